//! Noise that changes with a joint's speed or load: on real robots it is largest where friction turns round.

use serde::{Deserialize, Serialize};

/// Bins of equal numbers of rows.
const BINS: usize = 6;
/// Fewest effective rows in a bin.
const FEWEST: f64 = 4.0;

/// Relative noise variance of a row: `g(|q̇|) h(|τ_nom|)`, mean 1 over the training rows; a factor that is not learned is 1.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Spread {
    /// g, by speed in rad/s or m/s.
    pub speed: Option<Profile>,
    /// h, by the size of the joint's nominal torque in N·m or N.
    pub load: Option<Profile>,
}

impl Spread {
    /// Relative noise variance at a velocity and a nominal torque.
    pub fn at(&self, velocity: f64, nominal: f64) -> f64 {
        let factor = |profile: &Option<Profile>, x: f64| {
            let profile = profile.as_ref();
            profile.map_or(1.0, |profile| profile.at(x))
        };
        factor(&self.speed, velocity) * factor(&self.load, nominal)
    }

    /// True if it can be evaluated: a file may have been damaged.
    pub fn is_sound(&self) -> bool {
        [&self.speed, &self.load]
            .into_iter()
            .flatten()
            .all(Profile::is_sound)
    }
}

/// Relative noise variance g(|x|) of one joint: ln g is piecewise linear between the knots and constant beyond them; its mean
/// over the rows that it was learned from is 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    /// |x| of the knots, ascending.
    pub knots: Vec<f64>,
    /// ln g there.
    pub log_variance: Vec<f64>,
}

impl Profile {
    /// The profile of moving rows `(|x|, residual)`, of which `memory` count as one independent row; `None` where the
    /// rows do not ask for one.
    ///
    /// The mean squares of six bins with equal numbers of rows, in logarithms, each pulled to their mean by what chance
    /// explains (James–Stein with known sampling variance 2/n_eff):
    ///
    /// ```text
    /// ln g_b = λ (ln s_b² − mean),   λ = t²/(t² + 2/n_eff),   t² = max(0, Var_b(ln s_b²) − 2/n_eff)
    /// ```
    pub fn of_rows(mut rows: Vec<(f64, f64)>, memory: f64) -> Option<Self> {
        rows.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let own = rows.len() as f64 / BINS as f64 / memory.max(1.0);
        if own < FEWEST {
            return None;
        }
        let cut = |bin: usize| bin * rows.len() / BINS;
        let bins = (0..BINS).map(|bin| &rows[cut(bin)..cut(bin + 1)]);
        let (mut knots, mut log): (Vec<f64>, Vec<f64>) = bins
            .map(|bin| {
                let square = bin.iter().map(|(_, r)| r * r).sum::<f64>() / bin.len() as f64;
                (bin[bin.len() / 2].0, square.ln())
            })
            .unzip();
        if log.iter().any(|value| !value.is_finite()) {
            return None;
        }
        // Knots at one place would be no function of it.
        if knots.windows(2).any(|pair| pair[0] >= pair[1]) {
            let keep: Vec<usize> = (0..BINS)
                .filter(|&i| i == 0 || knots[i] > knots[i - 1])
                .collect();
            knots = keep.iter().map(|&i| knots[i]).collect();
            log = keep.iter().map(|&i| log[i]).collect();
        }
        let count = log.len() as f64;
        let mean = log.iter().sum::<f64>() / count;
        let spread = log.iter().map(|l| (l - mean) * (l - mean)).sum::<f64>() / (count - 1.0);
        let chance = 2.0 / own;
        let truth = spread - chance;
        if log.len() < 2 || truth.is_nan() || truth <= 0.0 {
            return None;
        }
        let pull = truth / (truth + chance);
        let mut profile = Self {
            knots,
            log_variance: log.iter().map(|l| pull * (l - mean)).collect(),
        };
        let sum: f64 = rows.iter().map(|(x, _)| profile.at(*x)).sum();
        profile.divide(sum / rows.len() as f64);
        Some(profile)
    }

