//! Where the chapters of a long log come from.

use super::recording::Recording;
use crate::error::Result;
use std::fmt::Debug;

/// Where the chapters of a log come from.
pub trait ReadChapter: Debug + Send + Sync {
    /// Chapter number `chapter`, counted from 0; its name and what was carried do not matter.
    ///
    /// # Errors
    /// [`crate::Error::Log`] where it cannot be read again.
    fn read(&self, chapter: usize) -> Result<Recording>;

    /// The positions of one joint in a chapter, as [`ReadChapter::read`] gives them.
    ///
    /// # Errors
    /// Those of [`ReadChapter::read`].
    fn positions(&self, chapter: usize, joint: usize) -> Result<Vec<f64>> {
        Ok(std::mem::take(&mut self.read(chapter)?.joints[joint].q))
    }
}
