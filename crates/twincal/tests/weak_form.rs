//! Rows by the weak form beside the rows that are used, on positions from a noisy encoder.
//!
//! The weak form takes the derivative off the momentum and puts it on the filter, so that q̈ is never formed:
//!
//! ```text
//! F (d/dt p − r) = (D F) p − F r,   p = ∂L/∂q̇,  r = ∂L/∂q
//! ```
//! The rows that are used come from q, q̇ and q̈ of ONE smooth motion: the encoder's positions through a low-pass, its first and
//! its second derivative. For such a motion the two forms are the same number, and noise has no way to tell them apart.

use twincal::random::Random;
use twincal::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Motion, Robot, RobotDescription,
    nominal_torque,
};
use twincal::rows::{RowSignal, visit_rows};
use twincal::signal::{Channels, Payload, Pipeline, Recording, Trajectory, align};
use twincal::term::{Family, Library, LibrarySettings};

const RATE: f64 = 1000.0;
const SECONDS: f64 = 12.0;

/// Four links about z, y, y and x: inertia changes with position everywhere.
fn arm() -> Robot {
    let link = |name: &str, inertia| LinkDescription {
        name: name.into(),
        inertia,
    };
    let body = |mass: f64, com: [f64; 3]| {
        Some(Inertia {
            mass,
            com,
            tensor: [
                [0.03 * mass, 0.002, 0.0],
                [0.002, 0.05 * mass, 0.001],
                [0.0, 0.001, 0.04 * mass],
            ],
        })
    };
    let joint = |name: &str, parent: &str, child: &str, axis, translation| {
        let mut joint = JointDescription::new(name, JointKind::Revolute, parent, child);
        joint.axis = axis;
        joint.placement.translation = translation;
        joint
    };
    let description = RobotDescription {
        name: "arm".into(),
        gravity: [0.0, 0.0, -9.81],
        links: vec![
            link("base", None),
            link("one", body(4.0, [0.02, 0.03, 0.1])),
            link("two", body(3.0, [0.2, 0.02, 0.01])),
            link("three", body(2.0, [0.15, -0.03, 0.02])),
            link("four", body(1.0, [0.05, 0.04, 0.03])),
        ],
        joints: vec![
            joint("yaw", "base", "one", [0.0, 0.0, 1.0], [0.0; 3]),
            joint("shoulder", "one", "two", [0.0, 1.0, 0.0], [0.1, 0.0, 0.3]),
            joint("elbow", "two", "three", [0.0, 1.0, 0.0], [0.4, 0.0, 0.0]),
            joint("wrist", "three", "four", [1.0, 0.0, 0.0], [0.3, 0.0, 0.0]),
        ],
        allow_unphysical: false,
    };
    Robot::new(description, &Default::default())
        .expect("an arm")
        .0
}

/// Position, velocity and acceleration of a joint: three sines up to 1.5 Hz.
fn motion(joint: usize, t: f64) -> [f64; 3] {
    let mut state = [0.0; 3];
    for (k, size) in [0.5, 0.3, 0.15].into_iter().enumerate() {
        let w = std::f64::consts::TAU * (0.17 + 0.42 * k as f64 + 0.11 * joint as f64);
        let (sin, cos) = (w * t + 1.3 * (joint * 3 + k) as f64).sin_cos();
        state[0] += size * sin;
        state[1] += size * w * cos;
        state[2] -= size * w * w * sin;
    }
    state
}

/// Positions alone, each with noise of `sd` rad.
fn log(dof: usize, sd: f64) -> Recording {
    let time: Vec<f64> = (0..(SECONDS * RATE) as usize)
        .map(|i| i as f64 / RATE)
        .collect();
    let mut noise = Random::new(3, 0);
    let joints = (0..dof)
        .map(|joint| Channels {
            q: (time.iter())
                .map(|&t| motion(joint, t)[0] + sd * noise.normal())
                .collect(),
            qd: None,
            qdd: None,
            tau: Some(vec![0.0; time.len()]),
            temperature: None,
        })
        .collect();
    Recording {
        unfolded: false,
        start_ns: 0,
        name: "encoder".into(),
        time,
        joints,
        payload: Payload::None,
    }
}

/// τ(q, q̇, q̈) with parts of the motion of `trajectory` shifted or left out: `q + shift q̇`, `velocity q̇`, `a`.
fn torque(robot: &Robot, trajectory: &Trajectory, shift: f64, velocity: f64, a: Third) -> Vec<f64> {
    let segment = &trajectory.segments[0];
    let moved = segment
        .q
        .iter()
        .zip(&segment.qd)
        .map(|(q, qd)| q + shift * qd);
    let slower = segment.qd.iter().map(|qd| velocity * qd);
    let third = match a {
        Third::Velocity => segment.qd.clone(),
        Third::Nothing => vec![0.0; segment.qd.len()],
    };
    let mut tau = vec![0.0; segment.q.len()];
    let motion = Motion {
        len: segment.time.len(),
        q: &moved.collect::<Vec<_>>(),
        qd: &slower.collect::<Vec<_>>(),
        qdd: &third,
    };
    nominal_torque(robot, motion, &mut tau);
    tau
}

/// What stands in the place of q̈.
#[derive(Clone, Copy)]
enum Third {
    Velocity,
    Nothing,
}

