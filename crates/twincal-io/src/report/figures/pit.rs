//! Histogram of the probability that the prediction gave to values below the measured one (PIT).

use crate::report::figure::{Figure, HALF, Image, Legend};
use crate::report::plot::{Frame, Panel};
use crate::report::svg::Svg;
use crate::words::number::{count, percent};

/// The figure from all held-out PIT values and the number of rows that count as independent.
pub(in crate::report) fn figure(pit: &[f64], independent_rows: f64) -> Option<Figure> {
    let bins = if pit.len() >= 400 { 20 } else { 10 };
    let shares = histogram(pit, bins)?;
    let flat = 1.0 / bins as f64;
    let chance = 1.96 * (flat * (1.0 - flat) / independent_rows.max(1.0)).sqrt();
    let top = shares
        .iter()
        .copied()
        .fold(flat + chance.min(3.0 * flat), f64::max);
    let height = 250.0;
    let panel = Panel::new(
        Frame::inside(HALF, height, (0.0, 100.0 * top)),
        (0.0, 1.0),
        (0.0, 106.0 * top),
    );
    let mut svg = Svg::new(HALF, height);
    let (low, high) = (
        100.0 * (flat - chance).max(0.0),
        100.0 * (flat + chance).min(1.06 * top),
    );
    panel.axes(
        &mut svg,
        "predicted probability of a smaller torque",
        "share of rows (%)",
    );
    panel.band(&mut svg, "still", &[(0.0, low, high), (1.0, low, high)]);
    bars(&mut svg, &panel, &shares, flat);
    // Over the bars its ends alone: a band would turn the colour of what stands below it.
    for (class, height) in [("a", low), ("a", high), ("half", 100.0 * flat)] {
        svg.line(class, panel.at(0.0, height), panel.at(1.0, height));
    }
    let label = format!(
        "Histogram of {} probability integral transform values in {bins} bins.",
        count(pit.len() as u64)
    );
    Some(Figure {
        title: "Shape of the predictions (PIT)".into(),
        read: "Bars level with the dashed line: the predicted distribution has the right shape; a hill means too wide, a valley \
               too narrow, a slope biased."
            .into(),
        legend: vec![
            Legend { mark: "area", class: "bar", label: "held-out rows" },
            Legend { mark: "line", class: "half", label: "ideal" },
            Legend { mark: "area", class: "still", label: "chance (95 %)" },
        ],
        images: vec![Image::half("", svg.finish(&label))],
    })
}

/// A bar of `width` per share.
fn bars(svg: &mut Svg, panel: &Panel, shares: &[f64], width: f64) {
    for (i, share) in shares.iter().enumerate() {
        let corner = panel.at(i as f64 * width, 100.0 * share);
        let opposite = panel.at((i + 1) as f64 * width, 0.0);
        let hint = format!(
            "{:.2} to {:.2}: {}",
            i as f64 * width,
            (i + 1) as f64 * width,
            percent(*share)
        );
        svg.rect(
            "bar",
            (corner.0 + 0.8, corner.1),
            (opposite.0 - corner.0 - 1.6, opposite.1 - corner.1),
            Some(&hint),
        );
    }
}

/// Shares of the values in equal bins over [0, 1]; `None` without a finite value.
fn histogram(values: &[f64], bins: usize) -> Option<Vec<f64>> {
    let mut counts = vec![0usize; bins];
    let finite = values.iter().filter(|v| v.is_finite());
    for v in finite {
        counts[((v.clamp(0.0, 1.0) * bins as f64) as usize).min(bins - 1)] += 1;
    }
    let total: usize = counts.iter().sum();
    (total > 0).then(|| {
        counts
            .into_iter()
            .map(|n| n as f64 / total as f64)
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_sum_to_one_and_the_ends_belong_to_the_outer_bins() {
        let shares = histogram(&[0.0, 1.0, 0.5, 0.49, f64::NAN], 2).unwrap();
        assert_eq!(shares, [0.5, 0.5]);
        assert_eq!(histogram(&[f64::NAN], 4), None);
        assert_eq!(histogram(&[], 4), None);
    }
}
