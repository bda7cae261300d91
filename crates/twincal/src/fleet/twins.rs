//! Twins that a fleet gives: that of the type, and those of robots that were asked for.

use super::hierarchy::Hierarchy;
use super::known::Known;
use super::logs::KeptStatistics;
use super::posterior::{FleetPosterior, UnitPosterior};
use super::result::{FleetResult, FleetTwin};
use crate::calibrate::{
    Calibration, CalibrationSettings, Plan, Pooled, Statistics, calibrate_pooled,
};
use crate::error::Result;
use crate::posterior::Method;
use crate::robot::Robot;

/// Least variance of a coefficient over that of its slab: what never moves has a covariance with an inverse, too.
const LEAST: f64 = 1e-10;
/// Probability of a change from which the logs before it are no longer the robot's.
const CHANGED: f64 = 0.5;

/// What twins are made of.
pub(super) struct Twins<'a> {
    pub(super) robot: &'a Robot,
    pub(super) plan: &'a Plan,
    pub(super) settings: &'a CalibrationSettings,
    pub(super) known: &'a Known,
    pub(super) hierarchy: &'a Hierarchy,
    pub(super) posterior: &'a FleetPosterior,
    pub(super) method: Method,
    /// Statistics of the robots in which noise was measured, and of those asked for.
    pub(super) kept: Vec<KeptStatistics>,
}

impl Twins<'_> {
    /// What a robot of the type does of which no log is there: β ~ μ with the scatter of robots and windows.
    ///
    /// # Errors
    /// Those of a fit.
    pub(super) fn of_type(&self) -> Result<Calibration> {
        let size = self.hierarchy.size();
        let draws = &self.posterior.mu;
        let weight = 1.0 / draws.len().max(1) as f64;
        let mut sums = Moments::new(size);
        draws.iter().for_each(|mu| sums.add(mu, weight));
        let scatter = self.hierarchy.scatter();
        let own = self.pooled(sums, &scatter, self.posterior.inclusion.clone());
        let logs = (self.kept.iter().filter(|log| log.measured)).map(KeptStatistics::named);
        self.calibration("", logs.collect(), own)
    }

    /// One robot as it is in its last window.
    ///
    /// # Errors
    /// Those of a fit.
    pub(super) fn of_robot(&self, name: &str, result: &FleetResult) -> Result<FleetTwin> {
        let at = self.known.units.iter().position(|unit| unit.name == name);
        let unit = &self.posterior.units[at.unwrap_or_default()];
        let (of_type, size) = (&self.posterior.inclusion, self.hierarchy.size());
        let mut inclusion = of_type.clone();
        for (columns, deviates) in self.hierarchy.columns.iter().zip(&unit.inclusion) {
            for &k in columns {
                inclusion[k] = 1.0 - (1.0 - of_type[k]) * (1.0 - deviates);
            }
        }
        let own = self.pooled(Moments::of(unit, size), &vec![0.0; size], inclusion);
        let since = since(name, result);
        let logs = (self.kept.iter())
            .filter(|log| log.robot == name && log.window >= since)
            .map(|log| log.statistics.clone());
        Ok(FleetTwin {
            robot: name.to_owned(),
            calibration: self.calibration(name, logs.collect(), own)?,
        })
    }

    /// In the coefficients' units, for a window that is to come.
    fn pooled(&self, moments: Moments, more: &[f64], inclusion: Vec<f64>) -> Pooled {
        let root: Vec<f64> = self.known.noise.slab.iter().map(|d| d.sqrt()).collect();
        let windows = self.hierarchy.window_scatter();
        let size = root.len();
        let mut covariance = moments.covariance();
        for k in 0..size {
            covariance[k * size + k] += more[k] + windows[k] + LEAST;
        }
        for (row, scale) in covariance.chunks_exact_mut(size).zip(&root) {
            (row.iter_mut().zip(&root)).for_each(|(value, root)| *value *= scale * root);
        }
        Pooled {
            zero_columns: self.known.zero.clone(),
            inclusion,
            mean: (moments.mean.iter().zip(&root))
                .map(|(mean, root)| mean * root)
                .collect(),
            covariance,
            method: self.method.clone(),
        }
    }

    fn calibration(
        &self,
        name: &str,
        logs: Vec<crate::calibrate::LogStatistics>,
        own: Pooled,
    ) -> Result<Calibration> {
        let statistics = Statistics {
            robot_name: name.to_owned(),
            robot: self.robot.clone(),
            plan: self.plan.clone(),
            logs,
        };
        calibrate_pooled(&statistics, &own, self.settings)
    }
}

/// Number of the window with which the last change of a robot came.
fn since(name: &str, result: &FleetResult) -> Option<i64> {
    let unit = result.units.iter().find(|unit| unit.robot == name);
    let deviations = unit.map_or(&[][..], |unit| &unit.deviations);
    let changes = deviations.iter().filter(|own| own.pip > CHANGED);
    changes.filter_map(|own| own.since?.number).max()
}

/// E[x] and E[x xᵀ].
struct Moments {
    mean: Vec<f64>,
    second: Vec<f64>,
}

impl Moments {
    fn new(size: usize) -> Self {
        Self {
            mean: vec![0.0; size],
            second: vec![0.0; size * size],
        }
    }

    /// Of a robot's coefficients in its last window.
    fn of(unit: &UnitPosterior, size: usize) -> Self {
        let mean = unit.means.last().cloned();
        Self {
            mean: mean.unwrap_or_else(|| vec![0.0; size]),
            second: unit.second.clone(),
        }
    }

    fn add(&mut self, x: &[f64], weight: f64) {
        let size = x.len();
        for (i, &own) in x.iter().enumerate() {
            self.mean[i] += weight * own;
            let row = &mut self.second[i * size..(i + 1) * size];
            row.iter_mut()
                .zip(x)
                .for_each(|(sum, other)| *sum += weight * own * other);
        }
    }

    fn covariance(&self) -> Vec<f64> {
        let size = self.mean.len();
        let at = |place: usize| self.mean[place / size] * self.mean[place % size];
        let second = self.second.iter().enumerate();
        second.map(|(place, second)| second - at(place)).collect()
    }
}
