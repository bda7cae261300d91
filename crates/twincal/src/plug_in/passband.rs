//! Noise with one memory behind the row filter: which autoregression of rows it is, and how much of it the filter leaves.
//!
//! AR(1) noise with the time constant T behind the filter F has the spectrum `|H(f)|² L(f)`, L(f) = 1/(1 + (2π f T)²), f in cycles per
//! row. An autoregression fitted to such rows takes what F cuts off for memory: at T = 5 rows and a cut-off of 0.4 its ρ is 0.885, and what it
//! leaves, white in its eyes, is 2.3 times larger in the middle of the band than at 0 Hz. So T is read off the fitted ρ̂,
//!
//! ```text
//! ρ̂ = ∫ |H|² L cos(2π f) df / ∫ |H|² L df
//! ```
//! and ρ is the one whose innovations `L(f) |1 − ρ e^{−2πif}|²` are flattest where F passes: the least Whittle (1953) divergence
//! ln⟨S⟩ − ⟨ln S⟩, means weighted with |H|². Innovations fill only the share ⟨|H|²⟩ of the frequencies of rows, so that n rows know as much as
//! that share of them.

use crate::signal::fir::filter_gains;
use std::f64::consts::TAU;

/// Frequencies of an integral.
const FREQUENCIES: usize = 160;
/// Nothing passes from here on, in cut-offs.
const STOPPED: f64 = 1.4;
/// Longest T, rows.
const LONGEST: f64 = 1e3;
/// Steps of a bisection, and of a golden section: 1e-9 of where they start.
const STEPS: usize = 30;
const SECTIONS: usize = 44;

/// A filter as rows see it.
#[derive(Debug, Clone)]
pub(super) struct Passband {
    /// Distance of frequencies, cycles per row.
    step: f64,
    /// f and |H(f)|².
    gains: Vec<(f64, f64)>,
}

/// An autoregression behind the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Autoregression {
    /// ρ of rows.
    pub(super) rho: f64,
    /// Variance of the rows over that of the autoregression with the same level of innovations: v (1 − ρ²)/⟨S⟩.
    pub(super) variance: f64,
}

impl Passband {
    /// Of a cut-off in cycles per row; `None` without a filter.
    pub(super) fn new(cutoff: f64) -> Option<Self> {
        if cutoff <= 0.0 {
            return None;
        }
        let step = STOPPED * cutoff / FREQUENCIES as f64;
        let frequencies: Vec<f64> = (0..FREQUENCIES).map(|i| (i as f64 + 0.5) * step).collect();
        let gains = filter_gains(cutoff, &frequencies);
        let gains = gains.iter().map(|gain| gain * gain);
        Some(Self {
            step,
            gains: frequencies.iter().copied().zip(gains).collect(),
        })
    }

    /// Share of the power of white rows that passes, at most 1.
    pub(super) fn share(&self) -> f64 {
        (2.0 * self.step * self.sum(|_| 1.0)).min(1.0)
    }

    /// Σ |H|² of something over the frequencies.
    fn sum(&self, of: impl Fn(f64) -> f64) -> f64 {
        self.gains.iter().map(|(f, passed)| passed * of(*f)).sum()
    }

    /// What rows have whose neighbours correlate by `correlation`.
    pub(super) fn autoregression(&self, correlation: f64) -> Autoregression {
        let time = self.time(correlation);
        if time <= 0.0 {
            return Autoregression {
                rho: 0.0,
                variance: self.share(),
            };
        }
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        let (mut low, mut high) = (0.0, 1.0 - 1e-6);
        for _ in 0..SECTIONS {
            let (a, b) = (high - golden * (high - low), low + golden * (high - low));
            if self.unevenness(time, a) < self.unevenness(time, b) {
                high = b;
            } else {
                low = a;
            }
        }
        let rho = 0.5 * (low + high);
        let level = self.sum(|f| innovations(f, time, rho)) / self.sum(|_| 1.0);
        let variance = 2.0 * self.step * self.sum(|f| noise(f, time));
        Autoregression {
            rho,
            variance: variance * (1.0 - rho * rho) / level,
        }
    }

    /// T in rows; 0 for what correlates no more than white noise behind the filter.
    fn time(&self, correlation: f64) -> f64 {
        let of = |time: f64| {
            self.sum(|f| noise(f, time) * (TAU * f).cos()) / self.sum(|f| noise(f, time))
        };
        if correlation <= of(0.0) {
            return 0.0;
        }
        let (mut low, mut high) = (0.0_f64, LONGEST.ln_1p());
        for _ in 0..STEPS {
            let middle = 0.5 * (low + high);
            if of(middle.exp_m1()) < correlation {
                low = middle;
            } else {
                high = middle;
            }
        }
        (0.5 * (low + high)).exp_m1()
    }

