//! The standard Student-t distribution of one fixed number of degrees of freedom, tabulated for millions of look-ups.
//!
//! A predictive interval is the quantile of a mixture of hundreds of t distributions, found for thousands of rows; all of
//! them share their degrees of freedom. So the upper tail S(a) = P(T > a) is tabulated once and then costs a quintic
//! polynomial.

use crate::lanes::{LANES, Lane};

/// Cells of the table.
const CELLS: usize = 384;
/// Cells per unit of `min(1, √ν)`; the table ends at 12 of them, where a closed series takes over.
const CELLS_PER_UNIT: f64 = 32.0;
/// Gauss–Legendre nodes and weights on [0, 1], six points.
const NODES: [(f64, f64); 6] = [
    (0.033_765_242_898_423_99, 0.085_662_246_189_585_17),
    (0.169_395_306_766_867_74, 0.180_380_786_524_069_3),
    (0.380_690_406_958_401_56, 0.233_956_967_286_345_52),
    (0.619_309_593_041_598_5, 0.233_956_967_286_345_52),
    (0.830_604_693_233_132_3, 0.180_380_786_524_069_3),
    (0.966_234_757_101_576, 0.085_662_246_189_585_17),
];

/// Upper tail, density and slope of the density at one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tail {
    /// P(T ≤ t) for t < 0, P(T > t) for t ≥ 0: whichever is the smaller, so that it keeps its relative accuracy.
    pub(crate) probability: f64,
    /// f(t).
    pub(crate) density: f64,
    /// f'(t).
    pub(crate) slope: f64,
}

const NOTHING: Tail = Tail {
    probability: 0.0,
    density: 0.0,
    slope: 0.0,
};

/// Standard Student-t with ν degrees of freedom, any finite ν > 0; CDF accurate to 1e-12, tail with relative accuracy 1e-9.
#[derive(Debug, Clone, PartialEq)]
pub struct StudentT {
    dof: f64,
    /// Density at 0.
    peak: f64,
    /// Cells per unit of t.
    per_unit: f64,
    /// End of the table.
    end: f64,
    /// The tail beyond the table is below 1e-17: lanes that lie there need no series.
    ends_at_zero: bool,
    /// Quintic coefficients of S in the cell's own coordinate in [0, 1), lowest power first.
    cells: Vec<[f64; 6]>,
}

impl StudentT {
    /// Tabulates the distribution with `dof` = ν > 0 degrees of freedom (about 0.1 ms).
    ///
    /// S comes from the closed tail series at the table's end and Gauss–Legendre integrals of the density inwards; value,
    /// slope and curvature at the borders of each cell give its quintic.
    #[must_use]
    pub fn new(dof: f64) -> Self {
        let dof = dof.clamp(1e-6, 1e12);
        let per_unit = CELLS_PER_UNIT / dof.sqrt().min(1.0);
        let width = 1.0 / per_unit;
        let mut table = Self {
            dof,
            peak: gamma_ratio(0.5 * dof) / (dof * std::f64::consts::PI).sqrt(),
            per_unit,
            end: CELLS as f64 * width,
            ends_at_zero: false,
            cells: vec![[0.0; 6]; CELLS],
        };
        let mut upper = table.series(table.end);
        table.ends_at_zero = upper < 1e-17;
        for cell in (0..CELLS).rev() {
            let (left, right) = (cell as f64 * width, (cell + 1) as f64 * width);
            let integral: f64 = NODES
                .iter()
                .map(|&(node, weight)| weight * table.density(left + node * width))
                .sum();
            let lower = upper + width * integral;
            // Hermite data of S on [0, 1]: S' = −f·h, S'' = −f'·h².
            let (v0, v1) = (lower, upper);
            let (d0, d1) = (-table.density(left) * width, -table.density(right) * width);
            let (c0, c1) = (
                -table.slope(left) * width * width,
                -table.slope(right) * width * width,
            );
            let (dv, e0) = (v1 - v0 - d0 - 0.5 * c0, d1 - d0 - c0);
            let e1 = c1 - c0;
            table.cells[cell] = [
                v0,
                d0,
                0.5 * c0,
                10.0 * dv - 4.0 * e0 + 0.5 * e1,
                -15.0 * dv + 7.0 * e0 - e1,
                6.0 * dv - 3.0 * e0 + 0.5 * e1,
            ];
            upper = lower;
        }
        table
    }

    /// Degrees of freedom ν.
    #[must_use]
    pub fn dof(&self) -> f64 {
        self.dof
    }

    /// P(T ≤ t).
    #[must_use]
    pub fn cdf(&self, t: f64) -> f64 {
        let tail = self.tail(t).probability;
        if t < 0.0 { tail } else { 1.0 - tail }
    }

    /// The t with P(T ≤ t) = `probability`; ±∞ at 1 and 0, NaN outside.
    #[must_use]
    pub fn quantile(&self, probability: f64) -> f64 {
        if !(0.0..=1.0).contains(&probability) {
            return f64::NAN;
        }
        let wanted = probability.min(1.0 - probability);
        if wanted == 0.0 {
            return if probability == 0.0 {
                f64::NEG_INFINITY
            } else {
                f64::INFINITY
            };
        }
        let (mut low, mut high) = (0.0, 1.0);
        while self.tail(high).probability > wanted {
            low = high;
            high *= 2.0;
        }
        let mut t = 0.5 * (low + high);
        for _ in 0..200 {
            let tail = self.tail(t);
            if tail.probability > wanted {
                low = t;
            } else {
                high = t;
            }
            let newton = t + (tail.probability - wanted) / tail.density;
            let next = if newton > low && newton < high {
                newton
            } else {
                0.5 * (low + high)
            };
            let step = (next - t).abs();
            t = next;
            if step <= 4.0 * f64::EPSILON * t.max(f64::MIN_POSITIVE) {
                break;
            }
        }
        if probability < 0.5 { -t } else { t }
    }

