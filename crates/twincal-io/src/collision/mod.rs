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

mod cloud;
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
use twincal::design::{Approach, Clearance, NearSlope, Path};
use twincal::robot::{Placement, Robot};

/// A distance that is larger than the margin by this is not computed closely, m.
const FAR: f64 = 0.3;

/// Share of a pair's room that a search sees at least.
const LEAST: f64 = 1e-3;
/// Share of the last computed distance beyond the margin above which the gap along its direction is good enough.
const ENOUGH: f64 = 0.6;

/// A direction that separated two solids, with their distance then.
#[derive(Debug, Clone, Copy)]
struct Separating {
    axis: Vector,
    distance: f64,
}

/// A pair, and a direction that separated it last.
type Looked<'a> = (&'a Pair, Option<Separating>);

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
        let enough = axis.map_or(f64::INFINITY, |known| {
            pair.margin + ENOUGH * (known.distance - pair.margin)
        });
        self.looked_at(pair, bodies, axis, (enough, self.margin + FAR))
    }

    /// Distance of a pair, or a lower bound: the gap along a known axis where it is `enough`, and one beyond `far`.
    fn looked_at(
        &self,
        pair: &Pair,
        bodies: &[Pose],
        axis: &mut Option<Separating>,
        (enough, far): (f64, f64),
    ) -> f64 {
        let [(one, own), (other, its)] = self.placed(pair, bodies);
        if let Some(known) = axis {
            let gap = one.gap(&own, other, &its, known.axis);
            if gap >= enough {
                return gap;
            }
        }
        let found = one.apart(&own, other, &its, far);
        *axis = found.axis.map(|axis| Separating {
            axis,
            distance: found.distance,
        });
        found.distance
    }

    /// All pairs, none looked at.
    fn looks(&self) -> Vec<Looked<'_>> {
        self.pairs.iter().map(|own| (own, None)).collect()
    }

    /// What is left to the margin as a share of the pair's room, [`LEAST`] to 1.
    fn near(&self, pair: &Pair, bodies: &[Pose], axis: &mut Option<Separating>) -> f64 {
        let far = pair.margin + pair.room();
        let left = self.looked_at(pair, bodies, axis, (far, far)) - pair.margin;
        (left / pair.room()).clamp(LEAST, 1.0)
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
    fn breach(&self, path: &Path, joint: Option<usize>) -> Option<Approach> {
        let mut frames = Frames::new(&self.robot, path);
        let concerned = |own: &&Pair| joint.is_none_or(|joint| own.joints().contains(&joint));
        for pair in self.pairs.iter().filter(concerned) {
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

    fn nearness(&self, q: &[f64], len: usize) -> Vec<f64> {
        let mut pairs = self.looks();
        let of = |state: usize| {
            let bodies = poses(&self.robot, &position(q, len, state));
            let near = |(pair, axis): &mut Looked<'_>| self.near(pair, &bodies, axis).ln();
            pairs.iter_mut().map(near).sum()
        };
        (0..len).map(of).collect()
    }

    /// Differences over `steps` to either side: what lies between is smoothed, where corners and faces take turns.
    fn nearness_slopes(&self, q: &[f64], len: usize, steps: &[f64]) -> Vec<NearSlope> {
        let mut pairs = self.looks();
        let mut found = Vec::new();
        for state in 0..len {
            let mut q = position(q, len, state);
            let bodies = poses(&self.robot, &q);
            let mut around: Vec<Option<[Vec<Pose>; 2]>> = vec![None; q.len()];
            for (pair, axis) in &mut pairs {
                if self.near(pair, &bodies, axis) >= 1.0 {
                    continue;
                }
                let mut slopes = vec![0.0; q.len()];
                for joint in pair.joints() {
                    let around = around[joint].get_or_insert_with(|| {
                        [-1.0, 1.0].map(|side| {
                            let here = q[joint];
                            q[joint] += side * steps[joint];
                            let there = poses(&self.robot, &q);
                            q[joint] = here;
                            there
                        })
                    });
                    let logs = [0, 1].map(|side| self.near(pair, &around[side], &mut None).ln());
                    slopes[joint] = (logs[1] - logs[0]) / (2.0 * steps[joint]);
                }
                found.push(NearSlope { state, slopes });
            }
        }
        found
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

/// Positions of one state, of `[joint * len + state]`.
fn position(q: &[f64], len: usize, state: usize) -> Vec<f64> {
    q.iter().skip(state).step_by(len).copied().collect()
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
