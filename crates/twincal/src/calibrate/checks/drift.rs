//! Drift within a run: a residual that is different at the end from what it was at the beginning (warming up), or that goes with
//! the drive's temperature where that was logged.

use crate::error::{Code, Finding, Severity};
use crate::observations::{Observations, Part};
use crate::robot::Robot;
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::borrow::Cow;

/// Blocks that each third of a run is cut into; their means vary as independent rows would not.
const BLOCKS: usize = 8;
/// Fewest moving rows in a block.
const FEWEST: usize = 4;
/// False alarms per fit.
const ALARM: f64 = 1e-3;
/// Fewest degrees over a run for anything to be told of temperature.
const DEGREES: f64 = 1.0;
/// A drift below this share of the residual's sd is not worth a word.
const SHARE: f64 = 0.5;

/// What of the residual may drift.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum What {
    /// Its mean: an offset, gravity.
    Level,
    /// Its mean against the direction of motion: friction.
    Friction,
}

/// Findings for all logs and joints, of the residual at the model average: how it goes with the temperature where that was logged
/// and moved, else first against last third.
pub(in crate::calibrate) fn findings(
    robot: &Robot,
    training: &[Part<'_>],
    mean: &[f64],
) -> Vec<Finding> {
    let names = robot.joint_names();
    let tests = (4 * names.len() * training.len()).max(1) as f64;
    let mut findings = Vec::new();
    for part in training {
        for (joint, name) in names.iter().enumerate() {
            let residual = part.residual(joint, mean, part.rows.clone());
            let rows = Rows::of(part.observations, joint, part.rows.start, &residual);
            let log = &part.observations.log;
            for what in [What::Level, What::Friction] {
                if let Some(warming) = rows.warming(what, ALARM / tests) {
                    findings.push(warms(what, log, name, &warming));
                } else if let Some((change, sd)) = rows.drift(what, ALARM / tests) {
                    findings.push(finding(what, log, name, change, sd));
                }
            }
        }
    }
    findings
}

fn finding(what: What, log: &str, joint: &str, change: f64, sd: f64) -> Finding {
    let (subject, remedy) = match what {
        What::Level => (
            "what the model leaves over changed",
            "zero the torque sensor or warm the drives up before logging",
        ),
        What::Friction => (
            "friction changed",
            "warm the joints up before logging, and log as they will be used",
        ),
    };
    Finding::new(
        Severity::Warning,
        Code::Drift,
        joint,
        format!(
            "log `{log}`, joint `{joint}`: {subject} by {change:+.3} (residual sd {sd:.3}) from the first third of the run to \
             the last, or its motion did; the twin holds the average: {remedy}"
        ),
        0,
    )
    .with([("change", change), ("residual_sd", sd)])
}

fn warms(what: What, log: &str, joint: &str, warming: &Warming) -> Finding {
    let (subject, remedy) = match what {
        What::Level => (
            "what the model leaves over",
            "zero the torque sensor at the temperature of work",
        ),
        What::Friction => (
            "friction",
            "log at the temperature of work, or fit a twin to each",
        ),
    };
    let Warming {
        slope,
        error,
        range: [low, high],
        sd,
    } = warming;
    Finding::new(
        Severity::Warning,
        Code::DriftWithTemperature,
        joint,
        format!(
            "log `{log}`, joint `{joint}`: {subject} goes with the temperature, {slope:+.3} ± {error:.3} per degree from {low:.1} to \
             {high:.1} (residual sd {sd:.3}), or with what else changed in that time; the twin holds the average: {remedy}"
        ),
        0,
    )
    .with([
        ("slope", *slope), ("slope_sd", *error), ("temperature_low", *low),
        ("temperature_high", *high), ("residual_sd", *sd),
    ])
}

/// How the residual goes with the temperature.
#[derive(Debug, Clone, PartialEq)]
struct Warming {
    /// N·m (N) per degree, with its standard error.
    slope: f64,
    error: f64,
    /// Least and largest block mean of the temperature.
    range: [f64; 2],
    /// Of the residual.
    sd: f64,
}

/// Moving rows of one joint: residual, direction of motion, temperature.
struct Rows<'a> {
    residual: &'a [f64],
    velocity: Cow<'a, [f64]>,
    still: &'a [bool],
    /// Empty where it was not logged.
    temperature: &'a [f64],
}

impl<'a> Rows<'a> {
    fn of(observations: &'a Observations, joint: usize, start: usize, residual: &'a [f64]) -> Self {
        let end = start + residual.len();
        Self {
            residual,
            velocity: observations.qd[joint].some(start..end),
            still: &observations.joints[joint].standstill[start..end],
            temperature: (observations.joints[joint].temperature)
                .get(start..end)
                .unwrap_or_default(),
        }
    }

