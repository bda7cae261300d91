//! Bags of ROS through the program: the same answer as from CSV, exit codes for broken ones, predictions out.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

#[path = "../../twincal-io/tests/common/logs.rs"]
#[allow(dead_code, reason = "other tests use other parts of these generators")]
mod logs;
#[path = "../../twincal-io/tests/log_bags/write.rs"]
#[allow(dead_code, reason = "other tests use other parts of these generators")]
mod write;

use crate::common;
use crate::common::{csv, fitted_copy, folder, run};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use write::{Message, bag, plain};

/// No accelerations in a bag: the filter is on.
const SETTINGS: &str = "[library]\nterms = [\"sin(q2)\"]\ngeneric = false\nfriction = [\"viscous\"]\noffset = false\n\
                        motor_inertia = false\n";

/// Header and rows of a log at 50 Hz without accelerations.
fn table(rows: usize) -> Vec<Vec<f64>> {
    let text = csv(rows, &|_, row| row);
    text.lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect()
}

fn messages(rows: usize) -> Vec<Message> {
    table(rows)
        .iter()
        .map(|row| Message {
            stamp: (row[0] * 1e9).round() as u64,
            names: vec!["elbow".into(), "shoulder".into()],
            lists: [(2, 1), (4, 3), (8, 7)]
                .map(|(elbow, shoulder)| vec![row[elbow], row[shoulder]]),
        })
        .collect()
}

fn fit(folder: &Path, log: &str, more: &[&str]) -> common::Run {
    fs::write(folder.join("bag.toml"), SETTINGS).unwrap();
    let base = [
        "fit", log, "--model", "arm.urdf", "--config", "bag.toml", "-o", "out", "--force",
    ];
    run(folder, base.iter().chain(more))
}

fn result(folder: &Path) -> serde_json::Value {
    serde_json::from_str(&fs::read_to_string(folder.join("out/result.json")).unwrap()).unwrap()
}

