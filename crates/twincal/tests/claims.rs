//! Claims of `assess`: each is made where its numbers say so, and carries them.

use crate::two_link;
use std::sync::OnceLock;
use twincal::assess::{Answer, Assessment, Claim, RequestCode, Subject, assess, of_gates};
use twincal::prelude::*;
use twincal::random::Random;
use twincal::signal::{Auto, Recording};
use twincal::validate::Split;
use twincal::{Code, Finding, Severity};

/// A two-link arm whose payload was found, judged by a held-out log; without findings.
fn twin() -> Calibration {
    static TWIN: OnceLock<Calibration> = OnceLock::new();
    let fit = || -> twincal::Result<Calibration> {
        let mut noise = Random::new(1, 0);
        let (robot, real) = (two_link::arm(2.0)?, two_link::arm(2.6)?);
        let mut run = |name: &str, phase: f64| two_link::log(name, phase, &real, &mut noise);
        let (log, other) = (run("run1", 0.3), run("run2", 1.9));
        let mut settings = Settings::default();
        settings.library.families = vec![Family::Payload, Family::Viscous];
        let calibrate = Calibrate::new(&robot).logs([log]).heldout([other]);
        Ok(calibrate.settings(settings).run()?)
    };
    let own = TWIN.get_or_init(|| {
        let mut own = fit().expect("the example's fit");
        own.findings.clear();
        own
    });
    own.clone()
}

fn assessed(change: impl Fn(&mut Calibration)) -> Assessment {
    let mut own = twin();
    change(&mut own);
    assess(&own)
}

fn one(assessment: &Assessment, code: Code) -> &Claim {
    let mut claims = assessment.claims(code);
    let claim = claims
        .next()
        .unwrap_or_else(|| panic!("{code} is not claimed"));
    assert_eq!(claims.next(), None, "{code} is claimed twice");
    claim
}

fn is_claimed(assessment: &Assessment, code: Code) -> bool {
    assessment.claims(code).next().is_some()
}

#[test]
fn the_error_is_that_of_moving_held_out_rows() {
    let own = twin();
    let claim = assess(&own);
    let claim = one(&claim, Code::TorqueError);
    let scores = &own.validation.moving;
    assert_eq!(claim.subject, Subject::Run);
    assert_eq!(claim.number("rms_nominal"), scores.rmse_nominal);
    assert_eq!(claim.number("rms_calibrated"), scores.rmse_calibrated);
}

#[test]
fn without_a_test_nothing_else_is_said_of_torque() {
    let untested = assessed(|own| {
        for scores in [&mut own.validation.filtered, &mut own.validation.moving] {
            scores.joints.iter_mut().for_each(|joint| joint.rows = 0);
        }
    });
    assert_eq!(
        (untested.answer, untested.reason),
        (Answer::NotYet, Code::NotTested)
    );
    assert!(!is_claimed(&untested, Code::TorqueError));
}

#[test]
fn a_joint_that_got_worse_is_named_with_its_errors() {
    let worse = assessed(|own| own.validation.moving.joints[1].rmse_calibrated = 9.0);
    let claim = one(&worse, Code::JointTorqueWorse);
    assert_eq!(claim.subject, Subject::Joint("elbow".into()));
    assert_eq!(claim.number("rms_calibrated"), 9.0);
    assert!(worse.answer > Answer::Yes);
}

/// √((0.09 + 0.16)/2) of two joints with as many rows.
#[test]
fn friction_alone_is_pooled_over_rows_and_its_worse_joints_are_named() {
    let own = assessed(|own| {
        let scores = &mut own.validation.moving.joints;
        for (joint, left) in scores.iter_mut().zip([0.3, 0.4]) {
            (joint.rows, joint.rmse_friction) = (100, Some(left));
            joint.rmse_nominal = 0.35;
        }
    });
    let left = one(&own, Code::FrictionAlone).number("rms_friction");
    assert!((left - 0.125f64.sqrt()).abs() < 1e-12);
    let worse = one(&own, Code::JointFrictionAloneWorse);
    assert_eq!(worse.subject, Subject::Joint("elbow".into()));
    assert_eq!(one(&own, Code::FrictionAlone).number("joints_better"), 1.0);
}

#[test]
fn what_intervals_of_a_joint_hold_is_one_claim() {
    let of = |rows: u64, share: f64| {
        let own = assessed(|own| {
            own.noise
                .iter_mut()
                .for_each(|n| n.autocorrelation_time = 1.0);
            let joint = &mut own.validation.moving.joints[1];
            (joint.rows, joint.coverage95) = (rows, share);
            own.validation.moving.joints[0].coverage95 = 0.95;
        });
        let codes = [
            Code::JointIntervalsNarrow,
            Code::JointIntervalsWide,
            Code::JointCoverageOff,
            Code::JointCoverageByChance,
        ];
        codes.map(|code| is_claimed(&own, code))
    };
    // Two standard errors of 10 000 rows: 2 √(0.95 · 0.05/10⁴) = 0.44 %; of 20 rows 9.7 %.
    assert_eq!(of(10_000, 0.80), [true, false, false, false]);
    assert_eq!(of(10_000, 0.995), [false, true, false, false]);
    assert_eq!(of(10_000, 0.91), [false, false, true, false]);
    assert_eq!(of(20, 0.88), [false, false, false, true]);
    assert_eq!(of(10_000, 0.95), [false; 4]);
}

