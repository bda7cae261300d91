//! What a fit takes of its rows: sums that add, joint by joint. Up to here cost grows with the logs, and not beyond.

mod bands;
mod decoys;
mod log_sums;
mod spectrum;
mod sums;
mod unit;
mod weighing;

pub(crate) use bands::Bands;
pub(crate) use decoys::{JointDecoys, decoys};
pub(crate) use log_sums::{BLOCKS, JointBlock, JointSums, LogSums, Runs};
pub(crate) use spectrum::Spectrum;
pub(crate) use sums::{GROUPS, Purpose, Sums};
pub(crate) use unit::{JointUnit, Unit, of_joint, residual_form};
pub(crate) use weighing::Weighing;

use crate::gram::Gram;
use crate::observations::Part;
use log_sums::stretch;
use std::ops::Range;

/// Units that one or two logs are cut into; of three logs or more each is one.
const PARTS: usize = 5;
/// Units of three logs or more at most; more logs are grouped.
const MOST_UNITS: usize = 6;

/// The rows of a fit as a few sums over columns and torque, each of which can be left out.
#[derive(Debug, Clone, Default)]
pub(crate) struct Training {
    /// Contiguous parts of one or two logs, whole logs or groups of them.
    pub(crate) units: Vec<Unit>,
}

impl Training {
    /// Units that can be left out, see [`units`].
    pub(crate) fn new(sums: &Sums) -> Self {
        let units = units(sums.groups());
        Self {
            units: units.iter().map(|unit| sums.unit(unit)).collect(),
        }
    }

    /// Sum of all units.
    pub(crate) fn total(&self) -> Unit {
        let mut total = Unit::default();
        self.units.iter().for_each(|unit| total += unit);
        total
    }

    /// [`Self::without`] each unit.
    pub(crate) fn all_but_each(&self) -> Vec<Gram> {
        (0..self.units.len())
            .map(|unit| self.without(unit))
            .collect()
    }

    /// Columns and torque of all units but one.
    pub(crate) fn without(&self, left_out: usize) -> Gram {
        let mut kept = Gram::default();
        let others = self.units.iter().enumerate();
        others
            .filter(|(unit, _)| *unit != left_out)
            .for_each(|(_, unit)| kept += &unit.gram);
        kept
    }
}

/// What is left out together, as stretches of groups of logs: three logs or more one by one (more than six in six groups), otherwise one fifth of
/// each log after the other.
pub(crate) fn units(groups: usize) -> Vec<Vec<(usize, Range<usize>)>> {
    if groups >= 3 {
        let count = groups.min(MOST_UNITS);
        let unit = |unit| {
            (unit..groups)
                .step_by(count)
                .map(|group| (group, 0..BLOCKS))
        };
        return (0..count).map(|own| unit(own).collect()).collect();
    }
    let cut = |i: usize| i * BLOCKS / PARTS;
    let unit = |i: usize| (0..groups).map(move |group| (group, cut(i)..cut(i + 1)));
    let count = if groups == 0 { 0 } else { PARTS };
    (0..count).map(|own| unit(own).collect()).collect()
}

/// The rows of some stretches of a group of these parts, each of another log.
pub(crate) fn rows_of<'a>(
    parts: &[Part<'a>],
    (group, stretches): (usize, Range<usize>),
) -> Vec<Part<'a>> {
    let mut logs: Vec<&Part<'a>> = parts.iter().collect();
    logs.sort_by(|a, b| a.observations.log.cmp(&b.observations.log));
    let piece = |part: &Part<'a>| Part {
        observations: part.observations,
        rows: stretch(&part.rows, stretches.start).start
            ..stretch(&part.rows, stretches.end - 1).end,
    };
    logs.into_iter()
        .skip(group)
        .step_by(GROUPS)
        .map(piece)
        .collect()
}

/// The rows of the [`units`] of these parts.
pub(crate) fn rows_of_units<'a>(parts: &[Part<'a>]) -> Vec<Vec<Part<'a>>> {
    let units = units(parts.len().min(GROUPS)).into_iter();
    let rows = |unit: Vec<_>| {
        unit.into_iter()
            .flat_map(|own| rows_of(parts, own))
            .collect()
    };
    units.map(rows).collect()
}

#[cfg(test)]
mod tests;
