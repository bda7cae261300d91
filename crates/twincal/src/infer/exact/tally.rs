//! What a walk through models remembers of them one by one: the heaviest seen so far, a bounded list whose entrance threshold rises, and
//! a bound of all that were not visited.

use crate::infer::answer::LISTED_MODELS;
use pulp::{Simd, bytemuck};
use std::sync::atomic::{AtomicU64, Ordering};

/// A threshold that all subtrees share. Positive floats are ordered like their bits.
///
/// It only ever says "at least [`LISTED_MODELS`] models are at least as heavy", so that which thread raised it when
/// changes how many light models are looked at, never which heavy ones are kept.
#[derive(Debug)]
pub(super) struct Threshold(AtomicU64);

impl Threshold {
    pub(super) fn new() -> Self {
        Self(AtomicU64::new(f64::MIN_POSITIVE.to_bits()))
    }

    fn raise(&self, weight: f64) -> f64 {
        let before = self.0.fetch_max(weight.to_bits(), Ordering::Relaxed);
        f64::from_bits(before).max(weight)
    }
}

/// Models as (weight, set of components), at least the [`LISTED_MODELS`] heaviest of those offered.
#[derive(Debug)]
pub(super) struct Tally {
    models: Vec<(f64, u32)>,
    threshold: f64,
    not_visited: f64,
}

impl Tally {
    pub(super) fn new(shared: &Threshold) -> Self {
        Self {
            models: Vec::new(),
            threshold: shared.raise(f64::MIN_POSITIVE),
            not_visited: 0.0,
        }
    }

    /// Offers one model per lane: the components of `set`, and the lane's own first ones.
    #[inline(always)]
    pub(super) fn offer<S: Simd>(
        &mut self,
        simd: S,
        weight: S::f64s,
        set: u32,
        shared: &Threshold,
    ) {
        let heavy = simd.greater_than_or_equal_f64s(weight, simd.splat_f64s(self.threshold));
        if simd.first_true_m64s(heavy) < S::F64_LANES {
            self.keep(bytemuck::cast_slice(&[weight]), set, shared);
        }
    }

    /// Models that weigh no more than this together are left out.
    #[inline(always)]
    pub(super) fn leave_out(&mut self, weight: f64) {
        self.not_visited += weight;
    }

    /// What all models left out weigh at most.
    pub(super) fn not_visited(&self) -> f64 {
        self.not_visited
    }

    #[cold]
    #[inline(never)]
    fn keep(&mut self, weights: &[f64], set: u32, shared: &Threshold) {
        for (lane, &weight) in weights.iter().enumerate() {
            if weight >= self.threshold {
                self.models.push((weight, set | lane as u32));
            }
        }
        if self.models.len() >= 4 * LISTED_MODELS {
            self.shrink();
            self.threshold = shared.raise(self.models[LISTED_MODELS - 1].0);
        }
    }

    /// Keeps the heaviest; of equal ones those with the smaller set. The last one kept is the lightest.
    fn shrink(&mut self) {
        if self.models.len() > LISTED_MODELS {
            self.models
                .select_nth_unstable_by(LISTED_MODELS - 1, |a, b| {
                    b.0.total_cmp(&a.0).then(a.1.cmp(&b.1))
                });
            self.models.truncate(LISTED_MODELS);
        }
    }

    /// Both together.
    pub(super) fn merge(mut self, other: Tally) -> Self {
        self.models.extend(other.models);
        self.not_visited += other.not_visited;
        self.shrink();
        self
    }

    /// At most [`LISTED_MODELS`], in no particular order.
    pub(super) fn into_models(mut self) -> Vec<(f64, u32)> {
        self.shrink();
        self.models
    }
}
