//! Rows as logged: for the pipeline off, for raw validation and for predictions.

use super::evaluate::{Source, Stretch, channels};
use super::{Form, JointRows, MAX_BLOCK, PARTS_APART, RowBlock, Slice};
use crate::error::Result;
use crate::signal::Segment;
use crate::signal::interpolate::Place;
use std::ops::Range;

/// Motion at the stamps of a log whose segment has another clock: the filtered motion, interpolated. The filter leaves nothing
/// above f_q, so the error is far below that of the filter.
struct AtStamps {
    places: Vec<Place>,
    /// Nearest sample of the segment.
    nearest: Vec<usize>,
}

impl AtStamps {
    fn new(segment: &Segment, stamps: &[f64]) -> Self {
        let (start, len) = (segment.time[0], segment.time.len());
        let nearest = |t: &f64| {
            let steps = ((t - start) / segment.interval).round();
            (steps.max(0.0) as usize).min(len - 1)
        };
        Self {
            places: (stamps
                .iter()
                .map(|&t| Place::new(t, start, segment.interval, len)))
            .collect(),
            nearest: stamps.iter().map(nearest).collect(),
        }
    }

    /// `joint * stamps + stamp`.
    fn of(&self, values: &[f64], len: usize, out: &mut Vec<f64>) {
        out.clear();
        for joint in values.chunks_exact(len) {
            out.extend(self.places.iter().map(|place| place.of(joint)));
        }
    }

    fn standstill(&self, still: &[bool], len: usize) -> Vec<bool> {
        let joints = still.chunks_exact(len);
        joints
            .flat_map(|joint| self.nearest.iter().map(|&i| joint[i]))
            .collect()
    }
}

/// Visits logged samples of a segment.
pub(super) fn visit(
    source: &mut dyn Source,
    (slice, form): (&Slice, Form),
    segment: &Segment,
    dof: usize,
    visit: &mut dyn FnMut(&RowBlock<'_>) -> Result<()>,
) -> Result<()> {
    let (time, input_rows, tau) = match &segment.logged {
        Some(logged) => (&logged.time, &logged.input_rows, &logged.tau),
        None => (&segment.time, &segment.input_rows, &segment.tau),
    };
    let total = time.len();
    let mut stretch = Stretch::new(dof);
    let mut from = slice.rows.start;
    while from < slice.rows.end {
        let len = MAX_BLOCK.min(slice.rows.end - from);
        let still = load(&mut stretch, segment, from..from + len);
        let stride = match form {
            Form::Columns => len,
            Form::Parts => PARTS_APART,
        };
        match form {
            Form::Columns => stretch.evaluate(source),
            Form::Parts => stretch.evaluate_parts(source, stride),
        }
        let joints = (0..dof)
            .map(|joint| JointRows {
                columns: source.columns(joint),
                recipes: form.recipes(source, joint),
                stride,
                x: &stretch.values[joint],
                measured: if tau.is_empty() {
                    &[]
                } else {
                    &tau[joint * total + from..][..len]
                },
                nominal: &stretch.nominal[joint * len..(joint + 1) * len],
                products: stretch.products(joint),
                standstill: &still[joint * len..(joint + 1) * len],
            })
            .collect();
        visit(&RowBlock {
            segment: slice.segment,
            first: from == 0,
            len,
            time: &time[from..from + len],
            input_rows: &input_rows[from..from + len],
            q: &stretch.q,
            qd: &stretch.qd,
            qdd: &stretch.qdd,
            joints,
        })?;
        from += len;
    }
    Ok(())
}

/// Loads the motion of logged samples of a segment; whether each joint stands still there.
fn load(stretch: &mut Stretch, segment: &Segment, rows: Range<usize>) -> Vec<bool> {
    let samples = segment.time.len();
    if let Some(logged) = &segment.logged {
        let at = AtStamps::new(segment, &logged.time[rows.clone()]);
        stretch.len = rows.len();
        for (to, values) in stretch.channels().into_iter().zip(channels(segment)) {
            at.of(values, samples, to);
        }
        return at.standstill(&segment.standstill, samples);
    }
    stretch.load(rows.start, rows.len(), samples, channels(segment));
    let joints = segment.standstill.chunks_exact(samples);
    joints
        .flat_map(|joint| &joint[rows.clone()])
        .copied()
        .collect()
}
