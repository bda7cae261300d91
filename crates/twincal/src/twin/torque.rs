//! Torque of states that are given as arrays.

use super::{Predictor, TorqueSignal, Twin};
use crate::error::{Error, Result};
use crate::posterior::draws::CoefficientDraws;
use crate::random::Random;
use crate::rows::{RowBlock, RowSignal, visit_rows};
use crate::signal::{Payload, Pipeline, Segment, Trajectory};
use crate::term::Library;
use rayon::prelude::*;

/// States that one thread takes at a time.
const BATCH: usize = 4096;
/// Random stream of noise in draws of torque.
const NOISE_STREAM: u64 = (1 << 32) + 5;

/// Torque of some states, `state * joints + joint`, N·m or N.
///
/// # Example
/// Two states of two joints are four numbers, state by state.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// # let fit = two_link::study()?;
/// let (q, zeros) = ([0.1, 0.7, 0.3, -0.2], [0.0; 4]);
/// let torque = fit.twin().torque(&q, &zeros, &zeros)?;
/// let second = fit.twin().torque(&q[2..], &zeros[2..], &zeros[2..])?;
/// assert!((torque.mean[2] - second.mean[0]).abs() < 1e-9);
/// assert!((torque.high[3] - second.high[1]).abs() < 1e-9);
/// # Ok::<(), twincal::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Torque {
    /// Nominal torque plus the mean of what was found.
    pub mean: Vec<f64>,
    /// Lower end of the central 95 % interval of measured torque.
    pub low: Vec<f64>,
    /// Upper end.
    pub high: Vec<f64>,
    /// The joint is where the logs have not been, its torque is less certain than the noise, or no number (a term may have a pole).
    pub outside: Vec<bool>,
}

/// Torque of a twin, made ready once for any number of states.
///
/// # Example
/// One model serves many calls: the elbow's torque falls with the cosine of the arm's angle.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// # let fit = two_link::study()?;
/// let (model, rest) = (fit.twin().torque_model()?, [0.0, 0.0]);
/// let mut elbow = Vec::new();
/// for step in 0..4 {
///     let raised = [0.4 * f64::from(step), 0.0];
///     elbow.push(model.torque(&raised, &rest, &rest)?.mean[1]);
/// }
/// // 2.6 kg at 0.5 m, and 0.8 cos(q1 − q2) N·m
/// assert!((0..4).all(|step| (elbow[step] - (9.81 * 2.6 * 0.5 + 0.8) * (0.4 * step as f64).cos()).abs() < 0.05));
/// # Ok::<(), twincal::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct TorqueModel<'a> {
    twin: &'a Twin,
    library: Library,
    predictor: Predictor,
    /// As the twin's, but states are no log: nothing is filtered.
    pipeline: Pipeline,
}

impl Twin {
    /// Torque of states, each joint's position, velocity and acceleration, `state * joints + joint`: eq. (1) with the posterior of β.
    ///
    /// The robot carries what was found of an unknown payload, as in exported programs; a payload that a log stated as known is not carried. A
    /// state has no history: friction that remembers the motion slides steadily, friction that warms up is at the mean of the logs. For many
    /// calls make [`Twin::torque_model`] once.
    ///
    /// # Errors
    /// [`Error::Setting`] with the key `q`, `qd` or `qdd` where a length is no multiple of the joints, or differs, or a number is not finite;
    /// those of [`Twin::library`].
    ///
    /// # Example
    /// The arm at rest, stretched out: 3 kg at 0.5 m, in truth 2.6 kg at 1 m, and the hidden torque −0.8 and +0.8 N·m. Noise is 0.1 N·m.
    /// ```
    /// # #[path = "../../examples/two_link.rs"] mod two_link;
    /// # let fit = two_link::study()?;
    /// let rest = [0.0, 0.0];
    /// let torque = fit.twin().torque(&[0.0, 0.0], &rest, &rest)?;
    /// let truth = [9.81 * (3.0 * 0.5 + 2.6 * 1.0) - 0.8, 9.81 * 2.6 * 0.5 + 0.8];
    /// for joint in 0..2 {
    ///     assert!((torque.mean[joint] - truth[joint]).abs() < 0.05);
    ///     assert!(torque.low[joint] < truth[joint] && truth[joint] < torque.high[joint]);
    /// }
    /// # Ok::<(), twincal::Error>(())
    /// ```
    pub fn torque(&self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Result<Torque> {
        self.torque_model()?.torque(q, qd, qdd)
    }

    /// Makes everything ready that predictions of single states share.
    ///
    /// # Errors
    /// Those of [`Twin::library`] and [`Twin::predictor`].
    pub fn torque_model(&self) -> Result<TorqueModel<'_>> {
        let library = self.library()?;
        let predictor = self.predictor(&library)?;
        Ok(TorqueModel {
            predictor,
            library,
            pipeline: Pipeline {
                history: self.pipeline.history.clone(),
                coulomb_velocity: self.pipeline.coulomb_velocity,
                ..Pipeline::off(self.robot.dof())
            },
            twin: self,
        })
    }
}

