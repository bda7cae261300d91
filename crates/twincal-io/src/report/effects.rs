//! The effects found, the tentative ones, the ones that are absent, and the terms that were dropped. An
//! effect is a component: one physical effect with all its columns.

use crate::words::number::plus_minus;
use crate::words::number::{interval, probability, with_ends};
use crate::words::{family_name, reason as status_reason, remarks};
use serde::Serialize;
use twincal::calibrate::{
    Calibration, ComponentSummary, ParameterSummary, Status as Said, TermSummary,
};
use twincal::term::{Estimate, Family, Status, is_place, told};

/// The effects as a reader wants them: by kind, in the order of the library, joints in the order of the model.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(super) struct Effects {
    /// Established, or equivalent or tentative and in.
    pub(super) found: Vec<Kind>,
    /// Tentative, and likelier out than in.
    pub(super) possible: Vec<Kind>,
    /// Absent: names alone.
    pub(super) absent: Vec<Absent>,
    /// Equivalent to a likelier one: names alone.
    pub(super) rivals: Vec<Absent>,
    /// Unidentifiable, whatever their PIP: names alone.
    pub(super) unseen: Vec<Absent>,
    /// Not columns of the regression.
    pub(super) dropped: Vec<Dropped>,
    /// Number of effects in each list.
    pub(super) counts: Counts,
}

/// Effects in each list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub(super) struct Counts {
    pub(super) possible: usize,
    pub(super) absent: usize,
    pub(super) rivals: usize,
    pub(super) unseen: usize,
    pub(super) dropped: usize,
}

/// Effects of one family.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Kind {
    pub(super) title: String,
    /// The part of their names after the dot; empty where a name has none.
    pub(super) word: String,
    pub(super) effects: Vec<Effect>,
}

/// One effect in the table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Effect {
    /// The joint or link, or what it is where it belongs to none.
    pub(super) title: String,
    pub(super) name: String,
    pub(super) pip: String,
    /// What it is known by, given that it is there: the clearest numbers.
    pub(super) told: Vec<Parameter>,
    /// All numbers that the data see, where they are more than those told.
    pub(super) all: Vec<Parameter>,
    /// Names of the others.
    pub(super) unseen: Vec<String>,
    pub(super) status: &'static str,
    /// Why; may be empty.
    pub(super) reason: String,
    /// What explains its numbers.
    pub(super) remarks: Vec<String>,
}

/// One physical parameter of an effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Parameter {
    pub(super) name: String,
    pub(super) value: String,
    pub(super) unit: String,
    pub(super) interval: String,
}

/// Absent effects of one family, or those that are not seen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Absent {
    pub(super) title: String,
    pub(super) names: Vec<String>,
}

/// Terms that are no columns, for one reason.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Dropped {
    pub(super) names: Vec<String>,
    pub(super) reason: String,
}

/// The list on which an effect stands: its status decides, and of what is open whether it is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum List {
    Found,
    Possible,
    Rivals,
    Absent,
    Unseen,
}

impl List {
    fn of(component: &ComponentSummary) -> Self {
        match component.status {
            Said::Unidentifiable => Self::Unseen,
            Said::Absent => Self::Absent,
            Said::Established => Self::Found,
            Said::Equivalent | Said::Tentative if component.is_in() => Self::Found,
            Said::Equivalent => Self::Rivals,
            Said::Tentative => Self::Possible,
        }
    }
}

/// Sorts the components of `calibration`.
pub(super) fn sort(calibration: &Calibration) -> Effects {
    let on = |list: List| -> Vec<&ComponentSummary> {
        let candidates = calibration.components.iter().filter(|c| c.pip.is_some());
        candidates.filter(|c| List::of(c) == list).collect()
    };
    let [found, possible, rivals] = [List::Found, List::Possible, List::Rivals].map(on);
    let [absent, unseen] = [List::Absent, List::Unseen].map(on);
    let dropped = dropped(&calibration.terms);
    Effects {
        found: kinds(&found, calibration),
        counts: Counts {
            possible: possible.len(),
            absent: absent.len(),
            rivals: rivals.len(),
            unseen: unseen.len(),
            dropped: dropped.iter().map(|d| d.names.len()).sum(),
        },
        possible: kinds(&possible, calibration),
        absent: names(&absent),
        rivals: names(&rivals),
        unseen: names(&unseen),
        dropped,
    }
}

fn names(components: &[&ComponentSummary]) -> Vec<Absent> {
    let own = |own: &[&ComponentSummary]| Absent {
        title: family_title(own[0]),
        names: own.iter().map(|c| c.name.clone()).collect(),
    };
    by_family(components).map(own).collect()
}

