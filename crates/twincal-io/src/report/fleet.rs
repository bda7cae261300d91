//! The page of a fleet: words and numbers come in, HTML goes out.

use super::page::environment;
use super::plot::{Frame, Panel};
use super::svg::Svg;
use crate::error::{Error, Result};
use crate::fleet::Corrected;
use minijinja::value::Serde;
use serde::Serialize;
use twincal::fleet::CoursePoint;

/// Size of a course's figure.
const WIDTH: f64 = 350.0;
const HEIGHT: f64 = 170.0;
/// Half of a central 95 % interval of a normal distribution, in standard deviations.
const HALF_OF_95: f64 = 1.96;

/// What the template shows.
#[derive(Debug, Serialize)]
pub(crate) struct FleetPage {
    /// How many robots deviate.
    pub(crate) headline: String,
    /// What makes the answer doubtful; may be empty.
    pub(crate) doubt: String,
    /// What is wrong for all of them.
    pub(crate) of_type: String,
    /// The corrected model file.
    pub(crate) corrected: Corrected,
    /// Model and amount of data.
    pub(crate) about: String,
    /// False discovery rate.
    pub(crate) rate: String,
    /// Most likely first.
    pub(crate) deviating: Vec<Robot>,
    pub(crate) others: Vec<Robot>,
    pub(crate) effects: Vec<Effect>,
    pub(crate) left_out: Vec<LeftOut>,
}

/// One robot.
#[derive(Debug, Serialize)]
pub(crate) struct Robot {
    pub(crate) name: String,
    pub(crate) probability: String,
    pub(crate) deviations: Vec<Deviation>,
    pub(crate) logs: Vec<String>,
    pub(crate) rows: usize,
}

/// What it has more than its type.
#[derive(Debug, Serialize)]
pub(crate) struct Deviation {
    pub(crate) name: String,
    pub(crate) story: String,
    pub(crate) main: String,
    pub(crate) since: String,
    pub(crate) probability: String,
    /// Days and values of the robot's windows.
    #[serde(serialize_with = "figure")]
    pub(crate) course: Vec<(String, CoursePoint)>,
    /// Unit of the values.
    pub(crate) unit: String,
}

/// What is wrong for all robots.
#[derive(Debug, Serialize)]
pub(crate) struct Effect {
    pub(crate) name: String,
    pub(crate) story: String,
    pub(crate) main: String,
    pub(crate) values: Vec<[String; 2]>,
    pub(crate) scatter: String,
    pub(crate) probability: String,
    pub(crate) likely: bool,
}

/// A log that does not count.
#[derive(Debug, Serialize)]
pub(crate) struct LeftOut {
    pub(crate) robot: String,
    pub(crate) log: String,
    pub(crate) reason: String,
}

/// The page as HTML.
///
/// # Errors
/// [`Error::Internal`] if the template and the values that fill it do not fit together.
pub(crate) fn render(page: &FleetPage) -> Result<String> {
    let made = || -> std::result::Result<String, minijinja::Error> {
        let mut environment = environment()?;
        environment.add_template("fleet.html", include_str!("fleet.html"))?;
        environment.add_template("report.css", include_str!("report.css"))?;
        environment.get_template("fleet.html")?.render(Serde(page))
    };
    made().map_err(|error| Error::Internal {
        what: "fleet template".into(),
        problem: format!("{error:#}"),
    })
}

/// A course as SVG text.
fn figure<S: serde::Serializer>(
    course: &[(String, CoursePoint)],
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    serializer.serialize_str(&draw(course))
}

/// What each window alone says, with 95 % intervals, and what all of them say together.
fn draw(course: &[(String, CoursePoint)]) -> String {
    let points: Vec<&CoursePoint> = course.iter().map(|(_, point)| point).collect();
    let ends = |point: &CoursePoint| {
        let half = HALF_OF_95 * point.sd;
        [point.value - half, point.value + half, point.mean, 0.0]
    };
    let all = points.iter().flat_map(|point| ends(point));
    let (low, high) = super::scale::extent(all);
    let room = 0.06 * (high - low);
    let last = points.iter().map(|point| point.window).max().unwrap_or(0) as f64;
    let mut svg = Svg::new(WIDTH, HEIGHT);
    let panel = Panel::new(
        Frame::inside(WIDTH, HEIGHT, (low, high)),
        (-0.5, last + 0.5),
        (low - room, high + room),
    );
    panel.axes(&mut svg, "window", "difference to the type");
    svg.line("half", panel.at(-0.5, 0.0), panel.at(last + 0.5, 0.0));
    for (day, point) in course {
        let x = point.window as f64;
        let [below, above, ..] = ends(point);
        svg.line("m", panel.at(x, below), panel.at(x, above));
        let hint = format!("{day}: {:.4} ± {:.4}", point.value, point.sd);
        svg.circle("ring", panel.at(x, point.value), 3.5, Some(&hint));
        svg.line(
            "c",
            panel.at(x - 0.5, point.mean),
            panel.at(x + 0.5, point.mean),
        );
    }
    svg.finish("Difference to the type, window by window")
}
