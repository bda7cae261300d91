//! Degrees where radians are meant, as far as motion and joint limits alone can tell (case 18).

use crate::error::{Error, Result, WrongUnit};
use crate::robot::JointKind;
use crate::signal::log::joints::JointFacts;
use crate::signal::log::recording::{Channels, Recording};
use rayon::prelude::*;

/// Degrees per radian.
const DEGREES: f64 = 180.0 / std::f64::consts::PI;
/// Radians per degree.
const RADIANS: f64 = std::f64::consts::PI / 180.0;
/// How near a ratio of velocities must be to that.
const NEAR: f64 = 0.1;
/// Share of the velocity's power that the differences of position must explain.
const ALIKE: f64 = 0.8;
/// Samples on either side of a difference.
const HALF: usize = 3;
/// How far beyond its stated range a joint must move to be in degrees for sure.
const BEYOND: f64 = 3.0;
/// Samples in a row that must reach an angle: fewer are a glitch and say nothing of a unit.
const SUSTAINED: usize = 5;

/// Refuses a log whose angles or angular velocities are in degrees.
///
/// Told by a logged velocity that is 57.3 times larger or smaller than the change of position, and by a joint that moves
/// through more than a turn and more than 3 times its stated range, all of which fits the range as degrees. What fewer than five samples
/// in a row reach is no motion.
///
/// # Errors
/// [`Error::Unit`] with the joint, the numbers and the remedy.
pub(crate) fn refuse_degrees(joints: &[JointFacts], log: &Recording) -> Result<()> {
    let check = |(facts, channels)| refuse_joint(facts, channels, log);
    let checked: Vec<Result<()>> = joints.par_iter().zip(&log.joints).map(check).collect();
    checked.into_iter().collect()
}

/// The same for one joint.
fn refuse_joint(facts: &JointFacts, channels: &Channels, log: &Recording) -> Result<()> {
    let error = |problem: String, remedy: &str, channels: &[&str]| {
        let channels: Vec<String> = (channels.iter())
            .map(|channel| format!("{channel} = {{ {:?} = {RADIANS} }}", facts.name))
            .collect();
        Err(Error::Unit {
            log: log.name.clone(),
            unit: WrongUnit::Degrees(facts.name.clone()),
            problem,
            remedy: format!(
                "{remedy}: × π/180, as with [columns] factor = {{ {} }} for this joint alone; `twincal init` finds all that need it",
                channels.join(", ")
            ),
        })
    };
    if facts.kind == JointKind::Prismatic {
        return Ok(());
    }
    if let Some(ratio) = velocity_ratio(&log.time, channels) {
        let near = |expected: f64| (ratio / expected - 1.0).abs() < NEAR;
        if near(DEGREES) {
            return error(
                format!(
                    "the velocity of joint `{}` is {ratio:.1} times the change of its position: it is in degrees/s",
                    facts.name
                ),
                "export velocities in rad/s",
                &["qd"],
            );
        }
        if near(1.0 / DEGREES) {
            return error(
                format!(
                    "the position of joint `{}` changes {:.1} times faster than its velocity says: it is in degrees",
                    facts.name,
                    1.0 / ratio
                ),
                "export positions in rad",
                &["q"],
            );
        }
    }
    let (Some(range), [low, high]) = (facts.range, reached(&channels.q)) else {
        return Ok(());
    };
    let travel = high - low;
    if travel > std::f64::consts::TAU && travel > BEYOND * range && travel / DEGREES <= 1.05 * range
    {
        return error(
            format!(
                "joint `{}` moves from {low:.1} to {high:.1}, its range in the model is {range:.2} rad: these are degrees",
                facts.name
            ),
            "export positions, velocities and accelerations in radians",
            &["q", "qd"],
        );
    }
    Ok(())
}

