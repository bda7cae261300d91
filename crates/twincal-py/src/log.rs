//! Logs: a file that is read when its robot is known, or columns in memory.

use crate::errors::Problem;
use crate::pool;
use crate::robot::numbers;
use arrow_array::cast::AsArray as _;
use arrow_array::ffi_stream::{FFI_ArrowArrayStream, RecordBatchStreamReader};
use arrow_array::types::{Float32Type, Float64Type, Int32Type, Int64Type};
use arrow_array::{Array, RecordBatch, RecordBatchReader as _};
use arrow_schema::DataType;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyCapsule;
use std::path::PathBuf;
use std::sync::Arc;
use twincal_cli::Failure;
use twincal_cli::session::{Columns, LogSource};

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

    /// Arrays by name of column.
    #[staticmethod]
    fn arrays(
        py: Python<'_>,
        name: String,
        named: Vec<(String, PyReadonlyArray1<'_, f64>)>,
        entry: String,
        columns: String,
    ) -> PyResult<Self> {
        let mut header = Vec::new();
        let mut own = Vec::new();
        for (column, values) in &named {
            header.push(column.clone());
            own.push(numbers(py, values)?.to_vec());
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

    /// Columns in memory by name; none for a file.
    fn in_memory<'py>(&self, py: Python<'py>) -> Vec<(String, Bound<'py, numpy::PyArray1<f64>>)> {
        match &self.source {
            LogSource::File(_) => Vec::new(),
            LogSource::Columns(own) => {
                let columns = own.header.iter().cloned().zip(&own.columns);
                columns
                    .map(|(name, x)| (name, numpy::PyArray1::from_slice(py, x)))
                    .collect()
            }
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

/// All columns of numbers of a table.
fn columns_of(name: String, reader: RecordBatchStreamReader) -> Result<Columns, Problem> {
    let refuse = |problem: String| {
        let remedy = "give a table with one column of numbers per channel";
        Problem::from(Failure::usage(format!("`{name}` {problem}"), remedy))
    };
    let schema = reader.schema();
    let wanted: Vec<usize> = (0..schema.fields().len())
        .filter(|&index| is_number(schema.field(index).data_type()))
        .collect();
    let header = wanted
        .iter()
        .map(|&index| schema.field(index).name().clone());
    let header: Vec<String> = header.collect();
    let mut columns = vec![Vec::new(); wanted.len()];
    for batch in reader {
        let batch = batch.map_err(|e| refuse(format!("cannot be read: {e}")))?;
        for (own, index) in columns.iter_mut().zip(&wanted) {
            append(&batch, *index, own);
        }
    }
    Ok(Columns::new(name, header, columns))
}

fn is_number(kind: &DataType) -> bool {
    matches!(
        kind,
        DataType::Float64 | DataType::Float32 | DataType::Int64 | DataType::Int32
    )
}

/// Numbers of a column, NaN where it has none.
fn append(batch: &RecordBatch, index: usize, own: &mut Vec<f64>) {
    let column = batch.column(index);
    macro_rules! extend {
        ($kind:ty) => {{
            let array = column.as_primitive::<$kind>();
            match array.null_count() {
                0 => own.extend(array.values().iter().map(|&x| x as f64)),
                _ => own.extend(array.iter().map(|x| x.map_or(f64::NAN, |x| x as f64))),
            }
        }};
    }
    match column.data_type() {
        DataType::Float64 => extend!(Float64Type),
        DataType::Float32 => extend!(Float32Type),
        DataType::Int64 => extend!(Int64Type),
        _ => extend!(Int32Type),
    }
}
