//! Traces for figures: of long ones some rows are kept, and they say so.

use super::Trace;
use crate::twin::JointTorque;

/// Most points of one trace: what a figure can show.
pub const MAX_POINTS: usize = 2000;

/// Rows of one joint beside their prediction, as [`Trace::extend`] takes them; slices of one length.
#[derive(Debug, Clone, Copy)]
pub struct TraceRows<'a> {
    /// Row times, s.
    pub time: &'a [f64],
    /// Position, rad or m.
    pub q: &'a [f64],
    /// Velocity, rad/s or m/s.
    pub qd: &'a [f64],
    /// Measured torque, N·m.
    pub measured: &'a [f64],
    /// Standstill rows; empty if none.
    pub standstill: &'a [bool],
    /// Their prediction.
    pub torque: &'a JointTorque,
}

impl Trace {
    /// An empty trace of `joint` in `log`, which keeps every `step`-th row, `step` the smallest that leaves at most [`MAX_POINTS`] of `rows` rows.
    #[must_use]
    pub fn new(log: impl Into<String>, joint: impl Into<String>, rows: usize) -> Self {
        Self {
            log: log.into(),
            joint: joint.into(),
            step: rows.div_ceil(MAX_POINTS).max(1),
            ..Self::default()
        }
    }

    /// Takes the next rows, `seen` of the log's having been seen before.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn extend(&mut self, seen: usize, rows: &TraceRows<'_>) {
        let count = rows.torque.nominal.len();
        let lengths = [
            rows.time.len(),
            rows.q.len(),
            rows.qd.len(),
            rows.measured.len(),
        ];
        assert!(
            lengths.iter().all(|&length| length == count),
            "{lengths:?} values for {count} predicted rows"
        );
        let (step, first) = (self.step, (self.step - seen % self.step) % self.step);
        let torque = rows.torque;
        for (kept, values) in [
            (&mut self.time, rows.time),
            (&mut self.q, rows.q),
            (&mut self.qd, rows.qd),
            (&mut self.measured, rows.measured),
            (&mut self.nominal, &torque.nominal),
            (&mut self.calibrated, &torque.calibrated),
            (&mut self.low, &torque.low),
            (&mut self.high, &torque.high),
            (&mut self.pit, &torque.pit),
        ] {
            kept.extend(values.iter().skip(first).step_by(step));
        }
        let still = |row: usize| rows.standstill.get(row).copied().unwrap_or(false);
        let taken = (0..count).skip(first).step_by(step);
        self.standstill.extend(taken.map(still));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_trace_is_thinned_evenly_and_says_the_step() {
        let rows = 4001;
        let time: Vec<f64> = (0..rows).map(f64::from).collect();
        let values = vec![0.0; rows as usize];
        let torque = |len: usize| JointTorque {
            nominal: vec![0.0; len],
            calibrated: vec![0.0; len],
            low: vec![0.0; len],
            high: vec![0.0; len],
            pit: vec![0.0; len],
            ..JointTorque::default()
        };
        let mut trace = Trace::new("run.csv", "elbow", rows as usize);
        // Whatever comes together.
        for start in (0..rows as usize).step_by(1000) {
            let own = start..(start + 1000).min(rows as usize);
            let part = TraceRows {
                time: &time[own.clone()],
                q: &values[own.clone()],
                qd: &values[own.clone()],
                measured: &values[own.clone()],
                standstill: &[],
                torque: &torque(own.len()),
            };
            trace.extend(start, &part);
        }
        assert_eq!((trace.step, trace.time.len()), (3, 1334));
        assert!(trace.time.windows(2).all(|pair| pair[1] - pair[0] == 3.0));
        for length in [
            trace.pit.len(),
            trace.standstill.len(),
            trace.high.len(),
            trace.qd.len(),
        ] {
            assert_eq!(length, 1334);
        }
    }
}
