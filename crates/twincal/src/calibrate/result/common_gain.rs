//! One factor on the torque of all drives that is far from 1: less a drive constant than another unit or gain of the columns.

use super::calibration::ComponentSummary;
use super::status::Status;
use crate::error::{Code, Finding, Severity};
use crate::term::Family;
use crate::words::significant;

/// Deviation from 1 from which on it is said.
const FAR: f64 = 0.1;

/// What an established `drives.gain` says of the logs; `None` where it is not established or near 1. `from_currents`: drive constants are known
/// to be uncertain.
pub(in crate::calibrate) fn finding(
    components: &[ComponentSummary],
    from_currents: bool,
) -> Option<Finding> {
    let common = |component: &&ComponentSummary| {
        component.family == Family::Gain && component.name == "drives.gain"
    };
    let found = components.iter().find(common)?;
    let gain = found.parameters.first()?;
    if found.status != Status::Established {
        return None;
    }
    let [low, high] = gain.interval68;
    of_factor(1.0 + gain.median, 0.5 * (high - low), from_currents)
}

/// The same of torque that is `factor` ± `sd` times the model's.
fn of_factor(factor: f64, sd: f64, from_currents: bool) -> Option<Finding> {
    if (factor - 1.0).abs() < FAR {
        return None;
    }
    let severity = match from_currents {
        true => Severity::Warning,
        false => Severity::Degraded,
    };
    let message = format!(
        "torque of all joints is {} ± {} times what the model with its found effects asks for, gravity and inertia alike (`drives.gain`): looks \
         like another unit or gain of the torque columns, drive constants that are all off, or a model in other units of mass, length or time; \
         check the drive constants and the clock, or give [columns.factor] tau = {}. It was fitted: other effects are those of the true torque if \
         the model's own masses are right",
        significant(factor, 3),
        significant(sd, 1),
        significant(1.0 / factor, 3)
    );
    Some(
        Finding::new(severity, Code::CommonFactor, "", message, 0)
            .with([("factor", factor), ("factor_sd", sd)]),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_far_from_one_forbids_a_yes_unless_currents_were_logged() {
        assert_eq!(of_factor(1.08, 0.01, false), None);
        assert_eq!(of_factor(0.93, 0.01, false), None);
        let said = of_factor(1.2, 0.013, false).unwrap();
        assert!(said.forbids_yes());
        for words in ["1.20 ± 0.01 times", "tau = 0.833"] {
            assert!(said.message.contains(words), "{}", said.message);
        }
        assert!(!of_factor(0.8, 0.01, true).unwrap().forbids_yes());
    }
}
