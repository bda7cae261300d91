//! Motion that is recorded already: what it shows the next one need not show again.
//!
//! ```text
//! M = M_new + (rows/T) T_old / n_old · Σ φ φᵀ        over n_old states of logs that last T_old
//! ```

use super::information::Objective;
use super::spline::{SAMPLES, SPAN};
use crate::error::{Finding, Result};
use crate::excitation::States;
use crate::incidents::{leave_out, motion};
use crate::robot::Robot;
use crate::signal::{Log, Pipeline, Raw, Trajectory, prepare};

/// States per second that are kept: as many as of a motion that is designed.
const RATE: f64 = SAMPLES as f64 / SPAN;
/// States that are kept at most: of longer logs every second, fourth … one.
const MOST: usize = 1 << 14;

/// Motion of logs that are recorded already.
#[derive(Debug, Clone, PartialEq)]
pub struct Recorded {
    /// Some of its states, evenly spread.
    pub states: States,
    /// How long it is, s: what filters and incidents cut away does not count.
    pub seconds: f64,
    /// Names of the logs, each with its seconds.
    pub logs: Vec<(String, f64)>,
}

impl Recorded {
    /// Its states and their seconds.
    pub(super) fn motion(&self) -> (&States, f64) {
        (&self.states, self.seconds)
    }

    /// The motion of logs as a pipeline filters it, and what was found on the way; their torque is not looked at.
    ///
    /// # Errors
    /// Those of [`motion`], and of chapters that cannot be read.
    pub fn new(
        robot: &Robot,
        pipeline: &Pipeline,
        logs: &[Log<'_>],
    ) -> Result<(Self, Vec<Finding>)> {
        let mut kept = Kept::new(robot.dof());
        let (mut findings, mut seconds) = (Vec::new(), Vec::new());
        for log in logs {
            let before = kept.seconds;
            let (trajectory, incidents, said) = motion(robot, pipeline, log)?;
            findings.extend(said);
            match log {
                Log::Whole(_) => kept.take(&trajectory),
                Log::Long(long) => long.visit(&mut Vec::new(), |_, chapter, _| {
                    let prepared = prepare(robot, chapter, pipeline)?;
                    let (mut part, _) = prepared.align(pipeline, Raw::None)?;
                    leave_out(pipeline, &mut part, &incidents);
                    kept.take(&part);
                    Ok(())
                })?,
            }
            seconds.push((log.name().to_owned(), kept.seconds - before));
        }
        let recorded = Self {
            seconds: kept.seconds,
            states: kept.into_states(),
            logs: seconds,
        };
        Ok((recorded, findings))
    }
}

/// States as they are collected, by joint.
struct Kept {
    q: Vec<Vec<f64>>,
    qd: Vec<Vec<f64>>,
    qdd: Vec<Vec<f64>>,
    still: Vec<Vec<bool>>,
    seconds: f64,
    /// From one state to the next, s, and when the next one is due.
    step: f64,
    due: f64,
}

impl Kept {
    fn new(dof: usize) -> Self {
        Self {
            q: vec![Vec::new(); dof],
            qd: vec![Vec::new(); dof],
            qdd: vec![Vec::new(); dof],
            still: vec![Vec::new(); dof],
            seconds: 0.0,
            step: 1.0 / RATE,
            due: 0.0,
        }
    }

    fn take(&mut self, trajectory: &Trajectory) {
        for segment in &trajectory.segments {
            let len = segment.time.len();
            for sample in 0..len {
                if self.seconds >= self.due {
                    for joint in 0..self.q.len() {
                        let at = joint * len + sample;
                        self.q[joint].push(segment.q[at]);
                        self.qd[joint].push(segment.qd[at]);
                        self.qdd[joint].push(segment.qdd[at]);
                        self.still[joint].push(segment.standstill[at]);
                    }
                    self.due += self.step;
                    self.thin();
                }
                self.seconds += segment.interval;
            }
        }
    }

