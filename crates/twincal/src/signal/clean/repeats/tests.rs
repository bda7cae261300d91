//! Logs of known motion whose rows repeat, and logs in which nothing does.

use super::*;
use crate::robot::JointKind;
use crate::signal::clean::correct::Corrections;
use crate::signal::clean::pieces::Prepared;
use crate::signal::clean::prepare::prepare;
use crate::signal::log::joints::JointFacts;
use crate::signal::worlds::{JOINTS, MOTIONS, Motion, World, normal, polled, rows_of};
use rand::{RngExt, SeedableRng};

fn facts() -> Vec<JointFacts> {
    let facts = |joint: usize| JointFacts {
        name: format!("joint{joint}"),
        kind: JointKind::Revolute,
        range: None,
        effort: None,
    };
    (0..JOINTS).map(facts).collect()
}

fn prepared(log: &Recording) -> (Prepared<'_>, Vec<Finding>) {
    let mut findings = Vec::new();
    let prepared = prepare(&facts(), log, false, &Corrections::default(), &mut findings);
    (prepared.unwrap(), findings)
}

fn said<'a>(findings: &'a [Finding], code: &str) -> Option<&'a Finding> {
    findings
        .iter()
        .find(|finding| finding.code.as_str() == code)
}

/// Rows that repeat the row before.
fn repeats(steps: &[usize]) -> usize {
    steps.windows(2).filter(|pair| pair[0] == pair[1]).count()
}

/// Largest difference of position from the truth in a quarter of a second of motion, after the best shift in time there, rad; and the largest
/// shift less the smallest, s. In a dwell a step may be lost.
fn off_truth(log: &Prepared<'_>, motion: Motion) -> [f64; 2] {
    let piece = &log.pieces[0];
    let (mut worst, mut shifts) = (0.0_f64, Vec::new());
    for from in (0..piece.time.len() - 250).step_by(250) {
        let speed = |i: usize| motion.at(0, piece.time[i] - 17.3)[1].abs();
        if (from..from + 250).any(|i| speed(i) < 1e-3) {
            continue;
        }
        let samples = || (0..JOINTS).flat_map(|joint| (from..from + 250).map(move |i| (joint, i)));
        let mut shift = 17.3;
        for _ in 0..4 {
            let (mut product, mut square) = (0.0, 1e-9);
            for (joint, i) in samples() {
                let [q, v] = motion.at(joint, piece.time[i] - shift);
                product += v * (piece.joints[joint].q[i] - q);
                square += v * v;
            }
            shift -= product / square;
        }
        let off = |(joint, i): (usize, usize)| {
            piece.joints[joint].q[i] - motion.at(joint, piece.time[i] - shift)[0]
        };
        worst = samples().fold(worst, |worst, at| worst.max(off(at).abs()));
        shifts.push(shift);
    }
    let (low, high) =
        (shifts.iter()).fold((f64::INFINITY, 0.0_f64), |(l, h), s| (l.min(*s), h.max(*s)));
    [worst, high - low]
}

#[test]
fn a_polled_stream_is_put_on_the_controllers_clock() {
    for motion in [Motion::Fourier, Motion::PointToPoint, Motion::Trapezoid] {
        for (seed, with_velocity) in [(1, true), (2, false), (3, true)] {
            let world = World {
                with_velocity,
                ..World::new(motion, seed)
            };
            let (log, steps) = polled(&world.clean(), world.rate, 100 + seed);
            let (prepared, findings) = prepared(&log);
            let found = said(&findings, "repeated_samples").expect("a finding");
            let (count, truth) = (found.count as f64, repeats(&steps) as f64);
            let share = truth / steps.len() as f64;
            assert!((0.03..0.1).contains(&share), "the world: {share}");
            assert!(
                (count / truth - 1.0).abs() < 0.002,
                "{motion:?}: {count} of {truth}"
            );
            assert_eq!(found.severity, Severity::Warning);
            let off = prepared.interval * world.rate - 1.0;
            assert!(
                off.abs() < 1e-4,
                "{motion:?} {seed}: {off} {}",
                found.message
            );
            assert_eq!(prepared.pieces.len(), 1, "{findings:?}");
            let grid = prepared.pieces[0].time.len() as f64;
            assert!(grid > 0.99 * world.rate * world.seconds, "{grid}");
            // With the receiver's stamps it is 0.6 ms times 2 rad/s.
            let [off, drift] = off_truth(&prepared, motion);
            assert!(
                off < 1e-4 && drift < 2e-3,
                "{motion:?} {seed}: {off} {drift}"
            );
            for code in ["position_step", "motion_spike", "resampled", "gaps"] {
                assert!(said(&findings, code).is_none(), "{findings:?}");
            }
        }
    }
}

