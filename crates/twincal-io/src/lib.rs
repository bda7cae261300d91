//! Files in, files and reports out: robot models, logs, settings, results. No mathematics here.

pub mod error;
mod files;
pub mod open;
pub mod model;
pub mod memory;
pub mod config;
pub mod log;
pub mod table;
pub mod artifact;
pub mod report;
pub mod result_json;
pub mod twin_json;
pub mod export;

pub use error::{Error, Place, Result};
pub use files::{load, read_recording, read_robot, save};
