//! How long the residual remembers itself: autocorrelation before and after calibration, per joint.

use crate::report::figure::{Figure, HALF, Image, Legend, legend};
use crate::report::plot::{Frame, Panel};
use crate::report::scale::extent;
use crate::report::svg::Svg;
use crate::report::view::Joint;
use crate::words::number::{count, number};
use twincal::calibrate::Calibration;

/// The figure; `None` where the calibration carries no autocorrelation.
pub(in crate::report) fn figure(calibration: &Calibration, joints: &[Joint<'_>]) -> Option<Figure> {
    let curves = &calibration.autocorrelation;
    let rate = calibration.twin.pipeline.rate_hz;
    let images: Vec<_> = joints
        .iter()
        .enumerate()
        .filter_map(|(j, joint)| {
            let (before, after) = (curves.get(2 * j)?, curves.get(2 * j + 1)?);
            (after.len() > 1).then(|| draw(joint, before, after, rate))
        })
        .collect();
    (!images.is_empty()).then(|| Figure {
        title: "Autocorrelation of the residual: effective sample size".into(),
        read: "Rows whose residuals resemble their neighbours' carry little new information: a curve that drops into the \
               grey band at once is white noise, a slow one means fewer effective samples and wider intervals."
            .into(),
        legend: vec![
            legend::BEFORE,
            legend::AFTER,
            Legend { mark: "area", class: "still", label: "white noise (95 %)" },
        ],
        images,
    })
}

fn draw(joint: &Joint<'_>, before: &[f64], after: &[f64], rate: f64) -> Image {
    let (step, x_label) = if rate > 0.0 {
        (1.0 / rate, "lag (s)")
    } else {
        (1.0, "lag (rows)")
    };
    let curve = |values: &[f64]| -> Vec<(f64, f64)> {
        values
            .iter()
            .enumerate()
            .map(|(lag, &r)| (lag as f64 * step, r))
            .collect()
    };
    let (before, after) = (curve(before), curve(after));
    let (low, _) = extent(before.iter().chain(&after).map(|p| p.1).chain([-0.2]));
    let height = 210.0;
    let panel = Panel::new(
        Frame::inside(HALF, height, (-1.0, 1.0)),
        (0.0, step * (before.len().max(after.len()) - 1) as f64),
        (low - 0.05, 1.05),
    );
    let mut svg = Svg::new(HALF, height);
    let white = 1.96 / joint.noise.n.max(1.0).sqrt();
    panel.band(
        &mut svg,
        "still",
        &[(0.0, -white, white), (panel.x.domain.1, -white, white)],
    );
    panel.axes(&mut svg, x_label, "autocorrelation");
    svg.line("a", panel.at(0.0, 0.0), panel.at(panel.x.domain.1, 0.0));
    panel.line(&mut svg, "ns", before);
    panel.dots(&mut svg, "pc big", after.iter().copied());
    panel.line(&mut svg, "c", after);
    let noise = joint.noise;
    let rows = count(noise.n.max(0.0).round() as u64);
    let caption = format!(
        "{}: {rows} rows count as {}",
        joint.name,
        number(noise.n_eff, 3)
    );
    let label = format!(
        "Autocorrelation of the residual of joint {} before and after calibration; {rows} rows count as {} independent ones.",
        joint.name,
        number(noise.n_eff, 3)
    );
    Image::half(caption, svg.finish(&label))
}
