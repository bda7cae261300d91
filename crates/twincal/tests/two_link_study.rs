//! The example's study against its closed-form truth, and the twin that comes out of it through JSON and back.

use crate::two_link;
use std::sync::LazyLock;
use twincal::calibrate::{Calibration, CalibrationSettings, Status, calibrate};
use twincal::random::Random;
use twincal::rows::{RowSignal, count_rows};
use twincal::signal::{Auto, Log, Raw, choose_pipeline, prepare};
use twincal::twin::Twin;
use twincal::validate::{HeldOut, Split};

static STUDY: LazyLock<Calibration> = LazyLock::new(|| two_link::study().expect("a study"));

/// False alarm below 1e-4: four estimates within 4.5 sd, coverage of 4000 rows within 0.95 ± 5 sd; the seed is fixed.
#[test]
fn the_payload_and_the_hidden_effect_are_found_and_nothing_else() {
    let result = &*STUDY;
    let found: Vec<&str> = result
        .components
        .iter()
        .filter(|component| component.status == Status::Established)
        .map(|component| component.name.as_str())
        .collect();
    assert_eq!(
        found,
        ["sin(q1 - q2)", "payload"],
        "{:?}",
        result.components
    );
    // 0.6 kg more at the end of the fore link, which is 0.5 m from its joint.
    for (component, parameter, truth) in [
        ("sin(q1 - q2)", "value", 0.8),
        ("payload", "mass", 0.6),
        ("payload", "com_x", 0.5),
        ("payload", "com_y", 0.0),
    ] {
        let summary = result.components.iter().find(|c| c.name == component);
        let summary = summary.expect("a component");
        assert!(summary.pip > Some(0.99));
        let value = summary.parameters.iter().find(|p| p.name == parameter);
        let value = value.expect("a parameter");
        assert!(
            (value.mean - truth).abs() < 4.5 * value.sd,
            "{component} {parameter}: {} ± {}, in truth {truth}",
            value.mean,
            value.sd
        );
    }
    let scores = &result.validation.filtered;
    assert!(
        scores.rmse_nominal > 3.0 && scores.rmse_calibrated < 0.105,
        "{scores:?}"
    );
    for joint in &scores.joints {
        // Binomial(2000, 0.95): sd 0.0049.
        assert!((joint.coverage95 - 0.95).abs() < 0.0245, "{joint:?}");
    }
}

/// Intervals and guarantee of the same study. False alarm of this test and the next below 1e-3: 9 statistics at 4.5 sd or 95 %
/// of a bound times 1.5; the seed is fixed.
#[test]
fn the_answer_comes_with_its_own_checks() {
    let result = &*STUDY;
    let validation = &result.validation;
    for (joint, score) in validation
        .reliability
        .iter()
        .zip(&validation.filtered.joints)
    {
        assert_eq!(joint.rows, 2000);
        for (level, seen) in &joint.coverage_levels {
            let sd = (level * (1.0 - level) / 2000.0).sqrt();
            assert!((seen - level).abs() < 4.5 * sd, "{joint:?}");
        }
        assert!(joint.pit.distance < 1.5 * joint.pit.chance, "{joint:?}");
        // Normal noise of 0.1 N·m and α = 0.05: (4/α) σ φ(1.96) = 0.4676, per row ± 0.45.
        assert!(
            (score.interval_score95 - 0.4676).abs() < 4.5 * 0.0101,
            "{score:?}"
        );
        assert!((score.noise_sd - 0.1).abs() < 0.01, "{score:?}");
        let both = score.epistemic_sd.powi(2) + score.noise_sd.powi(2);
        let share = score.epistemic_sd.powi(2) / both;
        assert!(
            (score.epistemic_share - share).abs() < 1e-12 && share < 0.05,
            "{score:?}"
        );
    }
    let conformal = validation.conformal.as_ref().expect("a held-out log");
    assert_eq!(
        (
            conformal.trajectories,
            conformal.level,
            conformal.guaranteed
        ),
        (1, 0.5, true)
    );
    assert!((conformal.factor - 1.0).abs() < 0.1, "{conformal:?}");
}

