//! Tables of results: columns that leave as an Arrow C stream, without a copy in Python.

use crate::errors::Problem;
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{
    ArrayRef, BooleanArray, Float64Array, RecordBatch, RecordBatchIterator, StringArray,
    UInt64Array,
};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict};
use serde::Serialize;
use std::sync::Arc;
use twincal::assess::assess;
use twincal::calibrate::{Calibration, ComponentSummary, ParameterSummary};
use twincal::validate::{JointScore, Validation};

/// Values of one column.
#[derive(Debug)]
enum Column {
    Text(Vec<String>),
    Number(Vec<f64>),
    Count(Vec<u64>),
    Flag(Vec<bool>),
}

/// A table: columns of one length by name.
#[pyclass(frozen, module = "twincal._twincal")]
#[derive(Debug, Default)]
pub(crate) struct Table {
    columns: Vec<(&'static str, Column)>,
}

impl Table {
    fn text(mut self, name: &'static str, values: impl IntoIterator<Item = String>) -> Self {
        let values = values.into_iter().collect();
        self.columns.push((name, Column::Text(values)));
        self
    }

    fn number(mut self, name: &'static str, values: impl IntoIterator<Item = f64>) -> Self {
        let values = values.into_iter().collect();
        self.columns.push((name, Column::Number(values)));
        self
    }

    fn count(mut self, name: &'static str, values: impl IntoIterator<Item = u64>) -> Self {
        let values = values.into_iter().collect();
        self.columns.push((name, Column::Count(values)));
        self
    }

    fn flag(mut self, name: &'static str, values: impl IntoIterator<Item = bool>) -> Self {
        let values = values.into_iter().collect();
        self.columns.push((name, Column::Flag(values)));
        self
    }

    fn batch(&self) -> Result<RecordBatch, Problem> {
        let array = |column: &Column| -> ArrayRef {
            match column {
                Column::Text(own) => Arc::new(StringArray::from_iter_values(own)),
                // A number that does not exist is null in Arrow, as in result.json.
                Column::Number(own) => Arc::new(Float64Array::from_iter(
                    own.iter().map(|x| Some(*x).filter(|x| !x.is_nan())),
                )),
                Column::Count(own) => Arc::new(UInt64Array::from(own.clone())),
                Column::Flag(own) => Arc::new(BooleanArray::from(own.clone())),
            }
        };
        let columns = self.columns.iter();
        let columns = columns.map(|(name, column)| (*name, array(column), true));
        RecordBatch::try_from_iter_with_nullable(columns)
            .map_err(|e| Problem::Panicked(format!("a table of results: {e}")))
    }
}

#[pymethods]
impl Table {
    /// Names of the columns.
    #[getter]
    fn column_names(&self) -> Vec<&'static str> {
        self.columns.iter().map(|(name, _)| *name).collect()
    }

    /// Number of rows.
    #[getter]
    fn num_rows(&self) -> usize {
        match self.columns.first() {
            Some((_, Column::Text(own))) => own.len(),
            Some((_, Column::Number(own))) => own.len(),
            Some((_, Column::Count(own))) => own.len(),
            Some((_, Column::Flag(own))) => own.len(),
            None => 0,
        }
    }

    /// Columns by name: lists of text, arrays of numbers.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(py);
        for (name, column) in &self.columns {
            match column {
                Column::Text(own) => columns.set_item(name, own)?,
                Column::Number(own) => columns.set_item(name, PyArray1::from_slice(py, own))?,
                Column::Count(own) => columns.set_item(name, PyArray1::from_slice(py, own))?,
                Column::Flag(own) => columns.set_item(name, PyArray1::from_slice(py, own))?,
            }
        }
        Ok(columns)
    }

    /// A capsule with an Arrow C stream of one batch.
    fn arrow_c_stream<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        let batch = self.batch().map_err(|problem| problem.raise(py))?;
        let schema = batch.schema();
        let batches = RecordBatchIterator::new([Ok(batch)], schema);
        let stream = FFI_ArrowArrayStream::new(Box::new(batches));
        PyCapsule::new_with_value(py, stream, c"arrow_array_stream")
    }
}

/// One row for each parameter of each component, as `twincal export --to csv`.
pub(crate) fn effects(calibration: &Calibration) -> Table {
    let mut rows: Vec<(&ComponentSummary, Option<&ParameterSummary>)> = Vec::new();
    for component in &calibration.components {
        match component.parameters.is_empty() {
            true => rows.push((component, None)),
            false => rows.extend(
                component
                    .parameters
                    .iter()
                    .map(|own| (component, Some(own))),
            ),
        }
    }
    let of = |value: fn(&ParameterSummary) -> f64| -> Vec<f64> {
        let own = rows.iter();
        let own = own.map(|(_, parameter)| parameter.filter(|own| own.seen));
        own.map(|parameter| parameter.map_or(f64::NAN, value))
            .collect()
    };
    let text = |value: fn(&ParameterSummary) -> &str| -> Vec<String> {
        let own = rows.iter();
        own.map(|(_, parameter)| parameter.map_or(String::new(), |own| value(own).to_owned()))
            .collect()
    };
    Table::default()
        .text("component", rows.iter().map(|(own, _)| own.name.clone()))
        .text(
            "family",
            rows.iter().map(|(own, _)| own.family.word().to_owned()),
        )
        .text(
            "status",
            rows.iter().map(|(own, _)| own.status.word().to_owned()),
        )
        .number(
            "pip",
            rows.iter().map(|(own, _)| own.pip.unwrap_or(f64::NAN)),
        )
        .text("parameter", text(|own| &own.name))
        .text("unit", text(|own| &own.unit))
        .number("mean", of(|own| own.mean))
        .number("sd", of(|own| own.sd))
        .number("median", of(|own| own.median))
        .number("low95", of(|own| own.interval95[0]))
        .number("high95", of(|own| own.interval95[1]))
        .text("words", rows.iter().map(|(own, _)| own.words.clone()))
}

