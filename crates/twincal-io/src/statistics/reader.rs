//! One file of statistics: what it holds, and its rows.

use super::{Entry, FORMAT, Format, KEY, MAX_BYTES, Metadata, RowText};
use crate::artifact::sha256;
use crate::error::{Error, Place, Result};
use crate::log::{ANEW, Row, Rows};
use crate::open::{InputFile, Refusal};
use std::fs::File;
use std::path::Path;
use twincal::calibrate::{LogTable, Record};

/// Metadata of a file, and where its rows begin.
///
/// # Errors
/// [`Error::Content`] for another file, format or checksum of the metadata.
pub(super) fn look(path: &Path) -> Result<(Metadata, Vec<u64>)> {
    let name = path.display().to_string();
    let refuse = |problem: String| Error::content(Place::file(&name), problem, ANEW);
    let rows = Rows::open(opened(path)?, &name)?;
    let text = rows.metadata(KEY)?.ok_or_else(|| {
        Error::content(
            Place::file(&name),
            "holds no statistics of twincal",
            "give a file that `twincal statistics` wrote",
        )
    })?;
    let unreadable = |e: serde_json::Error| refuse(format!("its metadata cannot be read: {e}"));
    let Format { format } = serde_json::from_str(&text).map_err(unreadable)?;
    if format != FORMAT {
        let remedy = match format > FORMAT {
            true => "read it with a newer version of twincal",
            false => ANEW,
        };
        let problem = format!("has format {format}, this program reads {FORMAT}");
        return Err(Error::content(Place::file(&name), problem, remedy));
    }
    let metadata: Metadata = serde_json::from_str(&text).map_err(unreadable)?;
    rows.require_columns()?;
    if metadata.own_checksum()? != metadata.checksum {
        return Err(damaged(&name));
    }
    let (held, stated) = (rows.len(), metadata.logs.len());
    if held != stated {
        let problem = format!("has {held} rows, its metadata name {stated}");
        return Err(refuse(problem));
    }
    Ok((metadata, rows.into_batches()))
}

fn opened(path: &Path) -> Result<File> {
    let file = InputFile::new(path, MAX_BYTES).open();
    file.map_err(|refusal| {
        let remedy = match refusal {
            Refusal::TooLarge { .. } => "merge fewer files at a time, and give `fit` several",
            _ => "check the path",
        };
        refusal.into_error(&path.display().to_string(), remedy)
    })
}

fn damaged(name: &str) -> Error {
    let problem = "is damaged: its checksum is another one";
    Error::content(Place::file(name), problem, ANEW)
}

/// A file that was looked at.
#[derive(Debug)]
pub(super) struct Reader {
    name: String,
    rows: Rows<File>,
}

impl Reader {
    /// `batches`: where its rows begin.
    pub(super) fn open(path: &Path, batches: &[u64]) -> Result<Self> {
        let name = path.display().to_string();
        let rows = Rows::again(opened(path)?, &name, batches.to_vec())?;
        Ok(Self { name, rows })
    }

    pub(super) fn refuse(&self, problem: String) -> Error {
        Error::content(Place::file(&self.name), problem, ANEW)
    }

    /// A row as it stands there and what its text says, checked against what the metadata say of it.
    ///
    /// # Errors
    /// [`Error::Content`] for a row that is damaged, or was changed since the file was looked at.
    pub(super) fn row(&mut self, number: usize, entry: &Entry) -> Result<(Row, RowText)> {
        let row = self.rows.row(number)?;
        let checksums = [&row.text, &row.numbers].map(|bytes| sha256(bytes));
        if checksums != [&*entry.text, &*entry.numbers] {
            return Err(damaged(&self.name));
        }
        let text: RowText = serde_json::from_slice(&row.text)
            .map_err(|e| self.refuse(format!("row {number} cannot be read: {e}")))?;
        if Entry::new(&text.header, checksums) != *entry {
            let problem = format!("row {number} is another log than the metadata name");
            return Err(self.refuse(problem));
        }
        let mut counts = text.records.iter().map(|own| own.5);
        let count = counts.try_fold(0_u64, u64::checked_add);
        if count.and_then(|count| count.checked_mul(8)) != Some(row.numbers.len() as u64) {
            let problem = format!("row {number} has another count of numbers than its text says");
            return Err(self.refuse(problem));
        }
        Ok((row, text))
    }
}

/// The log of a row; numbers beyond its end are none.
pub(super) fn table(row: &Row, text: RowText) -> LogTable {
    let mut numbers = row
        .numbers
        .as_chunks()
        .0
        .iter()
        .copied()
        .map(f64::from_le_bytes);
    let records = text.records.into_iter().map(|own| Record {
        joint: own.0,
        quantity: own.1,
        block: own.2,
        rows: own.3,
        runs: own.4,
        values: numbers.by_ref().take(own.5 as usize).collect(),
    });
    LogTable {
        records: records.collect(),
        header: text.header,
    }
}
