//! How the base stands: the direction of gravity that the torque shows, where the model has it elsewhere.
//!
//! Gravity is linear in the torque. Its three components in the base frame are fitted to all joints together, with inertia and friction beside
//! them; a direction that no joint feels keeps the part of the model's gravity that the length leaves for it. What this reading explains is then
//! compared with the log as it is, as every other reading is.

use super::columns::is_constant;
use super::correct::explains_more;
use super::explain::{Explained, Reading, explain};
use super::parts::Parts;
use super::sample::Sample;
use super::shared;
use crate::error::{Code, Finding, Severity};
use crate::linear_algebra::symmetric_eigen;
use crate::robot::Robot;
use crate::words::significant;
use serde::{Deserialize, Serialize};

/// Angle from which the base is called turned, degrees: an unknown payload and masses that are 30 % wrong turned it by 8.5 at most in 44 simulated
/// logs of a UR5 and a Panda. Less than that is the matter of the candidate `base.tilt`.
const TURNED: f64 = 20.0;
/// Angle within which a base is taken to stand along an axis, degrees: twice what model errors turn it by.
const ALONG_AN_AXIS: f64 = 15.0;
/// Size of the gravity found, as a share of the model's, within which its direction is believed: torque whose scale is further off has to be
/// corrected first, and compensated torque shows none.
const BELIEVED: std::ops::RangeInclusive<f64> = 0.5..=2.5;
/// Standard error of a component from which on no joint feels it, m/s².
const UNSEEN: f64 = 1.5;
/// Least Σ ln(share left before / after): e times less in all. Gravity has two angles only, where signs and order have thousands of readings.
const LEAST_GAIN: f64 = 1.0;

/// How the base stands where the torque contradicts the model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Base {
    /// Gravity in the base frame, m/s².
    pub gravity: [f64; 3],
    /// Roll, pitch and yaw of the base in a world whose gravity is along −z, rad; no torque shows the yaw: it is 0.
    pub rpy: [f64; 3],
    /// Gravity in the base frame as the model has it, m/s².
    pub nominal: [f64; 3],
    /// Angle between the model's gravity and this one, rad.
    pub angle: f64,
}

/// A base that explains more, with the robot on it and what it explains.
pub(super) struct Turned {
    pub(super) base: Base,
    pub(super) robot: Robot,
    pub(super) explained: Vec<Option<Explained>>,
}

impl Base {
    fn new(gravity: [f64; 3], nominal: [f64; 3]) -> Self {
        let size = length(gravity);
        // Adding 0 makes −0 a 0: half a turn is π, not −π.
        let up = gravity.map(|g| -g / size + 0.0);
        // upᵀ = (−sin p, sin r cos p, cos r cos p)
        let pitch = (-up[0]).clamp(-1.0, 1.0).asin();
        let roll = match up[1].hypot(up[2]) > 1e-9 {
            true => up[1].atan2(up[2]),
            false => 0.0,
        };
        Self {
            gravity,
            rpy: [roll + 0.0, pitch + 0.0, 0.0],
            nominal,
            angle: angle(gravity, nominal),
        }
    }

    /// The line for `[model]` in twincal.toml: `base`, which turns gravity along −z; where the model has gravity elsewhere already, `gravity`.
    #[must_use]
    pub fn line(&self) -> String {
        let [x, y, z] = self.nominal;
        if x.hypot(y) > 1e-6 * z.abs() || z > 0.0 {
            return format!("gravity = {:?}", self.gravity);
        }
        let [roll, pitch, yaw] = self.rpy;
        format!("base = {{ rpy = [{roll:?}, {pitch:?}, {yaw:?}] }}")
    }

    pub(super) fn finding(
        &self,
        robot: &Robot,
        before: &[Option<Explained>],
        after: &[Option<Explained>],
    ) -> Finding {
        let degrees = self.angle.to_degrees();
        let place = match degrees {
            150.0.. => "a robot upside down",
            60.0..=120.0 => "a robot on a wall",
            _ => "a tilted base",
        };
        let shown = |gravity: [f64; 3]| gravity.map(|g| significant(g, 3)).join(", ");
        let (joint, worst) = most_helped(robot, before, after);
        let ([x, y, z], [roll, pitch, yaw]) = (self.gravity, self.rpy);
        Finding::new(
            Severity::Degraded,
            Code::BaseOrientation,
            "",
            format!(
                "the torque shows gravity [{}] m/s² in the base frame, the model has [{}]: {degrees:.0}° apart, {place}; with it model and \
                 friction explain {:.0} % of the torque of joint `{joint}` instead of {:.0} %; nothing was changed: write {} under [model] in \
                 twincal.toml",
                shown(self.gravity),
                shown(robot.description().gravity),
                100.0 * (1.0 - worst[1]),
                100.0 * (1.0 - worst[0]),
                self.line()
            ),
            0,
        )
        .with([
            ("angle", self.angle), ("explained", 1.0 - worst[1]),
            ("explained_before", 1.0 - worst[0]), ("gravity_x", x), ("gravity_y", y),
            ("gravity_z", z), ("roll", roll), ("pitch", pitch), ("yaw", yaw),
        ])
    }
}

