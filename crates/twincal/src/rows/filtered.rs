//! Rows of the regression: F over torque and the columns' parts, only where a row is kept.

use super::evaluate::{Source, Stretch, channels};
use super::{Form, JointRows, MAX_BLOCK, RowBlock, Slice};
use crate::error::Result;
use crate::robot::BLOCK;
use crate::signal::decimate::Decimator;
use crate::signal::fir::column_kernel;
use crate::signal::{Pipeline, Segment};
use std::ops::Range;

/// Samples that are evaluated at a time.
const STRETCH: usize = BLOCK;
/// Rows that are computed together, at least; and so many windows long, so that the samples before the first row's centre
/// and behind the last one's, which the next rows need again, add little.
const LEAST_BATCH: usize = 1024;
const WINDOWS: usize = 8;

/// Which samples of a segment become rows.
pub(super) struct Plan {
    /// F.
    pub(super) kernel: Vec<f64>,
    /// Every `step`-th sample is kept.
    pub(super) step: usize,
    /// Number of rows; row r is centred on sample `half + r * step`.
    pub(super) rows: usize,
}

impl Plan {
    pub(super) fn new(pipeline: &Pipeline, segment: &Segment) -> Self {
        let kernel = column_kernel(pipeline.cutoff_hz, segment.interval);
        let step = pipeline.step(segment.interval);
        let rows = match segment.time.len().checked_sub(kernel.len()) {
            Some(rest) => rest / step + 1,
            None => 0,
        };
        Self { kernel, step, rows }
    }

    /// The first row whose centre is not before a time, s.
    pub(super) fn first_since(&self, segment: &Segment, since: f64) -> usize {
        let (mut low, mut high) = (0, self.rows);
        while low < high {
            let row = usize::midpoint(low, high);
            if segment.time[self.kernel.len() / 2 + row * self.step] < since {
                low = row + 1;
            } else {
                high = row;
            }
        }
        low
    }
}

