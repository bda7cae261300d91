//! Arithmetic on eight models at a time, fused where the instruction set has it.

use crate::lanes::{LANES, Lane};

/// The same number in every lane.
#[inline(always)]
pub(super) fn splat(x: f64) -> Lane {
    [x; LANES]
}

/// a + b.
#[inline(always)]
pub(super) fn add(a: &Lane, b: &Lane) -> Lane {
    let mut out = [0.0; LANES];
    for lane in 0..LANES {
        out[lane] = a[lane] + b[lane];
    }
    out
}

/// a · b.
#[inline(always)]
pub(super) fn mul(a: &Lane, b: &Lane) -> Lane {
    let mut out = [0.0; LANES];
    for lane in 0..LANES {
        out[lane] = a[lane] * b[lane];
    }
    out
}

/// −a.
#[inline(always)]
pub(super) fn neg(a: &Lane) -> Lane {
    let mut out = [0.0; LANES];
    for lane in 0..LANES {
        out[lane] = -a[lane];
    }
    out
}

/// a · b + c; one rounding if `FUSED`, which only kernels compiled for an instruction set with FMA may ask for.
#[inline(always)]
pub(super) fn mul_add<const FUSED: bool>(a: &Lane, b: &Lane, c: &Lane) -> Lane {
    let mut out = [0.0; LANES];
    for lane in 0..LANES {
        out[lane] = if FUSED {
            a[lane].mul_add(b[lane], c[lane])
        } else {
            a[lane] * b[lane] + c[lane]
        };
    }
    out
}

/// 1/max(a, least).
#[inline(always)]
pub(super) fn reciprocal(a: &Lane, least: f64) -> Lane {
    let mut out = [0.0; LANES];
    for lane in 0..LANES {
        out[lane] = 1.0 / if a[lane] > least { a[lane] } else { least };
    }
    out
}

/// √a.
#[inline(always)]
pub(super) fn sqrt(a: &Lane) -> Lane {
    let mut out = [0.0; LANES];
    for lane in 0..LANES {
        out[lane] = a[lane].sqrt();
    }
    out
}