    /// Of too many states every second one is left.
    fn thin(&mut self) {
        if self.q.first().map_or(0, Vec::len) <= MOST {
            return;
        }
        let values = [&mut self.q, &mut self.qd, &mut self.qdd];
        values.into_iter().flatten().for_each(every_second);
        self.still.iter_mut().for_each(every_second);
        self.step *= 2.0;
    }

    fn into_states(self) -> States {
        States {
            len: self.q.first().map_or(0, Vec::len),
            q: self.q.concat(),
            qd: self.qd.concat(),
            qdd: self.qdd.concat(),
            still: self.still.concat(),
        }
    }
}

fn every_second<T: Copy>(values: &mut Vec<T>) {
    *values = values.iter().copied().step_by(2).collect();
}

/// What is to be large of a motion and of what was recorded before it.
pub(super) struct Following<'a> {
    objective: &'a dyn Objective,
    /// Sums of one row per second.
    sums: Vec<f64>,
    seconds: f64,
}

impl<'a> Following<'a> {
    pub(super) fn new(objective: &'a dyn Objective, recorded: &Recorded) -> Self {
        let len = recorded.states.len.max(1) as f64;
        let mut sums = objective.of_recorded(&recorded.states);
        sums.iter_mut()
            .for_each(|sum| *sum *= recorded.seconds / len);
        Self {
            objective,
            sums,
            seconds: recorded.seconds,
        }
    }

    /// Sums over both, rows and duration; all at the density of the motion's rows.
    pub(super) fn both(&self, sums: &[f64], rows: f64, duration: f64) -> (Vec<f64>, f64, f64) {
        let density = rows / duration;
        let of_both = sums.iter().zip(&self.sums);
        (
            of_both.map(|(new, old)| new + density * old).collect(),
            rows + density * self.seconds,
            duration + self.seconds,
        )
    }
}

