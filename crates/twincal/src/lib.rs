//! The mathematics of twincal: a sparse residual Lagrangian that explains the torque a robot model misses.
//!
//! ```text
//! τ_measured − τ_nominal = Σ_k β_k D(φ_k)(q, q̇, q̈) + ε          (paper eq. 1–5)
//! ```
//!
//! The modules stand in reading order, which is also the only direction in which one may use another: a module sees
//! what stands above it and nothing below (`tests/layers.rs` holds this). This crate opens no file, reads no clock and
//! prints nothing.

pub mod error;
pub mod words;
pub mod lanes;
pub mod linear_algebra;
pub mod random;
pub mod diagnostics;
pub mod robot;
pub mod signal;
pub mod self_check;
mod rigid_body;
mod rigid_fit;
pub mod lag;
pub mod incidents;
pub mod term;
pub mod rows;
pub mod gram;
pub mod observations;
mod statistics;
pub mod excitation;
pub mod prior;
pub mod posterior;
pub mod likelihood;
pub mod infer;
pub mod plug_in;
pub mod regression;
pub mod twin;
pub mod validate;
pub mod cross_check;
pub mod calibrate;
pub mod assess;
pub mod compare;
pub mod fleet;
pub mod design;
pub mod evaluator;
pub mod write_back;
pub mod builder;
pub mod prelude;

pub use error::{Code, Error, Finding, Mistake, Result, Severity, WrongUnit};
