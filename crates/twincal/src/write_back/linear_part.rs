//! The part of friction that no file holds which the friction of a file can stand for.
//!
//! Quadratic friction takes from viscous friction what grows with the speed. Viscous friction alone in a file would brake too much: what
//! goes there is the viscous and dry friction with the torque nearest to all friction of the joint over states within the training range,
//!
//! ```text
//! min over f of Σ_states (β_quadratic x_quadratic + Σ_k (β_k − f_k) x_k)²,      f_k ≥ least_k
//! ```
//! k over viscous and dry friction, `least_k` where the total in the file is 0, the model's own damping included: simulators take no
//! negative friction. f_k goes into the file in the place of β_k, and β_k − f_k stays beside it with the quadratic friction, so that file
//! and residual together are the twin all the same.

use super::{Place, Writer};
use crate::linear_algebra::Cholesky;
use crate::term::Family;

/// What a file holds of some columns because of one that it cannot hold.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Share {
    /// The column that no file holds.
    pub(super) of: usize,
    /// `(column in the file, its coefficient there)`.
    pub(super) into: Vec<(usize, f64)>,
}

impl Writer<'_> {
    /// Shares of quadratic friction of `chosen` components in the viscous and dry friction of the same joint that is `held`; `beta`: all
    /// coefficients.
    pub(super) fn shares(
        &self,
        chosen: &[bool],
        held: &[Option<Place>],
        beta: &[f64],
    ) -> Vec<Share> {
        let terms = self.library.columns().iter().enumerate();
        let quadratic = terms.filter(|(column, term)| {
            let family = self.library.terms()[**term].family;
            family == Family::QuadraticFriction && chosen[self.component(*column)]
        });
        quadratic
            .filter_map(|(column, _)| self.share(column, held, beta))
            .collect()
    }

    fn share(&self, of: usize, held: &[Option<Place>], beta: &[f64]) -> Option<Share> {
        let robot = &self.calibration.twin.robot;
        let (joint, quadratic) =
            (0..robot.dof()).find_map(|joint| Some((joint, self.states.column(joint, of)?)))?;
        let least = |place: &Place| match place {
            Place::Viscous(own) if *own == joint => Some(-robot.joint(joint).damping),
            Place::Coulomb(own) if *own == joint => Some(0.0),
            _ => None,
        };
        let into: Vec<(usize, f64, &[f64])> = (held.iter().enumerate())
            .filter_map(|(column, place)| {
                let least = least(place.as_ref()?)?;
                Some((column, least, self.states.column(joint, column)?))
            })
            .collect();
        let mut wanted: Vec<f64> = quadratic.iter().map(|x| beta[of] * x).collect();
        for (column, _, x) in &into {
            let whole = wanted.iter_mut().zip(*x);
            whole.for_each(|(wanted, x)| *wanted += beta[*column] * x);
        }
        let x: Vec<&[f64]> = into.iter().map(|(_, _, x)| *x).collect();
        let least: Vec<f64> = into.iter().map(|(_, least, _)| *least).collect();
        let nearest = nearest(&x, &wanted, &least)?;
        let columns = into.iter().map(|(column, _, _)| *column);
        Some(Share {
            of,
            into: columns.zip(nearest).collect(),
        })
    }
}

/// f with the least |wanted − Σ f_k x_k|² and f_k ≥ least_k, `least` itself to the bit where a bound acts; `None` without a column or where
/// columns depend on each other.
///
/// Each subset of columns is fitted with the others at their bounds: of a convex problem the best fit within all bounds is the answer. The
/// subsets of two columns are four.
fn nearest(x: &[&[f64]], wanted: &[f64], least: &[f64]) -> Option<Vec<f64>> {
    if x.is_empty() {
        return None;
    }
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut best: Option<(f64, Vec<f64>)> = None;
    for subset in 0..1_usize << x.len() {
        let (free, bound): (Vec<usize>, Vec<usize>) =
            (0..x.len()).partition(|k| subset >> k & 1 == 1);
        let mut rest = wanted.to_vec();
        let take = |rest: &mut [f64], k: usize, f: f64| {
            rest.iter_mut()
                .zip(x[k])
                .for_each(|(rest, x)| *rest -= f * x);
        };
        bound.iter().for_each(|&k| take(&mut rest, k, least[k]));
        let normal: Vec<f64> = (free.iter())
            .flat_map(|&a| free.iter().map(move |&b| dot(x[a], x[b])))
            .collect();
        let mut fitted: Vec<f64> = free.iter().map(|&k| dot(x[k], &rest)).collect();
        Cholesky::new(&normal, free.len()).ok()?.solve(&mut fitted);
        if free.iter().zip(&fitted).any(|(&k, f)| *f < least[k]) {
            continue;
        }
        let mut all = least.to_vec();
        for (&k, &f) in free.iter().zip(&fitted) {
            take(&mut rest, k, f);
            all[k] = f;
        }
        let error = dot(&rest, &rest);
        if best.as_ref().is_none_or(|(least, _)| error < *least) {
            best = Some((error, all));
        }
    }
    best.map(|(_, all)| all)
}

