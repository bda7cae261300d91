//! What a program loses because it knows one state and nothing of what was before.

use crate::error::{Code, Finding, Result, Severity};
use crate::signal::Warmth;
use crate::term::Family;
use crate::twin::Twin;
use crate::words::significant;

/// PIP from which a component is named.
const NAMED: f64 = 0.5;
/// Standard deviations of a logged temperature that are reckoned with.
const DEVIATIONS: f64 = 2.0;
/// Components that are named.
const MOST: usize = 4;

/// Largest factor of a column that changes with warmth on a joint: of the channel, and of the speed where friction grows with it.
fn warmth(twin: &Twin, joint: usize, name: &str) -> f64 {
    let history = twin.pipeline.history.get(joint);
    let channel = match history.and_then(|history| history.warmth) {
        // At most (t/T) e^(−t/T) is 1/e.
        Some(Warmth::Time { later_mean, .. }) if name.ends_with("_later") => {
            later_mean.max((-1.0_f64).exp() - later_mean)
        }
        Some(Warmth::Time { mean, .. }) => mean.max(1.0 - mean),
        Some(Warmth::Temperature { .. }) => DEVIATIONS,
        None => 0.0,
    };
    let [_, _, slowest, fastest, ..] = twin.hull[joint];
    let speed = slowest.abs().max(fastest.abs());
    channel
        * if name.contains(".viscous") {
            speed
        } else {
            1.0
        }
}

/// What programs of a twin leave out: they take friction with hysteresis as that of steady sliding, and friction that changes with warmth as
/// its mean. `None` where the twin remembers nothing.
///
/// # Errors
/// Those of [`Twin::library`].
pub fn forgotten(twin: &Twin) -> Result<Option<Finding>> {
    let (library, posterior) = (twin.library()?, &twin.posterior);
    let mut sizes = vec![(0.0, 0.0); library.components().len()];
    for (column, &term) in library.columns().iter().enumerate() {
        let own = &library.terms()[term];
        let most = match own.family {
            // Right after the reversal of a long way: e/r = -1 where the direction is +1.
            Family::Hysteresis => 2.0,
            Family::WarmUp => {
                let mut joints = 0..library.joints();
                let joint = joints.find(|joint| library.columns_of_joint(*joint).contains(&column));
                joint.map_or(0.0, |joint| warmth(twin, joint, &own.name))
            }
            _ => continue,
        };
        let (size, pip) = &mut sizes[own.component];
        *size += most * posterior.mean[column].abs();
        *pip = posterior.inclusion[column].max(*pip);
    }
    let named = library.components().iter().zip(&sizes);
    let named: Vec<String> = named
        .filter(|(_, (_, pip))| *pip >= NAMED)
        .map(|(component, (size, _))| {
            format!("`{}` by up to {}", component.name, significant(*size, 2))
        })
        .collect();
    let most = sizes.iter().filter(|(_, pip)| *pip >= NAMED);
    let most = most.map(|(size, _)| *size).fold(0.0, f64::max);
    let (Some(first), count) = (named.first(), named.len()) else {
        return Ok(None);
    };
    let shown = match count {
        1 => first.clone(),
        _ => named[..count.min(MOST)].join(", "),
    };
    let more = match count.saturating_sub(MOST) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    Ok(Some(Finding::new(
        Severity::Note,
        Code::ProgramForgets,
        "",
        format!(
            "the program knows one state and nothing of what was before: it takes friction as that of steady sliding at mean warmth, which is \
             off for {shown}{more} N·m (N), for some milliradians after a velocity reversal or in a cold robot; `twincal predict` follows the motion"
        ),
        count as u64,
    )
    .with([("largest", most)])))
}
