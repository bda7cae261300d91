//! What columns are evaluated on: motion, and what is known of its history.

use crate::robot::Motion;

/// Motion with its history channels ([`crate::signal`]).
#[derive(Debug, Clone, Copy)]
pub struct Course<'a> {
    /// Positions, velocities, accelerations.
    pub motion: Motion<'a>,
    /// `channel * len + sample`; shorter where nothing is known: channels that are missing are 0.
    pub history: &'a [f64],
}

impl<'a> From<Motion<'a>> for Course<'a> {
    /// States that nothing is known of but themselves.
    fn from(motion: Motion<'a>) -> Self {
        Self {
            motion,
            history: &[],
        }
    }
}

impl<'a> Course<'a> {
    /// Some samples of a channel, if it is known.
    #[inline(always)]
    pub(super) fn channel(&self, channel: usize, start: usize, width: usize) -> Option<&'a [f64]> {
        let from = channel * self.motion.len + start;
        self.history.get(from..from + width)
    }
}

/// A number for a channel at a random state: any that is no function of position, velocity and acceleration that a column could be.
pub(super) fn anything(channel: usize, positions: f64) -> f64 {
    (1e4 * positions + 37.0 * (channel + 1) as f64).sin()
}
