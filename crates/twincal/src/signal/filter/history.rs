//! Signals of a joint that depend on more of its motion than one sample: history channels.
//!
//! ```text
//! stop operator     e(t) = clip(e(t−) + Δq, −r, r)
//! its channel       e/r − tanh(q̇/v_s)               0 while the joint slides on
//! warmth            exp(−t/T) − mean, or (temperature − mean)/sd
//! later             (t/T) exp(−t/T) − mean, 0 with temperature: exp(−t/T') to first order in ln(T'/T)
//! ```
//! They are made once of a segment's smooth motion and carried with it. Every channel is 0 where nothing is known of what was before: a
//! state by itself has steady sliding and the training logs' mean warmth.
//!
//! # Source
//! Brokate & Sprekels 1996, section 2.3 (stop and play, Prandtl–Ishlinskii); Al-Bender, Lampaert, Swevers 2005 (Maxwell slip).

use serde::{Deserialize, Serialize};

/// Stop operators of a joint at most.
pub(crate) const STOPS: usize = 3;
/// Channels of a joint: its stop operators, then its warmth, then how that goes with another time constant.
pub(super) const CHANNELS: usize = STOPS + 2;

/// Channel of a stop operator of a joint.
pub(crate) fn stop_channel(joint: usize, stop: usize) -> usize {
    joint * CHANNELS + stop
}

/// Channel of a joint's warmth.
pub(crate) fn warmth_channel(joint: usize) -> usize {
    joint * CHANNELS + STOPS
}

/// Channel by which a joint warms later than its warmth says.
pub(crate) fn later_channel(joint: usize) -> usize {
    joint * CHANNELS + STOPS + 1
}

/// What a joint warms with.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Warmth {
    /// Time since the log's start: `exp(−t/constant) − mean`, and `(t/constant) exp(−t/constant) − later_mean`.
    Time {
        /// T, s.
        constant: f64,
        /// Mean of the first over the training logs.
        mean: f64,
        /// Mean of the second.
        #[serde(default)]
        later_mean: f64,
    },
    /// Logged temperature: `(temperature − mean)/sd`.
    Temperature {
        /// Mean over the training logs, °C or K as logged.
        mean: f64,
        /// Standard deviation over the training logs.
        sd: f64,
    },
}

/// What is followed of the history of one joint.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct JointHistory {
    /// Thresholds r of its stop operators, rad or m, ascending; empty: none.
    pub thresholds: Vec<f64>,
    /// What it warms with, if anything.
    pub warmth: Option<Warmth>,
}

impl JointHistory {
    /// Whether its numbers can be used: a twin's file may be damaged.
    pub(crate) fn is_sound(&self) -> bool {
        let thresholds = self.thresholds.iter().all(|r| r.is_finite() && *r > 0.0);
        let warmth = match self.warmth {
            None => true,
            Some(Warmth::Time {
                constant,
                mean,
                later_mean,
            }) => constant > 0.0 && mean.is_finite() && later_mean.is_finite(),
            Some(Warmth::Temperature { mean, sd }) => sd > 0.0 && mean.is_finite(),
        };
        self.thresholds.len() <= STOPS && thresholds && warmth
    }
}

/// A stop operator over a motion, e/r to `out`, from a state that is not known: 0, halfway between the least and the largest, until both
/// would have come together. Returns from which sample on that is so; `q.len()` if nowhere.
///
/// Once position has spanned 2r no earlier state is left: the operator has yielded, wherever it began.
pub(crate) fn stop(q: &[f64], r: f64, out: &mut [f64]) -> usize {
    let (mut low, mut high, mut before) = (-r, r, q.first().copied().unwrap_or(0.0));
    let mut known = q.len();
    for (i, (q, out)) in q.iter().zip(out.iter_mut()).enumerate() {
        let step = q - before;
        before = *q;
        (low, high) = ((low + step).clamp(-r, r), (high + step).clamp(-r, r));
        *out = 0.5 * (low + high) / r;
        if low == high {
            known = i;
            break;
        }
    }
    // From here on one state is all of them.
    let rest = known.min(out.len())..;
    let share = 1.0 / r;
    for (q, out) in q[rest.clone()].iter().zip(&mut out[rest]) {
        low = (low + (q - before)).clamp(-r, r);
        before = *q;
        *out = low * share;
    }
    known
}

/// Temperatures with their stamps; `None` without any, and of a log whose stamps step back.
pub(crate) fn known_temperatures(
    time: &[f64],
    logged: &Option<Vec<f64>>,
) -> Option<Vec<(f64, f64)>> {
    let logged = time.iter().zip(logged.iter().flatten());
    let known: Vec<(f64, f64)> = logged
        .filter(|(time, value)| time.is_finite() && value.is_finite())
        .map(|(time, value)| (*time, *value))
        .collect();
    let steps_back = known.windows(2).any(|pair| pair[1].0 <= pair[0].0);
    (!known.is_empty() && !steps_back).then_some(known)
}

