//! From the posterior over columns to physical stories: one line per component, with parameters that people know.

use super::calibration::{ComponentSummary, ParameterSummary, TermSummary};
use super::drive_scale::DriveScale;
use super::status::{Status, StatusReason, by_probability};
use crate::posterior::draws::{CoefficientDraws, Drawer};
use crate::posterior::{Model, Posterior};
use crate::term::{Before, Component, Estimate, Library, Parameter};
use rayon::prelude::*;

/// Draws that the parameters are worked out from.
const DRAWS: usize = 4000;
/// Fewest of them that must hold a component; for rarer ones there are draws given that it is in.
const ENOUGH: usize = 500;
/// Levels one standard deviation below and above the middle of a normal distribution.
const ONE_SD: [f64; 2] = [0.158_655, 0.841_345];
/// What is said instead of a number that is the prior's alone.
pub(in crate::calibrate) const NOT_SEEN: &str = "not seen by these data";
/// Share of the prior's sd from which on a parameter is not seen.
const UNSEEN: f64 = 0.9;
/// Share of a mass that its sd may be where its centre is told.
const OPEN: f64 = 0.5;
/// Random stream of those draws.
const STREAM: u64 = (1 << 32) + 1;

/// One summary per component of the library, in order. `terms` are the finished summaries of its terms.
pub(in crate::calibrate) fn components(
    library: &Library,
    posterior: &Posterior,
    terms: &[TermSummary],
    seed: u64,
    scale: Option<&DriveScale>,
) -> Vec<ComponentSummary> {
    let drawer = Drawer::new(posterior);
    let drawn = Drawn {
        posterior,
        all: drawer.draw(DRAWS, seed, STREAM),
        drawer,
        seed,
        scale,
    };
    (0..library.components().len())
        .into_par_iter()
        .map(|index| summary(library, index, terms, &drawn))
        .collect()
}

/// What the parameters are worked out from.
struct Drawn<'a> {
    posterior: &'a Posterior,
    drawer: Drawer<'a>,
    all: CoefficientDraws,
    seed: u64,
    scale: Option<&'a DriveScale>,
}

impl Drawn<'_> {
    /// Draws of `columns` (0 for `None`) from the models that hold `member`: those among all draws, or draws given such models
    /// if they are few.
    fn given(&self, member: u32, columns: &[Option<usize>]) -> Vec<Vec<f64>> {
        let holds = |model: &Model| model.members.contains(&member);
        let of = |draws: &CoefficientDraws| -> Vec<Vec<f64>> {
            let rows = draws.models.iter().enumerate();
            rows.filter(|(_, model)| holds(&self.posterior.models[**model as usize]))
                .map(|(row, _)| {
                    let value = |column: &Option<usize>| {
                        column.map_or(0.0, |k| draws.beta[row * draws.columns + k])
                    };
                    columns.iter().map(value).collect()
                })
                .collect()
        };
        let values = of(&self.all);
        if values.len() >= ENOUGH {
            return values;
        }
        of(&self.drawer.draw_given(holds, ENOUGH, self.seed, STREAM))
    }
}

fn summary(
    library: &Library,
    index: usize,
    terms: &[TermSummary],
    drawn: &Drawn<'_>,
) -> ComponentSummary {
    let component = &library.components()[index];
    let own: Vec<&TermSummary> = component.terms.iter().map(|&t| &terms[t]).collect();
    let live: Vec<&TermSummary> = own.iter().copied().filter(|t| t.pip.is_some()).collect();
    let mut summary = ComponentSummary {
        name: component.name.clone(),
        family: component.family,
        story: component.story.clone(),
        columns: own.iter().map(|term| term.term.name.clone()).collect(),
        pip: None,
        pip_mcse: None,
        status: Status::Unidentifiable,
        reason: StatusReason::NoColumn,
        alias_of: component.alias_of.clone(),
        told_as: None,
        no_rigid_body: false,
        rigid_share: None,
        words: String::new(),
        parameters: Vec::new(),
    };
    let Some(first) = live.first() else {
        return summary;
    };
    (summary.pip, summary.pip_mcse) = (first.pip, first.pip_mcse);
    let number = |value: Option<f64>| value.unwrap_or(f64::NAN);
    let (pip, mcse) = (number(first.pip), number(first.pip_mcse));
    (summary.status, summary.reason) = by_probability(pip, mcse, is_seen(&live));
    summary.parameters = parameters(library, component, index, &own, drawn);
    let estimates: Vec<Estimate> = summary
        .parameters
        .iter()
        .map(|p| Estimate {
            name: p.name.clone(),
            unit: p.unit.clone(),
            // What these data do not see has no value here as in the tables.
            value: if p.seen { p.told().0 } else { f64::NAN },
            spread: p.told().1,
            ends: p.ends(),
        })
        .collect();
    let held = || summary.parameters.iter().any(|p| p.median.is_finite());
    let unseen = estimates.iter().all(|p| p.value.is_nan()) && held();
    summary.words = if summary.status == Status::Unidentifiable || unseen {
        format!("{}: {NOT_SEEN}", component.story)
    } else {
        library.component_words(index, &estimates)
    };
    summary
}

