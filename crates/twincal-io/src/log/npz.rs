//! NPZ logs (`numpy.savez`): numeric arrays only, no pickle, sizes checked before anything is allocated.
//!
//! An array with one dimension is a column under its key, as in CSV. An array `q` with two, samples × joints, makes columns `q1`, `q2` …, or
//! `<joint>.q` where an array of names (`joints`, `joint_names` or `names`) says whose they are. `[columns]` may name an array, for all joints, or
//! one of its columns, `positions[:,2]` (`npz/arrays.rs`).

mod arrays;
mod directory;

use super::cells::{Sink, disk_failure};
use super::columns::is_channel;
use super::{Cells, MAX_COLUMNS, Request, assemble};
use crate::error::{Error, Place, Result};
use std::io::{BufReader, Read, Seek};
use twincal::Finding;
use twincal::signal::Log;
use zip::ZipArchive;
use zip::read::ZipFile;

/// Most bytes out per byte in of a packed array.
const RATIO: u64 = 200;
/// Arrays below this size may have any ratio, bytes.
const SMALL: u64 = 1 << 20;
/// Longest header of an array, bytes.
const MAX_HEADER: usize = 1 << 16;
/// Most arrays and most joints of an array.
const MAX_ARRAYS: usize = 10_000;
const MAX_JOINTS: usize = 1_000;
/// Rows that are read at a time.
const BLOCK: usize = 4096;
/// Keys of the array of names.
const NAMES: [&str; 3] = ["joints", "joint_names", "names"];

/// How numbers stand in an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Number {
    F8,
    F4,
    Signed(usize),
    Unsigned(usize),
    /// Text of so many UTF-32 characters.
    Text(usize),
}

/// What the header of an array says.
#[derive(Debug, Clone, PartialEq)]
struct Header {
    number: Number,
    big_endian: bool,
    by_column: bool,
    shape: Vec<usize>,
}

impl Number {
    fn bytes(self) -> usize {
        match self {
            Self::F8 => 8,
            Self::F4 => 4,
            Self::Signed(n) | Self::Unsigned(n) => n,
            Self::Text(characters) => 4 * characters,
        }
    }

    fn value(self, big_endian: bool, cell: &[u8]) -> f64 {
        let mut eight = [0; 8];
        let n = cell.len().min(8);
        eight[..n].copy_from_slice(&cell[..n]);
        if big_endian {
            eight[..n].reverse();
        }
        let bits = u64::from_le_bytes(eight);
        match self {
            Self::F8 => f64::from_bits(bits),
            Self::F4 => f64::from(f32::from_bits(bits as u32)),
            Self::Unsigned(_) => bits as f64,
            // Shifted up and back down, the sign comes along.
            Self::Signed(n) => {
                let unused = 64 - 8 * n as u32;
                ((bits << unused).cast_signed() >> unused) as f64
            }
            Self::Text(_) => f64::NAN,
        }
    }
}

/// An array and the columns that it makes.
struct Array {
    entry: usize,
    key: String,
    header: Header,
    /// First of its columns in the table, and how many.
    first: usize,
    width: usize,
}

/// Reads an NPZ log.
pub(super) fn read(
    mut source: impl Read + Seek,
    request: Request<'_>,
) -> Result<(Log<'static>, Vec<Finding>)> {
    let name = request.name;
    directory::check(&mut source, MAX_ARRAYS, name)?;
    let mut archive = archive(source, name)?;
    let (mut arrays, names) = headers(&mut archive, name)?;
    let mut columns = number_columns(&mut arrays, &names);
    let options = &*arrays::name_columns(
        name,
        &arrays,
        &names,
        &mut columns,
        request.robot,
        request.options,
    )?;
    let request = Request { options, ..request };
    refuse_transposed(name, &arrays, request.robot.dof())?;
    let selection = request.select(&columns)?;
    let wanted = selection.file_columns();
    let uses = |array: &&Array| {
        let range = array.first..array.first + array.width;
        wanted.iter().any(|column| range.contains(column))
    };
    let used: Vec<&Array> = arrays.iter().filter(uses).collect();
    let rows = common_rows(name, &used)?;
    let mut cells = Cells::reserve(name, rows, wanted.len(), request.chapters)?;
    let mut sinks = cells.sinks();
    for array in used {
        let targets: Vec<Option<usize>> = (array.first..array.first + array.width)
            .map(|column| wanted.iter().position(|w| *w == column))
            .collect();
        let (key, mut file) = open(&mut archive, array.entry, name)?;
        header(&mut file, name, &key)?;
        let read = values(&mut file, array, rows, &targets, &mut sinks);
        if let Err(e) = read.and_then(|()| end(&mut file)) {
            let damaged = || {
                let problem = format!("array `{key}` is damaged: {e}");
                Error::content(Place::file(name), problem, "write it again")
            };
            return Err(disk_failure(name, &sinks).unwrap_or_else(damaged));
        }
    }
    let mut findings = Vec::new();
    let log = assemble(request, cells, selection, &mut findings)?;
    Ok((log, findings))
}

