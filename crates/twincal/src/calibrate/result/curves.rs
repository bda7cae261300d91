//! What was found as curves: torque of one joint over its own position (springs, counterbalances, gravity of its own) or over its
//! own velocity (friction), with the interval of all models together.
//!
//! Single coefficients of such a law are hard to read and often cannot be told apart; their sum at a position can.

use super::calibration::{Along, Calibration, Curve};
use crate::posterior::draws::{CoefficientDraws, Drawer};
use crate::robot::{JointKind, Motion, Robot};
use crate::term::Library;
use rayon::prelude::*;

/// Points of a curve.
const POINTS: usize = 80;
/// Draws behind mean and interval.
const DRAWS: usize = 2000;
/// Random stream of those draws.
const STREAM: u64 = (1 << 32) + 1;
/// Relative change of a column that counts as none.
const SAME: f64 = 1e-9;
/// PIP from which a component is named beside a curve: rarer ones cannot move an end of the 95 % band.
const NAMED: f64 = 0.025;

/// The curves to which a component that was found contributes.
///
/// A column belongs to the curve of joint j over position (velocity) if it acts on joint j alone and its torque changes with
/// nothing but that. A constant torque counts as one over position: it has a potential.
///
/// They span the range of each joint in the logs.
pub(in crate::calibrate) fn curves(
    robot: &Robot,
    library: &Library,
    calibration: &Calibration,
    drawer: &Drawer<'_>,
    seed: u64,
) -> Vec<Curve> {
    let (components, hull) = (&calibration.components, &calibration.twin.hull);
    let draws = drawer.draw(DRAWS, seed, STREAM);
    if draws.models.is_empty() {
        return Vec::new(); // nothing to draw from
    }
    let curve = |(joint, along): (usize, Along)| {
        let x = grid(&hull[joint], along, robot.joint_kind(joint))?;
        let columns = columns_along(library, joint, along, &x, hull);
        let own = |k: usize| library.terms()[library.columns()[k]].component;
        let found = columns
            .iter()
            .any(|c| !c.constant && components[own(c.index)].is_in());
        if !found {
            return None;
        }
        let mut names: Vec<usize> = columns.iter().map(|c| own(c.index)).collect();
        names.dedup();
        names.retain(|&c| components[c].pip.is_some_and(|pip| pip >= NAMED));
        let [mean, low95, high95] = band(&draws, &columns, x.len());
        Some(Curve {
            joint: robot.joint_names()[joint].to_owned(),
            along,
            components: names.iter().map(|&c| components[c].name.clone()).collect(),
            x,
            mean,
            low95,
            high95,
        })
    };
    let both = |joint| [(joint, Along::Position), (joint, Along::Velocity)];
    let all: Vec<(usize, Along)> = (0..robot.dof()).flat_map(both).collect();
    all.into_par_iter().filter_map(curve).collect()
}

/// Evenly spaced over the range in the logs; `None` where the joint does not move.
fn grid(hull: &[f64; 6], along: Along, kind: JointKind) -> Option<Vec<f64>> {
    let (low, high) = match along {
        // A turning joint that went round and round is shown over one turn.
        Along::Position
            if kind == JointKind::Continuous && hull[1] - hull[0] >= std::f64::consts::TAU =>
        {
            (-std::f64::consts::PI, std::f64::consts::PI)
        }
        Along::Position => (hull[0], hull[1]),
        Along::Velocity => (hull[2], hull[3]),
    };
    let step = (high - low) / (POINTS - 1) as f64;
    (step > 0.0 && step.is_finite()).then(|| (0..POINTS).map(|i| low + step * i as f64).collect())
}

/// A column that is a function of one coordinate.
struct Column {
    index: usize,
    /// Torque at the grid's points per unit of β.
    torque: Vec<f64>,
    constant: bool,
}

