//! The effects found, the ones that cannot be excluded, the ones that are absent, and the terms that were dropped.

use super::figures::inclusion::family_name;
use super::text::{interval, probability};
use super::verdict::plus_minus;
use serde::Serialize;
use twincal::calibrate::{Calibration, TermSummary};
use twincal::term::Status;

/// Below this probability an effect that was not kept is called absent.
const ABSENT: f64 = 0.1;

/// The effects in the order in which a reader wants them.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(super) struct Effects {
    /// PIP ≥ 0.5, surest and largest first.
    pub(super) found: Vec<Effect>,
    /// 0.1 ≤ PIP < 0.5.
    pub(super) possible: Vec<Effect>,
    /// PIP < 0.1.
    pub(super) absent: Vec<Effect>,
    /// Not columns of the regression.
    pub(super) dropped: Vec<Dropped>,
}

/// One row of the table of effects.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Effect {
    pub(super) words: String,
    pub(super) name: String,
    pub(super) family: &'static str,
    pub(super) unit: String,
    pub(super) pip: String,
    /// Given that it is there.
    pub(super) value: String,
    /// Unconditional.
    pub(super) interval: String,
    /// The sampler cannot tell on which side of 0.5 it lies.
    pub(super) undecided: bool,
}

/// A term that is no column.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Dropped {
    pub(super) name: String,
    pub(super) reason: String,
}

/// Sorts the terms of `calibration`.
pub(super) fn sort(calibration: &Calibration) -> Effects {
    let mut live: Vec<(&TermSummary, f64)> = calibration
        .terms
        .iter()
        .filter_map(|t| Some((t, t.pip?)))
        .collect();
    let strength =
        |t: &TermSummary| match (t.conditional_mean.or(t.mean), t.conditional_sd.or(t.sd)) {
            (Some(mean), Some(sd)) if sd > 0.0 => (mean / sd).abs(),
            _ => 0.0,
        };
    // Ties keep the library's order: the sort is stable.
    live.sort_by(|a, b| {
        b.1.total_cmp(&a.1)
            .then(strength(b.0).total_cmp(&strength(a.0)))
    });
    let pick = |keep: &dyn Fn(&TermSummary, f64) -> bool| {
        live.iter()
            .filter(|(t, p)| keep(t, *p))
            .map(|(t, p)| effect(t, *p))
            .collect()
    };
    Effects {
        found: pick(&|t, _| t.selected),
        possible: pick(&|t, p| !t.selected && p >= ABSENT),
        absent: pick(&|t, p| !t.selected && (p < ABSENT || p.is_nan())),
        dropped: calibration.terms.iter().filter_map(dropped).collect(),
    }
}

fn effect(term: &TermSummary, pip: f64) -> Effect {
    let value = match (
        term.conditional_mean.or(term.mean),
        term.conditional_sd.or(term.sd),
    ) {
        (Some(mean), Some(sd)) => plus_minus(mean, sd),
        _ => "–".into(),
    };
    Effect {
        words: if term.words.is_empty() {
            term.term.name.clone()
        } else {
            term.words.clone()
        },
        name: term.term.name.clone(),
        family: family_name(term.term.family),
        unit: term.term.unit.clone(),
        pip: probability(pip),
        value,
        interval: term.interval95.map_or("–".into(), interval),
        undecided: term
            .pip_mcse
            .is_some_and(|e| e > 0.0 && (pip - 0.5).abs() < 3.0 * e),
    }
}

fn dropped(term: &TermSummary) -> Option<Dropped> {
    let reason = match &term.term.status {
        Status::Candidate => return None,
        Status::AliasOf(other) => {
            format!("its torque cannot be told from that of {other}, which stands for both")
        }
        Status::NullLagrangian => "it is a total time derivative: it makes no torque at all".into(),
        Status::ZeroColumn => "it makes no torque in any of these logs".into(),
    };
    Some(Dropped {
        name: term.term.name.clone(),
        reason,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;

    #[test]
    fn every_term_is_listed_exactly_once() {
        for calibration in [
            fixture::two_joints(),
            fixture::seven_joints(),
            fixture::nothing_found(),
        ] {
            let effects = sort(&calibration);
            let listed = effects.found.len()
                + effects.possible.len()
                + effects.absent.len()
                + effects.dropped.len();
            assert_eq!(listed, calibration.terms.len());
        }
    }

    #[test]
    fn the_surest_and_strongest_come_first_and_reasons_are_given() {
        let effects = sort(&fixture::two_joints());
        let pips: Vec<_> = effects.found.iter().map(|e| e.pip.as_str()).collect();
        assert_eq!(pips[0], "1.00");
        assert!(
            effects
                .dropped
                .iter()
                .any(|d| d.reason.contains("which stands for both"))
        );
        assert!(
            effects
                .dropped
                .iter()
                .any(|d| d.reason.contains("total time derivative"))
        );
    }

    #[test]
    fn within_three_standard_errors_of_one_half_is_undecided() {
        let mut calibration = fixture::gibbs();
        calibration
            .terms
            .iter_mut()
            .for_each(|t| t.pip_mcse = t.pip.map(|_| 0.02));
        calibration.terms[0].pip = Some(0.55);
        calibration.terms[1].pip = Some(0.57);
        let effects = sort(&calibration);
        let by_name = |name: &str| {
            effects
                .found
                .iter()
                .chain(&effects.possible)
                .chain(&effects.absent)
                .find(|e| e.name == name)
                .unwrap()
                .undecided
        };
        assert!(
            by_name(&calibration.terms[0].term.name) && !by_name(&calibration.terms[1].term.name)
        );
    }
}
