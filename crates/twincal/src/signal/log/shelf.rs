//! Numbers that are made of a long log and need not stay in memory.

use crate::error::{Error, Result};
use std::borrow::Cow;
use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;

/// Where numbers that are made of a long log are put away, so that they need not stay in memory.
pub trait Shelf: Debug + Send + Sync {
    /// Puts numbers away; the place where they are.
    ///
    /// # Errors
    /// [`Error::Log`] where there is no room.
    fn put(&self, numbers: &[f64]) -> Result<u64>;

    /// Takes back numbers that were put there, all but the first `skip`, as many as there is room for. Where they cannot be read they are
    /// NaN, and [`Shelf::failure`] says why: those who sum over rows have no better answer, and the calibration ends with it.
    fn get(&self, place: u64, skip: usize, numbers: &mut [f64]);

    /// The first failure of [`Shelf::put`] or [`Shelf::get`].
    fn failure(&self) -> Option<Error>;
}

/// Numbers in memory or on a shelf.
#[derive(Debug, Clone)]
pub enum Numbers {
    /// In memory.
    Memory(Vec<f64>),
    /// Away.
    Shelf {
        /// Where.
        shelf: Arc<dyn Shelf>,
        /// One behind the other: their first number, and the place.
        blocks: Vec<(usize, u64)>,
        /// Numbers of all blocks.
        len: usize,
    },
}

impl Default for Numbers {
    /// None, in memory.
    fn default() -> Self {
        Self::Memory(Vec::new())
    }
}

impl From<Vec<f64>> for Numbers {
    fn from(numbers: Vec<f64>) -> Self {
        Self::Memory(numbers)
    }
}

impl PartialEq for Numbers {
    /// The same numbers, wherever they are.
    fn eq(&self, other: &Self) -> bool {
        self.get() == other.get()
    }
}

impl Numbers {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Memory(numbers) => numbers.len(),
            Self::Shelf { len, .. } => *len,
        }
    }

    /// Leaves them on a shelf, if they are not on one.
    ///
    /// # Errors
    /// Those of [`Shelf::put`].
    pub(crate) fn put_away(&mut self, shelf: &Arc<dyn Shelf>) -> Result<()> {
        if let Self::Memory(numbers) = self {
            let mut away = Self::Shelf {
                shelf: shelf.clone(),
                blocks: Vec::new(),
                len: 0,
            };
            away.append(numbers)?;
            *self = away;
        }
        Ok(())
    }

    /// Takes memory for as many in all, where they are in memory.
    pub(crate) fn reserve(&mut self, most: usize) {
        if let Self::Memory(numbers) = self {
            numbers.reserve_exact(most.saturating_sub(numbers.len()));
        }
    }

    /// Puts more behind them, where they are.
    ///
    /// # Errors
    /// Those of [`Shelf::put`].
    pub(crate) fn append(&mut self, more: &[f64]) -> Result<()> {
        match self {
            Self::Memory(numbers) => numbers.extend_from_slice(more),
            Self::Shelf { shelf, blocks, len } if !more.is_empty() => {
                blocks.push((*len, shelf.put(more)?));
                *len += more.len();
            }
            Self::Shelf { .. } => {}
        }
        Ok(())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All of them.
    pub fn get(&self) -> Cow<'_, [f64]> {
        self.some(0..self.len())
    }

    /// Some of them.
    ///
    /// # Panics
    /// If there are not so many.
    pub fn some(&self, range: Range<usize>) -> Cow<'_, [f64]> {
        let (shelf, blocks, len) = match self {
            Self::Memory(numbers) => return Cow::Borrowed(&numbers[range]),
            Self::Shelf { shelf, blocks, len } => (shelf, blocks, *len),
        };
        let mut numbers = vec![0.0; range.len()];
        let ends = blocks.iter().skip(1).map(|(first, _)| *first);
        for (&(first, place), end) in blocks.iter().zip(ends.chain([len])) {
            let (from, to) = (range.start.max(first), range.end.min(end));
            if from < to {
                let room = &mut numbers[from - range.start..to - range.start];
                shelf.get(place, from - first, room);
            }
        }
        Cow::Owned(numbers)
    }
}
