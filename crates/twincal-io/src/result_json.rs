//! `result.json`, schema 1: the answer for programs. Fields are written in the order in which they stand here.
//!
//! Nothing in it depends on the machine, the clock, the number of threads or the folder: the same input, settings and
//! seed give the same bytes. Numbers are the shortest that read back the same; what is not a number is `null`.

use crate::assessment::Versioned;
use crate::context::ReportContext;
use crate::error::{Error, Result};
use serde::Serialize;
use std::collections::BTreeMap;
use twincal::Finding;
use twincal::calibrate::{
    Calibration, CompactTerm, ComponentSummary, Curve, Group, LikelihoodUsed, LogSummary,
    SweepPoint, TermSummary,
};
use twincal::lag::Lags;
use twincal::likelihood::{JointNoise, PayloadSize};
use twincal::posterior::Method;
use twincal::prior::Inclusion;
use twincal::signal::Pipeline;
use twincal::term::{Family, Status};
use twincal::validate::{Conformal, JointScore, Loss, Pit, Reliability, Scores, Split, Validation};

/// Version of this layout.
pub const SCHEMA: u64 = 1;

/// The text of `result.json`; `context` has names of model and config and the seed of all random numbers.
///
/// # Errors
/// [`Error::Internal`] if the values cannot be written.
///
/// # Example
/// ```
/// # #[path = "../../twincal/examples/two_link.rs"] mod two_link;
/// use twincal_io::{context::ReportContext, result_json::result_json};
///
/// # let fit = two_link::study()?;
/// let text = result_json(&fit, &ReportContext::default())?;
/// let result: serde_json::Value = serde_json::from_str(&text)?;
/// let components = result["components"].as_array().ok_or("no list")?;
/// let payload = components.iter().find(|own| own["name"] == "payload").ok_or("none")?;
/// assert_eq!(payload["status"], "established");
/// assert!(payload["pip"].as_f64().is_some_and(|pip| pip > 0.99));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn result_json(calibration: &Calibration, context: &ReportContext) -> Result<String> {
    let internal = |e: serde_json::Error| Error::Internal {
        what: crate::artifact::RESULT.into(),
        problem: e.to_string(),
    };
    let mut text =
        serde_json::to_string_pretty(&ResultFile::of(calibration, context)).map_err(internal)?;
    text.push('\n');
    Ok(text)
}

#[derive(Serialize)]
struct ResultFile<'a> {
    schema: u64,
    twincal: &'static str,
    model: &'a str,
    config: Option<ConfigRow<'a>>,
    assessment: Versioned,
    components: &'a [ComponentSummary],
    terms: Vec<TermRow<'a>>,
    groups: &'a [Group],
    noise: &'a [JointNoise],
    log_evidence: Option<f64>,
    prior: PriorRow,
    likelihood: &'a LikelihoodUsed,
    signal: SignalRow<'a>,
    inference: InferenceRow,
    validation: ValidationRow<'a>,
    compact: Option<CompactRow<'a>>,
    curves: &'a [Curve],
    logs: &'a [LogSummary],
    lags: Option<&'a Lags>,
    findings: &'a [Finding],
}

/// The config that was read: path as given, without the folders of an absolute one.
#[derive(Serialize)]
struct ConfigRow<'a> {
    path: &'a str,
    sha256: &'a str,
}

#[derive(Serialize)]
struct TermRow<'a> {
    name: &'a str,
    family: Family,
    unit: &'a str,
    status: String,
    pip: Option<f64>,
    pip_mcse: Option<f64>,
    mean: Option<f64>,
    sd: Option<f64>,
    interval95: Option<[f64; 2]>,
    conditional_mean: Option<f64>,
    conditional_sd: Option<f64>,
    conditional_median: Option<f64>,
    conditional_interval68: Option<[f64; 2]>,
    seen: bool,
    column_rms: Option<f64>,
    pip_sensitivity: &'a [f64],
    sandwich_sd: Option<f64>,
    words: &'a str,
}

/// The prior as used, in the form of `[prior]`.
#[derive(Serialize)]
struct PriorRow {
    slab: SlabRow,
    inclusion: Inclusion,
    expected: Vec<ExpectedRow>,
    forced: Vec<String>,
    /// Components that are in only where another is.
    heredity: BTreeMap<String, String>,
    noise: NoisePriorRow,
}

/// A family of which the user expects a number of components.
#[derive(Serialize)]
struct ExpectedRow {
    family: Family,
    components: f64,
}

