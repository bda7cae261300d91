//! From posterior to what people read: terms, statuses, groups, sensitivity, autocorrelation.

use super::calibration::ends;
use super::calibration::{
    Calibration, ComponentSummary, Draws, Group, LikelihoodUsed, PriorUsed, TermSummary,
};
use super::common_gain;
use super::components::{NOT_SEEN, components};
use super::drive_scale::{self, DriveScale};
use super::groups::{groups, told_as};
use super::settle;
use crate::calibrate::checks::prior_conflict;
use crate::calibrate::checks::sandwich::{self, Sds};
use crate::calibrate::checks::sweep::SweepPoint;
use crate::calibrate::data::facts::Facts;
use crate::calibrate::fit::compact::Compact;
use crate::calibrate::settings::CalibrationSettings;
use crate::error::{Code, Finding, Result, Severity};
use crate::infer::approximate;
use crate::likelihood::{Columns, mean_squares};
use crate::plug_in::Fit;
use crate::posterior::draws::draw;
use crate::posterior::summary::{ColumnSummary, summarise as summarise_columns};
use crate::posterior::{Posterior, Problem};
use crate::prior::Inclusion;
use crate::signal::Auto;
use crate::statistics::{Spectrum, Sums};
use crate::term::Library;
use crate::twin::Twin;
use crate::validate::Validation;
use rayon::prelude::*;

/// Lags of the residual autocorrelation, rows.
const LAGS: usize = 20;
/// Terms in the pair plot at most, and draws of each.
const PAIR_PLOT: (usize, usize) = (8, 1000);
/// Posterior sd in prior sd above which the data do not see a coefficient.
const WIDE: f64 = 0.9;
/// Random stream of those draws.
const DRAW_STREAM: u64 = 1 << 32;

/// What was computed to check the answer.
pub(in crate::calibrate) struct SecondOpinion {
    /// Per column.
    pub(in crate::calibrate) sandwich: Vec<Option<f64>>,
    pub(in crate::calibrate) compact: Compact,
}

/// What [`summarise`] joins.
pub(in crate::calibrate) struct Pieces<'a> {
    pub(in crate::calibrate) twin: Twin,
    pub(in crate::calibrate) library: &'a Library,
    pub(in crate::calibrate) facts: &'a Facts,
    /// Of all rows.
    pub(in crate::calibrate) sums: &'a Sums,
    pub(in crate::calibrate) columns: &'a Columns,
    pub(in crate::calibrate) settings: &'a CalibrationSettings,
    pub(in crate::calibrate) fit: Fit,
    pub(in crate::calibrate) validation: Validation,
    pub(in crate::calibrate) sweep: Vec<SweepPoint>,
    pub(in crate::calibrate) opinion: SecondOpinion,
    /// The posterior is that of a fleet: it has no other prior, and left-out rows of one robot decide nothing.
    pub(in crate::calibrate) pooled: bool,
}

/// Everything a reader gets, from the pieces of [`crate::calibrate::calibrate`].
///
/// # Errors
/// Those of [`approximate`] under other priors.
pub(in crate::calibrate) fn summarise(
    pieces: Pieces<'_>,
    findings: &mut Vec<Finding>,
) -> Result<Calibration> {
    let Pieces {
        library,
        facts,
        sums,
        columns,
        settings,
        ref fit,
        ref opinion,
        ..
    } = pieces;
    let drive_sd = drive_scale::left(settings.drive_gain_sd, facts.payloads.iter().copied());
    let scale = DriveScale::new(drive_sd, library, &fit.problem, &fit.posterior);
    findings.extend(drive_scale::ignored(drive_sd, scale.as_ref(), library));
    findings.extend(scale.as_ref().and_then(DriveScale::finding));
    let scale = scale.as_ref();
    let terms = judged_terms(&pieces, scale, findings)?;
    let apart = facts.payload_apart.then(|| library.with_payload_apart());
    let told_apart = apart.as_ref().unwrap_or(library);
    let seed = settings.inference.seed;
    let (components, groups) = settled(&pieces, told_apart, &terms, scale);
    findings.extend(common_gain::finding(
        &components,
        settings.drive_gain_sd > 0.0,
    ));
    let prior = prior_used(library, columns, settings, fit);
    findings.extend(prior.forced.iter().map(forced));
    findings.extend(findings_of_posterior(&groups, &fit.problem, sums));
    Ok(Calibration {
        noise: pieces.twin.noise.clone(),
        curves: Vec::new(),
        lags: None,
        draws: pair_plot_draws(library, columns, &terms, &fit.posterior, seed),
        twin: pieces.twin,
        terms,
        components,
        prior,
        likelihood: LikelihoodUsed {
            model: settings.noise.model,
            rounds: fit.rounds,
        },
        groups,
        sweep: pieces.sweep,
        compact: Some(opinion.compact.clone()),
        problem: (!pieces.pooled).then(|| fit.problem.clone()),
        validation: pieces.validation,
        autocorrelation: autocorrelation(sums, &fit.posterior.mean),
        logs: facts.summaries.clone(),
        findings: std::mem::take(findings),
    })
}

