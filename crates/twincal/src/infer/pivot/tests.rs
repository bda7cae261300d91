//! Moments after an exchange against those of a tableau that walked there.

use crate::infer::kin::Step;
use crate::infer::moments::{Covariance, Moments, after_exchange, after_flip, present};
use crate::infer::standard::Standard;
use crate::infer::testing::grouped;
use crate::infer::walker::Walker;

/// Every flip of a random walk, and every exchange that it passes, of one component for one or two.
#[test]
fn the_moments_are_those_of_the_model_after_the_walk() {
    let problem = grouped(2, &[3, 1, 2, 10, 1, 4], 60, true).problem;
    let standard = Standard::new(&problem).unwrap();
    let mut walker = Walker::new(&standard, &problem.prior);
    let blocks = standard.blocks.len();
    let (mut state, mut compared) = (99u64, 0);
    for _ in 0..60 {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        let block = (state >> 33) as usize % blocks;
        let (_, excess) = walker.flip_gain(block);
        let got = after_flip(&walker, block, excess, true);
        let size = standard.size();
        let beside = dense(&present(&walker, true).joint, size, &[]);
        let covariance = dense(&got.joint, size, &beside);
        walker.flip(block);
        let truth = present(&walker, true);
        alike(&got, &truth, &covariance, &Step::default());
        let (inside, outside): (Vec<usize>, Vec<usize>) =
            (0..blocks).partition(|&b| walker.tableau.holds(b));
        for &leaves in &inside {
            for entering in outside.windows(1).chain(outside.windows(2)) {
                let step = Step {
                    leaving: vec![leaves],
                    entering: entering.to_vec(),
                };
                compare(&mut walker, &step);
                compared += 1;
            }
        }
    }
    assert!(compared > 300, "{compared}");
}

fn compare(walker: &mut Walker<'_>, step: &Step) {
    let before = walker.log_weight();
    let (gain, excess, pivot) = walker.exchange_gain(step);
    let got = after_exchange(walker, step, &pivot, excess, true);
    walker.take(step);
    let (then, truth) = (walker.log_weight(), present(walker, true));
    let back = Step {
        leaving: step.entering.clone(),
        entering: step.leaving.clone(),
    };
    walker.take(&back);
    assert!(
        (before + gain - then).abs() < 1e-7 * (1.0 + then.abs()),
        "{step:?}: weight off by {}",
        before + gain - then
    );
    let beside = dense(&present(walker, true).joint, got.delta.len(), &[]);
    let covariance = dense(&got.joint, got.delta.len(), &beside);
    alike(&got, &truth, &covariance, step);
}

fn alike(got: &Moments, truth: &Moments, covariance: &[f64], step: &Step) {
    assert_eq!(got.holds, truth.holds, "{step:?}");
    let close = |a: f64, b: f64| (a - b).abs() < 1e-7 * (1.0 + b.abs());
    assert!(close(got.excess, truth.excess), "{step:?}: c");
    for k in 0..got.delta.len() {
        assert!(close(got.delta[k], truth.delta[k]), "{step:?}: mean of {k}");
        assert!(
            close(got.variance[k], truth.variance[k]),
            "{step:?}: variance of {k}, {} {}",
            got.variance[k],
            truth.variance[k]
        );
    }
    let size = got.delta.len();
    for (k, (a, b)) in covariance
        .iter()
        .zip(dense(&truth.joint, size, &[]))
        .enumerate()
    {
        let (i, j) = (k / size, k % size);
        assert!(close(*a, b), "{step:?}: covariance of {i} and {j}, {a} {b}");
    }
}

/// C of all positions; `beside`: that of the present model.
fn dense(joint: &Covariance, size: usize, beside: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; size * size];
    match joint {
        Covariance::Unknown => panic!("covariances were asked for"),
        Covariance::Whole { inside, entries } => {
            for (k, entry) in entries.iter().enumerate() {
                out[inside[k / inside.len()] * size + inside[k % inside.len()]] = *entry;
            }
        }
        Covariance::Beside {
            factors,
            at,
            halves,
        } => {
            out.copy_from_slice(beside);
            let rows: Vec<&[f64]> = halves.chunks_exact(factors.len()).collect();
            for (&i, x) in at.iter().zip(&rows) {
                for (&j, y) in at.iter().zip(&rows) {
                    let pairs = x.iter().zip(*y).zip(factors);
                    out[i * size + j] += pairs.map(|((x, y), f)| f * x * y).sum::<f64>();
                }
            }
        }
    }
    out
}
