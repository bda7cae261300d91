//! Two components of which a twin holds one or the other: what looks as if it came and went is the same effect under another name.

use super::{Became, Change, Side};

/// Probability, in either twin, that at least one of two is in, from which the effect itself is as before.
const ONE_IS_IN: f64 = 0.95;
/// Probability from which a component counts as an alternative in a twin.
const POSSIBLE: f64 = 0.02;
/// Rivals are in together less often than this share of what independent ones would be.
const SELDOM: f64 = 0.5;

/// Marks every component that is perhaps new or gone where another stands for it: one of the two is in on both sides, and where both are possible they exclude each
/// other. Numbers of the two twins have to be the same quantities.
pub(super) fn mark(changes: &mut [Change], sides: &[Side; 2]) {
    let inside: Vec<[Vec<bool>; 2]> = (changes.iter())
        .map(|change| [0, 1].map(|side: usize| sides[side].holds(&change.name)))
        .collect();
    let is_open =
        |change: &Change| matches!(change.became, Became::PerhapsNew | Became::PerhapsGone);
    let rival = |own: usize| {
        let mut others =
            (0..inside.len()).filter(|&other| other != own && changes[other].comparable);
        others.find(|&other| are_rivals(&inside[own], &inside[other]))
    };
    let rivals: Vec<Option<usize>> = (0..changes.len())
        .map(|own| rival(own).filter(|_| is_open(&changes[own]) && changes[own].comparable))
        .collect();
    let names: Vec<String> = changes.iter().map(|change| change.name.clone()).collect();
    for (change, rival) in changes.iter_mut().zip(rivals) {
        if let Some(rival) = rival {
            change.became = Became::OneOfTwo;
            change.rival = Some(names[rival].clone());
        }
    }
}

/// By whether each draw of either twin holds them.
fn are_rivals(one: &[Vec<bool>; 2], other: &[Vec<bool>; 2]) -> bool {
    let mut possible = false;
    for (one, other) in one.iter().zip(other) {
        let share = |test: fn(bool, bool) -> bool| {
            let pairs = one.iter().zip(other);
            pairs.filter(|(a, b)| test(**a, **b)).count() as f64 / one.len() as f64
        };
        let (first, second) = (share(|a, _| a), share(|_, b| b));
        if share(|a, b| a || b) < ONE_IS_IN {
            return false;
        }
        if first.min(second) >= POSSIBLE {
            possible = true;
            if share(|a, b| a && b) > SELDOM * first * second {
                return false;
            }
        }
    }
    possible
}

#[cfg(test)]
mod tests {
    use super::are_rivals;

    /// Of a hundred draws the first `one` hold the first, the last `other` the second.
    fn draws(one: usize, other: usize) -> [Vec<bool>; 2] {
        [
            (0..100).map(|i| i < one).collect(),
            (0..100).map(|i| i >= 100 - other).collect(),
        ]
    }

    #[test]
    fn rivals_exclude_each_other_and_one_of_them_is_in() {
        let of = |before: (usize, usize), after: (usize, usize)| {
            let [a, b] = draws(before.0, before.1);
            let [c, d] = draws(after.0, after.1);
            are_rivals(&[a, c], &[b, d])
        };
        assert!(of((94, 6), (73, 27)));
        assert!(of((94, 6), (0, 100)));
        // The sum went down, or both are in at once.
        assert!(!of((94, 6), (70, 7)));
        assert!(!of((94, 90), (73, 27)));
        // Nothing says that one stands for the other.
        assert!(!of((100, 0), (0, 100)));
        // One that is always in is no alternative.
        assert!(!of((100, 94), (100, 20)));
    }
}
