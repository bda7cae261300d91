//! What the answer itself may do: scales, outliers, extrapolation; and our own bugs.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common;
use crate::common::{QUICK, command, csv, fit, folder, run};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

fn result(folder: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join("out/result.json")).unwrap()).unwrap()
}

#[test]
fn case_89_the_scale_of_a_candidate_does_not_matter() {
    let fitted = |term: &str| {
        let folder = folder();
        let config = QUICK.replace("\"sin(q2)\"", &format!("\"{term}\""));
        assert_ne!(config, QUICK.replace(term, ""));
        fs::write(folder.path().join("quick.toml"), config).unwrap();
        fit(folder.path(), &["-o", "out"]).expect(0);
        let terms = result(folder.path())["terms"].clone();
        let number = |key: &str, index: usize| terms[index][key].as_f64().unwrap();
        let terms = terms.as_array().unwrap().len();
        (0..terms)
            .map(|i| [number("pip", i), number("mean", i), number("sd", i)])
            .collect::<Vec<_>>()
    };
    let plain = fitted("sin(q2)");
    for scale in [1e-12, 1e12] {
        let scaled = fitted(&format!("{scale}*sin(q2)"));
        assert_eq!(scaled.len(), plain.len());
        for (index, (a, b)) in plain.iter().zip(&scaled).enumerate() {
            let factor = if index == 0 { scale } else { 1.0 };
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-6 * a.abs().max(1e-12);
            let alike = near(a[0], b[0]) && near(a[1], b[1] * factor) && near(a[2], b[2] * factor);
            assert!(alike, "{scale}: {a:?} {b:?}");
        }
    }
}

#[test]
fn case_92_outliers_are_named_and_coverage_stays() {
    let folder = folder();
    // Every 20th torque is off by 25 sd, either way.
    let spoiled = csv(2000, &|number, mut row| {
        if number % 20 == 7 {
            let off = if number % 40 == 7 { 0.5 } else { -0.5 };
            row[7] = (row[7].parse::<f64>().unwrap() + off).to_string();
        }
        row
    });
    fs::write(folder.path().join("run.csv"), spoiled).unwrap();
    fit(folder.path(), &["-o", "out"]).expect(0);
    let result = result(folder.path());
    let said: Vec<&Value> = result["findings"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|f| f["code"] == "heavy_tails")
        .collect();
    assert_eq!(said.len(), 1, "{said:?}");
    assert_eq!(said[0]["subject"], "shoulder");
    assert_eq!(said[0]["count"], 100);
    for joint in result["validation"]["joints"].as_array().unwrap() {
        let coverage = joint["coverage95"].as_f64().unwrap();
        assert!((0.90..=0.99).contains(&coverage), "{joint}");
    }
}

/// Chains that are too short to agree are no result, unless the user says so; then the result says it. Many candidates that
/// the data hardly speak of, under a narrow slab, make chains of 100 draws disagree at two of twelve seeds, this one among them.
#[test]
fn case_90_and_91_chains_that_disagree_are_refused() {
    let folder = folder();
    let terms = [
        "sin(q2)",
        "sin(2*q1)",
        "cos(3*q1)",
        "sin(5*q1)",
        "cos(4*q2)",
        "sin(3*q2)",
        "sin(q1+2*q2)",
        "cos(2*q1-q2)",
        "sin(3*q1+q2)",
        "cos(q1-3*q2)",
        "sin(4*q1)",
        "sin(7*q2)",
        "cos(5*q1+q2)",
    ];
    let terms = terms.map(|term| format!("\"{term}\""));
    let config = format!(
        "{}[noise]\nmodel = \"iid\"\n[prior]\ninclusion = {{ probability = 0.5 }}\nslab = {{ scaled_variance = 0.1 }}\n\
         [inference]\nmethod = \"gibbs\"\nchains = 4\ndraws = 100\nseed = 2\n",
        QUICK.replace("\"sin(q2)\"", &terms.join(", "))
    );
    fs::write(folder.path().join("quick.toml"), config).unwrap();
    fit(folder.path(), &["-o", "out"])
        .expect(4)
        .says(&["4 chains of 100 draws disagree", "inference.draws"]);
    assert!(!folder.path().join("out").exists());
    fit(
        folder.path(),
        &["-o", "out", "--allow", "disagreeing-chains"],
    )
    .expect(0);
    let result = result(folder.path());
    assert_eq!(result["inference"]["method"], "gibbs");
    assert!(result["inference"]["r_hat"].as_f64().unwrap() > 1.01);
    let said = result["findings"].as_array().unwrap().iter();
    assert_eq!(said.filter(|f| f["code"] == "chains_disagree").count(), 1);
}

