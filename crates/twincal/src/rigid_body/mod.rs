//! Inertias that a rigid body can have, and the nearest of them to what was found.

mod distance;
mod projection;
pub(crate) mod pseudo_inertia;

pub(crate) use distance::Found;
pub use projection::Projection;
pub(crate) use projection::{Link, project};
