//! The definitions row by row, noise that has no misfit, and misfit that grows with the log.

use super::super::tests::{log_of, noise, prior};
use super::super::{FitSettings, Moving, fit, start};
use super::*;
use crate::likelihood::NoiseModel;
use crate::observations::Observations;
use crate::random::Random;
use crate::statistics::{Purpose, Runs, Sums, Training};
use crate::term::Family;
use std::borrow::Cow;

/// A joint that swings, with two columns (q̇ and q̈ like) and what no column describes: `unknown` times sin 3q.
fn swinging(rows: usize, seed: u64, unknown: f64) -> Observations {
    let mut random = Random::new(seed, 0);
    let phase = |row: usize| 0.037 * row as f64;
    let q: Vec<f64> = (0..rows).map(|row| 1.2 * phase(row).sin()).collect();
    let qd: Vec<f64> = (0..rows).map(|row| 1.2 * phase(row).cos()).collect();
    let swing = |row: usize| (2.3 * phase(row)).sin();
    let y = (0..rows)
        .map(|row| {
            2.0 * qd[row] + 3.0 * swing(row) + unknown * (3.0 * q[row]).sin() + random.normal()
        })
        .collect();
    let x = qd.iter().copied().chain((0..rows).map(swing)).collect();
    log_of(q, qd, x, y)
}

fn two_columns() -> Columns {
    Columns {
        halves: Vec::new(),
        one_motion: false,
        names: vec!["a".into(), "b".into()],
        component: vec![0, 1],
        family: vec![0, 0],
        families: vec![Family::User],
        prior_sd: vec![None, None],
        lower: vec![f64::NEG_INFINITY; 2],
        forced: Vec::new(),
        parent: Vec::new(),
        second_choice: Vec::new(),
    }
}

fn fitted(log: &Observations, columns: &Columns) -> Fit {
    let prior = prior();
    let settings = FitSettings {
        noise: noise(NoiseModel::Tempered),
        prior: &prior,
    };
    let training = Sums::of(&[log.whole()], Runs::Apart, Purpose::Result);
    let first = start(&training, columns, &prior);
    fit(&training, columns, settings, &first, Moving::All, None).unwrap()
}

/// The misfit of a log, with fifths left out.
fn measured(log: &Observations, columns: &Columns, fit: &Fit) -> Misfit {
    let training = Training::new(&Sums::of(&[log.whole()], Runs::Apart, Purpose::Result));
    let kept: Vec<Gram> = (0..5).map(|unit| training.without(unit)).collect();
    let sums = (&training.total(), &training.units[..], &kept[..]);
    misfit(sums, (columns, &prior()), fit).unwrap()
}

/// λ¹ and λ² by sums over rows: decoys as they are defined, the normal equations of two columns by Cramer's rule.
#[test]
fn both_are_their_definitions() {
    let (rows, columns) = (400, two_columns());
    let log = swinging(rows, 3, 0.7);
    let fit = fitted(&log, &columns);
    let found = measured(&log, &columns, &fit);
    let own = Rows::new(&log, fit.plug_in.factor(0));
    let mean = [fit.posterior.mean[0], fit.posterior.mean[1]];
    let (a, _) = own.normal(&|_| true);
    let c = inverse(a, &fit.problem.prior.slab);
    let rss: f64 = (0..rows).map(|row| own.residual(mean, row).powi(2)).sum();
    let trace = a[0] * c[0] + a[1] * c[2] + a[2] * c[1] + a[3] * c[3];
    let variance = rss / (rows as f64 - trace);
    let (mut within, mut left_out) = ([0.0; 2], [0.0; 2]);
    let mut kept = Vec::new();
    for k in 0..34 {
        let (pr, square, g) = own.along(k, mean, &|_| true);
        let left = square - own.factor * form(c, g);
        if left > 0.05 * square {
            kept.push(k);
            within = [within[0] + pr * pr, within[1] + left];
        }
    }
    for piece in 0..5 {
        let inside = move |row: usize| row >= piece * rows / 5 && row < (piece + 1) * rows / 5;
        let (a, b) = own.normal(&|row| !inside(row));
        // The slab is that of the other pieces.
        let others: Vec<_> = (0..5)
            .filter(|p| *p != piece)
            .map(|p| log.cut(5)[p].clone())
            .collect();
        let problem = assemble(&others.iter().collect(), &columns, &fit.plug_in, &prior()).unwrap();
        let c = inverse(a, &problem.prior.slab);
        let beta = [c[0] * b[0] + c[1] * b[1], c[2] * b[0] + c[3] * b[1]];
        for &k in &kept {
            let (pr, square, g) = own.along(k, beta, &inside);
            let expected = square + own.factor * form(c, g);
            left_out = [left_out[0] + pr * pr, left_out[1] + expected];
        }
    }
    let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-8, "{a} {b}");
    close(found.variance[0], variance);
    close(found.within[0], within[0] / (within[1] * variance));
    close(found.left_out[0], left_out[0] / (left_out[1] * variance));
    assert!(found.within[0] > 3.0, "the planted torque shows: {found:?}");
}

