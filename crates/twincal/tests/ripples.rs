//! Gear ripple that nobody asked for, on the motions that robots are identified with: friction that no candidate has is none, a gear's is.

use crate::common;
use std::f64::consts::TAU;
use twincal::calibrate::{Calibration, CalibrationSettings, UnaskedRipple, calibrate};
use twincal::random::Random;
use twincal::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Robot, RobotDescription,
};
use twincal::signal::{Auto, Recording};

/// Seconds between samples.
const STEP: f64 = 0.005;
/// N of what is a gear's, per turn.
const TEETH: f64 = 60.0;

/// One joint about a vertical axis, 1 kg·m².
fn arm() -> Robot {
    let link = |name: &str, inertia| LinkDescription {
        name: name.into(),
        inertia,
    };
    let tensor = [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]];
    let rotor = Inertia {
        mass: 1.0,
        com: [0.0; 3],
        tensor,
    };
    let joint = JointDescription::new("turn", JointKind::Revolute, "base", "rotor");
    let description = RobotDescription {
        name: "one joint".into(),
        gravity: [0.0; 3],
        links: vec![link("base", None), link("rotor", Some(rotor))],
        joints: vec![joint],
        allow_unphysical: false,
    };
    let arm = Robot::new(description, &Default::default());
    arm.expect("an arm").0
}

/// Waves (rad/s, sin, cos) of a motion.
type Motion = Vec<[f64; 3]>;

fn sine(period: f64) -> Motion {
    vec![[TAU / period, 1.2, 0.0]]
}

/// Five harmonics of one period, or five frequencies that share none.
fn waves(base: [f64; 5], random: &mut Random) -> Motion {
    let wave = |(i, w): (usize, &f64)| {
        let size = 0.8 / (1.0 + i as f64);
        [*w, size * random.normal(), size * random.normal()]
    };
    base.iter().enumerate().map(wave).collect()
}

fn fourier(period: f64, random: &mut Random) -> Motion {
    waves([1.0, 2.0, 3.0, 4.0, 5.0].map(|k| k * TAU / period), random)
}

fn aperiodic(random: &mut Random) -> Motion {
    waves([0.31, 0.53, 0.87, 1.37, 2.09], random)
}

#[derive(Debug, Clone, Copy)]
enum Friction {
    /// 1 N·m against the motion, at once.
    Sign,
    /// 1 N·m, reached over about 0.02 rad: F' = σ q̇ (1 − F sgn q̇).
    Dahl,
    /// 0.3 atan(8 q̇) cos 3q.
    Uneven,
}

/// 120 s of a motion with friction, `ripple` N·m of a gear and noise of 0.02 N·m.
fn log(motion: &Motion, friction: Friction, ripple: f64, random: &mut Random) -> Recording {
    let (mut q, mut qd, mut qdd, mut tau) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut bristle = 0.0_f64;
    let time: Vec<f64> = (0..24_000).map(|i| STEP * f64::from(i)).collect();
    for t in &time {
        let [mut at, mut speed, mut gain] = [0.0; 3];
        for [w, a, b] in motion {
            let (sin, cos) = (w * t).sin_cos();
            at += a * sin + b * cos;
            speed += w * (a * cos - b * sin);
            gain -= w * w * (a * sin + b * cos);
        }
        bristle += 50.0 * speed * STEP * (1.0 - bristle * speed.signum());
        let friction = match friction {
            Friction::Sign => speed.signum(),
            Friction::Dahl => bristle.clamp(-1.0, 1.0),
            Friction::Uneven => 0.3 * (8.0 * speed).atan() * (3.0 * at).cos(),
        };
        let gear = ripple * (TEETH * at + 1.0).sin();
        q.push(at);
        qd.push(speed);
        qdd.push(gain);
        tau.push(0.1 * gain + friction + gear + 0.02 * random.normal());
    }
    common::recording(time, [[q, qd, qdd, tau]])
}

fn fitted(log: Recording, cutoff_hz: f64, unasked_ripple: UnaskedRipple) -> Calibration {
    let mut settings = CalibrationSettings {
        unasked_ripple,
        ..CalibrationSettings::default()
    };
    settings.library.generic = Some(false);
    settings.signal.cutoff_hz = Auto::Value(cutoff_hz);
    calibrate(&arm(), &[log], &[], &settings, &|_| {}).expect("a calibration")
}

/// Code and message of what is said of ripple.
fn said(result: &Calibration) -> Vec<(&str, &str)> {
    let all = result.findings.iter();
    let ripple = all.filter(|finding| finding.code.as_str().starts_with("ripple_"));
    ripple.map(|f| (f.code.as_str(), &*f.message)).collect()
}

/// 24 fits. Of noise alone one of them has a false ripple with a probability below 24 · 4000 · e⁻²⁵ < 1e-6; what friction leaves over at the
/// turns has no such number, the greatest gain of 45 such residuals was 9 nats of the 25.
#[test]
fn friction_that_no_candidate_has_is_no_ripple_of_repeated_motion() {
    for friction in [Friction::Sign, Friction::Dahl, Friction::Uneven] {
        let mut random = Random::new(11, 0);
        let motions = [
            sine(5.0),
            sine(20.0),
            fourier(5.0, &mut random),
            fourier(20.0, &mut random),
        ];
        for (number, motion) in motions.iter().enumerate() {
            let log = log(motion, friction, 0.0, &mut random);
            for cutoff_hz in [5.0, 20.0] {
                let result = fitted(log.clone(), cutoff_hz, UnaskedRipple::Candidate);
                let words = format!("{friction:?} on motion {number} below {cutoff_hz} Hz");
                assert_eq!(said(&result), [], "{words}");
            }
        }
    }
}

/// As high as a tenth of the friction. Where families were chosen it is told and not added; where ripple was ruled out, neither.
#[test]
fn the_ripple_of_a_gear_is_found_on_repeated_motion_and_on_any_other() {
    let mut random = Random::new(12, 0);
    let motions = [fourier(20.0, &mut random), aperiodic(&mut random)];
    for motion in &motions {
        let log = log(motion, Friction::Sign, 0.1, &mut random);
        let result = fitted(log.clone(), 20.0, UnaskedRipple::Candidate);
        let said_of_it = said(&result);
        assert!(
            matches!(said_of_it[..], [("ripple_added", _)]),
            "{said_of_it:?}"
        );
        let line = said_of_it[0].1.split("{ \"turn\" = ").nth(1);
        let periods = line.and_then(|line| line.split(' ').next());
        let periods: f64 = periods.unwrap_or("").parse().expect("a number");
        assert!((periods - TEETH).abs() < 0.1, "{}", said_of_it[0].1);
        let mut components = result.components.iter();
        let found = components.find(|component| component.name == "turn.ripple");
        assert!(found.is_some_and(|ripple| ripple.pip > Some(0.99)));

        let told = fitted(log.clone(), 20.0, UnaskedRipple::Told);
        assert!(matches!(said(&told)[..], [("ripple_seen", _)]));
        assert!(!told.components.iter().any(|c| c.name == "turn.ripple"));
        assert_eq!(said(&fitted(log, 20.0, UnaskedRipple::Ignored)), []);
    }
}
