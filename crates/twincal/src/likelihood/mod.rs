//! Which rows count how much: iid, tempered and AR(1) noise, plug-ins by fixed point (method section 5).

mod spread;
mod structure;

pub use spread::{Profile, Spread};

use crate::error::Result;
use crate::gram::{Gram, JointGram};
use crate::posterior::Problem;
use crate::prior::{HalfSpace, Prior, PriorSettings};
use crate::signal::Auto;
use crate::term::Family;
use serde::{Deserialize, Serialize};

/// `[noise] model`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoiseModel {
    /// Independent rows (the paper's).
    Iid,
    /// Independent rows, statistics divided by max(τ_j, λ_j).
    Tempered,
    /// First-order autoregression per joint.
    Ar1,
}

/// `[noise]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseSettings {
    /// Likelihood.
    pub model: NoiseModel,
    /// One variance per joint; false: all w_j = 1 and one ρ.
    pub per_joint: bool,
    /// Outliers count less: Student-t weights of rows; with [`NoiseModel::Tempered`] only.
    pub robust: bool,
    /// The noise of a joint may change with its speed; with [`NoiseModel::Tempered`] only.
    pub varies_with_speed: bool,
    /// The noise of a joint may change with the size of its nominal torque; with [`NoiseModel::Tempered`] only.
    pub varies_with_load: bool,
}

impl NoiseSettings {
    /// True where a row's weight depends on the row.
    pub fn weighs_rows(&self) -> bool {
        self.robust || self.varies_with_speed || self.varies_with_load
    }
}

/// Plug-in noise of one joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointNoise {
    /// Joint name.
    pub joint: String,
    /// √E[φ/(w_j(1−ρ_j²)) | y], with ar1 what the row filter leaves of it, N·m or N; the root mean square over the training rows where it changes with speed or load.
    pub sigma: f64,
    /// Root mean square of what the posterior mean leaves of the training rows, as the fit weighs them, N·m or N. Above `sigma` where few rows count as
    /// independent: the mean is then shrunk by more than the noise asks for. 0 in twins of programs before it was kept.
    #[serde(default)]
    pub training_rmse: f64,
    /// AR(1) coefficient; 0 unless `ar1`.
    pub rho: f64,
    /// w_j; n_j-weighted geometric mean 1.
    pub weight: f64,
    /// Rows.
    pub n: f64,
    /// Rows after tempering: n/max(τ_j, λ_j); with ar1 p n(1−ρ)/(1+ρ), p the share of frequencies that the row filter passes.
    pub n_eff: f64,
    /// Integrated autocorrelation time τ_j of the residual, rows; with `noise.robust` times what weighing rows costs (≥ 1).
    pub autocorrelation_time: f64,
    /// λ_j: rows that count as one because of what no candidate describes, at least 1; 1 unless `tempered`.
    #[serde(default = "one")]
    pub misfit: f64,
    /// Factor on the noise part of intervals: with `tempered` from left-out blocks, with `ar1` what the row filter leaves, else 1.
    pub interval_factor: f64,
    /// sd of the torque outside the filter's band, measured on the training residual, N·m; 0 with the filter off.
    pub out_of_band: f64,
    /// How the noise in the band changes with the joint's speed and load.
    #[serde(default)]
    pub spread: Spread,
}

impl JointNoise {
    /// Rows of the residual that count as one independent row, at least 1: τ_j, with ar1 (1+ρ)/(1−ρ).
    pub fn memory(&self) -> f64 {
        let rho = self.rho.clamp(-0.999_999, 0.999_999);
        (self.autocorrelation_time * (1.0 + rho) / (1.0 - rho)).max(1.0)
    }
}

