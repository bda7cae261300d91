//! A moving body with its prior: what its inertia may be off, in a metric that no choice of axes, units or frames changes.
//!
//! The pseudo-inertia about the centre of mass is `J = diag(S, m)`, S the second moments of mass (`I = tr(S) E − S`). Its metric
//! under affine maps of space (Lee, Wensing, Park 2020) is a sum of squares along mass, first moments and second moments:
//!
//! ```text
//! tr(J⁻¹ dJ J⁻¹ dJ) = (dm/m)² + 2 dhᵀ S⁻¹ dh / m + tr(S⁻¹ dS S⁻¹ dS)
//! dh = √(m/2) L z,     dS = L Z Lᵀ,     L Lᵀ = S,     z and Z standard normal (Z symmetric, variance ½ beside its diagonal)
//! ```
//! so that independent standard normal coefficients are the prior that this metric has, a normal distribution.

use crate::robot::spatial::{Matrix, add, cross, dot, norm, scale, transpose};
use crate::robot::{Body as Layout, Placement, Robot, principal_axes, to_body_frame};
use std::f64::consts::PI;

/// Least radius of gyration along an axis, as a share of the link's length.
const LEAST_RADIUS: f64 = 0.1;
/// Radius, likewise, below which the model has a point where the link has a body.
const POINT: f64 = 0.01;
/// Least mass as a share of all that the body's joint moves.
const LEAST_MASS: f64 = 0.01;
/// Length of a link about which the model says nothing, m.
const REACH: f64 = 0.2;
/// Sine of the angle between two axes from which on they have a common normal.
const CROSSING: f64 = 0.05;
/// Length of a uniform rod per radius of gyration.
const ROD: f64 = 3.464_101_615_137_754_6;
/// Mean density below which nothing that a robot is made of lies, kg/m³: foam has more.
const LIGHTEST: f64 = 20.0;
/// Rounding in second moments of a plate or a rod, as a share of the largest.
const ROUNDING: f64 = 1e-9;

/// Ten inertial parameters in the body's frame.
pub(super) type Ten = [f64; 10];

/// What is known of a moving body before the data.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Body {
    /// Index of the body.
    pub(super) index: usize,
    /// The link that its joint carries.
    pub(super) name: String,
    /// That link's frame in the body's frame.
    pub(super) link: Placement,
    /// The inertia that a change of density scales.
    pub(super) shape: Ten,
    /// kg, with its floor.
    pub(super) mass: f64,
    /// Centre of mass in the body's frame, m.
    pub(super) centre: [f64; 3],
    /// Length of the link between its axes and its centre of mass, m; 0 where they meet.
    pub(super) length: f64,
    /// Second moments about the centre, with their floor, kg·m².
    pub(super) second: Matrix,
    /// Why the floor had to take the place of what the model says.
    pub(super) floored: Option<&'static str>,
}

/// All moving bodies of a robot.
pub(super) fn bodies(robot: &Robot) -> Vec<Body> {
    let layout = robot.layout();
    let names = robot.bodies();
    let moved = moved_masses(layout);
    let centres: Vec<[f64; 3]> = (0..layout.len()).map(|b| centre(layout, b)).collect();
    let lengths: Vec<f64> = (0..layout.len())
        .map(|b| length(layout, b, centres[b]))
        .collect();
    let all = |index: usize| {
        let least = LEAST_MASS * moved[index];
        let link = robot.body_of_link(names[index]);
        Body {
            index,
            name: names[index].to_owned(),
            link: link.map_or(Placement::IDENTITY, |(_, placement)| placement),
            ..floored(
                &robot.parameters_of_body(index),
                (least, centres[index]),
                lengths[index],
            )
        }
    };
    (0..layout.len()).map(all).collect()
}

/// Mass that each body's joint moves, 1 kg where that is none.
fn moved_masses(layout: &[Layout]) -> Vec<f64> {
    let mut moved: Vec<f64> = layout.iter().map(|body| body.moments.mass).collect();
    for index in (0..layout.len()).rev() {
        if let Some(parent) = layout[index].parent {
            moved[parent] += moved[index];
        }
    }
    let all = moved.iter().copied().fold(0.0, f64::max);
    let least = if all > 0.0 { LEAST_MASS * all } else { 1.0 };
    moved.iter().map(|mass| mass.max(least)).collect()
}

