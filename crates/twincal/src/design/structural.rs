//! Effects that no motion of a robot tells from the others, and what does.

use super::questions::Questions;
use crate::error::Result;
use crate::excitation::States;
use crate::robot::Robot;
use crate::term::Library;
use serde::Serialize;

/// Rows of random motion that stand for all that the robot can show, and the λ below which even those say nothing.
const ENDLESS: f64 = 1e6;
/// A known load that would decide: as a share of the robot's mass, which counts as 1 kg at least, and its centre, m.
const LOAD: f64 = 0.05;
const LEAST_MASS: f64 = 1.0;
const LOAD_AT: [f64; 3] = [0.05, 0.08, 0.1];

/// A recording of the robot otherwise than it stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OtherRecording {
    /// With a load that is known.
    KnownLoad,
    /// With the base in another pose to gravity.
    OtherBase,
}

impl OtherRecording {
    const ALL: [Self; 2] = [Self::KnownLoad, Self::OtherBase];

    /// The robot in it: with a twentieth of its mass beside the axes of its last link, or on a wall.
    fn robot(self, robot: &Robot, library: &Library) -> Result<Robot> {
        match self {
            Self::KnownLoad => {
                let frame = library.payload_frame(robot);
                let mass = robot
                    .layout()
                    .iter()
                    .map(|body| body.moments.mass)
                    .sum::<f64>();
                robot.carrying(frame, LOAD * mass.max(LEAST_MASS), LOAD_AT)
            }
            Self::OtherBase => {
                let [x, y, z] = robot.description().gravity;
                Ok(robot.with_gravity([z, x, y]))
            }
        }
    }
}

impl Questions<'_> {
    /// Per question that no motion decides, what does beside it; `None` where some motion decides it.
    pub(super) fn structural(&self, random: &States) -> Result<Vec<Option<Vec<OtherRecording>>>> {
        let decided = |libraries: &[&Library]| -> Vec<bool> {
            let mut sums = vec![0.0; self.active.len().pow(2)];
            for library in libraries {
                let own = self.sums_of(library, &self.active, random);
                (sums.iter_mut().zip(own)).for_each(|(sum, own)| *sum += own);
            }
            match self.said(&sums, ENDLESS) {
                Some((lambda, _)) => lambda.iter().map(|own| *own >= 1.0).collect(),
                None => vec![false; self.open.len()],
            }
        };
        let mut found: Vec<Option<Vec<OtherRecording>>> = decided(&[self.library, self.coming])
            .into_iter()
            .map(|own| (!own).then(Vec::new))
            .collect();
        if found.iter().all(Option::is_none) {
            return Ok(found);
        }
        for other in OtherRecording::ALL {
            let robot = other.robot(self.robot, self.library)?;
            let library = self.library.in_log(&robot, true);
            let decides = decided(&[self.library, &library]);
            for (found, _) in found
                .iter_mut()
                .zip(decides)
                .filter(|(_, decides)| *decides)
            {
                if let Some(found) = found {
                    found.push(other);
                }
            }
        }
        Ok(found)
    }
}
