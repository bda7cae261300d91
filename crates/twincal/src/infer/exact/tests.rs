//! The tree against a plain loop over all models by another route: one Cholesky factorisation each, uncentred.

use super::*;
use crate::infer::testing::{Densities, Grouped, acting, grouped, problem};
use crate::linear_algebra::Cholesky;
use crate::prior::Inclusion;
use statrs::function::gamma::ln_gamma;

/// Everything that [`enumerate`] promises, by its definition.
struct Plain {
    inclusion: Vec<f64>,
    mean: Vec<f64>,
    sd: Vec<f64>,
    noise: f64,
    log_evidence: f64,
}

fn plain(problem: &Problem) -> Plain {
    let size = problem.xy.len();
    let sets = 0u32..1 << size;
    let models: Vec<PlainModel> = sets.map(|set| PlainModel::new(problem, set)).collect();
    let top = (models.iter().map(|m| m.log)).fold(f64::NEG_INFINITY, f64::max);
    let total: f64 = models.iter().map(|m| (m.log - top).exp()).sum();
    let mut out = Plain {
        inclusion: vec![0.0; size],
        mean: vec![0.0; size],
        sd: vec![0.0; size],
        noise: 0.0,
        log_evidence: top + total.ln(),
    };
    for model in &models {
        let w = (model.log - top).exp() / total;
        out.noise += w * model.phi;
        for (i, &k) in model.members.iter().enumerate() {
            out.inclusion[k] += w;
            out.mean[k] += w * model.mean[i];
            out.sd[k] += w * model.second[i];
        }
    }
    for k in 0..size {
        out.sd[k] = (out.sd[k] - out.mean[k] * out.mean[k]).sqrt();
    }
    out
}

/// One set of columns: log p(y, z), E[β], E[β²] and E[φ].
struct PlainModel {
    log: f64,
    members: Vec<usize>,
    mean: Vec<f64>,
    second: Vec<f64>,
    phi: f64,
}

impl PlainModel {
    fn new(problem: &Problem, set: u32) -> Self {
        let (size, prior) = (problem.xy.len(), &problem.prior);
        let shape = prior.shape + problem.n / 2.0;
        let members: Vec<usize> = (0..size).filter(|k| set >> k & 1 == 1).collect();
        let count = members.len();
        let mut a: Vec<f64> = members
            .iter()
            .flat_map(|&i| members.iter().map(move |&j| problem.gram[i * size + j]))
            .collect();
        (0..count).for_each(|i| a[i * count + i] += 1.0 / prior.slab[members[i]]);
        let factor = Cholesky::new(&a, count).unwrap();
        let mut mean: Vec<f64> = members.iter().map(|&k| problem.xy[k]).collect();
        factor.solve(&mut mean);
        let explained = members.iter().zip(&mean).map(|(&k, m)| problem.xy[k] * m);
        let rss = problem.yy - explained.sum::<f64>();
        let scale = prior.scale + rss / 2.0;
        let mut families = vec![0; prior.families()];
        members
            .iter()
            .for_each(|&k| families[prior.family_of(k)] += 1);
        let slabs: f64 = members.iter().map(|&k| prior.slab[k].ln()).sum();
        let log = prior.log_model(&families) + problem.log_constant
            - problem.n / 2.0 * (2.0 * std::f64::consts::PI).ln()
            + prior.shape * prior.scale.ln()
            - ln_gamma(prior.shape)
            + ln_gamma(shape)
            - slabs / 2.0
            - factor.log_determinant() / 2.0
            - shape * scale.ln();
        let phi = scale / (shape - 1.0);
        let inverse = factor.inverse();
        let second: Vec<f64> = (0..count)
            .map(|i| mean[i] * mean[i] + phi * inverse[i * count + i])
            .collect();
        Self {
            log,
            members,
            mean,
            second,
            phi,
        }
    }
}

