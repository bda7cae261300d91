//! What weighing rows costs: how much less rows know that a t likelihood weighs than rows of known weights.

use std::ops::AddAssign;

/// Degrees of freedom of the t likelihood that robust rows have.
const FREEDOM: f64 = 4.0;

/// Sums over rows with weights u.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Weighing {
    score: f64,
    slope: f64,
    known: f64,
    square: f64,
    count: f64,
}

impl Weighing {
    /// A row that counts u.
    pub(super) fn add(&mut self, u: f64) {
        let t2 = (FREEDOM + 1.0) / u - FREEDOM;
        self.score += u * u * t2;
        self.slope += u * u * (FREEDOM - t2) / (FREEDOM + 1.0);
        self.known += u;
        self.square += u * t2;
        self.count += 1.0;
    }

    /// The variance of the t likelihood's estimate over the one that known weights would give, from the weights alone (t² = (ν+1)/u − ν); 1 without
    /// rows. With ψ = u t (Huber 1981, eq. 4.6.11)
    ///
    /// ```text
    /// κ = E[ψ²]/E[ψ']² · E[u]/E[u t²],     ψ' = u² (ν − t²)/(ν + 1)
    /// ```
    pub(crate) fn cost(&self) -> f64 {
        let own = self.score * self.count / (self.slope * self.slope);
        let cost = own * self.known / self.square;
        if cost.is_finite() { cost.max(1.0) } else { 1.0 }
    }
}

impl AddAssign<&Weighing> for Weighing {
    fn add_assign(&mut self, other: &Weighing) {
        self.score += other.score;
        self.slope += other.slope;
        self.known += other.known;
        self.square += other.square;
        self.count += other.count;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ContinuousCDF, StudentsT};

    /// t rows: the Fisher information is (ν+1)/(ν+3) of what known weights would give, κ = 7/5; also of sums of sums.
    #[test]
    fn weighing_costs_what_the_information_says() {
        let t = StudentsT::new(0.0, 1.0, FREEDOM).expect("a scale of 1");
        let count = 40_000;
        let mut halves = [Weighing::default(), Weighing::default()];
        for i in 0..count {
            let r = t.inverse_cdf((i as f64 + 0.5) / count as f64);
            halves[i % 2].add((FREEDOM + 1.0) / (FREEDOM + r * r));
        }
        let [mut sum, other] = halves;
        sum += &other;
        assert!((sum.cost() - 1.4).abs() < 2e-3, "{}", sum.cost());
        assert_eq!(Weighing::default().cost(), 1.0);
    }
}
