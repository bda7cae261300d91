//! Power spectra of logged motion (Welch) and the white noise under them.

use super::fourier::Fourier;
use std::f64::consts::PI;
use std::sync::Arc;

/// Pieces that a spectrum is averaged over at most, evenly spread: its relative sd is 18 % per bin, 1 % in a floor's median.
const MOST_PIECES: usize = 32;

/// Pieces of `steps` steps that overlap by half, evenly spread ones of many.
fn pieces<'a>(runs: impl Iterator<Item = &'a [f64]>, steps: usize) -> Vec<&'a [f64]> {
    let all: Vec<&[f64]> = runs
        .flat_map(|run| {
            let starts = (0..run.len()).step_by((steps / 2).max(1));
            starts
                .take_while(|start| start + steps < run.len())
                .map(|start| &run[start..=start + steps])
        })
        .collect();
    spread(&all)
}

/// Evenly spread ones of many pieces.
fn spread<'a>(pieces: &[&'a [f64]]) -> Vec<&'a [f64]> {
    let kept = pieces.len().min(MOST_PIECES);
    (0..kept).map(|i| pieces[i * pieces.len() / kept]).collect()
}

/// One-sided power density of a channel, corrected for the differencing that keeps slow motion from leaking.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Spectrum {
    /// Bin width, Hz; bin i is at `(i + 1) · width`.
    pub(crate) width: f64,
    /// Unit²/Hz.
    pub(crate) density: Vec<f64>,
    /// Density of the white noise, unit²/Hz.
    pub(crate) floor: f64,
}

impl Spectrum {
    /// Frequency of bin `i`, Hz.
    pub(crate) fn frequency(&self, i: usize) -> f64 {
        (i + 1) as f64 * self.width
    }

    /// The noise as white noise that was differenced `order` times: what drives log as velocity is often the
    /// difference of encoder counts, whose noise rises with f and must not be taken for white.
    ///
    /// The order (at most `most`) is told by how much the density grows from a tenth to a third of the rate: 1, 9 and 80
    /// times for orders 0, 1 and 2.
    pub(crate) fn noise(&self, most: i32) -> Noise {
        let (low, high) = (self.median(0.08, 0.14), self.median(0.25, 0.42));
        let order = i32::from(high > 4.0 * low) + i32::from(high > 30.0 * low);
        let order = order.min(most);
        let size = 2.0 * self.density.len() as f64;
        let rate = self.width * size;
        let gain = |i: usize| (2.0 * rate * (PI * (i + 1) as f64 / size).sin()).powi(2 * order);
        let density = self.density.iter().enumerate();
        let undone: Vec<f64> = match order {
            0 => self.density.clone(),
            _ => density.map(|(i, d)| d / gain(i)).collect(),
        };
        let floor = median(&undone, 0.25, 0.42) * self.floor
            / self.median(0.25, 0.42).max(f64::MIN_POSITIVE);
        Noise {
            floor: floor * f64::from(u8::from(self.floor > 0.0)),
            order,
            rate,
        }
    }

    /// Median density between two shares of the rate.
    fn median(&self, from: f64, to: f64) -> f64 {
        median(&self.density, from, to)
    }
}

/// Welch's average for channels of one length and interval: Hann window, half overlap.
pub(crate) struct Welch {
    piece: usize,
    interval: f64,
    window: Vec<f64>,
    /// Gain of the first difference, bin by bin.
    gains: Vec<f64>,
    fourier: Arc<Fourier>,
}

impl Welch {
    /// Pieces of 20 s, or of the whole of the `longest` run; `None` if it has fewer than 32 samples.
    pub(crate) fn new(longest: usize, interval: f64) -> Option<Self> {
        let piece = (20.0 / interval).min(65_536.0) as usize;
        let piece = piece.min(longest.checked_sub(1)?);
        if piece < 31 {
            return None;
        }
        let size = piece.next_power_of_two();
        let gain = |i: usize| 2.0 * (PI * (i + 1) as f64 / size as f64).sin();
        Some(Self {
            piece,
            interval,
            window: (0..piece)
                .map(|i| (PI * (i as f64 + 0.5) / piece as f64).sin().powi(2))
                .collect(),
            gains: (0..size / 2).map(gain).collect(),
            fourier: Fourier::new(size),
        })
    }

