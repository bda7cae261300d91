//! Parts of a log: rows in the order of their stamps, and several parts on the stamps of the slowest.

use super::joint_state::Doubles;
use crate::error::{Error, Place, Result};
use crate::log::Cells;
use crate::log::cells::chapter_rows;
use crate::memory;
use std::collections::BTreeSet;
use twincal::robot::{JointKind, Robot};
use twincal::{Finding, Severity};

/// Neighbours further apart than this many median steps are not joined by a line.
const GAP: f64 = 5.0;
/// Least share of the slowest part's rows that the others have to cover.
const COVERED: f64 = 0.5;

/// Lists of a part: position, velocity, effort, acceleration (which only mapped topics have).
pub(super) const LISTS: usize = 4;

/// Messages of one topic that name the same joints.
#[derive(Debug, Default)]
pub(super) struct Part {
    /// Moving joints of the model.
    pub(super) joints: Vec<usize>,
    /// Whether position, velocity, effort, acceleration are there.
    pub(super) has: [bool; LISTS],
    /// Of a mapped topic: which joint has which list, `[columns]` says.
    pub(super) mapped: bool,
    /// `header.stamp`, ns.
    pub(super) stamps: Vec<i64>,
    /// [`LISTS`] per joint; empty where not there.
    columns: Vec<Vec<f64>>,
    /// First row behind the last step back of the clock.
    floor: usize,
    /// Rows before these, of a long log.
    earlier: Option<Earlier>,
}

/// Rows that no late message can be put before: time in seconds, and the columns.
#[derive(Debug)]
struct Earlier {
    cells: Cells,
    /// Which of the part's columns they are, in the order of a table: position, velocity, acceleration, effort of joint by joint.
    columns: Vec<usize>,
}

/// Rows that a part of a long log keeps room for.
const KEPT: usize = 1 << 17;

/// Order of a joint's lists in a table.
pub(super) const IN_TABLES: [usize; LISTS] = [0, 1, 3, 2];

fn seconds(stamps: &[i64]) -> impl Iterator<Item = f64> {
    stamps.iter().map(|&ns| ns as f64 / 1e9)
}

/// Where a message goes.
pub(super) struct Placed {
    pub(super) at: usize,
    /// ns behind the latest before it, if it came late.
    pub(super) lateness: Option<i64>,
}

impl Part {
    pub(super) fn new(joints: Vec<usize>, [q, qd, tau]: [bool; 3]) -> Self {
        Self {
            columns: vec![Vec::new(); LISTS * joints.len()],
            joints,
            has: [q, qd, tau, false],
            ..Self::default()
        }
    }

    /// Of a mapped topic, with these lists of one joint or another.
    pub(super) fn mapped(joints: Vec<usize>, has: [bool; LISTS]) -> Self {
        Self {
            columns: vec![Vec::new(); LISTS * joints.len()],
            joints,
            has,
            mapped: true,
            ..Self::default()
        }
    }

    /// Memory of the rows while they grow, bytes.
    pub(super) fn bytes(&self) -> u64 {
        let lists = self.has.iter().filter(|has| **has).count();
        (self.stamps.len() * (self.joints.len() * lists + 1)) as u64 * 8 * 3
    }

