//! The answer does not know the order of rows, joints and candidates, nor anybody's units.

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use twincal::gram::{Gram, JointAccumulator, JointGram, Workspace};
use twincal::infer::{Choice, InferenceSettings, infer};
use twincal::likelihood::{Columns, PlugIn, assemble};
use twincal::posterior::summary::summarise;
use twincal::posterior::{Posterior, Problem};
use twincal::prior::PriorSettings;
use twincal::signal::Auto;
use twincal::term::Family;

/// Rows of two joints with K columns each, `x[i * rows + row]`, and their residual torque.
#[derive(Debug, Clone)]
struct Data {
    columns: usize,
    rows: usize,
    x: [Vec<f64>; 2],
    y: [Vec<f64>; 2],
}

fn data() -> impl Strategy<Value = Data> {
    (2..6_usize, 8..40_usize).prop_flat_map(|(columns, rows)| {
        let x = prop::collection::vec(-1.0..1.0_f64, columns * rows);
        let noise = prop::collection::vec(-1.0..1.0_f64, rows);
        ([x.clone(), x], [noise.clone(), noise]).prop_map(move |(x, noise)| {
            // The first column acts weakly, so that no probability is 0 or 1.
            let y = [0, 1].map(|j| {
                (0..rows)
                    .map(|r| 0.4 * x[j][r] + 0.7 * noise[j][r])
                    .collect()
            });
            Data {
                columns,
                rows,
                x,
                y,
            }
        })
    })
}

impl Data {
    /// Statistics of one joint, the rows in this order.
    fn gram(&self, joint: usize, rows: &[usize]) -> JointGram {
        let pick = |values: &[f64]| -> Vec<f64> { rows.iter().map(|&row| values[row]).collect() };
        let x: Vec<f64> = self.x[joint].chunks(self.rows).flat_map(pick).collect();
        let mut sums = JointAccumulator::new((0..self.columns as u32).collect());
        sums.push_block(
            &x,
            rows.len(),
            &pick(&self.y[joint]),
            &vec![true; rows.len()],
            true,
            &mut Workspace::default(),
        );
        sums.finish()
    }

    fn grams(&self) -> Gram {
        let all: Vec<usize> = (0..self.rows).collect();
        Gram {
            joints: vec![self.gram(0, &all), self.gram(1, &all)],
        }
    }

    fn problem(&self, gram: &Gram, weight: [f64; 2]) -> Problem {
        let columns = Columns {
            names: (0..self.columns).map(|k| format!("x{k}")).collect(),
            component: (0..self.columns).collect(),
            family: (0..self.columns).map(|k| k % 2).collect(),
            families: vec![Family::User, Family::Generic],
            prior_sd: vec![None; self.columns],
            lower: vec![f64::NEG_INFINITY; self.columns],
            forced: Vec::new(),
            parent: Vec::new(),
            second_choice: Vec::new(),
            one_motion: false,
            halves: Vec::new(),
        };
        let mut plug_in = PlugIn::start(2, 2, 30.0);
        plug_in.weight = weight.to_vec();
        let settings = PriorSettings {
            scaled_variance: Auto::Value(30.0),
            inclusion: None,
            noise: None,
            families: Vec::new(),
            forced: Vec::new(),
            heredity: None,
        };
        assemble(gram, &columns, &plug_in, &settings).expect("a possible prior")
    }
}

fn exact(problem: &Problem) -> Posterior {
    let settings = InferenceSettings {
        method: Choice::Exact,
        chains: 1,
        draws: 1,
        seed: 1,
        allow_disagreement: false,
    };
    infer(problem, &settings).expect("a posterior")
}

