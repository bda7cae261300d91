//! The calibrated twin as a straight-line program: nominal dynamics, correction and interval in one list of steps that any
//! language can print.
//!
//! The mean of every inertial column goes into the bodies' parameters, so that one recursion gives nominal torque and all
//! inertial corrections; structure that is known beforehand (zeros, right angles) is folded away.

mod columns;
mod coordinates;
mod dynamics;
mod forgotten;
mod interval;
mod states;
mod trace;
#[cfg(test)]
mod tests;

pub use forgotten::forgotten;
pub(crate) use states::{STATES, States, rms};
pub use trace::Step;

use crate::error::{Error, Result};
use crate::robot::{Robot, regrouped};
use crate::term::{Library, ModelColumn};
use crate::twin::Twin;
use columns::{Columns, direction, nominal_parameters, parameters};
use interval::Interval;
use trace::{Id, Trace};

/// Coefficients whose torque stays below this in every state of the training range are left out, N·m.
const NOTHING: f64 = 1e-12;

/// What one joint needs beside the steps.
#[derive(Debug, Clone, PartialEq)]
pub struct EvaluatorJoint {
    /// Name.
    pub name: String,
    /// `N·m` or `N`.
    pub unit: &'static str,
    /// Training range with its margin, see [`Twin::limits`].
    pub limits: [f64; 6],
    /// The state is outside the data where the variance of xᵀβ exceeds this, (N·m)².
    pub noise: f64,
    /// Half width of the interval: `quantile · √(ratio · variance + base)`.
    pub base: f64,
}

/// A program: `torque[j]` and `variance[j]` are the steps that hold joint j's.
///
/// # Example
/// The program computes the torque that the twin predicts.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::evaluator::Evaluator;
///
/// # let fit = two_link::study()?;
/// let program = Evaluator::new(fit.twin(), None)?;
/// let (q, qd, qdd) = ([0.2, -0.4], [0.5, 0.3], [1.0, -1.0]);
/// let (torque, _) = program.evaluate(&q, &qd, &qdd);
/// let predicted = fit.twin().torque(&q, &qd, &qdd)?.mean;
/// assert!((0..2).all(|joint| (torque[joint] - predicted[joint]).abs() < 1e-9));
/// println!("{} steps", program.steps.len());
/// # Ok::<(), twincal::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluator {
    /// Joints in the twin's order.
    pub joints: Vec<EvaluatorJoint>,
    /// Steps, operands first.
    pub steps: Vec<Step>,
    /// Calibrated torque (model average).
    pub torque: Vec<u32>,
    /// Variance of the torque from coefficients and models, (N·m)²; rounding may leave it below 0.
    pub variance: Vec<u32>,
    /// Standard t quantile of the 95 % interval.
    pub quantile: f64,
    /// From the variance over noise levels to the square of the t scale: (a − 1)/a.
    pub ratio: f64,
    /// Inertial parameters and columns that the interval is made of; the others enter as a constant.
    pub kept: usize,
    /// Largest error of an end of the interval over 512 states within the training range, as a share of its width.
    pub interval_error: f64,
}

/// What a model file that was written already says, to be subtracted.
#[derive(Debug, Clone, Copy)]
pub struct Beyond<'a> {
    /// The robot of that file.
    pub robot: &'a Robot,
    /// Dry friction per joint, N·m; in the shape of the twin's Coulomb friction.
    pub friction: &'a [f64],
}

impl Evaluator {
    /// The program of a twin; with `beyond` of what it adds to a model file.
    ///
    /// # Errors
    /// Those of [`Twin::library`] and [`Twin::predictor`]; [`Error::Refused`] for a twin without a predictive variance.
    pub fn new(twin: &Twin, beyond: Option<Beyond<'_>>) -> Result<Self> {
        if twin.posterior.shape <= 1.0 {
            return Err(Error::Refused {
                problem: "so few rows that the noise has no variance".into(),
                remedy: "fit longer logs".into(),
            });
        }
        let library = twin.library()?;
        let states = States::new(twin, &library);
        let interval = Interval::new(twin, &library, &states)?;
        let mut t = Trace::default();
        let mut columns = Columns::new(&mut t, &twin.robot, &library);
        let mut torque = mean_torque(&mut t, &mut columns, twin, &states);
        if let Some(beyond) = beyond {
            let written = written_torque(&mut t, twin, beyond);
            torque = (torque.into_iter().zip(written))
                .map(|(all, written)| t.subtract(all, written))
                .collect();
        }
        let mut variance = interval.variance(&mut t, &mut columns);
        let steps = t.pruned(&mut [&mut torque, &mut variance]);
        let names = twin.robot.joint_names();
        Ok(Self {
            joints: (0..names.len())
                .map(|joint| EvaluatorJoint {
                    name: names[joint].to_owned(),
                    unit: twin.robot.joint_kind(joint).torque_unit(),
                    limits: twin.limits(joint),
                    noise: interval.noise[joint],
                    base: interval.base[joint],
                })
                .collect(),
            steps,
            torque,
            variance,
            quantile: interval.quantile,
            ratio: interval.ratio,
            kept: interval.count(),
            interval_error: interval.error,
        })
    }

