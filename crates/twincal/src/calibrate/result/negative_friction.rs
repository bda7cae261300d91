//! Friction that would drive its joint: quadratic friction that takes more than there is beyond the speeds that were logged.

use super::calibration::ComponentSummary;
use crate::error::{Code, Finding, Severity};
use crate::robot::JointKind;
use crate::term::{Family, Library};
use crate::twin::Twin;

/// Without a velocity limit a speed counts up to so many times the largest logged one.
const REACH: f64 = 2.0;

/// Friction of one joint at speeds well above that within which it turns round: dry + viscous v + quadratic v², the model's own damping
/// included; N·m (N), N·m·s/rad (N·s/m), N·m·s²/rad² (N·s²/m²).
#[derive(Debug, Clone, Copy, PartialEq)]
struct Friction {
    dry: f64,
    viscous: f64,
    quadratic: f64,
}

impl Friction {
    /// The speed above which friction is negative, rad/s (m/s); 0 where it is at every speed, `None` where it is positive in the end.
    fn turns_at(self) -> Option<f64> {
        if self.quadratic >= 0.0 {
            return None;
        }
        let root = self.viscous.powi(2) - 4.0 * self.quadratic * self.dry;
        if root < 0.0 {
            return Some(0.0);
        }
        Some(((self.viscous + root.sqrt()) / (-2.0 * self.quadratic)).max(0.0))
    }
}

/// One finding for each joint with found quadratic friction below 0 whose friction (posterior mean) changes sign below the model's velocity
/// limit, or where the model states none, below twice the largest speed of the training range.
pub(in crate::calibrate) fn findings(
    twin: &Twin,
    library: &Library,
    components: &[ComponentSummary],
) -> Vec<Finding> {
    let robot = &twin.robot;
    let names = robot.joint_names();
    let joints = names.into_iter().enumerate();
    joints
        .filter_map(|(joint, name)| {
            let mean = |suffix: &str, family: Family| -> Option<(usize, f64)> {
                let own = format!("{name}.{suffix}");
                let column = library.columns().iter().position(|&index| {
                    let term = &library.terms()[index];
                    term.family == family && term.name == own
                })?;
                Some((column, twin.posterior.mean[column]))
            };
            let (column, quadratic) = mean("quadratic_friction", Family::QuadraticFriction)?;
            let component = library.terms()[library.columns()[column]].component;
            if !components[component].is_in() {
                return None;
            }
            let of = |suffix, family| mean(suffix, family).map_or(0.0, |(_, mean)| mean);
            let friction = Friction {
                dry: of("coulomb", Family::Coulomb),
                viscous: robot.joint(joint).damping + of("viscous", Family::Viscous),
                quadratic,
            };
            let [_, _, low, high, ..] = twin.hull[joint];
            let limit = robot.joint(joint).limits.velocity;
            let slides = robot.joint_kind(joint) == JointKind::Prismatic;
            told(name, slides, friction, (limit, low.abs().max(high.abs())))
        })
        .collect()
}

/// What is told of a joint with this velocity limit and largest logged speed.
fn told(
    joint: &str,
    slides: bool,
    friction: Friction,
    (limit, logged): (Option<f64>, f64),
) -> Option<Finding> {
    let speed = friction.turns_at()?;
    let unit = if slides { "m/s" } else { "rad/s" };
    // Model files without a limit state 0.
    let limit = limit.filter(|limit| *limit > 0.0);
    if speed >= limit.unwrap_or(REACH * logged) {
        return None;
    }
    let reach = match limit {
        Some(limit) => format!(
            "below the model's velocity limit of {limit:.2} {unit} (logged: up to {logged:.2})"
        ),
        None => format!(
            "less than twice the largest logged speed of {logged:.2} {unit} (the model states no velocity limit)"
        ),
    };
    let Friction {
        dry,
        viscous,
        quadratic,
    } = friction;
    Some(Finding::new(
        Severity::Warning,
        Code::FrictionTurnsNegative,
        joint,
        format!(
            "friction of joint `{joint}` ({dry:.3} {viscous:+.3} v {quadratic:+.3} v²) is negative above {speed:.2} {unit}, {reach}: there \
             the twin would drive the joint; log faster motion, or leave the family quadratic_friction out of [library] families"
        ),
        0,
    )
    .with([
        ("coulomb", dry), ("viscous", viscous), ("quadratic", quadratic), ("velocity", speed),
        ("velocity_limit", limit.unwrap_or(f64::NAN)), ("velocity_logged", logged),
    ]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn friction(dry: f64, viscous: f64, quadratic: f64) -> Friction {
        Friction {
            dry,
            viscous,
            quadratic,
        }
    }

    /// Truth: factored polynomials, and the sign of friction on either side.
    #[test]
    fn the_speed_is_where_friction_changes_its_sign() {
        // −2 (v − 3)(v + 0.5)
        assert_eq!(friction(3.0, 5.0, -2.0).turns_at(), Some(3.0));
        // −(v − 1)(v − 4): negative near standstill, too; what counts is the end.
        assert_eq!(friction(-4.0, 5.0, -1.0).turns_at(), Some(4.0));
        assert_eq!(friction(-1.0, 1.0, -1.0).turns_at(), Some(0.0));
        assert_eq!(friction(0.0, -1.0, -1.0).turns_at(), Some(0.0));
        assert_eq!(friction(1.0, 1.0, 0.0).turns_at(), None);
        assert_eq!(friction(1.0, -1.0, 0.5).turns_at(), None);
        let found = friction(0.962, 2.2425, -0.4598);
        let speed = found.turns_at().unwrap();
        let at = |v: f64| found.dry + found.viscous * v + found.quadratic * v * v;
        assert!(at(speed - 1e-6) > 0.0 && at(speed + 1e-6) < 0.0, "{speed}");
        assert!((speed - 5.27).abs() < 0.01, "{speed}");
    }

    /// A joint that the model lets turn at 6.2 rad/s and that was logged up to 1.75 is told, with every number; one with a lower limit is
    /// not, and one without a limit only where it was logged at more than half of that speed.
    #[test]
    fn it_is_told_where_the_joint_can_be_so_fast() {
        let found = friction(0.962, 2.2425, -0.4598);
        let said = |limit, logged| told("hip", false, found, (limit, logged));
        let finding = said(Some(6.2), 1.75).unwrap();
        assert_eq!(
            (finding.code.as_str(), finding.subject.as_str()),
            ("friction_turns_negative", "hip")
        );
        assert_eq!(finding.severity, Severity::Warning);
        assert_eq!(
            finding.message,
            "friction of joint `hip` (0.962 +2.243 v -0.460 v²) is negative above 5.27 rad/s, below the model's velocity limit of 6.20 rad/s \
             (logged: up to 1.75): there the twin would drive the joint; log faster motion, or leave the family quadratic_friction out \
             of [library] families"
        );
        assert_eq!(said(Some(5.0), 1.75), None);
        assert_eq!(said(Some(5.0), 4.0), None);
        for none in [None, Some(0.0)] {
            assert_eq!(said(none, 2.6), None);
            let words = said(none, 2.7).unwrap().message;
            assert!(words.contains("less than twice the largest logged speed of 2.70 rad/s"));
        }
        let slider = told("rail", true, found, (Some(6.0), 1.0)).unwrap();
        assert!(slider.message.contains("5.27 m/s"), "{}", slider.message);
    }
}
