//! The road from logs to a calibration, gone once more where its fit says so: with gear ripple among the candidates, in a wider band, or
//! in a lower one where a coarse encoder leaves too few rows.

use super::lower_band::{TooFew, lower, lowered};
use super::ripples::Seen;
use super::wider_band::{Wider, not_wider};
use super::{Calibration, CalibrationSettings, Stage, road};
use crate::error::{Finding, Result};
use crate::robot::Robot;
use crate::signal::{Auto, Logs};

/// How far a road is to be gone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Goal {
    /// To its end.
    End,
    /// To where independent rows can be counted.
    Count,
}

/// Where a road leads.
pub(super) enum Road {
    /// To its end.
    End(Box<Calibration>),
    /// Back, with gear ripple among the candidates that was none of them.
    Again(Vec<Seen>),
    /// Back, in a wider band.
    Wider(Wider),
    /// Nowhere in this band.
    TooFew(TooFew),
    /// To where it was asked for: the independent rows of the joint that has most.
    Counted(f64),
}

/// [`super::calibrate`]; `findings` holds what was found where it ends early. Where nobody chose families and the fit shows gear ripple, that
/// becomes a candidate, and all is done once more; so it is in a wider band where the noise allows that, and where that ends early
/// in the usual one after all; and in a lower one where a coarse encoder leaves too few rows in the usual one.
pub(super) fn whole_road(
    robot: &Robot,
    recordings: (Logs<'_>, Logs<'_>),
    settings: &CalibrationSettings,
    progress: &dyn Fn(Stage),
    findings: &mut Vec<Finding>,
) -> Result<Calibration> {
    let (mut recordings, asked) = (Some(recordings), settings);
    let mut settings = asked.clone();
    let (mut added, mut usual, mut first) = (Vec::new(), None, None);
    loop {
        findings.clone_from(&added);
        let logs = &mut recordings;
        let few = match road(robot, logs, &settings, Goal::End, progress, findings) {
            Ok(Road::End(calibration)) => return Ok(*calibration),
            Ok(Road::Again(ripples)) => {
                added.extend(ripples.iter().map(Seen::added));
                let orders = ripples.into_iter().map(|seen| (seen.joint, seen.periods));
                settings.library.ripple.extend(orders);
                settings.signal.every_sample = true;
                continue;
            }
            Ok(Road::Wider(wider)) => {
                let wide = wider.settings(&settings);
                settings.may_widen = false;
                usual = Some((std::mem::replace(&mut settings, wide), added.clone()));
                added.push(wider.finding);
                continue;
            }
            Ok(Road::TooFew(few)) => few,
            // Only a road with `Goal::Count` ends there.
            Ok(Road::Counted(_)) => unreachable!("the goal is the end"),
            Err(error) => TooFew::from(error),
        };
        if let Some((error, found)) = first.take() {
            *findings = found;
            return Err(error);
        }
        if recordings.is_none() {
            return Err(few.error);
        }
        if let Some(band) = usual.take() {
            (settings, added) = band;
            added.push(not_wider(&few.error));
            continue;
        }
        let mut best = None;
        for cutoff_hz in lower(&few, findings, asked) {
            settings.signal.cutoff_hz = Auto::Value(cutoff_hz);
            let (logs, goal) = (&mut recordings, Goal::Count);
            let end = road(robot, logs, &settings, goal, &|_| (), &mut Vec::new());
            if let Ok(Road::Counted(rows)) = end
                && best.is_none_or(|(_, most)| rows > most)
            {
                best = Some((cutoff_hz, rows));
            }
        }
        let Some((cutoff_hz, _)) = best else {
            return Err(few.error);
        };
        settings.signal.cutoff_hz = Auto::Value(cutoff_hz);
        added.push(lowered(&few, cutoff_hz));
        first = Some((few.error, findings.clone()));
    }
}
