//! Power of a joint's columns and torque in bands of frequencies: sums over rows that add.
//!
//! With X_m the discrete Fourier transform of a run of rows `x = [columns, y]`, padded to M ≥ 2n, and bands of frequencies f (cycles per row),
//!
//! ```text
//! P_b = Σ_{m: f_m ∈ b} Re(X_m X_m*) / M,     Σ_b P_b = Σ x xᵀ
//! ```
//! Bands grow by a quarter with frequency: a lag at which noise of some memory still correlates is short beside 1 over the width of the
//! bands in which that noise has its power. Sums of runs, parts and logs add.

use crate::gram::Symmetric;
use crate::linear_algebra::{add_squares_of_columns, mirror};
use crate::observations::Part;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;
use std::ops::{AddAssign, Range};

/// Upper end of the lowest band, cycles per row, and how much higher that of the next one is.
const LOWEST: f64 = 1.0 / 512.0;
const GROWTH: f64 = 1.25;
/// Rows that are transformed at a time.
const LONGEST: usize = 4096;
/// A short run is padded to eight times its length, but to no more than this: its power between bins is what says which band it is in.
const PADDED: usize = 1024;

/// P_b of the signals of one joint and y, band by band.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Bands {
    pub(crate) power: Vec<Symmetric>,
    /// Rows of the longest run, at most [`LONGEST`].
    pub(crate) longest: usize,
}

impl Bands {
    /// Number of bands.
    pub(crate) const COUNT: usize = 26;

    /// Of the moving rows of a joint in some parts, as the fit weighs them.
    pub(super) fn of(parts: &[&Part<'_>], joint: usize) -> Self {
        let signals = parts
            .first()
            .map_or(0, |part| part.observations.joints[joint].signals());
        let mut bands = Self {
            power: vec![Symmetric::zeros(signals + 1); edges().len() - 1],
            longest: 0,
        };
        let mut run = Run {
            values: vec![Vec::new(); signals + 1],
            planner: RealFftPlanner::new(),
        };
        for part in parts {
            bands.add_rows(part, joint, &mut run);
        }
        for sums in &mut bands.power {
            mirror(&mut sums.values, sums.size);
        }
        bands
    }

    /// Adds to lower triangles.
    fn add_rows(&mut self, part: &Part<'_>, joint: usize, run: &mut Run) {
        let (all, rows) = (part.observations, &part.observations.joints[joint]);
        let signals = rows.signals();
        for range in part.runs_between_starts() {
            rows.visit_signals(all.len(), range, &mut |range, columns| {
                let moving = |row: &usize| !rows.standstill[*row];
                let mut from = range.start;
                while from < range.end {
                    if !moving(&from) {
                        self.end(run);
                        from += 1;
                        continue;
                    }
                    let most = (range.end - from).min(LONGEST - run.len());
                    let to = from + (from..from + most).take_while(moving).count();
                    for (i, values) in run.values[..signals].iter_mut().enumerate() {
                        values.extend_from_slice(columns.of(i, from - range.start, to - from));
                    }
                    run.values[signals].extend_from_slice(&rows.y[from..to]);
                    run.weigh(&rows.weight, from..to);
                    if run.len() == LONGEST {
                        self.end(run);
                    }
                    from = to;
                }
            });
            self.end(run);
        }
    }

    /// Of some of the signals.
    pub(super) fn of_signals(&self, signals: &[usize]) -> Self {
        let of = |sums: &Symmetric| {
            let rows: Vec<usize> = signals.iter().copied().chain([sums.size - 1]).collect();
            sums.of(&rows)
        };
        Self {
            power: self.power.iter().map(of).collect(),
            longest: self.longest,
        }
    }

    fn end(&mut self, run: &mut Run) {
        self.longest = self.longest.max(run.len());
        run.add_to(&mut self.power);
    }
}

impl AddAssign<&Bands> for Bands {
    /// # Panics
    /// If the two belong to different signals.
    fn add_assign(&mut self, other: &Bands) {
        self.longest = self.longest.max(other.longest);
        for (sum, own) in self.power.iter_mut().zip(&other.power) {
            *sum += own;
        }
    }
}

/// Ends of the bands, cycles per row.
pub(super) fn edges() -> Vec<f64> {
    let grown = std::iter::successors(Some(LOWEST), |edge| Some(edge * GROWTH));
    let below = grown.take_while(|edge| *edge * GROWTH.sqrt() < 0.5);
    std::iter::once(0.0).chain(below).chain([0.5]).collect()
}

/// Rows of one run: signals and y.
struct Run {
    values: Vec<Vec<f64>>,
    planner: RealFftPlanner<f64>,
}

impl Run {
    fn len(&self) -> usize {
        self.values.last().map_or(0, Vec::len)
    }

