//! The nearest physical inertias in a metric M, with a proof that none is nearer.
//!
//! ```text
//! minimise ½ (π − π̂)ᵀ M (π − π̂)   subject to   P(π_l) ⪰ 0   for every link l
//! ```
//! π holds the ten parameters of every link. In whitened coordinates u = Lᵀ (π − π̂), M = L Lᵀ, the objective is ½|u|² and every
//! pseudo-inertia is affine: `A_l + Σ_i u_i F_li`. Path following with the barrier −ln|P|; `Z_l = P_l⁻¹/t` is dual feasible at
//! every point, so the duality gap is known exactly:
//!
//! ```text
//! ½|u|² ≥ optimum ≥ −½|F*Z|² − Σ_l ⟨Z_l, A_l⟩,     (F*Z)_i = Σ_l ⟨F_li, Z_l⟩
//! ```
//! # Source
//! Boyd, Vandenberghe, *Convex Optimization*, section 11.6 (barrier method for generalised inequalities).

use super::pseudo_inertia::{Four, factor, inner, inverse, log_determinant, pseudo_inertia, times};
use crate::error::{Error, Result};
use crate::linear_algebra::Cholesky;
use serde::Serialize;

/// A link whose inertia changes: ten parameters in its own frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Link<'a> {
    pub(super) name: &'a str,
    /// As the nominal model has them.
    pub(super) nominal: [f64; 10],
    /// As they were found.
    pub(super) found: [f64; 10],
}

impl Link<'_> {
    /// Natural units of the ten parameters: mass, mass × length, mass × length².
    pub(super) fn units(&self) -> [f64; 10] {
        Scale::of(self).units()
    }
}

/// How inertias were made physical.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Projection {
    /// Links that no body could be before.
    pub links: Vec<String>,
    /// √((π − π̂)ᵀ M (π − π̂)): how far they moved, in standard deviations of what torque says of them.
    pub distance: f64,
    /// Upper bound of what a nearer solution could save of ½ distance².
    pub gap: f64,
}

/// Smallest eigenvalue of the pseudo-inertia in units of the link's own size: digits in a file round.
const MARGIN: f64 = 1e-6;
/// Size of a link without any inertia, m.
const SIZE: f64 = 0.1;
/// Smallest mass that makes a scale, kg.
const LEAST_MASS: f64 = 1e-6;
/// The gap ends at this share of the objective (or at this number).
const GAP: f64 = 1e-9;

