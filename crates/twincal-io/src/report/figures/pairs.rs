//! Joint and marginal posterior distributions of the kept coefficients (paper fig. 3).

mod hexagons;

use crate::report::figure::{Figure, Image, NARROW};
use crate::report::scale::Scale;
use crate::report::svg::{Anchor, Svg};
use crate::report::text::{shorten, text_width};
use crate::words::list::{first_of, list};
use crate::words::number::{count, fixed, percent};
use hexagons::{HEX, hexagons};
use twincal::calibrate::{Draws, TermSummary};

const BARS: usize = 18;
/// What is drawn of long tails; of a normal distribution everything.
const FAR: f64 = 4.0;
/// Space between cells, px.
const GAP: f64 = 10.0;
/// Share of a coefficient's draws from which it is told that they are not drawn: more than the outermost 1 %.
const MANY: f64 = 0.02;
/// Correlation from which two coefficients are called confounded, and pairs that are named.
const STRONG: f64 = 0.8;
const PAIRS: usize = 6;
/// Size of a label and distance of its lines, px.
const LABEL: f64 = 11.0;
const LINE: f64 = 13.0;
/// Room for names, and for the numbers of an axis, px.
const NAMES: f64 = 136.0;
const TICKS: f64 = 54.0;

/// The figure; `None` without kept coefficients or draws.
pub(in crate::report) fn figure(draws: &Draws, terms: &[TermSummary]) -> Option<Figure> {
    let variables = variables(draws, terms);
    if variables.is_empty() {
        return None;
    }
    let names: Vec<_> = variables.iter().map(|v| v.name).collect();
    let label = format!(
        "Matrix of joint and marginal posterior distributions of {}.",
        names.join(", ")
    );
    Some(Figure {
        title: "Posterior distributions: which coefficients are confounded".into(),
        read: "On the diagonal each coefficient on its own, below it every pair (the stronger the colour, the more probable), above it their \
               correlation: a slanted cloud means that the data know a combination of the two better than each of them (a phone shows \
               each on its own). \
               Not drawn are draws in which the coefficient is not in (exactly 0), the outermost 1 % of the others, and what is four times ± away from their median."
            .into(),
        legend: Vec::new(),
        images: vec![Image {
            wide: draw(&variables, &label),
            narrow: draw_each(&variables, &label),
            layout: "whole",
            ..Image::default()
        }],
    })
}

/// How many coefficients are drawn and why, where it is not all, and what the numbers stand for that replace long names; empty
/// where the figure says everything.
pub(in crate::report) fn shown(draws: &Draws, terms: &[TermSummary]) -> String {
    let kept = terms
        .iter()
        .filter(|term| term.seen && term.pip >= Some(0.5))
        .count();
    let names: Vec<&str> = variables(draws, terms).iter().map(|v| v.name).collect();
    let drawn = names.len();
    let mut out = String::new();
    let numbered = numbered(&names);
    if drawn > 0 && drawn < kept {
        out = format!(
            "Shown are the {} of {} kept coefficients that are largest against their 95 % interval",
            count(drawn as u64),
            count(kept as u64)
        );
        out.push_str(". All of them stand under “Effects” and in result.json. ");
    }
    out.push_str(&confounded(draws));
    if numbered {
        let each: Vec<String> = (1..)
            .zip(&names)
            .map(|(n, name)| format!("{n} {name}"))
            .collect();
        out.push_str(&format!("In the figure: {}.", list(&each)));
    }
    let beyond: Vec<String> = (variables(draws, terms).iter())
        .map(|v| (v.name, not_drawn(v.values)))
        .filter(|(_, share)| *share > MANY)
        .map(|(name, share)| format!("{} of the draws of {name}", percent(share)))
        .collect();
    if !beyond.is_empty() {
        out = format!(
            "{} {} lie so far off that they are not drawn.",
            out.trim_end(),
            list(&beyond)
        );
    }
    out.trim().to_owned()
}

/// The pairs with the largest correlations, by name; empty where none is strong.
fn confounded(draws: &Draws) -> String {
    let mut strong: Vec<_> = correlations(&draws.values)
        .into_iter()
        .filter(|(_, _, r)| r.abs() >= STRONG)
        .collect();
    strong.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
    let pairs: Vec<String> = strong
        .iter()
        .filter_map(|&(i, j, r)| {
            let (one, other) = (draws.terms.get(i)?, draws.terms.get(j)?);
            Some(format!("{one} with {other} ({})", fixed(r, 2)))
        })
        .collect();
    match pairs.is_empty() {
        true => String::new(),
        false => format!(
            "Confounded (correlation): {}. ",
            list(&first_of(pairs, PAIRS))
        ),
    }
}

