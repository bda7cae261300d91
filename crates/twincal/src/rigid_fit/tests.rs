//! A payload, a wrong model and friction leave noise; a push of a quarter of the log stays in what is left.

use super::robust::robust;
use super::*;
use crate::self_check::testing::{INTERVAL, LEN, arm, log};
use crate::signal::{Pipeline, Trajectory};

fn pipeline() -> Pipeline {
    Pipeline {
        cutoff_hz: 5.0,
        motion_cutoff_hz: 20.0,
        standstill_velocity: vec![0.02; 4],
        ..Pipeline::off(4)
    }
}

/// What is left by joint and bin, with the spread of each joint.
fn left(trajectory: &Trajectory) -> (Vec<Vec<f64>>, Vec<f64>, Vec<f64>) {
    let robot = arm(1.0);
    let bins = bins(&robot, &pipeline(), trajectory, &[]);
    let design = Design::new(&robot, &bins, &sample(&robot, &bins));
    let solution = robust(&design, &prior(&robot)).unwrap();
    let coulomb = (0..4)
        .map(|joint| design.coulomb(joint, &solution.theta))
        .collect();
    let spread = solution.spread.iter().map(|spread| spread[0]).collect();
    (design.residual(&solution.theta), spread, coulomb)
}

/// Noise of the arm's log: uniform of width 1, averaged over bins of ten samples.
const NOISE: f64 = 0.0913;

#[test]
fn a_wrong_model_and_friction_leave_noise() {
    for seed in 0..5 {
        let (_, spread, coulomb) = left(&log(f64::from(seed) * 3.1));
        for (spread, coulomb) in spread.iter().zip(coulomb) {
            assert!((0.6 * NOISE..1.3 * NOISE).contains(spread), "{spread}");
            // 2 N·m, and 1.5 N·m s/rad at 0.1 rad/s
            assert!((coulomb - 2.15).abs() < 0.3, "{coulomb}");
        }
    }
}

/// 6 N·m for 5 of 20 s stay in what is left, and do not change the spread.
#[test]
fn a_push_of_a_quarter_of_the_log_does_not_pull_the_fit() {
    for (seed, from) in [(0.0, 800), (3.1, 1700), (6.2, 2900)] {
        let mut pushed = log(seed);
        let push = from..from + 1000;
        for i in push.clone() {
            pushed.segments[0].tau[2 * LEN + i] += 6.0;
        }
        let (residual, spread, _) = left(&pushed);
        assert!(
            spread.iter().all(|spread| *spread < 2.0 * NOISE),
            "{spread:?}"
        );
        let inside: Vec<f64> = residual[2][push.start / 10 + 1..push.end / 10 - 1].to_vec();
        let mean = inside.iter().sum::<f64>() / inside.len() as f64;
        assert!((mean - 6.0).abs() < 0.5, "{mean}");
    }
}

#[test]
fn zones_are_where_friction_is_what_it_is() {
    let trajectory = log(0.0);
    let own = bins(&arm(1.0), &pipeline(), &trajectory, &[[2.0, 3.0]]).remove(0);
    let segment = &trajectory.segments[0];
    for joint in 0..4 {
        for (bin, zone) in own.zones(joint).iter().enumerate() {
            let at = |i: usize| segment.qd[joint * LEN + i];
            let turns = (10 * bin..10 * bin + 9).any(|i| at(i) * at(i + 1) < 0.0);
            let t = own.spans[bin];
            assert!(!turns || *zone != Zone::Slides, "{t:?}");
            let stopped = t[1] >= 2.0 && t[0] <= 3.0;
            assert_eq!(*zone == Zone::Unknown, stopped, "{t:?}");
            assert!((t[1] - t[0] - 9.0 * INTERVAL).abs() < 1e-9);
        }
    }
}
