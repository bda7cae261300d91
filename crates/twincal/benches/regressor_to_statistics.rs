//! From motion to sufficient statistics on one core, without filter, so that every sample is a row:
//! `cargo bench -p twincal --bench regressor_to_statistics`.
//!
//! Library: inertial parameters of every link, payload, friction, offset and motor inertia of each joint. Statistics: the
//! Gram of rows and of their first differences of all columns, residual torque included. Rows are summed as the parts that columns
//! are made of, as in a fit, and beside it as the columns themselves. What a Gram needs are `k (k + 1)` operations per joint and
//! sample for either of the two, k signals with the torque, once of all blocks of a run, which do not fit into the
//! cache of a core, once of the same block over and over; the machine's peak is measured beside it with
//! multiply-adds that never leave the registers, in the same instruction set. CPU time, least of many runs.

#![allow(
    clippy::print_stdout,
    reason = "a bench is a program that prints numbers"
)]

mod common;

use common::least;
use pulp::{Simd, WithSimd};
use serde_json::Value;
use std::collections::BTreeMap;
use std::hint::black_box;
use twincal::gram::{JointAccumulator, JointGram, Workspace};
use twincal::lanes::Aligned;
use twincal::robot::{Motion, Robot, RobotDescription};
use twincal::rows::{MAX_BLOCK, PARTS_APART};
use twincal::term::{Family, Library, LibrarySettings, Scratch};

/// Samples of one run, evaluated [`MAX_BLOCK`] at a time, as rows are streamed.
const SAMPLES: usize = 64 * MAX_BLOCK;
const REPEATS: usize = 100;
const ROBOTS: &str = include_str!("peers/robots.json");

fn main() {
    let robot = panda();
    let settings = LibrarySettings {
        families: vec![
            Family::Payload,
            Family::MassMoments,
            Family::Tensor,
            Family::Viscous,
            Family::Coulomb,
            Family::Offset,
            Family::MotorInertia,
        ],
        coulomb_velocity: 0.02,
        ..LibrarySettings::default()
    };
    let (library, _) = Library::propose(&robot, &settings).expect("the settings above are valid");
    let peak = peak();
    println!("peak of f64 multiply-adds: {:.1} GFLOP/s", 1e-9 * peak);
    let motion = waves(robot.dof());
    for way in [Way::Parts, Way::Columns] {
        measured(way, &library, &motion, peak);
    }
}

/// What is evaluated and summed.
#[derive(Debug, Clone, Copy)]
enum Way {
    Parts,
    Columns,
}

impl Way {
    /// Signals of a joint.
    fn signals(self, library: &Library, joint: usize) -> usize {
        match self {
            Self::Parts => library.recipes(joint).parts(),
            Self::Columns => library.columns_of_joint(joint).len(),
        }
    }

    /// From one signal to the next.
    fn stride(self) -> usize {
        match self {
            Self::Parts => PARTS_APART,
            Self::Columns => MAX_BLOCK,
        }
    }

    fn evaluate(
        self,
        library: &Library,
        block: &Block,
        out: &mut [Aligned],
        scratch: &mut Scratch,
    ) {
        match self {
            Self::Parts => library.evaluate_parts(of(block), PARTS_APART, out, scratch),
            Self::Columns => library.evaluate_with(of(block), out, scratch),
        }
    }

    fn accumulators(self, library: &Library) -> Vec<JointAccumulator> {
        let columns = |joint| library.columns_of_joint(joint).iter();
        let accumulator = |joint| {
            let columns = columns(joint).map(|&k| k as u32).collect();
            match self {
                Self::Parts => JointAccumulator::of_parts(columns, library.recipes(joint)),
                Self::Columns => JointAccumulator::new(columns),
            }
        };
        (0..library.joints()).map(accumulator).collect()
    }
}

/// Measures one way and prints what it found.
fn measured(way: Way, library: &Library, motion: &[Block], peak: f64) {
    let widths: Vec<usize> = (0..library.joints())
        .map(|joint| way.signals(library, joint) + 1)
        .collect();
    let needed = 2.0 * widths.iter().map(|k| (k * (k + 1)) as f64).sum::<f64>();
    println!(
        "\n{way:?}: Panda, {} columns; signals of one joint with its torque: {widths:?}; {needed:.0} operations per row",
        library.columns().len()
    );
    let Seconds {
        evaluation,
        gram,
        cached,
        both,
    } = seconds(way, library, motion);
    println!(
        "{:<25} {:>8.3} M samples/s",
        "signals alone",
        1e-6 / evaluation
    );
    for (what, gram) in [("alone ", gram), ("cached", cached)] {
        println!(
            "Gram and differences {what} {:>5.3} M rows/s, {:.1} GFLOP/s, {:.0} % of the peak",
            1e-6 / gram,
            1e-9 * needed / gram,
            100.0 * needed / gram / peak
        );
    }
    println!("motion to statistics      {:>8.3} M samples/s", 1e-6 / both);
    println!(
        "the peak would allow      {:>8.3} M rows/s for the Gram",
        1e-6 * peak / needed
    );
}

