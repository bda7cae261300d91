//! Files in which something comes far too often are refused by name, number and remedy within 5 s of CPU and 512 MiB of address space;
//! honest sizes are read. The shell holds both limits, so that a test cannot pass by luck.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common::{Run, folder, shell};
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;

/// Seconds of CPU and KiB of address space.
const LIMITS: &str = "ulimit -t 5; ulimit -v 524288; ";

fn limited(folder: &Path, arguments: &str) -> Run {
    shell(folder, &format!("{LIMITS}\"$TWINCAL\" {arguments}"))
}

/// Refused with exit code 2 and these words, in few lines.
#[track_caller]
fn refused(folder: &Path, arguments: &str, words: &[&str]) {
    let done = limited(folder, arguments).expect(2).says(words);
    assert!(done.err.len() < 4000, "{} bytes", done.err.len());
}

/// A base and `count` links that turn on it, each called `name` and its number.
fn fan(count: usize, name: &str) -> String {
    let mut text = String::from("<robot name=\"fan\"><link name=\"base\"/>");
    for i in 0..count {
        let _ = write!(
            text,
            "<link name=\"{name}{i}\"/><joint name=\"j{i}\" type=\"revolute\"><parent link=\"base\"/>\
             <child link=\"{name}{i}\"/><axis xyz=\"0 0 1\"/></joint>"
        );
    }
    text + "</robot>"
}

/// Writes a model, which is refused.
#[track_caller]
fn refused_model(folder: &Path, name: &str, text: &str, words: &[&str]) {
    fs::write(folder.join(name), text).unwrap();
    refused(folder, &format!("inspect {name}"), words);
}

#[test]
fn models_with_too_much_in_them_are_refused() {
    let folder = folder();
    let inspect =
        |name: &str, text: &str, words: &[&str]| refused_model(folder.path(), name, text, words);
    let body = |i: usize| format!("<body name=\"b{i}\"><joint name=\"j{i}\"/></body>");
    let many: String = (0..100_000).map(body).collect();
    let world = |inner: &str| format!("<mujoco><worldbody>{inner}</worldbody></mujoco>");
    inspect(
        "a.urdf",
        &fan(20_000, "l"),
        &["a.urdf:1:", "the model has 20001 links, the limit is 10000"],
    );
    let items = "more than 1000000 elements and attributes";
    inspect("a.urdf", &fan(100_000, "l"), &["a.urdf:1:", items]);
    inspect(
        "b.xml",
        &world(&many),
        &["b.xml:1:", "has 100000 links, the limit is 10000"],
    );
    let joints: String = (0..100_000)
        .map(|i| format!("<joint name=\"{i}\"/>"))
        .collect();
    inspect(
        "c.xml",
        &world(&format!("<body>{joints}</body>")),
        &["c.xml:1:1", "links, the limit is 10000"],
    );
    inspect(
        "d.xml",
        &world(&"<a/>".repeat(7_000_000)),
        &["d.xml:1:", items],
    );
    // A name of a megabyte.
    let long = fan(2, "l").replace("l1", &"x".repeat(1 << 20));
    inspect(
        "f.urdf",
        &long,
        &["f.urdf:1:", "has 1048576 bytes, the limit is 4096"],
    );
}

/// Few elements that stand for many.
#[test]
fn models_that_grow_when_they_are_read_are_refused() {
    let folder = folder();
    let inspect =
        |name: &str, text: &str, words: &[&str]| refused_model(folder.path(), name, text, words);
    // Each class holds all that the one around it states.
    let stated = "<joint range=\"0 1\" damping=\"1\" armature=\"1\"/>".repeat(1000);
    let classes: String = (0..9000)
        .map(|i| format!("<default class=\"{i}\"/>"))
        .collect();
    let nested = format!(
        "<mujoco><default><default class=\"x\">{stated}{classes}</default></default></mujoco>"
    );
    inspect(
        "e.xml",
        &nested,
        &["e.xml:1:", "hold more than 1000000 attributes"],
    );
    fs::write(folder.path().join("part.xml"), "<mujocoinclude/>").unwrap();
    let fan_out = format!(
        "<mujoco>{}</mujoco>",
        "<include file=\"part.xml\"/>".repeat(100_000)
    );
    inspect("g.xml", &fan_out, &["g.xml:1:", "or 1000 files in all"]);
}

/// A record of MCAP.
fn record(opcode: u8, parts: &[&[u8]]) -> Vec<u8> {
    let body: Vec<u8> = parts.concat();
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), &body].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

fn channel(number: u16, topic: &str) -> Vec<u8> {
    let schema = 1_u16.to_le_bytes();
    record(
        4,
        &[
            &number.to_le_bytes(),
            &schema,
            &text(topic),
            &text("cdr"),
            &[0; 4],
        ],
    )
}

