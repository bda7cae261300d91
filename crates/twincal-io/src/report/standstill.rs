//! Scores of joints that stand still.

use super::tables::{self, Table, with_unit};
use crate::words::number::{count, percent};
use crate::words::units::{pooled_unit, unit_of};
use twincal::assess::{AtRest, all_at_rest, at_rest};
use twincal::calibrate::Calibration;

/// Errors before and after on the rows in which a joint stands still; no rows without any.
pub(super) fn table(calibration: &Calibration) -> Table {
    let validation = &calibration.validation;
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
        add(own.joint, own, unit_of(calibration, own.joint));
    }
    if let (Some(all), 2..) = (all_at_rest(validation), each.len()) {
        add("all joints", &all, pooled_unit(calibration));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;

    /// Of 100 rows 50 move; mean squares of all and of those that move leave 9 and 1 at rest, and 90 and 45 held ones 45.
    #[test]
    fn rows_at_rest_are_what_all_rows_have_more_than_moving_ones() {
        let mut calibration = fixture::two_joints();
        let validation = &mut calibration.validation;
        validation.moving = validation.filtered.clone();
        for (all, moving) in
            (validation.filtered.joints.iter_mut()).zip(&mut validation.moving.joints)
        {
            (moving.rows, moving.rmse_nominal, moving.rmse_calibrated) = (50, 1.0, 1.0);
            (all.rows, all.rmse_nominal, all.rmse_calibrated) = (100, 5f64.sqrt(), 1.0);
            (moving.coverage95, all.coverage95) = (0.8, 0.85);
        }
        let table = table(&calibration);
        assert_eq!(table.rows.len(), 3);
        for row in &table.rows {
            assert!(
                row[2].starts_with("3.00") && row[3].starts_with("1.00"),
                "{row:?}"
            );
            assert_eq!(row[5], "90.0\u{202f}%");
        }
        calibration.validation.moving = calibration.validation.filtered.clone();
        assert!(super::table(&calibration).rows.is_empty());
    }
}