/// Noise that stays alike for 1/(1 − 0.95) rows: fewer effective rows, wider coefficients than the paper's likelihood, honest
/// intervals; the paper's likelihood says what it ignores.
#[test]
fn case_93_correlated_noise_counts_as_fewer_rows() {
    let folder = folder();
    let mut noise = vec![0.0_f64];
    let mut state = 7_u64;
    for _ in 0..2000 {
        let mut normal = 0.0;
        for _ in 0..12 {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            normal += (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
        }
        noise.push(0.95 * noise[noise.len() - 1] + 0.05 * normal);
    }
    let correlated = csv(2000, &|number, mut row| {
        row[7] = (row[7].parse::<f64>().unwrap() + noise[number]).to_string();
        row
    });
    fs::write(folder.path().join("run.csv"), correlated).unwrap();
    let sd = |model: &str| {
        let config = format!("{QUICK}[noise]\nmodel = \"{model}\"\n");
        fs::write(folder.path().join("quick.toml"), config).unwrap();
        fit(folder.path(), &["-o", "out", "--force"]).expect(0);
        let result = result(folder.path());
        let terms = result["terms"].as_array().unwrap();
        let own = terms.iter().find(|t| t["name"] == "shoulder.viscous");
        (own.unwrap()["sd"].as_f64().unwrap(), result.clone())
    };
    let (narrow, iid) = sd("iid");
    let warns = |result: &Value| {
        let all = result["findings"].as_array().unwrap();
        all.iter()
            .any(|f| f["code"] == "residual_correlated" && f["subject"] == "shoulder")
    };
    assert!(warns(&iid));
    let (wide, tempered) = sd("tempered");
    assert!(!warns(&tempered));
    // (1 + ρ)/(1 − ρ) = 39 rows are worth one.
    let noise = &tempered["noise"][0];
    let (n, effective) = (
        noise["n"].as_f64().unwrap(),
        noise["n_eff"].as_f64().unwrap(),
    );
    assert!(effective < n / 15.0 && effective > n / 150.0, "{noise}");
    assert!(wide > 3.0 * narrow, "{wide} {narrow}");
    let coverage = &tempered["validation"]["joints"][0]["coverage95"];
    assert!(coverage.as_f64().unwrap() > 0.85, "{coverage}");
}

/// The log of an arm whose second link had a moment of inertia below zero about its centre of mass.
#[test]
fn case_94_inertia_that_no_body_has_is_named() {
    let codes = |lost: f64| {
        let folder = folder();
        let config = "[signal]\ncutoff_hz = 0\n[library]\nfamilies = [\"tensor\", \"viscous\"]\ngeneric = false\n\
                      terms = [\"sin(q2)\"]\n";
        fs::write(folder.path().join("quick.toml"), config).unwrap();
        let log = csv(400, &|_, mut row| {
            let number = |k: usize| row[k].parse::<f64>().unwrap();
            let torque = lost * (number(5) + number(6));
            let less = [number(7) - torque, number(8) - torque];
            (row[7], row[8]) = (less[0].to_string(), less[1].to_string());
            row
        });
        fs::write(folder.path().join("run.csv"), log).unwrap();
        let done = fit(folder.path(), &["-o", "out"]);
        let result = result(folder.path());
        let all = result["findings"].as_array().unwrap().clone();
        let lost = all.iter().any(|finding| finding["severity"] == "degraded");
        let answer = result["assessment"]["answer"].as_str().unwrap();
        let code = if answer.starts_with("yes") && !lost {
            0
        } else {
            3
        };
        assert_eq!(done.code, Some(code), "{answer}: {}", done.err);
        let all = all
            .into_iter()
            .filter(|f| f["code"] == "unphysical_inertia_found");
        all.collect::<Vec<Value>>()
    };
    // The model says 0.01 kg·m² about the centre of mass.
    assert_eq!(codes(0.005), Vec::<Value>::new());
    // So far off that misfit and a prior that narrows with it could have taken all of it for noise.
    assert_eq!(codes(0.1).len(), 1);
    let said = codes(0.06);
    assert_eq!(said.len(), 1, "{said:?}");
    assert_eq!(said[0]["subject"], "fore");
    assert_eq!(said[0]["severity"], "warning");
    let message = said[0]["message"].as_str().unwrap();
    assert!(
        message.contains("link `fore`: 0.0 % of the posterior draws"),
        "{message}"
    );
}

#[test]
fn case_95_rows_outside_the_training_motion_are_flagged() {
    let folder = common::fitted_copy();
    let further = csv(400, &|number, mut row| {
        if number >= 300 {
            row[1] = (row[1].parse::<f64>().unwrap() + 2.0).to_string();
        }
        row
    });
    fs::write(folder.path().join("further.csv"), further).unwrap();
    let done = run(folder.path(), ["predict", "further.csv", "--twin", "twin"]).expect(0);
    for (number, line) in done.out.lines().skip(1).enumerate() {
        assert_eq!(line.ends_with("true"), number >= 300, "{number}: {line}");
    }
}

/// A clock that fails makes the standard library panic, as any bug of ours would.
#[test]
fn exit_code_70_is_our_bug_and_says_so() {
    let folder = folder();
    let source = "int clock_gettime(int id, void *time) { (void)id; (void)time; return -1; }\n";
    fs::write(folder.path().join("clock.c"), source).unwrap();
    let compiled = Command::new("cc")
        .args(["-shared", "-fPIC", "-o", "clock.so", "clock.c"])
        .current_dir(folder.path())
        .stderr(Stdio::inherit())
        .status()
        .unwrap();
    assert!(compiled.success());
    let output = command(folder.path())
        .args(["fit", "run.csv", "--model", "arm.urdf", "-o", "out"])
        .env("LD_PRELOAD", folder.path().join("clock.so"))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(70), "{said}");
    for words in [
        "our bug, not yours",
        "Please report it",
        env!("CARGO_PKG_VERSION"),
        "fit run.csv",
    ] {
        assert!(said.contains(words), "{words:?} is missing in:\n{said}");
    }
    assert!(!folder.path().join("out").exists());
}

