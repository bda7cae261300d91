//! The noise of a log's torque as a few numbers: copies of a log, and of a part of it, are found where the logs themselves are gone.
//!
//! A pattern is the signs of a joint's fourth differences ([`Signature`]) at 32 rows, [`SPACING`] apart: a copy has the same ones wherever it begins.
//! Of each joint's patterns those with the smallest hashes are kept. They are a random sample, the same for the same patterns, so that two logs
//! share of it what they share of all. Independent noise shares 2⁻³²; where a copy was rounded and signs agree with probability p it is p³².
//!
//! # Source
//! Broder 1997, "On the resemblance and containment of documents".

use super::signature::{MOST_JOINTS, SPACING, Signature, Signs};
use crate::error::{Code, Finding, Result, Severity};
use crate::signal::Log;
use crate::words::significant;
use std::collections::BTreeMap;

/// Changes of sign from which a pattern is noise: smooth torque has fewer, noise 16 ± 3.
const CHANGES: u32 = 8;
/// Patterns of a joint that are kept.
const MOST: usize = 1024;
/// Patterns among which those that repeat are counted: 2 % of them are 328 ± 18.
const COUNTED: usize = 16 * MOST;
/// Above every hash.
const ALL_HASHES: u64 = 1 << 53;
/// Patterns below which a joint is not judged.
const FEWEST: usize = 16;
/// Share of the patterns of the median joint from which a log is a copy.
const COPY: f64 = 0.1;
/// Share of the patterns that may repeat in a log whose joint is judged: of independent noise hardly any do, and as many as repeat are in
/// another log.
const REPEATED: f64 = 0.02;
/// Other logs with the same pattern that a log is compared with.
const NEIGHBOURS: usize = 4;

/// Which noise a log's torque has.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Sketch {
    /// Hashes of each joint, ascending.
    joints: Vec<Vec<u64>>,
}

impl Sketch {
    /// Of a log; without a hash of joints that show no noise.
    ///
    /// # Errors
    /// Of chapters that cannot be read.
    pub fn of(log: &Log<'_>, joints: usize) -> Result<Self> {
        let rows = Signature::of(log)?.rows;
        let of_joint = |joint: usize| match joint < MOST_JOINTS {
            true => least(&patterns(&rows, joint)),
            false => Vec::new(),
        };
        Ok(Self {
            joints: (0..joints).map(of_joint).collect(),
        })
    }

    /// Hashes of a joint, which a double holds exactly.
    #[must_use]
    pub fn numbers(&self, joint: usize) -> Vec<f64> {
        let hashes = self.joints.get(joint).map_or(&[][..], Vec::as_slice);
        hashes.iter().map(|hash| *hash as f64).collect()
    }

    /// From the hashes of each joint; `None` if they are none.
    #[must_use]
    pub fn of_numbers(joints: &[Vec<f64>]) -> Option<Self> {
        let sound = |own: &Vec<f64>| {
            let whole = own.iter().all(|hash| hash.fract() == 0.0 && *hash >= 0.0);
            whole && own.len() <= MOST && own.is_sorted_by(|one, next| one < next)
        };
        let hashes = |own: &Vec<f64>| own.iter().map(|hash| *hash as u64).collect();
        (joints.iter().all(sound)).then(|| Self {
            joints: joints.iter().map(hashes).collect(),
        })
    }

    /// Share of the patterns that the median joint has in common with another log, of the shorter of the two.
    fn shared(&self, other: &Self) -> Option<f64> {
        let pairs = self.joints.iter().zip(&other.joints);
        let mut shares: Vec<f64> = pairs.filter_map(|(a, b)| share(a, b)).collect();
        shares.sort_by(f64::total_cmp);
        shares.get(shares.len().saturating_sub(1) / 2).copied()
    }
}

/// Patterns of a joint, in the order of rows.
fn patterns(rows: &[Signs], joint: usize) -> Vec<u32> {
    let (mut signs, mut known) = ([0_u32; SPACING], [0_u32; SPACING]);
    let mut found = Vec::new();
    for (at, row) in rows.iter().enumerate() {
        let lane = at % SPACING;
        signs[lane] = signs[lane] << 1 | (row.positive >> joint & 1);
        known[lane] = known[lane] << 1 | (row.known >> joint & 1);
        let changes = (signs[lane] ^ signs[lane] >> 1) << 1;
        if known[lane] == u32::MAX && changes.count_ones() >= CHANGES {
            found.push(signs[lane]);
        }
    }
    found
}