    /// Of all `runs` that are as long, at most 32 pieces. The first difference is transformed, its gain `2 sin(π f dt)` divided out. The floor is the
    /// median over a quarter to 0.42 of the rate. `None` if every run is too short.
    pub(crate) fn of<'a>(&self, runs: impl Iterator<Item = &'a [f64]> + Clone) -> Option<Spectrum> {
        let starts = pieces(runs, self.piece);
        if starts.is_empty() {
            return None;
        }
        let size = 2 * self.gains.len();
        let energy: f64 = self.window.iter().map(|w| w * w).sum();
        let mut density = vec![0.0; size / 2];
        let pieces = starts.len() as f64;
        let (mut re, mut im) = (vec![0.0; size], vec![0.0; size]);
        // Two pieces at a time, one as real and one as imaginary part.
        for pair in starts.chunks(2) {
            for (part, values) in [&mut re, &mut im]
                .into_iter()
                .zip([Some(pair[0]), pair.get(1).copied()])
            {
                part.fill(0.0);
                let steps = values.into_iter().flat_map(|values| values.windows(2));
                for ((cell, step), window) in part.iter_mut().zip(steps).zip(&self.window) {
                    *cell = (step[1] - step[0]) * window;
                }
            }
            self.fourier.forward(&mut re, &mut im);
            // |A|² + |B|² of Z = A + iB is (|Z_k|² + |Z_−k|²)/2
            for (i, sum) in density.iter_mut().enumerate() {
                let (k, mirror) = (i + 1, size - i - 1);
                let square = |k: usize| re[k] * re[k] + im[k] * im[k];
                *sum += 0.5 * (square(k) + square(mirror));
            }
        }
        for (value, gain) in density.iter_mut().zip(&self.gains) {
            *value *= 2.0 * self.interval / (energy * pieces * gain * gain);
        }
        let median = median(&density, 0.25, 0.42);
        // A bin is an average of `pieces` exponentials: median/mean goes from ln 2 to 1 (Wilson–Hilferty).
        let floor = median / (1.0 - 1.0 / (9.0 * pieces)).powi(3);
        Some(Spectrum {
            width: 1.0 / (size as f64 * self.interval),
            density,
            floor,
        })
    }
}

/// Noise of a channel: white noise of density `floor`, differenced `order` times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Noise {
    /// Density before differencing, unit²/Hz.
    pub(crate) floor: f64,
    /// Times it was differenced.
    pub(crate) order: i32,
    /// Sampling rate, Hz.
    pub(crate) rate: f64,
}

impl Noise {
    /// sd of one sample before differencing.
    pub(crate) fn sd(&self) -> f64 {
        (self.floor * self.rate / 2.0).sqrt()
    }

    /// Power below `cutoff` after `more` derivatives: `∫ floor (2πf)^{2k} df`, k = order + more.
    pub(crate) fn power(&self, more: i32, cutoff: f64) -> f64 {
        let k = 2 * (self.order + more);
        self.floor * (2.0 * PI).powi(k) * cutoff.powi(k + 1) / f64::from(k + 1)
    }
}

/// Median of a one-sided density between two shares of the rate (bin i is at (i + 1)/(2 len) of it).
fn median(density: &[f64], from: f64, to: f64) -> f64 {
    let bins = 2.0 * density.len() as f64;
    let mut band = density[(from * bins) as usize..(to * bins) as usize].to_vec();
    let middle = band.len() / 2;
    *band.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn spectrum_of(run: &[f64], interval: f64) -> Spectrum {
        let welch = Welch::new(run.len(), interval).unwrap();
        welch.of(std::iter::once(run)).unwrap()
    }

    #[test]
    fn white_noise_is_measured_under_slow_motion() {
        // 20 000 samples: the median over 3400 bins has a relative sd below 3 %; ±15 % is five of them (1e-6).
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        for sd in [1e-5, 1e-3] {
            let q: Vec<f64> = (0..20_000)
                .map(|i| {
                    let noise: f64 = (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
                    (2.0 * PI * 0.3 * f64::from(i) * 1e-3).sin() + sd * noise
                })
                .collect();
            let spectrum = spectrum_of(&q, 1e-3);
            let noise = spectrum.noise(1);
            assert_eq!(noise.order, 0);
            assert!((noise.sd() / sd - 1.0).abs() < 0.15, "{noise:?} for {sd}");
            // The same noise in a velocity that is a difference of positions is found as what it is.
            let qd: Vec<f64> = q.windows(2).map(|w| (w[1] - w[0]) * 1e3).collect();
            let noise = spectrum_of(&qd, 1e-3).noise(1);
            assert_eq!(noise.order, 1);
            assert!((noise.sd() / sd - 1.0).abs() < 0.15, "{noise:?} for {sd}");
        }
    }

    #[test]
    fn power_of_a_sinusoid_is_half_its_squared_amplitude() {
        let q: Vec<f64> = (0..8000)
            .map(|i| 3.0 * (2.0 * PI * 1.7 * f64::from(i) * 2e-3).cos())
            .collect();
        let spectrum = spectrum_of(&q, 2e-3);
        let power: f64 = spectrum.density.iter().sum::<f64>() * spectrum.width;
        assert!((power - 4.5).abs() < 0.05, "{power}");
    }
}