    /// Torque and variance per joint at one state: what the printed programs compute, step by step.
    ///
    /// # Panics
    /// If a slice is shorter than the number of joints.
    #[must_use]
    pub fn evaluate(&self, q: &[f64], qd: &[f64], qdd: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let values = trace::values(&self.steps, q, qd, qdd);
        let pick = |ids: &[u32]| ids.iter().map(|&id| values[id as usize]).collect();
        (pick(&self.torque), pick(&self.variance))
    }
}

/// τ_nom + products + Φ E[β | y] per joint.
///
/// About a robot with effects θ* and drive gains 1 + g* that is τ(θ*) + (1 + g*) Σ (E[β] − θ*) columns + all others.
fn mean_torque(t: &mut Trace, columns: &mut Columns<'_>, twin: &Twin, states: &States) -> Vec<Id> {
    let (robot, library): (&Robot, &Library) = (columns.robot, columns.library);
    let has_gain = (0..robot.dof()).any(|joint| library.gain(joint) != 1.0);
    // One recursion for all that is rigid, where nothing of it is multiplied by a gain.
    let mut parameters = match has_gain {
        true => vec![[0.0; 10]; robot.layout().len()],
        false => parameters(robot),
    };
    let mut gravity = [0.0; 3];
    let mut others = Vec::new();
    for (column, &beta) in twin.posterior.mean.iter().enumerate() {
        let beta = beta - library.about(column);
        match library.model_column(column) {
            Some(ModelColumn::Inertia { body, weights }) => {
                for (parameter, weight) in parameters[*body].iter_mut().zip(weights) {
                    *parameter += beta * weight;
                }
            }
            Some(ModelColumn::Gravity { axis }) => gravity[*axis] += beta,
            _ if beta.abs() * states.largest(column) > NOTHING => others.push((column, beta)),
            _ => {}
        }
    }
    let mut loads = dynamics::loads(t, &columns.moving, &regrouped(robot, parameters));
    if gravity != [0.0; 3] {
        let tilt = columns.gravity_loads(t, gravity);
        loads = dynamics::together(t, &loads, &tilt);
    }
    let rigid = dynamics::torque(t, robot, &columns.moving, loads);
    let mut torque: Vec<Id> = if has_gain {
        let mut rigid: Vec<(usize, Id)> = rigid.into_iter().enumerate().collect();
        columns.times_gain(t, &mut rigid);
        let model = columns.nominal(t).into_iter().zip(rigid);
        model.map(|(a, (_, b))| t.add(a, b)).collect()
    } else {
        let passive = dynamics::passive(t, robot, &columns.moving);
        (rigid.into_iter().zip(passive))
            .map(|(a, b)| t.add(a, b))
            .collect()
    };
    for (column, beta) in others {
        for (joint, x) in columns.column(t, column) {
            let part = t.scale(beta, x);
            torque[joint] = t.add(torque[joint], part);
        }
    }
    torque
}

/// Torque of a model file: its dynamics and its dry friction.
fn written_torque(t: &mut Trace, twin: &Twin, beyond: Beyond<'_>) -> Vec<Id> {
    let robot = beyond.robot;
    let moving = dynamics::motion(t, robot, robot.description().gravity, true);
    let loads = dynamics::loads(t, &moving, &nominal_parameters(robot));
    let rigid = dynamics::torque(t, robot, &moving, loads);
    let passive = dynamics::passive(t, robot, &moving);
    let mut torque = Vec::with_capacity(rigid.len());
    for (joint, (rigid, passive)) in rigid.into_iter().zip(passive).enumerate() {
        let sum = t.add(rigid, passive);
        let rate = t.step(Step::Velocity(joint));
        let sense = direction(t, rate, twin.library.coulomb_velocity);
        let friction = t.scale(beyond.friction.get(joint).copied().unwrap_or(0.0), sense);
        torque.push(t.add(sum, friction));
    }
    torque
}
