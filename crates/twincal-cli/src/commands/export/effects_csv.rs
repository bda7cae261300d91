//! The table of effects: a row for each parameter of each candidate, for spreadsheets and notebooks.

use crate::terminal::clean;
use twincal::calibrate::{Calibration, ComponentSummary, ParameterSummary};
use twincal_io::Error;

const HEADER: [&str; 9] = [
    "component",
    "parameter",
    "unit",
    "mean",
    "sd",
    "low95",
    "high95",
    "pip",
    "status",
];

/// The table as CSV, and its number of rows. Numbers are given that the effect is in; what these logs do not show is empty.
pub(super) fn table(calibration: &Calibration) -> Result<(Vec<u8>, usize), Error> {
    let mut rows: Vec<[String; 9]> = Vec::new();
    for component in &calibration.components {
        match component.parameters.is_empty() {
            true => rows.push(row(component, None)),
            false => {
                let own = component.parameters.iter();
                rows.extend(own.map(|parameter| row(component, Some(parameter))));
            }
        }
    }
    let mut writer = csv::Writer::from_writer(Vec::new());
    let written = writer
        .write_record(HEADER)
        .and_then(|()| rows.iter().try_for_each(|row| writer.write_record(row)));
    let internal = |problem: String| Error::Internal {
        what: "the table of effects".into(),
        problem,
    };
    written.map_err(|e| internal(e.to_string()))?;
    let bytes = writer.into_inner().map_err(|e| internal(e.to_string()))?;
    Ok((bytes, rows.len()))
}

fn row(component: &ComponentSummary, parameter: Option<&ParameterSummary>) -> [String; 9] {
    let shown = parameter.filter(|own| own.seen);
    let number = |value: Option<f64>| {
        let value = value.filter(|value| value.is_finite());
        value.map_or(String::new(), |value| value.to_string())
    };
    let of = |value: fn(&ParameterSummary) -> f64| number(shown.map(value));
    [
        text(&component.name),
        parameter.map_or(String::new(), |own| text(&own.name)),
        parameter.map_or(String::new(), |own| text(&own.unit)),
        of(|own| own.mean),
        of(|own| own.sd),
        of(|own| own.interval95[0]),
        of(|own| own.interval95[1]),
        number(component.pip),
        component.status.word().to_owned(),
    ]
}

/// A name in one cell.
fn text(name: &str) -> String {
    clean(name).replace('\n', " ")
}