impl Objective for Following<'_> {
    fn size(&self) -> usize {
        self.objective.size()
    }

    fn of(&self, states: &States) -> Vec<f64> {
        self.objective.of(states)
    }

    fn of_recorded(&self, states: &States) -> Vec<f64> {
        self.objective.of_recorded(states)
    }

    fn value(&self, sums: &[f64], rows: f64, duration: f64) -> f64 {
        let (sums, rows, duration) = self.both(sums, rows, duration);
        self.objective.value(&sums, rows, duration)
    }

    fn gradient(&self, sums: &[f64], rows: f64, duration: f64) -> Option<Vec<f64>> {
        let (sums, rows, duration) = self.both(sums, rows, duration);
        self.objective.gradient(&sums, rows, duration)
    }

    fn shown(&self, matrix: &[f64], states: &States) -> Vec<f64> {
        self.objective.shown(matrix, states)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::information::Information;
    use crate::design::tests::{designed, library, short, stated};
    use crate::design::{DesignedMotion, Task, design, joint_limits};
    use crate::excitation::random_states;
    use crate::robot::testing::tree;
    use crate::signal::{Channels, Payload, Recording};

    /// A log of a motion, without torque.
    fn log(motion: &DesignedMotion) -> Recording {
        let of = |values: &[f64], joint: usize| {
            values[joint * motion.len..(joint + 1) * motion.len].to_vec()
        };
        Recording {
            unfolded: true,
            name: "first".into(),
            time: (0..motion.len).map(|k| k as f64 / motion.rate).collect(),
            start_ns: 0,
            joints: (0..motion.joints.len())
                .map(|joint| Channels {
                    q: of(&motion.q, joint),
                    qd: Some(of(&motion.qd, joint)),
                    qdd: Some(of(&motion.qdd, joint)),
                    tau: None,
                    temperature: None,
                })
                .collect(),
            payload: Payload::None,
        }
    }

    /// Rows that were recorded count as if the motion had them too, at any density of its rows.
    #[test]
    fn what_is_recorded_adds_up_with_the_motion() {
        let robot = tree();
        let library = library(&robot);
        let information = Information::new(&robot, &library);
        let all = random_states(&robot, 300);
        let part = |from: usize, to: usize| {
            let of = |values: &[f64]| -> Vec<f64> {
                values
                    .chunks(300)
                    .flat_map(|own| own[from..to].to_vec())
                    .collect()
            };
            States {
                len: to - from,
                q: of(&all.q),
                qd: of(&all.qd),
                qdd: of(&all.qdd),
                still: vec![false; robot.dof() * (to - from)],
            }
        };
        let recorded = Recorded {
            states: part(0, 200),
            seconds: 20.0,
            logs: Vec::new(),
        };
        let new = information.of(&part(200, 300));
        let following = Following::new(&information, &recorded);
        let wanted = information.value(&information.of(&all), 300.0, 30.0);
        let value = following.value(&new, 100.0, 10.0);
        assert!(
            (value - wanted).abs() < 1e-9 * wanted.abs(),
            "{value} {wanted}"
        );
        let denser: Vec<f64> = new.iter().map(|sum| 4.0 * sum).collect();
        let value = following.value(&denser, 400.0, 10.0);
        assert!(
            (value - wanted).abs() < 1e-9 * wanted.abs(),
            "{value} {wanted}"
        );
    }

    /// Of 8 s at 250 Hz 16 states a second; of ten million seconds no more than fit.
    #[test]
    fn states_are_spread_over_the_logs() {
        let robot = tree();
        let limits = joint_limits(&robot, &stated(&robot, None)).expect("limits");
        let motion = designed(&robot, &limits, &short())
            .expect("a motion")
            .motion;
        let mut own = log(&motion);
        let look = |own: &Recording| {
            let logs = [Log::from(own.clone())];
            let pipeline = Pipeline::off(robot.dof());
            Recorded::new(&robot, &pipeline, &logs)
                .expect("its motion")
                .0
        };
        let recorded = look(&own);
        assert!(
            (recorded.seconds - 8.004).abs() < 1e-6,
            "{}",
            recorded.seconds
        );
        assert!(
            recorded.states.len.abs_diff(128) <= 1,
            "{}",
            recorded.states.len
        );
        for (state, q) in recorded.states.q[..recorded.states.len].iter().enumerate() {
            let near = |value: &&f64| (**value - q).abs() < 1e-12;
            let at = motion.q[..motion.len].iter().position(|value| near(&value));
            let wanted = state as f64 / 16.0 * 250.0;
            assert!(at.is_some_and(|at| (at as f64 - wanted).abs() <= 1.0 || state == 0));
        }
        own.time.iter_mut().for_each(|t| *t *= 1e4);
        let long = look(&own);
        assert!(long.states.len <= MOST && long.seconds > 7.9e4);
        assert!(long.states.len > 1900, "every sample: {}", long.states.len);
    }

    /// A second motion that knows the first one shows more together with it than the first one twice.
    #[test]
    fn a_motion_after_a_log_shows_what_the_log_does_not() {
        let robot = tree();
        let limits = joint_limits(&robot, &stated(&robot, None)).expect("limits");
        let library = library(&robot);
        let of = |recorded| {
            let task = Task {
                robot: &robot,
                library: &library,
                questions: None,
                recorded,
                limits: &limits,
                torque: None,
                clearance: None,
            };
            design(&task, &short(), &|_| Ok(())).expect("a motion")
        };
        let alone = of(None);
        let logs = [Log::from(log(&alone.motion))];
        let pipeline = Pipeline::off(robot.dof());
        let (recorded, _) = Recorded::new(&robot, &pipeline, &logs).expect("its motion");
        let after = of(Some(&recorded));
        let information = Information::new(&robot, &library);
        let following = Following::new(&information, &recorded);
        let value = |motion: &DesignedMotion| {
            let states = States {
                len: motion.len,
                q: motion.q.clone(),
                qd: motion.qd.clone(),
                qdd: motion.qdd.clone(),
                still: vec![false; motion.q.len()],
            };
            following.value(&information.of(&states), motion.len as f64, 8.0)
        };
        let (twice, both) = (value(&alone.motion), value(&after.motion));
        assert!((twice - alone.log_determinant).abs() < 0.5, "{twice}");
        assert!((both - after.log_determinant).abs() < 0.2, "{both}");
        assert!(both > twice + 0.5, "{both} {twice}");
    }
}
