//! Posteriors with columns integrated out against those with every column in the tableau, and against densities.

use super::*;
use crate::infer::approximate::{approximate, averages};
use crate::infer::certain::components;
use crate::infer::moments::{Sums, present};
use crate::infer::search::Found;
use crate::infer::testing::{Densities, acting};
use crate::infer::walker::Walker;
use crate::posterior::Problem;

/// Averages and ln evidence of all models that hold what is certain, with or without its columns in the tableau.
fn summed(problem: &Problem, shrink: bool) -> (Averages, f64, bool) {
    let standard = Standard::new(problem).unwrap();
    let certain = components(&standard, problem, None);
    let reduced = if shrink {
        Reduced::new(&standard, &certain)
    } else {
        Reduced::whole(&standard, &certain)
    };
    let mut walker = Walker::new(&reduced.open, &problem.prior);
    let mut sums = Sums::new(&reduced.open, reduced.shrinks());
    sums.reference = f64::NEG_INFINITY;
    for &block in &reduced.certain {
        walker.flip(block);
    }
    for set in 0u64..1 << reduced.active.len() {
        for (bit, &block) in reduced.active.iter().enumerate() {
            if walker.tableau.holds(block) != (set >> bit & 1 == 1) {
                walker.flip(block);
            }
        }
        walker.tableau.refine();
        let moments = present(&walker, reduced.shrinks());
        sums.add(&reduced.open, walker.log_weight(), &moments);
    }
    let mut found = Found {
        sums,
        models: Vec::new(),
        missing: 0.0,
        overrated: false,
    };
    let log_sum = found.sums.total().ln() + found.sums.reference;
    let log_evidence = standard.log_evidence(log_sum);
    (
        averages(&reduced, &mut found),
        log_evidence,
        reduced.shrinks(),
    )
}

/// Strong effects in components of several columns, columns mixed: the same posterior to rounding.
#[test]
fn integrating_columns_out_changes_nothing() {
    let cases: [(u64, &[usize]); 4] = [
        (3, &[10, 6, 4, 4, 1, 6, 1, 4]),
        (4, &[1, 2, 1, 1, 3, 1, 1, 1, 2]),
        (5, &[4, 4, 1, 2, 2, 1, 1, 1, 6]),
        (6, &[1; 10]),
    ];
    for (seed, sizes) in cases {
        let data = acting(seed, sizes, 150, true, 4.0);
        let (got, log_evidence, shrinks) = summed(&data.problem, true);
        let (same, log_same, whole) = summed(&data.problem, false);
        assert!(shrinks && !whole, "{sizes:?}: nothing is certain");
        let off = (log_evidence - log_same).abs();
        assert!(off < 1e-9, "{sizes:?}: evidence off by {off}");
        let off = (got.misfit / same.misfit - 1.0).abs();
        assert!(off < 1e-10, "{sizes:?}: c off by {off}");
        let standard = Standard::new(&data.problem).unwrap();
        let truth = Densities::new(&data);
        let off = (log_evidence - truth.log_evidence).abs();
        assert!(
            off < 1e-9 * truth.log_evidence.abs(),
            "{sizes:?}: evidence off by {off}"
        );
        for (d, &k) in standard.order.iter().enumerate() {
            let off = (got.inclusion[d] - same.inclusion[d]).abs();
            assert!(off < 1e-10, "{sizes:?}: PIP {k} off by {off}");
            let off = (got.shift[d] - same.shift[d]).abs();
            assert!(
                off < 1e-10 * same.moment[d].sqrt(),
                "{sizes:?}: mean {k} off by {off}"
            );
            let off = (got.moment[d] / same.moment[d] - 1.0).abs();
            assert!(off < 1e-10, "{sizes:?}: moment {k} off by {off}");
            let pip = truth.pip[data.problem.prior.component[k]];
            assert!((got.inclusion[d] - pip).abs() < 1e-9, "{sizes:?}: PIP {k}");
            let unit = standard.natural(d);
            let mean = (standard.center[d] + got.shift[d]) / unit;
            let off = (mean - truth.mean[k]).abs();
            assert!(off < 1e-7 * truth.sd[k], "{sizes:?}: mean {k} off by {off}");
            let sd = (got.moment[d] - got.shift[d] * got.shift[d]).sqrt() / unit;
            let off = (sd / truth.sd[k] - 1.0).abs();
            assert!(off < 1e-6, "{sizes:?}: sd {k} off by {off}");
        }
    }
}

