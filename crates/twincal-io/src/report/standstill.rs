//! Joints that stand still: there friction is whatever it takes, so that errors are another matter than in motion.

use super::ambiguity;
use super::grounds::{NAMED, WORTH_TELLING, change, rows_of};
use super::limits::decisive;
use super::tables::{self, Table, with_unit};
use super::text::{count, list, number, percent};
use super::view::{Joint, pooled_unit};
use twincal::calibrate::Calibration;
use twincal::validate::{JointScore, Scores, Validation};

/// Held-out rows at standstill below which that is not tested.
const FEW_AT_REST: u64 = 20;
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
    if let ([only], true) = (&rest[..], joints.len() > 1) {
        return Some(format!("At standstill ({}): {told}.", only.0.joint));
    }
    let mut names: Vec<String> = (worse.iter().take(NAMED))
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
    if let Some(more) = worse.len().checked_sub(NAMED).filter(|more| *more > 0) {
        names.push(format!("{more} more"));
    }
    Some(match names.is_empty() {
        true => format!("At standstill: {told}."),
        false => format!("At standstill: {told}; worse on {}.", list(&names)),
    })
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
        format!(
            "Standstill is {tested} tested: {} stands still in {} of the logs' rows, {held_out}.",
            joint.name,
            percent(share)
        )
    })
}

/// Errors before and after on the rows in which a joint stands still; no rows without any.
pub(super) fn table(validation: &Validation, joints: &[Joint<'_>]) -> Table {
    let mut table = Table::new(["joint", "rows", "RMSE nominal", "RMSE calibrated", "change"]);
    let (all, moving) = (&validation.filtered, decisive(validation));
    let pairs = all.joints.iter().zip(&moving.joints);
    for (all, moving) in pairs.filter(|(all, moving)| all.rows > moving.rows) {
        let Some([before, after]) = still(&[(all, moving)]) else {
            continue;
        };
        let unit = joints.iter().find(|joint| joint.name == all.joint);
        let unit = unit.map_or("", |joint| joint.units.torque);
        table.rows.push(vec![
            all.joint.clone(),
            count(all.rows - moving.rows),
            with_unit(before, unit),
            with_unit(after, unit),
            tables::change(before, after),
        ]);
    }
    table
}
