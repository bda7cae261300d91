//! Blocks of samples: the joints' motion brought into lanes, and memory that blocks after blocks reuse.

use super::Robot;
use super::bodies::Body;
use super::lane_vectors::{load, load_any, store};
use super::motion::Motion;
use super::recursion::State;
use crate::lanes::{LANES, Line, sin_cos_fused};
use pulp::Simd;
use std::any::Any;
use std::ops::Range;

/// Samples per block: what a block leaves behind stays in the caches.
pub const BLOCK: usize = 64;

/// Distance between two columns of a block's results. Not a power of two, or the columns would fight for the same
/// few sets of the first-level cache.
pub const STRIDE: usize = BLOCK + LANES;

/// Which vectors the batched algorithms use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Instructions {
    /// The widest of this machine, found at run time.
    #[default]
    Widest,
    /// 256 bits with fused multiply-add (x86-64-v3); the widest where the machine has none.
    Avx2,
    /// One sample at a time, on any machine.
    Portable,
}

impl Instructions {
    /// Runs `kernel` compiled for these instructions.
    pub(super) fn dispatch<K: pulp::WithSimd>(self, kernel: K) -> K::Output {
        match self {
            Self::Portable => pulp::Scalar.vectorize(kernel),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => match pulp::x86::V3::try_new() {
                Some(simd) => pulp::Simd::vectorize(simd, kernel),
                None => pulp::Arch::new().dispatch(kernel),
            },
            _ => pulp::Arch::new().dispatch(kernel),
        }
    }
}

/// Sines and cosines of the joints of one block.
#[derive(Debug, Clone)]
pub(super) struct Angles {
    sines: Vec<Line<[f64; BLOCK]>>,
    cosines: Vec<Line<[f64; BLOCK]>>,
    /// First sample of the block.
    start: usize,
}

impl Angles {
    /// Room for `bodies` joints.
    pub(super) fn new(bodies: usize) -> Self {
        Self {
            sines: vec![Line([0.0; BLOCK]); bodies],
            cosines: vec![Line([1.0; BLOCK]); bodies],
            start: 0,
        }
    }

    /// Sines and cosines of the samples `block` (at most [`BLOCK`]) of a motion.
    #[inline(always)]
    pub(super) fn fill<S: Simd>(
        &mut self,
        s: S,
        bodies: &[Body],
        motion: &Motion<'_>,
        block: Range<usize>,
    ) {
        self.start = block.start;
        if block.len() == 1 {
            return self.fill_one(s, bodies, motion, block.start);
        }
        for i in 0..bodies.len() {
            let body = &bodies[i];
            if body.prismatic {
                continue;
            }
            let row = body.coordinate * motion.len;
            let q = &motion.q[row + block.start..row + block.end];
            for (k, q) in q.chunks(LANES).enumerate() {
                let mut angles = Line([0.0; LANES]);
                for (angle, q) in angles.0.iter_mut().zip(q) {
                    *angle = body.multiplier * q + body.offset;
                }
                let (sine, cosine) = sin_cos_fused(s, &angles.0);
                let group = k * LANES..(k + 1) * LANES;
                self.sines[i].0[group.clone()].copy_from_slice(&sine);
                self.cosines[i].0[group].copy_from_slice(&cosine);
            }
        }
    }

    /// One sample: joints side by side in the lanes, the same bytes as sample by sample.
    #[inline(always)]
    fn fill_one<S: Simd>(&mut self, s: S, bodies: &[Body], motion: &Motion<'_>, sample: usize) {
        for (chunk, bodies) in bodies.chunks(LANES).enumerate() {
            let mut angles = Line([0.0; LANES]);
            for (angle, body) in angles.0.iter_mut().zip(bodies) {
                let q = motion.q[body.coordinate * motion.len + sample];
                *angle = body.multiplier * q + body.offset;
            }
            let (sine, cosine) = sin_cos_fused(s, &angles.0);
            for (lane, body) in bodies.iter().enumerate() {
                if !body.prismatic {
                    let i = chunk * LANES + lane;
                    self.sines[i].0[..LANES].fill(sine[lane]);
                    self.cosines[i].0[..LANES].fill(cosine[lane]);
                }
            }
        }
    }

