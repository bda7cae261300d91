//! Inclusion probabilities of all candidates with the line at one half (paper fig. 2).

use crate::report::MENTIONED;
use crate::report::figure::{Figure, Image, Legend};
use crate::report::scale::Scale;
use crate::report::svg::{Anchor, Svg};
use crate::report::text::{shorten, text_width};
use crate::words::number::{count, probability};
use twincal::calibrate::ComponentSummary;
use twincal::term::Family;

/// Above this many candidates only those that stand out are drawn one by one.
const MOST: usize = 60;
/// "Stands out" means at least this inclusion probability.
const LEAST: f64 = MENTIONED;
const ROW: f64 = 18.0;
/// Space for names beside the bars: on a desk screen, on a phone.
pub(super) const NAMES: (f64, f64) = (250.0, 138.0);
/// More height of a row whose name stands above its bar.
pub(super) const ABOVE: f64 = 15.0;

enum Row<'a> {
    Family(&'static str),
    Term(&'a ComponentSummary, f64),
    Rest(usize),
}

/// The figure; `None` without candidates.
pub(in crate::report) fn figure(
    components: &[ComponentSummary],
    sees: impl Fn(&ComponentSummary) -> bool,
) -> Option<Figure> {
    let all = components.len();
    let components: Vec<&ComponentSummary> = components.iter().filter(|c| sees(c)).collect();
    let unseen = all > components.len();
    let live = components.iter().filter(|t| t.pip.is_some()).count();
    if live == 0 {
        return None;
    }
    let rows = rows(&components, live);
    let selected = components.iter().filter(|t| t.is_in()).count();
    let label = format!(
        "Bar chart of the inclusion probabilities of {live} candidates; {selected} reach one half."
    );
    Some(Figure {
        title: "Which effects the data support".into(),
        read: format!(
            "Each bar is the probability that the effect is really there, given this log and the prior; bars that reach \
             the line at 0.5 are likelier there than not.{}",
            if unseen {
                " What these data do not see has none."
            } else {
                ""
            }
        ),
        legend: vec![
            Legend {
                mark: "area",
                class: "kept",
                label: "kept",
            },
            Legend {
                mark: "area",
                class: "left",
                label: "not kept",
            },
            Legend {
                mark: "line",
                class: "half",
                label: "0.5",
            },
        ],
        images: vec![Image::full("", |width| draw(&rows, width, &label))],
    })
}

fn rows<'a>(components: &[&'a ComponentSummary], live: usize) -> Vec<Row<'a>> {
    let mut rows = Vec::new();
    let mut families: Vec<Family> = components
        .iter()
        .filter(|t| t.pip.is_some())
        .map(|t| t.family)
        .collect();
    families.sort();
    families.dedup();
    for family in families {
        rows.push(Row::Family(crate::words::family_name(family)));
        let members = components
            .iter()
            .filter(|t| t.family == family)
            .filter_map(|t| Some((*t, t.pip?)));
        let mut rest = 0;
        for (term, pip) in members {
            if live <= MOST || pip >= LEAST || term.is_in() {
                rows.push(Row::Term(term, pip))
            } else {
                rest += 1
            }
        }
        if rest > 0 {
            rows.push(Row::Rest(rest));
        }
    }
    rows
}

/// Where bars begin, and true if names stand above them: on a phone where a name would be cut, so that two could look alike.
pub(super) fn left<'a>(width: f64, mut names: impl Iterator<Item = &'a str>) -> (f64, bool) {
    match width {
        _ if width > 600.0 => (NAMES.0, false),
        _ if names.any(|name| text_width(name, 12.0) > NAMES.1 - 14.0) => (6.0, true),
        _ => (NAMES.1, false),
    }
}

/// The chart while its rows are drawn.
struct Chart {
    svg: Svg,
    /// From probabilities to pixels.
    x: Scale,
    width: f64,
    left: f64,
    right: f64,
    /// Names stand above their bars.
    stacked: bool,
}

fn draw(rows: &[Row<'_>], width: f64, label: &str) -> String {
    let names = rows.iter().filter_map(|row| match row {
        Row::Term(term, _) => Some(term.name.as_str()),
        _ => None,
    });
    let (left, stacked) = left(width, names);
    let height = |row: &Row<'_>| match row {
        Row::Term(..) if stacked => ROW + ABOVE,
        _ => ROW,
    };
    let (right, top) = (width - 52.0, 6.0);
    let bottom = top + rows.iter().map(height).sum::<f64>() + 4.0;
    let mut svg = Svg::new(width, bottom + 38.0);
    let x = Scale::new((0.0, 1.0), (left, right));
    for (value, text) in x.ticks(if width > 600.0 { 10 } else { 5 }) {
        svg.line("g", (x.at(value), top), (x.at(value), bottom));
        svg.text("t", (x.at(value), bottom + 15.0), Anchor::Middle, &text);
    }
    let mut chart = Chart {
        svg,
        x,
        width,
        left,
        right,
        stacked,
    };
    let mut next = top;
    for row in rows {
        chart.row(row, next);
        next += height(row);
    }
    let mut svg = chart.svg;
    if !stacked {
        svg.line("half", (x.at(0.5), top), (x.at(0.5), bottom));
    }
    svg.line("a", (left, top), (left, bottom));
    svg.text(
        "l",
        (0.5 * (left + right), bottom + 32.0),
        Anchor::Middle,
        "inclusion probability",
    );
    svg.finish(label)
}

