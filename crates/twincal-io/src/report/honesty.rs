//! Can the numbers be believed: tables of intervals joint by joint.

use super::tables::{Table, with_unit};
use super::view::Joint;
use crate::words::number::{count, number, percent};
use twincal::validate::Validation;

/// Coverage at four levels and shape of the predictions per joint; no rows without held-out rows.
pub(super) fn reliability(validation: &Validation) -> Table {
    let mut table = Table::new([
        "joint",
        "in 50 %",
        "in 80 %",
        "in 90 %",
        "in 95 %",
        "PIT deviation",
        "by chance",
    ]);
    let mut add = |name: &str, levels: &[(f64, f64)], distance: f64, chance: f64| {
        let mut row = vec![name.to_owned()];
        row.extend(levels.iter().map(|(_, seen)| percent(*seen)));
        row.extend([number(distance, 3), format!("below {}", number(chance, 3))]);
        table.rows.push(row);
    };
    for joint in validation.reliability.iter().filter(|joint| joint.rows > 0) {
        let pit = &joint.pit;
        add(
            &joint.joint,
            &joint.coverage_levels,
            pit.distance,
            pit.chance,
        );
    }
    if validation.reliability.len() > 1 && !validation.coverage_levels.is_empty() {
        let pit = &validation.pit;
        add(
            "all joints",
            &validation.coverage_levels,
            pit.distance,
            pit.chance,
        );
    }
    table
}

/// Moving rows that the training data speak of, beside those beyond; no rows where every motion was seen before.
pub(super) fn beyond(validation: &Validation, joints: &[Joint<'_>]) -> Table {
    let mut table = Table::new([
        "joint",
        "rows within",
        "95 % coverage",
        "RMSE",
        "rows beyond",
        "95 % coverage there",
        "RMSE there",
    ]);
    let pairs = validation
        .within
        .joints
        .iter()
        .zip(&validation.beyond.joints);
    for (within, beyond) in pairs.filter(|(_, beyond)| beyond.rows > 0) {
        let joint = joints.iter().find(|joint| joint.name == within.joint);
        let unit = joint.map_or("", |joint| joint.units.torque);
        let mut row = vec![within.joint.clone()];
        for scores in [within, beyond] {
            row.push(count(scores.rows));
            row.push(percent(scores.coverage95));
            row.push(with_unit(scores.rmse_calibrated, unit));
        }
        table.rows.push(row);
    }
    table
}
