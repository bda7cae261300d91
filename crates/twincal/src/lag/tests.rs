//! A planted lag comes back in parts of a sample, with an error that is true; friction that remembers, a wrong model and a contact are no lag.

use super::*;
use crate::error::Code;
use crate::self_check::testing::{INTERVAL, LEN, arm, leaning_and_loaded, log, log_of, remember};

fn pipeline() -> Pipeline {
    Pipeline {
        cutoff_hz: 5.0,
        motion_cutoff_hz: 20.0,
        standstill_velocity: vec![0.02; 4],
        ..Pipeline::off(4)
    }
}

/// Makes the torque of some joints late by this many samples.
fn delay(trajectory: &mut Trajectory, joints: &[usize], lag: &dyn Fn(f64) -> f64) {
    let grid: Vec<f64> = (0..LEN).map(|i| i as f64).collect();
    for joint in joints {
        let own = joint * LEN..(joint + 1) * LEN;
        let tau = trajectory.segments[0].tau[own.clone()].to_vec();
        let at: Vec<f64> = grid
            .iter()
            .map(|i| (i - lag(*i)).clamp(0.0, (LEN - 1) as f64))
            .collect();
        let moved = crate::signal::spline::resample(&grid, &tau, &at);
        trajectory.segments[0].tau[own].copy_from_slice(&moved);
    }
}

fn late(seed: f64, joints: &[usize], samples: f64) -> Trajectory {
    let mut trajectory = log(seed);
    delay(&mut trajectory, joints, &|_| samples);
    trajectory
}

fn found(logs: &[&Trajectory]) -> Lags {
    lags(&arm(1.0), &pipeline(), logs).unwrap()
}

/// 10 seeds × 5 lags: the common lag is within 4 of its standard deviations (false alarm 3e-3 for all of them together) and within a millisecond.
#[test]
fn case_17_a_planted_lag_comes_back_in_parts_of_a_sample() {
    for seed in 0..10 {
        for lag in [-2.0, 0.0, 1.0, 3.4, 8.0] {
            let found = found(&[&late(f64::from(seed) * 3.1, &[0, 1, 2, 3], lag)]);
            let [mean, sd] = found.common.unwrap();
            let error = (mean - lag * INTERVAL).abs();
            assert!(
                error < 1e-3 && error < 4.0 * sd,
                "seed {seed}: {lag} came back as {found:#?}"
            );
            assert_eq!(found.clear, lag != 0.0, "{found:#?}");
            assert!(found.joints.iter().all(|joint| !joint.differs));
            let said = lag_findings(&Lag::Unsaid, &found, &[]);
            assert_eq!(said.len(), usize::from(lag != 0.0), "{said:?}");
            assert!(
                said.iter()
                    .all(|f| f.severity == Severity::Note && f.code == Code::TorqueLag)
            );
            match found.correction(&arm(1.0)) {
                Some(Lag::All(moved)) => {
                    assert!(lag != 0.0 && (moved - lag * INTERVAL).abs() < 1e-3)
                }
                other => assert!(lag == 0.0 && other.is_none(), "{other:?}"),
            }
        }
    }
}

/// Presliding over 8 mrad delays friction by tens of milliseconds at every reversal.
#[test]
fn friction_that_remembers_is_no_lag() {
    for seed in 0..10 {
        let mut trajectory = log(f64::from(seed) * 3.1);
        remember(&mut trajectory, 2.0, 0.008);
        let found = found(&[&trajectory]);
        let [mean, _] = found.common.unwrap();
        assert!(mean.abs() < 1e-3 && !found.clear, "{found:#?}");
        assert_eq!(lag_findings(&Lag::Unsaid, &found, &[]), []);
    }
}

/// Gravity times what the arm carries is no lag: base by up to 12°, 4 kg at the wrist.
#[test]
fn a_base_that_leans_under_an_unknown_payload_is_no_lag() {
    for degrees in [0.5, 1.0, 2.0, 4.0, 8.0, 12.0] {
        let robot = leaning_and_loaded(degrees);
        for seed in 0..10 {
            let found = found(&[&log_of(&robot, f64::from(seed) * 3.1)]);
            let [mean, _] = found.common.unwrap();
            assert!(mean.abs() < 1e-3 && !found.clear, "{degrees}: {found:#?}");
            assert_eq!(lag_findings(&Lag::Unsaid, &found, &[]), []);
        }
    }
}

