//! What several tests make their logs with.

use twincal::signal::{Channels, Payload, Recording};

/// The log of what each joint did: position, velocity, acceleration and torque at the times, s.
pub(crate) fn recording<const N: usize>(time: Vec<f64>, joints: [[Vec<f64>; 4]; N]) -> Recording {
    let joints = joints.map(|[q, qd, qdd, tau]| Channels {
        q,
        qd: Some(qd),
        qdd: Some(qdd),
        tau: Some(tau),
        temperature: None,
    });
    Recording {
        unfolded: false,
        start_ns: 0,
        name: "log".into(),
        time,
        joints: joints.into(),
        payload: Payload::None,
    }
}
