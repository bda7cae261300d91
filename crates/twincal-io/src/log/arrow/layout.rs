//! Where a column's values stand in a record batch, and what kind of numbers they are.

use arrow_ipc::{Field, MetadataVersion, Precision, TimeUnit, Type, UnionMode};

/// A column of numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Numbers {
    /// How one is stored.
    pub(super) form: Form,
    /// Ticks per second of a time whose type states its unit, and the unit's name.
    pub(super) ticks: Option<(f64, &'static str)>,
}

/// How a number is stored, little-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    F32,
    F64,
    I8,
    I16,
    I32,
    I64,
    U8,
    U16,
    U32,
    U64,
}

impl Form {
    /// Bytes per number.
    pub(super) fn width(self) -> u64 {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::F32 | Self::I32 | Self::U32 => 4,
            Self::F64 | Self::I64 | Self::U64 => 8,
        }
    }

    /// Appends the numbers in `bytes`, a whole count of them.
    pub(super) fn append(self, bytes: &[u8], values: &mut Vec<f64>) {
        fn extend<const W: usize>(
            bytes: &[u8],
            values: &mut Vec<f64>,
            number: impl Fn([u8; W]) -> f64,
        ) {
            values.extend(bytes.as_chunks().0.iter().map(|chunk| number(*chunk)));
        }
        match self {
            Self::F32 => extend(bytes, values, |b| f32::from_le_bytes(b).into()),
            Self::F64 => extend(bytes, values, f64::from_le_bytes),
            Self::I8 => extend(bytes, values, |b| i8::from_le_bytes(b).into()),
            Self::I16 => extend(bytes, values, |b| i16::from_le_bytes(b).into()),
            Self::I32 => extend(bytes, values, |b| i32::from_le_bytes(b).into()),
            Self::I64 => extend(bytes, values, |b| i64::from_le_bytes(b) as f64),
            Self::U8 => extend(bytes, values, |b| u8::from_le_bytes(b).into()),
            Self::U16 => extend(bytes, values, |b| u16::from_le_bytes(b).into()),
            Self::U32 => extend(bytes, values, |b| u32::from_le_bytes(b).into()),
            Self::U64 => extend(bytes, values, |b| u64::from_le_bytes(b) as f64),
        }
    }
}

/// The numbers of a column.
///
/// # Errors
/// What it is instead, in words.
pub(super) fn numbers(field: Field<'_>) -> Result<Numbers, String> {
    if field.dictionary().is_some() {
        return Err("is dictionary-encoded, not one number per row".into());
    }
    let unknown = || "is of a type that its metadata does not state".to_owned();
    let plain = |form| Numbers { form, ticks: None };
    let time = |unit| {
        let ticks = match unit {
            TimeUnit::SECOND => (1.0, "seconds"),
            TimeUnit::MILLISECOND => (1e3, "milliseconds"),
            TimeUnit::MICROSECOND => (1e6, "microseconds"),
            TimeUnit::NANOSECOND => (1e9, "nanoseconds"),
            _ => return Err(unknown()),
        };
        Ok(Numbers {
            form: Form::I64,
            ticks: Some(ticks),
        })
    };
    match field.type_type() {
        Type::FloatingPoint => {
            let float = field.type_as_floating_point().ok_or_else(unknown)?;
            match float.precision() {
                Precision::DOUBLE => Ok(plain(Form::F64)),
                Precision::SINGLE => Ok(plain(Form::F32)),
                _ => Err("holds numbers of half precision".into()),
            }
        }
        Type::Int => {
            let int = field.type_as_int().ok_or_else(unknown)?;
            Ok(plain(match (int.bitWidth(), int.is_signed()) {
                (8, true) => Form::I8,
                (16, true) => Form::I16,
                (32, true) => Form::I32,
                (64, true) => Form::I64,
                (8, false) => Form::U8,
                (16, false) => Form::U16,
                (32, false) => Form::U32,
                (64, false) => Form::U64,
                (bits, _) => return Err(format!("holds whole numbers of {bits} bits")),
            }))
        }
        Type::Timestamp => time(field.type_as_timestamp().ok_or_else(unknown)?.unit()),
        Type::Duration => time(field.type_as_duration().ok_or_else(unknown)?.unit()),
        Type::Utf8 | Type::LargeUtf8 | Type::Utf8View => Err("is text, not a number".into()),
        Type::List
        | Type::LargeList
        | Type::FixedSizeList
        | Type::ListView
        | Type::LargeListView => Err("is a list, not one number per row".into()),
        other => Err(format!(
            "is of type {}, not a number",
            other
                .variant_name()
                .unwrap_or("unknown")
                .trim_end_matches('_')
        )),
    }
}

/// Running count of what the columns of a batch take, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Position {
    /// Nodes (length and number of nulls).
    pub(super) node: usize,
    /// Buffers.
    pub(super) buffer: usize,
    /// Columns whose number of buffers the batch states.
    variadic: usize,
}

impl Position {
    /// Moves behind a column (Arrow's Columnar.rst, "Serialization and interprocess communication"); none for a type that this
    /// version of the format does not have.
    pub(super) fn pass(
        &mut self,
        field: Field<'_>,
        version: MetadataVersion,
        variadic: &[i64],
    ) -> Option<()> {
        self.node += 1;
        // Indices; the values stand in a batch of their own.
        if field.dictionary().is_some() {
            self.buffer += 2;
            return Some(());
        }
        let mut nested = false;
        self.buffer += match field.type_type() {
            Type::Null => 0,
            Type::Bool
            | Type::Int
            | Type::FloatingPoint
            | Type::Decimal
            | Type::Date
            | Type::Time
            | Type::Timestamp
            | Type::Interval
            | Type::Duration
            | Type::FixedSizeBinary => 2,
            Type::Binary | Type::Utf8 | Type::LargeBinary | Type::LargeUtf8 => 3,
            Type::BinaryView | Type::Utf8View => {
                let more = usize::try_from(*variadic.get(self.variadic)?).ok()?;
                self.variadic += 1;
                more.checked_add(2)?
            }
            other => {
                nested = true;
                match other {
                    Type::List | Type::LargeList | Type::Map => 2,
                    Type::ListView | Type::LargeListView => 3,
                    Type::FixedSizeList | Type::Struct_ => 1,
                    Type::RunEndEncoded => 0,
                    Type::Union => {
                        let dense = field.type_as_union()?.mode() == UnionMode::Dense;
                        1 + usize::from(dense) + usize::from(version < MetadataVersion::V5)
                    }
                    _ => return None,
                }
            }
        };
        if nested {
            for child in field.children()? {
                self.pass(child, version, variadic)?;
            }
        }
        Some(())
    }
}
