//! What the answer rests on, a sentence each: error of held-out torque, what friction alone would leave, intervals, effects.

use super::list::{first_of, list};
use super::number::{count, number, percent};
use super::units::{pooled_unit, unit_of};
use super::{NAMED, family_name, rest, with};
use twincal::Code;
use twincal::assess::{Assessment, Claim, has_standstill};
use twincal::calibrate::{Calibration, ComponentSummary, Status};
use twincal::robot::JointDescription;
use twincal::validate::Split;

/// Share of rows at standstill from which what intervals hold there is told apart.
const SHARE_WORTH_TELLING: f64 = 0.01;
/// Held-out time that is told because it is short, s.
const SHORT: f64 = 30.0;

pub(super) fn grounds(assessment: &Assessment, calibration: &Calibration) -> Vec<String> {
    let mut out: Vec<String> = torque_error(assessment, calibration).into_iter().collect();
    out.extend(as_logged(assessment, calibration));
    // Where it got worse it is among what to mind.
    out.extend(rest::error(
        assessment,
        calibration,
        &[Code::TorqueErrorAtRest],
    ));
    out.extend(friction_alone(assessment, calibration));
    out.extend(held(assessment));
    out.extend(effects_found(calibration));
    out
}

/// "13.8 → 0.710 N·m, 94.9 % less", of an error by the model alone and by the twin.
pub(super) fn change(claim: &Claim, unit: &str) -> String {
    let [before, after] = [claim.number("rms_nominal"), claim.number("rms_calibrated")];
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
fn torque_error(assessment: &Assessment, calibration: &Calibration) -> Option<String> {
    let claim = assessment.claims(Code::TorqueError).next()?;
    let split = match calibration.validation.split {
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
    let which = match has_standstill(&calibration.validation) {
        true => "; joints that move",
        false => "",
    };
    let before = before_calibration(calibration);
    let told = change(claim, pooled_unit(calibration));
    Some(format!(
        "Torque error (RMSE){below} on {split}{which}{before}: {told}."
    ))
}

/// What the torque error before calibration is of, behind the error: nothing where the model file states no friction beyond its torque.
#[must_use]
pub fn before_calibration(calibration: &Calibration) -> &'static str {
    let joints = &calibration.twin.robot.description().joints;
    let stated = |own: &JointDescription| own.unused_damping != 0.0 || own.unused_friction != 0.0;
    match joints.iter().any(stated) {
        true => "; before: your model without the friction that its file states",
        false => "",
    }
}

/// The same of torque as it was logged, of moving joints as well, where that is another matter: "Unfiltered, … : 0.959 → 0.373 N·m; there Joint1 has
/// 0.467 left, 136 % of its torque's standard deviation."
fn as_logged(assessment: &Assessment, calibration: &Calibration) -> Option<String> {
    let claim = assessment.claims(Code::RawTorqueError).next()?;
    let lost = assessment.claims(Code::JointRawErrorAboveTorque);
    let lost: Vec<String> = lost
        .map(|own| {
            let (error, sd) = (own.number("rms_calibrated"), own.number("torque_sd"));
            format!(
                "{} has {} left, {} of its torque's standard deviation",
                own.subject.name(),
                number(error, 3),
                percent(error / sd)
            )
        })
        .collect();
    // The filter has no rows for half its window at both ends: much of a short log.
    let ends = match over_all(assessment).is_some_and(|own| own.number("seconds") < SHORT) {
        true => ", the log's ends too",
        false => "",
    };
    let lost = match lost.is_empty() {
        true => String::new(),
        false => format!("; there {}", list(&first_of(lost, NAMED))),
    };
    Some(format!(
        "Unfiltered, as it was logged and as `twincal predict` gives it (noise of torque and motion included{ends}): {} → {} {}{lost}.",
        number(claim.number("rms_nominal"), 3),
        number(claim.number("rms_calibrated"), 3),
        pooled_unit(calibration)
    ))
}

/// What the first thing that anybody adds to a model would leave: errors of a model without friction are large by that alone.
fn friction_alone(assessment: &Assessment, calibration: &Calibration) -> Option<String> {
    let claim = assessment.claims(Code::FrictionAlone).next()?;
    let left = claim.number("rms_friction");
    let told = format!("{} {}", number(left, 3), pooled_unit(calibration));
    let worse = assessment.claims(Code::JointFrictionAloneWorse);
    let worse = worse.map(|own| {
        let joint = own.subject.name();
        format!(
            "{joint} ({} → {} {})",
            number(own.number("rms_nominal"), 3),
            number(own.number("rms_friction"), 3),
            unit_of(calibration, joint)
        )
    });
    let worse = first_of(worse.collect(), NAMED);
    if left <= claim.number("rms_nominal") {
        let worse = match worse.is_empty() {
            true => String::new(),
            false => format!("; such a fit is worse than your model on {}", list(&worse)),
        };
        return Some(format!(
            "Viscous and Coulomb friction and an offset alone would leave {told}{worse}."
        ));
    }
    let better = match claim.number("joints_better") {
        0.0 => String::new(),
        1.0 => "; better on one joint".into(),
        n => format!("; better on {n} joints"),
    };
    Some(format!(
        "Viscous and Coulomb friction and an offset alone, fitted to the training rows, would leave {told}, more than your model does: \
         worse on {}{better}.",
        list(&worse)
    ))
}

/// What is claimed of the intervals over all joints.
fn over_all(assessment: &Assessment) -> Option<&Claim> {
    let codes = [
        Code::IntervalsHold,
        Code::NarrowIntervals,
        Code::NarrowIntervalsInMotion,
        Code::WideIntervals,
    ];
    codes
        .into_iter()
        .find_map(|code| assessment.claims(code).next())
}

/// How much the 95 % intervals hold: of moving joints, and of all rows where some stand still.
fn held(assessment: &Assessment) -> Option<String> {
    let claim = over_all(assessment)?;
    let (rows, share) = (claim.number("rows"), claim.number("coverage95"));
    let (rows, shown) = (count(rows as u64), percent(share));
    let short = match claim.number("seconds") {
        seconds if seconds < SHORT => format!(" ({} s of log)", number(seconds, 2)),
        _ => String::new(),
    };
    // Where all is inside, that is no praise.
    let needed = percent(claim.number("width_needed"));
    let enough = assessment.claims(Code::FewHeldOutRows).next().is_none();
    let wide = match (claim.has("width_needed"), enough) {
        (false, _) => String::new(),
        (true, true) => format!(
            ": they are wider than they need to be, {needed} of their width would have done"
        ),
        (true, false) => format!("; {needed} of their width would have done for these few"),
    };
    let single = match other_shares(assessment) {
        Some(told) => format!(" On single joints, {told}."),
        None => String::new(),
    };
    if !claim.has("rows_at_rest") {
        return Some(format!(
            "The 95 % intervals contain {shown} of the {rows} held-out values{short}{wide}.{single}"
        ));
    }
    let (still, at_rest) = (
        claim.number("rows_at_rest"),
        claim.number("coverage95_at_rest"),
    );
    let moving = claim.number("rows");
    let all = (share * moving + at_rest * still) / (moving + still);
    let all = match (share - all).abs() > SHARE_WORTH_TELLING {
        true => format!(
            ", and {} of the {} at standstill, where they are widened",
            percent(at_rest),
            count(still as u64)
        ),
        false => String::new(),
    };
    Some(format!(
        "The 95 % intervals contain {shown} of the {rows} held-out values of moving joints{short}{all}{wide}.{single}"
    ))
}

/// "a little outside 92 to 98 %: joint_2 91.1 %; within chance for so few rows: joint_3 88.3 %": joints of several whose intervals hold another
/// share than promised, and are called neither too narrow nor too wide.
pub(super) fn other_shares(assessment: &Assessment) -> Option<String> {
    let codes = [
        (Code::JointCoverageOff, "a little outside 92 to 98 %"),
        (Code::JointCoverageByChance, "within chance for so few rows"),
    ];
    let each = codes.map(|(code, words)| {
        let claims = assessment.claims(code);
        let shares = claims.map(|own| {
            let share = percent(own.number("coverage95"));
            format!("{} {share}", own.subject.name())
        });
        (words, first_of(shares.collect(), NAMED))
    });
    let told = each.iter().filter(|(_, shares)| !shares.is_empty());
    let told: Vec<String> = told
        .map(|(words, shares)| format!("{words}: {}", list(shares)))
        .collect();
    (!told.is_empty()).then(|| told.join("; "))
}

/// Effects up to this number are named; more are counted by family.
const FEW_EFFECTS: usize = 3;

/// "Established: viscous friction (6) and payload.", the equivalent sets and the tentative effects.
fn effects_found(calibration: &Calibration) -> Vec<String> {
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

#[cfg(all(test, feature = "report"))]
mod tests {
    use super::*;
    use crate::words::tests::judged;
    use std::collections::BTreeMap;
    use twincal::robot::{JointKind, Robot};

    /// The model file states dry friction of one joint.
    fn states_friction(c: &mut Calibration) {
        let mut description = c.twin.robot.description().clone();
        let moving = |own: &&mut JointDescription| own.kind != JointKind::Fixed;
        let joint = description.joints.iter_mut().find(moving);
        joint.expect("a moving joint").unused_friction = 0.1;
        let (robot, _) = Robot::new(description, &BTreeMap::new()).expect("a robot");
        c.twin.robot = robot;
    }

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
            states_friction(c);
        });
        let said = "; before: your model without the friction that its file states: ";
        assert!(one.grounds[0].contains(said), "{one:?}");
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
            better.headline.starts_with("Not yet: friction"),
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
