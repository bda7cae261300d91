//! Broken logs, one test per numbered case of the fault list: what is refused, what goes on, and what is said.

mod clock;
mod text;
mod values;

use crate::common::logs::{arm, motion};
use crate::common::refusals::{contains, refused};
use twincal::Finding;
use twincal::signal::{Auto, Recording, SignalSettings, Trajectory, align, choose_pipeline};
use twincal_io::Result;
use twincal_io::log::{LogOptions, read_csv};

const AUTO: SignalSettings = SignalSettings {
    cutoff_hz: Auto::Auto,
    rate_hz: Auto::Auto,
    coulomb_velocity: None,
    corrections: twincal::signal::Corrections {
        lag: twincal::signal::Lag::Unsaid,
        velocity: None,
    },
    every_sample: false,
};

fn options() -> LogOptions {
    LogOptions::default()
}

fn read(text: &str) -> Result<(Recording, Vec<Finding>)> {
    read_bytes(text.as_bytes(), &options())
}

fn read_bytes(bytes: &[u8], options: &LogOptions) -> Result<(Recording, Vec<Finding>)> {
    read_csv(bytes, bytes.len() as u64, "run.csv", &arm(), options)
}

/// The whole way to a trajectory with the automatic pipeline, with everything that was said.
fn run(text: &str) -> Result<(Trajectory, Vec<Finding>)> {
    let (recording, mut findings) = read(text)?;
    let logs = [recording];
    let (pipeline, said) = choose_pipeline(&arm(), &logs, &AUTO)?;
    findings.extend(said);
    let (trajectory, said) = align(&arm(), &logs[0], &pipeline)?;
    findings.extend(said);
    Ok((trajectory, findings))
}

fn says<'a>(findings: &'a [Finding], code: &str) -> &'a Finding {
    findings
        .iter()
        .find(|f| f.code.as_str() == code)
        .unwrap_or_else(|| panic!("no finding `{code}` in {findings:#?}"))
}

fn silent(findings: &[Finding], code: &str) {
    assert!(
        !findings.iter().any(|f| f.code.as_str() == code),
        "unexpected `{code}` in {findings:#?}"
    );
}

/// Motion of a trajectory is the truth everywhere, so nothing was differentiated across a cut.
#[track_caller]
fn is_true_motion(trajectory: &Trajectory, tolerance: f64, clock: impl Fn(f64) -> f64) {
    for segment in &trajectory.segments {
        let len = segment.time.len();
        for joint in 0..trajectory.dof {
            for i in 0..len {
                let [q, qd, qdd] = motion(joint, clock(segment.time[i]));
                let at = joint * len + i;
                let error = [
                    segment.q[at] - q,
                    (segment.qd[at] - qd) / 5.0,
                    (segment.qdd[at] - qdd) / 30.0,
                ];
                assert!(
                    error.iter().all(|e| e.abs() < tolerance),
                    "joint {joint} at {} s: {error:?}",
                    segment.time[i]
                );
            }
        }
    }
}
