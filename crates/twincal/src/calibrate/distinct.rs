//! Logs that are in a set once: not under two names, and not at the same time.

use crate::error::{Error, Result};
use std::fmt;

/// Stamps behind it are seconds since 1970, s: September 2001.
const ABSOLUTE: f64 = 1e9;

/// What distinguishes logs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Identity<'a> {
    /// Name of the log.
    pub name: &'a str,
    /// SHA-256 of its file, or empty.
    pub source: &'a str,
    /// First and last stamp, s; behind 10⁹ since 1970.
    pub ends: [f64; 2],
    /// Checksum (FNV-1a) of torque, residual torque and rows of each stretch: another recording has another one.
    pub sums: u64,
}

/// The checksum FNV-1a of 64 bits.
///
/// # Source
/// Fowler, Noll and Vo 1991.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fnv(u64);

impl Fnv {
    pub(super) fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    /// Adds a number, its lowest byte first.
    pub(super) fn add(&mut self, number: u64) {
        self.add_bytes(&number.to_le_bytes());
    }

    fn add_bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    pub(super) fn sum(self) -> u64 {
        self.0
    }
}

impl fmt::Write for Fnv {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.add_bytes(text.as_bytes());
        Ok(())
    }
}

/// Two logs that cannot both be there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Clash {
    /// Their places in the list.
    pub logs: [usize; 2],
    /// Why, by name.
    pub problem: String,
}

