//! What the verdict rests on, a sentence each: error of held-out torque, what friction alone would leave, intervals, effects.

use super::figures::inclusion::family_name;
use super::limits::other_shares;
use super::standstill::at_standstill;
use super::status::with;
use super::text::{count, first_of, list, number, percent};
use super::view::{Joint, pooled_unit, unit_of};
use twincal::Code;
use twincal::assess::{
    FEW, all_at_rest, decisive, friction_only, has_standstill, independent_rows, rest_got_worse,
    rows_of,
};
use twincal::calibrate::{Calibration, ComponentSummary, Status};
use twincal::validate::{JointScore, Scores, Split};

/// Change of an error from which other rows are told apart.
pub(super) const WORTH_TELLING: f64 = 0.05;
/// The same of unfiltered torque, which has noise that no twin explains.
const UNFILTERED_WORTH_TELLING: f64 = 0.25;
/// The same of the share of rows that intervals hold.
const SHARE_WORTH_TELLING: f64 = 0.01;
/// Held-out time that is told because it is short, s.
const SHORT: f64 = 30.0;
/// Share of the intervals' width that would have done from which they are called too wide, and the share of rows that they then hold.
const MUCH_TOO_WIDE: f64 = 0.5;
const SHARE_ALL: f64 = 0.99;
/// Joints that are named; the others are counted.
pub(super) const NAMED: usize = 3;

