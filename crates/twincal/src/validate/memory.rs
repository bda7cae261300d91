//! How many rows of an error count as one independent row, by the error itself.

use std::ops::AddAssign;

/// Largest correlation of neighbouring rows that is believed.
const MOST: f64 = 0.999;

/// Sums over the errors e of one joint's rows. What the library lacks comes back with the motion, and so does its error, longer than noise
/// does:
///
/// ```text
/// memory = (1 + ρ)/(1 − ρ),     ρ = mean of e_t e_{t+1} over mean of e_t²
/// ```
///
/// as of an autoregressive error of first order; the mean is not taken off, an error that stays is one row.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ErrorMemory {
    rows: f64,
    squares: f64,
    pairs: f64,
    products: f64,
}

impl ErrorMemory {
    /// Adds those rows of a block for which `keep(row)` holds; neighbours are rows that follow each other.
    pub(crate) fn push(&mut self, errors: &[f64], keep: impl Fn(usize) -> bool) {
        for (row, error) in errors.iter().enumerate().filter(|(row, _)| keep(*row)) {
            self.rows += 1.0;
            self.squares += error * error;
            if row > 0 && keep(row - 1) {
                self.pairs += 1.0;
                self.products += error * errors[row - 1];
            }
        }
    }

    /// Rows that count as one, at least 1.
    pub(crate) fn rows(&self) -> f64 {
        if self.pairs == 0.0 || self.squares == 0.0 {
            return 1.0;
        }
        let rho = (self.products / self.pairs) / (self.squares / self.rows);
        let rho = rho.clamp(0.0, MOST);
        (1.0 + rho) / (1.0 - rho)
    }
}

impl AddAssign for ErrorMemory {
    /// Adds rows that do not follow.
    fn add_assign(&mut self, other: Self) {
        self.rows += other.rows;
        self.squares += other.squares;
        self.pairs += other.pairs;
        self.products += other.products;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Autoregressive errors of 40 000 rows in blocks of 100: (1 + ρ)/(1 − ρ) within 10 %, five standard deviations or more.
    #[test]
    fn the_memory_of_an_autoregressive_error_is_found() {
        for (case, rho) in [0.0, 0.5, 0.8_f64].into_iter().enumerate() {
            let mut random = Random::new(5, case as u64);
            let mut error = 0.0;
            let mut memory = ErrorMemory::default();
            for _ in 0..400 {
                let mut block = [0.0; 100];
                for value in &mut block {
                    error = rho * error + (1.0 - rho * rho).sqrt() * random.normal();
                    *value = error;
                }
                memory.push(&block, |_| true);
            }
            let truth = (1.0 + rho) / (1.0 - rho);
            assert!((memory.rows() / truth - 1.0).abs() < 0.1, "{rho}");
        }
    }

    #[test]
    fn an_error_that_stays_is_one_row_and_rows_that_are_left_out_part_others() {
        let mut stays = ErrorMemory::default();
        stays.push(&[0.3; 50], |_| true);
        assert!(stays.rows() > 1000.0);
        // Every other row alone: no neighbours, no memory.
        let mut alone = ErrorMemory::default();
        alone.push(&[0.3; 50], |row| row % 2 == 0);
        assert_eq!(alone.rows(), 1.0);
        assert_eq!(ErrorMemory::default().rows(), 1.0);
        let mut sum = ErrorMemory::default();
        sum += stays;
        sum += alone;
        assert_eq!((sum.rows, sum.pairs), (75.0, 49.0));
    }
}