    /// g becomes g/`factor`.
    pub fn divide(&mut self, factor: f64) {
        let shift = factor.ln();
        self.log_variance.iter_mut().for_each(|l| *l -= shift);
    }

    /// g at x.
    pub fn at(&self, x: f64) -> f64 {
        let x = x.abs();
        let after = self.knots.partition_point(|knot| *knot <= x);
        let log = match (after.checked_sub(1), self.log_variance.get(after)) {
            (None, first) => first.copied().unwrap_or(0.0),
            (Some(before), None) => self.log_variance.get(before).copied().unwrap_or(0.0),
            (Some(before), Some(next)) => {
                let (from, to) = (self.knots[before], self.knots[after]);
                let low = self.log_variance[before];
                low + (next - low) * (x - from) / (to - from)
            }
        };
        log.exp()
    }

    /// True if it can be evaluated: a file may have been damaged.
    pub fn is_sound(&self) -> bool {
        !self.knots.is_empty()
            && self.knots.len() == self.log_variance.len()
            && self.knots.windows(2).all(|pair| pair[0] < pair[1])
            && self
                .knots
                .iter()
                .chain(&self.log_variance)
                .all(|v| v.is_finite())
    }

    /// Largest over smallest standard deviation.
    pub fn ratio(&self) -> f64 {
        let fold = |start: f64, pick: fn(f64, f64) -> f64| {
            self.log_variance.iter().copied().fold(start, pick)
        };
        (0.5 * (fold(f64::NEG_INFINITY, f64::max) - fold(f64::INFINITY, f64::min))).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Speeds 0 … 2 and noise of sd exp(−speed): ln g = −2·speed + constant.
    fn rows(random: &mut Random, count: usize, slope: f64) -> Vec<(f64, f64)> {
        (0..count)
            .map(|_| {
                let speed = 2.0 * random.uniform();
                (speed, (slope * speed).exp() * random.normal())
            })
            .collect()
    }

    /// 24 000 rows: ln s² of a bin is known to √(2/4000) = 0.022, and bends 0.01 within a bin; 4.5 sd and the bend allowed.
    #[test]
    fn a_known_profile_is_found() {
        let mut random = Random::new(1, 0);
        let data = rows(&mut random, 24_000, -1.0);
        let profile = Profile::of_rows(data.clone(), 1.0).unwrap();
        for (slow, fast) in [(0.3, 1.0), (1.0, 1.7), (0.5, 1.5)] {
            let change = (profile.at(slow) / profile.at(-fast)).ln();
            assert!(
                (change - 2.0 * (fast - slow)).abs() < 0.16,
                "{slow} {fast} {change}"
            );
        }
        let mean = data.iter().map(|(s, _)| profile.at(*s)).sum::<f64>() / 24_000.0;
        assert!((mean - 1.0).abs() < 1e-12);
        assert_eq!(profile.at(0.0), profile.at(profile.knots[0]));
        assert_eq!(profile.at(9.0), profile.at(profile.knots[5]));
        assert!(profile.is_sound() && profile.ratio() > 4.0);
    }

    /// Constant noise: what is left of chance is small (the pull), and with a long memory nothing is concluded at all.
    #[test]
    fn constant_noise_has_no_profile_to_speak_of() {
        let mut random = Random::new(2, 0);
        for _ in 0..50 {
            let profile = Profile::of_rows(rows(&mut random, 1200, 0.0), 1.0);
            let ratio = profile.map_or(1.0, |profile| profile.ratio());
            assert!(ratio < 1.25, "{ratio}");
        }
        assert_eq!(Profile::of_rows(rows(&mut random, 200, -1.0), 10.0), None);
        assert_eq!(Profile::of_rows(vec![(1.0, 0.0); 600], 1.0), None);
        assert_eq!(Profile::of_rows(Vec::new(), 1.0), None);
    }
}