/// 0.5 to 2 % single repeats on an even clock: found where the joint moves by more than its encoder hides, and nowhere else.
#[test]
fn single_repeats_are_left_out_or_interpolated_and_stamps_are_kept() {
    for (seed, share, all_channels) in [
        (1, 0.005, true),
        (2, 0.02, true),
        (3, 0.02, false),
        (4, 0.005, false),
    ] {
        let world = World::new(Motion::PointToPoint, seed);
        let clean = world.clean();
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut log = clean.clone();
        let mut made = Vec::new();
        let mut k = 5;
        while k + 5 < clean.time.len() {
            if random.random::<f64>() < share {
                made.push(k);
                k += 1;
            }
            k += 1;
        }
        for &k in &made {
            for joint in &mut log.joints {
                joint.q[k] = joint.q[k - 1];
                if all_channels {
                    for values in [&mut joint.qd, &mut joint.tau].into_iter().flatten() {
                        values[k] = values[k - 1];
                    }
                }
            }
        }
        let clear = |k: &&usize| world.motion.at(0, clean.time[**k])[1].abs() > 0.15;
        let slow = |k: &&usize| world.motion.at(0, clean.time[**k])[1].abs() > 0.01;
        let (least, most) = (
            made.iter().filter(clear).count(),
            made.iter().filter(slow).count(),
        );
        let (prepared, findings) = prepared(&log);
        let count = said(&findings, "repeated_samples")
            .expect("a finding")
            .count as usize;
        assert!(
            (least..=most + 2).contains(&count),
            "{count}: {least} to {most}"
        );
        assert!((prepared.interval * world.rate - 1.0).abs() < 1e-9);
        let piece = &prepared.pieces[0];
        assert_eq!(
            (prepared.pieces.len(), piece.time.len()),
            (1, clean.time.len())
        );
        assert_eq!(piece.resampled(), all_channels);
        for joint in 0..JOINTS {
            let pairs = piece.time.iter().zip(&*piece.joints[joint].q);
            let off = pairs.map(|(t, q)| (q - world.motion.at(joint, *t)[0]).abs());
            let off = off.fold(0.0, f64::max);
            assert!(off < 2e-4, "{seed}: {off}");
        }
    }
}

/// 144 logs without a repeat: none is found. The chance that a fresh reading repeats at the least travel that counts is below 1e-9 per row.
#[test]
fn rest_slow_motion_dither_and_honest_jitter_are_no_repeats() {
    let mut seed = 1000;
    for motion in MOTIONS {
        for counts in [1 << 16, 1 << 18, 1 << 20] {
            for rate in [125.0, 500.0, 1000.0] {
                for (dither, torque_noise) in [(0.0, 0.0), (0.0, 0.05), (0.7, 0.05), (0.7, 0.0)] {
                    seed += 1;
                    let world = World {
                        rate,
                        counts: f64::from(counts),
                        dither,
                        torque_noise,
                        ..World::new(motion, seed)
                    };
                    let (_, findings) = prepared(&world.clean());
                    for code in ["repeated_samples", "controller_clock"] {
                        assert!(said(&findings, code).is_none(), "{world:?}: {findings:?}");
                    }
                }
            }
        }
    }
    // Stamps of its own that are right: values belong to them.
    for motion in MOTIONS {
        let world = World::new(motion, 7);
        let fine = World {
            rate: 20_000.0,
            ..world
        };
        let all = fine.clean();
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        let rows: Vec<usize> = (0..19_990)
            .map(|i| 20 * i + (3.0 * normal(&mut random)).round().clamp(-9.0, 9.0) as usize)
            .collect();
        let time = rows.iter().map(|&row| all.time[row]).collect();
        let log = rows_of(&all, &rows[1..], time);
        let log = Recording {
            time: log.time[1..].to_vec(),
            ..log
        };
        let (_, findings) = prepared(&log);
        for code in ["repeated_samples", "controller_clock"] {
            assert!(said(&findings, code).is_none(), "{motion:?}: {findings:?}");
        }
    }
}

/// A slow channel, a stuck encoder and a joint that sticks are no single repeats.
#[test]
fn slow_channels_and_stuck_encoders_are_left_alone() {
    let world = World::new(Motion::Fourier, 21);
    let clean = world.clean();
    let mut slow = clean.clone();
    for joint in &mut slow.joints {
        joint.q = (0..joint.q.len()).map(|i| joint.q[i / 4 * 4]).collect();
    }
    let mut stuck = clean.clone();
    let held = stuck.joints[0].q[5000];
    stuck.joints[0].q[5000..5200].fill(held);
    for log in [slow, stuck] {
        let (_, findings) = prepared(&log);
        assert!(
            said(&findings, "repeated_samples").is_none(),
            "{findings:?}"
        );
    }
}
