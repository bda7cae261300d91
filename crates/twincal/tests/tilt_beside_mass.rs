//! A base that leans and a payload: gravity acts on the payload as well, which the column of `base.tilt` does not know.

#[path = "../examples/two_link.rs"]
#[allow(dead_code, reason = "its `main` and its study are not needed here")]
mod two_link;

use twincal::Finding;
use twincal::calibrate::{CalibrationSettings, calibrate};
use twincal::random::Random;
use twincal::robot::Robot;
use twincal::signal::{Auto, Payload, Recording};
use twincal::term::Family;

/// kg at the tip that the model lacks, m/s² along x that it does not know.
const LOAD: f64 = 0.6;
const LEAN: f64 = 0.5;

fn findings(load: f64, lean: f64, payload: Payload) -> Vec<Finding> {
    let mut description = two_link::arm(2.0 + load)
        .expect("an arm")
        .description()
        .clone();
    description.gravity[0] += lean;
    let (real, _) = Robot::new(description, &Default::default()).expect("an arm");
    let mut noise = Random::new(7, 0);
    let mut log = |name: &str, phase: f64| -> Recording {
        Recording {
            payload,
            ..two_link::log(name, phase, &real, &mut noise)
        }
    };
    let logs = [log("training", 0.3), log("held-out", 1.9)];
    let mut settings = CalibrationSettings::default();
    settings.library.terms = vec!["sin(q1 - q2)".into()];
    settings.library.families = vec![Family::Payload, Family::Tilt];
    settings.signal.cutoff_hz = Auto::Value(0.0);
    let nominal = two_link::arm(2.0).expect("an arm");
    let result = calibrate(&nominal, &logs[..1], &logs[1..], &settings, &|_| {});
    let all = result.expect("a calibration").findings;
    all.into_iter()
        .filter(|f| f.code == "tilt_beside_mass")
        .collect()
}

/// At rest the shoulder's torque of gravity is g (2.5 cos q1 + 1.0 cos(q1 + q2)), the elbow's g cos(q1 + q2); 0.6 kg at the tip add 0.3 g of
/// each cosine. Over all positions √(0.135/4.125) = 18.1 %; 256 of them tell it to 1 %.
#[test]
fn gravity_on_a_found_payload_is_told_with_its_share() {
    let told = findings(LOAD, LEAN, Payload::None);
    assert_eq!(told.len(), 1);
    let words = &told[0].message;
    let share = words
        .split("gravity by ")
        .nth(1)
        .and_then(|rest| rest.split(' ').next());
    let share: f64 = share.and_then(|text| text.parse().ok()).expect("a number");
    assert!((share - 18.1).abs() < 2.0, "{words}");
}

/// False alarm: one of the two effects that is not there found, below one in 300 (docs/selection.md).
#[test]
fn one_of_the_two_alone_is_what_it_says() {
    assert!(findings(0.0, LEAN, Payload::None).is_empty());
    assert!(findings(LOAD, 0.0, Payload::None).is_empty());
    let known = Payload::Known {
        mass: LOAD,
        com: [0.5, 0.0, 0.0],
    };
    assert!(findings(LOAD, LEAN, known).is_empty());
}
