//! Whether a moving robot comes too close to itself, to the floor or to stated boxes: convex solids for the geometry of the model file.
//!
//! ```text
//! |ḋ| ≤ Σ_j r_j |q̇_j|        d: distance of two solids, j: joints between them, r_j: how far a point of the solid can be from the axis
//! ```
//! A distance at one moment so gives time in which the margin holds: the path is looked at where that time ends, and the margin holds
//! between the samples, too (conservative advancement).
//!
//! # Source
//! Distance: Gilbert, Johnson and Keerthi 1988. Advancement: Mirtich 1996.

mod mesh;
mod pairs;
mod scene;
mod solid;
#[cfg(test)]
mod tests;

pub use scene::{AssumedShape, IgnoredPair, Keep, StatedBox, Surroundings};

use pairs::Pair;
use parry3d_f64::math::{Mat3, Pose, Rotation, Vector};
use solid::Solid;
use twincal::design::{Approach, Clearance, Path};
use twincal::robot::{Placement, Robot};

/// A distance that is larger than the margin by this is not computed closely, m.
const FAR: f64 = 0.3;

/// Distance beyond the margin at which a search begins to keep away, m, and the share of it that it sees at least.
const NEAR: f64 = 0.05;
const LEAST: f64 = 1e-3;
/// Share of the last computed distance beyond the margin above which the gap along its direction is good enough.
const ENOUGH: f64 = 0.6;

/// A direction that separated two solids, with their distance then.
#[derive(Debug, Clone, Copy)]
struct Separating {
    axis: Vector,
    distance: f64,
}

/// A solid with its name on a rigid body.
#[derive(Debug, Clone)]
struct Placed {
    /// Link or box.
    name: String,
    /// `None`: it does not move.
    body: Option<usize>,
    /// Its frame in the body's, or in the base's.
    pose: Pose,
    solid: Solid,
    /// A frame without geometry: it counts for the boxes that name it alone.
    is_frame: bool,
}

/// A robot's geometry and what stands around it.
#[derive(Debug, Clone)]
pub struct CollisionWorld {
    robot: Robot,
    solids: Vec<Placed>,
    pairs: Vec<Pair>,
    margin: f64,
    /// Links whose geometry is assumed, and why.
    pub assumed: Vec<AssumedShape>,
    /// Pairs of links that are not looked at, and why.
    pub ignored: Vec<IgnoredPair>,
}

impl CollisionWorld {
    /// Smallest distance that is allowed, m.
    #[must_use]
    pub fn margin(&self) -> f64 {
        self.margin
    }

    /// Pairs of things that are looked at.
    #[must_use]
    pub fn pairs(&self) -> usize {
        self.pairs.len()
    }

    /// Distance of a pair, or a lower bound beyond [`FAR`]; `axis` is a direction that separates the two, and is kept.
    ///
    /// Along the direction of an earlier sample the gap is computed in no time: where it is [`ENOUGH`] of the distance there, it counts as the
    /// distance.
    fn distance(&self, pair: &Pair, bodies: &[Pose], axis: &mut Option<Separating>) -> f64 {
        let [(one, own), (other, its)] = self.placed(pair, bodies);
        if let Some(known) = axis {
            let gap = one.gap(&own, other, &its, known.axis);
            if gap - pair.margin >= ENOUGH * (known.distance - pair.margin) {
                return gap;
            }
        }
        let found = one.apart(&own, other, &its, self.margin + FAR);
        *axis = found.axis.map(|axis| Separating {
            axis,
            distance: found.distance,
        });
        found.distance
    }

    /// Distance of a pair at one moment, or a lower bound beyond `far`.
    fn distance_within(&self, pair: &Pair, bodies: &[Pose], far: f64) -> f64 {
        let [(one, own), (other, its)] = self.placed(pair, bodies);
        one.apart(&own, other, &its, far).distance
    }

