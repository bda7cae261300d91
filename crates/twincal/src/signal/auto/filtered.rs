//! The pipeline with the filter on: cut-offs, sources of derivatives and thresholds from the spectra of the training logs.

use super::cutoff::{
    JointSpectra, automatic, derived_from, motion_band, noisy_velocity, rms_acceleration, wider,
};
use super::encoder::{Encoder, velocity_resolution};
use super::settings::{Auto, SignalSettings, setting};
use super::survey::{Candidates, Survey};
use super::unexcited::{COULOMB_VELOCITY, unexcited};
use crate::error::{Code, Error, Finding, Result, Severity};
use crate::signal::clean::correct::DerivedFrom;
use crate::signal::filter::fir::{
    column_half_seconds, column_kernel, motion_half_seconds, noise_gain,
};
use crate::signal::filter::pipeline::{COLUMN_LIMIT, MOTION_LIMIT, Pipeline};
use crate::signal::filter::thin::{coarsest, factor};
use crate::signal::log::joints::JointFacts;
use crate::words::significant;
use rayon::prelude::*;

/// Kept rows that the longest segment must give at least.
const FEWEST_ROWS: f64 = 10.0;

/// Clocks of the training logs.
struct Clocks {
    /// Sampling interval of each log, s; of a log in chapters its usual one: a chapter that is slower is left out where it must be.
    intervals: Vec<f64>,
    /// Sampling rate of the slowest log, Hz.
    lowest_rate: f64,
    /// Longest stretch without a cut, s.
    longest: f64,
}

impl Clocks {
    /// `surveys`: those of logs in memory; `seen`: of all.
    fn of(surveys: &[Survey], seen: &[&Survey], candidates: &Candidates<'_>) -> Self {
        let of_long = candidates
            .long
            .iter()
            .map(|(_, chapters)| chapters.interval());
        let intervals: Vec<f64> = (surveys.iter().map(|survey| survey.interval))
            .chain(of_long)
            .collect();
        let rates = intervals.iter().map(|interval| 1.0 / interval);
        let lowest_rate = rates.fold(f64::INFINITY, f64::min);
        Self {
            intervals,
            lowest_rate,
            longest: seen.iter().map(|survey| survey.longest).fold(0.0, f64::max),
        }
    }
}

/// Spectra of the training logs with the noise of the encoders' steps.
struct Spectra {
    /// By log and joint.
    logs: Vec<Vec<JointSpectra>>,
    /// Steps of the encoders, by joint.
    steps: Vec<Option<f64>>,
}

impl Spectra {
    /// `None` where no log is long enough for a spectrum.
    fn of(joints: usize, seen: &[&Survey], candidates: &Candidates<'_>) -> Option<Self> {
        let all: Vec<&Vec<JointSpectra>> = seen.iter().filter_map(|s| s.spectra.as_ref()).collect();
        if all.is_empty() {
            return None;
        }
        let steps: Vec<Option<f64>> = (0..joints)
            .into_par_iter()
            .map(|joint| candidates.step(joint))
            .collect();
        let with_steps = |log: &&'_ Vec<JointSpectra>| -> Vec<JointSpectra> {
            let joints = log.iter().zip(&steps);
            joints.map(|(own, step)| own.quantised(*step)).collect()
        };
        let logs = all.iter().map(with_steps).collect();
        Some(Self { logs, steps })
    }

    /// One joint's in every log.
    fn of_joint(&self, joint: usize) -> Vec<&JointSpectra> {
        self.logs.iter().map(|log| &log[joint]).collect()
    }

    /// Those of joints that move, or of all where none does: a joint that only trembles must not choose the cut-off.
    fn of_moving_joints(&self) -> Vec<Vec<&JointSpectra>> {
        let joints = self.steps.len();
        let moving: Vec<Vec<&JointSpectra>> = (0..joints)
            .map(|joint| self.of_joint(joint))
            .filter(|logs| motion_band(logs).1 > COULOMB_VELOCITY)
            .collect();
        if moving.is_empty() {
            return (0..joints).map(|joint| self.of_joint(joint)).collect();
        }
        moving
    }
}

