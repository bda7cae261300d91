//! The page of a designed motion: words, numbers and curves come in, HTML goes out.

use super::page::environment;
use super::plot::{Frame, Panel, thin};
use super::scale::extent;
use super::svg::Svg;
use crate::error::{Error, Result};
use minijinja::value::Serde;
use serde::Serialize;

/// Size of a curve's figure, px.
const WIDTH: f64 = 350.0;
const HEIGHT: f64 = 190.0;
/// Stretches of a curve of which the smallest and the largest value are drawn.
const BUCKETS: usize = 500;

/// What the template shows.
#[derive(Debug, Serialize)]
pub(crate) struct DesignPage {
    /// Length and rate.
    pub(crate) headline: String,
    /// Model, joints, samples and seed.
    pub(crate) about: String,
    /// What to know before the motion runs.
    pub(crate) warning: String,
    /// What is known of collisions.
    pub(crate) clearance: Vec<String>,
    /// What the motion was designed for.
    pub(crate) purpose: String,
    /// Numbers of the motion's information.
    pub(crate) numbers: Vec<Number>,
    pub(crate) questions: Vec<Question>,
    /// What the columns of the questions are.
    pub(crate) decided: &'static str,
    /// Sentences on effects that no motion decides.
    pub(crate) undecidable: Vec<String>,
    pub(crate) joints: Vec<Joint>,
    /// Whether a limit in a figure is assumed.
    pub(crate) some_assumed: bool,
    pub(crate) limits: Vec<Row>,
    /// What the shares of the table are.
    pub(crate) shares: String,
    /// Sentences on limits that nobody stated.
    pub(crate) assumed: Vec<String>,
}

/// A number with its name.
#[derive(Debug, Serialize)]
pub(crate) struct Number {
    pub(crate) value: String,
    pub(crate) name: &'static str,
}

/// What the motion is expected to say of one effect.
#[derive(Debug, Serialize)]
pub(crate) struct Question {
    pub(crate) effect: String,
    pub(crate) pip: String,
    pub(crate) right: String,
    pub(crate) wrong: String,
    pub(crate) sd: String,
    pub(crate) structural: bool,
}

/// One joint's figures.
#[derive(Debug, Serialize)]
pub(crate) struct Joint {
    pub(crate) name: String,
    /// As SVG.
    pub(crate) curves: Vec<String>,
}

/// One quantity of a joint over time, with its limits.
#[derive(Debug)]
pub(crate) struct Curve {
    /// `position`, `velocity` or `acceleration`.
    pub(crate) quantity: &'static str,
    pub(crate) unit: &'static str,
    /// Hz.
    pub(crate) rate: f64,
    pub(crate) values: Vec<f64>,
    pub(crate) limits: [f64; 2],
    pub(crate) assumed: bool,
    /// What the figure shows, for those who cannot see it.
    pub(crate) label: String,
}

/// Limits of one joint.
#[derive(Debug, Serialize)]
pub(crate) struct Row {
    pub(crate) joint: String,
    pub(crate) cells: Vec<Cell>,
}

/// One limit: the number, and how much of it is used.
#[derive(Debug, Serialize)]
pub(crate) struct Cell {
    pub(crate) quantity: &'static str,
    pub(crate) limit: String,
    pub(crate) used: String,
    pub(crate) assumed: bool,
}

/// The page as HTML.
///
/// # Errors
/// [`Error::Internal`] if the template and the values that fill it do not fit together.
pub(crate) fn render(page: &DesignPage) -> Result<String> {
    let made = || -> std::result::Result<String, minijinja::Error> {
        let mut environment = environment()?;
        environment.add_template("design.html", include_str!("design.html"))?;
        environment.add_template("report.css", include_str!("report.css"))?;
        environment.get_template("design.html")?.render(Serde(page))
    };
    made().map_err(|error| Error::Internal {
        what: "design template".into(),
        problem: format!("{error:#}"),
    })
}

impl Curve {
    /// The curve as SVG, its limits as lines across.
    pub(crate) fn svg(&self) -> String {
        let end = self.values.len().saturating_sub(1) as f64 / self.rate;
        let (low, high) = extent(self.values.iter().chain(&self.limits).copied());
        let room = 0.06 * (high - low);
        let mut svg = Svg::new(WIDTH, HEIGHT);
        let panel = Panel::new(
            Frame::inside(WIDTH, HEIGHT, (low, high)),
            (0.0, end),
            (low - room, high + room),
        );
        let label = format!("{}, {}", self.quantity, self.unit);
        panel.axes(&mut svg, "time, s", &label);
        let class = match self.assumed {
            true => "limit assumed",
            false => "limit",
        };
        for limit in self.limits.iter().filter(|limit| limit.is_finite()) {
            svg.line(class, panel.at(0.0, *limit), panel.at(end, *limit));
        }
        let times = (0..self.values.len()).map(|k| k as f64 / self.rate);
        let points: Vec<_> = times.zip(self.values.iter().copied()).collect();
        panel.line(&mut svg, "c", thin(&points, BUCKETS));
        svg.finish(&self.label)
    }
}
