//! What a fit takes of its rows: sums that add, joint by joint. Up to here cost grows with the logs, and not beyond.

mod decoys;
mod spectrum;
mod weighing;

pub(crate) use decoys::{DECOYS, JointDecoys};
pub(crate) use spectrum::Spectrum;
pub(crate) use weighing::Weighing;

use crate::gram::{Gram, JointGram, Symmetric};
use crate::observations::Part;
use rayon::prelude::*;
use std::ops::AddAssign;

/// Units that one or two logs are cut into, together; of three logs or more each is one.
const PARTS: usize = 5;
/// Units at most; more logs are grouped.
const MOST_UNITS: usize = 6;

/// The rows of a fit as a few sums, each of which can be left out.
#[derive(Debug, Clone, Default)]
pub struct Training {
    /// Contiguous parts of one or two logs, whole logs or groups of them.
    pub(crate) units: Vec<Unit>,
    /// Of each joint over all units; empty where nothing is to be left out.
    pub(crate) spectra: Vec<Spectrum>,
    /// Largest cut-off of the filters that made the rows, cycles per row; 0 without a filter.
    pub(crate) cutoff: f64,
}

/// Sums over some rows.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Unit {
    /// Columns and torque.
    pub(crate) gram: Gram,
    /// What else is asked of each joint.
    pub(crate) joints: Vec<JointUnit>,
}

/// Sums over some rows of one joint, beside its [`JointGram`].
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct JointUnit {
    pub(crate) decoys: JointDecoys,
    /// Squares of the measured torque at all rows, (N·m)².
    pub(crate) torque: f64,
    pub(crate) weighing: Weighing,
}

impl Training {
    /// Units that can be left out, see [`units`].
    pub fn new(parts: &[Part<'_>]) -> Self {
        Self {
            spectra: spectra(parts),
            ..Self::of(&units(parts), parts)
        }
    }

    /// Every log a unit, with its runs of rows as they are: nothing is to be left out.
    pub fn whole(parts: &[Part<'_>]) -> Self {
        let units: Vec<Vec<Part<'_>>> = parts.iter().map(|part| vec![part.clone()]).collect();
        Self::of(&units, parts)
    }

    fn of(units: &[Vec<Part<'_>>], parts: &[Part<'_>]) -> Self {
        let cutoffs = parts.iter().map(|part| part.observations.cutoff);
        Self {
            units: units.par_iter().map(|parts| Unit::of(parts)).collect(),
            spectra: Vec::new(),
            cutoff: cutoffs.fold(0.0, f64::max),
        }
    }

    /// Number of moving joints; 0 without rows.
    pub fn joints(&self) -> usize {
        self.units.first().map_or(0, |unit| unit.joints.len())
    }

    /// Sum of all units.
    pub(crate) fn total(&self) -> Unit {
        let mut total = Unit::default();
        self.units.iter().for_each(|unit| total += unit);
        total
    }

    /// Columns and torque of all units but one.
    pub(crate) fn without(&self, left_out: usize) -> Gram {
        let mut kept = Gram::default();
        let others = self.units.iter().enumerate();
        others
            .filter(|(unit, _)| *unit != left_out)
            .for_each(|(_, unit)| kept += &unit.gram);
        kept
    }
}

fn spectra(parts: &[Part<'_>]) -> Vec<Spectrum> {
    let joints = parts
        .first()
        .map_or(0, |part| part.observations.joints.len());
    let of_joint = |joint: usize| {
        let mut sum = Spectrum::default();
        parts.iter().for_each(|part| sum.add(part, joint));
        sum
    };
    (0..joints).into_par_iter().map(of_joint).collect()
}

impl Unit {
    fn of(parts: &[Part<'_>]) -> Self {
        let joints = parts
            .first()
            .map_or(0, |part| part.observations.joints.len());
        let of_joint = |joint: usize| {
            let mut sum = JointUnit::default();
            parts.iter().for_each(|part| sum.add(part, joint));
            sum
        };
        Self {
            gram: parts.iter().collect(),
            joints: (0..joints).into_par_iter().map(of_joint).collect(),
        }
    }
}

impl AddAssign<&Unit> for Unit {
    /// # Panics
    /// If the two belong to different robots or libraries (an empty default adopts the other's).
    fn add_assign(&mut self, other: &Unit) {
        self.gram += &other.gram;
        if self.joints.is_empty() {
            self.joints.clone_from(&other.joints);
            return;
        }
        for (sum, own) in self.joints.iter_mut().zip(&other.joints) {
            sum.decoys += &own.decoys;
            sum.torque += own.torque;
            sum.weighing += &own.weighing;
        }
    }
}

impl JointUnit {
    fn add(&mut self, part: &Part<'_>, joint: usize) {
        let rows = &part.observations.joints[joint];
        let measured = rows.measured.some(part.rows.clone());
        self.decoys += &JointDecoys::of(part, joint);
        self.torque += measured.iter().map(|tau| tau * tau).sum::<f64>();
        if rows.weight.is_empty() {
            return;
        }
        for row in part.rows.clone().filter(|&row| !rows.standstill[row]) {
            let spread = rows.spread.get(row).copied().unwrap_or(1.0);
            self.weighing.add(rows.weight[row] * spread);
        }
    }
}

/// Coefficients of the columns of a joint.
pub(crate) fn of_joint(joint: &JointGram, beta: &[f64]) -> Vec<f64> {
    let columns = joint.columns.iter();
    columns.map(|&column| beta[column as usize]).collect()
}

/// `[−β, 1]ᵀ S [−β, 1]`: of Σ x xᵀ the squares of y − Xβ; `beta` belongs to the columns of the joint.
pub(crate) fn residual_form(sums: &Symmetric, beta: &[f64]) -> f64 {
    let last = beta.len();
    let with = |i: usize| -> f64 {
        let products = beta.iter().enumerate();
        products.map(|(k, b)| sums.at(i, k) * b).sum()
    };
    let terms = beta.iter().enumerate();
    let explained: f64 = terms
        .map(|(i, b)| b * (2.0 * sums.at(i, last) - with(i)))
        .sum();
    sums.at(last, last) - explained
}

/// Rows that are left out together: three logs or more one by one (more than six in six groups), otherwise equal parts of each log.
pub(crate) fn units<'a>(parts: &[Part<'a>]) -> Vec<Vec<Part<'a>>> {
    let each = if parts.len() < 3 {
        PARTS.div_ceil(parts.len().max(1))
    } else {
        1
    };
    let cut = |part: &Part<'a>, i: usize| part.rows.start + i * part.rows.len() / each;
    let piece = |part: &Part<'a>, i: usize| Part {
        observations: part.observations,
        rows: cut(part, i)..cut(part, i + 1),
    };
    let pieces: Vec<Part<'a>> = parts
        .iter()
        .flat_map(|part| (0..each).map(move |i| piece(part, i)))
        .collect();
    let count = pieces.len().min(MOST_UNITS);
    (0..count)
        .map(|unit| pieces.iter().skip(unit).step_by(count).cloned().collect())
        .collect()
}
