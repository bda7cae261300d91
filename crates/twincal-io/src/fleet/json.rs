//! `fleet.json`: the posterior of a fleet for programs.

use super::reason::reason;
use crate::error::{Error, Result};
use crate::words::utc;
use serde::Serialize;
use twincal::fleet::{DeviationSummary, FleetResult, TypeEffect, UnitSummary, Value, WindowSpan};

/// Version of the format.
const SCHEMA: u64 = 1;

/// What else stands in `fleet.json`.
#[derive(Debug, Clone, Serialize)]
pub struct Inputs {
    /// Name of the model.
    pub model: String,
    /// Length of a window, s.
    pub window_seconds: f64,
    /// False discovery rate at which units are named.
    pub false_discovery_rate: f64,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Files of statistics, by name.
    pub statistics: Vec<String>,
    /// The model file with what is wrong for all robots put right.
    #[serde(skip)]
    pub corrected: Corrected,
}

/// The corrected model file of a type, or why there is none.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Corrected {
    /// Its name beside `fleet.json`.
    pub file: Option<&'static str>,
    /// Why there is none.
    pub refused: Option<String>,
}

/// `fleet.json`, see `schema/fleet.schema.json`.
#[derive(Debug, Serialize)]
pub struct FleetJson<'a> {
    schema: u64,
    twincal: &'static str,
    inputs: &'a Inputs,
    windows: Vec<Window>,
    type_effects: Vec<Effect<'a>>,
    corrected_model: &'a Corrected,
    units: Vec<Unit<'a>>,
    left_out: Vec<LeftOut<'a>>,
    sampling: Sampling,
}

#[derive(Debug, Serialize)]
struct Window {
    /// RFC 3339; `null` for logs without a date.
    start: Option<String>,
}

#[derive(Debug, Serialize)]
struct Parameter<'a> {
    name: &'a str,
    value: f64,
    unit: &'a str,
    interval95: [f64; 2],
}

#[derive(Debug, Serialize)]
struct Effect<'a> {
    effect: &'a str,
    family: &'static str,
    story: &'a str,
    pip: f64,
    parameters: Vec<Parameter<'a>>,
    scatter: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Unit<'a> {
    robot: &'a str,
    deviates: bool,
    pip: f64,
    deviations: Vec<Deviation<'a>>,
    rows: usize,
    logs: &'a [String],
}

#[derive(Debug, Serialize)]
struct Deviation<'a> {
    effect: &'a str,
    family: &'static str,
    story: &'a str,
    pip: f64,
    parameters: Vec<Parameter<'a>>,
    since: Option<String>,
    onset: &'a [f64],
    course: Course<'a>,
}

/// Window by window: what it says alone of the effect's first coefficient.
#[derive(Debug, Serialize)]
struct Course<'a> {
    unit: &'a str,
    window: Vec<usize>,
    value: Vec<f64>,
    sd: Vec<f64>,
    mean: Vec<f64>,
}

#[derive(Debug, Serialize)]
struct LeftOut<'a> {
    robot: &'a str,
    log: &'a str,
    code: &'static str,
    reason: String,
}

#[derive(Debug, Serialize)]
struct Sampling {
    expected_share: f64,
    largest_difference_of_chains: f64,
}

impl<'a> FleetJson<'a> {
    /// The format of a result.
    #[must_use]
    pub fn new(result: &'a FleetResult, inputs: &'a Inputs) -> Self {
        Self {
            schema: SCHEMA,
            twincal: env!("CARGO_PKG_VERSION"),
            inputs,
            windows: (result.windows.iter())
                .map(|span| Window {
                    start: start(*span),
                })
                .collect(),
            type_effects: result.type_effects.iter().map(effect).collect(),
            corrected_model: &inputs.corrected,
            units: result.units.iter().map(unit).collect(),
            left_out: (result.left_out.iter())
                .map(|own| LeftOut {
                    robot: &own.robot,
                    log: &own.log,
                    code: own.reason.code(),
                    reason: reason(&own.reason),
                })
                .collect(),
            sampling: Sampling {
                expected_share: result.share,
                largest_difference_of_chains: result.spread,
            },
        }
    }
}

/// `fleet.json` of a result.
///
/// # Errors
/// [`Error::Internal`] if it cannot be written as JSON.
pub fn fleet_json(result: &FleetResult, inputs: &Inputs) -> Result<Vec<u8>> {
    let mut bytes = serde_json::to_vec_pretty(&FleetJson::new(result, inputs)).map_err(|e| {
        Error::Internal {
            what: "a fleet as JSON".into(),
            problem: e.to_string(),
        }
    })?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// RFC 3339.
pub(super) fn start(span: WindowSpan) -> Option<String> {
    span.since.map(|since| utc(since.max(0.0) as u64))
}

fn parameters(values: &[Value]) -> Vec<Parameter<'_>> {
    let all = values.iter().map(|own| Parameter {
        name: &own.name,
        value: own.value,
        unit: &own.unit,
        interval95: own.interval95,
    });
    all.collect()
}

fn effect(own: &TypeEffect) -> Effect<'_> {
    Effect {
        effect: &own.name,
        family: own.family.word(),
        story: &own.story,
        pip: own.pip,
        parameters: parameters(&own.parameters),
        scatter: own.scatter,
    }
}

fn unit(own: &UnitSummary) -> Unit<'_> {
    Unit {
        robot: &own.robot,
        deviates: own.deviates,
        pip: own.probability,
        deviations: own.deviations.iter().map(deviation).collect(),
        rows: own.rows,
        logs: &own.logs,
    }
}

fn deviation(own: &DeviationSummary) -> Deviation<'_> {
    Deviation {
        effect: &own.name,
        family: own.family.word(),
        story: &own.story,
        pip: own.pip,
        parameters: parameters(&own.parameters),
        since: own.since.and_then(start),
        onset: &own.onset,
        course: Course {
            unit: &own.unit,
            window: own.course.iter().map(|point| point.window).collect(),
            value: own.course.iter().map(|point| point.value).collect(),
            sd: own.course.iter().map(|point| point.sd).collect(),
            mean: own.course.iter().map(|point| point.mean).collect(),
        },
    }
}
