//! Rows of a thinned log against those of the whole one, of an arm that is 15 % heavier than its model, with friction, logged at 1 kHz.

use super::super::*;
use super::pipeline;
use crate::robot::{Motion, Robot, nominal_torque};
use crate::self_check::testing::arm;
use crate::signal::{Channels, DerivedFrom, Payload, Raw, Recording, prepare};
use crate::term::{Family, Library, LibrarySettings};

const JOINTS: usize = 4;
const SAMPLES: usize = 30_000;
/// Share of mass that the model has too little.
const HEAVIER: f64 = 0.15;
const VISCOUS: f64 = 1.5;
const COULOMB: f64 = 2.0;
const COULOMB_VELOCITY: f64 = 0.02;

/// Two sines per joint, differentiated `order` times.
fn wave(time: &[f64], order: i32) -> Vec<f64> {
    let all = (0..JOINTS).flat_map(|joint| {
        let (w, v) = (0.9 + 0.37 * joint as f64, 2.3 - 0.41 * joint as f64);
        time.iter().map(move |t| {
            let quarter = f64::from(order) * std::f64::consts::FRAC_PI_2;
            let sine = |size: f64, w: f64, phase: f64| {
                size * w.powi(order) * (w * t + phase + quarter).sin()
            };
            sine(0.9, w, joint as f64) + sine(0.4, v, 2.0 * joint as f64)
        })
    });
    all.collect()
}

fn recording() -> Recording {
    let time: Vec<f64> = (0..SAMPLES).map(|i| 1e-3 * i as f64).collect();
    let [q, qd, qdd] = [0, 1, 2].map(|order| wave(&time, order));
    let mut tau = vec![0.0; JOINTS * SAMPLES];
    let motion = Motion {
        len: SAMPLES,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    nominal_torque(&arm(1.0 + HEAVIER), motion, &mut tau);
    for (tau, qd) in tau.iter_mut().zip(&qd) {
        *tau += VISCOUS * qd + COULOMB * (qd / COULOMB_VELOCITY).tanh();
    }
    let of_joint =
        |values: &[f64], joint: usize| values[joint * SAMPLES..(joint + 1) * SAMPLES].to_vec();
    Recording {
        unfolded: false,
        start_ns: 0,
        name: "run".into(),
        joints: (0..JOINTS)
            .map(|joint| Channels {
                q: of_joint(&q, joint),
                qd: Some(of_joint(&qd, joint)),
                qdd: None,
                tau: Some(of_joint(&tau, joint)),
                temperature: None,
            })
            .collect(),
        time,
        payload: Payload::None,
    }
}

/// The candidates, and their true coefficients.
fn candidates(robot: &Robot) -> (Library, Vec<f64>) {
    let settings = LibrarySettings {
        families: vec![Family::Density, Family::Viscous, Family::Coulomb],
        coulomb_velocity: COULOMB_VELOCITY,
        ..LibrarySettings::default()
    };
    let library = Library::propose(robot, &settings).unwrap().0;
    let true_value = |&term: &usize| match library.terms()[term].family {
        Family::Density => HEAVIER,
        Family::Viscous => VISCOUS,
        _ => COULOMB,
    };
    let truth = library.columns().iter().map(true_value).collect();
    (library, truth)
}

/// What the rows of a log leave unexplained.
struct Left {
    /// Largest torque that the true coefficients do not explain, N·m.
    worst: f64,
    rows: usize,
    /// Time of the first row.
    first: f64,
}

impl Left {
    fn add(&mut self, block: &RowBlock<'_>, truth: &[f64]) {
        if self.rows == 0 {
            self.first = block.time[0];
        }
        self.rows += block.len;
        for joint in &block.joints {
            for r in 0..block.len {
                let columns = joint.columns.iter().enumerate();
                let explained: f64 = columns
                    .map(|(i, &k)| truth[k] * joint.x[i * joint.stride + r])
                    .sum();
                let left = joint.measured[r] - joint.nominal[r] - explained;
                self.worst = self.worst.max(left.abs());
            }
        }
    }
}

/// Thinned or not, every row is explained by the true coefficients, and so is every sample as logged.
#[test]
fn a_coarser_clock_changes_no_row() {
    let (robot, recording) = (arm(1.0), recording());
    let (library, truth) = candidates(&robot);
    let mut times = Vec::new();
    for motion_interval in [0.0, 0.007] {
        let pipeline = Pipeline {
            motion_interval,
            standstill_velocity: vec![0.02; JOINTS],
            derived_from: vec![DerivedFrom::Velocity; JOINTS],
            velocity_from: Vec::new(),
            ..pipeline(5.0)
        };
        let (trajectory, _) = prepare(&robot, &recording, &pipeline)
            .unwrap()
            .align(&pipeline, Raw::All)
            .unwrap();
        let interval = trajectory.segments[0].interval;
        let expected = if motion_interval > 0.0 { 5e-3 } else { 1e-3 };
        assert!((interval - expected).abs() < 1e-12, "{interval}");
        for (signal, limit) in [(RowSignal::Filtered, 2e-4), (RowSignal::Raw, 5e-4)] {
            let mut left = Left {
                worst: 0.0,
                rows: 0,
                first: f64::NAN,
            };
            let mut check = |block: &RowBlock<'_>| {
                left.add(block, &truth);
                Ok(())
            };
            visit_rows(&robot, &library, &pipeline, &trajectory, signal, &mut check).unwrap();
            assert!(left.worst < limit, "{signal:?}: {:e} N·m", left.worst);
            times.push((left.first, left.rows));
        }
    }
    // The same rows but for the borders; samples as logged all the same.
    assert!(times[2].1.abs_diff(times[0].1) <= 2, "{times:?}");
    assert!(times[3].1 > 29_000 && times[3].1 < times[1].1, "{times:?}");
}
