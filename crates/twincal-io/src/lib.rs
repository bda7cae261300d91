//! Files in, files and reports out: robot models, logs, settings, results. No mathematics here.
//!
//! # From a URDF and CSV files to a twin in a folder
//! ```no_run
//! use twincal::prelude::*;
//! use twincal_io::{read_recording, read_robot, save};
//!
//! let robot = read_robot("arm.urdf")?;
//! let log = read_recording("run1.csv", &robot)?;
//! let other = read_recording("run2.csv", &robot)?;
//! let fit = Calibrate::new(&robot).logs([log]).heldout([other]).run()?;
//! for effect in fit.effects() {
//!     println!("{effect}");
//! }
//! save(&fit, "twin")?; // as `twincal fit` writes it: result.json, twin.json, with the feature `report` report.html
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//! `tests/library.rs` runs the same on files.
//!
//! # Features
//! | feature | what it adds |
//! |---|---|
//! | `tables` (default) | logs in Parquet, Arrow, NPZ; predictions and motions as Parquet |
//! | `bags` (default) | logs in MCAP, SQLite bags, rosbag2 folders; predictions as MCAP |
//! | `report` (default) | `report.html`, `fleet.html`, `design.html`, and their figures |
//!
//! CSV is always read and written. Without `tables` and `bags` nothing in C is compiled.

#![cfg_attr(
    not(all(feature = "tables", feature = "bags")),
    allow(
        dead_code,
        reason = "what several readers share is in use where all of them are there"
    )
)]

pub mod error;
mod files;
pub mod open;
pub mod model;
pub mod memory;
pub mod config;
pub mod log;
pub mod table;
pub mod context;
pub mod artifact;
pub mod collision;
pub mod assessment;
#[cfg(feature = "report")]
pub mod report;
pub mod result_json;
#[cfg(feature = "tables")]
pub mod statistics;
pub mod twin_json;
#[cfg_attr(
    not(feature = "report"),
    allow(dead_code, reason = "some sentences stand in the report alone")
)]
pub mod words;
#[cfg(feature = "tables")]
pub mod fleet;
pub mod export;
pub mod design;

pub use error::{Error, Place, Result};
pub use files::{load, read_recording, read_robot, save};
