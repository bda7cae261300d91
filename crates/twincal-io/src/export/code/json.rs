//! The steps as JSON: what is needed to evaluate the twin in a language of one's own.

use super::notes;
use super::text::json_text;
use crate::error::{Error, Result};
use serde_json::{Value, json};
use twincal::evaluator::{Evaluator, Step};

pub(super) fn source(evaluator: &Evaluator, about: &[String]) -> Result<String> {
    let steps: Vec<Value> = evaluator.steps.iter().map(step).collect();
    let joints: Vec<Value> = (evaluator.joints.iter().enumerate())
        .map(|(j, joint)| {
            json!({
                "name": joint.name,
                "unit": joint.unit,
                "torque": evaluator.torque[j],
                "variance": evaluator.variance[j],
                "limits": joint.limits.chunks(2).map(|pair| json!({"low": pair[0], "high": pair[1]})).collect::<Vec<_>>(),
                "noise": joint.noise,
                "base": joint.base,
            })
        })
        .collect();
    let all = json!({
        "schema": 1,
        "about": notes(evaluator, about),
        "use": "Steps are computed in order; numbers in a step are indices of earlier steps, except the value of `number`, the \
                joint of `q`, `qd`, `qdd` and the exponent of `power`. half width = quantile * sqrt(ratio * max(variance, 0) + \
                base); outside the data where q, qd or qdd leave limits or variance > noise.",
        "quantile": evaluator.quantile,
        "ratio": evaluator.ratio,
        "joints": joints,
        "steps": steps,
    });
    json_text(&all)
        .map(|text| text + "\n")
        .map_err(|e| Error::Internal {
            what: "export as JSON".into(),
            problem: e.to_string(),
        })
}

fn step(step: &Step) -> Value {
    match step {
        Step::Constant(value) => json!(["number", value]),
        Step::Position(joint) => json!(["q", joint]),
        Step::Velocity(joint) => json!(["qd", joint]),
        Step::Acceleration(joint) => json!(["qdd", joint]),
        Step::Add(a, b) => json!(["add", a, b]),
        Step::Subtract(a, b) => json!(["subtract", a, b]),
        Step::Multiply(a, b) => json!(["multiply", a, b]),
        Step::Divide(a, b) => json!(["divide", a, b]),
        Step::Negate(a) => json!(["negate", a]),
        Step::Absolute(a) => json!(["absolute", a]),
        Step::Power(a, exponent) => json!(["power", a, exponent]),
        Step::Apply(function, a) => json!([format!("{function:?}").to_lowercase(), a]),
    }
}
