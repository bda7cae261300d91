//! Logs compared with each other, and with themselves over time: is each a recording of its own, and is it read as the others are?

mod common_fit;
mod copies;
mod excerpt;
mod rows;
mod signature;
mod sketch;
mod stuck;
mod torque;

pub use copies::copies;
pub use excerpt::Excerpt;
pub use sketch::{Sketch, sketched_copies};
pub use stuck::stuck_encoders;
pub use torque::{Compared, odd_torque};
