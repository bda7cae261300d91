//! From rows to statistics: samples are gathered into small column-contiguous buffers and multiplied there.

use super::buffer::{BLOCK, Buffer};
use super::products::Products;
use super::{JointGram, Symmetric};
use crate::lanes::LANES;
use pulp::{Simd, WithSimd};

/// What a part of a log must know of the part before it: the last row of a run that is still open.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OpenRun {
    /// `[columns, y]` of the last row; `None` between runs.
    last_row: Option<Vec<f64>>,
}

/// Adds up the statistics of one joint from blocks of rows of any size.
///
/// The answer does not depend, not even in the last bit, on how the rows were divided into blocks.
#[derive(Debug)]
pub struct JointAccumulator {
    gram: JointGram,
    arch: pulp::Arch,
    /// Rows and their first differences.
    rows: Buffer,
    steps: Buffer,
    /// Rows waiting in the buffers.
    waiting: usize,
    /// Those of them that start a run.
    starts: Vec<usize>,
    s0: Products,
    d: Products,
    run: OpenRun,
}

impl JointAccumulator {
    /// For the given library columns (ascending), between runs.
    pub fn new(columns: Vec<u32>) -> Self {
        Self::resume(columns, OpenRun::default())
    }

    /// Goes on where [`JointAccumulator::cut`] stopped.
    pub fn resume(columns: Vec<u32>, run: OpenRun) -> Self {
        let width = columns.len() + 1;
        Self {
            gram: JointGram::empty(columns),
            arch: pulp::Arch::new(),
            rows: Buffer::new(width),
            steps: Buffer::new(width),
            waiting: 0,
            starts: Vec::new(),
            s0: Products::new(width),
            d: Products::new(width),
            run,
        }
    }

    /// Adds `y.len()` consecutive rows.
    ///
    /// | value | shape | meaning |
    /// |---|---|---|
    /// | `x` | columns × `stride` | row r of column i is `x[i * stride + r]`, N·m per unit of β |
    /// | `y` | rows | residual torque, N·m |
    /// | `keep` | rows | false: the row is left out and ends the run (standstill) |
    /// | `first` | | true: the first row starts a new segment |
    ///
    /// # Panics
    /// If the lengths do not fit together.
    pub fn push_block(&mut self, x: &[f64], stride: usize, y: &[f64], keep: &[bool], first: bool) {
        let (width, len) = (self.gram.columns.len(), y.len());
        assert_eq!(keep.len(), len, "one flag per row");
        assert!(
            width == 0 || len == 0 || x.len() >= (width - 1) * stride + len,
            "{width} columns of {len} rows"
        );
        if first {
            self.end_run();
        }
        let mut row = 0;
        while row < len {
            if !keep[row] {
                self.end_run();
                row += 1;
                continue;
            }
            let kept = keep[row..].iter().take_while(|&&k| k).count();
            let count = kept.min(BLOCK - self.waiting);
            self.push_run(x, stride, y, row, count);
            row += count;
        }
    }

    /// `count` rows of one run that fit into the buffers.
    fn push_run(&mut self, x: &[f64], stride: usize, y: &[f64], row: usize, count: usize) {
        let width = self.gram.columns.len();
        let starts = self.run.last_row.is_none();
        let last = self
            .run
            .last_row
            .get_or_insert_with(|| vec![0.0; width + 1]);
        for i in 0..=width {
            let column = if i < width {
                &x[i * stride + row..][..count]
            } else {
                &y[row..row + count]
            };
            if self.waiting == 0 {
                *self.rows.before_mut(i) = last[i];
            }
            self.rows.column_mut(i)[self.waiting..][..count].copy_from_slice(column);
            if starts {
                last[i] = column[0];
            }
        }
        if starts {
            self.starts.push(self.waiting);
            self.gram.starts += 1.0;
            self.gram.first.add_outer(last);
        }
        for i in 0..=width {
            last[i] = if i < width {
                x[i * stride + row + count - 1]
            } else {
                y[row + count - 1]
            };
        }
        self.gram.n += count as f64;
        self.waiting += count;
        if self.waiting == BLOCK {
            self.flush();
        }
    }

    fn flush(&mut self) {
        if self.waiting == 0 {
            return;
        }
        // Whole vectors: what is missing of the last one counts as zero.
        let samples = self.waiting.next_multiple_of(LANES);
        let width = self.gram.columns.len() + 1;
        for i in 0..width {
            self.rows.column_mut(i)[self.waiting..samples].fill(0.0);
        }
        self.arch.dispatch(Differences {
            rows: &self.rows,
            steps: &mut self.steps,
            width,
            samples: self.waiting,
        });
        for i in 0..width {
            let steps = self.steps.column_mut(i);
            steps[self.waiting..samples].fill(0.0);
            // The first row of a run has no predecessor: its difference is none, not its distance from another run.
            for &start in &self.starts {
                steps[start] = 0.0;
            }
        }
        self.s0.add(self.arch, &self.rows, samples);
        self.d.add(self.arch, &self.steps, samples);
        self.starts.clear();
        self.waiting = 0;
    }

    fn end_run(&mut self) {
        if let Some(last) = self.run.last_row.take() {
            self.gram.last.add_outer(&last);
        }
    }

    /// The statistics of all rows; an open run ends here.
    pub fn finish(mut self) -> JointGram {
        self.end_run();
        self.cut().0
    }

    /// The statistics so far, and what the next part needs so that the sum of both is that of the uncut log: a run that
    /// is still open is counted as started here and as ended in the part that ends it.
    pub fn cut(mut self) -> (JointGram, OpenRun) {
        self.flush();
        let size = self.gram.columns.len() + 1;
        self.gram.s0 = Symmetric {
            size,
            values: self.s0.into_matrix(),
        };
        self.gram.d = Symmetric {
            size,
            values: self.d.into_matrix(),
        };
        (self.gram, self.run)
    }
}

/// Writes the first differences of all columns.
struct Differences<'a> {
    rows: &'a Buffer,
    steps: &'a mut Buffer,
    width: usize,
    samples: usize,
}

impl WithSimd for Differences<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for i in 0..self.width {
            let rows = &self.rows.with_before(i)[..=self.samples];
            let steps = &mut self.steps.column_mut(i)[..self.samples];
            for (k, step) in steps.iter_mut().enumerate() {
                *step = rows[k + 1] - rows[k];
            }
        }
    }
}