/// Plug-in estimates of a likelihood: with these given, exact enumeration and Gibbs share one target.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlugIn {
    /// w_j, n_j-weighted geometric mean 1.
    pub weight: Vec<f64>,
    /// ρ_j; 0 unless `ar1`.
    pub rho: Vec<f64>,
    /// τ_j ≥ 1 in rows; 1 unless `tempered`.
    pub autocorrelation_time: Vec<f64>,
    /// λ_j ≥ 1: rows that count as one because of what no candidate describes; 1 (or empty) unless `tempered`.
    #[serde(default)]
    pub misfit: Vec<f64>,
    /// What one row counts where an autoregression knows of the row filter: the share of frequencies that passes; 1 unless `ar1`.
    #[serde(default = "one")]
    pub passed: f64,
    /// Variance of the rows over φ/(w_j(1−ρ_j²)), likewise; 1 (or empty) unless `ar1`.
    #[serde(default)]
    pub variance: Vec<f64>,
    /// v of each family, in the order of [`Columns::families`].
    pub scaled_variance: Vec<f64>,
    /// φ that turns the prior sd of a physical coefficient into its slab variance; 0 until a first fit has told it.
    pub noise: f64,
    /// How large a payload is.
    #[serde(default)]
    pub payload: PayloadSize,
}

/// The slab of a payload beside its prior sd, and what other slabs that it might have add to its prior odds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PayloadSize {
    /// s: the slab's sd is s times the prior sd.
    pub scale: f64,
    /// Mean evidence over all s as a factor on that of this one.
    pub odds: f64,
}

impl Default for PayloadSize {
    fn default() -> Self {
        Self {
            scale: 1.0,
            odds: 1.0,
        }
    }
}

impl PayloadSize {
    /// The prior of a problem as it was before the data chose a size.
    pub(crate) fn undone(self, prior: &Prior, columns: &Columns) -> Prior {
        let mut prior = prior.clone();
        for (k, slab) in prior.slab.iter_mut().enumerate() {
            if columns.is_payload(k) {
                *slab /= self.scale * self.scale;
            }
        }
        if let Some(payload) = columns.place_of(Family::Payload) {
            prior.odds[payload] /= self.odds;
        }
        prior
    }
}

fn one() -> f64 {
    1.0
}

/// The columns of a regression, as the likelihood needs them.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    /// Names, K.
    pub names: Vec<String>,
    /// Component of each column (0..C), K.
    pub component: Vec<usize>,
    /// Index in `families` of each component's family, C.
    pub family: Vec<usize>,
    /// Families that occur.
    pub families: Vec<Family>,
    /// Prior sd of each coefficient where physics says one (`slab` is then sd²/φ); `None`: v of the family, learned, K.
    pub prior_sd: Vec<Option<f64>>,
    /// Least value of each coefficient; −∞ where any is allowed, K.
    pub lower: Vec<f64>,
    /// Components that are in, whatever the data say, with those that they need; empty: none, C.
    pub forced: Vec<bool>,
    /// Component without which each is never in; empty: none, C.
    pub parent: Vec<Option<usize>>,
    /// Components whose torque another one, more usual, has in every motion: rare before the data; empty: none, C.
    pub second_choice: Vec<bool>,
    /// All rows come from one log.
    pub one_motion: bool,
    /// Bounds on sums of coefficients.
    pub halves: Vec<HalfSpace>,
}

impl Columns {
    /// Index in `families` of a column's family.
    pub fn family_of(&self, column: usize) -> usize {
        self.family[self.component[column]]
    }

    /// Whether a column is of the payload.
    pub(crate) fn is_payload(&self, column: usize) -> bool {
        self.families[self.family_of(column)].is_payload()
    }

    /// Index in `families` of a family.
    pub(crate) fn place_of(&self, family: Family) -> Option<usize> {
        self.families.iter().position(|own| *own == family)
    }

    /// What a column's prior variance is multiplied with to be v: the mean of rms² over the columns of its component, so
    /// that a direction that the data hardly see stays as narrow as its neighbours. For a column that is a component of
    /// its own that is its mean square (method section 6). A shape that is at most 1 counts as if it were 1 on a hundredth of
    /// its joint's rows at least ([`Family::fades`]).
    pub fn references(&self, grams: &Gram, weight: &[f64]) -> Vec<f64> {
        let mut square = mean_squares(grams, self.names.len(), weight);
        let rows = |(joint, w): (&JointGram, &f64)| joint.n * w;
        let all: f64 = grams.joints.iter().zip(weight).map(rows).sum();
        for (joint, w) in grams.joints.iter().zip(weight) {
            for &column in &joint.columns {
                let column = column as usize;
                if self.families[self.family_of(column)].fades() {
                    let least = LEAST_SHARE * rows((joint, w)) / all.max(f64::MIN_POSITIVE);
                    square[column] = square[column].max(least);
                }
            }
        }
        let components = self.family.len();
        let (mut sum, mut count) = (vec![0.0; components], vec![0.0; components]);
        for (&component, square) in self.component.iter().zip(&square) {
            sum[component] += square;
            count[component] += 1.0;
        }
        let mean = |&component: &usize| sum[component] / count[component];
        self.component.iter().map(mean).collect()
    }
}

