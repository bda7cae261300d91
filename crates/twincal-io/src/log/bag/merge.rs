//! Parts of a log whose messages hold some of the joints or channels: all on the stamps of the slowest.
//!
//! Parts are read side by side, block by block, and the rows leave memory as they come where they are many.

use super::part::{IN_TABLES, LISTS, Part, Rows, Stored};
use crate::error::{Error, Place, Result};
use crate::log::Cells;
use crate::log::cells::unreadable;
use crate::log::stamps::{since, start};
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::io;
use twincal::robot::{JointKind, Robot};
use twincal::words::{listed, quoted};
use twincal::{Code, Finding, Severity};

/// Neighbours further apart than this many median steps are not joined by a line.
const GAP: f64 = 5.0;
/// Least share of the slowest part's rows that the others have to cover.
const COVERED: f64 = 0.5;
/// Share of rows without a partner that is no more than what lies at the log's ends.
const EDGES: f64 = 0.01;
/// Rows between two looks at the memory that they take.
const LOOK: usize = 1 << 12;

/// Which part each list of each joint comes from.
pub(super) type Chosen = [[Option<usize>; LISTS]];

/// A part that is gone through in the order of its stamps, and read at those of another.
struct Walk<'s> {
    stored: &'s Stored,
    /// Columns that are read.
    wanted: Vec<usize>,
    /// Neighbours further apart are not joined, ns.
    gap: f64,
    block: Cow<'s, Rows>,
    number: usize,
    /// First row of the block that is not before the stamp.
    next: usize,
    /// The row before the block: stamp and columns.
    before: Option<(i64, Vec<f64>)>,
}

impl<'s> Walk<'s> {
    fn new(stored: &'s Stored, wanted: Vec<usize>, gap: f64) -> io::Result<Self> {
        Ok(Self {
            block: stored.block(0, &wanted)?,
            stored,
            wanted,
            gap,
            number: 0,
            next: 0,
            before: None,
        })
    }

    /// Goes to the first row that is not before a stamp.
    fn to(&mut self, stamp: i64) -> io::Result<()> {
        loop {
            let left = &self.block.stamps[self.next..];
            match left.iter().position(|at| *at >= stamp) {
                Some(further) => {
                    self.next += further;
                    return Ok(());
                }
                None => self.next = self.block.stamps.len(),
            }
            if self.number + 1 == self.stored.blocks() {
                return Ok(());
            }
            if let Some(last) = self.block.stamps.len().checked_sub(1) {
                let value = |column: &Vec<f64>| column.get(last).copied().unwrap_or(f64::NAN);
                let values = self.block.columns.iter().map(value).collect();
                self.before = Some((self.block.stamps[last], values));
            }
            self.number += 1;
            self.block = self.stored.block(self.number, &self.wanted)?;
            self.next = 0;
        }
    }

    /// Value of a column at the stamp that was gone to, linear between neighbours; NaN outside and in gaps. Angles that jump by more
    /// than half a turn between neighbours (a wrap) take the nearer one.
    fn value(&self, column: usize, is_angle: bool, stamp: i64) -> f64 {
        let Rows { stamps, columns } = &*self.block;
        let Some(&right) = stamps.get(self.next) else {
            return f64::NAN;
        };
        let b = columns[column][self.next];
        if right == stamp {
            return b;
        }
        let (left, a) = match (self.next.checked_sub(1), &self.before) {
            (Some(last), _) => (stamps[last], columns[column][last]),
            (None, Some((left, values))) => (*left, values[column]),
            (None, None) => return f64::NAN,
        };
        let step = right.saturating_sub(left) as f64;
        if step > self.gap {
            return f64::NAN;
        }
        let share = stamp.saturating_sub(left) as f64 / step;
        if is_angle && (b - a).abs() > PI {
            return if share < 0.5 { a } else { b };
        }
        a + share * (b - a)
    }
}