    /// Multiplies the rows that came last with the roots of what they count.
    fn weigh(&mut self, weight: &[f64], rows: Range<usize>) {
        let Some(weight) = weight.get(rows) else {
            return;
        };
        let from = self.len() - weight.len();
        for values in &mut self.values {
            let own = values[from..].iter_mut().zip(weight);
            own.for_each(|(value, u)| *value *= u.sqrt());
        }
    }

    /// Adds the power of the run, which begins anew, to lower triangles.
    fn add_to(&mut self, power: &mut [Symmetric]) {
        let rows = self.len();
        if rows == 0 {
            return;
        }
        let padded = (8 * rows).min(PADDED).max(2 * rows).next_power_of_two();
        let transform = self.planner.plan_fft_forward(padded);
        let mut scratch = transform.make_scratch_vec();
        let (mut input, bins) = (vec![0.0; padded], padded / 2 + 1);
        let mut output = vec![Complex::new(0.0, 0.0); bins];
        // A row per signal, real and imaginary parts by turns: a band is a stretch of columns.
        let mut transformed = Vec::with_capacity(2 * bins * self.values.len());
        let root = f64::sqrt(2.0 / padded as f64);
        for values in &mut self.values {
            input[..rows].copy_from_slice(values);
            input[rows..].fill(0.0);
            values.clear();
            let done = transform.process_with_scratch(&mut input, &mut output, &mut scratch);
            debug_assert!(done.is_ok(), "lengths are the plan's");
            // The ends have no twin at a negative frequency.
            for end in [0, bins - 1] {
                output[end] *= std::f64::consts::FRAC_1_SQRT_2;
            }
            transformed.extend(output.iter().flat_map(|x| [x.re * root, x.im * root]));
        }
        let bin = |edge: f64| (edge * padded as f64).ceil() as usize;
        for (band, sums) in edges().windows(2).zip(power) {
            let last = if band[1] >= 0.5 { bins } else { bin(band[1]) };
            let stretch = 2 * bin(band[0])..2 * last;
            add_squares_of_columns(&mut sums.values, &transformed, 2 * bins, stretch);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_as_many_bands_as_files_hold() {
        assert_eq!(edges().len() - 1, Bands::COUNT);
    }

    /// Lower triangles of two signals and y, band by band.
    fn power(values: [Vec<f64>; 3]) -> Vec<Symmetric> {
        let mut run = Run {
            values: values.to_vec(),
            planner: RealFftPlanner::new(),
        };
        let mut power = vec![Symmetric::zeros(3); Bands::COUNT];
        run.add_to(&mut power);
        assert_eq!(run.len(), 0, "the run begins anew");
        power
    }

    /// Σ_b P_b = Σ x xᵀ (Parseval), for runs that are padded eight times, to 1024 and twice.
    #[test]
    fn all_bands_together_hold_all_power() {
        for rows in [1_u32, 50, 300, 3000] {
            let mut random = crate::random::Random::new(7, rows.into());
            let values = [(); 3].map(|()| {
                (0..rows)
                    .map(|_| 1.0 + random.normal())
                    .collect::<Vec<f64>>()
            });
            let power = power(values.clone());
            for i in 0..3 {
                for j in 0..=i {
                    let sum: f64 = power.iter().map(|sums| sums.at(i, j)).sum();
                    let truth: f64 = values[i].iter().zip(&values[j]).map(|(x, y)| x * y).sum();
                    let off = (sum - truth).abs();
                    assert!(
                        off < 1e-10 * f64::from(rows),
                        "{rows} rows, {i} {j}: off by {off}"
                    );
                }
            }
        }
    }

    /// A sine of 0.03 cycles per row has its power in the band that holds this frequency, a constant in the lowest. A run of 4096 rows has
    /// 1/(2π²·4096·d) of the power beyond a distance of d cycles per row: 1.3 % of the constant beyond 1/512, both sides counted.
    #[test]
    fn power_stands_in_its_band() {
        let sine = |t: u32| (std::f64::consts::TAU * 0.03 * f64::from(t)).sin();
        let values = [
            (0..4096).map(sine).collect(),
            vec![1.0; 4096],
            vec![0.0; 4096],
        ];
        let power = power(values);
        let edges = edges();
        let band = edges
            .windows(2)
            .position(|e| e[0] <= 0.03 && 0.03 < e[1])
            .expect("0.03 is below half a cycle per row");
        assert!(power[band].at(0, 0) > 0.98 * 2048.0);
        assert!(power[0].at(1, 1) > 0.985 * 4096.0);
    }
}
