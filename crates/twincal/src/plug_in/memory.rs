//! Memory of noise behind the row filter: what Geyer's sum leaves out.
//!
//! The low-pass F gives white noise autocorrelations with negative lobes (0.34, −0.13, … at the default 2.5 rows per cut-off), and Geyer's
//! initial positive sequence ends before the first of them: its sum G is 1.60 rows where the time τ is 1.35, and intervals
//! become a tenth too wide. Of AR(1) noise with the time constant T behind F both are known,
//!
//! ```text
//! S(f) = |H(f)|² / (1 + (2π f T)²),   r_k ∝ ∫ S(f) cos(2π f k) df,   τ = Σ_k r_k = Σ_m S(m) / ∫ S(f) df
//! ```
//! with f in cycles per row, so that G is read as the T that has it and the answer is that T's τ. From T of a few rows on the
//! lobes are gone, and τ = G.

use crate::diagnostics::initial_positive_sequence;
use crate::signal::fir::filter_gains;
use std::f64::consts::TAU;

/// Time constants T, rows.
const TIMES: [f64; 13] = [
    0.0, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.1, 1.5, 2.0, 3.0, 4.5, 6.0,
];
/// Frequencies of an integral.
const FREQUENCIES: usize = 160;
/// Lags of a sum: more than ten of the longest time constant.
const LAGS: usize = 72;

/// Integrated autocorrelation time, rows, at least 1, of noise whose sum of Geyer is `sum`, behind a filter with a cut-off of
/// `cutoff` cycles per row (0: no filter, τ = G).
pub(super) fn behind_filter(sum: f64, cutoff: f64) -> f64 {
    if cutoff <= 0.0 {
        return sum.max(1.0);
    }
    let curve = curve(cutoff);
    let (first, last) = (curve[0], curve[curve.len() - 1]);
    let above = curve.partition_point(|point| point.sum < sum);
    let tau = if above == 0 {
        sum * first.tau / first.sum // less memory than white noise
    } else if above == curve.len() {
        sum * last.tau / last.sum
    } else {
        let (low, high) = (curve[above - 1], curve[above]);
        low.tau + (high.tau - low.tau) * (sum - low.sum) / (high.sum - low.sum)
    };
    tau.max(1.0)
}

/// What AR(1) noise of one time constant has behind the filter.
#[derive(Debug, Clone, Copy)]
struct Point {
    /// Geyer's sum G.
    sum: f64,
    /// Integrated autocorrelation time τ.
    tau: f64,
}

/// G and τ over [`TIMES`], both growing.
fn curve(cutoff: f64) -> Vec<Point> {
    // Nothing passes from 1.3 times the cut-off on; midpoints of equal steps.
    let step = 1.4 * cutoff / FREQUENCIES as f64;
    let frequency: Vec<f64> = (0..FREQUENCIES).map(|i| (i as f64 + 0.5) * step).collect();
    let passed = |frequencies: &[f64]| -> Vec<f64> {
        let gains = filter_gains(cutoff, frequencies);
        gains.iter().map(|gain| gain * gain).collect()
    };
    let cosine: Vec<Vec<f64>> = (0..LAGS)
        .map(|lag| {
            frequency
                .iter()
                .map(|f| (TAU * f * lag as f64).cos())
                .collect()
        })
        .collect();
    let noise = |f: f64, time: f64| 1.0 / (1.0 + (TAU * f * time).powi(2));
    // Frequencies that rows do not tell from 0.
    let folded: Vec<f64> = (0..)
        .map(f64::from)
        .take_while(|f| *f < 1.4 * cutoff)
        .collect();
    let (powers, folded_powers) = (passed(&frequency), passed(&folded));
    let mut points: Vec<Point> = Vec::with_capacity(TIMES.len());
    for time in TIMES {
        let spectrum: Vec<f64> = (frequency.iter().zip(&powers))
            .map(|(f, passed)| passed * noise(*f, time))
            .collect();
        let power: f64 = spectrum.iter().sum();
        let correlation = |lag: usize| -> f64 {
            let terms = spectrum.iter().zip(&cosine[lag]);
            terms.map(|(s, cos)| s * cos).sum::<f64>() / power
        };
        let both_sides = |f: &f64| if *f > 0.0 { 2.0 } else { 1.0 };
        let at_zero: f64 = (folded.iter().zip(&folded_powers))
            .map(|(f, power)| both_sides(f) * power * noise(*f, time))
            .sum();
        let point = Point {
            sum: initial_positive_sequence(LAGS, correlation),
            tau: at_zero / (2.0 * step * power),
        };
        if points.last().is_none_or(|before| point.sum > before.sum) {
            points.push(point);
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::fir::column_kernel;

    /// Autocorrelations of AR(1) noise of one sample's coefficient `rho` behind the filter of 5 Hz at 1 kHz, rows 80 samples
    /// apart, by sums over the filter's own taps.
    fn by_taps(rho: f64, lags: usize) -> Vec<f64> {
        let taps = column_kernel(5.0, 1e-3);
        let n = taps.len() as isize;
        let own: Vec<f64> = (0..n)
            .map(|lag| {
                (0..n - lag)
                    .map(|i| taps[i as usize] * taps[(i + lag) as usize])
                    .sum()
            })
            .collect();
        let at = |lag: isize| -> f64 {
            let noise = |d: isize| {
                if rho > 0.0 {
                    rho.powi(d.unsigned_abs() as i32)
                } else {
                    f64::from(u8::from(d == 0))
                }
            };
            (1 - n..n)
                .map(|m| own[m.unsigned_abs()] * noise(80 * lag - m))
                .sum()
        };
        let zero = at(0);
        (0..lags as isize).map(|lag| at(lag) / zero).collect()
    }

    /// Frequencies against the very taps: G of AR(1) noise becomes its τ.
    #[test]
    fn the_sum_of_an_autoregression_behind_the_filter_becomes_its_time() {
        for time in [0.0, 0.005, 0.02, 0.05, 0.1, 0.3, 1.0] {
            let rho = if time > 0.0 {
                (-1e-3_f64 / time).exp()
            } else {
                0.0
            };
            let lags = 20 + (12.0 * 12.5 * time) as usize;
            let r = by_taps(rho, lags);
            let tau = 1.0 + 2.0 * r[1..].iter().sum::<f64>();
            let sum = initial_positive_sequence(lags, |lag| r[lag]);
            let found = behind_filter(sum, 0.4);
            assert!(
                (found / tau - 1.0).abs() < 0.01,
                "{time} s: {found}, not {tau}"
            );
            assert!(
                time > 0.0 || (sum > 1.6 && tau < 1.45),
                "lobes: {sum}, {tau}"
            );
        }
    }

    #[test]
    fn without_a_filter_and_with_much_memory_the_sum_is_the_time() {
        assert_eq!(behind_filter(3.0, 0.0), 3.0);
        assert!((behind_filter(40.0, 0.4) / 40.0 - 1.0).abs() < 0.01);
        assert!(behind_filter(1.0, 0.4) >= 1.0);
    }
}
