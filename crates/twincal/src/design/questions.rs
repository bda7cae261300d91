//! Open questions of a posterior, and what rows of a motion say of them.
//!
//! ```text
//! A = G + G_new + V⁻¹                           precision of the columns in question, after the motion
//! S_q = A_qq − A_qo A_oo⁻¹ A_oq                 of those of one effect, all others free
//! λ_q = tr(S_q E[β_q β_qᵀ | in]) / φ            twice the expected ln Bayes factor for an effect that is there
//! maximise Σ_q ln(1 + λ_q) + ε ln det A
//! ```
//! # Source
//! Box & Hill 1967 (expected information between models); Chaloner & Verdinelli 1995.

use super::information::{Objective, quadratic};
use super::load::Loaded;
use super::sizes;
use crate::error::{Error, Result};
use crate::excitation::States;
use crate::likelihood::JointNoise;
use crate::linear_algebra::{Cholesky, product, product_transposed};
use crate::posterior::{OPEN, Posterior, Problem};
use crate::term::Library;
use crate::twin::Twin;

/// A column takes part in the search from this inclusion probability on.
const ACTIVE: f64 = 0.02;
/// Weight of ln det A beside the questions.
const REST: f64 = 0.02;
/// What is asked of a posterior.
///
/// # Example
/// Effects are asked by name. Without names every effect with a probability between 0.05 and 0.95 is a question.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::design::Questions;
///
/// # let fit = two_link::study()?;
/// let problem = fit.problem.as_ref().ok_or("a twin of a fleet has none")?;
/// let (library, rate) = (fit.twin().library()?, fit.kept_rate_hz());
/// let ask = |name: &str| Questions::new((problem, fit.twin()), (&library, rate), &[name.to_owned()]);
/// assert!(ask("elbow.viscous")?.names().eq(["elbow.viscous"])); // for `Task::questions`
/// assert!(ask("wrist.viscous").is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Questions<'a> {
    pub(super) problem: &'a Problem,
    pub(super) posterior: &'a Posterior,
    pub(super) twin: &'a Twin,
    pub(super) library: &'a Library,
    /// The library in the motion to come.
    pub(super) coming: &'a Library,
    /// What a row of each joint counts, 1/(N·m)² in units of φ.
    factor: Vec<f64>,
    /// Independent rows of each joint per row.
    pub(super) shares: Vec<f64>,
    /// Rows per second that a fit keeps.
    rate: f64,
    /// Columns that take part, ascending.
    pub(super) active: Vec<usize>,
    pub(super) open: Vec<Question>,
}

/// One effect that may be there or not.
#[derive(Debug, Clone)]
pub(super) struct Question {
    pub(super) name: String,
    /// Places among the active columns.
    pub(super) places: Vec<usize>,
    /// Columns that are large or small together: its own, and those of what goes with it.
    pub(super) sized: Vec<u32>,
    /// E[β βᵀ | in].
    second: Vec<f64>,
}

impl<'a> Questions<'a> {
    /// Of a twin's posterior; without `names` every effect whose probability is between 0.05 and 0.95.
    ///
    /// # Errors
    /// [`Error::Setting`] for a name that is no effect with a column, and where nothing is open.
    pub fn new(
        (problem, twin): (&'a Problem, &'a Twin),
        (library, rate): (&'a Library, f64),
        names: &[String],
    ) -> Result<Self> {
        let (posterior, noise) = (&twin.posterior, &twin.noise);
        let name_of = names_of(problem, library);
        require_known(names, &name_of)?;
        let asked = asked(posterior, names, &name_of)?;
        let active: Vec<usize> = (0..posterior.inclusion.len())
            .filter(|&k| {
                posterior.inclusion[k] >= ACTIVE || asked.contains(&problem.prior.component[k])
            })
            .collect();
        let shares = shares(noise);
        let open = asked.into_iter().map(|component| {
            let of = |k: &usize| problem.prior.component[*k] == component;
            let places = (0..active.len()).filter(|&at| of(&active[at])).collect();
            let together =
                |k: &u32| name_of[problem.prior.component[*k as usize]] == name_of[component];
            let sized = (0..problem.names.len() as u32).filter(together).collect();
            Question::new(
                (problem, posterior),
                &name_of[component],
                (places, sized),
                &active,
            )
        });
        Ok(Self {
            open: open.collect(),
            factor: (noise.iter().zip(&shares))
                .map(|(own, share)| own.weight * share)
                .collect(),
            shares,
            problem,
            posterior,
            twin,
            library,
            coming: library,
            rate,
            active,
        })
    }

    /// The same where the robot carries a known load in the motion to come.
    #[must_use]
    pub fn carrying(self, loaded: &'a Loaded) -> Self {
        Self {
            coming: &loaded.library,
            ..self
        }
    }

    /// Names of the effects in question.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.open.iter().map(|own| own.name.as_str())
    }