    /// ln⟨S⟩ − ⟨ln S⟩ ≥ 0 of the innovations.
    fn unevenness(&self, time: f64, rho: f64) -> f64 {
        let all = self.sum(|_| 1.0);
        let mean = self.sum(|f| innovations(f, time, rho)) / all;
        mean.ln() - self.sum(|f| innovations(f, time, rho).ln()) / all
    }
}

/// L(f).
fn noise(f: f64, time: f64) -> f64 {
    1.0 / (1.0 + (TAU * f * time).powi(2))
}

/// L(f) |1 − ρ e^{−2πif}|².
fn innovations(f: f64, time: f64, rho: f64) -> f64 {
    noise(f, time) * (1.0 + rho * rho - 2.0 * rho * (TAU * f).cos()).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::fir::column_kernel;

    /// Samples between two rows; the filter passes 0.4 cycles per row.
    const STEP: usize = 80;

    /// Autocovariances of AR(1) noise of variance 1 with the time constant `time` in rows behind the filter's own taps.
    fn covariances(time: f64, lags: usize) -> Vec<f64> {
        let taps = column_kernel(0.4, 1.0 / STEP as f64);
        let rho = (-1.0 / (time * STEP as f64)).exp();
        let own: Vec<f64> = (0..taps.len())
            .map(|shift| taps.iter().zip(&taps[shift..]).map(|(a, b)| a * b).sum())
            .collect();
        let of = |lag: i32| -> f64 {
            let sum = (1..own.len() as i32).map(|shift| {
                own[shift as usize]
                    * (rho.powi((lag - shift).abs()) + rho.powi((lag + shift).abs()))
            });
            own[0] * rho.powi(lag.abs()) + sum.sum::<f64>()
        };
        (0..lags as i32).map(|lag| of(lag * STEP as i32)).collect()
    }

    /// T of 5 rows is found again from the taps, and its variance is the taps'.
    #[test]
    fn the_time_constant_behind_the_filter_is_found() {
        let band = Passband::new(0.4).expect("a filter");
        for time in [0.5, 2.0, 5.0, 30.0] {
            let exact = covariances(time, 2);
            let found = band.time(exact[1] / exact[0]);
            assert!((found / time - 1.0).abs() < 0.02, "{time}: {found}");
            // L(f) is 1 at 0 Hz, where noise of variance 1 has 2T.
            let variance = 2.0 * time * 2.0 * band.step * band.sum(|f| noise(f, time));
            assert!(
                (variance / exact[0] - 1.0).abs() < 0.02,
                "{time}: {variance}"
            );
        }
    }

    /// White rows have no memory, whatever the filter gives them; their variance is the share that passes.
    #[test]
    fn white_noise_has_no_memory() {
        let band = Passband::new(0.4).expect("a filter");
        let white = band.autoregression(0.3);
        assert_eq!(white.rho, 0.0);
        assert!((white.variance - 1.0 / 1.35).abs() < 0.01, "{white:?}");
        assert!(Passband::new(0.0).is_none());
    }

    /// Innovations are flat to a quarter below the cut-off where those of the fitted coefficient differ by more than two.
    #[test]
    fn innovations_are_flat() {
        let band = Passband::new(0.4).expect("a filter");
        let exact = covariances(5.0, 2);
        let fitted = exact[1] / exact[0];
        let found = band.autoregression(fitted);
        let spread = |rho: f64| {
            let levels = [0.0, 0.05, 0.1, 0.2, 0.3].map(|f| innovations(f, 5.0, rho));
            levels.iter().copied().fold(0.0, f64::max)
                / levels.iter().copied().fold(f64::INFINITY, f64::min)
        };
        assert!(
            fitted > 0.87 && spread(fitted) > 2.0,
            "{fitted}, {}",
            spread(fitted)
        );
        assert!(spread(found.rho) < 1.4, "{found:?}, {}", spread(found.rho));
    }
    /// The variance that follows from the level of innovations is that of the taps: their mean square by covariances, over the
    /// share of frequencies that passes, is the level.
    #[test]
    fn level_and_variance_belong_together() {
        let band = Passband::new(0.4).expect("a filter");
        for time in [0.5, 2.0, 5.0, 30.0] {
            let [own, next] = covariances(time, 2)[..] else {
                panic!("two covariances");
            };
            let Autoregression { rho, variance } = band.autoregression(next / own);
            let innovations = (1.0 + rho * rho) * own - 2.0 * rho * next;
            let exact = own * (1.0 - rho * rho) / (innovations / band.share());
            assert!(
                (variance / exact - 1.0).abs() < 0.02,
                "{time}: {variance}, {exact}"
            );
        }
    }
}
