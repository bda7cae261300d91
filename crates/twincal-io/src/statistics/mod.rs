//! Statistics of logs as files: an Arrow IPC file of one column of numbers, with what they are in its metadata.
//!
//! ```text
//! schema metadata    key `twincal.statistics` → JSON: format, checksum, model, header, records
//! column `value`     float64; records one after the other, each [log, joint, quantity, block, rows, runs, numbers]
//! ```
//! The checksum is SHA-256 of the JSON with an empty checksum, and of all numbers as little-endian bytes.

mod write;

use crate::artifact::sha256;
use crate::error::{Error, Place, Result};
use crate::log::arrow_numbers;
use crate::open::InputFile;
use serde::{Deserialize, Serialize};
use std::io::Cursor;
use std::path::Path;
use twincal::calibrate::{Header, Quantity, Record, Statistics};

/// What this version writes.
const FORMAT: u32 = 1;
/// Key of the schema's metadata, and the name of the only column.
const KEY: &str = "twincal.statistics";
const COLUMN: &str = "value";
/// Largest file, bytes: some thousand logs of ten minutes.
const MAX_BYTES: u64 = 16 << 30;

/// Statistics with the model file that their robot was read from.
#[derive(Debug, Clone, PartialEq)]
pub struct StatisticsFile {
    /// What a fit takes.
    pub statistics: Statistics,
    /// What `twincal export` writes the result back into.
    pub model: ModelFile,
}

/// A model file as it was.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelFile {
    /// Name as given.
    pub name: String,
    /// Name within a twin's folder, `model.urdf` or `model.xml`.
    pub stored_as: String,
    /// What the file calls the robot; may be empty.
    pub robot: String,
    /// The file.
    pub text: String,
}

/// The JSON of the metadata.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Metadata {
    format: u32,
    checksum: String,
    model: ModelFile,
    header: Header,
    records: Vec<Layout>,
}

/// `[log, joint, quantity, block, rows, runs, numbers]`.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Layout(u32, u32, Quantity, u32, f64, f64, u64);

impl StatisticsFile {
    /// Reads a file that [`StatisticsFile::write_to`] wrote.
    ///
    /// # Errors
    /// [`Error::Content`] for another file, format or checksum; those of [`Statistics::from_records`].
    pub fn read(path: &Path) -> Result<Self> {
        let name = path.display().to_string();
        let remedy = "make it anew with `twincal statistics`";
        let bytes = InputFile::new(path, MAX_BYTES)
            .read()
            .map_err(|refusal| refusal.into_error(&name, remedy))?;
        let refuse = |problem: String| Error::content(Place::file(&name), problem, remedy);
        let (text, numbers) = arrow_numbers(Cursor::new(&bytes[..]), &name, (KEY, COLUMN))?;
        let text = text.ok_or_else(|| {
            Error::content(
                Place::file(&name),
                "holds no statistics of twincal",
                "give a file that `twincal statistics` wrote",
            )
        })?;
        let mut metadata: Metadata = serde_json::from_str(&text)
            .map_err(|e| refuse(format!("its metadata cannot be read: {e}")))?;
        if metadata.format != FORMAT {
            return Err(refuse(format!(
                "has format {}, this program reads {FORMAT}",
                metadata.format
            )));
        }
        let said = std::mem::take(&mut metadata.checksum);
        if said != checksum(&metadata, &numbers)? {
            return Err(refuse("is damaged: its checksum is another one".into()));
        }
        let mut left = &numbers[..];
        let mut records = Vec::with_capacity(metadata.records.len());
        for Layout(log, joint, quantity, block, rows, runs, count) in metadata.records {
            let count = usize::try_from(count).ok();
            let Some((own, rest)) = count.and_then(|count| left.split_at_checked(count)) else {
                return Err(refuse("holds fewer numbers than it declares".into()));
            };
            left = rest;
            records.push(Record {
                log,
                joint,
                quantity,
                block,
                rows,
                runs,
                values: own.to_vec(),
            });
        }
        if !left.is_empty() {
            return Err(refuse("holds more numbers than it declares".into()));
        }
        Ok(Self {
            statistics: Statistics::from_records(metadata.header, records)
                .map_err(|e| refuse(e.to_string()))?,
            model: metadata.model,
        })
    }
}

/// Of the metadata with an empty checksum, and the numbers.
fn checksum(metadata: &Metadata, numbers: &[f64]) -> Result<String> {
    let mut bytes = json(metadata)?.into_bytes();
    bytes.reserve(8 * numbers.len());
    for number in numbers {
        bytes.extend(number.to_le_bytes());
    }
    Ok(sha256(&bytes))
}

fn json(metadata: &Metadata) -> Result<String> {
    serde_json::to_string(metadata).map_err(|e| Error::Internal {
        what: "statistics as JSON".into(),
        problem: e.to_string(),
    })
}

#[cfg(test)]
mod tests;
