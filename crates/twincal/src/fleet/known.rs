//! What is known before the hierarchy: candidates, columns and noise.

use super::hierarchy::{Hierarchy, Scatter, UnitSums, Window};
use super::logs::KeptLog;
use super::noise::{Noise, measure};
use super::windows::{FleetUnit, WindowSpan, number};
use crate::calibrate::CalibrationSettings;
use crate::error::Result;
use crate::gram::Gram;
use crate::likelihood::Columns;
use crate::robot::Robot;
use crate::term::{Family as TermFamily, Library};
use rayon::prelude::*;

/// Factor on the probability of a deviation in what seldom changes on a robot in service, and in the body of a link.
const SELDOM: f64 = 0.1;
const BODY: f64 = 1e-3;

/// Candidates, columns and noise of a fleet, and its units.
#[derive(Debug)]
pub(super) struct Known {
    pub(super) library: Library,
    pub(super) columns: Columns,
    pub(super) noise: Noise,
    /// Names of the units, with their files.
    pub(super) units: Vec<UnitLogs>,
    /// Zero columns of the library before it.
    pub(super) zero: Vec<usize>,
    factors: Vec<Vec<f64>>,
}

/// Names of a unit and of its logs.
#[derive(Debug, Clone)]
pub(super) struct UnitLogs {
    pub(super) name: String,
    pub(super) logs: Vec<String>,
    pub(super) rows: usize,
}

impl Known {
    pub(super) fn new(
        robot: &Robot,
        units: &[FleetUnit],
        settings: &CalibrationSettings,
    ) -> Result<Self> {
        let (every_candidate, _) = Library::propose(robot, &settings.library)?;
        let logs = || units.iter().flat_map(|unit| &unit.logs);
        let (mut squares, mut rows) = (vec![0.0; every_candidate.columns().len()], 0);
        for log in logs() {
            rows += log.rows;
            for joint in &log.gram.joints {
                for (i, &column) in joint.columns.iter().enumerate() {
                    squares[column as usize] += joint.s0.at(i, i);
                }
            }
        }
        let zero = crate::calibrate::hardly_act(&squares, rows, &every_candidate);
        let library = every_candidate.without_columns(&zero);
        let columns = crate::calibrate::columns_of(robot, &library, settings, false)?;
        let measured: Vec<KeptLog> = logs().filter(|log| log.measured).cloned().collect();
        let noise = measure(&measured, &zero, &columns, settings)?;
        let grams: Vec<Gram> = units
            .iter()
            .map(|unit| {
                let mut sum = Gram::default();
                unit.logs.iter().for_each(|log| sum += &log.gram);
                sum.drop_columns(&zero);
                sum
            })
            .collect();
        Ok(Self {
            factors: noise.of_units(&grams),
            units: (units.iter())
                .map(|unit| UnitLogs {
                    name: unit.name.clone(),
                    logs: unit.logs.iter().map(|log| log.name.clone()).collect(),
                    rows: unit.logs.iter().map(|log| log.rows).sum(),
                })
                .collect(),
            library,
            columns,
            noise,
            zero,
        })
    }

    /// Sums of every unit and window; the logs are gone with it.
    pub(super) fn hierarchy(
        &self,
        units: Vec<FleetUnit>,
        (spans, window): (&[WindowSpan], f64),
    ) -> Hierarchy {
        let sums = units.into_par_iter().zip(&self.factors);
        let of_unit = |(unit, factor): (FleetUnit, &Vec<f64>)| {
            let mut windows: Vec<(usize, Gram)> = Vec::new();
            for log in unit.logs {
                let own = number(&log, window);
                let at = spans.partition_point(|span| span.number < own);
                match windows.iter_mut().find(|(index, _)| *index == at) {
                    Some((_, sum)) => *sum += &log.gram,
                    None => windows.push((at, log.gram)),
                }
            }
            windows.sort_by_key(|(index, _)| *index);
            let window = |(index, mut gram): (usize, Gram)| {
                gram.drop_columns(&self.zero);
                let (precision, score) = self.noise.normal_sums(&gram, factor);
                Window {
                    index,
                    precision,
                    score,
                }
            };
            UnitSums {
                windows: windows.into_iter().map(window).collect(),
            }
        };
        let units = sums.map(of_unit).collect();
        let (columns, odds) = self.components();
        let size = self.columns.names.len();
        let mut prior = self.noise.prior.clone();
        prior.slab = vec![1.0; size];
        prior.lower = vec![f64::NEG_INFINITY; size];
        prior.halves = Vec::new();
        Hierarchy {
            units,
            prior,
            plug_in: Scatter {
                variance: vec![1.0; columns.len()],
                windows: vec![1.0; columns.len()],
                share: 0.0,
            },
            columns,
            odds,
            names: self.columns.names.clone(),
        }
    }

    /// Columns of each component, and how readily a unit deviates in it.
    fn components(&self) -> (Vec<Vec<usize>>, Vec<f64>) {
        let own = self.groups().into_iter();
        own.map(|group| {
            let first = self.columns.component[group.columns[0]];
            let alias = self.columns.second_choice.get(first).copied();
            let odds = match alias {
                Some(true) => 0.0,
                _ => odds(self.library.terms()[self.library.columns()[group.columns[0]]].family),
            };
            (group.columns, odds)
        })
        .unzip()
    }

    /// What is in or out together, with its place in the library: a payload's tensor is apart from its mass.
    pub(super) fn groups(&self) -> Vec<Group> {
        let mut groups: Vec<Group> = Vec::new();
        for (k, &component) in self.columns.component.iter().enumerate() {
            if component == groups.len() {
                groups.push(Group {
                    index: self.library.terms()[self.library.columns()[k]].component,
                    columns: Vec::new(),
                });
            }
            groups[component].columns.push(k);
        }
        groups
    }
}

/// Columns that are in or out together.
#[derive(Debug, Clone)]
pub(super) struct Group {
    /// Of its component in the library.
    pub(super) index: usize,
    pub(super) columns: Vec<usize>,
}

/// What wears, drags, is moved or is put on changes in service; a drive constant or a spring seldom does, and what a link weighs hardly ever. The
/// shape of a friction law is no cause to name: a motion that shows it badly moves its coefficients far, and its level has a name. What a tensor
/// adds to a small body is next to nothing.
fn odds(family: TermFamily) -> f64 {
    match family {
        TermFamily::Viscous
        | TermFamily::Coulomb
        | TermFamily::Payload
        | TermFamily::EncoderZero
        | TermFamily::Offset
        | TermFamily::Tilt => 1.0,
        TermFamily::PayloadTensor
        | TermFamily::Potential
        | TermFamily::CoupledFriction
        | TermFamily::CoupledInertia
        | TermFamily::Ripple => 0.0,
        family if family.is_friction() => 0.0,
        family if family.is_level() => BODY,
        _ => SELDOM,
    }
}