/// One row for each term of the library, as `terms[]` of result.json.
pub(crate) fn terms(calibration: &Calibration) -> Table {
    let terms = &calibration.terms;
    let number = |value: fn(&twincal::calibrate::TermSummary) -> Option<f64>| -> Vec<f64> {
        terms
            .iter()
            .map(|own| value(own).unwrap_or(f64::NAN))
            .collect()
    };
    Table::default()
        .text("term", terms.iter().map(|own| own.term.name.clone()))
        .text(
            "family",
            terms.iter().map(|own| own.term.family.word().to_owned()),
        )
        .text("unit", terms.iter().map(|own| own.term.unit.clone()))
        .number("pip", number(|own| own.pip))
        .number("pip_mcse", number(|own| own.pip_mcse))
        .number("mean", number(|own| own.mean))
        .number("sd", number(|own| own.sd))
        .number("low95", number(|own| own.interval95.map(|ends| ends[0])))
        .number("high95", number(|own| own.interval95.map(|ends| ends[1])))
        .number("conditional_mean", number(|own| own.conditional_mean))
        .number("conditional_sd", number(|own| own.conditional_sd))
        .flag("observable", terms.iter().map(|own| own.seen))
        .text("words", terms.iter().map(|own| own.words.clone()))
}

/// One row for each joint and set of held-out rows.
pub(crate) fn validation(validation: &Validation) -> Table {
    let sets = [
        ("filtered", &validation.filtered),
        ("moving", &validation.moving),
        ("within", &validation.within),
        ("beyond", &validation.beyond),
        ("raw", &validation.raw),
        ("raw_moving", &validation.raw_moving),
    ];
    let rows: Vec<(&str, &JointScore)> = (sets.iter())
        .flat_map(|(set, scores)| scores.joints.iter().map(move |joint| (*set, joint)))
        .collect();
    let of = |value: fn(&JointScore) -> f64| -> Vec<f64> {
        rows.iter().map(|(_, joint)| value(joint)).collect()
    };
    Table::default()
        .text("joint", rows.iter().map(|(_, own)| own.joint.clone()))
        .text("rows_of", rows.iter().map(|(set, _)| (*set).to_owned()))
        .count("rows", rows.iter().map(|(_, own)| own.rows))
        .number("rmse_nominal", of(|own| own.rmse_nominal))
        .number("rmse_calibrated", of(|own| own.rmse_calibrated))
        .number("bias", of(|own| own.bias))
        .number("coverage95", of(|own| own.coverage95))
        .number("mean_width95", of(|own| own.mean_width95))
        .number("interval_score95", of(|own| own.interval_score95))
        .number("torque_sd", of(|own| own.torque_sd))
        .number("epistemic_share", of(|own| own.epistemic_share))
}

/// One row for each number behind each claim.
pub(crate) fn assessment(calibration: &Calibration) -> (Table, &'static str, String) {
    let assessment = assess(calibration);
    let mut rows: Vec<[String; 5]> = Vec::new();
    let mut numbers = Vec::new();
    for claim in &assessment.claims {
        let start = [
            claim.code.to_string(),
            word(&claim.role),
            word(&claim.severity),
            claim.subject.name().to_owned(),
        ];
        let mut push = |name: &str, number: f64| {
            let [code, role, severity, subject] = start.clone();
            rows.push([code, role, severity, subject, name.to_owned()]);
            numbers.push(number);
        };
        match claim.evidence.iter().next() {
            None => push("", f64::NAN),
            Some(_) => claim
                .evidence
                .iter()
                .for_each(|(name, number)| push(name, number)),
        }
    }
    let column =
        |index: usize| -> Vec<String> { rows.iter().map(|row| row[index].clone()).collect() };
    let table = Table::default()
        .text("code", column(0))
        .text("role", column(1))
        .text("severity", column(2))
        .text("subject", column(3))
        .text("evidence", column(4))
        .number("value", numbers);
    (
        table,
        assessment.answer.as_str(),
        assessment.reason.to_string(),
    )
}

/// An enum of the core as the word that its JSON has.
fn word(value: &impl Serialize) -> String {
    let value = serde_json::to_value(value).unwrap_or_default();
    value.as_str().unwrap_or_default().to_owned()
}

/// One row for each finding.
pub(crate) fn findings(findings: &[twincal::Finding]) -> Table {
    Table::default()
        .text("code", findings.iter().map(|own| own.code.to_string()))
        .text("severity", findings.iter().map(|own| word(&own.severity)))
        .text("subject", findings.iter().map(|own| own.subject.clone()))
        .text("message", findings.iter().map(|own| own.message.clone()))
        .count("count", findings.iter().map(|own| own.count))
}