/// The file as an archive of at most [`MAX_ARRAYS`] arrays.
fn archive<R: Read + Seek>(source: R, name: &str) -> Result<ZipArchive<R>> {
    let refuse = |problem: String, remedy: &str| Error::content(Place::file(name), problem, remedy);
    let archive = ZipArchive::new(source)
        .map_err(|e| refuse(format!("is not a whole NPZ file: {e}"), "write it again"))?;
    if archive.len() > MAX_ARRAYS {
        let problem = format!("holds {} arrays, the limit is {MAX_ARRAYS}", archive.len());
        return Err(refuse(problem, "save only the arrays that are needed"));
    }
    Ok(archive)
}

/// All arrays without their columns yet, and the joints that an array of names lists.
fn headers<R: Read + Seek>(
    archive: &mut ZipArchive<R>,
    name: &str,
) -> Result<(Vec<Array>, Vec<String>)> {
    let mut arrays = Vec::new();
    let mut names: Vec<String> = Vec::new();
    for entry in 0..archive.len() {
        let (key, mut file) = open(archive, entry, name)?;
        let header = header(&mut file, name, &key)?;
        if let Number::Text(_) = header.number
            && NAMES.contains(&key.as_str())
        {
            if header.shape.len() == 1 {
                names = text(file, &header, name, &key)?;
            }
            continue;
        }
        arrays.push(Array {
            entry,
            key,
            header,
            first: 0,
            width: 0,
        });
    }
    Ok((arrays, names))
}

/// Names of the columns that the arrays make, array by array.
fn number_columns(arrays: &mut [Array], names: &[String]) -> Vec<String> {
    let mut columns = Vec::new();
    for array in arrays {
        array.first = columns.len();
        match array.header.shape[..] {
            [_] => columns.push(array.key.clone()),
            // Beyond the limit of columns there is nothing but the error.
            [_, width] if width <= MAX_JOINTS && columns.len() <= MAX_COLUMNS => {
                let joint = |number: usize| match names.get(number) {
                    Some(joint) if names.len() == width => format!("{joint}.{}", array.key),
                    _ => format!("{}{}", array.key, number + 1),
                };
                columns.extend((0..width).map(joint));
            }
            // Numbers and stacks of tables are not of the log.
            _ => {}
        }
        array.width = columns.len() - array.first;
    }
    columns
}

/// Rows of the arrays that are read: the same number of each, and all are numbers.
fn common_rows(name: &str, used: &[&Array]) -> Result<usize> {
    let refuse = |problem: String, remedy: &str| Error::content(Place::file(name), problem, remedy);
    let is_text = |array: &&&Array| matches!(array.header.number, Number::Text(_));
    if let Some(array) = used.iter().find(is_text) {
        let problem = format!("array `{}` is text, not a number", array.key);
        return Err(refuse(problem, "save it as numbers, or under another name"));
    }
    let rows = used.first().map_or(0, |array| array.header.shape[0]);
    if let Some(other) = used.iter().find(|array| array.header.shape[0] != rows) {
        return Err(refuse(
            format!(
                "array `{}` has {} samples, `{}` has {rows}",
                other.key, other.header.shape[0], used[0].key
            ),
            "save arrays of samples × joints with one row per time stamp",
        ));
    }
    Ok(rows)
}

