//! Logs: a file that is read when its robot is known, or columns in memory.

use crate::errors::Problem;
use crate::pool;
use crate::robot::owned;
use crate::table_columns::columns_of;
use arrow_array::ffi_stream::{FFI_ArrowArrayStream, RecordBatchStreamReader};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyCapsule;
use std::path::PathBuf;
use std::sync::Arc;
use twincal_cli::Failure;
use twincal_cli::session::{Columns, LogSource};
use twincal_io::log::Column;

/// Where a log comes from, and the keys of `[[log]]` and `[columns]` as objects of JSON.
#[pyclass(frozen, module = "twincal._twincal")]
#[derive(Debug, Clone)]
pub(crate) struct Log {
    pub(crate) source: LogSource,
    /// Keys of its entry `[[log]]`; "{}" for none.
    #[pyo3(get)]
    pub(crate) entry: String,
    /// `[columns]`; "{}" for none.
    #[pyo3(get)]
    pub(crate) columns: String,
}

#[pymethods]
impl Log {
    /// A file.
    #[staticmethod]
    fn file(path: PathBuf, entry: String, columns: String) -> Self {
        Self {
            source: LogSource::File(path),
            entry,
            columns,
        }
    }

    /// Arrays by name of column; `others` are columns without numbers, and what they hold.
    #[staticmethod]
    fn arrays(
        py: Python<'_>,
        name: String,
        named: Vec<(String, PyReadonlyArray1<'_, f64>)>,
        others: Vec<(String, String)>,
        entry: String,
        columns: String,
    ) -> PyResult<Self> {
        let mut header = Vec::new();
        let mut own = Vec::new();
        for (column, values) in &named {
            header.push(column.clone());
            own.push(Column::Numbers(owned(py, values)?));
        }
        for (column, what) in others {
            header.push(column);
            own.push(Column::Other(what));
        }
        let source = py.detach(|| Columns::new(name, header, own));
        Ok(Self {
            source: LogSource::Columns(Arc::new(source)),
            entry,
            columns,
        })
    }

    /// A table, as a capsule that holds an Arrow C stream.
    #[staticmethod]
    fn table(
        py: Python<'_>,
        name: String,
        stream: &Bound<'_, PyCapsule>,
        entry: String,
        columns: String,
    ) -> PyResult<Self> {
        let reader = reader_of(py, stream)?;
        let source = pool::detached(py, None, || columns_of(name, reader))?;
        Ok(Self {
            source: LogSource::Columns(Arc::new(source)),
            entry,
            columns,
        })
    }

    /// Name as it was given.
    #[getter]
    fn name(&self) -> String {
        self.source.given().to_string_lossy().into_owned()
    }

    /// The file; none for what is in memory.
    #[getter]
    fn path(&self) -> Option<PathBuf> {
        match &self.source {
            LogSource::File(path) => Some(path.clone()),
            LogSource::Columns(_) => None,
        }
    }

    /// Columns of numbers in memory by name; none for a file.
    fn in_memory<'py>(&self, py: Python<'py>) -> Vec<(String, Bound<'py, numpy::PyArray1<f64>>)> {
        let columns = self.columns_in_memory().into_iter();
        let columns = columns.flat_map(|own| own.header.iter().cloned().zip(&own.columns));
        columns
            .filter_map(|(name, own)| Some((name, numpy::PyArray1::from_slice(py, own.numbers()?))))
            .collect()
    }

    /// Columns in memory that hold no numbers, and what they hold.
    fn others(&self) -> Vec<(String, String)> {
        let columns = self.columns_in_memory().into_iter();
        let columns = columns.flat_map(|own| own.header.iter().zip(&own.columns));
        let other = |(name, own): (&String, &Column)| match own {
            Column::Other(what) => Some((name.clone(), what.clone())),
            Column::Numbers(_) | Column::Stamps { .. } => None,
        };
        columns.filter_map(other).collect()
    }
}

impl Log {
    fn columns_in_memory(&self) -> Option<&Columns> {
        match &self.source {
            LogSource::File(_) => None,
            LogSource::Columns(own) => Some(&**own),
        }
    }
}

/// Name of a capsule with an Arrow C stream.
const STREAM: &std::ffi::CStr = c"arrow_array_stream";

/// Takes the stream out of its capsule.
#[expect(
    unsafe_code,
    reason = "the Arrow C stream interface hands over a struct by its address"
)]
fn reader_of(py: Python<'_>, capsule: &Bound<'_, PyCapsule>) -> PyResult<RecordBatchStreamReader> {
    let refuse = |e: String| {
        let failure = Failure::usage(
            format!("a table whose Arrow stream cannot be read: {e}"),
            "give a data frame of pandas, polars, pyarrow or DuckDB",
        );
        Problem::from(failure).raise(py)
    };
    let address = capsule
        .pointer_checked(Some(STREAM))
        .map_err(|e| refuse(e.to_string()))?;
    let stream = address.cast::<FFI_ArrowArrayStream>();
    // SAFETY: a capsule of this name holds a valid `ArrowArrayStream` (Arrow PyCapsule interface), which lives as long as the capsule, and the
    // capsule outlives this call. `from_raw` moves the stream out and leaves a released one behind, which the capsule's destructor accepts. The
    // GIL is held, so that nobody else reads the struct meanwhile.
    let reader = unsafe { RecordBatchStreamReader::from_raw(stream.as_ptr()) };
    reader.map_err(|e| refuse(e.to_string()))
}
