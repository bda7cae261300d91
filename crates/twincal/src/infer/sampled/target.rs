//! What is sampled: structure, coefficients, noise variances and autocorrelation, given the statistics of the rows.
//!
//! ```text
//! y_j = X_j β + ε_j,   ε_j stationary AR(1) with coefficient ρ_j and innovation variance σ_g², g the noise group of joint j
//! z ~ inclusion prior,   β_k | z_k=1 ~ N(0, s_k²) on β_k ≥ lower_k,   σ_g² ~ InvGamma(a0, b0),   ρ_j ~ U(−1, 1)
//! ```
//!
//! Unlike in [`crate::posterior::Problem`] the slab does not scale with the noise: several variances leave no single one
//! to scale with.

use super::planted::planted;
use crate::gram::JointGram;
use crate::prior::Prior;

/// Columns whose correlation under the likelihood exceeds this may stand for each other.
const ALIKE: f64 = 0.3;

/// See the module's text.
#[derive(Debug, Clone)]
pub(super) struct Target<'a> {
    /// Statistics of each joint.
    pub(super) grams: &'a [JointGram],
    /// Noise group of each joint.
    pub(super) group: Vec<usize>,
    /// (a0, b0) of each group, (N·m)².
    pub(super) noise: Vec<(f64, f64)>,
    /// ρ is sampled; otherwise 0.
    pub(super) autoregressive: bool,
    /// s_k, K.
    pub(super) slab: Vec<f64>,
    /// Inclusion, components and bounds.
    pub(super) prior: &'a Prior,
    /// Columns of each component.
    pub(super) columns: Vec<Vec<usize>>,
    /// Components that are never in without each.
    pub(super) children: Vec<Vec<usize>>,
    /// Pairs of free components between which exchanges are proposed.
    pub(super) pairs: Vec<(usize, usize)>,
}

impl<'a> Target<'a> {
    /// Pairs are told by the statistics at the given noise.
    pub(super) fn new(
        grams: &'a [JointGram],
        group: Vec<usize>,
        noise: Vec<(f64, f64)>,
        autoregressive: bool,
        slab: Vec<f64>,
        prior: &'a Prior,
        at: &Noise,
    ) -> Self {
        let mut target = Self {
            grams,
            group,
            noise,
            autoregressive,
            slab,
            prior,
            columns: prior.columns(),
            children: prior.children(),
            pairs: Vec::new(),
        };
        let (matrix, _) = target.precision(at);
        let size = target.size();
        let alike = |a: &usize, b: &usize| {
            let norm = (matrix[a * size + a] * matrix[b * size + b]).sqrt();
            matrix[a * size + b].abs() > ALIKE * norm
        };
        let columns = &target.columns;
        let free = |c: &usize| prior.lower[columns[*c][0]] == f64::NEG_INFINITY;
        for a in (0..columns.len()).filter(free) {
            for b in (0..a).filter(free) {
                if columns[a]
                    .iter()
                    .any(|i| columns[b].iter().any(|j| alike(i, j)))
                {
                    target.pairs.push((b, a));
                }
            }
        }
        target
    }

    /// K.
    pub(super) fn size(&self) -> usize {
        self.slab.len()
    }

    /// `I + Σ_j S X_jᵀ C_j⁻¹ X_j S` and `Σ_j S X_jᵀ C_j⁻¹ y_j`, S = diag(s): precision and right-hand side of β/s in the full
    /// model.
    pub(super) fn precision(&self, at: &Noise) -> (Vec<f64>, Vec<f64>) {
        let size = self.size();
        let (mut matrix, mut rhs) = (vec![0.0; size * size], vec![0.0; size]);
        for (j, gram) in self.grams.iter().enumerate() {
            let statistics = gram.stationary(planted!(9, at.rho[j], 0.0));
            let factor = 1.0 / at.variance[self.group[j]];
            let last = gram.columns.len();
            for (a, &row) in gram.columns.iter().enumerate() {
                let row = row as usize;
                let scale = factor * self.slab[row];
                for (b, &column) in gram.columns.iter().enumerate() {
                    let column = column as usize;
                    matrix[row * size + column] += scale * self.slab[column] * statistics.at(a, b);
                }
                rhs[row] += scale * statistics.at(a, last);
            }
        }
        (0..size).for_each(|k| matrix[k * size + k] += 1.0);
        (matrix, rhs)
    }

    /// Sums of squares of joint j's residual at β, from which `rᵀ C⁻¹ r` follows for every ρ.
    pub(super) fn squares(&self, joint: usize, beta: &[f64]) -> Squares {
        let gram = &self.grams[joint];
        let mut v: Vec<f64> = gram.columns.iter().map(|&k| -beta[k as usize]).collect();
        v.push(1.0);
        let form = |matrix: &crate::gram::Symmetric| -> f64 {
            let row = |i: usize| {
                let values = &matrix.values[i * matrix.size..(i + 1) * matrix.size];
                values.iter().zip(&v).map(|(m, x)| m * x).sum::<f64>()
            };
            let live = (0..v.len()).filter(|&i| v[i] != 0.0);
            live.map(|i| v[i] * row(i)).sum::<f64>().max(0.0)
        };
        Squares {
            all: form(&gram.s0),
            differences: form(&gram.d),
            ends: form(&gram.first) + form(&gram.last),
        }
    }
}

/// Noise at a moment of the chain.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Noise {
    /// Innovation variance σ_g² of each group, (N·m)².
    pub(super) variance: Vec<f64>,
    /// ρ_j.
    pub(super) rho: Vec<f64>,
}

/// `Σ r²`, `Σ (r_t − r_{t−1})²` and the squares at both ends of every run.
#[derive(Debug, Clone, Copy)]
pub(super) struct Squares {
    all: f64,
    differences: f64,
    ends: f64,
}

impl Squares {
    /// `rᵀ C⁻¹ r` at unit innovation variance, see [`JointGram::stationary`].
    pub(super) fn at(&self, rho: f64) -> f64 {
        (1.0 - rho) * (1.0 - rho) * self.all
            + rho * self.differences
            + planted!(6, rho * (1.0 - rho), 0.0) * self.ends
    }
}
