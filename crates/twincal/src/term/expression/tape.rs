//! Expressions as a flat list of instructions over blocks of samples.
//!
//! Every node of the graph is computed once per block of 64 samples, in registers (blocks of memory that stay in the
//! first-level cache); sine and cosine of one argument share one instruction.

use super::graph::{Function, Graph, Id, Node, Variable};
use crate::lanes::{LANES, Lane, Line, sin_cos, tanh};
use crate::term::Course;
use std::collections::HashMap;
use std::ops::DerefMut;

/// Lane groups per block.
const GROUPS: usize = 8;
/// Samples per block.
const BLOCK: usize = GROUPS * LANES;

/// A channel of which nothing is known.
const UNKNOWN: &[f64] = &[0.0; BLOCK];

/// One value for each sample of a block.
type Block = [Lane; GROUPS];

/// One step; the first register is written, the others are read and differ from it.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Instruction {
    Load(u32, Variable),
    Fill(u32, f64),
    Scale(u32, u32, f64),
    AddConstant(u32, u32, f64),
    Add(u32, u32, u32),
    Subtract(u32, u32, u32),
    /// a + c·b.
    AddScaled(u32, u32, u32, f64),
    Multiply(u32, u32, u32),
    Square(u32, u32),
    Divide(u32, u32, u32),
    Reciprocal(u32, u32),
    /// Writes two registers: sine, cosine.
    SinCos(u32, u32, u32),
    Apply(u32, u32, Function),
    Power(u32, u32, f64),
    /// Writes register to output `slot`.
    Store(u32, u32),
    /// Writes a variable, or a number, to output `slot`.
    StoreVariable(Variable, u32),
    StoreConstant(f64, u32),
}
use Instruction as I;

/// Where an output goes: `out[table][row * stride + sample]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Slot {
    pub(crate) table: usize,
    pub(crate) row: usize,
}

/// Compiled expressions.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tape {
    instructions: Vec<Instruction>,
    registers: usize,
    slots: Vec<Slot>,
}

/// Working memory of one thread; grows to what the tape needs.
#[derive(Debug, Clone, Default)]
pub(crate) struct Scratch {
    registers: Vec<Line<Block>>,
}

impl Tape {
    /// Compiles `outputs` of `graph`.
    pub(crate) fn new(graph: &Graph, outputs: &[(Id, Slot)]) -> Self {
        let mut compiler = Compiler {
            graph,
            instructions: Vec::new(),
            next: 0,
            done: HashMap::new(),
            known: HashMap::new(),
        };
        let mut slots = Vec::with_capacity(outputs.len());
        for &(id, slot) in outputs {
            let to = slots.len() as u32;
            let store = match graph.node(id) {
                Node::Constant(value) => I::StoreConstant(value.get(), to),
                &Node::Variable(variable) => I::StoreVariable(variable, to),
                _ => I::Store(compiler.compile(id), to),
            };
            compiler.instructions.push(store);
            slots.push(slot);
        }
        let (instructions, registers) = allocate(compiler.instructions, compiler.next as usize);
        Self {
            instructions,
            registers,
            slots,
        }
    }

    /// Computes all outputs; `out[table]` must hold its rows.
    pub(crate) fn evaluate<'a, T: DerefMut<Target = [f64]>>(
        &self,
        course: impl Into<Course<'a>>,
        stride: usize,
        out: &mut [T],
        scratch: &mut Scratch,
    ) {
        if scratch.registers.len() < self.registers {
            scratch
                .registers
                .resize(self.registers, Line([[0.0; LANES]; GROUPS]));
        }
        let run = Run {
            tape: self,
            course: course.into(),
            outputs: Outputs {
                slots: &self.slots,
                stride,
                out,
            },
            registers: &mut scratch.registers[..self.registers],
        };
        pulp::Arch::new().dispatch(run);
    }
}

/// Nodes to instructions on as many registers as there are values.
struct Compiler<'a> {
    graph: &'a Graph,
    instructions: Vec<Instruction>,
    next: u32,
    done: HashMap<Id, u32>,
    /// Products and quotients of registers that exist already: (left, right, divided).
    known: HashMap<(u32, u32, bool), u32>,
}

