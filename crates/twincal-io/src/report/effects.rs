//! The effects found, the ones that cannot be excluded, the ones that are absent, and the terms that were dropped. An
//! effect is a component: one physical story with all its columns.

use super::figures::inclusion::family_name;
use super::text::{interval, probability};
use super::verdict::plus_minus;
use serde::Serialize;
use twincal::calibrate::{Calibration, ComponentSummary, ParameterSummary, TermSummary, Verdict};
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
    pub(super) pip: String,
    /// What it is known by, given that it is there.
    pub(super) parameters: Vec<Parameter>,
    /// The sampler cannot tell on which side of 0.5 it lies.
    pub(super) undecided: bool,
    /// The data say nothing about it.
    pub(super) not_seen: bool,
    /// No motion of this robot can tell it from these.
    pub(super) alias_of: Vec<String>,
}

/// One physical parameter of an effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Parameter {
    pub(super) name: String,
    pub(super) value: String,
    pub(super) unit: String,
    pub(super) interval: String,
}

/// A term that is no column.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Dropped {
    pub(super) name: String,
    pub(super) reason: String,
}

/// Sorts the components of `calibration`.
pub(super) fn sort(calibration: &Calibration) -> Effects {
    let mut live: Vec<(&ComponentSummary, f64)> = calibration
        .components
        .iter()
        .filter_map(|c| Some((c, c.pip?)))
        .collect();
    let strength = |c: &ComponentSummary| {
        let clear = |p: &ParameterSummary| (p.mean / p.sd).abs();
        let all = c.parameters.iter().map(clear).filter(|x| x.is_finite());
        all.fold(0.0, f64::max)
    };
    // Ties keep the library's order: the sort is stable.
    live.sort_by(|a, b| {
        b.1.total_cmp(&a.1)
            .then(strength(b.0).total_cmp(&strength(a.0)))
    });
    let pick = |keep: &dyn Fn(&ComponentSummary, f64) -> bool| {
        live.iter()
            .filter(|(c, p)| keep(c, *p))
            .map(|(c, p)| effect(c, *p))
            .collect()
    };
    Effects {
        found: pick(&|c, _| c.selected),
        possible: pick(&|c, p| !c.selected && p >= ABSENT),
        absent: pick(&|c, p| !c.selected && (p < ABSENT || p.is_nan())),
        dropped: calibration.terms.iter().filter_map(dropped).collect(),
    }
}

fn effect(component: &ComponentSummary, pip: f64) -> Effect {
    Effect {
        words: if component.words.is_empty() {
            component.name.clone()
        } else {
            component.words.clone()
        },
        name: component.name.clone(),
        family: family_name(component.family),
        pip: probability(pip),
        parameters: component.parameters.iter().map(parameter).collect(),
        undecided: component
            .pip_mcse
            .is_some_and(|e| e > 0.0 && (pip - 0.5).abs() < 3.0 * e),
        not_seen: component.verdict == Some(Verdict::NotSeen),
        alias_of: component.alias_of.clone(),
    }
}

fn parameter(parameter: &ParameterSummary) -> Parameter {
    let unit = match parameter.unit.as_str() {
        "1" => "",
        unit => unit,
    };
    Parameter {
        name: match parameter.name.as_str() {
            "value" => String::new(),
            name => name.replace('_', " "),
        },
        value: plus_minus(parameter.mean, parameter.sd),
        unit: unit.into(),
        interval: interval(parameter.interval95),
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
            assert_eq!(listed, calibration.components.len());
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
            .components
            .iter_mut()
            .for_each(|c| c.pip_mcse = c.pip.map(|_| 0.02));
        calibration.components[0].pip = Some(0.55);
        calibration.components[1].pip = Some(0.57);
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
            by_name(&calibration.components[0].name) && !by_name(&calibration.components[1].name)
        );
    }
}
