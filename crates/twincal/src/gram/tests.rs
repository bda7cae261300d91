//! Sums are compared with plain loops, the stationary form with a dense stationary covariance.

use super::*;
use crate::linear_algebra::Cholesky;
use crate::term::Recipes;
use proptest::prelude::*;

/// Numbers in (−1, 1) that look random, from a seed.
fn noise(seed: u64, len: usize) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    (0..len)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        })
        .collect()
}

/// Rows of one joint with masks and segment starts.
#[derive(Debug, Clone)]
struct Log {
    columns: usize,
    rows: usize,
    x: Vec<f64>,
    y: Vec<f64>,
    keep: Vec<bool>,
    starts: Vec<usize>,
}

impl Log {
    fn new(seed: u64, columns: usize, rows: usize, masked: bool) -> Self {
        let choice = noise(seed ^ 77, rows);
        Self {
            columns,
            rows,
            x: noise(seed, columns * rows),
            y: noise(seed ^ 5, rows),
            keep: choice.iter().map(|&c| !masked || c < 0.6).collect(),
            starts: (0..rows)
                .filter(|&r| r == 0 || (masked && choice[r].abs() < 0.05))
                .collect(),
        }
    }

    fn row(&self, r: usize) -> Vec<f64> {
        (0..self.columns)
            .map(|i| self.x[i * self.rows + r])
            .chain([self.y[r]])
            .collect()
    }

    /// Pushes rows `from..to` in blocks of `step`.
    fn push(&self, accumulator: &mut JointAccumulator, from: usize, to: usize, step: usize) {
        let mut cuts: Vec<usize> = (from..to)
            .step_by(step.max(1))
            .chain(self.starts.iter().copied())
            .collect();
        cuts.retain(|&c| (from..to).contains(&c));
        cuts.push(to);
        cuts.sort_unstable();
        cuts.dedup();
        let mut workspace = Workspace::default();
        for pair in cuts.windows(2) {
            let x = if self.columns == 0 {
                &[][..]
            } else {
                &self.x[pair[0]..]
            };
            let rows = pair[0]..pair[1];
            let first = self.starts.contains(&pair[0]);
            let (y, keep) = (&self.y[rows.clone()], &self.keep[rows]);
            accumulator.push_block(x, self.rows, y, keep, first, &mut workspace);
        }
    }

    fn gram(&self, step: usize) -> JointGram {
        let mut accumulator = JointAccumulator::new((0..self.columns as u32).collect());
        self.push(&mut accumulator, 0, self.rows, step);
        accumulator.finish()
    }

    /// Runs of kept rows between masks and segment starts.
    fn runs(&self) -> Vec<Vec<Vec<f64>>> {
        let mut runs: Vec<Vec<Vec<f64>>> = Vec::new();
        let mut open = false;
        for r in 0..self.rows {
            if !self.keep[r] {
                open = false;
                continue;
            }
            if !open || self.starts.contains(&r) {
                runs.push(Vec::new());
            }
            runs.last_mut().unwrap().push(self.row(r));
            open = true;
        }
        runs
    }
}

fn close(a: &Symmetric, b: &Symmetric, scale: f64) -> bool {
    a.size == b.size
        && a.values
            .iter()
            .zip(&b.values)
            .all(|(x, y)| (x - y).abs() <= 1e-14 * scale)
}

/// The definition, written as four loops.
fn plain(log: &Log) -> JointGram {
    let mut gram = JointGram::empty((0..log.columns as u32).collect());
    for run in log.runs() {
        gram.starts += 1.0;
        gram.n += run.len() as f64;
        run.iter().for_each(|row| gram.s0.add_outer(row));
        for pair in run.windows(2) {
            let step: Vec<f64> = pair[1].iter().zip(&pair[0]).map(|(b, a)| b - a).collect();
            gram.d.add_outer(&step);
        }
        gram.first.add_outer(&run[0]);
        gram.last.add_outer(&run[run.len() - 1]);
    }
    gram
}

