//! Torque of one log or one joint that is scaled, turned, exchanged, or on another clock, by a common fit of all logs and joints.

use super::common_fit::{CommonFit, Effect, Fitted};
use super::excerpt::Excerpt;
use super::rows::{Block, blocks, parameters};
use crate::error::{Code, Finding, Severity};
use crate::rigid_fit::{Bins, leaning, settle};
use crate::robot::Robot;
use crate::signal::{Payload, Pipeline, Trajectory};
use crate::words::significant;
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Standard deviations from which a factor is believed. Real logs without a fault reach 10 (double pendulum, whose friction is not the same in each run), simulated
/// ones 6 (LuGre friction); a factor of 1.2 in one of three logs of 12 s has 40 and more.
const CLEAR: f64 = 12.0;
/// Difference of a factor from 1 from which it matters: held-out error or a mass changes by a tenth.
const MATTERS: f64 = 0.1;
/// What the factor explains at least, over what is left in its rows.
const EXPLAINS: f64 = 0.15;
/// Share of torque that may be left where a factor is believed: else this is not the robot of the model.
const LEFT: f64 = 0.3;
/// Sum of squares with a log turned, over that as it is, below which it is turned. LuGre friction leaves 0.33 of a turned log; of logs that are as they
/// should be the least is 1.16 (a double pendulum; simulated arms 2.4).
const TURNED: f64 = 0.5;
/// Squares of two joints with their torque exchanged, over those as it is, below which it is exchanged in a log.
const EXCHANGED: f64 = 0.25;
/// Factors that are looked for one after the other, and steps to each.
const MOST: usize = 3;
const STEPS: usize = 12;
/// Change of a factor below which it is found.
const FOUND: f64 = 0.002;
/// Standard deviations from which a drift is believed: probability 6e-7, by Student's t with 20 seconds or more 7e-5.
const DRIFTS: f64 = 5.0;
const SECONDS: usize = 20;
/// Times that the lag of each log is taken out: the torque that is left says it anew.
const ADVANCES: usize = 3;
/// Share by which two clocks may differ: quartz keeps 1e-4.
const CLOCKS: f64 = 3e-4;

/// By how much the lag of a log differs from the others', s, from which it matters, and what that explains at least: LuGre friction looks like 29 ms with less.
const LATE: f64 = 0.01;
const EXPLAINS_LAG: f64 = 0.3;

/// A log as it is compared with others.
#[derive(Debug, Clone)]
pub struct Compared<'a> {
    /// Its name.
    pub name: &'a str,
    /// What the robot carried.
    pub payload: Payload,
    /// Some of its rows.
    pub excerpt: Cow<'a, Excerpt>,
}

impl<'a> Compared<'a> {
    /// Of a filtered log.
    #[must_use]
    pub fn of(pipeline: &Pipeline, trajectory: &'a Trajectory) -> Self {
        Self {
            name: &trajectory.name,
            payload: trajectory.payload,
            excerpt: Cow::Owned(Excerpt::of(pipeline, trajectory)),
        }
    }
}

/// Whose torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Whose {
    Log(usize),
    Joint(usize),
    /// Of one joint in one log.
    Block {
        log: usize,
        joint: usize,
    },
}

impl Whose {
    /// The only log that it is about.
    fn log(self) -> Option<usize> {
        match self {
            Self::Log(log) | Self::Block { log, .. } => Some(log),
            Self::Joint(_) => None,
        }
    }

    fn has(self, block: &Block) -> bool {
        match self {
            Self::Log(log) => block.log == log,
            Self::Joint(joint) => block.joint == joint,
            Self::Block { log, joint } => block.log == log && block.joint == joint,
        }
    }

    /// All that may have a factor of its own: with one log no log, with one joint no joint.
    fn all(logs: &[usize], joints: &[usize], joints_too: bool) -> Vec<Self> {
        let several = logs.len() > 1;
        let logs = logs.iter().filter(|_| several).copied();
        let of_logs = logs.clone().map(Self::Log);
        let of_joints = joints.iter().filter(|_| joints_too && joints.len() > 1);
        let of_joints = of_joints.copied().map(Self::Joint);
        let of_both = logs.flat_map(|log| {
            let joints = joints.iter().filter(|_| joints_too && joints.len() > 1);
            joints.map(move |&joint| Self::Block { log, joint })
        });
        of_logs.chain(of_joints).chain(of_both).collect()
    }
}

