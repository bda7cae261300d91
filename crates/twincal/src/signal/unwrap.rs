//! Angles that a counter folded into one turn, unfolded.

use std::f64::consts::{PI, TAU};

/// Unfolds an angle in place and returns the number of jumps.
///
/// Only a signal that stays within one turn can have been folded, so one that leaves it is left alone. A jump is a step
/// of more than half a turn from one row to the next; `cuts` (ascending) are the rows right after a cut; across a cut the
/// nearest turn is taken once a jump has been seen.
pub(crate) fn unwrap_angle(q: &mut [f64], cuts: &[usize]) -> u64 {
    let (low, high) = q
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(*v), h.max(*v))
        });
    if high - low > TAU * 1.001 || high - low <= PI {
        return 0;
    }
    let mut jumps = 0;
    let folded =
        (1..q.len()).any(|i| (q[i] - q[i - 1]).abs() > PI && cuts.binary_search(&i).is_err());
    if !folded {
        return 0;
    }
    let mut turns = 0.0;
    let mut last = q[0];
    for i in 1..q.len() {
        let raw = q[i];
        let step = raw - last;
        if step.abs() > PI {
            turns -= step.signum();
            jumps += 1;
        }
        last = raw;
        q[i] = raw + turns * TAU;
    }
    jumps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folded_ramp_unfolds_to_the_ramp() {
        let truth: Vec<f64> = (0..400).map(|i| 0.05 * f64::from(i) - 3.0).collect();
        let mut q: Vec<f64> = truth
            .iter()
            .map(|t| (t + PI).rem_euclid(TAU) - PI)
            .collect();
        let expected = ((truth[399] + PI) / TAU).floor() - ((truth[0] + PI) / TAU).floor();
        assert_eq!(unwrap_angle(&mut q, &[]) as f64, expected);
        assert!(q.iter().zip(&truth).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn a_joint_that_turns_further_than_once_was_not_folded() {
        let mut q = vec![-3.0, 0.0, 3.0, 6.0, 2.0];
        assert_eq!(unwrap_angle(&mut q, &[]), 0);
        assert_eq!(q, [-3.0, 0.0, 3.0, 6.0, 2.0]);
    }

    #[test]
    fn a_jump_only_over_a_cut_is_motion() {
        let mut q = vec![-2.0, -2.0, 2.0, 2.0];
        assert_eq!(unwrap_angle(&mut q, &[2]), 0);
        assert_eq!(q, [-2.0, -2.0, 2.0, 2.0]);
    }
}
