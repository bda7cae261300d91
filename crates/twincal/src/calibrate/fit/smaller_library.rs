//! Fewer candidates where the rows are too few for all of them, or their models too many for the chains, unless somebody chose the candidates:
//! friction and base parameters.

use crate::calibrate::settings::{CalibrationSettings, UnaskedRipple};
use crate::error::{Code, Error, Finding, Severity};
use crate::term::Family;

/// Viscous and Coulomb friction, and the inertial parameters of links with the motors' inertia.
const FAMILIES: [Family; 6] = [
    Family::Viscous,
    Family::Coulomb,
    Family::MotorInertia,
    Family::Density,
    Family::MassMoments,
    Family::Tensor,
];

/// A fit with fewer candidates.
pub(in crate::calibrate) struct Smaller {
    /// Its settings.
    pub(in crate::calibrate) settings: CalibrationSettings,
    /// What is said of it.
    pub(in crate::calibrate) finding: Finding,
}

/// Whether nobody chose these families: the usual ones, with or without those that remember.
pub(in crate::calibrate) fn is_usual(families: &[Family]) -> bool {
    let states = || {
        Family::DEFAULT
            .into_iter()
            .filter(|family| !family.remembers())
    };
    *families == Family::DEFAULT || families.iter().copied().eq(states())
}

/// The same fit without candidates that remember, which cost the rows before their state is known; `None` where there are none, or somebody
/// chose the candidates, or the refusal has another reason.
pub(in crate::calibrate) fn without_memory(
    refused: &Error,
    settings: &CalibrationSettings,
) -> Option<Smaller> {
    let Error::Refused { problem, .. } = refused else {
        return None;
    };
    if settings.library.families != Family::DEFAULT {
        return None;
    }
    let mut settings = settings.clone();
    settings
        .library
        .families
        .retain(|family| !family.remembers());
    let message = format!(
        "too few rows for all candidates ({problem}): fitted without hysteresis and warm-up of friction"
    );
    let finding = Finding::new(Severity::Note, Code::HistoryNotFollowed, "", message, 0);
    Some(Smaller { settings, finding })
}

/// The fit that is tried after one by `settings` was refused; `None` where somebody chose the candidates or the refusal has another reason.
pub(in crate::calibrate) fn smaller(
    refused: &Error,
    settings: &CalibrationSettings,
) -> Option<Smaller> {
    let Error::Refused { problem, .. } = refused else {
        return None;
    };
    if !is_usual(&settings.library.families) {
        return None;
    }
    let mut settings = settings.clone();
    settings.library.families = FAMILIES.to_vec();
    settings.unasked_ripple = UnaskedRipple::Ignored;
    settings.may_widen = false;
    let message = format!(
        "no result with all candidates ({problem}): fitted with friction, motor inertia and link inertias only; log longer and faster motion \
         for the others"
    );
    let finding = Finding::new(Severity::Warning, Code::SmallerLibrary, "", message, 0);
    Some(Smaller { settings, finding })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chosen_candidates_and_other_errors_stay() {
        let refused = Error::Refused {
            problem: "12 rows".into(),
            remedy: String::new(),
        };
        let usual = CalibrationSettings::default();
        let states = without_memory(&refused, &usual).unwrap().settings;
        assert!(is_usual(&states.library.families));
        assert!(states.library.families.len() + 2 == usual.library.families.len());
        assert!(without_memory(&refused, &states).is_none());
        assert!(smaller(&refused, &states).is_some());
        let smaller_one = smaller(&refused, &usual).unwrap();
        assert_eq!(smaller_one.settings.library.families, FAMILIES);
        assert!(smaller_one.finding.message.contains("(12 rows)"));
        assert!(smaller(&refused, &smaller_one.settings).is_none());
        let other = Error::Setting {
            key: "a".into(),
            problem: "b".into(),
            remedy: "c".into(),
        };
        assert!(smaller(&other, &usual).is_none());
    }
}
