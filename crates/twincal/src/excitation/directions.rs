//! Subspaces of coefficient space: what the robot shows, what the logs show of it, and by which joint the rest appears.

use super::{ROBOT_SHOWS, SHOWN, UNSEEN};
use crate::linear_algebra::{dot, product, product_transposed, symmetric_eigen};
use rayon::prelude::*;

/// Squares below which a direction is in the span of others, to rounding.
const ROUNDING: f64 = 1e-6;
/// Share of a hidden direction's square that must be left beside those of single components.
const PART: f64 = 0.01;

/// The power S that the robot can show, whitened, and what the logs show in these coordinates.
///
/// ```text
/// S = U diag(s) Uᵀ     y = diag(s)^½ Uᵀ c, so that |y|² = cᵀSc     cᵀTc = yᵀ A y
/// ```
pub(super) struct Spectrum {
    size: usize,
    /// Rows √s_i uᵢᵀ: coefficients to y.
    to: Vec<Vec<f64>>,
    /// Rows uᵢᵀ/√s_i: y to coefficients of least norm.
    from: Vec<Vec<f64>>,
    /// S.
    power: Vec<f64>,
    /// Eigenvectors of A with an eigenvalue below the limit.
    hidden: Vec<Vec<f64>>,
}

/// Orthonormal vectors in the coordinates y.
pub(super) struct Directions {
    size: usize,
    vectors: Vec<Vec<f64>>,
}

impl Spectrum {
    /// Of `robot` (S) and `logs` (T), symmetric of order `size`, columns scaled to S_kk = 1.
    pub(super) fn new(robot: &[f64], logs: &[f64], size: usize) -> Self {
        let (values, vectors) = symmetric_eigen(robot, size).unwrap_or_default();
        let limit = ROBOT_SHOWS * ROBOT_SHOWS;
        let (mut to, mut from) = (Vec::new(), Vec::new());
        for (value, vector) in values.iter().zip(vectors.chunks_exact(size.max(1))) {
            if *value > limit {
                let root = value.sqrt();
                to.push(vector.iter().map(|u| root * u).collect());
                from.push(vector.iter().map(|u| u / root).collect());
            }
        }
        let mut spectrum = Self {
            size,
            to,
            from,
            power: robot.to_vec(),
            hidden: Vec::new(),
        };
        let seen = spectrum.whitened(logs);
        spectrum.hidden = below(&seen, spectrum.rank(), UNSEEN);
        spectrum
    }

    /// Order of S.
    pub(super) fn size(&self) -> usize {
        self.size
    }

    /// Independent directions that the robot can show.
    pub(super) fn rank(&self) -> usize {
        self.to.len()
    }

    /// Another power in the coordinates y.
    pub(super) fn whitened(&self, power: &[f64]) -> Vec<f64> {
        let (rank, size) = (self.rank(), self.size);
        let from: Vec<f64> = self.from.iter().flatten().copied().collect();
        let half = product(&from, power, [rank, size, size]);
        product_transposed(&half, &from, [rank, size, rank])
    }

    /// What the logs do not show.
    pub(super) fn all_hidden(&self) -> Directions {
        Directions {
            size: self.rank(),
            vectors: self.hidden.clone(),
        }
    }

    /// What the logs do not show of this spectrum over some `columns` of a `whole`, in the coordinates of that.
    pub(super) fn hidden(&self, columns: &[usize], whole: &Self) -> Directions {
        let embedded = self.hidden.iter().map(|y| {
            let mut c = vec![0.0; whole.size];
            for (from, y) in self.from.iter().zip(y) {
                for (&column, from) in columns.iter().zip(from) {
                    c[column] += y * from;
                }
            }
            whole.to.iter().map(|row| dot(row, &c)).collect()
        });
        Directions {
            size: whole.rank(),
            vectors: orthonormal(embedded.collect(), &[], ROUNDING),
        }
    }

