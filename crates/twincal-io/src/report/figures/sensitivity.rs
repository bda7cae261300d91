//! How much the inclusion probabilities depend on the prior.

use crate::report::figure::{Figure, Image, Legend};
use crate::report::scale::{Scale, extent};
use crate::report::svg::{Anchor, Svg};
use crate::report::text::{probability, shorten};
use twincal::calibrate::TermSummary;

const ROW: f64 = 19.0;
/// A term is drawn if its probability reaches this under any of the priors.
const LEAST: f64 = 0.05;

/// The figure; `None` where no probability under other priors was computed or all of them are negligible.
pub(in crate::report) fn figure(terms: &[TermSummary]) -> Option<Figure> {
    let rows: Vec<(&TermSummary, f64, (f64, f64))> = terms
        .iter()
        .filter_map(|term| {
            let pip = term.pip?;
            let range = extent(term.pip_sensitivity.iter().copied().chain([pip]));
            (!term.pip_sensitivity.is_empty() && range.1 >= LEAST).then_some((term, pip, range))
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

/// True if the decision at 0.5 is not the same under all priors tried.
pub(in crate::report) fn depends_on_prior(term: &TermSummary) -> bool {
    let (low, high) = extent(term.pip_sensitivity.iter().copied().chain(term.pip));
    low < 0.5 && high >= 0.5
}

fn draw(rows: &[(&TermSummary, f64, (f64, f64))], width: f64) -> String {
    let left = if width > 600.0 { 250.0 } else { 138.0 };
    let (right, top) = (width - 18.0, 6.0);
    let bottom = top + ROW * rows.len() as f64 + 4.0;
    let x = Scale::new((0.0, 1.0), (left, right));
    let mut svg = Svg::new(width, bottom + 38.0);
    for (value, text) in x.ticks(if width > 600.0 { 10 } else { 5 }) {
        svg.line("g", (x.at(value), top), (x.at(value), bottom));
        svg.text("t", (x.at(value), bottom + 15.0), Anchor::Middle, &text);
    }
    svg.line("half", (x.at(0.5), top), (x.at(0.5), bottom));
    for (i, (term, pip, (low, high))) in rows.iter().enumerate() {
        let y = top + ROW * i as f64;
        let class = if depends_on_prior(term) {
            "warn"
        } else {
            "left"
        };
        let hint = format!(
            "{}: {}, from {} to {}",
            term.term.name,
            probability(*pip),
            probability(*low),
            probability(*high)
        );
        svg.text(
            "name",
            (left - 8.0, y + 14.0),
            Anchor::End,
            &shorten(&term.term.name, left - 14.0, 12.0),
        );
        svg.rect(
            class,
            (x.at(*low) - 1.5, y + 7.0),
            (x.at(*high) - x.at(*low) + 3.0, 6.0),
            Some(&hint),
        );
        svg.circle("ring", (x.at(*pip), y + 10.0), 4.0, Some(&hint));
    }
    svg.text(
        "l",
        (0.5 * (left + right), bottom + 32.0),
        Anchor::Middle,
        "inclusion probability",
    );
    svg.finish(&format!(
        "Ranges of the inclusion probabilities of {} terms under five priors.",
        rows.len()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;

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