/// Parameters of every link at the nearest physical point; `metric` makes M (10 L × 10 L, row-major, positive definite), where it
/// is needed.
///
/// # Errors
/// [`Error::Refused`] if there are none.
pub(super) fn project(
    links: &[Link<'_>],
    metric: impl FnOnce() -> Vec<f64>,
) -> Result<(Vec<[f64; 10]>, Option<Projection>)> {
    let scales: Vec<Scale> = links.iter().map(Scale::of).collect();
    let impossible =
        |(link, scale): &(&Link<'_>, &Scale)| factor(&scale.inside(&link.found)).is_none();
    let bad: Vec<String> = (links.iter().zip(&scales))
        .filter(impossible)
        .map(|(link, _)| link.name.to_owned())
        .collect();
    if bad.is_empty() {
        return Ok((links.iter().map(|link| link.found).collect(), None));
    }
    let refused = || Error::Refused {
        problem: format!("no physical inertia of {} fits the data", bad.join(", ")),
        remedy: "correct the inertias of these links in the model first".into(),
    };
    let problem = Problem::new(links, &scales, &metric()).ok_or_else(refused)?;
    let start = problem.interior().ok_or_else(refused)?;
    let (u, gap) = problem.solve(start);
    let parameters = (links.iter().zip(&problem.steps))
        .map(|(link, steps)| moved(&link.found, steps, &u))
        .collect();
    let distance = u.iter().map(|x| x * x).sum::<f64>().sqrt();
    let projection = Projection {
        links: bad,
        distance,
        gap,
    };
    Ok((parameters, Some(projection)))
}

/// π̂ + Σ u_i step_i.
fn moved(found: &[f64; 10], steps: &[[f64; 10]], u: &[f64]) -> [f64; 10] {
    std::array::from_fn(|k| {
        let terms = steps.iter().zip(u);
        found[k] + terms.map(|(step, u)| step[k] * u).sum::<f64>()
    })
}

/// Units in which a link's pseudo-inertia is about 1.
#[derive(Debug, Clone, Copy)]
struct Scale {
    mass: f64,
    length: f64,
}

impl Scale {
    fn of(link: &Link<'_>) -> Self {
        let p = &link.nominal;
        let spread = 0.5 * (p[4] + p[7] + p[9]);
        let length = if p[0] > 0.0 && spread > 0.0 {
            (spread / p[0]).sqrt()
        } else {
            SIZE
        };
        Self {
            mass: p[0].max(link.found[0].abs()).max(LEAST_MASS),
            length,
        }
    }

    fn units(&self) -> [f64; 10] {
        std::array::from_fn(|k| {
            let length = [1.0, self.length, self.length * self.length];
            self.mass * length[usize::from(k > 0) + usize::from(k > 3)]
        })
    }

    /// P in these units.
    fn relative(&self, p: &[f64; 10]) -> Four {
        let units = self.units();
        pseudo_inertia(&std::array::from_fn(|k| p[k] / units[k]))
    }

    /// P − margin, which must be positive definite.
    fn inside(&self, p: &[f64; 10]) -> Four {
        let mut inside = self.relative(p);
        (0..4).for_each(|i| inside[i][i] -= MARGIN);
        inside
    }
}

/// The problem in whitened coordinates and relative units.
struct Problem {
    /// A_l.
    constant: Vec<Four>,
    /// F_li.
    slopes: Vec<Vec<Four>>,
    /// Parameters per unit of u, to come back.
    steps: Vec<Vec<[f64; 10]>>,
    size: usize,
}

impl Problem {
    /// `None` if the metric is not positive definite.
    fn new(links: &[Link<'_>], scales: &[Scale], metric: &[f64]) -> Option<Self> {
        let size = 10 * links.len();
        let units: Vec<f64> = scales.iter().flat_map(Scale::units).collect();
        let relative: Vec<f64> = (metric.iter().enumerate())
            .map(|(at, m)| m * units[at / size] * units[at % size])
            .collect();
        let root = Cholesky::new(&relative, size).ok()?;
        let mut steps = vec![vec![[0.0; 10]; size]; links.len()];
        for i in 0..size {
            // π − π̂ of u = e_i.
            let mut step = vec![0.0; size];
            step[i] = 1.0;
            root.solve_upper(&mut step);
            for (l, steps) in steps.iter_mut().enumerate() {
                steps[i] = std::array::from_fn(|k| step[10 * l + k] * units[10 * l + k]);
            }
        }
        let slopes = (steps.iter().zip(scales))
            .map(|(steps, scale)| steps.iter().map(|s| scale.relative(s)).collect())
            .collect();
        let constant = (links.iter().zip(scales))
            .map(|(link, scale)| scale.inside(&link.found))
            .collect();
        Some(Self {
            constant,
            slopes,
            steps,
            size,
        })
    }

    /// A_l + Σ u_i F_li + lift.
    fn matrix(&self, link: usize, u: &[f64], lift: f64) -> Four {
        let mut at = self.constant[link];
        for (slope, u) in self.slopes[link].iter().zip(u) {
            for (row, slope) in at.iter_mut().zip(slope) {
                for (value, slope) in row.iter_mut().zip(slope) {
                    *value += u * slope;
                }
            }
        }
        (0..4).for_each(|i| at[i][i] += lift);
        at
    }

    /// A strictly feasible u, by minimising a common lift of all eigenvalues until it is not needed.
    fn interior(&self) -> Option<Vec<f64>> {
        let mut x = vec![0.0; self.size + 1];
        let lowest = |x: &[f64]| {
            (0..self.constant.len())
                .all(|l| factor(&self.matrix(l, &x[..self.size], 0.0)).is_some())
        };
        x[self.size] = 1.0;
        while self.factors(&x[..self.size], x[self.size]).is_none() {
            x[self.size] *= 2.0;
            if !x[self.size].is_finite() {
                return None;
            }
        }
        let mut t = 1.0;
        while t < 1e12 {
            self.newton(&mut x, t, true);
            if lowest(&x) {
                x.truncate(self.size);
                return Some(x);
            }
            t *= 8.0;
        }
        None
    }

    /// The optimum from a strictly feasible start, and the duality gap there.
    fn solve(&self, mut u: Vec<f64>) -> (Vec<f64>, f64) {
        let mut t = 1.0;
        let mut gap = f64::INFINITY;
        for _ in 0..60 {
            self.newton(&mut u, t, false);
            gap = self.gap(&u, t);
            let value = 0.5 * u.iter().map(|x| x * x).sum::<f64>();
            if gap <= GAP * value.max(1e-3) {
                break;
            }
            t *= 8.0;
        }
        (u, gap)
    }

    /// ½|u|² minus the dual value of Z_l = P_l⁻¹/t.
    fn gap(&self, u: &[f64], t: f64) -> f64 {
        let mut image = vec![0.0; self.size];
        let mut value = 0.5 * u.iter().map(|x| x * x).sum::<f64>();
        for l in 0..self.constant.len() {
            let Some(lower) = factor(&self.matrix(l, u, 0.0)) else {
                return f64::INFINITY;
            };
            let z = inverse(&lower).map(|row| row.map(|x| x / t));
            value += inner(&z, &self.constant[l]);
            for (image, slope) in image.iter_mut().zip(&self.slopes[l]) {
                *image += inner(slope, &z);
            }
        }
        value + 0.5 * image.iter().map(|x| x * x).sum::<f64>()
    }

    /// Cholesky factors of all matrices; `None` outside.
    fn factors(&self, u: &[f64], lift: f64) -> Option<Vec<Four>> {
        (0..self.constant.len())
            .map(|l| factor(&self.matrix(l, u, lift)))
            .collect()
    }

    /// t · objective − Σ ln|P_l|; with `lifted` the last variable is the lift and the objective.
    fn value(&self, x: &[f64], t: f64, lifted: bool) -> Option<f64> {
        let lift = if lifted { x[self.size] } else { 0.0 };
        let factors = self.factors(&x[..self.size], lift)?;
        let barrier: f64 = factors.iter().map(log_determinant).sum();
        let square = 0.5 * x[..self.size].iter().map(|x| x * x).sum::<f64>();
        let objective = if lifted {
            t * lift + 1e-6 * square
        } else {
            t * square
        };
        Some(objective - barrier)
    }

    /// Damped Newton steps to the centre of parameter t.
    fn newton(&self, x: &mut [f64], t: f64, lifted: bool) {
        let count = x.len();
        for _ in 0..60 {
            let lift = if lifted { x[self.size] } else { 0.0 };
            let Some(factors) = self.factors(&x[..self.size], lift) else {
                return;
            };
            let weight = if lifted { 1e-6 } else { t };
            let mut gradient = vec![0.0; count];
            let mut hessian = vec![0.0; count * count];
            for i in 0..self.size {
                gradient[i] = weight * x[i];
                hessian[i * count + i] = weight;
            }
            if lifted {
                gradient[self.size] = t;
            }
            let identity: Four =
                std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
            for (l, lower) in factors.iter().enumerate() {
                let z = inverse(lower);
                let mut active: Vec<(usize, Four)> = Vec::new();
                let slopes = self.slopes[l].iter().chain(lifted.then_some(&identity));
                for (i, slope) in slopes.enumerate() {
                    if slope.iter().flatten().any(|&v| v != 0.0) {
                        gradient[i] -= inner(&z, slope);
                        active.push((i, times(&z, slope)));
                    }
                }
                for (i, a) in &active {
                    for (j, b) in &active {
                        let turned: Four =
                            std::array::from_fn(|r| std::array::from_fn(|c| b[c][r]));
                        hessian[i * count + j] += inner(a, &turned);
                    }
                }
            }
            let Ok(root) = Cholesky::new(&hessian, count) else {
                return;
            };
            let mut step: Vec<f64> = gradient.iter().map(|g| -g).collect();
            root.solve(&mut step);
            let decrement: f64 = -gradient.iter().zip(&step).map(|(g, s)| g * s).sum::<f64>();
            let Some(here) = self.value(x, t, lifted) else {
                return;
            };
            let mut length = 1.0;
            let moved = loop {
                let trial: Vec<f64> = x.iter().zip(&step).map(|(x, s)| x + length * s).collect();
                let enough = self
                    .value(&trial, t, lifted)
                    .is_some_and(|there| there <= here - 0.1 * length * decrement);
                if enough {
                    break Some(trial);
                }
                length *= 0.5;
                if length < 1e-10 {
                    break None;
                }
            };
            match moved {
                Some(trial) => x.copy_from_slice(&trial),
                None => return,
            }
            if decrement < 1e-12 {
                return;
            }
        }
    }
}
