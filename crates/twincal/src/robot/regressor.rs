//! The joint-torque regressor: what each inertial parameter of each body adds to each joint's torque.
//!
//! ```text
//! τ_rigid[j] = Σ_bodies Σ_k Y[j, body, k](q, q̇, q̈) · π[body][k]
//! ```
//! Only pairs (coordinate, body) in which the coordinate moves the body can differ from zero; of their ten columns those
//! that vanish whatever the robot does are known beforehand ([`Pair::present`]) and are not computed.

use super::Robot;
use super::block::{Angles, BLOCK, Instructions, Registers, STRIDE};
use super::bodies::Body;
use super::lane_vectors::{
    V3, all_to_child, cross, cross_add, dot, dot_add, load, origin, store, turn_back,
};
use super::motion::Motion;
use super::parameters::ENTRIES;
use super::random_states::random_states;
use super::recursion::{State, move_body};
use crate::lanes::{Aligned, LANES, Line};
use pulp::Simd;
use std::ops::Range;

/// A body that a coordinate moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pair {
    /// 0-based coordinate, the row of the regressor.
    pub coordinate: usize,
    /// Index in [`Robot::bodies`].
    pub body: usize,
    /// Which of the ten columns can differ from zero; order of [`PARAMETERS`](super::PARAMETERS).
    pub present: [bool; 10],
}

/// The joint-torque regressor of one robot, see the [module](self).
///
/// # Example
/// Rigid-body torque is linear in the inertial parameters: columns times parameters are the nominal torque.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::robot::{Motion, Regressor, nominal_torque};
///
/// # let robot = two_link::arm(2.0)?;
/// let motion = Motion { len: 1, q: &[0.3, -0.8], qd: &[0.5, 0.2], qdd: &[1.0, -2.0] };
/// let regressor = Regressor::new(&robot);
/// let mut block = regressor.block(&robot);
/// regressor.evaluate(&robot, motion, 0..1, &mut block);
/// let (mut torque, mut nominal) = ([0.0; 2], [0.0; 2]);
/// for (number, pair) in regressor.pairs().iter().enumerate() {
///     for (k, parameter) in robot.parameters_of_body(pair.body).iter().enumerate() {
///         torque[pair.coordinate] += block.column(number, k)[0] * parameter;
///     }
/// }
/// nominal_torque(&robot, motion, &mut nominal);
/// assert!((0..2).all(|joint| (torque[joint] - nominal[joint]).abs() < 1e-9));
/// # Ok::<(), twincal::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Regressor {
    pairs: Vec<Pair>,
    /// Pair of the same coordinate with the parent body.
    parents: Vec<Option<usize>>,
    /// Motion of the body's own joint per unit of the coordinate: its multiplier, 0 when another coordinate moves it.
    own: Vec<f64>,
    /// First pair of each body, and their number at the end.
    starts: Vec<usize>,
}

/// What [`Regressor::evaluate`] leaves behind, and its memory; one per thread.
#[derive(Debug, Clone)]
pub struct RegressorBlock {
    values: Aligned,
    /// Samples of the block before: nothing but zeros stands behind them.
    filled: usize,
    workspace: Workspace,
}

/// Memory of the recursion.
#[derive(Debug, Clone)]
struct Workspace {
    angles: Angles,
    registers: Registers,
    axes: Registers,
}

impl RegressorBlock {
    /// Column of parameter `parameter` of pair `pair`: one value per sample of the block, N·m per unit of the
    /// parameter (N for a slider); 0 behind the last sample where motion is finite. Length [`BLOCK`].
    ///
    /// # Panics
    /// If there is no such pair or parameter.
    #[inline(always)]
    pub fn column(&self, pair: usize, parameter: usize) -> &[f64] {
        let start = pair * 10 * STRIDE + parameter * STRIDE;
        &self.values[start..start + BLOCK]
    }

    /// All columns of a pair: parameter k of sample s stands at `k * STRIDE + s`.
    ///
    /// # Panics
    /// If there is no such pair.
    pub fn pair(&self, pair: usize) -> &[f64] {
        &self.values[pair * 10 * STRIDE..(pair + 1) * 10 * STRIDE]
    }
}

