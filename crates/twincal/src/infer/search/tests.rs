//! The search against sums over all models.

use crate::infer::testing::{Densities, grouped, problem};
use crate::infer::{approximate, exact};
use crate::posterior::Method;
use crate::prior::Inclusion;

/// Hard problems: components nearly alike, all columns correlated by 0.99, weak effects everywhere.
#[test]
fn the_search_agrees_with_the_sum_over_all_models() {
    let sizes: [&[usize]; 3] = [
        &[10, 6, 4, 1, 1, 1, 1, 1],
        &[4, 4, 1, 2, 2, 1, 1, 1, 6],
        &[1; 10],
    ];
    let heredity = [(3, 1), (1, 2), (4, 2), (0, 6)];
    let cases = sizes
        .iter()
        .flat_map(|sizes| [(sizes, &heredity[..]), (sizes, &[])]);
    for (seed, (sizes, pairs)) in cases.enumerate() {
        let data = grouped(seed as u64 / 2, sizes, 60, true).with_parents(pairs);
        let (got, truth) = (
            approximate(&data.problem, None).unwrap(),
            Densities::new(&data),
        );
        for k in 0..data.problem.xy.len() {
            let pip = truth.pip[data.problem.prior.component[k]];
            assert!((got.inclusion[k] - pip).abs() < 1e-4, "{sizes:?}: PIP {k}");
            let off = (got.mean[k] - truth.mean[k]).abs();
            assert!(off < 1e-3 * truth.sd[k], "{sizes:?}: mean {k}");
            // The sd of what is hardly ever in comes from models that the search may leave out.
            let off = (got.sd[k] / truth.sd[k] - 1.0).abs();
            assert!(pip < 0.01 || off < 1e-3, "{sizes:?}: sd {k}");
        }
        let off = (got.log_evidence.unwrap() - truth.log_evidence).abs();
        assert!(off < 1e-3, "{sizes:?}: evidence off by {off}");
    }
    for (seed, correlation) in [(1, 0.5), (2, 0.9), (3, 0.99)] {
        let problem = problem(seed, 18, 100, correlation, Inclusion::ExpectedTerms(4.0));
        let (got, truth) = (
            approximate(&problem, None).unwrap(),
            exact::enumerate(&problem).unwrap(),
        );
        let Method::Search { missing, .. } = got.method else {
            panic!("not searched")
        };
        // What is missing is said, by an estimate that may be off by a factor of two.
        for k in 0..18 {
            let off = (got.inclusion[k] - truth.inclusion[k]).abs();
            assert!(
                off < 1e-3 + 2.0 * missing,
                "correlation {correlation}: PIP {k} off by {off}, {missing} missing"
            );
        }
        let off = (got.log_evidence.unwrap() - truth.log_evidence.unwrap()).abs();
        assert!(
            off < 1e-3 + 3.0 * missing,
            "correlation {correlation}: evidence off by {off}, {missing} missing"
        );
    }
}

/// A start from another posterior finds the same.
#[test]
fn a_warm_start_changes_nothing() {
    let data = grouped(5, &[10, 6, 4, 1, 1, 1, 1, 1], 60, true);
    let cold = approximate(&data.problem, None).unwrap();
    let mut other = data.problem.clone();
    other.prior.slab.iter_mut().for_each(|v| *v *= 1.3);
    let warm = approximate(&other, Some(&cold)).unwrap();
    let again = approximate(&other, None).unwrap();
    for k in 0..other.xy.len() {
        assert!((warm.inclusion[k] - again.inclusion[k]).abs() < 1e-5);
    }
}
