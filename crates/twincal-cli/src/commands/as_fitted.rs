//! New logs of a twin, read as those of its fit were.

use super::inputs::Long;
use std::path::{Path, PathBuf};
use twincal::robot::Robot;
use twincal::signal::Log;
use twincal::words::significant;
use twincal::{Code, Finding, Severity};
use twincal_io::Error;
use twincal_io::config::{FactorTable, LogSettings, key};
use twincal_io::log::{LogOptions, read_header};
use twincal_io::twin_json::StoredTwin;

/// Motion this many times smaller or larger than that of the fit is not the same motion in the same unit.
const OTHER_UNIT: f64 = 20.0;

/// How the logs of a twin's fit were read, and what of that holds for new ones.
pub(super) struct AsFitted<'a> {
    stored: &'a StoredTwin,
    settings: LogSettings,
    /// Factors that hold because the fit had them.
    kept: FactorTable,
}

impl<'a> AsFitted<'a> {
    /// With what has to be said of all logs.
    pub(super) fn new(
        stored: &'a StoredTwin,
        mut settings: LogSettings,
        paths: &[PathBuf],
    ) -> (Self, Vec<Finding>) {
        let mut findings = Vec::new();
        let mut kept = FactorTable::default();
        if let Some(read_as) = &stored.read_as {
            let joints = stored.calibration.twin.robot.joint_names();
            let own = &mut settings.columns.factor;
            if let Some((factor, finding)) = read_as.fill_in_factors(own, &joints) {
                kept = factor;
                findings.push(finding);
            }
            findings.extend(read_as.fill_in(&mut settings, paths));
        }
        let all = Self {
            stored,
            settings,
            kept,
        };
        (all, findings)
    }

    /// Reads one log, and looks whether factors of the fit can be its own.
    pub(super) fn read(
        &self,
        path: &Path,
        long: Long,
    ) -> Result<(Log<'static>, Vec<Finding>), Error> {
        let robot = &self.stored.calibration.twin.robot;
        let (log, mut findings) = self.first_that_can_be_read(path, robot, long)?;
        findings.extend(self.doubts(&log)?);
        Ok((log, findings))
    }

    fn first_that_can_be_read(
        &self,
        path: &Path,
        robot: &Robot,
        long: Long,
    ) -> Result<(Log<'static>, Vec<Finding>), Error> {
        let options: LogOptions = self.settings.options(path);
        let Some(read_as) = &self.stored.read_as else {
            return long.read(path, robot, &options);
        };
        // What is wrong with a file or its header is said when the log is read.
        let header = read_header(path).ok().flatten();
        let attempts = read_as.attempts(&options, header.as_deref(), &robot.joint_names());
        let (mut refusal, mut kept_names) = (None, false);
        for attempt in attempts {
            match long.read(path, robot, &attempt.options) {
                Ok((log, mut findings)) => {
                    let said = attempt.findings(&path.display().to_string());
                    findings.splice(0..0, said);
                    return Ok((log, findings));
                }
                // Where no attempt reads it, the error is about the columns of the fit.
                Err(error @ Error::Content { .. }) => {
                    if refusal.is_none() || attempt.given_up.is_empty() {
                        kept_names = !attempt.kept.is_empty();
                        refusal = Some(error);
                    }
                }
                Err(error) => return Err(error),
            }
        }
        match refusal {
            Some(Error::Content {
                place,
                problem,
                remedy,
            }) => {
                let mut remedy = remedy;
                if kept_names {
                    remedy +=
                        "; [columns] is that of the fit's logs: say this log's own in a --config";
                }
                if let Some(hint) = read_as.hint() {
                    remedy = format!("{remedy}; {hint}");
                }
                Err(Error::content(place, problem, remedy))
            }
            // There is always one attempt, which was read or refused.
            _ => long.read(path, robot, &options),
        }
    }

    /// Joints whose positions move in another order of magnitude than in the fit, and would not without the fit's factor.
    fn doubts(&self, log: &Log<'_>) -> Result<Vec<Finding>, Error> {
        let twin = &self.stored.calibration.twin;
        let mut doubts = Vec::new();
        let joints = twin.robot.joint_names().into_iter().enumerate();
        for ((number, joint), hull) in joints.zip(&twin.hull) {
            let Some(factor) = self.kept.q.of_joint(joint) else {
                continue;
            };
            let (range, fitted) = (range(log, number)?, hull[1] - hull[0]);
            let ratio = range / fitted;
            let alike = |ratio: f64| (1.0 / OTHER_UNIT..=OTHER_UNIT).contains(&ratio);
            // A joint that stands still says nothing of units.
            if alike(ratio) || !alike(ratio / factor.abs()) {
                continue;
            }
            let message = format!(
                "with the factor {factor} of the fit joint `{joint}` moves over {} rad (m), {} of the {} that it moved \
                 over in the fit; without it, {} of that. Where this log is in radians (m) already, say [columns.factor] q = {{ {} = 1.0 }}, \
                 and likewise qd and qdd, in a --config",
                significant(range, 3),
                significant(ratio, 2),
                significant(fitted, 3),
                significant(ratio / factor.abs(), 2),
                key(joint)
            );
            doubts.push(
                Finding::new(
                    Severity::Warning,
                    Code::FactorInDoubt,
                    log.name(),
                    message,
                    log.samples(),
                )
                .of_joint(joint)
                .with([
                    ("factor", factor),
                    ("range", range),
                    ("range_in_fit", fitted),
                ]),
            );
        }
        Ok(doubts)
    }
}

/// From where to where a joint moves.
fn range(log: &Log<'_>, joint: usize) -> Result<f64, Error> {
    let of = |q: &[f64]| {
        let finite = q.iter().copied().filter(|q| q.is_finite());
        finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], q| {
            [low.min(q), high.max(q)]
        })
    };
    let [low, high] = match log {
        Log::Whole(recording) => of(&recording.joints[joint].q),
        Log::Long(long) => {
            let mut all = [f64::INFINITY, f64::NEG_INFINITY];
            for chapter in 0..long.chapters() {
                let [low, high] = of(&long.source().positions(chapter, joint)?);
                all = [all[0].min(low), all[1].max(high)];
            }
            all
        }
    };
    Ok(high - low)
}
