//! Uniform, finite, filtered motion and torque of a log: what rows are made of.

use crate::signal::log::recording::Payload;

/// A run of samples on one clock without a cut: finite, time increasing. Arrays are `joint * len + sample`.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Time stamps, s; uniform to rounding unless the pipeline is off. Those of every d-th sample of a fine clock
    /// ([`Pipeline::motion_interval`](crate::signal::Pipeline::motion_interval)).
    pub time: Vec<f64>,
    /// Index of each sample's input row in the recording when the clock was uniform already; otherwise empty.
    pub input_rows: Vec<usize>,
    /// The samples as logged within the segment, when the clock was uneven or too fine; `None` when `time` are the stamps.
    pub logged: Option<LoggedSamples>,
    /// Filtered motion (f_q); as logged with the pipeline off.
    pub q: Vec<f64>,
    /// Velocity.
    pub qd: Vec<f64>,
    /// Acceleration.
    pub qdd: Vec<f64>,
    /// Torque as logged (resampled if needed), not filtered but for a coarser clock; empty if the log has none.
    pub tau: Vec<f64>,
    /// Per joint and sample: the joint stands still or its torque is saturated, so that the torque says nothing.
    pub standstill: Vec<bool>,
    /// History channels, `channel * len + sample`; empty where none is followed ([`Pipeline::history`](crate::signal::Pipeline::history)).
    pub history: Vec<f64>,
    /// Sampling interval, s.
    pub interval: f64,
    /// Sampling interval of the log, s.
    pub logged_interval: f64,
}

impl Segment {
    /// Some of its samples.
    pub(in crate::signal) fn cut(&self, dof: usize, range: std::ops::Range<usize>) -> Self {
        let len = self.time.len();
        fn part<T: Copy>(
            values: &[T],
            dof: usize,
            len: usize,
            range: &std::ops::Range<usize>,
        ) -> Vec<T> {
            if values.is_empty() {
                return Vec::new();
            }
            let joints = (0..dof).flat_map(|joint| &values[joint * len..][range.clone()]);
            joints.copied().collect()
        }
        let of = |values: &[f64]| part(values, dof, len, &range);
        let time = self.time[range.clone()].to_vec();
        let logged = self.logged.as_ref().map(|logged| {
            let (first, last) = (time[0], time[time.len() - 1]);
            let from = logged.time.partition_point(|t| *t < first);
            let own = from..logged.time.partition_point(|t| *t <= last).max(from);
            LoggedSamples {
                tau: part(&logged.tau, dof, logged.time.len(), &own),
                input_rows: logged.input_rows[own.clone()].to_vec(),
                time: logged.time[own].to_vec(),
            }
        });
        Self {
            input_rows: self
                .input_rows
                .get(range.clone())
                .unwrap_or_default()
                .to_vec(),
            logged,
            q: of(&self.q),
            qd: of(&self.qd),
            qdd: of(&self.qdd),
            tau: of(&self.tau),
            standstill: part(&self.standstill, dof, len, &range),
            history: part(&self.history, self.history.len() / len.max(1), len, &range),
            interval: self.interval,
            logged_interval: self.logged_interval,
            time,
        }
    }

    /// How many samples of the log one sample stands for.
    pub(crate) fn thinning(&self) -> usize {
        (self.interval / self.logged_interval).round().max(1.0) as usize
    }
}

/// Rows of a log that lie within a segment with a separate clock, untouched.
#[derive(Debug, Clone, PartialEq)]
pub struct LoggedSamples {
    /// Stamps, s.
    pub time: Vec<f64>,
    /// Rows of the recording, one per stamp.
    pub input_rows: Vec<usize>,
    /// `joint * len + sample`, N·m or N; empty if the log has no torque.
    pub tau: Vec<f64>,
}

/// One log, ready: segments of filtered motion and raw torque.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// Name of its log.
    pub name: String,
    /// Moving joints.
    pub dof: usize,
    /// In time order.
    pub segments: Vec<Segment>,
    /// What the robot carried: a known payload enters the nominal torque.
    pub payload: Payload,
    /// False where the payload component does not act: in logs without a payload beside logs with an unknown one.
    pub payload_acts: bool,
}

impl Trajectory {
    /// Torque of a joint as it was logged, of the sample nearest to a time in s, N·m or N. `None` between segments and of a log without torque.
    #[must_use]
    pub fn logged_torque(&self, joint: usize, time: f64) -> Option<f64> {
        let behind = self
            .segments
            .partition_point(|segment| segment.time.first().is_some_and(|first| *first <= time));
        let segment = &self.segments[behind.checked_sub(1)?];
        if segment.time.last().is_none_or(|last| *last < time) {
            return None;
        }
        let (times, torque) = match &segment.logged {
            Some(logged) => (&logged.time, &logged.tau),
            None => (&segment.time, &segment.tau),
        };
        let after = times.partition_point(|own| *own < time);
        let near = [
            after.saturating_sub(1),
            after.min(times.len().checked_sub(1)?),
        ];
        let nearest = match time - times[near[0]] <= times[near[1]] - time {
            true => near[0],
            false => near[1],
        };
        let value = torque.get(joint * times.len() + nearest).copied();
        value.filter(|torque| torque.is_finite())
    }

    /// The same between two times, s.
    pub(crate) fn between(&self, from: f64, to: f64) -> Self {
        let cut = |segment: &Segment| {
            let first = segment.time.partition_point(|t| *t < from);
            let end = segment.time.partition_point(|t| *t < to);
            (first < end).then(|| segment.cut(self.dof, first..end))
        };
        Self {
            name: self.name.clone(),
            segments: self.segments.iter().filter_map(cut).collect(),
            ..*self
        }
    }
}
