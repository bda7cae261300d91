//! A motion that a search found, with what it shows.

use super::spline::Spline;

/// A motion, the sums over its rows, and the objective's value of them.
#[derive(Debug, Clone)]
pub(super) struct Found {
    pub(super) splines: Vec<Spline>,
    pub(super) sums: Vec<f64>,
    pub(super) value: f64,
}