fn codes(folder: &Path) -> Vec<String> {
    let result = result(folder);
    let findings = result["findings"].as_array().unwrap().iter();
    findings
        .map(|f| f["code"].as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn a_bag_gives_the_answer_of_its_csv() {
    let folder = folder();
    let folder = folder.path();
    let mut text = "t,q1,q2,qd1,qd2,tau1,tau2\n".to_owned();
    for row in table(2000) {
        let cells = [0, 1, 2, 3, 4, 7, 8].map(|column: usize| row[column].to_string());
        text += &format!("{}\n", cells.join(","));
    }
    fs::write(folder.join("table.csv"), text).unwrap();
    fit(folder, "table.csv", &[]).expect(0);
    let expected = result(folder);
    fs::create_dir(folder.join("rosbag")).unwrap();
    let messages = messages(2000);
    fs::write(folder.join("rosbag/part_0.mcap"), bag(&messages[..900])).unwrap();
    fs::write(folder.join("rosbag/part_1.mcap"), bag(&messages[900..])).unwrap();
    fs::write(folder.join("run.mcap"), bag(&messages)).unwrap();
    for log in ["run.mcap", "rosbag"] {
        fit(folder, log, &[]).expect(0);
        let found = result(folder);
        for key in ["terms", "components"] {
            assert!(expected[key].is_array(), "{key}");
            assert_eq!(found[key], expected[key], "{log}: {key}");
        }
        let codes = codes(folder);
        for code in ["time_source", "effort_is_joint_torque"] {
            assert!(
                codes.iter().any(|found| found == code),
                "{code} in {codes:?}"
            );
        }
        assert_eq!(codes.contains(&"no_metadata".to_owned()), log == "rosbag");
    }
}

#[test]
fn torque_from_a_topic_of_another_type_gives_the_answer_of_joint_states() {
    let folder = folder();
    let folder = folder.path();
    let messages = messages(2000);
    fs::write(folder.join("run.mcap"), bag(&messages)).unwrap();
    fit(folder, "run.mcap", &[]).expect(0);
    let expected = result(folder);
    let mut mapped = write::Bag::new(None);
    mapped.topic("/torque", Some("std_msgs/msg/Float64MultiArray"), "cdr");
    for message in &messages {
        let mut states = message.clone();
        let torque = std::mem::take(&mut states.lists[2]);
        mapped.message("/joint_states", &states);
        // no dimensions, no offset, two numbers
        let mut data = vec![0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0];
        torque.iter().for_each(|tau| data.extend(tau.to_le_bytes()));
        mapped.raw("/torque", message.stamp, &data);
    }
    fs::write(folder.join("mapped.mcap"), mapped.finish()).unwrap();
    let columns = "tau = { elbow = \"/torque:data[0]\", shoulder = \"/torque:data[1]\" }";
    let settings = format!("{SETTINGS}[columns]\n{columns}\n");
    fs::write(folder.join("mapped.toml"), settings).unwrap();
    let base = ["--model", "arm.urdf", "--config", "mapped.toml"];
    let fit = ["fit", "mapped.mcap", "-o", "out", "--force"];
    run(folder, fit.iter().chain(&base)).expect(0);
    assert_eq!(result(folder)["terms"], expected["terms"]);
    for code in ["log_time", "parts_merged", "columns"] {
        let codes = codes(folder);
        assert!(
            codes.iter().any(|found| found == code),
            "{code} in {codes:?}"
        );
    }
    let doctor = ["doctor", "mapped.mcap"];
    let done = run(folder, doctor.iter().chain(&base));
    let words: String = done.out.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words.contains("/torque:data[1]"), "{words}");
    assert!(words.contains("elbow = \"/torque:data[0]\""), "{words}");
}

/// Fits a file of these bytes.
fn fit_bytes(bytes: &[u8], more: &[&str]) -> (tempfile::TempDir, common::Run) {
    let folder = folder();
    fs::write(folder.path().join("run.mcap"), bytes).unwrap();
    let done = fit(folder.path(), "run.mcap", more);
    (folder, done)
}

#[test]
fn case_32_an_empty_effort_is_bad_input() {
    let mut messages = messages(500);
    messages
        .iter_mut()
        .for_each(|message| message.lists[2].clear());
    let (_, done) = fit_bytes(&bag(&messages), &[]);
    done.expect(2)
        .says(&["run.mcap", "`/joint_states`", "effort[] is empty"]);
}

#[test]
fn case_52_a_truncated_bag_is_degraded() {
    let bytes = bag(&messages(2000));
    let (folder, done) = fit_bytes(&bytes[..bytes.len() / 2], &[]);
    let done = done.expect(3);
    assert!(done.out.contains("cut off at byte"), "{}", done.out);
    assert!(codes(folder.path()).contains(&"truncated".to_owned()));
}

#[test]
fn case_53_a_damaged_chunk_is_degraded_and_with_strict_bad_input() {
    let mut bytes = plain(&messages(2000));
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    let (folder, done) = fit_bytes(&bytes, &[]);
    let done = done.expect(3);
    assert!(done.out.contains("damaged"), "{}", done.out);
    assert!(codes(folder.path()).contains(&"damaged_chunks".to_owned()));
    let (folder, done) = fit_bytes(&bytes, &["--strict"]);
    done.expect(2);
    assert!(!folder.path().join("out").exists());
}

#[test]
fn case_56_a_git_lfs_pointer_is_bad_input() {
    let (_, done) = fit_bytes(
        b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\n",
        &[],
    );
    done.expect(2).says(&["Git LFS pointer", "git lfs pull"]);
}

#[test]
fn case_63_a_bag_that_names_files_outside_is_bad_input() {
    let folder = folder();
    fs::write(folder.path().join("x.mcap"), bag(&messages(500))).unwrap();
    fs::create_dir(folder.path().join("rosbag")).unwrap();
    let text = "rosbag2_bagfile_information:\n  relative_file_paths: [../x.mcap]\n";
    fs::write(folder.path().join("rosbag/metadata.yaml"), text).unwrap();
    fit(folder.path(), "rosbag", &[]).expect(2).says(&[
        "metadata.yaml",
        "`../x.mcap`",
        "outside the bag's folder",
    ]);
}

#[test]
fn case_31_target_moment_is_refused_by_the_program() {
    let folder = folder();
    let text = csv(400, &|_, row| row).replace("tau1", "target_moment_0");
    fs::write(folder.path().join("run.csv"), text).unwrap();
    let settings = format!(
        "{}[columns]\ntau = {{ shoulder = \"target_moment_0\" }}\n",
        common::QUICK
    );
    fs::write(folder.path().join("quick.toml"), &settings).unwrap();
    common::fit(folder.path(), &["-o", "out"])
        .expect(2)
        .says(&["`target_moment_0`", "accept_model_torque"]);
    let settings = format!("{settings}[log]\naccept_model_torque = true\n");
    fs::write(folder.path().join("quick.toml"), settings).unwrap();
    common::fit(folder.path(), &["-o", "out"]).expect(0);
}

#[test]
fn predictions_go_out_as_messages_with_the_numbers_of_the_csv() {
    let folder = fitted_copy();
    let folder = folder.path();
    for output in ["p.csv", "p.mcap", "q.mcap"] {
        run(
            folder,
            ["predict", "run.csv", "--twin", "twin", "-o", output],
        )
        .expect(0);
    }
    let bytes = fs::read(folder.join("p.mcap")).unwrap();
    assert_eq!(bytes, fs::read(folder.join("q.mcap")).unwrap());
    let text = fs::read_to_string(folder.join("p.csv")).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let column = |name: &str| header.iter().position(|h| *h == name).unwrap();
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let topic = message.channel.topic.clone();
        let row = counts.entry(topic.clone()).or_default();
        let time: f64 = rows[*row][0].parse().unwrap();
        assert_eq!(message.log_time, (time * 1e9).round() as u64);
        let schema = message.channel.schema.as_ref().unwrap();
        if topic == "/twincal/extrapolating" {
            assert_eq!(schema.name, "std_msgs/msg/Bool");
            let flag = if rows[*row][column("extrapolating")] == "true" {
                1
            } else {
                0
            };
            assert_eq!(message.data[4], flag);
        } else {
            assert_eq!(schema.name, "sensor_msgs/msg/JointState");
            let words = [
                ("/twincal/measured", "tau_meas"),
                ("/twincal/nominal", "tau_nom"),
                ("/twincal/calibrated", "tau"),
                ("/twincal/low95", "tau_low95"),
                ("/twincal/high95", "tau_high95"),
            ];
            let word = words.iter().find(|(name, _)| *name == topic).unwrap().1;
            // Effort is what the message ends with.
            let end = message.data.len();
            for (joint, at) in [("shoulder", end - 16), ("elbow", end - 8)] {
                let value = f64::from_le_bytes(message.data[at..at + 8].try_into().unwrap());
                let cell = rows[*row][column(&format!("{joint}.{word}"))];
                assert_eq!(value, cell.parse::<f64>().unwrap());
            }
        }
        *row += 1;
    }
    assert_eq!(counts.len(), 6);
    assert!(
        counts.values().all(|count| *count == rows.len()),
        "{counts:?}"
    );
}
