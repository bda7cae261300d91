//! From a recording to uniform, finite, filtered motion and torque (method section 1). A wing uses those above it only.

mod log;
mod clean;
mod filter;
mod auto;

pub use auto::choose::{Chosen, choose_and_prepare, choose_pipeline};
pub(crate) use auto::few_chapters::FewChapters;
pub use auto::ready::{LongReady, ReadyLog, ready};
pub use auto::settings::{Auto, SignalSettings};
pub(crate) use auto::stretches::stretches;
pub use clean::correct::{Corrections, DerivedFrom, Lag};
pub use clean::describe::{JointOverview, LogOverview, describe, hardly_driven};
pub(crate) use clean::describe::{less_driven, torque_rms};
pub use clean::steps::{Steps, steps};
pub use clean::torque::{constant_torque, missing_torque};
pub use filter::agreement::{Agreement, velocity_agreement};
pub use filter::align::align;
pub(crate) use filter::align::align_part;
pub use filter::chapter_motion::ChapterMotion;
pub use filter::history::{JointHistory, Warmth};
pub(crate) use filter::history::{
    STOPS, known_temperatures, later_channel, stop_channel, temperature_at, warmth_channel,
};
pub use filter::pipeline::Pipeline;
pub use filter::prepared_log::{PreparedLog, Raw, prepare};
pub use filter::trajectory::{LoggedSamples, Segment, Trajectory};
pub(crate) use filter::{decimate, fir, interpolate};
pub use log::long::{Log, Logs, LongLog};
pub use log::read_chapter::ReadChapter;
pub use log::recording::{Channels, NextChannel, Payload, Recording};
pub use log::shelf::{Numbers, Shelf};
pub(crate) use log::stamps::{is_plausible_step, median_step};

#[cfg(test)]
pub(crate) use clean::spline;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod worlds;
