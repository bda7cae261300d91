//! Which candidates say nothing, or nothing new: judged at random states, so for every motion and not for one log.

use super::candidate::Candidate;
use super::expression::{Bounded, Graph, Variable, bounded_values};
use crate::linear_algebra::dot;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::borrow::Borrow;

/// A column that leaves less than this part of its length outside the span of the columns before it is an alias.
const TOLERANCE: f64 = 1e-9;
/// Shares of an alias smaller than this are rounding.
const SMALLEST_SHARE: f64 = 1e-6;
/// Ranges of the random positions, rad or m: the wider ones are for terms that exist only far out, as `log(q1 - 9)`.
const REACHES: [f64; 3] = [3.2, 30.0, 1000.0];
/// States that are tried in each range, per state that is wanted.
const PATIENCE: usize = 6;

/// What the random states say about one candidate.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Verdict {
    /// A column of its own.
    New,
    /// It or its torque is no finite number at any of so many states.
    NeverFinite(usize),
    /// No torque at any state.
    Null,
    /// Σ factor · candidate has the same torque.
    Combination(Vec<(f64, usize)>),
    /// A column, but it exists at too few states where all others do: not compared with them.
    NotCompared,
}

/// Position, velocity and acceleration of every joint.
pub(super) type Motions = Vec<[f64; 3]>;

/// Positions, velocities and accelerations of all states, `joint * states + state`.
pub(super) fn channels<S: Borrow<Motions>>(states: &[S], joints: usize) -> [Vec<f64>; 3] {
    std::array::from_fn(|k| {
        (0..joints)
            .flat_map(|joint| states.iter().map(move |state| state.borrow()[joint][k]))
            .collect()
    })
}

/// Torque of the candidates that are made from the robot model, `(candidate, torque)` with `torque[state * joints + joint]`.
pub(super) type ModelTorques<'a> = dyn Fn(&[&Motions]) -> Vec<(usize, Vec<f64>)> + 'a;

/// One random state: its motion and the torque of all candidates, `[candidate * joints + joint]`.
struct State {
    motion: Motions,
    torque: Vec<Bounded>,
}

/// Judges all candidates, and removes the image entries that are zero at every state.
///
/// `shares(k)` says that candidate k belongs to a component of several columns. Such columns, those of the robot model and those of
/// [`Family::is_story_of_its_own`](super::Family::is_story_of_its_own) are one story and stay; built-in generic terms that they span
/// are aliases.
pub(super) fn judge(
    graph: &Graph,
    candidates: &mut [Candidate],
    joints: usize,
    shares: &dyn Fn(usize) -> bool,
    model: &ModelTorques<'_>,
) -> Vec<Verdict> {
    let wanted = candidates.len() + 32;
    let pool = pool(graph, candidates, joints, wanted);
    let rows = |k: usize| k * joints..(k + 1) * joints;
    let finite =
        |state: &State, k: usize| state.torque[rows(k)].iter().all(|entry| entry.is_finite());

    let mut verdicts = Vec::with_capacity(candidates.len());
    for (k, candidate) in candidates.iter_mut().enumerate() {
        if candidate.model.is_some() {
            verdicts.push(Verdict::New);
            continue;
        }
        let own: Vec<&State> = pool.iter().filter(|state| finite(state, k)).collect();
        if own.is_empty() {
            verdicts.push(Verdict::NeverFinite(pool.len()));
            continue;
        }
        candidate.image.retain(|&(joint, _)| {
            own.iter()
                .any(|state| !state.torque[k * joints + joint].may_be_zero())
        });
        verdicts.push(if candidate.image.is_empty() {
            Verdict::Null
        } else {
            Verdict::New
        });
    }

    // states at which all columns exist; the rarest columns stand back until there are enough
    let mut live: Vec<usize> = (0..candidates.len())
        .filter(|&k| verdicts[k] == Verdict::New && candidates[k].model.is_none())
        .collect();
    let usable = loop {
        let usable: Vec<&State> = pool
            .iter()
            .filter(|state| live.iter().all(|&k| finite(state, k)))
            .collect();
        let count = |k: usize| pool.iter().filter(|state| finite(state, k)).count();
        let rarest = live
            .iter()
            .copied()
            .min_by_key(|&k| (count(k), std::cmp::Reverse(k)));
        match rarest {
            Some(k) if usable.len() < wanted && count(k) < pool.len() => {
                verdicts[k] = Verdict::NotCompared;
                live.retain(|&other| other != k);
            }
            _ => break usable,
        }
    };

    let usable = &usable[..usable.len().min(wanted)];
    let mut columns: Vec<(usize, Vec<f64>)> = live
        .iter()
        .map(|&k| {
            let torque = usable.iter().flat_map(|state| &state.torque[rows(k)]);
            (k, torque.map(|entry| entry.value).collect())
        })
        .collect();
    let motions: Vec<&Motions> = usable.iter().map(|state| &state.motion).collect();
    columns.extend(model(&motions));
    columns.sort_by_key(|&(k, _)| (candidates[k].family.preference(), k));
    let (order, columns): (Vec<usize>, Vec<Vec<f64>>) = columns.into_iter().unzip();
    for (position, combination) in dependent(columns) {
        let k = order[position];
        let candidate = &candidates[k];
        // The same as one other column it is no story of its own.
        let story = candidate.family.is_story_of_its_own() && combination.len() > 1;
        if shares(k) || candidate.model.is_some() || story {
            continue;
        }
        let combination = combination
            .into_iter()
            .map(|(factor, other)| (factor, order[other]))
            .collect();
        verdicts[k] = Verdict::Combination(combination);
    }
    verdicts
}