/// Whether the data see one of the columns that are in or out with the first.
fn is_seen(live: &[&TermSummary]) -> bool {
    let together = |term: &&&TermSummary| term.term.family == live[0].term.family;
    live.iter().filter(together).any(|term| term.seen)
}

/// Mean, sd and central interval of every parameter, given that the component is in.
fn parameters(
    library: &Library,
    component: &Component,
    index: usize,
    own: &[&TermSummary],
    drawn: &Drawn<'_>,
) -> Vec<ParameterSummary> {
    let columns: Vec<Option<usize>> = component
        .terms
        .iter()
        .map(|term| library.columns().iter().position(|column| column == term))
        .collect();
    let Some(member) = columns.iter().flatten().next().copied() else {
        return Vec::new();
    };
    let mut given = drawn.given(member as u32, &columns);
    let scale = drawn.scale.iter();
    scale.for_each(|scale| scale.shift(&columns, &mut given, drawn.seed));
    let values: Vec<Vec<f64>> = (given.into_iter())
        .map(|beta| library.parameter_values(index, &beta))
        .collect();
    let mut parameters: Vec<ParameterSummary> = library
        .parameters(index)
        .into_iter()
        .enumerate()
        .map(|(p, parameter)| {
            let mut drawn: Vec<f64> = values.iter().map(|row| row[p]).collect();
            drawn.sort_by(f64::total_cmp);
            let term = own.get(p).copied();
            parameter_summary(library, (index, p), parameter, term, &drawn)
        })
        .collect();
    identified(library, index, &mut parameters);
    parameters
}

/// A parameter by its component and its place in it, from its `drawn` values, ascending, and the term at that place.
fn parameter_summary(
    library: &Library,
    (index, p): (usize, usize),
    parameter: Parameter,
    term: Option<&TermSummary>,
    drawn: &[f64],
) -> ParameterSummary {
    let count = drawn.len() as f64;
    let quantile = |level: f64| {
        let place = (level * (count - 1.0)).round().max(0.0) as usize;
        drawn.get(place).copied().unwrap_or(f64::NAN)
    };
    // A coefficient has exact moments. A ratio of coefficients has none where its denominator can be near zero.
    // A parameter stands at the place of its term, or mixes several. Where one of those is no column, its value is not 0 but unknown.
    let before = library.before(index, p);
    let alone = term.filter(|_| before.is_none());
    if alone.is_some_and(|term| term.pip.is_none()) || before == Some(Before::Hidden) {
        return ParameterSummary {
            name: parameter.name,
            unit: parameter.unit,
            mean: f64::NAN,
            sd: f64::NAN,
            interval95: [f64::NAN; 2],
            median: f64::NAN,
            interval68: [f64::NAN; 2],
            seen: false,
        };
    }
    let exact = term.filter(|_| library.is_coefficient(index, p));
    let moments = exact.and_then(|term| term.conditional_mean.zip(term.conditional_sd));
    let quantiles = exact.and_then(|term| term.conditional_median.zip(term.conditional_interval68));
    let (median, interval68) = quantiles.unwrap_or_else(|| (quantile(0.5), ONE_SD.map(quantile)));
    let (mean, sd) = moments.unwrap_or((median, 0.5 * (interval68[1] - interval68[0])));
    ParameterSummary {
        name: parameter.name,
        unit: parameter.unit,
        mean,
        sd,
        interval95: [quantile(0.025), quantile(0.975)],
        median,
        interval68,
        seen: match before {
            Some(Before::Width(prior)) => sd < UNSEEN * prior,
            _ => alone.is_none_or(|term| term.seen),
        },
    }
}

/// Of a mass that is open by more than half of itself there is no centre: then first moments are told, else the centre.
fn identified(library: &Library, index: usize, parameters: &mut Vec<ParameterSummary>) {
    let ratio = |p: &usize| library.before(index, *p) == Some(Before::Ratio);
    let centre: Vec<usize> = (0..parameters.len()).filter(ratio).collect();
    let Some(mass) = parameters.first_mut().filter(|_| !centre.is_empty()) else {
        return;
    };
    mass.seen &= mass.sd <= OPEN * mass.mean.abs();
    let known = mass.seen;
    for p in centre {
        parameters[p].seen &= known;
    }
    parameters.retain(|own| !(known && matches!(own.name.as_str(), "mx" | "my" | "mz")));
}
