//! What a designed motion is and what it is expected to decide, in sentences and cells of tables.

use super::number::{THIN, fixed, number, probability};
use crate::collision::CollisionWorld;
use twincal::design::{
    Criterion, Design, JERK_TIME, JointLimits, Load, OtherRecording, Promise, Recorded, SPEED_UP,
};
use twincal::words::{listed, shortened};

/// What shares of limits are.
pub const SHARES: &str = "Shares are of the limits, at the samples.";

/// What it means that a motion decides an effect.
pub const DECIDED: &str = "Decided: the PIP leaves 0.05 to 0.95 in logs simulated from the posterior. \
    Expected sd: median sd of the first coefficient afterwards, in SI units, where the effect is there.";
/// Stands where a limit would.
pub const NOT_LIMITED: &str = "not limited";

/// Length and rate: "Motion of 20 s at 500 Hz".
#[must_use]
pub fn headline(design: &Design) -> String {
    let motion = &design.motion;
    let seconds = motion.len.saturating_sub(1) as f64 / motion.rate;
    let early = match design.stopped {
        true => ", ended early",
        false => "",
    };
    format!(
        "Motion of {} s at {} Hz{early}",
        round(seconds),
        round(motion.rate)
    )
}

/// What the motion was designed for.
#[must_use]
pub fn purpose(design: &Design, criterion: Criterion) -> String {
    match design.promises.len() {
        0 if criterion == Criterion::Condition => {
            "Designed to show body, motors and friction with a small condition number.".into()
        }
        0 => "Designed to show body, motors and friction.".into(),
        1 => "Designed to decide 1 effect of the twin.".into(),
        n => format!("Designed to decide {n} effects of the twin."),
    }
}

/// What its rows say of the base parameters.
#[must_use]
pub fn information(design: &Design) -> String {
    format!(
        "{} base parameters: ln det {}, condition number {}.",
        design.columns,
        number(design.log_determinant, 3),
        number(design.condition, 3)
    )
}

/// What was recorded before and counts in the numbers.
#[must_use]
pub fn before(recorded: &Recorded) -> String {
    let logs = match recorded.logs.len() {
        1 => "1 log".to_owned(),
        n => format!("{n} logs"),
    };
    format!(
        "Counted with the motion: {} of {logs} recorded before.",
        seconds(recorded.seconds)
    )
}

/// A length of time.
#[must_use]
pub fn seconds(length: f64) -> String {
    format!("{} s", number(length, 3))
}

/// How close the motion comes to the robot itself and to what stands around it, and what was assumed of that.
#[must_use]
pub fn clearance(design: &Design, world: &CollisionWorld) -> Vec<String> {
    let margin = number(world.margin(), 3);
    let mut said = vec![match &design.closest {
        Some(closest) => format!(
            "Smallest distance {} m ({} and {}, at {} s); margin {margin} m.",
            number(closest.distance, 3),
            shortened(&closest.between[0]),
            shortened(&closest.between[1]),
            number(closest.time, 3)
        ),
        None => format!("Nothing comes close; margin {margin} m."),
    }];
    for assumed in &world.assumed {
        let instead = match assumed.radius > 0.0 {
            true => format!(
                "a capsule of radius {} m instead",
                number(assumed.radius, 2)
            ),
            false => "left out".into(),
        };
        said.push(format!(
            "{}: {}; {instead}.",
            shortened(&assumed.link),
            assumed.reason
        ));
    }
    let named = |touching: bool| {
        let pairs = world.ignored.iter();
        let pairs = pairs.filter(|pair| (pair.reason == "touching") == touching);
        let names = pairs.map(|pair| {
            format!(
                "{} and {}",
                shortened(&pair.between[0]),
                shortened(&pair.between[1])
            )
        });
        names.collect::<Vec<_>>().join("; ")
    };
    let kinds = [
        (named(false), "Not checked against each other"),
        (named(true), "Checked for contact, without the margin"),
    ];
    let pairs = kinds.into_iter().filter(|(pairs, _)| !pairs.is_empty());
    said.extend(pairs.map(|(pairs, what)| format!("{what}: {pairs}.")));
    said
}

/// An effect that no motion decides, and what does.
#[must_use]
pub fn undecidable(promise: &Promise, loaded: bool) -> String {
    let others = promise.decided_by.iter().map(|own| match own {
        OtherRecording::KnownLoad if loaded => "a log with another known load",
        OtherRecording::KnownLoad => "a log with a known load",
        OtherRecording::OtherBase => "a log with the base on a wall (fitted by itself)",
    });
    let others: Vec<&str> = others.collect();
    let decides = match others.is_empty() {
        true => "no known load and no wall that was tried does".to_owned(),
        false => format!("{} does", others.join(" or ")),
    };
    format!(
        "{}: no motion of this robot distinguishes it from the others; {decides}.",
        promise.effect
    )
}

/// What the robot carries in the motion.
#[must_use]
pub fn carried(load: &Load) -> String {
    let [x, y, z] = load.com.map(|own| number(own, 3));
    format!(
        "The robot carries {}{THIN}kg at ({x}, {y}, {z}){THIN}m of {}. Its shape is not in the collision check. \
         State it as payload of the log.",
        number(load.mass, 3),
        shortened(&load.frame)
    )
}

