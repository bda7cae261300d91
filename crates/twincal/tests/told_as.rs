//! A link's moment about its joint and its motor's inertia are one torque, but no motor has a negative inertia.

use crate::two_link;
use twincal::calibrate::{Calibration, CalibrationSettings, calibrate};
use twincal::random::Random;
use twincal::robot::Robot;
use twincal::signal::Auto;
use twincal::term::Family;

/// An arm whose upper link has `change` more inertia about its joint than the model's, which has 0.4 kg·m² there.
fn found(change: f64, nonnegative: bool) -> Calibration {
    let arm = |more: f64| {
        let mut description = two_link::arm(2.0).expect("an arm").description().clone();
        let inertia = description.links[1].inertia.as_mut();
        let tensor = &mut inertia.expect("a mass").tensor;
        for (i, moment) in [0.3, 0.3, 0.4 + more].into_iter().enumerate() {
            tensor[i][i] = moment;
        }
        Robot::new(description, &Default::default())
            .expect("an arm")
            .0
    };
    let (nominal, real, mut noise) = (arm(0.0), arm(change), Random::new(3, 0));
    let logs = [0.3, 1.9].map(|phase| two_link::log("a log", phase, &real, &mut noise));
    let mut settings = CalibrationSettings::default();
    settings.library.terms = vec!["sin(q1 - q2)".into()];
    settings.library.families = vec![Family::Tensor, Family::MotorInertia];
    settings.library.nonnegative = nonnegative;
    settings.signal.cutoff_hz = Auto::Value(0.0);
    calibrate(&nominal, &logs[..1], &logs[1..], &settings, &|_| {}).expect("a calibration")
}

/// Names that the tensor of the upper link goes by, in a group or by itself.
fn names(calibration: &Calibration) -> Vec<String> {
    let own = "upper.tensor".to_owned();
    let groups = calibration.groups.iter();
    let grouped = groups.filter(|group| group.members.contains(&own));
    let mut names: Vec<String> = grouped.flat_map(|group| group.members.clone()).collect();
    let component = calibration.components.iter().find(|c| c.name == own);
    names.extend(component.expect("a tensor").names_beside().to_vec());
    names.retain(|name| *name != own);
    names.sort();
    names.dedup();
    names
}

/// False alarm: an effect of 0.1 kg·m², some fifty standard errors, not found, below 1e-9.
#[test]
fn a_moment_that_is_less_is_no_motor() {
    let less = found(-0.1, true);
    let tensor = |c: &Calibration| {
        let mut all = c.components.iter();
        all.any(|c| c.name == "upper.tensor" && c.is_in())
    };
    assert!(tensor(&less), "{:?}", less.groups);
    assert_eq!(names(&less), [""; 0]);
    assert!(less.told_apart_by_the_prior().is_empty());
    // Where a motor's inertia may be negative, and where there is more, it is.
    for other in [found(-0.1, false), found(0.1, true)] {
        assert_eq!(
            names(&other),
            ["shoulder.motor_inertia"],
            "{:?}",
            other.groups
        );
    }
}
