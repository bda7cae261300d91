//! What is to be minded about an effect before its numbers are used: it stands at the effect's own line.

use super::text::{list, number};
use twincal::calibrate::{Alike, Calibration, ComponentSummary, Repeat, Repeated};

/// Rivals that are named; the others are counted.
const NAMED: usize = 2;

/// Remarks on a found component, the gravest first.
pub(super) fn remarks(component: &ComponentSummary, calibration: &Calibration) -> Vec<String> {
    let mut out = Vec::new();
    let first = component.parameters.first().map(|p| p.told().0);
    let negative = first.and_then(|value| component.family.remark(value));
    out.extend(negative.map(str::to_owned));
    if component.no_rigid_body {
        out.push("no rigid body has this: it stands in for another effect".into());
    }
    out.extend(rivals(component, calibration));
    out.extend(repeats(component, calibration));
    if moves_with_the_cutoff(component, calibration) {
        out.push("moves with the cut-off by more than its ±".into());
    }
    out
}

/// What else may be behind the same torque.
fn rivals(component: &ComponentSummary, calibration: &Calibration) -> Option<String> {
    let mut groups = calibration.groups.iter();
    let own = |names: &[String]| names.contains(&component.name);
    let group = groups.find(|group| own(&group.members) && !group.settled);
    let others = |names: &[String]| {
        let others: Vec<&str> = (names.iter())
            .filter(|name| **name != component.name)
            .map(String::as_str)
            .collect();
        match others.len().checked_sub(NAMED) {
            None | Some(0) => list(&others),
            Some(more) => format!("{} and {more} more", others[..NAMED].join(", ")),
        }
    };
    match group {
        Some(group) if group.alike == Alike::TheseLogs => Some(format!(
            "or {} instead: these logs do not tell",
            others(&group.members)
        )),
        Some(group) => Some(format!(
            "or {} instead: no motion can tell",
            others(&group.members)
        )),
        None if component.alias_of.is_empty() => None,
        None => Some(format!(
            "no motion can tell it from {}; the prior prefers it",
            others(&component.alias_of)
        )),
    }
}

/// What the two halves of the data say, where they do not agree.
fn repeats(component: &ComponentSummary, calibration: &Calibration) -> Option<String> {
    let of = |repeat: &&Repeat| repeat.component == component.name;
    let own: Vec<Repeat> = (calibration.repeatability.iter())
        .filter(of)
        .cloned()
        .collect();
    let apart = own.iter().filter_map(|repeat| repeat.z).map(f64::abs);
    match Repeat::of_effect(&own) {
        Repeated::Repeats | Repeated::Wavers | Repeated::NotSeen => None,
        Repeated::Differs => Some(format!(
            "the two halves of the data differ by {} sd",
            number(apart.fold(0.0, f64::max), 2)
        )),
        Repeated::TooLoose => Some("either half alone is too loose to confirm it".into()),
        state => Some(state.words().into()),
    }
}

fn moves_with_the_cutoff(component: &ComponentSummary, calibration: &Calibration) -> bool {
    let mut findings = calibration.findings.iter();
    findings.any(|f| f.code == "depends_on_cutoff" && component.columns.contains(&f.subject))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;
    use twincal::calibrate::Group;
    use twincal::{Finding, Severity};

    fn of(change: impl Fn(&mut Calibration)) -> Vec<String> {
        let mut calibration = fixture::two_joints();
        calibration.repeatability.clear();
        calibration.findings.clear();
        change(&mut calibration);
        remarks(&calibration.components[0], &calibration)
    }

    #[test]
    fn nothing_is_remarked_of_a_plain_effect() {
        assert_eq!(of(|_| ()), [""; 0]);
    }

    #[test]
    fn each_doubt_is_said_once_at_the_effect() {
        let group = |alike, settled| Group {
            members: ["x", "y", "z", "w"].map(str::to_owned).to_vec(),
            pip: 1.0,
            alike,
            settled,
            words: String::new(),
        };
        let said = of(|c| {
            let mut group = group(Alike::TheseLogs, false);
            group.members.push(c.components[0].name.clone());
            c.groups = vec![group];
            c.components[0].no_rigid_body = true;
            let subject = c.components[0].columns[0].clone();
            c.findings.push(Finding::new(
                Severity::Warning,
                "depends_on_cutoff",
                subject,
                "",
                0,
            ));
        });
        assert_eq!(
            said,
            [
                "no rigid body has this: it stands in for another effect",
                "or x, y and 2 more instead: these logs do not tell",
                "moves with the cut-off by more than its ±",
            ]
        );
        // What the prior settled is said as such.
        let said = of(|c| {
            let mut group = group(Alike::EveryMotion, true);
            group.members.push(c.components[0].name.clone());
            c.groups = vec![group];
            c.components[0].alias_of = vec!["x".into()];
        });
        assert_eq!(said, ["no motion can tell it from x; the prior prefers it"]);
    }

    #[test]
    fn halves_that_do_not_agree_are_named() {
        let halves = |z: f64, first: (f64, f64), pips: (f64, f64)| {
            of(|c| {
                let repeat = Repeat {
                    component: c.components[0].name.clone(),
                    term: c.components[0].name.clone(),
                    unit: String::new(),
                    first: first.0,
                    first_sd: first.1,
                    first_pip: pips.0,
                    second: first.0,
                    second_sd: first.1,
                    second_pip: pips.1,
                    z: Some(z),
                };
                c.repeatability = vec![repeat];
            })
        };
        let sure = (1.0, 1.0);
        assert_eq!(halves(0.3, (7.0, 0.1), sure), [""; 0]);
        assert_eq!(
            halves(-3.7, (7.0, 0.1), sure),
            ["the two halves of the data differ by 3.7 sd"]
        );
        assert_eq!(
            halves(0.3, (7.0, 6.0), sure),
            ["either half alone is too loose to confirm it"]
        );
        assert_eq!(
            halves(0.3, (7.0, 0.1), (0.9, 0.1)),
            ["found in one half alone"]
        );
    }
}
