//! Friction that grows less than the speed is told by that name, where it is and nowhere else.

use crate::common;
use crate::two_link;
use twincal::calibrate::{Calibration, CalibrationSettings, calibrate};
use twincal::random::Random;
use twincal::robot::{Robot, Workspace, inverse_dynamics};
use twincal::signal::Recording;
use twincal::term::Family;
use twincal::write_back::{Holds, Writer};

/// Coulomb (N·m), viscous (N·m·s/rad), quadratic (N·m·s²/rad²) friction of shoulder and elbow.
const FRICTION: [[f64; 3]; 2] = [[1.0, 0.8, -0.15], [0.6, 0.5, 0.0]];
const NOISE: f64 = 0.05;

/// 40 s at 200 Hz, up to 3 rad/s.
fn log(seed: u64) -> Recording {
    log_of(&two_link::arm(2.0).expect("an arm"), FRICTION, seed)
}

/// The same of an arm with other friction.
fn log_of(arm: &Robot, friction: [[f64; 3]; 2], seed: u64) -> Recording {
    let (mut noise, mut workspace, mut tau) = (Random::new(seed, 0), Workspace::new(arm), [0.0; 2]);
    let mut channels = [[(); 4]; 2].map(|joint| joint.map(|()| Vec::new()));
    let time: Vec<f64> = (0..8000).map(|i| 0.005 * f64::from(i)).collect();
    for t in &time {
        let waves = [[1.3, 3.1, 0.2], [1.7, 2.6, 1.1]];
        let sum = |of: &dyn Fn(f64, f64) -> f64| {
            waves.map(|[a, b, phase]| of(a, a * t + phase) + 0.6 * of(b, b * t))
        };
        let q = sum(&|_, x: f64| x.sin());
        let qd = sum(&|w, x: f64| w * x.cos());
        let qdd = sum(&|w, x: f64| -w * w * x.sin());
        inverse_dynamics(arm, &mut workspace, &q, &qd, &qdd, &mut tau);
        for (j, joint) in channels.iter_mut().enumerate() {
            let ([coulomb, viscous, quadratic], v) = (friction[j], qd[j]);
            let friction = coulomb * (v / 0.02).tanh() + viscous * v + quadratic * v * v.abs();
            let torque = tau[j] + friction + NOISE * noise.normal();
            for (all, value) in joint.iter_mut().zip([q[j], v, qdd[j], torque]) {
                all.push(value);
            }
        }
    }
    common::recording(time, channels)
}

fn fitted(change: impl Fn(&mut CalibrationSettings)) -> Calibration {
    let mut settings = CalibrationSettings::default();
    change(&mut settings);
    let arm = two_link::arm(2.0).expect("an arm");
    calibrate(&arm, &[log(11)], &[], &settings, &|_| {}).expect("a calibration")
}

fn pip(result: &Calibration, name: &str) -> f64 {
    let component = result.components.iter().find(|c| c.name == name);
    component.and_then(|c| c.pip).unwrap_or(f64::NAN)
}

/// All default candidates compete. Four standard errors: one false alarm in 16 000.
#[test]
fn friction_that_flattens_is_found_where_it_is() {
    let result = fitted(|_| {});
    assert!(pip(&result, "shoulder.quadratic_friction") > 0.99);
    assert!(pip(&result, "elbow.quadratic_friction") < 0.5);
    // What it is a change of is in with it.
    assert!(pip(&result, "shoulder.viscous") > 0.99);
    let mut terms = result.terms.iter();
    let found = terms.find(|term| term.term.name == "shoulder.quadratic_friction");
    let term = found.expect("a term");
    assert_eq!(term.term.unit, "N·m·s²/rad²");
    let (mean, sd) = (term.mean.expect("a mean"), term.sd.expect("a spread"));
    let off = mean - FRICTION[0][2];
    assert!(off.abs() < 4.0 * sd && sd < 0.02, "{mean} ± {sd}");
    assert!(
        term.words.contains("quadratic friction on shoulder"),
        "{}",
        term.words
    );
    let mut all = result.components.iter();
    let said = all.find(|c| c.name == "shoulder.quadratic_friction");
    let words = &said.expect("a component").words;
    assert!(
        words.ends_with("(negative: friction grows less than the speed)"),
        "{words}"
    );
}