/// Components and groups with their statuses; `told_apart` is the library, the payload apart from its link where the logs tell it.
fn settled(
    pieces: &Pieces<'_>,
    told_apart: &Library,
    terms: &[TermSummary],
    scale: Option<&DriveScale>,
) -> (Vec<ComponentSummary>, Vec<Group>) {
    let (fit, sums) = (&pieces.fit, pieces.sums);
    let seed = pieces.settings.inference.seed;
    let mut components = components(told_apart, &fit.posterior, terms, seed, scale);
    let told = told_as(&fit.problem, &fit.posterior, told_apart);
    for (component, told_as) in components.iter_mut().zip(told) {
        component.told_as = told_as;
    }
    let mut groups = groups(&fit.problem, &fit.posterior, told_apart);
    if pieces.pooled {
        settle::by_probability(&mut components, &mut groups);
    } else {
        settle::settle(&mut components, &mut groups, fit, told_apart, sums);
    }
    (components, groups)
}

/// Every term, with what blocks of rows and the prior say of it.
fn judged_terms(
    pieces: &Pieces<'_>,
    scale: Option<&DriveScale>,
    findings: &mut Vec<Finding>,
) -> Result<Vec<TermSummary>> {
    let Pieces {
        library,
        columns,
        settings,
        fit,
        opinion,
        ..
    } = pieces;
    let squares = mean_squares(&fit.gram, columns.names.len(), &fit.plug_in.weight);
    let rms: Vec<f64> = squares.into_iter().map(f64::sqrt).collect();
    let sensitivity = match pieces.pooled {
        true => vec![Vec::new(); columns.names.len()],
        false => sensitivity(&fit.problem, &fit.posterior)?,
    };
    let mut terms = terms(library, fit, &rms, &sensitivity, scale);
    for (&index, sd) in library.columns().iter().zip(&opinion.sandwich) {
        terms[index].sandwich_sd = *sd;
    }
    let sds = terms.iter().map(|term| Sds {
        term: &term.term.name,
        sandwich: term.sandwich_sd,
        likelihood: term.conditional_sd,
    });
    findings.extend(sandwich::findings(sds));
    let conditional: Vec<(f64, f64)> = (library.columns().iter())
        .map(|&index| {
            let number = |value: Option<f64>| value.unwrap_or(0.0);
            let term = &terms[index];
            (number(term.conditional_mean), number(term.conditional_sd))
        })
        .collect();
    findings.extend(prior_conflict::findings(
        columns,
        &settings.prior,
        &fit.problem,
        &fit.posterior,
        &conditional,
    ));
    Ok(terms)
}

/// The prior as it was used.
fn prior_used(
    library: &Library,
    columns: &Columns,
    settings: &CalibrationSettings,
    fit: &Fit,
) -> PriorUsed {
    let names = names(library, columns);
    let is_forced = |(_, forced): &(&String, &bool)| **forced;
    let mut sure: Vec<String> = (names.iter().zip(&columns.forced))
        .filter(is_forced)
        .map(|(name, _)| name.clone())
        .collect();
    sure.dedup();
    let families = columns.families.iter().copied();
    PriorUsed {
        scaled_variance: families
            .zip(fit.plug_in.scaled_variance.iter().copied())
            .collect(),
        learned: settings.prior.scaled_variance == Auto::Auto,
        payload: fit.plug_in.payload,
        inclusion: fit.problem.prior.inclusion,
        families: settings.prior.families.clone(),
        forced: sure,
        heredity: (columns.parent.iter().enumerate())
            .filter_map(|(c, parent)| Some((names[c].clone(), names[(*parent)?].clone())))
            .filter(|(child, parent)| child != parent)
            .collect(),
        shape: fit.problem.prior.shape,
        scale: fit.problem.prior.scale,
    }
}