/// The columns that act on `joint` alone and depend on nothing but the coordinate.
fn columns_along(
    library: &Library,
    joint: usize,
    along: Along,
    x: &[f64],
    hull: &[[f64; 6]],
) -> Vec<Column> {
    let at_rest = evaluate(library, joint, along, x, hull, false);
    let moving = evaluate(library, joint, along, x, hull, true);
    let alone = |k: &usize| {
        (0..library.joints())
            .filter(|&other| other != joint)
            .all(|other| !library.columns_of_joint(other).contains(k))
    };
    let own = library.columns_of_joint(joint);
    own.iter()
        .enumerate()
        .filter(|(_, k)| alone(k))
        .filter_map(|(i, &index)| {
            let range = i * x.len()..(i + 1) * x.len();
            let (torque, other) = (&at_rest[range.clone()], &moving[range]);
            let size = torque.iter().fold(0.0f64, |m, t| m.max(t.abs()));
            let same = |a: f64, b: f64| (a - b).abs() <= SAME * size;
            let only = size > 0.0
                && size.is_finite()
                && torque.iter().zip(other).all(|(a, b)| same(*a, *b));
            let constant = torque.iter().all(|t| same(*t, torque[0]));
            (only && !(constant && along == Along::Velocity)).then(|| Column {
                index,
                torque: torque.to_vec(),
                constant,
            })
        })
        .collect()
}

