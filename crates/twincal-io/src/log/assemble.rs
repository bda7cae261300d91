//! From the numbers of a table to a recording: time from the file or the rate, channels per joint; of a long table chapter by chapter.

use super::cells::{Cells, Chapter, Spilled, unreadable};
use super::columns::Selection;
use super::factors;
use super::scratch::TemporaryShelf;
use super::stamps;
use super::torque::to_joint_torque;
use super::{LogOptions, Preset, Request};
use crate::error::{Error, Place, Result};
use std::borrow::Cow;
use std::sync::Arc;
use twincal::robot::Robot;
use twincal::signal::{Channels, Log, LongLog, ReadChapter, Recording};
use twincal::{Code, Finding, Severity};

/// Share of rows dropped as unreadable beyond which the log counts as degraded.
const DROPPED_LIMIT: f64 = 0.01;

/// Makes the log of a table.
///
/// # Errors
/// [`Error::Content`] for tables without rows and columns without any number, setting errors for rates and torques that make no sense.
pub(crate) fn assemble(
    request: Request<'_>,
    mut cells: Cells,
    selection: Selection,
    findings: &mut Vec<Finding>,
) -> Result<Log<'static>> {
    let (name, rows) = (request.name, cells.rows());
    factors::check(request.robot, request.options)?;
    findings.extend(selection.findings.iter().cloned());
    if rows == 0 {
        return Err(Error::content(
            Place::file(name),
            "has a header but no rows",
            "record a motion and export it again",
        ));
    }
    if cells.dropped > 0 {
        findings.push(dropped(name, rows, &mut cells));
    }
    let make = Make {
        name: name.to_owned(),
        robot: request.robot.clone(),
        options: request.options.clone(),
        scales: std::mem::take(&mut cells.scales),
        origin: cells.origin,
        selection,
        rows,
    };
    let Some(spilled) = cells.take_spilled(name)? else {
        let values = |column: usize| cells.columns[column].iter().any(|v| v.is_finite());
        refuse_empty_columns(name, rows, &make, &values)?;
        let recording = make.recording(cells.columns, 0, findings)?;
        return Ok(Log::Whole(Cow::Owned(recording)));
    };
    refuse_empty_columns(name, rows, &make, &|column| spilled.has_values(column))?;
    let chapters = spilled.chapters();
    let table = OnDisk {
        spilled,
        chapters,
        make,
    };
    let remedy = "set TMPDIR to a folder where files can be made";
    let shelf = TemporaryShelf::new(name)
        .map_err(|e| Error::system(name, "keep its numbers in a temporary file", &e, remedy))?;
    // What is assumed of one chapter is assumed of all.
    table.recording(0, findings)?;
    let samples = table.chapters.iter().map(Chapter::len).collect();
    let mut long =
        LongLog::new(request.robot, samples, Arc::new(table))?.with_shelf(Arc::new(shelf));
    name.clone_into(&mut long.name);
    long.payload = request.options.payload;
    Ok(Log::Long(long))
}

/// How columns become a recording.
#[derive(Debug)]
struct Make {
    name: String,
    robot: Robot,
    options: LogOptions,
    /// See [`Cells::scales`].
    scales: Vec<f64>,
    /// See [`Cells::origin`].
    origin: Option<i64>,
    selection: Selection,
    /// Of the whole log.
    rows: usize,
}

/// A long table.
#[derive(Debug)]
struct OnDisk {
    spilled: Spilled,
    chapters: Vec<Chapter>,
    make: Make,
}

impl OnDisk {
    fn recording(&self, chapter: usize, findings: &mut Vec<Finding>) -> Result<Recording> {
        let chapter = &self.chapters[chapter];
        let columns = (self.spilled.read(chapter)).map_err(|e| unreadable(&self.make.name, &e))?;
        self.make.recording(columns, chapter.first, findings)
    }

    /// The error as the core knows it.
    fn of_core(&self, error: Error) -> twincal::Error {
        match error {
            Error::Core(error) => error,
            error => twincal::Error::Log {
                log: self.make.name.clone(),
                problem: error.to_string(),
                remedy: "or give fewer or shorter logs".into(),
            },
        }
    }
}

impl ReadChapter for OnDisk {
    fn read(&self, chapter: usize) -> twincal::Result<Recording> {
        self.recording(chapter, &mut Vec::new())
            .map_err(|error| self.of_core(error))
    }

    fn positions(&self, chapter: usize, joint: usize) -> twincal::Result<Vec<f64>> {
        let Some(column) = self.make.selection.positions().joints[joint][0] else {
            return Ok(Vec::new());
        };
        let read = self.spilled.read_column(&self.chapters[chapter], column);
        let mut q = read.map_err(|e| self.of_core(unreadable(&self.make.name, &e)))?;
        self.make.scale(column, &mut q);
        let names = self.make.robot.joint_names();
        factors::apply_to_positions(&mut q, names[joint], &self.make.options);
        Ok(q)
    }
}