    /// The row of a message: the end, or further up if it came late by at most `within` and `messages`.
    #[inline]
    pub(super) fn place(&mut self, stamp: i64, within: i64, messages: usize) -> Placed {
        let len = self.stamps.len();
        let end = Placed {
            at: len,
            lateness: None,
        };
        let Some(&last) = self.stamps.last().filter(|last| **last > stamp) else {
            return end;
        };
        let lateness = last.saturating_sub(stamp);
        let lowest = self.floor.max(len.saturating_sub(messages));
        let back = self.stamps[lowest..].iter().rev();
        let at = len - back.take_while(|earlier| **earlier > stamp).count();
        let fits = at > lowest || lowest == self.floor;
        if lateness > within || !fits {
            self.floor = len;
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
        let end = at == self.stamps.len();
        if end {
            self.stamps.push(stamp);
        } else {
            self.stamps.insert(at, stamp);
        }
        for (columns, &entry) in self.columns.chunks_exact_mut(LISTS).zip(entries) {
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
        self.stamps.insert(at, stamp);
        for (column, value) in values {
            self.columns[column].insert(at, value);
        }
    }

    /// Which of the columns a joint's list is.
    pub(super) fn column(&self, joint: usize, list: usize) -> Option<usize> {
        let at = self.joints.iter().position(|j| *j == joint)?;
        Some(LISTS * at + list)
    }

    /// Moves rows of a long log to where they may leave memory, but for the last ones: `late` messages may still be put before these.
    ///
    /// # Errors
    /// Those of [`Cells::settle`].
    pub(super) fn settle(&mut self, file: &str, late: usize) -> Result<()> {
        let rows = self.stamps.len();
        let earlier = match &mut self.earlier {
            Some(earlier) => earlier,
            none => {
                let columns: Vec<usize> = (0..self.joints.len())
                    .flat_map(|joint| IN_TABLES.map(|list| LISTS * joint + list))
                    .filter(|column| !self.columns[*column].is_empty())
                    .collect();
                if !Cells::is_long(rows, columns.len() + 1) {
                    return Ok(());
                }
                none.insert(Earlier {
                    cells: Cells::on_disk(file, columns.len() + 1)?,
                    columns,
                })
            }
        };
        // Twice as many stay, so that the first of them is never the first row of the log.
        let moved = rows.saturating_sub(2 * late);
        let mut left = moved;
        while left > 0 {
            // Chapter by chapter: all at once they would be in memory twice.
            let piece = left.min(chapter_rows(earlier.columns.len() + 1));
            earlier.take(&mut self.stamps, &mut self.columns, piece);
            earlier.cells.settle(file)?;
            left -= piece;
        }
        for column in &mut self.columns {
            column.shrink_to(KEPT);
        }
        self.floor = self.floor.saturating_sub(moved);
        Ok(())
    }

    /// All rows, in memory or not.
    pub(super) fn rows(&self) -> usize {
        let earlier = self.earlier.as_ref();
        earlier.map_or(0, |earlier| earlier.cells.rows()) + self.stamps.len()
    }

    /// Whether rows have left memory.
    pub(super) fn is_long(&self) -> bool {
        self.earlier.is_some()
    }

    /// All rows of a part that [`Part::is_long`] as a table: time, then the columns that are there, joint by joint.
    pub(super) fn table(&mut self) -> Option<Cells> {
        let mut earlier = self.earlier.take()?;
        let rows = self.stamps.len();
        earlier.take(&mut self.stamps, &mut self.columns, rows);
        Some(earlier.cells)
    }

    fn median_step(&self) -> f64 {
        let mut steps: Vec<i64> = self.stamps.windows(2).map(|w| w[1] - w[0]).collect();
        if steps.is_empty() {
            return f64::INFINITY;
        }
        let middle = steps.len() / 2;
        *steps.select_nth_unstable(middle).1 as f64
    }

    /// Values of a column at `stamps`, linear between neighbours; NaN outside and in gaps. Angles that jump by more than half a turn
    /// between neighbours (a wrap) take the nearer one.
    fn at(&self, column: usize, is_angle: bool, stamps: &[i64], gap: f64) -> Vec<f64> {
        let values = &self.columns[column];
        let mut next = 0;
        stamps
            .iter()
            .map(|&stamp| {
                while next < self.stamps.len() && self.stamps[next] < stamp {
                    next += 1;
                }
                let Some(&right) = self.stamps.get(next) else {
                    return f64::NAN;
                };
                if right == stamp {
                    return values[next];
                }
                let Some(&left) = next.checked_sub(1).and_then(|left| self.stamps.get(left)) else {
                    return f64::NAN;
                };
                let step = (right - left) as f64;
                if step > gap {
                    return f64::NAN;
                }
                let share = (stamp - left) as f64 / step;
                let (a, b) = (values[next - 1], values[next]);
                if is_angle && (b - a).abs() > std::f64::consts::PI {
                    return if share < 0.5 { a } else { b };
                }
                a + share * (b - a)
            })
            .collect()
    }
}

impl Earlier {
    /// Takes the first `count` rows of a part.
    fn take(&mut self, stamps: &mut Vec<i64>, columns: &mut [Vec<f64>], count: usize) {
        let (time, values) = self.cells.columns.split_at_mut(1);
        time[0].extend(seconds(&stamps[..count]));
        stamps.drain(..count);
        for (to, &from) in values.iter_mut().zip(&self.columns) {
            to.extend(columns[from].drain(..count));
        }
    }
}

/// Position, velocity, effort and acceleration of each joint.
pub(super) type Columns = Vec<[Option<Vec<f64>>; LISTS]>;

/// Columns as they stand in a table, time first, and which of each joint's lists are there.
pub(super) fn in_table(time: Vec<f64>, columns: Columns) -> (Cells, Vec<[bool; LISTS]>) {
    let there = columns
        .iter()
        .map(|lists| lists.each_ref().map(Option::is_some))
        .collect();
    let mut cells = Cells::new(0, false);
    cells.columns.push(time);
    for mut lists in columns {
        cells
            .columns
            .extend(IN_TABLES.into_iter().filter_map(|list| lists[list].take()));
    }
    (cells, there)
}

/// Time in seconds and the columns of each joint, all on the stamps of the slowest part that is used.
pub(super) fn merge<'t>(
    file: &str,
    parts: &mut [Part],
    chosen: &[[Option<usize>; LISTS]],
    topic: impl Fn(usize) -> &'t str,
    robot: &Robot,
    findings: &mut Vec<Finding>,
) -> Result<(Vec<f64>, Columns)> {
    let used: BTreeSet<usize> = chosen.iter().flatten().flatten().copied().collect();
    let slowest = used
        .iter()
        .copied()
        .min_by_key(|&part| parts[part].stamps.len());
    let slowest = slowest.unwrap_or(0);
    if used.len() <= 1 {
        let part = &mut parts[slowest];
        let columns = (chosen.iter().enumerate())
            .map(|(joint, lists)| {
                std::array::from_fn(|list| {
                    let column = lists[list].and_then(|_| part.column(joint, list))?;
                    Some(std::mem::take(&mut part.columns[column]))
                })
            })
            .collect();
        return Ok((seconds(&part.stamps).collect(), columns));
    }
    let names = robot.joint_names();
    let describe = |part: usize| {
        let joints: Vec<&str> = parts[part].joints.iter().map(|&j| names[j]).collect();
        format!(
            "`{}` of `{}` ({} messages, every {:.3} ms)",
            joints.join("`, `"),
            topic(part),
            parts[part].stamps.len(),
            parts[part].median_step() / 1e6
        )
    };
    if let Some(&back) = used.iter().find(|&&part| parts[part].floor > 0) {
        return Err(Error::content(
            Place::file(file),
            format!(
                "time of {} steps back, so its joints cannot be brought together with the others",
                describe(back)
            ),
            "cut the log where the clock was set, or publish all joints in one message",
        ));
    }
    let bytes: u64 = used.iter().map(|&part| parts[part].bytes()).sum();
    memory::require(file, bytes, "read a shorter log")?;
    let stamps = parts[slowest].stamps.clone();
    let gaps: Vec<f64> = parts.iter().map(|part| GAP * part.median_step()).collect();
    let columns: Columns = (chosen.iter().enumerate())
        .map(|(joint, lists)| {
            let is_angle = robot.joint_kind(joint) != JointKind::Prismatic;
            std::array::from_fn(|list| {
                let part = lists[list]?;
                let column = parts[part].column(joint, list)?;
                if part == slowest {
                    return Some(parts[part].columns[column].clone());
                }
                Some(parts[part].at(column, list == 0 && is_angle, &stamps, gaps[part]))
            })
        })
        .collect();
    let outside = |row: usize| {
        let row = columns.iter().flatten().flatten().map(|column| column[row]);
        row.into_iter().any(f64::is_nan)
    };
    let lost = (0..stamps.len()).filter(|&row| outside(row)).count();
    let list: Vec<String> = used
        .iter()
        .filter(|&&part| part != slowest)
        .map(|&part| describe(part))
        .collect();
    if (lost as f64) > (1.0 - COVERED) * stamps.len() as f64 {
        return Err(Error::content(
            Place::file(file),
            format!(
                "joints or channels come in messages of their own that hardly overlap in time: {lost} of {} stamps of {} have no values of {}",
                stamps.len(),
                describe(slowest),
                list.join(" and ")
            ),
            "check the publishers' clocks, or fix joints that do not move with [model] locked",
        ));
    }
    let message = format!(
        "joints or channels come in messages of their own: {} brought to the stamps of {} by linear interpolation; {lost} of {} rows lie outside or in gaps and are NaN",
        list.join(" and "),
        describe(slowest),
        stamps.len()
    );
    findings.push(Finding::new(
        Severity::Warning,
        "parts_merged",
        file,
        message,
        lost as u64,
    ));
    Ok((seconds(&stamps).collect(), columns))
}
