//! What is tried where a pass over the logs ends early: a list, and the first attempt that applies sets up the next pass.

use super::exit::Exit;
use super::fit::lower_band::{Band, TooFew, clear, lower, lowered, most_rows};
use super::fit::ripples::Seen;
use super::fit::smaller_library::{Smaller, smaller, without_memory};
use super::fit::wider_band::not_wider;
use super::request::Goal;
use super::settings::CalibrationSettings;
use crate::error::{Error, Finding};
use crate::signal::Auto;

/// Sets up the next pass; false where it has nothing to do with the end of the last one.
type Attempt<'s> = fn(&mut Attempts<'s>, &mut Ended<'_>) -> bool;

/// How a pass ended.
pub(super) struct Ended<'e> {
    pub(super) exit: &'e Exit,
    /// What it found.
    pub(super) findings: &'e [Finding],
    /// Whether the recordings are still there, for another pass.
    pub(super) recordings_kept: bool,
    /// Counts independent rows; `None` where that is not possible.
    pub(super) count: &'e mut dyn FnMut(&CalibrationSettings) -> Option<Band>,
}

impl Ended<'_> {
    /// The error of a pass that may be gone again.
    fn failure(&self) -> Option<TooFew> {
        match self.exit {
            _ if !self.recordings_kept => None,
            Exit::TooFew(few) => Some(few.clone()),
            Exit::Failed(error) | Exit::Disagreeing(error) => Some(TooFew::from(error.clone())),
            _ => None,
        }
    }
}

/// Settings of the next pass, and what earlier ones left.
pub(super) struct Attempts<'s> {
    asked: &'s CalibrationSettings,
    pub(super) settings: CalibrationSettings,
    pub(super) goal: Goal,
    /// Findings with which the next pass begins.
    pub(super) findings: Vec<Finding>,
    /// Settings and findings of the usual band, while a wider one is tried.
    usual: Option<(CalibrationSettings, Vec<Finding>)>,
    /// Error and findings of the first pass that failed.
    first: Option<(Error, Vec<Finding>)>,
}

impl<'s> Attempts<'s> {
    /// The list, in the order in which it is gone through.
    const LIST: [Attempt<'s>; 8] = [
        Self::ripple,
        Self::linearisation,
        Self::wider_band,
        Self::clear_band,
        Self::without_memory,
        Self::usual_band,
        Self::lower_band,
        Self::smaller_library,
    ];

    /// Before the first pass.
    pub(super) fn new(asked: &'s CalibrationSettings) -> Self {
        Self {
            asked,
            settings: asked.clone(),
            goal: Goal::Result,
            findings: Vec::new(),
            usual: None,
            first: None,
        }
    }

    /// Sets up the next pass; false where the list has none.
    pub(super) fn next(&mut self, mut ended: Ended<'_>) -> bool {
        Self::LIST.iter().any(|attempt| attempt(self, &mut ended))
    }

    /// The error of the first pass that failed, which is the last one if no other did; `findings` become those of the same pass.
    pub(super) fn failure(self, last: Exit, findings: &mut Vec<Finding>) -> Error {
        match (self.first, last) {
            (Some((error, found)), _) => {
                *findings = found;
                error
            }
            (None, Exit::Failed(error) | Exit::Disagreeing(error)) => error,
            (None, Exit::TooFew(few) | Exit::Masked(few)) => few.error,
            (None, Exit::Ripple(_) | Exit::Elsewhere(_) | Exit::Wider(_)) => {
                unreachable!("the list has an attempt for it")
            }
        }
    }

    /// Gear ripple becomes a candidate.
    fn ripple(&mut self, ended: &mut Ended<'_>) -> bool {
        let Exit::Ripple(ripples) = ended.exit else {
            return false;
        };
        self.findings.extend(ripples.iter().map(Seen::added));
        let orders = ripples
            .iter()
            .map(|seen| (seen.joint.clone(), seen.periods));
        self.settings.library.ripple.extend(orders);
        self.settings.signal.every_sample = true;
        true
    }

    /// Columns about the effects that were found.
    fn linearisation(&mut self, ended: &mut Ended<'_>) -> bool {
        let Exit::Elsewhere(point) = ended.exit else {
            return false;
        };
        self.settings.library.linearised_at.clone_from(point);
        self.settings.relinearise -= 1;
        true
    }

    fn wider_band(&mut self, ended: &mut Ended<'_>) -> bool {
        let Exit::Wider(wider) = ended.exit else {
            return false;
        };
        let wide = wider.settings(&self.settings);
        self.settings.may_widen = false;
        let usual = std::mem::replace(&mut self.settings, wide);
        self.usual = Some((usual, self.findings.clone()));
        self.findings.push(wider.finding.clone());
        true
    }

