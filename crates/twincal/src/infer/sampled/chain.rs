//! One chain: structure with the free coefficients integrated out, then coefficients, variances and autocorrelation.
//!
//! ```text
//! z, β_bounded | σ², ρ      one component after the other, exchanges between components that are alike
//! β_free | z, β_bounded, σ², ρ      normal
//! σ_g² | β, ρ               inverse gamma
//! ρ_j | β, σ²               slice sampling (Neal 2003) on (−1, 1)
//! ```
//! A bounded coefficient is never integrated out with the free ones: given the other bounded ones its law is a normal cut off
//! at its bound, whose mass is known. A component of several bounded columns is born and dies in a Metropolis step whose
//! proposal draws one column after the other (Geweke 1991; Hajivassiliou & McFadden 1998), see [`super::orthant`].

use super::orthant::Orthant;
use super::planted::planted;
use super::sweep::Sweep;
use super::target::{Noise, Squares, Target};
use crate::error::Result;
use crate::linear_algebra::Cholesky;
use crate::random::Random;

/// Exchanges that a transition proposes; most are void.
const EXCHANGES: usize = 4;
/// Shrinking steps of the slice sampler at most: the interval is below rounding long before.
const SHRINKS: usize = 200;

/// A chain and where it is.
pub(super) struct Chain<'a> {
    target: &'a Target<'a>,
    sweep: Sweep,
    /// Precision and right-hand side before anything was swept.
    matrix: Vec<f64>,
    rhs: Vec<f64>,
    /// Components that are in.
    pub(super) holds: Vec<bool>,
    /// P(z_c = 1 | all else) as drawn last.
    pub(super) conditional: Vec<f64>,
    /// β, natural units, 0 where out.
    pub(super) beta: Vec<f64>,
    pub(super) noise: Noise,
    /// Components in, per family, and family sizes.
    members: Vec<usize>,
    sizes: Vec<usize>,
    /// β/s of bounded columns that are in.
    held: Vec<f64>,
    random: Random,
}

impl<'a> Chain<'a> {
    /// A chain at a given noise and structure.
    pub(super) fn new(
        target: &'a Target<'a>,
        noise: Noise,
        holds: Vec<bool>,
        random: Random,
    ) -> Self {
        let prior = target.prior;
        let mut members = vec![0; prior.families()];
        for (c, _) in holds.iter().enumerate().filter(|(_, inside)| **inside) {
            members[prior.family[c]] += 1;
        }
        Self {
            target,
            sweep: Sweep::new(Vec::new(), Vec::new()),
            matrix: Vec::new(),
            rhs: Vec::new(),
            conditional: vec![0.0; holds.len()],
            holds,
            beta: vec![0.0; target.size()],
            held: vec![0.0; target.size()],
            noise,
            members,
            sizes: prior.family_sizes(),
            random,
        }
    }

    /// Starts a chain from given coefficients (natural units).
    #[cfg(test)]
    pub(super) fn at(mut self, beta: &[f64]) -> Self {
        self.beta.copy_from_slice(beta);
        for k in 0..beta.len() {
            if self.bounded(k) {
                self.held[k] = beta[k] / self.target.slab[k];
            }
        }
        self
    }

    /// One transition.
    ///
    /// # Errors
    /// [`crate::Error::NotFinite`] if the statistics are those of no data.
    pub(super) fn step(&mut self) -> Result<()> {
        self.refresh();
        for component in 0..self.holds.len() {
            self.visit(component);
        }
        for _ in 0..EXCHANGES {
            self.exchange();
        }
        self.draw_coefficients()?;
        self.draw_noise();
        Ok(())
    }

    fn bounded(&self, column: usize) -> bool {
        self.target.prior.lower[column] > f64::NEG_INFINITY
    }

    /// Whether a component's columns have bounds: all of them or none.
    fn is_bounded(&self, component: usize) -> bool {
        self.bounded(self.target.columns[component][0])
    }

    /// Statistics at the present noise with the present structure.
    fn refresh(&mut self) {
        (self.matrix, self.rhs) = self.target.precision(&self.noise);
        self.sweep = Sweep::new(self.matrix.clone(), self.rhs.clone());
        for component in 0..self.holds.len() {
            if !self.holds[component] {
                continue;
            }
            for &k in &self.target.columns[component] {
                if self.bounded(k) {
                    self.sweep.hold(k, self.held[k]);
                } else {
                    self.sweep.flip(k, false);
                }
            }
        }
    }