    /// Power of some columns' torque in all of these directions together.
    pub(super) fn torque(&self, directions: &Directions, columns: &[usize]) -> f64 {
        let mut sum = 0.0;
        for y in &directions.vectors {
            let mut c = vec![0.0; self.size];
            for (from, y) in self.from.iter().zip(y) {
                for &column in columns {
                    c[column] += y * from[column];
                }
            }
            for &i in columns {
                let row = &self.power[i * self.size..(i + 1) * self.size];
                let along: f64 = columns.iter().map(|&j| row[j] * c[j]).sum();
                sum += c[i] * along;
            }
        }
        sum
    }
}

impl Directions {
    /// None, in `size` dimensions.
    pub(super) fn empty(size: usize) -> Self {
        Self {
            size,
            vectors: Vec::new(),
        }
    }

    pub(super) fn count(&self) -> usize {
        self.vectors.len()
    }

    /// Takes others in.
    pub(super) fn join(&mut self, other: &Self) {
        let more = orthonormal(other.vectors.clone(), &self.vectors, ROUNDING);
        self.vectors.extend(more);
    }

    /// What is left of these beside others.
    pub(super) fn without(&self, other: &Self) -> Self {
        Self {
            size: self.size,
            vectors: orthonormal(self.vectors.clone(), &other.vectors, PART),
        }
    }

    /// Which joint would show how much of these: the joint that shows most directions (of two, the one that shows them
    /// more strongly), then the joint that shows most of the rest; `None` for what no single joint shows. `shown` are [`shown`] of these
    /// directions; `allowed` are the joints to choose from.
    pub(super) fn by_joint(
        &self,
        shown: &[Vec<f64>],
        allowed: &[usize],
    ) -> Vec<(Option<usize>, Self)> {
        let mut found = Vec::new();
        let all = self.count();
        // What is left, as combinations of these directions, row by row.
        let mut rest: Vec<f64> = (0..all * all)
            .map(|i| f64::from(u8::from(i % (all + 1) == 0)))
            .collect();
        while !rest.is_empty() {
            let left = rest.len() / all;
            let mut best: Option<(usize, f64, usize, Vec<f64>)> = None;
            for &joint in allowed {
                let half = product(&rest, &shown[joint], [left, all, all]);
                let inner = product_transposed(&half, &rest, [left, all, left]);
                let trace: f64 = (0..left).map(|i| inner[i * left + i]).sum();
                // No more eigenvalues are above the limit than go into their sum.
                let most = best.as_ref().map_or(0, |best| best.0);
                if trace < SHOWN * most.max(1) as f64 {
                    continue;
                }
                let shown = above(&inner, left, SHOWN).len();
                let better = best.as_ref().is_none_or(|(most, strength, ..)| {
                    shown > *most || shown == *most && trace > *strength
                });
                if shown > 0 && better {
                    best = Some((shown, trace, joint, inner));
                }
            }
            let Some((_, _, joint, inner)) = best else {
                found.push((None, self.combined(&rest)));
                break;
            };
            let turned = |weights: Vec<Vec<f64>>| -> Vec<f64> {
                product(&weights.concat(), &rest, [weights.len(), left, all])
            };
            let shows = turned(above(&inner, left, SHOWN));
            found.push((Some(joint), self.combined(&shows)));
            rest = turned(below(&inner, left, SHOWN));
        }
        found
    }

    /// Combinations of these directions, row by row.
    fn combined(&self, weights: &[f64]) -> Self {
        let all = self.count();
        let flat = self.vectors.concat();
        let vectors = product(weights, &flat, [weights.len() / all.max(1), all, self.size]);
        self.like(
            vectors
                .chunks_exact(self.size.max(1))
                .map(<[f64]>::to_vec)
                .collect(),
        )
    }

    fn like(&self, vectors: Vec<Vec<f64>>) -> Self {
        Self {
            size: self.size,
            vectors,
        }
    }
}