/// Least seconds per sample of each step.
struct Seconds {
    /// Motion to signals.
    evaluation: f64,
    /// Signals to sums, of all blocks of a run.
    gram: f64,
    /// Signals to sums, of the same block over and over.
    cached: f64,
    /// Motion to sums.
    both: f64,
}

/// Runs every step of one way.
fn seconds(way: Way, library: &Library, motion: &[Block]) -> Seconds {
    let blocks: Vec<Vec<Aligned>> = (motion.iter())
        .map(|block| {
            let mut out = vec![Aligned::default(); library.joints()];
            way.evaluate(library, block, &mut out, &mut Scratch::default());
            out
        })
        .collect();
    let evaluation = run(|| {
        let (mut out, mut scratch) = (
            vec![Aligned::default(); library.joints()],
            Scratch::default(),
        );
        for block in motion {
            way.evaluate(library, block, black_box(&mut out), &mut scratch);
        }
    });
    let gram = run(|| {
        let (mut statistics, mut workspace) = (way.accumulators(library), Workspace::default());
        for block in &blocks {
            add(&mut statistics, block, way.stride(), &mut workspace);
        }
        finish(statistics)
    });
    let cached = run(|| {
        let (mut statistics, mut workspace) = (way.accumulators(library), Workspace::default());
        for _ in &blocks {
            add(&mut statistics, &blocks[0], way.stride(), &mut workspace);
        }
        finish(statistics)
    });
    let both = run(|| {
        let (mut out, mut scratch) = (
            vec![Aligned::default(); library.joints()],
            Scratch::default(),
        );
        let (mut statistics, mut workspace) = (way.accumulators(library), Workspace::default());
        for block in motion {
            way.evaluate(library, block, &mut out, &mut scratch);
            add(&mut statistics, &out, way.stride(), &mut workspace);
        }
        finish(statistics)
    });
    Seconds {
        evaluation,
        gram,
        cached,
        both,
    }
}

fn panda() -> Robot {
    let document: Value = serde_json::from_str(ROBOTS).expect("the file of robots is JSON");
    let cases = document["cases"].as_array().expect("cases");
    let case = cases.iter().find(|case| case["name"] == "panda");
    let description: RobotDescription =
        serde_json::from_value(case.expect("a Panda")["description"].clone()).expect("a robot");
    let (robot, _) = Robot::new(description, &BTreeMap::new()).expect("a valid robot");
    robot
}

/// Positions, velocities, accelerations of [`MAX_BLOCK`] samples, joint after joint.
type Block = [Vec<f64>; 3];

fn waves(dof: usize) -> Vec<Block> {
    let wave = |block: usize, scale: f64, frequency: f64| {
        let at = |joint: usize, t: usize| (frequency * (1 + joint) as f64) * (t + 1) as f64;
        (0..dof)
            .flat_map(|joint| (0..MAX_BLOCK).map(move |i| (joint, block * MAX_BLOCK + i)))
            .map(|(joint, t)| scale * at(joint, t).sin())
            .collect()
    };
    (0..SAMPLES / MAX_BLOCK)
        .map(|block| [(2.0, 0.0013), (3.0, 0.0021), (8.0, 0.0034)].map(|(s, f)| wave(block, s, f)))
        .collect()
}

fn of([q, qd, qdd]: &Block) -> Motion<'_> {
    Motion {
        len: MAX_BLOCK,
        q,
        qd,
        qdd,
    }
}

/// The torque is the first signal: what it says does not matter here.
fn add(
    statistics: &mut [JointAccumulator],
    columns: &[Aligned],
    stride: usize,
    workspace: &mut Workspace,
) {
    let keep = [true; MAX_BLOCK];
    for (joint, x) in statistics.iter_mut().zip(columns) {
        joint.push_block(x, stride, &x[..MAX_BLOCK], &keep, false, workspace);
    }
}

fn finish(statistics: Vec<JointAccumulator>) -> Vec<JointGram> {
    let finished = statistics.into_iter().map(JointAccumulator::finish);
    finished.collect()
}

/// Least seconds per sample.
fn run<T>(mut work: impl FnMut() -> T) -> f64 {
    let (seconds, _) = least(REPEATS, || black_box(work()));
    seconds / SAMPLES as f64
}

/// f64 operations per second of independent multiply-adds, each counted as two.
fn peak() -> f64 {
    let steps = 1 << 22;
    let (seconds, operations) = least(REPEATS, || pulp::Arch::new().dispatch(Peak { steps }));
    operations / seconds
}

struct Peak {
    steps: usize,
}

/// Enough to hide the latency of a multiply-add on two units, and few enough for sixteen registers.
const CHAINS: usize = 12;

impl WithSimd for Peak {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let factor = simd.splat_f64s(black_box(0.5));
        let summand = simd.splat_f64s(black_box(0.25));
        let mut chains = [simd.splat_f64s(black_box(1.0)); CHAINS];
        for _ in 0..self.steps {
            for chain in &mut chains {
                *chain = simd.mul_add_e_f64s(*chain, factor, summand);
            }
        }
        black_box(chains.map(|chain| simd.reduce_sum_f64s(chain)));
        (2 * CHAINS * S::F64_LANES * self.steps) as f64
    }
}
