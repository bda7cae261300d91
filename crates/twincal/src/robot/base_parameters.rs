//! Which inertial parameters, or which combinations of them, can be seen in torque at all: base parameters.

use super::Robot;
use super::block::BLOCK;
use super::motion::Motion;
use super::parameters::{PARAMETERS, to_body_frame};
use super::random_states::random_states;
use super::regressor::Regressor;
use crate::linear_algebra::dot;

/// Random states that the analysis looks at. A body has ten parameters and at least one joint's torque, so ten states
/// are enough for almost every draw; three times as many keep the columns well apart.
const STATES: usize = 32;
const _: () = assert!(STATES <= BLOCK);

/// A column whose part outside the span of those chosen before is below this fraction of its length depends on them.
/// Angles in model files are often rounded to four or five digits; what they make visible is below this bound.
const TOLERANCE: f64 = 1e-7;

/// A parameter that torque shows only together with others.
#[derive(Debug, Clone, PartialEq)]
pub struct DependentParameter {
    /// `<link>.<parameter>`.
    pub name: String,
    /// Its column is `Σ weight · column` of these independent parameters (index in [`BaseParameters::names`]); weights
    /// below 1e-6 of the largest are left out.
    pub combination: Vec<(usize, f64)>,
}

/// Structure of the inertial parameters of a robot, see [`base_parameters`].
#[derive(Debug, Clone, PartialEq)]
pub struct BaseParameters {
    /// Number of independent combinations: the rank of the regressor over all states.
    pub count: usize,
    /// One parameter for each, `<link>.<parameter>`; to know these is to know the torque of any motion.
    pub names: Vec<String>,
    /// Parameters that act only together with independent ones.
    pub dependent: Vec<DependentParameter>,
    /// Parameters that never act on any joint, e.g. the mass of a link that only turns about a fixed axis.
    pub unidentifiable: Vec<String>,
}

/// Independent, dependent and invisible inertial parameters of a robot, by the rank of its regressor over random states
/// of fixed seed (positions anywhere, gravity as in the model).
///
/// Names are `<link>.m`, `<link>.mcx` … `<link>.Izz` ([`PARAMETERS`]) of the main link of each body
/// ([`Robot::bodies`]), about the origin of the link's frame as the model file has it. Independent ones are chosen among
/// masses first, then first moments, then tensors; among equals the column that sticks out furthest.
///
/// # Source
/// Gautier 1991 (numerical base parameters by QR); Gram–Schmidt with pivoting, twice for orthogonality.
///
/// # Example
/// A planar arm of two links of 0.5 m has six base parameters. A mass on the elbow's axis acts like a first and a second moment of the upper
/// link: one of these three columns depends on the others.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::robot::base_parameters;
///
/// # let robot = two_link::arm(2.0)?;
/// let base = base_parameters(&robot);
/// assert_eq!(base.count, 6);
/// assert_eq!(base.dependent[0].name, "upper.Izz"); // 4 · fore.m − 2 · upper.mcx
/// for (independent, weight) in &base.dependent[0].combination {
///     println!("{weight:+.2} {}", base.names[*independent]);
/// }
/// assert!(base.unidentifiable.contains(&"upper.m".to_owned())); // a mass on a fixed axis has no torque
/// # Ok::<(), twincal::Error>(())
/// ```
pub fn base_parameters(robot: &Robot) -> BaseParameters {
    let bodies = robot.bodies.len();
    let mut columns = link_columns(robot);
    let lengths: Vec<f64> = columns.iter().map(|c| norm(c)).collect();
    let kind = |column: usize| kind_of(column % 10);
    let longest: [f64; 3] = std::array::from_fn(|wanted| {
        (0..10 * bodies)
            .filter(|&c| kind(c) == wanted)
            .fold(0f64, |most, c| most.max(lengths[c]))
    });
    let seen: Vec<bool> = (0..10 * bodies)
        .map(|c| lengths[c] > 1e-12 * longest[kind(c)])
        .collect();
    for (column, length) in columns.iter_mut().zip(&lengths) {
        if *length > 0.0 {
            column.iter_mut().for_each(|v| *v /= length);
        }
    }
    let Chosen {
        columns: chosen,
        products,
        free,
    } = choose(columns, &seen);
    let name = |c: usize| format!("{}.{}", robot.bodies()[c / 10], PARAMETERS[c % 10]);
    let dependent = (0..10 * bodies)
        .filter(|&c| seen[c] && free[c])
        .map(|c| DependentParameter {
            name: name(c),
            combination: combination(&chosen, &products, &lengths, c),
        })
        .collect();
    BaseParameters {
        count: chosen.len(),
        names: chosen.iter().map(|&c| name(c)).collect(),
        dependent,
        unidentifiable: (0..10 * bodies).filter(|&c| !seen[c]).map(name).collect(),
    }
}