/// A message of joint states at `number` × 10 ms: header, names, positions, velocities and effort of these joints.
fn message(number: u32, joints: &[&str]) -> Vec<u8> {
    let ns = 10_000_000 * u64::from(number);
    let mut data: Vec<u8> = Vec::new();
    let count = |data: &mut Vec<u8>, n: usize| {
        data.resize(data.len().next_multiple_of(4), 0);
        data.extend((n as u32).to_le_bytes());
    };
    data.extend(((ns / 1_000_000_000) as u32).to_le_bytes());
    data.extend(((ns % 1_000_000_000) as u32).to_le_bytes());
    count(&mut data, 1);
    data.push(0);
    count(&mut data, joints.len());
    for joint in joints {
        count(&mut data, joint.len() + 1);
        data.extend(joint.as_bytes());
        data.push(0);
    }
    for list in 0..3 {
        count(&mut data, joints.len());
        data.resize(data.len().next_multiple_of(8), 0);
        for joint in 0..joints.len() {
            let value = (f64::from(number) * 0.01 * (1 + joint % 3 + list) as f64).sin();
            data.extend(value.to_le_bytes());
        }
    }
    let head = [
        &1_u16.to_le_bytes()[..],
        &number.to_le_bytes(),
        &ns.to_le_bytes(),
        &ns.to_le_bytes(),
    ]
    .concat();
    record(5, &[&head, &[0, 1, 0, 0], &data])
}

/// An MCAP file of these records behind a header and the schema of joint states.
fn mcap(path: &Path, records: &[Vec<u8>]) {
    let kind = "sensor_msgs/msg/JointState";
    let schema = record(
        3,
        &[
            &1_u16.to_le_bytes(),
            &text(kind),
            &text("ros2msg"),
            &text(""),
        ],
    );
    let mut file = fs::File::create(path).unwrap();
    file.write_all(b"\x89MCAP0\r\n").unwrap();
    file.write_all(&record(1, &[&text(""), &text("")])).unwrap();
    file.write_all(&schema).unwrap();
    records
        .iter()
        .for_each(|record| file.write_all(record).unwrap());
    file.write_all(&record(15, &[&[0; 4]])).unwrap();
    file.write_all(&record(2, &[&[0; 20]])).unwrap();
    file.write_all(b"\x89MCAP0\r\n").unwrap();
}

const ARM: [&str; 2] = ["shoulder", "elbow"];

#[test]
fn bags_with_too_much_in_them_are_refused() {
    let folder = folder();
    let path = folder.path().join("run.mcap");
    let inspect =
        |words: &[&str]| refused(folder.path(), "inspect run.mcap --model arm.urdf", words);
    let channels: Vec<Vec<u8>> = (1..60_000).map(|n| channel(n, &format!("/t{n}"))).collect();
    mcap(&path, &channels);
    inspect(&["run.mcap: has more than 10000 channels", "mcap filter"]);
    mcap(&path, &[channel(1, &format!("/{}", "t".repeat(1 << 20)))]);
    inspect(&[
        "the name of topic `/ttt",
        "has 1048577 bytes, the limit is 4096",
    ]);
    let long = "e".repeat(1 << 20);
    mcap(
        &path,
        &[
            channel(1, "/joint_states"),
            message(1, &["shoulder", &long]),
        ],
    );
    inspect(&[
        "the name of joint `eee",
        "has 1048576 bytes, the limit is 4096",
    ]);
    // Other names in every message: a million in all.
    let states: Vec<Vec<u8>> = (0..250)
        .map(|number| {
            let names: Vec<String> = (0..4000).map(|k| format!("f{number}_{k}")).collect();
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            message(number, &names)
        })
        .collect();
    mcap(&path, &[vec![channel(1, "/joint_states")], states].concat());
    inspect(&["has no joint `shoulder`, `elbow`", "and 999990 more"]);
    // A hole of a terabyte behind the header is no record.
    fs::write(&path, b"\x89MCAP0\r\n").unwrap();
    let file = fs::File::options().append(true).open(&path).unwrap();
    file.set_len(1 << 39).unwrap();
    inspect(&["the file is cut off at byte 8"]);
}

#[test]
fn folders_of_bags_with_too_much_in_their_metadata_are_refused() {
    let folder = folder();
    let bag = folder.path().join("bag");
    fs::create_dir(&bag).unwrap();
    mcap(
        &bag.join("a.mcap"),
        &[channel(1, "/joint_states"), message(1, &ARM)],
    );
    let listed = "rosbag2_bagfile_information:\n  relative_file_paths:\n".to_owned();
    fs::write(
        bag.join("metadata.yaml"),
        listed + &"    - a.mcap\n".repeat(20_000),
    )
    .unwrap();
    let words = ["metadata.yaml: names 20000 files, the limit of a bag is 10000"];
    refused(folder.path(), "inspect bag --model arm.urdf", &words);
    fs::write(
        bag.join("metadata.yaml"),
        format!("a: [{}]\n", "[],".repeat(5_000_000)),
    )
    .unwrap();
    refused(
        folder.path(),
        "inspect bag --model arm.urdf",
        &["metadata.yaml:1: has more than 1000000 values, keys and brackets"],
    );
}

