//! Proof that the chain samples what it says: Geweke's joint-distribution test, simulation-based calibration, and the exact sum
//! where noise is known.

use super::chain::Chain;
use super::planted::{self, BUGS};
use super::target::{Noise, Target};
use crate::diagnostics::mcse_mean;
use crate::gram::{JointGram, Symmetric};
use crate::prior::{Inclusion, Prior};
use crate::random::Random;

const JOINTS: usize = 2;
const COLUMNS: usize = 6;
/// Rows of each run; every joint has two runs.
const RUN: usize = 6;

/// Six columns in four components: one free column, two free ones together, one bounded, two bounded together.
fn prior() -> Prior {
    Prior {
        parent: Vec::new(),
        halves: Vec::new(),
        slab: vec![1.0; COLUMNS],
        component: vec![0, 1, 1, 2, 3, 3],
        family: vec![0, 0, 1, 1],
        odds: vec![1.0, 0.7],
        lower: vec![
            f64::NEG_INFINITY,
            f64::NEG_INFINITY,
            f64::NEG_INFINITY,
            -0.3,
            0.0,
            0.0,
        ],
        inclusion: Inclusion::ExpectedTerms(2.0),
        shape: 3.0,
        scale: 2.0,
    }
}

/// Free columns only, two of them nearly the same: exchanges have something to do.
fn alike() -> Prior {
    Prior {
        component: vec![0, 1, 2, 3, 4, 4],
        family: vec![0; 5],
        odds: vec![1.0],
        lower: vec![f64::NEG_INFINITY; COLUMNS],
        ..prior()
    }
}

/// Columns of joint j in run r: RUN × COLUMNS; column 1 nearly repeats column 0, joint 0 has no column 5.
fn design() -> Vec<Vec<Vec<Vec<f64>>>> {
    let mut random = Random::new(11, 0);
    (0..JOINTS)
        .map(|joint| {
            (0..2)
                .map(|_| {
                    (0..RUN)
                        .map(|_| {
                            let mut x: Vec<f64> =
                                (0..COLUMNS).map(|_| 0.7 * random.normal()).collect();
                            x[1] = x[0] + 0.3 * x[1];
                            if joint == 0 {
                                x[5] = 0.0;
                            }
                            x
                        })
                        .collect()
                })
                .collect()
        })
        .collect()
}

/// All unknowns.
#[derive(Clone)]
struct Truth {
    holds: Vec<bool>,
    beta: Vec<f64>,
    noise: Noise,
}

/// [`prior`] with heredity: a free component needs a bounded one, that another bounded one, that a free one.
fn bound() -> Prior {
    Prior {
        parent: vec![Some(2), None, Some(3), Some(1)],
        ..prior()
    }
}

/// [`alike`] with heredity: exchanges part children from their parents.
fn alike_and_bound() -> Prior {
    Prior {
        parent: vec![None, None, Some(0), None, Some(1)],
        ..alike()
    }
}

/// A draw from the prior: urn (again until heredity allows the structure), slabs, inverse gamma, uniform.
fn from_prior(prior: &Prior, slab: &[f64], random: &mut Random, autoregressive: bool) -> Truth {
    let urn = |random: &mut Random| -> Vec<bool> {
        let (mut seen, mut inside) = (vec![0; prior.families()], vec![0; prior.families()]);
        let draw = |&family: &usize| {
            let (p, _) = prior.next(family, inside[family], seen[family]);
            let holds = random.uniform() < p;
            seen[family] += 1;
            inside[family] += usize::from(holds);
            holds
        };
        prior.family.iter().map(draw).collect()
    };
    let holds = loop {
        let holds = urn(random);
        let orphan = |c: usize| holds[c] && prior.parent_of(c).is_some_and(|p| !holds[p]);
        if !(0..holds.len()).any(orphan) {
            break holds;
        }
    };
    let beta = (0..slab.len())
        .map(|k| {
            if !holds[prior.component[k]] {
                return 0.0;
            }
            loop {
                let value = slab[k] * random.normal();
                if value >= prior.lower[k] {
                    return value;
                }
            }
        })
        .collect();
    let noise = Noise {
        variance: (0..JOINTS)
            .map(|_| random.inverse_gamma(prior.shape, prior.scale))
            .collect(),
        rho: (0..JOINTS)
            .map(|_| {
                if autoregressive {
                    2.0 * random.uniform() - 1.0
                } else {
                    0.0
                }
            })
            .collect(),
    };
    Truth { holds, beta, noise }
}

