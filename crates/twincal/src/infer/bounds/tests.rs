//! Truncated posteriors against brute force.

use crate::infer::moments::log_normal_mass;
use crate::infer::testing::{grouped, normal, problem, sampled};
use crate::infer::{approximate, exact};
use crate::posterior::draws::draw;
use crate::posterior::{Posterior, Problem};
use crate::prior::{HalfSpace, Inclusion};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Everything truncated, by brute force: draws from every model's conjugate posterior, weighed by 1 if they keep the
/// bounds and by the slab's mass within them at their φ.
fn brute_force(problem: &Problem, draws: usize) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let mut free = problem.clone();
    free.prior.lower.fill(f64::NEG_INFINITY);
    let posterior = exact::enumerate(&free).unwrap();
    let size = problem.xy.len();
    let (mut total, mut pip) = (0.0, vec![0.0; size]);
    let (mut mean, mut second) = (vec![0.0; size], vec![0.0; size]);
    for model in &posterior.models {
        let alone = Posterior {
            models: vec![crate::posterior::Model {
                weight: 1.0,
                ..model.clone()
            }],
            ..posterior.clone()
        };
        let sample = draw(&alone, draws, 5, 2);
        for (beta, phi) in sample.beta.chunks_exact(size).zip(&sample.noise) {
            let keeps = model
                .members
                .iter()
                .all(|&k| beta[k as usize] >= problem.prior.lower[k as usize]);
            if !keeps {
                continue;
            }
            let mass: f64 = model
                .members
                .iter()
                .map(|&k| k as usize)
                .filter(|&k| problem.prior.lower[k] > f64::NEG_INFINITY)
                .map(|k| {
                    let sd = (phi * problem.prior.slab[k]).sqrt();
                    let t = problem.prior.lower[k] / sd;
                    0.5 * statrs::function::erf::erfc(t / 2f64.sqrt())
                })
                .product();
            let weight = model.weight / mass;
            total += weight;
            for &k in &model.members {
                let k = k as usize;
                pip[k] += weight;
                mean[k] += weight * beta[k];
                second[k] += weight * beta[k] * beta[k];
            }
        }
    }
    let share = |x: &[f64]| -> Vec<f64> { x.iter().map(|x| x / total).collect() };
    let (mean, second) = (share(&mean), share(&second));
    let sd = (0..size)
        .map(|k| (second[k] - mean[k] * mean[k]).max(0.0).sqrt())
        .collect();
    (share(&pip), mean, sd)
}

/// Bounds at 0 and a little below, some of them far above the free estimate, with and without heredity. 20 000 draws per model: a
/// standard error of 0.0035 of a PIP; EP and φ at its mean (60 rows) are allowed 0.03, and 0.15 sd for the mean.
#[test]
fn bounded_posteriors_equal_brute_force() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    type Case<'a> = (u64, &'a [usize], &'a [(usize, usize)]);
    let cases: [Case<'_>; 5] = [
        (1, &[2, 2, 1, 1], &[]),
        (2, &[1, 1, 1, 1, 1], &[]),
        (3, &[3, 1, 2], &[]),
        (1, &[2, 2, 1, 1], &[(2, 0), (3, 2)]),
        (2, &[1, 1, 1, 1, 1], &[(1, 0), (3, 2)]),
    ];
    for (seed, sizes, parents) in cases {
        let mut problem = grouped(seed, sizes, 60, false)
            .with_parents(parents)
            .problem;
        for k in 0..problem.xy.len() {
            problem.prior.lower[k] = match k % 3 {
                0 => 0.0,
                1 => -0.05 * normal(&mut rng).abs(),
                _ => f64::NEG_INFINITY,
            };
        }
        let (pip, mean, sd) = brute_force(&problem, 20_000);
        for (name, got) in [
            ("exact", exact::enumerate(&problem).unwrap()),
            ("search", approximate(&problem, None).unwrap()),
            ("gibbs", sampled(&problem)),
        ] {
            for k in 0..problem.xy.len() {
                let off = (got.inclusion[k] - pip[k]).abs();
                let allowed = if name == "gibbs" { 0.07 } else { 0.03 };
                assert!(
                    off < allowed,
                    "{name} {sizes:?} {parents:?}: PIP {k}: {} {}",
                    got.inclusion[k],
                    pip[k]
                );
                let off = (got.mean[k] - mean[k]).abs();
                assert!(
                    off < 0.15 * sd[k] + 0.002,
                    "{name} {sizes:?} {parents:?}: mean {k}: {} {}",
                    got.mean[k],
                    mean[k]
                );
            }
            let draws = draw(&got, 500, 1, 1);
            for beta in draws.beta.chunks_exact(problem.xy.len()) {
                for (b, l) in beta.iter().zip(&problem.prior.lower) {
                    assert!(b >= l, "{name}: {b} below {l}");
                }
            }
        }
    }
}

