//! What the model misses against position, by direction of motion, and against velocity, before and after calibration.

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

/// One row.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sample {
    /// Position or velocity.
    x: f64,
    velocity: f64,
    /// Residual before and after calibration.
    before: f64,
    after: f64,
}

/// The figure over all joints: two images each, against q and against q̇.
pub(in crate::report) fn figure(joints: &[Joint<'_>]) -> Option<Figure> {
    let mut images = Vec::new();
    for joint in joints.iter().filter(|j| !j.traces.is_empty()) {
        images.push(draw(joint, &Against::POSITION));
        images.push(draw(joint, &Against::VELOCITY));
    }
    (!images.is_empty()).then(|| Figure {
        title: "Residual torque against position and velocity".into(),
        read: "A line is the mean of the held-out rows in that range. One that is not flat at zero is an effect which depends \
               on that quantity; after calibration it should be flat. Against position, a gap between the two directions of \
               motion is friction."
            .into(),
        legend: vec![
            Legend { mark: "dot", class: "pn big", label: "before" },
            Legend { mark: "line", class: "ns", label: "mean before (q̇ > 0)" },
            Legend { mark: "line", class: "n", label: "q̇ < 0" },
            Legend { mark: "dot", class: "pc big", label: "after" },
            Legend { mark: "line", class: "c", label: "mean after (q̇ > 0)" },
            Legend { mark: "line", class: "cd", label: "q̇ < 0" },
        ],
        images,
    })
}

/// The quantity along the horizontal axis.
struct Against {
    name: &'static str,
    unit: fn(&Joint<'_>) -> &'static str,
    of: fn(&Trace) -> &Vec<f64>,
    /// Rows of one mean line, with its styles before and after.
    lines: &'static [Direction],
}

/// Rows of one direction of motion.
struct Direction {
    holds: fn(&Sample) -> bool,
    before: &'static str,
    after: &'static str,
}

impl Against {
    const POSITION: Self = Self {
        name: "position",
        unit: |joint| joint.units.position,
        of: |trace| &trace.q,
        lines: &[
            Direction {
                holds: |sample| sample.velocity > 0.0,
                before: "ns",
                after: "c",
            },
            Direction {
                holds: |sample| sample.velocity < 0.0,
                before: "n",
                after: "cd",
            },
        ],
    };
    /// Its sign is the direction.
    const VELOCITY: Self = Self {
        name: "velocity",
        unit: |joint| joint.units.velocity,
        of: |trace| &trace.qd,
        lines: &[Direction {
            holds: |_| true,
            before: "ns",
            after: "c",
        }],
    };
}

/// The rows of all traces of a joint, in the order of the quantity.
fn samples(joint: &Joint<'_>, of: fn(&Trace) -> &Vec<f64>) -> Vec<Sample> {
    let mut out = Vec::new();
    for trace in &joint.traces {
        let states = of(trace).iter().zip(&trace.qd).take(rows(trace));
        for (i, (&x, &velocity)) in states.enumerate() {
            let sample = Sample {
                x,
                velocity,
                before: trace.measured[i] - trace.nominal[i],
                after: trace.measured[i] - trace.calibrated[i],
            };
            if [x, velocity, sample.before, sample.after]
                .iter()
                .all(|v| v.is_finite())
            {
                out.push(sample);
            }
        }
    }
    out.sort_by(|a, b| a.x.total_cmp(&b.x));
    out
}

fn draw(joint: &Joint<'_>, against: &Against) -> Image {
    let samples = samples(joint, against.of);
    let residuals = samples.iter().flat_map(|s| [s.before, s.after]);
    let (low, high) = extent(residuals.chain([0.0]));
    let y = (low - 0.04 * (high - low), high + 0.04 * (high - low));
    let height = 230.0;
    let frame = Frame::inside(HALF, height, y);
    let x = Scale::over(samples.iter().map(|s| s.x), (frame.left, frame.right));
    let panel = Panel::new(frame, x.domain, y);
    let mut svg = Svg::new(HALF, height);
    let quantity = against.name;
    panel.axes(
        &mut svg,
        &format!("{quantity} ({})", (against.unit)(joint)),
        &format!("residual ({})", joint.units.torque),
    );
    let stride = samples.len().div_ceil(POINTS).max(1);
    let drawn = || samples.iter().step_by(stride);
    panel.dots(&mut svg, "pn", drawn().map(|s| (s.x, s.before)));
    panel.dots(&mut svg, "pc", drawn().map(|s| (s.x, s.after)));
    svg.line("a", panel.at(x.domain.0, 0.0), panel.at(x.domain.1, 0.0));
    for direction in against.lines {
        let rows: Vec<Sample> = samples.iter().copied().filter(direction.holds).collect();
        panel.line(&mut svg, direction.before, means(&rows, |s| s.before));
        panel.line(&mut svg, direction.after, means(&rows, |s| s.after));
    }
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
            (mean(&|sample| sample.x), mean(&|sample| value(sample)))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(x: f64, before: f64) -> Sample {
        Sample {
            x,
            velocity: 1.0,
            before,
            after: 0.0,
        }
    }

    #[test]
    fn bin_means_of_a_step_are_its_two_levels() {
        let samples: Vec<Sample> = (0..1000)
            .map(|i| sample(f64::from(i) / 1000.0, if i < 500 { -2.0 } else { 3.0 }))
            .collect();
        let means = means(&samples, |s| s.before);
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
        let mut samples: Vec<Sample> = (0..23).map(|i| sample(f64::from(i), 1.0)).collect();
        samples.extend([sample(100.0, 1.0), sample(101.0, 1.0)]);
        let line = means(&samples, |s| s.before);
        assert_eq!(line.len(), 5);
        assert!(line.iter().all(|point| point.1 == 1.0) && line[4].0 > 22.0);
        assert!(means(&samples[..4], |s| s.before).is_empty());
    }

    /// Each row is in the line of its direction, one at rest in neither.
    #[test]
    fn position_is_split_by_direction() {
        let row = |velocity| Sample {
            velocity,
            ..sample(0.0, 1.0)
        };
        let lines = |row: Sample| {
            Against::POSITION
                .lines
                .iter()
                .map(|own| (own.holds)(&row))
                .collect::<Vec<_>>()
        };
        assert_eq!(lines(row(0.1)), [true, false]);
        assert_eq!(lines(row(-0.1)), [false, true]);
        assert_eq!(lines(row(0.0)), [false, false]);
    }
}
