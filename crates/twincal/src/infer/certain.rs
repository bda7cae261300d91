//! Components that no model worth counting leaves out: decided before the tree is walked, each halves the work.
//!
//! In the units of [`Standard`] a model's weight is `p(z) Π factor (v_k p_k)^−½ (1 + c_z)^−a_n`, and every factor before
//! the power but the prior's is at most 1 but for those of the bounds. Without component B no model misfits less than the
//! full model without B, and the prior probabilities of all models without B sum to P(z_B = 0), so that
//!
//! ```text
//! Σ_{z: B∉z} weight(z) ≤ P(z_B = 0) Π factor (1 + c_B)^−a_n,     c_B = β̂_Bᵀ ((A⁻¹)_BB)⁻¹ β̂_B
//! ```
//!
//! Where that is below e^−40 of a single model that does hold B, all of them together are below rounding.

use super::moments::present;
use super::search::climb;
use super::standard::Standard;
use super::walker::Walker;
use crate::prior::Prior;
use pulp::{Simd, WithSimd};

/// ln of the share of the mass below which models are not visited: 4e-18, far below one ulp of the sum.
const NEGLIGIBLE: f64 = -40.0;

/// Components (by their own number) that every model with weight holds.
pub(super) fn components(standard: &Standard, prior: &Prior) -> Vec<bool> {
    pulp::Arch::new().dispatch(Certain { standard, prior })
}

struct Certain<'a> {
    standard: &'a Standard,
    prior: &'a Prior,
}

impl WithSimd for Certain<'_> {
    type Output = Vec<bool>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<bool> {
        let Self { standard, prior } = self;
        let count = standard.blocks.len();
        let all: Vec<usize> = (0..count).collect();
        let mut walker = Walker::new(standard, prior);
        all.iter().for_each(|&block| walker.flip(simd, block));
        walker.tableau.refine();
        let bounds: f64 = standard.blocks.iter().map(|b| b.factor.ln()).sum();
        let costs: Vec<f64> = all.iter().map(|&b| walker.tableau.block(b).1).collect();
        // Any model makes a valid bound; a good one a sharp one.
        climb(simd, &mut walker, &all, &[]);
        let reference = walker.log_weight() + present(&walker).log_mass(standard);
        let mut certain = vec![false; count];
        for (block, cost) in standard.blocks.iter().zip(costs) {
            let (_, outside) = prior.next(block.family, 0, 0);
            let bound = bounds + outside.ln() - standard.shape * cost.ln_1p();
            certain[block.component] = bound < reference + NEGLIGIBLE;
        }
        certain
    }
}

/// Order of the components for the tree: certain ones, then the largest first; how many are certain.
pub(super) fn order(prior: &Prior, certain: &[bool]) -> (Vec<usize>, usize) {
    let columns = prior.columns();
    let mut order: Vec<usize> = (0..certain.len()).collect();
    order.sort_by_key(|&c| {
        (
            !certain[c],
            std::cmp::Reverse(columns[c].len()),
            prior.family[c],
        )
    });
    (order, certain.iter().filter(|c| **c).count())
}
