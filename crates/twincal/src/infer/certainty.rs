//! Which components are in every model that counts, as [`super::certain`] finds it.

use crate::prior::Prior;

/// What is certain, by the components' own numbers.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Certain {
    /// Every model with weight holds it.
    pub(super) sure: Vec<bool>,
    /// Its bounds, if it has any, act in no model with weight that holds it.
    pub(super) settled: Vec<bool>,
    /// What the full model misfits without it, c_B; 0 where it was not asked.
    pub(super) costs: Vec<f64>,
    /// ln of the weight of a model by which it was judged, in the units of [`super::standard::Standard`]; −∞ where there is none.
    pub(super) reference: f64,
}

#[cfg(test)]
impl Certain {
    /// The same verdict, by models of the same weight.
    #[track_caller]
    pub(super) fn is_like(&self, other: &Self) {
        assert_eq!(self.sure, other.sure);
        assert_eq!(self.settled, other.settled);
        let off = self.reference - other.reference;
        assert!(off.abs() < 1e-6 * self.reference.abs().max(1.0), "{off}");
    }
}

/// Nothing is certain.
pub(super) fn none(prior: &Prior) -> Certain {
    Certain {
        sure: vec![false; prior.components()],
        settled: vec![false; prior.components()],
        costs: vec![0.0; prior.components()],
        reference: f64::NEG_INFINITY,
    }
}

/// Order of the components for the tree: certain ones, then the largest first, those without kin last (the innermost loops ask
/// nobody), among these what data ask for most first (what follows where it is left out soon weighs nothing); how many are certain.
pub(super) fn order(prior: &Prior, certain: &Certain) -> (Vec<usize>, usize) {
    let (columns, costs, certain) = (prior.columns(), &certain.costs, &certain.sure);
    let children = prior.children();
    let kin = |c: usize| prior.parent_of(c).is_some() || !children[c].is_empty();
    let mut order: Vec<usize> = (0..certain.len()).collect();
    let coarse = |c: usize| (!certain[c], std::cmp::Reverse(columns[c].len()), !kin(c));
    order.sort_by(|&a, &b| {
        let finer = || costs[b].total_cmp(&costs[a]);
        coarse(a).cmp(&coarse(b)).then_with(finer)
    });
    (order, certain.iter().filter(|c| **c).count())
}
