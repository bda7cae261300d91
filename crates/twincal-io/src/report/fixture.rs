//! Calibrations made up for the tests of the report: realistic in shape, closed-form signals, own noise generator.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use twincal::calibrate::{
    Calibration, Compact, CompactTerm, ComponentSummary, Draws, Halves, LikelihoodUsed, LogSummary,
    ParameterSummary, PriorUsed, Repeat, TermSummary, Verdict,
};
use twincal::likelihood::{JointNoise, NoiseModel};
use twincal::posterior::{Method, Model, Posterior};
use twincal::prior::Inclusion;
use twincal::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Robot, RobotDescription,
};
use twincal::signal::Pipeline;
use twincal::term::{Family, LibrarySettings, Status, Term};
use twincal::twin::Twin;
use twincal::validate::{
    Conformal, JointFactor, JointScore, Loss, PitKeeper, Reliability, Scores, Split, Trace,
    Validation,
};
use twincal::{Finding, Severity};

/// Rate of the kept rows, Hz.
const RATE: f64 = 25.0;

/// A planar arm with two joints, 20 candidates, three logs of a minute.
pub(super) fn two_joints() -> Calibration {
    arm(&["shoulder", "elbow"], 3, 1500)
}

/// Eight held-out traces per joint, each of two minutes: what the limit on the page's size is about.
pub(super) fn many_logs() -> Calibration {
    arm(&["shoulder", "elbow"], 8, 3000)
}

