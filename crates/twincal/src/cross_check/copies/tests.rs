//! Copies are found, recordings of one programme are not.

use super::*;
use crate::cross_check::{Sketch, sketched_copies};
use crate::random::Random;
use crate::signal::{Channels, Payload};

/// Sampling interval, s.
const INTERVAL: f64 = 0.008;
/// sd of torque noise, N·m.
const NOISE: f64 = 0.1;

/// A recording of a programme: three joints that move on the same path whenever `programme` is the same, torque with dry friction and noise
/// that is that of `take`.
fn recording(programme: u64, take: u64, rows: usize) -> Recording {
    let mut path = Random::new(programme, 0);
    let mut noise = Random::new(1000 + take, 1);
    let time: Vec<f64> = (0..rows).map(|i| i as f64 * INTERVAL).collect();
    let joints = (0..3).map(|_| {
        let waves: Vec<[f64; 2]> = (1..5)
            .map(|k| [path.normal() / f64::from(k), path.normal()])
            .collect();
        let at = |t: f64, rate: bool| -> f64 {
            let wave = |(k, [size, phase]): (usize, &[f64; 2])| {
                let w = 1.3 * (k + 1) as f64;
                match rate {
                    true => size * w * (w * t + phase).cos(),
                    false => size * (w * t + phase).sin(),
                }
            };
            waves.iter().enumerate().map(wave).sum()
        };
        let mut slow = 0.0;
        let tau = time.iter().map(|t| {
            slow = 0.4 * slow + 0.6 * noise.normal();
            let motion = 20.0 * at(*t, false) + 5.0 * (at(*t, true) / 0.01).tanh();
            motion + NOISE * (0.7 * noise.normal() + 0.7 * slow)
        });
        Channels {
            tau: Some(tau.collect()),
            q: time.iter().map(|t| at(*t, false)).collect(),
            qd: None,
            qdd: None,
            temperature: None,
        }
    });
    Recording {
        unfolded: false,
        start_ns: 0,
        name: format!("run{take}"),
        joints: joints.collect(),
        time,
        payload: Payload::None,
    }
}

/// Rows `rows` of a recording, changed.
fn cut(
    from: &Recording,
    rows: std::ops::Range<usize>,
    change: impl Fn(f64, usize) -> f64,
) -> Recording {
    let mut copy = from.clone();
    copy.name = "copy".into();
    copy.time = copy.time[rows.clone()].iter().map(|t| t + 1000.0).collect();
    for channels in &mut copy.joints {
        channels.q = channels.q[rows.clone()].to_vec();
        let tau = channels.tau.take().unwrap_or_default();
        let tau = tau[rows.clone()].iter().enumerate();
        channels.tau = Some(tau.map(|(i, tau)| change(*tau, i)).collect());
    }
    copy
}

fn found(recordings: &[Recording]) -> Vec<Finding> {
    let logs: Vec<Log<'_>> = recordings.iter().map(Log::from).collect();
    copies(&logs).unwrap()
}

#[test]
fn copies_are_found_shifted_cut_rounded_and_with_noise() {
    let run = recording(1, 1, 1500);
    let other = recording(2, 2, 1500);
    let mut random = Random::new(3, 3);
    let more: Vec<f64> = (0..1500).map(|_| 0.5 * NOISE * random.normal()).collect();
    let copies = [
        cut(&run, 0..1500, |tau, _| tau),
        cut(&run, 37..1500, |tau, _| tau),
        cut(&run, 300..1200, |tau, _| (tau * 100.0).round() / 100.0),
        cut(&run, 0..1500, |tau, i| tau + more[i]),
        cut(&run, 600..1100, |tau, i| tau + more[i]),
    ];
    for copy in copies {
        let rows = copy.time.len() as u64;
        let said = found(&[run.clone(), other.clone(), copy.clone()]);
        assert_eq!(said.len(), 1, "{said:?}");
        assert_eq!((said[0].subject.as_str(), said[0].count), ("copy", rows));
        assert_eq!(said[0].severity, Severity::Degraded);
        assert!(said[0].message.contains("`run1`"), "{}", said[0].message);
        // Whichever of the two is given first.
        assert_eq!(found(&[copy, other.clone(), run.clone()]).len(), 1);
    }
}

/// Independent noise passes one limit of 8 sd with probability 6e-16 per offset that is looked at.
#[test]
fn recordings_of_one_programme_are_no_copies() {
    let runs: Vec<Recording> = (0..20).map(|take| recording(7, take, 1000)).collect();
    assert_eq!(found(&runs), []);
    let runs: Vec<Recording> = (0..20).map(|take| recording(take, take, 1000)).collect();
    assert_eq!(found(&runs), []);
}

