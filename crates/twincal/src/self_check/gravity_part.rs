//! Torque that lacks a part of the model's: measured minus model, or with gravity compensated; and parts that are all a common factor too large.
//!
//! Gravity and inertia of the nominal model get one factor each for all joints, c_g and c_i, with an unknown payload and the friction of each
//! joint beside them. Of a good log both are 1 ± 0.1 in simulated logs of a UR5 and a Panda with 1.5 kg that the model lacks, and within 0.7 and
//! 1.5 where every link's mass is 30 % wrong besides.

use super::columns::is_constant;
use super::parts::{DRIVEN, Torques, driven, payload};
use super::sample::Sample;
use super::shared::{self, CLEARLY, Estimate};
use crate::error::{Code, Finding, Severity};
use crate::robot::Robot;
use crate::words::significant;

/// Factor below which a part of the model's torque is missing, and above which it is there.
const MISSING: f64 = 0.5;
/// The same where a payload cannot be told from the model's own links.
const MISSING_WITHOUT_PAYLOAD: f64 = 0.3;
/// Joints on which friction must show.
const RULED: usize = 2;
/// Fewest driven joints: the drives of a pendulum may well hold it by friction alone.
const JOINTS: usize = 4;
/// ln of a factor on all torque beyond which it is no mistake in the masses: with every link 30 % wrong it is 0.7 to 1.45, on a real UR10 0.75.
const NO_MASSES: f64 = 0.405; // ln 1.5
/// ln by which the factors of gravity and inertia may differ and be one factor: 10 %.
const ALIKE: f64 = 0.095;
/// ln of c_i over c_g from which inertia and gravity do not belong to the same masses.
const OTHER_CLOCK: f64 = 0.26; // ln 1.3

/// Factors of the nominal gravity and inertia on all joints.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Factors {
    pub(super) gravity: Option<Estimate>,
    pub(super) inertia: Option<Estimate>,
    covariance: f64,
    /// Factor of gravity on each joint that it could rule.
    alone: Vec<f64>,
    /// Friction shows on two joints or more: an unknown payload hides it on those that carry it.
    with_friction: bool,
    /// Driven joints.
    joints: usize,
    /// Whether an unknown payload was told from the links.
    with_payload: bool,
}

/// What the two factors say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Part {
    /// No gravity in the torque, and no inertia where it can be told.
    NoModel,
    /// No gravity in the torque, inertia is there.
    NoGravity,
}

impl Factors {
    /// Fits them on a sample. `gravity` is that of the robot's own model at this sample's motion.
    pub(super) fn of(robot: &Robot, sample: &Sample, parts: &super::parts::Parts) -> Option<Self> {
        let gravity = parts.gravity(robot.description().gravity);
        let driven: Vec<bool> = (driven(sample, parts, &gravity, DRIVEN)
            .into_iter()
            .enumerate())
        .map(|(joint, size)| size.is_some() && !is_constant(sample, joint))
        .collect();
        let carried = payload(robot, sample);
        let nominal: [&Torques; 2] = [&gravity, &parts.inertia];
        let with: Vec<&Torques> = nominal
            .into_iter()
            .chain(carried.iter().flatten())
            .collect();
        let told = shared::fit(sample, &with, &parts.springs, &driven);
        let told = told.filter(|shared| shared.estimates[0].is_some());
        let with_payload = told.is_some();
        let shared = match told {
            Some(shared) => shared,
            None => shared::fit(sample, &nominal, &parts.springs, &driven)?,
        };
        Some(Self {
            gravity: shared.estimates[0],
            inertia: shared.estimates[1],
            covariance: shared.covariance,
            alone: shared.alone,
            with_friction: shared.with_friction[0] >= RULED,
            joints: shared.with_friction[1],
            with_payload,
        })
    }

    /// The part of the model's torque that the log lacks.
    pub(super) fn missing(&self) -> Option<Part> {
        let limit = match self.with_payload {
            true => MISSING,
            false => MISSING_WITHOUT_PAYLOAD,
        };
        let gravity = self.gravity?;
        let enough = self.joints >= JOINTS && !self.alone.is_empty();
        let on_all = self.alone.iter().all(|factor| factor.abs() < MISSING);
        if !(enough && on_all && gravity.is_below(limit) && gravity.is_above(-limit)) {
            return None;
        }
        match self.inertia {
            Some(inertia) if inertia.is_above(MISSING) => Some(Part::NoGravity),
            // Torque without friction either is no torque of this robot at all.
            _ => self.with_friction.then_some(Part::NoModel),
        }
    }

