//! The columns of a joint's rows, piece by piece: all at once where they are in memory, blocks of rows where they were put away.

use super::JointObservations;
use super::products::Columns;
use crate::error::Result;
use crate::rows::MAX_BLOCK;
use crate::signal::Shelf;
use std::ops::Range;
use std::sync::Arc;

/// Columns that were put away, block by block.
#[derive(Debug, Clone)]
pub(crate) struct Shelved {
    shelf: Arc<dyn Shelf>,
    blocks: Vec<Block>,
    /// Columns of each block.
    stored: usize,
    /// Those of them that are still asked for, ascending.
    kept: Vec<usize>,
}

/// Consecutive rows, column by column.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Block {
    rows: Range<usize>,
    place: u64,
}

impl PartialEq for Shelved {
    /// The same numbers at the same places.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.shelf, &other.shelf)
            && (&self.blocks, &self.kept) == (&other.blocks, &other.kept)
    }
}

impl Shelved {
    pub(super) fn new(shelf: Arc<dyn Shelf>, columns: usize) -> Self {
        Self {
            shelf,
            blocks: Vec::new(),
            stored: columns,
            kept: (0..columns).collect(),
        }
    }

    /// Puts `len` rows behind those before; column i is `x[i * len ..]`.
    ///
    /// # Errors
    /// Those of [`Shelf::put`].
    pub(super) fn append(&mut self, x: &[f64], len: usize) -> Result<()> {
        let first = self.blocks.last().map_or(0, |block| block.rows.end);
        let mut numbers = Vec::with_capacity(self.stored * MAX_BLOCK);
        for from in (0..len).step_by(MAX_BLOCK) {
            let to = len.min(from + MAX_BLOCK);
            numbers.clear();
            for column in x.chunks_exact(len) {
                numbers.extend_from_slice(&column[from..to]);
            }
            self.blocks.push(Block {
                rows: first + from..first + to,
                place: self.shelf.put(&numbers)?,
            });
        }
        Ok(())
    }

    /// Asks for these of the columns from now on, by their present order.
    pub(super) fn keep(&mut self, kept: &[usize]) {
        self.kept = kept.iter().map(|&i| self.kept[i]).collect();
    }

    fn visit(&self, range: Range<usize>, visit: &mut dyn FnMut(Range<usize>, Columns<'_>)) {
        let first = self
            .blocks
            .partition_point(|block| block.rows.end <= range.start);
        let mut numbers = Vec::new();
        for block in self.blocks[first..]
            .iter()
            .take_while(|block| block.rows.start < range.end)
        {
            let len = block.rows.len();
            numbers.resize(self.stored * len, 0.0);
            self.shelf.get(block.place, 0, &mut numbers);
            if self.kept.len() < self.stored {
                for (to, from) in self.kept.iter().enumerate() {
                    numbers.copy_within(from * len..(from + 1) * len, to * len);
                }
            }
            let rows = range.start.max(block.rows.start)..range.end.min(block.rows.end);
            let columns = Columns {
                x: numbers
                    .get(rows.start - block.rows.start..)
                    .unwrap_or_default(),
                stride: len,
            };
            visit(rows, columns);
        }
    }
}

impl JointObservations {
    /// Visits the columns of some of the `len` rows in order: which rows, and their columns.
    pub(crate) fn visit_columns(
        &self,
        len: usize,
        range: Range<usize>,
        visit: &mut dyn FnMut(Range<usize>, Columns<'_>),
    ) {
        let Some(recipes) = &self.recipes else {
            return self.visit_signals(len, range, visit);
        };
        let mut made = Vec::new();
        self.visit_signals(len, range, &mut |rows, parts| {
            for from in rows.clone().step_by(MAX_BLOCK) {
                let to = rows.end.min(from + MAX_BLOCK);
                let x = parts.x.get(from - rows.start..).unwrap_or_default();
                recipes.combine(x, parts.stride, to - from, &mut made);
                let columns = Columns {
                    x: &made,
                    stride: to - from,
                };
                visit(from..to, columns);
            }
        });
    }

    /// Visits what the columns of some of the `len` rows are made of, in order: which rows, and their signals.
    pub(crate) fn visit_signals(
        &self,
        len: usize,
        range: Range<usize>,
        visit: &mut dyn FnMut(Range<usize>, Columns<'_>),
    ) {
        if range.is_empty() {
            return;
        }
        match &self.shelved {
            Some(shelved) => shelved.visit(range, visit),
            None => {
                let x = self.x.get(range.start..).unwrap_or_default();
                visit(range, Columns { x, stride: len });
            }
        }
    }

    /// The first row behind `row` that is not in memory together with it; `len` rows in all.
    pub(super) fn together_until(&self, row: usize, len: usize) -> usize {
        let Some(shelved) = &self.shelved else {
            return len;
        };
        let block = shelved
            .blocks
            .partition_point(|block| block.rows.end <= row);
        shelved
            .blocks
            .get(block)
            .map_or(len, |block| block.rows.end)
    }
}