    /// A over the active columns, in units of 1/φ; the rows of the twin's logs count `logs` times.
    fn precision(&self, logs: f64, sums: &[f64], scale: f64) -> Vec<f64> {
        let (size, all) = (self.active.len(), self.problem.names.len());
        let mut matrix = Vec::with_capacity(size * size);
        for (i, &a) in self.active.iter().enumerate() {
            for (j, &b) in self.active.iter().enumerate() {
                let slab = if i == j {
                    1.0 / self.problem.prior.slab[a]
                } else {
                    0.0
                };
                matrix.push(
                    logs * self.problem.gram[a * all + b] + slab + scale * sums[i * size + j],
                );
            }
        }
        matrix
    }

    /// λ of every question, and ln det A in slab units.
    fn said(&self, sums: &[f64], scale: f64) -> Option<(Vec<f64>, f64)> {
        self.said_beside(1.0, sums, scale)
    }

    /// The same where the rows of the twin's logs count `logs` times.
    pub(super) fn said_beside(
        &self,
        logs: f64,
        sums: &[f64],
        scale: f64,
    ) -> Option<(Vec<f64>, f64)> {
        let size = self.active.len();
        let factor = Cholesky::new(&self.precision(logs, sums, scale), size).ok()?;
        let inverse = factor.inverse();
        let of = |question: &Question| question.lambda(&inverse, size, self.posterior.noise);
        let lambda: Option<Vec<f64>> = self.open.iter().map(of).collect();
        let slab = self.active.iter().map(|&k| self.problem.prior.slab[k].ln());
        Some((lambda?, factor.log_determinant() + slab.sum::<f64>()))
    }

    /// What rows of the motion count as rows of a fit.
    pub(super) fn scale(&self, rows: f64, duration: f64) -> f64 {
        self.rate * duration / rows
    }

    /// Σ f φ φᵀ over states, of some columns.
    pub(super) fn sums_of(
        &self,
        library: &Library,
        columns: &[usize],
        states: &States,
    ) -> Vec<f64> {
        let (len, size) = (states.len, columns.len());
        let mut out = vec![Vec::new(); self.factor.len()];
        library.evaluate(states.motion(), &mut out);
        let mut sums = vec![0.0; size * size];
        for (joint, factor) in self.factor.iter().enumerate() {
            let own = library.columns_of_joint(joint);
            let still = &states.still[joint * len..(joint + 1) * len];
            let used = |(value, still): (&f64, &bool)| if *still { 0.0 } else { *value };
            let (mut places, mut values) = (Vec::new(), Vec::new());
            for (column, signal) in own.iter().zip(out[joint].chunks_exact(len.max(1))) {
                let Ok(at) = columns.binary_search(column) else {
                    continue;
                };
                places.push(at);
                values.extend(signal.iter().zip(still).map(used));
            }
            let count = places.len();
            let products = product_transposed(&values, &values, [count, len, count]);
            for (i, &a) in places.iter().enumerate() {
                for (j, &b) in places.iter().enumerate() {
                    sums[a * size + b] += factor * products[i * count + j];
                }
            }
        }
        sums
    }
}

/// The components that are open or named: what is asked, each name once.
///
/// # Errors
/// [`Error::Setting`] where nothing is open.
fn asked(posterior: &Posterior, names: &[String], name_of: &[String]) -> Result<Vec<usize>> {
    let count = name_of.len();
    let pip = |component: usize| {
        let mut all = posterior.component.iter().zip(&posterior.inclusion);
        all.find(|(own, _)| **own == component)
            .map_or(0.0, |(_, pip)| *pip)
    };
    let is_open = |component: usize| match names.is_empty() {
        true => (OPEN[0]..OPEN[1]).contains(&pip(component)),
        false => names.contains(&name_of[component]),
    };
    // A payload's tensor goes with its mass: one question.
    let is_first = |component: usize| !name_of[..component].contains(&name_of[component]);
    let asked: Vec<usize> = (0..count)
        .filter(|&component| is_open(component) && is_first(component))
        .collect();
    if asked.is_empty() {
        return Err(setting(
            "no effect has a probability between 0.05 and 0.95".into(),
            "name effects with --decide, or give --model for a motion that shows all",
        ));
    }
    Ok(asked)
}

/// Name of every component of a regression.
fn names_of(problem: &Problem, library: &Library) -> Vec<String> {
    let mut name_of = vec![String::new(); problem.prior.components()];
    for (&component, &term) in problem.prior.component.iter().zip(library.columns()) {
        let own = library.terms()[term].component;
        name_of[component].clone_from(&library.components()[own].name);
    }
    name_of
}

/// # Errors
/// Of the first name that is none of those.
fn require_known(names: &[String], known: &[String]) -> Result<()> {
    let Some(name) = names.iter().find(|name| !known.contains(name)) else {
        return Ok(());
    };
    let nearest = crate::robot::did_you_mean(name, known.iter().map(String::as_str));
    let problem = format!("`{name}` is no effect of this twin");
    Err(setting(problem, &nearest))
}