fn agree(problem: &Problem, tolerance: f64) {
    let (a, b) = (enumerate(problem).unwrap(), plain(problem));
    let close = |x: f64, y: f64, unit: f64, what: &str| {
        assert!((x - y).abs() <= tolerance * unit, "{what}: {x} and {y}");
    };
    for k in 0..problem.xy.len() {
        close(a.inclusion[k], b.inclusion[k], 1.0, "inclusion");
        close(a.mean[k], b.mean[k], b.mean[k].abs() + b.sd[k], "mean");
        close(a.sd[k], b.sd[k], 1e3 * b.sd[k], "sd");
    }
    close(a.noise, b.noise, b.noise, "noise");
    close(
        a.log_evidence.unwrap(),
        b.log_evidence,
        1.0 + b.log_evidence.abs(),
        "log evidence",
    );
    let listed: f64 = a.models.iter().map(|m| m.weight).sum();
    assert!((listed - 1.0).abs() < 1e-12);
    assert!(
        a.models
            .windows(2)
            .all(|pair| pair[0].weight >= pair[1].weight)
    );
    let all = 1usize << problem.xy.len();
    assert!(a.models.len() == all.min(LISTED_MODELS) || a.models_mass >= LISTED_MASS);
}

#[test]
fn the_tree_equals_the_plain_loop() {
    for size in 0..=11 {
        for (seed, inclusion) in [
            (1, Inclusion::Probability(0.3)),
            (2, Inclusion::ExpectedTerms(0.4 * size as f64)),
        ] {
            if size == 0 && seed == 2 {
                continue;
            }
            for correlation in [0.0, 0.9] {
                agree(
                    &problem(size as u64 * 10 + seed, size, 60, correlation, inclusion),
                    1e-10,
                );
            }
        }
    }
}

#[test]
fn listed_models_carry_their_own_posterior() {
    let problem = problem(5, 6, 50, 0.5, Inclusion::Probability(0.5));
    let posterior = enumerate(&problem).unwrap();
    let mean: Vec<f64> = (0..6u32)
        .map(|k| {
            let at = |m: &crate::posterior::Model| {
                m.members
                    .iter()
                    .position(|&j| j == k)
                    .map_or(0.0, |i| m.weight * m.mean[i])
            };
            posterior.models.iter().map(at).sum()
        })
        .collect();
    for (k, mean) in mean.iter().enumerate() {
        assert!(
            (mean - posterior.mean[k]).abs() < 1e-5 * posterior.sd[k].max(1e-9),
            "{k}"
        );
    }
    for model in &posterior.models {
        let m = model.members.len();
        for (i, &ki) in model.members.iter().enumerate() {
            for (j, &kj) in model.members.iter().enumerate() {
                let product: f64 = (0..m)
                    .map(|l| model.factor[i * m + l] * model.factor[j * m + l])
                    .sum();
                let slab = if i == j {
                    1.0 / problem.prior.slab[ki as usize]
                } else {
                    0.0
                };
                let expected = problem.gram[ki as usize * 6 + kj as usize] + slab;
                assert!((product - expected).abs() < 1e-12 * (1.0 + expected.abs()));
            }
        }
    }
}

#[test]
fn case_86_an_all_zero_column_keeps_its_prior() {
    let mut problem = problem(8, 7, 40, 0.3, Inclusion::Probability(0.25));
    (0..7).for_each(|k| {
        problem.gram[k * 7 + 2] = 0.0;
        problem.gram[2 * 7 + k] = 0.0;
    });
    problem.xy[2] = 0.0;
    for slab in [1.0, f64::INFINITY] {
        problem.prior.slab[2] = slab;
        let posterior = enumerate(&problem).unwrap();
        assert!((posterior.inclusion[2] - 0.25).abs() < 1e-12 && posterior.mean[2] == 0.0);
        assert!(
            posterior
                .inclusion
                .iter()
                .chain(&posterior.sd)
                .all(|x| x.is_finite())
        );
    }
}

#[test]
fn case_87_a_zero_residual_has_nothing_to_correct() {
    let mut silent = problem(8, 7, 40, 0.3, Inclusion::Probability(0.25));
    silent.yy = 0.0;
    silent.xy.fill(0.0);
    for scale in [1e-3, 0.0] {
        silent.prior.scale = scale;
        let posterior = enumerate(&silent).unwrap();
        assert!(
            posterior.inclusion.iter().all(|p| (0.0..0.25).contains(p)),
            "{:?}",
            posterior.inclusion
        );
        assert!(
            posterior.mean.iter().all(|&m| m == 0.0) && posterior.log_evidence.unwrap().is_finite()
        );
        assert!(posterior.sd.iter().all(|x| x.is_finite()));
    }
}

