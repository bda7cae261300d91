//! Columns of an Arrow table as numbers, by the rules of the Parquet reader.

use crate::errors::Problem;
use arrow_array::cast::AsArray as _;
use arrow_array::ffi_stream::RecordBatchStreamReader;
use arrow_array::types::{
    Decimal32Type, Decimal64Type, Decimal128Type, DurationMicrosecondType, DurationMillisecondType,
    DurationNanosecondType, DurationSecondType, Float16Type, Float32Type, Float64Type, Int8Type,
    Int16Type, Int32Type, Int64Type, TimestampMicrosecondType, TimestampMillisecondType,
    TimestampNanosecondType, TimestampSecondType, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, RecordBatchReader as _};
use arrow_schema::{DataType, TimeUnit};
use twincal_cli::Failure;
use twincal_cli::session::Columns;
use twincal_io::log::Column;

/// Appends the numbers of an array, NaN where it has none.
type Append = fn(&dyn Array, &mut Vec<f64>);

/// How the values of a column become numbers.
struct Kind {
    append: Append,
    /// What they are divided by: ticks per second of stamps, the power of ten of decimals.
    scale: f64,
    /// The unit of stamps.
    unit: Option<&'static str>,
}

/// All columns of a table.
pub(crate) fn columns_of(
    name: String,
    reader: RecordBatchStreamReader,
) -> Result<Columns, Problem> {
    let schema = reader.schema();
    let header = schema.fields().iter().map(|own| own.name().clone());
    let header: Vec<String> = header.collect();
    let kinds = schema.fields().iter().map(|own| kind(own.data_type()));
    let kinds: Vec<Result<Kind, String>> = kinds.collect();
    let mut values = vec![Vec::new(); kinds.len()];
    for batch in reader {
        let batch = batch.map_err(|e| {
            let problem = format!("`{name}` cannot be read: {e}");
            Failure::usage(
                problem,
                "give a table with one column of numbers per channel",
            )
        })?;
        for ((own, kind), array) in values.iter_mut().zip(&kinds).zip(batch.columns()) {
            if let Ok(kind) = kind {
                (kind.append)(array.as_ref(), own);
            }
        }
    }
    let columns = values.into_iter().zip(kinds);
    let columns = columns.map(|(values, kind)| column(values, kind)).collect();
    Ok(Columns::new(name, header, columns))
}

fn column(mut values: Vec<f64>, kind: Result<Kind, String>) -> Column {
    let kind = match kind {
        Ok(kind) => kind,
        Err(what) => return Column::Other(what),
    };
    if kind.scale != 1.0 {
        values.iter_mut().for_each(|value| *value /= kind.scale);
    }
    match kind.unit {
        Some(unit) => Column::Stamps {
            seconds: values,
            unit,
        },
        None => Column::Numbers(values),
    }
}

/// Appends the numbers of a column of one type, NaN where it has none.
macro_rules! append {
    ($kind:ty) => {
        append!($kind, |x| x as f64)
    };
    ($kind:ty, $number:expr) => {
        |array, own| {
            let array = array.as_primitive::<$kind>();
            own.extend(array.iter().map(|x| x.map_or(f64::NAN, $number)));
        }
    };
}

/// How a type becomes numbers.
///
/// # Errors
/// What it holds instead, in words.
fn kind(data: &DataType) -> Result<Kind, String> {
    let append: Append = match data {
        DataType::Float16 => append!(Float16Type, |x| x.to_f64()),
        DataType::Float32 => append!(Float32Type, f64::from),
        DataType::Float64 => append!(Float64Type, |x| x),
        DataType::Int8 => append!(Int8Type),
        DataType::Int16 => append!(Int16Type),
        DataType::Int32 => append!(Int32Type),
        DataType::Int64 => append!(Int64Type),
        DataType::UInt8 => append!(UInt8Type),
        DataType::UInt16 => append!(UInt16Type),
        DataType::UInt32 => append!(UInt32Type),
        DataType::UInt64 => append!(UInt64Type),
        DataType::Decimal32(_, scale) => return Ok(decimals(append!(Decimal32Type), *scale)),
        DataType::Decimal64(_, scale) => return Ok(decimals(append!(Decimal64Type), *scale)),
        DataType::Decimal128(_, scale) => return Ok(decimals(append!(Decimal128Type), *scale)),
        DataType::Timestamp(unit, _) => return Ok(stamps(*unit)),
        DataType::Duration(unit) => return Ok(durations(*unit)),
        DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View => {
            return Err("is text, not a number".into());
        }
        DataType::Dictionary(..) => {
            return Err("is dictionary-encoded, not one number per row".into());
        }
        other => return Err(format!("is of type {other}, not a number")),
    };
    Ok(Kind {
        append,
        scale: 1.0,
        unit: None,
    })
}

fn decimals(append: Append, digits: i8) -> Kind {
    Kind {
        append,
        scale: 10_f64.powi(digits.into()),
        unit: None,
    }
}

fn stamps(unit: TimeUnit) -> Kind {
    match unit {
        TimeUnit::Second => ticks(append!(TimestampSecondType), 1.0, "seconds"),
        TimeUnit::Millisecond => ticks(append!(TimestampMillisecondType), 1e3, "milliseconds"),
        TimeUnit::Microsecond => ticks(append!(TimestampMicrosecondType), 1e6, "microseconds"),
        TimeUnit::Nanosecond => ticks(append!(TimestampNanosecondType), 1e9, "nanoseconds"),
    }
}

fn durations(unit: TimeUnit) -> Kind {
    match unit {
        TimeUnit::Second => ticks(append!(DurationSecondType), 1.0, "seconds"),
        TimeUnit::Millisecond => ticks(append!(DurationMillisecondType), 1e3, "milliseconds"),
        TimeUnit::Microsecond => ticks(append!(DurationMicrosecondType), 1e6, "microseconds"),
        TimeUnit::Nanosecond => ticks(append!(DurationNanosecondType), 1e9, "nanoseconds"),
    }
}

/// A time whose type states its unit.
fn ticks(append: Append, per_second: f64, unit: &'static str) -> Kind {
    Kind {
        append,
        scale: per_second,
        unit: Some(unit),
    }
}