/// Pipeline on; and a wider cut-off, see [`super::choose::Chosen::wider_hz`].
pub(super) fn on(
    joints: &[JointFacts],
    first_log: &str,
    candidates: &Candidates<'_>,
    settings: &SignalSettings,
) -> Result<(Pipeline, Option<f64>, Vec<Finding>)> {
    let whole = candidates.whole.iter();
    let surveys: Vec<Survey> = whole
        .map(|(recording, prepared, _)| Survey::of(recording, prepared, true))
        .collect();
    let chapters = candidates.long.iter();
    let seen: Vec<&Survey> = surveys
        .iter()
        .chain(chapters.flat_map(|(_, chapters)| &chapters.surveys))
        .collect();
    let clocks = Clocks::of(&surveys, &seen, candidates);
    let spectra = Spectra::of(joints.len(), &seen, candidates)
        .ok_or_else(|| too_short_for_a_spectrum(first_log, clocks.longest))?;
    let moving = spectra.of_moving_joints();
    let (cutoff, wider_hz) = match settings.cutoff_hz {
        Auto::Value(value) => (value, None),
        Auto::Auto => {
            let cutoff = automatic(&moving, clocks.longest, clocks.lowest_rate);
            (cutoff, wider(&moving, cutoff, clocks.lowest_rate))
        }
    };
    let (rate, mut findings) = limits(first_log, cutoff, &clocks, settings)?;
    let motion_cutoff = motion_cutoff(cutoff, clocks.lowest_rate, &mut findings);
    let cutoffs = [cutoff, motion_cutoff];
    let (derived, velocity_from) = sources(joints, &spectra, cutoffs, settings, &mut findings);
    let coulomb_velocity = settings.coulomb_velocity.unwrap_or(COULOMB_VELOCITY);
    let mut pipeline = Pipeline {
        cutoff_hz: cutoff,
        motion_cutoff_hz: motion_cutoff,
        rate_hz: rate,
        motion_interval: 0.0,
        coulomb_velocity,
        standstill_velocity: Vec::new(),
        derived_from: derived,
        velocity_from,
        corrections: settings.corrections.clone(),
        history: Vec::new(),
    };
    if !settings.every_sample {
        thin_motion(&mut pipeline, &moving, &clocks);
    }
    pipeline.standstill_velocity =
        standstill_velocities(joints, (&seen, &spectra), &pipeline, &mut findings);
    let thresholds = &pipeline.standstill_velocity;
    let moving = candidates.move_by(joints, thresholds, cutoff, settings)?;
    let still: Vec<bool> = moving.iter().map(|moves| !moves).collect();
    findings.extend(unexcited(joints, &still, thresholds)?);
    findings.push(described(&pipeline, &clocks));
    Ok((pipeline, wider_hz, findings))
}

/// The error of logs without any stretch that is long enough for a spectrum.
fn too_short_for_a_spectrum(first_log: &str, longest: f64) -> Error {
    Error::Log {
        log: first_log.to_owned(),
        problem: format!(
            "the longest stretch without a cut is {longest:.3} s, too short for a spectrum"
        ),
        remedy: "record at least some seconds without gaps, or set [signal] cutoff_hz = 0".into(),
    }
}

/// Cut-off of the motion filter, Hz: four times that of the columns, as far as the slowest log allows.
fn motion_cutoff(cutoff: f64, lowest_rate: f64, findings: &mut Vec<Finding>) -> f64 {
    let motion_cutoff = (4.0 * cutoff).min(MOTION_LIMIT * lowest_rate);
    if motion_cutoff < 4.0 * cutoff {
        findings.push(Finding::new(
            Severity::Note,
            Code::MotionFilterCapped,
            "",
            format!(
                "the motion filter's cut-off is {motion_cutoff:.3} Hz instead of 4 x {cutoff} Hz: the slowest log has only {lowest_rate:.3} Hz"
            ),
            0,
        )
        .with([("cutoff", motion_cutoff), ("cutoff_wanted", 4.0 * cutoff), ("rate", lowest_rate)]));
    }
    motion_cutoff
}

