//! Memory that signals are written to.

use crate::lanes::Aligned;
use std::ops::DerefMut;

/// Memory for the signals of a joint, one after the other. Where it starts at a cache line they are written faster.
pub trait Table: DerefMut<Target = [f64]> {
    /// Another length; what the numbers are then is not said.
    fn resize(&mut self, len: usize);
}

impl Table for Vec<f64> {
    fn resize(&mut self, len: usize) {
        Self::resize(self, len, 0.0);
    }
}

impl Table for Aligned {
    fn resize(&mut self, len: usize) {
        Self::resize(self, len);
    }
}
