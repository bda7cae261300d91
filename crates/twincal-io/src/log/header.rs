//! The names of a table's columns, without its rows.

use super::{Kind, csv};
use crate::error::{Error, Result};
use crate::open::open_log_file;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;

/// Column names of a CSV, Parquet or Arrow file; `None` for what holds them otherwise.
///
/// # Errors
/// [`Error::System`] if the file cannot be read, [`Error::Content`] if it has no header.
pub fn read_header(path: &Path) -> Result<Option<Vec<String>>> {
    let name = path.display().to_string();
    let system =
        |e: &std::io::Error| Error::system(&name, "read", e, "check the path and its permissions");
    let mut file = open_log_file(path, &name)?;
    let bytes = file.metadata().map_err(|e| system(&e))?.len();
    let mut head = Vec::new();
    (&mut file)
        .take(Kind::HEAD as u64)
        .read_to_end(&mut head)
        .map_err(|e| system(&e))?;
    file.seek(SeekFrom::Start(0)).map_err(|e| system(&e))?;
    match Kind::of(&head) {
        #[cfg(feature = "tables")]
        Kind::Parquet => {
            use parquet::file::reader::{FileReader as _, SerializedFileReader};
            super::parquet::check_footer(&file, &name)?;
            // What is wrong with the file is said when it is read.
            let Ok(reader) = SerializedFileReader::new(file) else {
                return Ok(None);
            };
            let schema = reader.metadata().file_metadata().schema_descr();
            let names = schema.columns().iter().map(|c| c.path().string());
            return Ok(Some(names.collect()));
        }
        // What is wrong with the file is said when it is read.
        #[cfg(feature = "tables")]
        Kind::Arrow => return Ok(super::arrow::header(file, &name).ok()),
        Kind::Text => {}
        _ => return Ok(None),
    }
    let table = csv::Table::open(file, bytes, &name)?;
    Ok(Some(table.header().to_vec()))
}