/// What is left is the statistics of the columns that are left, under their new numbers.
#[test]
fn columns_that_are_dropped_were_never_there() {
    let log = Log::new(3, 6, 400, true);
    let kept = [0, 2, 3, 5];
    let column = |i: &usize| &log.x[i * log.rows..(i + 1) * log.rows];
    let fewer = Log {
        columns: kept.len(),
        x: kept.iter().flat_map(column).copied().collect(),
        ..log.clone()
    };
    let mut gram = Gram {
        joints: vec![log.gram(37)],
    };
    gram.drop_columns(&[1, 4]);
    let (left, expected) = (&gram.joints[0], plain(&fewer));
    assert_eq!(left.columns, expected.columns);
    assert_eq!((left.n, left.starts), (expected.n, expected.starts));
    for (a, b) in [
        (&left.s0, &expected.s0),
        (&left.d, &expected.d),
        (&left.first, &expected.first),
        (&left.last, &expected.last),
    ] {
        assert!(close(a, b, 400.0));
    }
}

#[test]
fn statistics_equal_their_definition() {
    for (columns, rows) in [
        (0, 7),
        (1, 1),
        (2, 600),
        (3, 64),
        (5, 65),
        (6, 600),
        (9, 1000),
        (10, 513),
        (24, 300),
    ] {
        for masked in [false, true] {
            let log = Log::new(columns as u64 + 1, columns, rows, masked);
            let (a, b) = (log.gram(37), plain(&log));
            assert_eq!((a.n, a.starts, &a.columns), (b.n, b.starts, &b.columns));
            for (a, b) in [
                (&a.s0, &b.s0),
                (&a.d, &b.d),
                (&a.first, &b.first),
                (&a.last, &b.last),
            ] {
                assert!(
                    close(a, b, rows as f64),
                    "{columns} columns, {rows} rows, masked {masked}"
                );
            }
        }
    }
}

/// Tiles of all sizes, and sums whose lanes are many, few or one.
#[test]
fn instruction_sets_agree() {
    let mut others = vec![pulp::Arch::Scalar];
    #[cfg(target_arch = "x86_64")]
    others.extend(pulp::x86::V3::try_new().map(pulp::Arch::V3));
    for arch in others {
        for columns in 0..14 {
            let log = Log::new(columns as u64 + 1, columns, 600, true);
            let mut accumulator = JointAccumulator::new((0..columns as u32).collect());
            accumulator.arch = arch;
            log.push(&mut accumulator, 0, 600, 37);
            let (a, b) = (accumulator.finish(), plain(&log));
            assert!(close(&a.s0, &b.s0, 600.0), "{columns} columns, {arch:?}");
            assert!(close(&a.d, &b.d, 600.0), "{columns} columns, {arch:?}");
        }
    }
}

/// Blocks that are multiplied where they are have the bytes of those that waited.
#[test]
fn whole_blocks_equal_single_rows() {
    let log = Log::new(11, 7, 1000, false);
    assert_eq!(log.gram(1000), log.gram(1));
    assert_eq!(log.gram(super::tiles::BLOCK), log.gram(100));
}

/// Columns in the same places of a page are copied before they are multiplied; others are read where they are.
#[test]
fn distance_between_columns_does_not_matter() {
    let log = Log::new(13, 7, 1024, false);
    let distance = 1030;
    let apart = |column: &[f64]| [column, &vec![f64::NAN; distance - log.rows]].concat();
    let x: Vec<f64> = log.x.chunks(log.rows).flat_map(apart).collect();
    let mut accumulator = JointAccumulator::new((0..7).collect());
    let mut workspace = Workspace::default();
    accumulator.push_block(&x, distance, &log.y, &log.keep, true, &mut workspace);
    assert_eq!(accumulator.finish(), log.gram(log.rows));
}

/// `xᵀ C⁻¹ x` with the dense stationary covariance of several runs; the determinant too.
#[test]
fn stationary_form_equals_the_dense_covariance() {
    let log = Log::new(3, 2, 60, true);
    let gram = log.gram(60);
    assert!(gram.starts > 5.0);
    for rho in [-0.5, 0.0, 0.3, 0.9, 0.999] {
        let mut dense = Symmetric::zeros(3);
        let mut log_determinant = 0.0;
        for run in log.runs() {
            let n = run.len();
            let covariance: Vec<f64> = (0..n * n)
                .map(|k| f64::powi(rho, (k / n).abs_diff(k % n) as i32) / (1.0 - rho * rho))
                .collect();
            let factor = Cholesky::new(&covariance, n).unwrap();
            log_determinant -= 0.5 * factor.log_determinant();
            let mut columns: Vec<Vec<f64>> = (0..3)
                .map(|i| run.iter().map(|row| row[i]).collect())
                .collect();
            columns
                .iter_mut()
                .for_each(|column| factor.solve_lower(column));
            for t in 0..n {
                dense.add_outer(&[columns[0][t], columns[1][t], columns[2][t]]);
            }
        }
        let form = gram.stationary(rho);
        for (a, b) in form.values.iter().zip(&dense.values) {
            assert!(
                (a - b).abs() <= 1e-11 * (1.0 + b.abs()),
                "rho {rho}: {a} and {b}"
            );
        }
        let stated = 0.5 * gram.starts * (1.0 - rho * rho).ln();
        assert!(
            (stated - log_determinant).abs() < 1e-10,
            "rho {rho}: {stated} and {log_determinant}"
        );
    }
}

