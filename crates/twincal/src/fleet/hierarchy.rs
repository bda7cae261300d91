//! The regression behind a fleet: normal sums of every unit and window, and the plug-ins of the hierarchy over them.
//!
//! ```text
//! β_utk = μ_k + δ_uk + [t ≥ s_uc] b_uk + ε_utk,     k a column of component c, u a unit, t a window
//! z_c ∈ {0,1}   μ_k | z_c=1 ~ N(0, d_k), else 0                       what is wrong with the model file of all
//! δ_uk ~ N(0, ω_c² d_k)                                               scatter of units
//! ε_utk ~ N(0, ν_c² d_k)                                              scatter of windows: what no candidate describes differs with the motion
//! w_uc ∈ {0,1}  b_uk | w_uc=1 ~ N(0, g² d_k), g² one of SCALES        what one unit has more, from window s_uc on
//! ln p(y_ut | β) = −½ βᵀΛ_ut β + η_utᵀβ + constant
//! ```
//! s_uc is the unit's first window with probability 1/2, otherwise one of its later ones. d_k is the slab variance of a calibration; all
//! below is in units of √d_k, so that slabs are 1. ω_c, ν_c and the expected share of deviations π are plug-ins, learned from all units.

use crate::linear_algebra::Cholesky;
use crate::prior::Prior;

/// g²: variances of a deviation over that of the slab. Together they have the heavy tails of no scale that is known before.
pub(super) const SCALES: [f64; 4] = [1e-4, 2.5e-3, 6.25e-2, 1.5625];

/// Normal sums over the rows of one unit and window.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Window {
    /// Number of the window among all of the fleet.
    pub(super) index: usize,
    /// Λ, K × K row-major.
    pub(super) precision: Vec<f64>,
    /// η, K.
    pub(super) score: Vec<f64>,
}

/// The windows of one unit that have rows, in time.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct UnitSums {
    pub(super) windows: Vec<Window>,
}

/// All units and what is believed before their data.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Hierarchy {
    pub(super) units: Vec<UnitSums>,
    /// Prior of the type: slab 1 for every column, and the structure over components.
    pub(super) prior: Prior,
    /// Columns of each component of scatter and deviations; the type's prior may cut these finer.
    pub(super) columns: Vec<Vec<usize>>,
    /// Names of the columns, for messages.
    pub(super) names: Vec<String>,
    /// o_c: factor on π for each component; 0: it never deviates.
    pub(super) odds: Vec<f64>,
    pub(super) plug_in: Scatter,
}

/// Plug-ins of the hierarchy.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Scatter {
    /// ω_c².
    pub(super) variance: Vec<f64>,
    /// ν_c².
    pub(super) windows: Vec<f64>,
    /// π: probability that a unit deviates in a component with odds of 1.
    pub(super) share: f64,
}

impl Hierarchy {
    /// K.
    pub(super) fn size(&self) -> usize {
        self.names.len()
    }

    /// ω² of each column.
    pub(super) fn scatter(&self) -> Vec<f64> {
        self.by_column(&self.plug_in.variance)
    }

    /// ν² of each column.
    pub(super) fn window_scatter(&self) -> Vec<f64> {
        self.by_column(&self.plug_in.windows)
    }

    fn by_column(&self, variances: &[f64]) -> Vec<f64> {
        let mut of_columns = vec![0.0; self.size()];
        for (columns, variance) in self.columns.iter().zip(variances) {
            columns.iter().for_each(|&k| of_columns[k] = *variance);
        }
        of_columns
    }
}

/// What a unit says with scatter of windows and of units integrated out, for the starts of its windows.
///
/// ```text
/// R_t = (Λ_t + N⁻¹)⁻¹,  N = diag(ν²)          Λ̃_t = Λ_t − Λ_t R_t Λ_t,   η̃_t = η_t − Λ_t R_t η_t
/// A_s = Σ_{t≥s} Λ̃_t   E_s = Σ_{t≥s} η̃_t   P = (A_1 + D⁻¹)⁻¹,  D = diag(ω²)
/// g_s(μ) = E_s − A_s μ − A_s P (E_1 − A_1 μ)          score of a change from s on
/// H_ss'  = A_max(s,s') − A_s P A_s'                   its information
/// ```
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Unit {
    size: usize,
    /// A_s, start by start.
    after: Vec<Vec<f64>>,
    /// E_s.
    score: Vec<Vec<f64>>,
    /// P, K × K row-major.
    pub(super) posterior: Vec<f64>,
    /// ω² of each column.
    scatter: Vec<f64>,
}