/// Share of the draws of models that hold a term that are beyond what is drawn.
fn not_drawn(values: &[f64]) -> f64 {
    let [low, high] = bulk(values);
    let held = || values.iter().filter(|v| is_in(**v));
    let beyond = held().filter(|v| !(low..=high).contains(*v));
    beyond.count() as f64 / held().count().max(1) as f64
}

/// True where names do not fit beside their cells: cut short they could not be told from each other.
fn numbered(names: &[&str]) -> bool {
    let mut lines = names.iter().flat_map(|name| name_lines(name));
    lines.any(|line| text_width(line, LABEL) > NAMES)
}

/// The joint or link, what belongs to it, and which number of that; an expression stays whole.
fn name_lines(name: &str) -> Vec<&str> {
    let parts: Vec<&str> = name.split('.').collect();
    match parts
        .iter()
        .skip(1)
        .all(|part| part.starts_with(char::is_alphabetic))
    {
        true => parts,
        false => vec![name],
    }
}

/// The coefficients that have draws.
fn variables<'a>(draws: &'a Draws, terms: &'a [TermSummary]) -> Vec<Variable<'a>> {
    draws
        .terms
        .iter()
        .zip(&draws.values)
        .filter(|(_, values)| values.iter().filter(|v| v.is_finite()).count() > 1)
        .map(|(name, values)| Variable {
            name,
            values,
            unit: terms
                .iter()
                .find(|t| t.term.name == *name)
                .map_or("", |t| &t.term.unit),
        })
        .collect()
}

/// Width of a cell where `k` coefficients are drawn, px.
fn cell(k: usize) -> f64 {
    match k {
        0 | 1 => 240.0,
        2 => 190.0,
        3..=4 => 150.0,
        5..=6 => 104.0,
        _ => 76.0,
    }
}

struct Variable<'a> {
    name: &'a str,
    unit: &'a str,
    values: &'a [f64],
}

fn draw(variables: &[Variable<'_>], label: &str) -> String {
    let grid = Grid::new(variables);
    let widths = grid.labels.iter().flatten();
    let widths = widths.map(|line| text_width(line, LABEL));
    let longest = if grid.numbered {
        LINE
    } else {
        widths.fold(0.0, f64::max)
    };
    let size = grid.size();
    let mut svg = Svg::new(grid.left + size + 12.0, TOP + size + 28.0 + longest);
    for row in 0..variables.len() {
        for column in 0..variables.len() {
            grid.draw_cell(&mut svg, row, column);
        }
        grid.draw_label(&mut svg, row);
    }
    svg.finish(label)
}

/// Upper edge of the first row.
const TOP: f64 = 8.0;

/// A cell for each pair of variables, with their names beside and below.
struct Grid<'a> {
    variables: &'a [Variable<'a>],
    /// Of each variable over the width of a cell.
    scales: Vec<Scale>,
    /// Lines of each variable's label.
    labels: Vec<Vec<String>>,
    /// Labels are numbers: names do not fit.
    numbered: bool,
    /// Width and height of a cell.
    cell: f64,
    /// Right end of the labels beside the rows, and left edge of the first column.
    names_at: f64,
    left: f64,
}