pub(super) fn grounds(calibration: &Calibration, joints: &[Joint<'_>]) -> Vec<String> {
    let mut out = vec![torque_error(calibration, joints)];
    out.extend(unfiltered(calibration, joints));
    // Where it got worse it is among what to mind.
    out.extend(at_standstill(calibration, joints).filter(|_| !rest_got_worse(calibration)));
    out.extend(friction_alone(calibration, joints));
    out.push(held(calibration));
    out.extend(effects_found(calibration));
    out
}

/// "13.8 → 0.710 N·m, 94.9 % less".
pub(super) fn change([before, after]: [f64; 2], unit: &str) -> String {
    let way = match after / before - 1.0 {
        c if c.abs() < 5e-4 => "unchanged".into(),
        c if c < 0.0 => format!("{} less", percent(-c)),
        c => format!("{} more", percent(c)),
    };
    format!("{} → {} {unit}, {way}", number(before, 3), number(after, 3))
}

/// " below 5 Hz"; nothing without a filter.
pub(super) fn below_cutoff(calibration: &Calibration) -> String {
    match calibration.twin.pipeline.cutoff_hz {
        cutoff if cutoff > 0.0 => format!(" below {} Hz", (100.0 * cutoff).round() / 100.0),
        _ => String::new(),
    }
}

/// RMSE before and after, of joints that move, for what the filter lets pass.
fn torque_error(calibration: &Calibration, joints: &[Joint<'_>]) -> String {
    let validation = &calibration.validation;
    let judged = decisive(validation);
    let split = match validation.split {
        Split::HeldoutLogs => "held-out logs",
        Split::LeaveOneLogOut => "logs left out one at a time, by fits of the others",
        Split::LeaveLogGroupsOut => "logs left out in five groups, by fits of the others",
        Split::LastThirty => match calibration.logs.len() {
            1 => "the last 30 % of the log, by a fit of the rest",
            _ => "the last 30 % of each log, by a fit of the rest",
        },
        Split::NotTested => "nothing was held out",
    };
    let below = below_cutoff(calibration);
    let which = match has_standstill(validation) {
        true => "; joints that move",
        false => "",
    };
    let mut findings = calibration.findings.iter();
    let which = match findings.any(|f| f.code == Code::UrdfDynamics) {
        true => format!("{which}; your model without the friction that its file states"),
        false => which.to_owned(),
    };
    let unit = pooled_unit(joints);
    let told = change([judged.rmse_nominal, judged.rmse_calibrated], unit);
    format!("Torque error (RMSE){below} on {split}{which}: {told}.")
}

/// The same of torque as it was logged, of moving joints as well, where that is another matter: "Unfiltered, … : 0.959 → 0.373 N·m; there Joint1 has
/// 0.467 left, 136 % of its torque's standard deviation."
fn unfiltered(calibration: &Calibration, joints: &[Joint<'_>]) -> Option<String> {
    if below_cutoff(calibration).is_empty() {
        return None;
    }
    let unit = pooled_unit(joints);
    let validation = &calibration.validation;
    let judged = decisive(validation);
    // Results of earlier versions do not have it; there rows at standstill are in it.
    let known = rows_of(&validation.raw_moving) > 0;
    let (raw, which) = match (known, has_standstill(validation)) {
        (true, true) => (&validation.raw_moving, ""),
        (_, false) => (&validation.raw, ""),
        (false, true) => (&validation.raw, " (standstill with it)"),
    };
    let lost: Vec<String> = (raw.joints.iter())
        .filter(|j| j.rows > 0 && j.rmse_calibrated > j.torque_sd)
        .map(|j| {
            let share = percent(j.rmse_calibrated / j.torque_sd);
            let error = number(j.rmse_calibrated, 3);
            format!(
                "{} has {error} left, {share} of its torque's standard deviation",
                j.joint
            )
        })
        .collect();
    let apart = (raw.rmse_calibrated / judged.rmse_calibrated - 1.0).abs();
    let worth_telling = apart > UNFILTERED_WORTH_TELLING || !lost.is_empty();
    (rows_of(raw) > 0 && worth_telling).then(|| {
        // The filter has no rows for half its window at both ends: much of a short log.
        let ends = match held_out_seconds(calibration) < SHORT {
            true => ", the log's ends too",
            false => "",
        };
        let lost = match lost.is_empty() {
            true => String::new(),
            false => format!("; there {}", list(&lost)),
        };
        format!(
            "Unfiltered, as it was logged and as `twincal predict` gives it (noise of torque and motion included{ends}){which}: {} → {} {unit}{lost}.",
            number(raw.rmse_nominal, 3),
            number(raw.rmse_calibrated, 3)
        )
    })
}

/// What the first thing that anybody adds to a model would leave: errors of a model without friction are large by that alone.
fn friction_alone(calibration: &Calibration, joints: &[Joint<'_>]) -> Option<String> {
    let scores = decisive(&calibration.validation);
    let left = friction_only(scores)?;
    let told = format!("{} {}", number(left, 3), pooled_unit(joints));
    Some(match left > scores.rmse_nominal {
        false => {
            let (worse, _) = with_friction(scores, joints);
            let worse = match worse.is_empty() {
                true => String::new(),
                false => format!("; such a fit is worse than your model on {}", list(&worse)),
            };
            format!("Viscous and Coulomb friction and an offset alone would leave {told}{worse}.")
        }
        true => {
            let (worse, better) = with_friction(scores, joints);
            let better = match better {
                0 => String::new(),
                1 => "; better on one joint".into(),
                n => format!("; better on {n} joints"),
            };
            format!(
                "Viscous and Coulomb friction and an offset alone, fitted to the training rows, would leave {told}, more than your model does: \
                 worse on {}{better}.",
                list(&worse)
            )
        }
    })
}

/// Joints on which friction alone would be worse than the model, the worst first, and the number of the others.
fn with_friction(scores: &Scores, joints: &[Joint<'_>]) -> (Vec<String>, usize) {
    let own = scores.joints.iter().filter(|joint| joint.rows > 0);
    let own = own.filter_map(|joint| Some((joint, joint.rmse_friction?)));
    let (mut worse, better): (Vec<_>, Vec<_>) =
        own.partition(|(joint, left)| *left > joint.rmse_nominal);
    let growth = |(joint, left): &(&JointScore, f64)| left - joint.rmse_nominal;
    worse.sort_by(|a, b| growth(b).total_cmp(&growth(a)));
    let named = worse.iter().map(|(joint, left)| {
        let unit = unit_of(joints, &joint.joint);
        format!(
            "{} ({} → {} {unit})",
            joint.joint,
            number(joint.rmse_nominal, 3),
            number(*left, 3)
        )
    });
    (first_of(named.collect(), NAMED), better.len())
}

/// How much the 95 % intervals hold: of moving joints, and of all rows where some stand still.
fn held(calibration: &Calibration) -> String {
    let all = &calibration.validation.filtered;
    let judged = decisive(&calibration.validation);
    let (rows, share) = (count(rows_of(judged)), percent(judged.coverage95));
    let seconds = held_out_seconds(calibration);
    let short = match seconds < SHORT {
        true => format!(" ({} s of log)", number(seconds, 2)),
        false => String::new(),
    };
    // Where all is inside, that is no praise.
    let factor = calibration.validation.conformal.as_ref().map(|c| c.factor);
    let enough = independent_rows(calibration) >= FEW;
    let wide = match factor.filter(|f| *f < MUCH_TOO_WIDE && judged.coverage95 > SHARE_ALL) {
        Some(factor) if enough => format!(
            ": they are wider than they need to be, {} of their width would have done",
            percent(factor)
        ),
        Some(factor) => format!(
            "; {} of their width would have done for these few",
            percent(factor)
        ),
        None => String::new(),
    };
    let single = match other_shares(calibration) {
        Some(told) => format!(" On single joints, {told}."),
        None => String::new(),
    };
    if !has_standstill(&calibration.validation) {
        return format!(
            "The 95 % intervals contain {share} of the {rows} held-out values{short}{wide}.{single}"
        );
    }
    let differ = (judged.coverage95 - all.coverage95).abs() > SHARE_WORTH_TELLING;
    let all = match differ {
        true => format!(
            ", and {} of the {} at standstill, where they are widened",
            percent(all_at_rest(&calibration.validation).map_or(f64::NAN, |own| own.coverage95)),
            count(rows_of(all).saturating_sub(rows_of(judged)))
        ),
        false => String::new(),
    };
    format!(
        "The 95 % intervals contain {share} of the {rows} held-out values of moving joints{short}{all}{wide}.{single}"
    )
}

/// From the first held-out row to the last, in s.
pub(super) fn held_out_seconds(calibration: &Calibration) -> f64 {
    let scores = &calibration.validation.filtered;
    let rows = scores.joints.iter().map(|joint| joint.rows).max();
    rows.unwrap_or(0).saturating_sub(1) as f64 / calibration.kept_rate_hz()
}

/// Effects up to this number are named; more are counted by family.
const FEW_EFFECTS: usize = 3;

/// "Established: viscous friction (6) and payload.", the equivalent sets and the tentative effects.
pub(super) fn effects_found(calibration: &Calibration) -> Vec<String> {
    let established = with(Status::Established, calibration);
    let mut out = vec![match established.len() {
        0 => "No effect is established.".into(),
        _ => format!("Established: {}.", by_family(&established)),
    }];
    let name = |own: &&ComponentSummary| own.name.clone();
    let is_equivalent = |name: &String| {
        let mut all = calibration.components.iter();
        all.any(|own| own.name == *name && own.status == Status::Equivalent)
    };
    let sets = calibration.groups.iter();
    let sets = sets.filter(|group| group.members.iter().any(is_equivalent));
    let sets: Vec<String> = sets.map(|group| group.members.join(" or ")).collect();
    let tentative = with(Status::Tentative, calibration);
    let tentative: Vec<String> = tentative.iter().map(name).collect();
    for (word, all) in [("Equivalent", sets), ("Tentative", tentative)] {
        if !all.is_empty() {
            out.push(format!("{word}: {}.", list(&first_of(all, NAMED))));
        }
    }
    out
}

fn by_family(effects: &[&ComponentSummary]) -> String {
    if effects.len() <= FEW_EFFECTS {
        let names: Vec<&str> = effects.iter().map(|own| own.name.as_str()).collect();
        return list(&names);
    }
    let kinds = effects.chunk_by(|a, b| a.family == b.family);
    let kinds: Vec<String> = kinds
        .map(|own| format!("{} ({})", family_name(own[0].family), own.len()))
        .collect();
    list(&kinds)
}

#[cfg(test)]
mod tests {
    use super::super::verdict::tests::judged;
    use super::*;
    use twincal::{Code, Finding, Severity};

    /// Standstill rows as many as moving ones: of these the mean square is 4 before and 0.25 after; at rest `still` before and after, joint by joint.
    fn with_standstill(c: &mut Calibration, still: [[f64; 2]; 2]) {
        c.validation.moving = c.validation.filtered.clone();
        for joint in &mut c.validation.moving.joints {
            (joint.rows, joint.rmse_nominal, joint.rmse_calibrated) = (50, 2.0, 0.5);
        }
        for (joint, [before, after]) in c.validation.filtered.joints.iter_mut().zip(still) {
            joint.rows = 100;
            joint.rmse_nominal = (0.5f64 * (4.0 + before)).sqrt();
            joint.rmse_calibrated = (0.5f64 * (0.25 + after)).sqrt();
        }
        let all = &mut c.validation.filtered;
        (all.rmse_nominal, all.rmse_calibrated) = (1.6, 2.2);
        let moving = &mut c.validation.moving;
        (moving.rmse_nominal, moving.rmse_calibrated) = (2.0, 0.5);
        c.validation.raw_moving = moving.clone();
    }

    #[test]
    fn rows_at_standstill_are_told_apart_and_joints_that_got_worse_are_named() {
        let verdict = |still: [[f64; 2]; 2]| judged(|c| with_standstill(c, still));
        let of = |still: [[f64; 2]; 2]| verdict(still).grounds;
        let both = of([[1.0, 0.25], [1.0, 9.0]]);
        let moving = "below 10 Hz on logs left out one at a time, by fits of the others; joints that move: 2.00 → 0.500 N·m, 75.0\u{202f}% less.";
        assert!(both[0].ends_with(moving), "{both:?}");
        // The mean squares are 1 before and 4.625 after.
        let still = "At standstill: 1.00 → 2.15 N·m, 115.1\u{202f}% more; worse on elbow (1.00 → 3.00 N·m).";
        // What got worse is to be minded.
        assert!(
            verdict([[1.0, 0.25], [1.0, 9.0]])
                .limits
                .contains(&still.to_owned())
        );
        assert!(!both[1].contains("standstill"), "{both:?}");
        let better = of([[1.0, 0.25], [1.0, 0.25]]);
        assert_eq!(
            better[1],
            "At standstill: 1.00 → 0.500 N·m, 50.0\u{202f}% less."
        );
        let one = judged(|c| {
            with_standstill(c, [[1.0, 9.0]; 2]);
            c.validation.filtered.joints[0] = c.validation.moving.joints[0].clone();
        });
        let said = "At standstill (elbow): 1.00 → 3.00 N·m, 200.0\u{202f}% more.";
        assert!(one.limits.contains(&said.to_owned()), "{one:?}");
        let few = judged(|c| {
            with_standstill(c, [[1.0, 9.0]; 2]);
            c.validation
                .moving
                .joints
                .iter_mut()
                .for_each(|j| j.rows = 91);
        });
        assert!(!few.grounds.iter().any(|g| g.contains("standstill")));
        let none = judged(|c| {
            with_standstill(c, [[1.0, 9.0]; 2]);
            let moving = &mut c.validation.moving;
            moving.joints.iter_mut().for_each(|joint| joint.rows = 0);
        });
        assert!(!none.grounds.iter().any(|g| g.contains("standstill")));
    }

    #[test]
    fn the_unfiltered_error_stands_beside_where_it_is_another_matter() {
        let of = |rmse: f64, sd: f64, cutoff: f64| {
            let change = |c: &mut Calibration| {
                c.twin.pipeline.cutoff_hz = cutoff;
                let raw = &mut c.validation.raw;
                (raw.rmse_nominal, raw.rmse_calibrated) = (0.959, rmse);
                (raw.joints[1].rmse_calibrated, raw.joints[1].torque_sd) = (0.4, sd);
            };
            judged(change).grounds
        };
        let told = of(0.373, 0.39, 5.0);
        let said = "Unfiltered, as it was logged and as `twincal predict` gives it (noise of torque and motion included): 0.959 → 0.373 N·m; there elbow has 0.400 left, 102.6\u{202f}% of its torque's standard deviation.";
        assert_eq!(told[1], said);
        assert!(told[0].starts_with("Torque error (RMSE) below 5 Hz on"));
        assert!(of(0.373, 0.41, 5.0)[1].ends_with("0.959 → 0.373 N·m."));
        let nothing_of_it = |told: &[String]| told.iter().all(|one| !one.contains("nfiltered"));
        assert!(nothing_of_it(&of(0.09, 0.41, 5.0)));
        // Without a filter they are the same.
        let same = of(0.373, 0.39, 0.0);
        assert!(nothing_of_it(&same) && !same[0].contains("below"));
    }

    #[test]
    fn friction_alone_and_short_tests_are_told() {
        let grounds = judged(|c| {
            for (joint, left) in c.validation.filtered.joints.iter_mut().zip([0.3, 0.4]) {
                (joint.rows, joint.rmse_friction) = (100, Some(left));
            }
        })
        .grounds;
        // √((0.09 + 0.16)/2).
        let said = "Viscous and Coulomb friction and an offset alone would leave 0.354 N·m.";
        assert_eq!(grounds[1], said);
        let worse = judged(|c| {
            let joints = &mut c.validation.filtered.joints;
            joints
                .iter_mut()
                .for_each(|joint| joint.rmse_friction = Some(9.0));
        });
        let said = "Viscous and Coulomb friction and an offset alone, fitted to the training rows, would leave 9.00 N·m, more than your model does: worse on elbow (0.431 → 9.00 N·m) and shoulder (0.715 → 9.00 N·m).";
        assert_eq!(worse.grounds[1], said);
        let one = judged(|c| {
            let joints = &mut c.validation.filtered.joints;
            (joints[0].rmse_friction, joints[1].rmse_friction) = (Some(0.01), Some(9.0));
            c.findings = vec![Finding::new(
                Severity::Note,
                Code::UrdfDynamics,
                "elbow",
                "",
                0,
            )];
        });
        assert!(
            one.grounds[0].contains("; your model without the friction that its file states: ")
        );
        assert!(
            one.grounds[1].ends_with("worse on elbow (0.431 → 9.00 N·m); better on one joint."),
            "{one:?}"
        );
        let better = judged(|c| {
            let joints = &mut c.validation.filtered.joints;
            joints
                .iter_mut()
                .for_each(|joint| joint.rmse_friction = Some(0.01));
        });
        assert!(
            better.headline.starts_with("Hardly: friction"),
            "{better:?}"
        );
        assert!(
            grounds[2].ends_with("of the 200 held-out values (4.0 s of log)."),
            "{grounds:?}"
        );
        let grounds = judged(|c| c.validation.filtered.joints[0].rmse_friction = None).grounds;
        assert!(
            !grounds
                .iter()
                .any(|g| g.contains("offset alone") || g.contains("s of log"))
        );
    }

    #[test]
    fn intervals_that_hold_everything_say_how_much_of_them_would_have_done() {
        let told = |factor: f64, coverage: f64, memory: f64| {
            let told = judged(|c| {
                c.validation.conformal.as_mut().unwrap().factor = factor;
                c.validation.filtered.coverage95 = coverage;
                for noise in &mut c.noise {
                    noise.autocorrelation_time *= memory;
                }
            });
            let held = told
                .grounds
                .into_iter()
                .find(|g| g.starts_with("The 95 % intervals"));
            held.unwrap_or_default()
        };
        let of = |factor: f64, coverage: f64| told(factor, coverage, 1.0);
        let said =
            ": they are wider than they need to be, 33.6\u{202f}% of their width would have done.";
        assert!(of(0.336, 1.0).ends_with(said), "{}", of(0.336, 1.0));
        assert!(!of(0.6, 1.0).contains("wider") && !of(0.336, 0.98).contains("wider"));
        let few = told(0.336, 1.0, 1000.0);
        let said = "; 33.6\u{202f}% of their width would have done for these few.";
        assert!(few.ends_with(said), "{few}");
    }

    #[test]
    fn effects_are_told_by_status() {
        use twincal::calibrate::{Alike, Group};
        let of = |change: &dyn Fn(&mut Calibration)| {
            let told = judged(change).grounds;
            let from = told.iter().position(|t| t.contains("stablished"));
            told[from.unwrap()..].to_vec()
        };
        let all = of(&|_| ());
        assert!(
            all.len() == 1 && all[0].starts_with("Established: "),
            "{all:?}"
        );
        let none = of(&|c| {
            let found = c.components.iter_mut().filter(|own| own.is_in());
            found.for_each(|own| own.status = Status::Tentative);
        });
        assert_eq!(none[0], "No effect is established.");
        assert!(none[1].starts_with("Tentative: ") && none[1].ends_with("and 4 more."));
        let set = of(&|c| {
            let found = c.components.iter_mut().find(|own| own.is_in()).unwrap();
            found.status = Status::Equivalent;
            c.groups = vec![Group {
                members: vec![found.name.clone(), "a.tensor".into()],
                pip: 0.98,
                alike: Alike::EveryMotion,
                settled: false,
                words: String::new(),
            }];
        });
        assert!(set[1].starts_with("Equivalent: ") && set[1].ends_with(" or a.tensor."));
    }
}
