//! The noise of a log's torque as bits: signs of fourth differences, by which a copy is found among many logs.
//!
//! Motion is smooth over five samples, so that fourth differences of torque are noise. Two recordings have independent signs there, also of one
//! programme; of Gaussian noise with correlation ρ the signs agree with probability `1/2 + asin(ρ)/π` (Sheppard 1899): 0.85 where noise of half
//! the own one was added.

use crate::error::Result;
use crate::signal::{Log, Recording};

/// Rows of a log whose signs are kept: 8 bytes each.
const MOST_ROWS: usize = 1 << 22;
/// Joints whose signs are kept.
pub(super) const MOST_JOINTS: usize = 32;
/// Rows from one bit of a key to the next of the same joint: fourth differences of white noise that far apart have correlation −0.11.
pub(super) const SPACING: usize = 3;
/// Samples of a fourth difference.
const SPAN: usize = 5;

/// Signs of one row: bit j is of joint j.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Signs {
    /// Fourth difference above 0.
    pub(super) positive: u32,
    /// Not 0, and of finite torque.
    pub(super) known: u32,
}

/// Signs of the rows of a log.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Signature {
    pub(super) rows: Vec<Signs>,
    /// Joints whose fourth difference is not 0 on most rows.
    pub(super) live: u32,
}

impl Signature {
    /// Of the first [`MOST_ROWS`] rows of a log; empty without torque.
    ///
    /// # Errors
    /// Of chapters that cannot be read.
    pub(super) fn of(log: &Log<'_>) -> Result<Self> {
        let mut rows = Vec::new();
        log.until(|recording| {
            append(recording, &mut rows);
            rows.len() >= MOST_ROWS
        })?;
        rows.truncate(MOST_ROWS);
        let live = (0..MOST_JOINTS).filter(|joint| {
            let known = rows.iter().filter(|row| row.known >> joint & 1 == 1);
            2 * known.count() > rows.len()
        });
        let live = live.fold(0, |bits, joint| bits | 1 << joint);
        Ok(Self { rows, live })
    }

    /// Keys of `bits` bits, each with the row at which it begins: signs of the live joints at rows [`SPACING`] apart.
    pub(super) fn keys(&self, bits: u32) -> Vec<(u32, u32)> {
        let joints = self.live.count_ones();
        if joints == 0 {
            return Vec::new();
        }
        let span = bits.div_ceil(joints) as usize * SPACING;
        let last = self.rows.len().saturating_sub(span);
        let key = |row: usize| {
            let (mut key, mut taken) = (0_u32, 0);
            for own in self.rows[row..].iter().step_by(SPACING) {
                let mut left = self.live;
                while left != 0 && taken < bits {
                    key = key << 1 | (own.positive >> left.trailing_zeros() & 1);
                    left &= left - 1;
                    taken += 1;
                }
                if taken == bits {
                    break;
                }
            }
            (key, row as u32)
        };
        (0..last).map(key).collect()
    }
}

/// Adds the rows of a recording; its last four have no difference.
fn append(recording: &Recording, rows: &mut Vec<Signs>) {
    let len = recording.time.len();
    let start = rows.len();
    rows.resize(start + len, Signs::default());
    let joints = recording.joints.iter().take(MOST_JOINTS).enumerate();
    for (joint, channels) in joints {
        let Some(tau) = &channels.tau else { continue };
        for (row, t) in rows[start..].iter_mut().zip(tau.windows(SPAN)) {
            let difference = t[0] - 4.0 * t[1] + 6.0 * t[2] - 4.0 * t[3] + t[4];
            row.positive |= u32::from(difference > 0.0) << joint;
            row.known |= u32::from(difference.is_finite() && difference != 0.0) << joint;
        }
    }
}
