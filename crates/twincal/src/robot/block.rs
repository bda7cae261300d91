//! Blocks of samples: the joints' motion brought into lanes, and memory that blocks after blocks reuse.

use super::bodies::Body;
use super::dynamics::Motion;
use super::recursion::State;
use crate::lanes::{LANES, Lane, sin_cos};
use pulp::Simd;
use std::any::Any;
use std::ops::Range;

/// Samples per block: what a block leaves behind stays in the caches.
pub const BLOCK: usize = 64;

/// Distance between two columns of a block's results. Not a power of two, or the columns would fight for the same
/// few sets of the first-level cache.
pub const STRIDE: usize = BLOCK + LANES;

/// Sines and cosines of the joints of one block.
#[derive(Debug, Clone)]
pub(super) struct Angles {
    sines: Vec<[f64; BLOCK]>,
    cosines: Vec<[f64; BLOCK]>,
}

impl Angles {
    /// Room for `bodies` joints.
    pub(super) fn new(bodies: usize) -> Self {
        Self {
            sines: vec![[0.0; BLOCK]; bodies],
            cosines: vec![[1.0; BLOCK]; bodies],
        }
    }

    /// Sines and cosines of the samples `block` (at most [`BLOCK`]) of a motion.
    #[inline(always)]
    pub(super) fn fill(&mut self, bodies: &[Body], motion: &Motion<'_>, block: Range<usize>) {
        for i in 0..bodies.len() {
            let body = &bodies[i];
            if body.prismatic {
                continue;
            }
            let row = body.coordinate * motion.len;
            let q = &motion.q[row + block.start..row + block.end];
            let mut angles = [0.0; BLOCK];
            for k in 0..q.len() {
                angles[k] = body.multiplier * q[k] + body.offset;
            }
            for k in 0..q.len().div_ceil(LANES) {
                let group = k * LANES..(k + 1) * LANES;
                let mut lane: Lane = [0.0; LANES];
                lane.copy_from_slice(&angles[group.clone()]);
                let (sine, cosine) = sin_cos(&lane);
                self.sines[i][group.clone()].copy_from_slice(&sine);
                self.cosines[i][group].copy_from_slice(&cosine);
            }
        }
    }

    /// Position, velocity, acceleration, sine and cosine of joint `i` for the samples `group` of the motion; `start`
    /// is the first sample of the block.
    #[inline(always)]
    pub(super) fn joint<S: Simd>(
        &self,
        s: S,
        i: usize,
        body: &Body,
        motion: &Motion<'_>,
        start: usize,
        group: Range<usize>,
        state: &mut State<S::f64s>,
    ) {
        let row = body.coordinate * motion.len;
        let (from, to) = (row + group.start, row + group.end);
        let (m, c) = (s.splat_f64s(body.multiplier), s.splat_f64s(body.offset));
        let q = s.partial_load_f64s(&motion.q[from..to]);
        let qd = s.partial_load_f64s(&motion.qd[from..to]);
        let qdd = s.partial_load_f64s(&motion.qdd[from..to]);
        state.position = s.mul_add_e_f64s(m, q, c);
        state.velocity = s.mul_f64s(m, qd);
        state.acceleration = s.mul_f64s(m, qdd);
        let local = group.start - start..group.end - start;
        state.sin = s.partial_load_f64s(&self.sines[i][local.clone()]);
        state.cos = s.partial_load_f64s(&self.cosines[i][local]);
    }
}

/// Vector registers' worth of memory whose element type depends on the instruction set that the run-time dispatch
/// chose: allocated by the first block, reused by all others.
#[derive(Debug, Default)]
pub(super) struct Registers(Option<Box<dyn Any + Send + Sync>>);

impl Registers {
    /// The memory as `len` elements of type T; what they hold is of no meaning.
    #[inline(always)]
    pub(super) fn slice<T: Copy + Send + Sync + 'static>(
        &mut self,
        len: usize,
        zero: T,
    ) -> &mut [T] {
        let fits = |any: &Box<dyn Any + Send + Sync>| {
            any.downcast_ref::<Vec<T>>().is_some_and(|v| v.len() >= len)
        };
        if !self.0.as_ref().is_some_and(fits) {
            self.0 = Some(Box::new(vec![zero; len]));
        }
        match self.0.as_mut().and_then(|any| any.downcast_mut::<Vec<T>>()) {
            Some(vector) => &mut vector[..len],
            None => &mut [],
        }
    }
}

impl Clone for Registers {
    /// Memory of its own, still to be allocated.
    fn clone(&self) -> Self {
        Self(None)
    }
}
