//! A model that walks: the tableau together with its weight, and what every step would do to it.
//!
//! ```text
//! ln weight(z) = ln p(z) + Σ ln factor − ½ ln |A_zz| Π v − a_n ln(1 + c_z)
//! ```
//!
//! What [`super::reduced::Reduced`] took out of the tableau counts in every term.

use super::kin::{Kin, Step};
use super::pivot::Pivot;
use super::standard::Standard;
use super::tableau::Tableau;
use crate::prior::Prior;

/// See the module's text. Components are numbered by their place in `standard.blocks`.
pub(super) struct Walker<'a> {
    pub(super) standard: &'a Standard,
    pub(super) tableau: Tableau<'a>,
    prior: &'a Prior,
    kin: Option<Kin>,
    /// Members of each family.
    members: Vec<usize>,
    /// Prior odds of one more member and 1 over them, by family and by the members beside it.
    odds: Vec<Vec<[f64; 2]>>,
    /// `Σ ln factor − ½ ln |A_zz| Π v` without ½ ln `squared`, the part that was not taken the logarithm of yet.
    log_slab: f64,
    squared: f64,
}

/// Products in this range go on as such.
const SMALL: std::ops::Range<f64> = 1e-100..1e100;

/// See [`Walker::odds`].
fn odds(prior: &Prior) -> Vec<Vec<[f64; 2]>> {
    let sizes = prior.family_sizes();
    let one_more = |family: usize, others: usize| {
        let (p, q) = prior.next(family, others, sizes[family] - 1);
        [p / q, q / p]
    };
    sizes
        .iter()
        .enumerate()
        .map(|(family, &size)| (0..size).map(|others| one_more(family, others)).collect())
        .collect()
}

impl<'a> Walker<'a> {
    /// The empty model.
    pub(super) fn new(standard: &'a Standard, prior: &'a Prior) -> Self {
        Self {
            standard,
            tableau: Tableau::new(standard),
            prior,
            kin: Kin::new(standard, prior),
            members: standard.held.clone(),
            odds: odds(prior),
            log_slab: standard.log_held,
            squared: 1.0,
        }
    }

    /// Whether moving a component changes what others may do.
    pub(super) fn has_kin(&self) -> bool {
        self.kin.is_some()
    }

    /// Number of families.
    pub(super) fn families(&self) -> usize {
        self.members.len()
    }

    /// ln of the present model's weight; it must be one that heredity allows.
    pub(super) fn log_weight(&self) -> f64 {
        self.prior.log_model(&self.members) + self.log_slab + 0.5 * self.squared.ln()
            - self.standard.shape * self.tableau.excess.ln_1p()
    }

    /// Moves a component in or out.
    pub(super) fn flip(&mut self, block: usize) {
        let own = self.standard.blocks[block];
        let (d, _) = self.tableau.block(block);
        let factor = own.factor * own.factor;
        if self.tableau.holds(block) {
            self.members[own.family] -= 1;
            self.squared /= d * factor;
        } else {
            self.members[own.family] += 1;
            self.squared *= factor / d;
        }
        if !SMALL.contains(&self.squared) {
            self.log_slab += 0.5 * std::mem::replace(&mut self.squared, 1.0).ln();
        }
        if let Some(log_determinant) = self.tableau.flip_block(block) {
            let held = |b: &usize| self.tableau.holds(*b);
            let factors: f64 = (0..self.standard.blocks.len())
                .filter(held)
                .map(|b| self.standard.blocks[b].factor.ln())
                .sum();
            self.log_slab = self.standard.log_held + factors - 0.5 * log_determinant;
            self.squared = 1.0;
        }
    }

    /// Takes a step.
    pub(super) fn take(&mut self, step: &Step) {
        for &block in step.leaving.iter().chain(&step.entering) {
            self.flip(block);
        }
    }

    /// A priori, how much likelier a component is where it is not; the slab's mass within the bounds included. 0 where heredity
    /// forbids the move.
    #[inline(always)]
    pub(super) fn flip_odds(&self, block: usize) -> f64 {
        if let Some(kin) = &self.kin
            && !kin.may_flip(&self.tableau, block)
        {
            return 0.0;
        }
        self.free_odds(block)
    }