/// A part that is used.
struct Used {
    /// Its number among all parts.
    part: usize,
    rows: Stored,
    /// Median step of its stamps, ns.
    step: f64,
}

/// Where a column of the table comes from.
struct Source {
    /// Which of the parts that are used.
    of: usize,
    column: usize,
    is_angle: bool,
}

/// Time and the chosen columns joint by joint, as they stand in a table, all on the stamps of the slowest part that is used.
///
/// # Errors
/// [`Error::Content`] for parts that hardly overlap and clocks that step back, [`Error::System`] of the disk.
pub(super) fn merge<'t>(
    file: &str,
    parts: &mut [Part],
    chosen: &Chosen,
    topic: impl Fn(usize) -> &'t str,
    robot: &Robot,
    may_spill: bool,
    findings: &mut Vec<Finding>,
) -> Result<Cells> {
    let numbers: BTreeSet<usize> = chosen.iter().flatten().flatten().copied().collect();
    let numbers: Vec<usize> = numbers.into_iter().collect();
    let sources = sources(&numbers, parts, chosen, robot);
    if let [only] = numbers[..] {
        let columns: Vec<usize> = sources.iter().map(|source| source.column).collect();
        if let Some(cells) = parts[only].take_table(&columns) {
            return Ok(cells);
        }
    }
    let used = take_used(file, &numbers, parts)?;
    parts.iter_mut().for_each(Part::clear);
    let names = robot.joint_names();
    let describe = |Used { part, rows, step }: &Used| {
        let joints: Vec<&str> = parts[*part].joints.iter().map(|&j| names[j]).collect();
        format!(
            "{} of `{}` ({} messages, every {:.3} ms)",
            quoted(&joints),
            topic(*part),
            rows.len(),
            step / 1e6
        )
    };
    let back = used.iter().find(|used| parts[used.part].steps_back);
    if let Some(back) = back.filter(|_| used.len() > 1) {
        return Err(steps_back(file, &describe(back)));
    }
    let slowest = (0..used.len()).min_by_key(|&k| used[k].rows.len());
    let slowest = slowest.unwrap_or(0);
    let rows = used[slowest].rows.len();
    let mut cells = table(file, (rows, 1 + sources.len()), may_spill)?;
    let lost = fill(&mut cells, file, &used, slowest, &sources)?;
    if used.len() > 1 {
        let others = used.iter().enumerate().filter(|(k, _)| *k != slowest);
        let others: Vec<String> = others.map(|(_, used)| describe(used)).collect();
        let merged = Merged {
            others: listed(&others, " and "),
            slowest: describe(&used[slowest]),
            lost,
            rows,
        };
        findings.push(merged.finding(file)?);
    }
    Ok(cells)
}

/// The clock of a part, in words, was set back.
fn steps_back(file: &str, part: &str) -> Error {
    Error::content(
        Place::file(file),
        format!(
            "time of {part} steps back, so its joints cannot be brought together with the others"
        ),
        "cut the log where the clock was set, or publish all joints in one message",
    )
}

/// A table in memory, or one that leaves memory as it comes where it may and is long.
fn table(file: &str, (rows, width): (usize, usize), may_spill: bool) -> Result<Cells> {
    if may_spill && Cells::is_long(rows, width) {
        return Ok(Cells::new(width, true));
    }
    Cells::reserve(file, rows, width, false)
}

/// Rows of the parts of these `numbers`.
fn take_used(file: &str, numbers: &[usize], parts: &mut [Part]) -> Result<Vec<Used>> {
    let mut used = Vec::new();
    for &part in numbers {
        let rows = parts[part].take_stored(file)?;
        let step = match numbers.len() {
            1 => f64::INFINITY,
            _ => rows.median_step().map_err(|e| unreadable(file, &e))?,
        };
        used.push(Used { part, rows, step });
    }
    Ok(used)
}