impl<'a> Grid<'a> {
    fn new(variables: &'a [Variable<'a>]) -> Self {
        let cell = cell(variables.len());
        let names: Vec<&str> = variables.iter().map(|v| v.name).collect();
        let numbered = numbered(&names);
        let label_of = |index: usize| -> Vec<String> {
            if numbered {
                return vec![(index + 1).to_string()];
            }
            let name = name_lines(names[index]).into_iter().map(str::to_owned);
            let unit = Some(variables[index].unit).filter(|unit| !unit.is_empty() && *unit != "1");
            name.chain(unit.map(|unit| format!("({unit})"))).collect()
        };
        let names_at = if numbered { 16.0 } else { NAMES };
        Self {
            scales: variables
                .iter()
                .map(|v| Scale::over(bulk(v.values), (0.0, cell)))
                .collect(),
            labels: (0..variables.len()).map(label_of).collect(),
            variables,
            numbered,
            cell,
            names_at,
            left: names_at + TICKS,
        }
    }

    /// Where a row or column begins behind the first.
    fn at(&self, index: usize) -> f64 {
        index as f64 * (self.cell + GAP)
    }

    /// Width and height of all cells.
    fn size(&self) -> f64 {
        self.at(self.variables.len()) - GAP
    }

    /// Hexagons below the diagonal, a histogram on it, the correlation above.
    fn draw_cell(&self, svg: &mut Svg, row: usize, column: usize) {
        let (cell, corner) = (self.cell, (self.left + self.at(column), TOP + self.at(row)));
        let (x, y) = (&self.variables[column], &self.variables[row]);
        if column <= row {
            svg.rect("cell", corner, (cell, cell), None);
        }
        let place = |scale: &Scale, range| Scale { range, ..*scale };
        // Hexagons at the edge of the data stay inside the cell.
        let inset = HEX + 2.0;
        let x_range = (corner.0 + inset, corner.0 + cell - inset);
        let x_scale = place(&self.scales[column], x_range);
        let y_range = (corner.1 + cell - inset, corner.1 + inset);
        let y_scale = place(&self.scales[row], y_range);
        match column.cmp(&row) {
            std::cmp::Ordering::Less => {
                hexagons(svg, pixels([x.values, y.values], [x_scale, y_scale]))
            }
            std::cmp::Ordering::Equal => {
                histogram(svg, x.values, x_scale, (corner.1, corner.1 + cell))
            }
            std::cmp::Ordering::Greater => {
                let r = correlation(x.values, y.values);
                let class = if r.abs() >= STRONG {
                    "number strong"
                } else {
                    "number"
                };
                let middle = (corner.0 + 0.5 * cell, corner.1 + 0.5 * cell + 5.0);
                svg.text(class, middle, Anchor::Middle, &fixed(r, 2));
            }
        }
        if row + 1 == self.variables.len() {
            for (x, text) in labels_inside(&x_scale) {
                svg.text("t", (x, corner.1 + cell + 15.0), Anchor::Middle, &text);
            }
        }
        if column == 0 && row > 0 {
            for (value, text) in y_scale.ticks(4) {
                let at = (corner.0 - 5.0, y_scale.at(value) + 3.8);
                svg.text("t", at, Anchor::End, &text);
            }
        }
    }

    /// A variable's name beside its row and below its column.
    fn draw_label(&self, svg: &mut Svg, index: usize) {
        let label = &self.labels[index];
        let middle = self.at(index) + 0.5 * self.cell;
        let first = -0.5 * LINE * (label.len() as f64 - 1.0);
        for (line, text) in label.iter().enumerate() {
            let shift = middle + first + LINE * line as f64 + 4.0;
            let class = if line == 0 { "name small" } else { "l" };
            svg.text(class, (self.names_at, TOP + shift), Anchor::End, text);
            let below = TOP + self.size() + 24.0;
            if self.numbered {
                let at = (self.left + middle, below + 8.0);
                svg.text(class, at, Anchor::Middle, text);
            } else {
                svg.text_up(class, (self.left + shift, below), Anchor::End, text);
            }
        }
    }
}

/// Each coefficient on its own, for a phone.
fn draw_each(variables: &[Variable<'_>], label: &str) -> String {
    const HEIGHT: f64 = 44.0;
    let row = LINE + HEIGHT + 30.0;
    let mut svg = Svg::new(NARROW, row * variables.len() as f64);
    for (number, variable) in variables.iter().enumerate() {
        let top = row * number as f64 + LINE;
        let name = match variable.unit {
            "" | "1" => variable.name.to_owned(),
            unit => format!("{} ({unit})", variable.name),
        };
        let name = shorten(&name, NARROW - 8.0, LABEL);
        svg.text("name small", (4.0, top - 3.0), Anchor::Start, &name);
        let (from, to) = (4.0, NARROW - 4.0);
        svg.rect("cell", (from, top), (to - from, HEIGHT), None);
        let x = Scale::over(bulk(variable.values), (from + 12.0, to - 12.0));
        histogram(&mut svg, variable.values, x, (top, top + HEIGHT));
        for (value, text) in x.ticks(5) {
            let at = (x.at(value), top + HEIGHT + 14.0);
            svg.text("t", at, Anchor::Middle, &text);
        }
    }
    svg.finish(label)
}

/// Whether a draw is of a model that holds the term: those at exactly zero must not squeeze the rest.
fn is_in(value: f64) -> bool {
    value.is_finite() && value != 0.0
}

/// The ends of the middle 99 % of the draws of models that hold the term, at most [`FAR`] times half their central 68.3 % interval
/// from their median: where some models leave it open and others do not, tails are long.
fn bulk(values: &[f64]) -> [f64; 2] {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| is_in(*v)).collect();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else {
        return [f64::NAN; 2];
    };
    let at = |share: f64| sorted[(share * last as f64).round() as usize];
    let (median, half) = (at(0.5), 0.5 * (at(0.841_345) - at(0.158_655)));
    let cut = sorted.len() / 200;
    let [low, high] = [sorted[cut], sorted[last - cut]];
    if half > 0.0 {
        [low.max(median - FAR * half), high.min(median + FAR * half)]
    } else {
        [low, high]
    }
}