/// Columns that agree to the last digit, on a log without noise and with a slab that is no help: any split between them
/// is as good, their sum is told.
#[test]
fn equal_columns_share_their_coefficient() {
    for (slab, noise) in [(10.0, 1e-2), (2e9, 1e-9), (2e9, 0.0)] {
        let mut problem = problem(8, 6, 400, 0.3, Inclusion::Probability(0.25));
        problem.prior.slab.fill(slab);
        // Column 4 is column 1; the torque is 0.5 of it.
        for k in 0..6 {
            let value = problem.gram[k * 6 + 1];
            problem.gram[k * 6 + 4] = value;
        }
        for k in 0..6 {
            let value = problem.gram[6 + k];
            problem.gram[4 * 6 + k] = value;
        }
        problem.xy = (0..6).map(|k| 0.5 * problem.gram[k * 6 + 1]).collect();
        problem.yy = 0.25 * problem.gram[7] + 400.0 * noise * noise;
        problem.prior.scale = 1e-6;
        let sampled = crate::infer::testing::sampled(&problem);
        for posterior in [enumerate(&problem).unwrap(), sampled] {
            let all = posterior.mean.iter().chain(&posterior.sd);
            assert!(all.chain(&posterior.inclusion).all(|x| x.is_finite()));
            assert!((posterior.mean[1] + posterior.mean[4] - 0.5).abs() < 1e-3);
            let either = posterior.inclusion[1].max(posterior.inclusion[4]);
            assert!(either > 0.4, "{:?}", posterior.inclusion);
        }
    }
}

/// Columns that depend on each other under a slab 1e30 standard errors wide have no digit left: an error, not a NaN.
#[test]
fn a_slab_without_end_is_refused_by_name() {
    let mut problem = problem(8, 24, 10, 0.99, Inclusion::Probability(0.5));
    problem.prior.slab.fill(1e60);
    let settings = crate::infer::InferenceSettings {
        method: crate::infer::Choice::Exact,
        chains: 4,
        draws: 100,
        seed: 1,
        allow_disagreement: true,
    };
    let error = crate::infer::infer(&problem, &settings)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("posterior mean") && error.contains("`x"),
        "{error}"
    );
}

#[test]
fn case_88_more_columns_than_rows() {
    agree(&problem(9, 8, 4, 0.0, Inclusion::ExpectedTerms(2.0)), 1e-9);
    agree(&problem(9, 10, 2, 0.5, Inclusion::ExpectedTerms(2.0)), 1e-9);
}

/// One row: φ has no mean, so that standard deviations are infinite; probabilities and means are not.
#[test]
fn a_single_row() {
    let problem = problem(9, 5, 1, 0.0, Inclusion::Probability(0.3));
    for posterior in [
        enumerate(&problem).unwrap(),
        crate::infer::testing::sampled(&problem),
    ] {
        assert!(posterior.inclusion.iter().all(|p| (0.0..=1.0).contains(p)));
        assert!(posterior.mean.iter().all(|x| x.is_finite()));
        assert!(
            posterior.sd.iter().all(|x| *x == f64::INFINITY) && posterior.noise == f64::INFINITY
        );
    }
}

#[test]
fn no_column_at_all() {
    let empty = enumerate(&problem(1, 0, 30, 0.0, Inclusion::Probability(0.5))).unwrap();
    assert_eq!((empty.models.len(), empty.models_mass), (1, 1.0));
}

