//! From a model's geometry and what the user states to the solids and pairs that are looked at.

use super::pairs::{Pair, TOUCHING};
use super::solid::Solid;
use super::{CollisionWorld, Placed, mesh, pose, poses};
use crate::error::{Error, Result};
use crate::model::{Form, Geometry, LinkShape};
use parry3d_f64::math::{Pose, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;
use twincal::design::{JointLimits, spread_positions};
use twincal::robot::spatial::{norm, scale, z_to};
use twincal::robot::{MovingBody, Placement, Robot, did_you_mean};

/// Smallest distance where none is stated, m.
const MARGIN: f64 = 0.02;
/// Radius of a capsule that stands for unknown geometry, as a share of the robot's reach.
const CAPSULE: f64 = 0.08;
/// Random positions at which a pair has to be too close, each time, to be left out.
const LOOKS: usize = 256;
/// Radius of a frame without geometry, m.
const POINT: f64 = 1e-6;
/// Name of the floor in what is said.
const FLOOR: &str = "floor";

/// What stands around a robot, and how near it may come.
#[derive(Debug, Clone, PartialEq)]
pub struct Surroundings {
    /// Smallest distance between any two things, m.
    pub margin: f64,
    /// Height of the floor over the origin of the base, against gravity, m; `None`: no floor.
    pub floor: Option<f64>,
    /// Boxes to stay out of, or in.
    pub boxes: Vec<StatedBox>,
    /// Pairs of links that are not looked at.
    pub ignore: Vec<[String; 2]>,
}

impl Default for Surroundings {
    fn default() -> Self {
        Self {
            margin: MARGIN,
            floor: None,
            boxes: Vec::new(),
            ignore: Vec::new(),
        }
    }
}

/// A box with its edges along the axes of the base.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct StatedBox {
    /// Name in what is said.
    pub name: String,
    /// Smallest coordinates, m.
    pub low: [f64; 3],
    /// Largest coordinates, m.
    pub high: [f64; 3],
    /// Which side is allowed.
    pub keep: Keep,
    /// Links or frames that it is for; empty: all that move.
    pub links: Vec<String>,
}

/// The allowed side of a box.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Keep {
    /// An obstacle.
    #[default]
    Outside,
    /// A workspace.
    Inside,
}

/// A link whose geometry is not known: a capsule stands for it.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct AssumedShape {
    /// Name of the link.
    pub link: String,
    /// Why.
    pub reason: String,
    /// Radius of the capsule, m.
    pub radius: f64,
}

/// Two links that are not looked at.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct IgnoredPair {
    /// Names of the links.
    pub between: [String; 2],
    /// `stated` (in the limits file), `model` (MJCF `<exclude>`), `always` (closer than the margin wherever the robot is), `touching` (so, too,
    /// but it touches in some positions alone: it is looked at, without the margin).
    pub reason: &'static str,
}

impl CollisionWorld {
    /// Of a robot whose model file, with this geometry, lies at a path; joints stay within their limits.
    ///
    /// # Errors
    /// A link that the surroundings name and the robot lacks, a box with a negative edge, a margin that is no number from 0 on.
    pub fn new(
        robot: &Robot,
        (geometry, model): (&Geometry, &Path),
        limits: &[JointLimits],
        surroundings: &Surroundings,
    ) -> Result<Self> {
        check(robot, surroundings)?;
        let mut scene = Scene {
            bodies: robot.moving_bodies(),
            robot,
            limits,
            margin: surroundings.margin,
            solids: Vec::new(),
            assumed: Vec::new(),
        };
        for shape in &geometry.shapes {
            scene.add(shape, model);
        }
        scene.add_missing();
        let (pairs, mut ignored) = scene.own_pairs(geometry, surroundings);
        let mut pairs: Vec<Pair> = pairs.into_iter().map(|two| scene.pair(two)).collect();
        let around = scene.add_surroundings(surroundings);
        let mut world = Self {
            robot: robot.clone(),
            solids: Vec::new(),
            pairs: Vec::new(),
            margin: surroundings.margin,
            assumed: scene.assumed.clone(),
            ignored: Vec::new(),
        };
        let around: Vec<Pair> = around.into_iter().map(|two| scene.pair(two)).collect();
        world.solids = scene.solids;
        world.leave_out(&mut pairs, &mut ignored, limits);
        world.pairs = pairs.into_iter().chain(around).collect();
        world.ignored = ignored;
        Ok(world)
    }

