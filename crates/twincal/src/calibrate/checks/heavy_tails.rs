//! Outliers: more large residuals than noise gives (case 92).

use crate::error::{Code, Finding, Severity};
use crate::observations::Part;
use crate::robot::Robot;
use crate::words::significant;

/// A residual beyond this many robust standard deviations is an outlier: 6 in 100 000 of a normal distribution.
const FAR: f64 = 4.0;
/// Share of outliers from which they are named.
const SHARE: f64 = 0.01;
/// Fewest outliers that are named.
const FEWEST: usize = 5;
/// Median of |x| of a standard normal variable.
const MEDIAN: f64 = 0.674_489_750_196_081_7;

/// One finding per joint whose residual has heavy tails. The intervals hold with them, since σ contains them, but they are
/// wider than the other rows need, and the estimates less sharp.
pub(in crate::calibrate) fn findings(
    robot: &Robot,
    training: &[Part<'_>],
    mean: &[f64],
    robust: bool,
) -> Vec<Finding> {
    let advice = if robust {
        "they count little in this fit (noise.robust)"
    } else {
        "they widen the intervals of all rows: cut what is no free motion (contacts, stops) out of the log, or set \
         noise.robust"
    };
    let mut findings = Vec::new();
    for (joint, name) in robot.joint_names().into_iter().enumerate() {
        let residual: Vec<f64> = training
            .iter()
            .flat_map(|part| part.residual_runs(joint, mean))
            .flatten()
            .collect();
        let Some((count, sd)) = outliers(&residual) else {
            continue;
        };
        findings.push(Finding::new(
            Severity::Warning,
            Code::HeavyTails,
            name,
            format!(
                "joint `{name}`: {count} of {} residuals ({:.1} %) are beyond {FAR} robust sd ({}), normal noise has 0.006 %: \
                 contacts, dropped samples or missing physics; {advice}",
                residual.len(),
                100.0 * count as f64 / residual.len() as f64,
                significant(sd, 3)
            ),
            count as u64,
        )
        .with([
            ("rows", residual.len() as f64), ("share", count as f64 / residual.len() as f64),
            ("robust_sd", sd), ("limit_in_sd", FAR),
        ]));
    }
    findings
}

/// Number of outliers and the robust sd, where there are too many.
fn outliers(residual: &[f64]) -> Option<(usize, f64)> {
    let mut size: Vec<f64> = residual.iter().map(|r| r.abs()).collect();
    size.sort_by(f64::total_cmp);
    let sd = size.get(size.len() / 2)? / MEDIAN;
    let count = size.len() - size.partition_point(|r| *r <= FAR * sd);
    let many = count >= FEWEST && count as f64 >= SHARE * size.len() as f64;
    (many && sd > 0.0).then_some((count, sd))
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

    /// The quantiles of a distribution at 4000 even probabilities.
    fn sample(quantile: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..4000)
            .map(|i| quantile((f64::from(i) + 0.5) / 4000.0))
            .collect()
    }

    #[test]
    fn heavy_tails_are_told_from_normal_ones() {
        let normal = Normal::standard();
        assert_eq!(outliers(&sample(|p| 3.0 * normal.inverse_cdf(p))), None);
        // Student's t with 2 degrees: |x| > 4 · 0.8165 / 0.6745 = 4.84 has 2(1 − F(4.84)) = 4.0 %.
        let student = StudentsT::new(0.0, 1.0, 2.0).unwrap();
        let (count, sd) = outliers(&sample(|p| student.inverse_cdf(p))).unwrap();
        let expected = 2.0 * (1.0 - student.cdf(FAR * sd));
        assert!((sd - 0.816_496_58 / MEDIAN).abs() < 1e-3, "{sd}");
        assert!(
            (count as f64 / 4000.0 - expected).abs() < 1e-3,
            "{count} {expected}"
        );
        assert_eq!(outliers(&[]), None);
        assert_eq!(outliers(&[0.0; 50]), None);
    }
}