/// The search adds the moments of neighbours together, by flips and exchanges: sd of all columns are those of all models, also of the ones that are gone.
#[test]
fn the_search_knows_the_sd_of_what_is_gone() {
    let cases: [(u64, &[usize]); 3] = [
        (3, &[10, 6, 4, 4, 1, 6, 1, 4]),
        (5, &[4, 4, 1, 2, 2, 1, 1, 1, 6]),
        (6, &[1; 10]),
    ];
    for (seed, sizes) in cases {
        let data = acting(seed, sizes, 150, true, 4.0);
        let standard = Standard::new(&data.problem).unwrap();
        let certain = components(&standard, &data.problem, None);
        let reduced = Reduced::new(&standard, &certain);
        assert!(reduced.shrinks() && !reduced.active.is_empty(), "{sizes:?}");
        let (got, truth) = (
            approximate(&data.problem, None).unwrap(),
            Densities::new(&data),
        );
        for k in 0..data.problem.xy.len() {
            let off = (got.sd[k] / truth.sd[k] - 1.0).abs();
            let pip = truth.pip[data.problem.prior.component[k]];
            assert!(pip < 0.01 || off < 1e-5, "{sizes:?}: sd {k} off by {off}");
        }
    }
}

/// Moments of the columns that are gone, one model at a time, against a factorisation of that model.
#[test]
fn what_is_gone_follows_what_is_left() {
    let data = acting(3, &[10, 6, 4, 4, 1, 6, 1, 4], 150, true, 2.0);
    let standard = Standard::new(&data.problem).unwrap();
    let certain = components(&standard, &data.problem, None);
    let reduced = Reduced::new(&standard, &certain);
    assert!(reduced.shrinks());
    let mut walker = Walker::new(&reduced.open, &data.problem.prior);
    let mut response = Response::default();
    for set in 0u64..1 << reduced.open.blocks.len() {
        for block in 0..reduced.open.blocks.len() {
            if walker.tableau.holds(block) != (set >> block & 1 == 1) {
                walker.flip(block);
            }
        }
        let tableau = &walker.tableau;
        let delta: Vec<f64> = (0..reduced.open.size())
            .map(|k| f64::from(tableau.includes(k)) * tableau.gradient[k] - reduced.open.center[k])
            .collect();
        let row = |k: usize| tableau.row(k);
        reduced.respond(&delta, &tableau.members, row, &mut response);
        let (_, mut positions) = reduced.members(&[set]);
        positions.sort_unstable_by_key(|&d| standard.order[d]);
        let model = standard.model(&positions, 1.0).unwrap();
        let factor = crate::linear_algebra::Cholesky::from_lower(model.factor, positions.len());
        let inverse = factor.inverse_diagonal();
        for (c, d) in reduced.gone().iter().enumerate() {
            let at = positions.iter().position(|p| p == d).unwrap();
            let unit = standard.natural(*d);
            let mean = (standard.center[*d] + response.delta[c]) / unit;
            assert!(
                (mean / model.mean[at] - 1.0).abs() < 1e-9,
                "mean {d} in {set:b}"
            );
            let variance = response.variance[c] / standard.precision_unit(*d);
            assert!(
                (variance / inverse[at] - 1.0).abs() < 1e-9,
                "variance {d} in {set:b}"
            );
        }
    }
}
