//! Logs that are copies of others: shifted in time, cut, rounded, or with noise added. Judged by the noise of torque, not by the path.
//!
//! 1. Rows whose signs agree on a whole key ([`Signature::keys`]) are brought together by sorting; pairs of logs with three of them at one
//!    offset are looked at. Work and memory are linear in the rows of all logs but for the sorting.
//! 2. At that offset the signs of all rows that both logs have are compared, joint by joint, and positions at some of them.
//!
//! Recordings of one programme have the same path, and independent noise: correlation 0. A copy with noise of up to half its own has 0.8 and more.
//! The limit of 0.5 is that of the median joint, so that repeatable ripple of a few joints makes no copy.

use super::signature::{MOST_JOINTS, Signature};
use crate::error::{Code, Finding, Result, Severity};
use crate::signal::{Log, Recording, median_step};
use crate::words::significant;
use rayon::prelude::*;
use std::f64::consts::FRAC_PI_2;

/// Correlation of the median joint's noise from which a log is a copy.
const COPY: f64 = 0.5;
/// Standard deviations of the agreement of independent signs: probability 6e-16 per pair and offset that is looked at.
const CLEAR: f64 = 8.0;
/// Variance of a sum of agreements over that of independent ones: fourth differences of white noise are correlated over two rows.
const INFLATION: f64 = 1.84;
/// Signs of a joint below which it is not judged.
const FEWEST: u64 = 64;
/// Keys at one offset from which it is looked at.
const HITS: usize = 3;
/// Offsets of one pair that are looked at.
const OFFSETS: usize = 8;
/// Rows of other logs with the same key that a row is brought together with.
const NEIGHBOURS: usize = 4;
/// Bits of a key: as many values as rows, four times over, within these.
const BITS: std::ops::RangeInclusive<u32> = 16..=30;
/// Rows at which positions are compared.
const PLACES: usize = 64;
/// Share of a joint's sd by which positions of a copy may differ: rounding and noise, not another path.
const SAME_PATH: f64 = 0.05;

/// Two logs that may be the same from an offset on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Candidate {
    /// The earlier of the two.
    first: u32,
    second: u32,
    /// Row of the first minus that of the second.
    offset: i64,
}

/// What two logs have in common.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Match {
    candidate: Candidate,
    /// Rows that both have.
    rows: usize,
    /// Correlation of the median joint's noise, and its sd for independent recordings.
    correlation: f64,
    chance: f64,
}

