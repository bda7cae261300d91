//! A motion as a Parquet file: the columns of `motion.csv`, the joints' names in its metadata.

use super::WARNING;
use super::forms::{column_names, quantities};
use crate::error::{Error, Result};
use crate::table::{ColumnKind, TableFormat, TableWriter, Values};
use std::io;
use twincal::design::DesignedMotion;

/// Samples that are handed over at a time.
const BLOCK: usize = 65_536;

/// `t, q1…, qd1…, qdd1…` as doubles: s, rad, rad/s, rad/s² (m for sliders).
///
/// The metadata hold `joints`, a JSON list of names in the order of the columns, `rate`, Hz, and `warning`. The same
/// motion gives the same bytes.
///
/// # Errors
/// [`Error::Internal`] if the table cannot be written.
pub fn motion_parquet(motion: &DesignedMotion) -> Result<Vec<u8>> {
    written(motion).map_err(|e| Error::Internal {
        what: "a motion as Parquet".into(),
        problem: e.to_string(),
    })
}

fn written(motion: &DesignedMotion) -> io::Result<Vec<u8>> {
    let names = column_names(motion.joints.len());
    let columns: Vec<_> = names
        .into_iter()
        .map(|name| (name, ColumnKind::Number))
        .collect();
    let mut table = TableWriter::new(Vec::new(), TableFormat::Parquet, &columns)?;
    table.keep("joints", &serde_json::to_string(&motion.joints)?);
    table.keep("rate", &motion.rate.to_string());
    table.keep("warning", WARNING);
    for start in (0..motion.len).step_by(BLOCK) {
        let samples = start..(start + BLOCK).min(motion.len);
        let times: Vec<f64> = (samples.clone()).map(|k| k as f64 / motion.rate).collect();
        let mut blocks = vec![Values::Numbers(&times)];
        for all in quantities(motion) {
            let joints = all.chunks_exact(motion.len);
            blocks.extend(joints.map(|own| Values::Numbers(&own[samples.clone()])));
        }
        table.push(&blocks)?;
    }
    table.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::fixture;
    use ::parquet::file::reader::{FileReader, SerializedFileReader};
    use ::parquet::record::RowAccessor;
    use std::collections::BTreeMap;

    /// A table, and what is kept beside it.
    struct Read {
        names: Vec<String>,
        rows: Vec<Vec<f64>>,
        kept: BTreeMap<String, String>,
    }

    /// By the reader of the crate `parquet`.
    fn read(bytes: Vec<u8>) -> Read {
        let reader = SerializedFileReader::new(bytes::Bytes::from(bytes)).expect("a Parquet file");
        let file = reader.metadata().file_metadata();
        let columns = file.schema_descr().columns().iter();
        let names: Vec<_> = columns.map(|own| own.name().to_owned()).collect();
        let kept = file.key_value_metadata().into_iter().flatten();
        let kept = kept.map(|own| (own.key.clone(), own.value.clone().unwrap_or_default()));
        let rows = reader.get_row_iter(None).expect("rows").map(|row| {
            let row = row.expect("a row");
            let cells = 0..row.len();
            cells
                .map(|at| row.get_double(at).expect("a double"))
                .collect()
        });
        Read {
            names,
            rows: rows.collect(),
            kept: kept.collect(),
        }
    }

    /// Every double of the CSV, to the last bit.
    #[test]
    fn the_table_is_that_of_the_csv() {
        let motion = fixture::motion(&fixture::HOSTILE, 70_001);
        let csv = crate::design::motion_csv(&motion);
        let Read { names, rows, .. } = read(motion_parquet(&motion).expect("written"));
        let mut lines = csv.lines();
        assert_eq!(lines.next(), Some(names.join(",").as_str()));
        assert_eq!(lines.clone().count(), rows.len());
        for (line, row) in lines.zip(&rows) {
            let said = line.split(',').map(|cell| cell.parse().expect("a number"));
            assert!(said.map(f64::to_bits).eq(row.iter().map(|x| x.to_bits())));
        }
    }

    #[test]
    fn names_and_warning_stand_beside_it_and_bytes_repeat() {
        let motion = fixture::motion(&fixture::HOSTILE, 50);
        let bytes = motion_parquet(&motion).expect("written");
        assert_eq!(bytes, motion_parquet(&motion).expect("written again"));
        let kept = read(bytes).kept;
        let names: Vec<String> = serde_json::from_str(&kept["joints"]).expect("a list");
        assert_eq!(names, motion.joints);
        assert_eq!(
            (kept["rate"].as_str(), kept["warning"].as_str()),
            ("250", WARNING)
        );
    }
}
