//! NPZ files, and tables of well-known recorders.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common::logs::{arm, motion, robot};
use crate::common::refusals::{contains, refused};
use proptest::prelude::*;
use std::fs;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};
use twincal::robot::JointKind;
use twincal::signal::Recording;
use twincal::{Code, Finding};
use twincal_io::Result;
use twincal_io::log::{LogOptions, Preset, TorqueSource, parse_log, read_csv, read_log};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures/npz")
        .join(name)
}

fn read(name: &str) -> Result<(Recording, Vec<Finding>)> {
    read_log(&fixture(name), &arm(), &LogOptions::default())
}

/// An NPZ file of these entries, reading it.
fn read_entries(entries: &[(&str, Vec<u8>)], method: CompressionMethod) -> Result<Recording> {
    let read = read_npz(zipped(entries, method), &LogOptions::default());
    read.map(|(recording, _)| recording)
}

fn read_npz(bytes: Vec<u8>, options: &LogOptions) -> Result<(Recording, Vec<Finding>)> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    fs::write(&path, bytes).unwrap();
    read_log(&path, &arm(), options)
}

fn zipped(entries: &[(&str, Vec<u8>)], method: CompressionMethod) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in entries {
        let options = SimpleFileOptions::default().compression_method(method);
        writer.start_file(format!("{name}.npy"), options).unwrap();
        writer.write_all(content).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// A NumPy array with this header text.
fn array(header: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

fn doubles(shape: &str, values: &[f64]) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
    let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    array(&header, &data)
}

#[test]
fn arrays_of_numpy_are_read_to_their_numbers() {
    for (name, has_velocity) in [
        ("tables.npz", true),
        ("named.npz", true),
        ("columns.npz", false),
    ] {
        let (recording, _) = read(name).unwrap();
        assert_eq!(recording.time.len(), 100, "{name}");
        for (joint, channels) in recording.joints.iter().enumerate() {
            assert_eq!(channels.qd.is_some(), has_velocity);
            for (i, t) in recording.time.iter().enumerate() {
                assert_eq!(*t, i as f64 / 100.0);
                let [q, qd, qdd] = motion(joint, *t);
                let near = |read: f64, written: f64| {
                    assert!(
                        (read - written).abs() < 1e-12,
                        "{name}, joint {joint}, row {i}"
                    );
                };
                near(channels.q[i], q);
                near(channels.qd.as_ref().map_or(qd, |values| values[i]), qd);
                near(channels.tau.as_ref().unwrap()[i], qdd + 0.5 * qd);
            }
        }
    }
}

/// Options of a `twincal.toml` with this text in `[columns]`.
fn columns(text: &str) -> LogOptions {
    let config = format!("[columns]\n{text}\n");
    let config = twincal_io::config::Config::parse("twincal.toml", &config).unwrap();
    let settings = config.settings().unwrap();
    settings.log.options(std::path::Path::new("run.npz"))
}

/// Time, positions and torques as whole arrays, and names of joints if they are given.
fn whole_arrays(names: Option<Vec<u8>>) -> Vec<u8> {
    let table: Vec<f64> = (0..12).map(f64::from).collect();
    let mut entries = vec![
        ("time_ms", doubles("(4,)", &[0.0, 100.0, 200.0, 300.0])),
        ("positions", doubles("(4, 3)", &table)),
        ("torques", doubles("(4, 2)", &table[..8])),
    ];
    entries.extend(names.map(|names| ("joints", names)));
    zipped(&entries, CompressionMethod::Stored)
}

#[test]
fn arrays_and_their_columns_are_mapped_by_the_config() {
    let text = "time = \"time_ms\"\ntime_unit = \"ms\"\nq = { shoulder = \"positions[:,2]\", elbow = \"positions[:, 0]\" }\ntau = \"torques\"";
    let (recording, findings) = read_npz(whole_arrays(None), &columns(text)).unwrap();
    assert_eq!(recording.time, [0.0, 0.1, 0.2, 0.3]);
    assert_eq!(recording.joints[0].q, [2.0, 5.0, 8.0, 11.0]);
    assert_eq!(recording.joints[1].q, [0.0, 3.0, 6.0, 9.0]);
    assert_eq!(
        recording.joints[0].tau.as_deref().unwrap(),
        [0.0, 2.0, 4.0, 6.0]
    );
    let said = findings.iter().find(|f| f.code == Code::Columns).unwrap();
    contains(
        &said.message,
        &[
            "shoulder = positions[:,2] torques[:,0]",
            "elbow = positions[:,0] torques[:,1]",
        ],
    );
    // names in the file say whose the columns of a whole array are
    let names = array(
        "{'descr': '<U8', 'fortran_order': False, 'shape': (2,), }",
        &["elbow", "shoulder"]
            .map(|name| {
                let mut cell = [0; 32];
                for (at, c) in name.chars().enumerate() {
                    cell[4 * at..4 * at + 4].copy_from_slice(&u32::from(c).to_le_bytes());
                }
                cell
            })
            .concat(),
    );
    let (recording, _) = read_npz(whole_arrays(Some(names)), &columns(text)).unwrap();
    assert_eq!(
        recording.joints[1].tau.as_deref().unwrap(),
        [0.0, 2.0, 4.0, 6.0]
    );
}

#[test]
fn maps_that_do_not_fit_the_arrays_are_refused() {
    for (text, words) in [
        (
            "q = \"positions\"",
            &[
                "`positions` has 3 columns, the model has 2",
                "positions[:,0]",
            ][..],
        ),
        (
            "q = \"position\"",
            &["no array `position`", "did you mean `positions`?"],
        ),
        (
            "q = { elbow = \"positions[:,3]\" }",
            &["has 3 columns, none of number 3 (from 0)"],
        ),
        (
            "q = { elbow = \"time_ms[:,0]\" }",
            &["`time_ms` has shape [4]", "samples × joints"],
        ),
        (
            "q = { elbow = \"positions[:,:]\" }",
            &["gives joint `elbow` all of"],
        ),
    ] {
        let options = columns(&format!("time = \"time_ms\"\n{text}"));
        contains(&refused(read_npz(whole_arrays(None), &options)), words);
    }
}

#[test]
fn one_name_with_a_star_means_a_column_per_joint() {
    let zero = "stamp_us,pos_0,pos_1,load 0 Nm,load 1 Nm\n0,1,2,3,4\n500000,5,6,7,8\n";
    let one = zero
        .replace("_1,", "_2,")
        .replace("_0,", "_1,")
        .replace("load 1", "load 2")
        .replace("load 0", "load 1");
    let text = "time = \"stamp_us\"\ntime_unit = \"us\"\nq = \"pos_*\"\ntau = \"load * Nm\"";
    for csv in [zero, &one] {
        let (recording, _) = table(csv, 2, &columns(text)).unwrap();
        assert_eq!(recording.time, [0.0, 0.5]);
        assert_eq!(recording.joints[1].q, [2.0, 6.0]);
        assert_eq!(recording.joints[0].tau.as_deref().unwrap(), [3.0, 7.0]);
    }
    for (text, words) in [
        (
            "q = \"pos_0\"",
            &["is one column for 2 moving joints", "write * where"][..],
        ),
        ("q = \"pos*\"", &["`pos1` is not there"]),
    ] {
        let text = format!("time = \"stamp_us\"\n{text}");
        contains(&refused(table(zero, 2, &columns(&text))), words);
    }
}

#[test]
fn other_number_types_are_read() {
    let counts: Vec<u8> = (0..4_i32).flat_map(|i| (i - 2).to_be_bytes()).collect();
    let singles: Vec<u8> = [0.5_f32, -1.25, 2.0, 8.0]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    let header =
        |kind: &str| format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': (4,), }}");
    let recording = read_entries(
        &[
            ("t", doubles("(4,)", &[0.0, 0.1, 0.2, 0.3])),
            ("q1", array(&header(">i4"), &counts)),
            ("q2", array(&header("<f4"), &singles)),
        ],
        CompressionMethod::Stored,
    )
    .unwrap();
    assert_eq!(recording.joints[0].q, [-2.0, -1.0, 0.0, 1.0]);
    assert_eq!(recording.joints[1].q, [0.5, -1.25, 2.0, 8.0]);
}

#[test]
fn a_channel_of_text_is_refused() {
    let header = "{'descr': '<U1', 'fortran_order': False, 'shape': (1, 2), }";
    let (t, q) = (doubles("(1,)", &[0.0]), doubles("(1, 2)", &[0.0; 2]));
    let entries = [("t", t), ("q", q), ("qd", array(header, &[0; 8]))];
    let read = read_entries(&entries, CompressionMethod::Stored);
    contains(&refused(read), &["array `qd` is text, not a number"]);
}

/// Also where other arrays are wide.
#[test]
fn an_array_with_a_row_per_joint_is_told_to_be_transposed() {
    let entries = [
        ("t", doubles("(4,)", &[0.0, 0.1, 0.2, 0.3])),
        ("lidar", doubles("(2, 9)", &[0.0; 18])),
        ("q", doubles("(2, 4)", &[0.0; 8])),
    ];
    contains(
        &refused(read_entries(&entries, CompressionMethod::Stored)),
        &["array `q` is 2 × 4: samples come first", "array.T"],
    );
}

#[test]
fn case_49_pickled_objects_are_never_read() {
    contains(
        &refused(read("pickled.npz")),
        &["array `notes`", "pickled Python objects", "never read"],
    );
}

#[test]
fn case_50_a_header_that_lies_about_its_shape_is_refused() {
    let t = doubles("(4,)", &[0.0; 4]);
    for (shape, values) in [
        ("(4, 3)", 8),
        ("(4, 1)", 8),
        ("(4611686018427387904, 4)", 0),
        ("(99999999999999999999, 2)", 8),
    ] {
        let entries = [("t", t.clone()), ("q", doubles(shape, &vec![0.0; values]))];
        contains(
            &refused(read_entries(&entries, CompressionMethod::Stored)),
            &["array `q`"],
        );
    }
    let entries = [("t", t), ("q", doubles("(5, 2)", &[0.0; 10]))];
    contains(
        &refused(read_entries(&entries, CompressionMethod::Stored)),
        &["array `q` has 5 samples, `t` has 4"],
    );
}

#[test]
fn case_51_an_entry_that_grows_without_measure_is_refused() {
    let zeros = doubles("(1000000, 2)", &vec![0.0; 2_000_000]);
    let t = doubles("(1000000,)", &vec![0.0; 1_000_000]);
    let entries = [("t", t), ("q", zeros)];
    contains(
        &refused(read_entries(&entries, CompressionMethod::Deflated)),
        &["refusing to expand"],
    );
    let mut bytes = fs::read(fixture("tables.npz")).unwrap();
    bytes.truncate(bytes.len() - 40);
    contains(
        &refused(read_npz(bytes, &LogOptions::default())),
        &["is not a whole NPZ file"],
    );
}

/// A changed number in an array, also in its last block, and a changed name: the CRC is compared at the end of an entry.
#[test]
fn a_changed_byte_in_an_array_is_refused() {
    let table: Vec<f64> = (0..20_000).map(f64::from).collect();
    let time: Vec<f64> = (0..10_000).map(|k| f64::from(k) / 100.0).collect();
    let entries = [
        ("t", doubles("(10000,)", &time)),
        ("q", doubles("(10000, 2)", &table)),
        ("tau", doubles("(10000, 2)", &table)),
    ];
    let whole = zipped(&entries, CompressionMethod::Stored);
    assert!(read_npz(whole.clone(), &LogOptions::default()).is_ok());
    for value in [12_345.0_f64, 19_999.0] {
        let mut changed = whole.clone();
        let bytes = value.to_le_bytes();
        let at = changed.windows(8).position(|eight| eight == bytes).unwrap();
        changed[at + 5] ^= 0x10;
        contains(
            &refused(read_npz(changed, &LogOptions::default())),
            &["array `q` is damaged", "checksum", "write it again"],
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_bytes_in_an_npz_file_are_answered(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        deflated in any::<bool>(),
    ) {
        let method = if deflated { CompressionMethod::Deflated } else { CompressionMethod::Stored };
        let entries = [("t", doubles("(4,)", &[0.0, 0.1, 0.2, 0.3])), ("q", doubles("(4, 2)", &[1.0; 8]))];
        let mut bytes = zipped(&entries, method);
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Ok((recording, _)) = parse_log("run.npz", bytes.leak(), &arm(), &LogOptions::default()) {
            prop_assert!(recording.time.len() <= 4);
        }
    }
}

/// Six joints as Universal Robots names them, or as many as asked.
fn industrial(count: usize) -> twincal::robot::Robot {
    let names: Vec<String> = (1..=count).map(|i| format!("axis_{i}")).collect();
    let joints: Vec<(&str, JointKind)> = names
        .iter()
        .map(|name| (name.as_str(), JointKind::Revolute))
        .collect();
    robot(&joints)
}

fn table(text: &str, joints: usize, options: &LogOptions) -> Result<(Recording, Vec<Finding>)> {
    read_csv(
        text.as_bytes(),
        text.len() as u64,
        "run.csv",
        &industrial(joints),
        options,
    )
}

/// What RTDE's record.py writes: blanks between columns, joints from 0.
fn rtde(torque: &str) -> String {
    let vector = |name: &str| {
        (0..6)
            .map(|i| format!("{name}_{i}"))
            .collect::<Vec<_>>()
            .join(" ")
    };
    let mut text = format!(
        "timestamp {} {} {} {}\n",
        vector("target_q"),
        vector("actual_q"),
        vector("actual_qd"),
        vector(torque)
    );
    for row in 0..20 {
        let cells: Vec<String> = (0..24).map(|column| format!("{}", column + row)).collect();
        text += &format!(
            "{:.3} {}\n",
            100.0 + f64::from(row) * 0.002,
            cells.join(" ")
        );
    }
    text
}

fn constants(names: &[&str], value: f64) -> std::collections::BTreeMap<String, f64> {
    names
        .iter()
        .map(|name| ((*name).to_owned(), value))
        .collect()
}

const AXES: [&str; 6] = ["axis_1", "axis_2", "axis_3", "axis_4", "axis_5", "axis_6"];

#[test]
fn the_preset_ur_rtde_reads_currents_by_drive_constants() {
    let mut options = LogOptions {
        preset: Some(Preset::UrRtde),
        ..LogOptions::default()
    };
    let text = rtde("actual_current");
    contains(
        &refused(table(&text, 6, &options)),
        &["log.drive_constant", "no number for joint `axis_1`"],
    );
    options.torque.drive_constant = constants(&AXES, 12.5);
    let (recording, findings) = table(&text, 6, &options).unwrap();
    assert_eq!(recording.time[1], 100.002);
    for (joint, channels) in recording.joints.iter().enumerate() {
        assert_eq!(channels.q[3], (6 + joint + 3) as f64);
        assert_eq!(channels.qd.as_ref().unwrap()[3], (12 + joint + 3) as f64);
        assert_eq!(
            channels.tau.as_ref().unwrap()[3],
            12.5 * (18 + joint + 3) as f64
        );
    }
    let said = findings
        .iter()
        .find(|f| f.code == Code::TorqueSource)
        .unwrap();
    contains(
        &said.message,
        &[
            "current times drive constant of the joint's side",
            "axis_1 12.5",
        ],
    );
}

/// By the config and by the preset; other columns of that kind may hold anything.
#[test]
fn temperatures_of_drives_are_read_where_they_are_named() {
    let temperature = |recording: &Recording, joint: usize| {
        let values = recording.joints[joint].temperature.as_ref();
        values.map(|values| values[1])
    };
    let rows = "0,1,2,30,31\n0.01,1,2,40,41\n";
    let text = format!("t,q1,q2,temp1,axis_2.temperature\n{rows}").replace("40,", "warm,");
    let (recording, _) = table(&text, 2, &LogOptions::default()).unwrap();
    assert_eq!(
        [0, 1].map(|joint| temperature(&recording, joint)),
        [None; 2]
    );
    let text = format!("t,q1,q2,T0,T1\n{rows}");
    let mapped = columns("temperature = \"T*\"");
    let (recording, findings) = table(&text, 2, &mapped).unwrap();
    assert_eq!(temperature(&recording, 1), Some(41.0));
    let said = findings.iter().find(|f| f.code == Code::Columns).unwrap();
    contains(&said.message, &["axis_1 = q1 T0", "axis_2 = q2 T1"]);
    let wrong = columns("temperature = { axis_1 = \"T7\" }");
    contains(
        &refused(table(&text, 2, &wrong)),
        &["no column `T7`", "[columns] temperature"],
    );
    let shared = columns("temperature = { axis_1 = \"T0\", axis_2 = \"T0\" }");
    contains(
        &refused(table(&text, 2, &shared)),
        &["`T0`", "temperature of joint `axis_1`", "joint `axis_2`"],
    );
    let mut options = LogOptions {
        preset: Some(Preset::UrRtde),
        ..LogOptions::default()
    };
    options.torque.drive_constant = constants(&AXES, 12.5);
    let text = rtde("actual_current").replace("target_q", "joint_temperatures");
    let (recording, _) = table(&text, 6, &options).unwrap();
    assert_eq!(temperature(&recording, 5), Some(6.0));
}

#[test]
fn case_31_target_moment_is_no_measurement() {
    let mut options = LogOptions {
        preset: Some(Preset::UrRtde),
        ..LogOptions::default()
    };
    options.torque.source = Some(TorqueSource::Joint);
    options.columns.tau = AXES
        .iter()
        .enumerate()
        .map(|(i, axis)| ((*axis).to_owned(), format!("target_moment_{i}")))
        .collect();
    let text = rtde("target_moment");
    contains(
        &refused(table(&text, 6, &options)),
        &[
            "`target_moment_0`",
            "`axis_1`",
            "controller's own model",
            "accept_model_torque = true",
        ],
    );
    options.torque.accept_model_torque = true;
    let (recording, _) = table(&text, 6, &options).unwrap();
    assert_eq!(recording.joints[5].tau.as_ref().unwrap()[0], 23.0);
}

#[test]
fn the_preset_franka_reads_both_forms_of_its_log() {
    let options = LogOptions {
        preset: Some(Preset::Franka),
        ..LogOptions::default()
    };
    // libfranka before and since 0.15: the older one repeats q_d of the state in the command
    for (time, rate, state, command) in [
        ("duration", " success rate", "", ""),
        ("time", "success_rate", "state.", "cmd."),
    ] {
        let vector = |prefix: &str, name: &str| {
            (0..7)
                .map(|i| format!("{prefix}{name}[{i}]"))
                .collect::<Vec<_>>()
                .join(", ")
        };
        let columns: Vec<String> = ["q", "q_d", "dq", "dq_d", "tau_J"]
            .iter()
            .map(|name| vector(state, name))
            .collect();
        let mut text = format!(
            "{time},{rate}, {},{},{}\n",
            columns.join(","),
            vector(command, "q_d"),
            vector(command, "tau_J_d")
        );
        for row in 0..20 {
            let cells: Vec<String> = (0..49).map(|column| format!("{}", column + row)).collect();
            text += &format!("{},1,{}\n", 5000 + row, cells.join(","));
        }
        let (recording, findings) = table(&text, 7, &options).unwrap();
        assert_eq!(recording.time[1], 5.001);
        for (joint, channels) in recording.joints.iter().enumerate() {
            assert_eq!(channels.q[2], (joint + 2) as f64);
            assert_eq!(channels.qd.as_ref().unwrap()[2], (14 + joint + 2) as f64);
            assert_eq!(channels.tau.as_ref().unwrap()[2], (28 + joint + 2) as f64);
        }
        assert!(findings.iter().any(|f| f.code == Code::TimeUnit));
    }
}

fn options_of(text: &str, log: &str) -> Result<LogOptions> {
    let config = twincal_io::config::Config::parse("twincal.toml", text)?;
    Ok(config.settings()?.log.options(Path::new(log)))
}

#[test]
fn the_config_says_topics_presets_and_torque_of_all_logs_or_of_one() {
    let text = "[log]\ntopic = \"/joint_states\"\ntorque = \"current\"\ngear_ratio = { a = 100 }\ndrive_constant = { a = 0.1, \"b c\" = -2 }\n";
    let options = options_of(text, "x.mcap").unwrap();
    assert_eq!(options.topics, ["/joint_states"]);
    assert_eq!(options.torque_source(), TorqueSource::Current);
    assert_eq!(options.torque.gear_ratio, constants(&["a"], 100.0));
    assert_eq!(options.torque.drive_constant["b c"], -2.0);
    let text = "[[log]]\nfile = \"a.mcap\"\ntopic = [\"/q\", \"/tau\"]\n[[log]]\nfile = \"b.csv\"\npreset = \"ur-rtde\"\ndrive_constant = { a = 10.0 }\n";
    assert_eq!(options_of(text, "a.mcap").unwrap().topics, ["/q", "/tau"]);
    let options = options_of(text, "b.csv").unwrap();
    assert_eq!(
        (options.preset, options.torque_source()),
        (Some(Preset::UrRtde), TorqueSource::Current)
    );
    assert_eq!(options_of(text, "c.csv").unwrap(), LogOptions::default());
    assert_eq!(
        options_of("", "c.csv").unwrap().torque_source(),
        TorqueSource::Joint
    );
    for (text, words) in [
        (
            "[log]\ngear_ratio = { a = 100 }",
            "twincal.toml:2:14: key `log.gear_ratio`: has no use",
        ),
        (
            "[log]\ntorque = \"motor\"\ndrive_constant = { a = 1 }",
            "key `log.drive_constant`: has no use",
        ),
        (
            "[log]\ntorque = \"motor\"\ngear_ratio = { a = 0 }",
            "key `log.gear_ratio.a`: 0 is out of range",
        ),
        ("[log]\ntorque = \"motors\"", "unknown variant `motors`"),
        ("[log]\npreset = \"ur\"", "unknown variant `ur`"),
        ("[log]\ntopics = \"/q\"", "did you mean `topic`?"),
        (
            "[[log]]\nfile = \"a\"\ntorque = \"none\"\ngear_ratio = { a = 1 }",
            "has no use",
        ),
    ] {
        contains(&refused(options_of(text, "a")), &[words]);
    }
}
