//! v_s of Coulomb friction where nobody states one: as the log says, and the usual one where the log does not care.

use crate::common;
use crate::two_link;
use std::sync::Arc;
use twincal::Code;
use twincal::calibrate::{Calibration, CalibrationSettings, calibrate};
use twincal::random::Random;
use twincal::robot::{Workspace, inverse_dynamics};
use twincal::signal::{Auto, Log, LongLog, ReadChapter, Recording};
use twincal::term::Family;

/// v_s where nothing is said, rad/s.
const USUAL: f64 = 0.02;
/// Hz, and how fast.
const SLOW: (f64, f64) = (100.0, 1.0);

/// 60 s of motion at `rate` Hz, slow but for `hurry`, with friction of `size` N·m that turns round within `v_s`, and noise of 0.02 N·m.
fn log(v_s: f64, size: f64, (rate, hurry): (f64, f64), seed: u64) -> Recording {
    let arm = two_link::arm(2.0).expect("an arm");
    let (mut noise, mut workspace, mut tau) =
        (Random::new(seed, 0), Workspace::new(&arm), [0.0; 2]);
    let mut channels = [[(); 4]; 2].map(|joint| joint.map(|()| Vec::new()));
    let samples = (60.0 * rate) as u32;
    let time: Vec<f64> = (0..samples).map(|i| f64::from(i) / rate).collect();
    for t in &time {
        let waves =
            [[0.7, 1.9, 0.2], [0.9, 1.5, 1.1]].map(|[a, b, phase]| [hurry * a, hurry * b, phase]);
        let sum = |of: &dyn Fn(f64, f64) -> f64| {
            waves.map(|[a, b, phase]| of(a, a * t + phase) + 0.5 * of(b, b * t))
        };
        let q = sum(&|_, x: f64| 0.4 * x.sin());
        let qd = sum(&|w, x: f64| 0.4 * w * x.cos());
        let qdd = sum(&|w, x: f64| -0.4 * w * w * x.sin());
        inverse_dynamics(&arm, &mut workspace, &q, &qd, &qdd, &mut tau);
        for (j, joint) in channels.iter_mut().enumerate() {
            let friction = size * (qd[j] / v_s).tanh();
            let values = [
                q[j],
                qd[j],
                qdd[j],
                tau[j] + friction + 0.02 * noise.normal(),
            ];
            for (all, value) in joint.iter_mut().zip(values) {
                all.push(value);
            }
        }
    }
    common::recording(time, channels)
}

fn settings() -> CalibrationSettings {
    let mut settings = CalibrationSettings::default();
    settings.library.generic = Some(false);
    settings.library.families = vec![Family::Payload, Family::Viscous, Family::Coulomb];
    settings
}

fn fitted(logs: &[Recording], change: impl Fn(&mut CalibrationSettings)) -> Calibration {
    let mut settings = settings();
    change(&mut settings);
    let arm = two_link::arm(2.0).expect("an arm");
    calibrate(&arm, logs, &[], &settings, &|_| {}).expect("a calibration")
}

fn said(result: &Calibration) -> Option<&str> {
    let mut all = result.findings.iter();
    let found = all.find(|finding| finding.code == Code::CoulombVelocity);
    found.map(|finding| &*finding.message)
}

/// From a quarter to four times the usual one; beyond, the last of them.
#[test]
fn the_velocity_within_which_friction_turns_round_is_that_of_the_log() {
    for (v_s, chosen) in [
        (0.001, 0.005),
        (0.01, 0.01),
        (USUAL, USUAL),
        (0.04, 0.04),
        (0.08, 0.08),
        (0.2, 0.08),
    ] {
        let result = fitted(&[log(v_s, 1.0, SLOW, 3)], |_| {});
        let twin = &result.twin;
        assert_eq!(twin.pipeline.coulomb_velocity, chosen, "{v_s}");
        assert_eq!(twin.library.coulomb_velocity, chosen);
        // What counts as standing still is another question.
        assert!(
            twin.pipeline
                .standstill_velocity
                .iter()
                .all(|v| *v >= USUAL)
        );
        assert_eq!(said(&result).is_some(), chosen != USUAL);
        if chosen == v_s {
            for joint in ["shoulder", "elbow"] {
                let name = format!("{joint}.coulomb");
                let term = result.terms.iter().find(|term| term.term.name == name);
                let mean = term.and_then(|term| term.mean).unwrap_or(f64::NAN);
                assert!((mean - 1.0).abs() < 0.02, "{v_s} {name} {mean}");
            }
        }
    }
}

