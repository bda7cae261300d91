//! Effects that no motion of a robot distinguishes from the others, and what does.

use super::questions::Questions;
use crate::error::Result;
use crate::excitation::States;
use crate::robot::Robot;
use crate::term::Library;
use serde::Serialize;

/// How often the rows of random motion count that stand for all that a robot can show.
const ENDLESS: f64 = 1e6;
/// λ from which they distinguish an effect.
const DISTINGUISHED: f64 = 1.0;
/// A known load that is tried: its mass as a share of the robot's, which counts as 1 kg at least, and its centre, m.
const LOAD: f64 = 0.05;
const LEAST_MASS: f64 = 1.0;
const LOAD_AT: [f64; 3] = [0.05, 0.08, 0.1];

/// A recording that is not of the robot as it stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OtherRecording {
    /// With a load that is known, in one fit with the logs of the twin.
    KnownLoad,
    /// With the base on a wall, fitted by itself: base and tilt are others there.
    OtherBase,
}

impl OtherRecording {
    const ALL: [Self; 2] = [Self::KnownLoad, Self::OtherBase];

    /// The robots that are tried: with a load beside the axes of its last link, or on a wall by either of two sides.
    fn robots(self, robot: &Robot, library: &Library) -> Result<Vec<Robot>> {
        match self {
            Self::KnownLoad => {
                let bodies = robot.layout().iter();
                let mass = bodies.map(|body| body.moments.mass).sum::<f64>();
                let mass = LOAD * mass.max(LEAST_MASS);
                Ok(vec![robot.carrying(
                    library.payload_frame(robot),
                    mass,
                    LOAD_AT,
                )?])
            }
            Self::OtherBase => {
                let sides = across(robot.description().gravity);
                Ok(sides.map(|gravity| robot.with_gravity(gravity)).into())
            }
        }
    }
}

/// Two vectors as long as one, at right angles to it and to each other.
fn across(vector: [f64; 3]) -> [[f64; 3]; 2] {
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let scaled = |a: [f64; 3]| {
        let own = a.iter().map(|x| x * x).sum::<f64>().sqrt();
        a.map(|x| if own > 0.0 { x * length / own } else { 0.0 })
    };
    // the axis that it lies along least
    let least = (0..3).min_by(|&a, &b| vector[a].abs().total_cmp(&vector[b].abs()));
    let axis = std::array::from_fn(|k| if Some(k) == least { 1.0 } else { 0.0 });
    let first = scaled(cross(vector, axis));
    [first, scaled(cross(vector, first))]
}

impl Questions<'_> {
    /// Per question that no motion decides, what does; `None` where some motion decides it.
    pub(super) fn structural(&self, random: &States) -> Result<Vec<Option<Vec<OtherRecording>>>> {
        let decided = self.distinguished(1.0, &[self.coming], random);
        let mut found: Vec<Option<Vec<OtherRecording>>> = decided
            .into_iter()
            .map(|own| (!own).then(Vec::new))
            .collect();
        if found.iter().all(Option::is_none) {
            return Ok(found);
        }
        for other in OtherRecording::ALL {
            // with a known load, a payload that acts where the load is unknown does not
            if other == OtherRecording::KnownLoad && self.twin.payload_where_unknown {
                continue;
            }
            for robot in other.robots(&self.twin.robot, self.library)? {
                let library = self.library.in_log(&robot, true);
                let decides = match other {
                    OtherRecording::KnownLoad => {
                        self.distinguished(1.0, &[self.coming, &library], random)
                    }
                    OtherRecording::OtherBase => self.distinguished(0.0, &[&library], random),
                };
                let open = found.iter_mut().zip(decides);
                for (found, _) in open.filter(|(_, decides)| *decides) {
                    if let Some(found) = found.as_mut().filter(|own| !own.contains(&other)) {
                        found.push(other);
                    }
                }
            }
        }
        Ok(found)
    }

    /// Of every question, whether endless random motion distinguishes it, in logs of each library beside those of the twin, which count `logs`
    /// times.
    fn distinguished(&self, logs: f64, libraries: &[&Library], random: &States) -> Vec<bool> {
        let mut sums = vec![0.0; self.active.len().pow(2)];
        for library in libraries {
            let own = self.sums_of(library, &self.active, random);
            (sums.iter_mut().zip(own)).for_each(|(sum, own)| *sum += own);
        }
        match self.said_beside(logs, &sums, ENDLESS) {
            Some((lambda, _)) => lambda.iter().map(|own| *own >= DISTINGUISHED).collect(),
            None => vec![false; self.open.len()],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Right angles and lengths, along an axis, between axes, and of nothing.
    #[test]
    fn a_wall_is_across_gravity() {
        let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for gravity in [
            [0.0, 0.0, -9.81],
            [5.0, 5.0, 5.0],
            [-6.9, 0.0, -6.9],
            [0.0; 3],
        ] {
            let [a, b] = across(gravity);
            for (side, other) in [(a, gravity), (b, gravity), (a, b)] {
                assert!(dot(side, other).abs() < 1e-12, "{side:?} {other:?}");
                assert!((dot(side, side) - dot(gravity, gravity)).abs() < 1e-9);
            }
        }
    }
}
