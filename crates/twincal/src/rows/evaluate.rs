//! Columns and nominal torque of a stretch of samples.

use crate::robot::{Motion, Robot, nominal_torque};
use crate::term::{Library, Scratch};

/// Where nominal torque and columns come from.
///
/// Parts are signals whose fixed linear combinations are all columns: what is filtered, because they are fewer.
pub(super) trait Source {
    /// Structurally non-zero columns of a joint.
    fn columns(&self, joint: usize) -> &[usize];
    /// How many parts a joint has.
    fn parts(&self, joint: usize) -> usize;
    /// `nominal[joint * len + sample]`, `out[joint][i * len + sample]`.
    fn evaluate(&mut self, motion: Motion<'_>, nominal: &mut [f64], out: &mut [Vec<f64>]);
    /// `nominal[joint * len + sample]`, `out[joint][part * len + sample]`.
    fn evaluate_parts(&mut self, motion: Motion<'_>, nominal: &mut [f64], out: &mut [Vec<f64>]);
    /// `parts[part * stride + row]` to `out[i * rows + row]`.
    fn combine(&self, joint: usize, parts: &[f64], stride: usize, rows: usize, out: &mut Vec<f64>);
}

/// The columns of a library on a robot.
pub(super) struct OfLibrary<'a> {
    pub(super) robot: &'a Robot,
    pub(super) library: &'a Library,
    /// `(joint, row)` of columns that do not act in this log.
    pub(super) absent: Vec<(usize, usize)>,
    pub(super) scratch: Scratch,
}

impl Source for OfLibrary<'_> {
    fn columns(&self, joint: usize) -> &[usize] {
        self.library.columns_of_joint(joint)
    }

    fn parts(&self, joint: usize) -> usize {
        self.library.parts_of_joint(joint)
    }

    fn evaluate(&mut self, motion: Motion<'_>, nominal: &mut [f64], out: &mut [Vec<f64>]) {
        nominal_torque(self.robot, motion, nominal);
        self.library.evaluate_with(motion, out, &mut self.scratch);
        for &(joint, row) in &self.absent {
            out[joint][row * motion.len..(row + 1) * motion.len].fill(0.0);
        }
    }

    fn evaluate_parts(&mut self, motion: Motion<'_>, nominal: &mut [f64], out: &mut [Vec<f64>]) {
        nominal_torque(self.robot, motion, nominal);
        self.library.evaluate_parts(motion, out, &mut self.scratch);
    }

    fn combine(&self, joint: usize, parts: &[f64], stride: usize, rows: usize, out: &mut Vec<f64>) {
        self.library.combine_parts(joint, parts, stride, rows, out);
        for &(_, row) in self.absent.iter().filter(|absent| absent.0 == joint) {
            out[row * rows..(row + 1) * rows].fill(0.0);
        }
    }
}

/// Motion of a stretch of samples, and what was evaluated there.
#[derive(Debug, Default)]
pub(super) struct Stretch {
    /// Samples.
    pub(super) len: usize,
    /// `joint * len + sample`.
    pub(super) q: Vec<f64>,
    /// Velocity.
    pub(super) qd: Vec<f64>,
    /// Acceleration.
    pub(super) qdd: Vec<f64>,
    /// Nominal torque.
    pub(super) nominal: Vec<f64>,
    /// Columns or parts: `values[joint][i * len + sample]`.
    pub(super) values: Vec<Vec<f64>>,
}

impl Stretch {
    /// Memory for the joints of a robot.
    pub(super) fn new(dof: usize) -> Self {
        Self {
            values: vec![Vec::new(); dof],
            ..Self::default()
        }
    }

    /// Takes samples `from .. from + len` of arrays `joint * total + sample`.
    pub(super) fn load(&mut self, from: usize, len: usize, total: usize, source: [&[f64]; 3]) {
        self.len = len;
        for (to, from_all) in [&mut self.q, &mut self.qd, &mut self.qdd]
            .into_iter()
            .zip(source)
        {
            to.clear();
            for joint in from_all.chunks_exact(total) {
                to.extend_from_slice(&joint[from..from + len]);
            }
        }
    }

    /// Evaluates nominal torque and columns of the loaded motion.
    pub(super) fn evaluate(&mut self, source: &mut dyn Source) {
        let (motion, nominal, values) = self.split();
        source.evaluate(motion, nominal, values);
    }

    /// Evaluates nominal torque and parts of the loaded motion.
    pub(super) fn evaluate_parts(&mut self, source: &mut dyn Source) {
        let (motion, nominal, values) = self.split();
        source.evaluate_parts(motion, nominal, values);
    }

    fn split(&mut self) -> (Motion<'_>, &mut [f64], &mut [Vec<f64>]) {
        let len = self.len;
        self.nominal.resize(self.values.len() * len, 0.0);
        let motion = Motion {
            len,
            q: &self.q,
            qd: &self.qd,
            qdd: &self.qdd,
        };
        (motion, &mut self.nominal, &mut self.values)
    }
}
