//! What the model misses against position and velocity, before and after calibration.

use crate::report::figure::{Figure, HALF, Image, Legend};
use crate::report::plot::{Frame, Panel};
use crate::report::scale::{Scale, extent};
use crate::report::svg::Svg;
use crate::report::view::{Joint, rows};
use twincal::validate::Trace;

/// Points drawn per series; the binned means use all rows.
const POINTS: usize = 350;
const BINS: usize = 20;

/// One row: state, residual before, residual after.
type Sample = (f64, f64, f64);

/// The figure over all joints: two images each, against q and against q̇.
pub(in crate::report) fn figure(joints: &[Joint<'_>]) -> Option<Figure> {
    let mut images = Vec::new();
    for joint in joints.iter().filter(|j| !j.traces.is_empty()) {
        let position = samples(joint, |trace| &trace.q);
        let velocity = samples(joint, |trace| &trace.qd);
        images.push(draw(joint, &position, "position", joint.units.position));
        images.push(draw(joint, &velocity, "velocity", joint.units.velocity));
    }
    (!images.is_empty()).then(|| Figure {
        title: "Residual torque against position and velocity".into(),
        read: "A line (the mean of all held-out rows in that range) that is not flat at zero is an effect which depends on \
               that quantity; after calibration it should be flat."
            .into(),
        legend: vec![
            Legend { mark: "dot", class: "pn big", label: "before" },
            Legend { mark: "line", class: "n", label: "mean before" },
            Legend { mark: "dot", class: "pc big", label: "after" },
            Legend { mark: "line", class: "c", label: "mean after" },
        ],
        images,
    })
}

fn samples(joint: &Joint<'_>, state: impl Fn(&Trace) -> &Vec<f64>) -> Vec<Sample> {
    let mut out = Vec::new();
    for trace in &joint.traces {
        for (i, &x) in state(trace).iter().enumerate().take(rows(trace)) {
            let sample = (
                x,
                trace.measured[i] - trace.nominal[i],
                trace.measured[i] - trace.calibrated[i],
            );
            if [sample.0, sample.1, sample.2].iter().all(|v| v.is_finite()) {
                out.push(sample);
            }
        }
    }
    out
}

fn draw(joint: &Joint<'_>, samples: &[Sample], quantity: &str, unit: &str) -> Image {
    let (low, high) = extent(samples.iter().flat_map(|s| [s.1, s.2]).chain([0.0]));
    let y = (low - 0.04 * (high - low), high + 0.04 * (high - low));
    let height = 230.0;
    let frame = Frame::inside(HALF, height, y);
    let x = Scale::over(samples.iter().map(|s| s.0), (frame.left, frame.right));
    let panel = Panel::new(frame, x.domain, y);
    let mut svg = Svg::new(HALF, height);
    panel.axes(
        &mut svg,
        &format!("{quantity} ({unit})"),
        &format!("residual ({})", joint.units.torque),
    );
    let stride = samples.len().div_ceil(POINTS).max(1);
    let drawn = || samples.iter().step_by(stride);
    panel.dots(&mut svg, "pn", drawn().map(|s| (s.0, s.1)));
    panel.dots(&mut svg, "pc", drawn().map(|s| (s.0, s.2)));
    svg.line("a", panel.at(x.domain.0, 0.0), panel.at(x.domain.1, 0.0));
    panel.line(&mut svg, "n", means(samples, x.domain, |s| s.1));
    panel.line(&mut svg, "c", means(samples, x.domain, |s| s.2));
    let label = format!(
        "Scatter plot of the residual torque of joint {} against its {quantity}, before and after calibration.",
        joint.name
    );
    Image::half(
        format!("{}, against {quantity}", joint.name),
        svg.finish(&label),
    )
}

/// Mean per bin over `domain`, at the bin's centre; a bin with fewer than five rows breaks the line.
fn means(
    samples: &[Sample],
    domain: (f64, f64),
    value: impl Fn(&Sample) -> f64,
) -> Vec<(f64, f64)> {
    let mut bins = [(0usize, 0.0); BINS];
    let width = (domain.1 - domain.0) / BINS as f64;
    for sample in samples {
        let bin = (((sample.0 - domain.0) / width) as usize).min(BINS - 1);
        bins[bin] = (bins[bin].0 + 1, bins[bin].1 + value(sample));
    }
    bins.iter()
        .enumerate()
        .map(|(i, &(n, sum))| {
            (
                domain.0 + width * (i as f64 + 0.5),
                if n < 5 { f64::NAN } else { sum / n as f64 },
            )
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bin_means_of_a_step_are_its_two_levels() {
        let samples: Vec<Sample> = (0..1000)
            .map(|i| (f64::from(i) / 1000.0, if i < 500 { -2.0 } else { 3.0 }, 0.0))
            .collect();
        let means = means(&samples, (0.0, 1.0), |s| s.1);
        assert_eq!(means.len(), BINS);
        assert!(
            means[..10].iter().all(|m| m.1 == -2.0) && means[10..].iter().all(|m| m.1 == 3.0),
            "{means:?}"
        );
        assert!((means[0].0 - 0.025).abs() < 1e-12);
    }
}