    /// Position, velocity, acceleration, sine and cosine of joint `i` for the samples `group` of the motion, which
    /// lie in the block that was filled.
    #[inline(always)]
    pub(super) fn joint<S: Simd>(
        &self,
        s: S,
        i: usize,
        body: &Body,
        motion: &Motion<'_>,
        group: Range<usize>,
        state: &mut State<S::f64s>,
    ) {
        let row = body.coordinate * motion.len;
        let (from, to) = (row + group.start, row + group.end);
        let (m, c) = (s.splat_f64s(body.multiplier), s.splat_f64s(body.offset));
        let q = load_any(s, &motion.q[from..to]);
        let qd = load_any(s, &motion.qd[from..to]);
        let qdd = load_any(s, &motion.qdd[from..to]);
        state.position = s.mul_add_e_f64s(m, q, c);
        state.velocity = s.mul_f64s(m, qd);
        state.acceleration = s.mul_f64s(m, qdd);
        // Whole vectors: groups of lanes are filled to their end.
        let local = group.start - self.start..group.start - self.start + S::F64_LANES;
        state.sin = load(s, &self.sines[i].0[local.clone()]);
        state.cos = load(s, &self.cosines[i].0[local]);
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

/// Memory of the algorithms that work on blocks, for one robot; one per thread. Nothing is allocated after the first
/// block.
#[derive(Debug, Clone)]
pub struct BlockWorkspace {
    angles: Angles,
    states: Registers,
    extra: Registers,
}

impl BlockWorkspace {
    /// Memory for `robot`.
    pub fn new(robot: &Robot) -> Self {
        Self {
            angles: Angles::new(robot.bodies.len()),
            states: Registers::default(),
            extra: Registers::default(),
        }
    }
}

/// What an algorithm does with one vector's worth of samples.
pub(super) trait Group {
    /// `states` holds the joints' motion; results go to the cells `at` of every column.
    fn group<S: Simd>(
        &mut self,
        s: S,
        robot: &Robot,
        states: &mut [State<S::f64s>],
        extra: &mut Registers,
        at: Range<usize>,
    );
}

/// Runs `kernel` over the samples `samples` of a motion, on this machine's widest vectors.
pub(super) fn run(
    robot: &Robot,
    workspace: &mut BlockWorkspace,
    motion: Motion<'_>,
    samples: Range<usize>,
    kernel: impl Group,
) {
    pulp::Arch::new().dispatch(Drive {
        robot,
        workspace,
        motion,
        samples,
        kernel,
    });
}

struct Drive<'a, K> {
    robot: &'a Robot,
    workspace: &'a mut BlockWorkspace,
    motion: Motion<'a>,
    samples: Range<usize>,
    kernel: K,
}

impl<K: Group> pulp::WithSimd for Drive<'_, K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        let Self {
            robot,
            workspace,
            motion,
            samples,
            mut kernel,
        } = self;
        assert!(samples.len() <= BLOCK, "at most {BLOCK} samples");
        let BlockWorkspace {
            angles,
            states,
            extra,
        } = workspace;
        let bodies = &robot.bodies[..];
        let states = states.slice(bodies.len(), State::new(s.splat_f64s(0.0)));
        angles.fill(s, bodies, &motion, samples.clone());
        let mut first = samples.start;
        while first < samples.end {
            let last = samples.end.min(first + S::F64_LANES);
            for i in 0..bodies.len() {
                let state = &mut states[i];
                angles.joint(s, i, &bodies[i], &motion, first..last, state);
            }
            let at = first - samples.start..last - samples.start;
            kernel.group(s, robot, states, extra, at);
            first = last;
        }
    }
}

/// Adds `value` to the cells `at` of column `column`.
#[inline(always)]
pub(super) fn add_to<S: Simd>(
    s: S,
    out: &mut [f64],
    column: usize,
    at: &Range<usize>,
    value: S::f64s,
) {
    let cells = &mut out[column * STRIDE + at.start..column * STRIDE + at.end];
    let sum = s.add_f64s(load(s, cells), value);
    store(s, cells, sum);
}
