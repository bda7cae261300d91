//! Convex solids: the hull of a few points with a skin, a cylinder, or half of space; and how far two of them are apart.

use super::cloud::{Cloud, ends, outermost};
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query::gjk::{CsoPoint, GJKResult, VoronoiSimplex, closest_points};
use parry3d_f64::shape::SupportMap;

/// Directions in which a hull keeps its outermost points.
const DIRECTIONS: usize = 800;
/// Directions of the corners of an ellipsoid.
const CORNERS: usize = 250;
/// Points of a ball's hull that stand this much outside it: the hull then holds the ball.
const OUTSIDE: f64 = 1.02;

/// A convex solid in a frame of its body.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Solid {
    core: Core,
    /// Everything closer than this to the core belongs to the solid, m.
    skin: f64,
    /// Share of the skin that holds points of a mesh which the core leaves out, m.
    hull_skin: f64,
    /// Centre and radius of a ball that holds the solid.
    centre: Vector,
    radius: f64,
}

#[derive(Debug, Clone, PartialEq)]
enum Core {
    /// The convex hull of points.
    Hull(Cloud),
    /// Radius and half length along z.
    Cylinder(f64, f64),
    /// z ≤ 0.
    HalfSpace,
}

impl SupportMap for Core {
    fn local_support_point(&self, dir: Vector) -> Vector {
        match self {
            Self::Hull(cloud) => cloud.outermost(dir),
            Self::Cylinder(radius, half) => {
                let across = dir.x.hypot(dir.y);
                let at = match across > 0.0 {
                    true => radius / across,
                    false => 0.0,
                };
                Vector::new(dir.x * at, dir.y * at, half.copysign(dir.z))
            }
            Self::HalfSpace => Vector::ZERO,
        }
    }
}

impl Solid {
    /// A ball about the origin.
    pub(super) fn ball(radius: f64) -> Self {
        Self::new(Core::Hull(Cloud::new([Vector::ZERO])), radius)
    }

    /// Everything closer than a radius to a line between two points.
    pub(super) fn capsule(from: Vector, to: Vector, radius: f64) -> Self {
        Self::new(Core::Hull(Cloud::new([from, to])), radius)
    }

    /// A box with its centre at the origin.
    pub(super) fn cuboid([a, b, c]: [f64; 3]) -> Self {
        let signs = [-1.0, 1.0];
        let corners = signs.iter().flat_map(|x| {
            let pairs = signs
                .iter()
                .flat_map(|y| signs.iter().map(move |z| (*y, *z)));
            pairs.map(move |(y, z)| Vector::new(x * a, y * b, z * c))
        });
        Self::new(Core::Hull(Cloud::new(corners)), 0.0)
    }

    /// A cylinder with its centre at the origin.
    pub(super) fn cylinder(radius: f64, half: f64) -> Self {
        Self::new(Core::Cylinder(radius, half), 0.0)
    }

    /// An ellipsoid, or a little more.
    pub(super) fn ellipsoid([a, b, c]: [f64; 3]) -> Self {
        let points = directions(CORNERS).map(|d| Vector::new(a * d.x, b * d.y, c * d.z) * OUTSIDE);
        Self::new(Core::Hull(Cloud::new(points)), 0.0)
    }

    /// z ≤ 0.
    pub(super) fn half_space() -> Self {
        Self {
            core: Core::HalfSpace,
            skin: 0.0,
            hull_skin: 0.0,
            centre: Vector::ZERO,
            radius: f64::INFINITY,
        }
    }

    /// The convex hull of points, or a little more: of many points the outermost ones in [`DIRECTIONS`], and a skin that holds the others.
    ///
    /// `None` without a point.
    pub(super) fn hull(points: &[Vector]) -> Option<Self> {
        if points.is_empty() {
            return None;
        }
        if points.len() <= DIRECTIONS {
            return Some(Self::new(
                Core::Hull(Cloud::new(points.iter().copied())),
                0.0,
            ));
        }
        let mut kept: Vec<Vector> = Vec::new();
        for direction in directions(DIRECTIONS) {
            let (_, point) = outermost(points, direction);
            if !kept.contains(&point) {
                kept.push(point);
            }
        }
        let core = Core::Hull(Cloud::new(kept));
        let beyond = points.iter().map(|point| {
            let own = Core::Hull(Cloud::new([*point]));
            apart(&Pose::IDENTITY, &core, &own, f64::MAX).distance
        });
        let skin = beyond.fold(0.0, f64::max);
        Some(Self {
            hull_skin: skin,
            ..Self::new(core, skin)
        })
    }

    fn new(core: Core, skin: f64) -> Self {
        let (centre, radius) = match &core {
            Core::Hull(cloud) => {
                let points = cloud.points();
                let (low, high) = ends(points);
                let centre = 0.5 * (low + high);
                let away = points.iter().map(|point| (*point - centre).length());
                (centre, away.fold(0.0, f64::max))
            }
            Core::Cylinder(radius, half) => (Vector::ZERO, radius.hypot(*half)),
            Core::HalfSpace => (Vector::ZERO, f64::INFINITY),
        };
        Self {
            core,
            skin,
            hull_skin: 0.0,
            centre,
            radius: radius + skin,
        }
    }

