//! Coefficients that all joints share, with the friction of each joint projected out and errors that mind autocorrelation.
//!
//! ```text
//! τ_j(t) = Σ_k c_k x_kj(t) + viscous_j q̇_j + Coulomb_j tanh(q̇_j / DRY) + motor_j q̈_j + offset_j
//! ```
//! Rows of a joint are weighed by what its own coefficients would leave. Errors are those of 20 stretches of the log (cluster-robust): what a
//! model misses is slow, and rows of one stretch count as one.
//!
//! Source: Frisch & Waugh 1933 (projection); Liang & Zeger 1986 (cluster-robust covariance).

use super::explain::DRY;
use super::parts::Torques;
use super::sample::Sample;
use crate::linear_algebra::Cholesky;

/// Stretches of a log whose errors count as independent.
const STRETCHES: usize = 20;
/// Fewest moving samples of a joint that say anything.
const FEWEST: usize = 60;
/// Share of a joint's torque that counts as error whatever is explained: no model is better than that.
const MODEL_ERROR: f64 = 0.05;
/// Share of a column that no other column may explain: else its coefficient is that of a collinear column.
const OWN_SHARE: f64 = 1e-3;
/// Power of a column over that of the torque from which it would show.
const RULES: f64 = 0.1;
/// Share of a joint's torque from which friction shows.
const FRICTION: f64 = 0.2;
/// Ridge, as a share of a column's mean square: for columns that are not there at all.
const RIDGE: f64 = 1e-9;

/// A coefficient with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Estimate {
    pub(super) value: f64,
    pub(super) error: f64,
}

/// Standard errors from which something is concluded: with 19 degrees of freedom 1 in 1300 by chance.
pub(super) const CLEARLY: f64 = 4.0;

impl Estimate {
    pub(super) fn is_below(self, limit: f64) -> bool {
        self.value + CLEARLY * self.error < limit
    }

    pub(super) fn is_above(self, limit: f64) -> bool {
        self.value - CLEARLY * self.error > limit
    }
}

/// The shared coefficients of a sample.
pub(super) struct Shared {
    /// By column; `None` where the motion does not tell it from the others.
    pub(super) estimates: Vec<Option<Estimate>>,
    /// All of them, whether the motion tells them or not.
    pub(super) values: Vec<f64>,
    /// Factor at the first column of each joint whose torque it could rule, the other columns as they are shared.
    pub(super) alone: Vec<f64>,
    /// How many of the joints have friction or motor inertia in their torque, and how many there are.
    pub(super) with_friction: [usize; 2],
    /// Covariance of the first two columns.
    pub(super) covariance: f64,
    /// Information on the coefficients by row and column: inverse of the covariance for white errors of the joints' own size.
    pub(super) information: Vec<f64>,
}

/// Rows of one joint after projection.
struct Rows {
    /// Row-major, `columns` wide.
    matrix: Vec<f64>,
    torque: Vec<f64>,
    /// Which stretch each row is of.
    stretch: Vec<usize>,
    /// Power of the first column over that of the torque, before friction was projected out.
    rules: f64,
    /// Share of the torque that friction and motor inertia explain.
    friction: f64,
}

impl Rows {
    /// Factor at the first column, the others as they are; `None` where that column is small beside the torque, so that other errors are as large.
    fn alone(&self, values: &[f64]) -> Option<f64> {
        let (mut square, mut product) = (0.0, 0.0);
        for (row, torque) in self.matrix.chunks(values.len()).zip(&self.torque) {
            let others: f64 = row[1..].iter().zip(&values[1..]).map(|(x, c)| x * c).sum();
            square += row[0] * row[0];
            product += row[0] * (torque - others);
        }
        (self.rules > RULES && square > 0.0).then(|| product / square)
    }
}

/// Fits the shared coefficients of `columns`; `None` where no joint says anything.
/// `with` says which joints take part.
pub(super) fn fit(
    sample: &Sample,
    columns: &[&Torques],
    springs: &Torques,
    with: &[bool],
) -> Option<Shared> {
    let width = columns.len();
    let rows: Vec<Rows> = (0..with.len())
        .filter(|joint| with[*joint])
        .filter_map(|joint| of_joint(sample, columns, &springs[joint], joint))
        .collect();
    if rows.is_empty() || width == 0 {
        return None;
    }
    let (gram, right) = normal_equations(&rows, width);
    let solved = Solved::of(&gram, width)?;
    let values = solved.times(&right);
    let mut scores = vec![vec![0.0; width]; STRETCHES];
    for rows in &rows {
        let each = rows.matrix.chunks(width).zip(&rows.torque);
        for ((row, torque), stretch) in each.zip(&rows.stretch) {
            let left = torque - row.iter().zip(&values).map(|(x, c)| x * c).sum::<f64>();
            for (score, x) in scores[*stretch].iter_mut().zip(row) {
                *score += x * left;
            }
        }
    }
    let steps: Vec<Vec<f64>> = scores.iter().map(|score| solved.times(score)).collect();
    let inflation = STRETCHES as f64 / (STRETCHES - 1) as f64;
    let covariance =
        |i: usize, j: usize| inflation * steps.iter().map(|step| step[i] * step[j]).sum::<f64>();
    let estimates = (0..width).map(|k| {
        let is_told = gram[k * width + k] > 0.0 && solved.own_share(k) > OWN_SHARE;
        is_told.then(|| Estimate {
            value: values[k],
            error: covariance(k, k).sqrt(),
        })
    });
    Some(Shared {
        estimates: estimates.collect(),
        alone: rows.iter().filter_map(|rows| rows.alone(&values)).collect(),
        with_friction: [
            rows.iter().filter(|rows| rows.friction > FRICTION).count(),
            rows.len(),
        ],
        covariance: covariance(0, width.min(2) - 1),
        values,
        information: gram,
    })
}

