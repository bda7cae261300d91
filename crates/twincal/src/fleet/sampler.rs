//! The posterior of a fleet by blocked Gibbs sampling: effects of the type given the units, units given the type.
//!
//! Both blocks integrate scatter and the size of deviations out. The type's block is the posterior of one spike-and-slab regression,
//! which inference of a calibration answers; a unit's block is [`Prepared::sweep`]. Given the plug-ins the chain has the posterior of
//! [`Hierarchy`] as its stationary distribution, up to models of the type too light to be listed.

use super::deviations::{Conditional, Deviation, Prepared, Rules, State};
use super::hierarchy::{Hierarchy, Unit, factored};
use crate::error::Result;
use crate::infer::{Choice, InferenceSettings, approximate, infer};
use crate::posterior::draws::draw;
use crate::posterior::{Posterior, Problem};
use crate::random::Random;
use rayon::prelude::*;

/// Weight of the prior that holds φ at 1: the noise is in Λ already.
const KNOWN_NOISE: f64 = 1e10;
/// Components up to which the type's block sums every model.
const FEW: usize = 12;
/// Draws of μ that are kept of every iteration.
const KEPT: usize = 16;
/// Sweeps over a unit between two looks at the type.
const SWEEPS: usize = 2;

/// One chain.
pub(super) struct Chain<'a> {
    hierarchy: &'a Hierarchy,
    units: &'a [Prepared],
    /// What all units say of μ where none deviates.
    gram: &'a [f64],
    linear: &'a [f64],
    states: Vec<State>,
    /// Present draw of μ, K.
    pub(super) mu: Vec<f64>,
    seed: u64,
    stream: u64,
    iteration: u64,
    known: Option<(Vec<Vec<Deviation>>, Posterior)>,
}

/// What all units say of μ where none deviates.
pub(super) fn of_type<'u>(units: impl Iterator<Item = &'u Unit>) -> (Vec<f64>, Vec<f64>) {
    let units: Vec<&Unit> = units.collect();
    let own: Vec<(Vec<f64>, Vec<f64>)> = units.par_iter().map(|unit| unit.of_type()).collect();
    let mut sum = own[0].clone();
    for (gram, linear) in &own[1..] {
        (sum.0.iter_mut().zip(gram)).for_each(|(sum, own)| *sum += own);
        (sum.1.iter_mut().zip(linear)).for_each(|(sum, own)| *sum += own);
    }
    sum
}

/// What one iteration says.
pub(super) struct Iteration {
    /// P(z = 1 | states) of each column.
    pub(super) inclusion: Vec<f64>,
    /// Draws of μ, K each.
    pub(super) mu: Vec<Vec<f64>>,
    /// That of them which units were looked at with.
    pub(super) of_units: Vec<f64>,
    /// Unit by unit.
    pub(super) units: Vec<UnitIteration>,
}

/// What one iteration says of one unit.
pub(super) struct UnitIteration {
    /// Of each component that can deviate.
    pub(super) conditional: Vec<Option<Conditional>>,
    /// (deviation, its b over all columns), drawn.
    pub(super) deviations: Vec<(Deviation, Vec<f64>)>,
    /// E[δ | b, μ], K.
    pub(super) offset: Vec<f64>,
}

impl<'a> Chain<'a> {
    pub(super) fn new(
        hierarchy: &'a Hierarchy,
        units: &'a [Prepared],
        (gram, linear): (&'a [f64], &'a [f64]),
        (seed, stream): (u64, u64),
    ) -> Self {
        Self {
            hierarchy,
            units,
            gram,
            linear,
            states: vec![State::default(); units.len()],
            mu: vec![0.0; hierarchy.size()],
            seed,
            stream: stream << 40,
            iteration: 0,
            known: None,
        }
    }

    /// Starts from the states of another chain.
    pub(super) fn with_states(mut self, states: Vec<State>) -> Self {
        self.states = states;
        self.states.iter_mut().for_each(State::forget);
        self
    }

    pub(super) fn into_states(self) -> Vec<State> {
        self.states
    }

