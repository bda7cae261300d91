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
use crate::term::LibrarySettings;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Periods per turn, or per metre of a slider: below, it may be anything that a model lacks; above are no gears of arms.
const PERIODS: [f64; 2] = [8.0, 400.0];
/// Gain from which an order is told, nats. With 10 joints of 4000 orders: less than one false alarm in a million fits, one in ten if the
/// effective rows were half as many.
const GAIN: f64 = 25.0;
/// Share of the residual's variance from which it is worth a word.
const SHARE: f64 = 0.1;
/// Periods that the motion of the rows must go through.
const SEEN: f64 = 3.0;
/// Rows that are looked at, evenly spread.
const ROWS: usize = 2048;
/// Orders that are looked at: of a joint that turns round and round, so many as its motion tells apart within a turn and a half.
const ORDERS: f64 = 4096.0;
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
    /// Radians of it per radian (metre) of the joint.
    order: f64,
    amplitude: f64,
    /// R².
    share: f64,
    gain: f64,
}

/// A ripple of a joint that is no candidate.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Seen {
    pub(super) joint: String,
    /// Per turn (per metre of a slider), to what the motion tells apart.
    pub(super) periods: f64,
    kind: JointKind,
    ripple: Ripple,
}

/// What the residuals of a fit show.
pub(super) fn seen(
    robot: &Robot,
    training: &[Part<'_>],
    fit: &Fit,
    library: &LibrarySettings,
    pipeline: &Pipeline,
) -> Vec<Seen> {
    let cutoff_hz = if pipeline.is_off() {
        f64::INFINITY
    } else {
        pipeline.cutoff_hz
    };
    let names = robot.joint_names();
    let found: Vec<Option<Seen>> = (names.par_iter().enumerate())
        .map(|(joint, name)| {
            if library.ripple.contains_key(*name) {
                return None;
            }
            let (rows, step) = rows(training, joint, &fit.posterior.mean);
            let memory = residual_correlation_time(training, joint, &fit.posterior.mean);
            let memory = f64::max(1.0, memory / step as f64);
            let kind = robot.joint_kind(joint);
            let (ripple, told_apart) = strongest(rows, per(kind), memory, cutoff_hz)?;
            Some(Seen::new(name, kind, ripple, told_apart))
        })
        .collect();
    found.into_iter().flatten().collect()
}

impl Seen {
    /// `told_apart`: difference of orders that the motion can tell.
    fn new(joint: &str, kind: JointKind, ripple: Ripple, told_apart: f64) -> Self {
        // Digits below a tenth of what can be told mean nothing.
        let per = per(kind);
        let digits = (-(0.1 * told_apart / per).log10()).ceil().clamp(0.0, 6.0);
        let scale = 10_f64.powi(digits as i32);
        Self {
            joint: joint.to_owned(),
            periods: (ripple.order / per * scale).round() / scale,
            kind,
            ripple,
        }
    }

    /// Where other families than the usual ones were asked for: the line that asks for this one.
    pub(super) fn told(&self) -> Finding {
        let remedy = "makes it a candidate";
        self.finding(Severity::Warning, "ripple_seen", "gear ripple; ", remedy)
    }

    /// Where it became a candidate.
    pub(super) fn added(&self) -> Finding {
        let what = "gear ripple, which is a candidate now; ";
        let remedy = "states it, another number or family chooses otherwise";
        self.finding(Severity::Note, "ripple_added", what, remedy)
    }

    fn finding(&self, severity: Severity, code: &'static str, what: &str, remedy: &str) -> Finding {
        let Self {
            joint,
            periods,
            kind,
            ripple,
        } = self;
        let (per, unit) = match kind {
            JointKind::Prismatic => ("metre", "N"),
            _ => ("turn", "N·m"),
        };
        Finding::new(
            severity,
            code,
            joint.clone(),
            format!(
                "joint `{joint}`: what the model leaves over repeats {periods} times per {per}, {:.3} {unit} at its height, {:.0} % of its \
                 variance, {:.0} nats: {what}[library] ripple = {{ {joint:?} = {periods} }} {remedy}",
                ripple.amplitude,
                100.0 * ripple.share,
                ripple.gain,
            ),
            0,
        )
    }
}

/// Order of one period per turn, or per metre.
fn per(kind: JointKind) -> f64 {
    if kind == JointKind::Prismatic {
        TAU
    } else {
        1.0
    }
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

/// The order that gains most, if it gains enough, and what orders the motion tells apart; `per`: the order of one period per turn or metre,
/// `memory` rows count as one. A row has a part where the filter keeps the ripple, below `cutoff_hz`.
fn strongest(mut rows: Vec<Row>, per: f64, memory: f64, cutoff_hz: f64) -> Option<(Ripple, f64)> {
    let [first, last] = PERIODS.map(|periods| periods * per);
    let widest = ORDERS / (last - first);
    rows.sort_by(|a, b| a.position.total_cmp(&b.position));
    let median = rows.get(rows.len() / 2)?.position;
    rows.retain(|row| (row.position - median).abs() <= 0.5 * widest);
    let ends = [rows.first()?.position, rows.last()?.position];
    let (middle, range) = (0.5 * (ends[0] + ends[1]), ends[1] - ends[0]);
    if !(range.is_finite() && range > 0.0) {
        return None;
    }
    rows.sort_by(|a, b| a.speed.total_cmp(&b.speed));
    rows.iter_mut().for_each(|row| row.position -= middle);
    // The phase between the ends of the motion changes by less than a radian from one order to the next.
    let step = 1.0 / range;
    let lowest = f64::max(first, SEEN * TAU / range);
    if lowest > last {
        return None;
    }
    let steps = ((last - lowest) / step) as usize;
    let better = |best: Ripple, other: Ripple| {
        if other.gain > best.gain { other } else { best }
    };
    let (mut now, turn) = (waves(&rows, lowest), waves(&rows, step));
    let orders = (0..=steps).map(|i| lowest + i as f64 * step);
    let all = orders.filter_map(|order| {
        let found = ripple(&rows, &now, order, memory, cutoff_hz);
        for ([sin, cos], [s, c]) in now.iter_mut().zip(&turn) {
            (*sin, *cos) = (*sin * c + *cos * s, *cos * c - *sin * s);
        }
        found
    });
    let best = all.reduce(better)?;
    if best.gain <= GAIN || best.share <= SHARE {
        return None;
    }
    let near = (-10..=10).map(|i| best.order + 0.1 * f64::from(i) * step);
    let near =
        near.filter_map(|order| ripple(&rows, &waves(&rows, order), order, memory, cutoff_hz));
    let finest = near.fold(best, better);
    Some((finest, step))
}

/// sin(N q) and cos(N q) of every row.
fn waves(rows: &[Row], order: f64) -> Vec<[f64; 2]> {
    let wave = |row: &Row| {
        let (sin, cos) = (order * row.position).sin_cos();
        [sin, cos]
    };
    rows.iter().map(wave).collect()
}

/// Least squares of one order on the rows that are slow enough for it; rows ascend in speed.
fn ripple(
    rows: &[Row],
    waves: &[[f64; 2]],
    order: f64,
    memory: f64,
    cutoff_hz: f64,
) -> Option<Ripple> {
    let count = rows.partition_point(|row| order * row.speed < TAU * cutoff_hz);
    if count < FEWEST {
        return None;
    }
    let (mut ss, mut sc, mut cc, mut sr, mut cr, mut rr) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (row, [s, c]) in rows[..count].iter().zip(waves) {
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
    Some(Ripple {
        order,
        amplitude: a.hypot(b),
        share,
        gain: -0.5 * (count as f64 / memory) * (1.0 - share).max(f64::MIN_POSITIVE).ln(),
    })
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
            let (found, told_apart) = strongest(rows, 1.0, 1.0, f64::INFINITY).expect("a ripple");
            assert!((told_apart - 1.0 / 4.4).abs() < 0.02, "{told_apart}");
            assert!((found.order - order).abs() < 0.05, "{order}: {found:?}");
            assert!((found.amplitude - 0.7).abs() < 0.07, "{order}: {found:?}");
            assert!((found.share - 0.245 / 1.245).abs() < 0.05, "{found:?}");
        }
        // A joint that turned round 35 times, and a slider.
        for (stretch, per) in [(50.0, 1.0), (0.2, TAU)] {
            let order = 30.7 * per;
            let mut rows = moved(0.0, 5, |_| 0.0);
            for row in &mut rows {
                row.position *= stretch;
                row.residual += 2.0 * (order * row.position).sin();
            }
            let found = strongest(rows, per, 1.0, f64::INFINITY);
            let order = found.expect("a ripple").0.order / per;
            assert!((order - 30.7).abs() < 0.05, "{stretch}: {order}");
        }
        // What the filter takes away is not looked for: 320 periods per radian at 0.1 rad/s are 5 Hz.
        let rows = moved(0.0, 5, |q| 0.7 * (320.0 * q).sin());
        assert_eq!(strongest(rows, 1.0, 1.0, 0.2), None);
    }

    /// Smooth errors of a model are no ripple, and noise is none in 200 logs, with memory as without.
    #[test]
    fn noise_and_smooth_errors_have_none() {
        for smooth in [2.0, 5.0] {
            let rows = moved(0.0, 9, |q: f64| 3.0 * (smooth * q).sin());
            assert_eq!(strongest(rows, 1.0, 1.0, f64::INFINITY), None, "{smooth}");
        }
        for seed in 0..100 {
            for rho in [0.0, 0.9] {
                let memory = (1.0 + rho) / (1.0 - rho);
                let rows = moved(rho, 100 + seed, |_| 0.0);
                let found = strongest(rows, 1.0, memory, f64::INFINITY);
                assert_eq!(found, None, "seed {seed}, correlation {rho}");
            }
        }
        assert_eq!(strongest(Vec::new(), 1.0, 1.0, 5.0), None);
        let still = [Row {
            position: 1.0,
            speed: 0.0,
            residual: 1.0,
        }; 50];
        assert_eq!(strongest(still.to_vec(), 1.0, 1.0, 5.0), None);
    }

    #[test]
    fn a_finding_gives_the_line_to_add() {
        let ripple = Ripple {
            order: 30.7234,
            amplitude: 0.48,
            share: 0.703,
            gain: 110.0,
        };
        let seen = Seen::new("joint_4", JointKind::Revolute, ripple, 0.25);
        assert_eq!(seen.periods, 30.72);
        let (told, added) = (seen.told(), seen.added());
        for said in [&told.message, &added.message] {
            assert!(
                said.contains("repeats 30.72 times per turn, 0.480 N·m"),
                "{said}"
            );
            assert!(
                said.contains("[library] ripple = { \"joint_4\" = 30.72 }"),
                "{said}"
            );
        }
        assert_eq!((&*told.code, &*added.code), ("ripple_seen", "ripple_added"));
        let slider = Ripple {
            order: 200.04 * TAU,
            ..ripple
        };
        let seen = Seen::new("rail", JointKind::Prismatic, slider, 1.0 / 0.5);
        let said = seen.told().message;
        assert!(said.contains("repeats 200.04 times per metre"), "{said}");
        assert!(said.contains(" N at its height"), "{said}");
    }
}
