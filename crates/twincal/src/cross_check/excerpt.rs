//! A few hundred smoothed rows of a log: what logs are compared by, also where the logs themselves are gone.

use crate::rigid_fit::{Bins, Zone};
use crate::signal::{Pipeline, Segment, Trajectory};

/// Rows of one log at most, and those below which it is not compared.
const MOST: usize = 300;
const FEWEST: usize = 20;
/// Rows of all logs about, and of each at least.
const OF_ALL: usize = 12_000;
const LEAST: usize = 40;
/// Width of the moving average in periods of the cut-off.
const WINDOW: f64 = 0.5;
/// In the order of their numbers.
const ZONES: [Zone; 4] = [Zone::Slides, Zone::Reverses, Zone::Rests, Zone::Unknown];
/// Position, velocity, acceleration, torque.
const CHANNELS: usize = 4;

/// Smoothed rows of a log, evenly taken. Seven digits suffice for what is compared.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Excerpt {
    /// s.
    time: Vec<f64>,
    /// First row of each stretch without a gap.
    starts: Vec<usize>,
    joints: Vec<Joint>,
}

/// Its rows of one joint.
#[derive(Debug, Clone, PartialEq, Default)]
struct Joint {
    /// Position, velocity, acceleration, torque.
    channels: [Vec<f32>; CHANNELS],
    /// Whether it moves and its torque says something.
    live: Vec<bool>,
    /// What its friction can be.
    zones: Vec<Zone>,
}

impl Excerpt {
    /// Of a filtered log; empty without torque.
    #[must_use]
    pub fn of(pipeline: &Pipeline, trajectory: &Trajectory) -> Self {
        let total: usize = trajectory.segments.iter().map(|s| s.time.len()).sum();
        if total == 0 || trajectory.segments.iter().any(|s| s.tau.is_empty()) {
            return Self::default();
        }
        let mut rows = Self {
            joints: vec![Joint::default(); trajectory.dof],
            ..Self::default()
        };
        for segment in &trajectory.segments {
            rows.append(pipeline, segment, total.div_ceil(MOST));
        }
        rows
    }

    fn append(&mut self, pipeline: &Pipeline, segment: &Segment, step: usize) {
        let len = segment.time.len();
        let half = if pipeline.is_off() {
            0
        } else {
            (0.5 * WINDOW / pipeline.cutoff_hz / segment.interval).round() as usize
        };
        let centres = || (half..len.saturating_sub(half)).step_by(step);
        if centres().next().is_some() {
            self.starts.push(self.time.len());
        }
        self.time.extend(centres().map(|i| segment.time[i]));
        let from = [&segment.q, &segment.qd, &segment.qdd, &segment.tau];
        for (joint, rows) in self.joints.iter_mut().enumerate() {
            let own = joint * len..(joint + 1) * len;
            for (to, from) in rows.channels.iter_mut().zip(from) {
                let values = &from[own.clone()];
                let mean = |i: usize| {
                    let window = &values[i - half..=i + half];
                    (window.iter().sum::<f64>() / window.len() as f64) as f32
                };
                to.extend(centres().map(mean));
            }
            let still = &segment.standstill[own];
            rows.live.extend(centres().map(|i| !still[i]));
            let zone = |i: usize| Zone::at(segment, joint, &(i - half..i + half + 1));
            rows.zones.extend(centres().map(zone));
        }
    }

    /// Rows that are compared; 0 for a log with hardly any.
    pub(super) fn len(&self) -> usize {
        match self.time.len() {
            0..FEWEST => 0,
            rows => rows,
        }
    }

    pub(super) fn time(&self) -> &[f64] {
        &self.time
    }

    pub(super) fn starts(&self) -> &[usize] {
        &self.starts
    }

    pub(super) fn live(&self, joint: usize) -> &[bool] {
        &self.joints[joint].live
    }

    /// Position, velocity, acceleration and torque of all joints, joint by joint.
    pub(super) fn motion(&self) -> [Vec<f64>; CHANNELS] {
        std::array::from_fn(|channel| {
            let joints = self.joints.iter();
            let values = joints.flat_map(|own| &own.channels[channel]);
            values.map(|value| f64::from(*value)).collect()
        })
    }

    /// Its rows as bins.
    pub(super) fn bins(&self) -> Bins {
        let joints = self.joints.iter();
        let zones = joints.flat_map(|own| own.zones.iter().copied());
        Bins::of_rows(&self.time, &self.motion(), zones.collect())
    }

    /// As many rows as a comparison of so many logs takes of each.
    #[must_use]
    pub fn among(&self, logs: usize) -> Self {
        let most = (OF_ALL / logs.max(1)).clamp(LEAST, MOST);
        let step = self.time.len().div_ceil(most).max(1);
        let mut starts: Vec<usize> = self.starts.iter().map(|row| row.div_ceil(step)).collect();
        starts.dedup();
        let kept = |own: &Joint| Joint {
            channels: own.channels.each_ref().map(|values| every(step, values)),
            live: every(step, &own.live),
            zones: every(step, &own.zones),
        };
        let time = every(step, &self.time);
        starts.retain(|row| *row < time.len());
        Self {
            time,
            starts,
            joints: self.joints.iter().map(kept).collect(),
        }
    }

