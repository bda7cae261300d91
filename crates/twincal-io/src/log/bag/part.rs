//! Rows of a part of a log, in the order of their stamps: in memory, and on disk where they are many.

use super::joint_state::Doubles;
use crate::error::{Error, Result};
use crate::log::Cells;
use crate::log::cells::{Chapter, Spilled, chapter_rows};
use crate::log::stamps;
use std::borrow::Cow;
use std::io;

/// Lists of a part: position, velocity, effort, acceleration (which only mapped topics have).
pub(super) const LISTS: usize = 4;
/// Order of a joint's lists in a table.
pub(super) const IN_TABLES: [usize; LISTS] = [0, 1, 3, 2];
/// Rows that a part of a long log keeps room for.
const KEPT: usize = 1 << 17;

/// Messages of one topic that name the same joints.
#[derive(Debug, Default)]
pub(super) struct Part {
    /// Moving joints of the model.
    pub(super) joints: Vec<usize>,
    /// Whether position, velocity, effort, acceleration are there.
    pub(super) has: [bool; LISTS],
    /// Of a mapped topic: which joint has which list, `[columns]` says.
    pub(super) mapped: bool,
    /// Rows in memory: all of them, or the last ones of a long log.
    rows: Rows,
    /// First row behind the last step back of the clock.
    floor: usize,
    /// Whether the clock stepped back.
    pub(super) steps_back: bool,
    /// Rows before these, of a long log.
    earlier: Option<Earlier>,
}

/// Consecutive rows of a part.
#[derive(Debug, Clone, Default)]
pub(super) struct Rows {
    /// `header.stamp`, ns.
    pub(super) stamps: Vec<i64>,
    /// [`LISTS`] per joint; empty where not there.
    pub(super) columns: Vec<Vec<f64>>,
}

/// Rows that no late message can be put before: time in ns from an origin, and the columns.
#[derive(Debug)]
struct Earlier {
    cells: Cells,
    /// Which of the part's columns they are, in the order of a table: position, velocity, acceleration, effort of joint by joint.
    columns: Vec<usize>,
}

/// Where a message goes.
pub(super) struct Placed {
    pub(super) at: usize,
    /// ns behind the latest before it, if it came late.
    pub(super) lateness: Option<i64>,
}

impl Part {
    pub(super) fn new(joints: Vec<usize>, [q, qd, tau]: [bool; 3]) -> Self {
        Self::with(joints, [q, qd, tau, false])
    }

    /// Of a mapped topic, with these lists of one joint or another.
    pub(super) fn mapped(joints: Vec<usize>, has: [bool; LISTS]) -> Self {
        Self {
            mapped: true,
            ..Self::with(joints, has)
        }
    }

    fn with(joints: Vec<usize>, has: [bool; LISTS]) -> Self {
        Self {
            rows: Rows {
                stamps: Vec::new(),
                columns: vec![Vec::new(); LISTS * joints.len()],
            },
            joints,
            has,
            ..Self::default()
        }
    }

    /// Memory of the rows while they grow, bytes.
    pub(super) fn bytes(&self) -> u64 {
        (self.rows.stamps.len() * self.width()) as u64 * 8 * 3
    }

    /// Numbers of a row, its stamp one of them.
    pub(super) fn width(&self) -> usize {
        let lists = self.has.iter().filter(|has| **has).count();
        self.joints.len() * lists + 1
    }

    /// The row of a message: the end, or further up if it came late by at most `within` and `messages`.
    #[inline]
    pub(super) fn place(&mut self, stamp: i64, within: i64, messages: usize) -> Placed {
        let stamps = &self.rows.stamps;
        let len = stamps.len();
        let end = Placed {
            at: len,
            lateness: None,
        };
        let Some(&last) = stamps.last().filter(|last| **last > stamp) else {
            return end;
        };
        let lateness = last.saturating_sub(stamp);
        let lowest = self.floor.max(len.saturating_sub(messages));
        let back = stamps[lowest..].iter().rev();
        let at = len - back.take_while(|earlier| **earlier > stamp).count();
        let fits = at > lowest || lowest == self.floor;
        if lateness > within || !fits {
            self.floor = len;
            self.steps_back = true;
            return end;
        }
        Placed {
            at,
            lateness: Some(lateness),
        }
    }

