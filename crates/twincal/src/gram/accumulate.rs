//! From rows to statistics: whole blocks are multiplied where they are, single rows wait until they are a block.

use super::block::{Block, Columns, Differences, Rows, Workspace};
use super::products::Products;
use super::tiles::BLOCK;
use super::{JointGram, Symmetric};
use crate::term::Recipes;
use pulp::{Simd, WithSimd};

/// What a part of a log must know of the part before it: the last row of a run that is still open.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OpenRun {
    /// `[columns, y]`, or `[parts, y]`, of the last row; `None` between runs.
    last_row: Option<Vec<f64>>,
    /// How columns and y follow from parts and y, where these were added up.
    recipes: Option<Recipes>,
}

/// Adds up the statistics of one joint from blocks of rows of any size.
///
/// The answer does not depend, not even in the last bit, on how the rows were divided into blocks.
#[derive(Debug)]
pub struct JointAccumulator {
    gram: JointGram,
    /// How columns and y follow from what is added up, if that is not themselves.
    recipes: Option<Recipes>,
    /// Decides the order of sums, and with it their last bits.
    pub(super) arch: pulp::Arch,
    /// Rows that are not a block yet.
    held: Columns<BLOCK>,
    waiting: usize,
    /// Those of them that start a run.
    starts: Vec<usize>,
    /// The row before the first of them.
    before: Vec<f64>,
    /// Of rows and of their differences.
    sums: [Products; 2],
    run: OpenRun,
}

impl JointAccumulator {
    /// For the given library columns (ascending), between runs.
    pub fn new(columns: Vec<u32>) -> Self {
        Self::resume(columns, OpenRun::default())
    }

    /// For the given library columns, between runs, where parts are added up: what columns are made of, see [`Recipes`]. A
    /// 7-joint arm has three times fewer products of parts than of columns.
    ///
    /// # Panics
    /// If the recipes are not those of so many columns.
    pub fn of_parts(columns: Vec<u32>, recipes: &Recipes) -> Self {
        assert_eq!(columns.len(), recipes.columns(), "a recipe per column");
        Self::with(columns, Some(recipes.and_one()), OpenRun::default())
    }

    /// Goes on where [`JointAccumulator::cut`] stopped, in columns or parts as there.
    ///
    /// # Panics
    /// If parts were added up there, and those of another number of columns.
    pub fn resume(columns: Vec<u32>, run: OpenRun) -> Self {
        let recipes = run.recipes.clone();
        let fits = |own: &Recipes| own.columns() == columns.len() + 1;
        assert!(recipes.as_ref().is_none_or(fits), "a recipe per column");
        Self::with(columns, recipes, run)
    }

    fn with(columns: Vec<u32>, recipes: Option<Recipes>, run: OpenRun) -> Self {
        let width = recipes.as_ref().map_or(columns.len() + 1, Recipes::parts);
        Self {
            gram: JointGram::empty(columns),
            recipes,
            arch: pulp::Arch::new(),
            held: Columns::default(),
            waiting: 0,
            starts: Vec::new(),
            before: vec![0.0; width],
            sums: [(); 2].map(|()| Products::new(width)),
            run,
        }
    }