/// Centre of mass; of a body without mass the foot of its first child's axis on its own.
fn centre(layout: &[Layout], body: usize) -> [f64; 3] {
    let moments = &layout[body].moments;
    if moments.mass > 0.0 {
        return scale(1.0 / moments.mass, moments.first);
    }
    let mut feet = children(layout, body).filter_map(|child| Some(feet(child)?.0));
    feet.next().unwrap_or([0.0; 3])
}

/// Bodies that turn about an axis fixed in this one.
fn children(layout: &[Layout], body: usize) -> impl Iterator<Item = &Layout> {
    let own = layout.iter();
    own.filter(move |child| child.parent == Some(body) && !child.prismatic)
}

/// Direction of a child's axis in its parent's frame.
fn axis(child: &Layout) -> [f64; 3] {
    child.rotation.map(|row| row[2])
}

/// Ends of the common normal of the parent's axis (z through the origin) and the child's, where there is one: neither depends on where
/// along its axis a frame sits.
fn feet(child: &Layout) -> Option<([f64; 3], [f64; 3])> {
    let z = [0.0, 0.0, 1.0];
    let (direction, p) = (axis(child), child.translation);
    let normal = cross(z, direction);
    let square = dot(normal, normal);
    if square < CROSSING * CROSSING {
        return None;
    }
    let own = dot(cross(p, direction), normal) / square;
    let other = dot(cross(p, z), normal) / square;
    Some((scale(own, z), add(p, scale(other, direction))))
}

/// The longest of the distances between centre of mass, own axis and the axes that the body carries, m; 0 where all of them meet.
fn length(layout: &[Layout], body: usize, centre: [f64; 3]) -> f64 {
    let from_line = |point: [f64; 3], direction: [f64; 3]| norm(cross(point, direction));
    let mut longest = 0.0_f64;
    if !layout[body].prismatic {
        longest = from_line(centre, [0.0, 0.0, 1.0]);
    }
    for child in children(layout, body) {
        let from_child = add(centre, scale(-1.0, child.translation));
        longest = longest.max(from_line(from_child, axis(child)));
        if layout[body].prismatic {
            continue;
        }
        match feet(child) {
            Some((own, other)) => {
                let ends = [(own, other), (own, centre), (other, centre)];
                let lengths = ends.map(|(a, b)| norm(add(a, scale(-1.0, b))));
                longest = lengths.into_iter().fold(longest, f64::max);
            }
            None => longest = longest.max(from_line(child.translation, [0.0, 0.0, 1.0])),
        }
    }
    longest
}

/// Prior of a body with these parameters, at least `least` kg of mass about `centre`, `length` metres between its axes.
fn floored(nominal: &Ten, (least, centre): (f64, [f64; 3]), length: f64) -> Body {
    let light = nominal[0] < least;
    let mass = nominal[0].max(least);
    let (moments, axes) = principal_axes(&second_moments(nominal, centre));
    let largest = moments[2].max(0.0);
    let hollow = density(nominal[0], moments) < LIGHTEST;
    let rod = match light || hollow {
        true => 0.0,
        false => ROD * (largest / mass).sqrt(),
    };
    let size = match length.max(rod) {
        0.0 => REACH,
        size => size,
    };
    let radius = |share: f64| mass * (share * size).powi(2);
    // A tensor that is too large is at least as uncertain as it is large.
    let kept = moments.map(|moment| moment.max(radius(LEAST_RADIUS)));
    let floored = match () {
        () if light => Some("hardly any mass"),
        () if hollow => Some("an inertia tensor too large for its mass"),
        () if moments[0] < -ROUNDING * moments[2].abs() => Some("an impossible inertia tensor"),
        () if moments[2] < radius(POINT) => Some("a point mass"),
        () => None,
    };
    let second: Matrix = std::array::from_fn(|i| {
        std::array::from_fn(|j| (0..3).map(|k| axes[i][k] * kept[k] * axes[j][k]).sum())
    });
    let mut body = Body {
        index: 0,
        name: String::new(),
        link: Placement::IDENTITY,
        shape: *nominal,
        mass,
        centre,
        length,
        second,
        floored,
    };
    if light {
        let mut own = [0.0; 10];
        own[0] = mass;
        own[4..].copy_from_slice(&tensor(&second));
        body.shape = body.centred(&own);
    }
    body
}

