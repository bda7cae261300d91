//! A planted lag comes back in parts of a sample, with an error that is true; without one nothing is said.

use super::*;
use crate::self_check::testing::{INTERVAL, LEN, arm, log};
use crate::signal::Corrections;

fn pipeline() -> Pipeline {
    Pipeline {
        cutoff_hz: 5.0,
        motion_cutoff_hz: 20.0,
        ..Pipeline::off(4)
    }
}

/// The log with torque `lag` samples late: exactly, as the noise of a fine grid would move with it.
fn late(seed: f64, lag: f64) -> Trajectory {
    let mut trajectory = log(seed);
    let (segment, exact) = (&mut trajectory.segments[0], log(seed));
    let whole = lag.floor();
    for joint in 0..4 {
        let tau = &exact.segments[0].tau[joint * LEN..(joint + 1) * LEN];
        let grid: Vec<f64> = (0..LEN).map(|i| i as f64).collect();
        let at: Vec<f64> = grid
            .iter()
            .map(|i| (i - lag).clamp(0.0, (LEN - 1) as f64))
            .collect();
        let moved = if lag == whole {
            at.iter().map(|i| tau[*i as usize]).collect()
        } else {
            crate::signal::spline::resample(&grid, tau, &at)
        };
        segment.tau[joint * LEN..(joint + 1) * LEN].copy_from_slice(&moved);
    }
    trajectory
}

/// 20 seeds: the common lag is within 4 of its standard deviations (which also hold what fast and slow differences disagree
/// by; false alarm below 1e-3 for all of them together) and within a fifth of a sample.
#[test]
fn case_17_a_planted_lag_comes_back_in_parts_of_a_sample() {
    for seed in 0..20 {
        for lag in [-2.0, 0.0, 3.4, 7.0] {
            let trajectory = late(f64::from(seed) * 3.1, lag);
            let found = estimate_lag(&arm(1.0), &pipeline(), &trajectory).unwrap();
            let [mean, sd] = found.common.unwrap();
            let (mean, sd) = (mean / INTERVAL, sd / INTERVAL);
            assert!(
                (mean - lag).abs() < 0.2 && (mean - lag).abs() < 4.0 * sd + 0.05,
                "seed {seed}: {lag} came back as {mean} ± {sd}: {found:#?}"
            );
            let said = lag_findings(&pipeline(), &[found]);
            assert_eq!(said.len(), usize::from(lag.abs() > 1.5), "{said:?}");
            assert!(said.iter().all(|f| f.severity == Severity::Degraded));
        }
    }
}

/// One sample late, known to parts of it: there, and not longer than a sample by three standard deviations.
#[test]
fn a_lag_of_a_sample_is_a_note_until_the_lag_is_said() {
    for lag in [1.0, -1.0] {
        let found = estimate_lag(&arm(1.0), &pipeline(), &late(0.0, lag)).unwrap();
        assert!(found.clear().is_none() && found.slight().is_some());
        let note = &lag_findings(&pipeline(), std::slice::from_ref(&found))[0];
        let order = if lag > 0.0 { "after" } else { "before" };
        assert_eq!(note.severity, Severity::Note);
        assert!(note.message.contains(order), "{}", note.message);
        let mut said = pipeline();
        said.corrections.lag = Lag::All(0.0);
        assert_eq!(lag_findings(&said, &[found]), []);
    }
    let none = estimate_lag(&arm(1.0), &pipeline(), &late(0.0, 0.3)).unwrap();
    assert_eq!(lag_findings(&pipeline(), &[none]), []);
}

#[test]
fn a_lag_that_was_said_is_no_degraded_data() {
    let found = estimate_lag(&arm(1.0), &pipeline(), &late(0.0, 4.0)).unwrap();
    let mut said = pipeline();
    said.corrections = Corrections {
        lag: Lag::All(0.0),
        ..Corrections::default()
    };
    let said = lag_findings(&said, &[found]);
    assert_eq!(said[0].severity, Severity::Warning);
}

#[test]
fn what_one_of_many_logs_says_is_only_a_warning() {
    let log = |seed: f64, lag: f64| estimate_lag(&arm(1.0), &pipeline(), &late(seed, lag)).unwrap();
    let most = lag_findings(&pipeline(), &[log(0.0, 4.0), log(3.1, 4.0), log(6.2, 0.0)]);
    let degraded = |f: &crate::Finding| f.severity == Severity::Degraded;
    assert!(most.len() == 2 && most.iter().all(degraded), "{most:?}");
    let one = lag_findings(&pipeline(), &[log(0.0, 4.0), log(3.1, 0.0), log(6.2, 0.0)]);
    assert!(one.len() == 1 && one[0].severity == Severity::Warning);
    assert!(
        one[0].message.contains("; only 1 of 3 logs say so"),
        "{one:?}"
    );
}

#[test]
fn joints_that_disagree_have_no_clear_lag() {
    let joint = |lag: f64, speaks: bool| JointLag {
        joint: "j".into(),
        lag,
        slow: Some(lag),
        sd: Some(1e-4),
        left: [0.5, 0.1],
        speaks,
    };
    let log = |joints: Vec<JointLag>| LogLag {
        log: "run".into(),
        interval: 0.001,
        common: common(&joints, 0.001),
        joints,
    };
    assert!(
        log(vec![joint(0.005, true), joint(0.0051, true)])
            .clear()
            .is_some()
    );
    assert!(
        log(vec![joint(0.005, true), joint(-0.02, true)])
            .clear()
            .is_none()
    );
    assert!(
        log(vec![joint(0.005, true), joint(0.005, false)])
            .common
            .is_none()
    );
}
