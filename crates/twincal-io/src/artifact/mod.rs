//! The artefact: the folder that holds a calibration, written complete or not at all and verified when read.
//!
//! ```text
//! DIR/result.json       the answer, for programs
//! DIR/report.html       the answer, for people
//! DIR/twin.json         what check, predict and report need
//! DIR/model.urdf        the user's model file as it was (model.xml for MJCF), for `export`
//! DIR/run.log           when, where, how long (not reproducible, hence apart)
//! DIR/manifest.json     format, who wrote it, SHA-256 of every other file
//! ```
//!
//! A new artefact is staged in a hidden folder beside DIR and takes its place in one atomic exchange, so that a
//! program killed at any moment leaves the old artefact or the new one. A lock beside DIR keeps a second writer out;
//! what a killed writer left behind is removed by the next one. Nothing is written over what the command reads (`inputs.rs`).

mod beside;
mod inputs;
mod manifest;
mod output_file;
mod pieces;
mod read;
mod write;

pub use inputs::Inputs;
pub use manifest::{FORMAT, FileEntry, Maker, Manifest, sha256, sha256_of_file, sha256_unless};
pub use output_file::OutputFile;
pub use pieces::Pieces;
pub use read::Artifact;
pub use write::{Claim, Replace};

/// The answer, for programs.
pub const RESULT: &str = "result.json";
/// The answer, for people.
pub const REPORT: &str = "report.html";
/// What `check`, `predict` and `report` need.
pub const TWIN: &str = "twin.json";
/// The user's URDF as it was fitted.
pub const MODEL_URDF: &str = "model.urdf";
/// The user's MJCF as it was fitted.
pub const MODEL_MJCF: &str = "model.xml";
/// When, where and how long.
pub const RUN_LOG: &str = "run.log";
/// Format, writer and checksums.
pub const MANIFEST: &str = "manifest.json";

/// Names that an artefact holds; a manifest may name more.
const NAMES: [&str; 5] = [RESULT, REPORT, TWIN, RUN_LOG, MANIFEST];

/// What to do where an output cannot be written.
const OTHER_OUTPUT: &str = "give another output with -o";

#[cfg(test)]
mod tests;