    /// A priori, how much likelier one more member of a family is, and one less; 0 where there is none to come or to go.
    #[inline(always)]
    pub(super) fn family_odds(&self, family: usize) -> [f64; 2] {
        let (odds, members) = (&self.odds[family], self.members[family]);
        let more = odds.get(members).map_or(0.0, |[odds, _]| *odds);
        let less = members.checked_sub(1).map_or(0.0, |others| odds[others][1]);
        [more, less]
    }

    /// [`Walker::flip_odds`] without heredity.
    #[inline(always)]
    fn free_odds(&self, block: usize) -> f64 {
        let own = &self.standard.blocks[block];
        let inside = self.tableau.holds(block);
        let others = self.members[own.family] - usize::from(inside);
        let [odds, inverse] = self.odds[own.family][others];
        if inside {
            inverse / own.factor
        } else {
            odds * own.factor
        }
    }

    /// (ln of the weight's growth, c after) of moving one component.
    #[inline(always)]
    pub(super) fn flip_gain(&self, block: usize) -> (f64, f64) {
        let (d, square) = self.tableau.block(block);
        let sign = if self.tableau.holds(block) { 1.0 } else { -1.0 };
        let (misfit, after) = self.misfits(sign * square);
        let gain =
            self.flip_odds(block).ln() - 0.5 * d.ln() - self.standard.shape * (after / misfit).ln();
        (gain, after - 1.0)
    }

    /// Prior ratio of an exchange of single components, slab's mass within the bounds included.
    #[inline(always)]
    pub(super) fn exchange_odds(&self, leaving: usize, entering: usize) -> f64 {
        let (out, into) = (
            &self.standard.blocks[leaving],
            &self.standard.blocks[entering],
        );
        if let Some(kin) = &self.kin
            && !kin.may_exchange(&self.tableau, leaving, entering)
        {
            return 0.0;
        }
        if out.family == into.family {
            into.factor / out.factor
        } else {
            self.free_odds(leaving) * self.free_odds(entering)
        }
    }

    /// (ln of the weight's growth, c after, the pivot) of an exchange.
    pub(super) fn exchange_gain(&self, step: &Step) -> (f64, f64, Pivot) {
        let pivot = Pivot::new(&self.tableau, &step.leaving, &step.entering);
        let (misfit, after) = self.misfits(pivot.change);
        if let Some(kin) = &self.kin
            && !kin.may_take(&self.tableau, step)
        {
            return (f64::NEG_INFINITY, after - 1.0, pivot);
        }
        let mut members = self.members.clone();
        let mut log_factor = 0.0;
        for &block in &step.leaving {
            members[self.standard.blocks[block].family] -= 1;
            log_factor -= self.standard.blocks[block].factor.ln();
        }
        for &block in &step.entering {
            members[self.standard.blocks[block].family] += 1;
            log_factor += self.standard.blocks[block].factor.ln();
        }
        let prior = self.log_prior_change(&members);
        let gain = prior + log_factor
            - 0.5 * pivot.determinant.ln()
            - self.standard.shape * (after / misfit).ln();
        (gain, after - 1.0, pivot)
    }

    /// `ln p(z') − ln p(z)` by the members of each family, one urn draw per difference.
    fn log_prior_change(&self, members: &[usize]) -> f64 {
        let mut sum = 0.0;
        for (family, (&now, &then)) in self.members.iter().zip(members).enumerate() {
            let odds = |others: usize| self.odds[family][others][0].ln();
            sum += (now..then).map(odds).sum::<f64>() - (then..now).map(odds).sum::<f64>();
        }
        sum
    }

    /// 1 + c now and after a change of c.
    fn misfits(&self, change: f64) -> (f64, f64) {
        let misfit = 1.0 + self.tableau.excess;
        // c ≥ 0: no model fits better than the full one does, whatever rounding says.
        (misfit, (misfit + change).max(1.0))
    }
}
