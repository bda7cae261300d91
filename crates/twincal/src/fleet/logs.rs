//! The logs of a fleet, as little of each as the posterior needs, and which of them are left out.

use crate::calibrate::LogStatistics;
use crate::calibrate::Plan;
use crate::gram::{Gram, JointGram};
use crate::robot::Robot;
use crate::statistics::JointBlock;
use std::collections::{BTreeMap, BTreeSet};

/// Stamps behind it are seconds since 1970, s: September 2001.
const ABSOLUTE: f64 = 1e9;
/// A log whose torque is more than this many times the median log's on every joint, or less than one over it, has another unit of torque.
const ODD: f64 = 30.0;

/// Why a log or a unit is left out.
#[derive(Debug, Clone, PartialEq)]
pub enum Reason {
    /// Its model file is not that of most units.
    OtherRobot,
    /// Its plan is not that of most units.
    OtherPlan,
    /// The same log is there under another name or unit.
    Twice {
        /// The other unit.
        robot: String,
        /// The other log.
        log: String,
    },
    /// It overlaps in time with another log of the unit by so many seconds.
    Overlap {
        /// The other log.
        log: String,
        /// s.
        seconds: f64,
    },
    /// The log's torque is this many times that of the median log on every joint.
    Size {
        /// Geometric mean over the joints.
        ratio: f64,
    },
    /// Its sums hold numbers that are not finite.
    NotFinite,
}

impl Reason {
    /// The reason as one word for programs: `other_plan`, `twice`, …
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::OtherRobot => "other_robot",
            Self::OtherPlan => "other_plan",
            Self::Twice { .. } => "twice",
            Self::Overlap { .. } => "overlap",
            Self::Size { .. } => "torque_unit",
            Self::NotFinite => "not_finite",
        }
    }
}

/// A log that does not count.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// Name of its unit.
    pub robot: String,
    /// Name of the log.
    pub log: String,
    /// Why.
    pub reason: Reason,
}

/// What is kept of one log.
#[derive(Debug, Clone)]
pub(super) struct KeptLog {
    pub(super) robot: String,
    pub(super) name: String,
    pub(super) source: String,
    /// First and last stamp, s.
    pub(super) ends: [f64; 2],
    pub(super) gram: Gram,
    /// Rows, and squares of the measured torque of each joint.
    pub(super) rows: usize,
    torque: Vec<f64>,
    /// Of a few units noise is measured.
    pub(super) measured: bool,
    /// All sums, of those and of units whose twin is asked for.
    pub(super) statistics: Option<Box<LogStatistics>>,
}

/// All statistics of a log.
#[derive(Debug, Clone)]
pub(super) struct KeptStatistics {
    pub(super) robot: String,
    pub(super) measured: bool,
    /// Number of its window; `None` without a date.
    pub(super) window: Option<i64>,
    pub(super) statistics: LogStatistics,
}

impl KeptStatistics {
    /// Under a name that says whose log it is.
    pub(super) fn named(&self) -> LogStatistics {
        let mut statistics = self.statistics.clone();
        let name = &mut statistics.about.facts.summary.name;
        *name = format!("{}/{name}", self.robot);
        statistics
    }
}

/// Logs with one robot model and one plan.
#[derive(Debug, Clone)]
pub(super) struct Family {
    pub(super) robot: Robot,
    pub(super) plan: Plan,
    pub(super) logs: Vec<KeptLog>,
    /// Robots met so far, and every how many of them keep all of their sums.
    units: BTreeMap<String, usize>,
    step: usize,
}

impl Family {
    pub(super) fn new(robot: Robot, plan: Plan) -> Self {
        Self {
            robot,
            plan,
            logs: Vec::new(),
            units: BTreeMap::new(),
            step: 1,
        }
    }