/// Findings on torque of one log, or one joint, that the others contradict, and on torque whose clock drifts against the motion's.
///
/// | finding | what was seen |
/// |---|---|
/// | `log_torque_factor` | torque of a log, or of one joint in it, is larger or smaller by a factor than the other logs' fit, or turned |
/// | `log_torque_exchanged` | two joints of a log have each other's torque |
/// | `joint_torque_factor` | torque of a joint is, by what the other joints say of the links that it moves |
/// | `log_torque_lag` | torque of a log is late or early, that of the others is not |
/// | `clock_drift` | the lag of torque behind the motion grows over the log |
///
/// Nothing is said of logs with different payloads. `signs_are_right`: [`self_check`](crate::self_check::self_check) found nothing; else
/// joints are not compared.
pub fn odd_torque(robot: &Robot, logs: &[Compared<'_>], signs_are_right: bool) -> Vec<Finding> {
    let alike = logs
        .windows(2)
        .all(|pair| pair[0].payload == pair[1].payload);
    let fit = if alike { common_fit(robot, logs) } else { None };
    let Some(mut fit) = fit else {
        return Vec::new();
    };
    let names = Names {
        logs: logs.iter().map(|log| log.name).collect(),
        joints: robot.joint_names(),
    };
    let mut findings = Vec::new();
    for _ in 0..MOST {
        let Some((log, joints, explained)) = next_exchange(&mut fit) else {
            break;
        };
        findings.push(names.exchange(log, joints, explained));
    }
    for _ in 0..MOST {
        let Some((whose, factor, sd)) = next_factor(&mut fit, signs_are_right) else {
            break;
        };
        findings.push(names.factor(whose, factor, sd));
    }
    findings.extend(late(&fit, &names));
    findings.extend(drifts(fit, &names));
    findings
}

/// The common fit, about the lean of the base where it sees one; `None` where too little moves. How far the base leans, under which inertias, the
/// robust fit says, which holds both near the model's: with all of them free gravity may be anything.
fn common_fit(robot: &Robot, logs: &[Compared<'_>]) -> Option<CommonFit> {
    let excerpts: Vec<Excerpt> = (logs.par_iter())
        .map(|log| log.excerpt.among(logs.len()))
        .collect();
    let fit = |robot: &Robot| CommonFit::new(blocks(robot, &excerpts), parameters(robot));
    let upright = fit(robot)?;
    if leaning(robot, upright.gravity(), &[]).is_none() {
        return Some(upright);
    }
    let bins: Vec<Bins> = excerpts.iter().map(Excerpt::bins).collect();
    match settle(robot, &bins).map(|settled| settled.robot) {
        Some(turned) if turned.description().gravity != robot.description().gravity => fit(&turned),
        _ => Some(upright),
    }
}

/// What a lag of 1 s of a log does to its torque.
fn lagging(own: Fitted<'_>, log: usize) -> Option<Vec<f64>> {
    let own = (own.block().log == log).then(|| own.rate())?;
    Some(own.iter().map(|rate| -rate).collect())
}

/// The lag of each log, s.
fn lags(fit: &CommonFit) -> BTreeMap<usize, f64> {
    let of = |log: &usize| Some((*log, fit.effect(Some(*log), |own| lagging(own, *log))?.size));
    fit.logs().iter().filter_map(of).collect()
}

/// The log whose lag differs most from that of the others, if that is clear.
fn late(fit: &CommonFit, names: &Names<'_>) -> Option<Finding> {
    let lags = lags(fit);
    let apart = |(log, lag): (&usize, &f64)| {
        let others = lags.iter().filter(|(other, _)| *other != log);
        let mut others: Vec<f64> = others.map(|(_, lag)| *lag).collect();
        others.sort_by(f64::total_cmp);
        let middle = others.get(others.len() / 2)?;
        Some((*log, *lag, (lag - middle).abs()))
    };
    // Of two logs that are as far apart the one with the larger lag.
    let size = |(_, lag, apart): &(usize, f64, f64)| apart + lag.abs();
    let all = lags.iter().filter_map(apart);
    let (log, lag, apart) = all.max_by(|a, b| size(a).total_cmp(&size(b)))?;
    if apart < LATE {
        return None;
    }
    let judged = fit.judged(Some(log), |own| lagging(own, log))?;
    let clear = judged.z() > CLEAR && judged.explains > EXPLAINS_LAG;
    clear.then(|| names.lag(log, lag, judged.sd))
}

/// The log and its two joints whose torque is exchanged there, and the shares of it that are explained before and after; the fit then has it exchanged.
fn next_exchange(fit: &mut CommonFit) -> Option<(usize, [usize; 2], [f64; 2])> {
    let logs = Some(fit.logs()).filter(|logs| logs.len() > 1)?;
    let (log, joints, gain) = fit.exchange(&logs)?;
    let own = |block: &Block| block.log == log && joints.contains(&block.joint);
    let of = |fit: &CommonFit| (fit.squares(own), 1.0 - fit.left(own));
    let (before, explained) = of(fit);
    if gain < (1.0 - EXCHANGED) * before {
        return None;
    }
    fit.swap(log, joints);
    let (after, exchanged) = of(fit);
    if after < EXCHANGED * before && exchanged > 1.0 - LEFT {
        return Some((log, joints, [explained, exchanged]));
    }
    fit.swap(log, joints);
    None
}

/// The factor that explains most, which the fit then has; `None` where none is clear.
fn next_factor(fit: &mut CommonFit, joints_too: bool) -> Option<(Whose, f64, f64)> {
    let (logs, joints) = (fit.logs(), fit.joints());
    let mut factor = 1.0;
    let mut whose = None;
    if logs.len() > 1 {
        let turned = fit.turned(&logs).into_iter().zip(logs.iter().copied());
        if let Some((_, log)) = turned
            .filter(|(share, _)| *share < TURNED)
            .min_by(|a, b| a.0.total_cmp(&b.0))
        {
            whose = Some(Whose::Log(log));
            factor = -1.0;
            fit.divide(|block| block.log == log, factor);
        }
    }
    let of = |fit: &CommonFit, whose: Whose| fit.effect(whose.log(), |own| rigid(own, whose));
    if whose.is_none() {
        let all = Whose::all(&logs, &joints, joints_too).into_iter();
        let effects = all.filter_map(|whose| Some((whose, of(fit, whose)?)));
        let (best, effect) = effects.max_by(|a, b| a.1.gain.total_cmp(&b.1.gain))?;
        if effect.size.abs() < 0.5 * MATTERS || effect.explains < EXPLAINS {
            return None;
        }
        let judged = fit.judged(best.log(), |own| rigid(own, best))?;
        if judged.z() < CLEAR {
            return None;
        }
        whose = Some(best);
    }
    let whose = whose?;
    for _ in 0..STEPS {
        let Some(effect) = of(fit, whose) else { break };
        let full = 1.0 + effect.size;
        let step = full.abs().clamp(0.5, 2.0).copysign(full);
        factor *= step;
        fit.divide(|block| whose.has(block), step);
        if (step - 1.0).abs() < FOUND {
            break;
        }
    }
    let sd = fit.judged(whose.log(), |own| rigid(own, whose))?.sd * factor.abs();
    let clear = (factor - 1.0).abs() > CLEAR * sd && (factor - 1.0).abs() >= MATTERS;
    if clear && fit.left(|block| whose.has(block)) < LEFT {
        return Some((whose, factor, sd));
    }
    fit.divide(|block| whose.has(block), 1.0 / factor);
    None
}

fn rigid(own: Fitted<'_>, whose: Whose) -> Option<Vec<f64>> {
    whose.has(own.block()).then(|| own.rigid())
}

/// Lag that grows: in all logs by one share, or in single ones. The lag itself is taken out before: it would hide what grows.
fn drifts(mut fit: CommonFit, names: &Names<'_>) -> Vec<Finding> {
    for _ in 0..ADVANCES {
        fit.advance(&lags(&fit));
    }
    let (fit, logs) = (&fit, fit.logs());
    let of = |which: Option<usize>| {
        let drift = fit.judged(which, |own| {
            let block = own.block();
            which
                .is_none_or(|log| log == block.log)
                .then(|| growing(own))
        })?;
        let clear = drift.clusters >= SECONDS && drift.z() > DRIFTS && drift.size.abs() > CLOCKS;
        clear.then_some(drift)
    };
    if let Some(drift) = of(None) {
        return vec![names.drift(None, &drift)];
    }
    // Of many logs only those that stand out are looked at closely: rows count as independent here.
    let stands_out = |log: &&usize| {
        let drift = fit.effect(Some(**log), |own| {
            (own.block().log == **log).then(|| growing(own))
        });
        let large = |drift: &Effect| drift.size.abs() > CLOCKS && drift.gain > DRIFTS * DRIFTS;
        logs.len() > 1 && drift.as_ref().is_some_and(large)
    };
    let single = logs.iter().filter(stands_out);
    single
        .filter_map(|&log| Some(names.drift(Some(log), &of(Some(log))?)))
        .collect()
}

/// What a lag that grows by 1 s per second from the middle of the log on does to torque.
fn growing(own: Fitted<'_>) -> Vec<f64> {
    let block = own.block();
    let mean = block.time.iter().sum::<f64>() / block.rows() as f64;
    let rate = own.rate();
    let grown = rate.iter().zip(&block.time);
    grown.map(|(rate, time)| -(time - mean) * rate).collect()
}

/// Names of logs and joints, and what is said with them.
struct Names<'a> {
    logs: Vec<&'a str>,
    joints: Vec<&'a str>,
}

impl Names<'_> {
    fn factor(&self, whose: Whose, factor: f64, sd: f64) -> Finding {
        let size = format!("{factor:.2} ± {}", significant(sd.max(0.001), 1));
        let (code, subject, what) = match whose {
            Whose::Log(log) => {
                let name = self.logs[log];
                (Code::LogTorqueFactor, name, format!("log `{name}`"))
            }
            Whose::Block { log, joint } => {
                let (log, joint) = (self.logs[log], self.joints[joint]);
                let what = format!("log `{log}`, joint `{joint}`");
                (Code::LogTorqueFactor, log, what)
            }
            Whose::Joint(joint) => {
                let name = self.joints[joint];
                (Code::JointTorqueFactor, name, format!("joint `{name}`"))
            }
        };
        let columns = match whose {
            Whose::Log(_) => "its torque columns",
            Whose::Block { .. } | Whose::Joint(_) => "its torque column",
        };
        let mistake = match factor < 0.0 {
            true => "a sign, ",
            false => "",
        };
        let load = match code == Code::LogTorqueFactor && factor > 0.0 {
            true => {
                "; a load that not all logs carry looks alike: state `payload` of this [[log]], \"unknown\" if nobody knows it"
            }
            false => "",
        };
        Finding::new(
            Severity::Warning,
            code,
            subject,
            format!(
                "{what}: measured torque is {size} times what {}: look for {mistake}a gain, gear ratio or torque constant there, and multiply \
                 {columns} by {}{load}",
                self.others(whose),
                significant(1.0 / factor, 3)
            ),
            0,
        )
        .with([("factor", factor), ("factor_sd", sd)])
    }

    fn exchange(&self, log: usize, joints: [usize; 2], shares: [f64; 2]) -> Finding {
        let [before, after] = shares.map(|share| share.max(0.0));
        let (name, [a, b]) = (self.logs[log], joints.map(|joint| self.joints[joint]));
        Finding::new(
            Severity::Warning,
            Code::LogTorqueExchanged,
            name,
            format!(
                "log `{name}`: joints `{a}` and `{b}` seem to have each other's torque: what the other logs say explains {:.0} % of it, {:.0} % \
                 exchanged; nothing was changed: rename the torque columns of this log, or leave it out",
                100.0 * before,
                100.0 * after
            ),
            2,
        )
        .with([("explained", after), ("explained_before", before)])
    }

    /// What the torque is compared with.
    fn others(&self, whose: Whose) -> String {
        let others = match (whose, &self.logs[..]) {
            (Whose::Log(log), [one, other]) => {
                let other = if log == 0 { other } else { one };
                return format!("`{other}` says of the same robot, or the other way round");
            }
            (Whose::Log(_), _) => "the other logs say of the same robot",
            (Whose::Block { .. }, _) => "the other logs and joints say of the same robot",
            (Whose::Joint(_), _) => "the other joints say of the links that it moves",
        };
        others.to_owned()
    }

    fn lag(&self, log: usize, lag: f64, sd: f64) -> Finding {
        let name = self.logs[log];
        Finding::new(
            Severity::Warning,
            Code::LogTorqueLag,
            name,
            format!(
                "log `{name}`: torque is written {:.0} ± {:.0} ms {} the motion than in the other logs: log it as the others, or move its stamps by that much",
                1e3 * lag.abs(),
                (1e3 * sd).max(1.0),
                if lag > 0.0 {
                    "later behind"
                } else {
                    "further ahead of"
                },
            ),
            0,
        )
        .with([("lag", lag), ("lag_sd", sd)])
    }

    fn drift(&self, log: Option<usize>, drift: &Effect) -> Finding {
        let (subject, what) = match log {
            Some(log) => (self.logs[log], format!("log `{}`", self.logs[log])),
            None => match &self.logs[..] {
                [one] => (*one, format!("log `{one}`")),
                all => ("", format!("all {} logs", all.len())),
            },
        };
        let order = if drift.size > 0.0 { "slower" } else { "faster" };
        Finding::new(
            Severity::Warning,
            Code::ClockDrift,
            subject,
            format!(
                "{what}: the clock of torque is {} % ± {} {order} than that of the motion, so that its lag grows by {} ms in 10 s: log both with one \
                 clock, or bring the stamps of torque to that of the motion",
                significant(100.0 * drift.size.abs(), 2),
                significant(100.0 * drift.sd, 1),
                significant(1e4 * drift.size.abs(), 2),
            ),
            0,
        )
        .with([
            ("drift", drift.size), ("drift_sd", drift.sd),
            ("logs", if log.is_some() { 1.0 } else { self.logs.len() as f64 }),
        ])
    }
}

#[cfg(test)]
mod tests;
