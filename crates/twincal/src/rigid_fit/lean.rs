//! A base that leans and carries something unknown: the torque of gravity is a product of both, which one linear fit cannot have.

use super::bins::Bins;
use super::design::{Design, Part, prior, sample};
use super::robust::{Solution, robust};
use crate::linear_algebra::dot;
use crate::robot::{Change, Robot};
use std::borrow::Cow;

/// Times that a fit is made anew about the lean that the one before found.
pub(crate) const LEANS: usize = 3;
/// Change of gravity in the base from which that matters, m/s²: half a degree.
const MATTERS: f64 = 0.1;

/// The robot as a fit has it, with gravity turned in its base by these m/s² and all inertias changed (ten parameters of each body in turn); `None`
/// where gravity turns little. Its size stays: it is known better than a log shows it, and beside free masses no log may show it at all.
pub(crate) fn leaning(robot: &Robot, change: [f64; 3], inertia: &[f64]) -> Option<Robot> {
    let own = robot.description().gravity;
    let mut turned = [0, 1, 2].map(|axis| own[axis] + change[axis]);
    let scale = norm(&own) / norm(&turned);
    turned.iter_mut().for_each(|along| *along *= scale);
    let gravity = [0, 1, 2].map(|axis| turned[axis] - own[axis]);
    // not a number where there is no gravity
    (norm(&gravity) > MATTERS).then(|| {
        let bodies = inertia.as_chunks().0.iter().copied().enumerate();
        robot.changed(&Change {
            gravity,
            inertia: bodies.collect(),
            ..Change::default()
        })
    })
}

/// The robust fit about the lean that it found.
pub(crate) struct Settled<'a> {
    /// The robot; where its base leans with the lean and the inertias that were found.
    pub(crate) robot: Cow<'a, Robot>,
    /// Which bins were looked at, and their rows.
    pub(crate) parts: Vec<Part>,
    pub(crate) design: Design,
    pub(crate) solution: Solution,
}

/// Fits rigid bodies and friction to bins; `None` where they are too few. About each lean the prior is that of the robot as it is then.
pub(crate) fn settle<'a>(robot: &'a Robot, bins: &[Bins]) -> Option<Settled<'a>> {
    let mut robot = Cow::Borrowed(robot);
    let parts = sample(&robot, bins);
    let mut leans = 0;
    loop {
        let design = Design::new(&robot, bins, &parts);
        let solution = robust(&design, &prior(&robot))?;
        let (gravity, inertia) = design.gravity_and_inertia(&solution.theta);
        match leaning(&robot, gravity, inertia) {
            Some(turned) if leans < LEANS => robot = Cow::Owned(turned),
            _ => {
                return Some(Settled {
                    robot,
                    parts,
                    design,
                    solution,
                });
            }
        }
        leans += 1;
    }
}

fn norm(vector: &[f64; 3]) -> f64 {
    dot(vector, vector).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::self_check::testing::arm;

    #[test]
    fn gravity_turns_and_keeps_its_size() {
        let robot = arm(1.0);
        assert!(leaning(&robot, [0.05, 0.0, 0.0], &[]).is_none());
        assert!(leaning(&robot, [0.0, 0.0, 3.0], &[]).is_none());
        let turned = leaning(&robot, [2.0, 0.0, 0.5], &[]).unwrap();
        let [x, y, z] = turned.description().gravity;
        assert!((x / z - 2.0 / -9.31).abs() < 1e-12 && y == 0.0);
        assert!((norm(&[x, y, z]) - 9.81).abs() < 1e-12);
    }
}
