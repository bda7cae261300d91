//! A base that leans and carries something unknown: the torque of gravity is a product of both, which one linear fit cannot have.

use super::bins::Bins;
use super::design::{Design, Part, prior, sample};
use super::robust::{BETTER, Solution, robust};
use crate::linear_algebra::dot;
use crate::robot::{Change, Robot};

/// Times that a fit is made anew about the lean that the one before found.
const LEANS: usize = 3;
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

/// A fit about one lean of the base.
pub(crate) struct Fit<T> {
    pub(crate) value: T,
    /// ln of what it leaves.
    pub(crate) size: f64,
    /// The robot with the lean and the inertias that it found; `None` where it turns little.
    pub(crate) leaning: Option<Robot>,
}

/// The fit about the lean that it finds itself, of several in turn the one that leaves least. A lean that does not leave less than [`BETTER`] of what the
/// upright fit leaves is none: poor motion, and what no rigid body explains, can look like one.
pub(crate) fn about_lean<T>(robot: &Robot, fit: impl Fn(&Robot) -> Option<Fit<T>>) -> Option<T> {
    let Fit {
        value: mut best,
        size,
        leaning: mut leans,
    } = fit(robot)?;
    let mut least = size + BETTER.ln();
    for _ in 0..LEANS {
        let Some(found) = leans.and_then(|robot| fit(&robot)) else {
            break;
        };
        leans = found.leaning;
        if found.size < least {
            (best, least) = (found.value, found.size);
        }
    }
    Some(best)
}

/// The robust fit about the lean that it found.
pub(crate) struct Settled {
    /// The robot; where its base leans with the lean and the inertias that were found.
    pub(crate) robot: Robot,
    /// Which bins were looked at, and their rows.
    pub(crate) parts: Vec<Part>,
    pub(crate) design: Design,
    pub(crate) solution: Solution,
}

/// Fits rigid bodies and friction to bins; `None` where they are too few. About each lean the prior is that of the robot as it is then.
pub(crate) fn settle(robot: &Robot, bins: &[Bins]) -> Option<Settled> {
    let parts = sample(robot, bins);
    let fit = |robot: &Robot| {
        let design = Design::new(robot, bins, &parts);
        let solution = robust(&design, &prior(robot))?;
        let (gravity, inertia) = design.gravity_and_inertia(&solution.theta);
        Some(Fit {
            size: solution.size(&design),
            leaning: leaning(robot, gravity, inertia),
            value: (robot.clone(), design, solution),
        })
    };
    let (robot, design, solution) = about_lean(robot, fit)?;
    Some(Settled {
        robot,
        parts,
        design,
        solution,
    })
}

fn norm(vector: &[f64; 3]) -> f64 {
    dot(vector, vector).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::self_check::testing::arm;
    use std::cell::Cell;

    /// What fits that leave these shares make of a robot that seems to lean on and on: number of the fit that is taken, 0 the upright one.
    fn taken(left: &[Option<f64>]) -> Option<usize> {
        let count = Cell::new(0);
        let fit = |robot: &Robot| {
            let own = count.replace(count.get() + 1);
            let size = (*left.get(own)?)?.ln();
            Some(Fit {
                value: own,
                size,
                leaning: leaning(robot, [2.0, 0.0, 0.0], &[]),
            })
        };
        about_lean(&arm(1.0), fit)
    }

    #[test]
    fn a_lean_must_leave_less_and_the_best_is_taken() {
        let [one, none] = [Some(1.0), None];
        assert_eq!(taken(&[one, Some(0.9), Some(0.85), Some(0.81)]), Some(0));
        assert_eq!(taken(&[one, Some(0.5), Some(0.4), Some(0.3)]), Some(3));
        assert_eq!(taken(&[one, Some(0.2), Some(0.85), Some(0.9)]), Some(1));
        // a lean that cannot be fitted, at once or later, and what cannot be compared
        assert_eq!(taken(&[one, none]), Some(0));
        assert_eq!(taken(&[one, Some(0.2), none]), Some(1));
        assert_eq!(taken(&[one, Some(f64::NAN), Some(f64::NAN)]), Some(0));
        assert_eq!(taken(&[none]), None);
    }

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
