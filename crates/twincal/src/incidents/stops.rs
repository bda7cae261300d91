//! All joints at rest, and no torque where the model says that holding takes some.

use super::incident::{Incident, IncidentKind};
use crate::robot::{Motion, Robot, nominal_torque};
use crate::signal::{Pipeline, Segment, Trajectory};
use std::ops::Range;

/// Shortest stop, s and samples.
const SHORTEST: f64 = 0.25;
const FEWEST: usize = 5;
/// Velocity at rest where the pipeline has no threshold, rad/s or m/s.
const AT_REST: f64 = 1e-3;
/// Torque below this share of a joint's rms torque is none.
const NONE: f64 = 0.02;
/// Share of a joint's rms torque that holding takes at least, and how many times the torque that is there.
const HOLDING: f64 = 0.2;
const TIMES: f64 = 5.0;

/// Stretches in which the drives are off.
pub(super) fn stops(robot: &Robot, pipeline: &Pipeline, trajectory: &Trajectory) -> Vec<Incident> {
    let names = robot.joint_names();
    let dof = trajectory.dof;
    let typical = rms_torque(trajectory);
    let mut found = Vec::new();
    for segment in &trajectory.segments {
        let len = segment.time.len();
        let fewest = ((SHORTEST / segment.interval).ceil() as usize).max(FEWEST);
        let off = |i: usize| {
            (0..dof).all(|joint| {
                let at = joint * len + i;
                segment.qd[at].abs() <= pipeline.standstill_velocity[joint].max(AT_REST)
                    && segment.tau[at].abs() <= NONE * typical[joint]
            })
        };
        let mut start = None;
        for i in 0..=len {
            match (i < len && off(i), start) {
                (true, None) => start = Some(i),
                (false, Some(from)) => {
                    start = None;
                    if i - from < fewest {
                        continue;
                    }
                    if let Some((joint, torque)) = missing(robot, segment, from..i, &typical) {
                        found.push(Incident {
                            kind: IncidentKind::DrivesOff,
                            joint: names[joint].to_owned(),
                            span: [segment.time[from], segment.time[i - 1]],
                            torque,
                            samples: ((i - from) * segment.thinning()) as u64,
                        });
                    }
                }
                _ => {}
            }
        }
    }
    found
}

/// Rms torque of every joint, N·m or N.
fn rms_torque(trajectory: &Trajectory) -> Vec<f64> {
    (0..trajectory.dof)
        .map(|joint| {
            let (mut sum, mut count) = (0.0, 0_usize);
            for segment in &trajectory.segments {
                let len = segment.time.len();
                let tau = &segment.tau[joint * len..(joint + 1) * len];
                sum += tau.iter().map(|t| t * t).sum::<f64>();
                count += len;
            }
            (sum / count.max(1) as f64).sqrt()
        })
        .collect()
}

/// What holding would take that is not there, in the joint where it is most for its drive; `typical` are the joints' rms torques.
fn missing(
    robot: &Robot,
    segment: &Segment,
    rest: Range<usize>,
    typical: &[f64],
) -> Option<(usize, f64)> {
    let (dof, len) = (typical.len(), segment.time.len());
    let middle = (rest.start + rest.end) / 2;
    let q: Vec<f64> = (0..dof).map(|j| segment.q[j * len + middle]).collect();
    let at_rest = vec![0.0; dof];
    let mut holding = vec![0.0; dof];
    let pose = Motion {
        len: 1,
        q: &q,
        qd: &at_rest,
        qdd: &at_rest,
    };
    nominal_torque(robot, pose, &mut holding);
    let needed = |joint: usize| {
        let tau = &segment.tau[joint * len + rest.start..joint * len + rest.end];
        let tau = tau.iter().sum::<f64>() / tau.len() as f64;
        let needed = holding[joint].abs();
        let clear = needed > HOLDING * typical[joint] && needed > TIMES * tau.abs();
        clear.then_some((joint, needed))
    };
    (0..dof)
        .filter_map(needed)
        .max_by(|a, b| (a.1 / typical[a.0]).total_cmp(&(b.1 / typical[b.0])))
}
