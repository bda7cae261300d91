//! Rows that count less, by second passes over the kept rows: outliers, as a Student-t likelihood weighs them, and rows at
//! speeds and under loads at which a joint is noisier.
//!
//! A t distribution is a normal one of random scale. Given the residual r and the scale s of its joint, the expected precision
//! of a row is (Lange, Little & Taylor 1989)
//!
//! ```text
//! u = (ν + 1) / (ν + r²/s²),   ν = 4,   s = median|r| / 0.7407
//! ```
//! and a row enters every sum multiplied by √u, so that `φ = Σ u r²/n` estimates s². The 95 % intervals are made wide enough for
//! 95 % of the left-out rows, outliers included (`interval_factor`).

use super::fitted::{estimate, sums};
use crate::calibrate::data::all_logs::Data;
use crate::calibrate::settings::CalibrationSettings;
use crate::error::{Code, Error, Finding, Result, Severity};
use crate::likelihood::{Columns, NoiseModel, NoiseSettings, Profile, Spread};
use crate::observations::Part;
use crate::robot::Robot;
use crate::statistics::Purpose;

/// Degrees of freedom ν.
pub(crate) const FREEDOM: f64 = 4.0;
/// Median of |t| with 4 degrees of freedom.
const MEDIAN: f64 = 0.740_697_084_112_684;
/// Fits before the last one.
const PASSES: usize = 2;
/// Weight below which a row counts as turned down.
const DOWN: f64 = 0.25;

/// Weighs the rows of all fit logs, as the settings ask: robust, by speed, by load. Returns how the noise of each joint varies.
///
/// # Errors
/// [`Error::Setting`] with another likelihood than the tempered one, and those of the fit.
pub(in crate::calibrate) fn weigh(
    robot: &Robot,
    data: &mut Data,
    columns: &Columns,
    settings: &CalibrationSettings,
    findings: &mut Vec<Finding>,
) -> Result<Vec<Spread>> {
    let mut spreads = vec![Spread::default(); robot.dof()];
    let noise = settings.noise;
    if !noise.weighs_rows() {
        return Ok(spreads);
    }
    if noise.model != NoiseModel::Tempered {
        let key = match (noise.robust, noise.varies_with_speed) {
            (true, _) => "noise.robust",
            (false, true) => "noise.varies_with_speed",
            (false, false) => "noise.varies_with_load",
        };
        return Err(Error::Setting {
            key: key.into(),
            problem: "only noise.model = \"tempered\" can weigh rows one by one".into(),
            remedy: "leave noise.model out, or this key".into(),
        });
    }
    let mut down = vec![(0, 0); robot.dof()];
    for _ in 0..PASSES {
        let rows = data.training();
        let fitted = estimate(
            &sums(&rows, settings, Purpose::Fit),
            &rows,
            columns,
            settings,
        )?;
        let beta = &fitted.fit.posterior.mean;
        for (joint, spread) in spreads.iter_mut().enumerate() {
            let memory = fitted.fit.plug_in.autocorrelation_time[joint];
            learn(
                spread,
                &moving(&data.training(), joint, beta),
                memory,
                noise,
            );
            down[joint] = set(data, joint, beta, spread, noise.robust);
        }
    }
    for (name, (count, all)) in robot.joint_names().into_iter().zip(down) {
        if count > 0 {
            let message = format!(
                "joint `{name}`: {count} of {all} rows count less than a quarter (noise.robust)"
            );
            let code = Code::OutliersWeighed;
            let finding = Finding::new(Severity::Note, code, name, message, count as u64);
            findings.push(finding.with([("rows", all as f64)]));
        }
    }
    Ok(spreads)
}

/// A moving row of a joint.
#[derive(Debug, Clone, Copy)]
pub(in crate::calibrate) struct MovingRow {
    /// |q̇|.
    pub(in crate::calibrate) speed: f64,
    /// |τ_nom|.
    pub(in crate::calibrate) load: f64,
    pub(in crate::calibrate) residual: f64,
    /// Relative noise variance as the rows are weighed.
    pub(in crate::calibrate) spread: f64,
}

