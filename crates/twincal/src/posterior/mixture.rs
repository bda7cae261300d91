//! Mixtures of Student-t distributions with shared degrees of freedom: what a coefficient or a torque looks like after
//! averaging over models (method section 8).

use super::student::StudentT;
use crate::lanes::{LANES, Lane};

/// `(1 − spike) Σ_k w_k t_ν((y − location_k)/scale_k) + spike · [y ≥ 0]`, all slices of one length K ≥ 1.
#[derive(Debug, Clone, Copy)]
pub struct Mixture<'a> {
    /// w_k ≥ 0, sum 1.
    pub weights: &'a [f64],
    /// Location of each component.
    pub locations: &'a [f64],
    /// Scale of each component, ≥ 0; below 1e-150 it counts as 1e-150 (a point).
    pub scales: &'a [f64],
    /// Probability of exactly 0, 0 … 1.
    pub spike: f64,
}

/// A probability with the standard t quantile that belongs to it, worked out once for many mixtures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// p, 0 < p < 1.
    pub probability: f64,
    /// t_ν⁻¹(p).
    pub standard: f64,
}

impl Level {
    /// The level `probability` for one number of degrees of freedom.
    #[must_use]
    pub fn new(student: &StudentT, probability: f64) -> Self {
        Self {
            probability,
            standard: student.quantile(probability),
        }
    }

    /// Both ends of the central interval that holds `mass`.
    #[must_use]
    pub fn central(student: &StudentT, mass: f64) -> [Self; 2] {
        let high = Self::new(student, 0.5 + 0.5 * mass);
        [
            Self {
                probability: 0.5 - 0.5 * mass,
                standard: -high.standard,
            },
            high,
        ]
    }
}

/// Scales below this are points; its square and its inverse are finite.
const POINT: f64 = 1e-150;

impl Mixture<'_> {
    /// P(Y ≤ y); 1e-12.
    #[must_use]
    pub fn cdf(&self, student: &StudentT, y: f64) -> f64 {
        let continuous = self.continuous_cdf(student, y);
        (1.0 - self.spike) * continuous + if y >= 0.0 { self.spike } else { 0.0 }
    }

    /// The smallest y with P(Y ≤ y) ≥ p; exactly `location + scale · t_ν⁻¹(p)` for one component without spike, exactly 0
    /// where p falls into the spike.
    #[must_use]
    pub fn quantile(&self, student: &StudentT, level: Level) -> f64 {
        if self.spike <= 0.0 {
            return self.continuous_quantile(student, level);
        }
        let below = (1.0 - self.spike) * self.continuous_cdf(student, 0.0);
        let inside = if level.probability <= below {
            level.probability / (1.0 - self.spike)
        } else if level.probability <= below + self.spike {
            return 0.0;
        } else {
            // From the upper end, so that no digits are lost next to 1.
            1.0 - (1.0 - level.probability) / (1.0 - self.spike)
        };
        if inside <= 0.0 || inside >= 1.0 {
            return 0.0;
        }
        self.continuous_quantile(student, Level::new(student, inside))
    }

    fn continuous_cdf(&self, student: &StudentT, y: f64) -> f64 {
        let mut sum = 0.0;
        for ((&weight, &location), &scale) in
            self.weights.iter().zip(self.locations).zip(self.scales)
        {
            sum += weight * student.cdf((y - location) / scale.max(POINT));
        }
        sum
    }

    fn continuous_quantile(&self, student: &StudentT, level: Level) -> f64 {
        pulp::Arch::new().dispatch(Quantile {
            mixture: self,
            student,
            level,
        })
    }
}

/// A quantile of the continuous part.
struct Quantile<'a> {
    mixture: &'a Mixture<'a>,
    student: &'a StudentT,
    level: Level,
}

impl pulp::WithSimd for Quantile<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> f64 {
        self.solve()
    }
}

/// Error in probability with which a quantile is accepted, as a share of the smaller tail; scales of components from `narrowest` to `widest`.
///
/// A Halley step cubes the error: 1e-4 of the tail leaves 1e-11 of it where all components are about equally wide.
#[inline(always)]
pub(crate) fn accuracy(narrowest: f64, widest: f64) -> f64 {
    if narrowest > 0.1 * widest {
        1e-4
    } else {
        1e-13
    }
}

/// Where a quantile lies.
struct Bracket {
    /// The components' own quantiles: the least and the largest.
    low: f64,
    high: f64,
    /// Scales of the components: the least and the largest.
    narrowest: f64,
    widest: f64,
    /// Moments of the mixture about its first location.
    mean: f64,
    square: f64,
}

