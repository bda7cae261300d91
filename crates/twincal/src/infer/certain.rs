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
//!
//! The same bound says how far coefficients can move: models with `c > c_max`, `Π factor (1 + c_max)^−a_n` being that
//! little, do not count, and in the others
//!
//! ```text
//! |δ_d| ≤ √(c_max (A⁻¹)_dd),    Var β_d ≤ φ_max (A⁻¹)_dd,    φ_max = (1 + c_max)/(2 a_n)
//! ```
//!
//! A bound that is [`FAR`] sd away even so acts in no model that counts.

use super::bounds::{log_weight, most_of_sums};
use super::certainty::{Certain, none};
use super::moments::{Covariance, Moments, present};
use super::reduced::Reduced;
use super::search::climb;
use super::standard::{Block, Standard, nudged};
use super::walker::Walker;
use crate::linear_algebra::Cholesky;
use crate::posterior::{Posterior, Problem};
use crate::prior::{HalfSpace, Prior, SETTLED};

/// ln of the share of the mass below which models are not visited: 4e-18, far below one ulp of the sum.
const NEGLIGIBLE: f64 = -40.0;

/// sd from the mean beyond which a bound takes no mass: ln Φ(9) = −1e-19.
const FAR: f64 = 9.0;

/// The components that every model with weight holds.
///
/// Any model makes a valid bound, a good one a sharp one: the one that a settled prior asks for, or the heaviest of a posterior that
/// is known to be near; without these, what the full model settles is integrated out and a better one looked for among the rest.
pub(super) fn components(
    standard: &Standard,
    problem: &Problem,
    near: Option<&Posterior>,
) -> Certain {
    let prior = &problem.prior;
    let Ok(factor) = nudged(&standard.matrix, standard.size()) else {
        return none(prior);
    };
    let inverse = factor.inverse();
    let size = standard.size();
    let bounds = Bounds::of(standard, prior, &inverse);
    let reference = match prior.settled_structure() {
        Some(holds) => weight_of(standard, problem, &holds),
        None => near.and_then(|near| weight_of_heaviest(standard, problem, near)),
    };
    if let Some(reference) = reference {
        return bounds.judge(reference);
    }
    let full = Moments {
        delta: vec![0.0; size],
        variance: bounds.spread.clone(),
        excess: 0.0,
        holds: Vec::new(),
        joint: Covariance::Unknown,
    };
    let slabs: f64 = standard.precision.iter().map(|p| p.ln()).sum();
    let reference = prior.log_model(&prior.family_sizes()) + bounds.factors + 0.5 * slabs
        - 0.5 * factor.log_determinant();
    let first = bounds.judge(reference + full.log_mass(standard));
    let reduced = Reduced::new(standard, &first);
    bounds.judge(climbed(&reduced.open, prior))
}

/// ln of the weight that the heaviest model of another posterior has here, its bounds counted as the search's guide does;
/// `None` where it is no model of this problem.
pub(super) fn weight_of_heaviest(
    standard: &Standard,
    problem: &Problem,
    near: &Posterior,
) -> Option<f64> {
    let prior = &problem.prior;
    // A structure that is settled here is not the heaviest there.
    if near.component != prior.component || prior.odds.iter().any(|&odds| odds >= SETTLED) {
        return None;
    }
    let model = near.models.first()?;
    let mut holds = vec![false; prior.components()];
    let members = model.members.iter();
    members.for_each(|&k| holds[prior.component[k as usize]] = true);
    weight_of(standard, problem, &holds)
}

/// ln of the weight of the model with these components, its bounds counted as the search's guide does; `None` where it has no prior
/// probability.
fn weight_of(standard: &Standard, problem: &Problem, holds: &[bool]) -> Option<f64> {
    let prior = &problem.prior;
    let orphan = |c: usize| holds[c] && prior.parent_of(c).is_some_and(|p| !holds[p]);
    if (0..holds.len()).any(orphan) {
        return None;
    }
    let blocks = standard.blocks.iter().filter(|b| holds[b.component]);
    let mut positions: Vec<usize> = blocks.flat_map(Block::range).collect();
    let model = standard.model(&positions, 1.0).ok()?;
    positions.sort_unstable_by_key(|&d| standard.order[d]);
    let count = positions.len();
    let spread = Cholesky::from_lower(model.factor.clone(), count).inverse_diagonal();
    let mut moments = Moments {
        delta: standard.center.iter().map(|x| -x).collect(),
        variance: vec![0.0; standard.size()],
        excess: standard.misfit(model.scale) - 1.0,
        holds: Vec::new(),
        joint: Covariance::Unknown,
    };
    for ((&d, mean), spread) in positions.iter().zip(&model.mean).zip(&spread) {
        moments.delta[d] += mean * standard.natural(d);
        moments.variance[d] = spread * standard.precision_unit(d);
    }
    Some(log_weight(problem, standard, &model) + moments.log_mass(standard))
}

