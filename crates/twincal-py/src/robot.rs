//! Robots: model files in, torque and regressors of arrays out.

use crate::errors::Problem;
use crate::{pool, settings};
use numpy::{PyArray1, PyReadonlyArray1, PyReadwriteArray1};
use pyo3::prelude::*;
use rayon::prelude::*;
use std::path::PathBuf;
use twincal::robot::spatial::{apply, scale, transpose};
use twincal::robot::{
    BLOCK, Motion, PARAMETERS, Placement, Regressor, inverse_dynamics, nominal_torque,
    to_body_frame,
};
use twincal_cli::session::ModelInput;
use twincal_io::config::Config;

/// States that one thread takes at a time: three channels of seven joints stay in the cache of a core.
const CHUNK: usize = 496;
/// States below which one thread is faster than waking the others.
const FEW: usize = 4096;

/// A robot and the settings of [model] that it was read with.
#[pyclass(frozen, module = "twincal._twincal")]
#[derive(Debug, Clone)]
pub(crate) struct Robot {
    pub(crate) input: ModelInput,
    pub(crate) config: Config,
}

/// Arrays of positions, velocities and accelerations, state * joints + joint.
type States<'py> = [PyReadonlyArray1<'py, f64>; 3];

/// The numbers of contiguous arrays; the Python layer makes them so.
pub(crate) fn numbers<'a>(
    py: Python<'_>,
    array: &'a PyReadonlyArray1<'_, f64>,
) -> PyResult<&'a [f64]> {
    array
        .as_slice()
        .map_err(|_| Problem::Panicked("an array that is not contiguous".into()).raise(py))
}

/// A copy of the numbers, for a thread that may outlive the call.
pub(crate) fn owned(py: Python<'_>, array: &PyReadonlyArray1<'_, f64>) -> PyResult<Vec<f64>> {
    numbers(py, array).map(<[f64]>::to_vec)
}

#[pymethods]
impl Robot {
    /// Of a file, with settings of [model] as an object of JSON.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf, keywords: &str) -> PyResult<Self> {
        pool::detached(py, None, || {
            let config = settings::config(keywords)?;
            let input = ModelInput::read(&path, &config)?;
            Ok::<_, Problem>(Self { input, config })
        })
    }

    /// Of the text of a model.
    #[staticmethod]
    fn parse(py: Python<'_>, name: &str, text: &str, keywords: &str) -> PyResult<Self> {
        pool::detached(py, None, || {
            let config = settings::config(keywords)?;
            let input = ModelInput::parse(name, text, &config)?;
            Ok::<_, Problem>(Self { input, config })
        })
    }

    /// What the file calls it.
    #[getter]
    fn name(&self) -> &str {
        self.input.name()
    }

    /// Names of the moving joints.
    #[getter]
    fn joint_names(&self) -> Vec<&str> {
        self.input.robot().joint_names()
    }

    /// Units of their torque.
    #[getter]
    fn torque_units(&self) -> Vec<&'static str> {
        let robot = self.input.robot();
        (0..robot.dof())
            .map(|j| robot.joint_kind(j).torque_unit())
            .collect()
    }

    /// Names of the moving bodies.
    #[getter]
    fn bodies(&self) -> Vec<&str> {
        self.input.robot().bodies()
    }

    /// Names of the parameters of a body.
    #[getter]
    fn parameter_names(&self) -> Vec<&'static str> {
        PARAMETERS.to_vec()
    }

    /// Inertial parameters of the bodies in the frames of their links, body * 10 + parameter.
    fn parameters<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let robot = self.input.robot();
        let of_body = |(body, name): (usize, &str)| {
            let placement = robot
                .body_of_link(name)
                .map_or(Placement::IDENTITY, |own| own.1);
            let map = to_body_frame(&inverse(&placement));
            let own = robot.parameters_of_body(body);
            map.map(|row| row.iter().zip(&own).map(|(a, x)| a * x).sum::<f64>())
        };
        let all = robot.bodies().into_iter().enumerate().flat_map(of_body);
        PyArray1::from_vec(py, all.collect())
    }

    /// Code and words of what had to be assumed of the model.
    fn findings(&self) -> Vec<(String, String)> {
        let findings = self.input.findings().iter();
        findings
            .map(|own| (own.code.to_string(), own.message.clone()))
            .collect()
    }

    /// Torque of states, into an array that NumPy has allocated: unlike a `Vec` it has large pages.
    fn inverse_dynamics<'py>(
        &self,
        py: Python<'py>,
        states: States<'py>,
        out: PyReadwriteArray1<'py, f64>,
    ) -> PyResult<()> {
        fill(py, &states, out, |motion, tau| self.torque(motion, tau))
    }

    /// Regressor of states: state * joints * parameters + joint * parameters + body * 10 + parameter; likewise into an array of NumPy.
    fn regressor<'py>(
        &self,
        py: Python<'py>,
        states: States<'py>,
        out: PyReadwriteArray1<'py, f64>,
    ) -> PyResult<()> {
        fill(py, &states, out, |motion, values| {
            self.columns(motion, values);
        })
    }

    /// Refuses a regressor of so many numbers that the memory does not hold.
    fn require_regressor(&self, py: Python<'_>, numbers: usize) -> PyResult<()> {
        let parameters = 10 * self.input.robot().bodies().len();
        pool::require_memory("regressor", &[numbers, parameters]).map_err(|e| e.raise(py))
    }
}