/// The joint that gains most, with the shares left before and after.
fn most_helped<'a>(
    robot: &'a Robot,
    before: &[Option<Explained>],
    after: &[Option<Explained>],
) -> (&'a str, [f64; 2]) {
    let names = robot.joint_names();
    let both = before.iter().zip(after).enumerate();
    let both = both
        .filter_map(|(joint, (b, a))| Some((names[joint], [b.as_ref()?.left, a.as_ref()?.left])));
    both.max_by(|a, b| (a.1[0] - a.1[1]).total_cmp(&(b.1[0] - b.1[1])))
        .unwrap_or(("", [1.0; 2]))
}

/// The base that the torque shows, where it clearly explains more than the model's and no joint less.
pub(super) fn turned(
    robot: &Robot,
    sample: &Sample,
    as_logged: &[Option<Explained>],
) -> Option<Turned> {
    let nominal = robot.description().gravity;
    let size = length(nominal);
    let found = gravity(sample, &Parts::of(robot, sample), nominal)?;
    if !(size > 0.0 && BELIEVED.contains(&(length(found) / size))) {
        return None;
    }
    let found = along_an_axis(found.map(|g| g * size / length(found)), size);
    if angle(found, nominal).to_degrees() < TURNED {
        return None;
    }
    let turned = robot.with_gravity(found);
    let explained = explain(&turned, sample, &Reading::as_logged(robot.dof()));
    explains_more(as_logged, &explained, LEAST_GAIN).then(|| Turned {
        base: Base::new(found, nominal),
        robot: turned,
        explained,
    })
}

/// Gravity in the base frame as the torque shows it, m/s²; a direction that no joint feels is filled up to the model's size, on the model's side.
fn gravity(sample: &Sample, parts: &Parts, nominal: [f64; 3]) -> Option<[f64; 3]> {
    let [x, y, z] = &parts.directions;
    let columns = [x, y, z, &parts.inertia];
    let with: Vec<bool> = (0..x.len())
        .map(|joint| !is_constant(sample, joint))
        .collect();
    let shared = shared::fit(sample, &columns, &parts.springs, &with)?;
    // What the rows say of gravity once inertia is fitted beside it.
    let row = |i: usize| &shared.information[4 * i..4 * i + 4];
    let inertia = row(3)[3].max(f64::MIN_POSITIVE);
    let information: Vec<f64> = (0..9)
        .map(|k| {
            let (i, j) = (k / 3, k % 3);
            row(i)[j] - row(i)[3] * row(3)[j] / inertia
        })
        .collect();
    let (sizes, vectors) = symmetric_eigen(&information, 3)?;
    let repeated = (sample.len as f64 / sample.independent).max(1.0);
    let mut found = [0.0; 3];
    let mut unseen = [0.0; 3];
    for (information, direction) in sizes.iter().zip(vectors.chunks(3)) {
        let along =
            |vector: &[f64]| -> f64 { direction.iter().zip(vector).map(|(a, b)| a * b).sum() };
        let is_seen = *information > 0.0 && (repeated / information).sqrt() < UNSEEN;
        let (to, amount) = match is_seen {
            true => (&mut found, along(&shared.values[..3])),
            false => (&mut unseen, along(&nominal)),
        };
        for (to, a) in to.iter_mut().zip(direction) {
            *to += amount * a;
        }
    }
    let rest = (length(nominal).powi(2) - length(found).powi(2))
        .max(0.0)
        .sqrt();
    if length(unseen) > 1e-3 * length(nominal) {
        let scale = rest / length(unseen);
        for (found, unseen) in found.iter_mut().zip(unseen) {
            *found += scale * unseen;
        }
    }
    (length(found) > 0.0).then_some(found)
}

/// Gravity along an axis of the base where it is near one: robots are mounted so.
fn along_an_axis(gravity: [f64; 3], size: f64) -> [f64; 3] {
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let mut straight = [0.0; 3];
            straight[axis] = sign * size;
            if angle(gravity, straight).to_degrees() < ALONG_AN_AXIS {
                return straight;
            }
        }
    }
    gravity
}

/// Angle between two directions, rad.
fn angle(a: [f64; 3], b: [f64; 3]) -> f64 {
    let along: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    (along / (length(a) * length(b))).clamp(-1.0, 1.0).acos()
}

fn length(vector: [f64; 3]) -> f64 {
    vector.iter().map(|x| x * x).sum::<f64>().sqrt()
}
