//! Mass and inertia of MJCF geoms: the primitives that MuJoCo integrates itself.

use super::super::xml::shorten;
use super::compiler::Compiler;
use super::defaults::View;
use crate::error::{Error, Result};
use std::f64::consts::PI;
use twincal::robot::spatial::{Matrix, Vector, add, norm, rotate_tensor, scale, z_to};
use twincal::robot::{Inertia, Placement};

/// Density of a geom that states neither mass nor density, kg/m³.
const WATER: f64 = 1000.0;

/// Mass, centre of mass and inertia of a geom in its body's frame; `None` when it adds nothing.
///
/// # Errors
/// At the geom: a mesh or another shape whose inertia twincal cannot know, sizes that are missing or not positive.
pub(super) fn inertia(
    compiler: &Compiler,
    view: &View<'_, '_>,
    outer: &Placement,
    body: &str,
) -> Result<Option<Inertia>> {
    let group = view.number("group")?.unwrap_or(0.0);
    if !(compiler.group_range[0] <= group && group <= compiler.group_range[1]) {
        return Ok(None);
    }
    let (stated, density) = (view.number("mass")?, view.number("density")?);
    for (what, value) in [("mass", stated), ("density", density)] {
        if value.is_some_and(|v| !v.is_finite() || v < 0.0) {
            return fail(
                view,
                body,
                format!("{what} is {}", value.unwrap_or(f64::NAN)),
                "give 0 or more",
            );
        }
    }
    if stated == Some(0.0) || (stated.is_none() && density == Some(0.0)) {
        return Ok(None);
    }
    let kind = view.text("type").unwrap_or("sphere");
    if kind == "plane" || kind == "hfield" {
        return Ok(None);
    }
    refuse_unknown_inertia(view, kind, body)?;
    let (size, place) = shape(compiler, view, kind, body)?;
    let solid = solid(kind, size);
    let mass = stated.unwrap_or(density.unwrap_or(WATER) * solid.volume);
    let place = outer.compose(&place);
    let mut tensor: Matrix = [[0.0; 3]; 3];
    for k in 0..3 {
        tensor[k][k] = mass * solid.radii[k];
    }
    Ok(Some(Inertia {
        mass,
        com: place.translation,
        tensor: rotate_tensor(&place.rotation, &tensor),
    }))
}

/// Refuses shapes that have no closed form here: meshes and shells.
fn refuse_unknown_inertia(view: &View<'_, '_>, kind: &str, body: &str) -> Result<()> {
    if !["sphere", "capsule", "cylinder", "box", "ellipsoid"].contains(&kind)
        || view.get("mesh").is_some()
    {
        return fail(
            view,
            body,
            format!(
                "has no <inertial>, and the inertia of its {} geom would need the mesh",
                shorten(kind)
            ),
            "write the inertia that MuJoCo computes into the model: in Python m = mujoco.MjModel.from_xml_path(…), then \
             <inertial> from m.body(…).mass, .ipos, .iquat and .inertia, or save it with <compiler saveinertial=\"true\"/>",
        );
    }
    if view.flag("shellinertia") == Some(true) {
        return fail(
            view,
            body,
            "has a geom with shellinertia=\"true\"".into(),
            "twincal computes solid bodies only: give the body an <inertial>",
        );
    }
    Ok(())
}

/// Half sizes (as MuJoCo means them) and placement in the body.
pub(super) fn shape(
    compiler: &Compiler,
    view: &View<'_, '_>,
    kind: &str,
    body: &str,
) -> Result<(Vector, Placement)> {
    // A short list replaces only the first numbers of the class's size.
    let mut size: Vector = [0.0; 3];
    let own = view.element.get("size").map(|a| (view.element, a));
    for (element, attribute) in view.stated("size").iter().copied().chain(own) {
        for (slot, value) in size
            .iter_mut()
            .zip(view.document.number_list(element, attribute)?)
        {
            *slot = value;
        }
    }
    let mut place = compiler.placement(view)?;
    let mut needed = match kind {
        "sphere" => 1,
        "capsule" | "cylinder" => 2,
        _ => 3,
    };
    if kind != "sphere"
        && let Some([a, b, c, d, e, f]) = view.numbers::<6>("fromto")?
    {
        let along = [a - d, b - e, c - f];
        let length = norm(along);
        if !(length.is_finite() && length > 0.0) {
            return fail(
                view,
                body,
                "has a geom whose fromto has no length".into(),
                "give two different points",
            );
        }
        place.translation = scale(0.5, add([a, b, c], [d, e, f]));
        place.rotation = z_to(scale(1.0 / length, along));
        if needed == 3 {
            size = [size[0], size[0], 0.5 * length];
        } else {
            size[1] = 0.5 * length;
        }
        needed = 1;
    }
    if !size[..needed].iter().all(|v| v.is_finite() && *v > 0.0) {
        return fail(
            view,
            body,
            format!("has a {kind} geom of size {:?}", &size[..needed]),
            "give positive half sizes in m",
        );
    }
    Ok((size, place))
}

