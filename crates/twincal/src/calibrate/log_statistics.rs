//! Statistics of logs: what a fit takes of them, apart from the logs themselves.

use super::data::all_logs::{spread, within};
use super::data::facts::LogFacts;
use super::data::log::Log;
use super::data::reader::{Reader, Role};
use super::distinct::{Fnv, Identity, require_distinct};
use super::plan::Plan;
use crate::cross_check::{Excerpt, Sketch, stuck_encoders};
use crate::error::{Error, Finding, Result};
use crate::gram::{JointAccumulator, JointGram, Workspace};
use crate::observations::Observations;
use crate::robot::Robot;
use crate::rows::{RowBlock, RowSignal, visit_parts};
use crate::self_check::{Look, look};
use crate::signal::{self, Payload, Trajectory, constant_torque, ready, torque_rms};
use crate::statistics::{BLOCKS, LogSums};
use crate::term::Library;
use crate::words::{quoted, significant};
use serde::{Deserialize, Serialize};

/// Statistics of logs of one robot under one plan, in the order of their names. Those of other logs can be added, and a fit takes nothing else.
///
/// # Example
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::calibrate::{Statistics, calibrate_statistics, plan};
/// use twincal::prelude::*;
///
/// # let mut noise = twincal::random::Random::new(1, 0);
/// # let (robot, real) = (two_link::arm(2.0)?, two_link::arm(2.6)?);
/// # let logs = [("run1", 0.3), ("run2", 1.1), ("run3", 2.2)];
/// # let logs = logs.map(|(name, phase)| two_link::log(name, phase, &real, &mut noise));
/// let mut settings = Settings::default();
/// settings.library.families = vec![Family::Payload, Family::Viscous];
/// let (plan, _) = plan(&robot, &logs[..1], &settings, &|_| {})?; // filters, candidates: once
/// let of = |log: &Recording| Statistics::of(("arm", &robot), &plan, &Log::from(log), "");
/// let mut sum = of(&logs[0])?; // each where its log is
/// sum.try_merge(&of(&logs[1])?)?;
/// let fit = calibrate_statistics(&sum, &logs[2..], &settings, &|_| {})?;
/// assert!(fit.effects().any(|effect| effect.name() == "payload"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Statistics {
    /// The robot that was logged; two of one type have the same model and another name.
    pub robot_name: String,
    /// The nominal robot.
    pub robot: Robot,
    /// How the logs were read.
    pub plan: Plan,
    /// Log by log.
    pub(crate) logs: Vec<LogStatistics>,
}

/// Statistics of one log.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LogStatistics {
    pub(crate) about: About,
    pub(crate) sums: LogSums,
    /// Per joint, over the signals: of torque as logged, and of filtered rows at the same times. Empty without a filter.
    pub(crate) raw: Vec<[JointGram; 2]>,
    /// The noise of its torque: copies are found by it.
    pub(crate) noise: Sketch,
    /// Some of its rows: the logs are compared by them.
    pub(crate) excerpt: Excerpt,
}

/// What else is known of a log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct About {
    pub(crate) facts: LogFacts,
    /// SHA-256 of the file, where there is one: the same log twice is found by it.
    pub(crate) source: String,
    /// Checksum of the settings that it was read with, where there is a file.
    pub(crate) reading: String,
    /// What was found while it was read.
    pub(crate) findings: Vec<Finding>,
    /// Root mean square of each joint's torque as logged, N·m or N.
    pub(crate) torque_rms: Vec<Option<f64>>,
    /// The self-check found nothing in it.
    pub(crate) signs_are_right: bool,
}

