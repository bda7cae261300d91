//! One posterior over the robots of a type, from the statistics of their logs: what is wrong with the model file of all, what one robot has
//! more than the others, and since when.

mod deviations;
mod discoveries;
mod hierarchy;
mod logs;
mod noise;
mod posterior;
mod result;
mod sampler;
mod scatter;
mod twins;

pub use logs::{LeftOut, Reason};
pub use result::{
    CoursePoint, DeviationSummary, FleetResult, TypeEffect, UnitSummary, Value, WindowSpan,
};
pub use twins::FleetTwin;

use crate::calibrate::{CalibrationSettings, Statistics};
use crate::error::{Error, Result};
use crate::gram::Gram;
use crate::likelihood::Columns;
use crate::posterior::Method;
use crate::robot::Robot;
use crate::term::{Family as TermFamily, Library};
use hierarchy::{Hierarchy, Scatter, UnitSums, Window};
use logs::{Family, KeptLog, KeptStatistics};
use noise::Noise;
use posterior::Length;
use std::collections::BTreeSet;
use twins::Twins;

/// Robots in which noise is measured: so many to twice as many, evenly in the order of their files.
const MEASURED: usize = 5;
/// Factor on the probability of a deviation in what seldom changes on a robot in service, and in the body of a link.
const SELDOM: f64 = 0.1;
const BODY: f64 = 1e-3;
/// 5 January 1970 was a Monday: windows of a week begin on Mondays, s.
const MONDAY: f64 = 4.0 * 86_400.0;

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
        let (family, mut left_out) =
            logs::largest(self.families).ok_or_else(|| no_units(0, &[]))?;
        let (kept, more) = logs::sifted(family.logs);
        left_out.extend(more);
        left_out.sort_by(|a, b| (&a.robot, &a.log).cmp(&(&b.robot, &b.log)));
        let mut units = by_unit(kept);
        if units.len() < 3 {
            return Err(no_units(units.len(), &left_out));
        }
        require_twins(&self.twins, &units)?;
        let mut calibration = settings.calibration.clone();
        calibration.library = family.plan.library.clone();
        calibration.noise.model = family.plan.noise;
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

/// The logs of one unit, by window.
#[derive(Debug)]
struct FleetUnit {
    name: String,
    logs: Vec<KeptLog>,
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

/// Windows that hold a log of the fleet, in time; logs without a date are in one of their own before all others.
fn spans(units: &[FleetUnit], window: f64) -> Vec<WindowSpan> {
    let logs = units.iter().flat_map(|unit| &unit.logs);
    let mut numbers: Vec<Option<i64>> = logs.map(|log| number(log, window)).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let span = |number: Option<i64>| WindowSpan {
        number,
        since: number.map(|n| n as f64 * window + MONDAY),
    };
    numbers.into_iter().map(span).collect()
}

fn number(log: &KeptLog, window: f64) -> Option<i64> {
    let start = log.since_1970()?;
    Some(((start - MONDAY) / window).floor() as i64)
}

/// What is known before the hierarchy: candidates, columns and noise.
#[derive(Debug)]
struct Known {
    library: Library,
    columns: Columns,
    noise: Noise,
    /// Names of the units, with their files.
    units: Vec<UnitLogs>,
    /// Zero columns of the library before it.
    zero: Vec<usize>,
    factors: Vec<Vec<f64>>,
}

/// Names of a unit and of its logs.
#[derive(Debug, Clone)]
struct UnitLogs {
    name: String,
    logs: Vec<String>,
    rows: usize,
}

impl Known {
    fn new(robot: &Robot, units: &[FleetUnit], settings: &CalibrationSettings) -> Result<Self> {
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
        let noise = noise::measure(&measured, &zero, &columns, settings)?;
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
    fn hierarchy(&self, units: Vec<FleetUnit>, (spans, window): (&[WindowSpan], f64)) -> Hierarchy {
        use rayon::prelude::*;
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
    fn groups(&self) -> Vec<Group> {
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
struct Group {
    /// Of its component in the library.
    index: usize,
    columns: Vec<usize>,
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

#[cfg(test)]
mod tests;
