//! How large an effect may be that the data hardly show: as large as what they do show of it, not as large as its slab.
//!
//! ```text
//! β_q | z, s ~ N(0, φ s² v_q)        s uniform over 1, ½, ¼ … 1/64, one for all columns of an effect
//! p(s | y, z) ∝ |V|^−½ |A|^−½ (b₀ + RSS/2)^−(a₀ + n/2),   A = G + V⁻¹
//! ```
//! A payload of which a log shows half a kilogram does not have a tensor of a hundred: a motion should decide about one that is likely.

use crate::linear_algebra::{Cholesky, dot, product_transposed};
use crate::plug_in::size::Evidence;
use crate::posterior::draws::draw;
use crate::posterior::{Model, Posterior, Problem};
use crate::random::Random;

/// Factors on the slab's sd.
const SCALES: usize = 7;
/// Weight of a scale below which it is left out of a mean.
const NEGLIGIBLE: f64 = 1e-3;

/// s of a place in the list.
fn scale(at: usize) -> f64 {
    0.5_f64.powi(at as i32)
}

/// p(s | y, z) of columns that share s.
pub(super) fn weights(problem: &Problem, members: &[u32], columns: &[u32]) -> [f64; SCALES] {
    let logs: [f64; SCALES] = std::array::from_fn(|at| {
        let own = Evidence::new(problem, members, (columns, scale(at)));
        own.map_or(f64::NEG_INFINITY, |own| own.log())
    });
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY {
        return std::array::from_fn(|at| if at == 0 { 1.0 } else { 0.0 });
    }
    let raw = logs.map(|own| (own - most).exp());
    let sum: f64 = raw.iter().sum();
    raw.map(|own| own / sum)
}

/// A model with another slab of some of its columns, its noise as before.
///
/// `None` where the smaller slab leaves no decomposition.
pub(super) fn rescaled(
    problem: &Problem,
    model: &Model,
    columns: &[u32],
    scale: f64,
) -> Option<Model> {
    let size = model.members.len();
    let mut matrix = product_transposed(&model.factor, &model.factor, [size; 3]);
    let right: Vec<f64> = (0..size)
        .map(|i| dot(&matrix[i * size..(i + 1) * size], &model.mean))
        .collect();
    for (i, column) in model.members.iter().enumerate() {
        if columns.contains(column) {
            matrix[i * size + i] += (scale.powi(-2) - 1.0) / problem.prior.slab[*column as usize];
        }
    }
    let factor = Cholesky::new(&matrix, size).ok()?;
    let mut mean = right;
    factor.solve(&mut mean);
    Some(Model {
        mean,
        factor: factor.into_lower(),
        ..model.clone()
    })
}

/// Robots drawn from a posterior, each effect in question with a scale: β and φ.
pub(super) fn robots(
    (problem, posterior): (&Problem, &Posterior),
    questions: &[&[u32]],
    (count, seed, stream): (usize, u64, u64),
) -> Vec<(Vec<f64>, f64)> {
    let models = draw(posterior, count, seed, stream).models;
    let empty = Posterior {
        models: Vec::new(),
        ..posterior.clone()
    };
    let of = |(number, &at): (usize, &u32)| {
        let stream = stream + 1 + number as u64;
        let mut random = Random::new(seed, stream);
        let mut model = posterior.models[at as usize].clone();
        for columns in questions {
            if !columns.iter().any(|own| model.members.contains(own)) {
                continue;
            }
            let weights = weights(problem, &model.members, columns);
            let scale = scale(drawn(&weights, random.uniform()));
            if let Some(other) = rescaled(problem, &model, columns, scale) {
                model = other;
            }
        }
        let own = Posterior {
            models: vec![model],
            ..empty.clone()
        };
        let drawn = draw(&own, 1, seed, stream + (1 << 32));
        (drawn.beta, drawn.noise[0])
    };
    models.iter().enumerate().map(of).collect()
}

/// The place at which weights add up to a level.
fn drawn(weights: &[f64; SCALES], level: f64) -> usize {
    let mut sum = 0.0;
    let reached = weights.iter().position(|own| {
        sum += own;
        sum > level
    });
    reached.unwrap_or(0)
}

