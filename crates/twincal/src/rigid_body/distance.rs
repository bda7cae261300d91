//! How far a found inertia is from every rigid body, in posterior standard deviations.

use super::projection::{Link, Scale, project};
use crate::linear_algebra::Cholesky;
use crate::random::Random;

/// Spread of parameters that the posterior holds still, in the link's own units: half of what is found of a point mass or a thin rod lies
/// beyond the bound by so little.
const STILL: f64 = 0.01;
/// Spread of parameters that no torque shows, likewise.
const HIDDEN: f64 = 1e3;
/// How much heavier the posterior weighs than the pull of [`project`] towards a sound body.
const WEIGHT: f64 = 1e4;

/// Draws behind a chance at most, and how many of them as far off as what was found are enough: the chance is then known to a quarter.
const DRAWS: usize = 1000;
const ENOUGH: usize = 20;

/// What a posterior says of a body's ten parameters, in the body's frame, and which of them no torque shows.
#[derive(Debug, Clone)]
pub(crate) struct Found {
    pub(crate) nominal: [f64; 10],
    pub(crate) mean: [f64; 10],
    /// 10 × 10, row-major.
    pub(crate) covariance: Vec<f64>,
    pub(crate) hidden: [bool; 10],
}

impl Found {
    /// Chance that the parameters of a rigid body are found as far from those of every rigid body, of the body that is nearest to what was
    /// found; `None` where that drowns in rounding. Where the truth lies on more bounds than that body, as a point mass does, the chance is
    /// too small.
    ///
    /// ```text
    /// d² = min (π − π̂)ᵀ C⁻¹ (π − π̂) over bodies π, at π°        P(d²(π° + e) ≥ d²),  e ~ N(0, C)
    /// ```
    /// # Source
    /// Davison & Hinkley 1997, section 4.4 (parametric bootstrap test).
    pub(crate) fn chance(&self, random: &mut Random) -> Option<f64> {
        let metric = self.metric()?;
        let (distance, nearest) = self.nearest(self.mean, &metric)?;
        if distance == 0.0 {
            return Some(1.0);
        }
        let root = Cholesky::new(&self.relative(false), 10).ok()?;
        let (lower, units) = (root.lower(), self.units());
        let (mut drawn, mut judged, mut farther) = (0, 0, 0);
        while drawn < DRAWS && farther < ENOUGH {
            let normal: [f64; 10] = std::array::from_fn(|_| random.normal());
            let found = std::array::from_fn(|k| {
                let error: f64 = (0..=k).map(|j| lower[10 * k + j] * normal[j]).sum();
                nearest[k] + units[k] * error
            });
            drawn += 1;
            let Some((own, _)) = self.nearest(found, &metric) else {
                continue;
            };
            judged += 1;
            farther += usize::from(own >= distance);
        }
        (2 * judged >= drawn).then(|| (1 + farther) as f64 / (1 + judged) as f64)
    }

    /// `WEIGHT` times the inverse of the covariance.
    fn metric(&self) -> Option<Vec<f64>> {
        let units = self.units();
        let mut metric = Cholesky::new(&self.relative(true), 10).ok()?.inverse();
        for (at, value) in metric.iter_mut().enumerate() {
            *value *= WEIGHT / (units[at / 10] * units[at % 10]);
        }
        Some(metric)
    }

    /// Distance of the nearest body from `found`, in standard deviations, and its parameters.
    fn nearest(&self, found: [f64; 10], metric: &[f64]) -> Option<(f64, [f64; 10])> {
        let link = Link {
            name: "",
            nominal: self.nominal,
            found,
        };
        let (bodies, projection) = project(&[link], || Ok(metric.to_vec())).ok()?;
        let distance = projection.map_or(0.0, |nearest| nearest.distance / WEIGHT.sqrt());
        Some((distance, bodies[0]))
    }

    fn units(&self) -> [f64; 10] {
        let link = Link {
            name: "",
            nominal: self.nominal,
            found: self.mean,
        };
        Scale::of(&link).units()
    }