/// The library has them in the order of families, but for what belongs to a payload.
fn by_family<'a, 'b>(
    components: &'b [&'a ComponentSummary],
) -> impl Iterator<Item = &'b [&'a ComponentSummary]> {
    components.chunk_by(|a, b| a.family == b.family)
}

fn kinds(components: &[&ComponentSummary], calibration: &Calibration) -> Vec<Kind> {
    let kind = |own: &[&ComponentSummary]| Kind {
        title: family_title(own[0]),
        word: match own[0].name.rsplit_once('.') {
            Some((_, word)) if word == own[0].family.word() => format!(".{word}"),
            _ => String::new(),
        },
        effects: own.iter().map(|c| effect(c, calibration)).collect(),
    };
    by_family(components).map(kind).collect()
}

/// "Viscous friction".
fn family_title(component: &ComponentSummary) -> String {
    let name = family_name(component.family);
    let mut letters = name.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}

fn effect(component: &ComponentSummary, calibration: &Calibration) -> Effect {
    let pip = component.pip.unwrap_or(f64::NAN);
    let seen: Vec<&ParameterSummary> = seen(component, true)
        .filter(|parameter| !is_no_place(parameter))
        .collect();
    let estimates: Vec<Estimate> = component.parameters.iter().map(estimate).collect();
    let told = told(component.family, &estimates);
    let told: Vec<&ParameterSummary> =
        (told.into_iter().map(|k| &component.parameters[k])).collect();
    let show = |all: &[&ParameterSummary]| -> Vec<Parameter> {
        all.iter().map(|p| parameter(p, component.family)).collect()
    };
    Effect {
        title: match component.name.rsplit_once('.') {
            Some((place, word)) if word == component.family.word() => place.into(),
            _ => component.story.clone(),
        },
        name: component.name.clone(),
        pip: probability(pip),
        all: if told.len() < seen.len() {
            show(&seen)
        } else {
            Vec::new()
        },
        told: show(&told),
        unseen: self::seen(component, false).map(name).collect(),
        status: component.status.word(),
        reason: status_reason(component),
        remarks: remarks(component, calibration),
    }
}

/// The parameters that these data see, or those that they do not.
fn seen(component: &ComponentSummary, wanted: bool) -> impl Iterator<Item = &ParameterSummary> {
    component
        .parameters
        .iter()
        .filter(move |p| p.seen == wanted)
}

/// Whether it is a spring's rest position at which no joint stands: its preload says what it does.
fn is_no_place(parameter: &ParameterSummary) -> bool {
    parameter.name == "rest_position" && !is_place(&estimate(parameter))
}

/// A parameter's name; empty where there is only one.
fn name(parameter: &ParameterSummary) -> String {
    match parameter.name.as_str() {
        "value" => String::new(),
        name => name.replace('_', " "),
    }
}

/// As it goes into a sentence: what these data do not see has no value.
fn estimate(parameter: &ParameterSummary) -> Estimate {
    let (value, spread) = parameter.told();
    Estimate {
        name: parameter.name.clone(),
        unit: parameter.unit.clone(),
        value: if parameter.seen { value } else { f64::NAN },
        spread,
        ends: parameter.ends(),
    }
}

fn parameter(parameter: &ParameterSummary, family: Family) -> Parameter {
    let (factor, unit) = family.told_in(&parameter.unit);
    let (value, spread) = parameter.told();
    // Otherwise only models too light to be listed hold it.
    let known = value.is_finite();
    let or_dash = |text: String| if known { text } else { "–".into() };
    Parameter {
        name: name(parameter),
        value: or_dash(match parameter.ends() {
            None => plus_minus(factor * value, factor * spread),
            Some(ends) => with_ends(factor * value, ends.map(|x| factor * x)),
        }),
        unit: unit.into(),
        interval: or_dash(interval(parameter.interval95.map(|x| factor * x))),
    }
}

/// Every term that is no column, by reason.
fn dropped(terms: &[TermSummary]) -> Vec<Dropped> {
    let mut out: Vec<Dropped> = Vec::new();
    for term in terms {
        let Some(reason) = reason(&term.term.status) else {
            continue;
        };
        let name = term.term.name.clone();
        match out.iter_mut().find(|dropped| dropped.reason == reason) {
            Some(dropped) => dropped.names.push(name),
            None => out.push(Dropped {
                names: vec![name],
                reason,
            }),
        }
    }
    out
}

