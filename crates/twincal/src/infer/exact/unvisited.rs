//! What the tree does not visit does not count.

use super::sums::Layout;
use super::*;
use crate::infer::testing::{normal, problem};
use crate::prior::{Inclusion, Prior};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// What is left out weighs no more than is said, however much it is, with bounded columns, too; and where that is too much the tree is
/// walked again: a model that is made out to be e^30 times as heavy as it is costs nothing.
#[test]
fn what_is_not_visited_does_not_count() {
    let mut lossy = 0;
    for (seed, size, bounded) in [
        (21, 14, false),
        (22, 14, true),
        (23, 14, false),
        (24, 22, false),
    ] {
        let mut problem = problem(seed, size, 3000, 0.5, Inclusion::Probability(0.2));
        if bounded {
            (0..size).for_each(|k| problem.prior.lower[k] = [f64::NEG_INFINITY, 0.0][k % 2]);
        }
        let standard = Standard::new(&problem).unwrap();
        let reference = certain::components(&standard, &problem, None).reference;
        let sums = |reference| walk::sum_all_models(&standard, &problem.prior, 0, reference).0;
        let all = sums(f64::NEG_INFINITY);
        let layout = Layout::new(size);
        let weight = all[layout.weight()];
        assert!(
            weight.ln() - tree::LOG_REFERENCE >= reference - 1e-9,
            "one of them"
        );
        for least in [-15.0, -10.0, -5.0, 0.0, 5.0] {
            let (some, _, bound) = walk::sum_but(&standard, &problem.prior, 0, reference + least);
            let some = some[layout.weight()];
            let lost = 1.0 - some / weight;
            assert!(
                lost * weight <= bound * some + 1e-13 * weight,
                "{lost} {bound}"
            );
            lossy += usize::from(lost > 1e-10);
        }
        for most in [sums(reference), sums(reference + 30.0)] {
            for index in 0..layout.len() {
                let off = (most[index] - all[index]) / weight;
                assert!(off.abs() < 1e-10, "{index}: {off}");
            }
        }
    }
    assert!(lossy >= 14, "{lossy} walks lost something");
}

/// Two columns that are nearly alike stand below the lanes and above the last ones, and either explains what both do: without the first the
/// misfit at the full model's coefficients is enormous, and the other makes it good. Nothing may be concluded from that misfit.
#[test]
fn columns_that_stand_for_each_other_are_visited() {
    let (size, rows) = (18, 3000);
    let mut rng = ChaCha8Rng::seed_from_u64(31);
    let (mut gram, mut xy, mut yy) = (vec![0.0; size * size], vec![0.0; size], 0.0);
    for _ in 0..rows {
        let mut x: Vec<f64> = (0..size).map(|_| normal(&mut rng)).collect();
        x[8] = 0.999 * x[4] + 0.005 * x[8];
        let y = 5.0 * (x[4] + x[8]) + normal(&mut rng);
        for i in 0..size {
            xy[i] += x[i] * y;
            (0..size).for_each(|j| gram[i * size + j] += x[i] * x[j]);
        }
        yy += y * y;
    }
    let problem = Problem {
        gram,
        xy,
        yy,
        n: f64::from(rows),
        log_constant: 0.0,
        names: (0..size).map(|k| format!("x{k}")).collect(),
        prior: Prior::single(
            vec![100.0; size],
            vec![0; size],
            Inclusion::Probability(0.2),
            (1e-3, 1e-3),
        ),
    };
    let standard = Standard::new(&problem).unwrap();
    let reference = certain::components(&standard, &problem, None).reference;
    let shares = |reference| {
        let (sums, _) = walk::sum_all_models(&standard, &problem.prior, 0, reference);
        let layout = Layout::new(size);
        (0..size)
            .map(|k| sums[layout.inclusion(k)] / sums[layout.weight()])
            .collect::<Vec<f64>>()
    };
    let (all, most) = (shares(f64::NEG_INFINITY), shares(reference));
    for (k, (all, most)) in all.iter().zip(&most).enumerate() {
        assert!((all - most).abs() < 1e-12, "{k}: {all} {most}");
    }
    assert!(
        all[4] < 0.999 && all[8] < 0.999,
        "either may be out: {all:?}"
    );
}
