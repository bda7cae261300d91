//! Gathers what the template shows and fills it; the one place where values become HTML.

use super::ReportContext;
use super::ambiguity;
use super::effects::{self, Effects};
use super::figure::Figure;
use super::figures;
use super::findings;
use super::first_screen::{self, Number, Use};
use super::honesty;
use super::script;
use super::standstill;
use super::tables::{self, Table};
use super::text;
use super::traces;
use super::verdict::{self, Verdict};
use super::view::{self, Joint};
use crate::words;
use minijinja::syntax::SyntaxConfig;
use minijinja::value::{Serde, Value};
use minijinja::{Environment, ErrorKind, UndefinedBehavior, escape_formatter};
use serde::Serialize;
use twincal::assess;
use twincal::calibrate::Calibration;

/// Traces drawn beyond the first of each joint, over all joints: the page stays below two megabytes.
const OTHER_TRACES: usize = 16;

/// Letters of a word in a sentence that are kept on one line.
const LONG: usize = 24;

/// The names that the template knows.
#[derive(Debug, Serialize)]
struct Page<'a> {
    run: &'a ReportContext,
    /// Files and amount of data, in one line.
    about: String,
    verdict: Verdict,
    numbers: [Number; 3],
    #[serde(rename = "use")]
    use_of: Use,
    /// The joint that is shown first, for readers without script and for print.
    hero: Option<Figure>,
    /// The data block of the script as JSON; empty without held-out rows.
    traces: String,
    script: String,
    /// What lets the script run.
    script_source: String,
    plot_style: &'static str,
    effects: Effects,
    inclusion: Option<Figure>,
    pairs: Option<Figure>,
    /// Which coefficients the figure of pairs shows, where it does not show all; may be empty.
    pairs_shown: String,
    curves: Option<Figure>,
    /// The joints besides the first one.
    torque: Vec<Figure>,
    other_torque: Vec<Figure>,
    residual_time: Option<Figure>,
    residual_state: Option<Figure>,
    autocorrelation: Option<Figure>,
    #[serde(flatten)]
    held_out: HeldOut,
    compact: Vec<String>,
    sensitivity: Option<Figure>,
    noise: Table,
    /// What the data leave open, a sentence each.
    open: Vec<String>,
    motion: Table,
    logs: Table,
    findings: Vec<findings::Kind>,
    convergence: Vec<String>,
    pipeline: Vec<String>,
}

/// What held-out rows say of the predictions.
#[derive(Debug, Serialize)]
struct HeldOut {
    coverage: Option<Figure>,
    pit: Option<Figure>,
    reliability: Table,
    guarantee: String,
    scores: Table,
    all_rows: Table,
    /// Whether some held-out rows are of joints that stand still.
    standstill: bool,
    at_rest: Table,
    beyond: Table,
    raw: Table,
    /// The same of moving joints; empty where none stands still.
    raw_moving: Table,
}

/// The page as HTML.
pub(super) fn fill(
    calibration: &Calibration,
    run: &ReportContext,
) -> Result<String, minijinja::Error> {
    let mut environment = environment()?;
    environment.add_template("report.html", include_str!("report.html"))?;
    environment.add_template("report.css", include_str!("report.css"))?;
    let joints = view::joints(calibration);
    let page = gather(calibration, run, &joints)
        .map_err(|error| minijinja::Error::new(ErrorKind::BadSerialization, error.to_string()))?;
    environment
        .get_template("report.html")?
        .render(Serde(&page))
}

/// Templates in which every string is cleaned and escaped, with the filters for names and sentences.
pub(super) fn environment() -> Result<Environment<'static>, minijinja::Error> {
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    environment.set_syntax(
        SyntaxConfig::builder()
            .trim_blocks(true)
            .lstrip_blocks(true)
            .build()?,
    );
    // Autoescape goes by the template's name; the formatter cleans each string before it is escaped.
    environment.set_formatter(|out, state, value| match value.as_str() {
        Some(string) if !value.is_safe() => {
            escape_formatter(out, state, &Value::from(text::clean(string)))
        }
        _ => escape_formatter(out, state, value),
    });
    // Names may break after `_` and `.`, in sentences only long ones; what comes out is escaped already.
    environment.add_filter("breaks", |text: String| {
        Value::from_safe_string(text::breakable(&text, 0))
    });
    environment.add_filter("prose", |text: String| {
        Value::from_safe_string(text::breakable(&text, LONG))
    });
    Ok(environment)
}

