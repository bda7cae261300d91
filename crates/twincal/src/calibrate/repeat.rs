//! Which number can I trust? The same effects fitted to two halves of the data, each without the other.

use super::compact::refit;
use super::repeated::APART;
use super::result::{Halves, Repeat};
use crate::error::{Finding, Result, Severity};
use crate::infer::approximate;
use crate::likelihood::{Columns, assemble};
use crate::observations::{Observations, Part};
use crate::plug_in::{Fit, total};
use crate::posterior::{Posterior, Problem};
use crate::prior::PriorSettings;
use crate::term::{Library, estimate};

/// A half that leaves a coefficient this wide, in prior sd, has not seen it.
const UNSEEN: f64 = 0.9;
/// Rows of the smaller half per row of the larger one, below which they are no halves.
const LEAST: f64 = 0.1;
/// Share of a log that may be left out between its halves, so that no filter reaches over the cut.
const MOST_GAP: f64 = 0.1;

/// Two halves of the data.
pub(super) struct Cut<'a> {
    halves: [Vec<Part<'a>>; 2],
    pub(super) kind: Halves,
}

/// Every other log where there are two or more; otherwise the first and second half of the log, with `gap` rows between.
pub(super) fn cut<'a>(training: &[Part<'a>], gap: usize) -> Option<Cut<'a>> {
    let mut halves = [Vec::new(), Vec::new()];
    let kind = match training {
        [] => return None,
        [only] => {
            let (start, end) = (only.rows.start, only.rows.end);
            let middle = start + only.rows.len() / 2;
            let gap = gap.min((MOST_GAP * only.rows.len() as f64) as usize);
            let observations: &'a Observations = only.observations;
            for (half, rows) in halves
                .iter_mut()
                .zip([start..middle - gap / 2, middle + gap.div_ceil(2)..end])
            {
                half.push(Part { observations, rows });
            }
            Halves::OneLog
        }
        _ => {
            for (index, part) in training.iter().enumerate() {
                halves[index % 2].push(part.clone());
            }
            Halves::EveryOtherLog
        }
    };
    Some(Cut { halves, kind })
}

/// The effects in `inside` on both halves, everything that is plugged in as in the whole fit. A half's inclusion
/// probability is that of a search of its own.
pub(super) fn repeat(
    cut: &Cut<'_>,
    library: &Library,
    columns: &Columns,
    prior: &PriorSettings,
    fit: &Fit,
    inside: &[bool],
) -> Result<Vec<Repeat>> {
    let mut found: Vec<(Problem, Posterior, Posterior)> = Vec::new();
    let rows = cut
        .halves
        .each_ref()
        .map(|half| half.iter().map(|part| part.rows.len()).sum::<usize>());
    if (rows[0].min(rows[1]) as f64) < LEAST * rows[0].max(rows[1]) as f64 {
        return Ok(Vec::new()); // two halves in name only
    }
    for half in &cut.halves {
        let mut problem = assemble(&total(half), columns, &fit.plug_in, prior)?;
        problem.prior = fit.problem.prior.clone();
        if problem.n <= 0.0 {
            return Ok(Vec::new());
        }
        let own = approximate(&problem, Some(&fit.posterior))?;
        let settled = refit(&problem, inside, &fit.posterior)?;
        found.push((problem, own, settled));
    }
    let mut out = Vec::new();
    for (k, &term) in library.columns().iter().enumerate() {
        if !inside[fit.problem.prior.component[k]] {
            continue;
        }
        let half = |i: usize| {
            let (problem, own, settled) = &found[i];
            let prior_sd = (settled.noise * problem.prior.slab[k]).sqrt();
            let zero = problem.gram[k * columns.names.len() + k] == 0.0;
            let seen = !zero && settled.sd[k] < UNSEEN * prior_sd;
            (settled.mean[k], settled.sd[k], own.inclusion[k], seen)
        };
        let ((first, first_sd, first_pip, a), (second, second_sd, second_pip, b)) =
            (half(0), half(1));
        let z = (second - first) / first_sd.hypot(second_sd);
        let term = &library.terms()[term];
        out.push(Repeat {
            component: library.components()[term.component].name.clone(),
            term: term.name.clone(),
            unit: term.unit.clone(),
            first,
            first_sd,
            first_pip,
            second,
            second_sd,
            second_pip,
            z: (a && b && z.is_finite()).then_some(z),
        });
    }
    Ok(out)
}

