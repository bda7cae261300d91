//! 200 random problems of up to 4 million rows against an elimination in 40 digits (`tests/reference/infer/many.py`).

use super::Source;
use serde_json::Value;
use twincal::infer::{Choice, InferenceSettings, infer};
use twincal::posterior::{Method, Problem};
use twincal::prior::{Inclusion, Prior};

struct Case {
    name: String,
    correlation: f64,
    problem: Problem,
    pip: Vec<f64>,
    log_evidence: f64,
}

fn cases() -> Vec<Case> {
    let file: Value = serde_json::from_str(include_str!("../reference/infer/many.json")).unwrap();
    let all = file["cases"].as_array().unwrap();
    assert_eq!(all.len(), 200);
    all.iter()
        .enumerate()
        .map(|(i, value)| case(i, value))
        .collect()
}

fn case(index: usize, value: &Value) -> Case {
    let numbers = |value: &Value| -> Vec<f64> {
        let all = value.as_array().unwrap().iter();
        all.map(|x| x.as_f64().unwrap()).collect()
    };
    let number = |key: &str| value[key].as_f64().unwrap();
    let (xy, triangle) = (numbers(&value["xy"]), numbers(&value["gram"]));
    let size = xy.len();
    let mut gram = vec![0.0; size * size];
    let mut next = triangle.into_iter();
    for i in 0..size {
        for j in i..size {
            gram[i * size + j] = next.next().unwrap();
            gram[j * size + i] = gram[i * size + j];
        }
    }
    let inclusion = match value["inclusion"]["probability"].as_f64() {
        Some(p) => Inclusion::Probability(p),
        None => Inclusion::ExpectedTerms(value["inclusion"]["expected_terms"].as_f64().unwrap()),
    };
    let family = numbers(&value["family"]).into_iter().map(|f| f as usize);
    let (noise, slab) = ((number("shape"), number("scale")), numbers(&value["slab"]));
    Case {
        name: format!("case {index} ({size} columns, {} rows)", number("n")),
        correlation: number("correlation"),
        problem: Problem {
            gram,
            xy,
            yy: number("yy"),
            n: number("n"),
            log_constant: 0.0,
            names: (0..size).map(|k| format!("x{k}")).collect(),
            prior: Prior::single(slab, family.collect(), inclusion, noise),
        },
        pip: numbers(&value["expected"]["pip"]),
        log_evidence: value["expected"]["log_evidence"].as_f64().unwrap(),
    }
}

fn settings(method: Choice) -> InferenceSettings {
    InferenceSettings {
        method,
        chains: 4,
        draws: 5000,
        seed: 3,
        allow_disagreement: true,
    }
}

#[test]
fn exact_sums_are_right_to_nine_digits() {
    for case in cases() {
        let got = infer(&case.problem, &settings(Choice::Exact)).unwrap();
        for (k, (got, pip)) in got.inclusion.iter().zip(&case.pip).enumerate() {
            assert!(
                (got - pip).abs() <= 1e-9,
                "{}: PIP {k}: {got} and {pip}",
                case.name
            );
        }
        let off = got.log_evidence.unwrap() / case.log_evidence - 1.0;
        assert!(
            off.abs() <= 1e-8,
            "{}: log evidence off by {off:e}",
            case.name
        );
    }
}

/// Default settings: every PIP within 0.02 (0.05 at correlation .99), and within 3 of its own Monte Carlo standard errors in
/// 99 of 100 (99.7 if the errors were known and normal). Chains are deterministic for their seed: no false alarm once it passes.
#[test]
fn gibbs_is_right_within_its_own_error() {
    let (mut within, mut all) = (0, 0);
    for case in cases() {
        let got = infer(&case.problem, &settings(Choice::Gibbs)).unwrap();
        assert!(matches!(got.method, Method::Gibbs { .. }));
        let limit = if case.correlation > 0.95 { 0.05 } else { 0.02 };
        for (k, pip) in case.pip.iter().enumerate() {
            let off = (got.inclusion[k] - pip).abs();
            assert!(off <= limit, "{}: PIP {k} is off by {off}", case.name);
            all += 1;
            // Rao–Blackwell averages of what is certain have no error that could be estimated.
            let error = got.inclusion_mcse[k];
            within += i32::from(off <= 3.0 * error || off < 1e-6);
        }
    }
    assert!(
        f64::from(within) >= 0.99 * f64::from(all),
        "{within} of {all}"
    );
}

/// Twenty thousand inclusion probabilities and what was drawn from the prior: calibrated to 0.01 in expectation.
#[test]
fn inclusion_probabilities_come_true() {
    let mut source = Source::new(17);
    let (mut predicted, mut happened) = ([0.0; 20], [0.0; 20]);
    let mut count = 0.0;
    for run in 0..2500 {
        let inclusion = [Inclusion::Probability(0.3), Inclusion::ExpectedTerms(2.5)][run % 2];
        let (included, problem) = super::calibration::draw_problem(&mut source, inclusion);
        let posterior = infer(&problem, &settings(Choice::Exact)).unwrap();
        for (pip, included) in posterior.inclusion.iter().zip(included) {
            let bin = ((pip * 20.0) as usize).min(19);
            predicted[bin] += pip;
            happened[bin] += f64::from(included);
            count += 1.0;
        }
    }
    let off = predicted
        .iter()
        .zip(&happened)
        .map(|(p, h): (&f64, &f64)| (p - h).abs());
    // Chance alone: Σ √(2/π Σ p(1 − p)) over 20 bins of 20 000 pairs is 0.0062 on average, sd about 0.001.
    let error = off.sum::<f64>() / count;
    assert!(count == 20_000.0 && error < 0.01, "{error} of {count}");
}
