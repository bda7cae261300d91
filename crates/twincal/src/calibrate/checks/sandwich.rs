//! A second opinion on every sd that does not believe the likelihood: the spread of block scores (method section 5).
//!
//! With the compact twin's `A = Σ x xᵀ + V⁻¹` and the score `s_b = Σ_{rows of b} x r` of a stretch of time b over all joints
//! (both weighted as in the fit)
//!
//! ```text
//! Cov(β̂ − β) ≈ A⁻¹ (B/(B−1) Σ_b s_b s_bᵀ + φ V⁻¹) A⁻¹
//! ```
//!
//! (Huber 1967; blocks for dependent rows as in Liang & Zeger 1986; the second part is the prior's own, so that what the data
//! do not see stays as wide as the prior). The tempering cancels: A⁻¹ grows with max(τ, λ) as s_b sinks.

use crate::error::{Code, Finding, Severity};
use crate::gram::Gram;
use crate::linear_algebra::Cholesky;
use crate::plug_in::Fit;
use crate::posterior::{Model, Posterior};
use crate::statistics::{BLOCKS, Sums, of_joint};

/// Stretches at most and at least: each sd has a relative error of about 1/√(2B). A log has ten at most.
const STRETCHES: (usize, usize) = (32, 8);
/// Shortest block, in autocorrelation times.
const TIMES: f64 = 4.0;
/// Ratio of the two sds from which they disagree.
const DISAGREE: f64 = 2.0;

/// Both opinions on the sd of a term's coefficient.
pub(in crate::calibrate) struct Sds<'a> {
    /// Name of the term.
    pub(in crate::calibrate) term: &'a str,
    pub(in crate::calibrate) sandwich: Option<f64>,
    pub(in crate::calibrate) likelihood: Option<f64>,
}

/// Sandwich sd of every column of the compact twin, K; `None` of the others, and where there are too few blocks.
pub(in crate::calibrate) fn sds(fit: &Fit, compact: &Posterior, sums: &Sums) -> Vec<Option<f64>> {
    let nothing = vec![None; compact.mean.len()];
    let Some(model) = compact.models.first() else {
        return nothing;
    };
    let blocks = blocks(fit, sums);
    if blocks.len() < STRETCHES.1 || model.members.is_empty() {
        return nothing;
    }
    let scores: Vec<Vec<f64>> = blocks
        .iter()
        .map(|block| score(fit, compact, model, block))
        .collect();
    let size = model.members.len();
    let inverse = Cholesky::from_lower(model.factor.clone(), size).inverse();
    let count = scores.len() as f64;
    let mut out = nothing;
    for (place, &member) in model.members.iter().enumerate() {
        let row = &inverse[place * size..(place + 1) * size];
        let along = |score: &Vec<f64>| row.iter().zip(score).map(|(a, s)| a * s).sum::<f64>();
        let square: f64 = scores.iter().map(|score| along(score).powi(2)).sum();
        let slab = |m: &u32| fit.problem.prior.slab[*m as usize];
        let own = row.iter().zip(&model.members).map(|(a, m)| a * a / slab(m));
        let prior = compact.noise * own.sum::<f64>();
        out[member as usize] = Some((square * count / (count - 1.0) + prior).sqrt());
    }
    out
}

/// Stretches of time, none shorter than a few autocorrelation times where that is possible.
fn blocks(fit: &Fit, sums: &Sums) -> Vec<Gram> {
    let (rows, groups) = (sums.rows(), sums.groups());
    let times = fit.plug_in.autocorrelation_time.iter().copied();
    let shortest = (TIMES * times.fold(1.0, f64::max)).ceil() as usize;
    let count = (rows / shortest.max(1)).clamp(STRETCHES.1, STRETCHES.0);
    let apart = sums.stretches();
    let each = count.div_ceil(groups.max(1)).min(apart);
    let cut = |i: usize| i * apart / each * (BLOCKS / apart);
    let all = (0..groups).flat_map(|group| (0..each).map(move |i| (group, cut(i)..cut(i + 1))));
    let gram = |place| sums.unit(&[place]).gram;
    let moves = |gram: &Gram| gram.joints.iter().any(|joint| joint.n > 0.0);
    all.map(gram).filter(moves).collect()
}

/// `Σ f_j x r` over the moving rows of a block, in the order of the model's members.
fn score(fit: &Fit, compact: &Posterior, model: &Model, block: &Gram) -> Vec<f64> {
    let mut place = vec![None; compact.mean.len()];
    for (at, &member) in model.members.iter().enumerate() {
        place[member as usize] = Some(at);
    }
    let mut score = vec![0.0; model.members.len()];
    for (joint, gram) in block.joints.iter().enumerate() {
        let (factor, beta) = (fit.plug_in.factor(joint), of_joint(gram, &compact.mean));
        for (i, &column) in gram.columns.iter().enumerate() {
            let Some(at) = place[column as usize] else {
                continue;
            };
            let explained = beta.iter().enumerate().map(|(k, b)| b * gram.s0.at(i, k));
            score[at] += factor * (gram.s0.at(i, beta.len()) - explained.sum::<f64>());
        }
    }
    score
}

