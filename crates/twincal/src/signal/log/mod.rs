//! What a log is: recordings, chapters of long ones, joints and stamps.

pub(super) mod chapters;
pub(super) mod joints;
pub(super) mod long;
pub(super) mod read_chapter;
pub(super) mod recording;
pub(super) mod shelf;
pub(super) mod stamps;
pub(super) mod unwrap;
