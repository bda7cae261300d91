//! Eight samples at a time: elementary functions on lanes and the run-time choice of instruction set.
//!
//! No unsafe code here: [`pulp`] holds the dispatch. A kernel is a plain `#[inline(always)]` function over
//! `[f64; 8]` that [`dispatch`] compiles once per instruction set.

/// Samples per lane group.
pub const LANES: usize = 8;

/// Eight consecutive samples.
pub type Lane = [f64; LANES];
