//! Calibrations made up for the tests of the report: realistic in shape, closed-form signals, own noise generator.

mod effects;
mod held_out;

use effects::{compact, components, draws, terms};
use held_out::{trace, validation};

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use twincal::calibrate::{
    Along, Calibration, Curve, Draws, LikelihoodUsed, LogSummary, PriorUsed, TermSummary,
};
use twincal::likelihood::{JointNoise, NoiseModel, PayloadSize};
use twincal::posterior::{Method, Model, Posterior, Problem};
use twincal::prior::{Inclusion, Prior};
use twincal::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Robot, RobotDescription,
};
use twincal::signal::Pipeline;
use twincal::term::{Family, LibrarySettings, Status};
use twincal::twin::Twin;
use twincal::validate::Trace;
use twincal::{Code, Finding, Severity};

/// Rate of the kept rows, Hz.
const RATE: f64 = 25.0;

/// A planar arm with two joints, 20 candidates, three logs of a minute.
pub(crate) fn two_joints() -> Calibration {
    arm(&["shoulder", "elbow"], 3, 1500)
}

/// Eight held-out traces per joint, each of two minutes: what the limit on the page's size is about.
pub(crate) fn many_logs() -> Calibration {
    arm(&["shoulder", "elbow"], 8, 3000)
}

/// An arm with seven joints and a slider under it.
pub(crate) fn seven_joints() -> Calibration {
    let names = [
        "rail",
        "shoulder_pan",
        "shoulder_lift",
        "elbow",
        "wrist_1",
        "wrist_2",
        "wrist_3",
    ];
    arm(&names, 2, 800)
}

/// Seven joints with more long held-out logs than the page draws: its largest size.
pub(crate) fn many_joints_and_logs() -> Calibration {
    let names = ["j1", "j2", "j3", "j4", "j5", "j6", "j7"];
    arm(&names, 4, 2000)
}

/// Sampled instead of enumerated, with chains that have not converged.
pub(crate) fn gibbs() -> Calibration {
    let mut calibration = two_joints();
    calibration.twin.posterior.method = Method::Gibbs {
        chains: 4,
        draws: 5000,
        r_hat: 1.034,
        ess: 212.4,
    };
    calibration.twin.posterior.log_evidence = None;
    calibration.twin.posterior.inclusion_mcse.fill(0.011);
    for term in calibration.terms.iter_mut().filter(|t| t.pip.is_some()) {
        term.pip_mcse = Some(0.011);
    }
    calibration.terms[0].pip = Some(0.52);
    calibration
}

/// A log that the nominal model explains.
pub(crate) fn nothing_found() -> Calibration {
    let mut calibration = two_joints();
    for term in calibration.terms.iter_mut().filter(|t| t.pip.is_some()) {
        term.pip = Some(0.01);
        term.pip_sensitivity = vec![0.03, 0.01, 0.0, 0.01, 0.02];
    }
    calibration.draws = Draws::default();
    let scores = &mut calibration.validation.filtered;
    scores.rmse_calibrated = scores.rmse_nominal;
    for trace in &mut calibration.validation.traces {
        trace.calibrated = trace.nominal.clone();
    }
    calibration
}

/// What `twincal design` may decide: a fit that keeps its regression, and a log that is not in doubt.
pub(crate) fn with_open_effects() -> Calibration {
    let mut calibration = two_joints();
    calibration.findings.clear();
    calibration.problem = Some(Problem {
        gram: Vec::new(),
        xy: Vec::new(),
        yy: 0.0,
        n: 0.0,
        log_constant: 0.0,
        prior: Prior::single(
            Vec::new(),
            Vec::new(),
            Inclusion::Probability(0.5),
            (1.0, 1.0),
        ),
        names: Vec::new(),
    });
    calibration
}

/// One row of one joint.
pub(crate) fn single_row() -> Calibration {
    let mut calibration = arm(&["only"], 1, 1);
    calibration.autocorrelation = vec![vec![1.0], vec![1.0]];
    calibration
        .draws
        .values
        .iter_mut()
        .for_each(|v| v.truncate(1));
    calibration
}

/// No held-out data at all.
pub(crate) fn no_validation() -> Calibration {
    let mut calibration = arm(&["shoulder", "elbow"], 2, 0);
    calibration.validation.coverage_levels.clear();
    calibration.autocorrelation.clear();
    calibration
}

