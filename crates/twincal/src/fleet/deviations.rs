//! Which deviations a unit has, given what its type has: one Gibbs step per component over "none" and every start and size.

use super::hierarchy::{SCALES, Unit, dot, factored};
use crate::linear_algebra::{Cholesky, symmetric_eigen};
use crate::random::Random;

/// A component that deviates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Deviation {
    pub(super) component: usize,
    /// Among the unit's own windows; 0: from the first on.
    pub(super) start: usize,
    /// Index in [`SCALES`].
    pub(super) scale: usize,
}

/// Probabilities of one component's states given all others.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Conditional {
    /// P(w = 1).
    pub(super) deviates: f64,
    /// P(s = start, w = 1), start by start.
    pub(super) starts: Vec<f64>,
}

/// Information of one component from one start, with its eigenvalues λ_i and vectors v_i, row by row.
#[derive(Debug, Clone, PartialEq)]
struct Alone {
    information: Vec<f64>,
    values: Vec<f64>,
    vectors: Vec<f64>,
}

impl Alone {
    fn new(information: Vec<f64>, size: usize) -> Self {
        let (values, vectors) = eigen(&information, size);
        Self {
            information,
            values,
            vectors,
        }
    }
}

/// What a unit's states are weighed with, as long as the plug-ins stay.
#[derive(Debug, Clone)]
pub(super) struct Prepared {
    pub(super) unit: Unit,
    /// Of each component and start.
    alone: Vec<Vec<Alone>>,
}

/// A unit with its present deviations.
#[derive(Debug, Clone, Default)]
pub(super) struct State {
    /// By component.
    pub(super) present: Vec<Deviation>,
    known: Option<Known>,
}

/// Sums over the columns that deviate.
#[derive(Debug, Clone)]
struct Known {
    /// (column, start, scale) of every one.
    columns: Vec<(usize, usize, usize)>,
    /// [`Unit::shared`] of every one.
    shared: Vec<Vec<Vec<f64>>>,
    /// Of (H + S⁻¹).
    factor: Cholesky,
}

/// The prior of a unit's deviations.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rules<'a> {
    pub(super) columns: &'a [Vec<usize>],
    /// o_c.
    pub(super) odds: &'a [f64],
    /// π.
    pub(super) share: f64,
}

impl Rules<'_> {
    fn probability(&self, component: usize) -> f64 {
        (self.share * self.odds[component]).min(0.5)
    }

    /// ln P(start, scale | deviates).
    fn log_prior(starts: usize, start: usize) -> f64 {
        let of_start = match (starts, start) {
            (1, _) => 1.0,
            (_, 0) => 0.5,
            (all, _) => 0.5 / (all - 1) as f64,
        };
        (of_start / SCALES.len() as f64).ln()
    }
}

impl Prepared {
    pub(super) fn new(unit: Unit, rules: Rules<'_>) -> Self {
        let of = |columns: &Vec<usize>, start: usize| {
            Alone::new(unit.information(columns, start), columns.len())
        };
        let components = rules.columns.iter().zip(rules.odds);
        let alone = components
            .map(|(columns, odds)| match *odds > 0.0 {
                true => (0..unit.starts()).map(|s| of(columns, s)).collect(),
                false => Vec::new(),
            })
            .collect();
        Self { unit, alone }
    }

    /// One step for every component that can deviate, in order; with the probabilities that each was drawn from.
    pub(super) fn sweep(
        &self,
        rules: Rules<'_>,
        scores: &[Vec<f64>],
        state: &mut State,
        random: &mut Random,
    ) -> Vec<Option<Conditional>> {
        let components = 0..rules.columns.len();
        components
            .map(|component| {
                (rules.odds[component] > 0.0)
                    .then(|| self.step(component, rules, scores, state, random))
            })
            .collect()
    }

    /// One of the present deviations, drawn at random, becomes what the data say of it, given that there is one in its place: of any
    /// component that does not deviate, from any start. Single steps hardly lead from one cause to another that looks like it.
    pub(super) fn exchange(
        &self,
        rules: Rules<'_>,
        scores: &[Vec<f64>],
        state: &mut State,
        random: &mut Random,
    ) {
        if state.present.is_empty() {
            return;
        }
        let place = (random.uniform() * state.present.len() as f64) as usize;
        let leaving = state.present[place].component;
        state.remove(leaving);
        let free: Vec<usize> = (0..rules.columns.len())
            .filter(|&c| rules.odds[c] > 0.0 && state.of(c).is_none())
            .collect();
        let known = state.known(self, rules);
        let known = known.map(|known| (known, known.solved(scores)));
        let mut weights = Vec::new();
        for &component in &free {
            self.weigh(component, rules, scores, known.as_ref(), &mut weights);
        }
        let largest = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        weights.iter_mut().for_each(|w| *w = (*w - largest).exp());
        let at = drawn(&weights, random.uniform() * weights.iter().sum::<f64>());
        let (own, of) = (at % self.states(), at / self.states());
        state.insert(Deviation {
            component: free[of],
            start: own / SCALES.len(),
            scale: own % SCALES.len(),
        });
    }