    /// A lower band in which the torque of the model is not masked; without one the same band, to its result.
    fn clear_band(&mut self, ended: &mut Ended<'_>) -> bool {
        let Exit::Masked(few) = ended.exit else {
            return false;
        };
        self.goal = Goal::ResultAnyway;
        if let Some(cutoff_hz) = clear(&self.lower_bands(few, ended)) {
            self.lower_to(cutoff_hz, few);
        }
        true
    }

    /// Candidates without memory, which need fewer rows; where chains disagree rows are not what is missing.
    fn without_memory(&mut self, ended: &mut Ended<'_>) -> bool {
        let failure = match ended.exit {
            Exit::Disagreeing(_) => None,
            _ => ended.failure(),
        };
        let fewer = failure.and_then(|few| without_memory(&few.error, &self.settings));
        fewer.is_some_and(|fewer| self.with(fewer))
    }

    /// The usual band after all, where a wider one failed.
    fn usual_band(&mut self, ended: &mut Ended<'_>) -> bool {
        let Some(few) = self.first_failure(ended) else {
            return false;
        };
        let Some((settings, findings)) = self.usual.take() else {
            return false;
        };
        (self.settings, self.findings) = (settings, findings);
        self.findings.push(not_wider(&few.error));
        true
    }

    /// The lower band with most independent rows.
    fn lower_band(&mut self, ended: &mut Ended<'_>) -> bool {
        let Some(few) = self.first_failure(ended) else {
            return false;
        };
        let Some(cutoff_hz) = most_rows(&self.lower_bands(&few, ended)) else {
            return false;
        };
        self.lower_to(cutoff_hz, &few);
        self.keep_first(few.error, ended);
        true
    }

    /// Friction and inertias alone.
    fn smaller_library(&mut self, ended: &mut Ended<'_>) -> bool {
        let Some(few) = self.first_failure(ended) else {
            return false;
        };
        let Some(smaller) = smaller(&few.error, &self.settings) else {
            return false;
        };
        self.keep_first(few.error, ended);
        self.with(smaller)
    }

    fn with(&mut self, smaller: Smaller) -> bool {
        self.settings = smaller.settings;
        // Effects that are no candidates any more are nothing to be linearised about.
        self.settings.library.linearised_at.clear();
        self.settings.relinearise = self.asked.relinearise;
        self.findings.push(smaller.finding);
        true
    }

    fn lower_to(&mut self, cutoff_hz: f64, few: &TooFew) {
        self.settings.signal.cutoff_hz = Auto::Value(cutoff_hz);
        self.findings.push(lowered(few, cutoff_hz));
    }

    /// The failure of a pass, if no other failed before it in a way that stays.
    fn first_failure(&self, ended: &Ended<'_>) -> Option<TooFew> {
        ended.failure().filter(|_| self.first.is_none())
    }

    /// If the next pass fails as well this error stands.
    fn keep_first(&mut self, error: Error, ended: &Ended<'_>) {
        self.goal = Goal::ResultAnyway;
        self.first = Some((error, ended.findings.to_vec()));
    }

    /// The lower bands in which independent rows can be counted.
    fn lower_bands(&self, few: &TooFew, ended: &mut Ended<'_>) -> Vec<Band> {
        let mut settings = self.settings.clone();
        let cutoffs = lower(few, ended.findings, self.asked).into_iter();
        let bands = cutoffs.filter_map(|cutoff_hz| {
            settings.signal.cutoff_hz = Auto::Value(cutoff_hz);
            (ended.count)(&settings)
        });
        bands.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(problem: &str) -> Error {
        Error::Refused {
            problem: problem.into(),
            remedy: String::new(),
        }
    }

    /// Sets up the pass after one that ended so.
    fn next(attempts: &mut Attempts<'_>, exit: &Exit) -> bool {
        attempts.next(Ended {
            exit,
            findings: &[],
            recordings_kept: true,
            count: &mut |_| None,
        })
    }

    /// Rows are not what chains lack: every pass with them costs up to [`crate::infer`]'s limit of work.
    #[test]
    fn disagreeing_chains_get_the_smaller_library_at_once_and_once() {
        let asked = CalibrationSettings::default();
        let mut attempts = Attempts::new(&asked);
        assert!(next(&mut attempts, &Exit::Disagreeing(refused("first"))));
        assert_eq!(attempts.settings.library.families.len(), 6);
        let last = Exit::Disagreeing(refused("second"));
        assert!(!next(&mut attempts, &last));
        assert_eq!(attempts.failure(last, &mut Vec::new()), refused("first"));
    }

    #[test]
    fn too_few_rows_lose_the_candidates_with_memory_first() {
        let asked = CalibrationSettings::default();
        let mut attempts = Attempts::new(&asked);
        let few = Exit::TooFew(TooFew::from(refused("few")));
        assert!(next(&mut attempts, &few));
        let families = &attempts.settings.library.families;
        assert_eq!(families.len() + 2, asked.library.families.len());
        assert!(next(&mut attempts, &few));
        assert_eq!(attempts.settings.library.families.len(), 6);
    }
}
