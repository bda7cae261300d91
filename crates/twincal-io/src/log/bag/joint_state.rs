//! One `sensor_msgs/JointState` from its bytes: CDR as ROS 2 writes it (both byte orders), or the ROS 1 form.
//!
//! CDR (OMG DDS-XTypes 1.3, 7.4): a header of 4 bytes names byte order and version, and alignment counts from behind it. Version 1 aligns
//! doubles to 8 bytes, version 2 to 4. ROS 1 has no header, no alignment and no closing zero of strings.

/// Longest list of joints in a message.
const MAX_JOINTS: u32 = 4096;

/// How messages of a topic are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    /// ROS 2.
    Cdr,
    /// ROS 1.
    Ros1,
}

/// A message, borrowed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct JointState<'a> {
    /// `header.stamp`, ns.
    pub(super) stamp: i64,
    /// The bytes of `name[]` as they stand, counts included: equal bytes are equal names.
    pub(super) names: NameBlock<'a>,
    /// `position[]`, `velocity[]`, `effort[]`.
    pub(super) values: [Doubles<'a>; 3],
}

/// `name[]` as bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct NameBlock<'a> {
    bytes: &'a [u8],
    layout: Layout,
}

/// A list of doubles as bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Doubles<'a> {
    bytes: &'a [u8],
    big_endian: bool,
}

impl Doubles<'_> {
    /// How many.
    pub(super) fn len(self) -> usize {
        self.bytes.len() / 8
    }

    /// Number `index`; NaN beyond the end.
    #[inline]
    pub(super) fn get(self, index: usize) -> f64 {
        match self.bytes.get(index * 8..index * 8 + 8) {
            Some(&[a, b, c, d, e, f, g, h]) if self.big_endian => {
                f64::from_be_bytes([a, b, c, d, e, f, g, h])
            }
            Some(&[a, b, c, d, e, f, g, h]) => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
            _ => f64::NAN,
        }
    }
}

impl NameBlock<'_> {
    /// The names, control characters out.
    pub(super) fn decode(self) -> Vec<String> {
        let mut cursor = Cursor {
            bytes: self.bytes,
            at: 0,
            layout: self.layout,
        };
        let mut names = Vec::new();
        // The block was walked once already, so that nothing in it reaches past its end.
        for _ in 0..cursor.u32().unwrap_or(0) {
            let text = cursor.string().unwrap_or_default();
            let text = String::from_utf8_lossy(text);
            names.push(text.chars().filter(|c| !c.is_control()).collect());
        }
        names
    }
}

/// The parts of a message that the encoding's header decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) big_endian: bool,
    /// Largest alignment, bytes; 1: none.
    alignment: usize,
    /// Strings end with a zero that counts.
    zero: bool,
}

/// A place in a message.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cursor<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
    pub(super) layout: Layout,
}

impl<'a> Cursor<'a> {
    #[inline]
    pub(super) fn align(&mut self, size: usize) {
        let size = size.min(self.layout.alignment);
        self.at = self.at.div_ceil(size) * size;
    }

    #[inline]
    pub(super) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let end = self.at.checked_add(count)?;
        let taken = self.bytes.get(self.at..end)?;
        self.at = end;
        Some(taken)
    }

    #[inline]
    pub(super) fn u32(&mut self) -> Option<u32> {
        self.align(4);
        let bytes = <[u8; 4]>::try_from(self.take(4)?).ok()?;
        Some(if self.layout.big_endian {
            u32::from_be_bytes(bytes)
        } else {
            u32::from_le_bytes(bytes)
        })
    }

    pub(super) fn string(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()? as usize;
        let text = self.take(length)?;
        match text.split_last() {
            Some((0, text)) if self.layout.zero => Some(text),
            _ => Some(text),
        }
    }

    fn doubles(&mut self) -> Option<Doubles<'a>> {
        let count = self.u32()?;
        if count > MAX_JOINTS {
            return None;
        }
        if count > 0 {
            self.align(8);
        }
        Some(Doubles {
            bytes: self.take(count as usize * 8)?,
            big_endian: self.layout.big_endian,
        })
    }
}

