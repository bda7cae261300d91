//! Columns that no model worth counting leaves out: decided before the tree is walked, each halves the work.
//!
//! In the units of [`Standard`] a model's weight is `p(z) Π (v_k p_k)^−½ (1 + c_z)^−a_n`, and every factor before the
//! power is at most 1. Without column k no model misfits less than the full model without k, so that
//!
//! ```text
//! Σ_{z: k∉z} weight(z) ≤ (1 + c_k)^−a_n,     c_k = β̂_k² / (A⁻¹)_kk
//! ```
//!
//! Where that is below e^−40 of a single model that does hold k, all of them together are below rounding.

use crate::infer::standard::Standard;
use crate::linear_algebra::Cholesky;
use crate::prior::Prior;

/// ln of the share of the mass below which models are not visited: 4e-18, far below one ulp of the sum.
const NEGLIGIBLE: f64 = -40.0;

/// Columns (by their own number, not position) that every model with weight holds.
pub(super) fn columns(standard: &Standard, prior: &Prior) -> Vec<bool> {
    let size = standard.size();
    let mut certain = vec![false; size];
    let all: Vec<usize> = (0..size).collect();
    let Some(full) = Removal::of(standard, &all) else {
        return certain;
    };
    let reference = best_by_elimination(standard, prior, all);
    for (d, cost) in full.cost.iter().enumerate() {
        let bound = -standard.shape * cost.ln_1p();
        certain[standard.order[d]] = bound < reference + NEGLIGIBLE;
    }
    certain
}

/// Order of the columns for the tree: families together; the first three and the last columns, which the tree decides
/// in its lanes and in its written-out leaves, uncertain ones where there are any.
pub(super) fn order(prior: &Prior, certain: &[bool]) -> Vec<usize> {
    let uncertain = |family: usize| {
        (0..certain.len())
            .filter(|&k| prior.family_of(k) == family && !certain[k])
            .count()
    };
    let sure =
        |family: usize| (0..certain.len()).any(|k| prior.family_of(k) == family && certain[k]);
    let mut families: Vec<usize> = (0..prior.families()).collect();
    families.sort_by_key(|&f| (sure(f), uncertain(f), f));
    if let Some(last) = (0..families.len()).max_by_key(|&i| (uncertain(families[i]), i)) {
        let family = families.remove(last);
        families.push(family);
    }
    let mut order = Vec::with_capacity(certain.len());
    for family in families {
        let (sure, mut open): (Vec<usize>, Vec<usize>) = (0..certain.len())
            .filter(|&k| prior.family_of(k) == family)
            .partition(|&k| certain[k]);
        let first = 3_usize.saturating_sub(order.len()).min(open.len());
        let rest = open.split_off(first);
        order.extend(open.into_iter().chain(sure).chain(rest));
    }
    order
}

/// ln weight of a model, and what leaving out each of its columns costs.
struct Removal {
    /// `ln Π (v_k p_k)^−½ (1 + c_z)^−a_n` without the prior.
    log_weight: f64,
    /// Growth of c when the member is left out.
    cost: Vec<f64>,
}

impl Removal {
    fn of(standard: &Standard, members: &[usize]) -> Option<Self> {
        let (size, count) = (standard.size(), members.len());
        let block: Vec<f64> = members
            .iter()
            .flat_map(|&i| members.iter().map(move |&j| standard.matrix[i * size + j]))
            .collect();
        let factor = Cholesky::new(&block, count).ok()?;
        let inverse = factor.inverse();
        // δ = −β̂ outside z, A_zz δ_z = A_ze β̂_e − h_z inside.
        let mut delta: Vec<f64> = standard.center.iter().map(|x| -x).collect();
        members.iter().for_each(|&d| delta[d] = 0.0);
        let product = |delta: &[f64], row: usize| -> f64 {
            (0..size)
                .map(|j| standard.matrix[row * size + j] * delta[j])
                .sum()
        };
        let right: Vec<f64> = members
            .iter()
            .map(|&d| -product(&delta, d) - standard.offset[d])
            .collect();
        for (i, &d) in members.iter().enumerate() {
            delta[d] = (0..count).map(|j| inverse[i * count + j] * right[j]).sum();
        }
        let excess: f64 = (0..size)
            .map(|d| delta[d] * (product(&delta, d) + 2.0 * standard.offset[d]))
            .sum();
        let excess = excess.max(0.0);
        let log_slab: f64 = members.iter().map(|&d| standard.precision[d].ln()).sum();
        Some(Self {
            log_weight: 0.5 * (log_slab - factor.log_determinant())
                - standard.shape * excess.ln_1p(),
            cost: members
                .iter()
                .enumerate()
                .map(|(i, &d)| {
                    let beta = standard.center[d] + delta[d];
                    beta * beta / inverse[i * count + i]
                })
                .collect(),
        })
    }
}

/// ln weight, prior included, of a good model: from the full one, the least costly column is left out as long as that
/// pays. Any model would make a valid bound; a good one makes a sharp one.
fn best_by_elimination(standard: &Standard, prior: &Prior, mut members: Vec<usize>) -> f64 {
    let weight = |members: &[usize], log_weight: f64| {
        let mut counts = vec![0; prior.families()];
        members
            .iter()
            .for_each(|&d| counts[prior.family_of(standard.order[d])] += 1);
        log_weight + prior.log_model(&counts)
    };
    let mut best = f64::NEG_INFINITY;
    while let Some(removal) = Removal::of(standard, &members) {
        best = best.max(weight(&members, removal.log_weight));
        let least = (0..members.len()).min_by(|&a, &b| removal.cost[a].total_cmp(&removal.cost[b]));
        match least {
            Some(least) => members.remove(least),
            None => break,
        };
    }
    best
}
