//! Whether the torque of several logs has one unit, by its size in their statistics.

use super::log_statistics::{LogStatistics, Statistics};
use crate::error::{Error, Result};
use crate::words::significant;

/// Factor between the torque of a log and that of the others which no motion makes on all joints.
const ODD: f64 = 30.0;
/// The same on one joint: it moves in all of these logs, so that friction is in its torque.
const ODD_JOINT: f64 = 1000.0;
/// Share of the rows in which a joint moves, from which its torque is compared.
const MOVES: f64 = 0.1;

/// Size of each joint's torque in a log.
struct Sizes<'a> {
    log: &'a str,
    /// Root mean square, N·m or N; `None` for a joint without torque.
    rms: Vec<Option<f64>>,
    /// Where the joint moves.
    moves: Vec<bool>,
}

/// Torque that the other logs contradict.
struct Odd {
    times: f64,
    /// Of all joints where there is none.
    joint: Option<usize>,
}

impl<'a> Sizes<'a> {
    fn of(log: &'a LogStatistics) -> Self {
        let rows = log.sums.rows.iter().sum::<usize>() as f64;
        let moves = log.sums.joints.iter().map(|joint| {
            let moving: f64 = joint.blocks.iter().map(|own| own.gram.n).sum();
            moving > MOVES * rows
        });
        let rms = log.row_torque_rms().into_iter();
        Self {
            log: log.name(),
            rms: rms.map(|rms| rms.filter(|rms| *rms > 0.0)).collect(),
            moves: moves.collect(),
        }
    }

    /// What is odd against the usual torque of each joint: the median of all logs, or that of the other one of a `pair`. All joints count
    /// together, those that hold a weight as well; one alone only where it moves.
    fn odd(&self, usual: &Usual, pair: bool) -> Option<Odd> {
        let ratio = |joint: usize| Some((joint, self.rms[joint]? / usual.all[joint]?));
        let ratios: Vec<(usize, f64)> = (0..self.rms.len()).filter_map(ratio).collect();
        // The larger one of two is named.
        let beyond = |ratio: f64, limit: f64| ratio > limit || !pair && ratio < 1.0 / limit;
        let one_way = |large: bool| ratios.iter().all(|(_, ratio)| (*ratio > 1.0) == large);
        let all_odd = ratios.iter().all(|(_, ratio)| beyond(*ratio, ODD));
        if ratios.len() > 1 && all_odd && (one_way(true) || one_way(false)) {
            let mean =
                ratios.iter().map(|(_, ratio)| ratio.ln()).sum::<f64>() / ratios.len() as f64;
            return Some(Odd {
                times: mean.exp(),
                joint: None,
            });
        }
        let moving = |joint: usize| {
            let rms = self.rms[joint].filter(|_| self.moves[joint])?;
            Some((joint, rms / usual.moving[joint]?))
        };
        let odd = (0..self.rms.len())
            .filter_map(moving)
            .find(|(_, ratio)| beyond(*ratio, ODD_JOINT));
        odd.map(|(joint, times)| Odd {
            times,
            joint: Some(joint),
        })
    }
}

/// Usual torque of each joint, of all logs with torque and of those in which it moves.
struct Usual {
    all: Vec<Option<f64>>,
    moving: Vec<Option<f64>>,
}

