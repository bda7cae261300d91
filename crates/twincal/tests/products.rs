//! Effects that multiply each other: gravity acts on a payload as well, which is not linear in both coefficients together. (Drive constants and
//! payloads: `payloads.rs`.)

use crate::two_link;
use twincal::Code;
use twincal::Severity;
use twincal::calibrate::{Calibration, CalibrationSettings, calibrate};
use twincal::evaluator::Evaluator;
use twincal::random::Random;
use twincal::robot::{Robot, Workspace, inverse_dynamics};
use twincal::rows::{RowBlock, RowSignal, visit_rows};
use twincal::signal::Auto;
use twincal::term::Family;
use twincal::twin::TorqueSignal;
use twincal::write_back::{Holds, Writer};

/// kg at the tip that the model lacks, m/s² along x that it does not know.
const LOAD: f64 = 0.6;
const LEAN: f64 = 0.5;

/// The arm with its load, in gravity that leans.
fn real(lean: f64) -> Robot {
    let arm = two_link::arm(2.0 + LOAD).expect("an arm");
    let mut description = arm.description().clone();
    description.gravity[0] += lean;
    Robot::new(description, &Default::default())
        .expect("an arm")
        .0
}

fn fitted(families: &[Family], relinearise: usize) -> Calibration {
    let real = real(if families.contains(&Family::Tilt) {
        LEAN
    } else {
        0.0
    });
    let mut noise = Random::new(7, 0);
    let mut log = |name: &str, phase: f64| two_link::log(name, phase, &real, &mut noise);
    let logs = [log("training", 0.3), log("held-out", 1.9)];
    let mut settings = CalibrationSettings::default();
    settings.library.terms = vec!["sin(q1 - q2)".into()];
    settings.library.families = families.to_vec();
    settings.signal.cutoff_hz = Auto::Value(0.0);
    settings.relinearise = relinearise;
    let nominal = two_link::arm(2.0).expect("an arm");
    calibrate(&nominal, &logs[..1], &logs[1..], &settings, &|_| {}).expect("a calibration")
}

/// Mean and sd of a parameter.
fn told(calibration: &Calibration, component: &str, parameter: &str) -> [f64; 2] {
    let mut components = calibration.components.iter();
    let own = components
        .find(|own| own.name == component)
        .expect("a component");
    let own = own.parameters.iter().find(|own| own.name == parameter);
    let own = own.expect("a parameter");
    [own.mean, own.sd]
}

/// Truth: the arm that was simulated. Chance of an error beyond 4.4 sd: 1e-5 each.
fn holds(calibration: &Calibration, component: &str, parameter: &str, truth: f64) {
    let [mean, sd] = told(calibration, component, parameter);
    let far = (mean - truth) / sd;
    assert!(
        far.abs() < 4.4,
        "{component} {parameter}: {mean} ± {sd}, not {truth}"
    );
    assert!(
        sd < 0.05 * truth.abs(),
        "{component} {parameter}: {mean} ± {sd}"
    );
}

/// How bad it is that columns were worked out anew.
fn severity(calibration: &Calibration) -> Option<Severity> {
    let mut findings = calibration.findings.iter();
    let own = findings.find(|finding| finding.code == Code::Relinearised);
    own.map(|finding| finding.severity)
}

#[test]
fn gravity_acts_on_a_payload_that_is_found() {
    let families = [Family::Payload, Family::Tilt];
    let calibration = fitted(&families, 3);
    holds(&calibration, "payload", "mass", LOAD);
    holds(&calibration, "base.tilt", "x", LEAN);
    assert!(!calibration.twin.library.linearised_at.is_empty());
    assert_eq!(severity(&calibration), Some(Severity::Note));
    // What this test is for: linear in all coefficients together it is off by many sd.
    let linear = fitted(&families, 0);
    assert_eq!(severity(&linear), None);
    let [mean, sd] = told(&linear, "base.tilt", "x");
    assert!((mean - LEAN).abs() > 10.0 * sd, "{mean} ± {sd}");
    for (joint, score) in calibration.validation.filtered.joints.iter().enumerate() {
        let error = score.rmse_calibrated;
        assert!((error - 0.1).abs() < 0.01, "joint {joint}: {error} N·m");
    }
}