    /// sd of the residual of the moving rows.
    fn sd(&self) -> f64 {
        let moving = self.residual.iter().zip(self.still).filter(|(_, s)| !**s);
        let (sum, count) = moving.fold((0.0, 0.0), |(s, n), (r, _)| (s + r * r, n + 1.0));
        f64::sqrt(sum / count)
    }

    /// The slope over the temperature, if it is beyond chance and what it makes over the run is worth a word.
    ///
    /// Least squares through the means of three times eight blocks of the run, Student's t with 22 degrees of freedom: a residual that
    /// is correlated over less than a block does not fool it.
    fn warming(&self, what: What, alarm: f64) -> Option<Warming> {
        if self.temperature.len() != self.residual.len() {
            return None;
        }
        let count = 3 * BLOCKS;
        let torque = self.blocks(what, 0..self.residual.len(), count)?;
        let cut = |i: usize| i * self.temperature.len() / count;
        let degrees: Vec<f64> = (0..count)
            .map(|block| mean_and_variance(&self.temperature[cut(block)..cut(block + 1)]).0)
            .collect();
        let (mean_torque, _) = mean_and_variance(&torque);
        let (mean_degrees, variance) = mean_and_variance(&degrees);
        let square = variance * (count as f64 - 1.0);
        if square.is_nan() || square <= 0.0 {
            return None;
        }
        let pairs = || torque.iter().zip(&degrees);
        let product: f64 = pairs()
            .map(|(y, x)| (y - mean_torque) * (x - mean_degrees))
            .sum();
        let slope = product / square;
        let left: f64 = pairs()
            .map(|(y, x)| (y - mean_torque - slope * (x - mean_degrees)).powi(2))
            .sum();
        let freedom = count as f64 - 2.0;
        let error = (left / freedom / square).sqrt();
        let t = (slope / error).abs();
        if t.is_nan() {
            return None; // nothing is left at all
        }
        let chance = 2.0 * StudentsT::new(0.0, 1.0, freedom).ok()?.sf(t);
        let fold =
            |start: f64, pick: fn(f64, f64) -> f64| degrees.iter().copied().fold(start, pick);
        let range = [
            fold(f64::INFINITY, f64::min),
            fold(f64::NEG_INFINITY, f64::max),
        ];
        let sd = self.sd();
        let change = (slope * (range[1] - range[0])).abs();
        let told = chance < alarm && change > SHARE * sd && range[1] - range[0] >= DEGREES;
        told.then_some(Warming {
            slope,
            error,
            range,
            sd,
        })
    }

    /// Change from the first to the last third and sd of the residual, if the change is beyond chance and worth a word.
    ///
    /// Welch's t of block means: a residual that is correlated over less than a block does not fool it.
    fn drift(&self, what: What, alarm: f64) -> Option<(f64, f64)> {
        let third = self.residual.len() / 3;
        let first = self.blocks(what, 0..third, BLOCKS)?;
        let last = self.blocks(
            what,
            self.residual.len() - third..self.residual.len(),
            BLOCKS,
        )?;
        let (a, va) = mean_and_variance(&first);
        let (b, vb) = mean_and_variance(&last);
        let (sa, sb) = (va / BLOCKS as f64, vb / BLOCKS as f64);
        if sa + sb <= 0.0 {
            return None;
        }
        let freedom = (sa + sb).powi(2) / ((sa * sa + sb * sb) / (BLOCKS as f64 - 1.0));
        let t = (b - a).abs() / (sa + sb).sqrt();
        let chance = 2.0 * StudentsT::new(0.0, 1.0, freedom).ok()?.sf(t);
        let sd = self.sd();
        (chance < alarm && (b - a).abs() > SHARE * sd).then_some((b - a, sd))
    }

    /// Means of the blocks of a stretch; `None` where one has too few moving rows.
    fn blocks(
        &self,
        what: What,
        stretch: std::ops::Range<usize>,
        count: usize,
    ) -> Option<Vec<f64>> {
        let cut = |i: usize| stretch.start + i * stretch.len() / count;
        (0..count)
            .map(|block| {
                let mut values = Vec::new();
                for row in cut(block)..cut(block + 1) {
                    let moves = !self.still[row];
                    match what {
                        What::Level if moves => values.push(self.residual[row]),
                        What::Friction if moves && self.velocity[row] != 0.0 => {
                            values.push(self.residual[row] * self.velocity[row].signum());
                        }
                        _ => {}
                    }
                }
                let count = values.len();
                (count >= FEWEST).then(|| values.iter().sum::<f64>() / count as f64)
            })
            .collect()
    }
}

