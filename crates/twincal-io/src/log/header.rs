//! The names of a table's columns, without its rows.

use super::csv;
use crate::error::{Error, Result};
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;

/// Column names of a CSV or Parquet file; `None` for what cannot be read twice (a pipe) or is no table.
///
/// # Errors
/// [`Error::System`] if the file cannot be read, [`Error::Content`] if it has no header.
pub fn read_header(path: &Path) -> Result<Option<Vec<String>>> {
    let name = path.display().to_string();
    let system =
        |e: &std::io::Error| Error::system(&name, "read", e, "check the path and its permissions");
    let mut file = File::open(path).map_err(|e| system(&e))?;
    let metadata = file.metadata().map_err(|e| system(&e))?;
    if !metadata.is_file() {
        return Ok(None);
    }
    let mut magic = Vec::with_capacity(4);
    let mut head = file.by_ref().take(4);
    head.read_to_end(&mut magic).map_err(|e| system(&e))?;
    file.seek(SeekFrom::Start(0)).map_err(|e| system(&e))?;
    if magic == b"PAR1" {
        // What is wrong with the file is said when it is read.
        let Ok(reader) = SerializedFileReader::new(file) else {
            return Ok(None);
        };
        let schema = reader.metadata().file_metadata().schema_descr();
        let names = schema.columns().iter().map(|c| c.path().string());
        return Ok(Some(names.collect()));
    }
    let binary = magic.iter().any(|byte| *byte == 0 || *byte == 0x89) || magic.starts_with(b"PK");
    if binary {
        return Ok(None);
    }
    let table = csv::Table::open(file, metadata.len(), &name)?;
    Ok(Some(table.header().to_vec()))
}
