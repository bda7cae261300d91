//! The whole pipeline on motion that is known in closed form.

use super::*;
use crate::error::{Code, Finding, Result};
use crate::robot::JointKind;
use crate::signal::log::joints::JointFacts;
use rand::{RngExt, SeedableRng};
use std::f64::consts::TAU;

fn joints() -> Vec<JointFacts> {
    ["shoulder", "elbow"]
        .map(|name| JointFacts {
            name: name.into(),
            kind: JointKind::Revolute,
            range: None,
            effort: None,
        })
        .to_vec()
}

/// Fourier series of five harmonics as identification experiments use them; `[q, q̇, q̈]` of a joint at `t`.
fn fourier(joint: usize, fundamental: f64, t: f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for k in 1..=5 {
        let omega = TAU * fundamental * f64::from(k);
        let phase = 0.7 * f64::from(k * k) + joint as f64;
        let amplitude = 0.8 / f64::from(k);
        let (sin, cos) = (omega * t + phase).sin_cos();
        sum[0] += amplitude * sin;
        sum[1] += amplitude * omega * cos;
        sum[2] -= amplitude * omega * omega * sin;
    }
    sum
}

/// Standard normal by the sum of twelve uniforms: tails beyond 6 are cut, which only makes tests stricter on bounds.
fn normal(random: &mut rand_chacha::ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

fn recording(
    rate: f64,
    seconds: f64,
    fundamental: f64,
    noise: f64,
    derivatives: bool,
) -> Recording {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let time: Vec<f64> = (0..(rate * seconds) as usize)
        .map(|i| i as f64 / rate)
        .collect();
    let joints = (0..2)
        .map(|joint| {
            let state: Vec<[f64; 3]> = time
                .iter()
                .map(|&t| fourier(joint, fundamental, t))
                .collect();
            Channels {
                q: state
                    .iter()
                    .map(|s| s[0] + noise * normal(&mut random))
                    .collect(),
                qd: derivatives.then(|| state.iter().map(|s| s[1]).collect()),
                qdd: derivatives.then(|| state.iter().map(|s| s[2]).collect()),
                tau: Some(state.iter().map(|s| s[2]).collect()),
                temperature: None,
            }
        })
        .collect();
    Recording {
        unfolded: false,
        start_ns: 0,
        name: "run".into(),
        time,
        joints,
        payload: Payload::None,
    }
}

fn settings(cutoff_hz: Auto) -> SignalSettings {
    SignalSettings {
        cutoff_hz,
        rate_hz: Auto::Auto,
        coulomb_velocity: None,
        corrections: Corrections::default(),
        every_sample: false,
    }
}

fn aligned(log: &Recording, pipeline: &Pipeline) -> Result<(Trajectory, Vec<Finding>)> {
    PreparedLog::new(joints(), log, pipeline)?.align(pipeline, Raw::All)
}

fn pipeline(log: &Recording) -> Pipeline {
    chosen(log, &settings(Auto::Auto)).unwrap().0
}

fn chosen(log: &Recording, settings: &SignalSettings) -> Result<(Pipeline, Vec<Finding>)> {
    let logs = Logs::from(std::slice::from_ref(log));
    let chosen = auto::choose::choose(&joints(), &logs.0, settings)?;
    let (pipeline, findings) = (chosen.pipeline, chosen.findings);
    Ok((pipeline, findings))
}

/// Root mean square error of q̇ and q̈ over both joints.
fn errors(log: &Recording, pipeline: &Pipeline, fundamental: f64) -> [f64; 2] {
    let (trajectory, _) = aligned(log, pipeline).unwrap();
    let (mut wrong, mut samples) = ([0.0; 2], 0.0);
    for segment in &trajectory.segments {
        let len = segment.time.len();
        for joint in 0..2 {
            for (i, &t) in segment.time.iter().enumerate() {
                samples += 1.0;
                let truth = fourier(joint, fundamental, t);
                for (k, value) in [segment.qd[joint * len + i], segment.qdd[joint * len + i]]
                    .into_iter()
                    .enumerate()
                {
                    wrong[k] += (value - truth[k + 1]).powi(2);
                }
            }
        }
    }
    wrong.map(|w| (w / samples).sqrt())
}

#[test]
fn clean_positions_are_differentiated_to_a_millionth() {
    for (rate, fundamental) in [(100.0, 0.1), (200.0, 0.2), (1000.0, 0.15)] {
        let log = recording(rate, 20.0, fundamental, 0.0, false);
        let pipeline = pipeline(&log);
        assert_eq!((pipeline.cutoff_hz, pipeline.rate_hz), (5.0, 12.5));
        let [qd, qdd] = errors(&log, &pipeline, fundamental);
        assert!(qd < 1e-7 && qdd < 1e-6, "{rate} Hz: {qd} {qdd}");
    }
}

#[test]
fn encoder_noise_leaves_the_acceleration_usable() {
    // sd of a derivative of white noise below f_q: σ √(2 dt ∫ (2πf)^{2k} df); the bound is 1.3 times that (a filter that is not a
    // brick wall) plus its bias on the clean motion, and half of it from below: a bound that is always met says nothing.
    for noise in [1e-5, 1e-4, 1e-3] {
        let log = recording(1000.0, 20.0, 0.2, noise, false);
        let pipeline = pipeline(&log);
        let f = pipeline.motion_cutoff_hz;
        let bound = |k: i32| {
            1.3 * noise * (2e-3 * TAU.powi(2 * k) * f.powi(2 * k + 1) / f64::from(2 * k + 1)).sqrt()
        };
        let [qd, qdd] = errors(&log, &pipeline, 0.2);
        for (error, bound) in [(qd, bound(1)), (qdd, bound(2))] {
            assert!(
                (0.5 * bound..bound).contains(&error),
                "{noise}: {error} {bound}"
            );
        }
        assert!(pipeline.cutoff_hz >= 2.0, "{}", pipeline.cutoff_hz);
    }
}

#[test]
fn torque_stays_with_its_own_motion() {
    // Torque is q̈ here, so the segment's torque is the filtered acceleration of the same sample, resampled or not.
    let even = recording(500.0, 10.0, 0.2, 0.0, true);
    let mut uneven = even.clone();
    for (i, t) in uneven.time.iter_mut().enumerate() {
        *t += 4e-4 * (2.4 * i as f64).sin();
    }
    for (joint, channels) in uneven.joints.iter_mut().enumerate() {
        let at = |k: usize| -> Vec<f64> {
            let state = uneven.time.iter().map(|&t| fourier(joint, 0.2, t)[k]);
            state.collect()
        };
        (channels.q, channels.qd, channels.qdd) = (at(0), Some(at(1)), Some(at(2)));
        channels.tau = channels.qdd.clone();
    }
    for log in [even, uneven] {
        let (trajectory, _) = aligned(&log, &pipeline(&log)).unwrap();
        let segment = &trajectory.segments[0];
        let worst = segment
            .tau
            .iter()
            .zip(&segment.qdd)
            .map(|(a, b)| (a - b).abs());
        assert!(worst.fold(0.0, f64::max) < 1e-5);
        if let Some(logged) = &segment.logged {
            let len = logged.time.len();
            for joint in 0..2 {
                let tau = log.joints[joint].tau.as_ref().unwrap();
                for (i, &row) in logged.input_rows.iter().enumerate() {
                    assert_eq!(logged.time[i], log.time[row]);
                    assert_eq!(logged.tau[joint * len + i], tau[row]);
                }
            }
        }
    }
}

#[test]
fn logged_derivatives_pass_the_same_kernel() {
    let log = recording(200.0, 20.0, 0.2, 0.0, true);
    let [qd, qdd] = errors(&log, &pipeline(&log), 0.2);
    assert!(qd < 1e-8 && qdd < 1e-8, "{qd} {qdd}");
}

#[test]
fn without_filter_every_row_is_taken_as_it_is() {
    let mut log = recording(100.0, 3.0, 0.2, 0.0, true);
    log.joints[1].q[17] = f64::NAN;
    let (off, _) = chosen(&log, &settings(Auto::Value(0.0))).unwrap();
    assert!(off.is_off() && off.coulomb_velocity == 0.0);
    assert_eq!(off.kernel_length(), 0.0);
    let (trajectory, findings) = aligned(&log, &off).unwrap();
    assert_eq!(findings.len(), 1);
    assert_eq!(
        (findings[0].code.as_str(), findings[0].count),
        ("not_finite_rows", 1)
    );
    let rows: Vec<usize> = trajectory
        .segments
        .iter()
        .flat_map(|s| s.input_rows.clone())
        .collect();
    assert_eq!(rows, (0..300).filter(|row| *row != 17).collect::<Vec<_>>());
    for segment in &trajectory.segments {
        let len = segment.time.len();
        for (i, &row) in segment.input_rows.iter().enumerate() {
            assert_eq!(
                segment.qdd[len + i],
                log.joints[1].qdd.as_ref().unwrap()[row]
            );
            assert_eq!(segment.tau[i], log.joints[0].tau.as_ref().unwrap()[row]);
        }
        assert!(segment.standstill.iter().all(|s| !s));
    }
}

#[test]
fn unfit_settings_are_refused_with_the_key() {
    let log = recording(100.0, 20.0, 0.2, 0.0, false);
    let choose = |cutoff: f64, rate: Auto| {
        let settings = SignalSettings {
            rate_hz: rate,
            ..settings(Auto::Value(cutoff))
        };
        chosen(&log, &settings)
    };
    for (cutoff, rate, part) in [
        (-1.0, Auto::Auto, "signal.cutoff_hz"),
        (f64::NAN, Auto::Auto, "signal.cutoff_hz"),
        (45.0, Auto::Auto, "at most 40.000"),
        (5.0, Auto::Value(0.0), "signal.rate_hz"),
        (0.2, Auto::Auto, "record longer"),
    ] {
        let message = choose(cutoff, rate).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    }
    let (_, findings) = choose(5.0, Auto::Value(6.0)).unwrap();
    assert!(findings.iter().any(|f| f.code == Code::RowsAlias));
    let (pipeline, findings) = choose(20.0, Auto::Auto).unwrap();
    assert!((pipeline.motion_cutoff_hz - 45.0).abs() < 1e-9);
    assert!(findings.iter().any(|f| f.code == Code::MotionFilterCapped));
}

#[test]
fn white_noise_gain_is_what_white_noise_shows() {
    // 40 000 samples, about 400 independent ones after the filter: relative sd 3.5 %, bound 6 sd.
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let x: Vec<f64> = (0..40_000).map(|_| normal(&mut random)).collect();
    let pipeline = Pipeline {
        cutoff_hz: 5.0,
        ..Pipeline::off(1)
    };
    let kernel = fir::column_kernel(5.0, 1e-3);
    let mut out = vec![0.0; x.len() - kernel.len() + 1];
    filter::convolve::correlate(&kernel, &x, &mut out);
    let sd = (out.iter().map(|v| v * v).sum::<f64>() / out.len() as f64).sqrt();
    assert!((sd / pipeline.noise_gain(1000.0) - 1.0).abs() < 0.2, "{sd}");
}

/// A log that was let go gives the same motion: slow, held at a coarser clock, and with an uneven clock.
#[test]
fn without_its_recording_a_log_is_smoothed_to_the_same_bits() {
    let even = recording(100.0, 20.0, 0.1, 1e-5, false);
    let fast = recording(1000.0, 20.0, 0.05, 1e-5, true);
    let mut uneven = even.clone();
    for (i, t) in uneven.time.iter_mut().enumerate() {
        *t += 0.002 * (7.3 * i as f64).sin();
    }
    for (log, thinned, resampled) in [
        (even, false, false),
        (fast, true, false),
        (uneven, false, true),
    ] {
        let pipeline = pipeline(&log);
        let wider = Pipeline {
            cutoff_hz: 1.4 * pipeline.cutoff_hz,
            motion_cutoff_hz: 1.4 * pipeline.motion_cutoff_hz,
            ..pipeline.clone()
        };
        let ready = || PreparedLog::new(joints(), &log, &pipeline).unwrap();
        let (kept, said) = ready().align(&wider, Raw::None).unwrap();
        let (alone, also) = ready().detached().align(&wider, Raw::None).unwrap();
        assert_eq!((&kept, &said), (&alone, &also));
        let (whole, _) = ready().align(&wider, Raw::All).unwrap();
        let (kept, whole) = (&kept.segments[0], &whole.segments[0]);
        assert_eq!((&kept.qdd, &kept.tau), (&whole.qdd, &whole.tau));
        assert_eq!(kept.thinning() > 1, thinned);
        assert_eq!(whole.logged.is_some(), thinned || resampled);
        assert!(kept.logged.is_none());
    }
}

/// q̇ with white noise on one joint: taken from position where that tells it better, and where it matters.
#[test]
fn a_noisy_velocity_gives_way_to_a_better_position() {
    let fundamental = 0.2;
    let noisy = |of_position: f64, of_velocity: f64| {
        let mut log = recording(500.0, 30.0, fundamental, of_position, true);
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(11);
        log.joints.iter_mut().for_each(|joint| joint.qdd = None);
        for v in log.joints[1].qd.iter_mut().flatten() {
            *v += of_velocity * normal(&mut random);
        }
        log
    };
    let source = |log: &Recording| pipeline(log).velocity_from;
    let log = noisy(1e-6, 0.3);
    assert_eq!(source(&log), [DerivedFrom::Velocity, DerivedFrom::Position]);
    // A velocity that is clean enough stays, and so does one beside a position that is no better; as does what was said.
    assert_eq!(source(&noisy(1e-6, 1e-3)), []);
    assert_eq!(source(&noisy(5e-3, 0.3)), []);
    let mut stated = settings(Auto::Auto);
    stated.corrections.velocity = Some(DerivedFrom::Velocity);
    let as_logged = chosen(&log, &stated).unwrap().0;
    assert_eq!(as_logged.velocity_from, []);
    let [from_position, logged] =
        [pipeline(&log), as_logged].map(|pipeline| errors(&log, &pipeline, fundamental)[0]);
    assert!(from_position < 0.05 * logged, "{from_position} {logged}");
}

/// The two numbers of "a of b s become rows".
fn kept_and_all(findings: &[Finding]) -> [f64; 2] {
    let said = findings
        .iter()
        .find(|finding| finding.code == Code::Borders);
    let (_, numbers) = said.unwrap().message.split_once("segment: ").unwrap();
    let numbers: Vec<f64> = numbers
        .split_whitespace()
        .filter_map(|word| word.parse().ok())
        .collect();
    [numbers[0], numbers[1]]
}

/// Rows that are missing, repeat or cut the log: never are more seconds kept than there are.
#[test]
fn kept_seconds_do_not_exceed_those_of_the_log() {
    use super::worlds::{Motion, World, polled};
    let even = World::new(Motion::PointToPoint, 3).clean();
    let missing: Vec<usize> = (0..even.time.len()).filter(|i| i % 3 != 1).collect();
    let time = missing.iter().map(|&row| even.time[row]).collect();
    let mut cut = even.clone();
    for row in (3000..16_000).step_by(4000) {
        cut.joints[0].q[row] = f64::NAN;
    }
    let logs = [
        super::worlds::rows_of(&even, &missing, time),
        polled(&even, 1000.0, 5).0,
        cut,
        even,
    ];
    for log in &logs {
        let (trajectory, findings) = aligned(log, &pipeline(log)).unwrap();
        let [kept, all] = kept_and_all(&findings);
        let seconds = log.time[log.time.len() - 1] - log.time[0];
        assert!(
            0.5 * all < kept && kept <= all && all <= seconds + 1e-3,
            "{kept} of {all} of {seconds}"
        );
        let segments = trajectory.segments.iter();
        let held: f64 = segments.map(|s| s.time[s.time.len() - 1] - s.time[0]).sum();
        assert!(held <= seconds);
    }
}

/// A finding on a logged velocity needs one.
#[test]
fn without_a_logged_velocity_nothing_is_said_of_it() {
    use super::worlds::{Motion, World};
    for motion in [Motion::Fourier, Motion::PointToPoint, Motion::Trapezoid] {
        let world = World {
            counts: 4096.0,
            with_velocity: false,
            ..World::new(motion, 4)
        };
        let log = world.clean();
        let (pipeline, mut findings) = chosen(&log, &settings(Auto::Value(8.0))).unwrap();
        findings.extend(aligned(&log, &pipeline).unwrap().1);
        for finding in &findings {
            assert!(
                !finding.code.as_str().starts_with("velocity_")
                    && !finding.message.contains("logged velocity"),
                "{finding:?}"
            );
        }
    }
}
