//! The table of joints: viscous and Coulomb friction, and the other effects of each joint.

use super::Detail;
use super::effects::{clearest, unit, value};
use super::text::{Page, Width, columns, lines, padded, plain, short_name};
use twincal::calibrate::{Calibration, ComponentSummary, Status, StatusReason};
use twincal::term::Family;

/// Columns of a joint's name at most.
const NAME: usize = 24;
/// Columns beside the others from which the further effects stand in the row.
const ROOM: usize = 26;

/// One row.
#[derive(Debug, Default)]
struct Row {
    name: String,
    viscous: String,
    coulomb: String,
    further: String,
}

impl Row {
    fn is_empty(&self) -> bool {
        self.viscous == NONE && self.coulomb == NONE && self.further.is_empty()
    }
}

/// What stands where nothing was found.
const NONE: &str = "–";

/// The joint that an effect belongs to, and what it is there: ("elbow", "motor_inertia").
pub(super) fn joint_of<'a>(
    calibration: &'a Calibration,
    component: &'a ComponentSummary,
) -> Option<(&'a str, &'a str)> {
    let of_links = matches!(
        component.family,
        Family::User
            | Family::Generic
            | Family::Payload
            | Family::PayloadTensor
            | Family::Density
            | Family::MassMoments
            | Family::Tensor
            | Family::Tilt
            | Family::CoupledFriction
            | Family::CoupledInertia
    );
    let names = calibration.twin.robot.joint_names();
    let own = |joint: &'a str| {
        let rest = component.name.strip_prefix(joint)?;
        Some((joint, rest.strip_prefix('.')?))
    };
    let joints = names.into_iter().filter_map(own);
    joints
        .max_by_key(|(joint, _)| joint.len())
        .filter(|_| !of_links)
}

/// The table, with joints of which something was found first where not all fit.
pub(super) fn table(calibration: &Calibration, detail: Detail, width: Width, page: &mut Page) {
    let units = [Family::Viscous, Family::Coulomb].map(|family| unit_of(calibration, family));
    let names = calibration.twin.robot.joint_names();
    let mut rows: Vec<Row> = names
        .iter()
        .map(|joint| row(calibration, joint, units))
        .collect();
    if rows.iter().all(Row::is_empty) {
        page.heading(
            match calibration.effects().any(|own| own.component().is_in()) {
                true => "Found",
                false => "Found: nothing. No candidate has a probability of 0.5 or more.",
            },
        );
        return;
    }
    if rows.len() > detail.joints {
        rows.sort_by_key(Row::is_empty);
    }
    let (all, shown) = (rows.len(), rows.len().min(detail.joints));
    rows.truncate(shown);
    let head = |name: &str, unit: &str| match unit {
        "" => name.to_owned(),
        unit => format!("{name}, {unit}"),
    };
    let heads = Row {
        name: "Found".into(),
        viscous: head("viscous", units[0]),
        coulomb: head("Coulomb", units[1]),
        further: "more".into(),
    };
    lay_out(&heads, &rows, detail.further, width, page);
    if all > shown {
        page.push(plain(format!("  … {} more joints (-v)", all - shown)));
    }
}

/// Unit of a friction, as its first number has it.
fn unit_of(calibration: &Calibration, family: Family) -> &str {
    let own = |component: &&ComponentSummary| {
        component.family == family && component.status == Status::Established
    };
    let first = calibration.components.iter().find(own);
    first.and_then(clearest).map_or("", unit)
}

fn row(calibration: &Calibration, joint: &str, units: [&str; 2]) -> Row {
    let mut row = Row {
        name: short_name(joint, NAME),
        viscous: NONE.into(),
        coulomb: NONE.into(),
        further: String::new(),
    };
    let (mut further, mut tentative) = (Vec::new(), Vec::new());
    for component in &calibration.components {
        let of_joint = joint_of(calibration, component).filter(|(own, _)| *own == joint);
        let Some((_, kind)) = of_joint else {
            continue;
        };
        let status = component.status;
        let kind = match component.family {
            Family::Stribeck => "Stribeck".into(),
            _ => kind.replace('_', " "),
        };
        let number = clearest(component);
        let shown = number.map_or(NONE.to_owned(), value);
        let shown_unit = number.map_or("", unit);
        let cell = |own: &str| match status {
            Status::Established if shown_unit == own => shown.clone(),
            Status::Established => format!("{shown} {shown_unit}"),
            Status::Tentative if component.is_in() => "tentative".into(),
            Status::Equivalent => "equivalent".into(),
            Status::Unidentifiable if component.reason == StatusReason::NoTorqueInLogs => {
                "not excited".into()
            }
            Status::Unidentifiable if component.is_unseen() => status.word().into(),
            _ => NONE.into(),
        };
        match component.family {
            Family::Viscous => row.viscous = cell(units[0]),
            Family::Coulomb => row.coulomb = cell(units[1]),
            _ if status == Status::Established => {
                let several = component.parameters.iter().filter(|own| own.seen).count() > 1;
                let (name, rest) = match number.filter(|_| several) {
                    Some(number) => (format!(" {}", number.name), ", …"),
                    None => (String::new(), ""),
                };
                let text = format!("{kind}{name} {shown} {shown_unit}");
                further.push(format!("{}{rest}", text.trim_end()));
            }
            _ if status == Status::Tentative && component.is_in() => tentative.push(kind),
            _ => {}
        }
    }
    if !tentative.is_empty() {
        further.push(format!("tentative: {}", tentative.join(", ")));
    }
    row.further = further.join("; ");
    row
}

/// Columns under each other; the further effects in the row where there is room, else in lines of their own.
fn lay_out(heads: &Row, rows: &[Row], most: usize, width: Width, page: &mut Page) {
    let widest = |of: fn(&Row) -> &str| {
        let cells = rows.iter().chain([heads]).map(|row| columns(of(row)));
        cells.max().unwrap_or(0)
    };
    let name = widest(|row| &row.name);
    let viscous = widest(|row| &row.viscous);
    let coulomb = widest(|row| &row.coulomb);
    let before = 2 + name + 2 + viscous + 2 + coulomb + 2;
    let in_row = before + ROOM <= width.0;
    let line = |row: &Row, begin: &str| {
        format!(
            "{begin}{}  {}  {}",
            padded(&row.name, name + 2 - begin.len()),
            padded(&row.viscous, viscous),
            padded(&row.coulomb, coulomb)
        )
    };
    let any = rows.iter().any(|row| !row.further.is_empty());
    let more = if any && in_row { "more" } else { "" };
    let text = format!("{}  {more}", line(heads, ""));
    page.heading(text.trim_end());
    for row in rows {
        let own = line(row, "  ");
        if row.further.is_empty() {
            page.push(plain(own.trim_end()));
        } else if in_row {
            let others = " ".repeat(before);
            let own = format!("{own}  ");
            for line in lines(&row.further, [&own, &others], width, most) {
                page.push(plain(line));
            }
        } else {
            page.push(plain(own.trim_end()));
            for line in lines(&row.further, ["      ", "      "], width, most) {
                page.push(plain(line));
            }
        }
    }
}
