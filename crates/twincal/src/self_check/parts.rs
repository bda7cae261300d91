//! The parts of the nominal torque along a sample of a log: gravity by direction, inertia, and what an unknown payload would add.

use super::sample::Sample;
use crate::robot::{Motion, Robot, nominal_torque};

/// Mass and distance of the point masses whose torques an unknown payload is made of, kg and m.
const POINT: (f64, f64) = (1.0, 0.1);
/// Fewest samples in motion that say anything.
const FEWEST: usize = 40;
/// Share of gravity's and inertia's power that is left in their sum where a joint is driven: of one that swings freely they cancel.
pub(super) const DRIVEN: f64 = 0.25;
/// Least nominal torque of a joint, as a share of the largest of all joints, that says whether it is driven.
const SAYS: f64 = 1e-3;
/// Unit gravity along x, y and z of the base.
const AXES: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Torque of every joint at every sample: `torque[joint][sample]`, N·m or N.
pub(super) type Torques = Vec<Vec<f64>>;

/// What the nominal torque consists of: `τ = Σ_k gravity_k · directions[k] + inertia + springs`.
pub(super) struct Parts {
    /// Torque per unit of gravity along x, y, z of the base, N·m per m/s².
    pub(super) directions: [Torques; 3],
    /// Torque of inertia, velocity products and damping.
    pub(super) inertia: Torques,
    /// Torque of the model's joint springs.
    pub(super) springs: Torques,
}

impl Parts {
    pub(super) fn of(robot: &Robot, sample: &Sample) -> Self {
        let motion = Flat::of(sample);
        let weightless = robot.with_gravity([0.0; 3]);
        let springs = motion.at_rest(&weightless);
        Self {
            directions: AXES.map(|axis| less(motion.at_rest(&robot.with_gravity(axis)), &springs)),
            inertia: less(motion.torque(&weightless), &springs),
            springs,
        }
    }

    /// Torque of this gravity, m/s² in the base frame.
    pub(super) fn gravity(&self, gravity: [f64; 3]) -> Torques {
        let [x, y, z] = &self.directions;
        let joints = x.iter().zip(y).zip(z);
        let of_joint = |((x, y), z): ((&Vec<f64>, &Vec<f64>), &Vec<f64>)| -> Vec<f64> {
            let samples = x.iter().zip(y).zip(z);
            samples
                .map(|((x, y), z)| gravity[0] * x + gravity[1] * y + gravity[2] * z)
                .collect()
        };
        joints.map(of_joint).collect()
    }
}

/// What point masses at the last link add to the torque of gravity and of inertia: their sums are what an unknown payload adds, but for its own
/// tensor. Empty where the model says that such a robot cannot be.
pub(super) fn payload(robot: &Robot, sample: &Sample) -> Vec<[Torques; 2]> {
    let Some(last) = robot.dof().checked_sub(1) else {
        return Vec::new();
    };
    let link = &robot.joint(last).child;
    let motion = Flat::of(sample);
    let (mass, away) = POINT;
    let both = |robot: &Robot| {
        let weight = motion.at_rest(robot);
        let inertia = less(motion.torque(robot), &weight);
        [weight, inertia]
    };
    let [weight, inertia] = both(robot);
    let places = [[0.0; 3]]
        .into_iter()
        .chain(AXES.map(|axis| axis.map(|x| away * x)));
    places
        .filter_map(|place| robot.carrying(link, mass, place).ok())
        .map(|carrying| {
            let [with_weight, with_inertia] = both(&carrying);
            [less(with_weight, &weight), less(with_inertia, &inertia)]
        })
        .collect()
}

/// Standard deviation of the torque that each joint's motion needs by the model; `None` for joints that hardly move, or swing freely: less
/// than this `share` of the variances of gravity and inertia is left of their sum.
pub(super) fn needed(
    sample: &Sample,
    parts: &Parts,
    gravity: &Torques,
    share: f64,
) -> Vec<Option<f64>> {
    let of_joint = |joint: usize| {
        let [sum, parts] = variances(sample, [&gravity[joint], &parts.inertia[joint]], joint);
        (sum > share * parts).then(|| sum.sqrt())
    };
    (0..gravity.len()).map(of_joint).collect()
}

/// The same of joints whose torque is not too small to tell.
pub(super) fn driven(
    sample: &Sample,
    parts: &Parts,
    gravity: &Torques,
    share: f64,
) -> Vec<Option<f64>> {
    let largest = needed(sample, parts, gravity, 0.0).into_iter().flatten();
    let least = SAYS * largest.fold(0.0, f64::max);
    let needed = needed(sample, parts, gravity, share).into_iter();
    needed.map(|sd| sd.filter(|sd| *sd > least)).collect()
}

/// Variance of gravity and inertia together, and the sum of theirs, while a joint moves.
fn variances(sample: &Sample, [gravity, inertia]: [&[f64]; 2], joint: usize) -> [f64; 2] {
    let moves = &sample.moves[joint];
    let rows: Vec<usize> = (0..sample.len).filter(|&i| moves[i]).collect();
    if rows.len() < FEWEST {
        return [0.0; 2];
    }
    let of = |part: &dyn Fn(usize) -> f64| spread(rows.iter().map(|&i| part(i)));
    let sum = of(&|i| gravity[i]) + of(&|i| inertia[i]);
    [of(&|i| gravity[i] + inertia[i]), sum]
}

fn spread(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / count;
    values.map(|x| (x - mean).powi(2)).sum::<f64>() / count
}

/// Motion with all joints in one slice, as the dynamics take it.
struct Flat {
    dof: usize,
    len: usize,
    rest: Vec<f64>,
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd: Vec<f64>,
}

impl Flat {
    fn of(sample: &Sample) -> Self {
        let [q, qd, qdd] = [0, 1, 2].map(|k: usize| sample.channels[k].concat());
        Self {
            dof: sample.channels[0].len(),
            len: sample.len,
            rest: vec![0.0; q.len()],
            q,
            qd,
            qdd,
        }
    }

    fn torque(&self, robot: &Robot) -> Torques {
        self.run(robot, &self.qd, &self.qdd)
    }

    fn at_rest(&self, robot: &Robot) -> Torques {
        self.run(robot, &self.rest, &self.rest)
    }

    fn run(&self, robot: &Robot, qd: &[f64], qdd: &[f64]) -> Torques {
        let (len, q) = (self.len, &self.q[..]);
        let mut torque = vec![0.0; self.dof * len];
        nominal_torque(robot, Motion { len, q, qd, qdd }, &mut torque);
        torque.chunks(len.max(1)).map(<[f64]>::to_vec).collect()
    }
}

/// One torque less another.
fn less(mut all: Torques, part: &Torques) -> Torques {
    for (all, part) in all.iter_mut().zip(part) {
        for (all, part) in all.iter_mut().zip(part) {
            *all -= part;
        }
    }
    all
}
