//! What a motion must stay within, joint by joint.

use crate::error::{Error, Result};
use crate::robot::{JointDescription, JointKind, Robot};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Time in which a joint may reach its velocity limit where no acceleration is stated, s.
pub const SPEED_UP: f64 = 0.2;
/// Time in which it may reach that acceleration where no jerk is stated, s.
pub const JERK_TIME: f64 = 0.1;
/// Positions of a joint that turns without end, rad: half a turn either way.
const WITHOUT_END: f64 = PI;

/// Limits of one joint that replace those of the model file; rad, m, N·m or N, and s.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct StatedLimits {
    /// Smallest and largest position.
    pub position: Option<[f64; 2]>,
    /// Largest speed.
    pub velocity: Option<f64>,
    /// Largest acceleration.
    pub acceleration: Option<f64>,
    /// Largest jerk.
    pub jerk: Option<f64>,
    /// Largest torque.
    pub torque: Option<f64>,
    /// Position at the motion's start and end.
    pub start: Option<f64>,
}

/// Limits of one joint in force.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointLimits {
    /// Name of the joint.
    pub joint: String,
    /// Smallest and largest position.
    pub position: [f64; 2],
    /// Largest speed.
    pub velocity: f64,
    /// Largest acceleration.
    pub acceleration: f64,
    /// Largest jerk.
    pub jerk: f64,
    /// Largest torque; `None`: not limited.
    pub torque: Option<f64>,
    /// Position at the start and at the end.
    pub start: f64,
    /// Keys that nobody stated: `acceleration` is velocity / 0.2 s, `jerk` acceleration / 0.1 s, `position` of a joint that turns without end
    /// ±π, `start` 0, the middle, or another one where the robot cannot rest there.
    pub assumed: Vec<&'static str>,
    /// Keys whose stated limit is beyond that of the model file: `position`, `velocity`, `torque`.
    pub beyond_model: Vec<&'static str>,
}

impl JointLimits {
    /// Bounds on position, velocity, acceleration and jerk.
    pub(super) fn bounds(&self) -> [[f64; 2]; 4] {
        let even = |most: f64| [-most, most];
        [
            self.position,
            even(self.velocity),
            even(self.acceleration),
            even(self.jerk),
        ]
    }
}

/// Limits of every joint: stated ones, those of the model file, and what is assumed.
///
/// # Errors
/// [`Error::Setting`] with the joint's name for one that is not there, without a velocity limit or a range of positions, with a limit that is no
/// positive number, and with a start outside the range.
///
/// # Example
/// Without a stated acceleration a joint reaches its speed in 0.2 s, and without a stated jerk that acceleration in 0.1 s.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::design::{StatedLimits, joint_limits};
///
/// # let robot = two_link::arm(2.0)?;
/// let own = StatedLimits { position: Some([-1.5, 1.5]), velocity: Some(2.0), ..Default::default() };
/// let stated = robot.joint_names().into_iter().map(|name| (name.to_owned(), own)).collect();
/// let limits = joint_limits(&robot, &stated)?;
/// assert!((limits[0].acceleration - 10.0).abs() < 1e-9 && (limits[0].jerk - 100.0).abs() < 1e-9);
/// assert!(limits[0].assumed.contains(&"jerk"));
/// assert!(joint_limits(&robot, &Default::default()).is_err()); // the model states no speed
/// # Ok::<(), twincal::Error>(())
/// ```
pub fn joint_limits(
    robot: &Robot,
    stated: &BTreeMap<String, StatedLimits>,
) -> Result<Vec<JointLimits>> {
    let names = robot.joint_names();
    if let Some(unknown) = stated.keys().find(|name| !names.contains(&name.as_str())) {
        let known = crate::robot::did_you_mean(unknown, names.iter().copied());
        return Err(refused(unknown, "is no joint that moves".into(), &known));
    }
    (0..robot.dof())
        .map(|joint| {
            let own = stated.get(names[joint]).copied().unwrap_or_default();
            of_joint(robot, joint, own)
        })
        .collect()
}

