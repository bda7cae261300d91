//! Exact and Gibbs against multivariate t densities of every model (`tests/reference/infer/make.py`).

use serde_json::Value;
use twincal::infer::{Choice, InferenceSettings, infer};
use twincal::posterior::{Method, Problem};
use twincal::prior::{Inclusion, Prior};

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}

/// Every case of the file: its name, the problem, and what is expected.
fn cases() -> Vec<(String, Problem, Value)> {
    let file: Value =
        serde_json::from_str(include_str!("../reference/infer/enumeration.json")).unwrap();
    let all = file["cases"].as_array().unwrap();
    assert!(all.len() >= 37);
    all.iter()
        .enumerate()
        .map(|(index, case)| {
            let number = |key: &str| case[key].as_f64().unwrap();
            let slab = numbers(&case["slab"]);
            let inclusion = match case["inclusion"]["probability"].as_f64() {
                Some(p) => Inclusion::Probability(p),
                None => {
                    Inclusion::ExpectedTerms(case["inclusion"]["expected_terms"].as_f64().unwrap())
                }
            };
            let problem = Problem {
                gram: numbers(&case["gram"]),
                xy: numbers(&case["xy"]),
                yy: number("yy"),
                n: number("n"),
                log_constant: number("log_constant"),
                names: (0..slab.len()).map(|k| format!("x{k}")).collect(),
                prior: Prior::single(
                    slab,
                    numbers(&case["family"])
                        .into_iter()
                        .map(|f| f as usize)
                        .collect(),
                    inclusion,
                    (number("shape"), number("scale")),
                ),
            };
            let name = format!(
                "case {index} ({}, correlation {})",
                case["kind"], case["correlation"]
            );
            (name, problem, case["expected"].clone())
        })
        .collect()
}

fn settings(method: Choice) -> InferenceSettings {
    InferenceSettings {
        method,
        chains: 4,
        draws: 3000,
        seed: 11,
        allow_disagreement: false,
    }
}

#[test]
fn exact_equals_brute_force() {
    for (name, problem, expected) in cases() {
        let got = infer(&problem, &settings(Choice::Exact)).unwrap();
        let (pip, mean, sd) = (
            numbers(&expected["pip"]),
            numbers(&expected["mean"]),
            numbers(&expected["sd"]),
        );
        for k in 0..pip.len() {
            assert!(
                (got.inclusion[k] - pip[k]).abs() <= 1e-9,
                "{name}: PIP {k}: {} and {}",
                got.inclusion[k],
                pip[k]
            );
            assert!(
                (got.mean[k] - mean[k]).abs() <= 1e-8 * (mean[k].abs() + sd[k]),
                "{name}: mean {k}"
            );
            assert!(
                (got.sd[k] / sd[k] - 1.0).abs() <= 1e-6,
                "{name}: sd {k}: {} and {}",
                got.sd[k],
                sd[k]
            );
        }
        let evidence = expected["log_evidence"].as_f64().unwrap();
        let off = got.log_evidence.unwrap() - evidence;
        assert!(
            off.abs() <= 1e-8 * evidence.abs(),
            "{name}: log evidence off by {off}"
        );
        assert!(
            (got.noise / expected["noise"].as_f64().unwrap() - 1.0).abs() <= 1e-9,
            "{name}: noise"
        );
        let best: Vec<u32> = numbers(&expected["best"])
            .into_iter()
            .map(|k| k as u32)
            .collect();
        assert_eq!(got.models[0].members, best, "{name}");
        let weight = got.models[0].weight * got.models_mass;
        assert!(
            (weight - expected["best_weight"].as_f64().unwrap()).abs() <= 1e-9,
            "{name}: heaviest model"
        );
    }
}

/// `max(0.02, 5 √(p(1−p)/ESS))`: five standard errors of ≤ 260 probabilities, false alarm below 2e-4; the seed is fixed.
#[test]
fn gibbs_equals_brute_force_within_its_error() {
    for (name, problem, expected) in cases() {
        let got = infer(&problem, &settings(Choice::Gibbs)).unwrap();
        let Method::Gibbs { ess, r_hat, .. } = got.method else {
            panic!("{name}: not sampled")
        };
        assert!(
            r_hat <= 1.01 && ess > 200.0,
            "{name}: R-hat {r_hat}, ESS {ess}"
        );
        for (k, p) in numbers(&expected["pip"]).into_iter().enumerate() {
            let bound = 0.02f64.max(5.0 * (p * (1.0 - p) / ess).sqrt());
            assert!(
                (got.inclusion[k] - p).abs() <= bound,
                "{name}: PIP {k}: {} and {p}",
                got.inclusion[k]
            );
        }
        assert_eq!(got.log_evidence, None);
    }
}