/// The units of columns and torque change nothing but the units of the answer.
#[test]
fn case_89_units_do_not_matter() {
    let problem = problem(21, 8, 50, 0.6, Inclusion::ExpectedTerms(2.0));
    let expected = enumerate(&problem).unwrap();
    for torque in [1e-9, 1.0, 3e7] {
        let unit: Vec<f64> = (0..8)
            .map(|k| [1e-12, 7e-5, 1.0, 1e12, 3e3, 1e-6, 2e9, 0.1][k])
            .collect();
        let mut scaled = problem.clone();
        for i in 0..8 {
            for j in 0..8 {
                scaled.gram[i * 8 + j] *= unit[i] * unit[j];
            }
            scaled.xy[i] *= unit[i] * torque;
            scaled.prior.slab[i] /= unit[i] * unit[i];
        }
        scaled.yy *= torque * torque;
        scaled.prior.scale *= torque * torque;
        let got = enumerate(&scaled).unwrap();
        for k in 0..8 {
            assert!((got.inclusion[k] - expected.inclusion[k]).abs() < 1e-11);
            let factor = unit[k] / torque;
            assert!(
                (got.mean[k] * factor - expected.mean[k]).abs() < 1e-10 * expected.mean[k].abs()
            );
            assert!((got.sd[k] * factor - expected.sd[k]).abs() < 1e-9 * expected.sd[k]);
        }
        let moved = got.log_evidence.unwrap() + problem.n * f64::ln(torque);
        assert!((moved - expected.log_evidence.unwrap()).abs() < 1e-9 * moved.abs());
    }
}

/// A noise-free log: the residual is 1e-9 of the torque, which `yy − rᵀA⁻¹r` cannot see.
#[test]
fn an_almost_perfect_fit_keeps_its_digits() {
    let exact = problem(31, 6, 80, 0.5, Inclusion::Probability(0.5));
    let mut shrunk = exact.clone();
    // y' = 1e9·Xβ + y: the data part beyond Xβ is unchanged; slabs so wide that shrinkage does not matter.
    let beta: Vec<f64> = (0..6)
        .map(|k| if k < 3 { 1e6 * (k as f64 + 1.0) } else { 0.0 })
        .collect();
    let product: Vec<f64> = (0..6)
        .map(|i| (0..6).map(|j| exact.gram[i * 6 + j] * beta[j]).sum())
        .collect();
    let cross: f64 = (0..6)
        .map(|k| 2.0 * beta[k] * exact.xy[k] + beta[k] * product[k])
        .sum();
    shrunk.yy += cross;
    (0..6).for_each(|k| shrunk.xy[k] += product[k]);
    shrunk.prior.slab.fill(1e14);
    let posterior = enumerate(&shrunk).unwrap();
    for k in 0..6 {
        assert!(posterior.sd[k] > 0.0 && posterior.sd[k].is_finite());
        if k < 3 {
            assert!(
                (posterior.mean[k] / beta[k] - 1.0).abs() < 1e-6
                    && posterior.inclusion[k] > 1.0 - 1e-12
            );
            assert!(posterior.sd[k] < 1.0, "{}", posterior.sd[k]);
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let problem = problem(3, 18, 100, 0.7, Inclusion::ExpectedTerms(5.0));
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| enumerate(&problem).unwrap())
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(5));
    assert_eq!(one.models.len(), LISTED_MODELS.min(one.models.len()));
}

#[test]
fn the_list_holds_the_heaviest_of_all() {
    let (size, rows) = (12, 30);
    let problem = problem(4, size, rows, 0.8, Inclusion::Probability(0.5));
    let posterior = enumerate(&problem).unwrap();
    let standard = Standard::new(&problem).unwrap();
    let mut all: Vec<(f64, Vec<u32>)> = (0u32..1 << size)
        .map(|set| {
            let members: Vec<usize> = (0..size).filter(|d| set >> d & 1 == 1).collect();
            let model = standard.model(&members, 1.0).unwrap();
            let log_slabs: f64 = model
                .members
                .iter()
                .map(|&k| problem.prior.slab[k as usize].ln())
                .sum();
            let count = model.members.len();
            let log_factor: f64 = (0..count).map(|i| model.factor[i * count + i].ln()).sum();
            (
                -(0.5 * log_slabs + log_factor + posterior.shape * model.scale.ln()),
                model.members,
            )
        })
        .collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (listed, (log, members)) in posterior.models.iter().zip(&all) {
        let ratio = (log - all[0].0).exp();
        assert!(
            (listed.weight / posterior.models[0].weight - ratio).abs() < 1e-9,
            "{members:?}"
        );
    }
}