/// What viscous and Coulomb friction alone leave of friction that bends. Truth: least squares of v|v| on v and tanh(v/0.02) over the first 70 % of
/// the samples, its rms over the last 30 %, and the noise that the twin has left. Both halves are odd in v: no offset. 10 % for the low-passed steps.
#[test]
fn friction_alone_leaves_what_bends() {
    let result = fitted(|_| {});
    let qd = log(11).joints[0].qd.clone().expect("speeds");
    let (training, tested) = qd.split_at(7 * qd.len() / 10);
    let dry = |v: f64| (v / 0.02).tanh();
    let sum = |of: &dyn Fn(f64) -> f64| training.iter().map(|v| of(*v)).sum::<f64>();
    let bent = |v: f64| v * v.abs();
    let (vv, vs, ss) = (
        sum(&|v| v * v),
        sum(&|v| v * dry(v)),
        sum(&|v| dry(v).powi(2)),
    );
    let (vq, sq) = (sum(&|v| v * bent(v)), sum(&|v| dry(v) * bent(v)));
    let det = vv * ss - vs * vs;
    let (viscous, coulomb) = ((vq * ss - sq * vs) / det, (sq * vv - vq * vs) / det);
    let left = tested
        .iter()
        .map(|v| FRICTION[0][2] * (bent(*v) - viscous * v - coulomb * dry(*v)));
    let square = left.map(|x| x * x).sum::<f64>() / tested.len() as f64;
    let joints = &result.validation.moving.joints;
    let [shoulder, elbow] = [&joints[0], &joints[1]].map(|joint| {
        let alone = joint.rmse_friction.expect("friction is a candidate");
        (alone, joint.rmse_calibrated)
    });
    let truth = (square + shoulder.1.powi(2)).sqrt();
    assert!(truth > 1.5 * shoulder.1, "{truth} {shoulder:?}");
    assert!(
        (shoulder.0 / truth - 1.0).abs() < 0.1,
        "{truth} {shoulder:?}"
    );
    assert!((elbow.0 / elbow.1 - 1.0).abs() < 0.05, "{elbow:?}");
    let without = fitted(|settings| settings.library.families = vec![Family::MotorInertia]);
    assert_eq!(without.validation.moving.joints[0].rmse_friction, None);
}

/// A file holds the viscous and dry friction nearest to all friction of the joint. Truth: least squares of v|v| on v and tanh(v/0.02)
/// over speeds spread evenly between the least and the largest of the log, by Cramer's rule.
#[test]
fn what_a_file_can_say_of_it_goes_there_and_the_rest_stays_beside() {
    let result = fitted(|_| {});
    let change = Writer::new(&result, Holds::URDF).expect("a writer");
    let change = change.mean().expect("a change");
    let qd = log(11).joints[0].qd.clone().expect("speeds");
    let (least, most) = qd
        .iter()
        .fold((0.0_f64, 0.0_f64), |(a, b), v| (a.min(*v), b.max(*v)));
    let [mut vv, mut vs, mut ss, mut vq, mut sq] = [0.0; 5];
    for i in 0..100_000 {
        let v = least + (most - least) * (f64::from(i) + 0.5) / 1e5;
        let (s, q) = ((v / 0.02).tanh(), v * v.abs());
        vv += v * v;
        vs += v * s;
        ss += s * s;
        vq += v * q;
        sq += s * q;
    }
    let det = vv * ss - vs * vs;
    let (viscous, dry) = ((vq * ss - sq * vs) / det, (sq * vv - vq * vs) / det);
    let mean = |name: &str| {
        let mut columns = result.terms.iter();
        let term = columns.find(|term| term.term.name == name);
        term.and_then(|term| term.mean).expect("a mean")
    };
    let quadratic = mean("shoulder.quadratic_friction");
    let mut joints = change.joints.iter();
    let joint = joints.find(|j| j.joint == "shoulder").expect("a change");
    let of_damping = joint.damping.expect("viscous") - mean("shoulder.viscous");
    let of_friction = joint.friction.expect("dry") - mean("shoulder.coulomb");
    // The states of the comparison are few; they share the speeds evenly to a few percent.
    assert!(
        (of_damping / (viscous * quadratic) - 1.0).abs() < 0.1,
        "{of_damping}"
    );
    assert!(
        (of_friction / (dry * quadratic) - 1.0).abs() < 0.15,
        "{of_friction}"
    );
    // With what stays beside, the sum is the twin.
    let mut residual = change.residual.iter();
    let rest = residual.find(|r| r.component == "shoulder.quadratic_friction");
    let rest = rest.expect("a residual");
    let beside = |name: &str| {
        let own = rest
            .coefficients
            .iter()
            .filter(|(column, _)| column == name);
        own.map(|(_, value)| value).sum::<f64>()
    };
    assert!((beside("shoulder.quadratic_friction") - quadratic).abs() < 1e-15);
    assert!((beside("shoulder.viscous") + of_damping).abs() < 1e-12);
    assert!((beside("shoulder.coulomb") + of_friction).abs() < 1e-12);
    let said = format!(
        "added to the file as nearest to it: shoulder.viscous {of_damping:+.3}, shoulder.coulomb {of_friction:+.3}"
    );
    assert!(rest.reason.ends_with(&said), "{}", rest.reason);
}

