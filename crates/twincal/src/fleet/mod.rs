//! One posterior over the robots of a type, from the statistics of their logs: what is wrong with the model file of all, what one robot has
//! more than the others, and since when.

mod deviations;
mod discoveries;
mod hierarchy;
mod known;
mod logs;
mod noise;
mod posterior;
mod result;
mod sampler;
mod scatter;
mod twins;
mod windows;

pub use logs::{LeftOut, Reason};
pub use result::{
    CoursePoint, DeviationSummary, FleetResult, FleetTwin, TypeEffect, UnitSummary, Value,
};
pub use windows::WindowSpan;

use crate::calibrate::{CalibrationSettings, Plan, Statistics};
use crate::error::{Error, Result};
use crate::posterior::Method;
use known::Known;
use logs::{Family, KeptLog, KeptStatistics};
use posterior::Length;
use std::collections::BTreeSet;
use twins::Twins;
use windows::{FleetUnit, number, spans};

/// Robots in which noise is measured: so many to twice as many, evenly in the order of their files.
const MEASURED: usize = 5;
/// How a fleet is looked at.
#[derive(Debug, Clone, PartialEq)]
pub struct FleetSettings {
    /// Settings of the fits behind it: prior and inference.
    pub calibration: CalibrationSettings,
    /// Length of a window, s. A deviation begins with a window.
    pub window: f64,
    /// Expected share of units named as deviating that do not deviate, at most.
    pub false_discovery_rate: f64,
    /// Iterations of each chain.
    pub draws: usize,
    /// Chains.
    pub chains: usize,
}

impl Default for FleetSettings {
    fn default() -> Self {
        Self {
            calibration: CalibrationSettings::default(),
            window: 7.0 * 86_400.0,
            false_discovery_rate: 0.05,
            draws: 200,
            chains: 2,
        }
    }
}

/// The statistics of many robots' logs, added one by one: of each only what the posterior needs is kept.
///
/// # Example
/// Seven arms of one type, each with about 0.6 kg more at its tip than the model file of all says.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::calibrate::{About, Statistics, plan_about};
/// use twincal::fleet::{Fleet, FleetSettings};
/// use twincal::prelude::*;
///
/// # let (robot, mut noise) = (two_link::arm(2.0)?, twincal::random::Random::new(4, 0));
/// # let mut logs = Vec::new();
/// # for unit in 0..7 {
/// #     let real = two_link::arm(2.6 + 0.01 * (f64::from(unit) - 3.0))?;
/// #     logs.push(two_link::log(&format!("unit{unit}"), 0.3 + 0.7 * f64::from(unit), &real, &mut noise));
/// # }
/// # let mut settings = Settings::default();
/// # settings.library.families = vec![Family::Payload, Family::Viscous, Family::Coulomb];
/// # settings.library.terms = vec!["sin(q1 - q2)".into()];
/// let (plan, _) = plan_about(About::Found, &robot, &logs[..1], &settings, &|_| {})?;
/// let mut fleet = Fleet::default();
/// for log in &logs {
///     fleet.add(&Statistics::of((&log.name, &robot), &plan, &Log::from(log), "")?); // each where its log is
/// }
/// let settings = FleetSettings { calibration: settings, draws: 100, ..FleetSettings::default() };
/// let result = fleet.fit(&settings, &|_| Ok(()))?;
/// let payload = result.type_effects.iter().find(|effect| effect.name == "payload").ok_or("none")?;
/// assert!(payload.pip > 0.99 && (payload.parameters[0].value - 0.6).abs() < 0.05); // kg
/// assert_eq!(result.units.len(), 7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct Fleet {
    families: Vec<Family>,
    twins: BTreeSet<String>,
}

/// What a fit of a fleet is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FleetStage {
    /// Noise is measured in a few units.
    Noise,
    /// Scatter of units is learned: rounds done, and all of them.
    Scatter(usize, usize),
    /// The posterior is sampled: iterations done, and all of them.
    Posterior(usize, usize),
    /// Twins are made of it.
    Twins,
}

impl Fleet {
    /// A fleet of which these robots get a twin each.
    #[must_use]
    pub fn with_twins(robots: impl IntoIterator<Item = String>) -> Self {
        Self {
            families: Vec::new(),
            twins: robots.into_iter().collect(),
        }
    }

    /// Adds the logs of one unit: `statistics.robot_name` says which.
    pub fn add(&mut self, statistics: &Statistics) {
        let same =
            |family: &Family| family.robot == statistics.robot && family.plan == statistics.plan;
        let at = self.families.iter().position(same);
        let at = at.unwrap_or_else(|| {
            let family = Family::new(statistics.robot.clone(), statistics.plan.clone());
            self.families.push(family);
            self.families.len() - 1
        });
        let kept = (MEASURED, &self.twins);
        self.families[at].add(&statistics.robot_name, &statistics.logs, kept);
    }