    /// ln of the evidence for a free component, its coefficients integrated out.
    fn log_bayes(&self, component: usize) -> f64 {
        let columns = &self.target.columns[component];
        let sign = if self.holds[component] { -1.0 } else { 1.0 };
        if let [k] = columns[..] {
            let (d, g) = (sign * self.sweep.at(k, k), self.sweep.rhs[k]);
            return 0.5 * (g * g / d - sign * planted!(1, d, d * d).ln());
        }
        let mut g: Vec<f64> = columns.iter().map(|&k| self.sweep.rhs[k]).collect();
        match Cholesky::new(&self.block(component, sign), columns.len()) {
            Ok(factor) => {
                factor.solve_lower(&mut g);
                let square: f64 = g.iter().map(|x| x * x).sum();
                0.5 * (square - sign * factor.log_determinant())
            }
            // Rounding left no block to speak of: what is in stays in.
            Err(_) => f64::INFINITY,
        }
    }

    /// `sign` times the square of T that belongs to a component.
    fn block(&self, component: usize, sign: f64) -> Vec<f64> {
        let columns = &self.target.columns[component];
        columns
            .iter()
            .flat_map(|&i| columns.iter().map(move |&j| (i, j)))
            .map(|(i, j)| sign * self.sweep.at(i, j))
            .collect()
    }

    /// The law of a bounded component that is out; `None` if rounding left none.
    fn orthant(&self, component: usize) -> Option<Orthant> {
        let columns = &self.target.columns[component];
        let lower = |&k: &usize| self.target.prior.lower[k] / self.target.slab[k];
        Orthant::new(
            &self.block(component, 1.0),
            columns.iter().map(|&k| self.sweep.rhs[k]).collect(),
            columns.iter().map(lower).collect(),
        )
    }

    /// `P(z_c = 1)/P(z_c = 0)` given the others, a priori: 0 without the parent, infinite below a child.
    fn odds(&self, component: usize) -> f64 {
        let prior = self.target.prior;
        if prior.parent_of(component).is_some_and(|p| !self.holds[p]) {
            return 0.0;
        }
        if self.target.children[component]
            .iter()
            .any(|&c| self.holds[c])
        {
            return f64::INFINITY;
        }
        let family = self.target.prior.family[component];
        let own = usize::from(self.holds[component]);
        let others = self.members[family] - planted!(2, own, 0);
        let decided = self.sizes[family] - planted!(2, 1, 0);
        let (p, q) = prior.next(family, others, decided);
        p / q
    }

    /// A free component comes in.
    fn enter(&mut self, component: usize) {
        for &k in &self.target.columns[component] {
            self.sweep.flip(k, false);
        }
        self.count(component, true);
    }

    /// A bounded component comes in with given coefficients, in units of the slab.
    fn enter_with(&mut self, component: usize, values: &[f64]) {
        for (&k, &value) in self.target.columns[component].iter().zip(values) {
            self.held[k] = value;
            self.sweep.hold(k, value);
        }
        self.count(component, true);
    }

    fn leave(&mut self, component: usize) {
        for &k in &self.target.columns[component] {
            if self.bounded(k) {
                self.sweep.hold(k, -self.held[k]);
                self.held[k] = 0.0;
            } else {
                self.sweep.flip(k, true);
            }
        }
        self.count(component, false);
    }

    fn count(&mut self, component: usize, inside: bool) {
        self.holds[component] = inside;
        let members = &mut self.members[self.target.prior.family[component]];
        if inside {
            *members += 1;
        } else {
            *members -= 1;
        }
    }

    /// z of one component, and β with it where that is bounded.
    fn visit(&mut self, component: usize) {
        if self.is_bounded(component) {
            return self.visit_bounded(component);
        }
        let log_odds = self.log_bayes(component) + self.odds(component).ln();
        let probability = 1.0 / (1.0 + (-log_odds).exp());
        self.conditional[component] = probability;
        let inside = self.random.uniform() < probability;
        match (self.holds[component], inside) {
            (false, true) => self.enter(component),
            (true, false) => self.leave(component),
            _ => {}
        }
    }

    /// One column: drawn from its conditional law, mass and all. Several: born or dying, then drawn one by one.
    fn visit_bounded(&mut self, component: usize) {
        let columns = &self.target.columns[component];
        let now: Option<Vec<f64>> = self.holds[component].then(|| {
            let values = columns.iter().map(|&k| self.held[k]).collect();
            self.leave(component);
            values
        });
        let Some(law) = self.orthant(component) else {
            self.conditional[component] = 0.0;
            return;
        };
        let prior = self.odds(component).ln();
        let inside = if columns.len() == 1 {
            let values = law.propose(&mut self.random);
            let probability = 1.0 / (1.0 + (-prior - law.log_weight(&values)).exp());
            self.conditional[component] = probability;
            (self.random.uniform() < probability).then_some(values)
        } else {
            let born = now.is_none();
            let values = now.unwrap_or_else(|| law.propose(&mut self.random));
            let log_odds = prior + law.log_weight(&values);
            let accepted = self.random.uniform().ln() < if born { log_odds } else { -log_odds };
            let inside = born == accepted;
            self.conditional[component] = f64::from(u8::from(inside));
            inside.then(|| law.stir(values, &mut self.random))
        };
        if let Some(values) = inside {
            self.enter_with(component, &values);
        }
    }