impl Chart {
    /// A row that begins at `y`.
    fn row(&mut self, row: &Row<'_>, y: f64) {
        let base = y + 13.5;
        match row {
            Row::Family(name) => {
                self.svg
                    .rect("strip", (0.0, y + 2.0), (self.width, ROW - 2.0), None);
                self.svg.text(
                    "l strong",
                    (4.0, base),
                    Anchor::Start,
                    &shorten(name, self.width - 8.0, 11.0),
                );
            }
            Row::Rest(n) => {
                let text = format!("{} more, each below {LEAST}", count(*n as u64));
                self.svg
                    .text("t", (self.left + 4.0, base), Anchor::Start, &text);
            }
            Row::Term(term, pip) => self.candidate(term, *pip, (y, base)),
        }
    }

    /// Name, bar and probability of a candidate; its row begins at `y`, its name stands on `base`.
    fn candidate(&mut self, term: &ComponentSummary, pip: f64, (mut y, mut base): (f64, f64)) {
        let Self {
            svg,
            x,
            width,
            left,
            right,
            stacked,
        } = self;
        let class = if term.is_in() { "kept" } else { "left" };
        let hint = format!("{}: {}", term.name, probability(pip));
        if *stacked {
            let name = shorten(&term.name, *width - *left, 12.0);
            svg.text("name", (*left, base), Anchor::Start, &name);
            (y, base) = (y + ABOVE, base + ABOVE);
        } else {
            let name = shorten(&term.name, *left - 12.0, 12.0);
            svg.text("name", (*left - 6.0, base), Anchor::End, &name);
        }
        // A bar of one pixel shows that there is a candidate.
        svg.rect(
            class,
            (*left, y + 4.0),
            ((x.at(pip) - *left).max(1.0), ROW - 6.0),
            Some(&hint),
        );
        if let Some(error) = term.pip_mcse.filter(|e| *e > 0.0) {
            let ends = [(pip - 1.96 * error).max(0.0), (pip + 1.96 * error).min(1.0)];
            svg.line(
                "whisker",
                (x.at(ends[0]), y + 10.0),
                (x.at(ends[1]), y + 10.0),
            );
        }
        svg.text("t", (*right + 6.0, base), Anchor::Start, &probability(pip));
        if *stacked {
            // Not through the names.
            svg.line("half", (x.at(0.5), y + 3.0), (x.at(0.5), y + ROW - 1.0));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;
    use twincal::calibrate::{Status, StatusReason};

    #[test]
    fn bars_are_as_long_as_their_probability() {
        let mut term = fixture::two_joints().components[0].clone();
        term.pip = Some(0.25);
        let svg = draw(&[Row::Term(&term, 0.25)], 880.0, "");
        // From 250 to 880 − 52.
        assert!(
            svg.contains(&format!(r#"width="{}""#, 0.25 * (880.0 - 52.0 - 250.0))),
            "{svg}"
        );
    }

    #[test]
    fn what_the_data_do_not_see_has_no_bar() {
        let mut components = fixture::two_joints().components;
        let said =
            |components: &[ComponentSummary]| figure(components, |c| !c.is_unseen()).unwrap().read;
        assert!(!said(&components).contains("do not see"));
        let own = components
            .iter_mut()
            .find(|c| !c.is_in() && c.pip.is_some());
        let own = own.unwrap();
        (own.status, own.reason) = (Status::Unidentifiable, StatusReason::WideAsPrior);
        let name = format!(">{}<", own.name);
        let drawn = figure(&components, |c| !c.is_unseen()).unwrap();
        assert!(drawn.read.contains("do not see") && !drawn.images[0].wide.contains(&name));
    }

    #[test]
    fn a_long_name_stands_above_its_bar_on_a_phone() {
        let mut term = fixture::two_joints().components[0].clone();
        term.name = "shoulder_lift_joint.viscous".into();
        for width in [350.0, 880.0] {
            let svg = draw(&[Row::Term(&term, 0.25)], width, "");
            assert!(svg.contains(&format!(">{}<", term.name)), "{svg}");
        }
        assert_eq!(left(350.0, ["elbow.viscous"].into_iter()), (138.0, false));
        assert_eq!(left(350.0, [term.name.as_str()].into_iter()), (6.0, true));
    }

    #[test]
    fn many_absent_terms_are_counted_instead_of_drawn() {
        let calibration = fixture::two_joints();
        let mut terms = calibration.components.clone();
        let mut absent = terms
            .iter()
            .find(|t| t.pip.is_some_and(|p| p < LEAST))
            .unwrap()
            .clone();
        absent.family = Family::Generic;
        terms.extend(std::iter::repeat_n(absent, 100));
        let figure = figure(&terms, |_| true).unwrap();
        assert!(figure.images[0].wide.matches("<rect").count() < 40);
        assert!(figure.images[0].wide.contains("more, each below 0.05"));
    }

    #[test]
    fn no_candidates_no_figure() {
        assert_eq!(figure(&[], |_| true), None);
    }
}