impl Statistics {
    /// Statistics of one log; `source` is the checksum of its file, or empty.
    ///
    /// # Errors
    /// [`Error::Statistics`] for a plan of another version or robot, for a log without rows and for one that carries something unknown where no log of
    /// the plan did; those of logs.
    pub fn of(
        (robot_name, robot): (&str, &Robot),
        plan: &Plan,
        log: &signal::Log<'_>,
        source: &str,
    ) -> Result<Self> {
        plan.require_for(robot)?;
        let names = robot.joint_names();
        log.any_recording(|recording| recording.require_torque(&names))?;
        require_planned_payload(log, plan)?;
        let (library, _) = Library::propose(robot, &plan.library)?;
        // While nothing else of the log is in memory.
        let noise = Sketch::of(log, robot.dof())?;
        let mut findings = as_recorded(robot, log)?;
        let read = ready(robot, log, &plan.pipeline)?;
        let reader = Reader {
            robot,
            library: &library,
            pipeline: &plan.pipeline,
            unknown: plan.payload_where_unknown,
        };
        let given = log;
        let (log, trajectory) = reader.log(&read, Role::Fit(&[]), &mut findings)?;
        drop(read);
        let motion = std::iter::once(&trajectory);
        let compared = look(robot, &plan.pipeline, motion)?;
        require_unit(given.name(), &compared)?;
        let signs_are_right = compared.findings.is_empty();
        findings.extend(compared.findings);
        if log.observations.is_empty() {
            return Err(Error::Statistics {
                problem: format!("log `{}` has no row behind the filters", log.summary.name),
                remedy: "leave the log out".into(),
            });
        }
        let raw = raw((robot, &library), plan, &log, &trajectory)?;
        let sums =
            LogSums::of(&[&log.observations.whole()], BLOCKS, plan.runs()).with_runs(plan.runs());
        require_read_back(given)?;
        Ok(Self {
            robot_name: robot_name.to_owned(),
            robot: robot.clone(),
            plan: plan.clone(),
            logs: vec![LogStatistics {
                sums,
                raw,
                noise,
                excerpt: Excerpt::of(&plan.pipeline, &trajectory),
                about: About {
                    facts: LogFacts::of(&log, given.payload()),
                    source: source.to_owned(),
                    reading: String::new(),
                    findings,
                    torque_rms: torque_rms(given)?,
                    signs_are_right,
                },
            }],
        })
    }

    /// The same with how the file of its only log was read (a checksum of the settings), and what was found meanwhile.
    #[must_use]
    pub fn with_reading(mut self, reading: String, findings: Vec<Finding>) -> Self {
        if let Some(log) = self.logs.first_mut() {
            log.about.reading = reading;
            log.about.findings.splice(0..0, findings);
        }
        self
    }

    /// Names of the logs.
    pub fn log_names(&self) -> impl Iterator<Item = &str> {
        self.logs
            .iter()
            .map(|log| log.about.facts.summary.name.as_str())
    }

    /// Checksums of the files of the logs, where they are known.
    pub fn sources(&self) -> impl Iterator<Item = &str> {
        let sources = self.logs.iter().map(|log| log.about.source.as_str());
        sources.filter(|source| !source.is_empty())
    }

    /// Checksums of the settings that the logs were read with; empty where there was no file.
    pub fn readings(&self) -> impl Iterator<Item = &str> {
        self.logs.iter().map(|log| log.about.reading.as_str())
    }

    /// Adds the statistics of other logs of the same robot under the same plan.
    ///
    /// # Errors
    /// [`Error::Statistics`] for another plan, version or robot, for a log that is there already, under this or another name, and for logs of
    /// one robot that overlap in time (by absolute stamps); then nothing was added.
    ///
    /// # Example
    /// A log adds once: the second time it is refused.
    /// ```
    /// # #[path = "../../examples/two_link.rs"] mod two_link;
    /// use twincal::calibrate::{Statistics, plan};
    /// use twincal::prelude::*;
    ///
    /// # let (robot, mut noise) = (two_link::arm(2.0)?, twincal::random::Random::new(1, 0));
    /// # let logs = [("run1", 0.3), ("run2", 1.1)];
    /// # let real = two_link::arm(2.6)?;
    /// # let logs = logs.map(|(name, phase)| two_link::log(name, phase, &real, &mut noise));
    /// # let mut settings = Settings::default();
    /// # settings.library.families = vec![Family::Payload, Family::Viscous];
    /// # let (plan, _) = plan(&robot, &logs[..1], &settings, &|_| {})?;
    /// let of = |log: &Recording| Statistics::of(("arm", &robot), &plan, &Log::from(log), "");
    /// let (mut sum, other) = (of(&logs[0])?, of(&logs[1])?);
    /// sum.try_merge(&other)?;
    /// assert!(sum.log_names().eq(["run1", "run2"]));
    /// assert!(sum.try_merge(&other).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn try_merge(&mut self, other: &Self) -> Result<()> {
        require_same(self.common(), other.common())?;
        let logs = self.logs.iter().chain(&other.logs);
        require_distinct(&logs.map(LogStatistics::identity).collect::<Vec<_>>())?;
        self.logs.extend_from_slice(&other.logs);
        self.logs.sort_by(|a, b| a.name().cmp(b.name()));
        Ok(())
    }

    /// What is the same in statistics that add.
    fn common(&self) -> Common<'_> {
        (&self.robot_name, &self.robot, &self.plan)
    }
}

