//! Traces for figures: long ones are thinned, and say so.

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
    /// An empty trace of `joint` in `log`.
    #[must_use]
    pub fn new(log: impl Into<String>, joint: impl Into<String>) -> Self {
        Self {
            log: log.into(),
            joint: joint.into(),
            step: 1,
            ..Self::default()
        }
    }

    /// Puts rows at the end; all of them are kept until [`Trace::thin`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn extend(&mut self, rows: &TraceRows<'_>) {
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
        self.time.extend_from_slice(rows.time);
        self.q.extend_from_slice(rows.q);
        self.qd.extend_from_slice(rows.qd);
        self.measured.extend_from_slice(rows.measured);
        self.nominal.extend_from_slice(&rows.torque.nominal);
        self.calibrated.extend_from_slice(&rows.torque.calibrated);
        self.low.extend_from_slice(&rows.torque.low);
        self.high.extend_from_slice(&rows.torque.high);
        self.pit.extend_from_slice(&rows.torque.pit);
        if rows.standstill.is_empty() {
            self.standstill.resize(self.time.len(), false);
        } else {
            self.standstill.extend_from_slice(rows.standstill);
        }
    }

    /// Keeps every `step`-th row, `step` the smallest that leaves at most [`MAX_POINTS`]; scores must be taken before.
    pub fn thin(&mut self) {
        let step = self.time.len().div_ceil(MAX_POINTS).max(1);
        if step == 1 {
            return;
        }
        let keep = |values: &mut Vec<f64>| *values = values.iter().copied().step_by(step).collect();
        for values in [
            &mut self.time,
            &mut self.q,
            &mut self.qd,
            &mut self.measured,
            &mut self.nominal,
            &mut self.calibrated,
            &mut self.low,
            &mut self.high,
            &mut self.pit,
        ] {
            keep(values);
        }
        self.standstill = self.standstill.iter().copied().step_by(step).collect();
        self.step *= step;
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
        let torque = JointTorque {
            nominal: values.clone(),
            calibrated: values.clone(),
            low: values.clone(),
            high: values.clone(),
            pit: values.clone(),
            ..JointTorque::default()
        };
        let part = TraceRows {
            time: &time,
            q: &values,
            qd: &values,
            measured: &values,
            standstill: &[],
            torque: &torque,
        };
        let mut trace = Trace::new("run.csv", "elbow");
        trace.extend(&part);
        trace.thin();
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
        let once = trace.clone();
        trace.thin();
        assert_eq!(trace, once);
    }
}
