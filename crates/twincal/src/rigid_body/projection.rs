//! The physical inertias with the nearest torque, with a proof that none is nearer.
//!
//! ```text
//! minimise ½ (π − π̂)ᵀ T (π − π̂) + ½ Σ ((π − π°)/unit)²   subject to   P(π_l) ⪰ ε   for every link l
//! ```
//! π holds the ten parameters of every link, π̂ what was found. T is the square of the torque between them (`write_back::metric`). The
//! second part is weak: it draws what no torque shows towards π°, which for a link that was found to be no body is its nominal
//! tensor about the centre of mass that was found. ε is 1e-6 in the link's own units.
//!
//! Both parts are ½ (π − π*)ᵀ M (π − π*) and a constant, M = T + diag(1/unit²). In whitened coordinates u = Lᵀ (π − π*),
//! M = L Lᵀ, that is ½|u|² and every pseudo-inertia is affine: `P − ε = A_l + Σ_i u_i F_li`. Path following with the barrier −ln|P − ε|; `Z_l = (P_l − ε)⁻¹/t` is
//! dual feasible at every point, so the duality gap is known exactly:
//!
//! ```text
//! ½|u|² ≥ optimum ≥ −½|F*Z|² − Σ_l ⟨Z_l, A_l⟩,     (F*Z)_i = Σ_l ⟨F_li, Z_l⟩
//! ```
//! # Source
//! Boyd, Vandenberghe, *Convex Optimization*, section 11.6 (barrier method for generalised inequalities).

use super::pseudo_inertia::{Four, factor, inner, inverse, log_determinant, pseudo_inertia, times};
use crate::error::{Error, Result};
use crate::linear_algebra::Cholesky;
use crate::robot::{Inertia, Placement, body_parameters, inertia_of};
use serde::Serialize;

/// A link whose inertia changes: ten parameters in its own frame.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Link<'a> {
    pub(crate) name: &'a str,
    /// As the nominal model has them.
    pub(crate) nominal: [f64; 10],
    /// As they were found.
    pub(crate) found: [f64; 10],
}

/// How inertias were made physical.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Projection {
    /// Links that no body could be before.
    pub links: Vec<String>,
    /// √((π − π̂)ᵀ T (π − π̂)): how far their torque moved, in standard deviations of what the data say of it.
    pub distance: f64,
    /// Upper bound of what another physical solution could save of the objective.
    pub gap: f64,
}

/// Smallest eigenvalue of the pseudo-inertia in units of the link's own size: digits in a file round.
const MARGIN: f64 = 1e-6;
/// Size of a link without any inertia, m.
const SIZE: f64 = 0.1;
/// Smallest mass that makes a scale, kg.
const LEAST_MASS: f64 = 1e-6;
/// The gap ends at this share of the objective (or at this number), and is refused above the second one.
const GAP: f64 = 1e-9;
const MOST_GAP: f64 = 1e-4;
/// Squared Newton decrement below which full steps are taken.
const NEAR: f64 = 0.05;
/// Where the path ends at the latest: the barrier then weighs less than rounding.
const LAST: f64 = 1e18;
/// Share of a link's scale below which a found mass says nothing of where it is.
const LIGHT: f64 = 1e-3;

