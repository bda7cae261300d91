//! What one model says of coefficients and noise, as a chain records it.

use crate::infer::reduced::{Reduced, Response};
use crate::infer::tableau::Tableau;

/// Natural units, by position of all columns.
#[derive(Debug, Clone, Default)]
pub(super) struct State {
    /// `E[δ | z]`.
    pub(super) delta: Vec<f64>,
    /// `Var(δ | z)/φ`; 0 outside the model.
    pub(super) variance: Vec<f64>,
    /// 1 + c.
    pub(super) misfit: f64,
}

impl State {
    /// Of the model in the tableau. `response` is room to work in.
    pub(super) fn read(
        &mut self,
        reduced: &Reduced<'_>,
        tableau: &Tableau<'_>,
        response: &mut Response,
    ) {
        let (size, standard) = (reduced.full.size(), &reduced.open);
        self.delta.resize(size, 0.0);
        self.variance.resize(size, 0.0);
        self.misfit = 1.0 + tableau.excess;
        let delta = |k: usize| {
            let inside = if tableau.includes(k) {
                tableau.gradient[k]
            } else {
                0.0
            };
            inside - standard.center[k]
        };
        for (k, (d, stretch)) in reduced.left().enumerate() {
            self.delta[d] = delta(k) / stretch;
            self.variance[d] = if tableau.includes(k) {
                tableau.diagonal[k] / (stretch * stretch)
            } else {
                0.0
            };
        }
        if reduced.shrinks() {
            let delta: Vec<f64> = (0..standard.size()).map(delta).collect();
            let row = |k: usize| tableau.row(k);
            reduced.respond(&delta, &tableau.members, row, response);
            let moments = response.delta.iter().zip(&response.variance);
            for (&d, (&delta, &variance)) in reduced.gone().iter().zip(moments) {
                (self.delta[d], self.variance[d]) = (delta, variance);
            }
        }
    }
}
