//! Which candidates say nothing, or nothing new: judged at random states, so for every motion and not for one log.

use super::candidate::Candidate;
use super::course::anything;
use super::expression::{Bounded, Graph, Id, Variable, bounded_values};
use super::motions::Motions;
use crate::linear_algebra::dot;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// A column that leaves less than this part of its length outside the span of the columns before it is an alias.
const TOLERANCE: f64 = 1e-9;
/// Shares of an alias smaller than this are rounding.
const SMALLEST_SHARE: f64 = 1e-6;
/// Ranges of the random positions, rad or m: the wider ones are for terms that exist only far out, as `log(q1 - 9)`.
const REACHES: [f64; 3] = [3.2, 30.0, 1000.0];
/// States that are tried in each range, per state that is wanted.
const PATIENCE: usize = 6;

/// Rows per random sum of them from which on sums do.
const MANY_ROWS: usize = 8;
/// Sums that a row is added to.
const HASHES: usize = 4;
/// States whose torques are held at a time.
const CHUNK: usize = 64;

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

/// Torque of the candidates that are made from the robot model, `(candidate, torque)` with `torque[state * joints + joint]`.
pub(super) type ModelTorques<'a> = dyn Fn(&[&Motions]) -> Vec<(usize, Vec<f64>)> + 'a;

/// One random state: its motion and the torque of all candidates that are expressions, by [`Entries`].
struct State {
    motion: Motions,
    torque: Vec<Bounded>,
    /// log(-q1) has a torque at q1 > 0 but does not exist there.
    exists: Vec<bool>,
}

/// Where the torque of a candidate on a joint stands in [`State::torque`]: of hundreds of candidates on dozens of joints few act.
struct Entries {
    /// Of each candidate, first entry and the joints of its entries.
    of: Vec<(usize, Vec<usize>)>,
    count: usize,
}

impl Entries {
    fn new(candidates: &[Candidate]) -> Self {
        let (mut of, mut count) = (Vec::with_capacity(candidates.len()), 0);
        for candidate in candidates {
            let joints: Vec<usize> = candidate.image.iter().map(|entry| entry.0).collect();
            of.push((count, joints));
            count += candidate.image.len();
        }
        Self { of, count }
    }

    fn range(&self, k: usize) -> std::ops::Range<usize> {
        let (first, joints) = &self.of[k];
        *first..first + joints.len()
    }
}

impl State {
    fn is_finite(&self, entries: &Entries, k: usize) -> bool {
        self.exists[k] && (self.torque[entries.range(k)].iter()).all(|entry| entry.is_finite())
    }
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
    let pool = Pool::new(graph, candidates, joints);
    let mut verdicts = pool.by_themselves(candidates);
    let mut live: Vec<usize> = (0..candidates.len())
        .filter(|&k| verdicts[k] == Verdict::New && candidates[k].model.is_none())
        .collect();
    let states = pool.compared(&mut live, &mut verdicts);
    let mut columns = pool.rows(&states, &live, model).columns;
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

/// Random states, with the torque of all candidates that are expressions.
struct Pool {
    states: Vec<State>,
    entries: Entries,
    joints: usize,
    /// States at which columns are compared.
    wanted: usize,
}

impl Pool {
    fn new(graph: &Graph, candidates: &[Candidate], joints: usize) -> Self {
        let wanted = candidates.len() + 32;
        let entries = Entries::new(candidates);
        Self {
            states: pool(graph, candidates, &entries, (joints, wanted)),
            entries,
            joints,
            wanted,
        }
    }

    /// States at which a candidate is a number.
    fn of(&self, k: usize) -> impl Iterator<Item = &State> {
        let finite = move |state: &&State| state.is_finite(&self.entries, k);
        self.states.iter().filter(finite)
    }

    /// Judges each candidate without the others, and removes the image entries that are zero at every state.
    fn by_themselves(&self, candidates: &mut [Candidate]) -> Vec<Verdict> {
        let judged = |(k, candidate): (usize, &mut Candidate)| {
            if candidate.model.is_some() {
                return Verdict::New;
            }
            let own: Vec<&State> = self.of(k).collect();
            if own.is_empty() {
                return Verdict::NeverFinite(self.states.len());
            }
            let mut entry = self.entries.range(k);
            candidate.image.retain(|_| {
                let at = entry.next().unwrap_or_default();
                own.iter().any(|state| !state.torque[at].may_be_zero())
            });
            match candidate.image.is_empty() {
                true => Verdict::Null,
                false => Verdict::New,
            }
        };
        candidates.iter_mut().enumerate().map(judged).collect()
    }

    /// States at which all columns exist; the rarest columns stand back until there are enough.
    fn compared(&self, live: &mut Vec<usize>, verdicts: &mut [Verdict]) -> Vec<&State> {
        loop {
            let all_exist = |state: &&State| {
                let mut live = live.iter();
                live.all(|&k| state.is_finite(&self.entries, k))
            };
            let usable: Vec<&State> = self.states.iter().filter(all_exist).collect();
            let count = |k: usize| self.of(k).count();
            let rarest = live
                .iter()
                .copied()
                .min_by_key(|&k| (count(k), std::cmp::Reverse(k)));
            match rarest {
                Some(k) if usable.len() < self.wanted && count(k) < self.states.len() => {
                    verdicts[k] = Verdict::NotCompared;
                    live.retain(|&other| other != k);
                }
                _ => return usable.into_iter().take(self.wanted).collect(),
            }
        }
    }