/// With strong effects the tree does not branch on them; the plain loop, which visits every model, agrees all the same.
#[test]
fn certain_columns_change_nothing() {
    for size in [3, 6, 9, 11] {
        for (seed, inclusion) in [
            (3, Inclusion::Probability(0.3)),
            (4, Inclusion::ExpectedTerms(0.4 * size as f64)),
        ] {
            let problem = problem(size as u64 * 10 + seed, size, 3000, 0.5, inclusion);
            let standard = Standard::new(&problem).unwrap();
            let certain = certain::components(&standard, &problem, None);
            let count = certain.sure.iter().filter(|c| **c).count();
            assert!(count >= 1 && count < size, "{count} of {size} are certain");
            let (mut order, first) = certainty::order(&problem.prior, &certain);
            assert!(first == count && order[..count].iter().all(|&c| certain.sure[c]));
            order.sort_unstable();
            assert!(order.into_iter().eq(0..size));
            agree(&problem, 1e-9);
            same_with_what_is_near(&standard, &problem, &certain);
        }
    }
}

/// A known posterior gives the same answer, by the weight of its heaviest model.
#[track_caller]
fn same_with_what_is_near(standard: &Standard, problem: &Problem, certain: &certainty::Certain) {
    let near = enumerate(problem).unwrap();
    certain::components(standard, problem, Some(&near)).is_like(certain);
    let weight = certain::weight_of_heaviest(standard, problem, &near).unwrap();
    let truth = near.log_evidence.unwrap() + (near.models[0].weight * near.models_mass).ln();
    let off = standard.log_evidence(weight) - truth;
    assert!(off.abs() < 1e-9 * truth.abs().max(1.0), "{off}");
}

/// Components of several columns, in three families with odds, two of them nearly alike, columns lying apart.
#[test]
fn components_equal_multivariate_t_densities() {
    let cases: [&[usize]; 7] = [
        &[1, 2],
        &[6, 4, 1],
        &[2, 2, 1, 4, 1],
        &[10, 10, 1, 1, 4, 6, 1, 2],
        &[4, 4, 4, 4],
        &[1, 1, 1, 6],
        &[2, 1, 1, 1, 2, 1, 1, 1, 1],
    ];
    for (seed, sizes) in cases.iter().enumerate() {
        for (rows, interleaved) in [(30, false), (45, true), (7, true)] {
            let data = grouped(seed as u64, sizes, rows, interleaved);
            agrees_with_densities(&data, &format!("{sizes:?} {rows}"));
        }
    }
}

/// Heredity: children before and after their parents, chains, several children, in lanes and below, of one column and of more.
#[test]
fn heredity_equals_multivariate_t_densities() {
    type Case<'a> = (&'a [usize], &'a [(usize, usize)]);
    let cases: [Case<'_>; 6] = [
        (&[1, 2], &[(1, 0)]),
        (&[1; 8], &[(0, 7), (6, 1), (2, 1), (5, 2)]),
        (&[2, 2, 1, 4, 1], &[(0, 4), (4, 3), (1, 3)]),
        (&[1; 10], &[(9, 0), (0, 5), (5, 2), (2, 8)]),
        (&[1, 6, 1, 1, 1, 4, 1], &[(1, 0), (0, 2), (3, 5), (4, 5)]),
        (&[1; 7], &[(0, 1), (2, 1), (3, 1), (4, 1), (5, 1)]),
    ];
    for (seed, (sizes, pairs)) in cases.into_iter().enumerate() {
        let orphans = |set: u64| {
            let orphan = |&&(c, p): &&(usize, usize)| set >> c & 1 == 1 && set >> p & 1 == 0;
            pairs.iter().filter(orphan).count()
        };
        let models = (0..1 << sizes.len())
            .filter(|&set| orphans(set) == 0)
            .count() as u64;
        for rows in [7, 40] {
            let data = grouped(60 + seed as u64, sizes, rows, true).with_parents(pairs);
            agrees_with_densities(&data, &format!("{sizes:?} {pairs:?} {rows}"));
            let method = enumerate(&data.problem).unwrap().method;
            assert_eq!(method, Method::Exact { models });
        }
    }
    let sizes = [10, 6, 4, 4, 1, 6, 1, 4];
    let data = acting(3, &sizes, 150, true, 2.0).with_parents(&[(0, 4), (3, 6), (7, 2), (5, 3)]);
    agrees_with_densities(&data, "with certain components");
}