    /// Takes away pairs that no joint can part: closer than the margin wherever the robot is, and either always or never touching. Of those
    /// that touch here and there the margin is [`TOUCHING`].
    fn leave_out(
        &self,
        pairs: &mut Vec<Pair>,
        ignored: &mut Vec<IgnoredPair>,
        limits: &[JointLimits],
    ) {
        let look = |k| poses(&self.robot, &spread_positions(k, limits));
        let looks: Vec<Vec<Pose>> = (0..LOOKS).map(look).collect();
        let mut bare = self.clone();
        bare.solids
            .iter_mut()
            .for_each(|own| own.solid = own.solid.bare());
        let mut left_out: BTreeSet<([String; 2], &'static str)> = BTreeSet::new();
        pairs.retain_mut(|pair| {
            let distances = looks
                .iter()
                .map(|bodies| self.distance(pair, bodies, &mut None));
            let distances: Vec<f64> = distances.collect();
            pair.usual = distances.iter().sum::<f64>() / LOOKS as f64;
            if distances.iter().any(|own| *own >= pair.margin) {
                return true;
            }
            // Skins of two meshes may touch where the meshes do not.
            let touching = looks
                .iter()
                .filter(|bodies| bare.distance(pair, bodies, &mut None) < TOUCHING);
            let touching = touching.count();
            let names = [pair.one, pair.other].map(|at| self.solids[at].name.clone());
            pair.margin = TOUCHING;
            let stays = touching > 0 && touching < LOOKS;
            let reason = if stays { "touching" } else { "always" };
            left_out.insert((names, reason));
            stays
        });
        // What is often close is looked at first.
        pairs.sort_by(|a, b| a.usual.total_cmp(&b.usual));
        let left_out = left_out.into_iter();
        ignored.extend(left_out.map(|(between, reason)| IgnoredPair { between, reason }));
    }
}

/// Solids while they are gathered.
struct Scene<'a> {
    robot: &'a Robot,
    bodies: Vec<MovingBody>,
    limits: &'a [JointLimits],
    margin: f64,
    solids: Vec<Placed>,
    assumed: Vec<AssumedShape>,
}