    /// Proposes that one free component takes the place of another.
    fn exchange(&mut self) {
        let pairs = &self.target.pairs;
        if pairs.is_empty() {
            return;
        }
        let at = (self.random.uniform() * pairs.len() as f64) as usize;
        let (a, b) = pairs[at.min(pairs.len() - 1)];
        if self.holds[a] == self.holds[b] {
            return;
        }
        let (out, into) = if self.holds[a] { (a, b) } else { (b, a) };
        self.leave(out);
        let gain = |component: usize| self.log_bayes(component) + self.odds(component).ln();
        let (lost, won) = (gain(out), gain(into));
        let taken = self.random.uniform().ln() < won - planted!(3, lost, 0.0);
        self.enter(if taken { into } else { out });
    }

    /// β of the free columns that are in, all at once.
    fn draw_coefficients(&mut self) -> Result<()> {
        let (target, size) = (self.target, self.target.size());
        self.beta.fill(0.0);
        let inside = (0..size).filter(|&k| self.holds[target.prior.component[k]]);
        let (fixed, free): (Vec<usize>, Vec<usize>) = inside.partition(|&k| self.bounded(k));
        let matrix: Vec<f64> = free
            .iter()
            .flat_map(|&i| free.iter().map(move |&j| (i, j)))
            .map(|(i, j)| self.matrix[i * size + j])
            .collect();
        let factor =
            Cholesky::new(&matrix, free.len()).map_err(|error| crate::Error::NotFinite {
                what: "Cholesky factor of a model".into(),
                column: free[error.pivot].to_string(),
                remedy: "remove one of the columns that are equal on these data".into(),
            })?;
        let mut theta: Vec<f64> = free
            .iter()
            .map(|&i| {
                let held = |k: &usize| self.matrix[i * size + k] * self.held[*k];
                let explained: f64 = fixed.iter().map(held).sum();
                self.rhs[i] - planted!(7, explained, 0.0)
            })
            .collect();
        // L⁻ᵀ(L⁻¹ b + ε) = A⁻¹ b + L⁻ᵀ ε
        factor.solve_lower(&mut theta);
        theta.iter_mut().for_each(|x| *x += self.random.normal());
        factor.solve_upper(&mut theta);
        for (&k, theta) in free.iter().zip(&theta) {
            self.beta[k] = theta * target.slab[k];
        }
        for k in fixed {
            self.beta[k] = self.held[k] * target.slab[k];
        }
        Ok(())
    }

    /// σ² of every group, then ρ of every joint.
    fn draw_noise(&mut self) {
        let target = self.target;
        let squares: Vec<Squares> = (0..target.grams.len())
            .map(|joint| target.squares(joint, &self.beta))
            .collect();
        for (g, &(shape, scale)) in target.noise.iter().enumerate() {
            let own = (0..squares.len()).filter(|&j| target.group[j] == g);
            let (rows, sum) = own.fold((0.0, 0.0), |(rows, sum), j| {
                (
                    rows + target.grams[j].n,
                    sum + squares[j].at(self.noise.rho[j]),
                )
            });
            self.noise.variance[g] = self.random.inverse_gamma(
                shape + planted!(5, 0.5, 1.0) * rows,
                planted!(11, scale, 0.0) + 0.5 * sum,
            );
        }
        if !target.autoregressive {
            return;
        }
        for (j, squares) in squares.iter().enumerate() {
            let variance = self.noise.variance[target.group[j]];
            let starts = planted!(4, target.grams[j].starts, 0.0);
            let log_density =
                |rho: f64| 0.5 * starts * (-rho * rho).ln_1p() - 0.5 * squares.at(rho) / variance;
            self.noise.rho[j] = slice(self.noise.rho[j], log_density, &mut self.random);
        }
    }
}

/// One step of a slice sampler on (−1, 1) that begins with the whole interval and shrinks it towards `now`.
fn slice(now: f64, log_density: impl Fn(f64) -> f64, random: &mut Random) -> f64 {
    let height = random.uniform().ln();
    let level = log_density(now) + planted!(10, height, 0.0);
    let (mut low, mut high) = (-1.0, 1.0);
    for _ in 0..SHRINKS {
        let proposed = low + (high - low) * random.uniform();
        if proposed.abs() < 1.0 && log_density(proposed) >= level {
            return proposed;
        }
        if proposed < now {
            low = proposed;
        } else {
            high = proposed;
        }
    }
    now
}
