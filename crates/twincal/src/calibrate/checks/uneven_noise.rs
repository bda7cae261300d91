//! Does the noise of a joint change with its speed or load? Said where it does and the fit assumes that it does not.

use crate::calibrate::fit::weigh::{MovingRow, moving};
use crate::error::{Code, Finding, Severity};
use crate::likelihood::{NoiseSettings, Profile};
use crate::observations::Part;
use crate::plug_in::{Fit, residual_correlation_time};
use crate::robot::Robot;

/// Ratio of the largest to the smallest noise sd from which it is worth a word.
const WORTH: f64 = 2.0;

/// What noise may change with.
struct Cause {
    code: Code,
    /// "at some speeds than at others".
    words: &'static str,
    key: &'static str,
    value: fn(&MovingRow) -> f64,
    allowed: fn(&NoiseSettings) -> bool,
}

static CAUSES: [Cause; 2] = [
    Cause {
        code: Code::NoiseVariesWithSpeed,
        words: "at some speeds than at others",
        key: "noise.varies_with_speed",
        value: |row| row.speed,
        allowed: |noise| noise.varies_with_speed,
    },
    Cause {
        code: Code::NoiseVariesWithLoad,
        words: "under some loads than under others",
        key: "noise.varies_with_load",
        value: |row| row.load,
        allowed: |noise| noise.varies_with_load,
    },
];

/// One finding for all joints whose residual is much larger at some speeds than at others, and one for loads, beyond what rows are weighed
/// for already.
pub(in crate::calibrate) fn findings(
    robot: &Robot,
    fit: &Fit,
    training: &[Part<'_>],
    noise: NoiseSettings,
) -> Vec<Finding> {
    let mut found: [Vec<(&str, f64)>; 2] = Default::default();
    for (joint, name) in robot.joint_names().into_iter().enumerate() {
        let memory = residual_correlation_time(training, joint, &fit.posterior.mean);
        let rows = moving(training, joint, &fit.posterior.mean);
        let open = found.iter_mut().zip(&CAUSES);
        for (found, cause) in open.filter(|(_, cause)| !(cause.allowed)(&noise)) {
            let even = |row: &MovingRow| row.residual / row.spread.sqrt();
            let pairs = rows.iter().map(|row| ((cause.value)(row), even(row)));
            if let Some(profile) = Profile::of_rows(pairs.collect(), memory)
                && profile.ratio() > WORTH
            {
                found.push((name, profile.ratio()));
            }
        }
    }
    let all = found.into_iter().zip(&CAUSES);
    all.filter_map(|(found, cause)| finding(found, cause))
        .collect()
}

fn finding(mut found: Vec<(&str, f64)>, cause: &Cause) -> Option<Finding> {
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    let (name, ratio) = found.first()?;
    let others = match found.len() {
        1 => String::new(),
        n => format!(" (and {} more)", n - 1),
    };
    let Cause {
        code, words, key, ..
    } = cause;
    Some(Finding::new(
        Severity::Note,
        *code,
        *name,
        format!(
            "joint `{name}`{others}: what is left is {ratio:.1} times larger {words}; intervals are too wide at \
             some and too narrow at others; try {key} = true, and keep it where the held-out error does not grow"
        ),
        found.len() as u64,
    )
    .with([("ratio", *ratio)]))
}
