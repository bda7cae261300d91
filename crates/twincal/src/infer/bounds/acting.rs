//! Which bounds act in a model, and the mass that its slab has within them.

use super::propagation::propagate;
use crate::infer::moments::{half_mass, log_normal_mass};
use crate::infer::standard::{Standard, slab_mass};
use crate::linear_algebra::Cholesky;
use crate::posterior::{Model, Site};
use std::collections::BTreeMap;

/// A bound this many standard deviations below the mean does not act: its mass is 1 − 6e-16.
pub(super) const FAR: f64 = 8.0;

/// A bound `Σ f β_i ≥ lower` on coefficients of a model, by their place in it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bound {
    pub(super) terms: Vec<(usize, f64)>,
    /// In the coefficients' units, as the factors.
    pub(super) lower: f64,
    /// The group of sums that it belongs to or whose columns it bounds; `None`: it has nothing to do with any.
    pub(super) group: Option<usize>,
}

impl Bound {
    /// `Σ f x_i`.
    pub(super) fn sum(&self, x: &[f64]) -> f64 {
        self.terms.iter().map(|&(i, f)| f * x[i]).sum()
    }

    pub(super) fn site(&self, precision: f64, shift: f64) -> Site {
        let single = self.terms.len() == 1 && self.terms[0].1 == 1.0;
        let terms = self.terms.iter().map(|&(i, f)| (i as u32, f));
        Site {
            place: self.terms[0].0 as u32,
            terms: if single { Vec::new() } else { terms.collect() },
            lower: self.lower,
            precision,
            shift,
        }
    }
}

/// Masses of slabs within bounds at 0, which depend on a group's members alone: the same for many models.
#[derive(Debug, Default)]
pub(in crate::infer) struct SlabMasses(BTreeMap<Vec<(usize, u64)>, f64>);

/// The bounds of a model.
pub(super) struct Acting {
    /// Those that say something: no bound of a coefficient that two sums imply.
    pub(super) bounds: Vec<Bound>,
    /// Places of all coefficients with bounds of their own, with the group of sums that they are part of.
    single: Vec<(usize, Option<usize>)>,
}

impl Acting {
    /// Of the model with these positions; `None` where a bound forbids it.
    pub(super) fn new(standard: &Standard, positions: &[usize]) -> Option<Self> {
        let mut place = vec![None; standard.size()];
        positions
            .iter()
            .enumerate()
            .for_each(|(i, &d)| place[d] = Some(i));
        let inside = |d: usize| place[d].is_some();
        let mut sums = Vec::new();
        let (mut replaced, mut group) = (vec![false; positions.len()], vec![None; positions.len()]);
        for half in standard.halves.iter().filter(|half| half.acts(inside)) {
            if half.forbids(inside) {
                return None;
            }
            let term = |&(d, f): &(usize, f64)| place[d].map(|i| (i, f * standard.natural(d)));
            let terms: Vec<(usize, f64)> = half.terms.iter().filter_map(term).collect();
            terms.iter().for_each(|&(i, _)| group[i] = Some(half.group));
            if let Some(i) = half.replaces.and_then(|d| place[d]) {
                replaced[i] = true;
            }
            sums.push(Bound {
                terms,
                lower: half.lower,
                group: Some(half.group),
            });
        }
        let single: Vec<(usize, Option<usize>)> = (positions.iter().enumerate())
            .filter(|(_, d)| standard.lower[**d] > f64::NEG_INFINITY)
            .map(|(i, _)| (i, group[i]))
            .collect();
        let own = single.iter().filter(|(i, _)| !replaced[*i]);
        let mut bounds: Vec<Bound> = own
            .map(|&(i, group)| Bound {
                terms: vec![(i, 1.0)],
                lower: standard.lower[positions[i]] / standard.natural(positions[i]),
                group,
            })
            .collect();
        bounds.extend(sums);
        Some(Self { bounds, single })
    }

    /// ln of the mass that single bounds leave of the slab at the full model's φ over the mass that all bounds leave of it at φ of a model
    /// with this b_z: the former is in a model's weight, the latter should be.
    pub(super) fn slab_ratio(
        &self,
        standard: &Standard,
        positions: &[usize],
        scale: f64,
        masses: &mut SlabMasses,
    ) -> f64 {
        let misfit = standard.misfit(scale);
        let single = |&(i, group): &(usize, Option<usize>)| {
            let d = positions[i];
            let mass = |weight: f64| slab_mass(standard.lower[d], standard.precision[d], weight);
            let full = mass(2.0 * standard.shape);
            match group {
                None => (full / mass(2.0 * standard.shape / misfit)).ln(),
                Some(_) => full.ln(),
            }
        };
        let phi = scale / standard.shape;
        let variance = |i: usize| {
            let d = positions[i];
            phi / (standard.precision[d] * standard.precision_unit(d))
        };
        let of_single: f64 = self.single.iter().map(single).sum();
        of_single - self.log_slab(positions, variance, masses)
    }