/// Friction that bends so much that the viscous friction of the best fit is negative: a file has none of it, and the dry friction that is
/// nearest then. 0.3 N·m·s/rad of the viscous friction are the model's own. Truth: least squares of what is left on tanh(v/0.02), over
/// speeds spread evenly between the least and the largest of the log.
#[test]
fn a_file_without_negative_friction_and_its_residual_are_the_twin() {
    const DAMPING: f64 = 0.3;
    let arm = two_link::arm(2.0).expect("an arm");
    let mut description = arm.description().clone();
    description.joints[0].damping = DAMPING;
    let (arm, _) = Robot::new(description, &Default::default()).expect("an arm");
    let log = log_of(&arm, [[8.0, 0.7 - DAMPING, -0.8], [0.6, 0.5, 0.0]], 12);
    let mut settings = CalibrationSettings::default();
    settings.library.families = vec![
        Family::Viscous,
        Family::Coulomb,
        Family::QuadraticFriction,
        Family::Offset,
    ];
    let result = calibrate(&arm, std::slice::from_ref(&log), &[], &settings, &|_| {});
    let result = result.expect("a calibration");
    let mean = |name: &str| {
        let mut columns = result.terms.iter();
        let term = columns.find(|term| term.term.name == name);
        term.and_then(|term| term.mean).expect("a mean")
    };
    let [dry, viscous, quadratic] =
        ["coulomb", "viscous", "quadratic_friction"].map(|what| mean(&format!("shoulder.{what}")));
    assert!((quadratic + 0.8).abs() < 0.1, "{quadratic}");
    let [_, _, least, most, ..] = result.twin.hull[0];
    let [mut along, mut size] = [0.0; 2];
    for i in 0..100_000 {
        let v = least + (most - least) * (f64::from(i) + 0.5) / 1e5;
        let shape = (v / 0.02).tanh();
        along += shape * (dry * shape + (viscous + DAMPING) * v + quadratic * v * v.abs());
        size += shape * shape;
    }
    let change = Writer::new(&result, Holds::URDF).expect("a writer");
    let change = change.mean().expect("a change");
    let mut joints = change.joints.iter();
    let joint = joints.find(|j| j.joint == "shoulder").expect("a change");
    assert_eq!(joint.damping, Some(-DAMPING));
    // The states of the comparison are few; they share the speeds evenly to a few percent.
    let friction = joint.friction.expect("dry");
    assert!(
        (friction / (along / size) - 1.0).abs() < 0.1,
        "{friction}, not {}",
        along / size
    );
    // Nothing is lost: file and residual are the twin.
    assert!(change.lost[0] < 1e-9, "{:?}", change.lost);
    let mut residual = change.residual.iter();
    let rest = residual.find(|r| r.component == "shoulder.quadratic_friction");
    let rest = rest.expect("a residual");
    for (name, file, twin) in [
        ("shoulder.viscous", -DAMPING, viscous),
        ("shoulder.coulomb", friction, dry),
    ] {
        let mut beside = rest.coefficients.iter();
        let beside = beside.find(|(column, _)| column == name);
        let (_, beside) = beside.expect("a coefficient");
        assert!((file + beside - twin).abs() < 1e-12, "{name}: {beside}");
    }
}
