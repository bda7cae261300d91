//! What a fleet's posterior says in physical words: effects of the type, and the units that deviate.

use super::deviations::Deviation;
use super::discoveries::named;
use super::hierarchy::{Hierarchy, dot};
use super::known::Known;
use super::logs::LeftOut;
use super::posterior::{FleetPosterior, UnitPosterior};
use super::windows::WindowSpan;
use crate::calibrate::Calibration;
use crate::term::{Family, Library};

/// Deviations less likely than this are not listed.
const LISTED: f64 = 0.1;
/// Effects of the type less likely than this are not listed.
const LISTED_TYPE: f64 = 0.01;
/// Draws of a deviation that an interval needs.
const ENOUGH: usize = 20;

/// A number with its central 95 % interval.
#[derive(Debug, Clone, PartialEq)]
pub struct Value {
    /// `mass`, `coulomb`, …
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Median.
    pub value: f64,
    /// Central 95 % interval.
    pub interval95: [f64; 2],
}

/// What is wrong with the model file of all units.
#[derive(Debug, Clone, PartialEq)]
pub struct TypeEffect {
    /// Name: `payload`, `elbow.coulomb`, …
    pub name: String,
    /// Kind of effect.
    pub family: Family,
    /// In words, with joint, link or frame: "viscous friction on elbow".
    pub story: String,
    /// P(the mean over all robots of the type is not 0).
    pub pip: f64,
    /// Mean over the type, given that it is not 0.
    pub parameters: Vec<Value>,
    /// sd of units about the mean, in the unit of the coefficient; `None` for an effect of several coefficients.
    pub scatter: Option<f64>,
}

/// What one unit has more than its type.
#[derive(Debug, Clone, PartialEq)]
pub struct DeviationSummary {
    /// Name of the effect.
    pub name: String,
    /// Kind of effect.
    pub family: Family,
    /// In words, with joint, link or frame: "viscous friction on elbow".
    pub story: String,
    /// P(the unit deviates in it).
    pub pip: f64,
    /// Difference to the type, or with `since` to the unit itself before.
    pub parameters: Vec<Value>,
    /// Most likely window that it starts with; `None`: from the unit's first window on.
    pub since: Option<WindowSpan>,
    /// P(it starts with a window | it is there), window by window of the fleet; that of the unit's first one stands for all before.
    pub onset: Vec<f64>,
    /// What each window of the unit alone says of the effect's first coefficient.
    pub course: Vec<CoursePoint>,
    /// Unit of that coefficient.
    pub unit: String,
}

/// What one window alone says of one coefficient of a unit, all others being what all windows say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoursePoint {
    /// Number of the window among [`FleetResult::windows`].
    pub window: usize,
    /// Difference to the mean of the type.
    pub value: f64,
    /// Its standard deviation, with the scatter of windows.
    pub sd: f64,
    /// The same difference as all windows together say it.
    pub mean: f64,
}

/// One robot of the fleet.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitSummary {
    /// Its name.
    pub robot: String,
    /// Whether it is named at the false discovery rate that was asked for.
    pub deviates: bool,
    /// P(it deviates in any effect).
    pub probability: f64,
    /// Most likely first.
    pub deviations: Vec<DeviationSummary>,
    /// Names of its logs.
    pub logs: Vec<String>,
    /// Rows behind the filters.
    pub rows: usize,
    /// Posterior mean of β in its last window, in the columns of [`FleetResult::columns`].
    pub mean: Vec<f64>,
    /// sd of β likewise.
    pub sd: Vec<f64>,
}

/// A robot of the fleet as a calibrated twin.
#[derive(Debug, Clone, PartialEq)]
pub struct FleetTwin {
    /// Name of the robot.
    pub robot: String,
    /// Its twin: the coefficients of its last window, given the statistics of all robots.
    pub calibration: Calibration,
}

/// The posterior of a fleet.
#[derive(Debug, Clone, PartialEq)]
pub struct FleetResult {
    /// Windows that hold logs, in time.
    pub windows: Vec<WindowSpan>,
    /// Most likely first.
    pub type_effects: Vec<TypeEffect>,
    /// Units that deviate first, most likely first, then the others by name.
    pub units: Vec<UnitSummary>,
    /// Logs that do not count, with the reason.
    pub left_out: Vec<LeftOut>,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Posterior mean of μ, column by column.
    pub mean: Vec<f64>,
    /// π: share of units that is expected to deviate in one effect.
    pub share: f64,
    /// Largest difference of a unit's probability between the chains.
    pub spread: f64,
    /// What a robot of the type does of which no log is there: the mean of the type, and how robots differ.
    pub type_twin: Option<Calibration>,
    /// Twins of the robots that [`Fleet::with_twins`](super::Fleet::with_twins) named, in the order of their names.
    pub twins: Vec<FleetTwin>,
}