/// Mean squares: 1 before and 0.25 after while it moves; at rest 1 before and 9 after.
#[test]
fn torque_at_rest_that_got_worse_limits_a_yes() {
    let own = assessed(|own| {
        let validation = &mut own.validation;
        for (all, moving) in
            (validation.filtered.joints.iter_mut()).zip(&mut validation.moving.joints)
        {
            (moving.rows, moving.rmse_nominal, moving.rmse_calibrated) = (500, 1.0, 0.5);
            (all.rows, all.rmse_nominal) = (1000, 1.0);
            all.rmse_calibrated = (0.5f64 * (0.25 + 9.0)).sqrt();
        }
        (
            validation.moving.rmse_nominal,
            validation.moving.rmse_calibrated,
        ) = (1.0, 0.5);
        (
            validation.filtered.rmse_nominal,
            validation.filtered.rmse_calibrated,
        ) = (1.0, 2.2);
    });
    let claim = one(&own, Code::WorseAtRest);
    assert!((claim.number("rms_nominal") - 1.0).abs() < 1e-9);
    assert!((claim.number("rms_calibrated") - 3.0).abs() < 1e-9);
    assert_eq!(own.claims(Code::JointWorseAtRest).count(), 2);
    assert_eq!(own.answer, Answer::YesWithinLimits);
}

#[test]
fn a_second_motion_is_asked_for_where_only_later_parts_were_tried() {
    let asked = |split: Split| {
        let own = assessed(|own| own.validation.split = split.clone());
        own.next
            .iter()
            .any(|own| own.code == RequestCode::HeldOutLog)
    };
    assert!(asked(Split::LastThirty));
    assert!(!asked(Split::HeldoutLogs));
}

#[test]
fn of_a_log_that_is_no_measurement_nothing_is_asked() {
    let own = assessed(|own| {
        own.validation.split = Split::LastThirty;
        let finding = Finding::new(Severity::Degraded, Code::SignFlip, "elbow", "", 0);
        own.findings.push(finding);
    });
    assert_eq!((own.answer, own.next.len()), (Answer::NotYet, 0));
}

#[test]
fn a_finding_on_a_new_log_is_a_claim_on_that_log() {
    let twin = twin();
    let subjects = ["", "new.csv", "elbow"].map(|subject| {
        let found = [Finding::new(Severity::Note, Code::SignFlip, subject, "", 0)];
        of_gates(Vec::new(), &found, (&twin, &["new.csv"])).claims[0]
            .subject
            .clone()
    });
    let log = Subject::Log("new.csv".into());
    assert_eq!(
        subjects,
        [Subject::Run, log, Subject::Joint("elbow".into())]
    );
}

#[test]
fn gates_decide_and_a_mistake_where_they_hold() {
    let above = || {
        let subject = Subject::Joint("elbow".into());
        Claim::of_gate(Code::ErrorAboveGate, subject, 2.0, [f64::NAN, 1.0])
    };
    let flipped = [Finding::new(
        Severity::Degraded,
        Code::SignFlip,
        "elbow",
        "",
        0,
    )];
    let twin = twin();
    let of = |gates: Vec<Claim>, findings: &[Finding]| {
        let own = of_gates(gates, findings, (&twin, &["new.csv"]));
        (own.answer, own.reason)
    };
    assert_eq!(of(Vec::new(), &flipped), (Answer::NotYet, Code::SignFlip));
    // Torque that is not what it is said to be decides where no other log has gates.
    for code in [
        Code::TorqueConstant,
        Code::TorqueCopied,
        Code::SignFlip,
        Code::JointOrder,
        Code::LogTorqueLag,
    ] {
        let wrong = [Finding::new(Severity::Degraded, code, "elbow", "", 0)];
        assert_eq!(of(Vec::new(), &wrong), (Answer::NotYet, code));
        let failed = (Answer::No, Code::ErrorAboveGate);
        assert_eq!(of(vec![above()], &wrong), failed);
    }
    // A motion that is wrong for a while does not excuse a gate that fails; without one it decides.
    let stuck = [Finding::new(
        Severity::Warning,
        Code::EncoderStuck,
        "new.csv",
        "",
        0,
    )];
    let failed = (Answer::No, Code::ErrorAboveGate);
    assert_eq!(of(vec![above()], &stuck), failed);
    assert_eq!(of(Vec::new(), &stuck), (Answer::NotYet, Code::EncoderStuck));
    // A log that the twin knows decides nothing.
    for code in [Code::LogWasFitted, Code::LogWasHeldout] {
        let known = [Finding::new(Severity::Note, code, "old.csv", "", 0)];
        assert_eq!(of(vec![above()], &known), failed);
        assert_eq!(of(Vec::new(), &known), (Answer::Yes, Code::Passed));
    }
    assert_eq!(of(Vec::new(), &[]), (Answer::Yes, Code::Passed));
    let short = vec![Claim::of_run(Code::TooShortToCheck)];
    assert_eq!(of(short, &[]), (Answer::NotYet, Code::TooShortToCheck));
}