    /// Stamps of the rows, s, and the first row of each stretch: whole numbers.
    #[must_use]
    pub fn places(&self) -> [Vec<f64>; 2] {
        let starts = self.starts.iter().map(|row| *row as f64);
        [self.time.clone(), starts.collect()]
    }

    /// Position, velocity, acceleration and torque of a joint, and what its friction can be (0 to 3), with 4 more where it moves.
    #[must_use]
    pub fn numbers(&self, joint: usize) -> [Vec<f64>; CHANNELS + 1] {
        let Some(own) = self.joints.get(joint) else {
            return Default::default();
        };
        let [q, qd, qdd, tau] = (own.channels.each_ref())
            .map(|values| values.iter().map(|value| f64::from(*value)).collect());
        let states = own.zones.iter().zip(&own.live).filter_map(|(zone, live)| {
            let number = ZONES.iter().position(|own| own == zone)?;
            Some((number + ZONES.len() * usize::from(*live)) as f64)
        });
        [q, qd, qdd, tau, states.collect()]
    }

    /// From [`Excerpt::places`], and [`Excerpt::numbers`] of each joint; `None` if they are none of an excerpt.
    #[must_use]
    pub fn of_numbers(
        [time, starts]: [Vec<f64>; 2],
        joints: &[[Vec<f64>; CHANNELS + 1]],
    ) -> Option<Self> {
        let rows = time.len();
        let begins = |row: &f64| row.fract() == 0.0 && (0.0..rows as f64).contains(row);
        let sound = starts.iter().all(begins)
            && starts.is_sorted_by(|one, next| one < next)
            && starts.is_empty() == time.is_empty()
            && joints.iter().flatten().all(|values| values.len() == rows);
        let state = |number: &f64| {
            let whole = (number.fract() == 0.0 && *number >= 0.0).then_some(*number as usize)?;
            let live = whole >= ZONES.len();
            Some((*ZONES.get(whole - ZONES.len() * usize::from(live))?, live))
        };
        let joint = |[q, qd, qdd, tau, states]: &[Vec<f64>; CHANNELS + 1]| {
            let short = |values: &Vec<f64>| values.iter().map(|value| *value as f32).collect();
            let states: Option<Vec<(Zone, bool)>> = states.iter().map(state).collect();
            let (zones, live) = states?.into_iter().unzip();
            Some(Joint {
                channels: [q, qd, qdd, tau].map(short),
                live,
                zones,
            })
        };
        let joints: Option<Vec<Joint>> = joints.iter().map(joint).collect();
        let starts = starts.iter().map(|row| *row as usize).collect();
        let joints = joints.filter(|_| sound)?;
        Some(Self {
            time,
            starts,
            joints,
        })
    }
}

fn every<T: Copy>(step: usize, values: &[T]) -> Vec<T> {
    values.iter().step_by(step).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::self_check::testing::{arm, log};

    /// Numbers hold all of an excerpt; numbers that no excerpt has are refused.
    #[test]
    fn numbers_are_all_of_it() {
        let pipeline = Pipeline {
            cutoff_hz: 5.0,
            motion_cutoff_hz: 20.0,
            ..Pipeline::off(4)
        };
        let excerpt = Excerpt::of(&pipeline, &log(17.3));
        let joints = arm(1.0).dof();
        assert!(
            excerpt.len() > MOST / 2 && excerpt.len() <= MOST,
            "{}",
            excerpt.len()
        );
        let numbers: Vec<_> = (0..joints).map(|joint| excerpt.numbers(joint)).collect();
        let places = excerpt.places();
        assert_eq!(
            Excerpt::of_numbers(places.clone(), &numbers),
            Some(excerpt.clone())
        );
        let mut other = numbers.clone();
        for wrong in [8.0, 0.5, -1.0] {
            other[1][4][7] = wrong;
            assert_eq!(Excerpt::of_numbers(places.clone(), &other), None);
        }
        let mut other = numbers.clone();
        other[0][2].pop();
        assert_eq!(Excerpt::of_numbers(places.clone(), &other), None);
        for starts in [vec![1.0, 1.0], vec![0.5], vec![-1.0], vec![1e9], vec![]] {
            let [time, _] = places.clone();
            assert_eq!(Excerpt::of_numbers([time, starts], &numbers), None);
        }
        assert_eq!(excerpt.among(40), excerpt);
        let few = excerpt.among(1000);
        assert!(few.len() <= LEAST, "{}", few.len());
        assert_eq!(
            few.time(),
            every(excerpt.len().div_ceil(LEAST), excerpt.time())
        );
    }

    /// A gap begins another stretch, also where rows are left out.
    #[test]
    fn stretches_begin_behind_gaps() {
        let mut gapped = log(17.3);
        let whole = gapped.segments[0].clone();
        gapped.segments.push(whole);
        let excerpt = Excerpt::of(&Pipeline::off(4), &gapped);
        assert_eq!(excerpt.starts(), [0, excerpt.len() / 2]);
        let few = excerpt.among(200);
        let [first, second] = *few.starts() else {
            panic!("{:?}", few.starts());
        };
        assert_eq!(first, 0);
        assert!(few.time()[second] < few.time()[second - 1]);
    }
}