/// Statistics of rows drawn at the truth, added up row by row as their definition says.
fn simulate(design: &[Vec<Vec<Vec<f64>>>], truth: &Truth, random: &mut Random) -> Vec<JointGram> {
    design
        .iter()
        .enumerate()
        .map(|(joint, runs)| {
            let mut gram = JointGram::empty((0..COLUMNS as u32).collect());
            let (variance, rho) = (truth.noise.variance[joint], truth.noise.rho[joint]);
            for run in runs {
                let mut error = (variance / (1.0 - rho * rho)).sqrt() * random.normal();
                let mut before: Option<Vec<f64>> = None;
                for (t, x) in run.iter().enumerate() {
                    if t > 0 {
                        error = rho * error + variance.sqrt() * random.normal();
                    }
                    let torque: f64 = x.iter().zip(&truth.beta).map(|(x, b)| x * b).sum();
                    let mut row = x.clone();
                    row.push(torque + error);
                    gram.n += 1.0;
                    gram.s0.add_outer(&row);
                    if t == 0 {
                        gram.starts += 1.0;
                        gram.first.add_outer(&row);
                    }
                    if t == run.len() - 1 {
                        gram.last.add_outer(&row);
                    }
                    if let Some(before) = &before {
                        let step: Vec<f64> = row.iter().zip(before).map(|(a, b)| a - b).collect();
                        gram.d.add_outer(&step);
                    }
                    before = Some(row);
                }
            }
            gram
        })
        .collect()
}

fn target<'a>(grams: &'a [JointGram], prior: &'a Prior, at: &Noise, ar1: bool) -> Target<'a> {
    let noise = vec![(prior.shape, prior.scale); JOINTS];
    let slab = vec![1.0, 0.8, 1.2, 1.0, 0.9, 1.1];
    Target::new(grams, vec![0, 1], noise, ar1, slab, prior, at)
}

/// Functions of the unknowns with moments, whatever the tails: first and second order, and products across the blocks.
fn functions(truth: &Truth) -> Vec<f64> {
    let beta: Vec<f64> = truth.beta.iter().map(|b| b.tanh()).collect();
    let log: Vec<f64> = truth.noise.variance.iter().map(|v| v.ln()).collect();
    let mut g: Vec<f64> = truth
        .holds
        .iter()
        .map(|h| f64::from(u8::from(*h)))
        .collect();
    let number: f64 = g.iter().sum();
    g.extend([number, number * number, g[0] * g[1], g[2] * g[3]]);
    g.extend(&beta);
    g.extend(beta.iter().map(|b| b * b));
    g.extend([beta[0] * beta[1], beta[4] * beta[5], beta[2] * beta[3]]);
    for j in 0..JOINTS {
        let rho = truth.noise.rho[j];
        g.extend([log[j], log[j] * log[j], rho, rho * rho, rho * log[j]]);
        g.push(beta[0] * log[j]);
    }
    g
}