/// Pixel and label of the most ticks whose labels neither touch each other nor leave the cell.
fn labels_inside(x: &Scale) -> Vec<(f64, String)> {
    let fits = |target: usize| -> Vec<(f64, String)> {
        let mut end = x.range.0 - 8.0;
        let mut out = Vec::new();
        for (value, text) in x.ticks(target) {
            let (middle, half) = (x.at(value), 0.5 * text_width(&text, 11.0));
            if middle - half >= end && middle + half <= x.range.1 + 8.0 {
                end = middle + half + 5.0;
                out.push((middle, text));
            }
        }
        out
    };
    // Fewer candidates may leave more of them: 0.2 and 0.4 where 0.1, 0.2, 0.3 … would keep 0.1 and 0.4.
    let tries = [2, 3, 4, 5, 6].map(|target| (fits(target), x.ticks(target).len()));
    let whole = tries
        .iter()
        .filter(|(kept, all)| kept.len() == *all)
        .max_by_key(|(kept, _)| kept.len());
    // One number alone is no scale.
    match whole {
        Some((kept, _)) if kept.len() > 1 => kept.clone(),
        _ => {
            let most = tries.iter().rev().max_by_key(|(kept, _)| kept.len());
            most.map_or_else(Vec::new, |(kept, _)| kept.clone())
        }
    }
}

fn histogram(svg: &mut Svg, values: &[f64], x: Scale, (top, bottom): (f64, f64)) {
    let [low, high] = bulk(values);
    let width = (high - low) / BARS as f64;
    let mut counts = [0usize; BARS];
    let inside = |v: &&f64| is_in(**v) && (low..=high).contains(*v);
    for v in values.iter().filter(inside) {
        let bin = if width > 0.0 {
            ((v - low) / width) as usize
        } else {
            BARS / 2
        };
        counts[bin.min(BARS - 1)] += 1;
    }
    let most = counts.iter().copied().max().unwrap_or(1).max(1) as f64;
    for (i, n) in counts.into_iter().enumerate().filter(|(_, n)| *n > 0) {
        // All draws equal: one bar in the middle.
        let ends = if width > 0.0 {
            (
                x.at(low + width * i as f64),
                x.at(low + width * (i + 1) as f64),
            )
        } else {
            (x.at(low) - 3.0, x.at(low) + 3.0)
        };
        let height = 0.82 * (bottom - top) * n as f64 / most;
        svg.rect(
            "bar",
            (ends.0, bottom - height),
            (ends.1 - ends.0 - 0.6, height),
            None,
        );
    }
}

/// Pixels of the draws that hold both terms, within both scales.
fn pixels([x, y]: [&[f64]; 2], [x_scale, y_scale]: [Scale; 2]) -> impl Iterator<Item = (f64, f64)> {
    let inside = |scale: &Scale, v: f64| is_in(v) && v >= scale.domain.0 && v <= scale.domain.1;
    x.iter()
        .zip(y)
        .filter(move |(x, y)| inside(&x_scale, **x) && inside(&y_scale, **y))
        .map(move |(x, y)| (x_scale.at(*x), y_scale.at(*y)))
}

/// Correlation of every pair (i < j) of sets of draws.
fn correlations(values: &[Vec<f64>]) -> Vec<(usize, usize, f64)> {
    let pairs = (0..values.len()).flat_map(|i| (i + 1..values.len()).map(move |j| (i, j)));
    pairs
        .map(|(i, j)| (i, j, correlation(&values[i], &values[j])))
        .collect()
}