#[test]
fn a_claim_has_the_numbers_of_its_finding() {
    let found = Finding::new(Severity::Warning, Code::EncoderStuck, "elbow", "", 3)
        .with([("from", 12.3), ("to", 12.4)])
        .with(Some(("moved", 0.04)));
    let json = serde_json::to_string(&found).unwrap();
    assert_eq!(serde_json::from_str::<Finding>(&json).unwrap(), found);
    let own = of_gates(Vec::new(), &[found], (&twin(), &[]));
    let numbers: Vec<(&str, f64)> = own.claims[0].evidence.iter().collect();
    let wanted = [
        ("count", 3.0),
        ("from", 12.3),
        ("moved", 0.04),
        ("to", 12.4),
    ];
    assert_eq!(numbers, wanted);
    let bare = Finding::new(Severity::Note, Code::Forced, "", "", 0);
    let json = serde_json::to_string(&bare).unwrap();
    assert!(!json.contains("evidence"), "{json}");
}

/// Samples of the held-out log are 10 ms apart: what stands beside a row is the sample of that time.
#[test]
fn traces_have_the_torque_as_it_was_logged() {
    let own = twin();
    let mut noise = Random::new(1, 0);
    let real = two_link::arm(2.6).expect("an arm");
    let mut run = |name: &str, phase: f64| two_link::log(name, phase, &real, &mut noise);
    let (_, log) = (run("run1", 0.3), run("run2", 1.9));
    assert!(own.twin.pipeline.cutoff_hz > 0.0);
    for (joint, trace) in own.validation.traces.iter().enumerate() {
        let torque = log.joints[joint].tau.as_ref().expect("torque");
        assert_eq!(trace.logged.len(), trace.time.len());
        for (time, logged) in trace.time.iter().zip(&trace.logged) {
            let own = logged.expect("a whole log");
            // The nearest sample, or of a row in the middle one of two.
            let at = (time / 0.01).round() as usize;
            let near = [at.saturating_sub(1), at, (at + 1).min(torque.len() - 1)];
            assert!(near.iter().any(|k| torque[*k] == own), "{time} {own}");
            let nearest = near.map(|k| (time - 0.01 * k as f64).abs());
            let least = nearest.into_iter().fold(f64::INFINITY, f64::min);
            let of = near.iter().zip(nearest).find(|(k, _)| torque[**k] == own);
            assert!(of.is_some_and(|(_, away)| away <= least + 1e-9), "{time}");
        }
    }
}

/// A held-out log that goes on getting faster where training ends: its rows beyond the range of training's position, velocity or
/// acceleration, widened by a twentieth, are counted joint by joint.
#[test]
fn rows_beyond_the_training_motion_are_counted() -> twincal::Result<()> {
    let robot = two_link::arm(2.0)?;
    let mut noise = Random::new(3, 0);
    let mut training = two_link::log("slow", 0.3, &robot, &mut noise);
    let long = two_link::log("faster", 0.7, &robot, &mut noise);
    training.time.truncate(1000);
    for joint in &mut training.joints {
        joint.q.truncate(1000);
        for column in [&mut joint.qd, &mut joint.qdd, &mut joint.tau] {
            column.as_mut().expect("a column").truncate(1000);
        }
    }
    let beyond = |joint: usize| {
        let columns = |log: &Recording| {
            let own = &log.joints[joint];
            let [qd, qdd] = [&own.qd, &own.qdd].map(|own| own.clone().expect("a column"));
            [own.q.clone(), qd, qdd]
        };
        let (trained, tested) = (columns(&training), columns(&long));
        let outside = |k: usize, value: f64| {
            let low = trained[k].iter().copied().fold(f64::INFINITY, f64::min);
            let high = trained[k].iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let margin = 0.05 * (high - low);
            value < low - margin || value > high + margin
        };
        let rows = 0..tested[0].len();
        rows.filter(|row| (0..3).any(|k| outside(k, tested[k][*row])))
            .count() as u64
    };
    let wanted = [beyond(0), beyond(1)];
    let mut settings = Settings::default();
    settings.library.families = vec![Family::Payload, Family::Viscous];
    settings.signal.cutoff_hz = Auto::Value(0.0); // every sample a row
    let calibrate = Calibrate::new(&robot).logs([training]).heldout([long]);
    let found = calibrate.settings(settings).run()?;
    assert!(wanted.iter().all(|rows| *rows > 200), "{wanted:?}");
    assert_eq!(found.validation.new_motion, wanted);
    Ok(())
}