/// E[β βᵀ | in] of columns (ascending) over the models that hold all of them and over the scales of those that are sized together.
pub(super) fn second_moment(
    (problem, posterior): (&Problem, &Posterior),
    columns: &[u32],
    sized: &[u32],
) -> Vec<f64> {
    let size = columns.len();
    let (mut second, mut weight) = (vec![0.0; size * size], 0.0);
    for model in &posterior.models {
        let at = |column: &u32| model.members.binary_search(column).ok();
        let Some(own) = columns.iter().map(at).collect::<Option<Vec<usize>>>() else {
            continue;
        };
        weight += model.weight;
        let noise = model.scale / (posterior.shape - 1.0).max(f64::MIN_POSITIVE);
        for (at, share) in weights(problem, &model.members, sized).iter().enumerate() {
            if *share < NEGLIGIBLE {
                continue;
            }
            let Some(other) = rescaled(problem, model, sized, scale(at)) else {
                continue;
            };
            let members = other.members.len();
            let inverse = Cholesky::from_lower(other.factor, members).inverse();
            for (i, &a) in own.iter().enumerate() {
                for (j, &b) in own.iter().enumerate() {
                    let value = other.mean[a] * other.mean[b] + noise * inverse[a * members + b];
                    second[i * size + j] += model.weight * share * value;
                }
            }
        }
    }
    if weight > 0.0 {
        second.iter_mut().for_each(|x| *x /= weight);
    } else {
        // No model has it: as large as its prior.
        for (i, &column) in columns.iter().enumerate() {
            second[i * size + i] = posterior.noise * problem.prior.slab[column as usize];
        }
    }
    second
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::infer::approximate;
    use crate::prior::{Inclusion, Prior};

    /// One effect of two columns and three rows: y = (20 β₁, 0.001 β₂, 0) + noise; the first column is seen, the second one hardly.
    const ROWS: [f64; 3] = [20.0, 1e-3, 0.0];
    const SLAB: [f64; 3] = [2.0, 3.0, 1.0];
    const Y: [f64; 3] = [3.0, 0.4, -0.5];

    fn problem() -> Problem {
        let inclusion = Inclusion::Probability(0.5);
        Problem {
            gram: vec![ROWS[0] * ROWS[0], 0.0, 0.0, ROWS[1] * ROWS[1]],
            xy: vec![ROWS[0] * Y[0], ROWS[1] * Y[1]],
            yy: Y.iter().map(|y| y * y).sum(),
            n: 3.0,
            log_constant: 0.0,
            prior: Prior {
                component: vec![0, 0],
                family: vec![0],
                ..Prior::single(SLAB[..2].to_vec(), vec![0, 0], inclusion, (2.0, 1.0))
            },
            names: vec!["a".into(), "b".into()],
        }
    }

    /// y is of a t distribution with scale matrix I + X V Xᵀ, which is diagonal here.
    fn closed_form() -> [f64; SCALES] {
        let raw: [f64; SCALES] = std::array::from_fn(|at| {
            let square = scale(at) * scale(at);
            let spread = [0, 1, 2].map(|k| 1.0 + square * SLAB[k] * ROWS[k] * ROWS[k]);
            let sum: f64 = (Y.iter().zip(spread)).map(|(y, d)| y * y / d).sum();
            spread.iter().product::<f64>().powf(-0.5) * (1.0 + 0.5 * sum).powf(-3.5)
        });
        let sum: f64 = raw.iter().sum();
        raw.map(|own| own / sum)
    }

    #[test]
    fn scales_are_weighed_by_their_evidence() {
        let found = weights(&problem(), &[0, 1], &[0, 1]);
        for (found, wanted) in found.iter().zip(closed_form()) {
            assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
        }
        // The seen coefficient is 0.15 beside a slab's sd of 1.4 √φ: small scales are likely, and the whole slab is not.
        assert!(found[0] < 0.2 && found[2] > found[0], "{found:?}");
    }

    /// β₂ is φ s² v₂ large: E[β₂²] = φ̄ v₂ E[s²], and in 4000 robots within 5 standard errors (false alarm 6e-7, the seed is fixed).
    #[test]
    fn what_is_not_seen_is_as_large_as_what_is() {
        let problem = problem();
        let posterior = approximate(&problem, None).expect("a posterior of two models");
        let shares = closed_form();
        let mean: f64 = (0..SCALES).map(|at| shares[at] * scale(at).powi(2)).sum();
        let model = posterior.models.iter().find(|own| own.members.len() == 2);
        let phi = model.expect("the model that has the effect").scale / (posterior.shape - 1.0);
        let found = second_moment((&problem, &posterior), &[0, 1], &[0, 1]);
        let wanted = phi * 3.0 * mean;
        assert!(
            (found[3] - wanted).abs() < 2e-3 * wanted,
            "{} {wanted}",
            found[3]
        );
        let robots = robots((&problem, &posterior), &[&[0, 1]], (4000, 1, 0));
        let squares: Vec<f64> = (robots.iter().map(|(beta, _)| beta[1] * beta[1]))
            .filter(|own| *own > 0.0)
            .collect();
        let count = squares.len() as f64;
        let average = squares.iter().sum::<f64>() / count;
        let variance: f64 = squares.iter().map(|x| (x - average).powi(2)).sum::<f64>() / count;
        let error = 5.0 * (variance / count).sqrt();
        assert!(
            (average - wanted).abs() < error,
            "{average} {wanted} {error}"
        );
    }
}