/// What is the same in statistics that add: name of the robot, its model, the plan.
pub(super) type Common<'a> = (&'a str, &'a Robot, &'a Plan);

/// # Errors
/// [`Error::Statistics`] for another plan, version or robot.
pub(super) fn require_same(own: Common<'_>, other: Common<'_>) -> Result<()> {
    let ((name, robot, plan), (other_name, other_robot, other_plan)) = (own, other);
    let (problem, remedy) = if plan.version != other_plan.version {
        (
            format!(
                "made with version {} of the plan, the others with {}",
                other_plan.version, plan.version
            ),
            "make all of them with one version of the program",
        )
    } else if name != other_name {
        (
            format!("of robot `{other_name}`, the others of `{name}`"),
            "merge statistics of one robot; say with --robot which one was logged",
        )
    } else if robot != other_robot {
        let [joints, others] = [other_robot, robot].map(|own| quoted(own.joint_names()));
        let problem = match joints == others {
            true => "of another model file than the others".into(),
            false => {
                format!("of a model with joints {joints}, the others with {others}, in this order")
            }
        };
        (
            problem,
            "make all of them with one model file: twincal statistics --model FILE",
        )
    } else if plan != other_plan {
        (
            "made with another plan than the others".into(),
            "make all of them with one plan: twincal statistics --plan FILE",
        )
    } else {
        return Ok(());
    };
    Err(Error::Statistics {
        problem,
        remedy: remedy.into(),
    })
}

/// Numbers of a long log that could not be read back are behind whatever was made of it.
///
/// # Errors
/// Why they could not.
pub(super) fn require_read_back(log: &signal::Log<'_>) -> Result<()> {
    match log.shelf().and_then(|shelf| shelf.failure()) {
        Some(failure) => Err(failure),
        None => Ok(()),
    }
}

fn require_planned_payload(log: &signal::Log<'_>, plan: &Plan) -> Result<()> {
    if log.payload() != Payload::Unknown || plan.payload_where_unknown {
        return Ok(());
    }
    Err(Error::Statistics {
        problem: format!(
            "log `{}` carries something unknown, which no log of the plan did",
            log.name()
        ),
        remedy: "make a plan from logs of which some carry it and some do not".into(),
    })
}

/// Factor between measured and nominal torque which is a unit and not a gear: N·mm is 1000, gears go to 300.
const UNIT: f64 = 400.0;
/// Ratio of the factors of two joints up to which they have one unit; a single joint may as well have a wrong mass in the model.
const ONE_UNIT: f64 = 2.5;

/// # Errors
/// [`Error::Log`] for torque of another unit, on all joints or alike on two and more.
fn require_unit(log: &str, compared: &Look) -> Result<()> {
    let odd = |times: f64| !(1.0 / UNIT..=UNIT).contains(&times);
    let odd: Vec<&(Option<String>, f64)> = (compared.sizes.iter())
        .filter(|(_, times)| odd(*times))
        .collect();
    let sizes = || odd.iter().map(|(_, times)| *times);
    let (least, most) = (
        sizes().fold(f64::INFINITY, f64::min),
        sizes().fold(0.0, f64::max),
    );
    // The column that is read as a joint's torque: it may be another one's.
    let column = |joint: &String| {
        let mut checks = compared.joints.iter();
        let own = checks.find(|own| own.joint == *joint);
        own.map_or_else(|| joint.clone(), |own| own.torque.0.clone())
    };
    let named: Vec<String> = (odd.iter())
        .filter_map(|(joint, _)| joint.as_ref().map(column))
        .collect();
    let joints = match (odd.len() - named.len(), named.len()) {
        (1.., _) => "all joints".into(),
        (0, 2..) if most <= ONE_UNIT * least => format!("joints {}", quoted(&named)),
        _ => return Ok(()),
    };
    Err(Error::Log {
        log: log.to_owned(),
        problem: format!(
            "the torque of {joints} is {} times the model's, which is another unit",
            significant(most, 3)
        ),
        remedy: "give what makes N·m of it in [columns.factor] tau, or what the column holds in [[log]] torque".into(),
    })
}