impl Compiler<'_> {
    fn register(&mut self) -> u32 {
        self.next += 1;
        self.next - 1
    }

    fn emit(&mut self, make: impl FnOnce(u32) -> Instruction) -> u32 {
        let register = self.register();
        self.instructions.push(make(register));
        register
    }

    fn compile(&mut self, id: Id) -> u32 {
        if let Some(&register) = self.done.get(&id) {
            return register;
        }
        let graph = self.graph;
        let register = match graph.node(id) {
            Node::Constant(value) => self.emit(|r| I::Fill(r, value.get())),
            &Node::Variable(variable) => self.emit(|r| I::Load(r, variable)),
            Node::Sum(constant, parts) => {
                let parts: Vec<(f64, u32)> = parts
                    .iter()
                    .map(|&(c, part)| (c.get(), self.compile(part)))
                    .collect();
                self.sum(constant.get(), &parts)
            }
            Node::Product(factors) => {
                let factors: Vec<(u32, i32)> =
                    factors.iter().map(|&(f, e)| (self.compile(f), e)).collect();
                self.product(&factors)
            }
            &Node::Power(base, exponent) => {
                let base = self.compile(base);
                self.emit(|r| I::Power(r, base, exponent.get()))
            }
            &Node::Function(function @ (Function::Sin | Function::Cos), argument) => {
                let x = self.compile(argument);
                let (sine, cosine) = (self.register(), self.register());
                self.instructions.push(I::SinCos(sine, cosine, x));
                for (partner, register) in [(Function::Sin, sine), (Function::Cos, cosine)] {
                    if let Some(partner) = graph.find(&Node::Function(partner, argument)) {
                        self.done.insert(partner, register);
                    }
                }
                if function == Function::Sin {
                    sine
                } else {
                    cosine
                }
            }
            &Node::Function(function, argument) => {
                let x = self.compile(argument);
                self.emit(|r| I::Apply(r, x, function))
            }
        };
        self.done.insert(id, register);
        register
    }

    fn sum(&mut self, constant: f64, parts: &[(f64, u32)]) -> u32 {
        let first = parts.iter().position(|&(c, _)| c == 1.0).unwrap_or(0);
        let (scale, start) = parts[first];
        let mut total = if scale == 1.0 {
            start
        } else {
            self.emit(|r| I::Scale(r, start, scale))
        };
        for (i, &(coefficient, part)) in parts.iter().enumerate() {
            if i != first {
                let left = total;
                total = self.emit(|r| match coefficient {
                    1.0 => I::Add(r, left, part),
                    -1.0 => I::Subtract(r, left, part),
                    c => I::AddScaled(r, left, part, c),
                });
            }
        }
        if constant == 0.0 {
            total
        } else {
            self.emit(|r| I::AddConstant(r, total, constant))
        }
    }

    fn product(&mut self, factors: &[(u32, i32)]) -> u32 {
        let (mut above, mut below) = (None, None);
        for &(factor, exponent) in factors {
            let power = self.integer_power(factor, exponent.unsigned_abs());
            let side = if exponent > 0 { &mut above } else { &mut below };
            let left = *side;
            let joined = match left {
                None => power,
                Some(left) => self.multiply(left, power),
            };
            *(if exponent > 0 { &mut above } else { &mut below }) = Some(joined);
        }
        match (above, below) {
            (Some(above), None) => above,
            (Some(above), Some(below)) => {
                self.once((above, below, true), |r| I::Divide(r, above, below))
            }
            (None, Some(below)) => self.once((below, below, true), |r| I::Reciprocal(r, below)),
            (None, None) => self.emit(|r| I::Fill(r, 1.0)),
        }
    }

    /// x^exponent by squaring.
    fn integer_power(&mut self, x: u32, exponent: u32) -> u32 {
        match exponent {
            0 | 1 => x,
            e => {
                let half = self.integer_power(x, e / 2);
                let square = self.multiply(half, half);
                if e % 2 == 0 {
                    square
                } else {
                    self.multiply(square, x)
                }
            }
        }
    }

    fn multiply(&mut self, a: u32, b: u32) -> u32 {
        let (a, b) = (a.min(b), a.max(b));
        self.once((a, b, false), |r| {
            if a == b {
                I::Square(r, a)
            } else {
                I::Multiply(r, a, b)
            }
        })
    }

    fn once(&mut self, key: (u32, u32, bool), make: impl FnOnce(u32) -> Instruction) -> u32 {
        if let Some(&register) = self.known.get(&key) {
            return register;
        }
        let register = self.emit(make);
        self.known.insert(key, register);
        register
    }
}

