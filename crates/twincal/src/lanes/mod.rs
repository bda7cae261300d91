//! Eight samples at a time: elementary functions on lanes and the run-time choice of instruction set.
//!
//! No unsafe code here: [`pulp`] holds the dispatch. A kernel is a type whose work sits in `#[inline(always)]` functions
//! over `[f64; 8]`; `pulp::Arch::new().dispatch(kernel)` runs the copy of it that was compiled for this machine's
//! widest vectors. [`sin_cos`] uses only + − × and bit operations, each rounded once: every
//! instruction set gives the same bytes. [`sin_cos_fused`], [`exp`], [`ln`] and [`tanh`] fuse where the instructions can.

mod aligned;
mod log_exp;
mod trig;

pub use aligned::{Aligned, Line};
pub use log_exp::{exp, ln, tanh};
pub use trig::{sin_cos, sin_cos_fused};

/// Whether `f64::mul_add` is one instruction in code that is compiled for these vectors; else it may be a slow call.
#[must_use]
pub const fn fuses<S: pulp::Simd>() -> bool {
    // All of pulp's vectors of these processors have it, and one number at a time may not.
    cfg!(any(target_arch = "x86_64", target_arch = "aarch64")) && S::F64_LANES > 1
}

/// Samples per lane group.
pub const LANES: usize = 8;

/// Eight consecutive samples.
pub type Lane = [f64; LANES];