/// What a log as recorded says of itself.
fn as_recorded(robot: &Robot, log: &signal::Log<'_>) -> Result<Vec<Finding>> {
    let one = || vec![log.lent()];
    let mut findings = constant_torque(robot, one())?;
    findings.extend(stuck_encoders(robot, &one())?);
    Ok(findings)
}

impl LogStatistics {
    pub(crate) fn name(&self) -> &str {
        &self.about.facts.summary.name
    }

    /// What distinguishes it from others.
    pub(crate) fn identity(&self) -> Identity<'_> {
        let mut sum = Fnv::new();
        (self.sums.rows.iter()).for_each(|rows| sum.add(*rows as u64));
        for block in self.sums.joints.iter().flat_map(|joint| &joint.blocks) {
            let residual = block.gram.s0.values.last().copied().unwrap_or(0.0);
            let numbers = [block.torque, block.gram.n, residual];
            (numbers.iter()).for_each(|number| sum.add(number.to_bits()));
        }
        Identity {
            name: self.name(),
            source: &self.about.source,
            ends: self.about.facts.ends,
            sums: sum.sum(),
        }
    }

    /// Root mean square of each joint's torque in the rows, N·m or N.
    pub(crate) fn row_torque_rms(&self) -> Vec<Option<f64>> {
        let rows = self.sums.rows.iter().sum::<usize>().max(1) as f64;
        let squares = self.sums.joints.iter().map(|joint| {
            let squares = joint.blocks.iter().map(|own| own.torque);
            squares.sum::<f64>()
        });
        squares
            .map(|squares| Some((squares / rows).sqrt()))
            .collect()
    }

    /// The same with stretches twice as long.
    pub(crate) fn coarse(&self) -> Self {
        Self {
            sums: self.sums.coarse(),
            ..self.clone()
        }
    }
}

/// Sums of the torque as logged and of the filtered rows at the same times, of about 8000 samples of a log.
fn raw(
    (robot, library): (&Robot, &Library),
    plan: &Plan,
    log: &Log,
    trajectory: &Trajectory,
) -> Result<Vec<[JointGram; 2]>> {
    let pipeline = &plan.pipeline;
    if pipeline.cutoff_hz == 0.0 {
        return Ok(Vec::new());
    }
    let (slices, times) = spread(pipeline, trajectory);
    let signals = |joint: usize| log.observations.joints[joint].signals() as u32;
    let sums = |joint: usize| JointAccumulator::new((0..signals(joint)).collect());
    let mut raw: Vec<JointAccumulator> = (0..robot.dof()).map(sums).collect();
    let mut workspace = Workspace::default();
    let mut add = |block: &RowBlock<'_>| {
        for (rows, sum) in block.joints.iter().zip(&mut raw) {
            let torques = rows.measured.iter().zip(rows.nominal);
            let mut y: Vec<f64> = torques.map(|(m, n)| m - n).collect();
            // There are none where no effects multiply each other.
            (y.iter_mut().zip(rows.products)).for_each(|(y, product)| *y -= product);
            let keep: Vec<bool> = rows.standstill.iter().map(|still| !still).collect();
            sum.push_block(rows.x, rows.stride, &y, &keep, block.first, &mut workspace);
        }
        Ok(())
    };
    let signal = RowSignal::Raw;
    visit_parts(
        robot, library, pipeline, trajectory, signal, &slices, &mut add,
    )?;
    let in_band = (0..robot.dof()).map(|joint| in_band(&log.observations, joint, &times));
    let both = raw.into_iter().map(JointAccumulator::finish).zip(in_band);
    Ok(both
        .map(|(mut raw, mut in_band)| {
            raw.forget_runs();
            in_band.forget_runs();
            [raw, in_band]
        })
        .collect())
}

/// Sums of the moving rows of a joint within some times.
fn in_band(all: &Observations, joint: usize, times: &[[f64; 2]]) -> JointGram {
    let rows = &all.joints[joint];
    let mut sums = JointAccumulator::new((0..rows.signals() as u32).collect());
    let mut workspace = Workspace::default();
    rows.visit_signals(all.len(), 0..all.len(), &mut |range, columns| {
        let keep = |row: usize| !rows.standstill[row] && within(times, all.time[row]);
        let keep: Vec<bool> = range.clone().map(keep).collect();
        let x = if rows.signals() == 0 { &[] } else { columns.x };
        sums.push_block(
            x,
            columns.stride,
            &rows.y[range],
            &keep,
            true,
            &mut workspace,
        );
    });
    sums.finish()
}