impl PlugIn {
    /// Where the fixed point starts: equal weights, white noise, `v` for every family.
    pub fn start(joints: usize, families: usize, v: f64) -> Self {
        Self {
            weight: vec![1.0; joints],
            rho: vec![0.0; joints],
            autocorrelation_time: vec![1.0; joints],
            misfit: vec![1.0; joints],
            passed: 1.0,
            variance: vec![1.0; joints],
            scaled_variance: vec![v; families],
            noise: 0.0,
            payload: PayloadSize::default(),
        }
    }

    /// What the statistics of a joint are multiplied with: w_j / max(τ_j, λ_j).
    pub fn factor(&self, joint: usize) -> f64 {
        self.weight[joint] * self.temper(joint)
    }

    /// What one row of a joint's statistics counts: 1 / max(τ_j, λ_j).
    pub fn temper(&self, joint: usize) -> f64 {
        let misfit = self.misfit.get(joint).copied().unwrap_or(1.0);
        1.0 / self.autocorrelation_time[joint].max(misfit)
    }

    /// What the row count of a joint is multiplied with: with `ar1` the filter leaves fewer independent rows than there are, and φ is the
    /// level of their innovations where it passes.
    pub fn counted(&self, joint: usize) -> f64 {
        self.passed * self.temper(joint)
    }
}

/// Mean square of each column over all rows of all joints, zeros included, weighted by w (method section 6), K.
///
/// ```text
/// rms_k² = Σ_j w_j S0_j[k,k] / Σ_j w_j n_j
/// ```
pub fn mean_squares(grams: &Gram, columns: usize, weight: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; columns];
    let mut rows = 0.0;
    for (joint, w) in grams.joints.iter().zip(weight) {
        rows += w * joint.n;
        for (i, &column) in joint.columns.iter().enumerate() {
            sum[column as usize] += w * joint.s0.values[i * joint.s0.size + i];
        }
    }
    sum.iter()
        .map(|s| if rows > 0.0 { s / rows } else { 0.0 })
        .collect()
}

/// The weighted regression and its prior: all that inference sees.
///
/// ```text
/// G = Σ_j w_j/t_j G_j(ρ_j)    n = Σ_j p n_j/t_j,   t_j = max(τ_j, λ_j)    v_k = v_family / r_k, or s² sd_k² / φ
/// ```
/// with r_k of [`Columns::references`] and p of [`PlugIn::passed`]. s is 1 but for a payload ([`PayloadSize`]). A prior sd that physics says gives way to a scale that the user gives.
///
/// # Errors
/// [`crate::Error::Setting`] if the prior's numbers are impossible for K columns.
pub fn assemble(
    grams: &Gram,
    columns: &Columns,
    plug_in: &PlugIn,
    settings: &PriorSettings,
) -> Result<Problem> {
    let sums = WeightedSums::of(grams, columns.names.len(), plug_in);
    let unexplained = scale_of_residual(sums.yy / sums.n.max(f64::MIN_POSITIVE));
    let noise = if plug_in.noise > 0.0 {
        plug_in.noise
    } else {
        unexplained
    };
    let learned = settings.scaled_variance == Auto::Auto;
    let slab = columns
        .references(grams, &plug_in.weight)
        .iter()
        .enumerate()
        .map(|(k, reference)| {
            let slab = match columns.prior_sd[k] {
                Some(sd) if learned => {
                    let scale = match columns.is_payload(k) {
                        true => plug_in.payload.scale,
                        false => 1.0,
                    };
                    scale * scale * sd * sd / noise
                }
                _ => plug_in.scaled_variance[columns.family_of(k)] / reference,
            };
            let widest = WIDEST_SLAB / sums.gram[k * columns.names.len() + k];
            if learned { slab.min(widest) } else { slab }
        })
        .collect();
    let (shape, scale) = match settings.noise {
        Some(given) => given,
        None => (AUTO_SHAPE, auto_scale(noise, unexplained)),
    };
    let (families, mut odds, inclusion) = structure::structure(columns, settings)?;
    let payload = columns.place_of(Family::Payload);
    if let Some(payload) = payload.filter(|_| learned) {
        odds[payload] *= plug_in.payload.odds;
    }
    let prior = Prior {
        slab,
        component: columns.component.clone(),
        family: families,
        parent: columns.parent.clone(),
        odds,
        lower: columns.lower.clone(),
        halves: columns.halves.clone(),
        inclusion,
        shape,
        scale,
    };
    Ok(sums.problem(prior, columns.names.clone()))
}

