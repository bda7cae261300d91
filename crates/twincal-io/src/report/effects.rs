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
    /// What it is known by, given that it is there; only what the data see.
    pub(super) parameters: Vec<Parameter>,
    /// Names of the others.
    pub(super) unseen: Vec<String>,
    /// The data do not say whether it is there, or the sampler cannot tell on which side of 0.5 it lies.
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
        let clear = |p: &ParameterSummary| {
            let (value, spread) = p.told();
            (value / spread).abs()
        };
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
        parameters: seen(component, true).map(parameter).collect(),
        unseen: seen(component, false).map(name).collect(),
        undecided: component.verdict == Some(Verdict::Undecided)
            || component
                .pip_mcse
                .is_some_and(|e| e > 0.0 && (pip - 0.5).abs() < 3.0 * e),
        not_seen: component.verdict == Some(Verdict::NotSeen),
        alias_of: component.alias_of.clone(),
    }
}

/// The parameters that these data see, or those that they do not.
fn seen(component: &ComponentSummary, wanted: bool) -> impl Iterator<Item = &ParameterSummary> {
    component
        .parameters
        .iter()
        .filter(move |p| p.seen == wanted)
}

/// A parameter's name; empty where there is only one.
fn name(parameter: &ParameterSummary) -> String {
    match parameter.name.as_str() {
        "value" => String::new(),
        name => name.replace('_', " "),
    }
}

fn parameter(parameter: &ParameterSummary) -> Parameter {
    let (value, spread) = parameter.told();
    let unit = match parameter.unit.as_str() {
        "1" => "",
        unit => unit,
    };
    Parameter {
        name: name(parameter),
        // Only models too light to be listed hold it.
        value: if value.is_finite() {
            plus_minus(value, spread)
        } else {
            "–".into()
        },
        unit: unit.into(),
        interval: if value.is_finite() {
            interval(parameter.interval95)
        } else {
            "–".into()
        },
    }
}

fn dropped(term: &TermSummary) -> Option<Dropped> {
    let reason = match &term.term.status {
        Status::Candidate => return None,
        Status::AliasOf(other) => {
            format!("its torque cannot be told from that of {other}, which stands for both")
        }
        Status::NullLagrangian => {
            "no motion of this robot gives it a torque: what it acts on has no load or no mass, or its energy is a total time derivative".into()
        }
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
    fn a_parameter_that_the_data_do_not_see_has_no_number() {
        let mut calibration = fixture::two_joints();
        let component = &mut calibration.components[0];
        let parameter = |name: &str, value: f64, seen| ParameterSummary {
            name: name.into(),
            unit: "kg·m²".into(),
            mean: value + 0.3,
            sd: 0.58,
            interval95: [0.32, 0.63],
            median: value,
            interval68: [value - 0.08, value + 0.08],
            seen,
        };
        component.parameters = vec![
            parameter("ixx", 0.47, true),
            ParameterSummary {
                sd: 0.0, // a difference of rounded sums
                interval95: [f64::NAN; 2],
                ..parameter("iyy", f64::NAN, true)
            },
            parameter("com_y", f64::NAN, false),
            parameter("izz", 0.0, false),
        ];
        let name = component.name.clone();
        let effects = sort(&calibration);
        let all = effects.found.iter().chain(&effects.possible);
        let effect = all.chain(&effects.absent).find(|e| e.name == name).unwrap();
        let values: Vec<&str> = effect.parameters.iter().map(|p| p.value.as_str()).collect();
        assert_eq!(values, ["0.470 ± 0.080", "–"]);
        assert_eq!(effect.unseen, ["com y", "izz"]);
        let html = crate::report::render(&calibration, &crate::report::ReportContext::default());
        let html = html.unwrap();
        assert!(html.contains("not seen by these data: com y, izz"));
        assert!(!html.contains("0 ± 0<"));
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