/// Visits filtered rows of one segment; `batch` rows are computed at a time (no matter how many).
pub(super) fn visit(
    source: &mut dyn Source,
    pipeline: &Pipeline,
    (slice, form): (&Slice, Form),
    segment: &Segment,
    dof: usize,
    batch: Option<usize>,
    visit: &mut dyn FnMut(&RowBlock<'_>) -> Result<()>,
) -> Result<()> {
    let plan = Plan::new(pipeline, segment);
    let batch = batch.unwrap_or(LEAST_BATCH.max(WINDOWS * plan.kernel.len() / plan.step));
    let mut next = slice.rows.start;
    while next < slice.rows.end {
        let end = slice.rows.end.min(next + batch);
        let rows = Rows::new(source, (&plan, form), segment, dof, next..end);
        let mut from = 0;
        while from < rows.len() {
            let to = rows.len().min(from + MAX_BLOCK);
            rows.give(source, slice.segment, from..to, visit)?;
            from = to;
        }
        next = end;
    }
    Ok(())
}

/// Filtered rows that were computed together.
struct Rows {
    /// Rows of the segment.
    range: Range<usize>,
    time: Vec<f64>,
    input_rows: Vec<usize>,
    /// `joint * len + row`.
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd: Vec<f64>,
    standstill: Vec<bool>,
    form: Form,
    /// Columns or parts of each joint, `i * len + row`.
    x: Vec<Vec<f64>>,
    nominal: Vec<Vec<f64>>,
    /// Empty without products.
    products: Vec<Vec<f64>>,
    /// Empty if the log has no torque.
    measured: Vec<Vec<f64>>,
}

impl Rows {
    fn new(
        source: &mut dyn Source,
        (plan, form): (&Plan, Form),
        segment: &Segment,
        dof: usize,
        range: Range<usize>,
    ) -> Self {
        let (half, total) = (plan.kernel.len() / 2, segment.time.len());
        let centres = || range.clone().map(|row| half + row * plan.step);
        let at_centres = |values: &[f64]| -> Vec<f64> {
            values
                .chunks_exact(total)
                .flat_map(|joint| centres().map(|i| joint[i]))
                .collect()
        };
        let mut rows = Self {
            time: centres().map(|i| segment.time[i]).collect(),
            input_rows: centres().map(|i| input_row(segment, i)).collect(),
            q: at_centres(&segment.q),
            qd: at_centres(&segment.qd),
            qdd: at_centres(&segment.qdd),
            standstill: segment
                .standstill
                .chunks_exact(total)
                .flat_map(|joint| centres().map(|i| joint[i]))
                .collect(),
            form,
            x: vec![Vec::new(); dof],
            nominal: Vec::with_capacity(dof),
            products: Vec::new(),
            measured: Vec::new(),
            range: range.clone(),
        };
        rows.filter(source, plan, segment, dof);
        rows
    }

    fn len(&self) -> usize {
        self.range.len()
    }

    /// F over torque and columns. Per joint the signals are its parts, its nominal, its measured torque, and that of products.
    fn filter(&mut self, source: &mut dyn Source, plan: &Plan, segment: &Segment, dof: usize) {
        let (len, total) = (self.len(), segment.time.len());
        let has_tau = !segment.tau.is_empty();
        let mut firsts = Vec::with_capacity(dof);
        let mut signals = 0;
        for joint in 0..dof {
            firsts.push(signals);
            signals += source.recipes(joint).parts() + 2 + usize::from(source.has_products());
        }
        let mut decimator = Decimator::new(&plan.kernel, plan.step, len, signals);
        let begin = self.range.start * plan.step;
        let end = begin + (len - 1) * plan.step + plan.kernel.len();
        let mut stretch = Stretch::new(dof);
        let mut from = begin;
        while from < end {
            let count = STRETCH.min(end - from);
            stretch.load(from, count, total, channels(segment));
            stretch.evaluate_parts(source, count);
            let mut at_hand: Vec<(usize, &[f64])> = Vec::with_capacity(4 * dof);
            for (joint, &first) in firsts.iter().enumerate() {
                let parts = source.recipes(joint).parts();
                let own = joint * count..(joint + 1) * count;
                at_hand.push((first, &stretch.values[joint][..]));
                at_hand.push((first + parts, &stretch.nominal[own]));
                if has_tau {
                    let tau = &segment.tau[joint * total + from..][..count];
                    at_hand.push((first + parts + 1, tau));
                }
                if source.has_products() {
                    at_hand.push((first + parts + 2, stretch.products(joint)));
                }
            }
            decimator.add(from - begin, count, &at_hand);
            from += count;
        }
        for (joint, &first) in firsts.iter().enumerate() {
            let recipes = source.recipes(joint);
            let parts = recipes.parts();
            let (sums, stride) = (decimator.sums(first, parts), decimator.stride());
            match self.form {
                Form::Columns => recipes.combine(sums, stride, len, &mut self.x[joint]),
                Form::Parts => {
                    let rows = sums.chunks_exact(stride).map(|part| &part[..len]);
                    self.x[joint] = rows.flatten().copied().collect();
                }
            }
            let row = |signal: usize| decimator.sums(signal, 1)[..len].to_vec();
            self.nominal.push(row(first + parts));
            if has_tau {
                self.measured.push(row(first + parts + 1));
            }
            if source.has_products() {
                self.products.push(row(first + parts + 2));
            }
        }
    }

    /// Shows some of the rows to a visitor.
    fn give(
        &self,
        source: &dyn Source,
        segment: usize,
        rows: Range<usize>,
        visit: &mut dyn FnMut(&RowBlock<'_>) -> Result<()>,
    ) -> Result<()> {
        let (len, dof) = (self.len(), self.x.len());
        let some = |values: &[f64]| -> Vec<f64> {
            values
                .chunks_exact(len)
                .flat_map(|joint| joint[rows.clone()].iter().copied())
                .collect()
        };
        let joints = (0..dof)
            .map(|joint| JointRows {
                columns: source.columns(joint),
                recipes: self.form.recipes(source, joint),
                stride: len,
                x: self.x[joint].get(rows.start..).unwrap_or(&[]),
                measured: self.measured.get(joint).map_or(&[], |m| &m[rows.clone()]),
                nominal: &self.nominal[joint][rows.clone()],
                products: self.products.get(joint).map_or(&[], |p| &p[rows.clone()]),
                standstill: &self.standstill[joint * len..(joint + 1) * len][rows.clone()],
            })
            .collect();
        visit(&RowBlock {
            segment,
            first: self.range.start + rows.start == 0,
            len: rows.len(),
            time: &self.time[rows.clone()],
            input_rows: &self.input_rows[rows.clone()],
            q: &some(&self.q),
            qd: &some(&self.qd),
            qdd: &some(&self.qdd),
            joints,
        })
    }
}

/// Row of the recording that is nearest in time to grid sample `i`.
fn input_row(segment: &Segment, i: usize) -> usize {
    if let Some(row) = segment.input_rows.get(i) {
        return *row;
    }
    let Some(logged) = &segment.logged else {
        return i;
    };
    let t = segment.time[i];
    let after = logged
        .time
        .partition_point(|stamp| *stamp < t)
        .min(logged.time.len() - 1);
    let before = after.saturating_sub(1);
    let closer = if (logged.time[before] - t).abs() <= (logged.time[after] - t).abs() {
        before
    } else {
        after
    };
    logged.input_rows[closer]
}
