//! Numbers that start at a cache line: the widest vectors, which are as long as one, then never cross two.

use super::LANES;
use std::ops::{Deref, DerefMut};

/// A vector of numbers of fixed length.
#[derive(Debug)]
pub struct Aligned {
    values: Vec<f64>,
    start: usize,
    len: usize,
}

impl Aligned {
    /// `len` zeros.
    pub fn zeros(len: usize) -> Self {
        let values = vec![0.0; len + LANES - 1];
        // Alignment is a matter of speed alone: where it cannot be told, any start is right.
        let start = values.as_ptr().align_offset(LANES * size_of::<f64>());
        let start = if start < LANES { start } else { 0 };
        Self { values, start, len }
    }

    /// Another length; what the numbers are then is not said.
    pub fn resize(&mut self, len: usize) {
        match self.start + len <= self.values.len() {
            true => self.len = len,
            false => *self = Self::zeros(len),
        }
    }
}

impl Default for Aligned {
    fn default() -> Self {
        Self::zeros(0)
    }
}

impl Deref for Aligned {
    type Target = [f64];

    #[inline(always)]
    fn deref(&self) -> &[f64] {
        &self.values[self.start..][..self.len]
    }
}

impl DerefMut for Aligned {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.values[self.start..][..self.len]
    }
}

impl Clone for Aligned {
    /// Elsewhere in memory a cache line starts elsewhere.
    fn clone(&self) -> Self {
        let mut copy = Self::zeros(self.len);
        copy.copy_from_slice(self);
        copy
    }
}

/// A value that starts at a cache line.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub struct Line<T>(pub T);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_length_starts_at_a_cache_line() {
        let mut numbers = Aligned::default();
        for len in [5, 1000, 0, 999, 1001] {
            numbers.resize(len);
            numbers.fill(1.0);
            assert_eq!(numbers.len(), len);
            assert_eq!(numbers.as_ptr().align_offset(64), 0);
        }
    }

    #[test]
    fn numbers_start_at_a_cache_line_in_every_copy() {
        for len in [0, 1, 7, 8, 1000] {
            let mut numbers = Aligned::zeros(len);
            numbers
                .iter_mut()
                .enumerate()
                .for_each(|(i, x)| *x = i as f64);
            let copies: Vec<Aligned> = (0..5).map(|_| numbers.clone()).collect();
            for copy in &copies {
                assert_eq!(copy.as_ptr().align_offset(64), 0);
                assert!(copy.iter().enumerate().all(|(i, x)| *x == i as f64) && copy.len() == len);
            }
        }
    }
}
