//! From a recording to uniform, finite, filtered motion and torque (method section 1).

mod agreement;
mod align;
mod chapters;
mod choose;
mod chapter_motion;
mod filtered;
mod unexcited;
mod segment;
mod prepared_log;
mod remember;
mod read_chapter;
mod pieces;
mod joints;
mod stamps;
mod clock;
pub(crate) mod convolve;
pub(crate) mod decimate;
mod correct;
mod fourier;
mod held;
mod history;
mod jumps;
mod long;
mod cutoff;
mod describe;
mod encoder;
mod few_chapters;
pub(crate) mod fir;
pub(crate) mod interpolate;
mod mask;
mod pipeline;
mod prepare;
mod ready;
mod recording;
mod repeats;
mod saturation;
mod settings;
mod shelf;
mod sound;
mod spectrum;
pub(crate) mod spline;
mod standstill;
mod steps;
mod stretches;
mod survey;
mod thin;
mod ticks;
mod torque;
mod trajectory;
mod travel;
mod units;
mod unwrap;

pub use agreement::{Agreement, velocity_agreement};
pub use align::align;
pub(crate) use align::align_part;
pub use chapter_motion::ChapterMotion;
pub use choose::{Chosen, choose_and_prepare, choose_pipeline};
pub use correct::{Corrections, DerivedFrom, Lag};
pub(crate) use describe::less_driven;
pub use describe::{JointOverview, LogOverview, describe, hardly_driven};
pub(crate) use few_chapters::FewChapters;
pub use history::{JointHistory, Warmth};
pub(crate) use history::{
    STOPS, known_temperatures, later_channel, stop_channel, temperature_at, warmth_channel,
};
pub use long::{Log, Logs, LongLog};
pub use pipeline::Pipeline;
pub use prepared_log::{PreparedLog, Raw, prepare};
pub use read_chapter::ReadChapter;
pub use ready::{LongReady, ReadyLog, ready};
pub use recording::{Channels, Payload, Recording};
pub use settings::{Auto, SignalSettings};
pub use shelf::{Numbers, Shelf};
pub(crate) use stamps::median_step;
pub use steps::{Steps, steps};
pub(crate) use stretches::stretches;
pub use torque::{constant_torque, missing_torque};
pub use trajectory::{LoggedSamples, Segment, Trajectory};

#[cfg(test)]
mod tests;
#[cfg(test)]
mod worlds;