    /// Starts times scales.
    fn states(&self) -> usize {
        self.unit.starts() * SCALES.len()
    }

    /// ln of the posterior odds of every start and scale of a component against none, given all other deviations.
    fn weigh(
        &self,
        component: usize,
        rules: Rules<'_>,
        scores: &[Vec<f64>],
        known: Option<&(&Known, Vec<f64>)>,
        weights: &mut Vec<f64>,
    ) {
        let starts = self.unit.starts();
        let columns = &rules.columns[component];
        let odds = rules.probability(component) / (1.0 - rules.probability(component));
        for start in 0..starts {
            let own = &self.alone[component][start];
            let factors = match known {
                Some((known, solved)) => beside((own, columns), start, scores, (known, solved)),
                None => {
                    let score: Vec<f64> = columns.iter().map(|&k| scores[start][k]).collect();
                    log_factors(own, &score)
                }
            };
            let prior = Rules::log_prior(starts, start) + odds.ln();
            weights.extend(factors.map(|log| log + prior));
        }
    }

    fn step(
        &self,
        component: usize,
        rules: Rules<'_>,
        scores: &[Vec<f64>],
        state: &mut State,
        random: &mut Random,
    ) -> Conditional {
        let before = state.of(component);
        if before.is_some() {
            state.remove(component);
        }
        let known = state.known(self, rules);
        let known = known.map(|known| (known, known.solved(scores)));
        let mut weights = Vec::new();
        self.weigh(component, rules, scores, known.as_ref(), &mut weights);
        let largest = weights.iter().copied().fold(0.0, f64::max);
        let none = (-largest).exp();
        weights.iter_mut().for_each(|w| *w = (*w - largest).exp());
        let total = none + weights.iter().sum::<f64>();
        let left = random.uniform() * total - none;
        if left >= 0.0 {
            let at = drawn(&weights, left);
            state.insert(Deviation {
                component,
                start: at / SCALES.len(),
                scale: at % SCALES.len(),
            });
        }
        let of_start = weights.chunks_exact(SCALES.len());
        Conditional {
            deviates: 1.0 - none / total,
            starts: of_start
                .map(|own| own.iter().sum::<f64>() / total)
                .collect(),
        }
    }
}

/// The place where the running sum of weights passes `left`.
fn drawn(weights: &[f64], mut left: f64) -> usize {
    for (at, weight) in weights.iter().enumerate() {
        left -= weight;
        if left < 0.0 {
            return at;
        }
    }
    weights.len() - 1
}

/// ln of the Bayes factor for each scale beside other deviations, which are integrated out.
fn beside(
    (own, columns): (&Alone, &[usize]),
    start: usize,
    scores: &[Vec<f64>],
    (known, solved): (&Known, &[f64]),
) -> [f64; SCALES.len()] {
    let size = columns.len();
    let cross: Vec<Vec<f64>> = (columns.iter())
        .map(|&k| known.shared.iter().map(|own| own[start][k]).collect())
        .collect();
    let score: Vec<f64> = (columns.iter().zip(&cross))
        .map(|(&k, cross)| scores[start][k] - dot(cross, solved))
        .collect();
    let half: Vec<Vec<f64>> = (cross.into_iter())
        .map(|mut cross| {
            known.factor.solve_lower(&mut cross);
            cross
        })
        .collect();
    let mut information = own.information.clone();
    for a in 0..size {
        for b in 0..size {
            information[a * size + b] -= dot(&half[a], &half[b]);
        }
    }
    log_factors(&Alone::new(information, size), &score)
}

/// ln of the Bayes factor of a component for each scale: Σ_i −½ ln(1 + g²λ_i) + ½ g² (v_iᵀg)²/(1 + g²λ_i).
fn log_factors(own: &Alone, score: &[f64]) -> [f64; SCALES.len()] {
    let size = score.len();
    let mut factors = [0.0; SCALES.len()];
    for (value, vector) in own.values.iter().zip(own.vectors.chunks_exact(size)) {
        let along = dot(vector, score).powi(2);
        for (factor, scale) in factors.iter_mut().zip(SCALES) {
            let gain = 1.0 + scale * value.max(0.0);
            *factor += 0.5 * (scale * along / gain - gain.ln());
        }
    }
    factors
}