/// Geweke (2004): drawing unknowns from the prior, and walking from unknowns to data to unknowns, must give the same joint
/// law. The largest |z| over 35 functions; with 1e5 draws of each, 4 is exceeded with probability 2e-3 if they do.
fn geweke(prior: &Prior, ar1: bool, seed: u64, draws: usize) -> (f64, String) {
    let design = design();
    let slab = [1.0, 0.8, 1.2, 1.0, 0.9, 1.1];
    let mut random = Random::new(seed, 0);
    let direct: Vec<Vec<f64>> = (0..draws)
        .map(|_| functions(&from_prior(prior, &slab, &mut random, ar1)))
        .collect();
    let mut truth = from_prior(prior, &slab, &mut random, ar1);
    let mut walked = Vec::with_capacity(draws);
    for step in 0..draws {
        let grams = simulate(&design, &truth, &mut random);
        let target = target(&grams, prior, &truth.noise, ar1);
        let chain = Random::new(seed, 1 + step as u64);
        let mut chain =
            Chain::new(&target, truth.noise.clone(), truth.holds.clone(), chain).at(&truth.beta);
        if let Err(error) = chain.step() {
            return (f64::INFINITY, format!("transition {step}: {error}"));
        }
        truth = Truth {
            holds: chain.holds.clone(),
            beta: chain.beta.clone(),
            noise: chain.noise.clone(),
        };
        walked.push(functions(&truth));
    }
    let mut worst = (0.0, String::new());
    for f in 0..direct[0].len() {
        let of = |draws: &[Vec<f64>]| -> Vec<f64> { draws.iter().map(|g| g[f]).collect() };
        let (a, b) = (of(&direct), of(&walked));
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
        let error = |x: &[f64]| {
            let own = mcse_mean(&[x]);
            if own.is_nan() { 0.0 } else { own }
        };
        let z = (mean(&a) - mean(&b)) / error(&a).hypot(error(&b)).max(1e-12);
        // A walk that left for infinity has no error, and is seen.
        let z = if z.is_nan() { f64::INFINITY } else { z.abs() };
        if z > worst.0 {
            let what = format!("function {f}: {} and {}, z = {z:.2}", mean(&a), mean(&b));
            worst = (z, what);
        }
    }
    worst
}

#[test]
fn geweke_with_autocorrelation_and_bounds() {
    let (z, what) = geweke(&prior(), true, 21, 100_000);
    assert!(z < 4.0, "{what}");
}

#[test]
fn geweke_with_exchanges() {
    let (z, what) = geweke(&alike(), true, 22, 100_000);
    assert!(z < 4.0, "{what}");
}

#[test]
fn geweke_with_heredity() {
    for (prior, seed) in [(bound(), 24), (alike_and_bound(), 25)] {
        let (z, what) = geweke(&prior, true, seed, 100_000);
        assert!(z < 4.0, "{what}");
    }
}

#[test]
fn geweke_with_independent_rows() {
    let (z, what) = geweke(&prior(), false, 23, 100_000);
    assert!(z < 4.0, "{what}");
}

/// Every planted bug makes Geweke's test fail.
#[test]
fn planted_bugs_are_caught() {
    let caught = |bug: usize| {
        [prior(), alike()]
            .iter()
            .any(|prior| planted::with(bug, || geweke(prior, true, 24, 30_000)).0 > 4.0)
    };
    let missed: Vec<&str> = (0..BUGS.len())
        .filter(|&bug| !caught(bug))
        .map(|bug| BUGS[bug])
        .collect();
    assert!(missed.is_empty(), "{missed:?}");
}