    /// Torque of all columns at some states, row by row.
    fn rows(&self, states: &[&State], live: &[usize], model: &ModelTorques<'_>) -> Sketch {
        let joints = self.joints;
        let mut rows = Sketch::new(states.len() * joints, self.entries.of.len());
        for (chunk, states) in states.chunks(CHUNK).enumerate() {
            let first = chunk * CHUNK * joints;
            for &k in live {
                let (start, acting) = &self.entries.of[k];
                for (state, own) in states.iter().enumerate() {
                    for (joint, entry) in acting.iter().zip(&own.torque[*start..]) {
                        rows.add(k, first + state * joints + joint, entry.value);
                    }
                }
            }
            let motions: Vec<&Motions> = states.iter().map(|state| &state.motion).collect();
            for (k, torque) in model(&motions) {
                for (row, value) in torque.into_iter().enumerate() {
                    rows.add(k, first + row, value);
                }
            }
        }
        rows
    }
}

/// Random states, until all candidates exist at `wanted` of them; at most a bounded number where they do not.
fn pool(
    graph: &Graph,
    candidates: &[Candidate],
    entries: &Entries,
    (joints, wanted): (usize, usize),
) -> Vec<State> {
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
                Variable::History(channel) => {
                    anything(channel, motion.iter().map(|joint| joint[0]).sum())
                }
            });
            let mut torque = Vec::with_capacity(entries.count);
            let mut exists = Vec::with_capacity(candidates.len());
            for candidate in candidates {
                let finite = |phi: Id| values[phi.0 as usize].value.is_finite();
                exists.push(candidate.lagrangian.is_none_or(finite));
                let images = candidate.image.iter();
                torque.extend(images.map(|&(_, image)| values[image.0 as usize]));
            }
            let whole = exists.iter().all(|exists| *exists)
                && torque.iter().all(|entry: &Bounded| entry.is_finite());
            if whole {
                complete += 1;
            } else if partial < wanted * (stage + 1) {
                partial += 1;
            } else {
                continue;
            }
            pool.push(State {
                motion,
                torque,
                exists,
            });
        }
    }
    pool
}

/// The rows of all columns, or where they are far more than columns random sums of them.
///
/// Each row is added with a random sign to [`HASHES`] of `2 K + 64` sums. What depends on others does so in the sums as well, and what does not keeps
/// its distance from their span up to a factor near 1 (Nelson & Nguyên 2013, OSNAP): far from where [`TOLERANCE`] decides.
struct Sketch {
    columns: Vec<(usize, Vec<f64>)>,
    /// Place of each candidate in `columns`.
    place: Vec<Option<usize>>,
    rows: usize,
    /// Sums; `None`: rows as they are.
    sums: Option<usize>,
}

impl Sketch {
    fn new(rows: usize, columns: usize) -> Self {
        let sums = 2 * columns + 64;
        Self {
            columns: Vec::new(),
            place: vec![None; columns],
            rows,
            sums: (rows > MANY_ROWS * sums).then_some(sums),
        }
    }

    fn add(&mut self, column: usize, row: usize, value: f64) {
        let at = *self.place[column].get_or_insert_with(|| {
            self.columns
                .push((column, vec![0.0; self.sums.unwrap_or(self.rows)]));
            self.columns.len() - 1
        });
        let own = &mut self.columns[at].1;
        let Some(sums) = self.sums else {
            own[row] = value;
            return;
        };
        if value == 0.0 {
            return;
        }
        for hash in 0..HASHES {
            let number = mixed((row * HASHES + hash) as u64);
            let sign = if number >> 63 == 1 { -1.0 } else { 1.0 };
            own[(number % sums as u64) as usize] += sign * value;
        }
    }
}

/// Random bits of a number: the output function of SplitMix64 (Steele, Lea & Flood 2014).
fn mixed(number: u64) -> u64 {
    let z = number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
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

    /// 40 columns of 8000 rows, each on some rows only; the last two are combinations: sums of rows say the same as the rows, and factors agree to 1e-9.
    #[test]
    fn random_sums_of_rows_say_what_the_rows_say() {
        let (count, rows) = (40, 8000);
        let number = |i: usize| (1.0 + 0.37 * (i as f64).powf(1.3)).sin();
        let acts = |k: usize, row: usize| row % 8 == k % 8 || (k.is_multiple_of(3) && row % 8 < 4);
        let mut columns: Vec<Vec<f64>> = (0..count)
            .map(|k| {
                let value = |row: usize| match acts(k, row) {
                    true => number(k * rows + row),
                    false => 0.0,
                };
                (0..rows).map(value).collect()
            })
            .collect();
        for (to, from) in [(38, [3, 17]), (39, [0, 9])] {
            columns[to] = (0..rows)
                .map(|row| 2.0 * columns[from[0]][row] - 0.5 * columns[from[1]][row])
                .collect();
        }
        let mut sketch = Sketch::new(rows, count);
        assert!(sketch.sums.is_some());
        for (k, column) in columns.iter().enumerate() {
            for (row, value) in column.iter().enumerate() {
                sketch.add(k, row, *value);
            }
        }
        let sums: Vec<Vec<f64>> = sketch.columns.into_iter().map(|(_, sums)| sums).collect();
        let (of_rows, of_sums) = (dependent(columns), dependent(sums));
        assert_eq!(of_rows.len(), 2);
        for ((a, rows), (b, sums)) in of_rows.iter().zip(&of_sums) {
            assert_eq!((a, rows.len()), (b, sums.len()));
            for ((x, i), (y, j)) in rows.iter().zip(sums) {
                assert!(i == j && (x - y).abs() < 1e-9, "{x} {y}");
            }
        }
        assert_eq!(of_sums.len(), 2);
    }

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