/// Parameters of every link at the nearest physical point; `torque` makes T (10 L × 10 L, row-major), where it is needed.
///
/// # Errors
/// Those of `torque`; [`Error::Refused`] where rounding lets no point be found or proven.
pub(crate) fn project(
    links: &[Link<'_>],
    torque: impl FnOnce() -> Result<Vec<f64>>,
) -> Result<(Vec<[f64; 10]>, Option<Projection>)> {
    let scales: Vec<Scale> = links.iter().map(Scale::of).collect();
    let impossible: Vec<bool> = (links.iter().zip(&scales))
        .map(|(link, scale)| factor(&scale.inside(&link.found)).is_none())
        .collect();
    if !impossible.contains(&true) {
        return Ok((links.iter().map(|link| link.found).collect(), None));
    }
    let named = links.iter().zip(&impossible).filter(|(_, bad)| **bad);
    let bad: Vec<String> = named.map(|(link, _)| link.name.to_owned()).collect();
    let refused = || Error::Refused {
        problem: format!(
            "the physical inertia nearest to what was found for {} drowns in rounding",
            bad.join(", ")
        ),
        remedy: "look for inertias of these links in the model that are off by orders of magnitude"
            .into(),
    };
    let found: Vec<f64> = links.iter().flat_map(|link| link.found).collect();
    let sound: Vec<f64> = (links.iter().zip(&scales).zip(&impossible))
        .flat_map(|((link, scale), bad)| if *bad { scale.sound(link) } else { link.found })
        .collect();
    let torque = torque()?;
    let problem = Problem::new(&scales, &torque, &found, &sound).ok_or_else(refused)?;
    let start = problem.interior().ok_or_else(refused)?;
    let (u, gap) = problem.solve(start);
    let objective = 0.5 * u.iter().map(|x| x * x).sum::<f64>();
    if gap.is_nan() || gap > MOST_GAP * objective.max(1.0) {
        return Err(refused());
    }
    let parameters = problem.at(&u);
    let moved: Vec<f64> = parameters
        .iter()
        .flatten()
        .zip(&found)
        .map(|(p, f)| p - f)
        .collect();
    let rows = torque.chunks_exact(found.len()).zip(&moved);
    let square: f64 = rows
        .map(|(row, m)| m * row.iter().zip(&moved).map(|(t, n)| t * n).sum::<f64>())
        .sum();
    let projection = Projection {
        links: bad,
        distance: square.max(0.0).sqrt(),
        gap,
    };
    Ok((parameters, Some(projection)))
}

/// Units in which a link's pseudo-inertia is about 1.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scale {
    mass: f64,
    length: f64,
}

impl Scale {
    /// The length: the nominal radius of gyration or how far out mass was found, whichever is larger.
    pub(crate) fn of(link: &Link<'_>) -> Self {
        let (p, found) = (&link.nominal, &link.found);
        let mass = p[0].max(found[0].abs()).max(LEAST_MASS);
        let turning = 0.5 * (p[4] + p[7] + p[9]).max(0.0);
        let radius = (turning / mass).sqrt();
        let out = found[1].hypot(found[2]).hypot(found[3]) / mass;
        let length = radius.max(out);
        Self {
            mass,
            length: if length > 0.0 { length } else { SIZE },
        }
    }

    /// A body with mass and centre of mass as they were found, and the nominal tensor about it in proportion; without a nominal one that of
    /// a ball of half the scale's length.
    fn sound(&self, link: &Link<'_>) -> [f64; 10] {
        let mass = link.found[0].max(LIGHT * self.mass);
        let nominal = inertia_of(&link.nominal);
        let com = if link.found[0] > LIGHT * self.mass {
            [1, 2, 3].map(|k| link.found[k] / mass)
        } else {
            nominal.map_or([0.0; 3], |nominal| nominal.com)
        };
        let ball = 0.1 * mass * self.length * self.length;
        let tensor = nominal.map_or(
            [[ball, 0.0, 0.0], [0.0, ball, 0.0], [0.0, 0.0, ball]],
            |nominal| (nominal.tensor).map(|row| row.map(|x| x * mass / nominal.mass)),
        );
        body_parameters(&Inertia { mass, com, tensor }, &Placement::IDENTITY)
    }