#[derive(Serialize)]
struct SlabRow {
    /// The one value, or null where families have their own.
    scaled_variance: Option<f64>,
    learned: bool,
    families: Vec<FamilyRow>,
    /// sd of a payload's slab beside its prior sd, and what other sizes add to its prior odds.
    payload: PayloadSize,
}

#[derive(Serialize)]
struct FamilyRow {
    family: Family,
    scaled_variance: f64,
}

#[derive(Serialize)]
struct NoisePriorRow {
    shape: f64,
    scale: f64,
}

#[derive(Serialize)]
struct SignalRow<'a> {
    #[serde(flatten)]
    pipeline: Pipeline,
    cutoff_sweep: &'a [SweepPoint],
}

#[derive(Serialize)]
struct InferenceRow {
    method: &'static str,
    models: Option<u64>,
    chains: Option<usize>,
    draws: Option<usize>,
    r_hat: Option<f64>,
    ess: Option<f64>,
    seed: u64,
}

#[derive(Serialize)]
struct ValidationRow<'a> {
    split: &'a Split,
    signal: &'static str,
    #[serde(flatten)]
    filtered: ScoresRow<'a>,
    coverage_levels: Vec<LevelRow>,
    pit: &'a Pit,
    reliability: Vec<ReliabilityRow<'a>>,
    conformal: Option<&'a Conformal>,
    moving: ScoresRow<'a>,
    within: ScoresRow<'a>,
    beyond: ScoresRow<'a>,
    raw: ScoresRow<'a>,
    raw_moving: ScoresRow<'a>,
}

#[derive(Serialize)]
struct LevelRow {
    level: f64,
    coverage: f64,
}

/// What one joint's intervals hold.
#[derive(Serialize)]
struct ReliabilityRow<'a> {
    joint: &'a str,
    rows: u64,
    coverage_levels: Vec<LevelRow>,
    pit: &'a Pit,
}

/// The compact twin: what it holds and what it loses.
#[derive(Serialize)]
struct CompactRow<'a> {
    components: &'a [String],
    terms: &'a [CompactTerm],
    training_rmse: RivalRow<f64>,
    /// Moving filtered rows; null without any.
    heldout: Option<RivalRow<Loss>>,
}

/// The same number of the model average and of the compact twin.
#[derive(Serialize)]
struct RivalRow<T> {
    average: T,
    compact: T,
}

impl<T: Copy> RivalRow<T> {
    fn of([average, compact]: [T; 2]) -> Self {
        Self { average, compact }
    }
}

/// Scores over one set of rows.
#[derive(Serialize)]
struct ScoresRow<'a> {
    rmse_nominal: f64,
    rmse_calibrated: f64,
    coverage95: f64,
    interval_score95: f64,
    epistemic_share: f64,
    joints: &'a [JointScore],
}

impl<'a> ResultFile<'a> {
    fn of(calibration: &'a Calibration, context: &'a ReportContext) -> Self {
        Self {
            schema: SCHEMA,
            twincal: env!("CARGO_PKG_VERSION"),
            model: &context.model,
            config: context.config.as_ref().map(|config| ConfigRow {
                path: &config.name,
                sha256: &config.sha256,
            }),
            assessment: Versioned::of(calibration),
            components: &calibration.components,
            terms: calibration.terms.iter().map(TermRow::of).collect(),
            groups: &calibration.groups,
            noise: &calibration.noise,
            log_evidence: calibration.twin.posterior.log_evidence,
            prior: PriorRow::of(calibration),
            likelihood: &calibration.likelihood,
            signal: SignalRow {
                // What was used: kept rows stand whole samples apart.
                pipeline: Pipeline {
                    rate_hz: calibration.kept_rate_hz(),
                    ..calibration.twin.pipeline.clone()
                },
                cutoff_sweep: &calibration.sweep,
            },
            inference: InferenceRow::of(&calibration.twin.posterior.method, context.seed),
            validation: ValidationRow::of(&calibration.validation),
            compact: CompactRow::of(calibration),
            curves: &calibration.curves,
            logs: &calibration.logs,
            lags: calibration.lags.as_ref(),
            findings: &calibration.findings,
        }
    }
}

impl<'a> TermRow<'a> {
    fn of(summary: &'a TermSummary) -> Self {
        Self {
            name: &summary.term.name,
            family: summary.term.family,
            unit: &summary.term.unit,
            status: status_word(&summary.term.status),
            pip: summary.pip,
            pip_mcse: summary.pip_mcse,
            mean: summary.mean,
            sd: summary.sd,
            interval95: summary.interval95,
            conditional_mean: summary.conditional_mean,
            conditional_sd: summary.conditional_sd,
            conditional_median: summary.conditional_median,
            conditional_interval68: summary.conditional_interval68,
            seen: summary.seen,
            column_rms: summary.column_rms,
            pip_sensitivity: &summary.pip_sensitivity,
            sandwich_sd: summary.sandwich_sd,
            words: &summary.words,
        }
    }
}