/// One finding per component with a number that does not repeat, those furthest apart first.
pub(super) fn findings(repeats: &[Repeat], kind: Halves) -> Vec<Finding> {
    let mut findings: Vec<(f64, Finding)> = Vec::new();
    let size = |repeat: &Repeat| repeat.z.unwrap_or(0.0).abs();
    for group in repeats.chunk_by(|a, b| a.component == b.component) {
        let Some(worst) = group.iter().max_by(|a, b| size(a).total_cmp(&size(b))) else {
            continue;
        };
        if size(worst) < APART {
            continue;
        }
        let (one, other) = kind.words();
        let finding = Finding::new(
            Severity::Warning,
            "does_not_repeat",
            worst.component.clone(),
            format!(
                "`{}` is {} {} from {one} and {} from {other}, {:.1} sd apart: trust it no closer than that",
                worst.term,
                estimate(worst.first, worst.first_sd),
                worst.unit,
                estimate(worst.second, worst.second_sd),
                size(worst)
            ),
            group.iter().filter(|repeat| size(repeat) >= APART).count() as u64,
        );
        findings.push((size(worst), finding));
    }
    findings.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    findings.into_iter().map(|(_, finding)| finding).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::testing::{Regression, part};

    #[test]
    fn one_log_is_halved_with_a_gap_and_several_are_dealt_out() {
        let log = Regression::new(1, 100).log(&[1.0], 1.0);
        let one = cut(&[part(&log)], 7).unwrap();
        let rows = |half: usize| one.halves[half][0].rows.clone();
        assert_eq!((rows(0), rows(1)), (0..47, 54..100));
        // A gap never eats more than a tenth of the log.
        let one = cut(&[part(&log)], 1000).unwrap();
        assert_eq!(one.halves[1][0].rows.start - one.halves[0][0].rows.end, 10);
        let three = cut(&[part(&log), part(&log), part(&log)], 7).unwrap();
        assert_eq!((three.halves[0].len(), three.halves[1].len()), (2, 1));
        assert_eq!(three.kind, Halves::EveryOtherLog);
        assert!(cut(&[], 7).is_none());
    }

    /// With white noise and one truth in both halves z is standard normal: 200 data sets of two columns, the mean square
    /// of 400 z is 1 with sd 0.071, 4.5 sd allowed (false alarm 7e-6, fixed seed).
    #[test]
    fn z_is_standard_normal_when_nothing_moves() {
        let mut random = Regression::new(5, 150);
        let mut square = 0.0;
        for _ in 0..200 {
            let logs = [random.log(&[2.0, -1.0], 1.0), random.log(&[2.0, -1.0], 1.0)];
            let repeats = random.repeats(&logs);
            square += repeats.iter().map(|r| r.z.unwrap().powi(2)).sum::<f64>();
        }
        let mean = square / 400.0;
        assert!((mean - 1.0).abs() < 0.32, "{mean}");
    }

    #[test]
    fn a_half_of_a_few_rows_is_none() {
        let mut random = Regression::new(6, 400);
        let whole = random.log(&[2.0, -1.0], 1.0);
        let rest = |rows: usize| Regression::new(7, rows).log(&[2.0, -1.0], 1.0);
        assert!(random.repeats(&[whole.clone(), rest(39)]).is_empty());
        assert_eq!(random.repeats(&[whole, rest(41)]).len(), 2);
    }

    #[test]
    fn a_number_that_moves_is_named_and_one_that_is_unseen_is_not_judged() {
        let mut random = Regression::new(6, 400);
        let logs = [random.log(&[2.0, -1.0], 1.0), random.log(&[3.0, -1.0], 1.0)];
        let repeats = random.repeats(&logs);
        // Δ = 1, each sd 1/√400: z = 14.
        assert!((repeats[0].z.unwrap() - 14.1).abs() < 4.5, "{repeats:?}");
        assert!(repeats[1].z.unwrap().abs() < 4.5);
        let said = findings(&repeats, Halves::EveryOtherLog);
        assert_eq!((said.len(), &said[0].subject), (1, &repeats[0].component));
        // The second log does not have the second column at all.
        let mut logs = [random.log(&[2.0, -1.0], 1.0), random.log(&[2.0, 0.0], 1.0)];
        logs[1].joints[0].x[400..].fill(0.0);
        let repeats = random.repeats(&logs);
        assert_eq!((repeats[0].z.is_some(), repeats[1].z), (true, None));
    }
}
