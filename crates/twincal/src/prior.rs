//! What is believed before the data: spike and slab in the user's words (method section 6).

use crate::signal::Auto;
use crate::term::Family;
use serde::{Deserialize, Serialize};

mod heredity;

/// `[prior] inclusion`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Inclusion {
    /// Every component independently with this probability.
    Probability(f64),
    /// Beta–Binomial(1, C/m0 − 1) per family, C all components: m0 components expected in total.
    ExpectedTerms(f64),
}

/// `[prior]`.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorSettings {
    /// v in `β_k·rms(column k) ~ N(0, v φ)`; auto: learned.
    pub scaled_variance: Auto,
    /// `None`: `ExpectedTerms(min(5, K/2))`.
    pub inclusion: Option<Inclusion>,
    /// `(a0, b0)` of `φ ~ InvGamma`; b0 in (N·m)²; `None`: a0 = 1e-3 and b0 of [`crate::likelihood::auto_scale`].
    pub noise: Option<(f64, f64)>,
    /// Expected number of components of single families, instead of what `inclusion` says of them.
    pub families: Vec<(Family, f64)>,
    /// Names of components that are in, whatever the data say.
    pub forced: Vec<String>,
    /// `(child, parent)`: the child is in only where its parent is. Components by name, or families by [`Family::word`], joint by
    /// joint. `None`: [`HEREDITY`].
    pub heredity: Option<Vec<(String, String)>>,
}

/// What is in only with what, unless the user says otherwise: the Stribeck effect and asymmetry are changes of Coulomb friction,
/// which no nominal model here contains, quadratic friction is one of viscous friction, a coupled
/// motor that has inertia has friction, which is the larger part of its torque, and a link whose centre of mass is elsewhere has another
/// mass. Hysteresis and warmth are changes of Coulomb friction, too.
pub const HEREDITY: [(&str, &str); 7] = [
    ("asymmetry", "coulomb"),
    ("stribeck", "coulomb"),
    ("quadratic_friction", "viscous"),
    ("coupled_inertia", "coupled_friction"),
    ("hysteresis", "coulomb"),
    ("warm_up", "coulomb"),
    ("mass_moments", "density"),
];

/// Factor on prior odds that settles a component: what the data say weighs nothing beside it (e^690).
pub const SETTLED: f64 = 1e300;

/// The prior with every number filled in, for the K columns and C components of one problem.
///
/// A component is in or out with all its columns: a payload (10 columns), a friction (1). Components are independent of
/// each other but for the Beta–Binomial of their family and for heredity: a model that holds a child without its parent has
/// probability 0, and all others share what it would have had ([`Prior::log_admissible`]).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Prior {
    /// v_k: `β_k | z_k=1, φ ~ N(0, φ v_k)` in the column's own units, K.
    pub slab: Vec<f64>,
    /// Component of each column (0..C, every one with at least one column, in any order), K.
    pub component: Vec<usize>,
    /// Family of each component (0..families), C.
    pub family: Vec<usize>,
    /// Heredity: the component without which this one is never in, C; empty: none. No component is its own ancestor.
    pub parent: Vec<Option<usize>>,
    /// r_f > 0: factor on the prior odds of the components of each family; 1 leaves them alone.
    pub odds: Vec<f64>,
    /// β_k ≥ lower_k (≤ 0, so that 0 is allowed); −∞: free, K. The slab is truncated there and normalised again.
    #[serde(deserialize_with = "free_if_null")]
    pub lower: Vec<f64>,
    /// Bounds on sums of coefficients; the slab of a model is truncated to what acts there and normalised again.
    pub halves: Vec<HalfSpace>,
    /// Inclusion.
    pub inclusion: Inclusion,
    /// a0.
    pub shape: f64,
    /// b0, (N·m)².
    pub scale: f64,
}

/// `Σ factor · β_k ≥ lower` over the columns that are in.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HalfSpace {
    /// (column, factor), the first factor positive.
    pub terms: Vec<(usize, f64)>,
    /// At most 0.
    pub lower: f64,
    /// It acts where of each of these sets a column is in.
    pub with: Vec<Vec<usize>>,
    /// The column, first of `terms`, whose own bound this one and its mirror image imply. Without it the others would be exactly 0 where
    /// `lower` is: such models have no probability.
    pub replaces: Option<usize>,
    /// Bounds of different groups share no column.
    pub group: usize,
}

/// JSON has no −∞: it is written as null.
fn free_if_null<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
    let bounds: Vec<Option<f64>> = Deserialize::deserialize(from)?;
    let free = |bound: Option<f64>| bound.unwrap_or(f64::NEG_INFINITY);
    Ok(bounds.into_iter().map(free).collect())
}

