//! From a recording to uniform, finite, filtered motion and torque (method section 1).

mod agreement;
mod align;
mod chapters;
mod choose;
mod clock;
pub(crate) mod convolve;
pub(crate) mod decimate;
mod correct;
mod fourier;
mod held;
mod history;
mod jumps;
mod long;
mod cutoff;
mod describe;
mod encoder;
mod few_chapters;
pub(crate) mod fir;
pub(crate) mod interpolate;
mod mask;
mod prepare;
mod ready;
mod recording;
mod repeats;
mod saturation;
mod shelf;
mod sound;
mod spectrum;
pub(crate) mod spline;
mod standstill;
mod steps;
mod stretches;
mod survey;
mod thin;
mod ticks;
mod torque;
mod travel;
mod units;
mod unwrap;

pub use agreement::{Agreement, velocity_agreement};
pub use align::{PreparedLog, Raw};
pub use chapters::ChapterMotion;
pub use choose::Chosen;
pub(crate) use clock::median_step;
pub use correct::{Corrections, Lag};
pub(crate) use describe::less_driven;
pub use describe::{JointOverview, LogOverview, describe, hardly_driven};
pub(crate) use few_chapters::FewChapters;
pub use history::{JointHistory, Warmth};
pub(crate) use history::{
    STOPS, known_temperatures, later_channel, stop_channel, temperature_at, warmth_channel,
};
pub use long::{Log, Logs, LongLog, ReadChapter};
pub use ready::{LongReady, ReadyLog};
pub use recording::NextChannel;
pub use shelf::{Numbers, Shelf};
pub use steps::{Steps, steps};
pub(crate) use stretches::stretches;
pub use torque::{constant_torque, missing_torque};

use crate::error::{Error, Finding, Result};
use crate::robot::Robot;
use serde::{Deserialize, Serialize};

/// Rates that differ by less than this share are one: clocks are known no better.
const SAME_RATE: f64 = 1e-6;

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// A number, or "auto": chosen from the data and stated in the result.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Auto {
    /// Chosen from the data.
    Auto,
    /// As given.
    Value(f64),
}

/// `[signal]` and the parts of `[library]` and `[log]` that the pipeline needs.
#[derive(Debug, Clone, PartialEq)]
pub struct SignalSettings {
    /// Cut-off f_c of the torque-and-column filter, Hz. 0: no filter, decimation, resampling, trimming or mask.
    pub cutoff_hz: Auto,
    /// Rate of the kept rows, Hz; auto = 2.5 f_c.
    pub rate_hz: Auto,
    /// v_s of Coulomb friction and of the standstill mask, rad/s or m/s; `None`: 0 with cut-off 0, else 0.02, of which a calibration
    /// takes a quarter to four times for friction where training data clearly ask for it.
    pub coulomb_velocity: Option<f64>,
    /// What is put right in every log first.
    pub corrections: Corrections,
    /// Columns may change faster than the motion does (expressions of the user, gear ripple): evaluate them at every sample.
    pub every_sample: bool,
}

/// One joint's channels as logged, SI units, all of the recording's length.
#[derive(Debug, Clone, PartialEq)]
pub struct Channels {
    /// rad or m.
    pub q: Vec<f64>,
    /// rad/s or m/s, if logged.
    pub qd: Option<Vec<f64>>,
    /// rad/s² or m/s², if logged.
    pub qdd: Option<Vec<f64>>,
    /// N·m or N; absent for a log that is only to be predicted.
    pub tau: Option<Vec<f64>>,
    /// Temperature of the drive, °C or K, if logged; NaN where it is not known. It explains drift and nothing else.
    pub temperature: Option<Vec<f64>>,
}

/// What a robot carried in a log, beyond its model.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Payload {
    /// Nothing that the model does not have.
    #[default]
    None,
    /// A point mass (a body whose own tensor is left out) at a known place.
    Known {
        /// kg.
        mass: f64,
        /// Centre of mass in the payload frame, m.
        com: [f64; 3],
    },
    /// Something: mass and centre of mass are to be found in these logs.
    Unknown,
}

