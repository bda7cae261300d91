//! The example's study against its closed-form truth, and the twin that comes out of it through JSON and back.

#[path = "../examples/two_link.rs"]
#[allow(dead_code, reason = "its `main` prints, which a test does not need")]
mod two_link;

use std::sync::LazyLock;
use twincal::calibrate::Calibration;
use twincal::posterior::random::Random;
use twincal::signal::align;
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
        .filter(|component| component.selected)
        .map(|component| component.name.as_str())
        .collect();
    assert_eq!(found, ["sin(q1 - q2)", "payload"]);
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
        let (trajectory, _) = align(&twin.robot, &heldout, &twin.pipeline).expect("a trajectory");
        let mut scores = HeldOut::new(twin.robot.joint_names());
        scores
            .score(
                &twin.robot,
                &library,
                &twin.pipeline,
                &predictor,
                &trajectory,
                f64::NEG_INFINITY,
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
    assert_eq!(one, other);
    let wanted = &result.validation.filtered;
    assert!((one.filtered.rmse_calibrated / wanted.rmse_calibrated - 1.0).abs() < 1e-12);
    assert_eq!(one.filtered.coverage95, wanted.coverage95);
}