/// Other robots, other libraries, and sums that lost their shape on the way from a file.
#[test]
fn statistics_that_do_not_belong_together_are_refused_and_nothing_is_added() {
    let of = |columns: &[&[u32]]| Gram {
        joints: columns
            .iter()
            .map(|c| JointGram::empty(c.to_vec()))
            .collect(),
    };
    let mut sum = of(&[&[0, 1], &[1]]);
    sum.joints[0].n = 5.0;
    let mut damaged = of(&[&[0, 1], &[1]]);
    damaged.joints[1].d = Symmetric::zeros(1);
    let before = sum.clone();
    for (other, said) in [
        (of(&[&[0, 1]]), "of 1 joints, the others of 2"),
        (
            of(&[&[0, 1], &[1, 2]]),
            "joint 2 has 2 columns, the others 1",
        ),
        (of(&[&[0, 1], &[2]]), "joint 2 has other columns"),
        (damaged, "sums of joint 2 are not of its columns"),
    ] {
        let error = sum.try_merge(&other).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
        assert_eq!(sum, before);
    }
    let more = sum.clone();
    assert!(sum.try_merge(&more).is_ok() && sum.try_merge(&Gram::default()).is_ok());
    assert_eq!(sum.joints[0].n, 10.0);
    let mut none = Gram::default();
    assert!(none.try_merge(&sum).is_ok() && none == sum);
    // A joint without columns yet adopts the other's.
    let mut new = Gram {
        joints: vec![JointGram::default(); 2],
    };
    assert!(new.try_merge(&sum).is_ok() && new == sum);
}

#[test]
#[should_panic(expected = "matrices of different orders do not add")]
fn matrices_of_different_orders_are_never_cut_to_fit() {
    let mut sum = Symmetric::zeros(3);
    sum += &Symmetric::zeros(2);
}

