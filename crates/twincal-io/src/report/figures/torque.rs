//! Torque of one joint on held-out data: measured, nominal, calibrated and its interval (paper fig. 4).

use crate::report::figure::{Figure, Image, legend};
use crate::report::plot::{Frame, Panel, thin, thin_band};
use crate::report::scale::extent;
use crate::report::svg::Svg;
use crate::report::view::{Joint, rmse, rows, stands_still_between};
use crate::words::number::number;
use std::ops::Range;
use twincal::validate::Trace;

/// The figure of one joint; `None` without held-out rows.
pub(in crate::report) fn figure(joint: &Joint<'_>) -> Option<Figure> {
    let trace = *joint.traces.first()?;
    let all = 0..rows(trace);
    let window = worst_window(trace);
    let mut images = Vec::new();
    let mut legend = vec![
        legend::MEASURED,
        legend::NOMINAL,
        legend::CALIBRATED,
        legend::BAND,
    ];
    if window == all {
        images.push(Image::full(scores(joint, trace), |width| {
            draw(joint, trace, all.clone(), None, width, 270.0)
        }));
    } else {
        let still = stands_still_between(trace);
        let part = format!(
            "The {} s in which it is furthest off{}.",
            number(seconds(trace, &window), 2),
            if still { " while it moves" } else { "" }
        );
        images.push(Image::full(scores(joint, trace), |width| {
            draw(
                joint,
                trace,
                all.clone(),
                Some(window.clone()),
                width,
                210.0,
            )
        }));
        legend.push(legend::ENLARGED);
        images.push(Image::full(part, |width| {
            draw(joint, trace, window.clone(), None, width, 270.0)
        }));
    }
    if trace.standstill.iter().any(|s| *s) {
        legend.push(legend::STANDSTILL);
    }
    let others = if joint.traces.len() > 1 {
        " Shown is the held-out log on which the calibrated twin does worst."
    } else {
        ""
    };
    Some(Figure {
        title: format!("{}: torque on held-out data", joint.name),
        read: format!(
            "The closer the solid coloured line lies to the measured one the better, and about 95 % of the \
                       measured values should lie inside the band.{others}"
        ),
        legend,
        images,
    })
}

/// The same, small, for the logs that [`figure`] does not show: at most `most`, worst first.
pub(in crate::report) fn others(joint: &Joint<'_>, most: usize) -> Option<Figure> {
    let shown: Vec<_> = joint.traces.iter().skip(1).take(most).collect();
    if shown.is_empty() {
        return None;
    }
    let left_out = joint.traces.len() - 1 - shown.len();
    let note = if left_out > 0 {
        format!(" {left_out} more are not drawn.")
    } else {
        String::new()
    };
    Some(Figure {
        title: format!("{}: the other held-out logs", joint.name),
        read: format!("As above, the worst predicted log first.{note}"),
        legend: vec![
            legend::MEASURED,
            legend::NOMINAL,
            legend::CALIBRATED,
            legend::BAND,
        ],
        images: shown
            .into_iter()
            .map(|trace| {
                Image::full(scores(joint, trace), |width| {
                    draw(joint, trace, 0..rows(trace), None, width, 180.0)
                })
            })
            .collect(),
    })
}

/// The log and its errors before and after, in one line.
pub(in crate::report) fn scores(joint: &Joint<'_>, trace: &Trace) -> String {
    let thinned = match trace.step {
        0 | 1 => String::new(),
        step => format!(", from one row in {step}"),
    };
    let moving = stands_still_between(trace);
    let of = |predicted: &[f64]| number(rmse(trace, predicted), 3);
    format!(
        "{} — error (RMSE){} {} → {} {}{thinned}",
        trace.log,
        if moving { " while it moves" } else { "" },
        of(&trace.nominal),
        of(&trace.calibrated),
        joint.units.torque
    )
}

fn seconds(trace: &Trace, range: &Range<usize>) -> f64 {
    let time = &trace.time[range.clone()];
    time.last().copied().unwrap_or(0.0) - time.first().copied().unwrap_or(0.0)
}

