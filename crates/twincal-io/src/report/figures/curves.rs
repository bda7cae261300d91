//! Torque that was found over a joint's own position or velocity: springs, counterbalances, friction laws.

use crate::report::figure::{Figure, HALF, Image, Legend, legend};
use crate::report::plot::{Frame, Panel};
use crate::report::scale::extent;
use crate::report::svg::Svg;
use crate::report::view::Joint;
use crate::words::list::list;
use crate::words::number::probability;
use twincal::calibrate::{Along, ComponentSummary, Curve};

const MEAN: Legend = Legend {
    mark: "line",
    class: "c",
    label: "missing torque",
};

/// The figure over all curves; `None` if nothing of that kind was found.
pub(in crate::report) fn figure(
    curves: &[Curve],
    components: &[ComponentSummary],
    joints: &[Joint<'_>],
) -> Option<Figure> {
    let images: Vec<Image> = curves
        .iter()
        .filter_map(|curve| {
            let joint = joints.iter().find(|joint| joint.name == curve.joint)?;
            Some(draw(curve, components, joint))
        })
        .collect();
    (!images.is_empty()).then(|| Figure {
        title: "Missing torque as a law of one joint".into(),
        read: "Over the range in the logs: what the model lacks on a joint as a function of its own position (springs, \
               counterbalances) or velocity (friction), averaged over all models, those without an effect too. Where the band is narrow the law is known, even if its coefficients \
               cannot be told apart. What also acts on other joints or with acceleration (a payload, masses) is not in it."
            .into(),
        legend: vec![MEAN, legend::BAND],
        images,
    })
}

fn draw(curve: &Curve, components: &[ComponentSummary], joint: &Joint<'_>) -> Image {
    let ends = curve.low95.iter().chain(&curve.high95).copied();
    let (low, high) = extent(ends.chain([0.0]));
    let y = (low - 0.04 * (high - low), high + 0.04 * (high - low));
    let height = 230.0;
    let frame = Frame::inside(HALF, height, y);
    let ends = |x: &[f64]| Some((*x.first()?, *x.last()?));
    let x = ends(&curve.x).unwrap_or((0.0, 1.0));
    let panel = Panel::new(frame, x, y);
    let (quantity, unit) = match curve.along {
        Along::Position => ("position", joint.units.position),
        Along::Velocity => ("velocity", joint.units.velocity),
    };
    let mut svg = Svg::new(HALF, height);
    panel.axes(
        &mut svg,
        &format!("{quantity} ({unit})"),
        &format!("torque ({})", joint.units.torque),
    );
    let bounds = curve.low95.iter().zip(&curve.high95);
    let band: Vec<(f64, f64, f64)> = curve
        .x
        .iter()
        .zip(bounds)
        .map(|(&x, (&low, &high))| (x, low, high))
        .collect();
    panel.band(&mut svg, "b", &band);
    svg.line("a", panel.at(x.0, 0.0), panel.at(x.1, 0.0));
    panel.line(
        &mut svg,
        "c",
        curve.x.iter().copied().zip(curve.mean.iter().copied()),
    );
    let label = format!(
        "Missing torque of joint {} over its {quantity}, with its 95 percent interval.",
        joint.name
    );
    let laws = laws(curve, components);
    Image::half(
        format!("{} over {quantity}: {laws}", joint.name),
        svg.finish(&label),
    )
}

/// "a and b; counted in by their probability: c (PIP 0.11)": what was found, and what was not and is in line and band all the same.
fn laws(curve: &Curve, components: &[ComponentSummary]) -> String {
    let mut found = Vec::new();
    let mut open = Vec::new();
    for name in &curve.components {
        match components.iter().find(|own| own.name == *name) {
            Some(own) if !own.is_in() && own.pip.is_some() => {
                let pip = probability(own.pip.unwrap_or(0.0));
                open.push(format!("{name} (PIP {pip})"));
            }
            _ => found.push(name.as_str()),
        }
    }
    match open.is_empty() {
        true => list(&found),
        false => format!(
            "{}; counted in by their probability: {}",
            list(&found),
            list(&open)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;

    #[test]
    fn what_was_not_found_is_told_apart_from_what_was() {
        let calibration = fixture::two_joints();
        let (found, open) = {
            let of = |selected: bool| {
                let mut all = calibration.components.iter();
                all.find(|own| own.is_in() == selected && own.pip.is_some())
            };
            (of(true).unwrap(), of(false).unwrap())
        };
        let curve = |names: &[&String]| Curve {
            joint: "elbow".into(),
            along: Along::Velocity,
            components: names.iter().map(|name| (*name).clone()).collect(),
            x: Vec::new(),
            mean: Vec::new(),
            low95: Vec::new(),
            high95: Vec::new(),
        };
        let of = |names: &[&String]| laws(&curve(names), &calibration.components);
        assert_eq!(of(&[&found.name]), found.name);
        assert_eq!(
            of(&[&open.name, &found.name]),
            format!(
                "{}; counted in by their probability: {} (PIP {})",
                found.name,
                open.name,
                probability(open.pip.expect("a candidate with a probability"))
            )
        );
    }
}