/// Eigenvalues and vectors, row by row, of a small matrix.
fn eigen(matrix: &[f64], size: usize) -> (Vec<f64>, Vec<f64>) {
    if size == 1 {
        return (vec![matrix[0]], vec![1.0]);
    }
    let none = || (vec![0.0; size], vec![0.0; size * size]);
    symmetric_eigen(matrix, size).unwrap_or_else(none)
}

impl State {
    fn of(&self, component: usize) -> Option<Deviation> {
        let mut all = self.present.iter();
        all.find(|own| own.component == component).copied()
    }

    fn remove(&mut self, component: usize) {
        self.present.retain(|own| own.component != component);
        self.known = None;
    }

    fn insert(&mut self, found: Deviation) {
        self.present.push(found);
        self.present.sort();
        self.known = None;
    }

    /// After a change of the plug-ins.
    pub(super) fn forget(&mut self) {
        self.known = None;
    }

    fn known(&mut self, prepared: &Prepared, rules: Rules<'_>) -> Option<&Known> {
        if self.present.is_empty() {
            return None;
        }
        if self.known.is_none() {
            self.known = Some(Known::new(&prepared.unit, &self.present, rules.columns));
        }
        self.known.as_ref()
    }

    /// E[b | states, μ] or a draw of it: (start, b over all columns) of every deviation.
    pub(super) fn draw(
        &mut self,
        prepared: &Prepared,
        rules: Rules<'_>,
        scores: &[Vec<f64>],
        random: Option<&mut Random>,
    ) -> Vec<(Deviation, Vec<f64>)> {
        let size = scores[0].len();
        let present = self.present.clone();
        let Some(known) = self.known(prepared, rules) else {
            return Vec::new();
        };
        let mut b = known.solved(scores);
        if let Some(random) = random {
            let mut noise: Vec<f64> = b.iter().map(|_| random.normal()).collect();
            known.factor.solve_upper(&mut noise);
            b.iter_mut().zip(noise).for_each(|(b, noise)| *b += noise);
        }
        let mut values = b.into_iter();
        (present.into_iter())
            .map(|own| {
                let mut all = vec![0.0; size];
                for &k in &rules.columns[own.component] {
                    all[k] = values.next().unwrap_or(0.0);
                }
                (own, all)
            })
            .collect()
    }

    /// What the deviations take from what the unit says of its type: H_1X Q H_X1 and H_1X Q g_X, to subtract.
    pub(super) fn of_type(
        &mut self,
        prepared: &Prepared,
        rules: Rules<'_>,
        scores: &[Vec<f64>],
    ) -> Option<(Vec<f64>, Vec<f64>)> {
        let size = scores[0].len();
        let known = self.known(prepared, rules)?;
        let solved = known.solved(scores);
        let mut linear = vec![0.0; size];
        for (own, x) in known.shared.iter().zip(&solved) {
            (linear.iter_mut().zip(&own[0])).for_each(|(sum, h)| *sum += h * x);
        }
        // Column by column of H_X1: L⁻¹ of what each type column shares with the deviations.
        let half: Vec<f64> = (0..size)
            .flat_map(|k| {
                let mut cross: Vec<f64> = known.shared.iter().map(|own| own[0][k]).collect();
                known.factor.solve_lower(&mut cross);
                cross
            })
            .collect();
        let inner = known.columns.len();
        let gram = crate::linear_algebra::product_transposed(&half, &half, [size, inner, size]);
        Some((gram, linear))
    }
}

impl Known {
    fn new(unit: &Unit, present: &[Deviation], all: &[Vec<usize>]) -> Self {
        let columns: Vec<(usize, usize, usize)> = (present.iter())
            .flat_map(|own| {
                let columns = all[own.component].iter();
                columns.map(|&k| (k, own.start, own.scale))
            })
            .collect();
        let shared: Vec<Vec<Vec<f64>>> = (columns.iter())
            .map(|&(column, start, _)| unit.shared(column, start))
            .collect();
        let size = columns.len();
        let mut matrix = vec![0.0; size * size];
        for (b, own) in shared.iter().enumerate() {
            for (a, &(column, start, _)) in columns.iter().enumerate() {
                matrix[a * size + b] = own[start][column];
            }
        }
        for (a, &(_, _, scale)) in columns.iter().enumerate() {
            matrix[a * size + a] += 1.0 / SCALES[scale];
        }
        let factor = factored(matrix, size);
        Self {
            columns,
            shared,
            factor,
        }
    }

    /// (H_X + S⁻¹)⁻¹ g_X.
    fn solved(&self, scores: &[Vec<f64>]) -> Vec<f64> {
        let own = self.columns.iter();
        let mut b: Vec<f64> = own.map(|&(k, start, _)| scores[start][k]).collect();
        self.factor.solve(&mut b);
        b
    }
}