/// An effect that the user's own prior holds for impossible is estimated between the two, and that is said.
#[test]
fn case_96_a_prior_that_the_data_contradict_is_told() {
    let conflicts = |prior: &str| -> Vec<Value> {
        let folder = folder();
        let config = format!("{QUICK}[noise]\nmodel = \"iid\"\n{prior}");
        fs::write(folder.path().join("quick.toml"), config).unwrap();
        fit(folder.path(), &["-o", "out"]).expect(0);
        let findings = result(folder.path())["findings"].clone();
        let findings = findings.as_array().unwrap().iter();
        let told = findings.filter(|f| f["code"] == "prior_conflict");
        told.map(|f| f["subject"].clone()).collect()
    };
    let narrow = "[prior]\nslab = { scaled_variance = 0.01 }\n";
    assert!(conflicts(narrow).contains(&Value::from("sin(q2)")));
    let noisy = "[prior]\nnoise = { shape = 50.0, scale = 5000.0 }\n";
    assert_eq!(conflicts(noisy), ["prior.noise"]);
    assert!(conflicts("").is_empty());
}

/// One candidate of all that the arm lacks: what is left stays alike for hundreds of rows, and a larger c leaves nothing.
#[test]
fn a_residual_with_a_long_memory_is_fitted_all_the_same() {
    let folder = folder();
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    let config = "[library]\nterms = [\"sin(q2)\"]\ngeneric = false\nfamilies = []\n[signal]\ncutoff_hz = 0\n";
    fs::write(folder.path().join("one.toml"), config).unwrap();
    let (log, model) = (assets.join("train1.parquet"), assets.join("arm.urdf"));
    let paths = [log.to_str().unwrap(), "--model", model.to_str().unwrap()];
    let rest = ["--config", "one.toml", "-o", "out"];
    run(folder.path(), ["fit"].iter().chain(&paths).chain(&rest)).expect(3);
    let noise = &result(folder.path())["noise"];
    assert!(noise[1]["sigma"].as_f64().unwrap() > 0.0);
}