/// The coefficients that go into a file.
pub(super) fn written(beta: &[f64], shares: &[Share]) -> Vec<f64> {
    let mut file = beta.to_vec();
    for (column, value) in shares.iter().flat_map(|share| &share.into) {
        file[*column] = *value;
    }
    file
}

/// What stays beside the file of some columns: their coefficients, and what the file holds too much because of them.
pub(super) fn beside(own: &[usize], beta: &[f64], shares: &[Share]) -> Vec<(usize, f64)> {
    let mut left: Vec<(usize, f64)> = own.iter().map(|&column| (column, beta[column])).collect();
    for Share { into, .. } in shares.iter().filter(|share| own.contains(&share.of)) {
        let rest = into.iter();
        left.extend(rest.map(|(column, file)| (*column, beta[*column] - file)));
    }
    left
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Friction c + b v + a v|v| at speeds up to 2.5 rad/s, by the viscous and dry friction of a file. Truth: the nearest point of a fine
    /// grid, found by looking at all of them.
    #[test]
    fn the_nearest_friction_within_the_bounds_is_that_of_a_search() {
        let speeds: Vec<f64> = (0..200)
            .map(|i| -2.5 + 0.025 * (f64::from(i) + 0.5))
            .collect();
        let dry: Vec<f64> = speeds.iter().map(|v| (v / 0.02).tanh()).collect();
        for ([c, b, a], damping, at_bounds) in [
            ([1.0, 4.0, -2.0], 0.0, [true, false]),
            ([1.0, 3.5, -2.0], 0.5, [true, false]),
            ([1.0, 4.0, -2.0], 1.5, [false, false]),
            ([0.2, 0.8, 0.5], 0.0, [false, true]),
            ([1.0, 0.8, -0.1], 0.0, [false, false]),
            ([0.1, 0.1, -2.0], 0.0, [true, true]),
        ] {
            let friction = |v: &f64| c * (v / 0.02).tanh() + b * v + a * v * v.abs();
            let wanted: Vec<f64> = speeds.iter().map(friction).collect();
            let error = |f: [f64; 2]| -> f64 {
                let all = wanted.iter().zip(&speeds).zip(&dry);
                all.map(|((w, v), s)| (w - f[0] * v - f[1] * s).powi(2))
                    .sum()
            };
            let least = [-damping, 0.0];
            let found = nearest(&[&speeds, &dry], &wanted, &least).unwrap();
            let found = [found[0], found[1]];
            for k in 0..2 {
                assert!(found[k] >= least[k], "{found:?}");
                assert_eq!(found[k] == least[k], at_bounds[k], "{found:?}");
            }
            let mut best = (f64::INFINITY, [0.0; 2]);
            for i in 0..=400 {
                for j in 0..=400 {
                    let f = [
                        least[0] + 0.01 * f64::from(i),
                        least[1] + 0.01 * f64::from(j),
                    ];
                    if error(f) < best.0 {
                        best = (error(f), f);
                    }
                }
            }
            assert!(error(found) <= best.0, "{found:?}, {best:?}");
            for k in 0..2 {
                assert!((found[k] - best.1[k]).abs() < 0.02, "{found:?}, {best:?}");
            }
        }
    }

    #[test]
    fn without_a_column_there_is_nothing_to_share() {
        assert_eq!(nearest(&[], &[1.0, 2.0], &[]), None);
        let x = [1.0, 2.0];
        assert_eq!(nearest(&[&x, &x], &[1.0, 2.0], &[0.0; 2]), None);
        let alone = nearest(&[&x], &[-1.0, 0.1], &[0.0]);
        assert_eq!(alone, Some(vec![0.0]));
    }
}