/// What acceleration and what velocity are taken from, by joint; the latter is empty where it is the logged one throughout.
fn sources(
    joints: &[JointFacts],
    spectra: &Spectra,
    cutoffs: [f64; 2],
    settings: &SignalSettings,
    findings: &mut Vec<Finding>,
) -> (Vec<DerivedFrom>, Vec<DerivedFrom>) {
    let [cutoff, motion_cutoff] = cutoffs;
    let mut derived: Vec<DerivedFrom> = (0..joints.len())
        .map(|joint| derived_from(&spectra.of_joint(joint), cutoff))
        .collect();
    let mut velocity_from = vec![DerivedFrom::Velocity; joints.len()];
    let said = settings.corrections.velocity.is_some();
    for (joint, facts) in joints.iter().enumerate().filter(|_| !said) {
        if let Some(noise) = noisy_velocity(&spectra.of_joint(joint), motion_cutoff) {
            (velocity_from[joint], derived[joint]) = (DerivedFrom::Position, DerivedFrom::Position);
            findings.push(replaced_velocity(facts, noise));
        }
    }
    if !velocity_from.contains(&DerivedFrom::Position) {
        velocity_from.clear();
    }
    (derived, velocity_from)
}

/// Says that a joint's logged velocity is left out.
fn replaced_velocity(facts: &JointFacts, noise: [f64; 2]) -> Finding {
    let name = &facts.name;
    let [logged, travel] = noise.map(|noise| significant(noise, 2));
    let message = format!(
        "joint `{name}`: the logged velocity has a noise of {logged} per s (after the motion filter), the change of position {travel}: velocity is \
         taken from position; [signal] velocity = \"logged\" takes the log's"
    );
    Finding::new(Severity::Warning, Code::NoisyVelocity, name, message, 0).with([
        ("velocity_noise", noise[0]),
        ("velocity_noise_of_position", noise[1]),
    ])
}

/// Sets the coarsest clock at which motion may be held, where it thins any log.
fn thin_motion(pipeline: &mut Pipeline, moving: &[Vec<&JointSpectra>], clocks: &Clocks) {
    let acceleration = moving.iter().map(|logs| rms_acceleration(logs));
    let acceleration = acceleration.fold(0.0, f64::max);
    pipeline.motion_interval = coarsest(
        pipeline.motion_cutoff_hz,
        pipeline.coulomb_velocity,
        acceleration,
    );
    let mut intervals = clocks.intervals.iter();
    if intervals.all(|interval| factor(pipeline, *interval) == 1) {
        pipeline.motion_interval = 0.0;
    }
}

/// Speeds below which joints count as at rest, rad/s or m/s; says what noise the derivatives carry.
fn standstill_velocities(
    joints: &[JointFacts],
    logs: (&[&Survey], &Spectra),
    pipeline: &Pipeline,
    findings: &mut Vec<Finding>,
) -> Vec<f64> {
    let (seen, spectra) = logs;
    let resolved: Vec<(f64, Vec<Finding>)> = (joints.par_iter().enumerate())
        .map(|(joint, facts)| {
            let mut said = Vec::new();
            let logged = [0, 1].map(|channel| seen.iter().all(|s| s.logged[joint][channel]));
            let encoder = Encoder {
                facts,
                logged,
                step: spectra.steps[joint],
            };
            let own = spectra.of_joint(joint);
            let resolved = velocity_resolution(joint, &encoder, &own, pipeline, &mut said);
            (pipeline.coulomb_velocity.max(resolved), said)
        })
        .collect();
    let mut thresholds = Vec::with_capacity(joints.len());
    for (threshold, said) in resolved {
        findings.extend(said);
        thresholds.push(threshold);
    }
    thresholds
}

