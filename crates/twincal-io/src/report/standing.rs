//! How far an effect that is more likely than not may be rested on: it stands every check, its numbers have a doubt, or it is only suspected.

use super::figures::sensitivity;
use super::remarks::{doubts, size_of_gravity};
use super::text::{first_of, list, percent};
use twincal::calibrate::{Calibration, ComponentSummary, Repeat, Repeated, Verdict};

/// Of an effect that is more likely than not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Standing {
    /// Nothing speaks against it or its numbers.
    Stands,
    /// It is there; something speaks against its numbers.
    Doubted,
    /// Something speaks against its being there, or against its being what it says.
    Suspected,
}

/// The standing of `component`; `None` of what is not more likely than not.
pub(super) fn standing(
    component: &ComponentSummary,
    calibration: &Calibration,
) -> Option<Standing> {
    component.selected.then(|| {
        if !why_suspected(component, calibration).is_empty() {
            Standing::Suspected
        } else if !doubts(component, calibration).is_empty() {
            Standing::Doubted
        } else {
            Standing::Stands
        }
    })
}

/// Why an effect that is more likely than not is only suspected, the gravest first; empty where it is not.
#[must_use]
pub fn why_suspected(component: &ComponentSummary, calibration: &Calibration) -> Vec<String> {
    if !component.selected {
        return Vec::new();
    }
    let mut out: Vec<String> = no_body(component, calibration).into_iter().collect();
    out.extend(size_of_gravity(component, calibration));
    if of_halves(component, calibration) == Repeated::InNeitherHalf {
        out.push(Repeated::InNeitherHalf.words().into());
    }
    out.extend(by_another_prior(component, calibration));
    if component.verdict == Some(Verdict::Undecided) {
        out.push("undecided".into());
    }
    out
}

/// What another prior would have instead of a found effect.
pub(super) fn by_another_prior(
    component: &ComponentSummary,
    calibration: &Calibration,
) -> Option<String> {
    let mut by_prior = sensitivity::by_prior(calibration);
    if !(component.selected && by_prior.any(|other| other.name == component.name)) {
        return None;
    }
    let instead = sensitivity::instead_of(component, calibration);
    Some(match instead.is_empty() {
        false => format!(
            "another prior would have {} in its place",
            list(&first_of(instead, 1))
        ),
        true => "another prior would leave it out".into(),
    })
}

/// "no rigid body in 97.2 % of the draws": what was found of its link, all of it together. Results of earlier versions have no share.
pub(super) fn no_body(component: &ComponentSummary, calibration: &Calibration) -> Option<String> {
    let link = ["mass_moments", "tensor"]
        .iter()
        .find_map(|word| component.name.strip_suffix(word)?.strip_suffix('.'));
    let mut findings = calibration.findings.iter();
    let open = findings.any(|f| f.code == "unphysical_inertia_found" && Some(&*f.subject) == link);
    let share = match component.rigid_share {
        Some(share) => percent(1.0 - share),
        None if component.no_rigid_body => "more than 95 %".into(),
        None if open => "more than half".into(),
        None => return None,
    };
    (component.selected).then(|| format!("no rigid body in {share} of the draws"))
}

/// What the two halves of the data say of a component.
#[must_use]
pub fn of_halves(component: &ComponentSummary, calibration: &Calibration) -> Repeated {
    let all = &calibration.repeatability;
    let mut effects = all.chunk_by(|a, b| a.component == b.component);
    let own = effects.find(|own| own[0].component == component.name);
    Repeat::of_effect(own.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;
    use twincal::{Finding, Severity};

    #[test]
    fn what_speaks_against_an_effect_makes_it_suspected_and_what_speaks_against_a_number_does_not()
    {
        let of = |change: &dyn Fn(&mut Calibration)| {
            let mut calibration = fixture::two_joints();
            calibration.findings.clear();
            calibration.repeatability.clear();
            let terms = calibration.terms.iter_mut();
            terms.for_each(|term| term.pip_sensitivity.clear());
            calibration.components[0].selected = true;
            change(&mut calibration);
            let own = &calibration.components[0];
            (
                standing(own, &calibration),
                why_suspected(own, &calibration),
            )
        };
        let reasons = |reasons: &[&str]| reasons.iter().map(|&r| r.into()).collect::<Vec<String>>();
        assert_eq!(of(&|_| ()), (Some(Standing::Stands), reasons(&[])));
        assert_eq!(of(&|c| c.components[0].selected = false).0, None);
        let body = of(&|c| c.components[0].rigid_share = Some(0.028));
        let said = "no rigid body in 97.2\u{202f}% of the draws";
        assert_eq!(body, (Some(Standing::Suspected), reasons(&[said])));
        let earlier = of(&|c| {
            let code = "unphysical_inertia_found";
            c.components[0].name = "fore.tensor".into();
            c.findings = vec![Finding::new(Severity::Note, code, "fore", "", 0)];
        });
        assert_eq!(earlier.1, ["no rigid body in more than half of the draws"]);
        let undecided = of(&|c| c.components[0].verdict = Some(Verdict::Undecided));
        assert_eq!(undecided.1, ["undecided"]);
        let repeat = |c: &mut Calibration, pip: f64, z: f64| {
            let mut own = fixture::two_joints().repeatability[0].clone();
            own.component = c.components[0].name.clone();
            (own.first_pip, own.second_pip, own.z) = (pip, pip, Some(z));
            c.repeatability = vec![own];
        };
        let neither = of(&|c| repeat(c, 0.3, 0.5));
        assert_eq!(neither.1, ["found in neither half alone"]);
        let apart = of(&|c| repeat(c, 1.0, 3.7));
        assert_eq!(apart, (Some(Standing::Doubted), reasons(&[])));
    }

    #[test]
    fn what_takes_its_place_is_what_a_prior_without_it_has() {
        use twincal::calibrate::{Alike, Group};
        let of = |priors: [[f64; 2]; 2]| {
            let mut calibration = fixture::two_joints();
            let live = |found: bool| {
                let all = calibration.components.iter();
                let own = all
                    .clone()
                    .find(|c| c.selected == found && c.pip.is_some() && !c.is_unseen());
                own.map(|own| (own.name.clone(), own.columns.clone()))
                    .unwrap()
            };
            let (found, other) = (live(true), live(false));
            for term in &mut calibration.terms {
                term.pip_sensitivity.clear();
                for ((_, columns), priors) in [&found, &other].into_iter().zip(priors) {
                    if columns.contains(&term.term.name) {
                        term.pip_sensitivity = priors.to_vec();
                    }
                }
            }
            calibration.groups = vec![Group {
                members: vec![found.0.clone(), other.0.clone()],
                pip: 0.99,
                alike: Alike::TheseLogs,
                settled: false,
                words: String::new(),
            }];
            let own = calibration.components.iter().find(|c| c.name == found.0);
            (by_another_prior(own.unwrap(), &calibration), other.0)
        };
        let (said, other) = of([[0.9, 0.1], [0.1, 0.9]]);
        let instead = format!("another prior would have {other} in its place");
        assert_eq!(said, Some(instead));
        // In, but under a prior that has both.
        let both = of([[0.9, 0.1], [0.9, 0.1]]).0;
        assert_eq!(both.as_deref(), Some("another prior would leave it out"));
        assert_eq!(of([[0.9, 0.8], [0.9, 0.1]]).0, None);
    }
}
