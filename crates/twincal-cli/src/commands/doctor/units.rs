//! A log in other units than it seems to be in, to see whether it comes further: for the look alone.

use super::examine::filtered;
use std::sync::Arc;
use twincal::WrongUnit;
use twincal::robot::{JointKind, Robot};
use twincal::signal::{Log, LongLog, ReadChapter, Recording, describe};
use twincal::words::listed;
use twincal_io::config::{Settings, TimeUnit};

/// Radians per degree.
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// What the numbers of a log are multiplied by.
#[derive(Debug, Clone)]
struct Units {
    time: f64,
    /// By joint: of position, and of velocity and acceleration.
    joints: Vec<[f64; 2]>,
}

impl Units {
    fn change(&self, log: &mut Recording) {
        log.time.iter_mut().for_each(|t| *t *= self.time);
        for (own, [position, rates]) in log.joints.iter_mut().zip(&self.joints) {
            own.q.iter_mut().for_each(|q| *q *= position);
            for values in [own.qd.as_mut(), own.qdd.as_mut()].into_iter().flatten() {
                values.iter_mut().for_each(|value| *value *= rates);
            }
        }
    }

    /// The log in these units; `None` where it cannot be read again.
    fn of(self, robot: &Robot, log: &Log<'static>) -> Option<Log<'static>> {
        match log {
            Log::Whole(recording) => {
                let mut recording = recording.clone().into_owned();
                self.change(&mut recording);
                Some(recording.into())
            }
            Log::Long(long) => {
                let source = InUnits {
                    source: long.source().clone(),
                    units: self,
                };
                let changed = LongLog::new(robot, long.samples().to_vec(), Arc::new(source));
                let mut changed = changed.ok()?;
                changed.name.clone_from(&long.name);
                changed.payload = long.payload;
                Some(Log::Long(match long.shelf() {
                    Some(shelf) => changed.with_shelf(shelf.clone()),
                    None => changed,
                }))
            }
        }
    }
}

/// The chapters of a log in other units.
#[derive(Debug)]
struct InUnits {
    source: Arc<dyn ReadChapter>,
    units: Units,
}

impl ReadChapter for InUnits {
    fn read(&self, chapter: usize) -> twincal::Result<Recording> {
        let mut recording = self.source.read(chapter)?;
        self.units.change(&mut recording);
        Ok(recording)
    }

    fn positions(&self, chapter: usize, joint: usize) -> twincal::Result<Vec<f64>> {
        let mut q = self.source.positions(chapter, joint)?;
        let [position, _] = self.units.joints[joint];
        q.iter_mut().for_each(|q| *q *= position);
        Ok(q)
    }
}

/// A log in units with which it comes further.
pub(super) struct Converted {
    pub(super) log: Log<'static>,
    /// What was converted, in words.
    pub(super) words: String,
    /// The unit of its time where that is no second.
    pub(super) time: Option<TimeUnit>,
    /// What makes radians of it.
    pub(super) degrees: Option<Degrees>,
}

/// What makes radians of a log.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Degrees {
    /// Factor of positions, and of velocities and accelerations.
    pub(super) factors: [f64; 2],
    /// Its joints that are in degrees, ascending.
    pub(super) joints: Vec<usize>,
}

/// The log in units with which it comes further.
pub(super) fn converted(
    robot: &Robot,
    log: &Log<'static>,
    error: &twincal::Error,
    settings: &Settings,
) -> Option<Converted> {
    let twincal::Error::Unit { unit, .. } = error else {
        return None;
    };
    let (word, time) = match unit {
        WrongUnit::Degrees(joint) => return in_radians(robot, log, joint, settings),
        WrongUnit::Milliseconds => ("milliseconds", TimeUnit::Ms),
        WrongUnit::Microseconds => ("microseconds", TimeUnit::Us),
        WrongUnit::Nanoseconds => ("nanoseconds", TimeUnit::Ns),
        _ => return None,
    };
    let units = Units {
        time: time.ticks().recip(),
        joints: vec![[1.0; 2]; robot.dof()],
    };
    let changed = units.of(robot, log)?;
    // Other units may have to be repaired as well.
    match describe(robot, &changed) {
        Ok(_) => {}
        Err(error) => drop(degrees_of(&error)?),
    }
    Some(Converted {
        words: format!("{}: time was taken as {word}", log.name()),
        log: changed,
        time: Some(time),
        degrees: None,
    })
}