    /// ln of the mass within the bounds of all groups, coefficients being independent with mean 0.
    fn log_slab(
        &self,
        positions: &[usize],
        variance: impl Fn(usize) -> f64,
        masses: &mut SlabMasses,
    ) -> f64 {
        let mut groups: Vec<usize> = self.bounds.iter().filter_map(|b| b.group).collect();
        groups.sort_unstable();
        groups.dedup();
        let mass = |group: usize| {
            let own: Vec<(&Bound, f64)> = (self.bounds.iter())
                .filter(|bound| bound.group == Some(group))
                .map(|bound| {
                    let square = bound.terms.iter().map(|&(i, f)| f * f * variance(i));
                    (bound, square.sum::<f64>().sqrt())
                })
                .filter(|(bound, sd)| -bound.lower < FAR * sd)
                .collect();
            let score: Vec<f64> = own.iter().map(|(b, sd)| -b.lower / sd).collect();
            let shared = |a: &Bound, b: &Bound| -> f64 {
                let pairs = a.terms.iter().map(|&(i, f)| {
                    let same = b.terms.iter().filter(move |t| t.0 == i);
                    same.map(|t| f * t.1).sum::<f64>() * variance(i)
                });
                pairs.sum()
            };
            let correlation: Vec<f64> = own
                .iter()
                .flat_map(|a| own.iter().map(move |b| (a, b)))
                .map(|((a, sd), (b, other))| shared(a, b) / (sd * other))
                .collect();
            propagate(&score, &correlation).0
        };
        let mut known = |group: usize| match self.key(positions, group) {
            Some(key) => *masses.0.entry(key).or_insert_with(|| mass(group)),
            None => mass(group),
        };
        groups.into_iter().map(&mut known).sum()
    }

    /// What decides the slab's mass within the bounds of a group; `None` where φ does, too.
    fn key(&self, positions: &[usize], group: usize) -> Option<Vec<(usize, u64)>> {
        let mut key = Vec::new();
        for bound in self.bounds.iter().filter(|b| b.group == Some(group)) {
            if bound.lower != 0.0 {
                return None;
            }
            let terms = bound.terms.iter();
            key.extend(terms.map(|&(i, factor)| (positions[i], factor.to_bits())));
            key.push((usize::MAX, 0));
        }
        Some(key)
    }

    /// ln of the mass that the search's guide gave to the bounds of the groups, see [`crate::infer::moments::Moments::log_mass`].
    pub(super) fn guided(
        &self,
        standard: &Standard,
        positions: &[usize],
        model: &Model,
        factor: &Cholesky,
    ) -> f64 {
        if self.bounds.iter().all(|bound| bound.group.is_none()) {
            return 0.0;
        }
        let spread = factor.inverse_diagonal();
        let phi = model.scale / standard.shape;
        let place = |d: usize| positions.iter().position(|&own| own == d);
        let own = self.single.iter().filter(|(_, group)| group.is_some());
        let single = own.map(|&(i, _)| {
            let lower = standard.lower[positions[i]] / standard.natural(positions[i]);
            log_normal_mass((model.mean[i] - lower) / (phi * spread[i]).sqrt())
        });
        let natural = |d: usize, value: &dyn Fn(usize) -> f64| place(d).map_or(0.0, value);
        let sums = standard.halves.iter().map(|half| {
            half_mass(
                half,
                |d| place(d).is_some(),
                |d| natural(d, &|i| model.mean[i] * standard.natural(d)),
                |d| natural(d, &|i| phi * spread[i] * standard.natural(d).powi(2)),
            )
        });
        single.sum::<f64>() + sums.sum::<f64>()
    }
}

/// The most that bounds on sums multiply a model's weight with, ln: what they leave of the slab with everything in.
pub(in crate::infer) fn most_of_sums(standard: &Standard) -> f64 {
    if standard.halves.is_empty() {
        return 0.0;
    }
    let positions: Vec<usize> = (0..standard.size()).collect();
    let phi = standard.noise(1.0 / (2.0 * standard.shape));
    let variance = |d: usize| phi / (standard.precision[d] * standard.precision_unit(d));
    let masses = &mut SlabMasses::default();
    Acting::new(standard, &positions).map_or(0.0, |acting| {
        -acting.log_slab(&positions, variance, masses).min(0.0)
    })
}