impl Scene<'_> {
    fn pair(&self, two: (usize, usize)) -> Pair {
        let margin = self.margin;
        Pair::new((two, margin), &self.solids, &self.bodies, self.limits)
    }

    /// One geometry of the model file.
    fn add(&mut self, shape: &LinkShape, model: &Path) {
        let Some((body, link)) = self.robot.home_of_link(&shape.link) else {
            return;
        };
        let at = pose(&link.compose(&shape.placement));
        let solid = match mesh::of_form(&shape.form, model) {
            Some(Ok(points)) => Solid::hull(&points),
            Some(Err(reason)) => {
                self.assume(&shape.link, (body, &link), reason);
                None
            }
            None => primitive(&shape.form),
        };
        let Some(solid) = solid else { return };
        // A half of space has no end; of all else a number beyond every robot would overflow in distances.
        let reach = solid.reach(&at);
        let fits = reach.is_finite() && reach < mesh::FARTHEST;
        if !fits && solid != Solid::half_space() {
            let reason = format!("its geometry reaches farther than {} m", mesh::FARTHEST);
            self.assume(&shape.link, (body, &link), reason);
            return;
        }
        // Half of space stands for a floor: it does not move with a link.
        if body.is_some() && solid == Solid::half_space() {
            return;
        }
        self.solids.push(Placed {
            name: shape.link.clone(),
            body,
            pose: at,
            solid,
            is_frame: false,
        });
    }

    /// Moving bodies without any geometry.
    fn add_missing(&mut self) {
        for body in 0..self.bodies.len() {
            let has = |own: &Placed| own.body == Some(body);
            let is_assumed = |own: &AssumedShape| own.link == self.bodies[body].link;
            if self.solids.iter().any(has) || self.assumed.iter().any(is_assumed) {
                continue;
            }
            let link = self.bodies[body].link.clone();
            let placement = self
                .robot
                .home_of_link(&link)
                .map_or(Placement::IDENTITY, |own| own.1);
            self.assume(
                &link,
                (Some(body), &placement),
                "the model has no geometry".into(),
            );
        }
    }

    /// Capsules from the link's joint to where it ends, or a ball about the joint.
    fn assume(&mut self, link: &str, (body, frame): (Option<usize>, &Placement), reason: String) {
        let Some(body) = body else {
            // What stands still: the reader is told, nothing stands for it.
            self.assumed.push(AssumedShape {
                link: link.to_owned(),
                reason,
                radius: 0.0,
            });
            return;
        };
        let radius = CAPSULE * self.reach();
        let own = &self.bodies[body];
        let from: Vector = match own.link == link {
            true => Vector::ZERO,
            false => frame.translation.into(),
        };
        let mut ends = self.ends_of(link, body, frame);
        ends.retain(|to| (*to - from).length() > POINT);
        if ends.is_empty() {
            ends = vec![from];
        }
        for to in ends {
            self.solids.push(Placed {
                name: link.to_owned(),
                body: Some(body),
                pose: Pose::IDENTITY,
                solid: Solid::capsule(from, to, radius),
                is_frame: false,
            });
        }
        self.assumed.push(AssumedShape {
            link: link.to_owned(),
            reason,
            radius,
        });
    }

    /// Where a link ends, in its body: at the joints and frames that the body carries, and at the centre of mass; of a link that is fixed to
    /// another one at its centre of mass alone.
    fn ends_of(&self, link: &str, body: usize, frame: &Placement) -> Vec<Vector> {
        let links = &self.robot.description().links;
        let inertia = links
            .iter()
            .find(|own| own.name == link)
            .and_then(|own| own.inertia);
        let mut ends: Vec<Vector> = inertia
            .iter()
            .map(|own| frame.point(own.com).into())
            .collect();
        if self.bodies[body].link == link {
            let children =
                (0..self.bodies.len()).filter(|&at| self.bodies[at].parent == Some(body));
            ends.extend(children.map(|child| self.origin_in_parent(child)));
            let fixed = links
                .iter()
                .filter_map(|own| self.robot.home_of_link(&own.name));
            let fixed = fixed.filter(|(home, _)| *home == Some(body));
            ends.extend(fixed.map(|(_, at)| Vector::from(at.translation)));
        }
        ends
    }

    /// Origin of a body in the body that carries it, its joints at 0.
    fn origin_in_parent(&self, body: usize) -> Vector {
        let all = self.robot.body_placements(&vec![0.0; self.robot.dof()]);
        match self.bodies[body].parent {
            Some(parent) => pose(&all[parent]).inv_mul(&pose(&all[body])).translation,
            None => all[body].translation.into(),
        }
    }

    /// Length of the longest chain of bodies, m.
    fn reach(&self) -> f64 {
        let mut lengths: Vec<f64> = Vec::with_capacity(self.bodies.len());
        for body in &self.bodies {
            let before = body.parent.map_or(0.0, |parent| lengths[parent]);
            lengths.push(before + body.offset_from_parent);
        }
        lengths.into_iter().fold(0.0, f64::max)
    }

    /// Pairs of the robot's own solids, without those that a joint holds together, and those that are left out by name.
    fn own_pairs(
        &self,
        geometry: &Geometry,
        surroundings: &Surroundings,
    ) -> (Vec<(usize, usize)>, Vec<IgnoredPair>) {
        let mut pairs = Vec::new();
        let mut ignored: BTreeSet<([String; 2], &'static str)> = BTreeSet::new();
        for other in 0..self.solids.len() {
            for one in 0..other {
                let (a, b) = (&self.solids[one], &self.solids[other]);
                if a.body == b.body || self.adjacent(a, b) || self.adjacent(b, a) {
                    continue;
                }
                let names = |own: &&[String; 2]| {
                    (own[0] == a.name && own[1] == b.name) || (own[1] == a.name && own[0] == b.name)
                };
                let between = [a.name.clone(), b.name.clone()];
                if surroundings.ignore.iter().any(|own| names(&own)) {
                    ignored.insert((between, "stated"));
                } else if geometry.excluded.iter().any(|own| names(&own)) {
                    ignored.insert((between, "model"));
                } else {
                    pairs.push((one, other));
                }
            }
        }
        let ignored = ignored
            .into_iter()
            .map(|(between, reason)| IgnoredPair { between, reason });
        (pairs, ignored.collect())
    }

    /// Whether a joint stands on the first solid's body and moves the second's; of what does not move the link with the joint counts alone.
    fn adjacent(&self, carrier: &Placed, moved: &Placed) -> bool {
        let Some(body) = moved.body else { return false };
        let own = &self.bodies[body];
        if own.parent != carrier.body {
            return false;
        }
        let joints = &self.robot.description().joints;
        let stands_on = |link: &str| {
            joints
                .iter()
                .any(|j| j.child == own.link && j.parent == link)
        };
        carrier.body.is_some() || stands_on(&carrier.name)
    }

    /// Floor and boxes as solids, and their pairs.
    fn add_surroundings(&mut self, surroundings: &Surroundings) -> Vec<(usize, usize)> {
        let mut pairs = Vec::new();
        if let Some(height) = surroundings.floor {
            let gravity = self.robot.description().gravity;
            let up = match norm(gravity) > 0.0 {
                true => scale(-1.0 / norm(gravity), gravity),
                false => [0.0, 0.0, 1.0],
            };
            let floor = self.half_space(FLOOR, up, height);
            pairs.extend(self.movers(&[]).into_iter().map(|own| (own, floor)));
        }
        for stated in &surroundings.boxes {
            let links = self.movers(&stated.links);
            let walls: Vec<usize> = match stated.keep {
                Keep::Outside => vec![self.cuboid(stated)],
                Keep::Inside => (0..3)
                    .flat_map(|axis| [self.wall(stated, axis, 1.0), self.wall(stated, axis, -1.0)])
                    .collect(),
            };
            pairs.extend(
                links
                    .iter()
                    .flat_map(|own| walls.iter().map(|wall| (*own, *wall))),
            );
        }
        pairs
    }

    /// Solids of some links, or of all that move; a frame without geometry becomes a point.
    fn movers(&mut self, links: &[String]) -> Vec<usize> {
        let mut found: Vec<usize> = Vec::new();
        let moves = |own: &Placed| own.body.is_some() && !own.is_frame;
        if links.is_empty() {
            return (0..self.solids.len())
                .filter(|&at| moves(&self.solids[at]))
                .collect();
        }
        for link in links {
            let before = found.len();
            let named = |own: &Placed| own.name == *link && own.body.is_some();
            found.extend((0..self.solids.len()).filter(|&at| named(&self.solids[at])));
            let Some((Some(body), frame)) = self.robot.home_of_link(link) else {
                continue;
            };
            if found.len() == before {
                self.solids.push(Placed {
                    name: link.clone(),
                    body: Some(body),
                    pose: pose(&frame),
                    solid: Solid::ball(POINT),
                    is_frame: true,
                });
                found.push(self.solids.len() - 1);
            }
        }
        found
    }

    /// Half of space below a plane, whose normal leads out of it.
    fn half_space(&mut self, name: &str, normal: [f64; 3], along: f64) -> usize {
        let placement = Placement {
            rotation: z_to(normal),
            translation: scale(along, normal),
        };
        self.still(name, pose(&placement), Solid::half_space())
    }

    /// One side of a box to stay in.
    fn wall(&mut self, stated: &StatedBox, axis: usize, side: f64) -> usize {
        let at = match side > 0.0 {
            true => stated.high[axis],
            false => stated.low[axis],
        };
        let mut inwards = [0.0; 3];
        inwards[axis] = -side;
        self.half_space(&stated.name, inwards, -side * at)
    }

    fn cuboid(&mut self, stated: &StatedBox) -> usize {
        let (low, high) = (Vector::from(stated.low), Vector::from(stated.high));
        let half = 0.5 * (high - low);
        let at = Pose::from_translation(0.5 * (low + high));
        self.still(&stated.name, at, Solid::cuboid(half.to_array()))
    }

    fn still(&mut self, name: &str, pose: Pose, solid: Solid) -> usize {
        self.solids.push(Placed {
            name: name.to_owned(),
            body: None,
            pose,
            solid,
            is_frame: false,
        });
        self.solids.len() - 1
    }
}