#[test]
fn ten_thousand_joints_without_a_column_are_ten_names_and_a_count() {
    let folder = folder();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("fan.urdf", &fan(9999, "l"));
    write("few.csv", "t,q1,tau1\n0,0,0\n0.01,0.1,0.1\n");
    for verb in ["inspect", "fit"] {
        let words = [
            "has no position column for joint `j1` (q2)",
            "`j10` (q11) and 9988 more",
        ];
        refused(
            folder.path(),
            &format!("{verb} few.csv --model fan.urdf"),
            &words,
        );
    }
    // A hundred thousand columns of joints that the model does not have, and one name of a megabyte.
    let foreign: String = (0..90_000).map(|i| format!(",x{i}.q")).collect();
    write("foreign.csv", &format!("t,q1,q2,tau1,tau2{foreign}\n"));
    refused(
        folder.path(),
        "inspect foreign.csv --model fan.urdf",
        &["foreign.csv: column `x0.q`: the model has no joint `x0`"],
    );
    write(
        "long.csv",
        &format!("t,q1,q2,tau1,tau2,{}\n0\n", "x".repeat(1_000_000)),
    );
    refused(
        folder.path(),
        "inspect long.csv --model arm.urdf",
        &[
            "long.csv:1: the name of column 6",
            "has 1000000 bytes, the limit is 4096",
        ],
    );
}

#[test]
fn settings_with_too_much_in_them_are_refused() {
    let folder = folder();
    let inspect = |text: String, words: &[&str]| {
        fs::write(folder.path().join("big.toml"), text).unwrap();
        let arguments = "inspect run.csv --model arm.urdf --config big.toml";
        refused(folder.path(), arguments, words);
    };
    let entries = |count: usize| -> String {
        (0..count)
            .map(|i| format!("[[log]]\nfile = \"{i}\"\n"))
            .collect()
    };
    inspect(
        entries(100_000),
        &["big.toml: has", "bytes, the limit is 1048576"],
    );
    inspect(
        entries(40_000),
        &["big.toml:1:", "40000 entries, the limit is 10000"],
    );
    inspect(
        format!("a = {}{}", "[".repeat(500_000), "]".repeat(500_000)),
        &["big.toml:1:"],
    );
    let keys: String = (0..80_000).map(|i| format!("k{i} = 1\n")).collect();
    inspect(
        format!("[model]\n{keys}"),
        &["big.toml:2:1", "unknown key `k0`"],
    );
    inspect(
        format!("[model.locked]\n{keys}"),
        &["is to be locked, but the model has no such joint"],
    );
    let columns: String = (0..50_000).map(|i| format!("k{i} = \"a\"\n")).collect();
    inspect(
        format!("[columns.q]\n{columns}"),
        &["[columns] q names joint `k0`"],
    );
}

#[test]
fn honest_sizes_are_read() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    // 4000 channels, of which one has joint states.
    let others = (2..4001).map(|n| channel(n, &format!("/t{n}")));
    let states = (1..300).map(|number| message(number, &ARM));
    let records: Vec<Vec<u8>> = std::iter::once(channel(1, "/joint_states"))
        .chain(others)
        .chain(states)
        .collect();
    mcap(&path("run.mcap"), &records);
    limited(folder.path(), "inspect run.mcap --model arm.urdf").expect(0);
    // 2000 links and a table of 4000 channels.
    let arm = fs::read_to_string(path("arm.urdf")).unwrap();
    let mut links = String::new();
    for i in 0..2000 {
        let _ = write!(
            links,
            "<link name=\"x{i}\"/><joint name=\"w{i}\" type=\"fixed\"><parent link=\"base\"/><child link=\"x{i}\"/></joint>"
        );
    }
    fs::write(
        path("links.urdf"),
        arm.replace("</robot>", &(links + "</robot>")),
    )
    .unwrap();
    let wide = fs::read_to_string(path("run.csv")).unwrap();
    let more = |row: usize| match row {
        0 => (0..4000).map(|i| format!(",c{i}")).collect::<String>(),
        _ => ",0".repeat(4000),
    };
    let wide: String = wide
        .lines()
        .enumerate()
        .map(|(row, line)| format!("{line}{}\n", more(row)))
        .collect();
    fs::write(path("wide.csv"), wide).unwrap();
    limited(folder.path(), "inspect wide.csv --model links.urdf").expect(0);
    // Names of 1000 characters.
    let long = "ä".repeat(1000);
    fs::write(path("long.urdf"), arm.replace("elbow", &long)).unwrap();
    let log = fs::read_to_string(path("run.csv")).unwrap();
    let log = log
        .replace("q2", &format!("{long}.q"))
        .replace("tau2", &format!("{long}.tau"));
    fs::write(path("long.csv"), log).unwrap();
    limited(folder.path(), "inspect long.csv --model long.urdf").expect(0);
    let bag: Vec<Vec<u8>> = (1..300)
        .map(|number| message(number, &["shoulder", &long]))
        .collect();
    mcap(
        &path("long.mcap"),
        &[vec![channel(1, &format!("/{}", "t".repeat(1000)))], bag].concat(),
    );
    limited(folder.path(), "inspect long.mcap --model long.urdf").expect(0);
}
