//! What in a log is not the robot's own motion: something was hit (case 29), or the drives were off (case 30).
//!
//! Such stretches are told, listed and left out of the fit; the robot is not calibrated on a collision, nor on brakes.

mod contacts;
mod incident;
mod repeats;
mod stops;

pub use incident::{Incident, IncidentKind};

use crate::error::Code;
use crate::error::{Finding, Result, Severity};
use crate::rigid_fit::{Bins, bins};
use crate::robot::Robot;
use crate::signal::{FewChapters, Log, Pipeline, Raw, Shelf, Trajectory, align, prepare};
use crate::words::significant;
use std::sync::Arc;

/// Incidents that a message lists.
const LISTED: usize = 5;

/// What a log shows of incidents, part by part: what is far beyond the usual is told by all of them together.
#[derive(Debug, Default)]
pub struct Evidence {
    stops: Vec<Incident>,
    bins: Vec<Bins>,
}

impl Evidence {
    /// Takes the next part of a log; nothing with the pipeline off, where every input row is one row whatever happened there, and
    /// without torque.
    pub fn take(&mut self, robot: &Robot, pipeline: &Pipeline, trajectory: &Trajectory) {
        if pipeline.is_off() || trajectory.segments.iter().any(|s| s.tau.is_empty()) {
            return;
        }
        let stops = stops::stops(robot, pipeline, trajectory);
        let stopped: Vec<[f64; 2]> = stops.iter().map(|stop| stop.span).collect();
        self.stops.extend(stops);
        self.bins
            .extend(bins(robot, pipeline, trajectory, &stopped));
    }

    /// Leaves most of what was taken on a shelf.
    ///
    /// # Errors
    /// Those of [`Shelf::put`].
    pub fn put_away(&mut self, shelf: &Arc<dyn Shelf>) -> Result<()> {
        self.bins
            .iter_mut()
            .try_for_each(|bins| bins.put_away(shelf))
    }

    /// The incidents, in time order for each kind.
    #[must_use]
    pub fn incidents(self, robot: &Robot) -> Vec<Incident> {
        let mut found = self.stops;
        found.extend(contacts::contacts(robot, &self.bins));
        found
    }
}

/// A log as motion with its incidents left out, the incidents, and what was found on the way; of a log in chapters the motion of a few
/// of them.
///
/// # Errors
/// Those of [`align`], and of chapters that cannot be read.
pub fn motion(
    robot: &Robot,
    pipeline: &Pipeline,
    log: &Log<'_>,
) -> Result<(Trajectory, Vec<Incident>, Vec<Finding>)> {
    let mut findings = Vec::new();
    let mut evidence = Evidence::default();
    let mut trajectory = match log {
        Log::Whole(recording) => {
            let (trajectory, said) = align(robot, recording, pipeline)?;
            findings = said;
            evidence.take(robot, pipeline, &trajectory);
            trajectory
        }
        Log::Long(long) => {
            let mut few = FewChapters::new(long.chapters());
            long.visit(&mut findings, |number, chapter, said| {
                let prepared = prepare(robot, chapter, pipeline)?;
                let (trajectory, more) = prepared.align(pipeline, Raw::Spread)?;
                said.extend(more);
                evidence.take(robot, pipeline, &trajectory);
                if let Some(shelf) = long.shelf() {
                    evidence.put_away(shelf)?;
                }
                few.take(number, trajectory);
                Ok(())
            })?;
            few.into_trajectory()
                .ok_or_else(|| long.without_chapters())?
        }
    };
    let found = evidence.incidents(robot);
    leave_out(pipeline, &mut trajectory, &found);
    findings.extend(incident_findings(log.name(), &found));
    Ok((trajectory, found, findings))
}

/// Takes the incidents of a log out of the fit, for all joints: what hits a link acts on every joint before it.
pub fn leave_out(pipeline: &Pipeline, trajectory: &mut Trajectory, incidents: &[Incident]) {
    let spans = left_out(pipeline, incidents);
    for segment in &mut trajectory.segments {
        let len = segment.time.len();
        for [first, last] in &spans {
            let from = segment.time.partition_point(|t| t < first);
            let to = segment.time.partition_point(|t| t <= last);
            for joint in 0..trajectory.dof {
                segment.standstill[joint * len + from..joint * len + to.max(from)].fill(true);
            }
        }
    }
}

/// The times that incidents take out of the fit, s: no row that is left shares a sample with one.
pub fn left_out(pipeline: &Pipeline, incidents: &[Incident]) -> Vec<[f64; 2]> {
    let margin = pipeline.filter_half_length() + pipeline.motion_half_length();
    let span = |incident: &Incident| [incident.span[0] - margin, incident.span[1] + margin];
    incidents.iter().map(span).collect()
}

/// One warning per log and kind.
pub fn incident_findings(log: &str, incidents: &[Incident]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for kind in [IncidentKind::DrivesOff, IncidentKind::Contact] {
        let own: Vec<&Incident> = incidents.iter().filter(|i| i.kind == kind).collect();
        if own.is_empty() {
            continue;
        }
        let list: Vec<String> = own.iter().take(LISTED).map(|i| place(i)).collect();
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
            IncidentKind::Contact => (
                Code::Contact,
                format!(
                    "contact, collision or push, {times}: torque that no rigid body and no friction explains, {list}{more}. These samples are \
                     left out of the fit, for all joints. Look at what touched the robot; nothing has to be done if that is known"
                ),
            ),
            IncidentKind::DrivesOff => (
                Code::DrivesOff,
                format!(
                    "brakes or a protective stop, {times}: all joints are at rest without the torque that would hold them \
                     (joint and torque in brackets), {list}{more}. These samples are left out of the fit"
                ),
            ),
        };
        let samples = own.iter().map(|i| i.samples).sum();
        let numbers = [
            ("times", own.len() as f64),
            ("first_from", own[0].span[0]),
            ("first_to", own[0].span[1]),
            ("first_torque", own[0].torque),
        ];
        findings.push(Finding::new(Severity::Warning, code, log, message, samples).with(numbers));
    }
    findings
}

/// Begin, end, joint and torque of an incident.
fn place(incident: &Incident) -> String {
    let [first, last] = incident.span;
    let digits = if last - first < 0.1 { 3 } else { 2 };
    let (joint, torque) = (&incident.joint, significant(incident.torque, 3));
    format!("from {first:.digits$} s to {last:.digits$} s (`{joint}`, {torque} N·m)")
}

#[cfg(test)]
mod tests;
