//! The road from logs to a calibration, gone once more where its fit says so: with gear ripple among the candidates, in a wider band, or
//! in a lower one where a coarse encoder leaves too few rows or drowns the torque of the model, and with fewer candidates where rows are too few
//! for all of them.

use super::lower_band::{Band, TooFew, clear, lower, lowered, most_rows};
use super::ripples::Seen;
use super::wider_band::{Wider, not_wider};
use super::{Calibration, CalibrationSettings, Watch, road, smaller_library};
use crate::error::{Error, Finding, Result};
use crate::robot::Robot;
use crate::signal::{Auto, Logs};
use std::collections::BTreeMap;

/// How far a road is to be gone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Goal {
    /// To its end, if the torque of the model is not drowned by a coarse encoder.
    End,
    /// To its end.
    Anyway,
    /// To where independent rows can be counted.
    Count,
}

/// Where a road leads.
pub(super) enum Road {
    /// To its end.
    End(Box<Calibration>),
    /// Back, with gear ripple among the candidates that was none of them.
    Again(Vec<Seen>),
    /// Back, with columns about these effects.
    Elsewhere(BTreeMap<String, f64>),
    /// Back, in a wider band.
    Wider(Wider),
    /// Nowhere in this band.
    TooFew(TooFew),
    /// Nowhere good in this band.
    Drowned(TooFew),
    /// To where it was asked for.
    Counted(Band),
}

/// [`super::calibrate`]; `findings` holds what was found where it ends early. Where nobody chose families and the fit shows gear ripple, that
/// becomes a candidate, and all is done once more; so it is in a wider band where the noise allows that, and where that ends early
/// in the usual one after all; and in a lower one where a coarse encoder leaves too few rows in the usual one or drowns the model's torque.
pub(super) fn whole_road(
    robot: &Robot,
    recordings: (Logs<'_>, Logs<'_>),
    settings: &CalibrationSettings,
    progress: &Watch<'_>,
    findings: &mut Vec<Finding>,
) -> Result<Calibration> {
    let (mut recordings, asked) = (Some(recordings), settings);
    let mut settings = asked.clone();
    let (mut added, mut usual, mut first) = (Vec::new(), None, None);
    let mut goal = Goal::End;
    loop {
        findings.clone_from(&added);
        let logs = &mut recordings;
        let few = match road(robot, logs, &settings, goal, progress, findings) {
            Ok(Road::End(calibration)) => return Ok(*calibration),
            Ok(Road::Again(ripples)) => {
                added.extend(ripples.iter().map(Seen::added));
                let orders = ripples.into_iter().map(|seen| (seen.joint, seen.periods));
                settings.library.ripple.extend(orders);
                settings.signal.every_sample = true;
                continue;
            }
            Ok(Road::Elsewhere(point)) => {
                settings.library.linearised_at = point;
                settings.relinearise -= 1;
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
            Ok(Road::Drowned(few)) => {
                // With what follows the road ends here or in the band that is found now.
                goal = Goal::Anyway;
                let logs = &mut recordings;
                let bands = lower_bands(robot, logs, &settings, lower(&few, findings, asked));
                if let Some(cutoff_hz) = clear(&bands) {
                    settings.signal.cutoff_hz = Auto::Value(cutoff_hz);
                    added.push(lowered(&few, cutoff_hz));
                }
                continue;
            }
            // Only a road with `Goal::Count` ends there.
            Ok(Road::Counted(_)) => unreachable!("the goal is the end"),
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(error) => TooFew::from(error),
        };
        if recordings.is_some()
            && let Some(smaller) = smaller_library::without_memory(&few.error, &settings)
        {
            settings = smaller.settings;
            // Effects that are no candidates any more are nothing to be linearised about.
            settings.library.linearised_at.clear();
            added.push(smaller.finding);
            continue;
        }
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
        let logs = &mut recordings;
        let bands = lower_bands(robot, logs, &settings, lower(&few, findings, asked));
        if let Some(cutoff_hz) = most_rows(&bands) {
            settings.signal.cutoff_hz = Auto::Value(cutoff_hz);
            added.push(lowered(&few, cutoff_hz));
        } else if let Some(smaller) = smaller_library::smaller(&few.error, &settings) {
            settings = smaller.settings;
            settings.library.linearised_at.clear();
            added.push(smaller.finding);
        } else {
            return Err(few.error);
        }
        goal = Goal::Anyway;
        first = Some((few.error, findings.clone()));
    }
}

/// Those of these cut-offs at which independent rows can be counted.
fn lower_bands(
    robot: &Robot,
    recordings: &mut Option<(Logs<'_>, Logs<'_>)>,
    settings: &CalibrationSettings,
    cutoffs: Vec<f64>,
) -> Vec<Band> {
    let mut settings = settings.clone();
    let mut bands = Vec::new();
    for cutoff_hz in cutoffs {
        settings.signal.cutoff_hz = Auto::Value(cutoff_hz);
        let goal = Goal::Count;
        let end = road(
            robot,
            recordings,
            &settings,
            goal,
            &|_| Ok(()),
            &mut Vec::new(),
        );
        if let Ok(Road::Counted(band)) = end {
            bands.push(band);
        }
    }
    bands
}