/// A log as read: joints already matched to the robot's q1…qn, values untouched (NaN included).
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Whether angles are unfolded already, or known not to be folded, by what the whole log shows: they are left as they are then.
    pub unfolded: bool,
    /// Name as given by the user.
    pub name: String,
    /// Time stamps, s from [`Recording::start_ns`] on.
    pub time: Vec<f64>,
    /// Where time counts from, ns: 0 for a log whose stamps are in `time` as they are, of a bag the first stamp (ns since 1970), which
    /// a double would round to 0.2 µs.
    pub start_ns: i64,
    /// One entry per moving joint of the robot, in order.
    pub joints: Vec<Channels>,
    /// What the robot carried.
    pub payload: Payload,
}

impl Recording {
    /// A log can be predicted without torque, not fitted and not scored. `names`: moving joints in order.
    ///
    /// # Errors
    /// [`Error::Log`] naming the first joint without.
    pub fn require_torque(&self, names: &[&str]) -> Result<()> {
        let without = |(channels, _): &(&Channels, &&str)| channels.tau.is_none();
        match self.joints.iter().zip(names).find(without) {
            Some((_, name)) => Err(Error::Log {
                log: self.name.clone(),
                problem: format!("has no torque of joint `{name}`"),
                remedy: "measured torque is needed here; name its column in [columns] tau, and say torque = \"current\" in [[log]] if it is a current".into(),
            }),
            None => Ok(()),
        }
    }
}

/// What a velocity that is noisy, or an acceleration that is not logged, is derived from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DerivedFrom {
    /// Position.
    Position,
    /// Logged velocity.
    Velocity,
}

/// The pipeline with every "auto" replaced by its number; the same for all logs of a fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pipeline {
    /// f_c, Hz; 0 = off.
    pub cutoff_hz: f64,
    /// f_q = 4 f_c of the motion filter, Hz.
    pub motion_cutoff_hz: f64,
    /// Rate of kept rows as asked for, Hz; see [`Pipeline::kept_rate`] for that of a log.
    pub rate_hz: f64,
    /// Longest sampling interval at which motion is held and columns are evaluated, s: a finer clock is thinned behind a filter
    /// of its own (`signal/thin.rs`). 0: every sample of the log.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub motion_interval: f64,
    /// v_s, rad/s or m/s.
    pub coulomb_velocity: f64,
    /// Standstill threshold per joint: max(v_s as stated or 0.02, what the encoder resolves), rad/s or m/s. A joint that is slower for long
    /// counts as at rest, as one whose position is constant.
    pub standstill_velocity: Vec<f64>,
    /// What q̈ is derived from where it is not logged, per joint: the channel that leaves less noise.
    pub derived_from: Vec<DerivedFrom>,
    /// Where velocity comes from per joint: from position where the logged one has by far more noise; empty as logged.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub velocity_from: Vec<DerivedFrom>,
    /// What is put right in every log first.
    #[serde(default, skip_serializing_if = "Corrections::is_default")]
    pub corrections: Corrections,
    /// What is followed of each joint's history; empty: nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub history: Vec<JointHistory>,
}

/// A run of samples on one clock without a cut: finite, time increasing. Arrays are `joint * len + sample`.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Time stamps, s; uniform to rounding unless the pipeline is off. Those of every d-th sample of a fine clock
    /// ([`Pipeline::motion_interval`]).
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
    /// History channels, `channel * len + sample`; empty where none is followed ([`Pipeline::history`]).
    pub history: Vec<f64>,
    /// Sampling interval, s.
    pub interval: f64,
    /// Sampling interval of the log, s.
    pub logged_interval: f64,
}