/// What the bounds of the module's text are made of.
struct Bounds<'a> {
    standard: &'a Standard,
    prior: &'a Prior,
    /// c of the full model without each component, and `(A⁻¹)_dd`.
    costs: Vec<f64>,
    spread: Vec<f64>,
    /// `Σ ln factor`.
    factors: f64,
    /// `a'(A⁻¹) a` of each bound on a sum.
    sums: Vec<f64>,
}

impl<'a> Bounds<'a> {
    /// From A⁻¹ of the full model.
    fn of(standard: &'a Standard, prior: &'a Prior, inverse: &[f64]) -> Self {
        let size = standard.size();
        let cost = |block: &Block| -> f64 {
            let square: Vec<f64> = block
                .range()
                .flat_map(|i| inverse[i * size..][block.range()].iter().copied())
                .collect();
            let mut half = standard.center[block.range()].to_vec();
            match Cholesky::new(&square, block.len) {
                Ok(factor) => factor.solve_lower(&mut half),
                Err(_) => return 0.0,
            }
            half.iter().map(|x| x * x).sum()
        };
        Self {
            standard,
            prior,
            costs: standard.blocks.iter().map(cost).collect(),
            spread: (0..size).map(|d| inverse[d * size + d]).collect(),
            factors: standard.blocks.iter().map(|b| b.factor.ln()).sum::<f64>()
                + most_of_sums(standard),
            sums: standard
                .halves
                .iter()
                .map(|half| {
                    let pairs = |&(i, f): &(usize, f64)| {
                        let row = half.terms.iter().map(move |(j, g)| (i * size + j, f * g));
                        row.map(|(entry, product)| product * inverse[entry])
                            .sum::<f64>()
                    };
                    half.terms.iter().map(pairs).sum()
                })
                .collect(),
        }
    }

    /// `reference`: ln of the weight of any model.
    fn judge(&self, reference: f64) -> Certain {
        let standard = self.standard;
        let least = reference + NEGLIGIBLE;
        let most = ((self.factors - least).max(0.0) / standard.shape).exp_m1();
        let phi = 0.5 * (1.0 + most) / standard.shape;
        let far = |d: usize| {
            let reach = most.sqrt() + FAR * phi.sqrt();
            standard.lower[d] == f64::NEG_INFINITY
                || standard.center[d] - standard.lower[d] > reach * self.spread[d].sqrt()
        };
        let mut certain = Certain {
            reference,
            ..none(self.prior)
        };
        let near: Vec<&HalfSpace> = (standard.halves.iter().zip(&self.sums))
            .filter(|(half, spread)| {
                let reach = (most.sqrt() + FAR * phi.sqrt()) * spread.sqrt();
                let sum = half.terms.iter().map(|(d, f)| f * standard.center[*d]);
                sum.sum::<f64>() - half.lower <= reach
            })
            .map(|(half, _)| half)
            .collect();
        let in_sums = |d: usize| near.iter().any(|half| half.terms.iter().any(|t| t.0 == d));
        for (block, cost) in standard.blocks.iter().zip(&self.costs) {
            let (_, outside) = self.prior.next(block.family, 0, 0);
            let bound = self.factors + outside.ln() - standard.shape * cost.ln_1p();
            certain.sure[block.component] = bound < least;
            certain.settled[block.component] = block.range().all(|d| far(d) && !in_sums(d));
            certain.costs[block.component] = *cost;
        }
        // What holds a child holds its parent.
        for child in 0..certain.sure.len() {
            let mut parent = self.prior.parent_of(child).filter(|_| certain.sure[child]);
            while let Some(sure) = parent {
                certain.sure[sure] = true;
                parent = self.prior.parent_of(sure);
            }
        }
        certain
    }
}