/// The program of the twin computes what the twin predicts, with a gain and a zero beside payload and tilt.
#[test]
fn a_program_has_the_torque_of_products() {
    let families = [
        Family::Payload,
        Family::Tilt,
        Family::Gain,
        Family::EncoderZero,
    ];
    let mut calibration = fitted(&families, 3);
    // About effects that the fit need not have found, so that each of them counts.
    let about = [
        ("base.tilt.x", 0.4),
        ("payload.m", 0.5),
        ("shoulder.gain", 0.1),
        ("elbow.encoder_zero", 0.05),
    ];
    let about = about.map(|(name, value)| (name.to_owned(), value));
    calibration.twin.library.linearised_at = about.into();
    let twin = &calibration.twin;
    let library = twin.library().expect("a library");
    let predictor = twin.predictor(&library).expect("a predictor");
    let program = Evaluator::new(twin, None).expect("a program");
    let log = two_link::log("new", 0.8, &twin.robot, &mut Random::new(3, 0));
    let (trajectory, _) = twin.align(&log).expect("a trajectory");
    let mut rows = 0;
    let mut compare = |block: &RowBlock<'_>| {
        assert_eq!(block.joints[0].products.len(), block.len);
        let torque = predictor.block(block, TorqueSignal::Raw);
        for row in (0..block.len).step_by(37) {
            let at = |all: &[f64]| [all[row], all[block.len + row]];
            let (found, _) = program.evaluate(&at(block.q), &at(block.qd), &at(block.qdd));
            for (joint, found) in found.iter().enumerate() {
                let predicted = torque[joint].calibrated[row];
                assert!(
                    (found - predicted).abs() < 1e-9,
                    "joint {joint}: {found} {predicted}"
                );
                rows += 1;
            }
        }
        Ok(())
    };
    let (robot, pipeline) = (&twin.robot, &twin.pipeline);
    let raw = RowSignal::Raw;
    visit_rows(robot, &library, pipeline, &trajectory, raw, &mut compare).expect("rows");
    assert!(rows > 50, "{rows}");
}

/// Gravity of the written file acts on its payload. Truth: the arm that was simulated. (A point mass lies on the bound of what a body can be, so that
/// the file is not the found effects to the bit.)
#[test]
fn a_file_with_gravity_and_payload_is_the_arm() {
    let calibration = fitted(&[Family::Payload, Family::Tilt], 3);
    let writer = Writer::new(&calibration, Holds::MJCF).expect("a writer");
    let written = writer.mean().expect("a file");
    assert!(
        written.lost.iter().all(|lost| *lost < 0.02),
        "{:?}",
        written.lost
    );
    let file = written.robot(&calibration.twin.robot).expect("a robot");
    let real = real(LEAN);
    let (mut workspace, mut worst) = (Workspace::new(&real), 0.0_f64);
    for k in 0..50 {
        let at = |phase: f64| {
            [
                (phase + f64::from(k)).sin(),
                (2.0 * phase + 1.7 * f64::from(k)).cos(),
            ]
        };
        let mut torque = [[0.0; 2]; 2];
        for (robot, torque) in [&real, &file].into_iter().zip(&mut torque) {
            inverse_dynamics(robot, &mut workspace, &at(0.1), &at(0.5), &at(0.9), torque);
        }
        for joint in 0..2 {
            worst = worst.max((torque[0][joint] - torque[1][joint]).abs());
        }
    }
    // 2000 rows of 0.1 N·m tell it to 0.01; gravity's change on the payload is 0.6 kg × 0.5 m/s² × 1 m.
    assert!(worst < 0.05, "{worst}");
}

/// Inertias alone multiply nothing: the logs are gone through once.
#[test]
fn a_payload_alone_is_linear() {
    let calibration = fitted(&[Family::Payload, Family::Viscous], 3);
    assert!(calibration.twin.library.linearised_at.is_empty());
}