impl Unit {
    pub(super) fn new(sums: &UnitSums, scatter: &[f64], of_windows: &[f64]) -> Self {
        let size = scatter.len();
        let (mut after, mut score) = (Vec::new(), Vec::new());
        let (mut precision, mut linear) = (vec![0.0; size * size], vec![0.0; size]);
        for window in sums.windows.iter().rev() {
            let (own, own_linear) = window.softened(of_windows);
            add(&mut precision, &own);
            add(&mut linear, &own_linear);
            after.push(precision.clone());
            score.push(linear.clone());
        }
        after.reverse();
        score.reverse();
        Self {
            size,
            posterior: scattered(&precision, scatter),
            scatter: scatter.to_vec(),
            after,
            score,
        }
    }

    /// Starts of windows: the first is that of the unit's data.
    pub(super) fn starts(&self) -> usize {
        self.after.len()
    }

    /// A_1 − A_1 P A_1, and E_1 − A_1 P E_1: what the unit says of μ where it does not deviate.
    pub(super) fn of_type(&self) -> (Vec<f64>, Vec<f64>) {
        let (after, score) = (&self.after[0], &self.score[0]);
        let gram = without(after, &self.posterior, &self.scatter);
        let spread = times(&self.posterior, score).into_iter().zip(&self.scatter);
        (gram, spread.map(|(x, variance)| x / variance).collect())
    }

    /// g_s(μ) of every start.
    pub(super) fn scores(&self, mu: &[f64]) -> Vec<Vec<f64>> {
        let left = self.left(0, mu);
        let shared = times(&self.posterior, &left);
        let moved: Vec<f64> = mu.iter().zip(&shared).map(|(mu, x)| mu + x).collect();
        (0..self.starts()).map(|s| self.left(s, &moved)).collect()
    }

    /// E_s − A_s x.
    fn left(&self, start: usize, x: &[f64]) -> Vec<f64> {
        let explained = times(&self.after[start], x);
        let score = self.score[start].iter();
        score.zip(explained).map(|(e, a)| e - a).collect()
    }

    /// H_{s·,(k,r)}: the information that every column from every start shares with column `k` from start `r`, start by start.
    pub(super) fn shared(&self, column: usize, start: usize) -> Vec<Vec<f64>> {
        let n = self.size;
        let own = &self.after[start][column * n..(column + 1) * n];
        let spread = times(&self.posterior, own);
        let of = |s: usize| {
            let later = &self.after[s.max(start)][column * n..(column + 1) * n];
            let explained = times(&self.after[s], &spread);
            later.iter().zip(explained).map(|(a, b)| a - b).collect()
        };
        (0..self.starts()).map(of).collect()
    }

    /// H_ss of some columns, row-major.
    pub(super) fn information(&self, columns: &[usize], start: usize) -> Vec<f64> {
        let n = self.size;
        let row = |&k: &usize| &self.after[start][k * n..(k + 1) * n];
        let spread: Vec<Vec<f64>> = (columns.iter())
            .map(|k| times(&self.posterior, row(k)))
            .collect();
        let of = |a: &usize| -> Vec<f64> {
            let of = |(b, spread): (&usize, &Vec<f64>)| row(a)[*b] - dot(row(a), spread);
            columns.iter().zip(&spread).map(of).collect()
        };
        columns.iter().flat_map(of).collect()
    }

    /// E[δ | μ] where `shift[s]` is what deviations that start at s add: P (E_1 − A_1 μ − Σ_s A_s shift_s).
    pub(super) fn offset(&self, mu: &[f64], shift: &[(usize, Vec<f64>)]) -> Vec<f64> {
        let mut left = self.left(0, mu);
        for (start, b) in shift {
            let explained = times(&self.after[*start], b);
            left.iter_mut().zip(explained).for_each(|(l, e)| *l -= e);
        }
        times(&self.posterior, &left)
    }
}

impl Window {
    /// Λ̃ = Λ − Λ R Λ and η̃ = η − Λ R η: what the window says of the unit, its own scatter integrated out.
    fn softened(&self, of_windows: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let spread = scattered(&self.precision, of_windows);
        let precision = without(&self.precision, &spread, of_windows);
        // 1 − Λ R = N⁻¹ R.
        let spread = times(&spread, &self.score).into_iter().zip(of_windows);
        (
            precision,
            spread.map(|(x, variance)| x / variance).collect(),
        )
    }