impl Bracket {
    /// For the same mixture at other locations.
    #[inline(always)]
    fn of(mixture: &Mixture<'_>, locations: &[f64], standard: f64) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let (mut narrowest, mut widest) = (f64::INFINITY, 0.0_f64);
        let (mut mean, mut square) = (0.0, 0.0);
        let anchor = locations[0];
        let parts = locations.iter().zip(mixture.scales);
        for (&weight, (&location, &scale)) in mixture.weights.iter().zip(parts) {
            let own = location + scale * standard;
            low = low.min(own);
            high = high.max(own);
            narrowest = narrowest.min(scale);
            widest = widest.max(scale);
            let shift = location - anchor;
            mean += weight * shift;
            square += weight * (shift * shift + scale * scale);
        }
        Self {
            low,
            high,
            narrowest,
            widest,
            mean,
            square,
        }
    }
}

impl Quantile<'_> {
    /// Halley's method on F(y) − p inside the bracket of the components' own quantiles, bisection where it leaves it; above the median
    /// that of the mirrored mixture, whose smaller tail keeps its digits.
    #[inline(always)]
    fn solve(self) -> f64 {
        let mixture = self.mixture;
        let mirror = self.level.probability > 0.5;
        let sign = if mirror { -1.0 } else { 1.0 };
        let probability = match mirror {
            true => 1.0 - self.level.probability,
            false => self.level.probability,
        };
        let standard = sign * self.level.standard;
        let locations: Vec<f64> = mixture.locations.iter().map(|l| sign * l).collect();
        let anchor = locations[0];
        let Bracket {
            mut low,
            mut high,
            narrowest,
            widest,
            mean,
            square,
        } = Bracket::of(mixture, &locations, standard);
        if low >= high {
            return sign * low;
        }
        // One t with the mixture's mean and second moment is the start.
        let mut y =
            (anchor + mean + (square - mean * mean).max(0.0).sqrt() * standard).clamp(low, high);
        let last = probability * accuracy(narrowest, widest);
        let inverses: Vec<f64> = (mixture.scales.iter())
            .map(|scale| 1.0 / scale.max(POINT))
            .collect();
        for _ in 0..200 {
            let [below, density, slope] = self.evaluate(&locations, &inverses, y);
            let excess = below - probability;
            if excess > 0.0 {
                high = y;
            } else {
                low = y;
            }
            let newton = excess / density;
            let next = y - newton / (1.0 - (0.5 * newton * slope / density).clamp(-0.5, 0.5));
            let inside = next > low && next < high;
            let next = if inside { next } else { 0.5 * (low + high) };
            let step = (next - y).abs();
            y = next;
            // A last step of 1e-5 of the narrowest component leaves 1e-15 of it.
            let cubed = inside && (excess.abs() <= last || step <= 1e-5 * narrowest);
            if cubed || step <= 4.0 * f64::EPSILON * y.abs() {
                break;
            }
        }
        sign * y
    }

    /// F, f and f' at `y`, eight components at a time.
    #[inline(always)]
    fn evaluate(&self, locations: &[f64], inverses: &[f64], y: f64) -> [f64; 3] {
        let mut sums = [[0.0; LANES]; 3];
        let (weights, last_weights) = self.mixture.weights.as_chunks::<LANES>();
        let (locations, last_locations) = locations.as_chunks::<LANES>();
        let (scales, last_inverses) = inverses.as_chunks::<LANES>();
        for ((weight, location), inverse) in weights.iter().zip(locations).zip(scales) {
            self.add([weight, location, inverse], y, &mut sums);
        }
        // What fills the last lanes weighs nothing.
        let (mut weight, mut location, mut inverse) = ([0.0; LANES], [y; LANES], [1.0; LANES]);
        let left = last_weights.len();
        weight[..left].copy_from_slice(last_weights);
        location[..left].copy_from_slice(last_locations);
        inverse[..left].copy_from_slice(last_inverses);
        self.add([&weight, &location, &inverse], y, &mut sums);
        sums.map(|lanes| lanes.iter().sum())
    }

    /// Adds what eight components have of F, f and f' at `y`.
    #[inline(always)]
    fn add(&self, [weight, location, inverse]: [&Lane; 3], y: f64, sums: &mut [Lane; 3]) {
        let mut t = [0.0; LANES];
        for lane in 0..LANES {
            t[lane] = (y - location[lane]) * inverse[lane];
        }
        let [below, density, slope] = self.student.lanes(&t);
        for lane in 0..LANES {
            let per_unit = weight[lane] * inverse[lane];
            sums[0][lane] += weight[lane] * below[lane];
            sums[1][lane] += per_unit * density[lane];
            sums[2][lane] += per_unit * inverse[lane] * slope[lane];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Deserialize)]
    struct Reference {
        cdf: Vec<CdfCase>,
        mixtures: Vec<MixtureCase>,
    }

    #[derive(Deserialize)]
    struct CdfCase {
        dof: f64,
        t: Vec<f64>,
        cdf: Vec<f64>,
        quantile_975: f64,
    }

    #[derive(Deserialize)]
    struct MixtureCase {
        dof: f64,
        spike: f64,
        weights: Vec<f64>,
        locations: Vec<f64>,
        scales: Vec<f64>,
        probabilities: Vec<f64>,
        quantiles: Vec<f64>,
    }

    /// Made by `tests/reference/twin/make_mixtures.py` with SciPy and mpmath.
    fn reference() -> Reference {
        serde_json::from_str(include_str!("../../tests/reference/twin/mixtures.json")).unwrap()
    }

    #[test]
    fn the_t_distribution_is_that_of_mpmath_from_one_to_ten_million_degrees() {
        for case in reference().cdf {
            let student = StudentT::new(case.dof);
            for (&t, &wanted) in case.t.iter().zip(&case.cdf) {
                let got = student.cdf(t);
                assert!(
                    (got - wanted).abs() < 1e-12,
                    "dof {}: P(T ≤ {t}) = {got}, not {wanted}",
                    case.dof
                );
                if t < 0.0 && wanted > 1e-15 {
                    assert!(
                        (got / wanted - 1.0).abs() < 1e-9,
                        "dof {}: lower tail at {t}: {got}, {wanted}",
                        case.dof
                    );
                }
            }
            let got = student.quantile(0.975);
            assert!(
                (got / case.quantile_975 - 1.0).abs() < 1e-11,
                "dof {}: {got} {}",
                case.dof,
                case.quantile_975
            );
        }
    }

    #[test]
    fn mixture_quantiles_are_those_of_mpmath() {
        for (number, case) in reference().mixtures.into_iter().enumerate() {
            let student = StudentT::new(case.dof);
            let mixture = Mixture {
                weights: &case.weights,
                locations: &case.locations,
                scales: &case.scales,
                spike: case.spike,
            };
            let widest = case.scales.iter().fold(0.0_f64, |a, &b| a.max(b));
            for (&p, &wanted) in case.probabilities.iter().zip(&case.quantiles) {
                let got = mixture.quantile(&student, Level::new(&student, p));
                assert!(
                    (got - wanted).abs() <= 1e-9 * widest,
                    "mixture {number}, p = {p}: {got}, not {wanted}"
                );
            }
        }
    }

    #[test]
    fn one_component_is_location_plus_scale_times_quantile_to_the_bit() {
        let student = StudentT::new(37.5);
        let [low, high] = Level::central(&student, 0.95);
        let mixture = Mixture {
            weights: &[1.0],
            locations: &[0.7],
            scales: &[0.3],
            spike: 0.0,
        };
        assert_eq!(mixture.quantile(&student, high), 0.7 + 0.3 * high.standard);
        assert_eq!(mixture.quantile(&student, low), 0.7 + 0.3 * low.standard);
    }

    #[test]
    fn the_spike_swallows_the_quantiles_that_fall_into_it() {
        let student = StudentT::new(10.0);
        let mixture = Mixture {
            weights: &[1.0],
            locations: &[5.0],
            scales: &[0.1],
            spike: 0.5,
        };
        let at = |p| mixture.quantile(&student, Level::new(&student, p));
        assert_eq!(at(0.025), 0.0);
        assert_eq!(at(0.4999), 0.0);
        assert!((at(0.75) - 5.0).abs() < 1e-10);
        let gone = Mixture {
            spike: 1.0,
            ..mixture
        };
        assert_eq!(gone.quantile(&student, Level::new(&student, 0.975)), 0.0);
    }

    #[test]
    fn a_point_component_gives_its_point_and_no_nan() {
        let student = StudentT::new(4.0);
        let mixture = Mixture {
            weights: &[0.5, 0.5],
            locations: &[0.0, 1.0],
            scales: &[0.0, 0.0],
            spike: 0.0,
        };
        assert!(mixture.quantile(&student, Level::new(&student, 0.25)).abs() < 1e-12);
        assert!((mixture.quantile(&student, Level::new(&student, 0.75)) - 1.0).abs() < 1e-12);
        assert_eq!(mixture.cdf(&student, 0.5), 0.5);
    }
}