fn primitive(form: &Form) -> Option<Solid> {
    Some(match form {
        Form::Box(half) => Solid::cuboid(*half),
        Form::Sphere(radius) => Solid::ball(*radius),
        Form::Cylinder(radius, half) => Solid::cylinder(*radius, *half),
        Form::Capsule(radius, half) => {
            let end = Vector::new(0.0, 0.0, *half);
            Solid::capsule(-end, end, *radius)
        }
        Form::Ellipsoid(half) => Solid::ellipsoid(*half),
        Form::HalfSpace => Solid::half_space(),
        Form::Mesh(_) | Form::Points(_) | Form::Other(_) => return None,
    })
}

/// # Errors
/// See [`CollisionWorld::new`].
fn check(robot: &Robot, surroundings: &Surroundings) -> Result<()> {
    let margin = surroundings.margin;
    if !(margin >= 0.0 && margin.is_finite()) {
        let problem = format!("{margin} m");
        return refuse("limits.margin", problem, "give a length from 0 on".into());
    }
    if let Some(height) = surroundings.floor.filter(|height| !height.is_finite()) {
        let problem = format!("{height} m");
        return refuse("limits.floor", problem, "give a height in m".into());
    }
    let known = || {
        robot
            .description()
            .links
            .iter()
            .map(|own| own.name.as_str())
    };
    let names = surroundings.boxes.iter().flat_map(|own| &own.links);
    for name in names.chain(surroundings.ignore.iter().flatten()) {
        if !known().any(|own| own == name) {
            let problem = format!("link `{name}` is not in the model");
            return refuse("limits", problem, did_you_mean(name, known()));
        }
    }
    surroundings
        .boxes
        .iter()
        .try_for_each(|stated| check_box(robot, stated))
}

/// A box has edges of a length that a robot may meet, and is for links that move.
fn check_box(robot: &Robot, stated: &StatedBox) -> Result<()> {
    let (low, high) = (stated.low, stated.high);
    let mut ends = low.iter().zip(&high);
    let fits = |x: &f64| x.abs() < mesh::FARTHEST;
    if !ends.all(|(low, high)| low < high && fits(low) && fits(high)) {
        let problem = format!("box `{}` is from {low:?} to {high:?}", stated.name);
        let remedy = "give the smaller corner as `low`, in m".into();
        return refuse("limits.box", problem, remedy);
    }
    let still = |link: &&String| matches!(robot.home_of_link(link), Some((None, _)));
    if let Some(link) = stated.links.iter().find(still) {
        let problem = format!(
            "box `{}` is for link `{link}`, which does not move",
            stated.name
        );
        return refuse("limits.box", problem, "name a link that moves".into());
    }
    Ok(())
}

fn refuse(key: &str, problem: String, remedy: String) -> Result<()> {
    Err(Error::from(twincal::Error::Setting {
        key: key.into(),
        problem,
        remedy,
    }))
}
