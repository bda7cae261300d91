//! What the residual of a joint goes with most: time, temperature, speed, load or velocity reversal, and with which share.
//!
//! Each cause is two functions of itself beside a constant, so that none wins by having more of them:
//!
//! ```text
//! time: t, t²   temperature: T, T²   speed: q̇, |q̇|   load: τ_nom, |τ_nom|   reversal: e^(−Δt/T_r), sign(q̇) e^(−Δt/T_r)
//! ```
//! Δt is the time since the velocity last changed its sign. The share is R² of the residual on them, over moving rows.

use crate::linear_algebra::Cholesky;
use crate::observations::Part;

/// Time after a reversal within which friction with memory has settled, s.
const REVERSAL: f64 = 0.1;
/// Share that is added to the normal equations' diagonal: a cause that does not vary explains nothing.
const RIDGE: f64 = 1e-9;
/// Fewest rows that say anything.
const FEWEST: usize = 10;

/// The cause that a residual goes with most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::calibrate) struct Strongest {
    /// "speed".
    pub(in crate::calibrate) cause: &'static str,
    /// Share of the residual's mean square about its mean that it explains, 0 … 1.
    pub(in crate::calibrate) share: f64,
}

/// One moving row: its residual, and `[t, T, q̇, τ_nom, Δt]`.
struct Row {
    residual: f64,
    time: f64,
    temperature: f64,
    speed: f64,
    load: f64,
    since_reversal: f64,
}

/// Name and functions of a cause.
type Cause = (&'static str, fn(&Row) -> [f64; 2]);

const CAUSES: [Cause; 5] = [
    ("time", |row| [row.time, row.time.powi(2)]),
    ("temperature", |row| {
        [row.temperature, row.temperature.powi(2)]
    }),
    ("speed", |row| [row.speed, row.speed.abs()]),
    ("load", |row| [row.load, row.load.abs()]),
    ("velocity reversal", |row| {
        let fading = (-row.since_reversal / REVERSAL).exp();
        [fading, row.speed.signum() * fading]
    }),
];

/// What the residual `y − Xβ` of a joint goes with most; `None` with too few rows.
pub(in crate::calibrate) fn strongest(
    training: &[Part<'_>],
    joint: usize,
    beta: &[f64],
) -> Option<Strongest> {
    let rows: Vec<Row> = (training.iter())
        .flat_map(|part| rows(part, joint, beta))
        .collect();
    if rows.len() < FEWEST {
        return None;
    }
    let known = CAUSES.iter().filter_map(|(cause, of)| {
        let share = explained(&rows, *of)?;
        Some(Strongest { cause, share })
    });
    known.max_by(|a, b| a.share.total_cmp(&b.share))
}

/// Moving rows of one log.
fn rows(part: &Part<'_>, joint: usize, beta: &[f64]) -> Vec<Row> {
    let all = part.observations;
    let own = &all.joints[joint];
    let residual = part.residual(joint, beta, part.rows.clone());
    let (qd, nominal) = (all.qd[joint].get(), own.nominal.get());
    let start = all.time.first().copied().unwrap_or(0.0);
    let (mut turned, mut before) = (0.0, 0.0);
    let mut rows = Vec::new();
    for (row, residual) in part.rows.clone().zip(residual) {
        let (time, speed) = (all.time[row] - start, qd[row]);
        if speed * before < 0.0 {
            turned = time;
        }
        before = speed;
        if !own.standstill[row] {
            rows.push(Row {
                residual,
                time,
                temperature: own.temperature.get(row).copied().unwrap_or(f64::NAN),
                speed,
                load: nominal[row],
                since_reversal: time - turned,
            });
        }
    }
    rows
}

/// R² of the residual on a constant and two functions; `None` where they are not known.
fn explained(rows: &[Row], of: fn(&Row) -> [f64; 2]) -> Option<f64> {
    let count = rows.len() as f64;
    let values: Vec<[f64; 3]> = (rows.iter())
        .map(|row| {
            let [a, b] = of(row);
            [a, b, row.residual]
        })
        .collect();
    if values.iter().flatten().any(|value| !value.is_finite()) {
        return None;
    }
    let mean = |k: usize| values.iter().map(|row| row[k]).sum::<f64>() / count;
    let means = [mean(0), mean(1), mean(2)];
    let product = |i: usize, j: usize| -> f64 {
        let rows = values.iter();
        rows.map(|row| (row[i] - means[i]) * (row[j] - means[j]))
            .sum()
    };
    let total = product(2, 2);
    if total <= 0.0 {
        return None;
    }
    let diagonal = |k: usize| {
        let own = product(k, k);
        // A function that does not vary has no part.
        if own > 0.0 { own * (1.0 + RIDGE) } else { 1.0 }
    };
    let cross = product(0, 1);
    let normal = [diagonal(0), cross, cross, diagonal(1)];
    let right = [product(0, 2), product(1, 2)];
    let mut slopes = right;
    Cholesky::new(&normal, 2).ok()?.solve(&mut slopes);
    let explained: f64 = slopes.iter().zip(right).map(|(a, b)| a * b).sum();
    Some((explained / total).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 200 rows of sin t and a residual that is a known mixture; share in closed form: 4/5 of the variance is the speed's.
    #[test]
    fn the_cause_with_the_largest_share_is_named() {
        let row = |k: usize, residual: f64| {
            let time = 0.05 * k as f64;
            let speed = (1.7 * time).cos();
            Row {
                residual: residual + 2.0 * speed,
                time,
                temperature: f64::NAN,
                speed,
                load: (0.9 * time).sin(),
                since_reversal: 1.0,
            }
        };
        // Alternating: as good as orthogonal to all causes; 2 cos has a mean square of 2.
        let noise = 0.5_f64.sqrt();
        let rows: Vec<Row> = (0..1478)
            .map(|k| row(k, if k % 2 == 0 { noise } else { -noise }))
            .collect();
        let shares: Vec<Option<f64>> = CAUSES.iter().map(|(_, of)| explained(&rows, *of)).collect();
        assert!((shares[2].unwrap() - 0.8).abs() < 0.01, "{shares:?}");
        assert_eq!(shares[1], None);
        for other in [0, 3] {
            assert!(shares[other].unwrap() < 0.02, "{shares:?}");
        }
        // Its sign alone has 8/π² of the cosine's variance.
        let sign = 0.8 * 8.0 / std::f64::consts::PI.powi(2);
        assert!((shares[4].unwrap() - sign).abs() < 0.01, "{shares:?}");
    }
}
