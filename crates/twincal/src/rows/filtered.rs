//! Rows of the regression: F over torque and columns, only where a row is kept (polyphase).

use super::evaluate::{Model, Stretch};
use super::{JointRows, MAX_BLOCK, RowBlock, Slice};
use crate::error::Result;
use crate::signal::convolve::correlate;
use crate::signal::fir::column_kernel;
use crate::signal::{Pipeline, Segment};

/// Fewest samples that are evaluated at a time; at least two kernels, so that moving the window on costs little.
const CHUNK: usize = 512;

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
        let step = (1.0 / (segment.interval * pipeline.rate_hz))
            .round()
            .max(1.0) as usize;
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

/// Window of the log-rate channels of one joint: columns, then nominal, then measured, each `capacity` long.
struct Window {
    channels: Vec<Vec<f64>>,
}

/// Visits filtered rows of one segment; `chunk` samples are evaluated at a time (no matter how many).
pub(super) fn visit(
    model: &mut Model<'_, '_>,
    pipeline: &Pipeline,
    slice: &Slice,
    segment: &Segment,
    dof: usize,
    chunk: Option<usize>,
    visit: &mut dyn FnMut(&RowBlock<'_>) -> Result<()>,
) -> Result<()> {
    let plan = Plan::new(pipeline, segment);
    let (taps, total) = (plan.kernel.len(), segment.time.len());
    let chunk = chunk.unwrap_or(CHUNK.max(2 * taps));
    let has_tau = !segment.tau.is_empty();
    let mut stretch = Stretch::default();
    let mut windows: Vec<Window> = (0..dof)
        .map(|joint| Window {
            channels: vec![Vec::with_capacity(taps + chunk); model.columns[joint].len() + 1],
        })
        .collect();
    let mut rows = Rows::new(model, dof, has_tau);
    // Samples `start .. filled` of the segment are in the windows.
    let mut next = slice.rows.start;
    let (mut start, mut filled) = (next * plan.step, next * plan.step);
    // No sample after the last row's window is looked at.
    let total_seen = slice.rows.end.saturating_sub(1) * plan.step + taps;
    while next < slice.rows.end {
        // Forget what no later row sees, then add a chunk.
        let keep_from = next * plan.step;
        let forget = (keep_from - start).min(filled - start);
        for channel in windows.iter_mut().flat_map(|w| &mut w.channels) {
            channel.drain(..forget);
        }
        start += forget;
        let skip = keep_from.max(filled);
        if start == filled {
            // Between two rows further apart than F: samples that nobody sees.
            start = skip;
            filled = skip;
        }
        let len = chunk.min(total_seen.min(total) - filled);
        stretch.load(filled, len, total, [&segment.q, &segment.qd, &segment.qdd]);
        stretch.evaluate(model);
        for (joint, window) in windows.iter_mut().enumerate() {
            let width = window.channels.len() - 1;
            for (i, channel) in window.channels[..width].iter_mut().enumerate() {
                channel.extend_from_slice(&stretch.columns[joint][i * len..(i + 1) * len]);
            }
            window.channels[width]
                .extend_from_slice(&stretch.nominal[joint * len..(joint + 1) * len]);
        }
        filled += len;
        // Rows whose whole window is there.
        while next < slice.rows.end && next * plan.step + taps <= filled {
            let ready = (filled - taps - next * plan.step) / plan.step + 1;
            let count = ready.min(slice.rows.end - next).min(MAX_BLOCK);
            rows.fill(&plan, segment, &windows, start, next, count);
            visit(&rows.block(&model.columns, slice.segment, next == 0))?;
            next += count;
        }
    }
    Ok(())
}

/// Filtered rows of one block.
struct Rows {
    len: usize,
    time: Vec<f64>,
    input_rows: Vec<usize>,
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd: Vec<f64>,
    x: Vec<Vec<f64>>,
    nominal: Vec<f64>,
    measured: Vec<f64>,
    standstill: Vec<bool>,
    has_tau: bool,
    dof: usize,
}

impl Rows {
    fn new(model: &Model<'_, '_>, dof: usize, has_tau: bool) -> Self {
        Self {
            len: 0,
            time: Vec::new(),
            input_rows: Vec::new(),
            q: Vec::new(),
            qd: Vec::new(),
            qdd: Vec::new(),
            x: vec![Vec::new(); model.columns.len()],
            nominal: Vec::new(),
            measured: Vec::new(),
            standstill: Vec::new(),
            has_tau,
            dof,
        }
    }

    /// Computes rows `next .. next + count`; the windows begin at sample `start`.
    fn fill(
        &mut self,
        plan: &Plan,
        segment: &Segment,
        windows: &[Window],
        start: usize,
        next: usize,
        count: usize,
    ) {
        let (half, total) = (plan.kernel.len() / 2, segment.time.len());
        let centres = || (next..next + count).map(|row| half + row * plan.step);
        self.len = count;
        self.time.clear();
        self.time.extend(centres().map(|i| segment.time[i]));
        self.input_rows.clear();
        self.input_rows
            .extend(centres().map(|i| input_row(segment, i)));
        for (to, from) in [
            (&mut self.q, &segment.q),
            (&mut self.qd, &segment.qd),
            (&mut self.qdd, &segment.qdd),
        ] {
            to.clear();
            to.extend(
                (0..self.dof).flat_map(|joint| centres().map(move |i| from[joint * total + i])),
            );
        }
        self.standstill.clear();
        self.standstill.extend(
            (0..self.dof)
                .flat_map(|joint| centres().map(move |i| segment.standstill[joint * total + i])),
        );
        self.nominal.resize(self.dof * count, 0.0);
        self.measured
            .resize(if self.has_tau { self.dof * count } else { 0 }, 0.0);
        let from = next * plan.step - start;
        let first = next * plan.step;
        for (joint, window) in windows.iter().enumerate() {
            let (columns, rows) = (
                window.channels.len() - 1,
                joint * count..(joint + 1) * count,
            );
            self.x[joint].resize(columns * count, 0.0);
            for (out, channel) in self.x[joint].chunks_exact_mut(count).zip(&window.channels) {
                correlate(&plan.kernel, &channel[from..], plan.step, out);
            }
            correlate(
                &plan.kernel,
                &window.channels[columns][from..],
                plan.step,
                &mut self.nominal[rows.clone()],
            );
            if self.has_tau {
                let tau = &segment.tau[joint * total + first..(joint + 1) * total];
                correlate(&plan.kernel, tau, plan.step, &mut self.measured[rows]);
            }
        }
    }

    fn block<'a>(&'a self, columns: &[&'a [usize]], index: usize, first: bool) -> RowBlock<'a> {
        let len = self.len;
        let joints = (0..self.dof)
            .map(|joint| {
                let rows = joint * len..(joint + 1) * len;
                JointRows {
                    columns: columns[joint],
                    stride: len,
                    x: &self.x[joint],
                    measured: if self.has_tau {
                        &self.measured[rows.clone()]
                    } else {
                        &[]
                    },
                    nominal: &self.nominal[rows.clone()],
                    standstill: &self.standstill[rows],
                }
            })
            .collect();
        RowBlock {
            segment: index,
            first,
            len,
            time: &self.time,
            input_rows: &self.input_rows,
            q: &self.q,
            qd: &self.qd,
            qdd: &self.qdd,
            joints,
        }
    }
}

/// Row of the recording that is nearest in time to grid sample `i`.
fn input_row(segment: &Segment, i: usize) -> usize {
    let Some(logged) = &segment.logged else {
        return segment.input_rows[i];
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
