//! What the model misses over time, before and after calibration.

use super::torque::with_gaps;
use crate::report::figure::{Figure, Image, legend};
use crate::report::plot::{Frame, Panel, thin, thin_band};
use crate::report::scale::extent;
use crate::report::svg::Svg;
use crate::report::view::{Joint, rows};
use twincal::validate::Trace;

/// The figure over all joints, each on the held-out log that the calibrated twin predicts worst.
pub(in crate::report) fn figure(joints: &[Joint<'_>]) -> Option<Figure> {
    let images: Vec<_> = joints
        .iter()
        .filter_map(|joint| {
            let trace = *joint.traces.first()?;
            Some(Image::full(
                format!("{} in {}", joint.name, trace.log),
                |width| draw(joint, trace, width),
            ))
        })
        .collect();
    (!images.is_empty()).then(|| Figure {
        title: "Residual torque over time".into(),
        read: "Measured minus predicted torque: what is left after calibration should be small, without pattern, and mostly \
               inside the band."
            .into(),
        legend: vec![legend::BEFORE, legend::AFTER, legend::BAND],
        images,
    })
}

fn draw(joint: &Joint<'_>, trace: &Trace, width: f64) -> String {
    let n = rows(trace);
    let line = |value: &dyn Fn(usize) -> f64| with_gaps((0..n).map(|i| (trace.time[i], value(i))));
    let before = line(&|i| trace.measured[i] - trace.nominal[i]);
    let after = line(&|i| trace.measured[i] - trace.calibrated[i]);
    let low = line(&|i| {
        trace
            .low
            .get(i)
            .map_or(f64::NAN, |l| l - trace.calibrated[i])
    });
    let high = line(&|i| {
        trace
            .high
            .get(i)
            .map_or(f64::NAN, |h| h - trace.calibrated[i])
    });
    let (bottom, top) = extent(before.iter().chain(&after).map(|p| p.1).chain([0.0]));
    let margin = 0.05 * (top - bottom);
    let y = (bottom - margin, top + margin);
    let band: Vec<_> = low
        .iter()
        .zip(&high)
        .map(|(l, h)| (l.0, l.1.clamp(y.0, y.1), h.1.clamp(y.0, y.1)))
        .collect();
    let height = 190.0;
    let frame = Frame::inside(width, height, y);
    let panel = Panel::new(frame, extent(trace.time[..n].iter().copied()), y);
    let buckets = ((frame.right - frame.left) / 2.0) as usize;
    let mut svg = Svg::new(width, height);
    panel.axes(
        &mut svg,
        "time (s)",
        &format!("residual ({})", joint.units.torque),
    );
    panel.band(&mut svg, "b", &thin_band(&band, buckets));
    panel.line(&mut svg, "ns", thin(&before, buckets));
    panel.line(&mut svg, "c", thin(&after, buckets));
    svg.line(
        "a",
        panel.at(panel.x.domain.0, 0.0),
        panel.at(panel.x.domain.1, 0.0),
    );
    svg.finish(&format!(
        "Line chart over time of the residual torque of joint {} before and after calibration.",
        joint.name
    ))
}