/// Between samples linear, beyond them constant.
pub(crate) fn temperature_at(known: &[(f64, f64)], time: f64) -> f64 {
    let after = known.partition_point(|(t, _)| *t <= time);
    match (after.checked_sub(1).map(|i| known[i]), known.get(after)) {
        (Some((t0, v0)), Some((t1, v1))) => v0 + (v1 - v0) * (time - t0) / (t1 - t0),
        (Some((_, value)), None) => value,
        (None, first) => first.map_or(f64::NAN, |(_, value)| *value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The stop operator by its definition, from one beginning.
    fn brute(q: &[f64], r: f64, start: f64) -> Vec<f64> {
        let mut e = start;
        (0..q.len())
            .map(|i| {
                let step = if i == 0 { 0.0 } else { q[i] - q[i - 1] };
                e = f64::max(-r, f64::min(r, e + step));
                e / r
            })
            .collect()
    }

    fn wandering(seed: u64, len: usize) -> Vec<f64> {
        let (mut state, mut q) = (seed, 0.0);
        (0..len)
            .map(|_| {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                q += 2e-3 * ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5);
                q
            })
            .collect()
    }

    /// From when on a state counts as known, every beginning gives the same, and not a sample earlier.
    #[test]
    fn a_state_is_known_where_all_beginnings_have_come_together() {
        for seed in 1..20 {
            let (q, r) = (wandering(seed, 4000), 1e-3 * seed as f64);
            let mut e = vec![0.0; q.len()];
            let known = stop(&q, r, &mut e);
            let ways: Vec<Vec<f64>> = [-1.0, -0.4, 0.3, 1.0].map(|s| brute(&q, r, s * r)).into();
            let apart = |i: usize| {
                ways.iter()
                    .map(|way| (way[i] - e[i]).abs())
                    .fold(0.0, f64::max)
            };
            assert!((known..q.len()).all(|i| apart(i) < 1e-9), "{seed}");
            assert!(known == 0 || apart(known - 1) > 0.0, "{seed}");
            // Position has spanned 2r by then, and not before.
            let span = |to: usize| {
                let own = &q[..to];
                let high = own.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                high - own.iter().copied().fold(f64::INFINITY, f64::min)
            };
            assert!(known == q.len() || span(known + 1) >= 2.0 * r * (1.0 - 1e-9));
            assert!(known == 0 || span(known) < 2.0 * r * (1.0 + 1e-9));
        }
    }

    /// A triangle of amplitude a > r: e rises from −r with slope 1 over 2r after each corner, and stays at r.
    #[test]
    fn a_triangular_motion_has_its_closed_form() {
        let (a, r, period) = (0.02, 0.005, 400);
        let q: Vec<f64> = (0..5 * period)
            .map(|i| {
                let phase = (i % period) as f64 / period as f64;
                a * (if phase < 0.5 {
                    4.0 * phase - 1.0
                } else {
                    3.0 - 4.0 * phase
                })
            })
            .collect();
        let mut e = vec![0.0; q.len()];
        let known = stop(&q, r, &mut e);
        assert_eq!(
            known,
            (2.0 * r / (4.0 * a / period as f64)).round() as usize
        );
        for (i, e) in e.iter().enumerate().skip(period) {
            let phase = (i % period) as f64 / period as f64;
            let travelled = 4.0 * a * (phase % 0.5);
            let sense = if phase < 0.5 { 1.0 } else { -1.0 };
            let expected = sense * (travelled / r - 1.0).min(1.0);
            assert!((e - expected).abs() < 1e-9, "{i}: {e} {expected}");
        }
    }

    /// Wiping out: a small loop within a larger motion leaves no trace.
    #[test]
    fn a_closed_inner_loop_is_forgotten() {
        let path = |corners: &[f64]| -> Vec<f64> {
            let legs = corners.windows(2);
            legs.flat_map(|leg| {
                (0..100).map(move |i| leg[0] + (leg[1] - leg[0]) * f64::from(i) / 100.0)
            })
            .collect()
        };
        let plain = path(&[0.0, 0.05, -0.01, 0.03]);
        let looped = path(&[0.0, 0.05, -0.01, 0.012, 0.004, 0.012, 0.03]);
        for r in [1e-3, 3e-3, 8e-3, 15e-3] {
            let (mut a, mut b) = (vec![0.0; plain.len()], vec![0.0; looped.len()]);
            stop(&plain, r, &mut a);
            stop(&looped, r, &mut b);
            let (a, b) = (a[a.len() - 1], b[b.len() - 1]);
            // The last sample is one step short of the corner on both.
            assert!((a - b).abs() < 5e-4 / r, "{r}: {a} {b}");
        }
    }
}
