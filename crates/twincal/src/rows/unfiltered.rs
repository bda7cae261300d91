//! Rows as logged: for the pipeline off, for raw validation and for predictions.

use super::evaluate::{Source, Stretch};
use super::{JointRows, MAX_BLOCK, RowBlock, Slice};
use crate::error::Result;
use crate::signal::Segment;
use crate::signal::spline::resample;

/// The samples of a segment at the stamps of the log.
struct AtStamps {
    motion: [Vec<f64>; 3],
    standstill: Vec<bool>,
}

/// An uneven log's motion at its own stamps: the filtered motion on the even grid, interpolated. The filter leaves
/// nothing above f_q, so the spline's error is far below that of the filter.
fn at_stamps(segment: &Segment, stamps: &[f64], dof: usize) -> AtStamps {
    let len = segment.time.len();
    let interpolate = |values: &[f64]| -> Vec<f64> {
        if len < 4 {
            // Too few for a spline: the nearest sample.
            return values
                .chunks_exact(len)
                .flat_map(|joint| stamps.iter().map(|&t| joint[nearest(segment, t)]))
                .collect();
        }
        values
            .chunks_exact(len)
            .flat_map(|joint| resample(&segment.time, joint, stamps))
            .collect()
    };
    AtStamps {
        motion: [
            interpolate(&segment.q),
            interpolate(&segment.qd),
            interpolate(&segment.qdd),
        ],
        standstill: (0..dof)
            .flat_map(|joint| {
                stamps
                    .iter()
                    .map(move |&t| segment.standstill[joint * len + nearest(segment, t)])
            })
            .collect(),
    }
}

/// Grid sample nearest to time `t`.
fn nearest(segment: &Segment, t: f64) -> usize {
    let steps = ((t - segment.time[0]) / segment.interval).round();
    (steps.max(0.0) as usize).min(segment.time.len() - 1)
}

/// Visits logged samples of a segment.
pub(super) fn visit(
    source: &mut dyn Source,
    slice: &Slice,
    segment: &Segment,
    dof: usize,
    visit: &mut dyn FnMut(&RowBlock<'_>) -> Result<()>,
) -> Result<()> {
    let stamped = segment
        .logged
        .as_ref()
        .map(|logged| at_stamps(segment, &logged.time, dof));
    let (time, input_rows, tau) = match &segment.logged {
        Some(logged) => (&logged.time, &logged.input_rows, &logged.tau),
        None => (&segment.time, &segment.input_rows, &segment.tau),
    };
    let (motion, still) = match &stamped {
        Some(s) => ([&s.motion[0], &s.motion[1], &s.motion[2]], &s.standstill),
        None => ([&segment.q, &segment.qd, &segment.qdd], &segment.standstill),
    };
    let total = time.len();
    let mut stretch = Stretch::new(dof);
    let mut from = slice.rows.start;
    while from < slice.rows.end {
        let len = MAX_BLOCK.min(slice.rows.end - from);
        stretch.load(from, len, total, motion.map(Vec::as_slice));
        stretch.evaluate(source);
        let joints = (0..dof)
            .map(|joint| {
                let rows = joint * total + from..joint * total + from + len;
                JointRows {
                    columns: source.columns(joint),
                    stride: len,
                    x: &stretch.values[joint],
                    measured: if tau.is_empty() {
                        &[]
                    } else {
                        &tau[rows.clone()]
                    },
                    nominal: &stretch.nominal[joint * len..(joint + 1) * len],
                    standstill: &still[rows],
                }
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