/// Pearson's r of the finite pairs; NaN where one of them does not vary.
fn correlation(x: &[f64], y: &[f64]) -> f64 {
    let pairs = || {
        x.iter()
            .zip(y)
            .filter(|(x, y)| x.is_finite() && y.is_finite())
    };
    let n = pairs().count() as f64;
    let (sum_x, sum_y) = pairs().fold((0.0, 0.0), |m, (x, y)| (m.0 + x, m.1 + y));
    let (mean_x, mean_y) = (sum_x / n, sum_y / n);
    let (xx, yy, xy) = pairs().fold((0.0, 0.0, 0.0), |(xx, yy, xy), (x, y)| {
        let (dx, dy) = (x - mean_x, y - mean_y);
        (xx + dx * dx, yy + dy * dy, xy + dx * dy)
    });
    // What is left of a constant after rounding is not a variation.
    let varies = |sum: f64, mean: f64| sum > 1e-24 * n * mean * mean;
    if varies(xx, mean_x) && varies(yy, mean_y) {
        xy / (xx * yy).sqrt()
    } else {
        f64::NAN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_of_closed_forms() {
        let x: Vec<f64> = (0..100).map(f64::from).collect();
        let line: Vec<f64> = x.iter().map(|x| 3.0 - 2.0 * x).collect();
        let parabola: Vec<f64> = x.iter().map(|x| (x - 49.5).powi(2)).collect();
        assert!((correlation(&x, &line) + 1.0).abs() < 1e-12);
        assert!(correlation(&x, &parabola).abs() < 1e-12);
        assert!(correlation(&x, &[0.1; 100]).is_nan());
    }

    #[test]
    fn draws_without_the_term_and_the_outermost_do_not_squeeze_the_rest() {
        let mut values: Vec<f64> = (0..1000).map(|i| 5.0 + f64::from(i) / 1000.0).collect();
        values[..400].fill(0.0);
        values[400..402].fill(-70.0);
        assert!(bulk(&values)[0] > 5.4, "{:?}", bulk(&values));
        // A tenth of the draws is anywhere.
        values[402..460].fill(40.0);
        let [low, high] = bulk(&values);
        assert!(low > 4.0 && high < 8.0, "{low} to {high}");
        // Of the 600 that are not zero 58 and 2, and one more: three are the lowest half percent.
        assert_eq!(not_drawn(&values), 61.0 / 600.0);
        assert!(bulk(&[f64::NAN])[0].is_nan());
        assert_eq!(bulk(&[2.0]), [2.0; 2]);
    }

    #[test]
    fn coefficients_that_are_not_drawn_are_counted() {
        let mut calibration = crate::report::fixture::two_joints();
        assert_eq!(shown(&calibration.draws, &calibration.terms), "");
        calibration.draws.terms.truncate(2);
        calibration.draws.values.truncate(2);
        let text = shown(&calibration.draws, &calibration.terms);
        assert!(!text.contains("In the figure"), "{text}");
        assert!(
            text.starts_with("Shown are the 2 of 7 kept coefficients")
                && !text.contains(&calibration.draws.terms[0]),
            "{text}"
        );
    }

    #[test]
    fn names_that_do_not_fit_are_numbered_not_cut() {
        let mut calibration = crate::report::fixture::two_joints();
        let long = "shoulder_pan_joint_of_the_left_arm.viscous";
        calibration.draws.terms[0] = long.into();
        let text = shown(&calibration.draws, &calibration.terms);
        assert!(
            text.starts_with(&format!("In the figure: 1 {long}, 2 ")),
            "{text}"
        );
        let figure = figure(&calibration.draws, &calibration.terms).unwrap();
        assert!(figure.images[0].wide.contains(">7<") && !figure.images[0].wide.contains('…'));
    }

    #[test]
    fn every_name_stands_whole_on_a_desk_screen_and_on_a_phone() {
        let mut calibration = crate::report::fixture::two_joints();
        calibration.draws.terms[0] = "shoulder_lift_joint.quadratic_friction".into();
        let figure = figure(&calibration.draws, &calibration.terms).unwrap();
        let image = &figure.images[0];
        for line in [">shoulder_lift_joint<", ">quadratic_friction<"] {
            assert_eq!(image.wide.matches(line).count(), 2, "{line}");
        }
        assert!(
            image
                .narrow
                .contains(">shoulder_lift_joint.quadratic_friction<")
        );
        assert_eq!(name_lines("sin(0.5*q1)"), ["sin(0.5*q1)"]);
    }
}