    /// Smaller tail, density and slope at `t`.
    #[inline(always)]
    pub(crate) fn tail(&self, t: f64) -> Tail {
        let at = t.abs();
        let position = at * self.per_unit;
        let cell = position as usize;
        if cell < CELLS {
            let u = position - cell as f64;
            let [c0, c1, c2, c3, c4, c5] = self.cells[cell];
            let value = c0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))));
            let first = c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * (5.0 * c5))));
            let second = 2.0 * c2 + u * (6.0 * c3 + u * (12.0 * c4 + u * (20.0 * c5)));
            let slope = -second * self.per_unit * self.per_unit;
            Tail {
                probability: value,
                density: -first * self.per_unit,
                slope: if t < 0.0 { -slope } else { slope },
            }
        } else {
            Tail {
                probability: self.series(at),
                density: self.density(at),
                slope: self.slope(t),
            }
        }
    }

    /// CDF, density and slope at eight points; the lanes agree with [`StudentT::tail`] to rounding.
    #[inline(always)]
    pub(crate) fn lanes(&self, t: &Lane) -> [Lane; 3] {
        let mut fraction = [0.0; LANES];
        let mut coefficients = [[0.0; LANES]; 6];
        let mut outside = false;
        for lane in 0..LANES {
            let position = t[lane].abs() * self.per_unit;
            outside |= position >= CELLS as f64;
            let cell = position.min((CELLS - 1) as f64) as i32;
            fraction[lane] = position - f64::from(cell);
            let row = &self.cells[cell as usize];
            for power in 0..6 {
                coefficients[power][lane] = row[power];
            }
        }
        let [c0, c1, c2, c3, c4, c5] = coefficients;
        let (mut cdf, mut density, mut slope) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let u = fraction[lane];
            let value = c0[lane]
                + u * (c1[lane] + u * (c2[lane] + u * (c3[lane] + u * (c4[lane] + u * c5[lane]))));
            let first = c1[lane]
                + u * (2.0 * c2[lane]
                    + u * (3.0 * c3[lane] + u * (4.0 * c4[lane] + u * (5.0 * c5[lane]))));
            let second = 2.0 * c2[lane]
                + u * (6.0 * c3[lane] + u * (12.0 * c4[lane] + u * (20.0 * c5[lane])));
            let bend = second * self.per_unit * self.per_unit;
            cdf[lane] = if t[lane] < 0.0 { value } else { 1.0 - value };
            density[lane] = -first * self.per_unit;
            slope[lane] = if t[lane] < 0.0 { bend } else { -bend };
        }
        if outside {
            for lane in 0..LANES {
                if t[lane].abs() * self.per_unit < CELLS as f64 {
                    continue;
                }
                let tail = if self.ends_at_zero {
                    NOTHING
                } else {
                    self.tail(t[lane])
                };
                cdf[lane] = if t[lane] < 0.0 {
                    tail.probability
                } else {
                    1.0 - tail.probability
                };
                density[lane] = tail.density;
                slope[lane] = tail.slope;
            }
        }
        [cdf, density, slope]
    }

    /// f(t) = peak · (1 + t²/ν)^(−(ν+1)/2).
    fn density(&self, t: f64) -> f64 {
        self.peak * (-0.5 * (self.dof + 1.0) * (t * t / self.dof).ln_1p()).exp()
    }

    /// f'(t) = −f(t) · t (ν+1)/(ν+t²).
    fn slope(&self, t: f64) -> f64 {
        -self.density(t) * t * (self.dof + 1.0) / (self.dof + t * t)
    }

    /// S(t) for t beyond the table: ½ I_x(ν/2, ½) with x = ν/(ν+t²), by the series of the incomplete beta function
    /// (DLMF 8.17.7); all its terms are positive.
    fn series(&self, t: f64) -> f64 {
        if t == f64::INFINITY {
            return 0.0;
        }
        let half = 0.5 * self.dof;
        let x = self.dof / (self.dof + t * t);
        // x^a (1−x)^½ / (2 a B(a, ½)) Σ (a+½)_n / (a+1)_n xⁿ, with 1/B(a, ½) = peak·√ν.
        let mut sum = 1.0;
        let mut term = 1.0;
        let front = (-half * (t * t / self.dof).ln_1p()).exp()
            * (1.0 - x).sqrt()
            * self.peak
            * self.dof.sqrt()
            / self.dof;
        if front < 1e-300 {
            return 0.0;
        }
        let mut n = 0.0;
        while n < 4000.0 && term > 1e-17 * sum {
            term *= x * (half + 0.5 + n) / (half + 1.0 + n);
            sum += term;
            n += 1.0;
        }
        front * sum
    }
}

/// Γ(x + ½)/Γ(x) without the cancellation of two log-gammas: shifted to x ≥ 40, then the asymptotic series
/// √x (1 − 1/(8x) + 1/(128x²) + 5/(1024x³) − 21/(32768x⁴) − 399/(262144x⁵) + …) (DLMF 5.11.13).
fn gamma_ratio(x: f64) -> f64 {
    let (mut x, mut shift) = (x, 1.0);
    while x < 40.0 {
        shift *= x / (x + 0.5);
        x += 1.0;
    }
    let y = 1.0 / x;
    let series = 1.0
        + y * (-1.0 / 8.0
            + y * (1.0 / 128.0
                + y * (5.0 / 1024.0
                    + y * (-21.0 / 32768.0 + y * (-399.0 / 262_144.0 + y * 869.0 / 4_194_304.0)))));
    shift * x.sqrt() * series
}
