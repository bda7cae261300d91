//! How much of each joint's torque the nominal model and passive friction explain, for one way to read the log.

use super::sample::Sample;
use crate::linear_algebra::Cholesky;
use crate::robot::{Motion, Robot, nominal_torque};

/// Fewest moving samples of a joint that say anything.
const FEWEST: usize = 40;
/// Velocity at which dry friction is taken as fully there, rad/s or m/s.
const DRY: f64 = 0.02;
/// Share of the nominal torque's sd that a driven joint has at least.
const DRIVEN: f64 = 0.7;
/// Columns of the small regression: nominal torque, velocity, its sign, acceleration.
const COLUMNS: usize = 4;

/// Which channel of the log is which of the model: joint j of the model reads `motion[j]` and `torque[j]`, each a joint
/// of the log and a factor.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Reading {
    /// Of position, velocity and acceleration; the factor is that of position, and of acceleration where that was derived from it.
    pub(super) motion: Vec<(usize, f64)>,
    /// Factor of velocity, and of acceleration where that is its change.
    pub(super) rates: Vec<f64>,
    /// Of torque.
    pub(super) torque: Vec<(usize, f64)>,
}

impl Reading {
    /// The log as it stands.
    pub(super) fn as_logged(dof: usize) -> Self {
        let own: Vec<(usize, f64)> = (0..dof).map(|joint| (joint, 1.0)).collect();
        Self {
            motion: own.clone(),
            rates: vec![1.0; dof],
            torque: own,
        }
    }
}

/// What explains one joint's torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Explained {
    /// Share of the torque's variance that is left.
    pub(super) left: f64,
    /// The same without the nominal torque: friction and motor inertia alone.
    pub(super) left_without_model: f64,
    /// Factor at the nominal torque.
    pub(super) gain: f64,
    /// False for a joint that is moved by the others: it has far less torque than its motion needs. A drive that only damps it
    /// looks like friction with the wrong sign.
    pub(super) driven: bool,
    /// Sums of squares of the nominal and of the measured torque about their means.
    pub(super) sizes: [f64; 2],
}

/// Least squares of each joint's torque on its nominal torque, velocity, sign of velocity and acceleration, with a free
/// offset and coefficients that may not be negative: friction takes energy, motors have inertia. Torque that is read with
/// the wrong sign or of the wrong joint therefore stays unexplained. `None` for joints that say nothing.
pub(super) fn explain(robot: &Robot, sample: &Sample, reading: &Reading) -> Vec<Option<Explained>> {
    let (dof, len) = (robot.dof(), sample.len);
    let [q, qd, qdd] = [0, 1, 2].map(|k| -> Vec<f64> {
        let joints = reading.motion.iter().zip(&reading.rates);
        joints
            .flat_map(|(&(from, position), &rates)| {
                let with_position = k == 0 || k == 2 && sample.follows[from] < 0.0;
                let factor = if with_position { position } else { rates };
                sample.channels[k][from].iter().map(move |v| factor * v)
            })
            .collect()
    });
    let mut nominal = vec![0.0; dof * len];
    let (q, qd, qdd) = (&q[..], &qd[..], &qdd[..]);
    nominal_torque(robot, Motion { len, q, qd, qdd }, &mut nominal);
    (0..dof)
        .map(|joint| {
            let own = joint * len..(joint + 1) * len;
            let (from, factor) = reading.torque[joint];
            let moves = &sample.moves[reading.motion[joint].0];
            let rows = nominal[own.clone()]
                .iter()
                .zip(&qd[own.clone()])
                .zip(&qdd[own])
                .zip(&sample.channels[3][from])
                .zip(moves)
                .filter(|(_, moves)| **moves)
                .map(|((((n, v), a), tau), _)| [*n, *v, (v / DRY).tanh(), *a, factor * tau]);
            regress(rows)
        })
        .collect()
}

