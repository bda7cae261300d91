//! A calibration seen joint by joint: names, units and held-out traces, as every section needs them.

use crate::words::units::Units;
use twincal::calibrate::Calibration;
use twincal::likelihood::JointNoise;
use twincal::validate::Trace;

/// One moving joint with everything that the report says about it.
#[derive(Debug)]
pub(super) struct Joint<'a> {
    pub(super) name: &'a str,
    pub(super) units: Units,
    pub(super) noise: &'a JointNoise,
    /// Held-out traces with at least one row, the one that the calibrated twin predicts worst first.
    pub(super) traces: Vec<&'a Trace>,
}

/// The moving joints in the model's order.
pub(super) fn joints(calibration: &Calibration) -> Vec<Joint<'_>> {
    calibration
        .noise
        .iter()
        .enumerate()
        .map(|(index, noise)| {
            let mut traces: Vec<&Trace> = calibration
                .validation
                .traces
                .iter()
                .filter(|t| t.joint == noise.joint && rows(t) > 0)
                .collect();
            traces.sort_by(|a, b| {
                rmse(b, &b.calibrated)
                    .total_cmp(&rmse(a, &a.calibrated))
                    .then(a.log.cmp(&b.log))
            });
            let kind = calibration.twin.robot.joint_kind(index);
            Joint {
                name: &noise.joint,
                units: Units::of(kind),
                noise,
                traces,
            }
        })
        .collect()
}

/// Rows that every array of the trace has.
pub(super) fn rows(trace: &Trace) -> usize {
    trace
        .time
        .len()
        .min(trace.measured.len())
        .min(trace.nominal.len())
        .min(trace.calibrated.len())
}

/// Whether the joint both moves and stands still in it.
pub(super) fn stands_still_between(trace: &Trace) -> bool {
    trace.standstill.contains(&true) && trace.standstill.contains(&false)
}

/// Root mean square of measured − predicted over the rows where both are finite, of moving ones where there are some; NaN without any.
pub(super) fn rmse(trace: &Trace, predicted: &[f64]) -> f64 {
    let between = stands_still_between(trace);
    let rows = trace.measured.iter().zip(predicted).enumerate();
    let told = rows.filter(|(row, _)| !(between && trace.standstill[*row]));
    root_mean_square(told.map(|(_, (m, p))| m - p))
}

/// Root mean square of the finite values; NaN without any.
pub(super) fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (n, sum) = values
        .filter(|x| x.is_finite())
        .fold((0.0, 0.0), |(n, sum), x| (n + 1.0, sum + x * x));
    f64::sqrt(sum / n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logs_are_in_the_order_of_the_error_that_is_told_of_them() {
        let mut calibration = crate::report::fixture::two_joints();
        let traces = &mut calibration.validation.traces;
        let own = |trace: &&mut Trace| trace.joint == "elbow";
        for (k, trace) in traces.iter_mut().filter(own).enumerate() {
            let len = trace.measured.len();
            trace.standstill = (0..len).map(|row| row % 2 == 1).collect();
            trace.measured = vec![0.0; len];
            // The later ones are worse while they move and far better at rest.
            let error = |row: usize| match row % 2 {
                0 => 1.0 + k as f64,
                _ => 9.0 - 3.0 * k as f64,
            };
            trace.calibrated = (0..len).map(error).collect();
        }
        let joints = joints(&calibration);
        let elbow = joints.iter().find(|joint| joint.name == "elbow").unwrap();
        let told: Vec<f64> = elbow
            .traces
            .iter()
            .map(|t| rmse(t, &t.calibrated))
            .collect();
        assert!(
            told.len() > 1 && told.is_sorted_by(|a, b| a >= b),
            "{told:?}"
        );
        assert_eq!(told.last(), Some(&1.0));
    }

    #[test]
    fn moments_ignore_what_is_not_finite() {
        assert_eq!(root_mean_square([3.0, f64::NAN, -3.0].into_iter()), 3.0);
        assert!(root_mean_square(std::iter::empty()).is_nan());
    }
}