/// A finding for every log that is a copy of one before it, severity [`Severity::Degraded`]. Logs to fit come first.
///
/// # Errors
/// Of chapters that cannot be read.
pub fn copies(logs: &[Log<'_>]) -> Result<Vec<Finding>> {
    if logs.len() < 2 {
        return Ok(Vec::new());
    }
    let signatures: Vec<Signature> = logs.par_iter().map(Signature::of).collect::<Result<_>>()?;
    let mut found: Vec<Match> = candidates(&signatures)
        .par_iter()
        .filter_map(|candidate| matched(&signatures, *candidate))
        .collect();
    // The longest common part of each log with the first log that it is a copy of.
    found.sort_by_key(|own| {
        (
            own.candidate.second,
            own.candidate.first,
            usize::MAX - own.rows,
        )
    });
    let mut findings: Vec<Finding> = Vec::new();
    let mut last = None;
    for own in found {
        let Candidate { first, second, .. } = own.candidate;
        let pair = [&logs[first as usize], &logs[second as usize]];
        if last != Some(second) && same_path(pair, &own)? {
            findings.push(finding(pair, &own)?);
            last = Some(second);
        }
    }
    Ok(findings)
}

/// Pairs and offsets at which rows of two logs share keys.
fn candidates(signatures: &[Signature]) -> Vec<Candidate> {
    let all: usize = signatures.iter().map(|own| own.rows.len()).sum();
    let bits = (all.max(1).ilog2() + 2).clamp(*BITS.start(), *BITS.end());
    let mut keys: Vec<(u32, u32, u32)> = signatures
        .par_iter()
        .enumerate()
        .flat_map_iter(|(log, own)| {
            let keys = own.keys(bits).into_iter();
            keys.map(move |(key, row)| (key, log as u32, row))
        })
        .collect();
    keys.par_sort_unstable();
    let mut hits = Vec::new();
    for bucket in keys.chunk_by(|a, b| a.0 == b.0) {
        for (index, &(_, second, row)) in bucket.iter().enumerate() {
            let before = bucket[..index].iter().rev();
            let others = before.filter(|(_, log, _)| *log != second);
            hits.extend(others.take(NEIGHBOURS).map(|&(_, first, other)| Candidate {
                first,
                second,
                offset: i64::from(other) - i64::from(row),
            }));
        }
    }
    hits.par_sort_unstable();
    let mut often: Vec<(Candidate, usize)> = (hits.chunk_by(|a, b| a == b))
        .filter(|alike| alike.len() >= HITS)
        .map(|alike| (alike[0], alike.len()))
        .collect();
    often.sort_by_key(|(own, hits)| (own.first, own.second, usize::MAX - hits, own.offset));
    let pairs = often.chunk_by(|(a, _), (b, _)| (a.first, a.second) == (b.first, b.second));
    pairs
        .flat_map(|pair| pair.iter().take(OFFSETS).map(|(own, _)| *own))
        .collect()
}

/// Compares the signs of all common rows; `None` where they are as independent ones.
fn matched(signatures: &[Signature], candidate: Candidate) -> Option<Match> {
    let [first, second] = [candidate.first, candidate.second].map(|log| &signatures[log as usize]);
    let from = usize::try_from(candidate.offset.max(0)).ok()?;
    let to = usize::try_from((-candidate.offset).max(0)).ok()?;
    let pairs = || (first.rows.iter().skip(from)).zip(second.rows.iter().skip(to));
    let (mut known, mut agree) = ([0_u64; MOST_JOINTS], [0_u64; MOST_JOINTS]);
    for (a, b) in pairs() {
        let both = a.known & b.known;
        let same = both & !(a.positive ^ b.positive);
        for (joint, (known, agree)) in known.iter_mut().zip(&mut agree).enumerate() {
            *known += u64::from(both >> joint & 1);
            *agree += u64::from(same >> joint & 1);
        }
    }
    let judged = || (0..MOST_JOINTS).filter(|&joint| known[joint] >= FEWEST);
    let total =
        |counts: &[u64; MOST_JOINTS]| judged().map(|joint| counts[joint]).sum::<u64>() as f64;
    let (all, alike) = (total(&known), total(&agree));
    let clear = alike - 0.5 * all > CLEAR * 0.5 * (INFLATION * all).sqrt();
    let share = |joint: usize| agree[joint] as f64 / known[joint] as f64;
    let mut correlations: Vec<f64> = judged()
        .map(|joint| (FRAC_PI_2 * (2.0 * share(joint) - 1.0)).sin())
        .collect();
    correlations.sort_by(f64::total_cmp);
    let correlation = *correlations.get(correlations.len().saturating_sub(1) / 2)?;
    let signs = all / correlations.len() as f64;
    (clear && correlation >= COPY).then(|| Match {
        candidate,
        rows: pairs().count(),
        correlation,
        chance: FRAC_PI_2 * (INFLATION / signs).sqrt(),
    })
}

/// Whether the positions of most joints are the same at common rows.
fn same_path(pair: [&Log<'_>; 2], found: &Match) -> Result<bool> {
    let offset = found.candidate.offset;
    let starts = [offset.max(0), (-offset).max(0)].map(|row| row as usize);
    let step = found.rows.div_ceil(PLACES).max(1);
    let places: Vec<usize> = (0..found.rows).step_by(step).collect();
    let at = |log: usize| positions(pair[log], &places, starts[log]);
    let [first, second] = [at(0)?, at(1)?];
    let same = |(a, b): &(&Vec<f64>, &Vec<f64>)| {
        let len = a.len().min(b.len()).max(1) as f64;
        let mean = a.iter().sum::<f64>() / len;
        let sd = (a.iter().map(|q| (q - mean).powi(2)).sum::<f64>() / len).sqrt();
        let pairs = a.iter().zip(*b);
        let difference = (pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>() / len).sqrt();
        // What does not move says nothing.
        difference <= SAME_PATH * sd || difference == 0.0
    };
    let joints = first.len();
    let alike = first.iter().zip(&second).filter(same).count();
    Ok(2 * alike > joints)
}

/// Positions of each joint at `start + place`, for places that ascend.
fn positions(log: &Log<'_>, places: &[usize], start: usize) -> Result<Vec<Vec<f64>>> {
    let mut found: Vec<Vec<f64>> = Vec::new();
    let (mut seen, mut next) = (0, 0);
    log.until(|recording: &Recording| {
        found.resize(recording.joints.len(), Vec::new());
        let len = recording.time.len();
        while let Some(row) = places.get(next).map(|place| start + place)
            && row < seen + len
        {
            for (own, channels) in found.iter_mut().zip(&recording.joints) {
                own.push(channels.q[row - seen]);
            }
            next += 1;
        }
        seen += len;
        next == places.len()
    })?;
    Ok(found)
}

fn finding([first, second]: [&Log<'_>; 2], found: &Match) -> Result<Finding> {
    let step = second.any_recording(|recording| Ok(median_step(&recording.time)))?;
    let seconds = step.unwrap_or(0.0) * found.rows as f64;
    let Match {
        candidate,
        rows,
        correlation,
        chance,
    } = *found;
    let [here, there] = match candidate.offset {
        later if later >= 0 => [1, later + 1],
        earlier => [1 - earlier, 1],
    };
    Ok(Finding::new(
        Severity::Degraded,
        Code::CopiedLog,
        second.name(),
        format!(
            "log `{}` is a copy of `{}`: {} s of both have the same torque noise (correlation {correlation:.2}, independent recordings have 0 ± \
             {chance:.2}), from row {here} here and row {there} there; nothing is tested by a copy: give another recording instead of it",
            second.name(),
            first.name(),
            significant(seconds, 3),
        ),
        rows as u64,
    )
    .with([
        ("seconds", seconds), ("correlation", correlation), ("correlation_sd", chance),
        ("first_row", here as f64), ("first_row_of_original", there as f64),
    ]))
}

#[cfg(test)]
mod tests;
