//! A wider band where noise is an autoregression, and nowhere else.

use crate::common;
use crate::two_link;
use twincal::Code;
use twincal::calibrate::{Calibration, CalibrationSettings, Stopped, calibrate};
use twincal::likelihood::NoiseModel;
use twincal::random::Random;
use twincal::robot::{Workspace, inverse_dynamics};
use twincal::signal::{Auto, Recording};
use twincal::term::Family;

/// Hz.
const RATE: f64 = 500.0;

/// 30 s of motion with viscous friction, Stribeck's of `stribeck` N·m, and noise of 0.1 N·m with the time constant `memory`, s.
fn log(memory: f64, stribeck: f64, seed: u64) -> Recording {
    let arm = two_link::arm(2.0).expect("an arm");
    let (mut random, mut workspace, mut tau) =
        (Random::new(seed, 0), Workspace::new(&arm), [0.0; 2]);
    let rho = if memory > 0.0 {
        (-1.0 / (RATE * memory)).exp()
    } else {
        0.0
    };
    let mut noise = [random.normal(), random.normal()];
    let mut channels = [[(); 4]; 2].map(|joint| joint.map(|()| Vec::new()));
    let time: Vec<f64> = (0..15_000).map(|i| f64::from(i) / RATE).collect();
    for t in &time {
        let waves = [[0.7, 1.9, 0.2], [0.9, 1.5, 1.1]].map(|[a, b, p]| [2.0 * a, 2.0 * b, p]);
        let sum = |of: &dyn Fn(f64, f64) -> f64| {
            waves.map(|[a, b, phase]| of(a, a * t + phase) + 0.5 * of(b, b * t))
        };
        let q = sum(&|_, x: f64| 0.4 * x.sin());
        let qd = sum(&|w, x: f64| 0.4 * w * x.cos());
        let qdd = sum(&|w, x: f64| -0.4 * w * w * x.sin());
        inverse_dynamics(&arm, &mut workspace, &q, &qd, &qdd, &mut tau);
        for (j, joint) in channels.iter_mut().enumerate() {
            noise[j] = rho * noise[j] + (1.0 - rho * rho).sqrt() * random.normal();
            let sharp = (qd[j] / 0.02_f64).tanh() * (-(qd[j] / 0.1).powi(2)).exp();
            let torque = tau[j] + 0.5 * qd[j] + stribeck * sharp + 0.1 * noise[j];
            for (all, value) in joint.iter_mut().zip([q[j], qd[j], qdd[j], torque]) {
                all.push(value);
            }
        }
    }
    common::recording(time, channels)
}

fn fitted(log: Recording, change: impl Fn(&mut CalibrationSettings)) -> Calibration {
    tried(log, change).expect("a calibration")
}

fn tried(
    log: Recording,
    change: impl Fn(&mut CalibrationSettings),
) -> Result<Calibration, Stopped> {
    let mut settings = CalibrationSettings::default();
    settings.library.generic = Some(false);
    settings.library.families = vec![Family::Payload, Family::Viscous];
    change(&mut settings);
    let arm = two_link::arm(2.0).expect("an arm");
    calibrate(&arm, &[log][..], &[], &settings, &|_| {})
}

/// Cut-off, likelihood, and whether a wider band is told.
fn used(result: &Calibration) -> (f64, NoiseModel, bool) {
    let said = result
        .findings
        .iter()
        .any(|found| found.code == Code::WiderBand);
    (
        result.twin.pipeline.cutoff_hz,
        result.likelihood.model,
        said,
    )
}