/// Joints with long names, and names that are attacks.
pub(crate) fn hostile() -> Calibration {
    let long = "left_manipulator_shoulder_pan_joint_of_the_second_station_upper_deck";
    let mut calibration = arm(
        &[
            "<script>alert(1)</script>",
            long,
            "\u{1b}[31mred\u{1b}[0m\u{202e}\"onload='x'",
        ],
        2,
        400,
    );
    calibration.logs[0].name = "<img src=x onerror=alert(2)>.csv".into();
    for trace in &mut calibration.validation.traces {
        trace.log = "</title></svg><script>alert(3)</script>".into();
    }
    calibration.terms[0].term.name = "\"><svg/onload=alert(4)>".into();
    calibration.terms[0].term.unit = "<b>kg</b>".into();
    calibration.terms[0].words = "payload <script>alert(5)</script>".into();
    calibration.terms[1].term.status = Status::AliasOf("<script>alert(6)</script>".into());
    calibration.terms[1].pip = None;
    calibration.draws.terms[0] = calibration.terms[0].term.name.clone();
    calibration.findings.push(Finding::new(
        Severity::Degraded,
        Code::Columns,
        "<u>",
        "<script>alert(7)</script>\u{7}",
        1,
    ));
    calibration
}

/// Uniform and normal numbers from a linear congruential generator (Knuth's MMIX constants).
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

/// An arm with these joints, `logs` logs and as many held-out traces of `rows` rows per joint.
fn arm(names: &[&str], logs: usize, rows: usize) -> Calibration {
    let mut noise = Noise(7);
    let terms = terms(names);
    let traces: Vec<Trace> = (0..logs)
        .flat_map(|log| (0..names.len()).map(move |joint| (log, joint)))
        .map(|(log, joint)| trace(log, names[joint], joint, rows, &mut noise))
        .collect();
    let posterior = posterior(&terms);
    let joint_noise = joint_noise(names, (logs * rows) as f64);
    let decay = |memory: f64| {
        (0..=20)
            .map(|lag| (-f64::from(lag) / memory).exp() * (0.5 * f64::from(lag) / memory).cos())
            .collect()
    };
    Calibration {
        draws: draws(&terms, &mut noise),
        curves: curves(names),
        lags: None,
        twin: twin(names, posterior, joint_noise.clone()),
        components: components(&terms),
        compact: Some(compact(&terms)),
        problem: None,
        terms,
        noise: joint_noise,
        prior: prior(),
        likelihood: LikelihoodUsed {
            model: NoiseModel::Tempered,
            rounds: 6,
        },
        groups: Vec::new(),
        sweep: Vec::new(),
        validation: validation(traces, names),
        autocorrelation: names
            .iter()
            .flat_map(|_| [decay(6.0), decay(1.2)])
            .collect(),
        logs: log_summaries(logs, names.len()),
        findings: findings(names),
    }
}

/// Exact posterior of the candidates, of one model.
fn posterior(terms: &[TermSummary]) -> Posterior {
    let live: Vec<&TermSummary> = terms.iter().filter(|t| t.pip.is_some()).collect();
    let column = |value: &dyn Fn(&TermSummary) -> Option<f64>| {
        live.iter()
            .map(|t| value(t).unwrap_or(0.0))
            .collect::<Vec<_>>()
    };
    let members: Vec<u32> = (0..live.len())
        .filter(|k| live[*k].pip >= Some(0.5))
        .map(|k| k as u32)
        .collect();
    Posterior {
        component: (0..live.len()).collect(),
        inclusion: column(&|t| t.pip),
        inclusion_mcse: vec![0.0; live.len()],
        mean: column(&|t| t.mean),
        sd: column(&|t| t.sd),
        shape: 750.0,
        noise: 0.01,
        models: vec![Model {
            mean: vec![0.0; members.len()],
            factor: Vec::new(),
            sites: Vec::new(),
            members,
            weight: 0.83,
            scale: 7.5,
        }],
        models_mass: 0.999_999_4,
        log_evidence: Some(-1_234.567_89),
        method: Method::Exact {
            models: 1 << live.len().min(28),
        },
    }
}

/// Noise of every joint on so many rows.
fn joint_noise(names: &[&str], rows: f64) -> Vec<JointNoise> {
    names
        .iter()
        .enumerate()
        .map(|(j, name)| JointNoise {
            joint: (*name).into(),
            sigma: 0.09 / (1.0 + j as f64),
            training_rmse: 0.0,
            rho: 0.0,
            weight: 1.0 + 0.2 * j as f64,
            n: rows,
            n_eff: rows / 7.3,
            autocorrelation_time: 2.4,
            misfit: 1.0,
            interval_factor: 1.08,
            out_of_band: 0.021,
            spread: Default::default(),
        })
        .collect()
}

