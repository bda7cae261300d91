//! What the pages of a Parquet column chunk claim about themselves, checked before anything is allocated for them.
//!
//! A page header is a Thrift compact struct; only its sizes and counts are read here (parquet-format, `PageHeader`).

use std::io::{Read, Seek, SeekFrom};

/// Largest page after decompression, bytes.
pub(super) const MAX_PAGE: i64 = 1 << 28;
/// Longest page header (it may carry statistics), bytes.
const MAX_HEADER: usize = 1 << 16;
/// Deepest nesting of structs in a header.
const MAX_DEPTH: u32 = 8;

/// Sizes and counts of one page.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct PageHeader {
    kind: i64,
    uncompressed: i64,
    compressed: i64,
    values: i64,
}

/// Walks the pages of one column chunk and compares what they claim with the chunk's `values` and `length` bytes. Bytes that the
/// largest page takes, packed and unpacked together.
///
/// # Errors
/// A sentence that says what does not fit.
pub(super) fn check_chunk(
    file: &mut (impl Read + Seek),
    start: u64,
    length: u64,
    values: i64,
) -> Result<u64, String> {
    let (mut position, mut largest) = (0, 0);
    let mut seen = 0_i64;
    let mut buffer = Vec::new();
    while seen < values && position < length {
        let at = start + position;
        let (header, size) = header_at(file, at, length - position, &mut buffer)?;
        if !(0..=MAX_PAGE).contains(&header.uncompressed) {
            return Err(format!(
                "the page at byte {at} claims {} bytes, the limit is {MAX_PAGE}",
                header.uncompressed
            ));
        }
        // 0 and 3 are data pages; a dictionary (2) counts its own entries.
        let is_data = matches!(header.kind, 0 | 3);
        if header.values < 0 || header.values > values || is_data && header.values > values - seen {
            return Err(format!(
                "the page at byte {at} declares {} values, its column chunk has {values}",
                header.values
            ));
        }
        if header.compressed < 0 || header.compressed as u64 > length - position - size as u64 {
            return Err(format!(
                "the page at byte {at} claims {} bytes beyond its column chunk",
                header.compressed
            ));
        }
        largest = largest.max((header.compressed + header.uncompressed) as u64);
        seen += if is_data { header.values } else { 0 };
        position += size as u64 + header.compressed as u64;
    }
    if seen != values {
        return Err(format!(
            "the pages hold {seen} values, the column chunk declares {values}"
        ));
    }
    Ok(largest)
}

/// The page header at a byte of a file that has `left` bytes of its column chunk, and its size.
///
/// # Errors
/// That it cannot be read, or is broken.
fn header_at(
    file: &mut (impl Read + Seek),
    at: u64,
    left: u64,
    buffer: &mut Vec<u8>,
) -> Result<(PageHeader, usize), String> {
    // Most headers are a few dozen bytes.
    for room in [256, MAX_HEADER as u64] {
        buffer.clear();
        file.seek(SeekFrom::Start(at)).map_err(|e| e.to_string())?;
        (&mut *file)
            .take(room.min(left))
            .read_to_end(buffer)
            .map_err(|e| e.to_string())?;
        let mut reader = Compact {
            bytes: buffer,
            at: 0,
        };
        if let Some(header) = reader.page_header() {
            return Ok((header, reader.at));
        }
    }
    Err(format!("the page header at byte {at} is broken"))
}

/// A reader of the Thrift compact protocol that never allocates.
struct Compact<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Compact<'_> {
    fn byte(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.at)?;
        self.at += 1;
        Some(byte)
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7F) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    fn zigzag(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    fn jump(&mut self, bytes: u64) -> Option<()> {
        let to = self.at.checked_add(usize::try_from(bytes).ok()?)?;
        (to <= self.bytes.len()).then(|| self.at = to)
    }

    /// Visits the fields of a struct: `visit(reader, id, type)` has to consume the value.
    fn fields(&mut self, mut visit: impl FnMut(&mut Self, i64, u8) -> Option<()>) -> Option<()> {
        let mut id = 0_i64;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Some(());
            }
            id = match head >> 4 {
                0 => self.zigzag()?,
                step => id + i64::from(step),
            };
            visit(self, id, head & 0x0F)?;
        }
    }

    fn skip(&mut self, kind: u8, depth: u32) -> Option<()> {
        if depth == 0 {
            return None;
        }
        match kind {
            1 | 2 => Some(()),
            3 => self.jump(1),
            4..=6 => self.varint().map(|_| ()),
            7 => self.jump(8),
            8 => {
                let length = self.varint()?;
                self.jump(length)
            }
            9 | 10 => {
                let head = self.byte()?;
                let size = match head >> 4 {
                    15 => self.varint()?,
                    n => u64::from(n),
                };
                // Elements of type bool take a byte each.
                let element = head & 0x0F;
                for _ in 0..size {
                    if matches!(element, 1 | 2) {
                        self.jump(1)?;
                    } else {
                        self.skip(element, depth - 1)?;
                    }
                }
                Some(())
            }
            12 => self.fields(|reader, _, kind| reader.skip(kind, depth - 1)),
            _ => None,
        }
    }

    /// Field 1 is the kind, 2 and 3 the sizes; the first field of 5, 7 or 8 counts values.
    fn page_header(&mut self) -> Option<PageHeader> {
        let mut page = PageHeader {
            kind: -1,
            ..PageHeader::default()
        };
        self.fields(|reader, id, kind| {
            match (id, kind) {
                (1, 5) => page.kind = reader.zigzag()?,
                (2, 5) => page.uncompressed = reader.zigzag()?,
                (3, 5) => page.compressed = reader.zigzag()?,
                (5 | 7 | 8, 12) => reader.fields(|reader, id, kind| {
                    if (id, kind) == (1, 5) {
                        page.values = reader.zigzag()?;
                        return Some(());
                    }
                    reader.skip(kind, MAX_DEPTH)
                })?,
                _ => reader.skip(kind, MAX_DEPTH)?,
            }
            Some(())
        })?;
        Some(page)
    }
}