/// Place of the largest number, of equal ones the first.
fn likeliest(values: &[f64]) -> usize {
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    values
        .iter()
        .position(|value| *value == largest)
        .unwrap_or(0)
}

/// What the words of a result come from.
pub(super) struct About<'a> {
    pub(super) known: &'a Known,
    pub(super) hierarchy: &'a Hierarchy,
    pub(super) spans: &'a [WindowSpan],
    pub(super) left_out: Vec<LeftOut>,
    pub(super) rate: f64,
}

/// A component of the library with its columns.
struct Named<'a> {
    library: &'a Library,
    index: usize,
    columns: Vec<usize>,
}

impl<'a> Named<'a> {
    /// With the columns of all groups of its component.
    fn whole(&self, all: &[Named<'a>]) -> Self {
        let alike = all.iter().filter(|other| other.index == self.index);
        Self {
            library: self.library,
            index: self.index,
            columns: alike.flat_map(|other| other.columns.clone()).collect(),
        }
    }

    /// Unit of its first coefficient.
    fn unit(&self) -> String {
        let term = self.library.columns()[self.columns[0]];
        self.library.terms()[term].unit.clone()
    }

    /// Medians and intervals of its parameters over draws of its columns, in natural units.
    fn values(&self, draws: &[Vec<f64>]) -> Vec<Value> {
        if draws.len() < ENOUGH {
            return Vec::new();
        }
        let component = &self.library.components()[self.index];
        let place = |term: &usize| {
            let column = self.library.columns().iter().position(|own| own == term)?;
            self.columns.iter().position(|own| *own == column)
        };
        let places: Vec<Option<usize>> = component.terms.iter().map(place).collect();
        let of_draw = |draw: &Vec<f64>| {
            let beta: Vec<f64> = (places.iter())
                .map(|place| place.map_or(0.0, |at| draw[at]))
                .collect();
            self.library.parameter_values(self.index, &beta)
        };
        let values: Vec<Vec<f64>> = draws.iter().map(of_draw).collect();
        let parameters = self.library.parameters(self.index).into_iter().enumerate();
        parameters
            .filter_map(|(p, parameter)| {
                let mut own: Vec<f64> = values.iter().map(|row| row[p]).collect();
                own.retain(|value| value.is_finite());
                own.sort_by(f64::total_cmp);
                let quantile = |level: f64| own[(level * (own.len() - 1) as f64).round() as usize];
                let shown = own.len() >= ENOUGH && own[0] != own[own.len() - 1];
                shown.then(|| Value {
                    name: parameter.name,
                    unit: parameter.unit,
                    value: quantile(0.5),
                    interval95: [quantile(0.025), quantile(0.975)],
                })
            })
            .collect()
    }
}

impl About<'_> {
    pub(super) fn result(self, posterior: &FleetPosterior) -> FleetResult {
        let components: Vec<Named<'_>> = (self.known.groups().into_iter())
            .map(|group| Named {
                library: &self.known.library,
                index: group.index,
                columns: group.columns,
            })
            .collect();
        let probabilities: Vec<f64> = posterior.units.iter().map(|unit| unit.deviates).collect();
        let deviating = named(&probabilities, self.rate);
        let count = posterior.mu.len().max(1) as f64;
        let type_mean: Vec<f64> = (0..self.hierarchy.size())
            .map(|k| posterior.mu.iter().map(|mu| mu[k]).sum::<f64>() / count)
            .collect();
        let mut units: Vec<UnitSummary> = (posterior.units.iter().enumerate())
            .map(|(at, unit)| self.unit((at, unit), (&components, &type_mean), deviating[at]))
            .collect();
        units.sort_by(|a, b| {
            let key = |unit: &UnitSummary| (!unit.deviates, -unit.probability);
            let ((x, p), (y, q)) = (key(a), key(b));
            let by_name = a.robot.cmp(&b.robot);
            if x || y {
                x.cmp(&y).then(by_name)
            } else {
                p.total_cmp(&q).then(by_name)
            }
        });
        let mut type_effects: Vec<TypeEffect> = (components.iter().enumerate())
            .filter(|(at, own)| *at == 0 || components[at - 1].index != own.index)
            .map(|(at, own)| self.type_effect((at, &own.whole(&components)), posterior))
            .filter(|effect| effect.pip >= LISTED_TYPE)
            .collect();
        type_effects.sort_by(|a, b| b.pip.total_cmp(&a.pip).then(a.name.cmp(&b.name)));
        FleetResult {
            windows: self.spans.to_vec(),
            type_effects,
            units,
            columns: self.hierarchy.names.clone(),
            mean: (type_mean.iter().enumerate())
                .map(|(k, mean)| mean * self.root(k))
                .collect(),
            share: self.hierarchy.plug_in.share,
            spread: posterior.spread,
            left_out: self.left_out,
            type_twin: None,
            twins: Vec::new(),
        }
    }

    /// √d_k.
    fn root(&self, column: usize) -> f64 {
        self.known.noise.slab[column].sqrt()
    }