/// The fifth of the trace (2 s to 10 s) with the largest squared error of the calibrated torque while the joint moves; all of a short trace.
fn worst_window(trace: &Trace) -> Range<usize> {
    let n = rows(trace);
    let total = seconds(trace, &(0..n));
    let length = (total / 5.0).clamp(2.0, 10.0);
    let size = (length / total * n as f64).round() as usize;
    if total.is_nan() || total <= 1.5 * length || size < 20 || size >= n {
        return 0..n;
    }
    // At standstill friction is whatever it takes: that is no fault of the twin's.
    let moves = trace.standstill.contains(&false);
    let error = |i: usize| {
        let e = trace.measured[i] - trace.calibrated[i];
        let still = moves && trace.standstill[i];
        if e.is_finite() && !still { e * e } else { 0.0 }
    };
    let mut sum: f64 = (0..size).map(error).sum();
    let (mut best, mut largest) = (0, sum);
    for start in 1..=n - size {
        sum += error(start + size - 1) - error(start - 1);
        if sum > largest {
            (best, largest) = (start, sum);
        }
    }
    best..best + size
}

/// Lines and band of a range of a trace, broken at pauses.
struct Curves {
    measured: Vec<(f64, f64)>,
    nominal: Vec<(f64, f64)>,
    calibrated: Vec<(f64, f64)>,
    band: Vec<(f64, f64, f64)>,
}

fn draw(
    joint: &Joint<'_>,
    trace: &Trace,
    range: Range<usize>,
    mark: Option<Range<usize>>,
    width: f64,
    height: f64,
) -> String {
    let time = &trace.time[range.clone()];
    let Curves {
        measured,
        nominal,
        calibrated,
        band,
    } = Curves::of(trace, &range);
    let y = torque_range(&[&measured, &nominal, &calibrated], &band);
    let frame = Frame::inside(width, height, y);
    let panel = Panel::new(frame, extent(time.iter().copied()), y);
    let mut svg = Svg::new(width, height);
    for still in runs(&trace.standstill, &range) {
        shade(
            &mut svg,
            &panel,
            "still",
            trace.time[still.start],
            trace.time[still.end - 1],
        );
    }
    if let Some(mark) = mark {
        shade(
            &mut svg,
            &panel,
            "mark",
            trace.time[mark.start],
            trace.time[mark.end - 1],
        );
    }
    panel.axes(
        &mut svg,
        "time (s)",
        &format!("torque ({})", joint.units.torque),
    );
    let buckets = ((frame.right - frame.left) / 2.0) as usize;
    let clipped: Vec<_> = band
        .iter()
        .map(|&(t, l, h)| (t, l.clamp(y.0, y.1), h.clamp(y.0, y.1)))
        .collect();
    panel.band(&mut svg, "b", &thin_band(&clipped, buckets));
    panel.line(&mut svg, "n", thin(&nominal, buckets));
    panel.line(&mut svg, "m", thin(&measured, buckets));
    panel.line(&mut svg, "c", thin(&calibrated, buckets));
    svg.finish(&label(joint, trace))
}

impl Curves {
    fn of(trace: &Trace, range: &Range<usize>) -> Self {
        let time = &trace.time[range.clone()];
        let part = |values: &[f64]| -> Vec<(f64, f64)> {
            with_gaps(
                time.iter().copied().zip(
                    values[range.start.min(values.len())..range.end.min(values.len())]
                        .iter()
                        .copied(),
                ),
            )
        };
        let (low, high) = (part(&trace.low), part(&trace.high));
        Self {
            measured: part(&trace.measured),
            nominal: part(&trace.nominal),
            calibrated: part(&trace.calibrated),
            band: low
                .iter()
                .zip(&high)
                .map(|(l, h)| (l.0, l.1, h.1))
                .collect(),
        }
    }
}

/// What the chart shows, in words for readers who do not see it.
fn label(joint: &Joint<'_>, trace: &Trace) -> String {
    format!(
        "Line chart over time of the torque of joint {} in {}: measured, nominal (error {} {unit}) and calibrated \
         (error {} {unit}) with its 95 % interval{}.",
        joint.name,
        trace.log,
        number(rmse(trace, &trace.nominal), 3),
        number(rmse(trace, &trace.calibrated), 3),
        match stands_still_between(trace) {
            true => "; errors while it moves",
            false => "",
        },
        unit = joint.units.torque,
    )
}