/// The hidden effect, and what a planar arm shows of the payload. It is a point at the link's own centre: of the tensor that a payload is
/// expected to have nothing may be found. False alarm of 4.5 sd: 7e-6.
#[test]
fn the_compact_twin_keeps_what_is_found() {
    let result = &*STUDY;
    let compact = result.compact.as_ref().expect("a compact twin");
    let kept: Vec<&str> = compact.terms.iter().map(|r| &*r.name).collect();
    assert_eq!(
        kept,
        [
            "sin(q1 - q2)",
            "payload.m",
            "payload.h1",
            "payload.h2",
            "payload.s1"
        ]
    );
    let mut terms = result.terms.iter();
    let tensor = terms.find(|term| term.term.name == "payload.s1");
    let tensor = tensor.expect("its tensor");
    let [mean, sd] = [tensor.conditional_mean, tensor.conditional_sd].map(|x| x.expect("a number"));
    assert!(mean.abs() < 4.5 * sd, "{mean} ± {sd}");
    assert_eq!(compact.components, ["sin(q1 - q2)", "payload"]);
    let [average, own] = result.validation.compact.expect("losses");
    assert!(own.rmse < 1.01 * average.rmse && (own.log_score - average.log_score).abs() < 0.01);
    // −½ ln(2πe σ²) = 0.8837 nats of normal noise of 0.1 N·m, per row ± 0.71.
    assert!(
        (average.log_score - 0.8837).abs() < 4.5 * 0.71 / 4000.0_f64.sqrt(),
        "{average:?}"
    );
    for term in result
        .terms
        .iter()
        .filter(|term| term.sandwich_sd.is_some())
    {
        let ratio = term.sandwich_sd.unwrap_or(0.0) / term.conditional_sd.unwrap_or(1.0);
        assert!((0.4..1.6).contains(&ratio), "{} {ratio}", term.term.name);
    }
}

/// What people are told is median and half the central 68 %: of a posterior that is almost one t, mean and sd.
#[test]
fn a_parameter_that_no_joint_shows_has_no_number_and_the_others_are_told_by_quantiles() {
    let result = &*STUDY;
    let payload = result.components.iter().find(|c| c.name == "payload");
    let payload = payload.expect("a payload");
    let mut unseen = Vec::new();
    for parameter in payload.parameters.iter().filter(|own| !own.seen) {
        unseen.push(parameter.name.as_str());
        assert!(parameter.mean.is_nan() && parameter.told().0.is_nan());
        assert!(parameter.interval95.iter().all(|end| end.is_nan()));
    }
    // The axes are parallel to z.
    assert_eq!(unseen, ["com_z", "ixx", "ixy", "ixz", "iyy", "iyz"]);
    assert!(!payload.words.contains("NaN"), "{}", payload.words);
    let mass = &payload.parameters[0];
    let (median, spread) = mass.told();
    assert!(mass.seen && (median - mass.mean).abs() < 0.1 * mass.sd);
    assert!((spread / mass.sd - 1.0).abs() < 0.1, "{mass:?}");
}

