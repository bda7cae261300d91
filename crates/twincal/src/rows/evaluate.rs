//! Columns and nominal torque of a stretch of samples.

use crate::robot::Motion;

/// `evaluate(motion, nominal, out)`: `nominal[joint * len + sample]`, `out[joint][i * len + sample]`.
pub(super) type Evaluate<'a> = dyn FnMut(Motion<'_>, &mut [f64], &mut [Vec<f64>]) + 'a;

/// Which columns a joint has and how to evaluate them.
pub(super) struct Model<'c, 'e> {
    /// Structurally non-zero columns by joint.
    pub(super) columns: Vec<&'c [usize]>,
    /// The functions.
    pub(super) evaluate: &'e mut Evaluate<'e>,
}

/// Scratch memory for stretches of samples.
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
    /// Columns: `columns[joint][i * len + sample]`.
    pub(super) columns: Vec<Vec<f64>>,
}

impl Stretch {
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
    pub(super) fn evaluate(&mut self, model: &mut Model<'_, '_>) {
        let len = self.len;
        self.nominal.resize(model.columns.len() * len, 0.0);
        self.columns.resize(model.columns.len(), Vec::new());
        for (out, columns) in self.columns.iter_mut().zip(&model.columns) {
            out.resize(columns.len() * len, 0.0);
        }
        let motion = Motion {
            len,
            q: &self.q,
            qd: &self.qd,
            qdd: &self.qdd,
        };
        (model.evaluate)(motion, &mut self.nominal, &mut self.columns);
    }
}
