//! What a program that uses the library writes: recordings from arrays, a calibration put together, its effects, torque of arrays.

use crate::two_link;
use std::ops::ControlFlow;
use std::sync::Mutex;
use twincal::evaluator::Evaluator;
use twincal::prelude::*;
use twincal::random::Random;
use twincal::rows::{RowBlock, RowSignal, visit_rows};
use twincal::twin::TorqueSignal;

struct Study {
    robot: Robot,
    training: Recording,
    heldout: Recording,
    settings: Settings,
}

fn study() -> Study {
    let robot = two_link::arm(2.0).expect("an arm");
    let real = two_link::arm(2.6).expect("an arm");
    let mut noise = Random::new(1, 0);
    let mut log = |name: &str, phase: f64| two_link::log(name, phase, &real, &mut noise);
    let mut settings = Settings::default();
    settings.library.terms = vec!["sin(q1 - q2)".into()];
    settings.library.families = vec![Family::Payload, Family::Viscous, Family::MotorInertia];
    settings.signal.cutoff_hz = Auto::Value(0.0);
    Study {
        training: log("training", 0.3),
        heldout: log("held-out", 1.9),
        robot,
        settings,
    }
}

impl Study {
    fn fit(&self) -> Calibration {
        let fit = Calibrate::new(&self.robot).logs([&self.training]);
        let fit = fit.heldout([&self.heldout]).settings(self.settings.clone());
        fit.run().expect("a calibration")
    }
}

/// The same recording as one of arrays.
fn from_arrays(log: &Recording) -> Recording {
    let mut own = Recording::new(log.name.clone(), log.time.clone());
    for joint in &log.joints {
        let tau = joint.tau.clone().expect("torque");
        own = own.joint(joint.q.clone(), tau).expect("a joint");
        own = own
            .velocity(joint.qd.clone().expect("velocity"))
            .expect("a channel");
        own = own
            .acceleration(joint.qdd.clone().expect("acceleration"))
            .expect("a channel");
    }
    own
}

#[test]
fn a_calibration_put_together_is_the_one_of_the_function() {
    let study = study();
    assert_eq!(from_arrays(&study.training), study.training);
    let whole = twincal::calibrate::calibrate(
        &study.robot,
        std::slice::from_ref(&study.training),
        std::slice::from_ref(&study.heldout),
        &study.settings,
        &|_| {},
    );
    // Not-a-number stands in both for what is not known.
    let text = |fit: &Calibration| format!("{fit:?}");
    assert_eq!(text(&study.fit()), text(&whole.expect("a calibration")));
}

#[test]
fn effects_come_by_status_and_probability_and_print_as_a_line() {
    let fit = study().fit();
    let effects: Vec<Effect<'_>> = fit.effects().collect();
    let names: Vec<&str> = effects.iter().map(Effect::name).collect();
    assert!(
        names.contains(&"payload") && names.contains(&"sin(q1 - q2)"),
        "{names:?}"
    );
    for pair in effects.windows(2) {
        let [a, b] = [&pair[0], &pair[1]];
        let rank = |effect: &Effect<'_>| match effect.status() {
            Status::Established => 0,
            Status::Equivalent => 1,
            _ => 2,
        };
        assert!(rank(a) < rank(b) || rank(a) == rank(b) && a.pip() >= b.pip());
    }
    let payload = effects
        .iter()
        .find(|effect| effect.name() == "payload")
        .expect("it");
    let line = payload.to_string();
    assert!(
        line.starts_with("established   PIP 1.000  payload"),
        "{line}"
    );
    assert!(payload.parameter("mass").is_some() && payload.parameter("stiffness").is_none());
}

/// Truth: what the twin says of the rows of a log, and the program that is exported.
#[test]
fn torque_of_arrays_is_that_of_a_log_and_of_the_program() {
    let study = study();
    let fit = study.fit();
    let (twin, log) = (&fit.twin, &study.heldout);
    let [q, qd, qdd] = states(log);
    let torque = twin.torque(&q, &qd, &qdd).expect("torque");
    compare_rows(twin, log, &torque);
    let program = Evaluator::new(twin, None).expect("a program");
    for row in (0..log.time.len()).step_by(97) {
        let own = 2 * row..2 * row + 2;
        let (mean, _) = program.evaluate(&q[own.clone()], &qd[own.clone()], &qdd[own.clone()]);
        for (found, mean) in torque.mean[own].iter().zip(&mean) {
            assert!((found - mean).abs() < 1e-9, "{found} {mean}");
        }
    }
    // One state by itself, and none.
    let one = twin.torque(&q[..2], &qd[..2], &qdd[..2]).expect("torque");
    assert_eq!(one.low, torque.low[..2]);
    assert!(twin.torque(&[], &[], &[]).expect("torque").mean.is_empty());
    let unknown = twin.torque(&[0.1, f64::NAN], &[0.0; 2], &[0.0; 2]);
    let said = unknown.expect_err("not a number").to_string();
    assert!(
        said.starts_with("setting `q`: NaN for joint 2 of state 0"),
        "{said}"
    );
    for wrong in [&q[..3], &q[..4]] {
        let error = twin
            .torque(&q[..2], wrong, &qdd[..2])
            .expect_err("other lengths");
        assert!(error.to_string().starts_with("setting `qd`"), "{error}");
    }
}