/// p = M(q) q̇ at `q + shift q̇`.
fn momentum(robot: &Robot, trajectory: &Trajectory, shift: f64) -> Vec<f64> {
    let with = torque(robot, trajectory, shift, 0.0, Third::Velocity);
    let without = torque(robot, trajectory, shift, 0.0, Third::Nothing);
    with.iter().zip(without).map(|(a, b)| a - b).collect()
}

/// r = ∂L/∂q = (∂p/∂q) q̇ − τ(q, q̇, 0), the derivative by a central difference of order 4.
fn force(robot: &Robot, trajectory: &Trajectory) -> Vec<f64> {
    let step = 1e-3;
    let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(|i| momentum(robot, trajectory, i * step));
    let rest = torque(robot, trajectory, 0.0, 1.0, Third::Nothing);
    (0..rest.len())
        .map(|i| (a[i] - 8.0 * b[i] + 8.0 * c[i] - d[i]) / (12.0 * step) - rest[i])
        .collect()
}

/// F over a signal given as measured torque, and over the nominal torque, at every sample: `[joint][sample]`.
fn filtered(
    robot: &Robot,
    pipeline: &Pipeline,
    trajectory: &Trajectory,
    signal: Vec<f64>,
) -> [Vec<Vec<f64>>; 2] {
    let mut trajectory = trajectory.clone();
    trajectory.segments[0].tau = signal;
    let settings = LibrarySettings {
        families: vec![Family::Offset],
        generic: Some(false),
        ..LibrarySettings::default()
    };
    let (library, _) = Library::propose(robot, &settings).expect("a library");
    let [mut measured, mut nominal] = [(); 2].map(|()| vec![Vec::new(); robot.dof()]);
    let mut visit = |block: &twincal::rows::RowBlock<'_>| {
        for (joint, rows) in block.joints.iter().enumerate() {
            measured[joint].extend_from_slice(rows.measured);
            nominal[joint].extend_from_slice(rows.nominal);
        }
        Ok(())
    };
    visit_rows(
        robot,
        &library,
        pipeline,
        &trajectory,
        RowSignal::Filtered,
        &mut visit,
    )
    .expect("rows");
    [measured, nominal]
}

/// Central difference of order 8; four samples fewer at either end.
fn derivative(x: &[f64]) -> Vec<f64> {
    let weights = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
    (4..x.len() - 4)
        .map(|i| {
            let pairs = (1..=4).map(|k| weights[k - 1] * (x[i + k] - x[i - k]));
            RATE * pairs.sum::<f64>()
        })
        .collect()
}

/// Root mean squares of strong − truth, weak − truth and strong − weak, N·m.
fn compare(robot: &Robot, sd: f64, motion_cutoff_hz: f64) -> [f64; 3] {
    let pipeline = Pipeline {
        cutoff_hz: 10.0,
        motion_cutoff_hz,
        rate_hz: RATE,
        ..Pipeline::off(robot.dof())
    };
    let (trajectory, _) = align(robot, &log(robot.dof(), sd), &pipeline).expect("a trajectory");
    let len = trajectory.segments[0].time.len();
    let nothing = vec![0.0; robot.dof() * len];
    let [_, strong] = filtered(robot, &pipeline, &trajectory, nothing.clone());
    let [p, _] = filtered(
        robot,
        &pipeline,
        &trajectory,
        momentum(robot, &trajectory, 0.0),
    );
    let [r, _] = filtered(robot, &pipeline, &trajectory, force(robot, &trajectory));
    let mut real = trajectory.clone();
    let segment = &mut real.segments[0];
    for joint in 0..robot.dof() {
        for (i, &t) in segment.time.iter().enumerate() {
            let at = joint * len + i;
            [segment.q[at], segment.qd[at], segment.qdd[at]] = motion(joint, t);
        }
    }
    let [_, truth] = filtered(robot, &pipeline, &real, nothing);
    let (mut sums, mut count) = ([0.0; 3], 0.0);
    for joint in 0..robot.dof() {
        for (i, slope) in derivative(&p[joint]).into_iter().enumerate() {
            let weak = slope - r[joint][i + 4];
            let (strong, truth) = (strong[joint][i + 4], truth[joint][i + 4]);
            for (sum, x) in sums
                .iter_mut()
                .zip([strong - truth, weak - truth, strong - weak])
            {
                *sum += x * x;
            }
            count += 1.0;
        }
    }
    sums.map(|sum: f64| (sum / count).sqrt())
}

/// Without noise both are the truth. With it both err alike, in thousandths, and lie a thousand times closer to each other than to
/// the truth, whether the motion filter stops at four times the cut-off of the rows or at twelve times.
#[test]
fn rows_of_one_smooth_motion_are_those_of_the_weak_form() {
    let robot = arm();
    for motion_cutoff_hz in [40.0, 120.0] {
        let [strong, weak, _] = compare(&robot, 0.0, motion_cutoff_hz);
        assert!(strong < 1e-8 && weak < 1e-8, "{strong:e} {weak:e}");
        for sd in [1e-5, 1e-4, 1e-3] {
            let [strong, weak, apart] = compare(&robot, sd, motion_cutoff_hz);
            let told = format!(
                "{sd:e} rad, motion up to {motion_cutoff_hz} Hz: errors {strong:.3e} and {weak:.3e} N m, {apart:.3e} apart"
            );
            // 0.28 N m per 1e-3 rad: the noise is seen, and not drowned in something else.
            assert!((270.0..295.0).contains(&(strong / sd)), "{told}");
            assert!((weak / strong - 1.0).abs() < 1e-3, "{told}");
            assert!(apart < 1e-3 * strong, "{told}");
        }
    }
}