/// Rows are the columns, then the torque.
fn regress(rows: impl Iterator<Item = [f64; COLUMNS + 1]>) -> Option<Explained> {
    let mut count = 0;
    let mut mean = [0.0; COLUMNS + 1];
    let mut products = [[0.0; COLUMNS + 1]; COLUMNS + 1];
    // Welford's update: no cancellation.
    for row in rows {
        count += 1;
        let before: [f64; COLUMNS + 1] = std::array::from_fn(|i| row[i] - mean[i]);
        for (mean, before) in mean.iter_mut().zip(before) {
            *mean += before / f64::from(count);
        }
        for i in 0..=COLUMNS {
            for j in 0..=COLUMNS {
                products[i][j] += before[i] * (row[j] - mean[j]);
            }
        }
    }
    let total = products[COLUMNS][COLUMNS];
    if (count as usize) < FEWEST || !(total.is_finite() && total > 0.0) {
        return None;
    }
    let scale: [f64; COLUMNS + 1] = std::array::from_fn(|i| products[i][i].sqrt());
    let (mut best, mut without) = ((1.0, 0.0), 1.0_f64);
    for subset in 1..1_u32 << COLUMNS {
        let members: Vec<usize> = (0..COLUMNS)
            .filter(|&i| subset >> i & 1 == 1 && scale[i] > 0.0)
            .collect();
        let Some((left, gain)) = solve(&products, &scale, &members) else {
            continue;
        };
        if left < best.0 {
            best = (left, gain);
        }
        if !members.contains(&0) {
            without = without.min(left);
        }
    }
    Some(Explained {
        left: best.0,
        left_without_model: without,
        gain: best.1,
        driven: scale[COLUMNS] > DRIVEN * scale[0],
        sizes: [products[0][0], total],
    })
}

/// Share left and factor at column 0 of the least-squares fit on `members`; `None` where a coefficient is negative or the
/// columns are alike.
fn solve(
    products: &[[f64; COLUMNS + 1]; COLUMNS + 1],
    scale: &[f64; COLUMNS + 1],
    members: &[usize],
) -> Option<(f64, f64)> {
    let n = members.len();
    let correlation = |i: usize, j: usize| products[i][j] / (scale[i] * scale[j]);
    let mut matrix = Vec::with_capacity(n * n);
    for &i in members {
        matrix.extend(members.iter().map(|&j| correlation(i, j)));
    }
    let right: Vec<f64> = members.iter().map(|&i| correlation(i, COLUMNS)).collect();
    let mut solution = right.clone();
    Cholesky::new(&matrix, n).ok()?.solve(&mut solution);
    let passive = solution.iter().all(|b| *b >= 0.0);
    if n == 0 || !passive {
        return None;
    }
    let explained: f64 = solution.iter().zip(&right).map(|(b, r)| b * r).sum();
    let gain = match members[0] {
        0 => solution[0] * scale[COLUMNS] / scale[0],
        _ => 0.0,
    };
    Some(((1.0 - explained).max(0.0), gain))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// n, v, sign v, a and torque of a made-up joint.
    fn rows(torque: impl Fn(f64, f64, f64) -> f64) -> Vec<[f64; 5]> {
        (0..200)
            .map(|i| {
                let t = 0.05 * f64::from(i);
                let (n, v, a) = ((0.7 * t).cos() * 5.0, (1.3 * t).sin(), (2.9 * t).cos());
                [n, v, (v / DRY).tanh(), a, torque(n, v, a)]
            })
            .collect()
    }

    #[test]
    fn a_passive_joint_is_explained_with_its_gain_and_an_active_one_is_not() {
        let said = regress(rows(|n, v, a| 2.5 * n + 0.3 * v + 0.1 * a - 7.0).into_iter()).unwrap();
        assert!(
            said.left < 1e-12 && (said.gain - 2.5).abs() < 1e-9,
            "{said:?}"
        );
        assert!(said.left_without_model > 0.9, "{said:?}");
        // the same with the sign of the torque turned: no coefficient that may not be negative helps
        let said = regress(rows(|n, v, a| -2.5 * n - 0.3 * v - 0.1 * a).into_iter()).unwrap();
        assert!(said.left > 0.9, "{said:?}");
        assert_eq!(regress(rows(|_, _, _| 1.0).into_iter()), None);
        assert_eq!(regress(rows(|n, _, _| n).into_iter().take(30)), None);
    }
}
