//! What is known of logs before the pipeline is: of those in memory all of it, of the chapters of others what each of them said.

use super::cutoff::{JointSpectra, spectra};
use super::settings::SignalSettings;
use crate::error::{Finding, Result};
use crate::signal::clean::pieces::{Piece, Prepared};
use crate::signal::clean::prepare::prepare;
use crate::signal::clean::steps::{changes, common_step, quantum};
use crate::signal::log::joints::JointFacts;
use crate::signal::log::long::LongLog;
use crate::signal::log::recording::{Channels, Recording};
use rayon::prelude::*;

/// Chapters of a long log whose spectra are looked at, evenly spread.
const SPECTRA: usize = 8;

/// What choosing has to know of a recording.
pub(super) struct Survey {
    /// Median step, s.
    pub(super) interval: f64,
    /// Longest stretch without a cut, s.
    pub(super) longest: f64,
    /// `None` where it is too short for one.
    pub(super) spectra: Option<Vec<JointSpectra>>,
    /// Whether velocity and acceleration are logged, by joint.
    pub(super) logged: Vec<[bool; 2]>,
}

impl Survey {
    pub(super) fn of(recording: &Recording, prepared: &Prepared<'_>, with_spectra: bool) -> Self {
        let seconds = |piece: &Piece<'_>| piece.time.len() as f64 * piece.interval;
        let joints = recording.joints.iter();
        Self {
            interval: prepared.interval,
            longest: prepared.pieces.iter().map(seconds).fold(0.0, f64::max),
            spectra: with_spectra.then(|| spectra(prepared)).flatten(),
            logged: (joints.map(|joint| [joint.qd.is_some(), joint.qdd.is_some()])).collect(),
        }
    }
}

/// Logs before the pipeline is known.
pub(super) struct Candidates<'a> {
    /// Those in memory, cut and unfolded.
    pub(super) whole: Vec<(&'a Recording, Prepared<'a>, Vec<Finding>)>,
    pub(super) long: Vec<(&'a LongLog, Chapters)>,
}

/// What is known of the chapters of a log.
pub(super) struct Chapters {
    pub(super) surveys: Vec<Survey>,
    /// Steps of the encoders, by joint and chapter.
    pub(super) steps: Vec<Vec<Option<f64>>>,
}

impl Chapters {
    pub(super) fn read(
        joints: &[JointFacts],
        long: &LongLog,
        settings: &SignalSettings,
    ) -> Result<Self> {
        let (mut surveys, mut steps) = (Vec::new(), vec![Vec::new(); joints.len()]);
        let mut looked_at = [false; SPECTRA];
        let chapters = long.chapters();
        long.visit(&mut Vec::new(), |number, chapter, said| {
            let prepared = prepare(joints, chapter, false, &settings.corrections, said)?;
            let looked_at = &mut looked_at[number * SPECTRA / chapters];
            let survey = Survey::of(chapter, &prepared, chapters <= SPECTRA || !*looked_at);
            *looked_at |= survey.spectra.is_some();
            surveys.push(survey);
            let step = |channels: &Channels| quantum(std::iter::once(channels.q.as_slice()));
            let of_chapter: Vec<Option<f64>> = chapter.joints.par_iter().map(step).collect();
            let all = steps.iter_mut().zip(of_chapter).zip(&chapter.joints);
            for ((steps, step), channels) in all {
                // A joint at rest says nothing of its encoder.
                if changes(&channels.q) {
                    steps.push(step);
                }
            }
            Ok(())
        })?;
        // Those that were looked at speak for all.
        let of_all = surveys.len() as f64;
        let mut known: Vec<_> = surveys
            .iter_mut()
            .filter_map(|s| s.spectra.as_mut())
            .collect();
        let factor = of_all / known.len().max(1) as f64;
        for joint in known.iter_mut().flat_map(|joints| joints.iter_mut()) {
            joint.duration *= factor;
        }
        Ok(Self { surveys, steps })
    }

    /// Median step, s.
    pub(super) fn interval(&self) -> f64 {
        let mut all: Vec<f64> = self.surveys.iter().map(|survey| survey.interval).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    }

    /// The step of a joint's encoder, if at least every second chapter has one.
    pub(super) fn step(&self, joint: usize) -> Option<f64> {
        common_step(&self.steps[joint])
    }
}

impl Candidates<'_> {
    /// The step of a joint's encoder: of the logs in memory together, and of each log in chapters.
    pub(super) fn step(&self, joint: usize) -> Option<f64> {
        let whole = self
            .whole
            .iter()
            .map(|whole| whole.0.joints[joint].q.as_slice());
        let long = self
            .long
            .iter()
            .filter_map(|(_, chapters)| chapters.step(joint));
        quantum(whole)
            .into_iter()
            .chain(long)
            .min_by(f64::total_cmp)
    }

    /// By joint: displaced anywhere by more than its threshold, rad/s or m/s, times half a period of the cut-off in that time.
    pub(super) fn move_by(
        &self,
        joints: &[JointFacts],
        thresholds: &[f64],
        cutoff: f64,
        settings: &SignalSettings,
    ) -> Result<Vec<bool>> {
        let see = |moving: &mut Vec<bool>, prepared: &Prepared<'_>| {
            (moving.par_iter_mut().zip(thresholds).enumerate())
                .filter(|(_, (moving, _))| !**moving)
                .for_each(|(joint, (moving, threshold))| {
                    *moving = moves(joint, prepared, *threshold, cutoff);
                });
        };
        let mut moving = vec![false; joints.len()];
        for (_, prepared, _) in &self.whole {
            see(&mut moving, prepared);
        }
        for (long, _) in &self.long {
            // Nearly always the first chapter says it all.
            for chapter in 0..long.chapters() {
                if moving.iter().all(|moves| *moves) {
                    break;
                }
                let recording = long.chapter(chapter)?;
                let corrections = &settings.corrections;
                if let Ok(prepared) =
                    prepare(joints, &recording, false, corrections, &mut Vec::new())
                {
                    see(&mut moving, &prepared);
                }
            }
        }
        Ok(moving)
    }
}

/// Whether a joint is anywhere displaced by more than `threshold` times half a period of the cut-off in that time.
fn moves(joint: usize, prepared: &Prepared<'_>, threshold: f64, cutoff: f64) -> bool {
    prepared.pieces.iter().any(|piece| {
        let lag = ((0.5 / cutoff / piece.interval).round() as usize).max(1);
        let least = threshold * lag as f64 * piece.interval;
        let q = &piece.joints[joint].q;
        q.iter()
            .zip(q.iter().skip(lag))
            .any(|(a, b)| (b - a).abs() > least)
    })
}
