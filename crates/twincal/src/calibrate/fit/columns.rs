//! The columns that a fit chooses from: what each belongs to, which are forced in, and which need another one.

use super::heredity::{self, Named};
use crate::calibrate::settings::CalibrationSettings;
use crate::error::{Error, Result};
use crate::likelihood::Columns;
use crate::robot::Robot;
use crate::term::{Family, Library};

/// The live columns with their components, families and bounds; `payload_apart`: the payload acts in some logs only, which tells
/// it from the link that carries it.
///
/// # Errors
/// [`Error::Setting`] if a component that is forced in has no column, or heredity makes no sense.
pub(crate) fn columns_of(
    robot: &Robot,
    library: &Library,
    settings: &CalibrationSettings,
    payload_apart: bool,
) -> Result<Columns> {
    let forced = &settings.prior.forced;
    let mut columns = none_yet(library.prior_sds());
    let mut named = Vec::new();
    let mut unknown: Vec<&String> = forced.iter().collect();
    let mut last = None;
    for &index in library.columns() {
        let term = &library.terms()[index];
        // A payload's tensor is in or out by itself, where motion can tell it from the payload's mass.
        let family = match term.family {
            Family::PayloadTensor if library.payload_is_one() => Family::Payload,
            family => family,
        };
        if last != Some((term.component, family)) {
            let alone = term.family == Family::PayloadTensor
                && last.is_none_or(|(component, _)| component != term.component);
            last = Some((term.component, family));
            let name = &library.components()[term.component].name;
            named.push(Named {
                name,
                family: term.family,
            });
            columns.forced.push(forced.contains(name));
            let component = &library.components()[term.component];
            columns
                .second_choice
                .push(alone || (!payload_apart && component.is_second_choice()));
            unknown.retain(|forced| *forced != name);
            let known = columns.families.iter().position(|f| *f == term.family);
            columns.family.push(known.unwrap_or_else(|| {
                columns.families.push(term.family);
                columns.families.len() - 1
            }));
        }
        columns.component.push(columns.family.len() - 1);
        columns.names.push(term.name.clone());
        columns.lower.push(if settings.library.nonnegative {
            library.least_value(index, robot)
        } else {
            f64::NEG_INFINITY
        });
    }
    columns.parent = heredity::parents(&named, settings.prior.heredity.as_deref())?;
    heredity::force_parents(&columns.parent, &mut columns.forced);
    match unknown.first() {
        None => Ok(columns),
        Some(name) => Err(unknown_forced(name)),
    }
}

/// No columns, before those of these prior sds are added.
fn none_yet(prior_sd: Vec<Option<f64>>) -> Columns {
    Columns {
        names: Vec::new(),
        component: Vec::new(),
        family: Vec::new(),
        families: Vec::new(),
        prior_sd,
        lower: Vec::new(),
        forced: Vec::new(),
        parent: Vec::new(),
        second_choice: Vec::new(),
        one_motion: false,
        halves: Vec::new(),
    }
}

/// The error for a component that is forced in and has no column.
fn unknown_forced(name: &str) -> Error {
    Error::Setting {
        key: "prior.forced".into(),
        problem: format!("no candidate `{name}` that has torque in these logs"),
        remedy: "give names of components as `twincal fit` prints them, such as \"elbow.viscous\""
            .into(),
    }
}
