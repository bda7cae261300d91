//! What `twincal fleet` writes: `fleet.json` for programs, `fleet.html` for people.

mod json;
#[cfg(feature = "report")]
mod page;
mod reason;

pub use json::{Corrected, FleetJson, Inputs, fleet_json};
#[cfg(feature = "report")]
pub use page::fleet_page;
pub use reason::reason;

/// The answer, for programs.
pub const FLEET: &str = "fleet.json";
/// The answer, for people.
pub const PAGE: &str = "fleet.html";
/// The model file with what is wrong for all robots put right.
pub const TYPE_URDF: &str = "type.urdf";
/// The same of an MJCF model.
pub const TYPE_MJCF: &str = "type.xml";
