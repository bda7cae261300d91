//! `<collision>` and `<visual>` of URDF links.

use super::shapes::{Form, Geometry, LinkShape, MeshFile};
use super::urdf::{origin, required};
use super::xml::{Document, Element, shorten};
use crate::error::Result;
use twincal::robot::Placement;

/// Geometry of all links.
///
/// # Errors
/// With the place of the element or attribute.
pub(super) fn geometry(document: &Document) -> Result<Geometry> {
    let root = &document.elements[0];
    let mut shapes = Vec::new();
    for link in document.children(root, "link") {
        let name = link.text("name").unwrap_or("");
        let kind = match document.child(link, "collision") {
            Some(_) => "collision",
            None => "visual",
        };
        for element in document.children(link, kind) {
            let Some(form) = form(document, element, name)? else {
                continue;
            };
            shapes.push(LinkShape {
                link: name.to_owned(),
                placement: origin(document, element)?,
                form,
            });
        }
    }
    Ok(Geometry {
        shapes,
        excluded: Vec::new(),
    })
}

/// What stands in `<geometry>`; `None` where nothing does.
fn form(document: &Document, element: &Element, link: &str) -> Result<Option<Form>> {
    let Some(geometry) = document.child(element, "geometry") else {
        return Ok(None);
    };
    let Some(&first) = geometry.children.first() else {
        return Ok(None);
    };
    let shape = &document.elements[first];
    let positive = |value: f64, key: &str| match value.is_finite() && value > 0.0 {
        true => Ok(value),
        false => Err(document.error(
            shape,
            format!("link `{link}`: <{}> {key} is {value}", shorten(&shape.name)),
            "give a positive length in m",
        )),
    };
    let length = |key: &str| positive(required(document, shape, key)?, key);
    let form = match shape.name.as_str() {
        "box" => {
            let size = document.numbers::<3>(shape, "size")?.unwrap_or([0.0; 3]);
            for edge in size {
                positive(edge, "size")?;
            }
            Form::Box(size.map(|edge| 0.5 * edge))
        }
        "sphere" => Form::Sphere(length("radius")?),
        "cylinder" => Form::Cylinder(length("radius")?, 0.5 * length("length")?),
        "capsule" => Form::Capsule(length("radius")?, 0.5 * length("length")?),
        "mesh" => Form::Mesh(MeshFile {
            file: shape.text("filename").unwrap_or("").to_owned(),
            folder: String::new(),
            scale: document.numbers(shape, "scale")?.unwrap_or([1.0; 3]),
            reference: Placement::IDENTITY,
        }),
        other => Form::Other(shorten(other)),
    };
    Ok(Some(form))
}
