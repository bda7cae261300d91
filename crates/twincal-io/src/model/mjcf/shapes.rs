//! `<geom>` of MJCF bodies and the meshes that they name.

use super::super::shapes::{Form, Geometry, LinkShape, MeshFile};
use super::super::xml::{Document, Element, shorten};
use super::body::{Part, Tree};
use super::compiler::Compiler;
use super::defaults::{Defaults, View};
use super::geom;
use super::inertial::shift;
use crate::error::Result;
use std::collections::{BTreeMap, BTreeSet};
use twincal::robot::Placement;
use twincal::robot::spatial::{apply, scale, transpose};

/// A `<geom>` in its body, gathered while the bodies are read.
#[derive(Debug, Clone)]
pub(super) struct Placed<'a> {
    pub(super) part: Part<'a>,
    pub(super) link: String,
    /// Origin of the link's frame in the body's frame, m.
    pub(super) origin: [f64; 3],
}

/// Geometry of all bodies.
///
/// # Errors
/// With the place of the element or attribute.
pub(super) fn geometry(document: &Document, root: &Element, tree: &Tree<'_>) -> Result<Geometry> {
    let meshes = Meshes::read(document, root, tree)?;
    let mut found: Vec<(LinkShape, bool)> = Vec::new();
    for placed in &tree.geoms {
        let part = &placed.part;
        let view = (tree.defaults).view(document, part.element, part.childclass)?;
        let touches = |key| -> Result<bool> { Ok(view.number(key)?.unwrap_or(1.0) != 0.0) };
        let collides = touches("contype")? || touches("conaffinity")?;
        let (form, own) = form(&tree.compiler, &view, &placed.link, &meshes)?;
        let outer = shift(scale(-1.0, placed.origin)).compose(&part.placement);
        let shape = LinkShape {
            link: placed.link.clone(),
            placement: outer.compose(&own),
            form,
        };
        found.push((shape, collides));
    }
    let colliding: BTreeSet<String> = (found.iter())
        .filter(|(_, collides)| *collides)
        .map(|(shape, _)| shape.link.clone())
        .collect();
    // What only shows counts where a body has nothing else.
    found.retain(|(shape, collides)| *collides || !colliding.contains(&shape.link));
    Ok(Geometry {
        shapes: found.into_iter().map(|(shape, _)| shape).collect(),
        excluded: excluded(document, root),
    })
}

/// Form of a geom and its frame in the body's.
fn form(
    compiler: &Compiler,
    view: &View<'_, '_>,
    body: &str,
    meshes: &Meshes,
) -> Result<(Form, Placement)> {
    let kind = view.text("type").unwrap_or("sphere");
    if let Some(mesh) = view.text("mesh") {
        let own = compiler.placement(view)?;
        let form = meshes.by_name.get(mesh).cloned();
        return Ok((
            form.unwrap_or_else(|| Form::Other(format!("mesh {}", shorten(mesh)))),
            own,
        ));
    }
    if kind == "plane" {
        return Ok((Form::HalfSpace, compiler.placement(view)?));
    }
    if !["sphere", "capsule", "cylinder", "box", "ellipsoid"].contains(&kind) {
        return Ok((Form::Other(shorten(kind)), compiler.placement(view)?));
    }
    let (size, own) = geom::shape(compiler, view, kind, body)?;
    let form = match kind {
        "sphere" => Form::Sphere(size[0]),
        "capsule" => Form::Capsule(size[0], size[1]),
        "cylinder" => Form::Cylinder(size[0], size[1]),
        "box" => Form::Box(size),
        _ => Form::Ellipsoid(size),
    };
    Ok((form, own))
}

/// Meshes of `<asset>`.
struct Meshes {
    by_name: BTreeMap<String, Form>,
}

impl Meshes {
    fn read(document: &Document, root: &Element, tree: &Tree<'_>) -> Result<Self> {
        let mut folder = String::new();
        for compiler in document.children(root, "compiler") {
            let stated = compiler.text("meshdir").or(compiler.text("assetdir"));
            folder = stated.map_or(folder, str::to_owned);
        }
        let mut by_name = BTreeMap::new();
        for asset in document.children(root, "asset") {
            for element in document.children(asset, "mesh") {
                let view = tree.defaults.view(document, element, None)?;
                let (name, form) = mesh(document, &view, &tree.compiler, &folder)?;
                by_name.insert(name, form);
            }
        }
        Ok(Self { by_name })
    }
}

/// Name and form of a `<mesh>`; without a name it is called like its file.
fn mesh(
    document: &Document,
    view: &View<'_, '_>,
    compiler: &Compiler,
    folder: &str,
) -> Result<(String, Form)> {
    let file = view.element.text("file").unwrap_or("");
    let stem = file.rsplit('/').next().unwrap_or("");
    let stem = stem.rsplit_once('.').map_or(stem, |(stem, _)| stem);
    let name = view.element.text("name").unwrap_or(stem).to_owned();
    let factor = view.numbers("scale")?.unwrap_or([1.0; 3]);
    let reference = Placement {
        rotation: compiler.reference_rotation(view)?,
        translation: view.numbers("refpos")?.unwrap_or([0.0; 3]),
    };
    let Some(vertices) = view.element.get("vertex").filter(|_| file.is_empty()) else {
        let mesh = MeshFile {
            file: file.to_owned(),
            folder: folder.to_owned(),
            scale: factor,
            reference,
        };
        return Ok((name, Form::Mesh(mesh)));
    };
    let numbers = document.number_list(view.element, vertices)?;
    let points = numbers.chunks_exact(3).map(|p| {
        let scaled = std::array::from_fn(|k| p[k] * factor[k]);
        seen_from(&reference, scaled)
    });
    Ok((name, Form::Points(points.collect())))
}

/// A point of a mesh in the frame that it is seen from.
pub(crate) fn seen_from(reference: &Placement, point: [f64; 3]) -> [f64; 3] {
    let away = std::array::from_fn(|k| point[k] - reference.translation[k]);
    apply(&transpose(&reference.rotation), away)
}

/// Pairs of bodies of `<contact><exclude>`.
fn excluded(document: &Document, root: &Element) -> Vec<[String; 2]> {
    let contacts = document.children(root, "contact");
    let pairs = contacts.flat_map(|contact| document.children(contact, "exclude"));
    pairs
        .filter_map(|pair| {
            let (one, other) = (pair.text("body1")?, pair.text("body2")?);
            Some([one.to_owned(), other.to_owned()])
        })
        .collect()
}

/// Reads the bodies again, with what the geometry needs.
///
/// # Errors
/// With the place of the element or attribute.
pub(in crate::model) fn of_document(document: &Document) -> Result<Geometry> {
    let root = &document.elements[0];
    let compiler = Compiler::read(document, root)?;
    let defaults = Defaults::read(document, root)?;
    let mut tree = Tree::new(document, compiler, defaults);
    for world in document.children(root, "worldbody") {
        tree.read_world(world)?;
    }
    geometry(document, root, &tree)
}