/// What a row of each joint counts; a joint that did not move is taken for the one that counts least.
fn shares(noise: &[JointNoise]) -> Vec<f64> {
    let share = |own: &JointNoise| (own.n > 0.0).then(|| (own.n_eff / own.n).clamp(0.0, 1.0));
    let least = noise.iter().filter_map(share).fold(1.0, f64::min);
    noise
        .iter()
        .map(|own| share(own).unwrap_or(least))
        .collect()
}

impl Question {
    fn new(
        (problem, posterior): (&Problem, &Posterior),
        name: &str,
        (places, sized): (Vec<usize>, Vec<u32>),
        active: &[usize],
    ) -> Self {
        let columns: Vec<u32> = places.iter().map(|&at| active[at] as u32).collect();
        let second = sizes::second_moment((problem, posterior), &columns, &sized);
        Self {
            name: name.to_owned(),
            places,
            sized,
            second,
        }
    }

    /// tr(S E[β βᵀ]) / φ with S⁻¹ the block of A⁻¹.
    fn lambda(&self, inverse: &[f64], size: usize, noise: f64) -> Option<f64> {
        let schur = self.schur(inverse, size)?;
        let trace: f64 = schur.iter().zip(&self.second).map(|(s, b)| s * b).sum();
        Some(trace / noise)
    }

    /// S, the inverse of the effect's block of A⁻¹.
    fn schur(&self, inverse: &[f64], size: usize) -> Option<Vec<f64>> {
        let own = self.places.len();
        let block: Vec<f64> = (self.places.iter())
            .flat_map(|&a| self.places.iter().map(move |&b| inverse[a * size + b]))
            .collect();
        Some(Cholesky::new(&block, own).ok()?.inverse())
    }
}

impl Objective for Questions<'_> {
    fn size(&self) -> usize {
        self.active.len()
    }

    fn of(&self, states: &States) -> Vec<f64> {
        self.sums_of(self.coming, &self.active, states)
    }

    fn of_recorded(&self, states: &States) -> Vec<f64> {
        self.sums_of(self.library, &self.active, states)
    }

    fn value(&self, sums: &[f64], rows: f64, duration: f64) -> f64 {
        let said = self.said(sums, self.scale(rows, duration));
        said.map_or(f64::NEG_INFINITY, |(lambda, rest)| {
            lambda.iter().map(|own| own.ln_1p()).sum::<f64>() + REST * rest
        })
    }

    /// ∂λ/∂A = A⁻¹ Pᵀ S B S P A⁻¹ / φ with P the places of the effect, S its Schur complement and B = E[β βᵀ | in].
    fn gradient(&self, sums: &[f64], rows: f64, duration: f64) -> Option<Vec<f64>> {
        let (size, scale) = (self.active.len(), self.scale(rows, duration));
        let factor = Cholesky::new(&self.precision(1.0, sums, scale), size).ok()?;
        let inverse = factor.inverse();
        let mut gradient: Vec<f64> = inverse.iter().map(|x| REST * scale * x).collect();
        for question in &self.open {
            let count = question.places.len();
            let schur = question.schur(&inverse, size)?;
            let trace: f64 = schur.iter().zip(&question.second).map(|(s, b)| s * b).sum();
            let lambda = trace / self.posterior.noise;
            let left = product(&schur, &question.second, [count; 3]);
            let middle = product(&left, &schur, [count; 3]);
            let rows: Vec<f64> = (question.places.iter())
                .flat_map(|&a| inverse[a * size..(a + 1) * size].iter().copied())
                .collect();
            let through = product(&middle, &rows, [count, count, size]);
            let weight = scale / (self.posterior.noise * (1.0 + lambda));
            for a in 0..size {
                for b in 0..size {
                    let sum: f64 = (0..count)
                        .map(|k| rows[k * size + a] * through[k * size + b])
                        .sum();
                    gradient[a * size + b] += weight * sum;
                }
            }
        }
        Some(gradient)
    }

    fn shown(&self, matrix: &[f64], states: &States) -> Vec<f64> {
        let factor = |joint: usize, _| self.factor[joint].sqrt();
        quadratic(self.coming, &self.active, (matrix, states), factor)
    }
}

fn setting(problem: String, remedy: &str) -> Error {
    Error::Setting {
        key: "design.decide".into(),
        problem,
        remedy: remedy.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A = [[2, 1], [1, 3]]: of the first column 2 − 1/3 is left where the second is free.
    #[test]
    fn what_others_explain_says_nothing_of_an_effect() {
        let inverse = Cholesky::new(&[2.0, 1.0, 1.0, 3.0], 2)
            .expect("positive")
            .inverse();
        let question = Question {
            name: "first".into(),
            places: vec![0],
            sized: vec![0],
            second: vec![0.49],
        };
        let lambda = question.lambda(&inverse, 2, 0.25).expect("a number");
        assert!(
            (lambda - (2.0 - 1.0 / 3.0) * 0.49 / 0.25).abs() < 1e-12,
            "{lambda}"
        );
    }
}