/// The rows of a log with two columns.
struct Rows<'a> {
    q: Cow<'a, [f64]>,
    qd: Cow<'a, [f64]>,
    x: [&'a [f64]; 2],
    y: &'a [f64],
    /// Weight of a row.
    factor: f64,
}

impl<'a> Rows<'a> {
    fn new(log: &'a Observations, factor: f64) -> Self {
        let joint = &log.joints[0];
        let rows = joint.y.len();
        let (a, b) = joint.x.split_at(rows);
        Self {
            q: log.q[0].some(0..rows),
            qd: log.qd[0].some(0..rows),
            x: [a, b],
            y: &joint.y,
            factor,
        }
    }

    fn decoy(&self, k: usize, row: usize) -> f64 {
        let (harmonic, sense) = (k % 17, (self.qd[row] / 0.02).tanh());
        let order = harmonic.div_ceil(2) as f64;
        let shape = match harmonic {
            0 => 1.0,
            odd if odd % 2 == 1 => (order * self.q[row]).cos(),
            _ => (order * self.q[row]).sin(),
        };
        if k < 17 { shape } else { shape * sense }
    }

    fn residual(&self, beta: [f64; 2], row: usize) -> f64 {
        self.y[row] - beta[0] * self.x[0][row] - beta[1] * self.x[1][row]
    }

    /// `[A, b]` of some rows.
    fn normal(&self, own: &dyn Fn(usize) -> bool) -> ([f64; 4], [f64; 2]) {
        let (mut a, mut b) = ([0.0; 4], [0.0; 2]);
        for row in (0..self.y.len()).filter(|&row| own(row)) {
            for i in 0..2 {
                for j in 0..2 {
                    a[2 * i + j] += self.factor * self.x[i][row] * self.x[j][row];
                }
                b[i] += self.factor * self.x[i][row] * self.y[row];
            }
        }
        (a, b)
    }

    /// φᵀr, φᵀφ and Xᵀφ of a decoy over some rows.
    fn along(&self, k: usize, beta: [f64; 2], own: &dyn Fn(usize) -> bool) -> (f64, f64, [f64; 2]) {
        let (mut pr, mut square, mut g) = (0.0, 0.0, [0.0; 2]);
        for row in (0..self.y.len()).filter(|&row| own(row)) {
            let phi = self.decoy(k, row);
            pr += phi * self.residual(beta, row);
            square += phi * phi;
            g = [g[0] + phi * self.x[0][row], g[1] + phi * self.x[1][row]];
        }
        (pr, square, g)
    }
}

/// The inverse of A with the slab's precision.
fn inverse(mut a: [f64; 4], slab: &[f64]) -> [f64; 4] {
    (a[0], a[3]) = (a[0] + 1.0 / slab[0], a[3] + 1.0 / slab[1]);
    let det = a[0] * a[3] - a[1] * a[2];
    [a[3] / det, -a[1] / det, -a[2] / det, a[0] / det]
}

/// gᵀ C g.
fn form(c: [f64; 4], g: [f64; 2]) -> f64 {
    c[0] * g[0] * g[0] + (c[1] + c[2]) * g[0] * g[1] + c[3] * g[1] * g[1]
}

/// Independent noise: over 40 logs the mean of both is 1 within five standard errors (false alarm: 1e-6). Values below 1 are raised to it, so
/// that the mean lies a little above; without that it is 1.
#[test]
fn independent_noise_has_none() {
    let columns = two_columns();
    let mut mean = [0.0; 2];
    for seed in 0..40 {
        let log = swinging(600, 100 + seed, 0.0);
        let found = measured(&log, &columns, &fitted(&log, &columns));
        mean = [
            mean[0] + found.within[0] / 40.0,
            mean[1] + found.left_out[0] / 40.0,
        ];
    }
    assert!(mean.iter().all(|m| (1.0..1.35).contains(m)), "{mean:?}");
}

/// A torque that no column describes: four times the rows of the same motion say it four times as loud, and count no more.
#[test]
fn misfit_grows_with_the_log_so_that_rows_count_no_more() {
    let columns = two_columns();
    let of = |rows: usize| {
        let log = swinging(rows, 7, 1.0);
        measured(&log, &columns, &fitted(&log, &columns)).within[0]
    };
    let (short, long) = (of(1700), of(6800));
    assert!(
        short > 10.0 && (3.3..4.7).contains(&(long / short)),
        "{short} {long}"
    );
}