impl Regressor {
    /// The pairs of `robot` and their columns.
    ///
    /// A column is left out when it is below 1e-13 of the largest column of its kind (mass, first moments, tensor) in
    /// 64 random states with joints anywhere and gravity as the model has it.
    pub fn new(robot: &Robot) -> Self {
        let mut pairs: Vec<Pair> = Vec::new();
        let (mut parents, mut own, mut starts) = (Vec::new(), Vec::new(), vec![0]);
        for (index, body) in robot.bodies.iter().enumerate() {
            let above = body.parent.map_or(0..0, |p| starts[p]..starts[p + 1]);
            let mut moved = false;
            for parent in above {
                let coordinate = pairs[parent].coordinate;
                let own_too = coordinate == body.coordinate;
                moved |= own_too;
                pairs.push(Pair {
                    coordinate,
                    body: index,
                    present: [true; 10],
                });
                parents.push(Some(parent));
                own.push(if own_too { body.multiplier } else { 0.0 });
            }
            if !moved {
                pairs.push(Pair {
                    coordinate: body.coordinate,
                    body: index,
                    present: [true; 10],
                });
                parents.push(None);
                own.push(body.multiplier);
            }
            starts.push(pairs.len());
        }
        let mut regressor = Self {
            pairs,
            parents,
            own,
            starts,
        };
        regressor.find_zeros(robot);
        regressor
    }

    /// The same with some of the columns only, by pair and parameter: the others are no longer computed, nor present.
    #[must_use]
    pub fn only(&self, wanted: &dyn Fn(usize, usize) -> bool) -> Self {
        let mut rest = self.clone();
        for (index, pair) in rest.pairs.iter_mut().enumerate() {
            for (k, present) in pair.present.iter_mut().enumerate() {
                *present &= wanted(index, k);
            }
        }
        rest
    }

    /// Pairs (coordinate, body), by body, parents first.
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// Memory for one thread.
    pub fn block(&self, robot: &Robot) -> RegressorBlock {
        RegressorBlock {
            values: Aligned::zeros(self.pairs.len() * 10 * STRIDE),
            filled: 0,
            workspace: Workspace {
                angles: Angles::new(robot.bodies.len()),
                registers: Registers::default(),
                axes: Registers::default(),
            },
        }
    }

    /// Computes the columns of the samples `samples` (at most [`BLOCK`]) of a motion into `block`.
    ///
    /// The same bytes wherever a sample stands in a block. Without motors' inertia, damping and springs, which are no
    /// inertial parameters. Bodies that share a coordinate (mimic) are pairs of their own; where a chain holds several
    /// joints of one coordinate, the pair of a body above them is their sum already, multipliers included.
    ///
    /// # Panics
    /// If `samples` holds more than [`BLOCK`] samples, goes beyond the motion, or the block is another robot's.
    /// # Source
    /// Atkeson, An, Hollerbach 1986; without 6 × 10 matrices: with u the axis of the joint and v the velocity of the
    /// body's origin per unit of the joint's velocity, both in the body's frame,
    /// `τ = v·f + u·n`, `f = m a + B mc`, `n = I ω̇ + ω × I ω + mc × a`.
    pub fn evaluate(
        &self,
        robot: &Robot,
        motion: Motion<'_>,
        samples: Range<usize>,
        block: &mut RegressorBlock,
    ) {
        self.evaluate_with(Instructions::Widest, robot, motion, samples, block);
    }

    /// [`Regressor::evaluate`] on chosen instructions: to compare them, or to have the same bytes on different machines.
    ///
    /// # Panics
    /// As [`Regressor::evaluate`].
    pub fn evaluate_with(
        &self,
        instructions: Instructions,
        robot: &Robot,
        motion: Motion<'_>,
        samples: Range<usize>,
        block: &mut RegressorBlock,
    ) {
        let RegressorBlock {
            values,
            filled,
            workspace,
        } = block;
        instructions.dispatch(Kernel {
            regressor: self,
            robot,
            motion,
            samples: samples.clone(),
            workspace,
            sink: &mut Cells(values),
        });
        clear(values, samples.len(), filled);
    }

    /// [`Regressor::evaluate`] where columns go straight to where they belong, which costs less than to bring them there: that of
    /// parameter k of a pair to `places[pair * 10 + k]`, sample by sample of the motion, and into the block where that is empty.
    ///
    /// # Panics
    /// As [`Regressor::evaluate`], or if a place is too short.
    pub(crate) fn evaluate_to(
        &self,
        robot: &Robot,
        motion: Motion<'_>,
        samples: Range<usize>,
        block: &mut RegressorBlock,
        places: &mut [&mut [f64]],
    ) {
        let RegressorBlock {
            values,
            filled,
            workspace,
        } = block;
        Instructions::Widest.dispatch(Kernel {
            regressor: self,
            robot,
            motion,
            samples: samples.clone(),
            workspace,
            sink: &mut Places {
                cells: Cells(values),
                places,
                start: samples.start,
            },
        });
        clear(values, samples.len(), filled);
    }