/// Independent columns by Gram–Schmidt with pivoting.
struct Chosen {
    /// Independent columns, in the order of choice.
    columns: Vec<usize>,
    /// Products of every column with the orthonormal directions, in that order.
    products: Vec<Vec<f64>>,
    /// Columns that are seen and not chosen.
    free: Vec<bool>,
}

/// Chooses among the columns of length 1 that are seen.
fn choose(mut columns: Vec<Vec<f64>>, seen: &[bool]) -> Chosen {
    let count = columns.len();
    let mut chosen: Vec<usize> = Vec::new();
    let mut directions: Vec<Vec<f64>> = Vec::new();
    let mut products: Vec<Vec<f64>> = vec![Vec::new(); count];
    let mut free = seen.to_vec();
    // What is left of each column, brought up to date as parts go; measured again where most of it has gone.
    let mut left = vec![1.0_f64; count];
    let mut measured = left.clone();
    for wanted in 0..3 {
        loop {
            let candidates = (0..count).filter(|&c| free[c] && kind_of(c % 10) == wanted);
            let best = candidates
                .map(|c| (c, left[c]))
                .max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((best, length)) = best else { break };
            if length <= TOLERANCE {
                break;
            }
            free[best] = false;
            let mut direction = columns[best].clone();
            for earlier in &directions {
                subtract(&mut direction, earlier);
            }
            let length = norm(&direction);
            direction.iter_mut().for_each(|v| *v /= length);
            products[best].push(length);
            for c in 0..count {
                if free[c] {
                    let part = subtract(&mut columns[c], &direction);
                    products[c].push(part);
                    left[c] = f64::max(left[c] * left[c] - part * part, 0.0).sqrt();
                    if left[c] < 1e-3 * measured[c] {
                        left[c] = norm(&columns[c]);
                        measured[c] = left[c];
                    }
                }
            }
            chosen.push(best);
            directions.push(direction);
        }
    }
    Chosen {
        columns: chosen,
        products,
        free,
    }
}

/// 0: mass, 1: first moment, 2: tensor.
fn kind_of(parameter: usize) -> usize {
    usize::from(parameter > 0) + usize::from(parameter > 3)
}

fn norm(v: &[f64]) -> f64 {
    dot(v, v).sqrt()
}

/// Takes the part along `direction` (of length 1) out of `v` and returns it.
fn subtract(v: &mut [f64], direction: &[f64]) -> f64 {
    let part = dot(v, direction);
    if part != 0.0 {
        v.iter_mut()
            .zip(direction)
            .for_each(|(a, b)| *a -= part * b);
    }
    part
}

/// The weights of the chosen columns in column `c`: back substitution in the triangle of products.
fn combination(
    chosen: &[usize],
    products: &[Vec<f64>],
    lengths: &[f64],
    c: usize,
) -> Vec<(usize, f64)> {
    let mut weights = products[c].clone();
    for i in (0..chosen.len()).rev() {
        // products[chosen[i]] holds its own length last, at place i.
        weights[i] /= products[chosen[i]][i];
        for k in 0..i {
            weights[k] -= products[chosen[i]][k] * weights[i];
        }
    }
    for (weight, &other) in weights.iter_mut().zip(chosen) {
        *weight *= lengths[c] / lengths[other];
    }
    let largest = weights.iter().fold(0f64, |most, w| most.max(w.abs()));
    let pairs = weights.into_iter().enumerate();
    pairs.filter(|(_, w)| w.abs() > 1e-6 * largest).collect()
}

/// One column per parameter of every body, in the frame of its main link: its rows are joints × random states.
fn link_columns(robot: &Robot) -> Vec<Vec<f64>> {
    let (dof, bodies) = (robot.dof(), robot.bodies.len());
    let len = STATES;
    let [q, qd, qdd] = random_states(robot, len);
    let motion = Motion {
        len,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let regressor = Regressor::new(robot);
    let mut block = regressor.block(robot);
    let mut columns = vec![vec![0.0; dof * len]; 10 * bodies];
    regressor.evaluate(robot, motion, 0..len, &mut block);
    for (index, pair) in regressor.pairs().iter().enumerate() {
        let home = &robot.homes[robot.bodies[pair.body].link].1;
        let map = to_body_frame(home);
        let at = pair.coordinate * len;
        for i in (0..10).filter(|&i| pair.present[i]) {
            let values = block.column(index, i);
            for k in (0..10).filter(|&k| map[i][k] != 0.0) {
                let cells = &mut columns[10 * pair.body + k][at..at + len];
                for (cell, value) in cells.iter_mut().zip(values) {
                    *cell += map[i][k] * value;
                }
            }
        }
    }
    columns
}