/// Limits that nobody stated, with the rule that gave them and the joints.
#[must_use]
pub fn assumed(limits: &[JointLimits]) -> Vec<String> {
    let rules = [
        (
            "acceleration",
            "acceleration limit",
            format!("velocity / {SPEED_UP} s"),
        ),
        (
            "jerk",
            "jerk limit",
            format!("acceleration / {JERK_TIME} s"),
        ),
        ("position", "position limit", "±π".to_owned()),
        (
            "start",
            "start",
            "0, the middle, or near to it where that is not free".to_owned(),
        ),
    ];
    let said = rules.into_iter().filter_map(|(key, what, rule)| {
        let joints = limits.iter().filter(|own| own.assumed.contains(&key));
        let is_start = key == "start";
        let named = |own: &JointLimits| match is_start {
            true => format!("{} {}", shortened(&own.joint), number(own.start, 3)),
            false => shortened(&own.joint).into_owned(),
        };
        let names: Vec<String> = joints.map(named).collect();
        let names = match names.len() {
            0 => return None,
            n if n == limits.len() && n > 1 && !is_start => "all joints".to_owned(),
            _ => listed(&names, ", "),
        };
        Some(format!("{what} assumed: {rule} ({names})"))
    });
    said.collect()
}

/// Stated limits that the model file does not allow.
#[must_use]
pub fn beyond_model(limits: &[JointLimits]) -> Vec<String> {
    let said = ["position", "velocity", "torque"]
        .into_iter()
        .filter_map(|key| {
            let joints = limits.iter().filter(|own| own.beyond_model.contains(&key));
            let names: Vec<_> = joints.map(|own| shortened(&own.joint)).collect();
            let beyond = "is beyond that of the model file; check its unit";
            (!names.is_empty())
                .then(|| format!("the {key} limit of {} {beyond}", listed(&names, ", ")))
        });
    said.collect()
}

/// A probability, never rounded to certainty.
#[must_use]
pub fn chance(p: f64) -> String {
    probability(p)
}

/// A share as whole per cent; "–" if it is no number.
#[must_use]
pub fn share(share: f64) -> String {
    match share.is_finite() {
        true => format!("{}{THIN}%", fixed(100.0 * share, 0)),
        false => "–".into(),
    }
}

/// What the motion uses of a limit.
#[must_use]
pub fn used(part: f64) -> String {
    format!("{} used", share(part))
}

/// Positions that the motion stays between.
#[must_use]
pub fn range_used([low, high]: [f64; 2]) -> String {
    format!("{} to {} used", number(low, 3), number(high, 3))
}

/// What a figure of a joint's motion shows.
#[must_use]
pub fn curve(joint: &str, quantity: &str, unit: &str, [low, high]: [f64; 2]) -> String {
    format!(
        "{quantity} of {joint} over time, limits {} and {} {unit}",
        number(low, 3),
        number(high, 3)
    )
}

/// Four digits at most: 500, 2.5, 333.3.
fn round(x: f64) -> String {
    let text = number(x, 4);
    match text.contains('.') && !text.contains('⁻') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_decides_where_no_motion_does_is_named() {
        let said = |decided_by, loaded| {
            let promise = Promise {
                effect: "turn.gain".into(),
                pip: 0.5,
                right: 0.0,
                wrong: 0.0,
                sd: None,
                structural: true,
                decided_by,
            };
            undecidable(&promise, loaded)
        };
        let (load, base) = (OtherRecording::KnownLoad, OtherRecording::OtherBase);
        for (text, wanted) in [
            (said(vec![], false), "others; no known load"),
            (
                said(vec![load], false),
                "others; a log with a known load does",
            ),
            (said(vec![load], true), "a log with another known load does"),
            (
                said(vec![load, base], false),
                "load or a log with the base on a wall (fitted by itself) does",
            ),
        ] {
            assert!(text.starts_with("turn.gain: no motion"), "{text}");
            assert!(text.contains(wanted), "{text}");
        }
        let load = Load {
            frame: "tool0".into(),
            mass: 2.0,
            com: [0.0, 0.0, 0.05],
        };
        let text = carried(&load);
        assert!(text.contains("m of tool0. Its shape"), "{text}");
    }

    fn limits(joint: &str, assumed: &[&'static str]) -> JointLimits {
        JointLimits {
            joint: joint.into(),
            position: [-1.0, 1.0],
            velocity: 1.0,
            acceleration: 5.0,
            jerk: 50.0,
            torque: None,
            start: 0.25,
            assumed: assumed.to_vec(),
            beyond_model: Vec::new(),
        }
    }

    #[test]
    fn lengths_and_rates_have_no_empty_digits() {
        let texts = [20.0, 500.0, 2.5, 1000.0 / 3.0, 8000.0].map(round);
        assert_eq!(texts, ["20", "500", "2.5", "333.3", "8000"]);
    }

    #[test]
    fn an_assumed_limit_has_its_rule_and_its_joints() {
        let both = [
            limits("a", &["acceleration", "jerk"]),
            limits("b", &["jerk", "position", "start"]),
        ];
        assert_eq!(
            assumed(&both),
            [
                "acceleration limit assumed: velocity / 0.2 s (a)",
                "jerk limit assumed: acceleration / 0.1 s (all joints)",
                "position limit assumed: ±π (b)",
                "start assumed: 0, the middle, or near to it where that is not free (b 0.250)"
            ]
        );
        assert!(assumed(&[limits("a", &[])]).is_empty());
        let mut fast = limits("a", &[]);
        assert!(beyond_model(std::slice::from_ref(&fast)).is_empty());
        fast.beyond_model = vec!["velocity"];
        let said = beyond_model(&[fast]);
        assert!(
            said[0].starts_with("the velocity limit of a is beyond"),
            "{said:?}"
        );
    }

    #[test]
    fn a_share_is_whole_per_cent() {
        assert_eq!(share(0.9749), "97\u{202f}%");
        assert_eq!(share(f64::NAN), "–");
    }
}
