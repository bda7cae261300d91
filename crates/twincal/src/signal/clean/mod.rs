//! What is wrong with a log, and the log on even clocks without it; nothing is filtered yet.

pub(super) mod clock;
pub(super) mod correct;
pub(super) mod describe;
pub(super) mod held;
pub(super) mod jumps;
pub(super) mod pieces;
pub(super) mod prepare;
pub(super) mod repeats;
pub(super) mod saturation;
pub(crate) mod spline;
pub(super) mod standstill;
pub(super) mod steps;
pub(super) mod ticks;
pub(super) mod torque;
pub(super) mod travel;
pub(super) mod units;