fn reason(status: &Status) -> Option<String> {
    Some(match status {
        Status::Candidate => return None,
        Status::AliasOf(other) => {
            format!("torque that cannot be told from that of {other}, which stands for all")
        }
        Status::NullLagrangian => {
            "no torque in any motion of this robot: what they act on has no load or no mass, or their energy is a total time derivative".into()
        }
        Status::ZeroColumn => "no torque in any of these logs".into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;
    use twincal::calibrate::StatusReason;

    fn unsee(own: &mut ComponentSummary, pip: f64) {
        (own.pip, own.status) = (Some(pip), Said::Unidentifiable);
        own.reason = StatusReason::WideAsPrior;
    }

    #[test]
    fn every_term_is_listed_exactly_once() {
        for calibration in [
            fixture::two_joints(),
            fixture::seven_joints(),
            fixture::nothing_found(),
        ] {
            let effects = sort(&calibration);
            let of = |kinds: &[Kind]| kinds.iter().map(|kind| kind.effects.len()).sum::<usize>();
            let names = |all: &[Absent]| all.iter().map(|kind| kind.names.len()).sum::<usize>();
            let (absent, unseen) = (names(&effects.absent), names(&effects.unseen));
            let rivals = names(&effects.rivals);
            assert_eq!(effects.counts.rivals, rivals);
            assert_eq!(effects.counts.possible, of(&effects.possible));
            assert_eq!(effects.counts.absent, absent);
            assert_eq!(effects.counts.unseen, unseen);
            let listed = of(&effects.found)
                + of(&effects.possible)
                + absent
                + rivals
                + unseen
                + effects.counts.dropped;
            assert_eq!(listed, calibration.components.len());
        }
    }

    /// Names on each list: found, possible, absent, rivals, unseen.
    fn lists(effects: Effects) -> [Vec<String>; 5] {
        let rows = |kinds: Vec<Kind>| flat(kinds).into_iter().map(|e| e.name).collect();
        let names = |kinds: Vec<Absent>| kinds.into_iter().flat_map(|kind| kind.names).collect();
        [
            rows(effects.found),
            rows(effects.possible),
            names(effects.absent),
            names(effects.rivals),
            names(effects.unseen),
        ]
    }

    /// Statuses of fits to a UR10: absent with a PIP of 0.07, unidentifiable with one of 0.39.
    #[test]
    fn every_list_has_the_statuses_that_it_names() {
        let mut open = fixture::two_joints();
        let changed = [
            ("q2^2", Said::Equivalent),
            ("qd1^2", Said::Tentative),
            ("qd1^2*cos(q2)", Said::Unidentifiable),
            ("elbow.coulomb", Said::Equivalent),
        ];
        for (name, status) in changed {
            let mut all = open.components.iter_mut();
            all.find(|c| c.name == name).expect("a component").status = status;
        }
        let calibrations = [
            open,
            fixture::two_joints(),
            fixture::seven_joints(),
            fixture::nothing_found(),
        ];
        for calibration in calibrations {
            let lists = lists(sort(&calibration));
            let of = |names: &[String], wanted: &[Said], is_in: bool| {
                for name in names {
                    let mut all = calibration.components.iter();
                    let own = all.find(|c| c.name == *name).expect("a component");
                    assert!(wanted.contains(&own.status), "{name}: {:?}", own.status);
                    assert_eq!(own.is_in(), is_in, "{name}");
                }
            };
            let [found, possible, absent, rivals, unseen] = &lists;
            let claimed = [Said::Established, Said::Equivalent, Said::Tentative];
            of(found, &claimed, true);
            of(possible, &[Said::Tentative], false);
            of(absent, &[Said::Absent], false);
            of(rivals, &[Said::Equivalent], false);
            of(unseen, &[Said::Unidentifiable], false);
            let live = calibration.components.iter().filter(|c| c.pip.is_some());
            assert_eq!(lists.iter().flatten().count(), live.count());
        }
    }

    #[test]
    fn what_the_data_do_not_see_is_neither_absent_nor_possible() {
        let mut calibration = fixture::two_joints();
        for (name, pip) in [("elbow.offset", 0.01), ("qd1^2*cos(q2)", 0.21)] {
            let own = calibration.components.iter_mut().find(|c| c.name == name);
            let own = own.unwrap();
            unsee(own, pip);
        }
        let effects = sort(&calibration);
        let unseen: Vec<&String> = effects.unseen.iter().flat_map(|u| &u.names).collect();
        assert_eq!(unseen, ["qd1^2*cos(q2)", "elbow.offset"]);
        let absent = effects.absent.iter().flat_map(|u| &u.names);
        assert!(absent.into_iter().all(|name| name != "elbow.offset"));
        assert!(
            flat(effects.possible)
                .iter()
                .all(|e| e.name != "qd1^2*cos(q2)")
        );
        let html = crate::report::render(&calibration, &crate::report::ReportContext::default());
        assert!(
            html.expect("a page")
                .contains("2 unidentifiable: not seen by these data")
        );
    }

    #[test]
    fn a_lopsided_number_has_both_ends_and_one_number_is_one() {
        let mut calibration = fixture::two_joints();
        let own = (calibration.components.iter_mut()).find(|c| c.name == "elbow.coulomb");
        let own = own.unwrap();
        let value = &mut own.parameters[0];
        (value.median, value.interval68, value.interval95) =
            (293.9, [284.5, 378.1], [276.0, 424.0]);
        own.family = Family::Payload;
        value.name = "com_x".into();
        let unseen = ParameterSummary {
            name: "mass".into(),
            seen: false,
            ..value.clone()
        };
        own.parameters.insert(0, unseen);
        let shown = effect(own, &fixture::two_joints());
        assert_eq!(shown.all[0].value, "294 (276 … 424)");
        let html = crate::report::render(&calibration, &crate::report::ReportContext::default());
        assert!(html.expect("a page").contains("one number, 1 not seen"));
    }

    fn flat(kinds: Vec<Kind>) -> Vec<Effect> {
        kinds.into_iter().flat_map(|kind| kind.effects).collect()
    }

    #[test]
    fn effects_stand_by_kind_and_reasons_are_given() {
        let mut calibration = fixture::two_joints();
        for (component, name) in calibration
            .components
            .iter_mut()
            .zip(["b.viscous", "a.viscous"])
        {
            component.name = name.into();
            component.family = Family::Viscous;
            (component.status, component.pip) = (Said::Established, Some(1.0));
        }
        let effects = sort(&calibration);
        let first = &effects.found[0];
        assert_eq!(
            (&*first.title, &*first.word),
            ("Viscous friction", ".viscous")
        );
        let titles: Vec<&str> = first.effects.iter().map(|e| e.title.as_str()).collect();
        assert_eq!(titles[..2], ["b", "a"]);
        assert!(
            effects
                .dropped
                .iter()
                .any(|d| d.reason.contains("which stands for all"))
        );
        assert!(
            effects
                .dropped
                .iter()
                .any(|d| d.reason.contains("total time derivative"))
        );
    }

    #[test]
    fn the_clearest_numbers_are_told_and_units_are_those_of_the_terminal() {
        let parameter = |name: &str, unit: &str, median: f64, half: f64| ParameterSummary {
            name: name.into(),
            unit: unit.into(),
            mean: median,
            sd: half,
            interval95: [median - 2.0 * half, median + 2.0 * half],
            median,
            interval68: [median - half, median + half],
            seen: true,
        };
        let mut calibration = fixture::two_joints();
        let component = &mut calibration.components[0];
        component.family = Family::MassMoments;
        component.parameters = [("m", 1.0), ("mx", 30.0), ("my", 1.5), ("mz", -40.0)]
            .map(|(name, value)| parameter(name, "kg·m", value, 1.0))
            .to_vec();
        let names = |calibration: &Calibration| -> Vec<String> {
            let told = effect(&calibration.components[0], calibration).told;
            told.into_iter().map(|p| p.name).collect()
        };
        assert_eq!(names(&calibration), ["mx", "mz"]);
        for p in &mut calibration.components[0].parameters {
            p.median = 0.1;
        }
        assert_eq!(names(&calibration), ["m"]);
        let component = &mut calibration.components[0];
        component.family = Family::Payload;
        component.parameters = vec![
            parameter("mass", "kg", 1.2, 0.03),
            ParameterSummary {
                seen: false,
                ..parameter("com_x", "m", 0.0, 0.0)
            },
            parameter("com_y", "m", 0.061, 0.004),
            parameter("com_z", "m", 0.0, 0.004),
            parameter("ixx", "kg·m²", 5.0, 0.1),
        ];
        let told = effect(&calibration.components[0], &calibration).told;
        let told: Vec<_> = told
            .iter()
            .map(|p| (&*p.name, &*p.value, &*p.unit))
            .collect();
        assert_eq!(
            told,
            [
                ("mass", "1.200 ± 0.030", "kg"),
                ("com y", "61.0 ± 4.0", "mm"),
                ("com z", "0.0 ± 4.0", "mm")
            ]
        );
        let gain = self::parameter(
            &parameter("value", "1", 0.0439, 0.0041),
            Family::LoadFriction,
        );
        assert_eq!((&*gain.value, &*gain.unit), ("4.39 ± 0.41", "%"));
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
        let all = flat(effects.found)
            .into_iter()
            .chain(flat(effects.possible));
        let effect = all.into_iter().find(|e| e.name == name).unwrap();
        let values: Vec<&str> = effect.all.iter().map(|p| p.value.as_str()).collect();
        assert_eq!(values, ["0.470 ± 0.080", "–"]);
        assert_eq!(effect.unseen, ["com y", "izz"]);
        let html = crate::report::render(&calibration, &crate::report::ReportContext::default());
        let html = html.expect("a page");
        assert!(html.contains("not seen by these data: com y, izz"));
        assert!(!html.contains("0 ± 0<"));
    }
}