impl TorqueModel<'_> {
    /// As [`Twin::torque`].
    ///
    /// # Errors
    /// [`Error::Setting`] with the key `q`, `qd` or `qdd`.
    pub fn torque(&self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Result<Torque> {
        let dof = self.twin.robot.dof();
        self.check(q, qd, qdd)?;
        let batches: Vec<usize> = (0..q.len()).step_by(BATCH * dof).collect();
        let parts: Vec<Torque> = (batches.into_par_iter())
            .map(|from| {
                let own = from..q.len().min(from + BATCH * dof);
                self.batch([&q[own.clone()], &qd[own.clone()], &qdd[own]])
            })
            .collect::<Result<_>>()?;
        let mut torque = Torque::default();
        for part in parts {
            torque.mean.extend(part.mean);
            torque.low.extend(part.low);
            torque.high.extend(part.high);
            torque.outside.extend(part.outside);
        }
        Ok(torque)
    }

    /// Draws of measured torque, `(draw * states + state) * joints + joint`: nominal torque, the effects with each draw's coefficients, and noise.
    ///
    /// Noise is independent from state to state, with the sd that the interval has; of one `seed` the result is the same on any number of threads.
    ///
    /// # Errors
    /// Those of [`Twin::torque`].
    ///
    /// # Example
    /// 19 of 20 draws of measured torque are inside its 95 % interval.
    /// ```
    /// # #[path = "../../examples/two_link.rs"] mod two_link;
    /// use twincal::posterior::draws::draw;
    ///
    /// # let fit = two_link::study()?;
    /// let (model, q, rest) = (fit.twin().torque_model()?, [0.3, -0.5], [0.0, 0.0]);
    /// let torque = model.torque(&q, &rest, &rest)?;
    /// let coefficients = draw(&fit.twin().posterior, 4000, 1, 0);
    /// let draws = model.draws([&q, &rest, &rest], &coefficients, 2)?;
    /// let shoulder: Vec<f64> = draws.iter().step_by(2).copied().collect();
    /// let inside = shoulder.iter().filter(|tau| (torque.low[0]..torque.high[0]).contains(*tau));
    /// assert!((inside.count() as f64 / 4000.0 - 0.95).abs() < 0.02);
    /// # Ok::<(), twincal::Error>(())
    /// ```
    pub fn draws(
        &self,
        [q, qd, qdd]: [&[f64]; 3],
        draws: &CoefficientDraws,
        seed: u64,
    ) -> Result<Vec<f64>> {
        self.check(q, qd, qdd)?;
        let dof = self.twin.robot.dof();
        let all = q.len();
        let mut torque = vec![0.0; draws.models.len() * all];
        let mut sd = vec![0.0; all];
        let mut put = |block: &RowBlock<'_>| {
            let joints = self.predictor.block(block, TorqueSignal::Raw);
            for (joint, (own, rows)) in joints.iter().zip(&block.joints).enumerate() {
                for (i, &row) in block.input_rows.iter().enumerate() {
                    let at = row * dof + joint;
                    sd[at] = own.noise[i];
                    let fixed = rows.nominal[i] + rows.products.get(i).copied().unwrap_or(0.0);
                    for (draw, beta) in draws.beta.chunks_exact(draws.columns).enumerate() {
                        let columns = rows.columns.iter().enumerate();
                        let found =
                            columns.map(|(k, &column)| beta[column] * rows.x[k * rows.stride + i]);
                        torque[draw * all + at] = fixed + found.sum::<f64>();
                    }
                }
            }
            Ok(())
        };
        let trajectory = self.trajectory([q, qd, qdd]);
        let (robot, library) = (&self.twin.robot, &self.library);
        let raw = RowSignal::Raw;
        visit_rows(robot, library, &self.pipeline, &trajectory, raw, &mut put)?;
        let mut random = Random::new(seed, NOISE_STREAM);
        for own in torque.chunks_exact_mut(all.max(1)) {
            own.iter_mut()
                .zip(&sd)
                .for_each(|(tau, sd)| *tau += sd * random.normal());
        }
        Ok(torque)
    }

    /// Refuses arrays that are no states of the robot.
    fn check(&self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Result<()> {
        let dof = self.twin.robot.dof();
        for (key, values) in [("q", q), ("qd", qd), ("qdd", qdd)] {
            if !values.len().is_multiple_of(dof) || values.len() != q.len() {
                let problem = format!(
                    "{} numbers; q has {} and the robot {dof} joints",
                    values.len(),
                    q.len()
                );
                return Err(Error::Setting {
                    key: key.into(),
                    problem,
                    remedy: "give every joint of every state: state * joints + joint".into(),
                });
            }
            if let Some(place) = values.iter().position(|value| !value.is_finite()) {
                return Err(Error::Setting {
                    key: key.into(),
                    problem: format!(
                        "{} for joint {} of state {place_of_state}",
                        values[place],
                        place % dof + 1,
                        place_of_state = place / dof
                    ),
                    remedy: "leave out states that are not known".into(),
                });
            }
        }
        Ok(())
    }

    fn batch(&self, motion: [&[f64]; 3]) -> Result<Torque> {
        let dof = self.twin.robot.dof();
        let count = motion[0].len() / dof;
        let trajectory = self.trajectory(motion);
        let mut torque = Torque {
            mean: vec![0.0; dof * count],
            low: vec![0.0; dof * count],
            high: vec![0.0; dof * count],
            outside: vec![false; dof * count],
        };
        let mut put = |block: &RowBlock<'_>| {
            let joints = self.predictor.block(block, TorqueSignal::Raw);
            for (joint, own) in joints.iter().enumerate() {
                for (i, &row) in block.input_rows.iter().enumerate() {
                    let at = row * dof + joint;
                    torque.mean[at] = own.calibrated[i];
                    torque.low[at] = own.low[i];
                    torque.high[at] = own.high[i];
                    torque.outside[at] = own.extrapolating[i] || !own.calibrated[i].is_finite();
                }
            }
            Ok(())
        };
        visit_rows(
            &self.twin.robot,
            &self.library,
            &self.pipeline,
            &trajectory,
            RowSignal::Raw,
            &mut put,
        )?;
        Ok(torque)
    }

    /// States as a trajectory without history.
    fn trajectory(&self, motion: [&[f64]; 3]) -> Trajectory {
        let dof = self.twin.robot.dof();
        let count = motion[0].len() / dof;
        let by_joint = |values: &[f64]| -> Vec<f64> {
            (0..dof)
                .flat_map(|joint| values.iter().skip(joint).step_by(dof).copied())
                .collect()
        };
        let [q, qd, qdd] = motion.map(by_joint);
        Trajectory {
            name: String::new(),
            dof,
            segments: vec![Segment {
                time: (0..count).map(|i| i as f64).collect(),
                input_rows: (0..count).collect(),
                logged: None,
                q,
                qd,
                qdd,
                tau: Vec::new(),
                standstill: vec![false; dof * count],
                history: vec![0.0; self.pipeline.channels() * dof * count],
                interval: 1.0,
                logged_interval: 1.0,
            }],
            payload: Payload::None,
            payload_acts: true,
        }
    }
}