/// Rows and columns of a symmetric matrix.
pub(super) fn block(matrix: &[f64], columns: &[usize]) -> Vec<f64> {
    let size = matrix.len().isqrt();
    let row = |&i: &usize| columns.iter().map(move |&j| matrix[i * size + j]);
    columns.iter().flat_map(row).collect()
}

/// VᵀAV of several sets of directions V: by set and joint, whose A is the power at the logs' states with that joint moving.
pub(super) fn shown(sets: &[&Directions], with_joint: &[Vec<f64>]) -> Vec<Vec<Vec<f64>>> {
    let size = sets.first().map_or(0, |set| set.size);
    let vectors = sets.iter().flat_map(|set| set.vectors.iter().flatten());
    let all: Vec<f64> = vectors.copied().collect();
    let count: usize = sets.iter().map(|set| set.count()).sum();
    let of_joint = |power: &Vec<f64>| -> Vec<Vec<f64>> {
        // A is symmetric: rows of VᵀA.
        let images = product(&all, power, [count, size, size]);
        let mut from = 0;
        let own = sets.iter().map(|set| {
            let rows = from * size..(from + set.count()) * size;
            from += set.count();
            let dimensions = [set.count(), size, set.count()];
            product_transposed(&images[rows.clone()], &all[rows], dimensions)
        });
        own.collect()
    };
    let of_joints: Vec<Vec<Vec<f64>>> = with_joint.par_iter().map(of_joint).collect();
    let set = |set: usize| of_joints.iter().map(|joint| joint[set].clone()).collect();
    (0..sets.len()).map(set).collect()
}

/// Eigenvectors with eigenvalues below a limit.
fn below(matrix: &[f64], size: usize, limit: f64) -> Vec<Vec<f64>> {
    eigenvectors(matrix, size, &|value| value <= limit)
}

/// Eigenvectors with eigenvalues above a limit.
fn above(matrix: &[f64], size: usize, limit: f64) -> Vec<Vec<f64>> {
    eigenvectors(matrix, size, &|value| value > limit)
}

fn eigenvectors(matrix: &[f64], size: usize, wanted: &dyn Fn(f64) -> bool) -> Vec<Vec<f64>> {
    let (values, vectors) = symmetric_eigen(matrix, size).unwrap_or_default();
    let pairs = values.iter().zip(vectors.chunks_exact(size.max(1)));
    let wanted = pairs.filter(|(value, _)| wanted(**value));
    wanted.map(|(_, vector)| vector.to_vec()).collect()
}

/// Orthonormal directions of what the vectors span beside `known` (orthonormal); directions with a smaller share of their
/// squares than `least` are left out.
fn orthonormal(vectors: Vec<Vec<f64>>, known: &[Vec<f64>], least: f64) -> Vec<Vec<f64>> {
    let mut rest: Vec<Vec<f64>> = vectors;
    for vector in &mut rest {
        subtract(vector, known);
    }
    // By the Gram matrix of what is left, so that the order of the vectors does not matter.
    let size = rest.len();
    let gram: Vec<f64> = (rest.iter())
        .flat_map(|a| rest.iter().map(|b| dot(a, b)))
        .collect();
    let (values, weights) = symmetric_eigen(&gram, size).unwrap_or_default();
    let mut out = Vec::new();
    for (value, weights) in values.iter().zip(weights.chunks_exact(size.max(1))) {
        if *value > least {
            let mut sum = vec![0.0; rest[0].len()];
            for (weight, vector) in weights.iter().zip(&rest) {
                let weight = weight / value.sqrt();
                sum.iter_mut()
                    .zip(vector)
                    .for_each(|(s, v)| *s += weight * v);
            }
            out.push(sum);
        }
    }
    out
}

fn subtract(vector: &mut [f64], known: &[Vec<f64>]) {
    for _ in 0..2 {
        for direction in known {
            let along = dot(direction, vector);
            for (v, d) in vector.iter_mut().zip(direction) {
                *v -= along * d;
            }
        }
    }
}