/// The twin of an arm.
fn twin(names: &[&str], posterior: Posterior, noise: Vec<JointNoise>) -> Twin {
    Twin {
        robot: robot(names),
        library: LibrarySettings::default(),
        zero_columns: Vec::new(),
        pipeline: Pipeline {
            cutoff_hz: 10.0,
            motion_cutoff_hz: 40.0,
            rate_hz: RATE,
            motion_interval: 0.0,
            coulomb_velocity: 0.02,
            standstill_velocity: vec![0.02; names.len()],
            derived_from: vec![twincal::signal::DerivedFrom::Position; names.len()],
            velocity_from: Vec::new(),
            corrections: twincal::signal::Corrections::default(),
            history: Vec::new(),
        },
        posterior,
        noise,
        hull: names
            .iter()
            .enumerate()
            .map(|(j, _)| [-1.2, 1.4 + 0.1 * j as f64, -3.1, 3.0, -14.2, 13.9])
            .collect(),
        payload_where_unknown: false,
    }
}

/// The prior that was used.
fn prior() -> PriorUsed {
    PriorUsed {
        scaled_variance: vec![(Family::Generic, 240.0)],
        payload: PayloadSize::default(),
        learned: true,
        inclusion: Inclusion::ExpectedTerms(5.0),
        families: Vec::new(),
        forced: Vec::new(),
        heredity: Vec::new(),
        shape: 1e-3,
        scale: 1e-4,
    }
}

/// Logs of a minute each.
fn log_summaries(logs: usize, joints: usize) -> Vec<LogSummary> {
    (0..logs)
        .map(|log| LogSummary {
            name: format!("run{log}.csv"),
            role: "fit".into(),
            samples: 60_000,
            duration: 60.0,
            rate_hz: 1000.0,
            kept_rate_hz: RATE,
            segments: 1 + log as u64,
            rows: (0..joints).map(|j| 1500 - 140 * j as u64).collect(),
            standstill: (0..joints).map(|j| 140 * j as u64).collect(),
            incidents: Vec::new(),
        })
        .collect()
}

/// A warning and a note.
fn findings(names: &[&str]) -> Vec<Finding> {
    vec![
        Finding::new(
            Severity::Warning,
            Code::JointNotExcited,
            names[names.len() - 1],
            format!(
                "joint `{}`: at rest in 9.3 % of the rows (|q̇| < 0.02 rad/s); its friction is known less well than the \
                 numbers say, move it more.",
                names[names.len() - 1]
            ),
            140,
        ),
        Finding::new(
            Severity::Note,
            Code::TimeOrigin,
            "run0.csv",
            "3 stamps repeated; the later ones were dropped.",
            3,
        ),
    ]
}

/// A counterbalance over the second joint's position, where there is one.
fn curves(names: &[&str]) -> Vec<Curve> {
    let Some(name) = names.get(1) else {
        return Vec::new();
    };
    let x: Vec<f64> = (0..80).map(|i| -1.2 + 0.03 * f64::from(i)).collect();
    let torque = |offset: f64| x.iter().map(|q| -3.0 * q.sin() + offset).collect();
    vec![Curve {
        joint: (*name).into(),
        along: Along::Position,
        components: vec![
            format!("{name}.gravity_compensation"),
            format!("{name}.offset"),
        ],
        mean: torque(0.0),
        low95: torque(-0.4),
        high95: torque(0.3),
        x,
    }]
}

/// A chain of equal links, each turning about y; a joint named `rail` slides.
fn robot(names: &[&str]) -> Robot {
    let inertia = Inertia {
        mass: 1.0,
        com: [0.0, 0.0, 0.1],
        tensor: [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]],
    };
    let link = |i: usize| LinkDescription {
        name: format!("link{i}"),
        inertia: Some(inertia),
    };
    let joint = |(i, name): (usize, &&str)| {
        let kind = if *name == "rail" {
            JointKind::Prismatic
        } else {
            JointKind::Continuous
        };
        JointDescription {
            axis: [0.0, 1.0, 0.0],
            ..JointDescription::new(name, kind, &format!("link{i}"), &format!("link{}", i + 1))
        }
    };
    let description = RobotDescription {
        name: "arm".into(),
        gravity: [0.0, 0.0, -9.81],
        links: (0..=names.len()).map(link).collect(),
        joints: names.iter().enumerate().map(joint).collect(),
        allow_unphysical: false,
    };
    Robot::new(description, &BTreeMap::new()).unwrap().0
}
