//! What was found and is not to be rested on, in words.

use super::figures::sensitivity;
use super::grounds::NAMED;
use super::halves::whole_against_halves;
use super::remarks::size_of_gravity;
use super::text::{first_of, list, number};
use twincal::Severity;
use twincal::calibrate::{Calibration, Repeat, Repeated};

/// What was found and is not to be rested on: bodies that are none, gravity of another size, numbers on which the halves of the data differ, effects
/// that neither half has alone, and those that another prior would leave out.
pub(super) fn not_to_rest_on(calibration: &Calibration) -> Vec<String> {
    let mut out = Vec::new();
    let bodies = no_bodies(calibration);
    if !bodies.is_empty() {
        out.push(format!(
            "What was found of {} is no rigid body (in more than 95 % of the draws): another effect is missing among the candidates, or inertias of the model are wrong; do not read it as mass or inertia.",
            list(&bodies)
        ));
    }
    let found = calibration.components.iter().filter(|c| c.selected);
    out.extend(found.filter_map(|component| {
        let words = size_of_gravity(component, calibration)?;
        Some(format!("{}: {words}.", component.name))
    }));
    let effects = || (calibration.repeatability).chunk_by(|a, b| a.component == b.component);
    let apart = effects().filter(|own| Repeat::of_effect(own) == Repeated::Differs);
    let apart: Vec<String> = apart
        .map(|own| {
            let z = own.iter().filter_map(|number| number.z).map(f64::abs);
            format!(
                "{} ({} sd)",
                own[0].component,
                number(z.fold(0.0, f64::max), 2)
            )
        })
        .collect();
    if !apart.is_empty() {
        out.push(format!(
            "The two halves of the data differ by 3 sd or more on {}.",
            list(&apart)
        ));
    }
    let in_neither = effects().filter(|own| Repeat::of_effect(own) == Repeated::InNeitherHalf);
    let in_neither: Vec<&str> = in_neither.map(|own| own[0].component.as_str()).collect();
    if !in_neither.is_empty() {
        out.push(format!(
            "Found in the whole data, but in neither half alone: {}.",
            list(&in_neither)
        ));
    }
    let found = calibration.components.iter().filter(|c| c.selected);
    let against: Vec<String> = found
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
    let by_prior: Vec<&str> = sensitivity::by_prior(calibration)
        .filter(|component| component.selected)
        .map(|component| component.name.as_str())
        .collect();
    if !by_prior.is_empty() {
        out.push(format!("Other priors would leave out {}.", list(&by_prior)));
    }
    out
}

/// What hangs on settings that are as good: the filter's cut-off, and priors that would add something.
pub(super) fn of_settings(calibration: &Calibration) -> Vec<String> {
    let mut out = Vec::new();
    let added: Vec<String> = sensitivity::by_prior(calibration)
        .filter(|component| !component.selected)
        .map(|component| component.name.clone())
        .collect();
    if !added.is_empty() {
        out.push(format!(
            "Other priors would add {}.",
            list(&first_of(added, NAMED))
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
            "Another cut-off of the filter moves by more than their ±: {}.",
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
            "Another cut-off of the filter moves by more than their ±: {}, {}, {} and 2 more.",
            name(4),
            name(3),
            name(2)
        );
        assert_eq!(of_settings(&calibration), [said]);
        calibration.findings.clear();
        assert!(of_settings(&calibration).is_empty());
    }
}