/// Bounds that are far away change no byte but for the slab's mass, which is 1.
#[test]
fn distant_bounds_change_nothing() {
    let problem = grouped(4, &[2, 1, 3, 1], 60, false).problem;
    let mut bounded = problem.clone();
    bounded.prior.lower.fill(-1e6);
    let (a, b) = (
        exact::enumerate(&problem).unwrap(),
        exact::enumerate(&bounded).unwrap(),
    );
    assert_eq!(a.inclusion, b.inclusion);
    assert_eq!(a.models, b.models);
}

/// One coefficient: with a bound at 0 its model counts by Φ(t)/½, evidence and probability in closed form. Also where the
/// effect has the wrong sign by hundreds of standard deviations, which no number holds without logarithms.
#[test]
fn one_bounded_coefficient_in_closed_form() {
    let mut problem = problem(4, 1, 2000, 0.0, Inclusion::Probability(0.2));
    let (gram, rows) = (problem.gram[0], problem.n);
    for score in [3.0, 0.5, -0.7, -3.0, -8.0, -40.0, -400.0, -4000.0] {
        // residual variance 1, least-squares estimate `score` standard errors from 0
        problem.xy[0] = score * gram.sqrt();
        problem.yy = rows + score * score;
        problem.prior.lower[0] = f64::NEG_INFINITY;
        let free = exact::enumerate(&problem).unwrap();
        problem.prior.lower[0] = 0.0;
        let got = exact::enumerate(&problem).unwrap();
        let by_search = approximate(&problem, None).unwrap();
        let pip = free.inclusion[0];
        let (mean, sd) = (free.mean[0] / pip, {
            let second = (free.sd[0].powi(2) + free.mean[0].powi(2)) / pip;
            (second - (free.mean[0] / pip).powi(2)).max(0.0).sqrt()
        });
        let odds_free = pip / (1.0 - pip);
        for (name, got) in [("exact", &got), ("search", &by_search)] {
            assert!(
                got.inclusion[0].is_finite() && got.mean[0].is_finite(),
                "{name} at {score}: {} {}",
                got.inclusion[0],
                got.mean[0]
            );
            if score.abs() < 5.0 {
                let factor = 2.0 * log_normal_mass(mean / sd).exp();
                let odds = odds_free * factor;
                let expected = odds / (1.0 + odds);
                let off = (got.inclusion[0] - expected).abs();
                assert!(off < 2e-3, "{name} at {score}: {off}");
                let grown = ((1.0 - pip) + pip * factor).ln();
                let off = got.log_evidence.unwrap() - free.log_evidence.unwrap() - grown;
                assert!(off.abs() < 5e-3, "{name} at {score}: evidence {off}");
            } else {
                assert!(
                    got.inclusion[0] < 0.05,
                    "{name} at {score}: {}",
                    got.inclusion[0]
                );
                let limit = free.log_evidence.unwrap() + 1.0;
                assert!(got.log_evidence.unwrap() < limit, "{name} at {score}");
            }
        }
    }
}

/// Two columns almost alike whose sum is wanted negative: taken as independent each is barely outside, together they are
/// impossible. The model without them must not be lost.
#[test]
fn alike_columns_on_the_wrong_side_are_left_out() {
    let mut problem = problem(4, 2, 4000, 0.0, Inclusion::Probability(0.2));
    let (a, rho) = (1000.0, 0.98);
    problem.gram = vec![a, rho * a, rho * a, a];
    // y = −0.5 (x₁ + x₂) + noise of variance 1
    let xy = -0.5 * a * (1.0 + rho);
    problem.xy = vec![xy, xy];
    problem.yy = problem.n + 0.5 * a * (1.0 + rho);
    problem.prior.slab = vec![1.0; 2];
    problem.prior.lower = vec![0.0; 2];
    for (name, got) in [
        ("exact", exact::enumerate(&problem).unwrap()),
        ("search", approximate(&problem, None).unwrap()),
    ] {
        let models: Vec<_> = got.models.iter().map(|m| (&m.members, m.weight)).collect();
        assert!(
            got.inclusion.iter().all(|pip| *pip < 0.2),
            "{name}: {:?} of {models:?}",
            got.inclusion
        );
    }
}