    fn natural(&self, columns: &[usize], draw: impl Iterator<Item = f64>) -> Vec<f64> {
        columns
            .iter()
            .zip(draw)
            .map(|(&k, x)| self.root(k) * x)
            .collect()
    }

    fn type_effect(
        &self,
        (at, own): (usize, &Named<'_>),
        posterior: &FleetPosterior,
    ) -> TypeEffect {
        let component = &own.library.components()[own.index];
        let first = own.columns[0];
        let draws: Vec<Vec<f64>> = (posterior.mu.iter())
            .filter(|mu| mu[first] != 0.0)
            .map(|mu| self.natural(&own.columns, own.columns.iter().map(|&k| mu[k])))
            .collect();
        let scatter = self.hierarchy.plug_in.variance[at].sqrt() * self.root(first);
        TypeEffect {
            name: component.name.clone(),
            family: component.family,
            story: component.story.clone(),
            pip: posterior.inclusion[first],
            parameters: own.values(&draws),
            scatter: (own.columns.len() == 1).then_some(scatter),
        }
    }

    fn unit(
        &self,
        (at, unit): (usize, &UnitPosterior),
        (components, type_mean): (&[Named<'_>], &[f64]),
        deviates: bool,
    ) -> UnitSummary {
        let about = &self.known.units[at];
        let last: &[f64] = unit.means.last().map_or(&[], Vec::as_slice);
        let listed = (0..components.len()).filter(|&c| unit.inclusion[c] >= LISTED);
        let mut deviations: Vec<DeviationSummary> = listed
            .map(|c| self.deviation((at, unit), (c, &components[c]), type_mean))
            .collect();
        deviations.sort_by(|a, b| b.pip.total_cmp(&a.pip).then(a.name.cmp(&b.name)));
        UnitSummary {
            robot: about.name.clone(),
            deviates,
            probability: unit.deviates,
            deviations,
            logs: about.logs.clone(),
            rows: about.rows,
            mean: (last.iter().enumerate())
                .map(|(k, mean)| mean * self.root(k))
                .collect(),
            sd: (unit
                .second
                .iter()
                .step_by(last.len() + 1)
                .zip(last)
                .enumerate())
            .map(|(k, (square, mean))| (square - mean * mean).max(0.0).sqrt() * self.root(k))
            .collect(),
        }
    }

    fn deviation(
        &self,
        (at, unit): (usize, &UnitPosterior),
        (c, own): (usize, &Named<'_>),
        type_mean: &[f64],
    ) -> DeviationSummary {
        let component = &own.library.components()[own.index];
        let starts = &unit.starts[c];
        let total: f64 = starts.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        // First whether it was there from the start, then with which later window it came.
        let later: f64 = starts.iter().skip(1).sum();
        let start = match starts.first() {
            Some(first) if later > *first => likeliest(&starts[1..]) + 1,
            _ => 0,
        };
        let windows = &self.hierarchy.units[at].windows;
        let mut onset = vec![0.0; self.spans.len()];
        for (window, share) in windows.iter().zip(starts) {
            onset[window.index] = share / total;
        }
        // A change is the difference to the unit before, what was there from the start the one to the type.
        let alike = |found: &Deviation| (found.start == 0) == (start == 0);
        let draws: Vec<Vec<f64>> = (unit.draws.iter())
            .filter(|(found, _)| found.component == c && alike(found))
            .map(|(_, b)| self.natural(&own.columns, b.iter().copied()))
            .collect();
        DeviationSummary {
            name: component.name.clone(),
            family: component.family,
            story: component.story.clone(),
            pip: unit.inclusion[c],
            parameters: own.values(&draws),
            since: (start > 0).then(|| self.spans[windows[start].index]),
            onset,
            unit: own.unit(),
            course: self.course((at, unit), own.columns[0], type_mean),
        }
    }

    /// Window by window: (η_t − Λ_t β)_k / Λ_t,kk with β_k = 0 and all else at its mean.
    fn course(
        &self,
        (at, unit): (usize, &UnitPosterior),
        column: usize,
        type_mean: &[f64],
    ) -> Vec<CoursePoint> {
        let size = self.hierarchy.size();
        let scatter = self.hierarchy.window_scatter()[column];
        let windows = self.hierarchy.units[at].windows.iter().zip(&unit.means);
        windows
            .filter_map(|(window, mean)| {
                let row = &window.precision[column * size..(column + 1) * size];
                let own = row[column];
                let explained = dot(row, mean) - own * mean[column];
                let scale = self.root(column);
                (own > 0.0).then(|| CoursePoint {
                    window: window.index,
                    value: scale * ((window.score[column] - explained) / own - type_mean[column]),
                    sd: scale * (1.0 / own + scatter).sqrt(),
                    mean: scale * (mean[column] - type_mean[column]),
                })
            })
            .collect()
    }
}
