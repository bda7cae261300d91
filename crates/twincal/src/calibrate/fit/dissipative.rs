//! Friction takes energy in each direction of motion: bounds on sums of coefficients.
//!
//! ```text
//! σ = ±1, the direction of motion:
//! c + σ a ≥ 0,    v + σ b ≥ 0                                                   Coulomb and viscous friction of each direction
//! (c + σ a) + (v + σ b) x + w x² + s exp(−(x/0.1)²) ≥ 0                         at x = 0⁺, v_s and the largest logged speed
//! ```
//! with Coulomb friction c and viscous friction v (the model's own included), asymmetry a and b, quadratic friction w and Stribeck friction
//! s. The second line acts where w or s is in.

use crate::likelihood::Columns;
use crate::prior::HalfSpace;
use crate::robot::Robot;
use crate::term::{LibrarySettings, STRIBECK_VELOCITY};

/// The bounds of every joint; `hull`: ranges of q, q̇, q̈ of the training rows. None where friction may be negative
/// ([`LibrarySettings::nonnegative`]).
pub(in crate::calibrate) fn halves(
    robot: &Robot,
    settings: &LibrarySettings,
    columns: &Columns,
    hull: &[[f64; 6]],
) -> Vec<HalfSpace> {
    if !settings.nonnegative {
        return Vec::new();
    }
    let place = |name: String| columns.names.iter().position(|own| *own == name);
    let names = robot.joint_names().into_iter().enumerate();
    names
        .flat_map(|(joint, name)| {
            let place = |suffix: &str| place(format!("{name}.{suffix}"));
            let friction = Friction {
                group: joint,
                dry: place("coulomb"),
                viscous: place("viscous"),
                asymmetry: [place("asymmetry.coulomb"), place("asymmetry.viscous")],
                stribeck: place("stribeck"),
                quadratic: place("quadratic_friction"),
                damping: robot.joint(joint).damping,
            };
            let [_, _, low, high, ..] = hull[joint];
            let fastest = low.abs().max(high.abs());
            friction.halves([0.0, settings.coulomb_velocity, fastest])
        })
        .collect()
}

/// Where the columns of one joint's friction are.
struct Friction {
    group: usize,
    dry: Option<usize>,
    viscous: Option<usize>,
    asymmetry: [Option<usize>; 2],
    stribeck: Option<usize>,
    quadratic: Option<usize>,
    /// Viscous friction of the model, N·m·s/rad or N·s/m.
    damping: f64,
}

impl Friction {
    /// All bounds; the curve's at these speeds, rad/s or m/s.
    fn halves(&self, speeds: [f64; 3]) -> Vec<HalfSpace> {
        let mut all = Vec::new();
        for direction in [1.0, -1.0] {
            all.extend(self.each_way(direction));
            for (i, speed) in speeds.into_iter().enumerate() {
                if speed.is_finite() && !speeds[..i].contains(&speed) {
                    all.extend(self.total(direction, speed));
                }
            }
        }
        all
    }

    /// Coulomb and viscous friction of one direction.
    fn each_way(&self, direction: f64) -> Vec<HalfSpace> {
        let pairs = [
            (self.dry, self.asymmetry[0], 0.0),
            (self.viscous, self.asymmetry[1], -self.damping),
        ];
        let bound = |(own, half, lower): (Option<usize>, Option<usize>, f64)| {
            let (own, half) = (own?, half?);
            Some(HalfSpace {
                terms: vec![(own, 1.0), (half, direction)],
                lower,
                with: vec![vec![half]],
                replaces: Some(own),
                group: self.group,
            })
        };
        pairs.into_iter().filter_map(bound).collect()
    }

    /// All friction of one direction at one speed.
    fn total(&self, direction: f64, speed: f64) -> Option<HalfSpace> {
        let fall = (-(speed / STRIBECK_VELOCITY).powi(2)).exp();
        let terms = [
            (self.dry, 1.0),
            (self.asymmetry[0], direction),
            (self.viscous, speed),
            (self.asymmetry[1], direction * speed),
            (self.quadratic, speed * speed),
            (self.stribeck, fall),
        ];
        let terms: Vec<(usize, f64)> = (terms.into_iter())
            .filter_map(|(column, factor)| Some((column?, factor)))
            .filter(|(_, factor)| *factor != 0.0)
            .collect();
        let inside = |columns: &[Option<usize>]| -> Vec<usize> {
            let own = columns.iter().flatten().copied();
            own.filter(|k| terms.iter().any(|(column, _)| column == k))
                .collect()
        };
        let mut with = vec![inside(&[self.stribeck, self.quadratic])];
        if direction < 0.0 {
            // Without asymmetry both directions say the same.
            with.push(inside(&self.asymmetry));
        }
        let acts = with.iter().all(|some| !some.is_empty());
        acts.then(|| HalfSpace {
            lower: -self.damping * speed,
            with,
            replaces: None,
            group: self.group,
            terms,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn friction() -> Friction {
        Friction {
            group: 0,
            dry: Some(0),
            viscous: Some(1),
            asymmetry: [Some(2), Some(3)],
            stribeck: Some(4),
            quadratic: Some(5),
            damping: 0.5,
        }
    }

    /// What the bounds allow is what the friction curve itself does not make negative: 2000 coefficients, curve evaluated in both
    /// directions at the three speeds.
    #[test]
    fn allowed_is_what_dissipates() {
        let speeds = [0.0, 0.05, 1.5];
        let halves = friction().halves(speeds);
        let mut allowed = 0;
        for i in 0..2000u32 {
            let value = |k: u32| {
                let step = f64::from(3 * k + 2).sqrt() * std::f64::consts::E;
                2.0 * (f64::from(i + 1) * step).fract() - 1.0
            };
            let beta: Vec<f64> = (0..6).map(value).collect();
            let [c, v, a, b, s, w] = beta[..] else {
                panic!()
            };
            let dissipates = [1.0, -1.0].iter().all(|d| {
                let (dry, viscous) = (c + d * a, 0.5 + v + d * b);
                let total =
                    |x: f64| dry + viscous * x + w * x * x + s * (-(x / 0.1) * (x / 0.1)).exp();
                dry >= 0.0 && viscous >= 0.0 && speeds.iter().all(|&x| total(x) >= 0.0)
            });
            let keeps = halves.iter().all(|half| {
                let sum: f64 = half.terms.iter().map(|(k, f)| f * beta[*k]).sum();
                sum >= half.lower
            });
            assert_eq!(dissipates, keeps, "{beta:?}");
            allowed += usize::from(keeps);
        }
        assert!((100..1500).contains(&allowed), "{allowed}");
    }

    /// Each direction's bounds act with asymmetry alone, the curve's with curve terms alone, and once where both directions are one.
    #[test]
    fn bounds_act_where_their_terms_are_in() {
        let halves = friction().halves([0.0, 0.05, 1.5]);
        let acting = |inside: &[usize]| {
            let acts = |half: &&HalfSpace| half.acts(|k| inside.contains(&k));
            halves.iter().filter(acts).count()
        };
        assert_eq!(acting(&[0, 1]), 0);
        assert_eq!(acting(&[0, 1, 2, 3]), 4);
        assert_eq!(acting(&[0, 1, 4]), 3);
        assert_eq!(acting(&[0, 1, 5]), 2);
        assert_eq!(acting(&[0, 1, 2, 3, 4, 5]), 10);
    }
}
