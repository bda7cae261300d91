//! From the posterior's models to the t components that one joint can tell apart.

use crate::linear_algebra::{Cholesky, dot};
use crate::posterior::{Model, Posterior};
use std::collections::BTreeMap;

/// Models that hold less than this together are left out of intervals: an error of at most 1e-9 in probability.
const IGNORED_MASS: f64 = 1e-9;
/// Two models are one for a joint when their coefficients differ by less than this, in posterior sd.
const SAME_GEOMETRY: f64 = 1e-7;
/// … and their noise scales by less than this, relative: an error of about 1e-9 in probability.
const SAME_SCALE: f64 = 2e-4;

/// What a set of models says about the torque of one joint: location `xᵀμ`, epistemic factor `q = xᵀ A_z⁻¹ x = |R x|²`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Geometry {
    /// Places in the joint's own list of columns.
    pub(super) places: Vec<u32>,
    /// μ at those places.
    pub(super) mean: Vec<f64>,
    /// μ and upper triangular R by columns: of [`ROWS`] rows at a time, first of all with μ before them, those from its first
    /// row on. What is below the diagonal is 0.
    pub(super) root: Vec<[f64; ROWS]>,
    /// A⁻¹ at those places, to compare models.
    covariance: Vec<f64>,
}

/// One t distribution of the mixture.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Component {
    /// Which geometry gives location and q.
    pub(super) geometry: usize,
    /// Probability.
    pub(super) weight: f64,
    /// b_n/a_n, (N·m)².
    pub(super) rate: f64,
}

/// The mixture of one joint, heaviest component first.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Components {
    pub(super) geometries: Vec<Geometry>,
    pub(super) components: Vec<Component>,
}

impl Components {
    /// Components for a joint with structural `columns` (ascending).
    pub(super) fn of_joint(posterior: &Posterior, columns: &[usize]) -> Self {
        let mut heaviest: Vec<&Model> = posterior
            .models
            .iter()
            .filter(|model| model.weight > 0.0)
            .collect();
        heaviest.sort_by(|a, b| {
            b.weight
                .total_cmp(&a.weight)
                .then_with(|| a.members.cmp(&b.members))
        });
        let total: f64 = heaviest.iter().map(|model| model.weight).sum();
        let mut kept = 0.0;
        let needed = heaviest.iter().take_while(|model| {
            let go_on = kept < (1.0 - IGNORED_MASS) * total;
            kept += model.weight;
            go_on
        });
        let needed = needed.count();

        let mut joint = Self::default();
        let mut by_places: BTreeMap<Vec<u32>, Vec<usize>> = BTreeMap::new();
        for model in &heaviest[..needed] {
            let rate = model.scale / posterior.shape;
            let geometry = Geometry::of_model(model, columns);
            let alike = by_places.entry(geometry.places.clone()).or_default();
            let known = alike
                .iter()
                .copied()
                .find(|&known| joint.geometries[known].is_close(&geometry, rate));
            let index = known.unwrap_or_else(|| {
                alike.push(joint.geometries.len());
                joint.geometries.push(geometry);
                joint.geometries.len() - 1
            });
            joint.add(index, model.weight, rate);
        }
        let mass: f64 = joint
            .components
            .iter()
            .map(|component| component.weight)
            .sum();
        for component in &mut joint.components {
            component.weight /= mass;
        }
        joint
    }

    fn add(&mut self, geometry: usize, weight: f64, rate: f64) {
        let same = |c: &&mut Component| {
            c.geometry == geometry && (c.rate - rate).abs() <= SAME_SCALE * rate
        };
        if let Some(found) = self.components.iter_mut().find(same) {
            let sum = found.weight + weight;
            found.rate = (found.rate * found.weight + rate * weight) / sum;
            found.weight = sum;
        } else {
            self.components.push(Component {
                geometry,
                weight,
                rate,
            });
        }
    }
}

impl Geometry {
    fn of_model(model: &Model, columns: &[usize]) -> Self {
        let size = model.members.len();
        let (mut places, mut mean, mut inverse_columns) = (Vec::new(), Vec::new(), Vec::new());
        let factor = Cholesky::from_lower(model.factor.clone(), size);
        for (at, &member) in model.members.iter().enumerate() {
            if let Ok(place) = columns.binary_search(&(member as usize)) {
                places.push(place as u32);
                mean.push(model.mean[at]);
                // Column `at` of L⁻¹: its inner products are A⁻¹ = L⁻ᵀ L⁻¹.
                let mut unit = vec![0.0; size];
                unit[at] = 1.0;
                factor.solve_lower(&mut unit);
                inverse_columns.push(unit);
            }
        }
        let covariance = inverse_columns
            .iter()
            .flat_map(|a| inverse_columns.iter().map(|b| dot(a, b)))
            .collect();
        Self {
            root: by_columns(&mean, &triangular(&mut inverse_columns)),
            places,
            mean,
            covariance,
        }
    }

    fn is_close(&self, other: &Self, rate: f64) -> bool {
        let size = self.places.len();
        let sd = |i: usize| self.covariance[i * size + i].sqrt();
        (0..size).all(|i| {
            let near = (self.mean[i] - other.mean[i]).abs() <= SAME_GEOMETRY * rate.sqrt() * sd(i);
            near && (0..size).all(|j| {
                let difference = self.covariance[i * size + j] - other.covariance[i * size + j];
                difference.abs() <= SAME_GEOMETRY * sd(i) * sd(j)
            })
        })
    }
}

/// Rows of μ and R that are multiplied side by side: their sums fit into registers and do not wait for each other.
pub(super) const ROWS: usize = 8;

/// μ and R (packed by rows) as [`Geometry::root`] holds them.
fn by_columns(mean: &[f64], packed: &[f64]) -> Vec<[f64; ROWS]> {
    let size = mean.len();
    // Row 0 is μ, row i + 1 is row i of R.
    let entry = |row: usize, column: usize| match row.checked_sub(1) {
        None => mean[column],
        Some(i) if i <= column => packed[i * size - i * i.saturating_sub(1) / 2 - i + column],
        Some(_) => 0.0,
    };
    let mut root = Vec::new();
    for first in (0..=size).step_by(ROWS) {
        for column in first.saturating_sub(1)..size {
            root.push(std::array::from_fn(|k| {
                let row = first + k;
                if row <= size { entry(row, column) } else { 0.0 }
            }));
        }
    }
    root
}

/// R of W = Q R, packed by rows, so that |W x| = |R x| (modified Gram–Schmidt: R is backward stable, Björck 1967).
fn triangular(columns: &mut [Vec<f64>]) -> Vec<f64> {
    let size = columns.len();
    let mut root = Vec::with_capacity(size * (size + 1) / 2);
    for i in 0..size {
        let (done, rest) = columns.split_at_mut(i + 1);
        let pivot = &mut done[i];
        let length = dot(pivot, pivot).sqrt();
        root.push(length);
        for value in pivot.iter_mut() {
            *value /= if length > 0.0 { length } else { 1.0 };
        }
        for column in rest {
            let along = dot(pivot, column);
            root.push(along);
            for (value, direction) in column.iter_mut().zip(&*pivot) {
                *value -= along * direction;
            }
        }
    }
    root
}