/// A slow drift of 5 N·m on both joints that no candidate knows: 400 rows say what a few would. On one joint it is named, on both
/// nothing is left to answer.
#[test]
fn case_07_joints_whose_rows_are_all_alike_are_named_and_refused_with_their_counts() {
    let drifting = |joints: &[usize]| {
        csv(400, &|number, mut row| {
            for &joint in joints {
                let drift = 5.0 * (0.003 * number as f64).sin();
                let torque: f64 = row[7 + joint].parse().unwrap();
                row[7 + joint] = (torque + drift).to_string();
            }
            row
        })
    };
    let folder = folder();
    fs::write(folder.path().join("run.csv"), drifting(&[0])).unwrap();
    fit(folder.path(), &["-o", "out"]).expect(3);
    let findings = result(folder.path())["findings"].clone();
    let few = |f: &&Value| f["code"] == "few_effective_rows";
    let said: Vec<&Value> = findings.as_array().unwrap().iter().filter(few).collect();
    assert_eq!(said.len(), 1, "{findings}");
    assert_eq!(said[0]["subject"], "shoulder");
    assert_eq!(said[0]["count"], 400);
    fs::write(folder.path().join("run.csv"), drifting(&[0, 1])).unwrap();
    fit(folder.path(), &["-o", "none"]).expect(4).says(&[
        "the 400 rows of joint `shoulder` count as",
        "the 400 rows of joint `elbow` count as",
        "10 are needed",
    ]);
    assert!(!folder.path().join("none").exists());
}

/// With the filter off every input row is one row, whatever happened there: no incident leaves rows out.
#[test]
fn with_the_filter_off_a_torque_spike_takes_no_row() {
    let folder = folder();
    let spiked = csv(2000, &|number, mut row| {
        if number == 700 {
            row[7] = "60".into();
        }
        row
    });
    fs::write(folder.path().join("run.csv"), spiked).unwrap();
    fit(folder.path(), &["-o", "out"]).expect(0);
    let noise = &result(folder.path())["noise"];
    for joint in 0..2 {
        assert_eq!(noise[joint]["n"].as_f64(), Some(2000.0), "{noise}");
    }
}

/// A model that explains its log to the last digit, or but for 1e-9 N·m: nothing is missing, and every number is one.
#[test]
fn a_log_of_the_models_own_torque_lacks_nothing() {
    let folder = folder();
    fit(folder.path(), &["-o", "twin"]).expect(0);
    let predict = ["predict", "run.csv", "--twin", "twin", "-o", "nominal.csv"];
    run(folder.path(), predict).expect(0);
    let column = |name: &str| -> Vec<String> {
        let text = fs::read_to_string(folder.path().join("nominal.csv")).unwrap();
        let mut lines = text.lines();
        let place = lines.next().unwrap().split(',').position(|n| n == name);
        lines
            .map(|line| line.split(',').nth(place.unwrap()).unwrap().to_owned())
            .collect()
    };
    let nominal = [column("shoulder.tau_nom"), column("elbow.tau_nom")];
    for error in [0.0, 1e-9] {
        let own = csv(400, &|number, mut row| {
            let sign = if number * 7919 % 14 < 7 {
                error
            } else {
                -error
            };
            for joint in 0..2 {
                let torque: f64 = nominal[joint][number].parse().unwrap();
                row[7 + joint] = (torque + sign).to_string();
            }
            row
        });
        fs::write(folder.path().join("own.csv"), own).unwrap();
        for config in ["", "[signal]\ncutoff_hz = 0\n"] {
            fs::write(folder.path().join("own.toml"), config).unwrap();
            let rest = ["--config", "own.toml", "-o", "out", "--force"];
            let command = ["fit", "own.csv", "--model", "arm.urdf"];
            run(folder.path(), command.iter().chain(&rest)).expect(0);
            let result = result(folder.path());
            for term in result["terms"].as_array().unwrap() {
                let pip = term["pip"].as_f64().unwrap_or(0.0);
                assert!(
                    pip < 0.5 || term["seen"] == false,
                    "{error} {config} {term}"
                );
                assert!(term["pip"].is_null() || term["mean"].is_f64(), "{term}");
            }
        }
    }
}

/// One variance for all joints is one σ for all joints, whatever the likelihood.
#[test]
fn joints_that_share_a_variance_show_the_same_sigma() {
    let folder = folder();
    for model in ["iid", "tempered", "ar1"] {
        let config = format!("{QUICK}[noise]\nmodel = \"{model}\"\nper_joint = false\n");
        fs::write(folder.path().join("quick.toml"), config).unwrap();
        fit(folder.path(), &["-o", "out", "--force"]).expect(0);
        let noise = &result(folder.path())["noise"];
        assert!(noise[0]["sigma"].as_f64().unwrap() > 0.0);
        assert_eq!(noise[0]["sigma"], noise[1]["sigma"], "{model}");
        assert_eq!(noise[0]["rho"], noise[1]["rho"], "{model}");
    }
}