    fn rules(&self) -> Rules<'a> {
        Rules {
            columns: &self.hierarchy.columns,
            odds: &self.hierarchy.odds,
            share: self.hierarchy.plug_in.share,
        }
    }

    /// Type given units, then units given the type.
    ///
    /// # Errors
    /// Those of inference.
    pub(super) fn iterate(&mut self) -> Result<Iteration> {
        self.iteration += 1;
        let stream = self.stream + (self.iteration << 20);
        let posterior = self.of_type()?;
        let draws = draw(&posterior, KEPT, self.seed, stream);
        let size = self.hierarchy.size();
        let mu: Vec<Vec<f64>> = (draws.beta.chunks_exact(size))
            .map(<[f64]>::to_vec)
            .collect();
        if let Some(last) = mu.last() {
            self.mu.clone_from(last);
        }
        let (rules, mu_now, seed) = (self.rules(), &self.mu, self.seed);
        let step = |(unit, (prepared, state)): (usize, (&Prepared, &mut State))| {
            let mut random = Random::new(seed, stream + 1 + unit as u64);
            let scores = prepared.unit.scores(mu_now);
            let mut conditional = Vec::new();
            for _ in 0..SWEEPS {
                conditional = prepared.sweep(rules, &scores, state, &mut random);
                prepared.exchange(rules, &scores, state, &mut random);
            }
            let deviations = state.draw(prepared, rules, &scores, Some(&mut random));
            let shift: Vec<(usize, Vec<f64>)> = (deviations.iter())
                .map(|(own, b)| (own.start, b.clone()))
                .collect();
            UnitIteration {
                conditional,
                offset: prepared.unit.offset(mu_now, &shift),
                deviations,
            }
        };
        let pairs = self.units.par_iter().zip(self.states.par_iter_mut());
        let units = pairs.enumerate().map(step).collect();
        Ok(Iteration {
            inclusion: posterior.inclusion,
            mu,
            of_units: self.mu.clone(),
            units,
        })
    }

    /// Posterior of the type given the units' deviations.
    fn of_type(&mut self) -> Result<Posterior> {
        let present: Vec<Vec<Deviation>> = (self.states.iter())
            .map(|state| state.present.clone())
            .collect();
        if let Some((states, posterior)) = &self.known
            && *states == present
        {
            return Ok(posterior.clone());
        }
        let (mut gram, mut linear) = (self.gram.to_vec(), self.linear.to_vec());
        let rules = self.rules();
        let zero = vec![0.0; self.hierarchy.size()];
        for (prepared, state) in self.units.iter().zip(&mut self.states) {
            if state.present.is_empty() {
                continue;
            }
            let scores = prepared.unit.scores(&zero);
            if let Some((own_gram, own_linear)) = state.of_type(prepared, rules, &scores) {
                (gram.iter_mut().zip(own_gram)).for_each(|(sum, own)| *sum -= own);
                (linear.iter_mut().zip(own_linear)).for_each(|(sum, own)| *sum -= own);
            }
        }
        let before = self.known.take().map(|(_, posterior)| posterior);
        let posterior = type_posterior(self.hierarchy, gram, linear, before.as_ref())?;
        self.known = Some((present, posterior.clone()));
        Ok(posterior)
    }
}

/// The posterior of a spike-and-slab regression whose noise is in its sums already.
///
/// # Errors
/// Those of inference.
fn type_posterior(
    hierarchy: &Hierarchy,
    gram: Vec<f64>,
    linear: Vec<f64>,
    before: Option<&Posterior>,
) -> Result<Posterior> {
    let size = hierarchy.size();
    // Residual squares of the full model become 0; only differences between models count.
    let mut full = gram.clone();
    for (i, slab) in hierarchy.prior.slab.iter().enumerate() {
        full[i * size + i] += 1.0 / slab;
    }
    let mut mean = linear.clone();
    factored(full, size).solve(&mut mean);
    let yy = linear.iter().zip(&mean).map(|(r, b)| r * b).sum::<f64>();
    let mut prior = hierarchy.prior.clone();
    (prior.shape, prior.scale) = (KNOWN_NOISE, KNOWN_NOISE);
    let problem = Problem {
        gram,
        xy: linear,
        yy: yy * (1.0 + 1e-9) + 1e-9,
        n: 2.0,
        log_constant: 0.0,
        prior,
        names: hierarchy.names.clone(),
    };
    if hierarchy.prior.components() <= FEW {
        let all = InferenceSettings {
            method: Choice::Exact,
            chains: 1,
            draws: 1,
            seed: 1,
            allow_disagreement: true,
        };
        return infer(&problem, &all);
    }
    approximate(&problem, before)
}
