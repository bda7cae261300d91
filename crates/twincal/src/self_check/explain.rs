//! How much of each joint's torque the nominal model and passive friction explain, for one way to read the log.

use super::sample::Sample;
use crate::linear_algebra::Cholesky;
use crate::robot::{Motion, Robot, nominal_torque};

/// Fewest moving samples of a joint that say anything.
const FEWEST: usize = 40;
/// Velocity at which dry friction is taken as fully there, rad/s or m/s.
pub(super) const DRY: f64 = 0.02;
/// Share of the nominal torque's sd that a driven joint has at least.
const DRIVEN: f64 = 0.7;
/// Columns of the small regression: nominal torque, velocity, its sign, acceleration; behind them what gravity takes of the nominal
/// torque with the other sign, which a counterbalance adds.
const COLUMNS: usize = 5;
/// The nominal torque among them.
const NOMINAL: usize = 0;
/// The counterbalance among them.
const BALANCE: usize = 4;
/// Products of the columns and, last, the torque.
type Products = [[f64; COLUMNS + 1]; COLUMNS + 1];

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
    /// The same with the nominal torque as it is, its factor one, but for a counterbalance that takes a part of the weight.
    pub(super) left_as_modelled: f64,
    /// Factor at the nominal torque.
    pub(super) gain: f64,
    /// False for a joint that is moved by the others: it has far less torque than its motion needs. A drive that only damps it
    /// looks like friction with the wrong sign.
    pub(super) driven: bool,
    /// Sums of squares of the nominal and of the measured torque about their means.
    pub(super) sizes: [f64; 2],
    /// That of what gravity takes of the nominal torque.
    pub(super) gravity: f64,
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
    let mut gravity = nominal.clone();
    let still = &vec![0.0; dof * len][..];
    let (q, qd, qdd) = (&q[..], &qd[..], &qdd[..]);
    nominal_torque(robot, Motion { len, q, qd, qdd }, &mut nominal);
    let at_rest = Motion {
        len,
        q,
        qd: still,
        qdd: still,
    };
    nominal_torque(robot, at_rest, &mut gravity);
    (0..dof)
        .map(|joint| {
            let own = joint * len..(joint + 1) * len;
            let (from, factor) = reading.torque[joint];
            let moves = &sample.moves[reading.motion[joint].0];
            let [nominal, gravity] = [&nominal, &gravity].map(|torque| &torque[own.clone()]);
            let [qd, qdd] = [qd, qdd].map(|rates| &rates[own.clone()]);
            let tau = &sample.channels[3][from];
            let rows = (0..len).filter(|&i| moves[i]).map(|i| {
                let (v, torque) = (qd[i], factor * tau[i]);
                [nominal[i], v, (v / DRY).tanh(), qdd[i], -gravity[i], torque]
            });
            regress(rows)
        })
        .collect()
}

/// Rows are the columns, then the torque.
fn regress(rows: impl Iterator<Item = [f64; COLUMNS + 1]>) -> Option<Explained> {
    let mut count = 0;
    let mut mean = [0.0; COLUMNS + 1];
    let mut products: Products = [[0.0; COLUMNS + 1]; COLUMNS + 1];
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
    let rest = less_nominal(&products);
    let (mut best, mut without, mut as_modelled) = ((1.0, 0.0), 1.0_f64, 1.0_f64);
    for subset in 1..1_u32 << COLUMNS {
        let is_member = |column: usize| subset >> column & 1 == 1;
        let members: Vec<usize> = (0..COLUMNS)
            .filter(|&column| is_member(column) && products[column][column] > 0.0)
            .collect();
        if !is_member(BALANCE)
            && let Some((left, passive)) = solve(&products, &members)
        {
            if left < best.0 {
                let has_model = members[0] == NOMINAL;
                best = (left, if has_model { passive[0] } else { 0.0 });
            }
            if !is_member(NOMINAL) {
                without = without.min(left);
            }
        }
        if !is_member(NOMINAL)
            && let Some((left, passive)) = solve(&rest, &members)
        {
            let balanced = members.last() == Some(&BALANCE) && passive[members.len() - 1] > 1.0;
            if !balanced {
                as_modelled = as_modelled.min(left);
            }
        }
    }
    Some(Explained {
        left: best.0,
        left_without_model: without,
        left_as_modelled: as_modelled * rest[COLUMNS][COLUMNS] / total,
        gain: best.1,
        driven: total.sqrt() > DRIVEN * products[NOMINAL][NOMINAL].sqrt(),
        sizes: [products[NOMINAL][NOMINAL], total],
        gravity: products[BALANCE][BALANCE],
    })
}

/// The products with the measured torque less the nominal one.
fn less_nominal(products: &Products) -> Products {
    let mut rest = *products;
    for column in 0..COLUMNS {
        rest[column][COLUMNS] -= products[column][NOMINAL];
        rest[COLUMNS][column] = rest[column][COLUMNS];
    }
    let both = products[NOMINAL][COLUMNS];
    rest[COLUMNS][COLUMNS] += products[NOMINAL][NOMINAL] - 2.0 * both;
    rest
}

/// Share left and coefficients of the least-squares fit on `members`; `None` where a coefficient is negative or the columns are alike.
fn solve(products: &Products, members: &[usize]) -> Option<(f64, Vec<f64>)> {
    let n = members.len();
    let scale = |i: usize| products[i][i].sqrt();
    let correlation = |i: usize, j: usize| products[i][j] / (scale(i) * scale(j));
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
    for (coefficient, &member) in solution.iter_mut().zip(members) {
        *coefficient *= scale(COLUMNS) / scale(member);
    }
    Some(((1.0 - explained).max(0.0), solution))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// n, v, sign v, a and torque of a made-up joint.
    fn rows(torque: impl Fn(f64, f64, f64) -> f64) -> Vec<[f64; COLUMNS + 1]> {
        (0..200)
            .map(|i| {
                let t = 0.05 * f64::from(i);
                let (n, v, a) = ((0.7 * t).cos() * 5.0, (1.3 * t).sin(), (2.9 * t).cos());
                [n, v, (v / DRY).tanh(), a, -0.9 * n, torque(n, v, a)]
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
