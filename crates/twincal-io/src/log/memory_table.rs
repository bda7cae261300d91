//! Tables in memory: columns by name, which are matched to the joints as those of a file are.

use super::{Cells, LogOptions, Request, assemble, in_memory};
use crate::error::{Error, Place, Result};
use twincal::robot::Robot;
use twincal::signal::Recording;
use twincal::{Code, Finding, Severity};

/// What a column holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Column {
    /// One number per sample, SI units; NaN where there is none.
    Numbers(Vec<f64>),
    /// Time stamps whose type states their unit.
    Stamps {
        /// Stamps, s; NaN where there is none.
        seconds: Vec<f64>,
        /// The unit of the type, such as "nanoseconds".
        unit: &'static str,
    },
    /// No numbers. The text says what instead, such as "is text, not a number": a channel of this name is refused, any other column passed over.
    Other(String),
}

impl Column {
    /// The numbers; none where it has none.
    #[must_use]
    pub fn numbers(&self) -> Option<&[f64]> {
        match self {
            Self::Numbers(values) => Some(values),
            Self::Stamps { seconds, .. } => Some(seconds),
            Self::Other(_) => None,
        }
    }
}

/// A log of columns in memory, which are matched to the joints as those of a table are; `name` is what messages call it.
///
/// # Errors
/// Like [`super::read_log`]; columns of different lengths, and channels that are no numbers.
pub fn read_columns(
    name: &str,
    header: &[String],
    columns: &[Column],
    robot: &Robot,
    options: &LogOptions,
) -> Result<(Recording, Vec<Finding>)> {
    let request = Request {
        name,
        robot,
        options,
        chapters: false,
    };
    require_one_length(name, header, columns)?;
    let selection = request.select(header)?;
    let mut cells = Cells::default();
    let mut findings = Vec::new();
    for index in selection.file_columns() {
        let own = &header[index];
        match &columns[index] {
            Column::Numbers(values) => cells.columns.push(values.clone()),
            Column::Stamps { seconds, unit } => {
                cells.columns.push(seconds.clone());
                findings.push(typed_stamps(name, own, unit));
            }
            Column::Other(what) => {
                return Err(Error::content(
                    Place::file(name),
                    format!("column `{own}` {what}"),
                    "give it as numbers, or map another column in [columns]",
                ));
            }
        }
    }
    let log = assemble(request, cells, selection, &mut findings)?;
    in_memory((log, findings))
}

fn require_one_length(name: &str, header: &[String], columns: &[Column]) -> Result<()> {
    let mut lengths = header.iter().zip(columns).filter_map(|(own, column)| {
        let values = column.numbers()?;
        Some((own, values.len()))
    });
    let Some((first, rows)) = lengths.next() else {
        return Ok(());
    };
    match lengths.find(|(_, len)| *len != rows) {
        None => Ok(()),
        Some((other, len)) => Err(Error::content(
            Place::file(name),
            format!("column `{other}` has {len} samples, `{first}` has {rows}"),
            "give one value for each time stamp, NaN where it is not known",
        )),
    }
}

/// The note on stamps whose type states their unit.
pub(super) fn typed_stamps(name: &str, column: &str, unit: &str) -> Finding {
    Finding::new(
        Severity::Note,
        Code::TimestampType,
        name,
        format!(
            "column `{column}` is a timestamp in {unit} by its type and was turned into seconds"
        ),
        0,
    )
}
