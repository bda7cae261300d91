//! Planted contacts and stops are found where they are; an arm with friction, noise and a wrong model has none.

use super::*;
use crate::self_check::testing::{INTERVAL, LEN, arm, log};

fn pipeline() -> Pipeline {
    Pipeline {
        cutoff_hz: 5.0,
        motion_cutoff_hz: 20.0,
        standstill_velocity: vec![0.02; 4],
        ..Pipeline::off(4)
    }
}

fn found(trajectory: &Trajectory) -> Vec<Incident> {
    let mut evidence = Evidence::default();
    evidence.take(&arm(1.0), &pipeline(), trajectory);
    evidence.incidents(&arm(1.0), &pipeline())
}

#[test]
fn a_good_log_has_no_incident() {
    for seed in 0..10 {
        assert_eq!(found(&log(f64::from(seed) * 3.1)), []);
    }
}

#[test]
fn case_29_a_contact_is_found_where_it_is_and_left_out_for_all_joints() {
    let mut trajectory = log(0.0);
    // half a sine of 60 and 25 N·m in two joints, 0.3 s from 8 s
    let (from, to) = (1600, 1660);
    for i in from..to {
        let shape = (std::f64::consts::PI * (i - from) as f64 / (to - from) as f64).sin();
        trajectory.segments[0].tau[LEN + i] += 60.0 * shape;
        trajectory.segments[0].tau[2 * LEN + i] += 25.0 * shape;
    }
    let spikes = found(&trajectory);
    assert_eq!(spikes.len(), 1, "{spikes:?}");
    let spike = &spikes[0];
    assert_eq!(spike.kind, IncidentKind::Spike);
    assert!(spike.span[0] < 8.08 && spike.span[0] > 7.9, "{spike:?}");
    assert!(spike.span[1] > 8.22 && spike.span[1] < 8.4, "{spike:?}");
    // the average over half a period of 5 Hz takes a twelfth off the peak
    assert!(spike.torque > 20.0 && spike.torque < 60.0, "{spike:?}");
    leave_out(&pipeline(), &mut trajectory, &spikes);
    let still = &trajectory.segments[0].standstill;
    let all: Vec<bool> = (0..4).map(|j| still[j * LEN + 1630]).collect();
    assert_eq!(all, [true; 4]);
    assert!(!still[0] && !still[1400] && !still[1900]);
    assert_eq!(incident_findings("run", &spikes)[0].code, "torque_spike");
}

#[test]
fn case_30_drives_that_are_off_are_told_from_drives_that_hold() {
    let hold = |torque: bool| {
        let mut trajectory = log(0.0);
        let segment = &mut trajectory.segments[0];
        let held: Vec<usize> = (2000..2400).collect();
        for joint in 0..4 {
            for &i in &held {
                let (at, first) = (joint * LEN + i, joint * LEN + 2000);
                segment.q[at] = segment.q[first];
                (segment.qd[at], segment.qdd[at]) = (0.0, 0.0);
                segment.standstill[at] = true;
                segment.tau[at] = if torque { segment.tau[first] } else { 0.0 };
            }
        }
        found(&trajectory)
    };
    assert_eq!(hold(true), []);
    let stops = hold(false);
    assert_eq!(stops.len(), 1, "{stops:?}");
    assert_eq!(stops[0].kind, IncidentKind::DrivesOff);
    let [first, last] = stops[0].span;
    assert!((first - 2000.0 * INTERVAL).abs() < 1e-9 && (last - 2399.0 * INTERVAL).abs() < 1e-9);
    assert_eq!(stops[0].samples, 400);
}