/// ln of the weight of a good model, its bounds counted as the search's guide does: the full one and a climb.
fn climbed(standard: &Standard, prior: &Prior) -> f64 {
    let mut walker = Walker::new(standard, prior);
    let all: Vec<usize> = (0..standard.blocks.len()).collect();
    all.iter().for_each(|&block| walker.flip(block));
    walker.tableau.refine();
    climb(&mut walker, &all, &[]);
    walker.log_weight() + present(&walker, false).log_mass(standard)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::infer::testing::{Densities, grouped};
    use crate::infer::{approximate, exact};

    /// The problem with its structure settled, and with odds a hair short of that: as good as settled, but by the general road,
    /// where a model to measure by is looked for.
    fn roads(problem: &Problem, inside: &[bool]) -> [Problem; 2] {
        let mut settled = problem.clone();
        settled.prior = problem.prior.settled(inside);
        let mut general = settled.clone();
        general.prior.odds = vec![0.99 * SETTLED, 1.0 / (0.99 * SETTLED)];
        assert_eq!(settled.prior.settled_structure().as_deref(), Some(inside));
        assert_eq!(general.prior.settled_structure(), None);
        [settled, general]
    }

    fn judged(problem: &Problem) -> Certain {
        components(&Standard::new(problem).unwrap(), problem, None)
    }

    /// Every structure of five components, with and without bounds: what is in is certain and nothing else, as by the general road,
    /// and what it was measured by is the whole evidence, by multivariate t densities.
    #[test]
    fn a_settled_structure_is_its_own_measure() {
        let mut data = grouped(6, &[2, 2, 1, 3, 1], 60, true);
        let (mut acting, mut distant) = (0, 0);
        for set in 0..1 << 5 {
            let inside: Vec<bool> = (0..5).map(|c| set >> c & 1 == 1).collect();
            let [settled, general] = roads(&data.problem, &inside);
            let certain = judged(&settled);
            assert_eq!(certain.sure, inside);
            certain.is_like(&judged(&general));

            let standard = Standard::new(&settled).unwrap();
            let weight = weight_of(&standard, &settled, &inside).unwrap();
            let free = std::mem::replace(&mut data.problem, settled);
            let truth = Densities::new(&data);
            let off = standard.log_evidence(weight) - truth.log_evidence;
            assert!(off.abs() < 1e-9 * truth.log_evidence.abs(), "{set:b}");
            let got = exact::enumerate(&data.problem).unwrap();
            for k in 0..got.mean.len() {
                let off = (got.mean[k] - truth.mean[k]).abs();
                assert!(off < 1e-9 * (1.0 + truth.sd[k]), "{set:b}: mean {k}");
                let off = (got.sd[k] - truth.sd[k]).abs();
                assert!(off < 1e-7, "{set:b}: sd {k}");
            }
            data.problem = free;

            let mut bounded = data.problem.clone();
            for (k, lower) in bounded.prior.lower.iter_mut().enumerate() {
                *lower = [f64::NEG_INFINITY, -0.1, -1e3][k % 3];
            }
            let [settled, general] = roads(&bounded, &inside);
            let certain = judged(&settled);
            certain.is_like(&judged(&general));
            distant += certain.settled.iter().filter(|s| **s).count();
            acting += certain.settled.iter().filter(|s| !**s).count();
        }
        assert!(acting > 0 && distant > 0, "{acting} {distant}");
    }

    /// One column that may not be negative and whose posterior has its mean at −1.5 sd: the mass that is left, 0.0668 (1000 rows: the t
    /// distribution is normal to 0.2 %), counts twice, as the slab is half a normal distribution.
    #[test]
    fn a_bound_takes_its_share_of_the_weight() {
        let mean = -1.5 * (1.0_f64 / 1000.0).sqrt();
        let mut problem = Problem {
            gram: vec![1.0],
            xy: vec![mean],
            yy: mean * mean + 1.0,
            n: 1000.0,
            log_constant: 0.0,
            prior: Prior::single(
                vec![1e6],
                vec![0],
                crate::prior::Inclusion::Probability(0.5),
                (0.01, 1e-6),
            ),
            names: vec!["b".into()],
        };
        let weight = |problem: &Problem| {
            weight_of(&Standard::new(problem).unwrap(), problem, &[true]).unwrap()
        };
        let free = weight(&problem);
        problem.prior.lower = vec![0.0];
        let lost = weight(&problem) - free;
        assert!((lost - (2.0 * 0.0668_f64).ln()).abs() < 0.01, "{lost}");
    }

    /// Two columns that are settled to be out and explain the torque together only: y = b + 2.5 u + e of columns b, w + u/10 and
    /// w − u/10. Neither can leave alone (500 ln 7 > ln [`SETTLED`]), so that the general road measures by a model e^400 too light and
    /// leaves b open. By the settled structure b is certain; the posterior is that of b alone either way.
    #[test]
    fn a_settled_structure_needs_no_climb() {
        let problem = Problem {
            gram: vec![1.0, 0.0, 0.0, 0.0, 1.01, 0.99, 0.0, 0.99, 1.01],
            xy: vec![1.8, 0.25, -0.25],
            yy: 1.8 * 1.8 + 2.5 * 2.5 + 1.0,
            n: 1000.0,
            log_constant: 0.0,
            prior: Prior::single(
                vec![1e6; 3],
                vec![0; 3],
                crate::prior::Inclusion::Probability(0.5),
                (0.01, 1e-6),
            ),
            names: ["b", "plus", "minus"].map(String::from).to_vec(),
        };
        let inside = [true, false, false];
        let [settled, general] = roads(&problem, &inside);
        assert_eq!(judged(&general).sure, [false; 3]);
        assert_eq!(judged(&settled).sure, inside);

        let precision = 1.0 + 1e-6;
        let mean = 1.8 / precision;
        let scale = 1e-6 + 0.5 * (problem.yy - 1.8 * mean);
        let sd = (scale / (500.01 - 1.0) / precision).sqrt();
        for (road, got) in [
            ("settled", exact::enumerate(&settled).unwrap()),
            ("general", exact::enumerate(&general).unwrap()),
            ("search", approximate(&settled, None).unwrap()),
        ] {
            assert_eq!(got.models[0].members, [0], "{road}");
            assert!((got.mean[0] - mean).abs() < 1e-9 * sd, "{road}: mean");
            assert!((got.sd[0] / sd - 1.0).abs() < 1e-9, "{road}: sd");
            assert!(got.mean[1..].iter().all(|m| m.abs() < 1e-9), "{road}");
        }
    }
}
