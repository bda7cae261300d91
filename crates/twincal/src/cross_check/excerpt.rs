//! A few hundred smoothed rows of a log: what logs are compared by, also where the logs themselves are gone.

use crate::rigid_fit::{Bins, Zone};
use crate::signal::{Pipeline, Segment, Trajectory};

/// Places of one log at most, at each of which three neighbouring rows are kept: their differences are rates, however long the log is.
const MOST: usize = 200;
pub(super) const TRIPLE: usize = 3;
/// Places of all logs about, and of each at least.
const OF_ALL: usize = 4_000;
const LEAST: usize = 16;
/// Rows below which a log is not compared.
const FEWEST: usize = 20;
/// Width of the moving average in periods of the cut-off, and the part of it by which neighbours are apart.
const WINDOW: f64 = 0.5;
const APART: f64 = 0.25;
/// That distance without a filter, s.
const UNFILTERED: f64 = 0.02;
/// In the order of their numbers.
const ZONES: [Zone; 4] = [Zone::Slides, Zone::Reverses, Zone::Rests, Zone::Unknown];
/// Position, velocity, acceleration, torque.
const CHANNELS: usize = 4;

/// Smoothed rows of a log, evenly taken. Seven digits suffice for what is compared.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Excerpt {
    /// s.
    time: Vec<f64>,
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
        let step = total.div_ceil(MOST);
        let mut seen: usize = 0;
        for segment in &trajectory.segments {
            // Evenly over the log, however it is cut.
            let first = seen.next_multiple_of(step) - seen;
            rows.append(pipeline, segment, (first, step));
            seen += segment.time.len();
        }
        rows
    }

    fn append(&mut self, pipeline: &Pipeline, segment: &Segment, (first, step): (usize, usize)) {
        let len = segment.time.len();
        let rows_of = |seconds: f64| (seconds / segment.interval).round() as usize;
        let (half, apart) = match pipeline.is_off() {
            true => (0, rows_of(UNFILTERED)),
            false => {
                let window = WINDOW / pipeline.cutoff_hz;
                (rows_of(0.5 * window), rows_of(APART * window))
            }
        };
        let apart = apart.max(1);
        let step = step.max(TRIPLE * apart);
        let reach = half + apart;
        let places = (first..len).step_by(step);
        let places = places.filter(|i| *i >= reach && i + reach < len);
        let centres: Vec<usize> = places.flat_map(|i| [i - apart, i, i + apart]).collect();
        self.time.extend(centres.iter().map(|i| segment.time[*i]));
        let from = [&segment.q, &segment.qd, &segment.qdd, &segment.tau];
        for (joint, rows) in self.joints.iter_mut().enumerate() {
            let own = joint * len..(joint + 1) * len;
            for (to, from) in rows.channels.iter_mut().zip(from) {
                let values = &from[own.clone()];
                let mean = |i: &usize| {
                    let window = &values[i - half..=i + half];
                    (window.iter().sum::<f64>() / window.len() as f64) as f32
                };
                to.extend(centres.iter().map(mean));
            }
            let still = &segment.standstill[own];
            rows.live.extend(centres.iter().map(|i| !still[*i]));
            let zone = |i: &usize| Zone::at((pipeline, segment), joint, &(i - half..i + half + 1));
            rows.zones.extend(centres.iter().map(zone));
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

    /// As many rows as a comparison of so many logs takes of each, evenly taken.
    #[must_use]
    pub fn among(&self, logs: usize) -> Self {
        let (places, most) = (
            self.time.len() / TRIPLE,
            (OF_ALL / logs.max(1)).clamp(LEAST, MOST),
        );
        let kept = places.min(most);
        let kept: Vec<usize> = (0..kept).map(|i| i * places / kept).collect();
        let of_joint = |own: &Joint| Joint {
            channels: own.channels.each_ref().map(|values| triples(&kept, values)),
            live: triples(&kept, &own.live),
            zones: triples(&kept, &own.zones),
        };
        Self {
            time: triples(&kept, &self.time),
            joints: self.joints.iter().map(of_joint).collect(),
        }
    }

    /// Stamps of the rows, s, three of each place.
    #[must_use]
    pub fn stamps(&self) -> &[f64] {
        &self.time
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

    /// From [`Excerpt::stamps`], and [`Excerpt::numbers`] of each joint; `None` if they are none of an excerpt.
    #[must_use]
    pub fn of_numbers(time: Vec<f64>, joints: &[[Vec<f64>; CHANNELS + 1]]) -> Option<Self> {
        let ascends = |triple: &[f64]| triple.is_sorted_by(|one, next| one < next);
        let finite = |values: &Vec<f64>| values.iter().all(|value| (*value as f32).is_finite());
        let sound = time.len().is_multiple_of(TRIPLE)
            && time.chunks(TRIPLE).all(ascends)
            && time.iter().all(|stamp| stamp.is_finite())
            && joints
                .iter()
                .flatten()
                .all(|values| values.len() == time.len() && finite(values));
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
        let joints = joints.filter(|_| sound)?;
        Some(Self { time, joints })
    }
}

/// The rows of these places.
fn triples<T: Copy>(kept: &[usize], values: &[T]) -> Vec<T> {
    let of_place = |place: &usize| values[TRIPLE * place..TRIPLE * (place + 1)].iter().copied();
    kept.iter().flat_map(of_place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::self_check::testing::{arm, log};

    fn pipeline() -> Pipeline {
        Pipeline {
            cutoff_hz: 5.0,
            motion_cutoff_hz: 20.0,
            ..Pipeline::off(4)
        }
    }

    /// Numbers hold all of an excerpt; numbers that no excerpt has are refused.
    #[test]
    fn numbers_are_all_of_it() {
        let excerpt = Excerpt::of(&pipeline(), &log(17.3));
        let rows = excerpt.len();
        assert!(
            rows > TRIPLE * MOST * 8 / 10 && rows <= TRIPLE * MOST,
            "{rows}"
        );
        let joints = arm(1.0).dof();
        let numbers: Vec<_> = (0..joints).map(|joint| excerpt.numbers(joint)).collect();
        let stamps = excerpt.stamps().to_vec();
        assert_eq!(Excerpt::of_numbers(stamps.clone(), &numbers), Some(excerpt));
        type Damage = fn(&mut Vec<f64>, &mut Vec<[Vec<f64>; CHANNELS + 1]>);
        let damages: [Damage; 8] = [
            |_, all| all[1][4][7] = 8.0,
            |_, all| all[1][4][7] = 0.5,
            |_, all| all[1][4][7] = -1.0,
            |_, all| all[0][2].truncate(5),
            |_, all| all[0][3][5] = 1e300,
            |time, _| time[4] = time[5],
            |time, _| time[0] = f64::NAN,
            |time, all| {
                time.truncate(7);
                all.iter_mut()
                    .flatten()
                    .for_each(|values| values.truncate(7));
            },
        ];
        for (number, damage) in damages.iter().enumerate() {
            let (mut stamps, mut numbers) = (stamps.clone(), numbers.clone());
            damage(&mut stamps, &mut numbers);
            assert_eq!(Excerpt::of_numbers(stamps, &numbers), None, "{number}");
        }
    }

    /// No log has fewer rows than are compared, thinned once or twice.
    #[test]
    fn many_logs_are_thinned_evenly() {
        let excerpt = Excerpt::of(&pipeline(), &log(17.3));
        assert_eq!(excerpt.among(20), excerpt);
        for (fitted, all) in [(41, 42), (160, 161), (279, 280), (400, 500)] {
            let (once, twice) = (excerpt.among(all), excerpt.among(fitted).among(all));
            assert_eq!(
                (once.len(), twice.len()),
                (once.len(), once.len()),
                "{fitted}"
            );
            assert!(twice.len() >= TRIPLE * LEAST, "{fitted}");
            let ends = |own: &Excerpt| own.stamps()[own.len() - 1] - own.stamps()[0];
            assert!(ends(&twice) > 0.9 * ends(&excerpt), "{fitted}");
        }
    }

    /// Rates are those of the torque, also where places are far apart; a log in a thousand pieces has no more rows than a whole one.
    #[test]
    fn rows_are_neighbours_and_no_more_than_those_of_a_whole_log() {
        let whole = log(17.3);
        let excerpt = Excerpt::of(&pipeline(), &whole);
        let interval = whole.segments[0].interval;
        for triple in excerpt.stamps().chunks(TRIPLE) {
            let apart = [triple[1] - triple[0], triple[2] - triple[1]];
            let expected = APART * WINDOW / 5.0;
            assert!(
                apart
                    .iter()
                    .all(|apart| (apart - expected).abs() <= 0.5 * interval)
            );
        }
        let mut pieces = whole.clone();
        pieces.segments = (0..1000).flat_map(|_| log(17.3).segments).collect();
        assert!(Excerpt::of(&pipeline(), &pieces).len() <= TRIPLE * (MOST + 1));
    }
}
