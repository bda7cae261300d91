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
/// Fewest rows of a bin.
const LEAST: usize = 5;

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
    out.sort_by(|a, b| a.0.total_cmp(&b.0));
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
    panel.line(&mut svg, "n", means(samples, |s| s.1));
    panel.line(&mut svg, "c", means(samples, |s| s.2));
    let label = format!(
        "Scatter plot of the residual torque of joint {} against its {quantity}, before and after calibration.",
        joint.name
    );
    Image::half(
        format!("{}, against {quantity}", joint.name),
        svg.finish(&label),
    )
}

/// Means of state and value over bins with equally many rows each: where few rows are, the bins are wide and the line goes on. Rows
/// are in the order of their state.
fn means(samples: &[Sample], value: impl Fn(&Sample) -> f64) -> Vec<(f64, f64)> {
    let bins = BINS.min(samples.len() / LEAST);
    let cut = |bin: usize| bin * samples.len() / bins;
    (0..bins)
        .map(|bin| {
            let own = &samples[cut(bin)..cut(bin + 1)];
            let mean =
                |of: &dyn Fn(&Sample) -> f64| own.iter().map(of).sum::<f64>() / own.len() as f64;
            (mean(&|sample| sample.0), mean(&|sample| value(sample)))
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
        let means = means(&samples, |s| s.1);
        assert_eq!(means.len(), BINS);
        assert!(
            means[..10].iter().all(|m| m.1 == -2.0) && means[10..].iter().all(|m| m.1 == 3.0),
            "{means:?}"
        );
        assert!((means[0].0 - 0.0245).abs() < 1e-12);
    }

    /// Two far rows are no bin of their own, and no rows no line.
    #[test]
    fn few_rows_leave_no_gap_in_the_line() {
        let mut samples: Vec<Sample> = (0..23).map(|i| (f64::from(i), 1.0, 0.0)).collect();
        samples.extend([(100.0, 1.0, 0.0), (101.0, 1.0, 0.0)]);
        let line = means(&samples, |s| s.1);
        assert_eq!(line.len(), 5);
        assert!(line.iter().all(|point| point.1 == 1.0) && line[4].0 > 22.0);
        assert!(means(&samples[..4], |s| s.1).is_empty());
    }
}
