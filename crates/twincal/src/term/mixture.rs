//! Parameters that are linear in the coefficients of a component.

use super::body::Ten;
use super::parameter::Parameter;

/// Share of a parameter's prior variance in hidden directions from which on no motion shows it.
const SHOWN: f64 = 1e-6;

/// Parameters that are linear in a component's coefficients.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mixture {
    /// Names and units.
    pub(super) parameters: Vec<Parameter>,
    /// Per parameter, its change by each coefficient.
    pub(super) weights: Vec<Vec<f64>>,
    /// Prior sd of each coefficient.
    sds: Vec<f64>,
    /// Per parameter, its prior variance in directions that no column has.
    lost: Vec<f64>,
}

impl Mixture {
    /// `rows`: each parameter's change by the body's ten. `columns`: the change of the ten by each coefficient, and the coefficient's prior
    /// sd; `hidden`: directions that no column has.
    pub(super) fn new(
        parameters: Vec<Parameter>,
        rows: &[Ten],
        columns: &[(Ten, f64)],
        hidden: &[Ten],
    ) -> Self {
        let lost = |row: &Ten| hidden.iter().map(|own| product(row, own).powi(2)).sum();
        Self {
            weights: (rows.iter())
                .map(|row| columns.iter().map(|(own, _)| product(row, own)).collect())
                .collect(),
            sds: columns.iter().map(|(_, sd)| *sd).collect(),
            lost: rows.iter().map(lost).collect(),
            parameters,
        }
    }

    /// Prior sd of a parameter where the `live` columns show it; `None` where it also depends on what nothing shows.
    pub(super) fn prior_sd(&self, parameter: usize, live: &[bool]) -> Option<f64> {
        let (mut shown, mut lost) = (0.0, self.lost[parameter]);
        for (k, weight) in self.weights[parameter].iter().enumerate() {
            let own = (weight * self.sds[k]).powi(2);
            *(if live[k] { &mut shown } else { &mut lost }) += own;
        }
        (lost <= SHOWN * (shown + lost)).then_some(shown.sqrt())
    }

    /// Values at coefficients `beta`.
    pub(super) fn values(&self, beta: &[f64]) -> Vec<f64> {
        self.weights.iter().map(|row| product(row, beta)).collect()
    }
}

/// Scalar product, in the order of the entries.
pub(super) fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
