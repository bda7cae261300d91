//! Columns that remember, through clock, filters and slices.

use super::*;
use crate::robot::{Motion, nominal_torque};
use crate::self_check::testing::arm;
use crate::signal::{Channels, DerivedFrom, JointHistory, Raw, Recording, Warmth, prepare};
use crate::term::{Family, LibrarySettings};

const DOF: usize = 4;
const LEN: usize = 20_000;
const R: f64 = 5e-3;
/// Coulomb friction that is the slip of one element, N·m, and what a cold joint has more at the log's start.
const FRICTION: f64 = 1.5;
const COLD: f64 = 0.6;
const CONSTANT: f64 = 7.0;
/// Mean of the warmth over the training logs.
const MEAN: f64 = 0.3;

/// Two sines per joint, 1 kHz; `order`: derivative.
fn wave(order: i32) -> Vec<f64> {
    let quarter = f64::from(order) * std::f64::consts::FRAC_PI_2;
    let sine = |size: f64, w: f64, t: f64| size * w.powi(order) * (w * t + quarter).sin();
    let of_joint = |joint: usize| {
        let (w, v) = (0.9 + 0.37 * joint as f64, 2.3 - 0.41 * joint as f64);
        (0..LEN).map(move |i| sine(0.5, w, 1e-3 * i as f64) + sine(0.2, v, 1e-3 * i as f64))
    };
    (0..DOF).flat_map(of_joint).collect()
}

/// The friction of one joint by its definition: an element that bends by up to R and slips then, which gets colder with the log's time.
fn friction(q: &[f64], qd: &[f64]) -> Vec<f64> {
    let mut e = 0.0;
    (0..q.len())
        .map(|i| {
            let step = if i == 0 { 0.0 } else { q[i] - q[i - 1] };
            e = (e + step).clamp(-R, R);
            let cold = COLD * (-1e-3 * i as f64 / CONSTANT).exp();
            FRICTION * e / R + cold * (qd[i] / 0.02).tanh()
        })
        .collect()
}

fn log() -> Recording {
    let [q, qd, qdd] = [wave(0), wave(1), wave(2)];
    let mut tau = vec![0.0; DOF * LEN];
    let motion = Motion {
        len: LEN,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    nominal_torque(&arm(1.0), motion, &mut tau);
    let joint = |joint: usize| {
        let own = joint * LEN..(joint + 1) * LEN;
        let (q, qd) = (q[own.clone()].to_vec(), qd[own.clone()].to_vec());
        let both = tau[own].iter().zip(friction(&q, &qd));
        Channels {
            tau: Some(both.map(|(tau, friction)| tau + friction).collect()),
            q,
            qd: Some(qd),
            qdd: None,
            temperature: None,
        }
    };
    Recording {
        unfolded: true,
        name: "run".into(),
        time: (0..LEN).map(|i| 100.0 + 1e-3 * i as f64).collect(),
        start_ns: 0,
        joints: (0..DOF).map(joint).collect(),
        payload: Payload::None,
    }
}

/// Coefficients that the columns of the element and of its warmth have.
fn coefficients(library: &Library) -> Vec<f64> {
    (library.columns().iter())
        .map(
            |&term| match library.terms()[term].name.rsplit('.').next() {
                Some("stop2") => FRICTION,
                Some("coulomb") if library.terms()[term].family == Family::WarmUp => COLD,
                Some("coulomb") => FRICTION + COLD * MEAN,
                _ => 0.0,
            },
        )
        .collect()
}

/// A pipeline that knows the element's thresholds and the time in which joints warm up.
fn pipeline(motion_interval: f64) -> Pipeline {
    let history = JointHistory {
        thresholds: vec![1.5e-3, R, 15e-3],
        warmth: Some(Warmth::Time {
            constant: CONSTANT,
            mean: MEAN,
            later_mean: 0.2,
        }),
    };
    Pipeline {
        cutoff_hz: 5.0,
        motion_cutoff_hz: 20.0,
        rate_hz: 12.5,
        motion_interval,
        coulomb_velocity: 0.02,
        standstill_velocity: vec![0.02; DOF],
        derived_from: vec![DerivedFrom::Velocity; DOF],
        history: vec![history; DOF],
        ..Pipeline::off(DOF)
    }
}

/// Adds a block's columns row by row, so that blocks do not matter; the most torque that these coefficients leave once all is known.
fn left(block: &RowBlock<'_>, coefficients: &[f64], all: &mut Vec<f64>) -> f64 {
    let mut worst = 0.0_f64;
    for row in 0..block.len {
        for rows in &block.joints {
            let own = all.len();
            let columns = 0..rows.columns.len();
            all.extend(columns.map(|i| rows.x[i * rows.stride + row]));
            let columns = rows.columns.iter().zip(&all[own..]);
            let explained: f64 = columns.map(|(&k, x)| coefficients[k] * x).sum();
            let left = rows.measured[row] - rows.nominal[row] - explained;
            if block.time[row] > 101.0 {
                worst = worst.max(left.abs());
                assert!(!rows.standstill[row], "known by then");
            }
        }
    }
    worst
}

/// Truth: the element itself. The column of r = 5 mrad has all of the Coulomb friction, warmth is `e^(−t/T)` less its mean.
#[test]
fn an_element_that_bends_and_slips_is_explained_by_its_column() {
    let robot = arm(1.0);
    let settings = LibrarySettings {
        families: vec![Family::Coulomb, Family::Hysteresis, Family::WarmUp],
        coulomb_velocity: 0.02,
        ..LibrarySettings::default()
    };
    let library = Library::propose(&robot, &settings).unwrap().0;
    let truth = coefficients(&library);
    let log = log();
    for motion_interval in [0.0, 0.007] {
        let pipeline = pipeline(motion_interval);
        let (trajectory, _) = prepare(&robot, &log, &pipeline)
            .unwrap()
            .align(&pipeline, Raw::All)
            .unwrap();
        for signal in [RowSignal::Filtered, RowSignal::Raw] {
            let numbers = |most: usize| {
                let slices = slices(&pipeline, &trajectory, signal, f64::NEG_INFINITY, most);
                let (mut all, mut worst) = (Vec::new(), 0.0_f64);
                let mut look = |block: &RowBlock<'_>| {
                    worst = worst.max(left(block, &truth, &mut all));
                    Ok(())
                };
                visit_slices(
                    &robot,
                    &library,
                    &pipeline,
                    &trajectory,
                    signal,
                    &slices,
                    &mut look,
                )
                .unwrap();
                (all, worst)
            };
            let (whole, worst) = numbers(usize::MAX);
            // As logged, a thinned clock rounds off the corner where the element begins to slip.
            let limit = match signal {
                RowSignal::Filtered => 0.02 * FRICTION,
                RowSignal::Raw => 0.05 * FRICTION,
            };
            assert!(worst < limit, "{signal:?}, {motion_interval}: {worst}");
            assert_eq!(whole, numbers(77).0);
        }
    }
}
