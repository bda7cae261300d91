//! Values between the samples of an even clock: the polynomial of degree 7 through the eight nearest.
//!
//! Local, so that a stretch of stamps can be computed on its own. For a signal of angular frequency ω, sampled every h
//! seconds, the error is at most `(ωh)⁸ · 11025/(2⁸ · 8!)` = 1.1e-3 (ωh)⁸ of its amplitude between the two middle samples.
//! Source: Abramowitz & Stegun, 25.2.

/// Samples that a value is made of.
const NODES: usize = 8;

/// Where a stamp lies: the first of the samples that make its value, and their weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    first: usize,
    count: usize,
    weights: [f64; NODES],
}

impl Place {
    /// Place of `time` on the clock `start + i · interval`, 0 ≤ i < `len`, len > 0.
    pub(crate) fn new(time: f64, start: f64, interval: f64, len: usize) -> Self {
        let at = (time - start) / interval;
        let count = NODES.min(len);
        let left = at.floor() - (count / 2 - usize::from(count > 1)) as f64;
        let first = left.clamp(0.0, (len - count) as f64) as usize;
        let x = at - first as f64;
        let mut weights = [0.0; NODES];
        for (j, weight) in weights.iter_mut().enumerate().take(count) {
            *weight = (0..count)
                .filter(|&m| m != j)
                .map(|m| (x - m as f64) / (j as f64 - m as f64))
                .product();
        }
        Self {
            first,
            count,
            weights,
        }
    }

    /// The value there of samples on that clock.
    pub(crate) fn of(&self, values: &[f64]) -> f64 {
        let near = &values[self.first..self.first + self.count];
        near.iter().zip(&self.weights).map(|(v, w)| v * w).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_of_degree_seven_are_exact_and_sines_as_near_as_promised() {
        let clock = |i: usize| 2.0 + 0.005 * i as f64;
        let polynomial = |t: f64| 1.0 - t + 0.3 * (t - 2.1).powi(7) * 1e6;
        let omega = 2.0 * std::f64::consts::PI * 15.0;
        let sine = |t: f64| (omega * t).sin();
        let of = |f: &dyn Fn(f64) -> f64, len: usize| {
            (0..len).map(|i| f(clock(i))).collect::<Vec<f64>>()
        };
        let (exact, near) = (of(&polynomial, 40), of(&sine, 40));
        let bound = 1.1e-3 * (omega * 0.005).powi(8);
        for i in 0..390 {
            let t = clock(0) + 0.0005 * f64::from(i);
            let place = Place::new(t, 2.0, 0.005, 40);
            assert!((place.of(&exact) - polynomial(t)).abs() < 1e-9);
            let inner = (0.02..0.17).contains(&(t - 2.0));
            let off = (place.of(&near) - sine(t)).abs();
            assert!(!inner || off < bound, "{t}: off by {off}, not {bound}");
        }
        // A short clock: as many samples as there are.
        for len in 1..8 {
            let place = Place::new(clock(len / 2), 2.0, 0.005, len);
            let values: Vec<f64> = (0..len).map(|i| i as f64).collect();
            assert!((place.of(&values) - (len / 2) as f64).abs() < 1e-9);
        }
    }
}