#[test]
fn sums_of_robots_adopt_and_add() {
    let log = Log::new(9, 2, 50, false);
    let one = Gram {
        joints: vec![log.gram(50)],
    };
    let mut total = Gram::default();
    total += &one;
    total += &Gram::default();
    assert_eq!(total, one);
    total += &one;
    assert_eq!(total.joints[0].n, 100.0);
    assert_eq!(total.joints[0].s0.at(2, 1), 2.0 * one.joints[0].s0.at(1, 2));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Same bytes for any division into blocks.
    #[test]
    fn blocks_do_not_matter(seed in 1u64..1 << 40, columns in 0usize..12, rows in 1usize..700, step in 1usize..300) {
        let log = Log::new(seed, columns, rows, true);
        prop_assert_eq!(log.gram(step), log.gram(rows));
    }

    /// Cutting anywhere, also inside a run, and adding the parts changes nothing but rounding.
    #[test]
    fn cutting_changes_nothing(seed in 1u64..1 << 40, rows in 2usize..700, at in 0.0f64..1.0, masked: bool) {
        let log = Log::new(seed, 3, rows, masked);
        let at = (at * rows as f64) as usize;
        let mut head = JointAccumulator::new(vec![0, 1, 2]);
        log.push(&mut head, 0, at, rows);
        let (mut total, run) = head.cut();
        let mut tail = JointAccumulator::resume(vec![0, 1, 2], run);
        log.push(&mut tail, at, rows, rows);
        total += &tail.finish();
        let whole = log.gram(rows);
        prop_assert_eq!((total.n, total.starts), (whole.n, whole.starts));
        for (a, b) in [(&total.s0, &whole.s0), (&total.d, &whole.d), (&total.first, &whole.first), (&total.last, &whole.last)] {
            prop_assert!(close(a, b, rows as f64));
        }
    }

    /// Nor does it where parts are added up, inside a run or between runs: the second accumulator knows what the first one added.
    #[test]
    fn cutting_parts_changes_nothing(seed in 1u64..1 << 40, rows in 2usize..700, at in 0.0f64..1.0, masked: bool) {
        let log = Log::new(seed, 3, rows, masked);
        let at = (at * rows as f64) as usize;
        let recipes = Recipes::new(3, vec![vec![(0, 1.0), (2, -2.0)], vec![(1, 0.5)], vec![(1, 1.0), (2, 1.0)], vec![(0, 3.0)]]);
        let columns = vec![0, 1, 2, 3];
        let mut whole = JointAccumulator::of_parts(columns.clone(), &recipes);
        log.push(&mut whole, 0, rows, rows);
        let whole = whole.finish();
        let mut head = JointAccumulator::of_parts(columns.clone(), &recipes);
        log.push(&mut head, 0, at, rows);
        let (mut total, run) = head.cut();
        let mut tail = JointAccumulator::resume(columns, run);
        log.push(&mut tail, at, rows, rows);
        total += &tail.finish();
        prop_assert_eq!((total.n, total.starts), (whole.n, whole.starts));
        for (a, b) in [(&total.s0, &whole.s0), (&total.d, &whole.d), (&total.first, &whole.first), (&total.last, &whole.last)] {
            prop_assert!(close(a, b, 20.0 * rows as f64));
        }
    }

    /// Permuting columns permutes the statistics, bit by bit.
    #[test]
    fn permuting_columns_permutes(seed in 1u64..1 << 40, rows in 1usize..700) {
        let log = Log::new(seed, 6, rows, true);
        let order = [4usize, 0, 5, 2, 1, 3, 6];
        let mut permuted = log.clone();
        for (i, &k) in order[..6].iter().enumerate() {
            permuted.x[i * rows..(i + 1) * rows].copy_from_slice(&log.x[k * rows..(k + 1) * rows]);
        }
        let (a, b) = (log.gram(rows), permuted.gram(rows));
        for i in 0..7 {
            for j in 0..7 {
                prop_assert_eq!(b.s0.at(i, j), a.s0.at(order[i], order[j]));
                prop_assert_eq!(b.d.at(i, j), a.d.at(order[i], order[j]));
            }
        }
    }
}

/// Sums over parts, followed by the recipes, are the sums over columns: masked rows, several runs, blocks of any size; a column that
/// is nothing, one that is a part, one that stands for another.
#[test]
fn statistics_of_parts_are_those_of_columns() {
    let recipes = Recipes::new(
        4,
        vec![
            vec![(2, 1.0)],
            vec![(0, 0.5), (1, -2.0), (3, 7.0)],
            vec![],
            vec![(0, 0.5), (1, -2.0), (3, 7.0)],
            vec![(1, 1e3)],
            vec![(0, 1.0), (1, 1.0), (2, 1.0), (3, 1.0)],
        ],
    );
    for (seed, rows, step) in [(3, 900, 900), (4, 333, 17), (5, 1, 1), (6, 0, 1)] {
        let parts = Log::new(seed, 4, rows, true);
        let mut columns = parts.clone();
        columns.columns = 6;
        recipes.combine(&parts.x, rows, rows, &mut columns.x);
        let mut of_parts = JointAccumulator::of_parts((0..6).collect(), &recipes);
        parts.push(&mut of_parts, 0, rows, step);
        let mut of_columns = JointAccumulator::new((0..6).collect());
        columns.push(&mut of_columns, 0, rows, step);
        let (of_parts, expected) = (of_parts.finish(), of_columns.finish());
        assert_eq!(of_parts.columns, expected.columns);
        assert_eq!((of_parts.n, of_parts.starts), (expected.n, expected.starts));
        for (got, expected) in [
            (&of_parts.s0, &expected.s0),
            (&of_parts.d, &expected.d),
            (&of_parts.first, &expected.first),
            (&of_parts.last, &expected.last),
        ] {
            assert_eq!(got.size, 7);
            for i in 0..7 {
                for j in 0..7 {
                    let scale = (expected.at(i, i) * expected.at(j, j)).sqrt();
                    let off = (got.at(i, j) - expected.at(i, j)).abs();
                    assert!(off <= 1e-13 * scale, "seed {seed}, {i}, {j}: {off:e}");
                    assert_eq!(got.at(i, j).to_bits(), got.at(j, i).to_bits());
                }
            }
        }
    }
}