#[test]
fn logs_without_torque_or_without_noise_say_nothing() {
    let run = recording(1, 1, 400);
    let constant = cut(&run, 0..400, |_, _| 1.5);
    let mut without = run.clone();
    without.joints.iter_mut().for_each(|own| own.tau = None);
    assert_eq!(
        found(&[constant.clone(), constant, without.clone(), without]),
        []
    );
    assert_eq!(found(&[]), []);
}

#[test]
fn a_copy_among_many_logs_is_found() {
    let mut runs: Vec<Recording> = (0..300)
        .map(|take| recording(take % 3, take, 300))
        .collect();
    runs.push(cut(&runs[17], 0..300, |tau, _| tau));
    let said = found(&runs);
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].message.contains("`run17`"));
}

/// What sketches of the logs say, without the logs.
fn sketched(recordings: &[Recording]) -> Vec<Finding> {
    let sketch = |own: &Recording| Sketch::of(&Log::from(own), 3).unwrap();
    let sketches: Vec<Sketch> = recordings.iter().map(sketch).collect();
    let names = recordings.iter().map(|own| own.name.as_str());
    sketched_copies(&names.zip(&sketches).collect::<Vec<_>>())
}

#[test]
fn sketches_find_copies_that_are_shifted_cut_or_rounded() {
    let run = recording(1, 1, 6000);
    let other = recording(2, 2, 6000);
    for copy in [
        cut(&run, 0..6000, |tau, _| tau),
        cut(&run, 37..6000, |tau, _| tau),
        cut(&run, 5000..5800, |tau, _| tau),
        cut(&run, 300..1200, |tau, _| (tau * 100.0).round() / 100.0),
    ] {
        let said = sketched(&[run.clone(), other.clone(), copy.clone()]);
        assert_eq!(said.len(), 1, "{said:?}");
        assert_eq!(said[0].subject, "copy");
        assert_eq!(said[0].severity, Severity::Degraded);
        assert!(said[0].message.contains("`run1`"), "{}", said[0].message);
        assert_eq!(sketched(&[copy, other.clone(), run.clone()]).len(), 1);
    }
}

/// A pattern of independent noise is in both logs with probability 2⁻³² per pair of rows, and sixteen of a joint have to be.
#[test]
fn sketches_of_recordings_say_nothing() {
    let runs: Vec<Recording> = (0..20).map(|take| recording(7, take, 3000)).collect();
    assert_eq!(sketched(&runs), []);
    let smooth = |programme| {
        let mut smooth = recording(programme, programme, 3000);
        for channels in &mut smooth.joints {
            channels.tau = Some(channels.q.iter().map(|q| 20.0 * q).collect());
        }
        smooth
    };
    assert_eq!(sketched(&[smooth(1), smooth(2), smooth(3)]), []);
    let rippled = |programme| {
        let mut rippled = smooth(programme);
        for channels in &mut rippled.joints {
            let all = channels.tau.iter_mut().flatten().enumerate();
            all.for_each(|(row, tau)| *tau += [0.3, -0.1, 0.5, -0.7][row % 4]);
        }
        rippled
    };
    assert_eq!(sketched(&[rippled(1), rippled(2)]), []);
    assert_eq!(sketched(&[]), []);
}

/// Mains hum of another phase in each log, one to four times as large as the noise, at half a sample's rate and a fraction: patterns repeat
/// in every log, and in any two.
#[test]
fn sketches_of_recordings_with_hum_say_nothing() {
    for turns in [0.48, 0.4, 0.24] {
        for times in [1.0, 2.0, 4.0] {
            let humming = |take: u64| {
                let mut own = recording(take, take, 6000);
                for channels in &mut own.joints {
                    let all = channels.tau.iter_mut().flatten().enumerate();
                    let phase = 1.7 * take as f64;
                    all.for_each(|(row, tau)| {
                        let angle = std::f64::consts::TAU * turns * row as f64 + phase;
                        *tau += times * NOISE * angle.sin();
                    });
                }
                own
            };
            let said = sketched(&[humming(1), humming(2), humming(3)]);
            assert_eq!(said, [], "{turns} {times}");
        }
    }
}

/// A part of 3 % of a long log has 31 ± 6 of its 1024 patterns per joint, 16 of which are enough: that two of three joints have fewer has a
/// probability below 1e-4.
#[test]
fn a_sketch_of_a_small_part_of_a_long_log_finds_it() {
    let run = recording(3, 3, 60_000);
    let part = cut(&run, 20_000..21_900, |tau, _| tau);
    let said = sketched(&[run, recording(4, 4, 60_000), part]);
    assert_eq!(said.len(), 1, "{said:?}");
    assert_eq!(said[0].subject, "copy");
}
