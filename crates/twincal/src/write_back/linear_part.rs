//! The part of friction that no file holds which the friction of a file can stand for.
//!
//! Quadratic friction takes from viscous friction what grows with the speed. Viscous friction alone in a file would brake too much: what
//! goes there is the viscous and dry friction with the nearest torque over states within the training range,
//!
//! ```text
//! min over κ of Σ_states (x_quadratic − Σ_k κ_k x_k)²,      β_k → β_k + κ_k β_quadratic
//! ```
//! and −κ_k β_quadratic stays beside the file, so that file and residual together are the twin all the same.

use super::{Place, Writer};
use crate::linear_algebra::Cholesky;
use crate::term::Family;

/// How much of a column goes into others.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Share {
    /// The column that no file holds.
    pub(super) of: usize,
    /// `(column in the file, κ)`.
    pub(super) into: Vec<(usize, f64)>,
}

impl Writer<'_> {
    /// Shares of quadratic friction of `chosen` components in the viscous and dry friction of the same joint that is `held`.
    pub(super) fn shares(&self, chosen: &[bool], held: &[Option<Place>]) -> Vec<Share> {
        let terms = self.library.columns().iter().enumerate();
        let quadratic = terms.filter(|(column, term)| {
            let family = self.library.terms()[**term].family;
            family == Family::QuadraticFriction && chosen[self.component(*column)]
        });
        quadratic
            .filter_map(|(column, _)| self.share(column, held))
            .collect()
    }

    fn share(&self, of: usize, held: &[Option<Place>]) -> Option<Share> {
        let joints = 0..self.calibration.twin.robot.dof();
        let (joint, wanted) = joints
            .filter_map(|joint| Some((joint, self.states.column(joint, of)?)))
            .next()?;
        let friction = [Place::Viscous(joint), Place::Coulomb(joint)];
        let into: Vec<(usize, &[f64])> = (held.iter().enumerate())
            .filter(|(_, place)| place.as_ref().is_some_and(|place| friction.contains(place)))
            .filter_map(|(column, _)| Some((column, self.states.column(joint, column)?)))
            .collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let normal: Vec<f64> = (into.iter())
            .flat_map(|(_, a)| into.iter().map(move |(_, b)| dot(a, b)))
            .collect();
        let mut kappa: Vec<f64> = into.iter().map(|(_, x)| dot(x, wanted)).collect();
        let root = Cholesky::new(&normal, into.len()).ok()?;
        root.solve(&mut kappa);
        let columns = into.iter().map(|(column, _)| *column);
        Some(Share {
            of,
            into: columns.zip(kappa).collect(),
        })
    }
}

/// The coefficients that go into a file.
pub(super) fn written(beta: &[f64], shares: &[Share]) -> Vec<f64> {
    let mut file = beta.to_vec();
    for Share { of, into } in shares {
        into.iter()
            .for_each(|(column, kappa)| file[*column] += kappa * beta[*of]);
    }
    file
}

/// What stays beside the file of some columns: their coefficients, and minus their shares.
pub(super) fn beside(own: &[usize], beta: &[f64], shares: &[Share]) -> Vec<(usize, f64)> {
    let mut left: Vec<(usize, f64)> = own.iter().map(|&column| (column, beta[column])).collect();
    for Share { of, into } in shares.iter().filter(|share| own.contains(&share.of)) {
        left.extend(
            into.iter()
                .map(|(column, kappa)| (*column, -kappa * beta[*of])),
        );
    }
    left
}