    /// Marks the columns that are zero in any state.
    fn find_zeros(&mut self, robot: &Robot) {
        let [q, qd, qdd] = random_states(robot, BLOCK);
        let motion = Motion {
            len: BLOCK,
            q: &q,
            qd: &qd,
            qdd: &qdd,
        };
        let mut block = self.block(robot);
        self.evaluate(robot, motion, 0..BLOCK, &mut block);
        let largest = |pair: usize, k: usize| {
            block
                .column(pair, k)
                .iter()
                .fold(0f64, |most, v| most.max(v.abs()))
        };
        let kind = |k: usize| usize::from(k > 0) + usize::from(k > 3);
        let mut scale = [0f64; 3];
        for pair in 0..self.pairs.len() {
            for k in 0..10 {
                scale[kind(k)] = scale[kind(k)].max(largest(pair, k));
            }
        }
        for (index, pair) in self.pairs.iter_mut().enumerate() {
            pair.present = std::array::from_fn(|k| largest(index, k) > 1e-13 * scale[kind(k)]);
        }
    }
}

/// One for each sample of a vector.
const ONES: [f64; LANES] = [1.0; LANES];

/// Where columns go.
trait Sink {
    /// Takes the samples of a block from `at` on, of which the first `live` are some.
    fn put<S: Simd>(&mut self, s: S, column: usize, at: usize, live: usize, value: S::f64s);
}

/// Sample `at` of a column at `column * STRIDE + at`.
struct Cells<'a>(&'a mut [f64]);

impl Sink for Cells<'_> {
    /// Writes a whole vector: masked stores cost many times as much (Zen 3).
    #[inline(always)]
    fn put<S: Simd>(&mut self, s: S, column: usize, at: usize, _: usize, value: S::f64s) {
        let start = column * STRIDE + at;
        store(s, &mut self.0[start..start + S::F64_LANES], value);
    }
}

/// See [`Regressor::evaluate_to`].
struct Places<'a, 'b> {
    cells: Cells<'a>,
    places: &'a mut [&'b mut [f64]],
    /// The block's first sample in the motion.
    start: usize,
}

impl Sink for Places<'_, '_> {
    #[inline(always)]
    fn put<S: Simd>(&mut self, s: S, column: usize, at: usize, live: usize, value: S::f64s) {
        let place = &mut *self.places[column];
        if place.is_empty() {
            return self.cells.put(s, column, at, live, value);
        }
        store(s, &mut place[self.start + at..][..live], value);
    }
}

/// Nothing of an earlier block may stand behind the last sample.
fn clear(values: &mut [f64], samples: usize, filled: &mut usize) {
    if samples < *filled {
        for column in values.chunks_exact_mut(STRIDE) {
            column[samples..*filled].fill(0.0);
        }
    }
    *filled = samples;
}

struct Kernel<'a, K> {
    regressor: &'a Regressor,
    robot: &'a Robot,
    motion: Motion<'a>,
    samples: Range<usize>,
    workspace: &'a mut Workspace,
    sink: &'a mut K,
}

impl<K: Sink> pulp::WithSimd for Kernel<'_, K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        let Self {
            regressor,
            robot,
            motion,
            samples,
            workspace,
            sink,
        } = self;
        let Workspace {
            angles,
            registers,
            axes,
        } = workspace;
        assert!(samples.len() <= BLOCK, "at most {BLOCK} samples");
        let bodies = &robot.bodies[..];
        let gravity = robot.description.gravity;
        let zero = s.splat_f64s(0.0);
        let states = registers.slice(bodies.len(), State::new(zero));
        let axes = axes.slice(regressor.pairs.len(), Line([[zero; 3]; 2]));
        angles.fill(s, bodies, &motion, samples.clone());
        let mut first = samples.start;
        while first < samples.end {
            let last = samples.end.min(first + S::F64_LANES);
            // Columns are linear in u and v, which are 0 in lanes without a sample: whole vectors can be stored. Everything else is
            // finite there, where motion is: motion of one sample stands in all lanes, of several there are zeros.
            let live = load(s, &ONES[..last - first]);
            for i in 0..bodies.len() {
                let body = &bodies[i];
                let (before, rest) = states.split_at_mut(i);
                let state = &mut rest[0];
                angles.joint(s, i, body, &motion, first..last, state);
                move_body(s, body, gravity, body.parent.map(|p| &before[p]), state);
                let p = origin(s, body, state.position);
                for pair in regressor.starts[i]..regressor.starts[i + 1] {
                    let [mut u, mut v] = match regressor.parents[pair] {
                        Some(parent) => turned_on(s, body, state, p, axes[parent].0),
                        None => [[zero; 3]; 2],
                    };
                    // Then the body's own joint.
                    let own = s.mul_f64s(live, s.splat_f64s(regressor.own[pair]));
                    if body.prismatic {
                        v[2] = s.add_f64s(v[2], own);
                    } else {
                        u[2] = s.add_f64s(u[2], own);
                    }
                    axes[pair] = Line([u, v]);
                    let present = &regressor.pairs[pair].present;
                    let at = first - samples.start;
                    let put = |k, value| sink.put(s, pair * 10 + k, at, last - first, value);
                    if regressor.parents[pair].is_none() && !body.prismatic {
                        own_columns(s, present, own, state, put);
                    } else {
                        columns(s, present, [u, v], state, put);
                    }
                }
            }
            first = last;
        }
    }
}

