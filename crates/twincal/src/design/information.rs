//! What rows of a motion say of independent columns: M = Σ Φᵀ W Φ.

use super::criterion::Criterion;
use super::spline::{SAMPLES, Spline, StateWeights};
use crate::excitation::{Reference, STATES, States, random_states, reference};
use crate::linear_algebra::{product, symmetric_eigen};
use crate::robot::Robot;
use crate::term::Library;

/// A column is independent of those chosen before it if so much of its power at random states is left, as a share.
const INDEPENDENT: f64 = 1e-6;
/// Information of every column before the motion, in rows: what keeps a matrix of few rows from being singular.
const BEFORE: f64 = 1e-6;

/// What a search maximises: a function of sums over the rows of a motion.
pub(super) trait Objective: Sync {
    /// K of the K × K sums.
    fn size(&self) -> usize;

    /// Sums over states of the motion.
    fn of(&self, states: &States) -> Vec<f64>;

    /// Sums over states that are recorded: without what the robot carries in the motion.
    fn of_recorded(&self, states: &States) -> Vec<f64> {
        self.of(states)
    }

    /// What is to be large, of sums over so many rows of a motion that lasts so long, s.
    fn value(&self, sums: &[f64], rows: f64, duration: f64) -> f64;

    /// ∂value/∂sums, K × K and symmetric; `None` where there is none.
    fn gradient(&self, sums: &[f64], rows: f64, duration: f64) -> Option<Vec<f64>>;

    /// tr(W · sums) of each state by itself.
    fn shown(&self, matrix: &[f64], states: &States) -> Vec<f64>;
}

/// Σ_j f_jᵀ W f_j of each state, f_j the row of joint j in some columns (ascending), each value times `factor(joint, column)`.
pub(super) fn quadratic(
    library: &Library,
    columns: &[usize],
    (matrix, states): (&[f64], &States),
    factor: impl Fn(usize, usize) -> f64,
) -> Vec<f64> {
    let (len, size, dof) = (states.len, columns.len(), library.joints());
    let mut out = vec![Vec::new(); dof];
    library.evaluate(states.motion(), &mut out);
    let mut shown = vec![0.0; len];
    for (joint, out) in out.iter().enumerate() {
        let (mut places, mut values) = (Vec::new(), Vec::new());
        let own = library.columns_of_joint(joint).iter();
        for (column, signal) in own.zip(out.chunks_exact(len.max(1))) {
            let Ok(at) = columns.binary_search(column) else {
                continue;
            };
            let factor = factor(joint, *column);
            places.push(at);
            values.extend(signal.iter().map(|value| factor * value));
        }
        let block: Vec<f64> = (places.iter())
            .flat_map(|&a| places.iter().map(move |&b| matrix[a * size + b]))
            .collect();
        let count = places.len();
        let weighed = product(&block, &values, [count, count, len]);
        for (values, weighed) in values
            .chunks_exact(len.max(1))
            .zip(weighed.chunks_exact(len.max(1)))
        {
            for ((shown, a), b) in shown.iter_mut().zip(values).zip(weighed) {
                *shown += a * b;
            }
        }
    }
    shown
}

/// Independent columns of a library, each of size 1 at random states, in torque of size 1 per joint.
pub(super) struct Information<'a> {
    library: &'a Library,
    reference: Reference<'a>,
    criterion: Criterion,
    /// The independent columns, ascending.
    pub(super) columns: Vec<usize>,
}

impl<'a> Information<'a> {
    pub(super) fn new(robot: &'a Robot, library: &'a Library) -> Self {
        let all = random_states(robot, STATES);
        let reference = reference(robot, library, &all);
        let shown: Vec<usize> = (0..library.columns().len())
            .filter(|&k| reference.size[k].is_finite() && reference.size[k] > 0.0)
            .collect();
        let power = reference.power(library, &shown, &all);
        let columns = independent(&power, shown.len())
            .into_iter()
            .map(|k| shown[k])
            .collect();
        Self {
            library,
            reference,
            criterion: Criterion::Determinant,
            columns,
        }
    }

    /// The same columns with another criterion.
    pub(super) fn maximising(self, criterion: Criterion) -> Self {
        Self { criterion, ..self }
    }

    /// ln det(M/n + ε): 0 for n rows that show every column like random states do, and none together with another.
    pub(super) fn log_determinant(&self, sums: &[f64], rows: f64) -> f64 {
        Criterion::Determinant.value(&self.of_a_row(sums, rows), self.size())
    }