/// `candidate`, or why a term is no column.
pub fn status_word(status: &Status) -> String {
    match status {
        Status::Candidate => "candidate".into(),
        Status::AliasOf(name) => format!("alias_of:{name}"),
        Status::NullLagrangian => "null_lagrangian".into(),
        Status::ZeroColumn => "zero_column".into(),
    }
}

impl PriorRow {
    fn of(calibration: &Calibration) -> Self {
        let prior = &calibration.prior;
        let first = prior.scaled_variance.first().map(|(_, v)| *v);
        let same = prior.scaled_variance.iter().all(|(_, v)| Some(*v) == first);
        let families = prior.scaled_variance.iter();
        Self {
            slab: SlabRow {
                scaled_variance: first.filter(|_| same),
                learned: prior.learned,
                families: families
                    .map(|&(family, scaled_variance)| FamilyRow {
                        family,
                        scaled_variance,
                    })
                    .collect(),
                payload: prior.payload,
            },
            inclusion: prior.inclusion,
            expected: (prior.families.iter())
                .map(|&(family, components)| ExpectedRow { family, components })
                .collect(),
            forced: prior.forced.clone(),
            heredity: prior.heredity.iter().cloned().collect(),
            noise: NoisePriorRow {
                shape: prior.shape,
                scale: prior.scale,
            },
        }
    }
}

impl InferenceRow {
    fn of(method: &Method, seed: u64) -> Self {
        match *method {
            Method::Exact { models } => Self {
                method: "exact",
                models: Some(models),
                chains: None,
                draws: None,
                r_hat: None,
                ess: None,
                seed,
            },
            Method::Search { models, .. } => Self {
                method: "search",
                models: Some(models),
                chains: None,
                draws: None,
                r_hat: None,
                ess: None,
                seed,
            },
            Method::Gibbs {
                chains,
                draws,
                r_hat,
                ess,
            } => Self {
                method: "gibbs",
                models: None,
                chains: Some(chains),
                draws: Some(draws),
                r_hat: Some(r_hat),
                ess: Some(ess),
                seed,
            },
            Method::Fleet { chains, draws, .. } => Self {
                method: "fleet",
                models: None,
                chains: Some(chains),
                draws: Some(draws),
                r_hat: None,
                ess: None,
                seed,
            },
        }
    }
}

impl<'a> ValidationRow<'a> {
    fn of(validation: &'a Validation) -> Self {
        Self {
            split: &validation.split,
            signal: "filtered",
            filtered: ScoresRow::of(&validation.filtered),
            coverage_levels: levels(&validation.coverage_levels),
            pit: &validation.pit,
            reliability: validation
                .reliability
                .iter()
                .map(ReliabilityRow::of)
                .collect(),
            conformal: validation.conformal.as_ref(),
            moving: ScoresRow::of(&validation.moving),
            within: ScoresRow::of(&validation.within),
            beyond: ScoresRow::of(&validation.beyond),
            raw: ScoresRow::of(&validation.raw),
            raw_moving: ScoresRow::of(&validation.raw_moving),
        }
    }
}

fn levels(levels: &[(f64, f64)]) -> Vec<LevelRow> {
    let row = |&(level, coverage): &(f64, f64)| LevelRow { level, coverage };
    levels.iter().map(row).collect()
}

impl<'a> ReliabilityRow<'a> {
    fn of(reliability: &'a Reliability) -> Self {
        Self {
            joint: &reliability.joint,
            rows: reliability.rows,
            coverage_levels: levels(&reliability.coverage_levels),
            pit: &reliability.pit,
        }
    }
}

impl<'a> CompactRow<'a> {
    fn of(calibration: &'a Calibration) -> Option<Self> {
        let compact = calibration.compact.as_ref()?;
        Some(Self {
            components: &compact.components,
            terms: &compact.terms,
            training_rmse: RivalRow::of(compact.training_rmse),
            heldout: calibration.validation.compact.map(RivalRow::of),
        })
    }
}

impl<'a> ScoresRow<'a> {
    fn of(scores: &'a Scores) -> Self {
        Self {
            rmse_nominal: scores.rmse_nominal,
            rmse_calibrated: scores.rmse_calibrated,
            coverage95: scores.coverage95,
            interval_score95: scores.interval_score95,
            epistemic_share: scores.epistemic_share,
            joints: &scores.joints,
        }
    }
}
