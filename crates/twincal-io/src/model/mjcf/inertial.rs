//! The inertia of one MJCF body: stated, or the sum of its geoms, then the compiler's bounds.

use super::super::xml::Document;
use super::body::Part;
use super::compiler::{Compiler, FromGeom};
use super::defaults::{Defaults, View};
use super::geom;
use crate::error::Result;
use twincal::robot::spatial::{IDENTITY, add, rotate_tensor, scale};
use twincal::robot::{Inertia, Placement, principal_axes};

/// Inertia of a body in its own frame; `None` when nothing states one.
///
/// # Errors
/// At the element that cannot be used; a mesh only where the body `moves`.
pub(super) fn of_body<'a>(
    document: &'a Document,
    compiler: &Compiler,
    defaults: &Defaults<'a>,
    parts: &[Part<'a>],
    body: &str,
    moves: bool,
) -> Result<Option<Inertia>> {
    let mut explicit = None;
    for part in parts.iter().filter(|p| p.element.name == "inertial") {
        if explicit.is_some() {
            return Err(document.error(
                part.element,
                format!("body `{body}` has a second <inertial>"),
                "keep one of them, as MuJoCo asks",
            ));
        }
        explicit = Some(stated(document, compiler, part, body)?);
    }
    let from_geoms = match compiler.inertia_from_geom {
        FromGeom::No => false,
        FromGeom::Yes => true,
        FromGeom::Auto => explicit.is_none(),
    };
    // What stands on the base without moving never needs an inertia.
    if !moves {
        return Ok(explicit);
    }
    let mut inertia = explicit;
    if from_geoms {
        let mut geoms = Vec::new();
        for part in parts.iter().filter(|p| p.element.name == "geom") {
            let view = defaults.view(document, part.element, part.childclass)?;
            geoms.extend(geom::inertia(compiler, &view, &part.placement, body)?);
        }
        inertia = sum(&geoms).or(explicit);
    }
    Ok(inertia.map(|inertia| bounded(compiler, inertia)))
}

/// `<inertial>`.
fn stated(
    document: &Document,
    compiler: &Compiler,
    part: &Part<'_>,
    body: &str,
) -> Result<Inertia> {
    let view = View::plain(document, part.element);
    let fail = |problem: &str, remedy: &str| {
        Err(document.error(
            part.element,
            format!("body `{body}`: <inertial> {problem}"),
            remedy,
        ))
    };
    let Some(mass) = view.number("mass")? else {
        return fail("has no mass", "add mass=\"…\" in kg");
    };
    if view.get("pos").is_none() {
        return fail("has no pos", "add pos=\"x y z\", the centre of mass in m");
    }
    let place = part.placement.compose(&compiler.placement(&view)?);
    let tensor = match (
        view.numbers::<3>("diaginertia")?,
        view.numbers::<6>("fullinertia")?,
    ) {
        (Some(_), Some(_)) => return fail("has diaginertia and fullinertia", "give one of them"),
        (Some(d), None) => std::array::from_fn(|k| scale(d[k], IDENTITY[k])),
        (None, Some([xx, yy, zz, xy, xz, yz])) => [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]],
        (None, None) => [[0.0; 3]; 3],
    };
    let tensor = if place.rotation == IDENTITY {
        tensor
    } else {
        rotate_tensor(&place.rotation, &tensor)
    };
    Ok(Inertia {
        mass,
        com: place.translation,
        tensor,
    })
}

/// Several bodies as one, about their common centre of mass.
fn sum(parts: &[Inertia]) -> Option<Inertia> {
    if let [one] = parts {
        return Some(*one);
    }
    let mass: f64 = parts.iter().map(|p| p.mass).sum();
    if mass == 0.0 {
        return None;
    }
    let com = parts
        .iter()
        .fold([0.0; 3], |c, p| add(c, scale(p.mass / mass, p.com)));
    let mut tensor = [[0.0; 3]; 3];
    for part in parts {
        let d = add(part.com, scale(-1.0, com));
        let square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        for i in 0..3 {
            for j in 0..3 {
                let diagonal = if i == j { square } else { 0.0 };
                tensor[i][j] += part.tensor[i][j] + part.mass * (diagonal - d[i] * d[j]);
            }
        }
    }
    Some(Inertia { mass, com, tensor })
}

/// `boundmass`, `boundinertia`, `balanceinertia`, in MuJoCo's order.
fn bounded(compiler: &Compiler, mut inertia: Inertia) -> Inertia {
    inertia.mass = inertia.mass.max(compiler.bound_mass);
    if !inertia.tensor.as_flattened().iter().all(|v| v.is_finite()) {
        return inertia; // refused with its link's name when the robot is built
    }
    let (mut moments, axes) = principal_axes(&inertia.tensor);
    let bound = moments.iter().any(|&m| m < compiler.bound_inertia);
    moments = moments.map(|m| m.max(compiler.bound_inertia));
    let balance = compiler.balance && moments[0] + moments[1] < moments[2];
    if balance {
        moments = [(moments[0] + moments[1] + moments[2]) / 3.0; 3];
    }
    if bound || balance {
        let diagonal = std::array::from_fn(|k| scale(moments[k], IDENTITY[k]));
        inertia.tensor = rotate_tensor(&axes, &diagonal);
    }
    inertia
}

/// The inertia seen from a frame at `origin` (same axes) of the body's frame.
pub(super) fn moved(inertia: Inertia, origin: [f64; 3]) -> Inertia {
    Inertia {
        com: add(inertia.com, scale(-1.0, origin)),
        ..inertia
    }
}

/// A placement that only shifts.
pub(super) fn shift(translation: [f64; 3]) -> Placement {
    Placement {
        rotation: IDENTITY,
        translation,
    }
}
