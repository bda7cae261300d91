//! Gear ripple that nobody asked for: residual torque that repeats many times per turn of its joint, whatever the speed.
//!
//! ```text
//! r_t ≈ a sin(N q_t) + b cos(N q_t),      gain = −½ n_eff ln(1 − R²)   nats
//! ```
//! N is looked for among all orders that the motion tells apart. Without ripple 2 · gain of one order is χ² with two degrees of
//! freedom, so that a gain of g nats comes by chance with probability e^−g at each.

use crate::error::{Finding, Severity};
use crate::observations::Part;
use crate::plug_in::{Fit, residual_correlation_time};
use crate::robot::{JointKind, Robot};
use crate::signal::Pipeline;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Orders (radians of ripple per radian): below, it may be anything that a model lacks; above are no gears of arms.
const ORDERS: [f64; 2] = [8.0, 400.0];
/// Gain from which an order is told, nats. With 10 joints of 4000 orders: less than one false alarm in a million fits, one in ten if the
/// effective rows were half as many.
const GAIN: f64 = 25.0;
/// Share of the residual's variance from which it is worth a word.
const SHARE: f64 = 0.1;
/// Periods that the motion of the rows must go through.
const PERIODS: f64 = 3.0;
/// Rows that are looked at, evenly spread.
const ROWS: usize = 2048;
/// Fewest of them at an order.
const FEWEST: usize = 30;

/// A moving row.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Row {
    position: f64,
    speed: f64,
    residual: f64,
}

/// What repeats.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ripple {
    /// Radians (or 1/m) of it per radian (metre) of the joint.
    order: f64,
    amplitude: f64,
    /// R².
    share: f64,
    gain: f64,
}

