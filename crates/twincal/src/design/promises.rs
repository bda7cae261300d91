//! What a motion is expected to say of each question: fits to data simulated from the posterior.

use super::questions::{Question, Questions};
use super::sizes;
use super::structural::OtherRecording;
use crate::error::Result;
use crate::excitation::States;
use crate::infer::approximate;
use crate::posterior::{OPEN, Posterior, Problem};
use crate::random::Random;
use rayon::prelude::*;
use serde::Serialize;

/// Robots that are drawn from the posterior to see whether the motion decides.
const WORLDS: usize = 64;
/// Random streams of those worlds and of their noise.
const STREAM: u64 = 11 << 60;
const NOISE: u64 = STREAM + (1 << 40);

/// The motion to come and the recorded one, each with its length in s.
type Motions<'a> = [Option<(&'a States, f64)>; 2];

/// What a motion is expected to say of one question, by simulation from the posterior.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Promise {
    /// Name of the effect.
    pub effect: String,
    /// Its probability now.
    pub pip: f64,
    /// Probability that its PIP leaves 0.05 … 0.95 on the side of the truth.
    pub right: f64,
    /// That it leaves it on the other side.
    pub wrong: f64,
    /// Median sd of its first coefficient afterwards, where it is there.
    pub sd: Option<f64>,
    /// No motion of this robot distinguishes it from the others.
    pub structural: bool,
    /// What does, where it is structural.
    pub decided_by: Vec<OtherRecording>,
}

/// One question in one world.
struct Judged {
    /// `None`: still open.
    right: Option<bool>,
    sd: Option<f64>,
}

impl Questions<'_> {
    /// What motions add to the regression, each with its length in s: sums of all columns, and rows that count as independent.
    fn added(&self, motions: Motions<'_>) -> (Vec<f64>, f64) {
        let all: Vec<usize> = (0..self.problem.names.len()).collect();
        let (mut gram, mut counted) = (vec![0.0; all.len() * all.len()], 0.0);
        for (motion, library) in motions.into_iter().zip([self.coming, self.library]) {
            let Some((states, seconds)) = motion else {
                continue;
            };
            let scale = self.scale(states.len.max(1) as f64, seconds);
            let own = self.sums_of(library, &all, states);
            (gram.iter_mut().zip(own)).for_each(|(sum, own)| *sum += scale * own);
            let joints = self
                .shares
                .iter()
                .zip(states.still.chunks(states.len.max(1)));
            for (share, still) in joints {
                let rows = still.iter().filter(|still| !**still).count();
                counted += share * scale * rows as f64;
            }
        }
        (gram, counted)
    }

    /// Whether motions decide each question, in worlds drawn from the posterior.
    ///
    /// # Errors
    /// Those of inference.
    pub(super) fn promises(
        &self,
        (motions, random): (Motions<'_>, &States),
        seed: u64,
    ) -> Result<Vec<Promise>> {
        let (gram, counted) = self.added(motions);
        let sized: Vec<&[u32]> = self.open.iter().map(|own| own.sized.as_slice()).collect();
        let known = (self.problem, self.posterior);
        let robots = sizes::robots(known, &sized, (WORLDS, seed, STREAM));
        let judged: Vec<Vec<Judged>> = robots
            .par_iter()
            .enumerate()
            .map(|(world, (beta, noise))| {
                let mut random = Random::new(seed, NOISE + world as u64);
                let problem = self.after(&gram, (beta, *noise), counted, &mut random);
                let posterior = approximate(&problem, Some(self.posterior))?;
                Ok(self.judged(beta, &posterior))
            })
            .collect::<Result<_>>()?;
        let structural = self.structural(random)?;
        let promise = |(at, question): (usize, &Question)| {
            let own: Vec<&Judged> = judged.iter().map(|world| &world[at]).collect();
            let share = |side: Option<bool>| {
                own.iter().filter(|own| own.right == side).count() as f64 / own.len().max(1) as f64
            };
            let mut sds: Vec<f64> = own.iter().filter_map(|own| own.sd).collect();
            sds.sort_by(f64::total_cmp);
            let first = self.active[question.places[0]];
            Promise {
                effect: question.name.clone(),
                pip: self.posterior.inclusion[first],
                right: share(Some(true)),
                wrong: share(Some(false)),
                sd: sds.get(sds.len() / 2).copied(),
                structural: structural[at].is_some(),
                decided_by: structural[at].clone().unwrap_or_default(),
            }
        };
        Ok(self.open.iter().enumerate().map(promise).collect())
    }

    /// The regression with rows of the motion added: r = G β + φ^½ L ξ.
    fn after(
        &self,
        gram: &[f64],
        (beta, noise): (&[f64], f64),
        counted: f64,
        random: &mut Random,
    ) -> Problem {
        let size = beta.len();
        let mut problem = self.problem.clone();
        let shaken = shaken(gram, size, random);
        let (mut explained, mut cross) = (0.0, 0.0);
        for a in 0..size {
            let row = &gram[a * size..(a + 1) * size];
            let through: f64 = row.iter().zip(beta).map(|(g, b)| g * b).sum();
            explained += beta[a] * through;
            cross += beta[a] * shaken[a];
            problem.xy[a] += through + noise.sqrt() * shaken[a];
        }
        (problem.gram.iter_mut().zip(gram)).for_each(|(sum, own)| *sum += own);
        problem.yy += explained + 2.0 * noise.sqrt() * cross + noise * counted;
        problem.n += counted;
        problem
    }

    /// Each question in one world.
    fn judged(&self, beta: &[f64], posterior: &Posterior) -> Vec<Judged> {
        let of = |question: &Question| {
            let first = self.active[question.places[0]];
            let is_there = (question.places.iter()).any(|&at| beta[self.active[at]] != 0.0);
            let pip = posterior.inclusion[first];
            let said = match pip {
                pip if pip >= OPEN[1] => Some(true),
                pip if pip <= OPEN[0] => Some(false),
                _ => None,
            };
            Judged {
                right: said.map(|said| said == is_there),
                sd: is_there.then(|| posterior.sd[first]),
            }
        };
        self.open.iter().map(of).collect()
    }
}