/// Random states, until all candidates exist at `wanted` of them; at most a bounded number where they do not.
fn pool(graph: &Graph, candidates: &[Candidate], joints: usize, wanted: usize) -> Vec<State> {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut uniform = move || (random.next_u64() >> 11) as f64 / 2.0_f64.powi(52) - 1.0;
    let (mut pool, mut complete, mut partial) = (Vec::new(), 0, 0);
    for (stage, reach) in REACHES.into_iter().enumerate() {
        for _ in 0..PATIENCE * wanted {
            if complete == wanted {
                return pool;
            }
            let motion: Motions = (0..joints)
                .map(|_| [reach * uniform(), 2.0 * uniform(), 5.0 * uniform()])
                .collect();
            let values = bounded_values(graph, |variable| match variable {
                Variable::Position(joint) => motion[joint][0],
                Variable::Velocity(joint) => motion[joint][1],
                Variable::Acceleration(joint) => motion[joint][2],
            });
            let mut torque = vec![
                Bounded {
                    value: 0.0,
                    error: 0.0
                };
                candidates.len() * joints
            ];
            for (k, candidate) in candidates.iter().enumerate() {
                // log(-q1) has a torque at q1 > 0 but does not exist there
                let exists = candidate
                    .lagrangian
                    .is_none_or(|phi| values[phi.0 as usize].value.is_finite());
                for &(joint, image) in &candidate.image {
                    torque[k * joints + joint] = values[image.0 as usize];
                }
                if !exists {
                    torque[k * joints] = Bounded {
                        value: f64::NAN,
                        error: 0.0,
                    };
                }
            }
            let whole = torque.iter().all(|entry| entry.is_finite());
            if whole {
                complete += 1;
            } else if partial < wanted * (stage + 1) {
                partial += 1;
            } else {
                continue;
            }
            pool.push(State { motion, torque });
        }
    }
    pool
}

/// Columns in the span of those before them, `(position, Σ factor · earlier kept column)`: modified Gram–Schmidt, twice
/// for orthogonality to rounding, in the order given.
pub(super) fn dependent(columns: Vec<Vec<f64>>) -> Vec<(usize, Vec<(f64, usize)>)> {
    let mut kept: Vec<usize> = Vec::new();
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let mut factors: Vec<Vec<f64>> = Vec::new(); // column of R for each kept column, in units of its length
    let mut lengths = vec![0.0; columns.len()];
    let mut found = Vec::new();
    for (position, mut column) in columns.into_iter().enumerate() {
        let length = norm(&column);
        lengths[position] = length;
        if length == 0.0 {
            continue; // judged by itself, see `Verdict::Null`
        }
        column.iter_mut().for_each(|value| *value /= length);
        let mut shares = vec![0.0; basis.len()];
        for _ in 0..2 {
            for (share, direction) in shares.iter_mut().zip(&basis) {
                let along = dot(direction, &column);
                *share += along;
                column
                    .iter_mut()
                    .zip(direction)
                    .for_each(|(value, d)| *value -= along * d);
            }
        }
        let rest = norm(&column);
        if rest > TOLERANCE {
            column.iter_mut().for_each(|value| *value /= rest);
            shares.push(rest);
            basis.push(column);
            factors.push(shares);
            kept.push(position);
            continue;
        }
        // R c = shares, upwards
        for i in (0..shares.len()).rev() {
            shares[i] /= factors[i][i];
            for above in 0..i {
                shares[above] -= factors[i][above] * shares[i];
            }
        }
        let combination = kept
            .iter()
            .zip(&shares)
            .filter(|(_, share)| share.abs() > SMALLEST_SHARE)
            .map(|(&other, share)| (share * length / lengths[other], other))
            .collect();
        found.push((position, combination));
    }
    found
}

/// Euclidean length without overflow.
fn norm(column: &[f64]) -> f64 {
    let largest = column
        .iter()
        .fold(0.0_f64, |largest, value| largest.max(value.abs()));
    if largest == 0.0 {
        return 0.0;
    }
    largest
        * column
            .iter()
            .map(|value| (value / largest).powi(2))
            .sum::<f64>()
            .sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_in_the_span_is_told_with_its_factors() {
        let a = vec![1.0, 2.0, 3.0, 4.0];
        let b = vec![1.0e9, -1.0e9, 0.5e9, 0.0];
        let c: Vec<f64> = a
            .iter()
            .zip(&b)
            .map(|(a, b)| 3.0 * a - 2.0e-9 * b)
            .collect();
        let d = vec![0.0, 0.0, 0.0, 1.0e-12];
        let found = dependent(vec![a, b, c, d]);
        assert_eq!(found.len(), 1);
        let (position, combination) = &found[0];
        assert_eq!((*position, combination.len()), (2, 2));
        assert!(
            (combination[0].0 - 3.0).abs() < 1e-12 && (combination[1].0 + 2.0e-9).abs() < 1e-20
        );
    }
}
