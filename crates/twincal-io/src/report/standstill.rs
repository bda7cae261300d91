//! Joints that stand still: there friction is whatever it takes, so that errors are another matter than in motion.

use super::grounds::{NAMED, WORTH_TELLING, change};
use super::tables::{self, Table, with_unit};
use super::text::{count, first_of, list, number, percent};
use super::view::{Joint, pooled_unit, unit_of};
use twincal::assess::{
    self, AtRest, Pauses, all_at_rest, at_rest, decisive, few_pauses, tested_at_rest,
};
use twincal::calibrate::Calibration;
use twincal::validate::Validation;

/// RMSE before and after of joints that stand still, where it is another matter, for there friction is whatever it takes: and which of them got worse.
pub(super) fn at_standstill(calibration: &Calibration, joints: &[Joint<'_>]) -> Option<String> {
    let validation = &calibration.validation;
    let (all, moving) = (&validation.filtered, decisive(validation));
    let together = tested_at_rest(validation)?;
    let rest = at_rest(validation);
    let mut worse: Vec<&AtRest<'_>> = rest.iter().filter(|own| own.got_worse()).collect();
    let gain = |own: &AtRest<'_>| own.rmse[1] - own.rmse[0];
    worse.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    let differ = (all.rmse_calibrated / moving.rmse_calibrated - 1.0).abs() > WORTH_TELLING;
    if worse.is_empty() && !differ {
        return None;
    }
    let told = change(together.rmse, pooled_unit(joints));
    let mut about = Vec::new();
    if let ([only], true) = (&rest[..], joints.len() > 1) {
        about.push(only.joint.to_owned());
        worse.clear();
    }
    about.extend(few_pauses(calibration).map(pauses));
    let place = match about.is_empty() {
        true => "At standstill".to_owned(),
        false => format!("At standstill ({})", about.join("; ")),
    };
    let names = (worse.iter())
        .map(|own| {
            let [before, after] = own.rmse.map(|rmse| number(rmse, 3));
            let unit = unit_of(joints, own.joint);
            format!("{} ({before} → {after} {unit})", own.joint)
        })
        .collect();
    let names = first_of(names, NAMED);
    Some(match names.is_empty() {
        true => format!("{place}: {told}."),
        false => format!("{place}: {told}; worse on {}.", list(&names)),
    })
}

/// "one pause, 0.960 s".
fn pauses(own: Pauses) -> String {
    let seconds = number(own.seconds, 2);
    match own.most {
        1 => format!("one pause, {seconds} s"),
        most => format!("at most {most} pauses of a joint, {seconds} s"),
    }
}

/// What joints do at rest in the logs and hardly in held-out rows.
pub(super) fn hardly_at_rest(calibration: &Calibration, joints: &[Joint<'_>]) -> Option<String> {
    let (joint, share, rows) = assess::hardly_at_rest(calibration)?;
    let (tested, held_out) = match rows {
        0 => ("not", "but no held-out row is at rest".to_owned()),
        1 => ("hardly", "but only one held-out row is at rest".to_owned()),
        n => ("hardly", format!("but only {n} held-out rows are at rest")),
    };
    let error = all_at_rest(&calibration.validation).filter(|_| rows > 0);
    let error = error.map_or_else(String::new, |own| {
        format!(" (error {})", change(own.rmse, pooled_unit(joints)))
    });
    Some(format!(
        "Standstill is {tested} tested: {joint} is at rest in {} of the logs' rows, {held_out}{error}.",
        percent(share)
    ))
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
    let mut add = |name: &str, own: &AtRest<'_>, unit: &str| {
        let [before, after] = own.rmse;
        table.rows.push(vec![
            name.to_owned(),
            count(own.rows),
            with_unit(before, unit),
            with_unit(after, unit),
            tables::change(before, after),
            percent(own.coverage95),
            with_unit(own.mean_width95, unit),
        ]);
    };
    let each = at_rest(validation);
    for own in &each {
        add(own.joint, own, unit_of(joints, own.joint));
    }
    if let (Some(all), 2..) = (all_at_rest(validation), each.len()) {
        add("all joints", &all, pooled_unit(joints));
    }
    table
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
        let of = |first: usize| few_pauses(&resting(&pauses[..first])).map(super::pauses);
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