/// Draws of the terms in the pair plot.
fn pair_plot_draws(
    library: &Library,
    columns: &Columns,
    terms: &[TermSummary],
    posterior: &Posterior,
    seed: u64,
) -> Draws {
    let selected = pair_plot_columns(library, terms);
    let draws = draw(posterior, PAIR_PLOT.1, seed, DRAW_STREAM);
    let of_column = |&k: &usize| {
        let values = draws.beta.iter().skip(k).step_by(draws.columns);
        values.copied().collect()
    };
    Draws {
        terms: selected.iter().map(|&k| columns.names[k].clone()).collect(),
        values: selected.iter().map(of_column).collect(),
    }
}

/// Name of each component.
fn names(library: &Library, columns: &Columns) -> Vec<String> {
    let mut names = vec![String::new(); columns.family.len()];
    for (&component, &index) in columns.component.iter().zip(library.columns()) {
        let own = library.terms()[index].component;
        names[component].clone_from(&library.components()[own].name);
    }
    names
}

/// A probability that is nobody's evidence.
fn forced(name: &String) -> Finding {
    Finding::new(
        Severity::Note,
        Code::Forced,
        name.clone(),
        format!(
            "`{name}` is in because prior.forced says so, or names what needs it: its probability of 1 is no evidence"
        ),
        0,
    )
}

/// PIPs under slab variance × 0.1, 1, 10 and expected terms (or prior odds) × 0.5, 2: five values per column.
fn sensitivity(problem: &Problem, posterior: &Posterior) -> Result<Vec<Vec<f64>>> {
    let mut variants = Vec::new();
    for factor in [0.1, 1.0, 10.0] {
        let mut variant = problem.clone();
        variant.prior.slab.iter_mut().for_each(|v| *v *= factor);
        variants.push(variant);
    }
    for factor in [0.5, 2.0] {
        let mut variant = problem.clone();
        let components = problem.prior.components();
        variant.prior.inclusion = scaled(problem.prior.inclusion, factor, components);
        variants.push(variant);
    }
    let pips: Vec<Vec<f64>> = variants
        .par_iter()
        .map(|variant| approximate(variant, Some(posterior)).map(|posterior| posterior.inclusion))
        .collect::<Result<_>>()?;
    Ok((0..problem.names.len())
        .map(|k| pips.iter().map(|p| p[k]).collect())
        .collect())
}

/// The inclusion prior with its expected number of terms, or its odds, multiplied.
fn scaled(inclusion: Inclusion, factor: f64, columns: usize) -> Inclusion {
    match inclusion {
        Inclusion::ExpectedTerms(m) => {
            let m = factor * m;
            Inclusion::ExpectedTerms(if m < columns as f64 {
                m
            } else {
                0.5 * (m / factor + columns as f64)
            })
        }
        Inclusion::Probability(p) => {
            let odds = factor * p / (1.0 - p);
            Inclusion::Probability(odds / (1.0 + odds))
        }
    }
}