    /// Largest distance of the solid from the origin of a frame in which it stands, m; infinite for half of space.
    pub(super) fn reach(&self, pose: &Pose) -> f64 {
        pose.transform_point(self.centre).length() + self.radius
    }

    /// Distance of two solids, 0 where they overlap; more than `far` is not looked at closely, and the result is then a lower bound.
    #[cfg(test)]
    pub(super) fn distance(&self, own: &Pose, other: &Self, its: &Pose, far: f64) -> f64 {
        self.apart(own, other, its, far).distance
    }

    /// The distance, with a direction that separates the two.
    pub(super) fn apart(&self, own: &Pose, other: &Self, its: &Pose, far: f64) -> Apart {
        match (&self.core, &other.core) {
            (Core::HalfSpace, _) => Apart {
                distance: other.above(its, own),
                axis: Some(own.transform_vector(Vector::Z)),
            },
            (_, Core::HalfSpace) => Apart {
                distance: self.above(own, its),
                axis: Some(-its.transform_vector(Vector::Z)),
            },
            _ => {
                let a = own.transform_point(self.centre);
                let b = its.transform_point(other.centre);
                let balls = (a - b).length() - self.radius - other.radius;
                if balls > far {
                    return Apart::exactly(balls);
                }
                // A joint far beyond every robot: no distance can be computed, which counts as an overlap.
                if !balls.is_finite() {
                    return Apart::exactly(0.0);
                }
                let skins = self.skin + other.skin;
                let between = own.inv_mul(its);
                let found = apart(&between, &self.core, &other.core, far + skins);
                Apart {
                    distance: (found.distance - skins).max(0.0),
                    axis: found.axis.map(|axis| own.transform_vector(axis)),
                }
            }
        }
    }

    /// The same solid without the skin that holds what its core leaves out of a mesh.
    pub(super) fn bare(&self) -> Self {
        Self {
            skin: self.skin - self.hull_skin,
            hull_skin: 0.0,
            ..self.clone()
        }
    }

    /// Gap between the two along a direction that leads from this solid to the other: their distance is no smaller.
    pub(super) fn gap(&self, own: &Pose, other: &Self, its: &Pose, axis: Vector) -> f64 {
        let end = |solid: &Self, at: &Pose, along: Vector| {
            let local = at.inverse_transform_vector(along);
            let point = at.transform_point(solid.core.local_support_point(local));
            point.dot(along) + solid.skin
        };
        -end(other, its, -axis) - end(self, own, axis)
    }

    /// Height of the lowest point above a plane, 0 where it is below.
    fn above(&self, own: &Pose, plane: &Pose) -> f64 {
        let up = plane.transform_vector(Vector::Z);
        let down = own.inverse_transform_vector(-up);
        let lowest = own.transform_point(self.core.local_support_point(down));
        ((lowest - plane.translation).dot(up) - self.skin).max(0.0)
    }
}

/// How far two solids are apart, and a direction from the first to the second along which they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Apart {
    pub(super) distance: f64,
    pub(super) axis: Option<Vector>,
}

impl Apart {
    fn exactly(distance: f64) -> Self {
        Self {
            distance,
            axis: None,
        }
    }
}

/// Distance of two cores by the algorithm of Gilbert, Johnson and Keerthi, in the first one's frame; where it is more than `far`, a lower bound beyond that.
fn apart(between: &Pose, one: &Core, other: &Core, far: f64) -> Apart {
    let towards = match between.translation.length() > 0.0 {
        true => -between.translation.normalize(),
        false => Vector::X,
    };
    let mut simplex = VoronoiSimplex::new();
    simplex.reset(CsoPoint::from_shapes(between, one, other, towards));
    match closest_points(between, one, other, far, true, &mut simplex) {
        GJKResult::ClosestPoints(a, b, _) => Apart {
            distance: (b - a).length(),
            axis: (b - a).try_normalize(),
        },
        // Along this axis they are apart, unless it did not converge.
        GJKResult::NoIntersection(axis) => {
            let gap = -axis.dot(CsoPoint::from_shapes(between, one, other, axis).point);
            match gap >= far {
                true => Apart {
                    distance: gap,
                    axis: Some(axis),
                },
                false => Apart::exactly(0.0),
            }
        }
        // What does not converge counts as an overlap: on the safe side.
        GJKResult::Intersection | GJKResult::Proximity(_) => Apart::exactly(0.0),
    }
}

/// Directions that are spread evenly over the sphere: a spiral of Fibonacci.
pub(super) fn directions(count: usize) -> impl Iterator<Item = Vector> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..count).map(move |k| {
        let z = 1.0 - (2 * k + 1) as f64 / count as f64;
        let across = (1.0 - z * z).sqrt();
        let (sin, cos) = (golden * k as f64).sin_cos();
        Vector::new(across * cos, across * sin, z)
    })
}
