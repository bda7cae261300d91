//! The paper on one page: which effects does the model of an arm lack, and how sure is its torque?
#![allow(clippy::print_stdout, reason = "an example shows its result")]
use twincal::calibrate::{Calibration, CalibrationSettings, calibrate};
use twincal::random::Random;
use twincal::robot::*;
use twincal::signal::{Auto, Channels, Payload, Recording};
use twincal::term::Family;

/// A planar arm of two links of 0.5 m that carry 3 kg and `fore` kg at their ends.
pub(crate) fn arm(fore: f64) -> twincal::Result<Robot> {
    let (com, tensor) = ([0.5, 0.0, 0.0], [[0.0; 3]; 3]);
    let link = |(name, mass): (&str, f64)| LinkDescription {
        name: name.into(),
        inertia: (mass > 0.0).then_some(Inertia { mass, com, tensor }),
    };
    let joint = |(name, from, to)| JointDescription::new(name, JointKind::Revolute, from, to);
    let links = [("base", 0.0), ("upper", 3.0), ("fore", fore)];
    let joints = [("shoulder", "base", "upper"), ("elbow", "upper", "fore")];
    let mut description = RobotDescription {
        name: "arm".into(),
        gravity: [0.0, -9.81, 0.0],
        links: links.map(link).to_vec(),
        joints: joints.map(joint).to_vec(),
        allow_unphysical: false,
    };
    description.joints[1].placement.translation = com;
    Ok(Robot::new(description, &Default::default())?.0)
}

/// 20 s at 100 Hz of `real` on a sweep, with a hidden ΔL = 0.8 sin(q1 − q2) and noise of 0.1 N·m.
pub(crate) fn log(name: &str, phase: f64, real: &Robot, noise: &mut Random) -> Recording {
    let (mut workspace, mut tau) = (Workspace::new(real), [0.0; 2]);
    let mut channels = [[(); 4]; 2].map(|joint| joint.map(|()| Vec::new()));
    let time: Vec<f64> = (0..2000).map(|i| 0.01 * f64::from(i)).collect();
    for t in &time {
        let state = [1.0, 1.7].map(|w| [phase + w * t + 0.05 * t * t, w + 0.1 * t]);
        let q = state.map(|[a, _]| a.sin());
        let qd = state.map(|[a, rate]| rate * a.cos());
        let qdd = state.map(|[a, rate]| 0.1 * a.cos() - rate * rate * a.sin());
        inverse_dynamics(real, &mut workspace, &q, &qd, &qdd, &mut tau);
        let hidden = 0.8 * (q[0] - q[1]).cos();
        tau[0] += 0.1 * noise.normal() - hidden;
        tau[1] += 0.1 * noise.normal() + hidden;
        for (j, joint) in channels.iter_mut().enumerate() {
            let values = [q[j], qd[j], qdd[j], tau[j]];
            for (all, value) in joint.iter_mut().zip(values) {
                all.push(value);
            }
        }
    }
    let joints = channels.map(|[q, qd, qdd, tau]| {
        let [qd, qdd, tau] = [qd, qdd, tau].map(Some);
        Channels {
            q,
            qd,
            qdd,
            tau,
            temperature: None,
        }
    });
    let (name, joints) = (name.into(), joints.to_vec());
    Recording {
        unfolded: false,
        start_ns: 0,
        name,
        time,
        joints,
        payload: Payload::None,
    }
}

/// The model believes in 2 kg at the tip; the arm carries 2.6 kg, and something unknown acts.
pub(crate) fn study() -> twincal::Result<Calibration> {
    let (nominal, real, mut noise) = (arm(2.0)?, arm(2.6)?, Random::new(1, 0));
    let training = log("training", 0.3, &real, &mut noise);
    let heldout = log("held-out", 1.9, &real, &mut noise);
    let mut settings = CalibrationSettings::default();
    settings.library.terms = vec!["sin(q1 - q2)".into()];
    settings.library.families = vec![Family::Payload, Family::Viscous, Family::MotorInertia];
    settings.signal.cutoff_hz = Auto::Value(0.0); // exact motion: nothing to filter
    let result = calibrate(&nominal, &[training], &[heldout], &settings, &|_| {})?;
    Ok(result)
}

fn main() -> twincal::Result<()> {
    let result = study()?;
    for found in result.components.iter().filter(|found| found.is_in()) {
        println!("PIP {:.3}  {}", found.pip.unwrap_or(0.0), found.words);
    }
    let scores = &result.validation.filtered;
    let (before, after) = (scores.rmse_nominal, scores.rmse_calibrated);
    println!("held-out RMSE {before:.3} → {after:.3} N·m");
    println!("95 % interval: {:.3} of torque", scores.coverage95);
    Ok(())
}