    /// Adds a row.
    #[inline]
    pub(super) fn insert(
        &mut self,
        at: usize,
        stamp: i64,
        entries: &[usize],
        values: &[Doubles<'_>; 3],
    ) {
        let Rows { stamps, columns } = &mut self.rows;
        let end = at == stamps.len();
        if end {
            stamps.push(stamp);
        } else {
            stamps.insert(at, stamp);
        }
        for (columns, &entry) in columns.chunks_exact_mut(LISTS).zip(entries) {
            for ((column, list), has) in columns.iter_mut().zip(values).zip(self.has) {
                if !has {
                    continue;
                }
                let value = list.get(entry);
                if end {
                    column.push(value);
                } else {
                    column.insert(at, value);
                }
            }
        }
    }

    /// Adds a row of a mapped topic: columns and their values.
    #[inline]
    pub(super) fn insert_mapped(
        &mut self,
        at: usize,
        stamp: i64,
        values: impl Iterator<Item = (usize, f64)>,
    ) {
        self.rows.stamps.insert(at, stamp);
        for (column, value) in values {
            self.rows.columns[column].insert(at, value);
        }
    }

    /// Which of the columns a joint's list is.
    pub(super) fn column(&self, joint: usize, list: usize) -> Option<usize> {
        let at = self.joints.iter().position(|j| *j == joint)?;
        Some(LISTS * at + list)
    }

    /// Moves rows of a long log to where they may leave memory, but for the last ones: `late` messages may still be put before these.
    /// `many`: its rows are many together with those of other parts.
    ///
    /// # Errors
    /// Those of [`Cells::settle`].
    pub(super) fn settle(&mut self, file: &str, late: usize, many: bool) -> Result<()> {
        let (rows, width) = (self.rows.stamps.len(), self.width());
        let earlier = match &mut self.earlier {
            Some(earlier) => earlier,
            None if !many || rows < 2 * chapter_rows(width) => return Ok(()),
            none => none.insert(Earlier::new(file, &self.rows)?),
        };
        // Twice as many stay, so that the first of them is never the first row of the log.
        let moved = rows.saturating_sub(2 * late);
        let mut left = moved;
        while left > 0 {
            // Chapter by chapter: all at once they would be in memory twice.
            let piece = left.min(chapter_rows(earlier.columns.len() + 1));
            earlier.take(&mut self.rows, piece);
            earlier.cells.settle(file)?;
            left -= piece;
        }
        self.rows.stamps.shrink_to(KEPT);
        for column in &mut self.rows.columns {
            column.shrink_to(KEPT);
        }
        self.floor = self.floor.saturating_sub(moved);
        Ok(())
    }

    /// All rows, in memory or not.
    pub(super) fn len(&self) -> usize {
        let earlier = self.earlier.as_ref();
        earlier.map_or(0, |earlier| earlier.cells.rows()) + self.rows.stamps.len()
    }

    /// Takes all rows as a table of time and `columns`; `None` if other columns lie on disk.
    pub(super) fn take_table(&mut self, columns: &[usize]) -> Option<Cells> {
        let rows = self.rows.stamps.len();
        if let Some(earlier) = &mut self.earlier {
            if earlier.columns != columns {
                return None;
            }
            earlier.take(&mut self.rows, rows);
            return self.earlier.take().map(|earlier| earlier.cells);
        }
        let mut cells = Cells::new(0, false);
        let start = stamps::start(&self.rows.stamps);
        cells.origin = Some(start);
        let time = self.rows.stamps.iter();
        cells
            .columns
            .push(time.map(|ns| stamps::since(start, *ns)).collect());
        let lists = &mut self.rows.columns;
        let taken = columns
            .iter()
            .map(|&column| std::mem::take(&mut lists[column]));
        cells.columns.extend(taken);
        Some(cells)
    }

    /// Forgets all rows.
    pub(super) fn clear(&mut self) {
        self.rows = Rows::default();
        self.earlier = None;
    }

    /// Takes all rows, to be read block by block.
    ///
    /// # Errors
    /// [`Error::System`] where the last ones cannot be written.
    pub(super) fn take_stored(&mut self, file: &str) -> Result<Stored> {
        let Some(mut earlier) = self.earlier.take() else {
            return Ok(Stored::Memory(std::mem::take(&mut self.rows)));
        };
        let (rows, width) = (self.rows.stamps.len(), self.rows.columns.len());
        earlier.take(&mut self.rows, rows);
        let Earlier { mut cells, columns } = earlier;
        let (Some(spilled), Some(origin)) = (cells.take_spilled(file)?, cells.origin) else {
            return Err(Error::Internal {
                what: file.to_owned(),
                problem: "rows that were put on disk are not there".into(),
            });
        };
        Ok(Stored::Disk {
            chapters: spilled.chapters(),
            spilled,
            columns,
            width,
            origin,
        })
    }
}

impl Earlier {
    /// For rows that begin like these.
    fn new(file: &str, rows: &Rows) -> Result<Self> {
        let lists = 0..rows.columns.len() / LISTS;
        let columns: Vec<usize> = lists
            .flat_map(|joint| IN_TABLES.map(|list| LISTS * joint + list))
            .filter(|column| !rows.columns[*column].is_empty())
            .collect();
        let mut cells = Cells::on_disk(file, columns.len() + 1)?;
        cells.origin = Some(stamps::start(&rows.stamps));
        Ok(Self { cells, columns })
    }

