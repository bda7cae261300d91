//! The text of a file in pieces: a long one grows without a copy, and into memory that is free here and there.

use std::io::{Read, Write};

/// Bytes of a full piece.
const PIECE: usize = 1 << 20;

/// The contents of a file.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Pieces(Vec<Vec<u8>>);

impl From<Vec<u8>> for Pieces {
    fn from(bytes: Vec<u8>) -> Self {
        Self(vec![bytes])
    }
}

impl Pieces {
    /// Piece by piece.
    pub(super) fn iter(&self) -> impl Iterator<Item = &[u8]> {
        self.0.iter().map(Vec::as_slice)
    }

    /// Bytes of all pieces.
    pub(super) fn len(&self) -> usize {
        self.0.iter().map(Vec::len).sum()
    }

    /// All pieces in one.
    pub(crate) fn to_vec(&self) -> Vec<u8> {
        self.0.concat()
    }

    /// The bytes as a file has them.
    pub(crate) fn reader(&self) -> impl Read {
        Reader {
            piece: &[],
            behind: self.iter(),
        }
    }
}

struct Reader<'a, I> {
    piece: &'a [u8],
    behind: I,
}

impl<'a, I: Iterator<Item = &'a [u8]>> Read for Reader<'a, I> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        while self.piece.is_empty() {
            match self.behind.next() {
                Some(next) => self.piece = next,
                None => return Ok(0),
            }
        }
        self.piece.read(buffer)
    }
}

impl Write for Pieces {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.0.last().is_none_or(|last| last.len() >= PIECE) {
            self.0.push(Vec::with_capacity(PIECE));
        }
        let room = self.0.last_mut().map(|last| (PIECE - last.len(), last));
        let Some((room, last)) = room else {
            return Ok(0);
        };
        let taken = bytes.len().min(room);
        last.extend_from_slice(&bytes[..taken]);
        Ok(taken)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::artifact::sha256;

    /// Bytes come back in order over the borders of pieces, whatever lengths they were written in.
    #[test]
    fn what_is_written_is_read() {
        let bytes: Vec<u8> = (0..5 * PIECE / 2).map(|k| (k * k % 251) as u8).collect();
        let mut pieces = Pieces::default();
        let (first, rest) = bytes.split_at(PIECE - 7);
        pieces.write_all(first).unwrap();
        rest.chunks(4099)
            .for_each(|chunk| pieces.write_all(chunk).unwrap());
        let mut read = Vec::new();
        pieces.reader().read_to_end(&mut read).unwrap();
        assert!(read == bytes && pieces.to_vec() == bytes);
        assert_eq!((pieces.len(), pieces.iter().count()), (bytes.len(), 3));
        let target = tempfile::tempdir().unwrap();
        let target = target.path().join("out");
        let claim = crate::artifact::Claim::new(
            &target,
            crate::artifact::Replace::Never,
            &Default::default(),
        );
        let files = vec![("twin.json", pieces)];
        claim
            .unwrap()
            .commit(crate::artifact::Maker::Fit, files)
            .unwrap();
        let artifact = crate::artifact::Artifact::open(&target).unwrap();
        artifact.verify_except(&[]).unwrap();
        assert_eq!(sha256(&artifact.read("twin.json").unwrap()), sha256(&bytes));
    }
}
