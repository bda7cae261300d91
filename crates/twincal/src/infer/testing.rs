//! Random regression problems for the tests of this module.

use super::{Choice, InferenceSettings, infer};
use crate::linear_algebra::Cholesky;
use crate::posterior::{Posterior, Problem};
use crate::prior::{Inclusion, Prior};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statrs::function::gamma::ln_gamma;

/// A standard normal number (Box and Muller).
pub(super) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - u).ln()).sqrt() * (2.0 * std::f64::consts::PI * v).cos()
}

/// `(XᵀX, Xᵀy, yᵀy)` of `rows` rows: columns with pairwise correlation about `correlation`, every third one acts.
fn random_gram(seed: u64, size: usize, rows: usize, correlation: f64) -> (Vec<f64>, Vec<f64>, f64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut gram, mut xy, mut yy) = (vec![0.0; size * size], vec![0.0; size], 0.0);
    for _ in 0..rows {
        let common = normal(&mut rng);
        let x: Vec<f64> = (0..size)
            .map(|k| {
                (1.0 + 0.3 * k as f64)
                    * (correlation.sqrt() * common + (1.0 - correlation).sqrt() * normal(&mut rng))
            })
            .collect();
        let signal: f64 = x
            .iter()
            .step_by(3)
            .enumerate()
            .map(|(i, x)| x * 0.3 / (1.0 + i as f64))
            .sum();
        let y = signal + 0.5 * normal(&mut rng);
        for i in 0..size {
            xy[i] += x[i] * y;
            (0..size).for_each(|j| gram[i * size + j] += x[i] * x[j]);
        }
        yy += y * y;
    }
    (gram, xy, yy)
}

/// A problem on [`random_gram`] with three families that do not lie together.
pub(super) fn problem(
    seed: u64,
    size: usize,
    rows: usize,
    correlation: f64,
    inclusion: Inclusion,
) -> Problem {
    let (gram, xy, yy) = random_gram(seed, size, rows, correlation);
    let prior = Prior::single(
        (0..size).map(|k| 10.0 / (1.0 + k as f64)).collect(),
        (0..size).map(|k| [0, 1, 0, 2, 1][k % 5]).collect(),
        inclusion,
        (0.01, 0.02),
    );
    let names = (0..size).map(|k| format!("x{k}")).collect();
    Problem {
        gram,
        xy,
        yy,
        n: rows as f64,
        log_constant: 0.7,
        prior,
        names,
    }
}

/// The posterior by a short run of four chains.
pub(super) fn sampled(problem: &Problem) -> Posterior {
    let settings = InferenceSettings {
        method: Choice::Gibbs,
        chains: 4,
        draws: 400,
        seed: 1,
        allow_disagreement: true,
    };
    infer(problem, &settings).unwrap()
}

/// A regression with components of the given sizes, kept with its rows.
pub(super) struct Grouped {
    pub(super) problem: Problem,
    /// Rows × columns, row-major.
    pub(super) x: Vec<f64>,
    pub(super) y: Vec<f64>,
}

/// Components of the given sizes in three families with odds; the first two columns of component 1 are nearly those of
/// component 0, every third component acts. `interleaved` mixes the columns of different components.
pub(super) fn grouped(seed: u64, sizes: &[usize], rows: usize, interleaved: bool) -> Grouped {
    acting(seed, sizes, rows, interleaved, 0.25)
}