    /// The covariance in the body's own units, with what holds the rest; hidden parameters are `free` or still.
    fn relative(&self, free: bool) -> Vec<f64> {
        let units = self.units();
        let mut relative: Vec<f64> = (self.covariance.iter().enumerate())
            .map(|(at, value)| value / (units[at / 10] * units[at % 10]))
            .collect();
        for (k, hidden) in self.hidden.iter().enumerate() {
            let spread = if *hidden && free { HIDDEN } else { STILL };
            relative[11 * k] += spread * spread;
        }
        relative
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{Inertia, Placement, body_parameters};

    const SEEN: [bool; 10] = [false; 10];

    fn ball(mass: f64, com: [f64; 3], moment: f64) -> [f64; 10] {
        let tensor =
            std::array::from_fn(|i| std::array::from_fn(|j| if i == j { moment } else { 0.0 }));
        body_parameters(&Inertia { mass, com, tensor }, &Placement::IDENTITY)
    }

    fn of(mean: [f64; 10], covariance: Vec<f64>, hidden: [bool; 10]) -> Found {
        let nominal = ball(1.0, [0.0; 3], 0.1);
        Found {
            nominal,
            mean,
            covariance,
            hidden,
        }
    }

    fn distance(found: &Found) -> f64 {
        let metric = found.metric().expect("a metric");
        found.nearest(found.mean, &metric).expect("a distance").0
    }

    fn diagonal(sd: [f64; 10]) -> Vec<f64> {
        let mut covariance = vec![0.0; 100];
        for (k, sd) in sd.iter().enumerate() {
            covariance[11 * k] = sd * sd;
        }
        covariance
    }

    /// One free parameter: the bound is where it is zero.
    #[test]
    fn a_negative_mass_is_as_far_off_as_it_is_negative() {
        let mut found = ball(1.0, [0.0; 3], 0.1);
        found[0] = -2.0;
        let mut sd = [0.0; 10];
        sd[0] = 0.5;
        let own = of(found, diagonal(sd), SEEN);
        assert!((distance(&own) - 4.0).abs() < 0.02, "{}", distance(&own));
        // Of one free parameter at its bound: P(z > 4) = 3e-5, and of a body that is none of the draws matter.
        assert!(own.chance(&mut Random::new(3, 0)).expect("a chance") < 0.005);
        let body = of(ball(3.0, [0.1, 0.0, 0.0], 0.2), diagonal(sd), SEEN);
        assert_eq!(distance(&body), 0.0);
        assert_eq!(body.chance(&mut Random::new(3, 0)), Some(1.0));
    }

    /// Moments that no torque shows do not count.
    #[test]
    fn what_is_hidden_is_free() {
        let mut found = ball(1.0, [0.0; 3], 0.1);
        (found[4], found[7]) = (-5.0, -5.0);
        let far = |hidden| distance(&of(found, diagonal([0.01; 10]), hidden));
        let mut hidden = SEEN;
        assert!(far(hidden) > 100.0);
        (hidden[4], hidden[7]) = (true, true);
        assert!(far(hidden) < 0.1);
    }

    /// One standard deviation below the bound of the mass, all else far inside: P(z > 1) = 0.159, of 20 of about 126 draws. Beyond the
    /// limits by chance: below 1e-3.
    #[test]
    fn the_chance_at_a_single_bound_is_the_tail_of_a_normal() {
        let mut found = ball(1.0, [0.0; 3], 0.1);
        found[0] = -1.0;
        let mut sd = [0.0; 10];
        sd[0] = 1.0;
        let chance = of(found, diagonal(sd), SEEN).chance(&mut Random::new(5, 0));
        let chance = chance.expect("a chance");
        assert!((0.07..0.31).contains(&chance), "{chance}");
    }

    /// A small ball, nearly a point, far out on a link, known as poorly as a log may know it, found with errors of that covariance: of 50 five
    /// or more with a chance below 0.01 would have a probability below 0.003 if it were two in a hundred.
    #[test]
    fn a_small_ball_is_rarely_found_too_far_from_every_body() {
        let truth = ball(1.6, [0.1, 0.02, -0.03], 2e-3);
        let sd = [0.01, 2e-3, 2e-3, 2e-3, 0.02, 0.01, 0.01, 0.02, 0.01, 0.02];
        let mut random = Random::new(11, 0);
        let mut contradicted = 0;
        for _ in 0..50 {
            let found = std::array::from_fn(|k| truth[k] + sd[k] * random.normal());
            let own = of(found, diagonal(sd), SEEN);
            let chance = own.chance(&mut random).expect("a chance");
            contradicted += usize::from(chance < 0.01);
        }
        assert!(contradicted < 5, "{contradicted}");
    }
}