/// Slope of the logged velocity over the differences of position, where these explain it.
fn velocity_ratio(time: &[f64], channels: &Channels) -> Option<f64> {
    let (q, qd) = (&channels.q, channels.qd.as_ref()?);
    let len = time.len().min(q.len()).min(qd.len());
    let (mut dd, mut dv, mut vv) = (0.0, 0.0, 0.0);
    for i in HALF..len.saturating_sub(HALF) {
        let difference = (q[i + HALF] - q[i - HALF]) / (time[i + HALF] - time[i - HALF]);
        let velocity = qd[i];
        if difference.is_finite() && velocity.is_finite() {
            dd += difference * difference;
            dv += difference * velocity;
            vv += velocity * velocity;
        }
    }
    let explained = dv * dv / (dd * vv);
    (explained > ALIKE).then(|| dv / dd)
}

/// Smallest and largest value that [`SUSTAINED`] finite samples in a row reach; low above high where there are fewer.
fn reached(values: &[f64]) -> [f64; 2] {
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    finite.windows(SUSTAINED).fold(none, |[low, high], run| {
        let [least, most] = run.iter().fold(none, |[l, h], v| [l.min(*v), h.max(*v)]);
        [low.min(most), high.max(least)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(kind: JointKind, range: Option<f64>, q: f64, qd: Option<f64>) -> String {
        said_of(kind, range, q, qd, 0)
    }

    /// With that many samples of the position, from the 100th on, at 50.
    fn said_of(
        kind: JointKind,
        range: Option<f64>,
        q: f64,
        qd: Option<f64>,
        wrong: usize,
    ) -> String {
        let facts = JointFacts {
            name: "elbow".into(),
            kind,
            range,
            effort: None,
        };
        let time: Vec<f64> = (0..400).map(|i| f64::from(i) * 0.01).collect();
        let mut log = Recording {
            unfolded: false,
            start_ns: 0,
            name: "run".into(),
            joints: vec![Channels {
                q: time.iter().map(|t| q * (2.0 * t).sin()).collect(),
                qd: qd.map(|qd| time.iter().map(|t| qd * 2.0 * (2.0 * t).cos()).collect()),
                qdd: None,
                tau: None,
                temperature: None,
            }],
            time,
            payload: crate::signal::Payload::None,
        };
        log.joints[0].q[100..100 + wrong].fill(50.0);
        refuse_degrees(&[facts], &log).map_or_else(|e| e.to_string(), |()| String::new())
    }

    #[test]
    fn case_18_degrees_are_told_by_velocity_and_by_range() {
        let turning = |range, q, qd| said(JointKind::Revolute, range, q, qd);
        assert!(turning(None, 1.0, Some(57.3)).contains("velocity of joint `elbow` is 57.3 times"));
        assert!(
            turning(None, 57.3, Some(1.0)).contains("it is in degrees; export positions in rad")
        );
        // five samples about the peak: 80 cos 0.04
        assert!(turning(Some(3.0), 80.0, Some(80.0)).contains("moves from -79.9 to 79.9"));
        assert!(turning(Some(3.0), 80.0, None).contains("these are degrees"));
        for good in [
            turning(Some(3.0), 1.2, Some(1.2)),
            turning(Some(3.0), 1.2, None),
            // many turns of a joint without limits, and of one with wide ones
            turning(None, 80.0, Some(80.0)),
            turning(Some(100.0), 80.0, None),
            // more than the range, but not as degrees either
            turning(Some(0.5), 80.0, None),
            // a gear ratio is no unit of angle
            turning(None, 1.0, Some(100.0)),
            said(JointKind::Prismatic, Some(0.2), 57.3, Some(1.0)),
        ] {
            assert_eq!(good, "");
        }
    }

    #[test]
    fn case_18_a_glitch_is_no_unit_and_hides_none() {
        let of = |q: f64, wrong: usize| said_of(JointKind::Revolute, Some(3.0), q, None, wrong);
        assert_eq!(of(1.2, 1), "");
        assert_eq!(of(1.2, 4), "");
        assert!(of(1.2, 5).contains("these are degrees"));
        let hidden = of(80.0, 1);
        assert!(hidden.contains("moves from -79.9 to 79.9"), "{hidden}");
    }
}