    /// A factor on all torque, clearly not 1.
    fn common(&self) -> Option<Estimate> {
        let (gravity, inertia) = (self.gravity?, self.inertia?);
        let in_ln = |e: Estimate| {
            (e.value > 0.0).then(|| Estimate {
                value: e.value.ln(),
                error: e.error / e.value,
            })
        };
        let (g, i) = (in_ln(gravity)?, in_ln(inertia)?);
        let apart = Estimate {
            value: (g.value - i.value).abs(),
            error: g.error.hypot(i.error),
        };
        let alike = !apart.is_above(ALIKE);
        let clear = g.value.abs() - CLEARLY * g.error > NO_MASSES && i.value * g.value > 0.0;
        (self.with_payload && alike && clear).then_some(gravity)
    }

    /// c_i over c_g where that is clearly another than 1.
    fn other_clock(&self) -> Option<Estimate> {
        let (gravity, inertia) = (self.gravity?, self.inertia?);
        if !(self.with_payload && gravity.is_above(MISSING) && inertia.value > 0.0) {
            return None;
        }
        let ratio = inertia.value / gravity.value;
        let [g, i] = [gravity, inertia].map(|e| e.error / e.value);
        let cross = self.covariance / (gravity.value * inertia.value);
        let error = (g * g + i * i - 2.0 * cross).max(0.0).sqrt();
        let clear = ratio.ln().abs() - CLEARLY * error > OTHER_CLOCK;
        clear.then_some(Estimate {
            value: ratio,
            error: ratio * error,
        })
    }
}

/// A finding on a log that lacks a part of the torque.
pub(super) fn missing_finding(log: &str, part: Part, factors: &Factors) -> Finding {
    let factor = |e: Option<Estimate>| e.map_or("unknown".to_owned(), shown);
    let (gravity, inertia) = (factor(factors.gravity), factor(factors.inertia));
    let number = |e: Option<Estimate>| e.map_or([f64::NAN; 2], |e| [e.value, e.error]);
    let (of_gravity, of_inertia) = (number(factors.gravity), number(factors.inertia));
    let (code, looks_like) = match part {
        Part::NoModel => (
            Code::ModelTorque,
            "measured minus model torque, or an estimate of external torque",
        ),
        Part::NoGravity => (
            Code::GravityCompensated,
            "torque with gravity compensated, as some controllers publish it",
        ),
    };
    Finding::new(
        Severity::Degraded,
        code,
        log,
        format!(
            "log `{log}`: the torque of all joints holds {gravity} of the model's gravity and {inertia} of its inertial torque: looks like \
             {looks_like}; masses fitted to it are wrong: log the measured torque of the drives, or add what was taken off"
        ),
        0,
    )
    .with([
        ("gravity_factor", of_gravity[0]), ("gravity_factor_sd", of_gravity[1]),
        ("inertia_factor", of_inertia[0]), ("inertia_factor_sd", of_inertia[1]),
    ])
}

/// Findings on factors that all joints have in common; none where a part of the torque is missing.
pub(super) fn factor_findings(factors: &Factors) -> Vec<Finding> {
    if factors.missing().is_some() {
        return Vec::new();
    }
    if let Some(ratio) = factors.other_clock() {
        let message = format!(
            "inertial torque is {} times the model's on all joints where gravity is 1: looks like a clock whose time is {} times too \
             {}, or motion in another unit; check the stamps, or give the rate: --rate HZ",
            shown(ratio),
            significant(ratio.value.max(1.0 / ratio.value).sqrt(), 3),
            if ratio.value > 1.0 { "long" } else { "short" }
        );
        return vec![
            Finding::new(Severity::Degraded, Code::ClockScale, "", message, 0).with([
                ("inertia_factor", ratio.value),
                ("inertia_factor_sd", ratio.error),
                ("time_factor", ratio.value.sqrt()),
            ]),
        ];
    }
    let Some(factor) = factors.common() else {
        return Vec::new();
    };
    let message = format!(
        "torque is {} times the model's on all joints, gravity and inertia alike: looks like another unit or gain of the torque columns, or another \
         robot: check the drive constants, or give [columns.factor] tau = {}",
        shown(factor),
        significant(1.0 / factor.value, 3)
    );
    vec![
        Finding::new(Severity::Degraded, Code::TorqueScale, "", message, 0)
            .with([("factor", factor.value), ("factor_sd", factor.error)]),
    ]
}

fn shown(estimate: Estimate) -> String {
    format!("{:.2} ± {:.2}", estimate.value, estimate.error)
}