fn gather<'a>(
    calibration: &'a Calibration,
    run: &'a ReportContext,
    joints: &[Joint<'a>],
) -> Result<Page<'a>, serde_json::Error> {
    let terms = &calibration.terms;
    let others = OTHER_TRACES / joints.len().max(1);
    let components = &calibration.components;
    let hero = first_screen::hero(calibration, joints);
    let traces = hero.and_then(|hero| traces::traces(joints, hero, 1 + others));
    let verdict = verdict::judge(calibration);
    let script = script::text();
    Ok(Page {
        run,
        about: tables::about(calibration, run),
        numbers: first_screen::numbers(calibration),
        use_of: first_screen::use_of(verdict.answer),
        hero: hero.and_then(figures::torque::figure),
        traces: match &traces {
            Some(traces) => script::json(traces)?,
            None => String::new(),
        },
        script_source: script::source(&script),
        script,
        plot_style: script::PLOT_STYLE,
        verdict,
        effects: effects::sort(calibration),
        inclusion: figures::inclusion::figure(components, |c| calibration.sees(c)),
        pairs: figures::pairs::figure(&calibration.draws, terms),
        pairs_shown: figures::pairs::shown(&calibration.draws, terms),
        curves: figures::curves::figure(&calibration.curves, components, joints),
        torque: joints
            .iter()
            .filter(|joint| hero.is_none_or(|hero| hero.name != joint.name))
            .filter_map(figures::torque::figure)
            .collect(),
        other_torque: joints
            .iter()
            .filter_map(|j| figures::torque::others(j, others))
            .collect(),
        residual_time: figures::residual_time::figure(joints),
        residual_state: figures::residual_state::figure(joints),
        autocorrelation: figures::autocorrelation::figure(calibration, joints),
        held_out: held_out(calibration, joints),
        compact: words::compact(calibration),
        sensitivity: figures::sensitivity::figure(terms, components),
        noise: tables::noise(joints),
        open: ambiguity::sentences(calibration, joints),
        motion: tables::motion(calibration, joints),
        logs: tables::logs(calibration),
        findings: findings::findings(calibration),
        convergence: tables::convergence(calibration),
        pipeline: tables::pipeline(calibration),
    })
}

fn held_out(calibration: &Calibration, joints: &[Joint<'_>]) -> HeldOut {
    let validation = &calibration.validation;
    let independent = assess::independent_rows(calibration);
    let pit: Vec<f64> = joints
        .iter()
        .flat_map(|j| &j.traces)
        .flat_map(|t| t.pit.iter().zip(&t.standstill))
        .filter_map(|(pit, still)| (!still).then_some(*pit))
        .collect();
    HeldOut {
        coverage: figures::coverage::figure(&validation.coverage_levels, independent),
        // Traces may be thinned: then there are fewer values than rows.
        pit: figures::pit::figure(&pit, independent.min(pit.len() as f64)),
        reliability: honesty::reliability(validation),
        guarantee: words::guarantee(validation, &calibration.findings),
        scores: tables::scores(assess::decisive(validation), calibration),
        all_rows: tables::scores(&validation.filtered, calibration),
        standstill: assess::has_standstill(validation),
        at_rest: standstill::table(calibration),
        beyond: honesty::beyond(validation, joints),
        raw: tables::scores(&validation.raw, calibration),
        raw_moving: match assess::has_standstill(validation) {
            true => tables::scores(&validation.raw_moving, calibration),
            false => Table::default(),
        },
    }
}
