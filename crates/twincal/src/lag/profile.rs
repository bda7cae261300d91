//! Sums of products of one piece of a log, and the share of torque's changes that is left at every lag.

use crate::linear_algebra::Cholesky;

/// Columns of the regression.
pub(super) const COLUMNS: usize = 6;
/// Added to the diagonal of the columns' correlations: alike columns share instead of dividing by zero.
const RIDGE: f64 = 1e-6;
/// Fewest samples in motion, per column.
const SAMPLES_PER_COLUMN: f64 = 20.0;

/// Sums of products of one joint in one piece; lags from −reach to reach.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Products {
    /// Samples in motion.
    count: f64,
    /// Columns with columns.
    xx: [[f64; COLUMNS]; COLUMNS],
    /// Columns with torque, `xy[column][lag]`.
    xy: [Vec<f64>; COLUMNS],
    /// Torque with itself.
    yy: Vec<f64>,
}

impl Products {
    /// `columns` are 0 where `moves` is; `changes` begin `reach` samples before them and end as many after.
    pub(super) fn new(
        columns: &[Vec<f64>; COLUMNS],
        moves: &[f64],
        changes: &[f64],
        reach: usize,
    ) -> Self {
        let lags = 2 * reach + 1;
        let mut products = Self {
            count: moves.iter().sum(),
            xx: [[0.0; COLUMNS]; COLUMNS],
            xy: std::array::from_fn(|_| vec![0.0; lags]),
            yy: vec![0.0; lags],
        };
        for (i, moves) in moves.iter().enumerate() {
            let window = &changes[i..i + lags];
            for (sum, y) in products.yy.iter_mut().zip(window) {
                *sum += moves * y * y;
            }
            for (a, xy) in products.xy.iter_mut().enumerate() {
                let x = columns[a][i];
                for (sum, y) in xy.iter_mut().zip(window) {
                    *sum += x * y;
                }
                for (sum, other) in products.xx[a].iter_mut().zip(columns) {
                    *sum += x * other[i];
                }
            }
        }
        products
    }
}

/// Share of the changes that is left at every lag, over all parts but one; `None` with too little motion.
pub(super) fn left(parts: &[&Products], without: Option<usize>) -> Option<Vec<f64>> {
    let lags = parts.first()?.yy.len();
    let mut sum = Products {
        count: 0.0,
        xx: [[0.0; COLUMNS]; COLUMNS],
        xy: std::array::from_fn(|_| vec![0.0; lags]),
        yy: vec![0.0; lags],
    };
    for (_, part) in parts
        .iter()
        .enumerate()
        .filter(|(i, _)| Some(*i) != without)
    {
        sum.count += part.count;
        let add = |to: &mut [f64], from: &[f64]| {
            to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
        };
        add(&mut sum.yy, &part.yy);
        for a in 0..COLUMNS {
            add(&mut sum.xy[a], &part.xy[a]);
            add(&mut sum.xx[a], &part.xx[a]);
        }
    }
    let live: Vec<usize> = (0..COLUMNS).filter(|&a| sum.xx[a][a] > 0.0).collect();
    let n = live.len();
    let moves = sum.count >= SAMPLES_PER_COLUMN * COLUMNS as f64;
    if n == 0 || !moves || sum.yy.iter().any(|yy| yy.is_nan() || *yy <= 0.0) {
        return None;
    }
    let size: Vec<f64> = live.iter().map(|&a| sum.xx[a][a].sqrt()).collect();
    let mut matrix = vec![0.0; n * n];
    for (i, &a) in live.iter().enumerate() {
        for (j, &b) in live.iter().enumerate() {
            matrix[i * n + j] = sum.xx[a][b] / (size[i] * size[j]);
        }
        matrix[i * n + i] += RIDGE;
    }
    let factor = Cholesky::new(&matrix, n).ok()?;
    let mut right = vec![0.0; n];
    let left = |lag: usize| {
        for (i, &a) in live.iter().enumerate() {
            right[i] = sum.xy[a][lag] / size[i];
        }
        factor.solve_lower(&mut right);
        let explained: f64 = right.iter().map(|v| v * v).sum();
        (1.0 - explained / sum.yy[lag]).max(0.0)
    };
    Some((0..lags).map(left).collect())
}

/// Where the curve is lowest, in parts of a step; `None` at an end.
pub(super) fn lowest(curve: &[f64]) -> Option<f64> {
    let at = (0..curve.len()).min_by(|a, b| curve[*a].total_cmp(&curve[*b]))?;
    if at == 0 || at + 1 == curve.len() {
        return None;
    }
    let (before, here, after) = (curve[at - 1], curve[at], curve[at + 1]);
    let bend = before - 2.0 * here + after;
    let part = if bend > 0.0 {
        0.5 * (before - after) / bend
    } else {
        0.0
    };
    Some(at as f64 + part)
}