/// Mean density of the uniform ellipsoid with that mass and those second moments (`m a²/5` for a half axis a), kg/m³; ∞ for plates and rods.
fn density(mass: f64, moments: [f64; 3]) -> f64 {
    let half_axes = moments.map(|moment| (5.0 * moment.max(0.0) / mass).sqrt());
    let volume = 4.0 / 3.0 * PI * half_axes.iter().product::<f64>();
    match volume > 0.0 {
        true => mass / volume,
        false => f64::INFINITY,
    }
}

/// Second moments of mass about `centre`, from parameters about the origin.
fn second_moments(parameters: &Ten, centre: [f64; 3]) -> Matrix {
    let [mass, hx, hy, hz, xx, xy, xz, yy, yz, zz] = *parameters;
    let half = 0.5 * (xx + yy + zz);
    let about_origin = [
        [half - xx, -xy, -xz],
        [-xy, half - yy, -yz],
        [-xz, -yz, half - zz],
    ];
    let first = [hx, hy, hz];
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            about_origin[i][j] - first[i] * centre[j] - centre[i] * first[j]
                + mass * centre[i] * centre[j]
        })
    })
}

/// The tensor of second moments, tr(S) E − S, in the order of the parameters.
fn tensor(second: &Matrix) -> [f64; 6] {
    let trace = second[0][0] + second[1][1] + second[2][2];
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = *second;
    [trace - xx, -xy, -xz, trace - yy, -yz, trace - zz]
}

/// Lower factor L of a positive definite matrix, L Lᵀ.
fn factor(matrix: &Matrix) -> Matrix {
    let mut lower = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..=i {
            let rest = matrix[i][j] - (0..j).map(|k| lower[i][k] * lower[j][k]).sum::<f64>();
            lower[i][j] = match i == j {
                true => rest.max(0.0).sqrt(),
                false => rest / lower[j][j],
            };
        }
    }
    lower
}

impl Body {
    /// A body that hangs on this one: of that mass, and as large as this link or as `size`.
    pub(super) fn carried(&self, mass: f64, size: f64) -> Self {
        let second = mass * self.length.hypot(size).powi(2);
        Self {
            mass,
            second: std::array::from_fn(|i| {
                std::array::from_fn(|j| if i == j { second } else { 0.0 })
            }),
            ..self.clone()
        }
    }

    /// Parameters about the centre as parameters about the body's origin.
    pub(super) fn centred(&self, about_centre: &Ten) -> Ten {
        let map = to_body_frame(&Placement {
            translation: self.centre,
            ..Placement::IDENTITY
        });
        map.map(|row| row.iter().zip(about_centre).map(|(a, b)| a * b).sum())
    }

    /// Mass alone, at the centre, per kg.
    pub(super) fn of_mass(&self) -> Ten {
        let mut own = [0.0; 10];
        own[0] = 1.0;
        self.centred(&own)
    }

    /// First moments about the centre for each of three standard normal coefficients.
    pub(super) fn of_first_moments(&self) -> Vec<Ten> {
        let columns = transpose(&factor(&self.second));
        let one = |column: [f64; 3]| {
            let mut own = [0.0; 10];
            own[1..4].copy_from_slice(&scale((0.5 * self.mass).sqrt(), column));
            self.centred(&own)
        };
        columns.into_iter().map(one).collect()
    }

    /// Second moments about the centre for each of six standard normal coefficients.
    pub(super) fn of_second_moments(&self) -> Vec<Ten> {
        let columns = transpose(&factor(&self.second));
        let pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
        let one = |(a, b): (usize, usize)| {
            // L Z Lᵀ with Z = e_a e_aᵀ, or (e_a e_bᵀ + e_b e_aᵀ)/√2.
            let size = if a == b { 0.5 } else { 0.5_f64.sqrt() };
            let second: Matrix = std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    let symmetric = columns[a][i] * columns[b][j] + columns[b][i] * columns[a][j];
                    size * symmetric
                })
            });
            let mut own = [0.0; 10];
            own[4..].copy_from_slice(&tensor(&second));
            self.centred(&own)
        };
        pairs.into_iter().map(one).collect()
    }
}

#[cfg(test)]
#[path = "body_tests.rs"]
mod tests;
