//! Statistics to a file.

use super::{COLUMN, FORMAT, KEY, Layout, Metadata, StatisticsFile, checksum, json};
use crate::error::Result;
use arrow_array::{ArrayRef, Float64Array, RecordBatch};
use arrow_ipc::writer::FileWriter;
use arrow_schema::{ArrowError, DataType, Field, Schema};
use std::collections::HashMap;
use std::io::{self, Write};
use std::sync::Arc;

impl StatisticsFile {
    /// Writes the same bytes for the same statistics.
    ///
    /// # Errors
    /// [`crate::Error::Internal`] for what has no JSON. The inner error is the system's refusal.
    pub fn write_to(&self, to: impl Write) -> Result<io::Result<()>> {
        let mut numbers = Vec::new();
        let records = self.statistics.records().into_iter();
        let records = records.map(|record| {
            let count = record.values.len() as u64;
            numbers.extend(record.values);
            let counts = (record.rows, record.runs, count);
            let place = (record.log, record.joint, record.quantity, record.block);
            Layout(
                place.0, place.1, place.2, place.3, counts.0, counts.1, counts.2,
            )
        });
        let mut metadata = Metadata {
            format: FORMAT,
            checksum: String::new(),
            model: self.model.clone(),
            header: self.statistics.header(),
            records: records.collect(),
        };
        metadata.checksum = checksum(&metadata, &numbers)?;
        Ok(written(json(&metadata)?, numbers, to))
    }
}

fn written(metadata: String, numbers: Vec<f64>, to: impl Write) -> io::Result<()> {
    let system = |error: ArrowError| match error {
        ArrowError::IoError(_, error) => error,
        other => io::Error::other(other.to_string()),
    };
    let field = Field::new(COLUMN, DataType::Float64, false);
    // One key: a map of several would come in any order.
    let metadata = HashMap::from([(KEY.to_owned(), metadata)]);
    let schema = Arc::new(Schema::new_with_metadata(vec![field], metadata));
    let column: ArrayRef = Arc::new(Float64Array::from(numbers));
    let batch = RecordBatch::try_new(Arc::clone(&schema), vec![column]).map_err(system)?;
    let mut writer = FileWriter::try_new(to, &schema).map_err(system)?;
    writer.write(&batch).map_err(system)?;
    writer.finish().map_err(system)
}