/// An array of a channel that has one row per joint, and as many columns as another array has samples.
fn refuse_transposed(name: &str, arrays: &[Array], joints: usize) -> Result<()> {
    let is_time = |samples: usize| arrays.iter().any(|array| array.header.shape == [samples]);
    for Array { key, header, .. } in arrays {
        if let [rows, samples] = header.shape[..]
            && rows == joints
            && samples != rows
            && is_time(samples)
            && is_channel(key)
        {
            return Err(Error::content(
                Place::file(name),
                format!("array `{key}` is {rows} × {samples}: samples come first, then joints"),
                "save it transposed: `array.T`",
            ));
        }
    }
    Ok(())
}

/// An entry with its key, if it does not claim to grow beyond reason.
fn open<'a, R: Read + Seek>(
    archive: &'a mut ZipArchive<R>,
    entry: usize,
    name: &str,
) -> Result<(String, BufReader<ZipFile<'a, R>>)> {
    let refuse = |problem: String, remedy: &str| Error::content(Place::file(name), problem, remedy);
    let file = archive
        .by_index(entry)
        .map_err(|e| refuse(format!("entry {}: {e}", entry + 1), "write it again"))?;
    let key = String::from_utf8_lossy(file.name_raw());
    let key: String = key.chars().filter(|c| !c.is_control()).collect();
    let (size, packed) = (file.size(), file.compressed_size());
    if size > SMALL && size > packed.saturating_mul(RATIO) {
        return Err(refuse(
            format!("entry `{key}` grows from {packed} to {size} bytes: refusing to expand"),
            "if it is an honest log, save it with numpy.savez instead of savez_compressed",
        ));
    }
    let key = key.strip_suffix(".npy").unwrap_or(&key).to_owned();
    Ok((key, BufReader::with_capacity(1 << 16, file)))
}

/// The header of an array; its claim is compared with the size of the entry.
fn header<R: Read + Seek>(
    file: &mut BufReader<ZipFile<'_, R>>,
    name: &str,
    key: &str,
) -> Result<Header> {
    let refuse = |problem: String| {
        Error::content(
            Place::file(name),
            format!("array `{key}` {problem}"),
            "save plain numeric arrays with numpy.savez",
        )
    };
    let damaged = |e: std::io::Error| refuse(format!("is damaged: {e}"));
    let mut head = [0; 8];
    file.read_exact(&mut head).map_err(damaged)?;
    if !head.starts_with(b"\x93NUMPY") {
        return Err(refuse("is not an array of NumPy".into()));
    }
    let mut length = [0; 4];
    let width = if head[6] == 1 { 2 } else { 4 };
    file.read_exact(&mut length[..width]).map_err(damaged)?;
    let length = u32::from_le_bytes(length) as usize;
    if length > MAX_HEADER {
        return Err(refuse(format!("has a header of {length} bytes")));
    }
    let mut text = vec![0; length];
    file.read_exact(&mut text).map_err(damaged)?;
    let text = String::from_utf8_lossy(&text);
    let parsed = parse(&text).map_err(refuse)?;
    let claimed = (parsed.shape.iter()).try_fold(parsed.number.bytes() as u64, |bytes, &n| {
        bytes.checked_mul(n as u64)
    });
    let size = file.get_ref().size();
    let held = size.saturating_sub((8 + width + length) as u64);
    if claimed != Some(held) {
        return Err(refuse(format!(
            "claims shape {:?} of {} bytes each, its data has {held} bytes",
            parsed.shape,
            parsed.number.bytes()
        )));
    }
    Ok(parsed)
}

