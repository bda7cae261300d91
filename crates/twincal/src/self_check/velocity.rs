//! Velocity that is the change of position times one number on all joints: a clock, or a unit, that is wrong.

use super::sample::Sample;
use crate::error::{Code, Finding, Severity};
use crate::words::significant;

/// |ln slope| from which velocity is not the change of position: 3 %, where inertial torque is off by 6 %.
const ANOTHER: f64 = 0.03;
/// |ln| by which the slopes of joints may differ.
const ALIKE: f64 = 0.01;
/// Joints that must agree: one alone may have its own gear.
const FEWEST: usize = 2;

/// A finding for every log in which all joints that move have the same slope, and it is not 1.
pub(super) fn findings<'a>(logs: impl Iterator<Item = (&'a str, &'a Sample)>) -> Vec<Finding> {
    let wrong = logs.filter_map(|(log, sample)| Some((log, common(&sample.slopes)?)));
    wrong.map(|(log, slope)| finding(log, slope)).collect()
}

/// The slope that all joints have, where it is clearly not 1.
fn common(slopes: &[Option<f64>]) -> Option<f64> {
    let mut told: Vec<f64> = slopes.iter().flatten().copied().collect();
    told.sort_unstable_by(f64::total_cmp);
    let (low, high) = (*told.first()?, *told.last()?);
    let middle = told[told.len() / 2];
    let is_common = told.len() >= FEWEST && (high / low).ln() <= 2.0 * ALIKE;
    (is_common && middle.ln().abs() > ANOTHER).then_some(middle)
}

fn finding(log: &str, slope: f64) -> Finding {
    let (times, order) = match slope > 1.0 {
        true => (slope, "long"),
        false => (1.0 / slope, "short"),
    };
    Finding::new(
        Severity::Degraded,
        Code::ClockScale,
        log,
        format!(
            "log `{log}`: the logged velocity of all joints is {} times the change of their position: looks like a clock whose time is {} times \
             too {order}, or a velocity in another unit; nothing was changed: give the true rate with --rate HZ ({} times that of the stamps), or \
             the factor {} for qd in [columns.factor]",
            significant(slope, 4),
            significant(times, 4),
            significant(slope, 4),
            significant(1.0 / slope, 4)
        ),
        0,
    )
    .with([("slope", slope), ("time_factor", slope)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_is_common_where_all_joints_have_it_and_it_is_not_one() {
        assert_eq!(common(&[Some(1.1), None, Some(1.099)]), Some(1.1));
        for good in [
            &[Some(1.0), Some(1.001), None][..],
            &[Some(1.02), Some(1.02)],
            &[Some(1.1), None],
            &[Some(1.1), Some(1.0)],
            &[],
        ] {
            assert_eq!(common(good), None, "{good:?}");
        }
        let message = finding("run", 1.1).message;
        assert!(message.contains("1.100 times too long"), "{message}");
    }
}