fn terms(
    library: &Library,
    fit: &Fit,
    rms: &[f64],
    sensitivity: &[Vec<f64>],
    scale: Option<&DriveScale>,
) -> Vec<TermSummary> {
    let (posterior, problem) = (&fit.posterior, &fit.problem);
    let summaries = summarise_columns(posterior);
    library
        .terms()
        .iter()
        .enumerate()
        .map(|(index, term)| {
            let Some(k) = library.columns().iter().position(|&c| c == index) else {
                return dropped(term);
            };
            let s = &summaries[k];
            let prior_sd = (posterior.noise * problem.prior.slab[k]).sqrt();
            let seen = s.conditional_sd.is_none_or(|sd| sd <= WIDE * prior_sd);
            let mut widened = *s;
            scale.iter().for_each(|scale| scale.widen(k, &mut widened));
            let s = &widened;
            TermSummary {
                term: term.clone(),
                pip: Some(s.pip),
                pip_mcse: Some(s.pip_mcse),
                mean: Some(s.mean),
                sd: Some(s.sd),
                interval95: Some(s.interval95),
                conditional_mean: s.conditional_mean,
                conditional_sd: s.conditional_sd,
                conditional_median: s.conditional_median,
                conditional_interval68: s.conditional_interval68,
                seen,
                column_rms: Some(rms[k]),
                pip_sensitivity: sensitivity[k].clone(),
                sandwich_sd: None,
                words: if seen {
                    let (value, spread, ends) = told(s);
                    library.words(index, value, spread, ends)
                } else {
                    format!("{}: {NOT_SEEN}", library.story(index))
                },
            }
        })
        .collect()
}

/// Median, half the central 68.3 % and what is told where that does not describe it; NaN where no listed model holds the column.
fn told(summary: &ColumnSummary) -> (f64, f64, Option<[f64; 2]>) {
    let (Some(median), Some(interval68)) =
        (summary.conditional_median, summary.conditional_interval68)
    else {
        return (f64::NAN, f64::NAN, None);
    };
    let spread = 0.5 * (interval68[1] - interval68[0]);
    let interval95 = summary.conditional_interval95;
    let ends = interval95.and_then(|interval95| ends(median, spread, interval68, interval95));
    (median, spread, ends)
}

fn dropped(term: &crate::term::Term) -> TermSummary {
    TermSummary {
        term: term.clone(),
        pip: None,
        pip_mcse: None,
        mean: None,
        sd: None,
        interval95: None,
        conditional_mean: None,
        conditional_sd: None,
        conditional_median: None,
        conditional_interval68: None,
        seen: false,
        column_rms: None,
        pip_sensitivity: Vec::new(),
        sandwich_sd: None,
        words: String::new(),
    }
}

fn findings_of_posterior(groups: &[Group], problem: &Problem, sums: &Sums) -> Vec<Finding> {
    let mut findings = Vec::new();
    let measured: f64 = sums.torque_squares().iter().sum();
    if problem.yy <= 1e-18 * measured {
        findings.push(Finding::new(
            Severity::Note,
            Code::NothingToCorrect,
            "",
            "the nominal model explains the torque to rounding: nothing to correct",
            0,
        ));
    }
    for group in groups {
        let severity = if group.settled {
            Severity::Note
        } else {
            Severity::Warning
        };
        findings.push(
            Finding::new(
                severity,
                Code::AlikeInData,
                group.members.join(", "),
                group.words.clone(),
                group.members.len() as u64,
            )
            .with([("pip", group.pip)]),
        );
    }
    findings
}

/// Columns of the pair plot: of the selected ones those with the largest value against its spread.
fn pair_plot_columns(library: &Library, terms: &[TermSummary]) -> Vec<usize> {
    let of = |k: usize| &terms[library.columns()[k]];
    let mut selected: Vec<usize> = (0..library.columns().len())
        .filter(|&k| of(k).seen && of(k).pip.is_some_and(|pip| pip >= 0.5))
        .collect();
    let strength = |k: usize| match (of(k).conditional_median, of(k).interval95) {
        (Some(median), Some([low, high])) => {
            median.abs() / (0.5 * (high - low)).max(f64::MIN_POSITIVE)
        }
        _ => 0.0,
    };
    selected.sort_by(|&a, &b| strength(b).total_cmp(&strength(a)).then(a.cmp(&b)));
    selected.truncate(PAIR_PLOT.0);
    selected.sort_unstable();
    selected
}

/// Per joint: normalised autocorrelation of the residual before and after calibration, lags 0..=20 rows each.
fn autocorrelation(sums: &Sums, beta: &[f64]) -> Vec<Vec<f64>> {
    let nothing = vec![0.0; beta.len()];
    let of_joint = |spectrum: &Spectrum| {
        [&nothing[..], beta].map(|beta| spectrum.autocorrelation(beta, LAGS + 1))
    };
    sums.spectra.iter().flat_map(of_joint).collect()
}