/// Volume, and principal moments per kilogram.
struct Solid {
    volume: f64,
    radii: Vector,
}

/// Closed forms of the homogeneous solids, long axis z.
fn solid(kind: &str, [a, b, c]: Vector) -> Solid {
    match kind {
        "sphere" => Solid {
            volume: 4.0 / 3.0 * PI * a * a * a,
            radii: [0.4 * a * a; 3],
        },
        "box" => Solid {
            volume: 8.0 * a * b * c,
            radii: [
                (b * b + c * c) / 3.0,
                (a * a + c * c) / 3.0,
                (a * a + b * b) / 3.0,
            ],
        },
        "ellipsoid" => Solid {
            volume: 4.0 / 3.0 * PI * a * b * c,
            radii: [
                (b * b + c * c) / 5.0,
                (a * a + c * c) / 5.0,
                (a * a + b * b) / 5.0,
            ],
        },
        "cylinder" => {
            // radius a, half length b
            let across = (3.0 * a * a + 4.0 * b * b) / 12.0;
            Solid {
                volume: 2.0 * PI * a * a * b,
                radii: [across, across, 0.5 * a * a],
            }
        }
        _ => {
            // Capsule: a cylinder of length 2b and two half balls of radius a, whose centres of mass are 3a/8 outside
            // the cylinder's ends.
            let ball = 4.0 * a / (4.0 * a + 6.0 * b);
            let tube = 1.0 - ball;
            let across = tube * (3.0 * a * a + 4.0 * b * b) / 12.0
                + ball * (0.4 * a * a + b * (3.0 * a + 4.0 * b) / 4.0);
            let along = tube * 0.5 * a * a + ball * 0.4 * a * a;
            Solid {
                volume: PI * a * a * (2.0 * b + 4.0 / 3.0 * a),
                radii: [across, across, along],
            }
        }
    }
}

fn fail<T>(view: &View<'_, '_>, body: &str, problem: String, remedy: &str) -> Result<T> {
    let error: Error =
        view.document
            .error(view.element, format!("body `{body}`: {problem}"), remedy);
    Err(error)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean of x², y², z² over the solid by midpoints; the moments follow. No formula of the code above.
    #[test]
    fn closed_forms_are_the_integrals() {
        let inside = |kind: &str, [a, b, c]: Vector, [x, y, z]: Vector| match kind {
            "sphere" => x * x + y * y + z * z < a * a,
            "box" => x.abs() < a && y.abs() < b && z.abs() < c,
            "ellipsoid" => x * x / (a * a) + y * y / (b * b) + z * z / (c * c) < 1.0,
            "cylinder" => x * x + y * y < a * a && z.abs() < b,
            _ => x * x + y * y + (z.abs() - b).max(0.0).powi(2) < a * a,
        };
        for (kind, size, reach) in [
            ("sphere", [0.7, 0.0, 0.0], [0.7, 0.7, 0.7]),
            ("box", [0.2, 0.5, 0.9], [0.2, 0.5, 0.9]),
            ("ellipsoid", [0.3, 0.6, 0.9], [0.3, 0.6, 0.9]),
            ("cylinder", [0.4, 0.8, 0.0], [0.4, 0.4, 0.8]),
            ("capsule", [0.3, 0.5, 0.0], [0.3, 0.3, 0.8]),
        ] {
            let n = 160;
            let (mut count, mut sums) = (0.0, [0.0; 3]);
            for i in 0..n * n * n {
                let cell = [i % n, i / n % n, i / (n * n)];
                let p: Vector = std::array::from_fn(|k| {
                    reach[k] * ((cell[k] as f64 + 0.5) / n as f64 * 2.0 - 1.0)
                });
                if inside(kind, size, p) {
                    count += 1.0;
                    sums = add(sums, p.map(|v| v * v));
                }
            }
            let box_volume = 8.0 * reach[0] * reach[1] * reach[2];
            let volume = box_volume * count / (n * n * n) as f64;
            let [x, y, z] = sums.map(|s| s / count);
            let found = solid(kind, size);
            assert!(
                (found.volume / volume - 1.0).abs() < 2e-3,
                "{kind}: {} {volume}",
                found.volume
            );
            for (k, expected) in [y + z, x + z, x + y].into_iter().enumerate() {
                assert!(
                    (found.radii[k] / expected - 1.0).abs() < 3e-3,
                    "{kind} {k}: {} {expected}",
                    found.radii[k]
                );
            }
        }
    }
}