/// Columns of `joint` on the grid, everything else at rest in mid-range, or moving about.
fn evaluate(
    library: &Library,
    joint: usize,
    along: Along,
    x: &[f64],
    hull: &[[f64; 6]],
    moving: bool,
) -> Vec<f64> {
    let (joints, len) = (library.joints(), x.len());
    let size = joints * len;
    let (mut q, mut qd, mut qdd) = (vec![0.0; size], vec![0.0; size], vec![0.0; size]);
    for j in 0..joints {
        let [low, high, ..] = hull[j];
        let (middle, half) = if high - low < 1e3 {
            (0.5 * (low + high), 0.5 * (high - low) + 0.1)
        } else {
            (0.0, 1.0)
        };
        for i in 0..len {
            let at = j * len + i;
            q[at] = middle;
            if moving {
                // Incommensurable frequencies: no two coordinates move alike.
                let phase = (i + 1) as f64 * (1.0 + 0.618 * (j + 1) as f64);
                q[at] += half * phase.sin();
                qd[at] = (1.3 * phase).cos();
                qdd[at] = 2.0 * (1.7 * phase).sin();
            }
        }
    }
    let coordinate = match along {
        Along::Position => &mut q,
        Along::Velocity => &mut qd,
    };
    coordinate[joint * len..(joint + 1) * len].copy_from_slice(x);
    let motion = Motion {
        len,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let mut out = vec![Vec::new(); joints];
    library.evaluate(motion, &mut out);
    out.swap_remove(joint)
}

/// Mean and central 95 % of the torque at each point.
fn band(draws: &CoefficientDraws, columns: &[Column], len: usize) -> [Vec<f64>; 3] {
    let count = draws.models.len();
    let of_column = |c: &Column| -> Vec<f64> {
        let betas = draws.beta.chunks_exact(draws.columns);
        betas.map(|beta| beta[c.index]).collect()
    };
    let coefficients: Vec<Vec<f64>> = columns.iter().map(of_column).collect();
    let mut out = [vec![0.0; len], vec![0.0; len], vec![0.0; len]];
    let mut torque = vec![0.0; count];
    for point in 0..len {
        torque.fill(0.0);
        for (column, coefficients) in columns.iter().zip(&coefficients) {
            let each = torque.iter_mut().zip(coefficients);
            each.for_each(|(torque, beta)| *torque += beta * column.torque[point]);
        }
        out[0][point] = torque.iter().sum::<f64>() / count as f64;
        let [low, high] = [0.025, 0.975].map(|p| (p * (count - 1) as f64).round() as usize);
        let (below, &mut top, _) = torque.select_nth_unstable_by(high, f64::total_cmp);
        out[2][point] = top;
        out[1][point] = match low < high {
            true => *below.select_nth_unstable_by(low, f64::total_cmp).1,
            false => top,
        };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{Inertia, JointDescription, LinkDescription, RobotDescription};
    use crate::term::{Family, LibrarySettings};

    /// Two links turning about parallel horizontal axes.
    fn arm() -> Robot {
        let inertia = Some(Inertia {
            mass: 1.0,
            com: [0.1, 0.0, 0.0],
            tensor: [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]],
        });
        let link = |name: &str, inertia| LinkDescription {
            name: name.into(),
            inertia,
        };
        let joint = |name: &str, parent: &str, child: &str| JointDescription {
            axis: [0.0, 1.0, 0.0],
            ..JointDescription::new(name, JointKind::Revolute, parent, child)
        };
        let description = RobotDescription {
            name: "arm".into(),
            gravity: [0.0, 0.0, -9.81],
            links: vec![
                link("base", None),
                link("one", inertia),
                link("two", inertia),
            ],
            joints: vec![
                joint("shoulder", "base", "one"),
                joint("elbow", "one", "two"),
            ],
            allow_unphysical: false,
        };
        Robot::new(description, &Default::default()).unwrap().0
    }

    fn library(robot: &Robot) -> Library {
        let terms = ["q2^2", "cos(q1+q2)", "sin(q2)", "qd2^2*cos(q2)"];
        let settings = LibrarySettings {
            terms: terms.map(String::from).to_vec(),
            generic: Some(false),
            families: vec![Family::Viscous, Family::Offset],
            ..LibrarySettings::default()
        };
        Library::propose(robot, &settings).unwrap().0
    }

    const HULL: [[f64; 6]; 2] = [[-1.0, 2.0, -3.0, 2.0, -9.0, 9.0]; 2];

    /// `d/dq (q2²) = 2 q2` and `d/dq sin(q2) = cos(q2)` enter the torque with a minus (method section 2); what also acts on the
    /// first joint or changes with velocity does not belong; a constant has a potential and is no friction.
    #[test]
    fn columns_of_one_coordinate_are_found_and_no_others() {
        let robot = arm();
        let library = library(&robot);
        let name = |c: &Column| library.terms()[library.columns()[c.index]].name.clone();
        let x = grid(&HULL[1], Along::Position, JointKind::Revolute).unwrap();
        let columns = columns_along(&library, 1, Along::Position, &x, &HULL);
        let names: Vec<String> = columns.iter().map(name).collect();
        assert_eq!(names, ["q2^2", "sin(q2)", "elbow.offset"]);
        for (i, x) in x.iter().enumerate() {
            assert!((columns[0].torque[i] + 2.0 * x).abs() < 1e-12);
            assert!((columns[1].torque[i] + x.cos()).abs() < 1e-12);
            assert!((columns[2].torque[i] - 1.0).abs() < 1e-12 && columns[2].constant);
        }
        let x = grid(&HULL[1], Along::Velocity, JointKind::Revolute).unwrap();
        assert_eq!((x[0], x[POINTS - 1]), (-3.0, 2.0));
        let columns = columns_along(&library, 1, Along::Velocity, &x, &HULL);
        let names: Vec<String> = columns.iter().map(name).collect();
        assert_eq!(names, ["elbow.viscous"]);
        assert!(grid(&[0.5; 6], Along::Position, JointKind::Revolute).is_none());
    }

    /// Draws 0, 1, …, 2000 of one coefficient: mean 1000, 2.5 and 97.5 % at 50 and 1950.
    #[test]
    fn the_band_holds_95_percent_of_the_draws() {
        let draws = CoefficientDraws {
            models: vec![0; 2001],
            noise: vec![1.0; 2001],
            beta: (0..2001).map(f64::from).collect(),
            columns: 1,
        };
        let column = Column {
            index: 0,
            torque: vec![1.0, -2.0],
            constant: false,
        };
        let [mean, low, high] = band(&draws, &[column], 2);
        assert_eq!((mean[0], low[0], high[0]), (1000.0, 50.0, 1950.0));
        assert_eq!((mean[1], low[1], high[1]), (-2000.0, -3900.0, -100.0));
    }
}