/// All lines, and the band as far as it does not squeeze the lines to less than half of the height.
fn torque_range(lines: &[&Vec<(f64, f64)>], band: &[(f64, f64, f64)]) -> (f64, f64) {
    let (low, high) = extent(lines.iter().flat_map(|line| line.iter().map(|p| p.1)));
    let room = 0.5 * (high - low);
    let (band_low, band_high) = extent(band.iter().flat_map(|p| [p.1, p.2]));
    let (low, high) = (
        low.min(band_low.max(low - room)),
        high.max(band_high.min(high + room)),
    );
    let margin = 0.03 * (high - low);
    (low - margin, high + margin)
}

/// A point that is not a number after every pause longer than five usual steps, so that lines break there.
pub(super) fn with_gaps(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let points: Vec<_> = points.collect();
    let times: Vec<f64> = points.iter().map(|point| point.0).collect();
    let limit = longest_step(&times);
    let mut out = Vec::with_capacity(points.len());
    for (i, &point) in points.iter().enumerate() {
        if i > 0 && point.0 - points[i - 1].0 > limit {
            out.push((points[i - 1].0, f64::NAN));
        }
        out.push(point);
    }
    out
}

/// A step of time that is longer is a pause: five usual steps.
pub(in crate::report) fn longest_step(times: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .filter(|step| *step > 0.0)
        .collect();
    steps.sort_by(f64::total_cmp);
    5.0 * steps.get(steps.len() / 2).copied().unwrap_or(f64::INFINITY)
}

/// Maximal runs of `true` inside `range`.
pub(in crate::report) fn runs(flags: &[bool], range: &Range<usize>) -> Vec<Range<usize>> {
    let mut out: Vec<Range<usize>> = Vec::new();
    for i in range
        .clone()
        .filter(|&i| flags.get(i).copied().unwrap_or(false))
    {
        match out.last_mut() {
            Some(run) if run.end == i => run.end = i + 1,
            _ => out.push(i..i + 1),
        }
    }
    out
}

fn shade(svg: &mut Svg, panel: &Panel, class: &'static str, from: f64, to: f64) {
    let (x, top) = panel.at(from, panel.y.domain.1);
    let (end, bottom) = panel.at(to, panel.y.domain.0);
    svg.rect(class, (x, top), ((end - x).max(1.0), bottom - top), None);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trace(n: usize, rate: f64) -> Trace {
        let time: Vec<f64> = (0..n).map(|i| i as f64 / rate).collect();
        let zero = vec![0.0; n];
        Trace {
            time,
            measured: zero.clone(),
            nominal: zero.clone(),
            calibrated: zero,
            ..Trace::default()
        }
    }

    #[test]
    fn the_window_is_where_the_error_is() {
        let mut long = trace(1000, 20.0);
        for i in 610..650 {
            long.measured[i] = 1.0;
        }
        let window = worst_window(&long);
        assert!(window.start <= 610 && window.end >= 650, "{window:?}");
        assert!((seconds(&long, &window) - 10.0).abs() < 0.1);
        for n in [0, 1, 2, 40] {
            assert_eq!(worst_window(&trace(n, 20.0)), 0..n);
        }
    }

    #[test]
    fn a_thinned_trace_says_so() {
        let calibration = crate::report::fixture::two_joints();
        let joints = crate::report::view::joints(&calibration);
        let mut trace = joints[0].traces[0].clone();
        assert!(scores(&joints[0], &trace).ends_with("N·m"));
        trace.step = 12;
        assert!(scores(&joints[0], &trace).ends_with("N·m, from one row in 12"));
    }

    #[test]
    fn standstill_runs_are_maximal_and_inside_the_range() {
        let flags = [true, true, false, true, true, true];
        assert_eq!(runs(&flags, &(1..5)), [1..2, 3..5]);
        assert!(runs(&[], &(0..3)).is_empty());
    }

    #[test]
    fn a_pause_becomes_a_break() {
        let points =
            with_gaps([(0.0, 1.0), (0.1, 1.0), (0.2, 1.0), (5.0, 1.0), (5.1, 1.0)].into_iter());
        assert_eq!(points.iter().position(|p| p.1.is_nan()), Some(3));
        assert_eq!(points.len(), 6);
    }

    #[test]
    fn a_huge_interval_does_not_flatten_the_lines() {
        let line = vec![(0.0, -1.0), (1.0, 1.0)];
        let (low, high) = torque_range(&[&line], &[(0.0, -100.0, 1.2)]);
        assert!(low > -2.2 && (1.2..1.4).contains(&high), "{low} {high}");
    }
}