/// Nothing is chosen where somebody chose, where the filter is off, without friction among the candidates, and without friction in the log.
#[test]
fn nothing_is_chosen_where_there_is_nothing_to_choose() {
    let with_friction = [log(0.08, 1.0, SLOW, 4)];
    let stated = fitted(&with_friction, |settings| {
        settings.signal.coulomb_velocity = Some(0.03);
    });
    assert_eq!(stated.twin.pipeline.coulomb_velocity, 0.03);
    let off = fitted(&with_friction, |settings| {
        settings.signal.cutoff_hz = Auto::Value(0.0);
    });
    assert_eq!(off.twin.pipeline.coulomb_velocity, 0.0);
    let without = fitted(&with_friction, |settings| {
        settings.library.families = vec![Family::Payload, Family::Viscous];
    });
    assert_eq!(without.twin.pipeline.coulomb_velocity, USUAL);
    let smooth = fitted(&[log(0.08, 0.0, SLOW, 4)], |_| {});
    assert_eq!(smooth.twin.pipeline.coulomb_velocity, USUAL);
    for result in [&stated, &off, &without, &smooth] {
        assert_eq!(said(result), None);
    }
}

/// Sharper friction needs a finer clock than the one on which the motion of a slow log is held, and gets it.
#[test]
fn a_sharper_turn_is_seen_on_a_finer_clock() {
    let fast = |v_s: f64| {
        fitted(&[log(v_s, 1.0, (1000.0, 2.0), 5)], |_| {})
            .twin
            .pipeline
    };
    let (usual, sharp) = (fast(USUAL), fast(0.005));
    assert_eq!(
        (usual.coulomb_velocity, sharp.coulomb_velocity),
        (USUAL, 0.005)
    );
    assert!(
        usual.motion_interval > 2.5 * sharp.motion_interval,
        "{usual:?} {sharp:?}"
    );
    assert!(sharp.motion_interval > 0.0);
}

/// A log in some parts.
fn parts(whole: &Recording, count: usize) -> Vec<Recording> {
    let len = whole.time.len() / count;
    let part = |part: usize| {
        let mut own = whole.clone();
        let rows = part * len..(part + 1) * len;
        own.name = format!("log {part}");
        own.time = own.time[rows.clone()].to_vec();
        for joint in &mut own.joints {
            joint.q = joint.q[rows.clone()].to_vec();
            for channel in [&mut joint.qd, &mut joint.qdd, &mut joint.tau] {
                *channel = channel.as_ref().map(|all| all[rows.clone()].to_vec());
            }
        }
        own
    };
    (0..count).map(part).collect()
}

#[test]
fn many_short_logs_say_the_same() {
    let result = fitted(&parts(&log(0.08, 1.0, SLOW, 6), 4), |_| {});
    assert_eq!(result.twin.pipeline.coulomb_velocity, 0.08);
}

#[derive(Debug)]
struct Chapters(Vec<Recording>);

impl ReadChapter for Chapters {
    fn read(&self, chapter: usize) -> twincal::Result<Recording> {
        Ok(self.0[chapter].clone())
    }
}

#[test]
fn so_does_a_log_in_chapters() {
    let arm = two_link::arm(2.0).expect("an arm");
    let chapters = Chapters(parts(&log(0.08, 1.0, SLOW, 7), 4));
    let long = LongLog::new(&arm, vec![1500; 4], Arc::new(chapters)).expect("positions");
    let logs = vec![Log::Long(long)];
    let none: &[Recording] = &[];
    let result = calibrate(&arm, logs, none, &settings(), &|_| {}).expect("a calibration");
    assert_eq!(result.twin.pipeline.coulomb_velocity, 0.08);
}

/// Fast motion at 1 kHz, where a second is many samples and few rows, in twelve logs of five seconds: no choice from a handful of rows. Every
/// one of twenty logs with the usual v_s and much noise keeps it (5 nats are a χ² of 10 with one degree of freedom: 0.0016 in either direction, 0.06 for
/// all; the seeds are fixed).
#[test]
fn short_fast_logs_do_not_mislead() {
    let many = |v_s: f64, size: f64, seed: u64| {
        let whole = log(v_s, size, (1000.0, 3.0), seed);
        fitted(&parts(&whole, 12), |_| {})
            .twin
            .pipeline
            .coulomb_velocity
    };
    assert_eq!(many(0.3, 1.0, 8), 0.08);
    for seed in 0..20 {
        // Friction of half the noise.
        assert_eq!(many(USUAL, 0.01, 100 + seed), USUAL, "{seed}");
    }
}
