//! What became of one log, as `result.json` says it.

use crate::incidents::Incident;
use crate::observations::{JointObservations, Observations};
use crate::signal::{Pipeline, Recording, Trajectory, median_step};
use serde::{Deserialize, Serialize};

/// What became of one log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LogSummary {
    /// Name as given.
    pub name: String,
    /// `fit` or `heldout`.
    pub role: String,
    /// Samples read.
    pub samples: u64,
    /// Duration, s.
    pub duration: f64,
    /// Median rate, Hz.
    pub rate_hz: f64,
    /// Rate of the kept rows, Hz: a whole fraction of the log's own; 0 in results that do not say it yet.
    #[serde(default)]
    pub kept_rate_hz: f64,
    /// Segments after cutting.
    pub segments: u64,
    /// Rows used per joint (standstill and saturated torque excluded).
    pub rows: Vec<u64>,
    /// Rows masked per joint: standstill and saturated torque.
    pub standstill: Vec<u64>,
    /// Contacts and protective stops, which are left out for all joints.
    #[serde(default)]
    pub incidents: Vec<Incident>,
}

impl LogSummary {
    /// Of chapters, which last `duration` s together.
    pub(in crate::calibrate) fn joined(chapters: Vec<Self>, duration: f64) -> Option<Self> {
        let mut rates: Vec<f64> = chapters.iter().map(|chapter| chapter.rate_hz).collect();
        rates.sort_by(f64::total_cmp);
        let longest = chapters.iter().max_by_key(|chapter| chapter.samples)?;
        let kept_rate_hz = longest.kept_rate_hz;
        let mut chapters = chapters.into_iter();
        let mut all = chapters.next()?;
        for chapter in chapters {
            all.segments += chapter.segments;
        }
        Some(Self {
            duration,
            rate_hz: rates[rates.len() / 2],
            kept_rate_hz,
            ..all
        })
    }

    /// Counts the rows of each joint, moving and not.
    pub(in crate::calibrate) fn count_rows(&mut self, observations: &Observations) {
        let still = |joint: &JointObservations| {
            let still = joint.standstill.iter().filter(|still| **still);
            still.count() as u64
        };
        self.standstill = observations.joints.iter().map(still).collect();
        let moving = |still: &u64| observations.len() as u64 - still;
        self.rows = self.standstill.iter().map(moving).collect();
    }

    /// Of one recording, before its rows are counted.
    pub(in crate::calibrate) fn of(
        recording: &Recording,
        role: &str,
        pipeline: &Pipeline,
        trajectory: &Trajectory,
    ) -> Self {
        let median = median_step(&recording.time).unwrap_or(f64::INFINITY);
        let ends = (
            recording.time.first().copied().unwrap_or(0.0),
            recording.time.last().copied().unwrap_or(0.0),
        );
        let longest = trajectory.segments.iter().max_by_key(|s| s.time.len());
        Self {
            name: recording.name.clone(),
            role: role.into(),
            samples: recording.time.len() as u64,
            duration: ends.1 - ends.0,
            rate_hz: 1.0 / median,
            kept_rate_hz: longest.map_or(0.0, |segment| pipeline.kept_rate(segment.interval)),
            segments: trajectory.segments.len() as u64,
            rows: Vec::new(),
            standstill: Vec::new(),
            incidents: Vec::new(),
        }
    }
}