impl Make {
    /// Of consecutive rows from row `first` on.
    fn recording(
        &self,
        mut columns: Vec<Vec<f64>>,
        first: usize,
        findings: &mut Vec<Finding>,
    ) -> Result<Recording> {
        let rows = columns.first().map_or(0, Vec::len);
        for (column, values) in columns.iter_mut().enumerate() {
            self.scale(column, values);
        }
        let positions = self.selection.positions();
        let mut take = |index: Option<usize>| index.map(|i| std::mem::take(&mut columns[i]));
        let stamps = take(positions.time);
        let time = self.time(stamps, first..first + rows, findings)?;
        let joints = positions
            .joints
            .iter()
            .enumerate()
            .map(|(number, joint)| Channels {
                q: take(joint[0]).unwrap_or_default(),
                qd: take(joint[1]),
                qdd: take(joint[2]),
                tau: take(joint[3]),
                temperature: take(positions.temperatures.get(number).copied().flatten()),
            })
            .collect();
        let mut recording = Recording {
            unfolded: false,
            start_ns: self
                .origin
                .filter(|_| self.options.rate_hz.is_none())
                .unwrap_or(0),
            name: self.name.clone(),
            time,
            joints,
            payload: self.options.payload,
        };
        factors::apply(&mut recording, &self.robot, &self.options, findings);
        to_joint_torque(&mut recording, &self.robot, &self.options, findings)?;
        Ok(recording)
    }

    /// Divides the numbers of a column by its scale.
    fn scale(&self, column: usize, values: &mut [f64]) {
        let scale = self.scales.get(column).copied().unwrap_or(1.0);
        if scale != 1.0 {
            values.iter_mut().for_each(|value| *value /= scale);
        }
    }

    /// Time of some rows, s.
    fn time(
        &self,
        stamps: Option<Vec<f64>>,
        rows: std::ops::Range<usize>,
        findings: &mut Vec<Finding>,
    ) -> Result<Vec<f64>> {
        let (name, options) = (&self.name, &self.options);
        if let Some(rate) = options.rate_hz {
            findings.extend(self.replaced_time(rate)?);
            return Ok(rows.map(|row| row as f64 / rate).collect());
        }
        let mut time = stamps.unwrap_or_default();
        if let Some(origin) = self.origin {
            time.iter_mut().for_each(|ns| *ns /= 1e9);
            let message = format!(
                "time counts from the stamp {} s, the first of the log",
                stamps::digits(origin)
            );
            findings.push(
                Finding::new(Severity::Note, Code::TimeOrigin, name, message, 0)
                    .with([("origin", origin as f64 / 1e9)]),
            );
        }
        if let Some(unit) = options.columns.time_unit.filter(|unit| unit.ticks() != 1.0) {
            time.iter_mut().for_each(|time| *time /= unit.ticks());
            let message = format!(
                "time stamps were taken as {} as [columns] time_unit says",
                unit.word()
            );
            findings.push(
                Finding::new(Severity::Note, Code::TimeUnit, name, message, 0)
                    .with([("ticks_per_second", unit.ticks())]),
            );
        } else if let Some(preset) = options.preset.filter(|p| wants_ticks(*p, options)) {
            time.iter_mut().for_each(|time| *time /= preset.ticks());
            let message = format!(
                "time stamps were divided by {} as the preset `{}` says",
                preset.ticks(),
                preset.name()
            );
            findings.push(
                Finding::new(Severity::Note, Code::TimeUnit, name, message, 0)
                    .with([("ticks_per_second", preset.ticks())]),
            );
        }
        Ok(time)
    }

    /// That a rate, Hz, takes the place of the time stamps, if there are any.
    fn replaced_time(&self, rate: f64) -> Result<Option<Finding>> {
        if !(rate.is_finite() && rate > 0.0) {
            return Err(twincal::Error::Setting {
                key: "--rate".into(),
                problem: format!("{rate} Hz is out of range"),
                remedy: "give the sampling rate in Hz, above 0".into(),
            }
            .into());
        }
        if self.selection.time.is_none() {
            return Ok(None);
        }
        let message = format!("time stamps were replaced by row / {rate} Hz as told");
        let rows = self.rows as u64;
        Ok(Some(
            Finding::new(
                Severity::Note,
                Code::TimeReplaced,
                &self.name,
                message,
                rows,
            )
            .with([("rate", rate)]),
        ))
    }
}

fn dropped(name: &str, rows: usize, cells: &mut Cells) -> Finding {
    let share = cells.dropped as f64 / (rows as f64 + cells.dropped as f64);
    let severity = if share > DROPPED_LIMIT {
        Severity::Degraded
    } else {
        Severity::Warning
    };
    let first = cells.first_dropped.take().unwrap_or_default();
    let message = format!(
        "{} rows ({:.2} %) could not be read and were dropped; the first: {first}",
        cells.dropped,
        100.0 * share
    );
    Finding::new(severity, Code::UnreadableRows, name, message, cells.dropped)
        .with([("share", share)])
}

/// Whether a preset's own clock counts: not where the config states the unit.
fn wants_ticks(preset: Preset, options: &LogOptions) -> bool {
    preset.ticks() != 1.0 && options.columns.time_unit.is_none()
}

/// Refuses a column without any number.
fn refuse_empty_columns(
    name: &str,
    rows: usize,
    make: &Make,
    has_values: &dyn Fn(usize) -> bool,
) -> Result<()> {
    let (selection, positions) = (&make.selection, make.selection.positions());
    let check = |column: Option<usize>, words: &str| match column {
        Some(column) if !has_values(column) => Err(Error::content(
            Place::file(name),
            format!("column `{words}` is NaN or empty in all {rows} rows"),
            "export it again, or map another column in [columns]",
        )),
        _ => Ok(()),
    };
    if let Some(time) = (selection.time.as_ref()).filter(|_| make.options.rate_hz.is_none()) {
        check(positions.time, &time.name)?;
    }
    for (columns, joint) in positions.joints.iter().zip(&selection.joints) {
        for (column, channel) in columns.iter().zip(joint) {
            if let Some(channel) = channel {
                check(*column, &channel.name)?;
            }
        }
    }
    Ok(())
}