    /// The two solids of a pair, where they are.
    fn placed(&self, pair: &Pair, bodies: &[Pose]) -> [(&Solid, Pose); 2] {
        [pair.one, pair.other].map(|at| {
            let placed = &self.solids[at];
            let pose = match placed.body {
                Some(body) => bodies[body] * placed.pose,
                None => placed.pose,
            };
            (&placed.solid, pose)
        })
    }

    fn approach(&self, pair: &Pair, distance: f64, time: f64) -> Approach {
        let name = |at: usize| self.solids[at].name.clone();
        Approach {
            between: [name(pair.one), name(pair.other)],
            distance,
            time,
        }
    }
}

impl Clearance for CollisionWorld {
    fn breach(&self, path: &Path) -> Option<Approach> {
        let mut frames = Frames::new(&self.robot, path);
        for pair in &self.pairs {
            let travel = pair.travel(path);
            let (mut sample, mut axis) = (0, None);
            while sample < path.len {
                let mut distance = self.distance(pair, frames.at(sample), &mut axis);
                let mut next = travel.next(sample, distance - pair.margin);
                if next.is_none() {
                    axis = None;
                    distance = self.distance(pair, frames.at(sample), &mut axis);
                    next = travel.next(sample, distance - pair.margin);
                }
                let Some(next) = next else {
                    let time = path.start + sample as f64 * path.step;
                    return Some(self.approach(pair, distance, time));
                };
                sample = next;
            }
        }
        None
    }

    fn nearness(&self, q: &[f64]) -> f64 {
        let bodies = poses(&self.robot, q);
        let near = |pair: &Pair| {
            // Pairs that are always close have no room to keep away in.
            if pair.margin < self.margin {
                return 0.0;
            }
            let left = self.distance_within(pair, &bodies, pair.margin + NEAR) - pair.margin;
            (left / NEAR).clamp(LEAST, 1.0).ln()
        };
        self.pairs.iter().map(near).sum()
    }

    fn closest(&self, path: &Path) -> Option<Approach> {
        let mut frames = Frames::new(&self.robot, path);
        let mut best: Option<Approach> = None;
        for pair in &self.pairs {
            let travel = pair.travel(path);
            let mut sample = 0;
            while sample < path.len {
                let distance = self.distance(pair, frames.at(sample), &mut None);
                let least = best.as_ref().map_or(f64::INFINITY, |own| own.distance);
                let full = pair.margin >= self.margin;
                if full && distance < least && distance <= self.margin + FAR {
                    let time = path.start + sample as f64 * path.step;
                    best = Some(self.approach(pair, distance, time));
                }
                let least = least.min(self.margin + FAR);
                sample = travel.next(sample, distance - least).unwrap_or(sample + 1);
            }
        }
        best
    }
}

/// Frames of the bodies at the samples that are looked at.
struct Frames<'a> {
    robot: &'a Robot,
    path: &'a Path,
    known: Vec<Vec<Pose>>,
}

impl<'a> Frames<'a> {
    fn new(robot: &'a Robot, path: &'a Path) -> Self {
        let known = vec![Vec::new(); path.len];
        Self { robot, path, known }
    }

    fn at(&mut self, sample: usize) -> &[Pose] {
        if self.known[sample].is_empty() {
            self.known[sample] = poses(self.robot, &self.path.position(sample));
        }
        &self.known[sample]
    }
}

/// Frames of the moving bodies at positions of the joints.
fn poses(robot: &Robot, q: &[f64]) -> Vec<Pose> {
    robot.body_placements(q).iter().map(pose).collect()
}

/// A frame as parry has it.
fn pose(placement: &Placement) -> Pose {
    let r = &placement.rotation;
    let column = |k: usize| Vector::new(r[0][k], r[1][k], r[2][k]);
    let matrix = Mat3::from_cols(column(0), column(1), column(2));
    Pose::from_parts(placement.translation.into(), Rotation::from_mat3(&matrix))
}