/// One round of backfitting: each factor from what the other leaves of the residual.
fn learn(spread: &mut Spread, rows: &[MovingRow], memory: f64, noise: NoiseSettings) {
    let profile = |x: fn(&MovingRow) -> f64, rest: &Spread| {
        let pair = |row: &MovingRow| {
            let left = rest.at(row.speed, row.load).sqrt();
            (x(row), row.residual / left)
        };
        Profile::of_rows(rows.iter().map(pair).collect(), memory)
    };
    if noise.varies_with_speed {
        spread.speed = None;
        spread.speed = profile(|row| row.speed, spread);
    }
    if noise.varies_with_load {
        spread.load = None;
        spread.load = profile(|row| row.load, spread);
    }
    // Where speed and load go together the mean of the product is not the product of the means.
    let all = rows.iter().map(|row| spread.at(row.speed, row.load));
    let mean = all.sum::<f64>() / rows.len() as f64;
    if let Spread {
        speed: Some(_),
        load: Some(load),
    } = spread
    {
        load.divide(mean);
    }
}

/// Speed, load and residual of the moving rows of a joint.
pub(in crate::calibrate) fn moving(
    training: &[Part<'_>],
    joint: usize,
    beta: &[f64],
) -> Vec<MovingRow> {
    let mut rows = Vec::new();
    for part in training {
        let residual = part.residual(joint, beta, part.rows.clone());
        let own = &part.observations.joints[joint];
        let velocity = part.observations.qd[joint].get();
        let nominal = own.nominal.get();
        let all = part.rows.clone().zip(residual);
        rows.extend(
            all.filter(|(row, _)| !own.standstill[*row])
                .map(|(row, residual)| MovingRow {
                    speed: velocity[row].abs(),
                    load: nominal[row].abs(),
                    residual,
                    spread: own.spread.get(row).copied().unwrap_or(1.0),
                }),
        );
    }
    rows
}

/// Sets weight and spread of every row of a joint; returns how many moving rows count little, and how many there are.
fn set(
    data: &mut Data,
    joint: usize,
    beta: &[f64],
    spread: &Spread,
    robust: bool,
) -> (usize, usize) {
    let rows = moving(&data.training(), joint, beta);
    let even = |row: &MovingRow| row.residual / spread.at(row.speed, row.load).sqrt();
    let scale = scale(rows.iter().map(even).collect());
    let (mut down, mut all) = (0, 0);
    for log in &mut data.fit {
        let own = &mut log.observations;
        let residual = own.whole().residual(joint, beta, 0..own.len());
        let velocity = own.qd[joint].get();
        let kept = &mut own.joints[joint];
        let nominal = kept.nominal.get();
        let motion = velocity.iter().zip(&*nominal);
        kept.spread = motion.map(|(v, load)| spread.at(*v, *load)).collect();
        kept.weight = residual
            .iter()
            .zip(&kept.spread)
            .map(|(r, g)| {
                if robust {
                    weight(r / g.sqrt(), scale) / g
                } else {
                    1.0 / g
                }
            })
            .collect();
        for ((weight, g), _) in (kept.weight.iter().zip(&kept.spread))
            .zip(&kept.standstill)
            .filter(|(_, still)| !**still)
        {
            down += usize::from(weight * g < DOWN);
            all += 1;
        }
    }
    (down, all)
}

/// s of a joint; 0 without rows.
fn scale(residual: Vec<f64>) -> f64 {
    let mut size: Vec<f64> = residual.into_iter().map(f64::abs).collect();
    size.sort_by(f64::total_cmp);
    size.get(size.len() / 2)
        .map_or(0.0, |median| median / MEDIAN)
}

/// u; 1 where there is no residual to speak of.
fn weight(residual: f64, scale: f64) -> f64 {
    if scale > 0.0 {
        let t = residual / scale;
        (FREEDOM + 1.0) / (FREEDOM + t * t)
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ContinuousCDF, StudentsT};

    /// A t variable's own quantiles: s is 1, and the weights have mean 1 (E[u] of the right scale) and Σ u r² = n.
    #[test]
    fn weights_are_those_of_the_t_likelihood() {
        let t = StudentsT::new(0.0, 1.0, FREEDOM).unwrap();
        let sample: Vec<f64> = (0..40_000)
            .map(|i| t.inverse_cdf((f64::from(i) + 0.5) / 40_000.0))
            .collect();
        let s = scale(sample.clone());
        assert!((s - 1.0).abs() < 1e-3, "{s}");
        let square: f64 = sample.iter().map(|r| weight(*r, 1.0) * r * r).sum();
        assert!((square / 40_000.0 - 1.0).abs() < 2e-3, "{square}");
        assert_eq!(weight(0.0, 1.0), 1.25);
        assert_eq!((weight(3.0, 0.0), scale(Vec::new())), (1.0, 0.0));
    }
}