impl Usual {
    /// Medians over these logs.
    fn of(logs: &[&Sizes<'_>], joints: usize) -> Self {
        let medians = |counts: &dyn Fn(&Sizes<'_>, usize) -> bool| {
            let median = |joint: usize| {
                let own = logs.iter().filter(|own| counts(own, joint));
                let mut sizes: Vec<f64> = own.filter_map(|own| own.rms[joint]).collect();
                sizes.sort_by(f64::total_cmp);
                sizes.get(sizes.len() / 2).copied()
            };
            (0..joints).map(median).collect()
        };
        Self {
            all: medians(&|_, _| true),
            moving: medians(&|own, joint| own.moves[joint]),
        }
    }
}

/// # Errors
/// [`Error::Statistics`] without logs, and for a log whose torque is of another size than that of the others, on every joint that moves or on one.
pub(super) fn require_like(statistics: &Statistics) -> Result<()> {
    let all: Vec<Sizes<'_>> = statistics.logs.iter().map(Sizes::of).collect();
    let (problem, remedy) = if all.is_empty() {
        let remedy = "give statistics of one log at least";
        ("no log".to_owned(), remedy)
    } else if let Some(problem) = problem(&all, &statistics.robot.joint_names()) {
        let remedy = "leave the log out, or make its statistics with its unit of torque";
        (problem, remedy)
    } else {
        return Ok(());
    };
    Err(Error::Statistics {
        problem,
        remedy: remedy.into(),
    })
}

/// The first log whose torque is odd, and against what.
fn problem(all: &[Sizes<'_>], joints: &[&str]) -> Option<String> {
    let (own, odd) = match all {
        [one, other] => [(one, other), (other, one)]
            .into_iter()
            .find_map(|(own, other)| {
                let usual = Usual::of(&[other], joints.len());
                Some((own, own.odd(&usual, true)?))
            })?,
        _ => {
            let usual = Usual::of(&all.iter().collect::<Vec<_>>(), joints.len());
            all.iter()
                .find_map(|own| Some((own, own.odd(&usual, false)?)))?
        }
    };
    let others = match all {
        [one, other] => format!(
            "log `{}`",
            if one.log == own.log {
                other.log
            } else {
                one.log
            }
        ),
        _ => "the others".into(),
    };
    let joints = odd.joint.map(|joint| format!("joint `{}`", joints[joint]));
    Some(format!(
        "the torque of log `{}` is {} times that of {others} on {}",
        own.log,
        significant(odd.times, 2),
        joints.as_deref().unwrap_or("every joint")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn said(logs: &[[f64; 2]], wanted: Option<&str>) {
        let names = ["a", "b", "c", "d"];
        let sizes = |(log, rms): (&'static str, &[f64; 2])| Sizes {
            log,
            rms: rms.iter().map(|rms| (*rms > 0.0).then_some(*rms)).collect(),
            moves: vec![true; 2],
        };
        let all: Vec<Sizes<'_>> = names.into_iter().zip(logs).map(sizes).collect();
        assert_eq!(problem(&all, &["hip", "knee"]).as_deref(), wanted);
    }

    #[test]
    fn one_of_two_logs_with_another_unit_is_named_with_the_other() {
        let wanted = "the torque of log `b` is 2.0e7 times that of log `a` on every joint";
        said(&[[3.0, 2.0], [6e7, 4e7]], Some(wanted));
        let wanted = "the torque of log `a` is 2.0e7 times that of log `b` on every joint";
        said(&[[6e7, 4e7], [3.0, 2.0]], Some(wanted));
        let wanted = "the torque of log `b` is 20000 times that of log `a` on joint `knee`";
        said(&[[3.0, 2.0], [4.0, 4e4]], Some(wanted));
        said(&[[3.0, 2.0], [60.0, 80.0]], None);
    }

    #[test]
    fn one_of_several_logs_is_named_and_the_joint_where_it_is_one() {
        let usual = [[3.0, 2.0], [4.0, 1.0]];
        let with = |own: [f64; 2]| [&usual[..], &[own]].concat();
        let wanted = "the torque of log `c` is 40 times that of the others on every joint";
        said(&with([160.0, 80.0]), Some(wanted));
        let wanted = "the torque of log `c` is 1.0e-6 times that of the others on joint `hip`";
        said(&with([3e-6, 1.0]), Some(wanted));
        let wanted = "the torque of log `c` is 1.5e6 times that of the others on joint `knee`";
        said(&with([3.0, 3e6]), Some(wanted));
    }

    /// A joint that turns slowly in one log and fast in the other, beside one that holds a weight in both.
    #[test]
    fn a_joint_that_holds_a_weight_says_that_the_unit_is_one() {
        let log = |log: &'static str, yaw: f64| Sizes {
            log,
            rms: vec![Some(yaw), Some(30.0)],
            moves: vec![true, false],
        };
        let all = [log("slow", 0.1), log("fast", 31.5)];
        assert_eq!(problem(&all, &["yaw", "pitch"]), None);
    }

    /// A heavy load, a joint that stands still, and logs of which none has the torque of another.
    #[test]
    fn other_motion_is_no_other_unit() {
        said(&[[3.0, 2.0]], None);
        said(&[[3.0, 2.0], [3.0, 400.0], [4.0, 1.0]], None);
        said(&[[3.0, 0.0], [0.0, 400.0], [4.0, 0.0]], None);
        said(&[[3.0, 0.0], [0.0, 400.0]], None);
    }
}