impl HalfSpace {
    /// Whether it acts in a model with these columns.
    pub fn acts(&self, inside: impl Fn(usize) -> bool) -> bool {
        let mut sets = self.with.iter();
        sets.all(|set| set.iter().any(|&k| inside(k)))
    }

    /// Whether it forbids a model with these columns.
    pub fn forbids(&self, inside: impl Fn(usize) -> bool) -> bool {
        let first = self.replaces.is_some_and(&inside);
        self.replaces.is_some() && !first && self.lower == 0.0 && self.acts(inside)
    }
}

impl Prior {
    /// Every column a component of its own, `family` by column, no bounds and equal odds.
    pub fn single(
        slab: Vec<f64>,
        family: Vec<usize>,
        inclusion: Inclusion,
        (shape, scale): (f64, f64),
    ) -> Self {
        let families = family.iter().map(|f| f + 1).max().unwrap_or(0);
        Self {
            component: (0..slab.len()).collect(),
            lower: vec![f64::NEG_INFINITY; slab.len()],
            halves: Vec::new(),
            odds: vec![1.0; families],
            slab,
            family,
            parent: Vec::new(),
            inclusion,
            shape,
            scale,
        }
    }

    /// The same slabs and bounds with the structure settled: the components in `inside` are in, all others out.
    #[must_use]
    pub fn settled(&self, inside: &[bool]) -> Self {
        Self {
            family: inside.iter().map(|&inside| usize::from(!inside)).collect(),
            parent: Vec::new(),
            odds: vec![SETTLED, 1.0 / SETTLED],
            inclusion: Inclusion::Probability(0.5),
            ..self.clone()
        }
    }

    /// The components that are in, where every one is settled as [`Prior::settled`] does it.
    pub fn settled_structure(&self) -> Option<Vec<bool>> {
        let inside = |&family: &usize| match self.odds[family] {
            odds if odds >= SETTLED => Some(true),
            odds if odds <= 1.0 / SETTLED => Some(false),
            _ => None,
        };
        self.family.iter().map(inside).collect()
    }

    /// C.
    pub fn components(&self) -> usize {
        self.family.len()
    }

    /// Columns of each component, ascending.
    pub fn columns(&self) -> Vec<Vec<usize>> {
        let mut columns = vec![Vec::new(); self.components()];
        for (k, &c) in self.component.iter().enumerate() {
            columns[c].push(k);
        }
        columns
    }

    /// Family of a column's component.
    pub fn family_of(&self, column: usize) -> usize {
        self.family[self.component[column]]
    }

    /// Number of families.
    pub fn families(&self) -> usize {
        self.odds.len()
    }

    /// Components per family.
    pub fn family_sizes(&self) -> Vec<usize> {
        let mut sizes = vec![0; self.families()];
        self.family.iter().for_each(|&f| sizes[f] += 1);
        sizes
    }

    /// `(P(z = 1), P(z = 0))` of the next component of a family of which `seen` components are decided, `included` of
    /// them in: the Pólya urn of the Beta–Binomial(1, b_f). Multiplied over all components, in any order, it gives the
    /// prior probability of a model.
    ///
    /// ```text
    /// P(z = 1 | included, seen) = (1 + included) / (1 + b_f + seen),     b_f = (C/m0 − 1) / r_f
    /// ```
    ///
    /// The odds of a component alone are `1/b_f`: r_f times those of a family with r = 1, whatever r_f is.
    ///
    /// # Example
    /// Of ten components one is expected: the first is in with probability 0.1, the second with 2/11 once the first is in.
    /// ```
    /// use twincal::prior::{Inclusion, Prior};
    ///
    /// let prior = Prior::single(vec![1.0; 10], vec![0; 10], Inclusion::ExpectedTerms(1.0), (1.0, 1.0));
    /// assert!((prior.next(0, 0, 0).0 - 0.1).abs() < 1e-12); // family 0, none in, none decided
    /// assert!((prior.next(0, 1, 1).0 - 2.0 / 11.0).abs() < 1e-12);
    /// ```
    pub fn next(&self, family: usize, included: usize, seen: usize) -> (f64, f64) {
        let odds = self.odds[family];
        match self.inclusion {
            Inclusion::Probability(p) => {
                let total = p * odds + (1.0 - p);
                (p * odds / total, (1.0 - p) / total)
            }
            Inclusion::ExpectedTerms(expected) => {
                let b = (self.components() as f64 / expected - 1.0) / odds;
                let total = 1.0 + b + seen as f64;
                (
                    (1.0 + included as f64) / total,
                    (b + (seen - included) as f64) / total,
                )
            }
        }
    }