/// The line of a pair's parent seen from the body, whose origin is at `p` in the parent's frame.
#[inline(always)]
fn turned_on<S: Simd>(
    s: S,
    body: &Body,
    state: &State<S::f64s>,
    p: V3<S>,
    [u, v]: [V3<S>; 2],
) -> [V3<S>; 2] {
    // u' = Rᵀ u, v' = Rᵀ (v + u × p)
    let v = cross_add(s, u, p, v);
    let [u, v] = all_to_child(s, body, [u, v]);
    if body.prismatic {
        return [u, v];
    }
    let (c, n) = (state.cos, state.sin);
    [turn_back(s, c, n, u), turn_back(s, c, n, v)]
}

/// The ten columns of one pair, by parameter.
#[inline(always)]
fn columns<S: Simd>(
    s: S,
    present: &[bool; 10],
    [u, v]: [V3<S>; 2],
    state: &State<S::f64s>,
    mut put: impl FnMut(usize, S::f64s),
) {
    let State { w, wd, a, b, .. } = state;
    if present[0] {
        put(0, dot(s, v, *a));
    }
    // Bᵀ v + a × u. One by one: in a loop compilers keep vectors in memory, to index them.
    macro_rules! moment {
        ($($k:literal)*) => {$(
            if present[1 + $k] {
                let (i, j) = (($k + 1) % 3, ($k + 2) % 3);
                let turned = s.mul_f64s(a[i], u[j]);
                let turned = s.sub_f64s(turned, s.mul_f64s(a[j], u[i]));
                let column = [b[0][$k], b[1][$k], b[2][$k]];
                put(1 + $k, dot_add(s, column, v, turned));
            }
        )*};
    }
    moment!(0 1 2);
    // u·(I ω̇) + (u × ω)·(I ω)
    let e = cross(s, u, *w);
    macro_rules! tensor {
        ($($k:literal)*) => {$(
            if present[4 + $k] {
                const IJ: (usize, usize) = ENTRIES[$k];
                let (i, j) = IJ;
                let mut value = s.mul_add_e_f64s(u[i], wd[j], s.mul_f64s(e[i], w[j]));
                if i != j {
                    value = s.mul_add_e_f64s(u[j], wd[i], s.mul_add_e_f64s(e[j], w[i], value));
                }
                put(4 + $k, value);
            }
        )*};
    }
    tensor!(0 1 2 3 4 5);
}

/// The same of a hinge's own body: its axis is z, `own` long, and goes through the origin. A quarter of a chain's pairs are such.
#[inline(always)]
fn own_columns<S: Simd>(
    s: S,
    present: &[bool; 10],
    own: S::f64s,
    state: &State<S::f64s>,
    mut put: impl FnMut(usize, S::f64s),
) {
    let State { w, wd, a, .. } = state;
    let zero = s.splat_f64s(0.0);
    let (x, y) = (s.mul_f64s(own, w[0]), s.mul_f64s(own, w[1]));
    macro_rules! scaled {
        ($x:expr) => {
            s.mul_f64s(own, $x)
        };
    }
    macro_rules! write {
        ($k:literal, $value:expr) => {
            if present[$k] {
                put($k, $value);
            }
        };
    }
    write!(0, zero);
    // a × u
    write!(1, scaled!(a[1]));
    write!(2, s.neg_f64s(scaled!(a[0])));
    write!(3, zero);
    // u·(I ω̇) + (u × ω)·(I ω), u × ω = (−y, x, 0)
    write!(4, s.neg_f64s(s.mul_f64s(y, w[0])));
    write!(5, s.sub_f64s(s.mul_f64s(x, w[0]), s.mul_f64s(y, w[1])));
    write!(6, s.sub_f64s(scaled!(wd[0]), s.mul_f64s(y, w[2])));
    write!(7, s.mul_f64s(x, w[1]));
    write!(8, s.mul_add_e_f64s(x, w[2], scaled!(wd[1])));
    write!(9, scaled!(wd[2]));
}