impl Segment {
    /// Some of its samples.
    fn cut(&self, dof: usize, range: std::ops::Range<usize>) -> Self {
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

/// Rows of a log that lie within a segment with a clock of its own, untouched.
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

impl Pipeline {
    /// How long the position of a joint has to be constant for a rest, s.
    #[must_use]
    pub fn shortest_rest(&self) -> f64 {
        standstill::SHORTEST
    }

    /// How long a joint has to be slow to count as at rest though its position changes, s: three periods of the cut-off, so that the filter
    /// has forgotten what was before; infinite without a filter.
    #[must_use]
    pub fn shortest_standstill(&self) -> f64 {
        align::STANDSTILL_PERIODS / self.cutoff_hz
    }

    /// The pipeline that changes nothing: every input row is one row.
    pub fn off(dof: usize) -> Self {
        Self {
            cutoff_hz: 0.0,
            motion_cutoff_hz: 0.0,
            rate_hz: 0.0,
            motion_interval: 0.0,
            coulomb_velocity: 0.0,
            standstill_velocity: vec![0.0; dof],
            derived_from: vec![DerivedFrom::Position; dof],
            velocity_from: Vec::new(),
            corrections: Corrections::default(),
            history: Vec::new(),
        }
    }

    /// True with cut-off 0.
    pub fn is_off(&self) -> bool {
        self.cutoff_hz == 0.0
    }

    /// Where velocity and an acceleration that is not logged come from, of one joint.
    pub(crate) fn sources(&self, joint: usize) -> [DerivedFrom; 2] {
        let velocity = self.velocity_from.get(joint);
        [
            velocity.copied().unwrap_or(DerivedFrom::Velocity),
            self.derived_from[joint],
        ]
    }

    /// Samples between kept rows of a log with this interval, s.
    pub(crate) fn step(&self, interval: f64) -> usize {
        if self.is_off() {
            1
        } else {
            (1.0 / (interval * self.rate_hz)).round().max(1.0) as usize
        }
    }

    /// Rate of the kept rows of a log with this interval (s), Hz: they stand whole samples apart, so that it is only near
    /// `rate_hz`.
    pub fn kept_rate(&self, interval: f64) -> f64 {
        1.0 / (interval * self.step(interval) as f64)
    }

    /// The one rate of the kept rows of several logs, from that of each; `rate_hz` where they differ.
    pub fn common_rate(&self, kept: impl IntoIterator<Item = f64>) -> f64 {
        let alike = |a: f64, b: f64| (a - b).abs() <= SAME_RATE * b;
        let kept: Vec<f64> = kept.into_iter().collect();
        match kept.first() {
            Some(&first) if kept.iter().all(|rate| alike(*rate, first)) => {
                if alike(first, self.rate_hz) {
                    self.rate_hz
                } else {
                    first
                }
            }
            _ => self.rate_hz,
        }
    }

    /// Half length of the column filter F, s; 0 when off. A row at t uses torque and columns from t − half to t + half.
    pub fn filter_half_length(&self) -> f64 {
        if self.is_off() {
            0.0
        } else {
            fir::column_half_seconds(self.cutoff_hz)
        }
    }

    /// Half length of the motion filter with what thins a fine clock before it, s; 0 when off.
    pub fn motion_half_length(&self) -> f64 {
        if self.is_off() {
            return 0.0;
        }
        let thinning = if self.motion_interval > 0.0 {
            fir::thinning_half_seconds(self.motion_cutoff_hz, self.motion_interval)
        } else {
            0.0
        };
        fir::motion_half_seconds(self.motion_cutoff_hz) + thinning
    }

    /// Whole length of what one row sees, s: two rows further apart share no sample. 0 when off.
    pub fn kernel_length(&self) -> f64 {
        2.0 * (self.filter_half_length() + self.motion_half_length())
    }

    /// sd of white torque noise of sd 1 after F, for a log at `rate_hz`; 1 when off.
    pub fn noise_gain(&self, rate_hz: f64) -> f64 {
        if self.is_off() {
            1.0
        } else {
            fir::noise_gain(&fir::column_kernel(self.cutoff_hz, 1.0 / rate_hz))
        }
    }
}

/// Chooses cut-off, rates and thresholds from the training recordings; the same pipeline then serves every log.
///
/// | value | rule for "auto" |
/// |---|---|
/// | `cutoff_hz` | max(5 Hz, 2 f_m), f_m the frequency below which 99 % of the velocity's power lies; lower where encoder noise in q̈ asks for it (`signal/cutoff.rs` states the whole rule) |
/// | `motion_cutoff_hz` | 4 f_c, at most 0.45 of the slowest log's rate |
/// | `rate_hz` | 2.5 f_c |
/// | `standstill_velocity` | the largest of v_s, three standard deviations of the noise in the derivative of position after the motion filter, and 4 f_q encoder steps (two steps at once look that fast) |
///
/// # Errors
/// [`crate::Error::Setting`] for numbers out of range or a cut-off above 0.4 of a log's rate; [`crate::Error::Log`] for logs that
/// are too short or have a broken clock, and with cut-off 0 for logs without q̇ or q̈; [`crate::Error::Refused`] if every joint stands still.
pub fn choose_pipeline(
    robot: &Robot,
    logs: &[Recording],
    settings: &SignalSettings,
) -> Result<(Pipeline, Vec<Finding>)> {
    let logs = Logs::from(logs);
    let chosen = choose_and_prepare(robot, &logs.0, settings)?;
    Ok((chosen.pipeline, chosen.findings))
}

/// [`choose_pipeline`] and [`ready`] in one: logs in memory are cut and unfolded once.
///
/// # Errors
/// Those of both.
pub fn choose_and_prepare<'a>(
    robot: &Robot,
    logs: &'a [Log<'_>],
    settings: &SignalSettings,
) -> Result<Chosen<'a>> {
    choose::choose(&prepare::joint_facts(robot), logs, settings)
}