#[test]
fn one_joint_that_is_late_is_named_and_moved_alone() {
    for joint in 0..4 {
        let trajectory = late(3.1, &[joint], 12.0);
        let found = found(&[&trajectory, &late(6.2, &[joint], 12.0)]);
        let differ: Vec<&str> = (found.joints.iter().filter(|joint| joint.differs))
            .map(|joint| &*joint.joint)
            .collect();
        let name = format!("j{}", joint + 1);
        assert_eq!(differ, [&*name], "{found:#?}");
        let said = &lag_findings(&Lag::Unsaid, &found, &[])[0];
        assert_eq!(
            (said.severity, &*said.subject),
            (Severity::Degraded, &*name)
        );
        assert!(
            said.message.contains("ms after the motion"),
            "{}",
            said.message
        );
        let Some(Lag::Joints(moved)) = found.correction(&arm(1.0)) else {
            panic!("{found:#?}");
        };
        let sd = found.joints[joint].sd;
        for (own, lag) in &moved {
            let planted = if *own == name { 0.06 } else { 0.0 };
            assert!((lag - planted).abs() < 4.0 * sd + 1e-3, "{moved:?} ± {sd}");
        }
        assert!(sd < SHARP);
    }
}

#[test]
fn one_log_that_is_late_is_named_and_moves_no_other() {
    let all = [0, 1, 2, 3];
    let logs = [late(0.0, &all, 12.0), log(3.1), log(6.2)];
    let mut logs = logs;
    logs.iter_mut()
        .zip(["a", "b", "c"])
        .for_each(|(log, name)| log.name = name.into());
    let found = found(&logs.each_ref());
    let differ: Vec<bool> = found.logs.iter().map(|log| log.differs).collect();
    assert_eq!(differ, [true, false, false], "{found:#?}");
    assert!(!found.clear && found.correction(&arm(1.0)).is_none());
    let said = lag_findings(&Lag::Unsaid, &found, &[]);
    let [own] = &said[..] else {
        panic!("{said:?}");
    };
    assert_eq!((own.code, &*own.subject), (Code::LogTorqueLag, "a"));
    assert!(own.forbids_yes());
    // What another check said of it already is not said again.
    assert_eq!(lag_findings(&Lag::Unsaid, &found, &said), []);
}

/// 0, 40 and 80 ms: no two logs agree, so that nothing is applied to all.
#[test]
fn logs_that_disagree_have_no_common_lag() {
    let all = [0, 1, 2, 3];
    let mut logs = [0.0, 3.1, 6.2].map(log);
    for (k, log) in logs.iter_mut().enumerate() {
        log.name = format!("run{k}");
        delay(log, &all, &|_| 8.0 * k as f64);
    }
    let found = found(&logs.each_ref());
    assert!(found.common.is_none() && !found.clear, "{found:#?}");
    assert!(found.correction(&arm(1.0)).is_none());
}

#[test]
fn a_lag_beside_the_one_that_was_said_is_a_warning() {
    let found = found(&[&late(0.0, &[0, 1, 2, 3], 4.0)]);
    let said = lag_findings(&Lag::All(0.0), &found, &[]);
    assert_eq!(said[0].severity, Severity::Warning);
}

/// A clock of torque that runs 0.3 % slow: 10, 30 and 50 ms in the thirds of 20 s.
#[test]
fn a_clock_that_drifts_shows_in_the_thirds_of_a_log() {
    let mut trajectory = log(0.0);
    delay(&mut trajectory, &[0, 1, 2, 3], &|i| 0.003 * i);
    let thirds = lag_by_thirds(&arm(1.0), &pipeline(), &trajectory).unwrap();
    for (k, [lag, sd]) in thirds.into_iter().enumerate() {
        let planted = 0.003 * (LEN as f64 * INTERVAL) * (2 * k + 1) as f64 / 6.0;
        assert!((lag - planted).abs() < 2e-3, "{k}: {lag} ± {sd}");
    }
}

#[test]
fn joints_that_disagree_have_no_lag_in_common() {
    let pool = |lags: &[[f64; 2]]| agreed(lags).common;
    assert!(pool(&[[0.02, 1e-3], [0.021, 1e-3], [0.0195, 1e-3]]).is_some());
    assert!(
        pool(&[
            [-0.009, 6e-3],
            [0.0, 2e-3],
            [-0.015, 2e-3],
            [-0.033, 3e-3],
            [-0.055, 6e-3]
        ])
        .is_none()
    );
    let one = agreed(&[[0.0, 1e-3], [0.001, 1e-3], [0.06, 1e-3], [0.0, 2e-3]]);
    assert_eq!(one.differs, [false, false, true, false]);
    assert!(one.common.is_some_and(|[mean, _]| mean.abs() < 1e-3));
}
