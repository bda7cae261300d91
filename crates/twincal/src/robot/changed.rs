//! The same robot with other numbers: inertias, gravity, zero positions. Its joints and links stay.

use super::parameters::ENTRIES;
use super::{Body, Robot};

/// What is added to a robot's numbers. The result is what dynamics are evaluated on, whether a body can be so or not.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Change {
    /// `(body, parameters)`: added to the ten parameters of a body, in its frame.
    pub(crate) inertia: Vec<(usize, [f64; 10])>,
    /// Added to gravity in the base frame, m/s².
    pub(crate) gravity: [f64; 3],
    /// `(joint, shift)`: the joint really stands at q + shift, rad (m for a slider).
    pub(crate) zero: Vec<(usize, f64)>,
}

impl Robot {
    /// The robot with a change. Its description still says what the model file says, but for gravity.
    pub(crate) fn changed(&self, change: &Change) -> Self {
        let mut robot = self.clone();
        for (gravity, more) in robot.description.gravity.iter_mut().zip(change.gravity) {
            *gravity += more;
        }
        for (body, parameters) in &change.inertia {
            robot.bodies[*body].add(parameters);
        }
        for &(joint, shift) in &change.zero {
            let own = robot.bodies.iter_mut().filter(|b| b.coordinate == joint);
            own.for_each(|body| body.offset += body.multiplier * shift);
        }
        robot
    }
}

impl Body {
    /// More of the ten parameters.
    fn add(&mut self, parameters: &[f64; 10]) {
        let moments = &mut self.moments;
        moments.mass += parameters[0];
        for (first, more) in moments.first.iter_mut().zip(&parameters[1..4]) {
            *first += more;
        }
        for ((i, j), more) in ENTRIES.into_iter().zip(&parameters[4..]) {
            moments.tensor[i][j] += more;
            if i != j {
                moments.tensor[j][i] += more;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::testing::tree;

    /// Truth: the model files that say the same.
    #[test]
    fn a_changed_robot_has_the_numbers_of_the_sum() {
        let robot = tree();
        let [mut more, before] = [[0.0; 10], robot.parameters_of_body(1)];
        for (k, value) in more.iter_mut().enumerate() {
            *value = 0.1 * (k as f64 + 1.0);
        }
        let change = Change {
            inertia: vec![(1, more)],
            gravity: [0.1, 0.0, -0.2],
            zero: vec![(0, 0.02)],
        };
        let changed = robot.changed(&change);
        let after = changed.parameters_of_body(1);
        for k in 0..10 {
            assert!((after[k] - before[k] - more[k]).abs() < 1e-15, "{k}");
        }
        let own = robot.description().gravity;
        assert_eq!(
            changed.description().gravity,
            [own[0] + 0.1, own[1], own[2] - 0.2]
        );
        assert_eq!(changed.bodies[0].offset - robot.bodies[0].offset, 0.02);
        assert_eq!(robot.changed(&Change::default()), robot);
    }
}
