//! A load that is known: what the robot carries in the motion to come, beside what its model and its candidates have.

use crate::error::Result;
use crate::robot::Robot;
use crate::term::Library;

/// What a robot is known to carry: a point mass.
#[derive(Debug, Clone, PartialEq)]
pub struct Load {
    /// Link that it is fixed to.
    pub frame: String,
    /// kg.
    pub mass: f64,
    /// Centre of mass in the frame of that link, m.
    pub com: [f64; 3],
}

/// A robot with a known load, and its candidates as they act with it.
#[derive(Debug)]
pub struct Loaded {
    /// The robot with the load, a point mass.
    pub robot: Robot,
    /// The candidates of the robot without it: their columns are those of a log with the load.
    pub library: Library,
}

impl Loaded {
    /// Of a robot and its candidates.
    ///
    /// # Errors
    /// Those of [`Robot::carrying`].
    pub fn new(robot: &Robot, library: &Library, load: &Load) -> Result<Self> {
        let robot = robot.carrying(&load.frame, load.mass, load.com)?;
        Ok(Self {
            library: library.in_log(&robot, true),
            robot,
        })
    }
}
