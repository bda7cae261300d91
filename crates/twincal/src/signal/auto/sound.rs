//! Whether a pipeline that was read from a file is one that a choice of filters gives.

use crate::robot::Robot;
use crate::signal::filter::fir;
use crate::signal::filter::history::JointHistory;
use crate::signal::filter::pipeline::Pipeline;
use crate::signal::filter::thin::coarsest;
use crate::signal::log::joints::joint_facts;
use std::fmt::Debug;

/// Longest kernel, and longest time between rows, s: a day.
const LONGEST: f64 = 86_400.0;
/// Highest rate of kept rows, Hz.
const HIGHEST_RATE: f64 = 1e6;
/// What rounding may add to a ratio.
const ROUNDING: f64 = 1.0 + 1e-9;

impl Pipeline {
    /// The first key whose value no choice of filters gives for this robot, with the value.
    pub(crate) fn unsound(&self, robot: &Robot) -> Option<(&'static str, String)> {
        let joints = robot.dof();
        let facts = joint_facts(robot);
        let corrected = self.corrections.check(&facts, self.is_off()).is_ok();
        let still = &self.standstill_velocity;
        let stands = still.len() == joints && still.iter().all(is_speed);
        let derived = self.derived_from.len() == joints;
        let velocity = [0, joints].contains(&self.velocity_from.len());
        let checks: [(_, _, &dyn Debug); 10] = [
            ("cutoff_hz", self.has_sound_cutoff(), &self.cutoff_hz),
            (
                "motion_cutoff_hz",
                self.has_sound_motion_cutoff(),
                &self.motion_cutoff_hz,
            ),
            ("rate_hz", self.has_sound_rate(), &self.rate_hz),
            (
                "motion_interval",
                self.has_sound_interval(),
                &self.motion_interval,
            ),
            (
                "coulomb_velocity",
                is_speed(&self.coulomb_velocity),
                &self.coulomb_velocity,
            ),
            ("standstill_velocity", stands, still),
            ("derived_from", derived, &self.derived_from),
            ("velocity_from", velocity, &self.velocity_from),
            ("corrections", corrected, &self.corrections),
            ("history", self.has_sound_history(joints), &self.history),
        ];
        let wrong = checks.into_iter().find(|(_, sound, _)| !sound);
        wrong.map(|(key, _, value)| (key, format!("{value:?}")))
    }

    /// Whether what is followed of the history of these joints can be used.
    pub(crate) fn has_sound_history(&self, joints: usize) -> bool {
        (self.history.is_empty() || self.history.len() == joints)
            && self.history.iter().all(JointHistory::is_sound)
    }

    fn has_sound_cutoff(&self) -> bool {
        let kernel = || 2.0 * fir::column_half_seconds(self.cutoff_hz);
        self.is_off() || self.cutoff_hz > 0.0 && kernel() <= LONGEST
    }

    /// The motion filter is at least as wide as that of the columns, at most four times; a log that holds its kernel holds both.
    fn has_sound_motion_cutoff(&self) -> bool {
        let ratio = self.motion_cutoff_hz / self.cutoff_hz;
        match self.is_off() {
            true => self.motion_cutoff_hz == 0.0,
            false => (1.0 / ROUNDING..=4.0 * ROUNDING).contains(&ratio),
        }
    }

    fn has_sound_rate(&self) -> bool {
        let lowest = if self.is_off() { 0.0 } else { 1.0 / LONGEST };
        (lowest..=HIGHEST_RATE).contains(&self.rate_hz)
    }

    /// The clock of the motion is no coarser than that of a motion which never reverses.
    fn has_sound_interval(&self) -> bool {
        let longest = coarsest(self.motion_cutoff_hz, f64::INFINITY, 1.0);
        (0.0..=ROUNDING * longest).contains(&self.motion_interval)
    }
}

fn is_speed(value: &f64) -> bool {
    value.is_finite() && *value >= 0.0
}
