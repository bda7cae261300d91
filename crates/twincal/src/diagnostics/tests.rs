//! ArviZ says what is right; closed forms for the autocorrelation time.

use super::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}

/// `null` in the file is NaN.
fn close(got: f64, expected: &Value, what: &str) {
    match expected.as_f64() {
        // Chains that stand still have no variance; ArviZ divides by what rounding leaves of it.
        Some(expected) if expected > 1e12 => assert_eq!(got, f64::INFINITY, "{what}"),
        Some(expected) => assert!(
            (got - expected).abs() <= 1e-8 * expected.abs().max(1.0),
            "{what}: {got} and {expected}"
        ),
        None => assert!(got.is_nan(), "{what}: {got} where ArviZ has no number"),
    }
}

#[test]
fn every_diagnostic_equals_arviz() {
    let file: Value =
        serde_json::from_str(include_str!("../../tests/reference/infer/diagnostics.json")).unwrap();
    let cases = file["cases"].as_array().unwrap();
    assert!(cases.len() >= 12);
    for case in cases {
        let chains: Vec<Vec<f64>> = case["chains"]
            .as_array()
            .unwrap()
            .iter()
            .map(numbers)
            .collect();
        let name = case["name"].as_str().unwrap();
        close(r_hat(&chains), &case["r_hat"], &format!("{name}: r_hat"));
        close(
            ess_bulk(&chains),
            &case["ess_bulk"],
            &format!("{name}: ess_bulk"),
        );
        let pooled: usize = chains.iter().map(|chain| chain.len() / 2 * 2).sum();
        // A table of another size is not used, and changes nothing.
        for size in [pooled, 7] {
            let (r, ess) = convergence(&chains, &NormalScores::new(size));
            close(r, &case["r_hat"], &format!("{name}: r_hat by table"));
            close(
                ess,
                &case["ess_bulk"],
                &format!("{name}: ess_bulk by table"),
            );
        }
        close(
            ess_tail(&chains),
            &case["ess_tail"],
            &format!("{name}: ess_tail"),
        );
        close(
            ess_mean(&chains),
            &case["ess_mean"],
            &format!("{name}: ess_mean"),
        );
        close(
            mcse_mean(&chains),
            &case["mcse_mean"],
            &format!("{name}: mcse_mean"),
        );
    }
}

#[test]
fn too_little_is_not_a_number() {
    let none: [Vec<f64>; 0] = [];
    assert!(r_hat(&none).is_nan() && ess_bulk(&none).is_nan() && ess_tail(&none).is_nan());
    let short = [vec![1.0, 2.0, 3.0], vec![1.0, 2.0, 3.0]];
    assert!(r_hat(&short).is_nan() && ess_mean(&short).is_nan() && mcse_mean(&short).is_nan());
    let missing = [vec![1.0, f64::NAN, 3.0, 4.0], vec![1.0, 2.0, 3.0, 4.0]];
    assert!(r_hat(&missing).is_nan() && ess_bulk(&missing).is_nan());
    let ragged = [vec![1.0, 2.0, 3.0, 4.0], vec![1.0, 2.0, 3.0, 4.0, 5.0]];
    assert!(ess_bulk(&ragged).is_nan());
}

/// AR(1) with coefficient ρ has τ = (1 + ρ)/(1 − ρ); white noise has 1.
///
/// 200 000 samples; the estimate's relative sd is about √(4·2·τ/n·M) with M ≈ 6τ lags kept: below 2.5 % at ρ = 0.9, so
/// 12 % is more than 4 sd (false alarm below 1e-4 per case, and the seed is fixed).
#[test]
fn autocorrelation_time_of_autoregressions() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for rho in [0.0, 0.5, 0.9] {
        let mut x = 0.0;
        let series: Vec<f64> = (0..200_000)
            .map(|_| {
                let u: f64 = (0..12).map(|_| rng.random::<f64>()).sum();
                x = rho * x + u - 6.0;
                x
            })
            .collect();
        let expected = (1.0 + rho) / (1.0 - rho);
        let whole = integrated_autocorrelation_time(&[&series]);
        let runs: Vec<&[f64]> = series.chunks(777).collect();
        let cut = integrated_autocorrelation_time(&runs);
        assert!((whole / expected - 1.0).abs() < 0.12, "rho {rho}: {whole}");
        assert!(
            (cut / expected - 1.0).abs() < 0.12,
            "rho {rho}: {cut} in runs"
        );
    }
}

#[test]
fn autocorrelation_time_by_hand() {
    // r_0 = 1, r_1 = 3/4, r_2 = 1/2, r_3 = 1/4: pairs 7/4 and 3/4, τ = −1 + 2(7/4 + 3/4).
    assert!((integrated_autocorrelation_time(&[&[1.0, 1.0, 1.0, 1.0]]) - 4.0).abs() < 1e-15);
    // Alternating: r_1 = −3/4, pairs 1/4 and 1/4: τ = 0, and 1 is the least.
    assert_eq!(
        integrated_autocorrelation_time(&[&[1.0, -1.0, 1.0, -1.0]]),
        1.0
    );
    assert_eq!(integrated_autocorrelation_time(&[&[0.0; 9]]), 1.0);
    assert_eq!(integrated_autocorrelation_time(&[&[1.0], &[2.0]]), 1.0);
    assert_eq!(integrated_autocorrelation_time(&[]), 1.0);
}