/// Each of the three logs has a chance of 4 % at most to be taken for something else; seeds are fixed.
#[test]
fn an_autoregression_is_fitted_in_a_wider_band() {
    for seed in 1..=3 {
        let result = fitted(log(0.1, 0.0, seed), |_| {});
        assert_eq!(used(&result), (20.0, NoiseModel::Ar1, true), "seed {seed}");
        for joint in &result.twin.noise {
            // ρ of rows 20 ms apart, and what the filter adds to it.
            assert!((0.78..0.95).contains(&joint.rho), "{}", joint.rho);
        }
        let again = fitted(log(0.1, 0.0, seed), |settings| {
            settings.signal.cutoff_hz = Auto::Value(20.0);
            settings.noise.model = NoiseModel::Ar1;
        });
        assert_eq!(again.twin.posterior, result.twin.posterior, "as if stated");
    }
}

#[test]
fn nothing_changes_where_noise_is_none_or_somebody_chose() {
    let usual = |result: &Calibration| used(result) == (5.0, NoiseModel::Tempered, false);
    for (memory, stribeck) in [(0.0, 0.0), (0.0, 1.0), (0.1, 1.0)] {
        let result = fitted(log(memory, stribeck, 4), |_| {});
        assert!(
            usual(&result),
            "{memory} s, {stribeck} N·m: {:?}",
            used(&result)
        );
        let stated = fitted(log(memory, stribeck, 4), |settings| {
            settings.may_widen = false
        });
        assert_eq!(
            format!("{stated:?}"),
            format!("{result:?}"),
            "to the last bit, NaN included"
        );
    }
    assert!(usual(&fitted(log(0.1, 0.0, 1), |settings| settings
        .may_widen =
        false)));
    let cutoff = fitted(log(0.1, 0.0, 1), |settings| {
        settings.signal.cutoff_hz = Auto::Value(5.0);
    });
    assert!(usual(&cutoff));
    let encoder = fitted(positions(log(0.1, 0.0, 1)), |_| {});
    assert_eq!(used(&encoder).1, NoiseModel::Tempered);
}

/// Rows of the wider band that do not fit into memory end that fit, not the calibration: it is the usual one, and says so.
#[test]
fn where_the_wider_band_ends_early_the_usual_one_is_fitted() {
    let memory = || log(0.1, 0.0, 1);
    let refused = |change: &dyn Fn(&mut CalibrationSettings)| -> f64 {
        let stopped = tried(memory(), |settings| {
            settings.most_bytes = Some(1000);
            change(settings);
        });
        let text = stopped.expect_err("no room").error.to_string();
        let after = text.split("needs about ").nth(1).expect("what it needs");
        let number = after.split(' ').next().expect("a number");
        1e6 * number.parse::<f64>().expect("megabytes")
    };
    let narrow = refused(&|_| {});
    let wide = refused(&|settings| {
        settings.signal.cutoff_hz = Auto::Value(20.0);
        settings.noise.model = NoiseModel::Ar1;
    });
    assert!(wide > narrow + 3e5, "{narrow} and {wide} bytes");
    let between = Some((0.5 * (narrow + wide)) as u64);
    let result = fitted(memory(), |settings| settings.most_bytes = between);
    let usual = fitted(memory(), |settings| settings.may_widen = false);
    assert_eq!(used(&result), (5.0, NoiseModel::Tempered, false));
    assert_eq!(result.twin.posterior, usual.twin.posterior);
    let (said, others): (Vec<_>, Vec<_>) =
        (result.findings.into_iter()).partition(|found| found.code == Code::NotWider);
    assert_eq!(others, usual.findings);
    assert!(
        said.len() == 1 && said[0].message.contains("MB are free"),
        "{said:?}"
    );
    let room = fitted(memory(), |settings| {
        settings.most_bytes = Some(2 * wide as u64);
    });
    assert_eq!(used(&room), (20.0, NoiseModel::Ar1, true));
}

/// The same with positions alone, from an encoder with 1e-4 rad of noise.
fn positions(mut log: Recording) -> Recording {
    let mut random = Random::new(9, 0);
    for joint in &mut log.joints {
        joint
            .q
            .iter_mut()
            .for_each(|q| *q += 1e-4 * random.normal());
        (joint.qd, joint.qdd) = (None, None);
    }
    log
}
