//! From a trajectory and a library to rows of the regression, streamed (method section 1, steps 2 to 4).
//!
//! ```text
//! F τ_meas − F τ_nom = (F Φ) β + F ε
//! ```
//! One symmetric filter F goes over torque, nominal torque and every column, so the relation stays exactly linear. Φ is
//! never held: the parts that columns are combinations of are evaluated at the log's rate, a block of samples at a time, and
//! added to the rows whose window holds them.

mod evaluate;
mod filtered;
mod unfiltered;

pub(crate) use evaluate::recipes_of_log;

use crate::error::Result;
use crate::robot::Robot;
use crate::signal::{Payload, Pipeline, Segment, Trajectory};
use crate::term::{Library, Recipes};
use evaluate::{OfLibrary, Source};
use std::ops::Range;
use std::sync::Arc;

/// Which rows [`visit_rows`] gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowSignal {
    /// Torque and columns through F, at the kept rate: the rows of the regression.
    Filtered,
    /// Every logged sample within the borders of the motion filter, torque as logged.
    Raw,
}

/// The rows of one joint in a [`RowBlock`].
#[derive(Debug, Clone, Copy)]
pub struct JointRows<'a> {
    /// Library columns that are structurally non-zero on this joint, ascending.
    pub columns: &'a [usize],
    /// How the columns follow from what is in `x`; `None`: they are in `x` themselves.
    pub recipes: Option<&'a Arc<Recipes>>,
    /// Distance between columns, or parts, in `x`.
    pub stride: usize,
    /// Column `columns[i]` of row r is `x[i * stride + r]`, N·m (N) per unit of β; with `recipes` that is part i.
    pub x: &'a [f64],
    /// Measured torque, one per row; empty if the log has no torque.
    pub measured: &'a [f64],
    /// Nominal torque, one per row.
    pub nominal: &'a [f64],
    /// Torque beside it that no coefficient moves, because effects multiply each other; empty where there is none.
    pub products: &'a [f64],
    /// Whether the joint stands still at the row's centre.
    pub standstill: &'a [bool],
}

/// Consecutive rows of one segment.
#[derive(Debug, Clone)]
pub struct RowBlock<'a> {
    /// Index of the segment in the trajectory.
    pub segment: usize,
    /// True if the first row starts the segment's rows.
    pub first: bool,
    /// Rows.
    pub len: usize,
    /// Time of each row, s.
    pub time: &'a [f64],
    /// Row of the recording nearest in time to each row; with [`RowSignal::Raw`] and pipeline off the row itself.
    pub input_rows: &'a [usize],
    /// Position at the rows, `joint * len + row`.
    pub q: &'a [f64],
    /// Velocity at the rows.
    pub qd: &'a [f64],
    /// Acceleration at the rows.
    pub qdd: &'a [f64],
    /// Per moving joint.
    pub joints: Vec<JointRows<'a>>,
}

/// Most rows in one block.
pub const MAX_BLOCK: usize = 320;

/// From one part to the next in a block of unfiltered rows: not so far that all are in the same places of the first-level cache.
pub const PARTS_APART: usize = MAX_BLOCK + crate::lanes::LANES;

/// What [`JointRows::x`] holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    Columns,
    Parts,
}

impl Form {
    fn recipes(self, source: &dyn Source, joint: usize) -> Option<&Arc<Recipes>> {
        (self == Self::Parts).then(|| source.recipes(joint))
    }
}

/// Consecutive rows of one segment: what can be computed on its own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Slice {
    /// Index of the segment in the trajectory.
    pub segment: usize,
    /// Rows of that segment.
    pub rows: Range<usize>,
}

/// The rows at or after time `since` (s; −∞: all of them) of a trajectory, in order, in slices of about `most` rows.
///
/// How rows are cut into slices does not change them.
pub fn slices(
    pipeline: &Pipeline,
    trajectory: &Trajectory,
    signal: RowSignal,
    since: f64,
    most: usize,
) -> Vec<Slice> {
    let mut slices = Vec::new();
    for (segment, samples) in trajectory.segments.iter().enumerate() {
        let rows = rows_since(pipeline, samples, signal, since);
        let count = rows.len().div_ceil(most.max(1));
        let cut = |i: usize| rows.start + i * rows.len() / count;
        slices.extend((0..count).map(|i| Slice {
            segment,
            rows: cut(i)..cut(i + 1),
        }));
    }
    slices
}

/// Of a log with more than four times as many raw rows so many are scored, in pieces: neighbours at a log's rate say nearly the same.
const SPREAD_RAW: usize = 1 << 13;
const RAW_PIECE: usize = 1 << 8;
/// Of many logs so many together, but not fewer of each, in at least four pieces.
const SPREAD_RAW_TOGETHER: usize = 1 << 16;
const LEAST_RAW: usize = 1 << 6;

/// Raw rows at or after time `since` (s) of one of `logs` logs: all of a log of at most 32 768 rows, evenly spread pieces of a longer one, of
/// 256 rows at most and about 8192 together; of more than eight logs fewer of each, in smaller pieces.
pub fn spread_raw(
    pipeline: &Pipeline,
    trajectory: &Trajectory,
    since: f64,
    logs: usize,
) -> Vec<Slice> {
    let spread = (SPREAD_RAW_TOGETHER / logs.max(1)).clamp(LEAST_RAW, SPREAD_RAW);
    let piece = RAW_PIECE.min(spread / 4);
    let all = slices(pipeline, trajectory, RowSignal::Raw, since, piece);
    let rows: usize = all.iter().map(|slice| slice.rows.len()).sum();
    if rows <= 4 * spread {
        return all;
    }
    let kept = (all.len() * spread).div_ceil(rows);
    (0..kept)
        .map(|i| all[i * all.len() / kept].clone())
        .collect()
}

