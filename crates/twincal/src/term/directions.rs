//! Which directions of a body's inertia torque can show, and the parameters that people know in their place.

use super::Family;
use super::body::Ten;
use super::candidate::{Candidate, Proposal};
use super::mixture::{Mixture, product};
use super::model_column::ModelColumn;
use super::parameter::Parameter;

/// A direction whose torque at random states is below this part of the largest is hidden from every motion.
const HIDDEN: f64 = 1e-9;
/// Lengths of what is left of an axis outside the hidden directions and those before it, that are tried in turn.
const LEFT: [f64; 4] = [0.5, 0.1, 1e-2, 1e-4];
/// Rounds of rotations, and the cosine at which two directions are perpendicular.
const ROUNDS: usize = 60;
const PERPENDICULAR: f64 = 1e-15;

/// Changes of a body's inertia whose coefficients are standard normal before the data.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Directions {
    /// Those that torque shows; all where it shows none.
    pub(super) shown: Vec<Ten>,
    /// The rest, which no motion tells from nothing.
    pub(super) hidden: Vec<Ten>,
}

/// The same prior by directions that torque shows and others: an orthogonal change of standard normal coefficients.
///
/// `torque`: per parameter of the body, its torque at random states. The hidden directions are the null space of the directions' torque
/// (one-sided Jacobi rotations, Hestenes 1958). Of the others, which no order is given, the first axes are kept as far as they are
/// outside: where nothing is hidden the directions stay as they are, and rounding in torque turns none of them.
pub(super) fn split(directions: &[Ten], torque: &[Vec<f64>]) -> Directions {
    let hidden = null_space(directions, torque);
    let count = directions.len();
    let all = |coefficients: &Vec<f64>| -> Ten {
        std::array::from_fn(|p| {
            let pairs = coefficients.iter().zip(directions);
            pairs.map(|(c, direction)| c * direction[p]).sum()
        })
    };
    if hidden.is_empty() || hidden.len() == count {
        return Directions {
            shown: directions.to_vec(),
            hidden: hidden.iter().map(all).collect(),
        };
    }
    let mut basis: Vec<Vec<f64>> = hidden.clone();
    for least in LEFT {
        for axis in 0..count {
            let mut rest = vec![0.0; count];
            rest[axis] = 1.0;
            for _ in 0..2 {
                for known in &basis {
                    let along = product(known, &rest);
                    let pairs = rest.iter_mut().zip(known);
                    pairs.for_each(|(rest, known)| *rest -= along * known);
                }
            }
            let length = product(&rest, &rest).sqrt();
            if length >= least && basis.len() < count {
                basis.push(rest.iter().map(|value| value / length).collect());
            }
        }
    }
    Directions {
        shown: basis[hidden.len()..].iter().map(all).collect(),
        hidden: hidden.iter().map(all).collect(),
    }
}

/// Orthonormal combinations of the directions that have no torque.
fn null_space(directions: &[Ten], torque: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let count = directions.len();
    let len = torque.first().map_or(0, Vec::len);
    let mut images: Vec<Vec<f64>> = (directions.iter())
        .map(|direction| {
            let mut image = vec![0.0; len];
            for (weight, own) in direction.iter().zip(torque) {
                let pairs = image.iter_mut().zip(own);
                pairs.for_each(|(image, own)| *image += weight * own);
            }
            image
        })
        .collect();
    let mut turned: Vec<Vec<f64>> = (0..count)
        .map(|i| (0..count).map(|j| f64::from(u8::from(i == j))).collect())
        .collect();
    for _ in 0..ROUNDS {
        let mut worst = 0.0_f64;
        for a in 0..count {
            for b in 0..a {
                let (aa, bb) = (
                    product(&images[a], &images[a]),
                    product(&images[b], &images[b]),
                );
                let ab = product(&images[a], &images[b]);
                if ab == 0.0 || ab.abs() <= PERPENDICULAR * (aa * bb).sqrt() {
                    continue;
                }
                worst = worst.max(ab.abs() / (aa * bb).sqrt());
                let theta = (bb - aa) / (2.0 * ab);
                let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
                let c = 1.0 / t.hypot(1.0);
                for table in [&mut images, &mut turned] {
                    let (left, right) = table.split_at_mut(a);
                    for (x, y) in right[0].iter_mut().zip(left[b].iter_mut()) {
                        (*x, *y) = (c * *x - c * t * *y, c * t * *x + c * *y);
                    }
                }
            }
        }
        if worst == 0.0 {
            break;
        }
    }
    let sizes: Vec<f64> = images
        .iter()
        .map(|image| product(image, image).sqrt())
        .collect();
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    let pairs = turned.into_iter().zip(sizes);
    let hidden = pairs.filter(|(_, size)| *size <= HIDDEN * largest);
    hidden.map(|(turned, _)| turned).collect()
}

/// What becomes the columns of one component, or of a part of it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Columns {
    /// Where they point.
    pub(super) directions: Directions,
    /// Prior sd of an average direction in the metric's own unit; coefficients are kept in `unit`.
    pub(super) size: f64,
    /// Prior sd in the metric.
    pub(super) share: f64,
    /// Columns are named `<component>.<letter>1`, ….
    pub(super) letter: &'static str,
    pub(super) family: Family,
    pub(super) unit: &'static str,
}

impl Columns {
    /// Per column the change of the body's parameters by its coefficient, and the coefficient's prior sd.
    pub(super) fn weights(&self) -> Vec<(Ten, f64)> {
        let one = |direction: &Ten| (direction.map(|x| x / self.size), self.share * self.size);
        self.directions.shown.iter().map(one).collect()
    }

    /// Directions that no column has, one prior sd long.
    pub(super) fn hidden(&self) -> Vec<Ten> {
        let one = |direction: &Ten| direction.map(|x| x * self.share);
        self.directions.hidden.iter().map(one).collect()
    }

    /// Candidates of a component of that name on a body, in words `story`.
    pub(super) fn candidates(&self, body: usize, (name, story): (&str, &str)) -> Vec<Candidate> {
        let one = |(k, (weights, sd)): (usize, (Ten, f64))| {
            Candidate::model(
                format!("{name}.{}{}", self.letter, k + 1),
                self.family,
                self.unit,
                story.to_owned(),
                ModelColumn::Inertia { body, weights },
            )
            .within(sd)
        };
        self.weights().into_iter().enumerate().map(one).collect()
    }

    /// A component of these columns alone; `rows`: its parameters' changes by the body's ten.
    pub(super) fn proposal(
        &self,
        body: usize,
        (name, story): (&str, &str),
        (parameters, rows): (Vec<Parameter>, Vec<Ten>),
    ) -> Proposal {
        let mut columns = self.candidates(body, (name, story));
        let mixture = Mixture::new(parameters, &rows, &self.weights(), &self.hidden());
        if let Some(first) = columns.first_mut() {
            first.mixture = Some(mixture);
        }
        Proposal {
            name: name.to_owned(),
            columns,
        }
    }
}

#[cfg(test)]
#[path = "directions_tests.rs"]
mod tests;