/// Fills an array with what follows from positions, velocities and accelerations, while other threads of Python run.
fn fill<'py>(
    py: Python<'py>,
    states: &States<'py>,
    mut out: PyReadwriteArray1<'py, f64>,
    work: impl FnOnce([&[f64]; 3], &mut [f64]) + Send,
) -> PyResult<()> {
    let [q, qd, qdd] = [0, 1, 2].map(|own| numbers(py, &states[own]));
    let motion = [q?, qd?, qdd?];
    let out = out.as_slice_mut();
    let out = out.map_err(|e| Problem::Panicked(e.to_string()).raise(py))?;
    pool::detached(py, None, || {
        work(motion, out);
        Ok::<_, Problem>(())
    })
}

/// The outer frame, seen from a frame in it.
fn inverse(placement: &Placement) -> Placement {
    let rotation = transpose(&placement.rotation);
    Placement {
        rotation,
        translation: scale(-1.0, apply(&rotation, placement.translation)),
    }
}

/// From state * joints + joint to joint * len + state.
fn by_joint(values: &[f64], dof: usize, out: &mut [f64]) {
    let len = values.len() / dof;
    for (joint, own) in out.chunks_exact_mut(len).take(dof).enumerate() {
        let values = values[joint..].iter().step_by(dof);
        own.iter_mut()
            .zip(values)
            .for_each(|(to, from)| *to = *from);
    }
}

impl Robot {
    /// Torque of states, state * joints + joint; `tau` is as long as `q`.
    fn torque(&self, [q, qd, qdd]: [&[f64]; 3], tau: &mut [f64]) {
        let robot = self.input.robot();
        let dof = robot.dof();
        if q.len() == dof {
            let mut workspace = twincal::robot::Workspace::new(robot);
            return inverse_dynamics(robot, &mut workspace, q, qd, qdd, tau);
        }
        let size = CHUNK * dof;
        let chunk = |memory: &mut [Vec<f64>; 4], (number, out): (usize, &mut [f64])| {
            let (at, len) = (number * size..number * size + out.len(), out.len() / dof);
            let [own_q, own_qd, own_qdd, own_tau] = memory;
            for (own, all) in [(&mut *own_q, q), (own_qd, qd), (own_qdd, qdd)] {
                by_joint(&all[at.clone()], dof, own);
            }
            let motion = Motion {
                len,
                q: own_q,
                qd: own_qd,
                qdd: own_qdd,
            };
            nominal_torque(robot, motion, own_tau);
            for (joint, own) in own_tau.chunks_exact(len).take(dof).enumerate() {
                let out = out[joint..].iter_mut().step_by(dof);
                out.zip(own).for_each(|(to, from)| *to = *from);
            }
        };
        let memory = || [(); 4].map(|()| vec![0.0; size]);
        if q.len() <= FEW * dof {
            let mut own = memory();
            tau.chunks_mut(size)
                .enumerate()
                .for_each(|out| chunk(&mut own, out));
        } else {
            (tau.par_chunks_mut(size).enumerate()).for_each_init(memory, chunk);
        }
    }

    /// Regressor of states; `values` are all its numbers.
    fn columns(&self, [q, qd, qdd]: [&[f64]; 3], values: &mut [f64]) {
        let robot = self.input.robot();
        let dof = robot.dof();
        let parameters = 10 * robot.bodies().len();
        let regressor = Regressor::new(robot);
        let of_link = |name: &str| {
            let placement = robot
                .body_of_link(name)
                .map_or(Placement::IDENTITY, |own| own.1);
            to_body_frame(&placement)
        };
        let maps: Vec<_> = robot.bodies().into_iter().map(of_link).collect();
        let memory = || {
            let motion = [(); 3].map(|()| vec![0.0; BLOCK * dof]);
            (motion, regressor.block(robot))
        };
        let chunks = values.par_chunks_mut(BLOCK * dof * parameters).enumerate();
        chunks.for_each_init(memory, |(motion, block), (number, out)| {
            out.fill(0.0);
            let len = out.len() / (dof * parameters);
            let at = number * BLOCK * dof..(number * BLOCK + len) * dof;
            for (own, all) in motion.iter_mut().zip([q, qd, qdd]) {
                by_joint(&all[at.clone()], dof, own);
            }
            let motion = Motion {
                len,
                q: &motion[0],
                qd: &motion[1],
                qdd: &motion[2],
            };
            regressor.evaluate(robot, motion, 0..len, block);
            for (index, pair) in regressor.pairs().iter().enumerate() {
                let place = pair.coordinate * parameters + 10 * pair.body;
                for inner in (0..10).filter(|&k| pair.present[k]) {
                    let column = &block.column(index, inner)[..len];
                    // a column of the link's parameters is Σ_i Y_body[i] A[i][k]
                    let row = &maps[pair.body][inner];
                    for (state, value) in column.iter().enumerate() {
                        let at = state * dof * parameters + place;
                        let own = out[at..at + 10].iter_mut().zip(row);
                        own.for_each(|(sum, a)| *sum += value * a);
                    }
                }
            }
        });
    }
}
