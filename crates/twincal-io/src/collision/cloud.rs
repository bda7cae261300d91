//! Points in a tree of clusters, of which the outermost one along a direction is found without a look at most of them.
//!
//! ```text
//! max_{p in cluster} p·d ≤ c·d + r |d|        c, r: centre and radius of a ball about the cluster
//! ```

use parry3d_f64::math::Vector;

/// Points of a cluster that is not split.
const TOGETHER: usize = 8;

/// Points, next to one another where they are near.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cloud {
    points: Vec<Vector>,
    /// The first one holds all points.
    clusters: Vec<Cluster>,
}

/// Some points, and a ball that holds them.
#[derive(Debug, Clone, PartialEq)]
struct Cluster {
    centre: Vector,
    radius: f64,
    from: usize,
    to: usize,
    /// Its two halves.
    halves: Option<[usize; 2]>,
}

impl Cloud {
    pub(super) fn new(points: impl IntoIterator<Item = Vector>) -> Self {
        let mut points: Vec<Vector> = points.into_iter().collect();
        let mut clusters = Vec::new();
        split(&mut points, 0, &mut clusters);
        Self { points, clusters }
    }

    pub(super) fn points(&self) -> &[Vector] {
        &self.points
    }

    /// The point farthest along a direction; the origin without a point.
    pub(super) fn outermost(&self, direction: Vector) -> Vector {
        let mut best = (f64::NEG_INFINITY, Vector::ZERO);
        self.look(0, (direction, direction.length()), &mut best);
        best.1
    }

    fn look(&self, at: usize, along: (Vector, f64), best: &mut (f64, Vector)) {
        let cluster = &self.clusters[at];
        let Some(halves) = cluster.halves else {
            let found = outermost(&self.points[cluster.from..cluster.to], along.0);
            if found.0 > best.0 {
                *best = found;
            }
            return;
        };
        let bound = |at: usize| {
            let own = &self.clusters[at];
            own.centre.dot(along.0) + own.radius * along.1
        };
        let mut halves = halves.map(|half| (bound(half), half));
        if halves[1].0 > halves[0].0 {
            halves.swap(0, 1);
        }
        for (bound, half) in halves {
            if bound > best.0 {
                self.look(half, along, best);
            }
        }
    }
}

/// The point farthest along a direction with how far it is; the first one of several.
pub(super) fn outermost(points: &[Vector], direction: Vector) -> (f64, Vector) {
    let mut best = (f64::NEG_INFINITY, Vector::ZERO);
    for point in points {
        let along = point.dot(direction);
        if along > best.0 {
            best = (along, *point);
        }
    }
    best
}

/// Halves points along their longest side until few are together; the place of their cluster.
fn split(points: &mut [Vector], from: usize, clusters: &mut Vec<Cluster>) -> usize {
    let (low, high) = ends(points);
    let centre = 0.5 * (low + high);
    let away = points.iter().map(|point| (*point - centre).length());
    let at = clusters.len();
    clusters.push(Cluster {
        centre,
        radius: away.fold(0.0, f64::max),
        from,
        to: from + points.len(),
        halves: None,
    });
    if points.len() > TOGETHER {
        let size = high - low;
        let along = |point: &Vector| match size.x >= size.y && size.x >= size.z {
            true => point.x,
            false if size.y >= size.z => point.y,
            false => point.z,
        };
        points.sort_by(|a, b| along(a).total_cmp(&along(b)));
        let (one, other) = points.split_at_mut(points.len() / 2);
        let middle = from + one.len();
        let one = split(one, from, clusters);
        clusters[at].halves = Some([one, split(other, middle, clusters)]);
    }
    at
}

/// Corners of the box about points.
pub(super) fn ends(points: &[Vector]) -> (Vector, Vector) {
    let none = (
        Vector::splat(f64::INFINITY),
        Vector::splat(f64::NEG_INFINITY),
    );
    points.iter().fold(none, |(low, high), point| {
        (low.min(*point), high.max(*point))
    })
}

#[cfg(test)]
mod tests {
    use super::super::solid::directions;
    use super::*;

    /// Along 500 directions of any length it is the outermost of all points, whatever their number.
    #[test]
    fn the_outermost_of_clusters_is_that_of_all_points() {
        for count in [1, 2, 16, 17, 100, 777] {
            let points: Vec<Vector> = directions(count)
                .enumerate()
                .map(|(k, d)| {
                    Vector::new(0.3 * d.x + 0.1, d.y, 2.0 * d.z) * (1.0 + 0.1 * (k % 7) as f64)
                })
                .collect();
            let cloud = Cloud::new(points.iter().copied());
            assert_eq!(cloud.points().len(), count);
            for (k, d) in directions(500).enumerate() {
                let d = d * 0.01 * (k + 1) as f64;
                let wanted = outermost(&points, d).0;
                let found = cloud.outermost(d).dot(d);
                assert!(
                    (found - wanted).abs() <= 1e-14 * wanted.abs(),
                    "{count} {found} {wanted}"
                );
            }
        }
    }
}
