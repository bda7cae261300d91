//! The road from logs to a calibration, gone once more where its fit says so: with gear ripple among the candidates, or in a wider band.

use super::ripples::Seen;
use super::wider_band::{Wider, not_wider};
use super::{Calibration, CalibrationSettings, Stage, road};
use crate::error::{Finding, Result};
use crate::robot::Robot;
use crate::signal::Logs;

/// Where a road leads.
pub(super) enum Road {
    /// To its end.
    End(Box<Calibration>),
    /// Back, with gear ripple among the candidates that was none of them.
    Again(Vec<Seen>),
    /// Back, in a wider band.
    Wider(Wider),
}

/// [`super::calibrate`]; `findings` holds what was found where it ends early. Where nobody chose families and the fit shows gear ripple, that
/// becomes a candidate, and all is done once more; so it is in a wider band where the noise allows that, and where that ends early
/// in the usual one after all.
pub(super) fn whole_road(
    robot: &Robot,
    recordings: (Logs<'_>, Logs<'_>),
    settings: &CalibrationSettings,
    progress: &dyn Fn(Stage),
    findings: &mut Vec<Finding>,
) -> Result<Calibration> {
    let (mut recordings, mut settings) = (Some(recordings), settings.clone());
    let (mut added, mut usual) = (Vec::new(), None);
    loop {
        findings.clone_from(&added);
        let end = road(robot, &mut recordings, &settings, progress, findings);
        if let (Err(error), Some(_)) = (&end, &recordings)
            && let Some(band) = usual.take()
        {
            (settings, added) = band;
            added.push(not_wider(error));
            continue;
        }
        match end? {
            Road::End(calibration) => return Ok(*calibration),
            Road::Again(ripples) => {
                added.extend(ripples.iter().map(Seen::added));
                let orders = ripples.into_iter().map(|seen| (seen.joint, seen.periods));
                settings.library.ripple.extend(orders);
                settings.signal.every_sample = true;
            }
            Road::Wider(wider) => {
                let wide = wider.settings(&settings);
                settings.may_widen = false;
                usual = Some((std::mem::replace(&mut settings, wide), added.clone()));
                added.push(wider.finding);
            }
        }
    }
}
