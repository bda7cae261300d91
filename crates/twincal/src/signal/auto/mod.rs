//! What is chosen from the data: the pipeline, and the logs made ready for it.

pub(super) mod choose;
pub(super) mod cutoff;
pub(super) mod encoder;
pub(super) mod few_chapters;
pub(super) mod filtered;
pub(super) mod ready;
pub(super) mod settings;
pub(super) mod sound;
pub(super) mod stretches;
pub(super) mod survey;
pub(super) mod unexcited;