/// One finding for all terms whose block scores spread more than twice as far as the likelihood says.
pub(in crate::calibrate) fn findings<'a>(terms: impl Iterator<Item = Sds<'a>>) -> Vec<Finding> {
    let ratio = |sds: Sds<'a>| -> Option<(&'a str, f64)> {
        let ratio = sds.sandwich? / sds.likelihood?;
        (ratio > DISAGREE).then_some((sds.term, ratio))
    };
    let mut found: Vec<(&str, f64)> = terms.filter_map(ratio).collect();
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    let Some((name, ratio)) = found.first() else {
        return Vec::new();
    };
    let others = match found.len() {
        1 => String::new(),
        n => format!(" and {} more (terms[].sandwich_sd)", n - 1),
    };
    vec![Finding::new(
        Severity::Warning,
        Code::SdTooSmall,
        *name,
        format!(
            "the sd of `{name}`{others} may be too small: stretches of the logs disagree on it {ratio:.1} times more than the \
             likelihood says"
        ),
        found.len() as u64,
    )
    .with([("ratio", *ratio)])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::testing::{Regression, part};
    use crate::observations::Observations;
    use crate::statistics::{Purpose, Runs};

    /// Sandwich over likelihood sd of both columns, of three logs that the rows are cut into.
    fn ratios(random: &Regression, log: &Observations) -> Vec<f64> {
        let logs = log.cut(3);
        let (fit, compact) = random.fitted(&logs);
        let sds = sds(
            &fit,
            &compact,
            &Sums::of(&logs, Runs::Joined, Purpose::Result),
        );
        sds.iter()
            .zip(&compact.sd)
            .map(|(s, sd)| s.unwrap() / sd)
            .collect()
    }

    /// White rows: both agree (30 stretches: relative error 1/√60 = 0.129, 4.5 of them allowed).
    #[test]
    fn on_white_noise_both_opinions_agree() {
        let mut random = Regression::new(8, 6400);
        let log = random.log(&[2.0, -1.0], 1.0);
        for ratio in ratios(&random, &log) {
            assert!((ratio - 1.0).abs() < 0.58, "{ratio}");
        }
    }

    /// A column and an error that are both constant over 50 rows: √50 = 7.1 times the sd of white rows, within 58 %.
    #[test]
    fn a_correlated_residual_is_seen_by_the_blocks() {
        let mut random = Regression::new(9, 6400);
        let mut log = random.log(&[2.0, -1.0], 1.0);
        let joint = &mut log.joints[0];
        for start in (0..6400).step_by(50) {
            let (x, noise) = (joint.x[start], random.random.normal());
            for row in start..start + 50 {
                joint.x[row] = x;
                joint.y[row] = 2.0 * x - joint.x[6400 + row] + noise;
            }
        }
        let ratios = ratios(&random, &log);
        assert!(
            (ratios[0] / 50.0_f64.sqrt() - 1.0).abs() < 0.58,
            "{ratios:?}"
        );
        assert!((ratios[1] - 1.0).abs() < 0.58, "{ratios:?}");
    }

    /// The score of a stretch is that of its rows: Σ x (y − Xβ), weighed rows too.
    #[test]
    fn scores_are_those_of_rows() {
        let mut random = Regression::new(10, 400);
        let mut log = random.log(&[2.0, -1.0], 1.0);
        log.joints[0].weight = (0..400).map(|row| 0.5 + (row % 3) as f64).collect();
        let (fit, compact) = random.fitted(&[part(&log)]);
        let blocks = blocks(&fit, &Sums::of(&[part(&log)], Runs::Apart, Purpose::Result));
        assert_eq!(blocks.len(), 10);
        let factor = fit.plug_in.factor(0);
        for (block, gram) in blocks.iter().enumerate() {
            let score = score(&fit, &compact, &compact.models[0], gram);
            for (column, score) in score.into_iter().enumerate() {
                let joint = &log.joints[0];
                let x = |column: usize, row: usize| joint.x[column * 400 + row];
                let rows = 40 * block..40 * (block + 1);
                let own = rows.map(|row| {
                    let explained: f64 = (0..2).map(|k| x(k, row) * compact.mean[k]).sum();
                    factor * joint.weight[row] * x(column, row) * (joint.y[row] - explained)
                });
                let truth: f64 = own.sum();
                assert!(
                    (score - truth).abs() < 1e-9 * (1.0 + truth.abs()),
                    "{score} {truth}"
                );
            }
        }
    }
}