/// [`grouped`] with effects of a given size beside noise of 0.5.
pub(super) fn acting(
    seed: u64,
    sizes: &[usize],
    rows: usize,
    interleaved: bool,
    effect: f64,
) -> Grouped {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut component: Vec<usize> = sizes
        .iter()
        .enumerate()
        .flat_map(|(c, &len)| std::iter::repeat_n(c, len))
        .collect();
    if interleaved {
        component.reverse();
        let half = component.len() / 2;
        component.rotate_left(half / 2);
    }
    let size = component.len();
    let (x, y) = acting_rows(&mut rng, &component, rows, effect);
    let (mut gram, mut xy) = (vec![0.0; size * size], vec![0.0; size]);
    for (row, y) in x.chunks_exact(size).zip(&y) {
        for i in 0..size {
            xy[i] += row[i] * y;
            (0..size).for_each(|j| gram[i * size + j] += row[i] * row[j]);
        }
    }
    let prior = Prior {
        slab: (0..size).map(|k| 1.0 + 0.2 * k as f64).collect(),
        component,
        family: (0..sizes.len()).map(|c| [0, 1, 0, 2][c % 4]).collect(),
        parent: Vec::new(),
        odds: vec![1.0, 0.3, 4.0],
        lower: vec![f64::NEG_INFINITY; size],
        halves: Vec::new(),
        inclusion: Inclusion::ExpectedTerms(0.3 * sizes.len() as f64),
        shape: 0.01,
        scale: 0.02,
    };
    let problem = Problem {
        gram,
        xy,
        yy: y.iter().map(|y| y * y).sum(),
        n: rows as f64,
        log_constant: 0.7,
        prior,
        names: (0..size).map(|k| format!("x{k}")).collect(),
    };
    Grouped { problem, x, y }
}

/// Columns, row-major, and y of [`acting`] by the component of each column.
fn acting_rows(
    rng: &mut ChaCha8Rng,
    component: &[usize],
    rows: usize,
    effect: f64,
) -> (Vec<f64>, Vec<f64>) {
    let size = component.len();
    let columns = |c: usize| -> Vec<usize> { (0..size).filter(|&k| component[k] == c).collect() };
    let (zero, one) = (columns(0), columns(1));
    let (mut x, mut y) = (vec![0.0; rows * size], vec![0.0; rows]);
    for (row, y) in x.chunks_exact_mut(size).zip(&mut y) {
        let common = normal(rng);
        for value in row.iter_mut() {
            *value = 0.5 * common + 0.8 * normal(rng);
        }
        for (&a, &b) in zero.iter().zip(&one) {
            row[b] = row[a] + 0.05 * normal(rng);
        }
        *y = 0.5 * normal(rng);
        for k in (0..size).filter(|&k| component[k].is_multiple_of(3)) {
            *y += effect * row[k] / (1.0 + component[k] as f64);
        }
    }
    (x, y)
}

impl Grouped {
    /// The same with heredity: (child, parent).
    pub(super) fn with_parents(mut self, pairs: &[(usize, usize)]) -> Self {
        let prior = &mut self.problem.prior;
        prior.parent = vec![None; prior.components()];
        pairs.iter().for_each(|&(c, p)| prior.parent[c] = Some(p));
        self
    }
}

/// Posterior of every set of components by multivariate t densities of the rows: no Gram matrix, no Schur complement.
///
/// Sets with a child without its parent have none, and the others share the prior.
///
/// ```text
/// y | z ~ t with 2 a0 degrees of freedom, location 0, scale (b0/a0)(1 + X_z V_z X_zᵀ)
/// ```
pub(super) struct Densities {
    pub(super) log_evidence: f64,
    /// By component.
    pub(super) pip: Vec<f64>,
    /// By column.
    pub(super) mean: Vec<f64>,
    pub(super) sd: Vec<f64>,
    /// Of every set, bit c its component c.
    pub(super) weights: Vec<f64>,
}