    /// Adds the logs of a robot; of `measured` robots to twice as many, and of those asked for, all sums are kept.
    pub(super) fn add(
        &mut self,
        robot: &str,
        logs: &[LogStatistics],
        (measured, asked): (usize, &BTreeSet<String>),
    ) {
        let count = self.units.len();
        let place = *self.units.entry(robot.to_owned()).or_insert(count);
        while place / self.step >= 2 * measured {
            self.step *= 2;
            for log in &mut self.logs {
                log.measured = self.units[&log.robot].is_multiple_of(self.step);
                if !log.measured && !asked.contains(&log.robot) {
                    log.statistics = None;
                }
            }
        }
        for log in logs {
            let mut kept = KeptLog::new(robot, log);
            kept.measured = place.is_multiple_of(self.step);
            if kept.measured || asked.contains(robot) {
                kept.statistics = Some(Box::new(log.coarse()));
            }
            self.logs.push(kept);
        }
    }
}

impl KeptLog {
    pub(super) fn new(robot: &str, log: &LogStatistics) -> Self {
        let joints = (log.sums.joints.iter()).map(|own| {
            let mut sum = JointBlock::default();
            own.blocks.iter().for_each(|block| sum += block);
            sum.of_columns(&own.columns, own.recipes.as_deref())
        });
        let joints: Vec<JointBlock> = joints.collect();
        Self {
            robot: robot.to_owned(),
            name: log.name().to_owned(),
            source: log.about.source.clone(),
            ends: log.about.facts.ends,
            rows: log.sums.rows.iter().sum(),
            torque: joints.iter().map(|own| own.torque).collect(),
            gram: Gram {
                joints: joints.into_iter().map(|own| own.gram).collect(),
            },
            measured: false,
            statistics: None,
        }
    }

    fn is_finite(&self) -> bool {
        let finite = |gram: &JointGram| {
            let sums = [&gram.s0, &gram.d, &gram.first, &gram.last];
            sums.iter()
                .all(|sum| sum.values.iter().all(|x| x.is_finite()))
        };
        self.gram.joints.iter().all(finite) && self.torque.iter().all(|x| x.is_finite())
    }

    /// Start since 1970, s; `None` where stamps do not count from there.
    pub(super) fn since_1970(&self) -> Option<f64> {
        Some(self.ends[0]).filter(|start| *start > ABSOLUTE)
    }

    fn left_out(&self, reason: Reason) -> LeftOut {
        LeftOut {
            robot: self.robot.clone(),
            log: self.name.clone(),
            reason,
        }
    }
}