    pub(crate) fn units(&self) -> [f64; 10] {
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
    /// π* of every link.
    centre: Vec<[f64; 10]>,
    /// A_l.
    constant: Vec<Four>,
    /// F_li.
    slopes: Vec<Vec<Four>>,
    /// Parameters per unit of u, to come back.
    steps: Vec<Vec<[f64; 10]>>,
    size: usize,
}

impl Problem {
    /// `None` if M is not positive definite.
    fn new(scales: &[Scale], torque: &[f64], found: &[f64], sound: &[f64]) -> Option<Self> {
        let size = found.len();
        let units: Vec<f64> = scales.iter().flat_map(Scale::units).collect();
        let relative: Vec<f64> = (torque.iter().enumerate())
            .map(|(at, t)| {
                let (i, k) = (at / size, at % size);
                t * units[i] * units[k] + f64::from(u8::from(i == k))
            })
            .collect();
        let root = Cholesky::new(&relative, size).ok()?;
        // π* − π̂ = M⁻¹ diag(1/unit²) (π° − π̂)
        let ends = sound.iter().zip(found).zip(&units);
        let mut shift: Vec<f64> = ends.map(|((s, f), unit)| (s - f) / unit).collect();
        root.solve(&mut shift);
        let per_link = |values: &[f64]| -> Vec<[f64; 10]> {
            let natural: Vec<f64> = values
                .iter()
                .zip(&units)
                .map(|(v, unit)| v * unit)
                .collect();
            let (links, _) = natural.as_chunks::<10>();
            links.to_vec()
        };
        let mut centre = per_link(&shift);
        for (centre, found) in centre.iter_mut().flatten().zip(found) {
            *centre += found;
        }
        let mut steps = vec![Vec::with_capacity(size); scales.len()];
        for i in 0..size {
            // π − π* of u = e_i.
            let mut step = vec![0.0; size];
            step[i] = 1.0;
            root.solve_upper(&mut step);
            for (steps, step) in steps.iter_mut().zip(per_link(&step)) {
                steps.push(step);
            }
        }
        let slopes = (steps.iter().zip(scales))
            .map(|(steps, scale)| steps.iter().map(|s| scale.relative(s)).collect())
            .collect();
        let constant = (centre.iter().zip(scales))
            .map(|(centre, scale)| scale.inside(centre))
            .collect();
        Some(Self {
            centre,
            constant,
            slopes,
            steps,
            size,
        })
    }

    /// Parameters of every link at u.
    fn at(&self, u: &[f64]) -> Vec<[f64; 10]> {
        let links = self.centre.iter().zip(&self.steps);
        links
            .map(|(centre, steps)| {
                std::array::from_fn(|k| {
                    let terms = steps.iter().zip(u);
                    centre[k] + terms.map(|(step, u)| step[k] * u).sum::<f64>()
                })
            })
            .collect()
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

    /// The optimum from a strictly feasible start, and the duality gap there; the best point where rounding ends the path.
    fn solve(&self, mut u: Vec<f64>) -> (Vec<f64>, f64) {
        let value = |u: &[f64]| 0.5 * u.iter().map(|x| x * x).sum::<f64>();
        // Objective and barrier weigh alike at first.
        let mut t = 1.0 / value(&u).max(1.0);
        let mut best = (u.clone(), f64::INFINITY);
        while t < LAST {
            self.newton(&mut u, t, false);
            let gap = self.gap(&u, t);
            if gap < best.1 {
                best = (u.clone(), gap);
            }
            if gap <= GAP * value(&u).max(1e-3) {
                break;
            }
            t *= 8.0;
        }
        best
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
            let (gradient, hessian) = self.derivatives(x, &factors, t, lifted);
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
                // The function is self-concordant: near the centre full steps converge, and what they gain drowns in rounding.
                let enough = self.value(&trial, t, lifted).is_some_and(|there| {
                    decrement < NEAR || there <= here - 0.1 * length * decrement
                });
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

    /// Gradient and Hessian of [`Self::value`], from the factors of all matrices.
    fn derivatives(
        &self,
        x: &[f64],
        factors: &[Four],
        t: f64,
        lifted: bool,
    ) -> (Vec<f64>, Vec<f64>) {
        let count = x.len();
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
                    let turned: Four = std::array::from_fn(|r| std::array::from_fn(|c| b[c][r]));
                    hessian[i * count + j] += inner(a, &turned);
                }
            }
        }
        (gradient, hessian)
    }
}
