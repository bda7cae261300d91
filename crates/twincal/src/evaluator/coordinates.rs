//! What the variance is a quadratic form in: regrouped inertial parameters, and the columns that are no inertia.
//!
//! Columns of a payload and of the link that carries it are nearly the same; each alone is unsure, their sum is not. In regrouped
//! parameters, which torque can tell apart, nothing cancels and what counts can be told one by one.

use super::columns::Columns;
use super::states::{STATES, States};
use super::trace::{Id, Trace, values};
use crate::robot::{Robot, regrouped};
use crate::term::{Library, ModelColumn};

/// Shares below this of a parameter's largest are rounding.
const ROUNDING: f64 = 1e-14;

/// One of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Coordinate {
    /// A regrouped parameter of a body, in the regressor's order.
    Parameter(usize, usize),
    /// A column of the library.
    Column(usize),
}

/// All of them, with the covariance of their coefficients.
#[derive(Debug, Clone)]
pub(super) struct Coordinates {
    pub(super) all: Vec<Coordinate>,
    /// N × N row-major.
    covariance: Vec<f64>,
}

impl Coordinates {
    /// From Cov[β | y], K × K: z = G β, Cov[z] = G Cov[β] Gᵀ.
    pub(super) fn new(robot: &Robot, library: &Library, beta: &[f64]) -> Self {
        let bodies = robot.layout().len();
        let columns = library.columns().len();
        let mut all = Vec::new();
        // Rows of G, `(column, share)`.
        let mut rows: Vec<Vec<(usize, f64)>> = Vec::new();
        let mut of_parameters = vec![Vec::new(); 10 * bodies];
        for column in 0..columns {
            let Some(ModelColumn::Inertia { body, weights }) = library.model_column(column) else {
                all.push(Coordinate::Column(column));
                rows.push(vec![(column, 1.0)]);
                continue;
            };
            let mut parameters = vec![[0.0; 10]; bodies];
            parameters[*body] = *weights;
            let shares = regrouped(robot, parameters);
            let largest = shares.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
            for (row, &share) in of_parameters.iter_mut().zip(shares.iter().flatten()) {
                if share.abs() > ROUNDING * largest {
                    row.push((column, share));
                }
            }
        }
        for (parameter, row) in of_parameters.into_iter().enumerate() {
            if !row.is_empty() {
                all.push(Coordinate::Parameter(parameter / 10, parameter % 10));
                rows.push(row);
            }
        }
        let entry = |a: &[(usize, f64)], b: &[(usize, f64)]| {
            let pairs = a.iter().flat_map(|a| b.iter().map(move |b| (a, b)));
            let parts = pairs.map(|(a, b)| a.1 * b.1 * beta[a.0 * columns + b.0]);
            parts.sum::<f64>()
        };
        let covariance = (rows.iter())
            .flat_map(|a| rows.iter().map(move |b| entry(a, b)))
            .collect();
        Self { all, covariance }
    }

    /// Covariance of two of them.
    pub(super) fn covariance(&self, a: usize, b: usize) -> f64 {
        self.covariance[a * self.all.len() + b]
    }

    /// Torque of one of them per unit: `(joint, step)` where it is not zero by structure.
    pub(super) fn torque(
        &self,
        t: &mut Trace,
        columns: &mut Columns<'_>,
        which: usize,
    ) -> Vec<(usize, Id)> {
        match self.all[which] {
            Coordinate::Column(column) => columns.column(t, column),
            Coordinate::Parameter(body, parameter) => {
                let mut unit = [0.0; 10];
                unit[parameter] = 1.0;
                let mut all = columns.inertia(t, body, &unit);
                all.retain(|(_, x)| t.value(*x) != Some(0.0));
                columns.times_gain(t, &mut all);
                all
            }
        }
    }

    /// What acts on each joint at all these states, one set after the other.
    pub(super) fn on_states(
        &self,
        robot: &Robot,
        library: &Library,
        sets: &[&States],
    ) -> Vec<Acting> {
        let mut acting = vec![Acting::default(); robot.dof()];
        let mut t = Trace::default();
        let mut columns = Columns::new(&mut t, robot, library);
        let mut steps: Vec<Vec<Id>> = vec![Vec::new(); robot.dof()];
        for (which, coordinate) in self.all.iter().enumerate() {
            if let Coordinate::Parameter(..) = coordinate {
                for (joint, x) in self.torque(&mut t, &mut columns, which) {
                    acting[joint].which.push(which);
                    steps[joint].push(x);
                }
            }
        }
        for (acting, steps) in acting.iter_mut().zip(&steps) {
            acting.torque = vec![Vec::new(); steps.len()];
        }
        for states in sets {
            for state in 0..STATES {
                let [q, qd, qdd] = states.state(state);
                let values = values(&t.steps, &q, &qd, &qdd);
                for (acting, steps) in acting.iter_mut().zip(&steps) {
                    for (torque, &x) in acting.torque.iter_mut().zip(steps) {
                        torque.push(values[x as usize]);
                    }
                }
            }
        }
        for (which, coordinate) in self.all.iter().enumerate() {
            let Coordinate::Column(column) = coordinate else {
                continue;
            };
            for (joint, acting) in acting.iter_mut().enumerate() {
                let torque: Vec<f64> = (sets.iter())
                    .filter_map(|states| states.column(joint, *column))
                    .flatten()
                    .copied()
                    .collect();
                if !torque.is_empty() {
                    acting.which.push(which);
                    acting.torque.push(torque);
                }
            }
        }
        acting
    }
}

/// What acts on one joint.
#[derive(Debug, Clone, Default)]
pub(super) struct Acting {
    /// Indices of coordinates.
    pub(super) which: Vec<usize>,
    /// Torque per unit and state, N·m.
    pub(super) torque: Vec<Vec<f64>>,
}