impl Instruction {
    /// Calls `change` with every register, written ones first; `true` when it is written.
    fn registers(&mut self, mut change: impl FnMut(&mut u32, bool)) {
        match self {
            I::Load(r, _) | I::Fill(r, _) => change(r, true),
            I::Scale(r, a, _)
            | I::AddConstant(r, a, _)
            | I::Square(r, a)
            | I::Reciprocal(r, a)
            | I::Apply(r, a, _)
            | I::Power(r, a, _) => {
                change(r, true);
                change(a, false);
            }
            I::Add(r, a, b)
            | I::Subtract(r, a, b)
            | I::AddScaled(r, a, b, _)
            | I::Multiply(r, a, b)
            | I::Divide(r, a, b) => {
                change(r, true);
                change(a, false);
                change(b, false);
            }
            I::SinCos(s, c, a) => {
                change(s, true);
                change(c, true);
                change(a, false);
            }
            I::Store(a, _) => change(a, false),
            I::StoreVariable(..) | I::StoreConstant(..) => {}
        }
    }
}

/// Puts values that are never alive together into one register.
fn allocate(mut instructions: Vec<Instruction>, values: usize) -> (Vec<Instruction>, usize) {
    let mut last_use = vec![0; values];
    for (time, instruction) in instructions.iter_mut().enumerate() {
        instruction.registers(|value, _| last_use[*value as usize] = time);
    }
    let mut place = vec![0_u32; values];
    let mut free: Vec<u32> = Vec::new();
    let mut used = 0_u32;
    for (time, instruction) in instructions.iter_mut().enumerate() {
        let mut ended: Vec<u32> = Vec::new();
        instruction.registers(|value, written| {
            let v = *value as usize;
            if written {
                place[v] = free.pop().unwrap_or_else(|| {
                    used += 1;
                    used - 1
                });
            }
            *value = place[v];
            if last_use[v] == time && !ended.contains(&place[v]) {
                ended.push(place[v]);
            }
        });
        free.extend(ended); // only now: what is written never shares a register with what is read
    }
    (instructions, used as usize)
}

/// Where the results go.
struct Outputs<'a, T> {
    slots: &'a [Slot],
    stride: usize,
    out: &'a mut [T],
}

impl<T: DerefMut<Target = [f64]>> Outputs<'_, T> {
    #[inline(always)]
    fn store(&mut self, slot: u32, start: usize, samples: &[f64]) {
        let Slot { table, row } = self.slots[slot as usize];
        let from = row * self.stride + start;
        self.out[table][from..from + samples.len()].copy_from_slice(samples);
    }
}

/// One evaluation, compiled once per instruction set.
struct Run<'a, T> {
    tape: &'a Tape,
    course: Course<'a>,
    outputs: Outputs<'a, T>,
    registers: &'a mut [Line<Block>],
}

impl<T: DerefMut<Target = [f64]>> pulp::WithSimd for Run<'_, T> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(mut self, simd: S) {
        let len = self.course.motion.len;
        let mut start = 0;
        while start < len {
            let width = BLOCK.min(len - start);
            for instruction in &self.tape.instructions {
                step(
                    simd,
                    instruction,
                    self.registers,
                    self.course,
                    start,
                    width,
                    &mut self.outputs,
                );
            }
            start += width;
        }
    }
}

/// The registers of one instruction, which the allocator keeps apart.
#[inline(always)]
fn apart<const N: usize>(registers: &mut [Line<Block>], which: [u32; N]) -> [&mut Block; N] {
    match registers.get_disjoint_mut(which.map(|register| register as usize)) {
        Ok(blocks) => blocks.map(|Line(block)| block),
        Err(_) => unreachable!("an instruction reads the register that it writes"),
    }
}