fn near(a: f64, b: f64, relative: f64) -> Result<(), TestCaseError> {
    prop_assert!(
        (a - b).abs() <= relative * (a.abs() + b.abs()) + 1e-12,
        "{a} and {b}"
    );
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None,
        rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn statistics_of_parts_add_up_to_those_of_the_whole(data in data(), at in any::<prop::sample::Index>()) {
        let cut = at.index(data.rows);
        let part = |rows: std::ops::Range<usize>, sums: &mut JointAccumulator| {
            let (x, y) = (&data.x[0][rows.start..], &data.y[0][rows.clone()]);
            let (keep, first) = (vec![true; rows.len()], rows.start == 0);
            sums.push_block(x, data.rows, y, &keep, first, &mut Workspace::default());
        };
        let mut first = JointAccumulator::new((0..data.columns as u32).collect());
        part(0..cut, &mut first);
        let (mut sum, open) = first.cut();
        let mut second = JointAccumulator::resume((0..data.columns as u32).collect(), open);
        part(cut..data.rows, &mut second);
        sum += &second.finish();
        let whole = &data.grams().joints[0];
        for rho in [0.0, 0.7, 0.999] {
            for (a, b) in sum.stationary(rho).values.iter().zip(&whole.stationary(rho).values) {
                prop_assert!((a - b).abs() < 1e-12 * data.rows as f64, "{a} and {b} at rho = {rho}");
            }
        }
        prop_assert_eq!((sum.n, sum.starts), (whole.n, whole.starts));
    }

    #[test]
    fn order_of_rows_and_joints_changes_nothing(data in data(), shuffle in any::<prop::sample::Index>()) {
        let turn = shuffle.index(data.rows);
        let mut rows: Vec<usize> = (0..data.rows).collect();
        rows.rotate_left(turn);
        rows.reverse();
        let gram = data.grams();
        let other = Gram { joints: vec![data.gram(1, &rows), data.gram(0, &rows)] };
        let (one, two) = (exact(&data.problem(&gram, [2.0, 0.5])), exact(&data.problem(&other, [0.5, 2.0])));
        for k in 0..data.columns {
            near(one.inclusion[k], two.inclusion[k], 1e-9)?;
            near(one.mean[k], two.mean[k], 1e-9)?;
        }
        near(one.log_evidence.unwrap(), two.log_evidence.unwrap(), 1e-10)?;
    }

    #[test]
    fn units_of_a_candidate_and_of_torque_change_only_units(data in data(), log_unit in -6.0..6.0_f64, log_torque in -3.0..3.0_f64) {
        let (unit, torque) = (10.0_f64.powf(log_unit), 10.0_f64.powf(log_torque));
        let mut scaled = data.clone();
        for joint in 0..2 {
            // Column 0 in another unit; torque (and so every column) in another one too.
            for (at, value) in scaled.x[joint].iter_mut().enumerate() {
                *value *= torque * if at < data.rows { unit } else { 1.0 };
            }
            scaled.y[joint].iter_mut().for_each(|value| *value *= torque);
        }
        let (one, two) = (exact(&data.problem(&data.grams(), [1.0, 1.0])), exact(&scaled.problem(&scaled.grams(), [1.0, 1.0])));
        for (k, (a, b)) in summarise(&one).iter().zip(summarise(&two)).enumerate() {
            let factor = if k == 0 { unit } else { 1.0 };
            near(a.pip, b.pip, 1e-8)?;
            near(a.mean, b.mean * factor, 1e-8)?;
            near(a.sd, b.sd * factor, 1e-8)?;
            for end in 0..2 {
                near(a.interval95[end], b.interval95[end] * factor, 1e-6)?;
            }
        }
        near(one.noise * torque * torque, two.noise, 1e-8)?;
    }

    #[test]
    fn order_of_candidates_permutes_the_answer(data in data()) {
        let problem = data.problem(&data.grams(), [1.0, 1.0]);
        let size = data.columns;
        let turned: Vec<usize> = (0..size).rev().collect();
        let mut other = problem.clone();
        for (a, &i) in turned.iter().enumerate() {
            other.xy[a] = problem.xy[i];
            other.prior.slab[a] = problem.prior.slab[i];
            other.prior.family[a] = problem.prior.family[i];
            for (b, &j) in turned.iter().enumerate() {
                other.gram[a * size + b] = problem.gram[i * size + j];
            }
        }
        let (one, two) = (exact(&problem), exact(&other));
        for (a, &i) in turned.iter().enumerate() {
            near(one.inclusion[i], two.inclusion[a], 1e-9)?;
            near(one.mean[i], two.mean[a], 1e-9)?;
            near(one.sd[i], two.sd[a], 1e-9)?;
        }
    }
}
