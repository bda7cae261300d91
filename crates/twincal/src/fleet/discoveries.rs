//! Which units are named: as many as the false discovery rate allows.
//!
//! # Source
//! Newton, Noueiry, Sarkar and Ahlquist, Detecting differential gene expression with a semiparametric hierarchical mixture method,
//! Biostatistics 5 (2004), section 4: the expected share of false discoveries among the units named is the mean of their 1 − P.

/// Which of these are named: the most likely ones, as long as the mean of 1 − P over them is at most `rate`.
pub(super) fn named(probabilities: &[f64], rate: f64) -> Vec<bool> {
    let mut order: Vec<usize> = (0..probabilities.len()).collect();
    order.sort_by(|&a, &b| {
        probabilities[b]
            .total_cmp(&probabilities[a])
            .then(a.cmp(&b))
    });
    let mut named = vec![false; probabilities.len()];
    let mut sum = 0.0;
    for (place, &unit) in order.iter().enumerate() {
        sum += 1.0 - probabilities[unit];
        if sum.is_nan() || sum > rate * (place + 1) as f64 {
            break;
        }
        named[unit] = true;
    }
    named
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_what_may_be_wrong_stays_below_the_rate() {
        // Means of 1 − P from the largest on: 0.01, 0.02, 0.0467, 0.16.
        let probabilities = [0.97, 0.5, 0.99, 0.9];
        assert_eq!(named(&probabilities, 0.05), [true, false, true, true]);
        assert_eq!(named(&probabilities, 0.021), [true, false, true, false]);
        assert_eq!(named(&[0.9, 0.2], 0.05), [false, false]);
        assert!(named(&[], 0.05).is_empty());
    }
}