/// The smallest hashes of patterns; none where they repeat, as those of ripple or of mains hum over little noise do: another log has as many
/// of them by chance as the log itself has twice. Hashes below a bound are a random sample of all patterns, and equal ones are in it together:
/// how many repeat is counted among [`COUNTED`] of them.
fn least(patterns: &[u32]) -> Vec<u64> {
    let share = COUNTED as f64 / patterns.len().max(1) as f64;
    let bound = (share.min(1.0) * ALL_HASHES as f64) as u64;
    let mut hashes: Vec<u64> = patterns.iter().map(|own| hash(*own)).collect();
    hashes.retain(|hash| *hash < bound);
    let all = hashes.len();
    hashes.sort_unstable();
    hashes.dedup();
    if ((all - hashes.len()) as f64) > REPEATED * all as f64 {
        return Vec::new();
    }
    hashes.truncate(MOST);
    // A log of ten minutes had 16 times as many.
    hashes.shrink_to_fit();
    hashes
}

/// 53 bits of the finaliser of SplitMix64 (Steele, Lea and Flood 2014).
fn hash(pattern: u32) -> u64 {
    let mut z = u64::from(pattern).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) >> 11
}

/// Share of the shorter list that the other one holds, as far as both go.
fn share(a: &[u64], b: &[u64]) -> Option<f64> {
    let end = |own: &[u64]| own.last().filter(|_| own.len() == MOST).copied();
    let end = [a, b].into_iter().filter_map(end).min().unwrap_or(u64::MAX);
    let [a, b] = [a, b].map(|own| &own[..own.partition_point(|hash| *hash <= end)]);
    let shorter = a.len().min(b.len());
    let common = a
        .iter()
        .filter(|hash| b.binary_search(hash).is_ok())
        .count();
    (shorter >= FEWEST).then(|| common as f64 / shorter as f64)
}

/// A finding for every log that is a copy of one before it or of a part of it, severity [`Severity::Degraded`]. Logs to fit come first.
#[must_use]
pub fn sketched_copies(logs: &[(&str, &Sketch)]) -> Vec<Finding> {
    let mut of: BTreeMap<usize, (usize, f64)> = BTreeMap::new();
    for [first, second] in met(logs) {
        let Some(share) = logs[first].1.shared(logs[second].1) else {
            continue;
        };
        if share >= COPY {
            of.entry(second).or_insert((first, share));
        }
    }
    let finding = |(second, (first, share)): (usize, (usize, f64))| {
        let (log, other) = (logs[second].0, logs[first].0);
        let percent = significant(100.0 * share, 2);
        let message = format!(
            "log `{log}` is a copy of `{other}` or of a part of it: {percent} % of the patterns in its torque noise are in both (independent recordings \
             have hardly any); nothing is tested by a copy: give another recording instead of it"
        );
        Finding::new(Severity::Degraded, Code::CopiedLog, log, message, 0).with([("share", share)])
    };
    of.into_iter().map(finding).collect()
}

/// Pairs of logs, the earlier first, that have some pattern of a joint in common.
fn met(logs: &[(&str, &Sketch)]) -> Vec<[usize; 2]> {
    let joints = logs.iter().map(|(_, own)| own.joints.len()).max();
    let mut pairs = Vec::new();
    for joint in 0..joints.unwrap_or(0) {
        let mut all: Vec<(u64, u32)> = Vec::new();
        for (log, (_, sketch)) in logs.iter().enumerate() {
            let hashes = sketch.joints.get(joint).map_or(&[][..], Vec::as_slice);
            all.extend(hashes.iter().map(|hash| (*hash, log as u32)));
        }
        all.sort_unstable();
        for alike in all.chunk_by(|a, b| a.0 == b.0) {
            for (at, (_, second)) in alike.iter().enumerate() {
                let before = alike[..at].iter().take(NEIGHBOURS);
                pairs.extend(before.map(|(_, first)| [*first as usize, *second as usize]));
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}
