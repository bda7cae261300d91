//! What in a log is not the robot's own motion: something was hit (case 29), or the drives were off (case 30).
//!
//! Such stretches are told, listed and left out of the fit; the robot is not calibrated on a collision, nor on brakes.

mod spikes;
mod stops;

use crate::error::{Finding, Severity};
use crate::robot::Robot;
use crate::signal::{Pipeline, Trajectory};
use serde::{Deserialize, Serialize};

/// Incidents that a message lists.
const LISTED: usize = 5;

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IncidentKind {
    /// Torque that neither the model nor friction explains, for a short time: a contact or a collision.
    Spike,
    /// All joints stand still without the torque that holds them: brakes, or a protective stop.
    DrivesOff,
}

/// A stretch of a log that is not the robot's own motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Incident {
    /// What happened.
    pub kind: IncidentKind,
    /// Joint in which it is largest.
    pub joint: String,
    /// First and last stamp, s.
    pub span: [f64; 2],
    /// Spike: largest torque that is not explained. Drives off: largest torque that holding would take. N·m or N.
    pub torque: f64,
    /// Samples from first to last.
    pub samples: u64,
}

/// Finds the incidents of a log, in time order for each kind; none with the pipeline off, where every input row is one
/// row whatever happened there.
pub fn incidents(robot: &Robot, pipeline: &Pipeline, trajectory: &Trajectory) -> Vec<Incident> {
    if pipeline.is_off() || trajectory.segments.iter().any(|s| s.tau.is_empty()) {
        return Vec::new();
    }
    let mut found = stops::stops(robot, pipeline, trajectory);
    let stopped: Vec<[f64; 2]> = found.iter().map(|stop| stop.span).collect();
    found.extend(spikes::spikes(robot, pipeline, trajectory, &stopped));
    found
}

/// Takes the incidents of a log out of the fit, for all joints: what hits a link acts on every joint before it.
pub fn leave_out(pipeline: &Pipeline, trajectory: &mut Trajectory, incidents: &[Incident]) {
    // No row that is left shares a sample with an incident.
    let margin = pipeline.filter_half_length() + pipeline.motion_half_length();
    for segment in &mut trajectory.segments {
        let len = segment.time.len();
        for [first, last] in incidents.iter().map(|incident| incident.span) {
            let from = segment.time.partition_point(|t| *t < first - margin);
            let to = segment.time.partition_point(|t| *t <= last + margin);
            for joint in 0..trajectory.dof {
                segment.standstill[joint * len + from..joint * len + to.max(from)].fill(true);
            }
        }
    }
}

/// One warning per log and kind.
pub fn incident_findings(log: &str, incidents: &[Incident]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for kind in [IncidentKind::DrivesOff, IncidentKind::Spike] {
        let own: Vec<&Incident> = incidents.iter().filter(|i| i.kind == kind).collect();
        if own.is_empty() {
            continue;
        }
        let list: Vec<String> = own
            .iter()
            .take(LISTED)
            .map(|i| {
                let [first, last] = i.span;
                let digits = if last - first < 0.1 { 3 } else { 2 };
                format!(
                    "{first:.digits$} … {last:.digits$} s (`{}`, {:.3} N·m)",
                    i.joint, i.torque
                )
            })
            .collect();
        let more = match own.len().saturating_sub(LISTED) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let times = if own.len() == 1 {
            "once"
        } else {
            &format!("{} times", own.len())
        };
        let list = list.join(", ");
        let (code, message) = match kind {
            IncidentKind::Spike => (
                "torque_spike",
                format!(
                    "a contact or collision, {times}: torque that neither model nor friction explains at {list}{more}; left \
                     out of the fit: look at what was hit, or cut the log there"
                ),
            ),
            IncidentKind::DrivesOff => (
                "drives_off",
                format!(
                    "brakes or a protective stop, {times}: all joints stand still without the torque that would hold them \
                     (joint and torque in brackets) at {list}{more}; left out of the fit"
                ),
            ),
        };
        let samples = own.iter().map(|i| i.samples).sum();
        findings.push(Finding::new(Severity::Warning, code, log, message, samples));
    }
    findings
}

#[cfg(test)]
mod tests;