    /// Takes the first `count` rows of a part.
    fn take(&mut self, rows: &mut Rows, count: usize) {
        let origin = self.cells.origin.unwrap_or(0);
        let (time, values) = self.cells.columns.split_at_mut(1);
        let taken = rows.stamps.drain(..count);
        time[0].extend(taken.map(|ns| stamps::since(origin, ns)));
        for (to, &from) in values.iter_mut().zip(&self.columns) {
            to.extend(rows.columns[from].drain(..count));
        }
    }
}

/// All rows of a part.
#[derive(Debug)]
pub(super) enum Stored {
    Memory(Rows),
    Disk {
        spilled: Spilled,
        chapters: Vec<Chapter>,
        /// Which of the part's columns stand behind the time.
        columns: Vec<usize>,
        /// Columns of the part.
        width: usize,
        /// Where its time counts from, ns.
        origin: i64,
    },
}

impl Stored {
    /// Rows.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Memory(rows) => rows.stamps.len(),
            Self::Disk { chapters, .. } => chapters.iter().map(Chapter::len).sum(),
        }
    }

    /// Blocks of consecutive rows.
    pub(super) fn blocks(&self) -> usize {
        match self {
            Self::Memory(_) => 1,
            Self::Disk { chapters, .. } => chapters.len(),
        }
    }

    /// One of them, with the columns that are `wanted` at least.
    ///
    /// # Errors
    /// Of the disk.
    pub(super) fn block(&self, at: usize, wanted: &[usize]) -> io::Result<Cow<'_, Rows>> {
        match self {
            Self::Memory(rows) => Ok(Cow::Borrowed(rows)),
            Self::Disk {
                spilled,
                chapters,
                columns,
                width,
                origin,
            } => {
                let chapter = &chapters[at];
                let time = spilled.read_column(chapter, 0)?;
                let mut rows = Rows {
                    stamps: time.iter().map(|ns| stamps::at(*origin, *ns)).collect(),
                    columns: vec![Vec::new(); *width],
                };
                for (place, column) in columns.iter().enumerate() {
                    if wanted.contains(column) {
                        rows.columns[*column] = spilled.read_column(chapter, place + 1)?;
                    }
                }
                Ok(Cow::Owned(rows))
            }
        }
    }

    /// The middle one of the steps from stamp to stamp, ns; infinite if there is none.
    ///
    /// Found digit by digit from the highest, so that memory does not depend on the number of rows.
    ///
    /// # Errors
    /// Of the disk.
    pub(super) fn median_step(&self) -> io::Result<f64> {
        const DIGIT: u32 = 16;
        let Some(steps) = self.len().checked_sub(1).filter(|steps| *steps > 0) else {
            return Ok(f64::INFINITY);
        };
        let (mut rank, mut found) = (steps / 2, 0_u64);
        for shift in (0..u64::BITS / DIGIT).rev().map(|digit| digit * DIGIT) {
            let mut counts = vec![0; 1 << DIGIT];
            let mut last = None;
            for at in 0..self.blocks() {
                for &stamp in &self.block(at, &[])?.stamps {
                    if let Some(last) = last.replace(stamp) {
                        let key = in_order(stamp.saturating_sub(last));
                        // Above the digit all that was found has to agree; nothing was before the first.
                        if key.checked_shr(shift + DIGIT).unwrap_or(0) == found {
                            counts[(key >> shift) as usize % (1 << DIGIT)] += 1;
                        }
                    }
                }
            }
            let mut digit = 0;
            while rank >= counts[digit] {
                rank -= counts[digit];
                digit += 1;
            }
            found = found << DIGIT | digit as u64;
        }
        Ok(of_order(found) as f64)
    }
}

/// A number without sign in the order of numbers with one.
fn in_order(number: i64) -> u64 {
    number as u64 ^ (1 << 63)
}

/// The number that [`in_order`] was made of.
fn of_order(key: u64) -> i64 {
    (key ^ (1 << 63)) as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_median_step_is_the_middle_of_all(stamps in prop::collection::vec(
            prop_oneof![any::<i64>(), 0..1_000_000_i64, -3..3_i64], 0..60
        )) {
            let mut steps: Vec<i64> = stamps.windows(2).map(|w| w[1].saturating_sub(w[0])).collect();
            steps.sort_unstable();
            let expected = steps.get(steps.len() / 2).map_or(f64::INFINITY, |ns| *ns as f64);
            let rows = Rows { stamps, columns: Vec::new() };
            prop_assert_eq!(Stored::Memory(rows).median_step().unwrap(), expected);
        }
    }
}