/// Says which filters the pipeline has and how many rows it keeps.
fn described(pipeline: &Pipeline, clocks: &Clocks) -> Finding {
    let (cutoff, motion_cutoff) = (pipeline.cutoff_hz, pipeline.motion_cutoff_hz);
    let intervals = clocks.intervals.iter();
    let kept = pipeline.common_rate(intervals.map(|interval| pipeline.kept_rate(*interval)));
    let taps = column_kernel(cutoff, 1.0 / clocks.lowest_rate);
    Finding::new(
        Severity::Note,
        Code::Pipeline,
        "",
        format!(
            "columns and torque: symmetric FIR at {cutoff} Hz, {:.3} s to either side, white-noise gain {:.3}; motion: FIR at {motion_cutoff:.3} Hz, {:.3} s; rows at {} Hz",
            column_half_seconds(cutoff),
            noise_gain(&taps),
            motion_half_seconds(motion_cutoff),
            (1e6 * kept).round() / 1e6
        ),
        0,
    )
    .with([
        ("cutoff", cutoff), ("half_length", column_half_seconds(cutoff)),
        ("noise_gain", noise_gain(&taps)), ("motion_cutoff", motion_cutoff),
        ("motion_half_length", motion_half_seconds(motion_cutoff)), ("rate", kept),
    ])
}

/// Rate of kept rows, after checking that the filters fit the logs.
fn limits(
    first_log: &str,
    cutoff: f64,
    clocks: &Clocks,
    settings: &SignalSettings,
) -> Result<(f64, Vec<Finding>)> {
    let (longest, lowest_rate) = (clocks.longest, clocks.lowest_rate);
    let mut findings = Vec::new();
    if cutoff > COLUMN_LIMIT * lowest_rate {
        return Err(setting(
            "signal.cutoff_hz",
            format!(
                "{cutoff} Hz is above {COLUMN_LIMIT} of the slowest log's rate of {lowest_rate:.3} Hz"
            ),
            &format!(
                "give at most {:.3}, \"auto\", or 0 for no filter",
                COLUMN_LIMIT * lowest_rate
            ),
        ));
    }
    let mut rate = match settings.rate_hz {
        Auto::Value(value) => value,
        Auto::Auto => 2.5 * cutoff,
    };
    if rate > lowest_rate * 1.001 {
        findings.push(Finding::new(
            Severity::Note,
            Code::RateCapped,
            "",
            format!("rows are kept at the slowest log's rate of {lowest_rate:.3} Hz instead of {rate} Hz"),
            0,
        )
        .with([("rate", lowest_rate), ("rate_wanted", rate)]));
        rate = lowest_rate;
    }
    if rate < 2.0 * cutoff {
        findings.push(Finding::new(
            Severity::Warning,
            Code::RowsAlias,
            "",
            format!("rows at {rate} Hz are below twice the cut-off of {cutoff} Hz: torque between them folds into the estimates as noise"),
            0,
        )
        .with([("rate", rate), ("cutoff", cutoff)]));
    }
    let needed = 2.0
        * (column_half_seconds(cutoff)
            + motion_half_seconds((4.0 * cutoff).min(MOTION_LIMIT * lowest_rate)))
        + FEWEST_ROWS / rate;
    if longest < needed {
        return Err(Error::Log {
            log: first_log.to_owned(),
            problem: format!(
                "the longest stretch without a cut is {longest:.3} s; filters at {cutoff} Hz need {needed:.3} s for {FEWEST_ROWS} rows"
            ),
            remedy: "record longer, fix the gaps, raise [signal] cutoff_hz, or set it to 0".into(),
        });
    }
    Ok((rate, findings))
}