/// Parts that were brought together.
struct Merged {
    /// The parts in words, and the slowest one, whose stamps the rows have.
    others: String,
    slowest: String,
    /// Rows without a value of some part.
    lost: usize,
    rows: usize,
}

impl Merged {
    /// # Errors
    /// [`Error::Content`] where the parts hardly overlap.
    fn finding(&self, file: &str) -> Result<Finding> {
        let Self {
            others,
            slowest,
            lost,
            rows,
        } = self;
        let share = |of: f64| of * *rows as f64;
        if (*lost as f64) > share(1.0 - COVERED) {
            return Err(Error::content(
                Place::file(file),
                format!(
                    "joints or channels come in messages of their own that hardly overlap in time: {lost} of {rows} stamps of {slowest} have no values of {others}"
                ),
                "check the publishers' clocks, or fix joints that do not move with [model] locked",
            ));
        }
        let severity = if (*lost as f64) > share(EDGES) {
            Severity::Warning
        } else {
            Severity::Note
        };
        Ok(Finding::new(
            severity,
            Code::PartsMerged,
            file,
            format!(
                "joints or channels come in messages of their own: {others} brought to the stamps of {slowest} by linear interpolation; {lost} of {rows} rows lie outside or in gaps and are NaN"
            ),
            *lost as u64,
        )
        .with([("rows", *rows as f64)]))
    }
}

/// The columns of the table behind its time, from the parts of these `numbers`.
fn sources(numbers: &[usize], parts: &[Part], chosen: &Chosen, robot: &Robot) -> Vec<Source> {
    let mut sources = Vec::new();
    for (joint, lists) in chosen.iter().enumerate() {
        let turns = robot.joint_kind(joint) != JointKind::Prismatic;
        for list in IN_TABLES {
            let source = |part: usize| {
                Some(Source {
                    of: numbers.binary_search(&part).ok()?,
                    column: parts[part].column(joint, list)?,
                    is_angle: list == 0 && turns,
                })
            };
            sources.extend(lists[list].and_then(source));
        }
    }
    sources
}

/// Fills a table with the rows of the slowest part and what the others have at its stamps; how many rows lack a value.
fn fill(
    cells: &mut Cells,
    file: &str,
    used: &[Used],
    slowest: usize,
    sources: &[Source],
) -> Result<usize> {
    let of_disk = |e: io::Error| unreadable(file, &e);
    let wanted = |of: usize| -> Vec<usize> {
        let columns = sources.iter().filter(|source| source.of == of);
        columns.map(|source| source.column).collect()
    };
    // None for the slowest itself.
    let mut walks = Vec::new();
    for (of, Used { rows, step, .. }) in used.iter().enumerate() {
        let walk = || Walk::new(rows, wanted(of), GAP * step).map_err(of_disk);
        walks.push((of != slowest).then(walk).transpose()?);
    }
    let (own, wanted) = (&used[slowest].rows, wanted(slowest));
    let (mut rows, mut lost) = (0_usize, 0);
    let origin = start(&own.block(0, &[]).map_err(of_disk)?.stamps);
    cells.origin = Some(origin);
    for number in 0..own.blocks() {
        let block = own.block(number, &wanted).map_err(of_disk)?;
        for (row, &stamp) in block.stamps.iter().enumerate() {
            for walk in walks.iter_mut().flatten() {
                walk.to(stamp).map_err(of_disk)?;
            }
            let mut is_whole = true;
            cells.columns[0].push(since(origin, stamp));
            for (column, source) in cells.columns[1..].iter_mut().zip(sources) {
                let value = match &walks[source.of] {
                    Some(walk) => walk.value(source.column, source.is_angle, stamp),
                    None => block.columns[source.column][row],
                };
                is_whole &= !value.is_nan();
                column.push(value);
            }
            lost += usize::from(!is_whole);
            rows += 1;
            if rows.is_multiple_of(LOOK) {
                cells.settle(file)?;
            }
        }
    }
    Ok(lost)
}