/// dst[l] = f(a[l]) over the lanes of a block.
macro_rules! unary {
    ($registers:expr, $dst:expr, $a:expr, |$x:ident| $f:expr) => {{
        let [dst, a] = apart($registers, [$dst, $a]);
        for group in 0..GROUPS {
            for lane in 0..LANES {
                let $x = a[group][lane];
                dst[group][lane] = $f;
            }
        }
    }};
}

/// dst[l] = f(a[l], b[l]) over the lanes of a block; a ≠ b, else it is a scale or a square.
macro_rules! binary {
    ($registers:expr, $dst:expr, $a:expr, $b:expr, |$x:ident, $y:ident| $f:expr) => {{
        let [dst, a, b] = apart($registers, [$dst, $a, $b]);
        for group in 0..GROUPS {
            for lane in 0..LANES {
                let ($x, $y) = (a[group][lane], b[group][lane]);
                dst[group][lane] = $f;
            }
        }
    }};
}

#[inline(always)]
fn step<S: pulp::Simd, T: DerefMut<Target = [f64]>>(
    simd: S,
    instruction: &Instruction,
    registers: &mut [Line<Block>],
    course: Course<'_>,
    start: usize,
    width: usize,
    outputs: &mut Outputs<'_, T>,
) {
    match *instruction {
        I::Load(r, variable) => {
            let source = samples(course, variable, start, width);
            let target = registers[r as usize].0.as_flattened_mut();
            target[..width].copy_from_slice(source);
            target[width..].fill(source[width - 1]); // the tail of the last block repeats a real sample
        }
        I::Fill(r, value) => registers[r as usize].0 = [[value; LANES]; GROUPS],
        I::Scale(r, a, c) => unary!(registers, r, a, |x| c * x),
        I::AddConstant(r, a, c) => unary!(registers, r, a, |x| x + c),
        I::Square(r, a) => unary!(registers, r, a, |x| x * x),
        I::Reciprocal(r, a) => unary!(registers, r, a, |x| 1.0 / x),
        I::Apply(r, a, Function::Tanh) => {
            let [dst, a] = apart(registers, [r, a]);
            let from = S::as_simd_f64s(a.as_flattened()).0;
            let to = S::as_mut_simd_f64s(dst.as_flattened_mut()).0;
            for (to, from) in to.iter_mut().zip(from) {
                *to = tanh(simd, *from);
            }
        }
        I::Apply(r, a, function) => unary!(registers, r, a, |x| function.value(x)),
        I::Power(r, a, exponent) => unary!(registers, r, a, |x| x.powf(exponent)),
        I::Add(r, a, b) => binary!(registers, r, a, b, |x, y| x + y),
        I::Subtract(r, a, b) => binary!(registers, r, a, b, |x, y| x - y),
        I::AddScaled(r, a, b, c) => binary!(registers, r, a, b, |x, y| x + c * y),
        I::Multiply(r, a, b) => binary!(registers, r, a, b, |x, y| x * y),
        I::Divide(r, a, b) => binary!(registers, r, a, b, |x, y| x / y),
        I::SinCos(s, c, a) => {
            let [sine, cosine, a] = apart(registers, [s, c, a]);
            for group in 0..GROUPS {
                (sine[group], cosine[group]) = sin_cos(&a[group]);
            }
        }
        I::Store(a, slot) => {
            outputs.store(
                slot,
                start,
                &registers[a as usize].0.as_flattened()[..width],
            );
        }
        I::StoreVariable(variable, slot) => {
            outputs.store(slot, start, samples(course, variable, start, width));
        }
        I::StoreConstant(value, slot) => outputs.store(slot, start, &[value; BLOCK][..width]),
    }
}

/// Some samples of a variable.
#[inline(always)]
fn samples<'a>(course: Course<'a>, variable: Variable, start: usize, width: usize) -> &'a [f64] {
    let motion = course.motion;
    let (source, joint) = match variable {
        Variable::History(channel) => {
            return (course.channel(channel, start, width)).unwrap_or(&UNKNOWN[..width]);
        }
        Variable::Position(joint) => (motion.q, joint),
        Variable::Velocity(joint) => (motion.qd, joint),
        Variable::Acceleration(joint) => (motion.qdd, joint),
    };
    &source[joint * motion.len + start..][..width]
}
