//! A calibration: tables, torque, draws, files.

use crate::errors::Problem;
use crate::follow::Following;
use crate::pool;
use crate::robot::{numbers, owned};
use crate::tables::{self, Table};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;
use twincal::calibrate::Along;
use twincal::posterior::draws::draw;
use twincal_cli::session::Fitted;
use twincal_io::words::answer;

/// Random stream of draws that Python asks for.
const STREAM: u64 = (1 << 32) + 3;

/// A result as it lies in a folder.
#[pyclass(frozen, module = "twincal._twincal")]
#[derive(Debug)]
pub(crate) struct Calibration {
    fitted: Arc<Fitted>,
}

impl Calibration {
    pub(crate) fn new(fitted: Fitted) -> Self {
        Self {
            fitted: Arc::new(fitted),
        }
    }

    fn result(&self) -> &twincal::calibrate::Calibration {
        &self.fitted.stored.calibration
    }
}

/// A one-dimensional array.
type Array<'py, T> = Bound<'py, PyArray1<T>>;
/// Mean, low, high and outside of states.
type Torque<'py> = (
    Array<'py, f64>,
    Array<'py, f64>,
    Array<'py, f64>,
    Array<'py, bool>,
);
/// Coefficients, noise and model of draws.
type Draws<'py> = (Array<'py, f64>, Array<'py, f64>, Array<'py, u32>);

/// Name, coordinate, components, x, mean, low and high of a law of one coordinate.
type Law<'py> = (
    String,
    &'static str,
    Vec<String>,
    Array<'py, f64>,
    Array<'py, f64>,
    Array<'py, f64>,
    Array<'py, f64>,
);

#[pymethods]
impl Calibration {
    /// Reads the folder of a result.
    #[staticmethod]
    fn load(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        let fitted = pool::detached(py, None, || Fitted::load(&folder))?;
        Ok(Self::new(fitted))
    }

    /// Writes the folder.
    fn save(&self, py: Python<'_>, folder: PathBuf, force: bool) -> PyResult<()> {
        pool::detached(py, None, || self.fitted.save(&folder, force))
    }

    /// The text of result.json.
    fn result_json(&self, py: Python<'_>) -> PyResult<String> {
        pool::detached(py, None, || self.fitted.stored.result_json())
    }

    /// The page.
    fn html(&self, py: Python<'_>) -> PyResult<String> {
        let stored = &self.fitted.stored;
        pool::detached(py, None, || {
            twincal_io::report::render(&stored.calibration, &stored.context)
        })
    }

    /// Names of the moving joints.
    #[getter]
    fn joint_names(&self) -> Vec<&str> {
        self.result().twin.robot.joint_names()
    }