    /// Adds `y.len()` consecutive rows.
    ///
    /// | value | shape | meaning |
    /// |---|---|---|
    /// | `x` | columns (or parts) × `stride` | row r of column i is `x[i * stride + r]`, N·m per unit of β |
    /// | `y` | rows | residual torque, N·m |
    /// | `keep` | rows | false: the row is left out and ends the run (standstill) |
    /// | `first` | | true: the first row starts a new segment |
    /// | `workspace` | | working memory, the same for all joints |
    ///
    /// # Panics
    /// If the lengths do not fit together.
    pub fn push_block(
        &mut self,
        x: &[f64],
        stride: usize,
        y: &[f64],
        keep: &[bool],
        first: bool,
        workspace: &mut Workspace,
    ) {
        let (width, len) = (self.before.len() - 1, y.len());
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
            let most = keep[row..].len().min(BLOCK - self.waiting);
            let count = keep[row..][..most].iter().take_while(|&&k| k).count();
            let rows = Rows {
                x: x.get(row..).unwrap_or_default(),
                stride,
                y: &y[row..row + count],
            };
            self.push_run(rows, workspace);
            row += count;
        }
    }

    /// Rows of one run that are a block together with those that wait, or fewer.
    fn push_run(&mut self, rows: Rows<'_>, workspace: &mut Workspace) {
        let (width, count) = (self.before.len(), rows.y.len());
        let row = |k: usize| (0..width).map(move |i| rows.column(i, width)[k]);
        if self.run.last_row.is_none() {
            let start: Vec<f64> = row(0).collect();
            self.gram.starts += 1.0;
            let columns = self.columns_of(&start);
            self.gram
                .first
                .add_outer(columns.as_deref().unwrap_or(&start));
            self.starts.push(self.waiting);
            self.run.last_row = Some(start);
        }
        let last = self.run.last_row.get_or_insert_default();
        if self.waiting == 0 {
            self.before.copy_from_slice(last);
        }
        last.clear();
        last.extend(row(count - 1));
        self.gram.n += count as f64;
        if count == BLOCK {
            self.multiply(Some(rows), count, workspace);
            return;
        }
        let held = self.held.first(width);
        for (i, column) in held.iter_mut().enumerate() {
            column[self.waiting..][..count].copy_from_slice(rows.column(i, width));
        }
        self.waiting += count;
        if self.waiting == BLOCK {
            self.flush(workspace);
        }
    }

    /// Multiplies the rows that wait.
    fn flush(&mut self, workspace: &mut Workspace) {
        if self.waiting > 0 {
            self.multiply(None, self.waiting, workspace);
            self.waiting = 0;
        }
    }

    /// Multiplies a block of these rows, or of those that wait.
    fn multiply(&mut self, from: Option<Rows<'_>>, samples: usize, workspace: &mut Workspace) {
        let width = self.before.len();
        let rows = match from {
            Some(rows) if rows.collide() => rows.copied(workspace.rows.first(width)),
            Some(rows) => rows,
            None => {
                let held = self.held.first(width);
                (held.iter_mut()).for_each(|column| column[samples..].fill(0.0));
                Rows::of(held)
            }
        };
        self.arch.dispatch(WithTiles(Multiply {
            block: Block {
                rows,
                samples,
                before: &self.before,
                starts: &self.starts,
            },
            sums: &mut self.sums,
            steps: &mut workspace.steps,
        }));
        self.starts.clear();
    }

    fn end_run(&mut self) {
        if let Some(last) = self.run.last_row.take() {
            let columns = self.columns_of(&last);
            self.gram
                .last
                .add_outer(columns.as_deref().unwrap_or(&last));
        }
    }

    /// Columns and y of a row of parts and y.
    fn columns_of(&self, row: &[f64]) -> Option<Vec<f64>> {
        self.recipes.as_ref().map(|recipes| recipes.row(row))
    }

    /// The statistics of all rows; an open run ends here.
    pub fn finish(mut self) -> JointGram {
        self.end_run();
        self.cut().0
    }

    /// The statistics so far, and what the next part needs so that the sum of both is that of the uncut log: a run that
    /// is still open is counted as started here and as ended in the part that ends it.
    pub fn cut(mut self) -> (JointGram, OpenRun) {
        self.flush(&mut Workspace::default());
        let size = self.gram.columns.len() + 1;
        let [s0, d] = self.sums.each_ref().map(|sums| {
            let matrix = self.arch.dispatch(WithTiles(Matrix { sums }));
            match &self.recipes {
                Some(recipes) => recipes.to_columns(&matrix),
                None => matrix,
            }
        });
        self.gram.s0 = Symmetric { size, values: s0 };
        self.gram.d = Symmetric { size, values: d };
        self.run.recipes = self.recipes;
        (self.gram, self.run)
    }
}

/// Work that depends on the size of tiles.
trait Tiled {
    type Output;

    /// `T`: columns of a tile.
    fn run<S: Simd, const T: usize>(self, s: S) -> Self::Output;
}

/// Work with tiles of the size that is best for the instruction set.
struct WithTiles<W>(W);

impl<W: Tiled> WithSimd for WithTiles<W> {
    type Output = W::Output;

    /// The sums of a tile and the factors of a step fit into the registers: 25 + 6 of 32, or 9 + 6 of 16. One number at a time, a
    /// tile of 16 sums is what compilers put into vectors of their own.
    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) -> W::Output {
        if S::REGISTER_COUNT >= 32 {
            self.0.run::<S, 5>(s)
        } else if S::IS_SCALAR {
            self.0.run::<S, 4>(s)
        } else {
            self.0.run::<S, 3>(s)
        }
    }
}

/// Adds the products of a block of rows and of their differences.
struct Multiply<'a> {
    block: Block<'a>,
    sums: &'a mut [Products; 2],
    steps: &'a mut Differences,
}

impl Tiled for Multiply<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd, const T: usize>(self, s: S) {
        self.block.add_to::<S, T>(s, self.sums, self.steps);
    }
}

/// Sums as a matrix.
struct Matrix<'a> {
    sums: &'a Products,
}

impl Tiled for Matrix<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<S: Simd, const T: usize>(self, s: S) -> Vec<f64> {
        self.sums.matrix::<S, T>(s)
    }
}
