//! How much the inclusion probabilities depend on the prior.

use super::inclusion::{ABOVE, left};
use crate::report::MENTIONED;
use crate::report::figure::{Figure, Image, Legend};
use crate::report::scale::{Scale, extent};
use crate::report::svg::{Anchor, Svg};
use crate::report::text::shorten;
use crate::words::number::probability;
use twincal::calibrate::{ComponentSummary, TermSummary};

const ROW: f64 = 19.0;
/// An effect is drawn if its probability reaches this under any of the priors.
const LEAST: f64 = MENTIONED;

/// The first live term of every component: a component is in or out with all its terms, which share its probabilities.
pub(in crate::report) fn one_each(
    terms: &[TermSummary],
) -> impl Iterator<Item = &TermSummary> + Clone {
    let live = |term: &&TermSummary| term.pip.is_some();
    terms.iter().enumerate().filter_map(move |(index, term)| {
        let mut before = terms[..index].iter().filter(live);
        let first = !before.any(|other| other.term.component == term.term.component);
        (live(&term) && first).then_some(term)
    })
}

/// The figure; `None` where no probability under other priors was computed or all of them are negligible.
pub(in crate::report) fn figure(
    terms: &[TermSummary],
    components: &[ComponentSummary],
) -> Option<Figure> {
    // What the data do not see is left to the prior by definition.
    let unseen = |term: &&TermSummary| {
        let mut own = components.iter();
        let own = own.find(|component| component.columns.contains(&term.term.name));
        own.is_some_and(ComponentSummary::is_unseen)
    };
    let rows: Vec<Row<'_>> = one_each(terms)
        .filter(|term| !unseen(term))
        .filter_map(|term| {
            let pip = term.pip?;
            let range = extent(term.pip_sensitivity.iter().copied().chain([pip]));
            let name = name(term, components);
            (!term.pip_sensitivity.is_empty() && range.1 >= LEAST).then_some(Row {
                name,
                term,
                pip,
                range,
            })
        })
        .collect();
    (!rows.is_empty()).then(|| Figure {
        title: "Inclusion probability under other priors".into(),
        read: "Each bar spans the probabilities when the slab is ten times narrower or wider and when half or twice as many \
               effects are expected; a bar that crosses 0.5 means that the decision is the prior's, not the data's."
            .into(),
        legend: vec![
            Legend { mark: "dot", class: "pc big", label: "prior as used" },
            Legend { mark: "area", class: "left", label: "range over the other priors" },
            Legend { mark: "area", class: "warn", label: "range that crosses 0.5" },
        ],
        images: vec![Image::full("", |width| draw(&rows, width))],
    })
}

/// The name of a term's component.
pub(in crate::report) fn name<'a>(
    term: &'a TermSummary,
    components: &'a [ComponentSummary],
) -> &'a str {
    let own = |component: &&ComponentSummary| component.columns.contains(&term.term.name);
    let component = components.iter().find(own);
    component.map_or(&term.term.name, |component| &component.name)
}

struct Row<'a> {
    name: &'a str,
    term: &'a TermSummary,
    pip: f64,
    range: (f64, f64),
}

/// True if the decision at 0.5 is not the same under all priors tried.
fn depends_on_prior(term: &TermSummary) -> bool {
    let (low, high) = extent(term.pip_sensitivity.iter().copied().chain(term.pip));
    low < 0.5 && high >= 0.5
}

fn draw(rows: &[Row<'_>], width: f64) -> String {
    let (left, stacked) = left(width, rows.iter().map(|row| row.name));
    let height = if stacked { ROW + ABOVE } else { ROW };
    let (right, top) = (width - 18.0, 6.0);
    let bottom = top + height * rows.len() as f64 + 4.0;
    let x = Scale::new((0.0, 1.0), (left, right));
    let mut svg = Svg::new(width, bottom + 38.0);
    for (value, text) in x.ticks(if width > 600.0 { 10 } else { 5 }) {
        svg.line("g", (x.at(value), top), (x.at(value), bottom));
        svg.text("t", (x.at(value), bottom + 15.0), Anchor::Middle, &text);
    }
    if !stacked {
        svg.line("half", (x.at(0.5), top), (x.at(0.5), bottom));
    }
    for (i, row) in rows.iter().enumerate() {
        let (pip, (low, high)) = (row.pip, row.range);
        let mut y = top + height * i as f64;
        let class = if depends_on_prior(row.term) {
            "warn"
        } else {
            "left"
        };
        let hint = format!(
            "{}: {}, from {} to {}",
            row.name,
            probability(pip),
            probability(low),
            probability(high)
        );
        if stacked {
            let name = shorten(row.name, width - left, 12.0);
            svg.text("name", (left, y + 14.0), Anchor::Start, &name);
            y += ABOVE;
            // Not through the names.
            svg.line("half", (x.at(0.5), y + 3.0), (x.at(0.5), y + ROW - 1.0));
        } else {
            let name = shorten(row.name, left - 14.0, 12.0);
            svg.text("name", (left - 8.0, y + 14.0), Anchor::End, &name);
        }
        svg.rect(
            class,
            (x.at(low) - 1.5, y + 7.0),
            (x.at(high) - x.at(low) + 3.0, 6.0),
            Some(&hint),
        );
        svg.circle("ring", (x.at(pip), y + 10.0), 4.0, Some(&hint));
    }
    svg.text(
        "l",
        (0.5 * (left + right), bottom + 32.0),
        Anchor::Middle,
        "inclusion probability",
    );
    svg.finish(&format!(
        "Ranges of the inclusion probabilities of {} effects under five priors.",
        rows.len()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;

    #[test]
    fn terms_of_one_effect_are_one_row() {
        let mut calibration = fixture::two_joints();
        let all = one_each(&calibration.terms).count();
        let live: Vec<usize> = (0..calibration.terms.len())
            .filter(|&i| calibration.terms[i].pip.is_some())
            .collect();
        let component = calibration.terms[live[0]].term.component;
        calibration.terms[live[3]].term.component = component;
        let each: Vec<&TermSummary> = one_each(&calibration.terms).collect();
        assert_eq!(each.len(), all - 1);
        let named = name(each[0], &calibration.components);
        assert_eq!(named, calibration.components[live[0]].name);
    }

    #[test]
    fn crossing_one_half_is_noticed() {
        let mut term = fixture::two_joints().terms[0].clone();
        for (pip, others, depends) in [
            (0.9, vec![0.6, 0.9, 0.99], false),
            (0.6, vec![0.4, 0.6], true),
            (0.1, vec![0.1, 0.5], true),
        ] {
            term.pip = Some(pip);
            term.pip_sensitivity = others;
            assert_eq!(depends_on_prior(&term), depends, "{pip}");
        }
    }
}
