//! What a log holds, before anything is fitted: rates, cuts, motion and torque per joint.

use super::prepare::{Piece, Values, joint_facts, prepare};
use super::{Corrections, Log, Logs, Recording};
use crate::error::{Finding, Result, Severity};
use crate::robot::Robot;
use serde::{Deserialize, Serialize};

/// Share of a joint's largest rms torque over the logs below which it was hardly driven.
const HARDLY_DRIVEN: f64 = 0.2;

/// Motion and torque of one joint in one log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointOverview {
    /// Joint name.
    pub joint: String,
    /// Smallest and largest position, rad or m.
    pub q_range: [f64; 2],
    /// Standard deviation of position, rad or m.
    pub q_sd: f64,
    /// Root mean square of velocity (logged, else by differences over five samples), rad/s or m/s.
    pub qd_rms: f64,
    /// Standard deviation of torque, N·m or N; `None` if not logged.
    pub tau_sd: Option<f64>,
    /// Root mean square of torque.
    pub tau_rms: Option<f64>,
    /// Whether velocity is logged.
    pub has_qd: bool,
    /// Whether acceleration is logged.
    pub has_qdd: bool,
}

/// One log at a glance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LogOverview {
    /// Name as given.
    pub name: String,
    /// Rows in the file.
    pub samples: u64,
    /// Time covered without gaps, s.
    pub duration: f64,
    /// One over the median step, Hz.
    pub rate_hz: f64,
    /// Stretches without a cut.
    pub segments: u64,
    /// Whether the clock is uneven.
    pub resampled: bool,
    /// Per moving joint.
    pub joints: Vec<JointOverview>,
}

/// Describes a log; findings are those of [`super::align`] without filters.
///
/// # Errors
/// Like [`super::align`].
pub fn describe(robot: &Robot, log: &Recording) -> Result<(LogOverview, Vec<Finding>)> {
    let facts = joint_facts(robot);
    let mut findings = Vec::new();
    let prepared = prepare(&facts, log, false, &Corrections::default(), &mut findings)?;
    let joints = facts
        .iter()
        .enumerate()
        .map(|(joint, facts)| {
            let gather = |pick: &dyn Fn(&Values<'_>) -> Vec<f64>| -> Vec<f64> {
                prepared
                    .pieces
                    .iter()
                    .flat_map(|p| pick(&p.joints[joint]))
                    .collect()
            };
            let q = gather(&|c| c.q.to_vec());
            let qd = gather(&|c| match &c.qd {
                Some(qd) => qd.to_vec(),
                None => {
                    c.q.windows(6)
                        .map(|w| (w[5] - w[0]) / (5.0 * prepared.interval))
                        .collect()
                }
            });
            let channels = &log.joints[joint];
            let tau = channels
                .tau
                .as_ref()
                .map(|_| gather(&|c| c.tau.as_deref().unwrap_or_default().to_vec()));
            JointOverview {
                joint: facts.name.clone(),
                q_range: q
                    .iter()
                    .fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| {
                        [l.min(*v), h.max(*v)]
                    }),
                q_sd: sd(&q),
                qd_rms: rms(&qd),
                tau_sd: tau.as_deref().map(sd),
                tau_rms: tau.as_deref().map(rms),
                has_qd: channels.qd.is_some(),
                has_qdd: channels.qdd.is_some(),
            }
        })
        .collect();
    let overview = LogOverview {
        name: log.name.clone(),
        samples: log.time.len() as u64,
        duration: prepared
            .pieces
            .iter()
            .map(|p| p.time.len() as f64 * p.interval)
            .sum(),
        rate_hz: 1.0 / prepared.interval,
        segments: prepared.pieces.len() as u64,
        resampled: prepared.pieces.iter().any(Piece::resampled),
        joints,
    };
    Ok((overview, findings))
}

/// Joints whose torque in a log is below a fifth of what it is in another log: they were hardly driven there, and
/// their motion is that of a passive joint.
///
/// # Errors
/// Of chapters that cannot be read.
pub fn hardly_driven<'a>(robot: &Robot, logs: impl Into<Logs<'a>>) -> Result<Vec<Finding>> {
    let Logs(logs) = logs.into();
    let mut findings = Vec::new();
    if logs.len() < 2 {
        return Ok(findings);
    }
    let torques: Vec<Vec<Option<f64>>> = logs.iter().map(torque_rms).collect::<Result<_>>()?;
    for (joint, name) in robot.joint_names().into_iter().enumerate() {
        let largest = (torques.iter().filter_map(|log| log[joint])).fold(0.0, f64::max);
        for (log, torque) in logs.iter().zip(&torques) {
            let Some(torque) = torque[joint].filter(|t| *t < HARDLY_DRIVEN * largest) else {
                continue;
            };
            findings.push(Finding::new(
                Severity::Note,
                "joint_not_driven",
                log.name(),
                format!(
                    "joint `{name}` is hardly driven: rms torque {torque:.3e}, {:.1} % of its largest in any log",
                    100.0 * torque / largest
                ),
                0,
            ));
        }
    }
    Ok(findings)
}

/// Root mean square of each joint's finite torques; `None` without any.
fn torque_rms(log: &Log<'_>) -> Result<Vec<Option<f64>>> {
    let mut sums: Vec<(f64, usize)> = Vec::new();
    log.until(|recording| {
        sums.resize(recording.joints.len(), (0.0, 0));
        for ((sum, count), channels) in sums.iter_mut().zip(&recording.joints) {
            let torque = channels.tau.iter().flatten().filter(|t| t.is_finite());
            for tau in torque {
                *sum += tau * tau;
                *count += 1;
            }
        }
        false
    })?;
    let mean = |(sum, count)| (count > 0).then(|| f64::sqrt(sum / count as f64));
    Ok(sums.into_iter().map(mean).collect())
}

fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|v| v * v).sum::<f64>() / x.len().max(1) as f64).sqrt()
}

fn sd(x: &[f64]) -> f64 {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    (x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / x.len().max(1) as f64).sqrt()
}
