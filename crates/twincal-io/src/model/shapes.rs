//! Geometry of the links as a model file states it: primitives, and meshes by name; no mesh is opened here.

use super::{Model, ModelFormat, mjcf, urdf_shapes};
use crate::error::Result;
use twincal::robot::Placement;

/// One geometry of a link.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkShape {
    /// Link of the description.
    pub link: String,
    /// Frame of the geometry in the link's frame.
    pub placement: Placement,
    /// What it looks like.
    pub form: Form,
}

/// Form of a geometry in its own frame; lengths in m, long axis z.
#[derive(Debug, Clone, PartialEq)]
pub enum Form {
    /// Half lengths of the edges.
    Box([f64; 3]),
    /// Radius.
    Sphere(f64),
    /// Radius and half the length.
    Cylinder(f64, f64),
    /// Radius, and half the length without the two half balls.
    Capsule(f64, f64),
    /// Half axes.
    Ellipsoid([f64; 3]),
    /// z ≤ 0.
    HalfSpace,
    /// A mesh in a file.
    Mesh(MeshFile),
    /// Corners of a mesh that stand in the model file.
    Points(Vec<[f64; 3]>),
    /// A form that has no convex hull here, by its name.
    Other(String),
}

/// Where a mesh is.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshFile {
    /// As the model file names it: a path, `package://…`, `model://…` or `file://…`.
    pub file: String,
    /// Folder that it is relative to, relative to the model file's.
    pub folder: String,
    /// Factor on each coordinate.
    pub scale: [f64; 3],
    /// Frame that the mesh is seen from, in the mesh's frame.
    pub reference: Placement,
}

/// The geometry that a model file states.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Geometry {
    /// For collisions; of a link that has none for collisions, what it shows.
    pub shapes: Vec<LinkShape>,
    /// Pairs of links that the file lets touch (MJCF `<exclude>`).
    pub excluded: Vec<[String; 2]>,
}

impl Model {
    /// Geometry of the links.
    ///
    /// # Errors
    /// At the element that cannot be read: a number that is none, sizes that are missing or not positive.
    pub fn geometry(&self) -> Result<Geometry> {
        match self.format() {
            ModelFormat::Urdf => urdf_shapes::geometry(self.document()),
            ModelFormat::Mjcf => mjcf::geometry(self.document()),
        }
    }
}