    /// The posterior of the fleet. `watch` is called before every stage and now and then within one; an error of it ends the fit.
    ///
    /// # Errors
    /// [`Error::Statistics`] with fewer than three units, [`Error::Setting`] for impossible settings and for a twin of a robot that is not
    /// there, those of a calibration, and what `watch` returns.
    pub fn fit(
        self,
        settings: &FleetSettings,
        watch: &(dyn Fn(FleetStage) -> Result<()> + Sync),
    ) -> Result<FleetResult> {
        require(settings)?;
        let (mut family, mut left_out) =
            logs::largest(self.families).ok_or_else(|| no_units(0, &[]))?;
        let mut units = units_of(std::mem::take(&mut family.logs), &mut left_out)?;
        require_twins(&self.twins, &units)?;
        let calibration = as_planned(&settings.calibration, &family.plan);
        watch(FleetStage::Noise)?;
        let known = Known::new(&family.robot, &units, &calibration)?;
        let spans = spans(&units, settings.window);
        let kept = kept_statistics(&mut units, settings.window);
        let mut hierarchy = known.hierarchy(units, (&spans, settings.window));
        let seed = calibration.inference.seed;
        let states = scatter::learn(&mut hierarchy, seed, &|done, all| {
            watch(FleetStage::Scatter(done, all))
        })?;
        let length = Length {
            chains: settings.chains,
            iterations: settings.draws,
            seed,
        };
        let posterior = posterior::sample(&hierarchy, states, length, &|done, all| {
            watch(FleetStage::Posterior(done, all))
        })?;
        watch(FleetStage::Twins)?;
        let about = result::About {
            known: &known,
            hierarchy: &hierarchy,
            spans: &spans,
            left_out,
            rate: settings.false_discovery_rate,
        };
        let mut result = about.result(&posterior);
        let twins = Twins {
            robot: &family.robot,
            plan: &family.plan,
            settings: &calibration,
            known: &known,
            hierarchy: &hierarchy,
            posterior: &posterior,
            method: Method::Fleet {
                robots: known.units.len(),
                chains: settings.chains,
                draws: settings.draws,
                spread: posterior.spread,
            },
            kept,
        };
        result.type_twin = Some(twins.of_type()?);
        for robot in &self.twins {
            let twin = twins.of_robot(robot, &result)?;
            result.twins.push(twin);
        }
        Ok(result)
    }
}

/// Settings of a calibration with the library and the noise of a plan.
fn as_planned(settings: &CalibrationSettings, plan: &Plan) -> CalibrationSettings {
    let mut calibration = settings.clone();
    calibration.library = plan.library.clone();
    calibration.noise.model = plan.noise;
    calibration
}

/// At least three units whose logs count; other logs go to those that are left out.
fn units_of(logs: Vec<KeptLog>, left_out: &mut Vec<LeftOut>) -> Result<Vec<FleetUnit>> {
    let (kept, more) = logs::sifted(logs);
    left_out.extend(more);
    left_out.sort_by(|a, b| (&a.robot, &a.log).cmp(&(&b.robot, &b.log)));
    let units = by_unit(kept);
    if units.len() < 3 {
        return Err(no_units(units.len(), left_out));
    }
    Ok(units)
}

/// # Errors
/// [`Error::Setting`] for a robot that has no logs, or none that count.
fn require_twins(asked: &BTreeSet<String>, units: &[FleetUnit]) -> Result<()> {
    let there = |robot: &&String| units.iter().any(|unit| unit.name == **robot);
    match asked.iter().find(|robot| !there(robot)) {
        None => Ok(()),
        Some(robot) => Err(Error::Setting {
            key: "fleet.twins".into(),
            problem: format!("no log of a robot `{robot}` counts"),
            remedy: "give the name that its statistics were made with (--robot)".into(),
        }),
    }
}

/// Takes all statistics out of the logs that have them.
fn kept_statistics(units: &mut [FleetUnit], window: f64) -> Vec<KeptStatistics> {
    let logs = units.iter_mut().flat_map(|unit| &mut unit.logs);
    let taken = logs.filter_map(|log| {
        let statistics = *log.statistics.take()?;
        Some(KeptStatistics {
            robot: log.robot.clone(),
            measured: log.measured,
            window: number(log, window),
            statistics,
        })
    });
    taken.collect()
}

fn require(settings: &FleetSettings) -> Result<()> {
    let wrong = |key: &str, problem: String, remedy: &str| {
        Err(Error::Setting {
            key: key.into(),
            problem,
            remedy: remedy.into(),
        })
    };
    let rate = settings.false_discovery_rate;
    if !(rate > 0.0 && rate < 1.0) {
        return wrong(
            "fleet.false_discovery_rate",
            format!("{rate} is not between 0 and 1"),
            "give a share such as 0.05",
        );
    }
    if !settings.window.is_finite() || settings.window <= 0.0 {
        return wrong(
            "fleet.window",
            format!("{} s is no length of time", settings.window),
            "give a length such as 7d",
        );
    }
    if settings.draws < 20 || settings.chains == 0 {
        return wrong(
            "fleet.draws",
            format!("{} chains of {} draws", settings.chains, settings.draws),
            "use at least one chain of 20 draws",
        );
    }
    Ok(())
}

fn no_units(units: usize, left_out: &[LeftOut]) -> Error {
    let out = match left_out {
        [] => String::new(),
        [first, ..] => format!(
            ", {} logs left out, the first `{}` of `{}`: {}",
            left_out.len(),
            first.log,
            first.robot,
            first.reason.code()
        ),
    };
    Error::Statistics {
        problem: format!("{units} robots with the same model and plan{out}"),
        remedy: "give statistics of three robots at least, made with one plan and --robot NAME"
            .into(),
    }
}

fn by_unit(logs: Vec<KeptLog>) -> Vec<FleetUnit> {
    let mut units: Vec<FleetUnit> = Vec::new();
    for log in logs {
        match units.last_mut() {
            Some(unit) if unit.name == log.robot => unit.logs.push(log),
            _ => units.push(FleetUnit {
                name: log.robot.clone(),
                logs: vec![log],
            }),
        }
    }
    units
}

#[cfg(test)]
mod tests;
