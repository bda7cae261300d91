//! One status per effect, on simulated arms whose truth is known.

use crate::two_link;
use twincal::calibrate::{
    Alike, Calibration, CalibrationSettings, ComponentSummary, LeftOutData, Status, StatusReason,
    calibrate,
};
use twincal::likelihood::NoiseModel;
use twincal::random::Random;
use twincal::robot::Robot;
use twincal::signal::{Auto, Recording};
use twincal::term::Family;

const HIDDEN: &str = "sin(q1 - q2)";

fn logs(real: &Robot, seed: u64) -> [Recording; 2] {
    let mut noise = Random::new(seed, 0);
    [0.3, 1.9].map(|phase| two_link::log("a log", phase, real, &mut noise))
}

fn settings(terms: &[&str], families: &[Family]) -> CalibrationSettings {
    let mut settings = CalibrationSettings::default();
    settings.library.terms = terms.iter().map(|&term| term.to_owned()).collect();
    settings.library.families = families.to_vec();
    settings.signal.cutoff_hz = Auto::Value(0.0);
    settings
}

fn fitted(nominal: &Robot, logs: &[Recording], settings: &CalibrationSettings) -> Calibration {
    calibrate(nominal, logs, &logs[..0], settings, &|_| {}).expect("a calibration")
}

fn of<'a>(calibration: &'a Calibration, name: &str) -> &'a ComponentSummary {
    let mut all = calibration.components.iter();
    all.find(|c| c.name == name).expect("a component")
}

/// The effect has a hundred standard errors and more; viscous friction is not there (PIP ≥ 0.95 by chance: below 1e-3).
#[test]
fn a_true_effect_is_established_by_the_other_log_or_by_fifths() {
    let arm = two_link::arm(2.0).expect("an arm");
    let logs = logs(&arm, 5);
    for (logs, data) in [
        (&logs[..], LeftOutData::Logs),
        (&logs[..1], LeftOutData::Fifths),
    ] {
        let found = fitted(&arm, logs, &settings(&[HIDDEN], &[Family::Viscous]));
        let hidden = of(&found, HIDDEN);
        assert_eq!(hidden.status, Status::Established);
        let StatusReason::LeftOut(error) = &hidden.reason else {
            panic!("{hidden:?}");
        };
        assert!(error.left_out == data && error.lowered > 0.5, "{error:?}");
        assert_ne!(of(&found, "elbow.viscous").status, Status::Established);
    }
}

/// The effect acts in the last two of twenty seconds: its PIP is 1, but what is left out never confirms it.
#[test]
fn an_effect_of_one_stretch_alone_is_tentative() {
    let arm = two_link::arm(2.0).expect("an arm");
    let [mut log, _] = logs(&arm, 6);
    let (q1, q2) = (log.joints[0].q.clone(), log.joints[1].q.clone());
    for (joint, sign) in [(0, 1.0), (1, -1.0)] {
        let torque = log.joints[joint].tau.as_mut().expect("torque");
        for row in 0..1800 {
            torque[row] += sign * 0.8 * (q1[row] - q2[row]).cos();
        }
    }
    // The default likelihood has too few independent rows left to answer at all.
    let mut settings = settings(&[HIDDEN], &[Family::Viscous]);
    settings.noise.model = NoiseModel::Iid;
    let found = fitted(&arm, &[log], &settings);
    let hidden = of(&found, HIDDEN);
    assert!(hidden.pip > Some(0.99), "{hidden:?}");
    assert_eq!(hidden.status, Status::Tentative);
    assert!(matches!(&hidden.reason, StatusReason::LeftOut(error) if !error.is_clear()));
}

/// Two terms whose torques differ by less than a standard error: either takes the other's place without loss.
#[test]
fn two_names_of_one_torque_are_equivalent_in_these_logs() {
    let arm = two_link::arm(2.0).expect("an arm");
    let other = "sin(q1 - q2) + 0.001*sin(q1)";
    let found = fitted(
        &arm,
        &logs(&arm, 7),
        &settings(&[HIDDEN, other], &[Family::Viscous]),
    );
    for name in [HIDDEN, other] {
        let own = of(&found, name);
        assert_eq!(own.status, Status::Equivalent, "{own:?}");
        let StatusReason::SameTorque {
            members,
            pip,
            alike,
        } = &own.reason
        else {
            panic!("{own:?}");
        };
        assert_eq!((members.len(), *alike), (2, Alike::TheseLogs));
        assert!(*pip > 0.99);
    }
}

/// A link whose moment about its own centre would have to be negative: torque needs it, no body has it.
#[test]
fn what_no_rigid_body_has_is_not_established() {
    let arm = |change: f64| {
        let mut description = two_link::arm(2.0).expect("an arm").description().clone();
        let inertia = description.links[1].inertia.as_mut();
        let tensor = &mut inertia.expect("a mass").tensor;
        for (i, moment) in [0.3, 0.3, 0.4 + change].into_iter().enumerate() {
            tensor[i][i] = moment;
        }
        description.allow_unphysical = true;
        Robot::new(description, &Default::default())
            .expect("an arm")
            .0
    };
    let families = [Family::Tensor, Family::Viscous];
    let [less, none] = [-0.1, -0.5].map(|change| {
        let found = fitted(
            &arm(0.0),
            &logs(&arm(change), 8),
            &settings(&[HIDDEN], &families),
        );
        of(&found, "upper.tensor").clone()
    });
    assert_eq!(less.status, Status::Established, "{less:?}");
    assert!(none.pip > Some(0.99));
    assert_eq!(none.status, Status::Tentative);
    assert!(matches!(none.reason, StatusReason::NoRigidBody { chance } if chance < 0.01));
}
