//! One file, parts of which several threads read: each part is found and read as one.

use bytes::Bytes;
use parquet::errors::{ParquetError, Result};
use parquet::file::reader::{ChunkReader, Length};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes taken at a time where it is not known how many are needed: headers of pages.
const SOME: usize = 512;

/// The file; all clones have one position, which nobody relies on.
#[derive(Debug, Clone)]
pub(super) struct SharedFile {
    file: Arc<Mutex<File>>,
    length: u64,
}

impl SharedFile {
    /// # Errors
    /// If the file does not tell its length.
    pub(super) fn new(file: File) -> std::io::Result<Self> {
        let length = file.metadata()?.len();
        let file = Arc::new(Mutex::new(file));
        Ok(Self { file, length })
    }

    /// Reads from `start` on with nobody in between.
    fn at<T>(
        &self,
        start: u64,
        read: impl FnOnce(&mut File) -> std::io::Result<T>,
    ) -> std::io::Result<T> {
        // A thread that panicked left nothing but a position.
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(start))?;
        read(&mut file)
    }
}

/// The file from a position on.
#[derive(Debug)]
pub(super) struct Rest {
    file: SharedFile,
    position: u64,
}

impl Read for Rest {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        let count = self.file.at(self.position, |file| file.read(to))?;
        self.position += count as u64;
        Ok(count)
    }
}

impl Length for SharedFile {
    fn len(&self) -> u64 {
        self.length
    }
}

impl ChunkReader for SharedFile {
    type T = BufReader<Rest>;

    fn get_read(&self, start: u64) -> Result<Self::T> {
        let rest = Rest {
            file: self.clone(),
            position: start,
        };
        Ok(BufReader::with_capacity(SOME, rest))
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes> {
        // Before memory is taken for them.
        let there = self.length.saturating_sub(start);
        if length as u64 > there {
            return Err(ParquetError::EOF(format!(
                "{length} bytes at {start} are claimed, the file has {there}"
            )));
        }
        let mut bytes = Vec::with_capacity(length);
        let take = length as u64;
        let read = self.at(start, |file| file.take(take).read_to_end(&mut bytes))?;
        if read < length {
            return Err(ParquetError::EOF(format!(
                "{length} bytes at {start} are claimed, {read} could be read"
            )));
        }
        Ok(bytes.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;
    use std::io::Write;

    #[test]
    fn threads_read_what_stands_at_their_place() {
        let mut file = tempfile::tempfile().unwrap();
        let all: Vec<u8> = (0..1_u32 << 18).flat_map(u32::to_le_bytes).collect();
        file.write_all(&all).unwrap();
        let shared = SharedFile::new(file).unwrap();
        assert_eq!(Length::len(&shared), all.len() as u64);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(8).build();
        pool.unwrap().install(|| {
            (0..4000_usize).into_par_iter().for_each(|k| {
                let (start, length) = (k * 257, k % 1500);
                let wanted = &all[start..start + length];
                let bytes = shared.get_bytes(start as u64, length).unwrap();
                assert_eq!(bytes, wanted);
                let mut read = vec![0; length];
                let mut rest = shared.get_read(start as u64).unwrap();
                // More than the buffer holds, a little at a time.
                for part in read.chunks_mut(100) {
                    rest.read_exact(part).unwrap();
                }
                assert_eq!(read, wanted);
            });
        });
    }

    #[test]
    fn bytes_beyond_the_end_are_refused_before_memory_is_taken() {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(b"PAR1").unwrap();
        let shared = SharedFile::new(file).unwrap();
        assert!(shared.get_bytes(0, 4).is_ok());
        for (start, length) in [(0, 5), (4, 1), (100, 1), (1, usize::MAX)] {
            assert!(shared.get_bytes(start, length).is_err());
        }
    }
}
