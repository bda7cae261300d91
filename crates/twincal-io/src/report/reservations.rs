//! What was found and is not to be rested on, in words.

use super::figures::sensitivity;
use super::grounds::NAMED;
use super::halves::whole_against_halves;
use super::standing::{Standing, of_halves, standing};
use super::text::{first_of, list, number};
use super::uses;
use twincal::Severity;
use twincal::calibrate::{Calibration, Repeated};

/// What was found and is not to be rested on: what is only suspected, and numbers on which the halves of the data differ from each other or, of
/// the rest, from all of it.
pub(super) fn not_to_rest_on(calibration: &Calibration) -> Vec<String> {
    let mut out: Vec<String> = uses::suspected(calibration).into_iter().collect();
    let found = || calibration.components.iter().filter(|own| own.selected);
    let apart: Vec<String> = found()
        .filter(|own| of_halves(own, calibration) == Repeated::Differs)
        .map(|own| {
            let numbers = calibration.repeatability.iter();
            let numbers = numbers.filter(|number| number.component == own.name);
            let z = numbers.filter_map(|number| number.z).map(f64::abs);
            format!("{} ({} sd)", own.name, number(z.fold(0.0, f64::max), 2))
        })
        .collect();
    if !apart.is_empty() {
        out.push(format!(
            "The two halves of the data differ by 3 sd or more on {}.",
            list(&apart)
        ));
    }
    let against: Vec<String> = found()
        .filter(|own| standing(own, calibration) == Some(Standing::Doubted))
        .filter_map(|component| {
            let against = whole_against_halves(component, calibration)?;
            Some(format!("{} ({against})", component.name))
        })
        .collect();
    if !against.is_empty() {
        out.push(format!(
            "All data together say what their two halves do not: {}.",
            list(&against)
        ));
    }
    out
}

/// What hangs on settings that are as good: the filter's cut-off, and priors that would add something.
pub(super) fn of_settings(calibration: &Calibration) -> Vec<String> {
    let mut out = Vec::new();
    // What comes in the place of something found is told there.
    let found = calibration.components.iter().filter(|own| own.selected);
    let instead: Vec<String> = found
        .flat_map(|own| sensitivity::instead_of(own, calibration))
        .collect();
    let added: Vec<(String, Vec<&str>)> = sensitivity::by_prior(calibration)
        .filter(|component| !component.selected && !instead.contains(&component.name))
        .map(|own| {
            (
                own.name.clone(),
                sensitivity::priors_that_hold(own, calibration),
            )
        })
        .filter(|(_, priors)| !priors.is_empty())
        .collect();
    if !added.is_empty() {
        let mut which: Vec<&str> = Vec::new();
        for prior in added.iter().flat_map(|(_, priors)| priors) {
            if !which.contains(prior) {
                which.push(prior);
            }
        }
        let priors = match which.len() {
            1 => "Another prior",
            _ => "Other priors",
        };
        let names = added.into_iter().map(|(name, _)| name).collect();
        out.push(format!(
            "{priors} ({}) would add {}.",
            which.join("; "),
            list(&first_of(names, NAMED))
        ));
    }
    // Findings have those first that move most.
    let mut moved: Vec<String> = Vec::new();
    for finding in calibration
        .findings
        .iter()
        .filter(|f| f.code == "depends_on_cutoff")
    {
        let mut all = calibration.components.iter();
        let own = all.find(|own| own.selected && own.columns.contains(&finding.subject));
        if let Some(own) = own.filter(|own| !moved.contains(&own.name)) {
            moved.push(own.name.clone());
        }
    }
    if !moved.is_empty() {
        out.push(format!(
            "Another cut-off of the filter moves by more than their sd (mean over all models, in or out): {}.",
            list(&first_of(moved, NAMED))
        ));
    }
    out
}

/// Links of which what was found is no rigid body.
pub(super) fn no_bodies(calibration: &Calibration) -> Vec<&str> {
    let found = calibration.findings.iter();
    let found = found.filter(|f| f.code == "unphysical_inertia_found");
    let sure = found.filter(|f| f.severity == Severity::Warning);
    sure.map(|f| f.subject.as_str()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;
    use twincal::Finding;

    #[test]
    fn effects_that_a_cutoff_moves_are_named_those_that_move_most_first() {
        let mut calibration = fixture::two_joints();
        for term in &mut calibration.terms {
            term.pip_sensitivity.clear();
        }
        let found: Vec<(String, String)> = (calibration.components.iter())
            .filter(|own| own.selected)
            .map(|own| (own.name.clone(), own.columns[0].clone()))
            .collect();
        let finding = |(_, column): &(String, String)| {
            let code = "depends_on_cutoff";
            Finding::new(Severity::Warning, code, column.as_str(), "", 0)
        };
        calibration.findings = found.iter().take(5).rev().map(finding).collect();
        let name = |k: usize| found[k].0.as_str();
        let said = format!(
            "Another cut-off of the filter moves by more than their sd (mean over all models, in or out): {}, {}, {} and 2 more.",
            name(4),
            name(3),
            name(2)
        );
        assert_eq!(of_settings(&calibration), [said]);
        calibration.findings.clear();
        assert!(of_settings(&calibration).is_empty());
    }

    #[test]
    fn priors_that_would_add_something_are_named() {
        let told = |sensitivity: [f64; 5]| {
            let mut calibration = fixture::two_joints();
            calibration.findings.clear();
            calibration.groups.clear();
            let mut components = calibration.components.iter();
            let own = components.find(|own| !own.selected && !own.is_unseen() && own.pip.is_some());
            let own = own.expect("one that is not found").clone();
            for term in &mut calibration.terms {
                term.pip_sensitivity.clear();
                if own.columns.contains(&term.term.name) {
                    term.pip_sensitivity = sensitivity.to_vec();
                }
            }
            (own.name, of_settings(&calibration))
        };
        let (name, one) = told([0.9, 0.1, 0.0, 0.1, 0.2]);
        let said = "Another prior (the slab’s variance ten times smaller) would add";
        assert_eq!(one, [format!("{said} {name}.")]);
        let (_, two) = told([0.1, 0.1, 0.6, 0.1, 0.7]);
        let said =
            "Other priors (the slab’s variance ten times larger; more effects expected) would add";
        assert_eq!(two, [format!("{said} {name}.")]);
        assert!(told([0.1, 0.9, 0.1, 0.1, 0.1]).1.is_empty());
    }
}