/// One recording through steps 1 and 2 of method section 1: cut, unfold, resample, smooth, differentiate, mask.
///
/// Rows that are NaN or infinite are dropped and cut the log; so do steps back and gaps of more than five median steps.
/// Uneven clocks are resampled at the median step by a cubic spline. With the pipeline off all rows stay as they are
/// (rows that are not finite excepted).
///
/// # Errors
/// [`crate::Error::Log`] if nothing usable is left or the clock is broken; the message says what to do.
pub fn align(
    robot: &Robot,
    log: &Recording,
    pipeline: &Pipeline,
) -> Result<(Trajectory, Vec<Finding>)> {
    prepare(robot, log, pipeline)?.align(pipeline, Raw::All)
}

/// [`align`] of a part of a log that starts at `start`, s.
///
/// # Errors
/// As [`align`].
pub(crate) fn align_part(
    robot: &Robot,
    part: &Recording,
    start: Option<f64>,
    pipeline: &Pipeline,
) -> Result<(Trajectory, Vec<Finding>)> {
    prepare(robot, part, pipeline)?
        .since(start)
        .align(pipeline, Raw::All)
}

/// Step 1 alone, for [`PreparedLog::align`] at several cut-offs up to 1.4 times that of `pipeline`.
///
/// # Errors
/// As [`align`].
pub fn prepare<'a>(
    robot: &Robot,
    log: &'a Recording,
    pipeline: &Pipeline,
) -> Result<PreparedLog<'a>> {
    PreparedLog::new(prepare::joint_facts(robot), log, pipeline)
}

/// [`prepare`] of a log that may be in chapters.
///
/// # Errors
/// As [`align`], and of chapters that cannot be read.
pub fn ready<'a>(robot: &Robot, log: &'a Log<'_>, pipeline: &Pipeline) -> Result<ReadyLog<'a>> {
    ReadyLog::new(&prepare::joint_facts(robot), log, pipeline)
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod worlds;
