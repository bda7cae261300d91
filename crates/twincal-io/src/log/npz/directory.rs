//! What the end of a ZIP file claims of its entries, compared with limits before a list of them is made (APPNOTE 6.3.10, 4.3.14 and 4.3.16).

use crate::error::{Error, Place, Result};
use std::io::{self, Read, Seek, SeekFrom};

/// Largest list of entries, bytes.
const MAX_BYTES: u64 = 16 << 20;
/// Bytes of the end record, of the locator before it and of the 64-bit end record.
const END: usize = 22;
const LOCATOR: usize = 20;
const END_64: usize = 56;
/// Longest comment behind the end record, bytes.
const COMMENT: u64 = 1 << 16;

/// Refuses an archive with too many entries or too long a list of them.
///
/// # Errors
/// [`Error::Content`] with the number.
pub(super) fn check(source: &mut (impl Read + Seek), most: usize, name: &str) -> Result<()> {
    let refuse = |problem: String, remedy: &str| Error::content(Place::file(name), problem, remedy);
    let claims = claims(source)
        .map_err(|e| refuse(format!("is not a whole NPZ file: {e}"), "write it again"))?;
    let remedy = "save only the arrays that are needed";
    match claims {
        Some((entries, _)) if entries > most as u64 => Err(refuse(
            format!("holds {entries} arrays, the limit is {most}"),
            remedy,
        )),
        Some((_, bytes)) if bytes > MAX_BYTES => Err(refuse(
            format!("has a list of arrays of {bytes} bytes, the limit is {MAX_BYTES}"),
            remedy,
        )),
        // Without an end record it is no archive, as its reader will say.
        _ => Ok(()),
    }
}

/// Number of entries, and bytes of their list, by the last end record.
fn claims(source: &mut (impl Read + Seek)) -> io::Result<Option<(u64, u64)>> {
    let length = source.seek(SeekFrom::End(0))?;
    let from = length.saturating_sub(COMMENT + (END + LOCATOR) as u64);
    source.seek(SeekFrom::Start(from))?;
    let mut tail = Vec::new();
    (&mut *source).take(length - from).read_to_end(&mut tail)?;
    let end = (tail.windows(4)).rposition(|four| four == b"PK\x05\x06");
    let found = match end.filter(|end| tail.len() - end >= END) {
        None => None,
        Some(end) => {
            let (entries, bytes) = (number(&tail, end + 10, 2), number(&tail, end + 12, 4));
            let locator = end.checked_sub(LOCATOR).map(|at| &tail[at..end]);
            match locator.filter(|locator| locator.starts_with(b"PK\x06\x07")) {
                Some(locator) => large(source, number(locator, 8, 8))?,
                None => Some((entries, bytes)),
            }
        }
    };
    source.seek(SeekFrom::Start(0))?;
    Ok(found)
}

/// The same by the 64-bit end record at a place.
fn large(source: &mut (impl Read + Seek), at: u64) -> io::Result<Option<(u64, u64)>> {
    source.seek(SeekFrom::Start(at))?;
    let mut end = Vec::new();
    (&mut *source).take(END_64 as u64).read_to_end(&mut end)?;
    let whole = end.len() == END_64 && end.starts_with(b"PK\x06\x06");
    Ok(whole.then(|| (number(&end, 32, 8), number(&end, 40, 8))))
}

/// A little-endian number of so many bytes; 0 beyond the end.
fn number(bytes: &[u8], at: usize, width: usize) -> u64 {
    let bytes = bytes.get(at..at + width).unwrap_or(&[]);
    (bytes.iter().rev()).fold(0, |sum, byte| sum << 8 | u64::from(*byte))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn archive(entries: u16, bytes: u32, large: Option<(u64, u64)>) -> Vec<u8> {
        let mut file = b"PK\x03\x04".to_vec();
        if let Some((entries, bytes)) = large {
            let at = file.len() as u64;
            file.extend(b"PK\x06\x06");
            file.resize(file.len() + 28, 0);
            file.extend(entries.to_le_bytes());
            file.extend(bytes.to_le_bytes());
            file.resize(file.len() + 8, 0);
            file.extend(b"PK\x06\x07\0\0\0\0");
            file.extend(at.to_le_bytes());
            file.extend([0; 4]);
        }
        file.extend(b"PK\x05\x06\0\0\0\0\0\0");
        file.extend(entries.to_le_bytes());
        file.extend(bytes.to_le_bytes());
        file.extend([0; 6]);
        file
    }

    #[test]
    fn the_end_says_how_much_there_is() {
        let most = 10_000;
        let check = |bytes: Vec<u8>| check(&mut Cursor::new(bytes), most, "x.npz");
        assert!(check(archive(10_000, 1 << 20, None)).is_ok());
        assert!(check(b"no archive".to_vec()).is_ok());
        for (bytes, words) in [
            (
                archive(10_001, 0, None),
                "holds 10001 arrays, the limit is 10000",
            ),
            (
                archive(7, u32::MAX - 1, None),
                "a list of arrays of 4294967294 bytes",
            ),
            (
                archive(u16::MAX, u32::MAX, Some((1 << 40, 5))),
                "holds 1099511627776 arrays",
            ),
            (
                archive(7, 7, Some((7, 1 << 40))),
                "a list of arrays of 1099511627776 bytes",
            ),
        ] {
            let error = check(bytes).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
        assert!(check(archive(u16::MAX, u32::MAX, Some((7, 7)))).is_ok());
    }
}