/// A draw of N(0, G) from any positive semidefinite G, by a Cholesky decomposition that leaves out what has no power.
fn shaken(gram: &[f64], size: usize, random: &mut Random) -> Vec<f64> {
    let mut lower = vec![0.0_f64; size * size];
    for k in 0..size {
        let row = |a: usize| a * size;
        let square: f64 = (0..k).map(|j| lower[row(k) + j].powi(2)).sum();
        let pivot = gram[row(k) + k] - square;
        if pivot <= 1e-12 * gram[row(k) + k] {
            continue;
        }
        let root = pivot.sqrt();
        for a in k..size {
            let product: f64 = (0..k).map(|j| lower[row(a) + j] * lower[row(k) + j]).sum();
            lower[row(a) + k] = (gram[row(a) + k] - product) / root;
        }
    }
    let normal: Vec<f64> = (0..size).map(|_| random.normal()).collect();
    let rows = lower.chunks_exact(size.max(1));
    rows.map(|row| row.iter().zip(&normal).map(|(l, x)| l * x).sum())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Second moments of 20 000 draws within 5 standard errors (false alarm 4e-6 in all, the seed is fixed); the third row is the sum of the
    /// others.
    #[test]
    fn noise_of_rows_has_their_covariance_where_columns_depend_too() {
        let gram = [2.0, 0.5, 2.5, 0.5, 1.0, 1.5, 2.5, 1.5, 4.0];
        let mut random = Random::new(3, 0);
        let draws: Vec<Vec<f64>> = (0..20_000).map(|_| shaken(&gram, 3, &mut random)).collect();
        for (place, wanted) in gram.iter().enumerate() {
            let (a, b) = (place / 3, place % 3);
            let sum: f64 = draws.iter().map(|draw| draw[a] * draw[b]).sum();
            let error = ((gram[4 * a] * gram[4 * b] + wanted * wanted) / 20_000.0).sqrt();
            assert!((sum / 20_000.0 - wanted).abs() < 5.0 * error, "{a} {b}");
        }
        assert!(
            draws
                .iter()
                .all(|draw| (draw[0] + draw[1] - draw[2]).abs() < 1e-9)
        );
    }
}
