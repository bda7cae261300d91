//! `fleet.html`: what a fleet's posterior says, for people.

use super::Inputs;
use super::reason::reason;
use crate::error::Result;
use crate::report::fleet::{Deviation, Effect, FleetPage, LeftOut, Robot, render};
use crate::words::fleet as words;
use twincal::fleet::{DeviationSummary, FleetResult, UnitSummary};

/// The page as HTML.
///
/// # Errors
/// [`crate::Error::Internal`] if the template and the values that fill it do not fit together.
pub fn fleet_page(result: &FleetResult, inputs: &Inputs) -> Result<String> {
    let rows: usize = result.units.iter().map(|unit| unit.rows).sum();
    let logs: usize = result.units.iter().map(|unit| unit.logs.len()).sum();
    let page = FleetPage {
        headline: words::headline(result),
        doubt: words::doubt(result).unwrap_or_default(),
        of_type: words::of_type(result),
        about: format!(
            "{}: {} robots, {} windows, {logs} logs, {rows} rows",
            inputs.model,
            result.units.len(),
            result.windows.len(),
        ),
        corrected: inputs.corrected.clone(),
        rate: crate::words::percent(inputs.false_discovery_rate),
        deviating: result
            .units
            .iter()
            .filter(|unit| unit.deviates)
            .map(robot(result))
            .collect(),
        others: result
            .units
            .iter()
            .filter(|unit| !unit.deviates)
            .map(robot(result))
            .collect(),
        effects: (result.type_effects.iter().filter(|own| own.pip >= 0.05))
            .map(|own| Effect {
                name: own.name.clone(),
                story: own.story.clone(),
                values: own.parameters.iter().map(named).collect(),
                main: words::main_value(&own.parameters).map_or_else(|| "–".into(), words::value),
                scatter: words::scatter(own.scatter, &own.parameters),
                probability: words::chance(own.pip),
                likely: own.pip >= 0.5,
            })
            .collect(),
        left_out: (result.left_out.iter())
            .map(|own| LeftOut {
                robot: own.robot.clone(),
                log: own.log.clone(),
                reason: reason(&own.reason),
            })
            .collect(),
    };
    render(&page)
}

fn named(own: &twincal::fleet::Value) -> [String; 2] {
    [own.name.clone(), words::value(own)]
}

fn robot(result: &FleetResult) -> impl Fn(&UnitSummary) -> Robot + '_ {
    |unit| Robot {
        name: unit.robot.clone(),
        probability: words::chance(unit.probability),
        // Figures of those that are named.
        deviations: (unit.deviations.iter().filter(|_| unit.deviates))
            .map(|own| deviation(own, result))
            .collect(),
        logs: unit.logs.clone(),
        rows: unit.rows,
    }
}

fn deviation(own: &DeviationSummary, result: &FleetResult) -> Deviation {
    let unit = match own.unit.as_str() {
        "1" => String::new(),
        unit => unit.to_owned(),
    };
    Deviation {
        name: own.name.clone(),
        story: own.story.clone(),
        main: words::main_value(&own.parameters).map_or_else(|| "–".into(), words::difference),
        since: words::since(own),
        probability: words::chance(own.pip),
        course: (own.course.iter())
            .map(|point| (words::day(result.windows[point.window]), *point))
            .collect(),
        unit,
    }
}
