//! States within the training range: how large torques are there, without the logs.

use crate::robot::{Motion, Robot, nominal_torque};
use crate::term::Library;
use crate::twin::Twin;

/// How many.
pub(crate) const STATES: usize = 512;

/// Quasi-random states in the box of the training motion, and the library's columns there.
#[derive(Debug, Clone)]
pub(crate) struct States {
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd: Vec<f64>,
    /// `columns[joint][i * STATES + state]` of the i-th column of the joint.
    columns: Vec<Vec<f64>>,
    by_joint: Vec<Vec<usize>>,
    /// Torque that no coefficient moves beside the nominal, `joint * STATES + state`; empty where there is none.
    products: Vec<f64>,
}

impl States {
    pub(crate) fn new(twin: &Twin, library: &Library) -> Self {
        Self::at(twin, library, |fraction| fraction)
    }

    /// Corners of the box: every position, velocity and acceleration at an end of its range, by chance.
    pub(crate) fn corners(twin: &Twin, library: &Library) -> Self {
        Self::at(twin, library, f64::round)
    }

    fn at(twin: &Twin, library: &Library, place: impl Fn(f64) -> f64) -> Self {
        let joints = twin.robot.dof();
        let channel = |which: usize| -> Vec<f64> {
            let value = |joint: usize, state: usize| {
                let [low, high] = [twin.hull[joint][2 * which], twin.hull[joint][2 * which + 1]];
                // Kronecker sequence with square roots of primes: even in every projection.
                let step = (PRIMES[(3 * joint + which) % PRIMES.len()] as f64).sqrt();
                low + (high - low) * place(((state as f64 + 0.5) * step).fract())
            };
            (0..joints)
                .flat_map(|joint| (0..STATES).map(move |state| value(joint, state)))
                .collect()
        };
        let mut states = Self {
            q: channel(0),
            qd: channel(1),
            qdd: channel(2),
            columns: vec![Vec::new(); joints],
            by_joint: (0..joints)
                .map(|joint| library.columns_of_joint(joint).to_vec())
                .collect(),
            products: Vec::new(),
        };
        let mut columns = std::mem::take(&mut states.columns);
        library.evaluate(states.motion(), &mut columns);
        states.columns = columns;
        if library.has_products() {
            let none = vec![0.0; library.columns().len()];
            let nominal = states.nominal(&twin.robot);
            let constant = library.torque_with(&twin.robot, states.motion(), true, &none);
            states.products = constant.iter().zip(nominal).map(|(a, b)| a - b).collect();
        }
        states
    }

    /// The motion of all states.
    pub(crate) fn motion(&self) -> Motion<'_> {
        Motion {
            len: STATES,
            q: &self.q,
            qd: &self.qd,
            qdd: &self.qdd,
        }
    }

    /// Positions, velocities and accelerations of one state.
    pub(crate) fn state(&self, state: usize) -> [Vec<f64>; 3] {
        let of = |all: &[f64]| all.iter().skip(state).step_by(STATES).copied().collect();
        [of(&self.q), of(&self.qd), of(&self.qdd)]
    }

    /// Torque of products of effects, added to `torque`, `joint * STATES + state`.
    pub(crate) fn add_products(&self, torque: &mut [f64]) {
        for (torque, products) in torque.iter_mut().zip(&self.products) {
            *torque += products;
        }
    }

    /// Σ β x per joint and state, `joint * STATES + state`.
    pub(crate) fn torque(&self, beta: &[f64]) -> Vec<f64> {
        let mut torque = vec![0.0; self.q.len()];
        for (joint, columns) in self.by_joint.iter().enumerate() {
            let own = &mut torque[joint * STATES..(joint + 1) * STATES];
            for (i, &column) in columns.iter().enumerate() {
                let x = &self.columns[joint][i * STATES..(i + 1) * STATES];
                for (t, x) in own.iter_mut().zip(x) {
                    *t += beta[column] * x;
                }
            }
        }
        torque
    }

    /// Largest torque of a column on any joint, per unit of its coefficient.
    pub(crate) fn largest(&self, column: usize) -> f64 {
        let mut most = 0.0_f64;
        for (columns, x) in self.by_joint.iter().zip(&self.columns) {
            if let Ok(i) = columns.binary_search(&column) {
                let own = x[i * STATES..(i + 1) * STATES].iter();
                most = own.fold(most, |m, x| m.max(x.abs()));
            }
        }
        most
    }

    /// RMS of Σ β x per joint, N·m.
    pub(crate) fn rms(&self, beta: &[f64]) -> Vec<f64> {
        rms(&self.torque(beta))
    }

    /// Nominal torque of a robot, `joint * STATES + state`.
    pub(crate) fn nominal(&self, robot: &Robot) -> Vec<f64> {
        let mut torque = vec![0.0; self.q.len()];
        nominal_torque(robot, self.motion(), &mut torque);
        torque
    }

    /// Torque of a column on a joint at all states, where it acts there.
    pub(crate) fn column(&self, joint: usize, column: usize) -> Option<&[f64]> {
        let i = self.by_joint[joint].binary_search(&column).ok()?;
        Some(&self.columns[joint][i * STATES..(i + 1) * STATES])
    }

    /// Columns of a joint and their values, `[i * STATES + state]`.
    pub(crate) fn columns(&self, joint: usize) -> (&[usize], &[f64]) {
        (&self.by_joint[joint], &self.columns[joint])
    }
}

/// RMS per joint of values `joint * STATES + state`.
pub(crate) fn rms(torque: &[f64]) -> Vec<f64> {
    let mean = |own: &[f64]| own.iter().map(|x| x * x).sum::<f64>() / STATES as f64;
    torque
        .chunks_exact(STATES)
        .map(|own| mean(own).sqrt())
        .collect()
}

/// The first 72.
const PRIMES: [u16; 72] = [
    2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89, 97,
    101, 103, 107, 109, 113, 127, 131, 137, 139, 149, 151, 157, 163, 167, 173, 179, 181, 191, 193,
    197, 199, 211, 223, 227, 229, 233, 239, 241, 251, 257, 263, 269, 271, 277, 281, 283, 293, 307,
    311, 313, 317, 331, 337, 347, 349, 353, 359,
];