/// The family of most units, and what is left out because it belongs to another.
pub(super) fn largest(families: Vec<Family>) -> Option<(Family, Vec<LeftOut>)> {
    let units = |family: &Family| {
        let mut names: Vec<&str> = family.logs.iter().map(|log| log.robot.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        names.len()
    };
    // Of equally large ones the first.
    let most = (0..families.len())
        .rev()
        .max_by_key(|&i| units(&families[i]))?;
    let mut families = families;
    let family = families.swap_remove(most);
    let mut left_out = Vec::new();
    for other in families {
        let same = other.robot == family.robot;
        for log in &other.logs {
            let reason = if same {
                Reason::OtherPlan
            } else {
                Reason::OtherRobot
            };
            left_out.push(log.left_out(reason));
        }
    }
    Some((family, left_out))
}

/// Takes out what cannot be a log of its unit, in the order of units and logs.
pub(super) fn sifted(mut logs: Vec<KeptLog>) -> (Vec<KeptLog>, Vec<LeftOut>) {
    logs.sort_by(|a, b| (&a.robot, &a.name).cmp(&(&b.robot, &b.name)));
    let mut reasons: Vec<Option<Reason>> = logs
        .iter()
        .map(|log| (!log.is_finite()).then_some(Reason::NotFinite))
        .collect();
    twice(&logs, &mut reasons);
    overlapping(&logs, &mut reasons);
    odd(&logs, &mut reasons);
    let mut left_out = Vec::new();
    let mut kept = Vec::new();
    for (log, reason) in logs.into_iter().zip(reasons) {
        match reason {
            None => kept.push(log),
            Some(reason) => left_out.push(log.left_out(reason)),
        }
    }
    (kept, left_out)
}

/// The same log under two units says nothing of either: both go. Under two names of one unit the second goes.
fn twice(logs: &[KeptLog], reasons: &mut [Option<Reason>]) {
    let mut by_size: BTreeMap<(usize, u64), Vec<usize>> = BTreeMap::new();
    for (i, log) in logs.iter().enumerate() {
        let torque = log.torque.iter().sum::<f64>();
        by_size
            .entry((log.rows, torque.to_bits()))
            .or_default()
            .push(i);
    }
    for own in by_size.values().filter(|own| own.len() > 1) {
        for (place, &b) in own.iter().enumerate() {
            for &a in &own[..place] {
                let same_file = !logs[a].source.is_empty() && logs[a].source == logs[b].source;
                if !same_file && logs[a].gram != logs[b].gram {
                    continue;
                }
                let of = |other: usize| Reason::Twice {
                    robot: logs[other].robot.clone(),
                    log: logs[other].name.clone(),
                };
                reasons[b].get_or_insert_with(|| of(a));
                if logs[a].robot != logs[b].robot {
                    reasons[a].get_or_insert_with(|| of(b));
                }
            }
        }
    }
}

fn overlapping(logs: &[KeptLog], reasons: &mut [Option<Reason>]) {
    let mut order: Vec<usize> = (0..logs.len())
        .filter(|&i| reasons[i].is_none() && logs[i].since_1970().is_some())
        .collect();
    order.sort_by(|&a, &b| {
        let key = |i: usize| (&logs[i].robot, logs[i].ends[0]);
        let ((x, s), (y, t)) = (key(a), key(b));
        x.cmp(y).then(s.total_cmp(&t))
    });
    let mut last: Option<usize> = None;
    for i in order {
        let before = last.filter(|&l| logs[l].robot == logs[i].robot);
        match before.filter(|&l| logs[l].ends[1] > logs[i].ends[0]) {
            Some(l) => {
                reasons[i] = Some(Reason::Overlap {
                    log: logs[l].name.clone(),
                    seconds: logs[l].ends[1].min(logs[i].ends[1]) - logs[i].ends[0],
                });
            }
            None => last = Some(i),
        }
    }
}

/// Logs with torque in another unit than the median log, joint by joint.
fn odd(logs: &[KeptLog], reasons: &mut [Option<Reason>]) {
    let kept: Vec<usize> = (0..logs.len()).filter(|&i| reasons[i].is_none()).collect();
    let joints = logs.first().map_or(0, |log| log.torque.len());
    if kept.len() < 3 {
        return;
    }
    let size = |i: usize, joint: usize| (logs[i].torque[joint] / logs[i].rows.max(1) as f64).sqrt();
    let medians: Vec<f64> = (0..joints)
        .map(|joint| {
            let mut sizes: Vec<f64> = kept.iter().map(|&i| size(i, joint)).collect();
            sizes.sort_by(f64::total_cmp);
            sizes[sizes.len() / 2]
        })
        .collect();
    for &i in &kept {
        let ratios = medians
            .iter()
            .enumerate()
            .map(|(j, median)| size(i, j) / median);
        let ratios: Vec<f64> = ratios.filter(|r| *r > 0.0 && r.is_finite()).collect();
        let all = |is: fn(f64) -> bool| !ratios.is_empty() && ratios.iter().all(|r| is(*r));
        if all(|r| r > ODD) || all(|r| r < 1.0 / ODD) {
            let mean = ratios.iter().map(|r| r.ln()).sum::<f64>() / ratios.len() as f64;
            reasons[i] = Some(Reason::Size { ratio: mean.exp() });
        }
    }
}
