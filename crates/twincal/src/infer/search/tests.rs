//! The search against sums over all models.

use crate::infer::testing::{Densities, grouped, problem};
use crate::infer::{approximate, exact};
use crate::posterior::{Method, Problem};
use crate::prior::{Inclusion, Prior};

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

/// y = −2 s + e. Column s is its best explanation; b, nearly the same with a cheaper slab, may not be negative; u + v + w, a multiple of
/// s, are three columns that no exchange leads to. From s a climb that knows no bounds goes on to b, which the bound forbids.
#[test]
fn a_start_is_counted_that_a_climb_leaves_for_a_forbidden_model() {
    let (s, b, parts, count) = (0, 1, [2, 3, 4], 31);
    let third = 1.0 / 3.0_f64.sqrt();
    let mut gram = vec![0.0; count * count];
    let mut set = |i: usize, j: usize, value: f64| {
        gram[i * count + j] = value;
        gram[j * count + i] = value;
    };
    (0..count).for_each(|i| set(i, i, 1.0));
    set(s, b, 0.9999);
    parts.iter().for_each(|&k| set(s, k, third));
    parts.iter().for_each(|&k| set(b, k, 0.9999 * third));
    let mut xy = vec![0.0; count];
    (xy[s], xy[b]) = (-2.0, -2.0 * 0.9999);
    parts.iter().for_each(|&k| xy[k] = -2.0 * third);
    let mut slab = vec![1e22; count];
    slab[b] = 1e20;
    parts.iter().for_each(|&k| slab[k] = 1e8);
    let inclusion = Inclusion::Probability(0.5);
    let mut prior = Prior::single(slab, vec![0; count], inclusion, (0.01, 1e-6));
    prior.lower[b] = 0.0;
    let problem = Problem {
        gram,
        xy,
        yy: 5.0,
        n: 1000.0,
        log_constant: 0.0,
        prior,
        names: (0..count).map(|k| k.to_string()).collect(),
    };
    let cold = approximate(&problem, None).unwrap();
    // s costs ½ ln 1e22 nats, the three parts 3/2 ln 1e8.
    let parts_alone = 1.0 / (1.0 + 10.0_f64);
    let mut near = cold.clone();
    let known = |members: Vec<usize>| {
        let mut model = cold.models[0].clone();
        model.members = members.iter().map(|&k| k as u32).collect();
        model
    };
    near.models = vec![known(vec![s]), known(parts.to_vec())];
    let warm = approximate(&problem, Some(&near)).unwrap();
    let off = (1.0 - warm.inclusion[s] - parts_alone).abs();
    assert!(off < 1e-2, "{}", warm.inclusion[s]);
    // Without a start there is nothing of the other explanation.
    assert!(cold.inclusion[s] > 0.9, "{}", cold.inclusion[s]);
}
