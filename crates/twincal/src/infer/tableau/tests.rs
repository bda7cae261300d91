//! The tableau against factorisations of whole models.

use super::*;
use crate::infer::pivot::Pivot;
use crate::infer::testing::{grouped, problem};
use crate::linear_algebra::Cholesky;
use crate::posterior::Problem;
use crate::prior::Inclusion;

/// After any sequence of moves every number equals that of a factorisation of the present model.
#[test]
fn moves_keep_the_definition() {
    walk(&problem(2, 11, 60, 0.7, Inclusion::Probability(0.5)));
    walk(&grouped(2, &[3, 1, 2, 10, 1, 4], 60, true).problem);
}

fn walk(problem: &Problem) {
    let standard = Standard::new(problem).unwrap();
    let mut tableau = Tableau::new(&standard);
    let blocks = standard.blocks.len();
    let mut state = 12345u64;
    for step in 0..5000 {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        tableau.flip_block((state >> 33) as usize % blocks);
        if step % 250 == 0 || step < 20 {
            compare(&tableau, &standard);
            compare_blocks(&tableau, &standard);
        }
    }
}

/// Equal columns with wide slabs: models with both are singular but for 1e-10, and what comes after them is exact again.
#[test]
fn nearly_singular_models_leave_no_rounding_behind() {
    let mut problem = problem(2, 9, 60, 0.3, Inclusion::Probability(0.5));
    let twins = [(0, 7), (1, 8)];
    for (own, copy) in twins {
        for k in 0..9 {
            problem.gram[copy * 9 + k] = problem.gram[own * 9 + k];
        }
        for k in 0..9 {
            problem.gram[k * 9 + copy] = problem.gram[k * 9 + own];
        }
        problem.xy[copy] = problem.xy[own];
    }
    problem.prior.slab.fill(1e8);
    let standard = Standard::new(&problem).unwrap();
    let position = |k: usize| standard.order.iter().position(|&o| o == k).unwrap();
    let mut tableau = Tableau::new(&standard);
    let mut state = 5u64;
    let mut compared = 0;
    for _ in 0..2000 {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        tableau.flip_block((state >> 33) as usize % 9);
        let both = |&(a, b): &(usize, usize)| {
            tableau.includes(position(a)) && tableau.includes(position(b))
        };
        if !twins.iter().any(both) {
            compare(&tableau, &standard);
            compared += 1;
        }
    }
    assert!(compared > 500);
}

/// Squares of components and exchanges, by determinants and forms of whole models.
fn compare_blocks(tableau: &Tableau<'_>, standard: &Standard) {
    let count = standard.blocks.len();
    let model = |holds: &dyn Fn(usize) -> bool| whole_model(standard, holds);
    let now = model(&|b| tableau.holds(b));
    let check = |then: (f64, f64), (d, change): (f64, f64), what: &str| {
        let off = d.ln() - (then.0 - now.0);
        assert!(
            off.abs() < 1e-7 * (1.0 + d.ln().abs()),
            "{what}: determinant, {off}"
        );
        let off = change - (then.1 - now.1);
        assert!(
            off.abs() < 1e-8 * (1.0 + then.1 + now.1),
            "{what}: misfit, {off}"
        );
    };
    for flipped in 0..count {
        let (d, square) = tableau.block(flipped);
        let change = if tableau.holds(flipped) {
            square
        } else {
            -square
        };
        let then = model(&|b| tableau.holds(b) != (b == flipped));
        check(then, (d, change), "flip");
    }
    let (inside, outside): (Vec<usize>, Vec<usize>) = (0..count).partition(|&b| tableau.holds(b));
    if let (Some(&leaves), [first, rest @ ..]) = (inside.last(), &outside[..]) {
        let entering: Vec<usize> = [first].into_iter().chain(rest.first()).copied().collect();
        let moved = |b: usize| b == leaves || entering.contains(&b);
        let then = model(&|b| tableau.holds(b) != moved(b));
        let pivot = Pivot::new(tableau, &[leaves], &entering);
        check(then, (pivot.determinant, pivot.change), "exchange");
    }
}

/// ln |A_zz| Π v and c of a model.
fn whole_model(standard: &Standard, holds: &dyn Fn(usize) -> bool) -> (f64, f64) {
    let members: Vec<usize> = (0..standard.blocks.len())
        .filter(|&b| holds(b))
        .flat_map(|b| standard.blocks[b].range())
        .collect();
    let (size, own) = (standard.size(), members.len());
    let at = |i: usize, j: usize| standard.matrix[i * size + j];
    let block: Vec<f64> = members
        .iter()
        .flat_map(|&i| members.iter().map(move |&j| at(i, j)))
        .collect();
    let factor = Cholesky::new(&block, own).unwrap();
    let mut right: Vec<f64> = members
        .iter()
        .map(|&i| (0..size).map(|j| at(i, j) * standard.center[j]).sum())
        .collect();
    let whole: f64 = (0..size)
        .map(|i| {
            let row: f64 = (0..size).map(|j| at(i, j) * standard.center[j]).sum();
            row * standard.center[i]
        })
        .sum();
    factor.solve_lower(&mut right);
    let slabs: f64 = members.iter().map(|&i| standard.precision[i].ln()).sum();
    let explained: f64 = right.iter().map(|x| x * x).sum();
    (factor.log_determinant() - slabs, whole - explained)
}

fn compare(tableau: &Tableau<'_>, standard: &Standard) {
    let size = standard.size();
    let members = &tableau.members;
    let count = members.len();
    let at = |i: usize, j: usize| standard.matrix[i * size + j];
    let block: Vec<f64> = members
        .iter()
        .flat_map(|&i| members.iter().map(move |&j| at(i, j)))
        .collect();
    let inverse = Cholesky::new(&block, count).unwrap().inverse();
    // r = A β̂ − h
    let r = |k: usize| {
        (0..size)
            .map(|j| at(k, j) * standard.center[j])
            .sum::<f64>()
            - standard.offset[k]
    };
    let beta: Vec<f64> = (0..count)
        .map(|a| {
            (0..count)
                .map(|b| inverse[a * count + b] * r(members[b]))
                .sum()
        })
        .collect();
    let mut excess = (0..size)
        .map(|k| standard.center[k] * (r(k) - standard.offset[k]))
        .sum::<f64>();
    for (a, &k) in members.iter().enumerate() {
        assert!(
            (tableau.diagonal[k] - inverse[a * count + a]).abs() < 1e-9 * inverse[a * count + a]
        );
        assert!((tableau.gradient[k] - beta[a]).abs() < 1e-9 * (1.0 + beta[a].abs()));
        excess -= beta[a] * r(k);
    }
    assert!(
        (tableau.excess - excess).abs() < 1e-9 * (1.0 + excess),
        "{} {excess}",
        tableau.excess
    );
    for k in (0..size).filter(|&k| !tableau.includes(k)) {
        let mut schur = 1.0;
        let mut gradient = r(k);
        for (a, &i) in members.iter().enumerate() {
            let t: f64 = (0..count)
                .map(|b| inverse[a * count + b] * at(members[b], k))
                .sum();
            assert!((tableau.row(i)[k] - t).abs() < 1e-9 * (1.0 + t.abs()));
            schur -= t * at(i, k);
            gradient -= at(k, i) * beta[a];
        }
        assert!((tableau.diagonal[k] - schur).abs() < 1e-9);
        assert!((tableau.gradient[k] - gradient).abs() < 1e-9 * (1.0 + gradient.abs()));
    }
}