    /// Units of their torque.
    #[getter]
    fn torque_units(&self) -> Vec<&'static str> {
        let robot = &self.result().twin.robot;
        (0..robot.dof())
            .map(|j| robot.joint_kind(j).torque_unit())
            .collect()
    }

    /// What the model file calls the robot.
    #[getter]
    fn robot_name(&self) -> &str {
        &self.fitted.stored.context.robot
    }

    /// Table of the claims, answer, code and headline.
    fn assessment(&self) -> (Table, &'static str, String, String) {
        let (table, word, code) = tables::assessment(self.result());
        (table, word, code, answer(self.result()).headline)
    }

    /// Table of the components.
    fn effects(&self) -> Table {
        tables::effects(self.result())
    }

    /// Table of the terms.
    fn terms(&self) -> Table {
        tables::terms(self.result())
    }

    /// Table of the held-out scores.
    fn validation(&self) -> Table {
        tables::validation(&self.result().validation)
    }

    /// Code, severity, subject and words of the findings.
    fn findings(&self) -> Table {
        tables::findings(&self.result().findings)
    }

    /// Torque of states, state * joints + joint.
    fn predict<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray1<'py, f64>,
        qd: PyReadonlyArray1<'py, f64>,
        qdd: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Torque<'py>> {
        let (q, qd, qdd) = (owned(py, &q)?, owned(py, &qd)?, owned(py, &qdd)?);
        let fitted = Arc::clone(&self.fitted);
        let torque = Following::SILENTLY.run(py, move |_| {
            Ok(fitted.stored.calibration.twin.torque(&q, &qd, &qdd)?)
        })?;
        Ok((
            PyArray1::from_vec(py, torque.mean),
            PyArray1::from_vec(py, torque.low),
            PyArray1::from_vec(py, torque.high),
            PyArray1::from_vec(py, torque.outside),
        ))
    }

    /// Draws from the posterior: coefficients (draw * columns + column), variance φ and index of the model.
    fn draws<'py>(&self, py: Python<'py>, count: usize, seed: u64) -> PyResult<Draws<'py>> {
        let posterior = &self.result().twin.posterior;
        let draws = pool::detached(py, None, || {
            pool::require_memory("draws", &[count, posterior.mean.len().max(1)])?;
            Ok::<_, Problem>(draw(posterior, count, seed, STREAM))
        })?;
        Ok((
            PyArray1::from_vec(py, draws.beta),
            PyArray1::from_vec(py, draws.noise),
            PyArray1::from_vec(py, draws.models),
        ))
    }

    /// Names of the columns of the regression: terms that were not dropped.
    #[getter]
    fn column_names(&self) -> Vec<String> {
        let terms = self.result().terms.iter();
        let live = terms.filter(|own| own.pip.is_some());
        live.map(|own| own.term.name.clone()).collect()
    }

    /// Names of the components that have columns, and of each column the index of its component.
    #[getter]
    fn components(&self) -> (Vec<String>, Vec<usize>) {
        let result = self.result();
        let own = &result.twin.posterior.component;
        let mut known: Vec<usize> = own.clone();
        known.sort_unstable();
        known.dedup();
        let name = |column: usize| {
            let live = result
                .terms
                .iter()
                .filter(|own| own.pip.is_some())
                .nth(column);
            let component = live.and_then(|own| result.components.get(own.term.component));
            component.map_or(String::new(), |own| own.name.clone())
        };
        let first = |component: &usize| own.iter().position(|other| other == component);
        let names = known.iter().filter_map(first).map(name).collect();
        let index = |component: &usize| known.partition_point(|other| other < component);
        (names, own.iter().map(index).collect())
    }

    /// Families of these components.
    #[getter]
    fn families(&self) -> Vec<&'static str> {
        let (names, _) = self.components();
        let family = |name: &String| {
            let mut all = self.result().components.iter();
            all.find(|own| own.name == *name)
                .map_or("", |own| own.family.word())
        };
        names.iter().map(family).collect()
    }

    /// Laws of one coordinate that were found.
    fn curves<'py>(&self, py: Python<'py>) -> Vec<Law<'py>> {
        let curves = self.result().curves.iter();
        let law = |own: &twincal::calibrate::Curve| {
            let along = match own.along {
                Along::Position => "position",
                Along::Velocity => "velocity",
            };
            let array = |values: &[f64]| PyArray1::from_slice(py, values);
            (
                own.joint.clone(),
                along,
                own.components.clone(),
                array(&own.x),
                array(&own.mean),
                array(&own.low95),
                array(&own.high95),
            )
        };
        curves.map(law).collect()
    }

    /// Draws of measured torque at states, (draw * states + state) * joints + joint.
    fn predictive<'py>(
        &self,
        py: Python<'py>,
        states: [PyReadonlyArray1<'py, f64>; 3],
        count: usize,
        seed: u64,
    ) -> PyResult<Array<'py, f64>> {
        let [q, qd, qdd] = [&states[0], &states[1], &states[2]].map(|own| numbers(py, own));
        let motion = [q?, qd?, qdd?];
        let twin = &self.result().twin;
        let torque = pool::detached(py, None, || {
            let columns = twin.posterior.mean.len();
            pool::require_memory(
                "draws of torque",
                &[count, motion[0].len().max(columns).max(1)],
            )?;
            let draws = draw(&twin.posterior, count, seed, STREAM);
            Ok::<_, Problem>(twin.torque_model()?.draws(motion, &draws, seed)?)
        })?;
        Ok(PyArray1::from_vec(py, torque))
    }
}
