//! Joints that stand still: there friction is whatever it takes, so that errors are another matter than in motion.

use super::ambiguity;
use super::grounds::{NAMED, WORTH_TELLING, change, rows_of};
use super::limits::decisive;
use super::tables::{self, Table, with_unit};
use super::text::{count, first_of, list, number, percent};
use super::view::{Joint, pooled_unit};
use twincal::calibrate::Calibration;
use twincal::validate::{JointScore, Scores, Validation};

/// Held-out rows at standstill below which that is not tested.
const FEW_AT_REST: u64 = 20;
/// Pauses in held-out data from which they say something of others.
const FEW_PAUSES: usize = 3;
/// Share of a joint's rows at standstill from which that is a part of what the robot does.
const STANDS_STILL: f64 = 0.05;

/// RMSE before and after of joints that stand still, where it is another matter, for there friction is whatever it takes: and which of them got worse.
pub(super) fn at_standstill(calibration: &Calibration, joints: &[Joint<'_>]) -> Option<String> {
    let validation = &calibration.validation;
    let (all, moving) = (&validation.filtered, decisive(validation));
    if rows_of(all).saturating_sub(rows_of(moving)) < FEW_AT_REST {
        return None;
    }
    let each = || all.joints.iter().zip(&moving.joints);
    let rest: Vec<_> = each()
        .filter(|(all, moving)| all.rows > moving.rows)
        .collect();
    let mut worse: Vec<(&str, [f64; 2])> = (rest.iter())
        .filter_map(|pair| Some((pair.0.joint.as_str(), still(&[*pair])?)))
        .filter(|(_, [before, after])| after / before - 1.0 > WORTH_TELLING)
        .collect();
    let gain = |errors: &[f64; 2]| errors[1] - errors[0];
    worse.sort_by(|(_, a), (_, b)| gain(b).total_cmp(&gain(a)));
    let together = still(&rest)?;
    let differ = (all.rmse_calibrated / moving.rmse_calibrated - 1.0).abs() > WORTH_TELLING;
    if worse.is_empty() && !differ {
        return None;
    }
    let told = change(together, pooled_unit(joints));
    let mut about = Vec::new();
    if let ([only], true) = (&rest[..], joints.len() > 1) {
        about.push(only.0.joint.clone());
        worse.clear();
    }
    about.extend(few_pauses(calibration));
    let place = match about.is_empty() {
        true => "At standstill".to_owned(),
        false => format!("At standstill ({})", about.join("; ")),
    };
    let names = (worse.iter())
        .map(|(name, [before, after])| {
            let unit = joints.iter().find(|joint| joint.name == *name);
            let unit = unit.map_or("", |joint| joint.units.torque);
            format!(
                "{name} ({} → {} {unit})",
                number(*before, 3),
                number(*after, 3)
            )
        })
        .collect();
    let names = first_of(names, NAMED);
    Some(match names.is_empty() {
        true => format!("{place}: {told}."),
        false => format!("{place}: {told}; worse on {}.", list(&names)),
    })
}

/// "one pause, 0.960 s", where held-out rows have so few that they say little of others.
pub(super) fn few_pauses(calibration: &Calibration) -> Option<String> {
    let (mut most, mut longest) = (0, 0.0f64);
    for joint in &calibration.validation.filtered.joints {
        let traces = calibration.validation.traces.iter();
        let (mut pauses, mut seconds) = (0, 0.0);
        for trace in traces.filter(|trace| trace.joint == joint.joint) {
            let rows = trace.standstill.iter().zip(&trace.time);
            let mut began = None;
            for (still, &time) in rows {
                match (still, began) {
                    (true, None) => (pauses, began) = (pauses + 1, Some(time)),
                    (true, Some(_)) => {}
                    (false, Some(start)) => (seconds, began) = (seconds + time - start, None),
                    (false, None) => {}
                }
            }
            if let (Some(start), Some(end)) = (began, trace.time.last()) {
                seconds += end - start;
            }
        }
        most = most.max(pauses);
        longest = longest.max(seconds);
    }
    match most {
        1 => Some(format!("one pause, {} s", number(longest, 2))),
        2..FEW_PAUSES => Some(format!(
            "at most {most} pauses of a joint, {} s",
            number(longest, 2)
        )),
        _ => None,
    }
}

/// Whether torque at standstill, of all joints together, got worse.
pub(super) fn rest_got_worse(calibration: &Calibration) -> bool {
    let validation = &calibration.validation;
    let (all, moving) = (&validation.filtered, decisive(validation));
    if rows_of(all).saturating_sub(rows_of(moving)) < FEW_AT_REST {
        return false;
    }
    let each: Vec<_> = all.joints.iter().zip(&moving.joints).collect();
    still(&each).is_some_and(|[before, after]| after / before - 1.0 > WORTH_TELLING)
}

/// RMSE before and after on the rows that are not among the moving ones; `None` without any.
fn still(pairs: &[(&JointScore, &JointScore)]) -> Option<[f64; 2]> {
    let rows: u64 = pairs
        .iter()
        .map(|(all, moving)| all.rows - moving.rows.min(all.rows))
        .sum();
    let square = |score: &JointScore, of: fn(&JointScore) -> f64| match score.rows {
        0 => 0.0,
        rows => rows as f64 * of(score).powi(2),
    };
    let each: [fn(&JointScore) -> f64; 2] = [|j| j.rmse_nominal, |j| j.rmse_calibrated];
    (rows > 0).then(|| {
        each.map(|of| {
            let left = pairs
                .iter()
                .map(|(all, moving)| square(all, of) - square(moving, of));
            (left.sum::<f64>().max(0.0) / rows as f64).sqrt()
        })
    })
}

/// What joints do at rest in the logs and hardly in held-out rows.
pub(super) fn hardly_at_rest(calibration: &Calibration, joints: &[Joint<'_>]) -> Option<String> {
    let validation = &calibration.validation;
    let rows = |scores: &Scores| scores.joints.iter().map(|joint| joint.rows).sum::<u64>();
    let moving = rows(&validation.moving);
    let at_rest = rows(&validation.filtered).saturating_sub(moving);
    let shares = (0..joints.len()).map(|j| ambiguity::standstill(calibration, j));
    let most = joints
        .iter()
        .zip(shares)
        .filter(|(_, share)| *share >= STANDS_STILL);
    let (joint, share) = most.max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    (moving > 0 && at_rest < FEW_AT_REST).then(|| {
        let (tested, held_out) = match at_rest {
            0 => ("not", "but no held-out row is at rest".to_owned()),
            1 => ("hardly", "but only one held-out row is at rest".to_owned()),
            n => ("hardly", format!("but only {n} held-out rows are at rest")),
        };
        let pairs: Vec<_> = (validation.filtered.joints.iter())
            .zip(&validation.moving.joints)
            .collect();
        let error = still(&pairs).filter(|_| at_rest > 0);
        let error = error.map_or_else(String::new, |error| {
            format!(" (error {})", change(error, pooled_unit(joints)))
        });
        format!(
            "Standstill is {tested} tested: {} stands still in {} of the logs' rows, {held_out}{error}.",
            joint.name,
            percent(share)
        )
    })
}

/// Errors before and after on the rows in which a joint stands still; no rows without any.
pub(super) fn table(validation: &Validation, joints: &[Joint<'_>]) -> Table {
    let mut table = Table::new([
        "joint",
        "rows",
        "RMSE nominal",
        "RMSE calibrated",
        "change",
        "95 % coverage",
        "mean width",
    ]);
    let (all, moving) = (&validation.filtered, decisive(validation));
    let pairs: Vec<_> = (all.joints.iter().zip(&moving.joints))
        .filter(|(all, moving)| all.rows > moving.rows)
        .collect();
    let mut add = |name: &str, pairs: &[(&JointScore, &JointScore)], unit: &str| {
        if let Some([before, after]) = still(pairs) {
            let rows = pairs.iter().map(|(all, moving)| all.rows - moving.rows);
            table.rows.push(vec![
                name.to_owned(),
                count(rows.sum()),
                with_unit(before, unit),
                with_unit(after, unit),
                tables::change(before, after),
                percent(at_rest(pairs, |score| score.coverage95)),
                with_unit(at_rest(pairs, |score| score.mean_width95), unit),
            ]);
        }
    };
    for pair in &pairs {
        let unit = joints.iter().find(|joint| joint.name == pair.0.joint);
        add(
            &pair.0.joint,
            &[*pair],
            unit.map_or("", |joint| joint.units.torque),
        );
    }
    if pairs.len() > 1 {
        add("all joints", &pairs, pooled_unit(joints));
    }
    table
}

/// Share of the rows at standstill that 95 % intervals hold.
pub(super) fn held_at_rest(validation: &Validation) -> f64 {
    let (all, moving) = (&validation.filtered, decisive(validation));
    let pairs: Vec<_> = all.joints.iter().zip(&moving.joints).collect();
    at_rest(&pairs, |score| score.coverage95)
}

/// The mean over the rows at standstill of what is a mean over all rows and over the moving ones.
fn at_rest(pairs: &[(&JointScore, &JointScore)], of: fn(&JointScore) -> f64) -> f64 {
    let inside = |score: &JointScore| match score.rows {
        0 => 0.0,
        rows => rows as f64 * of(score),
    };
    let rows = pairs
        .iter()
        .map(|(all, moving)| all.rows - moving.rows.min(all.rows));
    let held = pairs
        .iter()
        .map(|(all, moving)| inside(all) - inside(moving));
    held.sum::<f64>() / rows.sum::<u64>() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;

    /// Rows 0.1 s apart, of which these stand still, in every trace of the first log; none in the others.
    fn resting(rows: &[std::ops::Range<usize>]) -> Calibration {
        let mut calibration = fixture::two_joints();
        let log = calibration.validation.traces[0].log.clone();
        for trace in &mut calibration.validation.traces {
            let first = trace.log == log;
            trace.time = (0..trace.time.len()).map(|row| 0.1 * row as f64).collect();
            trace.standstill = (0..trace.time.len())
                .map(|row| first && rows.iter().any(|rows| rows.contains(&row)))
                .collect();
        }
        calibration
    }

    #[test]
    fn few_pauses_are_counted_and_many_are_not_told() {
        let pauses = [3..13, 20..25, 30..32];
        let of = |first: usize| few_pauses(&resting(&pauses[..first]));
        assert_eq!(of(0), None);
        assert_eq!(of(1).as_deref(), Some("one pause, 1.0 s"));
        assert_eq!(of(2).as_deref(), Some("at most 2 pauses of a joint, 1.5 s"));
        assert_eq!(of(3), None);
    }

    /// Of 100 rows 50 move; mean squares of all and of those that move leave 9 and 1 at rest, and 90 and 45 held ones 45.
    #[test]
    fn rows_at_rest_are_what_all_rows_have_more_than_moving_ones() {
        let calibration = fixture::two_joints();
        let joints = crate::report::view::joints(&calibration);
        let mut validation = calibration.validation.clone();
        validation.moving = validation.filtered.clone();
        for (all, moving) in
            (validation.filtered.joints.iter_mut()).zip(&mut validation.moving.joints)
        {
            (moving.rows, moving.rmse_nominal, moving.rmse_calibrated) = (50, 1.0, 1.0);
            (all.rows, all.rmse_nominal, all.rmse_calibrated) = (100, 5f64.sqrt(), 1.0);
            (moving.coverage95, all.coverage95) = (0.8, 0.85);
        }
        let table = table(&validation, &joints);
        assert_eq!(table.rows.len(), 3);
        for row in &table.rows {
            assert!(
                row[2].starts_with("3.00") && row[3].starts_with("1.00"),
                "{row:?}"
            );
            assert_eq!(row[5], "90.0\u{202f}%");
        }
        validation.moving = validation.filtered.clone();
        assert!(super::table(&validation, &joints).rows.is_empty());
    }
}