/// One finding per joint whose residual shows a ripple that is no candidate.
pub(super) fn findings(
    robot: &Robot,
    training: &[Part<'_>],
    fit: &Fit,
    asked: &[String],
    pipeline: &Pipeline,
) -> Vec<Finding> {
    let names = robot.joint_names();
    let cutoff_hz = if pipeline.is_off() {
        f64::INFINITY
    } else {
        pipeline.cutoff_hz
    };
    let found: Vec<Option<Finding>> = (names.par_iter().enumerate())
        .map(|(joint, name)| {
            if asked.iter().any(|own| own == name) {
                return None;
            }
            let (rows, step) = rows(training, joint, &fit.posterior.mean);
            let memory = residual_correlation_time(training, joint, &fit.posterior.mean);
            let ripple = strongest(rows, f64::max(1.0, memory / step as f64), cutoff_hz)?;
            Some(finding(name, robot.joint_kind(joint), &ripple))
        })
        .collect();
    found.into_iter().flatten().collect()
}

fn finding(joint: &str, kind: JointKind, ripple: &Ripple) -> Finding {
    let (periods, per, unit) = match kind {
        JointKind::Prismatic => (ripple.order / TAU, "metre", "N"),
        _ => (ripple.order, "turn", "N·m"),
    };
    Finding::new(
        Severity::Warning,
        "ripple_seen",
        joint,
        format!(
            "joint `{joint}`: what the model leaves over repeats {periods:.1} times per {per}, {:.3} {unit} at its height, {:.0} % of its \
             variance: gear ripple; [library] ripple = {{ {joint:?} = {periods:.1} }} makes it a candidate",
            ripple.amplitude,
            100.0 * ripple.share
        ),
        0,
    )
}

/// Every `step`-th moving row of a joint, at most [`ROWS`]; and that step.
fn rows(training: &[Part<'_>], joint: usize, beta: &[f64]) -> (Vec<Row>, usize) {
    let mut rows = Vec::new();
    for part in training {
        let residual = part.residual(joint, beta, part.rows.clone());
        let standstill = &part.observations.joints[joint].standstill[part.rows.clone()];
        let position = part.observations.q[joint].some(part.rows.clone());
        let velocity = part.observations.qd[joint].some(part.rows.clone());
        for (row, still) in standstill.iter().enumerate() {
            if !still {
                rows.push(Row {
                    position: position[row],
                    speed: velocity[row].abs(),
                    residual: residual[row],
                });
            }
        }
    }
    let step = rows.len().div_ceil(ROWS).max(1);
    (rows.into_iter().step_by(step).collect(), step)
}

/// The order that gains most, if it gains enough; `memory` rows count as one. A row has a part where the filter keeps the ripple,
/// below `cutoff_hz`.
fn strongest(mut rows: Vec<Row>, memory: f64, cutoff_hz: f64) -> Option<Ripple> {
    rows.sort_by(|a, b| a.speed.total_cmp(&b.speed));
    let mut waves = Waves::new(&rows)?;
    let mut best: Option<Ripple> = None;
    let kept = |order: f64| rows.partition_point(|row| order * row.speed < TAU * cutoff_hz);
    while waves.order < ORDERS[1] {
        let count = kept(waves.order);
        if count < FEWEST {
            break;
        }
        if let Some(ripple) = waves.ripple(&rows[..count], memory)
            && best.is_none_or(|best| ripple.gain > best.gain)
        {
            best = Some(ripple);
        }
        waves.next();
    }
    best.filter(|ripple| ripple.gain > GAIN && ripple.share > SHARE)
}

/// sin(N q) and cos(N q) of all rows for one N after the other, each turned from the one before.
struct Waves {
    order: f64,
    step: f64,
    /// Range of positions.
    range: f64,
    now: Vec<[f64; 2]>,
    turn: Vec<[f64; 2]>,
}

impl Waves {
    /// From the lowest order on; steps are small enough that the phase between the ends of the motion changes by less than a radian.
    fn new(rows: &[Row]) -> Option<Self> {
        let ends = rows
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |e, row| {
                [e[0].min(row.position), e[1].max(row.position)]
            });
        let (middle, range) = (0.5 * (ends[0] + ends[1]), ends[1] - ends[0]);
        if !(range.is_finite() && range > 0.0) {
            return None;
        }
        let step = f64::min(0.25, 1.0 / range);
        let wave = |order: f64| {
            move |row: &Row| {
                let (sin, cos) = (order * (row.position - middle)).sin_cos();
                [sin, cos]
            }
        };
        Some(Self {
            order: ORDERS[0],
            step,
            range,
            now: rows.iter().map(wave(ORDERS[0])).collect(),
            turn: rows.iter().map(wave(step)).collect(),
        })
    }

    fn next(&mut self) {
        self.order += self.step;
        for ([sin, cos], [s, c]) in self.now.iter_mut().zip(&self.turn) {
            (*sin, *cos) = (*sin * c + *cos * s, *cos * c - *sin * s);
        }
    }

    /// Least squares on the first rows.
    fn ripple(&self, rows: &[Row], memory: f64) -> Option<Ripple> {
        if self.order * self.range < PERIODS * TAU {
            return None;
        }
        let (mut ss, mut sc, mut cc, mut sr, mut cr, mut rr) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for (row, [s, c]) in rows.iter().zip(&self.now) {
            let r = row.residual;
            ss += s * s;
            sc += s * c;
            cc += c * c;
            sr += s * r;
            cr += c * r;
            rr += r * r;
        }
        let determinant = ss * cc - sc * sc;
        if rr <= 0.0 || determinant < 0.01 * ss * cc {
            return None;
        }
        let a = (cc * sr - sc * cr) / determinant;
        let b = (ss * cr - sc * sr) / determinant;
        let share = ((a * sr + b * cr) / rr).clamp(0.0, 1.0);
        let effective = rows.len() as f64 / memory;
        Some(Ripple {
            order: self.order,
            amplitude: a.hypot(b),
            share,
            gain: -0.5 * effective * (1.0 - share).max(f64::MIN_POSITIVE).ln(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::posterior::random::Random;

    /// 60 s at 100 rows per second, back and forth over 4 rad at changing speed, with noise of 1 whose neighbours have correlation ρ.
    fn moved(rho: f64, seed: u64, ripple: impl Fn(f64) -> f64) -> Vec<Row> {
        let mut random = Random::new(seed, 0);
        let mut noise = 0.0;
        let row = |t: f64, noise: f64| {
            let [a, b] = [0.7 * t, 0.31 * t];
            let position = 1.5 * a.sin() + 0.7 * b.sin();
            let velocity = 1.5 * 0.7 * a.cos() + 0.7 * 0.31 * b.cos();
            Row {
                position,
                speed: velocity.abs(),
                residual: ripple(position) + noise,
            }
        };
        (0..6000)
            .map(|i| {
                noise = rho * noise + (1.0 - rho * rho).sqrt() * random.normal();
                row(0.01 * f64::from(i), noise)
            })
            .collect()
    }

    #[test]
    fn a_ripple_is_told_with_its_order_and_height() {
        for (order, phase) in [(12.0_f64, 0.3), (30.7, 1.0), (101.0, 2.0), (320.0, 4.0)] {
            let rows = moved(0.0, 5, |q| 0.7 * (order * q + phase).sin());
            let found = strongest(rows, 1.0, f64::INFINITY).expect("a ripple");
            assert!((found.order - order).abs() < 0.25, "{order}: {found:?}");
            assert!((found.amplitude - 0.7).abs() < 0.07, "{order}: {found:?}");
            assert!((found.share - 0.245 / 1.245).abs() < 0.05, "{found:?}");
        }
        // What the filter takes away is not looked for: 320 periods per radian at 0.1 rad/s are 5 Hz.
        let rows = moved(0.0, 5, |q| 0.7 * (320.0 * q).sin());
        assert_eq!(strongest(rows, 1.0, 0.2), None);
    }

    /// Smooth errors of a model are no ripple, and noise is none in 200 logs, with memory as without.
    #[test]
    fn noise_and_smooth_errors_have_none() {
        for smooth in [2.0, 5.0] {
            let rows = moved(0.0, 9, |q: f64| 3.0 * (smooth * q).sin());
            assert_eq!(strongest(rows, 1.0, f64::INFINITY), None, "{smooth}");
        }
        for seed in 0..100 {
            for rho in [0.0, 0.9] {
                let memory = (1.0 + rho) / (1.0 - rho);
                let rows = moved(rho, 100 + seed, |_| 0.0);
                let found = strongest(rows, memory, f64::INFINITY);
                assert_eq!(found, None, "seed {seed}, correlation {rho}");
            }
        }
        assert_eq!(strongest(Vec::new(), 1.0, 5.0), None);
        let still = [Row {
            position: 1.0,
            speed: 0.0,
            residual: 1.0,
        }; 50];
        assert_eq!(strongest(still.to_vec(), 1.0, 5.0), None);
    }

    #[test]
    fn a_finding_gives_the_line_to_add() {
        let ripple = Ripple {
            order: 30.72,
            amplitude: 0.48,
            share: 0.703,
            gain: 110.0,
        };
        let said = finding("joint_4", JointKind::Revolute, &ripple).message;
        assert!(
            said.contains("repeats 30.7 times per turn, 0.480 N·m"),
            "{said}"
        );
        assert!(
            said.contains("[library] ripple = { \"joint_4\" = 30.7 }"),
            "{said}"
        );
        let slider = Ripple {
            order: 200.0 * TAU,
            ..ripple
        };
        let said = finding("rail", JointKind::Prismatic, &slider).message;
        assert!(
            said.contains("200.0 times per metre") && said.contains(" N at"),
            "{said}"
        );
    }
}