fn mean_and_variance(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square: f64 = values.iter().map(|x| (x - mean) * (x - mean)).sum();
    (mean, square / (count - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// AR(1) residual (ρ = .8, sd 1) on a motion with a period of 40 rows, 2400 rows.
    fn run(random: &mut Random) -> (Vec<f64>, Vec<f64>, Vec<bool>) {
        let mut state = random.normal();
        let residual = (0..2400).map(|_| {
            state = 0.8 * state + 0.6 * random.normal();
            state
        });
        let residual = residual.collect();
        let velocity = (0..2400).map(|i| (f64::from(i) * 0.157).cos()).collect();
        (residual, velocity, vec![false; 2400])
    }

    fn drift(data: &(Vec<f64>, Vec<f64>, Vec<bool>), what: What) -> Option<(f64, f64)> {
        let rows = Rows {
            residual: &data.0,
            velocity: Cow::Borrowed(&data.1),
            still: &data.2,
            temperature: &[],
        };
        rows.drift(what, 1e-4)
    }

    fn warming(
        data: &(Vec<f64>, Vec<f64>, Vec<bool>),
        temperature: &[f64],
        what: What,
    ) -> Option<Warming> {
        let rows = Rows {
            residual: &data.0,
            velocity: Cow::Borrowed(&data.1),
            still: &data.2,
            temperature,
        };
        rows.warming(what, 1e-4)
    }

    /// A drive that warms up as 1 − exp(−t/τ) by 15 degrees and loses 0.1 N·m of friction per degree. The estimate lies within 4.5 of its own standard
    /// errors of the truth (a false alarm in 1e-4 fits, 22 degrees of freedom); the seed is fixed.
    #[test]
    fn friction_that_falls_with_temperature_is_told_by_its_slope() {
        let mut random = Random::new(7, 0);
        let temperature: Vec<f64> = (0..2400)
            .map(|i| 25.0 + 15.0 * (1.0 - (-f64::from(i) / 800.0).exp()))
            .collect();
        let mut data = run(&mut random);
        assert_eq!(warming(&data, &temperature, What::Friction), None);
        let change = |i: usize| -0.1 * (temperature[i] - 35.0);
        (0..2400).for_each(|i| data.0[i] += change(i) * data.1[i].signum());
        let found = warming(&data, &temperature, What::Friction).unwrap();
        assert!(
            (found.slope + 0.1).abs() < 4.5 * found.error && found.error < 0.03,
            "{found:?}"
        );
        assert!((found.range[0] - 25.0).abs() < 1.5 && (found.range[1] - 39.3).abs() < 0.5);
        assert_eq!(warming(&data, &temperature, What::Level), None);
        // Neither without a temperature nor with one that stays as it is.
        assert_eq!(warming(&data, &[], What::Friction), None);
        assert_eq!(warming(&data, &[30.0; 2400], What::Friction), None);
        let hardly: Vec<f64> = temperature.iter().map(|t| 30.0 + 0.01 * t).collect();
        assert_eq!(warming(&data, &hardly, What::Friction), None);
        data.0.fill(0.0);
        assert_eq!(warming(&data, &temperature, What::Friction), None);
    }

    #[test]
    fn a_drifting_offset_and_drifting_friction_are_told_apart() {
        let mut random = Random::new(3, 0);
        let calm = run(&mut random);
        assert_eq!(drift(&calm, What::Level), None);
        assert_eq!(drift(&calm, What::Friction), None);
        let ramp = |i: usize| 3.0 * (i as f64 / 2400.0 - 0.5);
        let mut offset = calm.clone();
        (0..2400).for_each(|i| offset.0[i] += ramp(i));
        // The first third of a ramp of 3 has mean -1, the last +1.
        let (change, _) = drift(&offset, What::Level).unwrap();
        assert!((change - 2.0).abs() < 0.4, "{change}");
        assert_eq!(drift(&offset, What::Friction), None);
        let mut friction = calm.clone();
        (0..2400).for_each(|i| friction.0[i] += ramp(i) * friction.1[i].signum());
        let (change, _) = drift(&friction, What::Friction).unwrap();
        assert!((change - 2.0).abs() < 0.4, "{change}");
        assert_eq!(drift(&friction, What::Level), None);
    }

    /// 400 runs without drift at 1e-4 each: two alarms or more have probability 8e-4; the seed is fixed.
    #[test]
    fn a_correlated_residual_is_no_drift() {
        let mut random = Random::new(4, 0);
        let alarms = (0..400).filter(|_| drift(&run(&mut random), What::Level).is_some());
        assert!(alarms.count() <= 1);
    }

    #[test]
    fn a_short_run_is_not_judged() {
        let data = (vec![1.0; 60], vec![1.0; 60], vec![false; 60]);
        assert_eq!(drift(&data, What::Level), None);
    }
}