/// The statistics of all joints, each with its weight and temper.
struct WeightedSums {
    gram: Vec<f64>,
    xy: Vec<f64>,
    yy: f64,
    n: f64,
    log_constant: f64,
}

impl WeightedSums {
    /// Over K = `count` columns.
    fn of(grams: &Gram, count: usize, plug_in: &PlugIn) -> Self {
        let (mut gram, mut xy, mut yy) = (vec![0.0; count * count], vec![0.0; count], 0.0);
        let (mut n, mut log_constant) = (0.0, 0.0);
        for (j, joint) in grams.joints.iter().enumerate() {
            let (factor, temper) = (plug_in.factor(j), plug_in.counted(j));
            let rho = plug_in.rho[j];
            let statistics = joint.stationary(rho);
            let (size, values) = (statistics.size, &statistics.values);
            let last = size - 1;
            for (a, &row) in joint.columns.iter().enumerate() {
                for (b, &column) in joint.columns.iter().enumerate() {
                    gram[row as usize * count + column as usize] += factor * values[a * size + b];
                }
                xy[row as usize] += factor * values[a * size + last];
            }
            yy += factor * values[last * size + last];
            n += temper * joint.n;
            log_constant += 0.5 * temper * joint.n * plug_in.weight[j].ln();
            log_constant += 0.5 * temper * joint.starts * (-rho * rho).ln_1p();
        }
        Self {
            gram,
            xy,
            yy,
            n,
            log_constant,
        }
    }

    /// The regression under a prior.
    fn problem(self, prior: Prior, names: Vec<String>) -> Problem {
        Problem {
            gram: self.gram,
            xy: self.xy,
            yy: self.yy,
            n: self.n,
            log_constant: self.log_constant,
            prior,
            names,
        }
    }
}

/// Share of a joint's rows on which a shape that fades with speed acts, at least, where its slab is made: where the training motion
/// is too fast for it, its column is as small as 1e-38, and a coefficient that is a priori as large as the residual over
/// that would be told by rounding, and would drive the prediction of any slower motion.
const LEAST_SHARE: f64 = 0.01;

/// Largest variance of an automatic slab, in squares of the standard error that the column has alone. A slab that is wider
/// tells nothing more of the coefficient, and columns that depend on each other lose their last digits against it: on a
/// log without noise a prior of 1 kg would be 1e10 standard errors wide.
const WIDEST_SLAB: f64 = 1e12;

/// a0 of the automatic noise prior: it weighs as much as two thousandths of a row.
pub const AUTO_SHAPE: f64 = 1e-3;

/// Least noise that the automatic prior stands for, as a share of mean(y²).
const LEAST_NOISE: f64 = 1e-4;

/// `b0 = a0 max(E[φ], 1e-4 mean(y²))` of the automatic noise prior, (N·m)²: two thousandths of a row at the noise that the fixed point
/// finds. mean(y²) in its place is no weak prior where candidates explain nearly all: 300 effective rows whose noise is
/// 1/200 of the residual torque would get a variance 27 % too large.
pub fn auto_scale(noise: f64, unexplained: f64) -> f64 {
    AUTO_SHAPE * noise.max(LEAST_NOISE * unexplained).max(ROUNDING)
}

/// Mean square of rounding in torque, (N·m)²: below it there is nothing to explain.
const ROUNDING: f64 = 1e-24;

/// Mean square of the residual torque, with a floor at rounding: an exactly perfect model must not make b0 zero.
fn scale_of_residual(mean_square: f64) -> f64 {
    mean_square.max(ROUNDING)
}