/// Bounds on sums: what both directions of Coulomb friction have to be, |a| ≤ c, with c in or out, a its child, and a third column
/// without bounds. Truth: draws of every model's conjugate posterior that keep them, over the slab's mass atan(s_c/s_a)/π. 40 000 draws
/// per model: a standard error of 0.0025 of a PIP; EP is allowed 0.03, and 0.15 sd for the mean.
#[test]
fn bounds_on_sums_equal_brute_force() {
    for seed in 1..6 {
        let mut problem = grouped(seed, &[1, 1, 1], 60, false)
            .with_parents(&[(1, 0)])
            .problem;
        problem.prior.lower[0] = 0.0;
        problem.prior.halves = [1.0, -1.0].map(|sign| both_ways(0, 1, sign)).to_vec();
        let Kept {
            total,
            pip,
            mean,
            second,
        } = kept_draws(&problem);
        for (name, got) in [
            ("exact", exact::enumerate(&problem).unwrap()),
            ("search", approximate(&problem, None).unwrap()),
            ("gibbs", sampled(&problem)),
        ] {
            for k in 0..3 {
                let (pip, mean) = (pip[k] / total, mean[k] / total);
                let sd = (second[k] / total - mean * mean).max(0.0).sqrt();
                let allowed = if name == "gibbs" { 0.07 } else { 0.03 };
                assert!(
                    (got.inclusion[k] - pip).abs() < allowed,
                    "{name} {seed}: PIP {k}: {} {pip}",
                    got.inclusion[k]
                );
                assert!(
                    (got.mean[k] - mean).abs() < 0.15 * sd + 0.002,
                    "{name} {seed}: mean {k}: {} {mean} ({sd})",
                    got.mean[k]
                );
            }
            for beta in draw(&got, 500, 1, 1).beta.chunks_exact(3) {
                assert!(beta[1].abs() <= beta[0] + 1e-12, "{name}: {beta:?}");
            }
        }
    }
}

/// Sums over the draws that keep |a| ≤ c, by weight: of 1, and by column of z, β and β².
#[derive(Default)]
struct Kept {
    total: f64,
    pip: [f64; 3],
    mean: [f64; 3],
    second: [f64; 3],
}

/// Draws of every model without bounds; c is column 0, a column 1.
fn kept_draws(problem: &Problem) -> Kept {
    let mut free = problem.clone();
    free.prior.lower[0] = f64::NEG_INFINITY;
    free.prior.halves.clear();
    let posterior = exact::enumerate(&free).unwrap();
    let mut kept = Kept::default();
    for model in &posterior.models {
        let alone = Posterior {
            models: vec![crate::posterior::Model {
                weight: 1.0,
                ..model.clone()
            }],
            ..posterior.clone()
        };
        let slab = &problem.prior.slab;
        let mass = match (model.members.contains(&0), model.members.contains(&1)) {
            (true, true) => (slab[0] / slab[1]).sqrt().atan() / std::f64::consts::PI,
            (true, false) => 0.5,
            _ => 1.0,
        };
        let draws = draw(&alone, 40_000, 5, 2);
        for beta in draws.beta.chunks_exact(3) {
            if beta[1].abs() <= beta[0] || (beta[0] >= 0.0 && !model.members.contains(&1)) {
                let weight = model.weight / mass;
                kept.total += weight;
                for &k in &model.members {
                    let k = k as usize;
                    kept.pip[k] += weight;
                    kept.mean[k] += weight * beta[k];
                    kept.second[k] += weight * beta[k] * beta[k];
                }
            }
        }
    }
    kept
}

/// A model that lacks the column without which a sum's other terms are 0 has no probability, however much the data ask for it.
#[test]
fn a_sum_without_its_first_term_is_forbidden() {
    let mut problem = problem(4, 2, 2000, 0.0, Inclusion::Probability(0.5));
    problem.xy = vec![0.0, 30.0 * problem.gram[3].sqrt()];
    problem.gram[1] = 0.0;
    problem.gram[2] = 0.0;
    problem.yy = problem.n + 900.0;
    problem.prior.lower[0] = 0.0;
    problem.prior.halves = [1.0, -1.0].map(|sign| both_ways(0, 1, sign)).to_vec();
    for got in [
        exact::enumerate(&problem).unwrap(),
        approximate(&problem, None).unwrap(),
    ] {
        let alone = got.models.iter().filter(|m| m.members == [1]);
        assert!(alone.map(|m| m.weight).sum::<f64>() < 1e-100);
        assert!(
            got.inclusion.iter().all(|p| p.is_finite()),
            "{:?}",
            got.inclusion
        );
    }
}

/// `β_own ± β_half ≥ 0`.
fn both_ways(own: usize, half: usize, sign: f64) -> HalfSpace {
    HalfSpace {
        terms: vec![(own, 1.0), (half, sign)],
        lower: 0.0,
        with: vec![vec![half]],
        replaces: Some(own),
        group: 0,
    }
}