/// Σ x xᵀ and Σ x τ over the rows of all joints.
fn normal_equations(rows: &[Rows], width: usize) -> (Vec<f64>, Vec<f64>) {
    let mut gram = vec![0.0; width * width];
    let mut right = vec![0.0; width];
    for rows in rows {
        for (row, torque) in rows.matrix.chunks(width).zip(&rows.torque) {
            for i in 0..width {
                right[i] += row[i] * torque;
                for j in 0..width {
                    gram[i * width + j] += row[i] * row[j];
                }
            }
        }
    }
    (gram, right)
}

/// A Gram matrix with columns of size one, solved.
struct Solved {
    scales: Vec<f64>,
    inverse: Vec<f64>,
}

impl Solved {
    fn of(gram: &[f64], width: usize) -> Option<Self> {
        let size = |k: usize| gram[k * width + k].sqrt();
        let scales: Vec<f64> = (0..width).map(|k| size(k).max(f64::MIN_POSITIVE)).collect();
        let mut matrix = gram.to_vec();
        for i in 0..width {
            for j in 0..width {
                matrix[i * width + j] /= scales[i] * scales[j];
            }
            matrix[i * width + i] += if size(i) > 0.0 { RIDGE } else { 1.0 };
        }
        let inverse = Cholesky::new(&matrix, width).ok()?.inverse();
        Some(Self { scales, inverse })
    }

    fn times(&self, right: &[f64]) -> Vec<f64> {
        let width = self.scales.len();
        let scaled: Vec<f64> = right.iter().zip(&self.scales).map(|(r, s)| r / s).collect();
        let row = |i: usize| &self.inverse[i * width..(i + 1) * width];
        (0..width)
            .map(|i| row(i).iter().zip(&scaled).map(|(a, b)| a * b).sum::<f64>() / self.scales[i])
            .collect()
    }

    /// Share of a column that the others do not explain.
    fn own_share(&self, k: usize) -> f64 {
        1.0 / self.inverse[k * self.scales.len() + k]
    }
}

/// Rows of a joint while it moves, friction projected out, weighed by its own error.
fn of_joint(sample: &Sample, columns: &[&Torques], springs: &[f64], joint: usize) -> Option<Rows> {
    let [_, qd, qdd, tau] = sample.channels.each_ref().map(|channel| &channel[joint]);
    let moving: Vec<usize> = (0..sample.len)
        .filter(|&i| sample.moves[joint][i])
        .collect();
    if moving.len() < FEWEST {
        return None;
    }
    let pick =
        |values: &dyn Fn(usize) -> f64| -> Vec<f64> { moving.iter().map(|&i| values(i)).collect() };
    let friction = [
        pick(&|_| 1.0),
        pick(&|i| qd[i]),
        pick(&|i| (qd[i] / DRY).tanh()),
        pick(&|i| qdd[i]),
    ];
    let friction = orthonormal(friction);
    let own: Vec<Vec<f64>> = columns
        .iter()
        .map(|column| project(&friction, pick(&|i| column[joint][i])))
        .collect();
    let measured = pick(&|i| tau[i] - springs[i]);
    let spread = variance(&measured);
    let rules = variance(&pick(&|i| columns[0][joint][i])) / spread;
    let mut torque = project(&friction, measured);
    if !(spread > 0.0 && spread.is_finite()) {
        return None;
    }
    let basis = orthonormal(own.clone());
    let friction = 1.0 - torque.iter().map(|x| x * x).sum::<f64>() / (torque.len() as f64 * spread);
    let left = project(&basis, torque.clone());
    let left = left.iter().map(|x| x * x).sum::<f64>() / left.len() as f64;
    let weight = 1.0 / (left + MODEL_ERROR.powi(2) * spread).sqrt();
    torque.iter_mut().for_each(|x| *x *= weight);
    let width = columns.len();
    let mut matrix = vec![0.0; width * moving.len()];
    for (k, column) in own.iter().enumerate() {
        for (row, x) in matrix.chunks_mut(width).zip(column) {
            row[k] = weight * x;
        }
    }
    let stretch = moving.iter().map(|i| i * STRETCHES / sample.len);
    Some(Rows {
        matrix,
        torque,
        stretch: stretch.collect(),
        rules,
        friction,
    })
}

/// Directions of unit length that span the columns (Gram–Schmidt, twice); what others span already is left out.
fn orthonormal(columns: impl IntoIterator<Item = Vec<f64>>) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for column in columns {
        let before = length(&column);
        let mut rest = project(&basis, project(&basis, column));
        let after = length(&rest);
        if after > 1e-7 * before && after > 0.0 {
            rest.iter_mut().for_each(|x| *x /= after);
            basis.push(rest);
        }
    }
    basis
}

/// What is left of a column beside the directions of a basis.
fn project(basis: &[Vec<f64>], mut column: Vec<f64>) -> Vec<f64> {
    for direction in basis {
        let along: f64 = direction.iter().zip(&column).map(|(a, b)| a * b).sum();
        for (x, a) in column.iter_mut().zip(direction) {
            *x -= along * a;
        }
    }
    column
}

fn length(column: &[f64]) -> f64 {
    column.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn variance(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / values.len() as f64
}
