//! What `fit` would look for, and what the logs cannot show of it.

use super::super::summary::paragraph;
use super::super::table::{print_table, table};
use super::Inspection;
use crate::terminal::Terminal;
use serde::Serialize;
use twincal::excitation::{ComponentExcitation, Excitation, Seen};
use twincal::robot::{Robot, base_parameters};
use twincal::term::{Component, Family, Library, Status, Term};
use twincal_io::result_json::status_word;

/// Sentences on what is not seen that are shown; the rest is in the JSON.
const SHOWN: usize = 5;

/// Which inertial parameters torque can show.
#[derive(Serialize)]
pub(super) struct BaseRow {
    count: usize,
    names: Vec<String>,
    dependent: Vec<DependentRow>,
    unidentifiable: Vec<String>,
}

/// A parameter that acts only together with independent ones.
#[derive(Serialize)]
struct DependentRow {
    name: String,
    combination: Vec<ShareRow>,
}

#[derive(Serialize)]
struct ShareRow {
    name: String,
    weight: f64,
}

/// One candidate.
#[derive(Serialize)]
pub(in super::super) struct ComponentRow {
    name: String,
    family: Family,
    story: String,
    /// Names as in `terms[]` of result.json; units and statuses in the same order.
    columns: Vec<String>,
    units: Vec<String>,
    statuses: Vec<String>,
    alias_of: Vec<String>,
    /// Null without logs.
    seen: Option<Seen>,
    excitation: Option<f64>,
    directions: Option<[usize; 2]>,
}

pub(super) fn base_row(robot: &Robot) -> BaseRow {
    let base = base_parameters(robot);
    let share = |&(index, weight): &(usize, f64)| ShareRow {
        name: base.names[index].clone(),
        weight,
    };
    let dependent = base.dependent.iter().map(|parameter| DependentRow {
        name: parameter.name.clone(),
        combination: parameter.combination.iter().map(share).collect(),
    });
    BaseRow {
        count: base.count,
        dependent: dependent.collect(),
        names: base.names,
        unidentifiable: base.unidentifiable,
    }
}

pub(in super::super) fn component_rows(
    library: &Library,
    excitation: Option<&Excitation>,
) -> Vec<ComponentRow> {
    let terms = |component: &Component, text: &dyn Fn(&Term) -> String| -> Vec<String> {
        let terms = component.terms.iter();
        terms.map(|&term| text(&library.terms()[term])).collect()
    };
    let of = |index: usize| -> Option<&ComponentExcitation> {
        excitation.map(|excitation| &excitation.components[index])
    };
    library
        .components()
        .iter()
        .enumerate()
        .map(|(index, component)| ComponentRow {
            name: component.name.clone(),
            family: component.family,
            story: component.story.clone(),
            columns: terms(component, &|term| term.name.clone()),
            units: terms(component, &|term| term.unit.clone()),
            statuses: terms(component, &|term| status_word(&term.status)),
            alias_of: component.alias_of.clone(),
            seen: of(index).map(|e| e.seen),
            excitation: of(index).map(|e| e.excitation),
            directions: of(index).map(|e| e.directions),
        })
        .collect()
}

/// One line per family, then which joint should move more.
pub(super) fn print(inspection: &Inspection, terminal: &mut Terminal) {
    families(&inspection.components, terminal);
    let base = &inspection.base_parameters;
    paragraph(
        &format!(
            "of {} inertial parameters torque shows {} combinations; {} never act",
            base.count + base.dependent.len() + base.unidentifiable.len(),
            base.count,
            base.unidentifiable.len()
        ),
        terminal,
    );
    terminal.say("");
    let words = inspection.unseen.iter().map(|unseen| unseen.words.as_str());
    directions(inspection.directions, words, terminal);
}

/// What `fit` would look for, by family.
pub(in super::super) fn families(all: &[ComponentRow], terminal: &mut Terminal) {
    terminal.heading(&format!(
        "What fit would look for: {} components",
        all.len()
    ));
    let with_logs = all.iter().any(|component| component.seen.is_some());
    let mut header = vec!["family", "components", "columns"];
    if with_logs {
        header.extend(["seen", "in part", "not seen"]);
    }
    let mut rows = table(&header);
    let mut families: Vec<Family> = all.iter().map(|component| component.family).collect();
    families.dedup();
    for family in families {
        let own = || all.iter().filter(|component| component.family == family);
        let statuses = own().flat_map(|component| &component.statuses);
        let live = statuses.filter(|status| **status == status_word(&Status::Candidate));
        let mut row = vec![
            family.word().replace('_', " "),
            own().count().to_string(),
            live.count().to_string(),
        ];
        if with_logs {
            let count = |wanted: &[Seen]| {
                let counted = own().filter(|c| c.seen.is_some_and(|seen| wanted.contains(&seen)));
                match counted.count() {
                    0 => String::new(),
                    count => count.to_string(),
                }
            };
            row.extend([
                count(&[Seen::Fully]),
                count(&[Seen::Partly]),
                count(&[Seen::NotAtAll, Seen::Never]),
            ]);
        }
        rows.add_row(row);
    }
    print_table(&rows, terminal);
}

/// What logs show of that, and what another motion would; nothing without logs.
pub(in super::super) fn directions<'a>(
    directions: Option<[usize; 2]>,
    unseen: impl ExactSizeIterator<Item = &'a str>,
    terminal: &mut Terminal,
) {
    let Some([robot, logs]) = directions else {
        return;
    };
    terminal.heading(&format!(
        "What these logs show: {logs} of {robot} identifiable combinations"
    ));
    let all = unseen.len();
    for words in unseen.take(SHOWN) {
        paragraph(words, terminal);
    }
    if all > SHOWN {
        terminal.say(&format!("  and {} more (--json)", all - SHOWN));
    }
    terminal.say("");
}