/// Positions, velocities and accelerations of a log of two joints, `2 * row + joint`.
fn states(log: &Recording) -> [Vec<f64>; 3] {
    let channel = |pick: fn(&twincal::signal::Channels) -> &[f64]| -> Vec<f64> {
        (0..log.time.len())
            .flat_map(|row| [0, 1].map(|joint| pick(&log.joints[joint])[row]))
            .collect()
    };
    [
        channel(|own| &own.q),
        channel(|own| own.qd.as_deref().expect("velocity")),
        channel(|own| own.qdd.as_deref().expect("acceleration")),
    ]
}

/// Torque of the [`states`] of a log is the prediction of its rows.
fn compare_rows(twin: &Twin, log: &Recording, torque: &Torque) {
    let library = twin.library().expect("a library");
    let predictor = twin.predictor(&library).expect("a predictor");
    let (trajectory, _) = twin.align(log).expect("a trajectory");
    let mut rows = 0;
    let mut compare = |block: &RowBlock<'_>| {
        let joints = predictor.block(block, TorqueSignal::Raw);
        for (joint, own) in joints.iter().enumerate() {
            for (i, &row) in block.input_rows.iter().enumerate() {
                let at = 2 * row + joint;
                // Where a joint stands still stiction widens the interval of a log; a state by itself does not stand still.
                if block.joints[joint].standstill[i] {
                    continue;
                }
                let found = [torque.mean[at], torque.low[at], torque.high[at]];
                assert_eq!(found, [own.calibrated[i], own.low[i], own.high[i]]);
                assert_eq!(torque.outside[at], own.extrapolating[i]);
                rows += 1;
            }
        }
        Ok(())
    };
    let raw = RowSignal::Raw;
    visit_rows(
        &twin.robot,
        &library,
        &twin.pipeline,
        &trajectory,
        raw,
        &mut compare,
    )
    .expect("rows");
    assert!(rows > 3000, "{rows}");
}

/// Truth: the program that is exported, which carries what was found as well.
#[test]
fn an_unknown_payload_that_was_found_is_carried() {
    let study = study();
    let loaded = study.training.clone().carrying(Payload::Unknown);
    let empty = two_link::log("empty", 0.8, &study.robot, &mut Random::new(2, 0));
    let fit = Calibrate::new(&study.robot).logs([loaded, empty]);
    let fit = fit
        .settings(study.settings.clone())
        .run()
        .expect("a calibration");
    assert!(fit.twin.payload_where_unknown);
    let state = [[0.2, 0.3], [0.5, -0.2], [0.1, 0.4]];
    let torque = fit
        .twin
        .torque(&state[0], &state[1], &state[2])
        .expect("torque");
    let program = Evaluator::new(&fit.twin, None).expect("a program");
    let (mean, _) = program.evaluate(&state[0], &state[1], &state[2]);
    for (found, mean) in torque.mean.iter().zip(&mean) {
        assert!((found - mean).abs() < 1e-9, "{found} {mean}");
    }
}

#[test]
fn whoever_watches_sees_every_stage_and_can_end_it() {
    let study = study();
    let fit = || Calibrate::new(&study.robot).logs([&study.training, &study.heldout]);
    let seen = Mutex::new(Vec::new());
    let watch = |stage: Stage| {
        seen.lock().expect("no panic").push(stage);
        ControlFlow::Continue(())
    };
    let whole = fit().settings(study.settings.clone()).progress(watch).run();
    assert!(whole.is_ok());
    let seen = seen.into_inner().expect("no panic");
    let kind = |stage: &Stage| std::mem::discriminant(stage);
    for stage in [
        Stage::Rows,
        Stage::Inference,
        Stage::Validation(0, 2),
        Stage::Sensitivity,
    ] {
        assert!(seen.iter().any(|own| kind(own) == kind(&stage)), "{seen:?}");
    }
    for at in [
        Stage::Rows,
        Stage::Inference,
        Stage::Validation(0, 0),
        Stage::Sensitivity,
    ] {
        let watch = |stage: Stage| match kind(&stage) == kind(&at) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        let stopped = fit().settings(study.settings.clone()).progress(watch).run();
        assert_eq!(stopped.expect_err("stopped").error, Error::Cancelled);
    }
}