    /// `ln p(z)` of a model by its number of components in each family, [`Prior::log_admissible`] not taken off.
    pub fn log_model(&self, members: &[usize]) -> f64 {
        self.family_sizes()
            .iter()
            .zip(members)
            .enumerate()
            .map(|(f, (&size, &included))| self.log_family(f, size, included))
            .sum()
    }

    /// `ln p` of one set of `included` of a family's `size` components.
    pub(crate) fn log_family(&self, family: usize, size: usize, included: usize) -> f64 {
        let inside: f64 = (0..included).map(|i| self.next(family, i, i).0.ln()).sum();
        let outside = |seen| self.next(family, included, seen).1.ln();
        inside + (included..size).map(outside).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn prior(inclusion: Inclusion) -> Prior {
        Prior::single(
            vec![1.0; 7],
            vec![0, 1, 0, 1, 0, 0, 1],
            inclusion,
            (1e-3, 1e-3),
        )
    }

    #[test]
    fn a_settled_prior_says_what_is_in() {
        let open = prior(Inclusion::Probability(0.3));
        assert_eq!(open.settled_structure(), None);
        let inside = [true, false, false, true, true, false, true];
        assert_eq!(
            open.settled(&inside).settled_structure(),
            Some(inside.to_vec())
        );
        // Also where one of the two families is empty.
        for all in [[true; 7], [false; 7]] {
            assert_eq!(open.settled(&all).settled_structure(), Some(all.to_vec()));
        }
        let mut half = open.settled(&inside);
        half.odds[1] = 1.0;
        assert_eq!(half.settled_structure(), None);
    }

    /// ln Γ by Stirling's series with recurrence: independent of the urn.
    fn ln_gamma(x: f64) -> f64 {
        if x < 20.0 {
            return ln_gamma(x + 1.0) - x.ln();
        }
        (x - 0.5) * x.ln() - x + 0.5 * (2.0 * std::f64::consts::PI).ln() + 1.0 / (12.0 * x)
            - 1.0 / (360.0 * x.powi(3))
            + 1.0 / (1260.0 * x.powi(5))
    }

    fn ln_beta(a: f64, b: f64) -> f64 {
        ln_gamma(a) + ln_gamma(b) - ln_gamma(a + b)
    }

    #[test]
    fn the_urn_is_the_beta_binomial_of_each_family() {
        let prior = prior(Inclusion::ExpectedTerms(2.0));
        let b = 7.0 / 2.0 - 1.0;
        for m0 in 0..=4usize {
            for m1 in 0..=3usize {
                let expected = ln_beta(1.0 + m0 as f64, b + 4.0 - m0 as f64) - ln_beta(1.0, b)
                    + ln_beta(1.0 + m1 as f64, b + 3.0 - m1 as f64)
                    - ln_beta(1.0, b);
                assert!(
                    (prior.log_model(&[m0, m1]) - expected).abs() < 1e-12,
                    "{m0} {m1}"
                );
            }
        }
    }

    /// Odds of a component alone, and of the second once the first is in: closed forms.
    #[test]
    fn a_familys_odds_are_multiplied() {
        let mut prior = prior(Inclusion::Probability(0.2));
        prior.odds[1] = 0.1;
        let (inside, outside) = prior.next(1, 0, 0);
        assert!(
            (inside / outside - 0.1 * 0.25).abs() < 1e-15 && (inside + outside - 1.0).abs() < 1e-15
        );
        prior.inclusion = Inclusion::ExpectedTerms(2.0);
        let (inside, outside) = prior.next(1, 0, 0);
        assert!((inside / outside - 0.1 / 2.5).abs() < 1e-15);
        prior.odds[1] = 1e6;
        let (inside, outside) = prior.next(1, 1, 1);
        assert!(outside > 0.0 && (inside / outside - 2e6 / 2.5).abs() < 1e-3);
    }

    /// Probabilities sum to one and the expected number of terms is the stated one.
    #[test]
    fn expected_terms_are_expected() {
        for (inclusion, expected) in [
            (Inclusion::ExpectedTerms(2.0), 2.0),
            (Inclusion::Probability(0.2), 1.4),
        ] {
            let prior = prior(inclusion);
            let (mut total, mut terms) = (0.0, 0.0);
            for model in 0u32..128 {
                let mut members = [0, 0];
                (0..7)
                    .filter(|k| model >> k & 1 == 1)
                    .for_each(|k| members[prior.family[k]] += 1);
                let p = prior.log_model(&members).exp();
                total += p;
                terms += p * f64::from(model.count_ones());
            }
            assert!(
                (total - 1.0).abs() < 1e-13 && (terms - expected).abs() < 1e-12,
                "{total} {terms}"
            );
        }
    }
}