/// The joint that is in degrees, where that is what is wrong.
fn degrees_of(error: &twincal::Error) -> Option<&str> {
    match error {
        twincal::Error::Unit {
            unit: WrongUnit::Degrees(joint),
            ..
        } => Some(joint),
        _ => None,
    }
}

/// The log with all its joints taken as in degrees, or those alone that show it.
fn in_radians(
    robot: &Robot,
    log: &Log<'static>,
    joint: &str,
    settings: &Settings,
) -> Option<Converted> {
    let turning = |joint: &usize| robot.joint_kind(*joint) != JointKind::Prismatic;
    let turning: Vec<usize> = (0..robot.dof()).filter(turning).collect();
    for (what, factors) in [
        ("positions, velocities and accelerations", [DEGREE, DEGREE]),
        ("velocities", [1.0, DEGREE]),
        ("positions", [DEGREE, 1.0]),
    ] {
        let all = in_degrees(robot, log, settings, factors, turning.clone());
        let some = named(robot, joint)
            .and_then(|joint| in_degrees(robot, log, settings, factors, vec![joint]));
        // All of them, if the model does not explain clearly more of the torque with those alone that show it.
        let better = |some: &InDegrees| {
            all.as_ref()
                .is_none_or(|all| some.explained > 1.05 * all.explained)
        };
        let Some(found) = some.filter(better).or(all) else {
            continue;
        };
        let names = robot.joint_names();
        let own: Vec<&str> = found.joints.iter().map(|&joint| names[joint]).collect();
        let of = if found.joints == turning {
            String::new()
        } else {
            format!(" of {}", listed(&own, ", "))
        };
        return Some(Converted {
            words: format!("{}: {what}{of} were taken as degrees", log.name()),
            log: found.log,
            time: None,
            degrees: Some(Degrees {
                factors,
                joints: found.joints,
            }),
        });
    }
    None
}

/// A log with some joints taken as in degrees.
struct InDegrees {
    log: Log<'static>,
    joints: Vec<usize>,
    /// Shares of torque that model and friction explain then, all joints together.
    explained: f64,
}

/// Takes these joints as in degrees, and those that are named next, until the log comes further.
fn in_degrees(
    robot: &Robot,
    log: &Log<'static>,
    settings: &Settings,
    factors: [f64; 2],
    mut joints: Vec<usize>,
) -> Option<InDegrees> {
    loop {
        let of_joint = |joint| {
            if joints.contains(&joint) {
                factors
            } else {
                [1.0; 2]
            }
        };
        let units = Units {
            time: 1.0,
            joints: (0..robot.dof()).map(of_joint).collect(),
        };
        let changed = units.of(robot, log)?;
        match filtered(robot, std::slice::from_ref(&changed), settings) {
            Ok((_, _, checkup)) => {
                joints.sort_unstable();
                let explained = checkup.joints.iter().filter_map(|joint| joint.explained);
                return Some(InDegrees {
                    explained: explained.sum(),
                    log: changed,
                    joints,
                });
            }
            Err(error) => {
                let next = named(robot, degrees_of(&error)?);
                joints.push(next.filter(|joint| !joints.contains(joint))?);
            }
        }
    }
}

/// A joint by its name.
fn named(robot: &Robot, name: &str) -> Option<usize> {
    let names = robot.joint_names();
    names.iter().position(|own| *own == name)
}