/// Reads a message. `known` is the name block of an earlier one: if it stands here too, it is not walked again.
///
/// # Errors
/// A sentence that says what does not fit.
pub(super) fn decode<'a>(
    encoding: Encoding,
    message: &'a [u8],
    known: &[u8],
) -> Result<JointState<'a>, String> {
    let mut cursor = begin(encoding, message)?;
    let (bytes, layout) = (cursor.bytes, cursor.layout);
    let end = |what: &str| format!("its {what} reaches past its end ({} bytes)", message.len());
    if encoding == Encoding::Ros1 {
        cursor.u32().ok_or_else(|| end("header"))?; // seq
    }
    let seconds = cursor.u32().ok_or_else(|| end("header"))?;
    let nanoseconds = cursor.u32().ok_or_else(|| end("header"))?;
    if nanoseconds >= 1_000_000_000 {
        return Err(format!("its header.stamp has {nanoseconds} ns"));
    }
    let seconds = match encoding {
        Encoding::Cdr => i64::from(seconds.cast_signed()),
        Encoding::Ros1 => i64::from(seconds),
    };
    cursor.string().ok_or_else(|| end("frame_id"))?;
    cursor.align(4);
    let start = cursor.at;
    let is_known = !known.is_empty() && bytes[start.min(bytes.len())..].starts_with(known);
    if is_known {
        cursor.at += known.len();
    } else {
        let count = cursor.u32().ok_or_else(|| end("name[]"))?;
        if count > MAX_JOINTS {
            return Err(format!(
                "it claims {count} names, the limit is {MAX_JOINTS}"
            ));
        }
        for _ in 0..count {
            cursor.string().ok_or_else(|| end("name[]"))?;
        }
    }
    let names = NameBlock {
        bytes: &bytes[start..cursor.at],
        layout,
    };
    let position = cursor.doubles().ok_or_else(|| end("position[]"))?;
    let velocity = cursor.doubles().ok_or_else(|| end("velocity[]"))?;
    let effort = cursor.doubles().ok_or_else(|| end("effort[]"))?;
    Ok(JointState {
        stamp: seconds * 1_000_000_000 + i64::from(nanoseconds),
        names,
        values: [position, velocity, effort],
    })
}

impl<'a> NameBlock<'a> {
    /// The bytes, for [`decode`].
    pub(super) fn bytes(self) -> &'a [u8] {
        self.bytes
    }
}

/// The first byte behind what the encoding puts before a message.
pub(super) fn begin(encoding: Encoding, message: &[u8]) -> Result<Cursor<'_>, String> {
    let (bytes, layout) = match encoding {
        Encoding::Ros1 => (
            message,
            Layout {
                big_endian: false,
                alignment: 1,
                zero: false,
            },
        ),
        Encoding::Cdr => cdr_header(message)?,
    };
    Ok(Cursor {
        bytes,
        at: 0,
        layout,
    })
}

/// Byte order and alignment from the first two bytes; the payload behind the first four.
fn cdr_header(message: &[u8]) -> Result<(&[u8], Layout), String> {
    let (head, bytes) = message
        .split_at_checked(4)
        .ok_or_else(|| format!("it has {} bytes, fewer than a CDR header", message.len()))?;
    let (big_endian, alignment) = match head[..2] {
        [0, 0] => (true, 8),
        [0, 1] => (false, 8),
        [0, 6] => (true, 4),
        [0, 7] => (false, 4),
        _ => {
            return Err(format!(
                "its CDR header {:02x} {:02x} is none of plain CDR (00 00, 00 01, 00 06, 00 07)",
                head[0], head[1]
            ));
        }
    };
    let layout = Layout {
        big_endian,
        alignment,
        zero: true,
    };
    Ok((bytes, layout))
}