/// Rows of a segment whose time is not before `since`.
fn rows_since(
    pipeline: &Pipeline,
    segment: &Segment,
    signal: RowSignal,
    since: f64,
) -> Range<usize> {
    if signal == RowSignal::Filtered && !pipeline.is_off() {
        let plan = filtered::Plan::new(pipeline, segment);
        return plan.first_since(segment, since)..plan.rows;
    }
    let time = match &segment.logged {
        Some(logged) => &logged.time,
        None => &segment.time,
    };
    time.partition_point(|t| *t < since)..time.len()
}

/// Visits all rows of a trajectory in order, in blocks of at most [`MAX_BLOCK`] rows.
///
/// A known payload of the log is part of the nominal torque; where the payload component does not act its columns are 0.
///
/// With the pipeline off both signals are the input rows. Otherwise [`RowSignal::Filtered`] keeps every m-th sample of
/// the segment's inner part, m = max(1, round(log rate / `rate_hz`)), from the first sample where F fits; a segment shorter than
/// F gives none. Memory is that of one chunk; the values do not depend on how the work was cut.
///
/// # Errors
/// What `visit` returns; visiting stops there. Those of [`Robot::carrying`].
pub fn visit_rows(
    robot: &Robot,
    library: &Library,
    pipeline: &Pipeline,
    trajectory: &Trajectory,
    signal: RowSignal,
    visit: &mut dyn FnMut(&RowBlock<'_>) -> Result<()>,
) -> Result<()> {
    let all = slices(pipeline, trajectory, signal, f64::NEG_INFINITY, usize::MAX);
    visit_slices(robot, library, pipeline, trajectory, signal, &all, visit)
}

/// [`visit_rows`] for the rows of some [`slices`] only.
///
/// # Errors
/// As [`visit_rows`].
pub fn visit_slices(
    robot: &Robot,
    library: &Library,
    pipeline: &Pipeline,
    trajectory: &Trajectory,
    signal: RowSignal,
    slices: &[Slice],
    visit: &mut dyn FnMut(&RowBlock<'_>) -> Result<()>,
) -> Result<()> {
    let model = (robot, library);
    visit_loaded(
        model,
        pipeline,
        trajectory,
        signal,
        (slices, Form::Columns),
        visit,
    )
}

/// [`visit_slices`] with the parts that columns are made of in the place of columns: for what is summed over rows.
///
/// # Errors
/// As [`visit_rows`].
pub fn visit_parts(
    robot: &Robot,
    library: &Library,
    pipeline: &Pipeline,
    trajectory: &Trajectory,
    signal: RowSignal,
    slices: &[Slice],
    visit: &mut dyn FnMut(&RowBlock<'_>) -> Result<()>,
) -> Result<()> {
    let model = (robot, library);
    visit_loaded(
        model,
        pipeline,
        trajectory,
        signal,
        (slices, Form::Parts),
        visit,
    )
}

/// Slices of a log with what it carries.
fn visit_loaded(
    (robot, library): (&Robot, &Library),
    pipeline: &Pipeline,
    trajectory: &Trajectory,
    signal: RowSignal,
    slices: (&[Slice], Form),
    visit: &mut dyn FnMut(&RowBlock<'_>) -> Result<()>,
) -> Result<()> {
    // A known payload is part of the robot in this log.
    let loaded = match trajectory.payload {
        Payload::Known { mass, com } => {
            Some(robot.carrying(library.payload_frame(robot), mass, com)?)
        }
        Payload::None | Payload::Unknown => None,
    };
    let carries = trajectory.payload_acts;
    let other = loaded.is_some() || (library.changes_with_payload() && !carries);
    let robot = loaded.as_ref().unwrap_or(robot);
    let other = other.then(|| library.in_log(robot, carries));
    let library = other.as_ref().unwrap_or(library);
    let mut source = OfLibrary::new(robot, library, trajectory.payload_acts);
    visit_source(&mut source, pipeline, trajectory, signal, slices, visit)
}

/// Slices of a log for any way to evaluate columns.
fn visit_source(
    source: &mut dyn Source,
    pipeline: &Pipeline,
    trajectory: &Trajectory,
    signal: RowSignal,
    (slices, form): (&[Slice], Form),
    visit: &mut dyn FnMut(&RowBlock<'_>) -> Result<()>,
) -> Result<()> {
    for slice in slices {
        let (segment, dof) = (&trajectory.segments[slice.segment], trajectory.dof);
        if signal == RowSignal::Raw || pipeline.is_off() {
            unfiltered::visit(source, (slice, form), segment, dof, visit)?;
        } else {
            filtered::visit(source, pipeline, (slice, form), segment, dof, None, visit)?;
        }
    }
    Ok(())
}

/// Number of rows that [`visit_rows`] will give for a trajectory, without evaluating anything.
pub fn count_rows(pipeline: &Pipeline, trajectory: &Trajectory, signal: RowSignal) -> usize {
    let rows = |segment| rows_since(pipeline, segment, signal, f64::NEG_INFINITY).len();
    trajectory.segments.iter().map(rows).sum()
}

#[cfg(test)]
mod history_tests;
#[cfg(test)]
mod tests;