    /// E[ε | β], and how much of its prior variance the data leave to each ε_k, 0 to 1, with that of δ, P, in it:
    ///
    /// ```text
    /// E[ε] = R (η − Λ β)        (R + W P Wᵀ)_kk / ν_k²,   W = R Λ = 1 − R N⁻¹
    /// ```
    pub(super) fn scatter(
        &self,
        of_windows: &[f64],
        beta: &[f64],
        posterior: &[f64],
    ) -> (Vec<f64>, Vec<f64>) {
        let n = of_windows.len();
        let spread = scattered(&self.precision, of_windows);
        let explained = times(&self.precision, beta);
        let left: Vec<f64> = (self.score.iter().zip(explained))
            .map(|(own, less)| own - less)
            .collect();
        let share = |at: usize| {
            let unit = f64::from(u8::from(at / n == at % n));
            unit - spread[at] / of_windows[at % n]
        };
        let weights: Vec<f64> = (0..n * n).map(share).collect();
        let half = crate::linear_algebra::product(&weights, posterior, [n, n, n]);
        let open = (0..n).map(|k| {
            let row = k * n..(k + 1) * n;
            let of_unit = dot(&half[row.clone()], &weights[row]);
            (spread[k * n + k] + of_unit) / of_windows[k]
        });
        (times(&spread, &left), open.collect())
    }
}

/// Λ − Λ R Λ of R = (Λ + N⁻¹)⁻¹, as a sum of two positive semidefinite matrices: Wᵀ Λ W + Λ R N⁻¹ R Λ with W = 1 − R Λ = R N⁻¹. As a difference
/// it loses its sign to rounding where Λ is large, as of logs without noise.
fn without(precision: &[f64], spread: &[f64], variance: &[f64]) -> Vec<f64> {
    use crate::linear_algebra::{product, product_transposed};
    let n = variance.len();
    // R Λ row by row, and from it Λ R N⁻¹ R Λ = (N^-½ R Λ)ᵀ (N^-½ R Λ).
    let explained = product(spread, precision, [n, n, n]);
    let scaled: Vec<f64> = (0..n * n)
        .map(|at| explained[at % n * n + at / n] / variance[at % n].sqrt())
        .collect();
    // Wᵀ row by row: N⁻¹ R.
    let weights: Vec<f64> = (0..n * n)
        .map(|at| spread[at % n * n + at / n] / variance[at / n])
        .collect();
    let half = product(&weights, precision, [n, n, n]);
    let mut sum = product_transposed(&half, &weights, [n, n, n]);
    let more = product_transposed(&scaled, &scaled, [n, n, n]);
    (sum.iter_mut().zip(more)).for_each(|(sum, more)| *sum += more);
    // Products round each triangle in its own way.
    for i in 0..n {
        for k in 0..i {
            let mean = 0.5 * (sum[i * n + k] + sum[k * n + i]);
            (sum[i * n + k], sum[k * n + i]) = (mean, mean);
        }
    }
    sum
}

/// (Λ + D⁻¹)⁻¹ = D^½ (1 + D^½ Λ D^½)⁻¹ D^½, which small scatter does not harm.
fn scattered(precision: &[f64], scatter: &[f64]) -> Vec<f64> {
    let n = scatter.len();
    let root: Vec<f64> = scatter.iter().map(|variance| variance.sqrt()).collect();
    let mut matrix: Vec<f64> = (precision.iter().enumerate())
        .map(|(at, value)| value * root[at / n] * root[at % n])
        .collect();
    (0..n).for_each(|i| matrix[i * n + i] += 1.0);
    let mut inverse = factored(matrix, n).inverse();
    for (at, value) in inverse.iter_mut().enumerate() {
        *value *= root[at / n] * root[at % n];
    }
    inverse
}

/// Cholesky factor of a matrix that is positive definite but for rounding, which is added to its diagonal.
pub(super) fn factored(mut matrix: Vec<f64>, size: usize) -> Cholesky {
    for rounding in [1e-14, 1e-11, 1e-8] {
        match Cholesky::new(&matrix, size) {
            Ok(factor) => return factor,
            Err(_) => (0..size).for_each(|i| matrix[i * size + i] *= 1.0 + rounding),
        }
    }
    let largest = (0..size).map(|i| matrix[i * size + i]).fold(1.0, f64::max);
    (0..size).for_each(|i| matrix[i * size + i] += 1e-6 * largest);
    Cholesky::new(&matrix, size).expect("sums are finite and their rounding is smaller than this")
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    crate::linear_algebra::dot(a, b)
}

/// M x of a square matrix, row-major.
pub(super) fn times(matrix: &[f64], x: &[f64]) -> Vec<f64> {
    let n = x.len().max(1);
    matrix.chunks_exact(n).map(|row| dot(row, x)).collect()
}

fn add(sum: &mut [f64], more: &[f64]) {
    sum.iter_mut()
        .zip(more)
        .for_each(|(sum, more)| *sum += more);
}