impl Densities {
    pub(super) fn new(data: &Grouped) -> Self {
        let (size, count) = (data.problem.xy.len(), data.problem.prior.components());
        let sets = 0u32..1 << count;
        let models: Vec<Density> = sets.filter_map(|set| Density::new(data, set)).collect();
        let share = models.iter().fold(0.0, |sum, m| sum + m.log_prior.exp());
        let top = models
            .iter()
            .map(|m| m.log)
            .fold(f64::NEG_INFINITY, f64::max);
        let total: f64 = models.iter().map(|m| (m.log - top).exp()).sum();
        let mut out = Self {
            log_evidence: top + total.ln() - share.ln(),
            pip: vec![0.0; count],
            mean: vec![0.0; size],
            sd: vec![0.0; size],
            weights: vec![0.0; 1 << count],
        };
        for model in &models {
            let weight = (model.log - top).exp() / total;
            out.weights[model.set as usize] = weight;
            (0..count)
                .filter(|c| model.set >> c & 1 == 1)
                .for_each(|c| out.pip[c] += weight);
            for k in 0..size {
                out.mean[k] += weight * model.mean[k];
                out.sd[k] += weight * model.second[k];
            }
        }
        for k in 0..size {
            out.sd[k] = (out.sd[k] - out.mean[k] * out.mean[k]).max(0.0).sqrt();
        }
        out
    }
}

/// One set of components of [`Densities`]: log p(y, z), log p(z), and E[β] and E[β²] by column.
struct Density {
    set: u32,
    log: f64,
    log_prior: f64,
    mean: Vec<f64>,
    second: Vec<f64>,
}

impl Density {
    /// None of a set with a child without its parent.
    fn new(data: &Grouped, set: u32) -> Option<Self> {
        let (problem, prior) = (&data.problem, &data.problem.prior);
        let (size, rows, count) = (problem.xy.len(), data.y.len(), prior.components());
        let shape = prior.shape + 0.5 * rows as f64;
        let orphan = |c: usize| {
            let parent = prior.parent.get(c).copied().flatten();
            set >> c & 1 == 1 && parent.is_some_and(|p| set >> p & 1 == 0)
        };
        if (0..count).any(orphan) {
            return None;
        }
        let members: Vec<usize> = (0..size)
            .filter(|&k| set >> prior.component[k] & 1 == 1)
            .collect();
        let factor = Cholesky::new(&scale_matrix(data, &members), rows).unwrap();
        let mut solved = data.y.clone();
        factor.solve(&mut solved);
        let square: f64 = data.y.iter().zip(&solved).map(|(a, b)| a * b).sum();
        let mut families = vec![0; prior.families()];
        (0..count)
            .filter(|&c| set >> c & 1 == 1)
            .for_each(|c| families[prior.family[c]] += 1);
        let log_prior = prior.log_model(&families);
        let log = log_prior + problem.log_constant + ln_gamma(shape)
            - ln_gamma(prior.shape)
            - 0.5 * rows as f64 * (2.0 * std::f64::consts::PI * prior.scale).ln()
            - 0.5 * factor.log_determinant()
            - shape * (0.5 * square / prior.scale).ln_1p();
        let phi = (prior.scale + 0.5 * square) / (shape - 1.0);
        let (mut mean, mut second) = (vec![0.0; size], vec![0.0; size]);
        for &k in &members {
            let column: Vec<f64> = (0..rows).map(|i| data.x[i * size + k]).collect();
            let mut gain = column.clone();
            factor.solve(&mut gain);
            let along = |v: &[f64]| -> f64 { gain.iter().zip(v).map(|(a, b)| a * b).sum() };
            let v = prior.slab[k];
            mean[k] = v * along(&data.y);
            second[k] = mean[k] * mean[k] + phi * v * (1.0 - v * along(&column));
        }
        Some(Self {
            set,
            log,
            log_prior,
            mean,
            second,
        })
    }
}

/// 1 + X_z V_z X_zᵀ of these columns, rows × rows.
fn scale_matrix(data: &Grouped, members: &[usize]) -> Vec<f64> {
    let (size, rows) = (data.problem.xy.len(), data.y.len());
    let at = |i: usize, k: usize| data.x[i * size + k];
    let mut scale = vec![0.0; rows * rows];
    for i in 0..rows {
        for j in 0..=i {
            let inner: f64 = members
                .iter()
                .map(|&k| at(i, k) * at(j, k) * data.problem.prior.slab[k])
                .sum();
            scale[i * rows + j] = inner + f64::from(i == j);
            scale[j * rows + i] = scale[i * rows + j];
        }
    }
    scale
}
