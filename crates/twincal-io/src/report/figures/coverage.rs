//! Do intervals hold what they promise: nominal against observed coverage on held-out rows.

use crate::report::figure::{Figure, HALF, Image, Legend};
use crate::report::plot::{Frame, Panel};
use crate::report::svg::Svg;
use crate::words::number::percent;

/// The figure from `(level, observed)` pairs and the number of rows that count as independent.
pub(in crate::report) fn figure(levels: &[(f64, f64)], independent_rows: f64) -> Option<Figure> {
    let levels: Vec<_> = levels
        .iter()
        .copied()
        .filter(|(level, seen)| level.is_finite() && seen.is_finite())
        .collect();
    if levels.is_empty() {
        return None;
    }
    let lowest = levels.iter().map(|l| l.0.min(l.1)).fold(0.5, f64::min);
    let low = ((lowest - 0.05) * 10.0).floor() / 10.0;
    let height = 250.0;
    let panel = Panel::new(
        Frame::inside(HALF, height, (0.0, 100.0)),
        (100.0 * low, 102.0),
        (100.0 * low, 102.0),
    );
    let mut svg = Svg::new(HALF, height);
    panel.band(&mut svg, "still", &chance(low, independent_rows));
    panel.axes(&mut svg, "promised (%)", "observed (%)");
    svg.line(
        "half",
        panel.at(100.0 * low, 100.0 * low),
        panel.at(100.0, 100.0),
    );
    let points = || {
        levels
            .iter()
            .map(|(level, seen)| (100.0 * level, 100.0 * seen))
    };
    panel.line(&mut svg, "c", points());
    for (level, seen) in &levels {
        let hint = format!("promised {}, observed {}", percent(*level), percent(*seen));
        svg.circle(
            "ring",
            panel.at(100.0 * level, 100.0 * seen),
            4.5,
            Some(&hint),
        );
    }
    let words: Vec<_> = levels
        .iter()
        .map(|(level, seen)| format!("{} promised, {} observed", percent(*level), percent(*seen)))
        .collect();
    Some(Figure {
        title: "Coverage of the intervals".into(),
        read: "Points on the dashed line: intervals hold what they promise; below it they are too narrow, above it too wide.".into(),
        legend: vec![
            Legend { mark: "dot", class: "pc big", label: "held-out rows" },
            Legend { mark: "line", class: "half", label: "promised = observed" },
            Legend { mark: "area", class: "still", label: "chance (95 %)" },
        ],
        images: vec![Image::half("", svg.finish(&format!("Coverage of predictive intervals: {}.", words.join("; "))))],
    })
}

/// Where 95 % of the observed shares (%) lie if intervals hold what they promise, from the level `low` on.
fn chance(low: f64, independent_rows: f64) -> Vec<(f64, f64, f64)> {
    (0..=40)
        .map(|i| {
            let p = low + (1.0 - low) * f64::from(i) / 40.0;
            let half = 1.96 * (p * (1.0 - p) / independent_rows.max(1.0)).sqrt();
            (
                100.0 * p,
                100.0 * (p - half).max(low),
                100.0 * (p + half).min(1.0),
            )
        })
        .collect()
}