/// Talts et al. (2018): the rank of the truth among its posterior draws is uniform. 1000 simulations, 99 draws each, 14
/// quantities; all empirical distribution functions within the simultaneous 99.9 % band of Dvoretzky, Kiefer & Wolfowitz
/// (with the constant of Massart), Bonferroni over the quantities.
#[test]
fn ranks_of_the_truth_are_uniform() {
    const SIMULATIONS: usize = 1000;
    const DRAWS: usize = 99;
    let (prior, design) = (prior(), design());
    let slab = [1.0, 0.8, 1.2, 1.0, 0.9, 1.1];
    let at: Vec<f64> = vec![0.9, -0.4, 0.5, 0.7, -0.3, 0.6];
    let quantities = |truth: &Truth, random: &mut Random| -> Vec<f64> {
        let mut all = truth.beta.clone();
        all.extend(&truth.noise.variance);
        all.extend(&truth.noise.rho);
        let torque: f64 = at.iter().zip(&truth.beta).map(|(x, b)| x * b).sum();
        for j in 0..JOINTS {
            let rho = truth.noise.rho[j];
            let sd = (truth.noise.variance[j] / (1.0 - rho * rho)).sqrt();
            all.extend([torque, torque + sd * random.normal()]);
        }
        all
    };
    let mut ranks: Vec<Vec<f64>> = vec![Vec::new(); COLUMNS + 4 * JOINTS];
    for simulation in 0..SIMULATIONS {
        let mut random = Random::new(31, simulation as u64);
        let truth = from_prior(&prior, &slab, &mut random, true);
        let grams = simulate(&design, &truth, &mut random);
        let start = from_prior(&prior, &slab, &mut random, true);
        let target = target(&grams, &prior, &start.noise, true);
        let own = quantities(&truth, &mut random);
        let stream = Random::new(32, simulation as u64);
        let mut chain =
            Chain::new(&target, start.noise.clone(), start.holds.clone(), stream).at(&start.beta);
        let mut below = vec![(0usize, 0usize); own.len()];
        for step in 0..200 + 12 * DRAWS {
            chain.step().unwrap();
            if step < 200 || step % 12 != 0 {
                continue;
            }
            let draw = Truth {
                holds: chain.holds.clone(),
                beta: chain.beta.clone(),
                noise: chain.noise.clone(),
            };
            let drawn = quantities(&draw, &mut random);
            for ((below, drawn), own) in below.iter_mut().zip(drawn).zip(&own) {
                below.0 += usize::from(drawn < *own);
                below.1 += usize::from(drawn == *own);
            }
        }
        // Ties (coefficients that are out) are broken at random.
        for (ranks, (below, equal)) in ranks.iter_mut().zip(below) {
            let rank = below as f64 + (random.uniform() * (equal + 1) as f64).floor();
            ranks.push((rank + random.uniform()) / (DRAWS + 1) as f64);
        }
    }
    let count = ranks.len() as f64;
    let band = ((2.0 * count / 1e-3f64).ln() / (2.0 * SIMULATIONS as f64)).sqrt();
    for (quantity, mut ranks) in ranks.into_iter().enumerate() {
        ranks.sort_by(f64::total_cmp);
        let n = ranks.len() as f64;
        let worst = ranks.iter().enumerate().fold(0.0f64, |worst, (i, r)| {
            worst
                .max((i as f64 / n - r).abs())
                .max(((i + 1) as f64 / n - r).abs())
        });
        assert!(
            worst < band,
            "quantity {quantity}: {worst:.4}, band {band:.4}"
        );
    }
}

/// Statistics of no rows: what comes out is the prior.
#[test]
fn without_rows_the_prior_comes_back() {
    let prior = prior();
    let grams: Vec<JointGram> = (0..JOINTS)
        .map(|_| JointGram {
            s0: Symmetric::zeros(COLUMNS + 1),
            ..JointGram::empty((0..COLUMNS as u32).collect())
        })
        .collect();
    let start = Noise {
        variance: vec![1.0; JOINTS],
        rho: vec![0.0; JOINTS],
    };
    let target = target(&grams, &prior, &start, true);
    let mut chain = Chain::new(&target, start, vec![false; 4], Random::new(41, 0));
    let mut held = [0.0; 4];
    const STEPS: usize = 40_000;
    for _ in 0..STEPS {
        chain.step().unwrap();
        for (held, inside) in held.iter_mut().zip(&chain.holds) {
            *held += f64::from(u8::from(*inside)) / STEPS as f64;
        }
    }
    // Two families of two: P(z = 1) of each component is that of the first one drawn.
    for (component, held) in held.into_iter().enumerate() {
        let (p, _) = prior.next(prior.family[component], 0, 0);
        // Autocorrelation below 5 steps; 5 standard errors, false alarm 6e-7 each.
        let error = (5.0 * p * (1.0 - p) / STEPS as f64).sqrt();
        assert!(
            (held - p).abs() < 5.0 * error,
            "component {component}: {held} and {p}"
        );
    }
}