fn of_joint(robot: &Robot, joint: usize, stated: StatedLimits) -> Result<JointLimits> {
    let description = robot.joint(joint);
    let (name, file) = (description.name.as_str(), description.limits);
    let mut assumed = Vec::new();
    let of_file = (file.lower.zip(file.upper))
        .filter(|_| description.kind != JointKind::Continuous)
        .map(|(low, high)| [low, high]);
    let position = positions(description, stated.position.or(of_file), &mut assumed)?;
    let velocity = stated.velocity.or(file.velocity.filter(|v| *v > 0.0));
    let Some(velocity) = velocity else {
        let remedy = format!("state velocity for [joint.{name}], rad/s or m/s");
        return Err(refused(name, "has no velocity limit".into(), &remedy));
    };
    let acceleration = stated.acceleration.unwrap_or_else(|| {
        assumed.push("acceleration");
        velocity / SPEED_UP
    });
    let jerk = stated.jerk.unwrap_or_else(|| {
        assumed.push("jerk");
        acceleration / JERK_TIME
    });
    let torque = stated.torque.or(file.effort.filter(|effort| *effort > 0.0));
    let numbers = [
        ("velocity", Some(velocity)),
        ("acceleration", Some(acceleration)),
        ("jerk", Some(jerk)),
        ("torque", torque),
    ];
    for (key, value) in numbers {
        let wrong = value.filter(|x| !(*x > 0.0 && x.is_finite()));
        if let Some(value) = wrong {
            let problem = format!("has the {key} limit {value}");
            return Err(refused(name, problem, "give a positive number"));
        }
    }
    let start = start(name, position, stated.start, &mut assumed)?;
    let beyond = |own: f64, file: Option<f64>| file.is_some_and(|file| file > 0.0 && own > file);
    let further = of_file.is_some_and(|[low, high]| position[0] < low || position[1] > high);
    let more = [
        ("position", further),
        ("velocity", beyond(velocity, file.velocity)),
        ("torque", torque.is_some_and(|own| beyond(own, file.effort))),
    ];
    let more = more.into_iter().filter(|(_, is_beyond)| *is_beyond);
    Ok(JointLimits {
        joint: name.to_owned(),
        position,
        velocity,
        acceleration,
        jerk,
        torque,
        start,
        assumed,
        beyond_model: more.map(|(key, _)| key).collect(),
    })
}

/// Positions of a joint: its `range`, or any where it turns without end.
fn positions(
    joint: &JointDescription,
    range: Option<[f64; 2]>,
    assumed: &mut Vec<&'static str>,
) -> Result<[f64; 2]> {
    let name = joint.name.as_str();
    let position = match range {
        Some(range) => range,
        None if joint.kind == JointKind::Continuous => {
            assumed.push("position");
            [-WITHOUT_END, WITHOUT_END]
        }
        None => {
            let problem = "has no range of positions".into();
            let remedy = format!("state position = [low, high] for [joint.{name}]");
            return Err(refused(name, problem, &remedy));
        }
    };
    if !(position[0] < position[1] && position.iter().all(|x| x.is_finite())) {
        let problem = format!("has the positions {} to {}", position[0], position[1]);
        return Err(refused(name, problem, "give the smaller one first"));
    }
    Ok(position)
}

/// Where a joint's motion starts: as stated, at 0, or in the middle of its range where that does not hold 0.
fn start(
    name: &str,
    position: [f64; 2],
    stated: Option<f64>,
    assumed: &mut Vec<&'static str>,
) -> Result<f64> {
    let middle = 0.5 * (position[0] + position[1]);
    let inside = |x: f64| position[0] <= x && x <= position[1];
    let start = stated.unwrap_or_else(|| {
        assumed.push("start");
        if inside(0.0) { 0.0 } else { middle }
    });
    if !inside(start) {
        let problem = format!(
            "starts at {start}, outside {} to {}",
            position[0], position[1]
        );
        return Err(refused(name, problem, "give a start within the limits"));
    }
    Ok(start)
}

/// The k-th of a sequence of positions that fills the limits evenly: multiples of square roots of primes.
#[must_use]
pub fn spread_positions(k: usize, limits: &[JointLimits]) -> Vec<f64> {
    let is_prime = |n: &usize| {
        (2..*n)
            .take_while(|d| d * d <= *n)
            .all(|d| !n.is_multiple_of(d))
    };
    let mut primes = (2..).filter(is_prime);
    let positions = limits.iter().map(|own| {
        let root = (primes.next().unwrap_or(2) as f64).sqrt();
        let share = (root * (k + 1) as f64).fract();
        own.position[0] + share * (own.position[1] - own.position[0])
    });
    positions.collect()
}

fn refused(joint: &str, problem: String, remedy: &str) -> Error {
    Error::Setting {
        key: format!("limits.joint.{joint}"),
        problem: format!("joint `{joint}` {problem}"),
        remedy: remedy.to_owned(),
    }
}