/// Two of these logs of one robot that are one log, under one name or two, or that overlap in time (by absolute stamps), in n ln n steps for n
/// logs; two of the same names for any order of them.
#[must_use]
pub fn clash(logs: &[Identity<'_>]) -> Option<Clash> {
    let mut all: Vec<(usize, Identity<'_>)> = logs.iter().copied().enumerate().collect();
    all.sort_by(|(_, a), (_, b)| a.name.cmp(b.name));
    let found = |pair: [(usize, Identity<'_>); 2], problem: String| {
        let logs = pair.map(|(place, _)| place);
        Some(Clash { logs, problem })
    };
    if let Some(pair) = first_pair(&all, |a, b| a.name == b.name) {
        return found(pair, format!("log `{}` is there twice", pair[0].1.name));
    }
    // The sorts that follow keep the order of names.
    let named = all.clone();
    all.sort_by(|(_, a), (_, b)| a.source.cmp(b.source));
    let same_file = first_pair(&all, |a, b| !a.source.is_empty() && a.source == b.source);
    all.clone_from(&named);
    all.sort_by_key(|(_, own)| own.sums);
    if let Some(pair) = same_file.or_else(|| first_pair(&all, |a, b| a.sums == b.sums)) {
        let [one, other] = pair.map(|(_, own)| own.name);
        return found(
            pair,
            format!("log `{other}` is log `{one}` under another name"),
        );
    }
    overlap(&named)
}

/// The first two of these logs, which come with their places, that overlap in time by absolute stamps.
fn overlap(logs: &[(usize, Identity<'_>)]) -> Option<Clash> {
    let mut all = logs.to_vec();
    all.retain(|(_, own)| own.ends[0] > ABSOLUTE);
    all.sort_by(|(_, a), (_, b)| a.ends[0].total_cmp(&b.ends[0]));
    // Of those that began before, the one that ends last.
    let mut last: Option<(usize, Identity<'_>)> = None;
    for own in all {
        if let Some(before) = last.filter(|before| own.1.ends[0] < before.1.ends[1]) {
            let both = before.1.ends[1].min(own.1.ends[1]) - own.1.ends[0];
            let names = [before.1.name, own.1.name];
            let problem = format!(
                "logs `{}` and `{}` overlap in time by {both:.1} s",
                names[0], names[1]
            );
            let logs = [before.0, own.0];
            return Some(Clash { logs, problem });
        }
        last = match last {
            Some(before) if before.1.ends[1] >= own.1.ends[1] => Some(before),
            _ => Some(own),
        };
    }
    None
}

/// # Errors
/// [`Error::Statistics`] where two of these logs [`clash`].
pub(super) fn require_distinct(logs: &[Identity<'_>]) -> Result<()> {
    match clash(logs) {
        None => Ok(()),
        Some(Clash { problem, .. }) => Err(Error::Statistics {
            problem,
            remedy: "give every log once".into(),
        }),
    }
}

/// # Errors
/// [`Error::Statistics`] where a held-out log overlaps in time with a fitted one or another.
pub(super) fn require_apart(logs: &[Identity<'_>]) -> Result<()> {
    let placed: Vec<(usize, Identity<'_>)> = logs.iter().copied().enumerate().collect();
    match overlap(&placed) {
        None => Ok(()),
        Some(Clash { problem, .. }) => Err(Error::Statistics {
            problem,
            remedy: "hold out logs that the fit does not see, and each once".into(),
        }),
    }
}

/// The first two neighbours that are the same.
fn first_pair<'a>(
    logs: &[(usize, Identity<'a>)],
    same: impl Fn(&Identity<'a>, &Identity<'a>) -> bool,
) -> Option<[(usize, Identity<'a>); 2]> {
    let mut pairs = logs.array_windows();
    pairs.find(|[(_, a), (_, b)]| same(a, b)).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log<'a>(name: &'a str, source: &'a str, ends: [f64; 2], sums: u64) -> Identity<'a> {
        Identity {
            name,
            source,
            ends,
            sums,
        }
    }

    /// The test vectors of draft-eastlake-fnv.
    #[test]
    fn the_checksum_is_fnv() {
        for (text, wanted) in [
            ("", 0xcbf2_9ce4_8422_2325),
            ("a", 0xaf63_dc4c_8601_ec8c),
            ("foobar", 0x8594_4171_f739_67e8),
        ] {
            let mut sum = Fnv::new();
            sum.add_bytes(text.as_bytes());
            assert_eq!(sum.sum(), wanted, "{text}");
        }
    }

    /// In any order of the logs.
    #[track_caller]
    fn refused(mut logs: Vec<Identity<'_>>, words: &str) {
        for _ in 0..logs.len() {
            let found = clash(&logs).expect("two that clash");
            assert_eq!(found.problem, words);
            let names = found.logs.map(|place| logs[place].name);
            assert!(
                names
                    .iter()
                    .all(|name| words.contains(&format!("`{name}`")))
            );
            logs.rotate_left(1);
        }
    }

    /// Stamps that begin at 0 say nothing; two logs one after the other do not overlap, even where an earlier long one ends between them.
    #[test]
    fn every_log_is_there_once() {
        let day = 1.7e9;
        let good = vec![
            log("c", "", [0.0, 20.0], 1),
            log("a", "", [0.0, 20.0], 2),
            log("b", "x", [day, day + 10.0], 3),
            log("d", "y", [day + 10.0, day + 20.0], 4),
        ];
        require_distinct(&good).expect("different logs");
        let with = |own| [good.clone(), vec![own]].concat();
        refused(with(log("c", "", [0.0, 9.0], 9)), "log `c` is there twice");
        let same_file = with(log("a2", "x", [0.0, 9.0], 9));
        refused(same_file, "log `b` is log `a2` under another name");
        let same_sums = with(log("e", "", [0.0, 20.0], 2));
        refused(same_sums, "log `e` is log `a` under another name");
        let within = with(log("e", "", [day + 2.0, day + 3.5], 9));
        refused(within, "logs `b` and `e` overlap in time by 1.5 s");
        let long = vec![
            log("long", "", [day, day + 100.0], 1),
            log("short", "", [day - 5.0, day - 1.0], 2),
            log("late", "", [day + 90.0, day + 95.0], 3),
        ];
        refused(long, "logs `long` and `late` overlap in time by 5.0 s");
    }
}