/// `{'descr': '<f8', 'fortran_order': False, 'shape': (100, 7), }`
fn parse(text: &str) -> std::result::Result<Header, String> {
    let after = |key: &str| {
        let (_, rest) = text.split_once(key)?;
        Some(rest.trim_start().strip_prefix(':')?.trim_start())
    };
    let broken = || "has a header that NumPy does not write".to_owned();
    let descr = after("'descr'").ok_or_else(broken)?;
    let Some((descr, _)) = descr.strip_prefix('\'').and_then(|d| d.split_once('\'')) else {
        return Err("is a table of records, not of numbers".into());
    };
    let (order, kind) = descr.split_at_checked(1).ok_or_else(broken)?;
    let number = match kind {
        "f8" => Number::F8,
        "f4" => Number::F4,
        "i1" | "i2" | "i4" | "i8" => Number::Signed(usize::from(kind.as_bytes()[1] - b'0')),
        "u1" | "u2" | "u4" | "u8" => Number::Unsigned(usize::from(kind.as_bytes()[1] - b'0')),
        "b1" => Number::Unsigned(1),
        _ if order == "|" && kind.starts_with('O') => {
            return Err("holds pickled Python objects, which are never read".into());
        }
        _ => match kind.strip_prefix('U').and_then(|n| n.parse().ok()) {
            Some(characters) if characters <= MAX_HEADER => Number::Text(characters),
            _ => return Err(format!("has type `{descr}`, not a number")),
        },
    };
    let by_column = after("'fortran_order'")
        .ok_or_else(broken)?
        .starts_with("True");
    let shape = after("'shape'").and_then(|s| s.strip_prefix('(')?.split_once(')'));
    let (shape, _) = shape.ok_or_else(broken)?;
    let shape = (shape.split(',').map(str::trim))
        .filter(|n| !n.is_empty())
        .map(|n| n.trim_end_matches('L').parse().map_err(|_| broken()))
        .collect::<std::result::Result<_, _>>()?;
    Ok(Header {
        number,
        big_endian: order == ">",
        by_column,
        shape,
    })
}

/// Reads an entry to its end, where its checksum is compared.
fn end(file: &mut impl Read) -> std::io::Result<()> {
    match file.read(&mut [0])? {
        0 => Ok(()),
        _ => Err(std::io::Error::other("it goes on behind its last number")),
    }
}

/// Text of an array of names.
fn text<R: Read + Seek>(
    mut file: BufReader<ZipFile<'_, R>>,
    header: &Header,
    name: &str,
    key: &str,
) -> Result<Vec<String>> {
    let cell = header.number.bytes();
    let count = header.shape.first().copied().unwrap_or(0);
    if count > MAX_JOINTS {
        return Ok(Vec::new());
    }
    let mut bytes = Vec::new();
    (&mut file)
        .take((count * cell) as u64)
        .read_to_end(&mut bytes)
        .and_then(|_| end(&mut file))
        .map_err(|e| {
            Error::content(
                Place::file(name),
                format!("array `{key}` is damaged: {e}"),
                "write it again",
            )
        })?;
    let character = |four: &[u8]| {
        let four = <[u8; 4]>::try_from(four).ok()?;
        let code = if header.big_endian {
            u32::from_be_bytes(four)
        } else {
            u32::from_le_bytes(four)
        };
        char::from_u32(code).filter(|c| !c.is_control())
    };
    Ok((bytes.chunks_exact(cell.max(1)))
        .map(|cell| cell.chunks_exact(4).filter_map(character).collect())
        .collect())
}

/// Reads the data behind the header into the columns that are wanted.
fn values<R: Read + Seek>(
    file: &mut BufReader<ZipFile<'_, R>>,
    array: &Array,
    rows: usize,
    targets: &[Option<usize>],
    sinks: &mut [Sink<'_>],
) -> std::io::Result<()> {
    let Header {
        number, big_endian, ..
    } = array.header;
    let size = number.bytes();
    // Column after column, or all columns row by row.
    let by_column = array.header.by_column && array.header.shape.len() == 2;
    let (passes, width) = if by_column {
        (array.width, 1)
    } else {
        (1, array.width)
    };
    let mut block = Vec::new();
    for pass in 0..passes {
        for from in (0..rows).step_by(BLOCK) {
            let count = BLOCK.min(rows - from);
            block.resize(count * width * size, 0);
            file.read_exact(&mut block)?;
            for (place, target) in targets[pass..][..width].iter().enumerate() {
                let cells = block.chunks_exact(size).skip(place).step_by(width);
                if let Some(to) = target {
                    sinks[*to].extend(cells.map(|cell| number.value(big_endian, cell)))?;
                }
            }
        }
    }
    Ok(())
}