/// An arm with seven joints and a slider under it.
pub(super) fn seven_joints() -> Calibration {
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

/// Sampled instead of enumerated, with chains that have not converged.
pub(super) fn gibbs() -> Calibration {
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
    calibration.terms[0].selected = true;
    calibration
}

/// A log that the nominal model explains.
pub(super) fn nothing_found() -> Calibration {
    let mut calibration = two_joints();
    for term in calibration.terms.iter_mut().filter(|t| t.pip.is_some()) {
        term.pip = Some(0.01);
        term.selected = false;
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

/// One row of one joint.
pub(super) fn single_row() -> Calibration {
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
pub(super) fn no_validation() -> Calibration {
    let mut calibration = arm(&["shoulder", "elbow"], 2, 0);
    calibration.validation.coverage_levels.clear();
    calibration.autocorrelation.clear();
    calibration
}

/// Joints with long names, and names that are attacks.
pub(super) fn hostile() -> Calibration {
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
        "<i>",
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

fn arm(names: &[&str], logs: usize, rows: usize) -> Calibration {
    let mut noise = Noise(7);
    let terms = terms(names);
    let traces: Vec<Trace> = (0..logs)
        .flat_map(|log| (0..names.len()).map(move |joint| (log, joint)))
        .map(|(log, joint)| trace(log, names[joint], joint, rows, &mut noise))
        .collect();
    let live: Vec<&TermSummary> = terms.iter().filter(|t| t.pip.is_some()).collect();
    let column = |value: &dyn Fn(&TermSummary) -> Option<f64>| {
        live.iter()
            .map(|t| value(t).unwrap_or(0.0))
            .collect::<Vec<_>>()
    };
    let members: Vec<u32> = (0..live.len())
        .filter(|k| live[*k].selected)
        .map(|k| k as u32)
        .collect();
    let posterior = Posterior {
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
    };
    let joint_noise: Vec<JointNoise> = names
        .iter()
        .enumerate()
        .map(|(j, name)| JointNoise {
            joint: (*name).into(),
            sigma: 0.09 / (1.0 + j as f64),
            rho: 0.0,
            weight: 1.0 + 0.2 * j as f64,
            n: (logs * rows) as f64,
            n_eff: (logs * rows) as f64 / 7.3,
            autocorrelation_time: 2.4,
            interval_factor: 1.08,
            out_of_band: 0.021,
            speed_profile: None,
        })
        .collect();
    let decay = |memory: f64| {
        (0..=20)
            .map(|lag| (-f64::from(lag) / memory).exp() * (0.5 * f64::from(lag) / memory).cos())
            .collect()
    };
    Calibration {
        draws: draws(&terms, &mut noise),
        twin: Twin {
            robot: robot(names),
            library: LibrarySettings::default(),
            zero_columns: Vec::new(),
            pipeline: Pipeline {
                cutoff_hz: 10.0,
                motion_cutoff_hz: 40.0,
                rate_hz: RATE,
                coulomb_velocity: 0.02,
                standstill_velocity: vec![0.02; names.len()],
                derived_from: vec![twincal::signal::DerivedFrom::Position; names.len()],
            },
            posterior,
            noise: joint_noise.clone(),
            hull: names
                .iter()
                .enumerate()
                .map(|(j, _)| [-1.2, 1.4 + 0.1 * j as f64, -3.1, 3.0, -14.2, 13.9])
                .collect(),
            payload_where_unknown: false,
        },
        components: components(&terms),
        repeatability: repeats(&terms),
        halves: Some(Halves::EveryOtherLog),
        compact: Some(compact(&terms)),
        terms,
        noise: joint_noise,
        prior: PriorUsed {
            scaled_variance: vec![(Family::Generic, 240.0)],
            learned: true,
            inclusion: Inclusion::ExpectedTerms(5.0),
            families: Vec::new(),
            forced: Vec::new(),
            shape: 1e-3,
            scale: 1e-4,
        },
        likelihood: LikelihoodUsed {
            model: NoiseModel::Tempered,
            tempering: 3.0,
            tempering_scores: vec![(1.0, 10.0), (3.0, 14.0), (10.0, 9.0)],
            rounds: 6,
        },
        groups: Vec::new(),
        sweep: Vec::new(),
        validation: validation(traces, names),
        autocorrelation: names
            .iter()
            .flat_map(|_| [decay(6.0), decay(1.2)])
            .collect(),
        logs: (0..logs)
            .map(|log| LogSummary {
                name: format!("run{log}.csv"),
                role: "fit".into(),
                samples: 60_000,
                duration: 60.0,
                rate_hz: 1000.0,
                segments: 1 + log as u64,
                rows: (0..names.len()).map(|j| 1500 - 140 * j as u64).collect(),
                standstill: (0..names.len()).map(|j| 140 * j as u64).collect(),
            })
            .collect(),
        findings: vec![
            Finding::new(
                Severity::Warning,
                "joint_barely_driven",
                names[names.len() - 1],
                format!(
                    "joint `{}`: 9.3 % of the rows stand still (|q̇| < 0.02 rad/s); its friction is known less well than the \
                     numbers say, move it more.",
                    names[names.len() - 1]
                ),
                140,
            ),
            Finding::new(
                Severity::Note,
                "uniform_clock",
                "run0.csv",
                "log `run0.csv`: 3 stamps repeated; the later ones were dropped.",
                3,
            ),
        ],
    }
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

/// Motion is a sum of three sines; the effects missing from the nominal torque are friction and a payload.
fn trace(log: usize, name: &str, joint: usize, rows: usize, noise: &mut Noise) -> Trace {
    let mut trace = Trace {
        log: format!("run{log}.csv"),
        joint: name.into(),
        ..Trace::default()
    };
    let sigma = 0.11 / (1.0 + joint as f64);
    let mut error = sigma * noise.normal();
    for i in 0..rows {
        let t = i as f64 / RATE;
        // The joint rests for two seconds of every twenty.
        let still = joint > 0 && t % 20.0 > 18.0;
        let phase = 0.7 * joint as f64 + 0.4 * log as f64;
        let wave = |amplitude: f64, hz: f64, p: f64| {
            let w = TAU * hz;
            (
                amplitude * (w * t + p).sin(),
                amplitude * w * (w * t + p).cos(),
                -amplitude * w * w * (w * t + p).sin(),
            )
        };
        let waves = [
            wave(0.6, 0.11, phase),
            wave(0.3, 0.37, 2.0 * phase),
            wave(0.12, 0.93, phase + 1.0),
        ];
        let [q, mut qd, mut qdd] =
            [0, 1, 2].map(|k| waves.iter().map(|w| [w.0, w.1, w.2][k]).sum::<f64>());
        if still {
            (qd, qdd) = (0.0, 0.0);
        }
        let scale = 1.0 / (1.0 + 0.6 * joint as f64);
        let nominal = scale * (0.35 * qdd + 4.2 * q.sin());
        let missing = scale * (0.9 * q.sin() + 0.25 * qd + 0.42 * (qd / 0.02).tanh());
        error = 0.45 * error + (1.0f64 - 0.45 * 0.45).sqrt() * sigma * noise.normal();
        let calibrated = nominal + 0.985 * missing;
        let measured = nominal + missing + error;
        trace.time.push(t);
        trace.q.push(q);
        trace.qd.push(qd);
        trace.measured.push(measured);
        trace.nominal.push(nominal);
        trace.calibrated.push(calibrated);
        let spread = if still { 3.0 } else { 1.0 } * sigma;
        trace.low.push(calibrated - 1.96 * spread);
        trace.high.push(calibrated + 1.96 * spread);
        trace.standstill.push(still);
        trace.pit.push(normal_cdf((measured - calibrated) / spread));
    }
    trace
}

/// Φ by the logistic approximation (error below 1e-3: enough for a picture).
fn normal_cdf(x: f64) -> f64 {
    1.0 / (1.0 + (-1.5976 * x - 0.070_565_992 * x * x * x).exp())
}

fn validation(traces: Vec<Trace>, names: &[&str]) -> Validation {
    let score = |pick: &dyn Fn(&Trace) -> bool| {
        let (mut rows, mut before, mut after, mut inside, mut width) = (0u64, 0.0, 0.0, 0.0, 0.0);
        for t in traces.iter().filter(|t| pick(t)) {
            for i in 0..t.time.len() {
                rows += 1;
                before += (t.measured[i] - t.nominal[i]).powi(2);
                after += (t.measured[i] - t.calibrated[i]).powi(2);
                inside += f64::from(u8::from((t.low[i]..=t.high[i]).contains(&t.measured[i])));
                width += t.high[i] - t.low[i];
            }
        }
        let n = rows as f64;
        (
            rows,
            f64::sqrt(before / n),
            f64::sqrt(after / n),
            inside / n,
            width / n,
        )
    };
    let joints = names
        .iter()
        .map(|name| {
            let (rows, rmse_nominal, rmse_calibrated, coverage95, mean_width95) =
                score(&|t| t.joint == *name);
            JointScore {
                joint: (*name).into(),
                rows,
                rmse_nominal,
                rmse_calibrated,
                coverage95,
                mean_width95,
                torque_sd: 10.0 * rmse_nominal,
                interval_score95: 1.1 * mean_width95,
                epistemic_sd: 0.03 * rmse_nominal,
                noise_sd: 0.1 * rmse_nominal,
                epistemic_share: 0.0825,
            }
        })
        .collect();
    let (_, rmse_nominal, rmse_calibrated, coverage95, _) = score(&|_| true);
    let scores = Scores {
        rmse_nominal,
        rmse_calibrated,
        coverage95,
        interval_score95: 0.4,
        epistemic_share: 0.0825,
        joints,
    };
    let level = |level: f64| {
        let pits = || traces.iter().flat_map(|t| &t.pit);
        let inside = pits().filter(|p| (**p - 0.5).abs() <= 0.5 * level).count();
        (level, inside as f64 / pits().count() as f64)
    };
    let kept = |pick: &dyn Fn(&Trace) -> bool| {
        let mut keeper = PitKeeper::default();
        for t in traces.iter().filter(|t| pick(t)) {
            keeper.push(&t.pit, 2.5);
        }
        keeper
    };
    let reliability = |name: &&str| {
        let keeper = kept(&|t| t.joint == *name);
        Reliability {
            joint: (*name).into(),
            rows: keeper.rows(),
            coverage_levels: keeper.levels(),
            pit: keeper.pit(),
        }
    };
    let rows = kept(&|_| true).rows();
    let loss = |rmse: f64, log_score: f64| Loss {
        rows,
        rmse,
        log_score,
    };
    Validation {
        split: Split::LeaveOneLogOut,
        coverage_levels: [0.5, 0.8, 0.9, 0.95].map(level).to_vec(),
        pit: kept(&|_| true).pit(),
        reliability: names.iter().map(reliability).collect(),
        conformal: (rows > 0).then(|| Conformal {
            trajectories: 3,
            rows: 0.95,
            level: 0.75,
            guaranteed: false,
            factor: 1.31,
            joints: names
                .iter()
                .map(|name| JointFactor {
                    joint: (*name).into(),
                    factor: 1.1,
                })
                .collect(),
        }),
        compact: (rows > 0).then(|| {
            [
                loss(rmse_calibrated, 0.812),
                loss(1.01 * rmse_calibrated, 0.805),
            ]
        }),
        filtered: scores.clone(),
        moving: scores.clone(),
        raw: scores,
        traces,
    }
}

fn terms(names: &[&str]) -> Vec<TermSummary> {
    let mut out = Vec::new();
    let mut add = |name: &str, family, unit: &str, truth: Option<(f64, f64, f64)>| {
        let (pip, mean, sd) = truth.unwrap_or((f64::NAN, 0.0, 0.0));
        let live = truth.is_some();
        let some = |x: f64| live.then_some(x);
        out.push(TermSummary {
            term: Term {
                name: name.into(),
                family,
                unit: unit.into(),
                status: Status::Candidate,
                component: out.len(),
            },
            pip: some(pip),
            pip_mcse: some(0.0),
            mean: some(pip * mean),
            sd: some(sd),
            interval95: live.then_some([mean - 1.96 * sd, mean + 1.96 * sd]),
            conditional_mean: some(mean),
            conditional_sd: some(sd),
            selected: live && pip >= 0.5,
            verdict: live.then_some(if pip >= 0.5 {
                Verdict::Found
            } else {
                Verdict::Absent
            }),
            column_rms: some(1.0),
            pip_sensitivity: if live {
                [0.8, 1.0, 1.3, 0.7, 1.4]
                    .map(|f| f64::min(1.0, f * pip))
                    .to_vec()
            } else {
                Vec::new()
            },
            sandwich_sd: some(1.3 * sd).filter(|_| pip >= 0.5),
            words: if live && pip >= 0.5 {
                format!("{name}: {mean:+.3} ± {sd:.3} {unit}")
            } else {
                String::new()
            },
        });
    };
    let kinetic = [
        ("qd1^2", 0.62),
        ("qd2^2", 0.03),
        ("qd1*qd2", 0.02),
        ("qd1^2*cos(q2)", 0.21),
        ("qd1*qd2*cos(q2)", 0.04),
        ("qd1*qd2*sin(q2)", 0.004),
    ];
    let potential = [
        ("sin(q1)", 0.01),
        ("cos(q1)", 1.0),
        ("sin(q1+q2)", 0.07),
        ("cos(q1+q2)", 0.999_2),
        ("q1^2", 0.012),
    ];
    if names.len() <= 3 {
        add("q2^2", Family::User, "N·m/rad", Some((0.34, 0.021, 0.012)));
        add("qd1*q1", Family::User, "N·m·s", None);
        for (i, (name, pip)) in kinetic.into_iter().enumerate() {
            add(
                name,
                Family::Generic,
                "kg·m²",
                Some((pip, 0.043 / (1.0 + i as f64), 0.008)),
            );
        }
        for (i, (name, pip)) in potential.into_iter().enumerate() {
            add(
                name,
                Family::Generic,
                "N·m",
                Some((pip, -0.9 / (1.0 + i as f64), 0.017)),
            );
        }
        add("sin(q2)^2", Family::Generic, "N·m", None);
    }
    for (j, name) in names.iter().enumerate() {
        add(
            &format!("{name}.viscous"),
            Family::Viscous,
            "N·m·s/rad",
            Some((1.0, 0.25 / (1.0 + j as f64), 0.006)),
        );
    }
    for (j, name) in names.iter().enumerate() {
        add(
            &format!("{name}.coulomb"),
            Family::Coulomb,
            "N·m",
            Some((0.998 / (1.0 + 0.1 * j as f64), 0.42, 0.02)),
        );
    }
    for name in names {
        add(
            &format!("{name}.offset"),
            Family::Offset,
            "N·m",
            Some((0.006, 0.003, 0.004)),
        );
        add(
            &format!("{name}.motor_inertia"),
            Family::MotorInertia,
            "kg·m²",
            Some((0.015, 0.0002, 0.0009)),
        );
    }
    for term in &mut out {
        match term.term.name.as_str() {
            "qd1*q1" => term.term.status = Status::NullLagrangian,
            "sin(q2)^2" => term.term.status = Status::AliasOf("q2^2".into()),
            _ => {}
        }
    }
    out
}

/// The kept terms on two halves: the first one moves.
fn repeats(terms: &[TermSummary]) -> Vec<Repeat> {
    let kept = terms.iter().filter(|t| t.selected).enumerate();
    kept.map(|(i, t)| {
        let (mean, sd) = (
            t.conditional_mean.unwrap_or(0.0),
            1.4 * t.conditional_sd.unwrap_or(1.0),
        );
        let z = if i == 0 { 3.6 } else { 0.4 };
        Repeat {
            component: t.term.name.clone(),
            term: t.term.name.clone(),
            unit: t.term.unit.clone(),
            first: mean,
            first_sd: sd,
            first_pip: 0.97,
            second: mean + z * std::f64::consts::SQRT_2 * sd,
            second_sd: sd,
            second_pip: 0.99,
            z: (i != 1).then_some(z),
        }
    })
    .collect()
}

/// The kept terms.
fn compact(terms: &[TermSummary]) -> Compact {
    let kept: Vec<&TermSummary> = terms.iter().filter(|t| t.selected).collect();
    let term = |t: &&TermSummary| CompactTerm {
        name: t.term.name.clone(),
        unit: t.term.unit.clone(),
        mean: t.conditional_mean.unwrap_or(0.0),
        sd: t.conditional_sd.unwrap_or(0.0),
    };
    Compact {
        components: kept.iter().map(|t| t.term.name.clone()).collect(),
        terms: kept.iter().map(term).collect(),
        training_rmse: [0.1, 0.1003],
    }
}

/// One component per term.
fn components(terms: &[TermSummary]) -> Vec<ComponentSummary> {
    let component = |term: &TermSummary| ComponentSummary {
        name: term.term.name.clone(),
        family: term.term.family,
        story: term.term.name.clone(),
        columns: vec![term.term.name.clone()],
        pip: term.pip,
        pip_mcse: term.pip_mcse,
        selected: term.selected,
        verdict: term.verdict,
        alias_of: Vec::new(),
        words: term.words.clone(),
        parameters: term
            .conditional_mean
            .zip(term.conditional_sd)
            .map(|(mean, sd)| ParameterSummary {
                name: "value".into(),
                unit: term.term.unit.clone(),
                mean,
                sd,
                interval95: [mean - 1.96 * sd, mean + 1.96 * sd],
            })
            .into_iter()
            .collect(),
    };
    terms.iter().map(component).collect()
}

/// Correlated normal draws of the kept coefficients; those that are not sure have a spike at zero.
fn draws(terms: &[TermSummary], noise: &mut Noise) -> Draws {
    let kept: Vec<&TermSummary> = terms.iter().filter(|t| t.selected).take(8).collect();
    let mut values = vec![Vec::with_capacity(2000); kept.len()];
    for _ in 0..2000 {
        let common = noise.normal();
        for (i, term) in kept.iter().enumerate() {
            let share: f64 = if i < 2 { 0.9 } else { 0.2 };
            let z = share * common + (1.0 - share * share).sqrt() * noise.normal();
            let present = noise.uniform() < term.pip.unwrap_or(0.0);
            let slab =
                term.conditional_mean.unwrap_or(0.0) + term.conditional_sd.unwrap_or(1.0) * z;
            values[i].push(if present { slab } else { 0.0 });
        }
    }
    Draws {
        terms: kept.iter().map(|t| t.term.name.clone()).collect(),
        values,
    }
}
