//! A drive that warms up while it is logged: what the fit says of it.

use crate::two_link;
use twincal::Code;
use twincal::calibrate::{Calibration, CalibrationSettings, calibrate};
use twincal::random::Random;
use twincal::signal::Auto;
use twincal::term::Family;

/// Coulomb friction of the elbow, 1 N·m, falls by 0.04 N·m per degree while its drive warms from 20 to 35 degrees; its temperature is
/// logged once a second, with nothing in between.
fn warmed(logged: bool) -> Calibration {
    let mut noise = Random::new(31, 0);
    let nominal = two_link::arm(2.0).expect("an arm");
    let mut log = two_link::log("log", 0.3, &nominal, &mut noise);
    let temperature = |t: f64| 35.0 - 15.0 * (-t / 6.0).exp();
    let time = log.time.clone();
    let elbow = &mut log.joints[1];
    let speed = elbow.qd.clone().expect("a velocity");
    for ((tau, qd), t) in elbow.tau.iter_mut().flatten().zip(speed).zip(&time) {
        *tau += (1.0 - 0.04 * (temperature(*t) - 30.0)) * qd.signum();
    }
    let sample = |(row, t): (usize, &f64)| {
        let known = row % 100 == 0;
        if known { temperature(*t) } else { f64::NAN }
    };
    elbow.temperature = logged.then(|| time.iter().enumerate().map(sample).collect());
    let mut settings = CalibrationSettings::default();
    settings.library.terms = vec!["sin(q1 - q2)".into()];
    settings.library.families = vec![Family::Coulomb];
    settings.library.coulomb_velocity = 0.0;
    settings.signal.cutoff_hz = Auto::Value(0.0);
    calibrate(&nominal, &[log], &[], &settings, &|_| {}).expect("a calibration")
}

/// The slope's own standard error is 0.004 or so: −0.04 is told to its first digit.
#[test]
fn friction_that_goes_with_the_logged_temperature_is_told_with_its_slope() {
    let said = |result: &Calibration, code: &str| {
        let mut all = result.findings.iter().filter(|f| f.code.as_str() == code);
        all.next().map(|f| (f.subject.clone(), f.message.clone()))
    };
    let result = warmed(true);
    let (joint, message) = said(&result, "drift_with_temperature").expect("a finding");
    assert_eq!(joint, "elbow");
    assert!(
        message.contains("friction goes with the temperature, -0.0"),
        "{message}"
    );
    let slope = message.split("temperature, ").nth(1).expect("a number");
    let slope: f64 = slope
        .split(' ')
        .next()
        .unwrap_or("")
        .parse()
        .expect("a number");
    assert!((slope + 0.04).abs() < 0.01, "{message}");
    assert!(!result.findings.iter().any(|f| f.code == Code::Drift));

    assert_eq!(said(&warmed(false), "drift_with_temperature"), None);
}