#[test]
fn a_twin_from_json_predicts_the_same_bytes_and_scores_like_the_calibration() {
    let result = &*STUDY;
    let text = serde_json::to_string(&result.twin).expect("JSON");
    let again: Twin = serde_json::from_str(&text).expect("a twin");
    assert_eq!(again, result.twin);
    assert_eq!(
        again.library().expect("a library").terms().len(),
        result.terms.len()
    );

    // The same held-out log that the study made.
    let real = two_link::arm(2.6).expect("an arm");
    let mut noise = Random::new(1, 0);
    two_link::log("training", 0.3, &real, &mut noise);
    let heldout = two_link::log("held-out", 1.9, &real, &mut noise);
    let score = |twin: &Twin| {
        let library = twin.library().expect("a library");
        let predictor = twin.predictor(&library).expect("a predictor");
        let mut scores = HeldOut::new(twin.robot.joint_names());
        scores
            .score(
                (twin, &library, &predictor),
                &Log::from(&heldout),
                &mut Vec::new(),
                &mut |_| Ok(()),
            )
            .expect("scores");
        scores.finish(Split::HeldoutLogs)
    };
    let (one, other) = (score(&result.twin), score(&again));
    assert_eq!(one.traces.len(), 2);
    for (a, b) in one.traces.iter().zip(&other.traces) {
        let bits = |values: &[f64]| -> Vec<u64> { values.iter().map(|v| v.to_bits()).collect() };
        for (a, b) in [
            (&a.low, &b.low),
            (&a.high, &b.high),
            (&a.calibrated, &b.calibrated),
            (&a.pit, &b.pit),
        ] {
            assert_eq!(bits(a), bits(b));
        }
    }
    // As text: scores of no rows (none is beyond the training motion) are NaN.
    assert!(format!("{one:?}") == format!("{other:?}"), "scores differ");
    let wanted = &result.validation.filtered;
    assert!((one.filtered.rmse_calibrated / wanted.rmse_calibrated - 1.0).abs() < 1e-12);
    assert_eq!(one.filtered.coverage95, wanted.coverage95);
}

#[test]
fn case_105_rows_that_do_not_fit_into_memory_are_refused_with_the_log_and_both_numbers() {
    let real = two_link::arm(2.6).expect("an arm");
    let log = two_link::log("long", 0.3, &real, &mut Random::new(3, 0));
    let with = |most_bytes| {
        let settings = CalibrationSettings {
            most_bytes,
            ..CalibrationSettings::default()
        };
        let nominal = two_link::arm(2.0).expect("an arm");
        calibrate(
            &nominal,
            std::slice::from_ref(&log),
            &[],
            &settings,
            &|_| {},
        )
    };
    let text = with(Some(100_000)).expect_err("a refusal").to_string();
    for words in ["long", "needs about", "0.1 MB are free", "rate_hz"] {
        assert!(text.contains(words), "{text}");
    }
    assert!(with(Some(1 << 32)).is_ok());
}

/// The estimate of rows before there are any: what the rows are, and at most the filter's length in each piece more. Also for a clock that
/// starts again, for a rate that is no whole number of samples, and with the filter off.
#[test]
fn rows_at_most_are_close_to_the_rows_that_there_are() {
    let real = two_link::arm(2.6).expect("an arm");
    let log = two_link::log("run", 0.3, &real, &mut Random::new(3, 0));
    let mut twice = log.clone();
    twice.time.extend_from_slice(&log.time);
    for joint in &mut twice.joints {
        joint.q.extend_from_within(..);
        for channel in [&mut joint.qd, &mut joint.qdd, &mut joint.tau]
            .into_iter()
            .flatten()
        {
            channel.extend_from_within(..);
        }
    }
    for (cutoff_hz, rate_hz) in [
        (Auto::Auto, Auto::Auto),
        (Auto::Value(8.0), Auto::Value(67.5)),
        (Auto::Value(0.0), Auto::Auto),
    ] {
        for (log, pieces) in [(&log, 1), (&twice, 2)] {
            let mut settings = CalibrationSettings::default().signal;
            (settings.cutoff_hz, settings.rate_hz) = (cutoff_hz, rate_hz);
            let logs = std::slice::from_ref(log);
            let (pipeline, _) = choose_pipeline(&real, logs, &settings).expect("a pipeline");
            let ready = prepare(&real, log, &pipeline).expect("a log");
            let (trajectory, _) = ready.align(&pipeline, Raw::None).expect("a trajectory");
            let rows = count_rows(&pipeline, &trajectory, RowSignal::Filtered);
            let most = ready.rows_at_most(&pipeline);
            let trimmed = if pipeline.is_off() {
                0.0
            } else {
                2.0 * pipeline.kernel_length() + 1.0
            };
            let more = pieces * (trimmed * pipeline.rate_hz).ceil() as usize;
            assert!(
                rows > 20 && rows <= most && most <= rows + more,
                "{cutoff_hz:?}: {rows} {most} {more}"
            );
        }
    }
}