    /// M/n + ε.
    fn of_a_row(&self, sums: &[f64], rows: f64) -> Vec<f64> {
        let size = self.size();
        let mut matrix: Vec<f64> = sums.iter().map(|x| x / rows).collect();
        (0..size).for_each(|k| matrix[k * size + k] += BEFORE);
        matrix
    }

    /// Largest over smallest singular value of the rows.
    pub(super) fn condition(&self, sums: &[f64]) -> f64 {
        let Some((values, _)) = symmetric_eigen(sums, self.size()) else {
            return f64::INFINITY;
        };
        let largest = values.iter().copied().fold(0.0, f64::max);
        let smallest = values.iter().copied().fold(f64::INFINITY, f64::min);
        (largest / smallest.max(0.0)).sqrt()
    }
}

impl Objective for Information<'_> {
    fn size(&self) -> usize {
        self.columns.len()
    }

    fn of(&self, states: &States) -> Vec<f64> {
        let mut sums = (self.reference).power(self.library, &self.columns, states);
        sums.iter_mut().for_each(|x| *x *= states.len as f64);
        sums
    }

    fn value(&self, sums: &[f64], rows: f64, _duration: f64) -> f64 {
        self.criterion
            .value(&self.of_a_row(sums, rows), self.size())
    }

    fn gradient(&self, sums: &[f64], rows: f64, _duration: f64) -> Option<Vec<f64>> {
        let matrix = self.of_a_row(sums, rows);
        let mut gradient = self.criterion.gradient(&matrix, self.size())?;
        gradient.iter_mut().for_each(|x| *x /= rows);
        Some(gradient)
    }

    fn shown(&self, matrix: &[f64], states: &States) -> Vec<f64> {
        let reference = &self.reference;
        let factor =
            |joint: usize, column: usize| reference.weight[joint].sqrt() / reference.size[column];
        quadratic(self.library, &self.columns, (matrix, states), factor)
    }
}

/// Columns whose part outside the span of those before is large enough: a pivoted Cholesky decomposition.
fn independent(power: &[f64], size: usize) -> Vec<usize> {
    let mut left: Vec<f64> = (0..size).map(|k| power[k * size + k]).collect();
    let own = left.clone();
    let (mut chosen, mut rows): (Vec<usize>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
    loop {
        let free = (0..size).filter(|k| !chosen.contains(k));
        let Some(best) = free.max_by(|&a, &b| left[a].total_cmp(&left[b]).then(b.cmp(&a))) else {
            break;
        };
        if left[best] <= INDEPENDENT * own[best] {
            break;
        }
        let root = left[best].sqrt();
        let row: Vec<f64> = (0..size)
            .map(|k| {
                let before: f64 = rows.iter().map(|row| row[best] * row[k]).sum();
                (power[best * size + k] - before) / root
            })
            .collect();
        (left.iter_mut().zip(&row)).for_each(|(left, x)| *left = (*left - x * x).max(0.0));
        rows.push(row);
        chosen.push(best);
    }
    chosen.sort_unstable();
    chosen
}

/// States of some spans of a motion, [`SAMPLES`] each.
pub(super) fn states_of(splines: &[Spline], spans: std::ops::Range<usize>) -> States {
    let len = spans.len() * SAMPLES;
    let mut states = States {
        len,
        still: vec![false; splines.len() * len],
        ..States::default()
    };
    let weights: [StateWeights; SAMPLES] = std::array::from_fn(StateWeights::of_sample);
    for spline in splines {
        for span in spans.clone() {
            for weights in &weights {
                let [q, qd, qdd] = spline.state(span, weights);
                states.q.push(q);
                states.qd.push(qd);
                states.qdd.push(qdd);
            }
        }
    }
    states
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of x, y and x + y two are independent; of a column without power nothing is left.
    #[test]
    fn dependent_columns_are_left_out() {
        let (x, y) = ([1.0, 0.0, 2.0], [0.0, 1.0, 1.0]);
        let columns = [x, y, [1.0, 1.0, 3.0], [0.0; 3]];
        let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let power: Vec<f64> = (columns.iter())
            .flat_map(|a| columns.iter().map(move |b| dot(a, b)))
            .collect();
        assert_eq!(independent(&power, 4).len(), 2);
    }
}