/// The same where the child is decided first and neither is in the lanes (the first three that are open, at most), in tasks and
/// above them, beside what is certain: only the set of what is in tells the parent that it may not stay out.
#[test]
fn no_parent_stays_out_below_its_child() {
    let chain: Vec<(usize, usize)> = (3..17).map(|c| (c, c + 1)).collect();
    let long = [&[3, 3, 3, 2][..], &[1; 14]].concat();
    let cases = [
        grouped(80, &[3, 3, 3, 2, 1], 40, true).with_parents(&[(3, 4)]),
        grouped(81, &[5, 5, 5, 4, 3, 2], 40, true).with_parents(&[(3, 4), (4, 5)]),
        grouped(82, &[4, 4, 4, 2, 2, 1], 40, true).with_parents(&[(0, 5), (3, 5), (4, 5)]),
        grouped(83, &long, 20, true).with_parents(&chain),
        acting(3, &[10, 6, 4, 4, 1, 6, 1, 4], 150, true, 2.0).with_parents(&[(2, 4), (7, 4)]),
    ];
    for (number, data) in cases.iter().enumerate() {
        let prior = &data.problem.prior;
        let standard = Standard::new(&data.problem).unwrap();
        let sure = certain::components(&standard, &data.problem, None);
        let (order, certain) = certainty::order(prior, &sure);
        assert_eq!(certain > 0, number == 4);
        let below = &order[certain + 3..];
        let before = |(place, &parent): (usize, &usize)| {
            let child = |&c: &usize| prior.parent_of(c) == Some(parent);
            below[..place].iter().any(child)
        };
        assert!(below.iter().enumerate().any(before), "{number}: {order:?}");
        agrees_with_densities(data, &number.to_string());
    }
}

#[track_caller]
fn agrees_with_densities(data: &Grouped, what: &str) {
    let prior = &data.problem.prior;
    let (got, truth) = (enumerate(&data.problem).unwrap(), Densities::new(data));
    for k in 0..data.problem.xy.len() {
        let pip = truth.pip[data.problem.prior.component[k]];
        assert!((got.inclusion[k] - pip).abs() < 1e-9, "{what}: PIP {k}");
        let off = (got.mean[k] - truth.mean[k]).abs();
        assert!(off < 1e-8 * truth.sd[k], "{what}: mean {k}");
        let off = (got.sd[k] / truth.sd[k] - 1.0).abs();
        assert!(off < 1e-6, "{what}: sd {k}");
    }
    let off = got.log_evidence.unwrap() - truth.log_evidence;
    assert!(off.abs() < 1e-9 * truth.log_evidence.abs(), "{off}");
    for model in &got.models {
        let holds = |c: usize| {
            let k = data.problem.prior.component.iter().position(|&d| d == c);
            k.is_some_and(|k| model.members.contains(&(k as u32)))
        };
        let set: usize = (0..prior.components())
            .filter(|&c| holds(c))
            .map(|c| 1 << c)
            .sum();
        let off = model.weight * got.models_mass - truth.weights[set];
        assert!(off.abs() < 1e-9, "{what}: model {set:b}");
    }
}

/// With much data some components are certain; more than 32 columns; the densities visit every set all the same.
#[test]
fn certain_components_change_nothing() {
    let sizes = [10, 6, 4, 4, 1, 6, 1, 4];
    let data = acting(3, &sizes, 150, true, 2.0);
    assert!(data.problem.xy.len() > 32);
    let standard = Standard::new(&data.problem).unwrap();
    let certain = certain::components(&standard, &data.problem, None);
    assert!(
        certain.sure.contains(&true) && certain.sure.contains(&false),
        "{certain:?}"
    );
    same_with_what_is_near(&standard, &data.problem, &certain);
    let (got, truth) = (enumerate(&data.problem).unwrap(), Densities::new(&data));
    for k in 0..data.problem.xy.len() {
        let pip = truth.pip[data.problem.prior.component[k]];
        assert!((got.inclusion[k] - pip).abs() < 1e-9, "PIP {k}");
        assert!(
            (got.mean[k] - truth.mean[k]).abs() < 1e-8 * truth.sd[k],
            "mean {k}"
        );
        assert!((got.sd[k] / truth.sd[k] - 1.0).abs() < 1e-6, "sd {k}");
    }
}
