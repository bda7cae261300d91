//! Topics of any type: what other people's software wrote is read to its numbers by the paths of `[columns]`, and wrong paths are told.

use super::logs::motion;
use super::write::{Bag, JOINT_STATE, Message, both};
use super::{
    START, contains, fixture, is_the_motion, read, read_bytes_with, read_with, refused, says, stamp,
};
use mcap::{Compression, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::path::Path;
use twincal::Severity;
use twincal::signal::Recording;
use twincal_io::config::{ChannelNames, Config};
use twincal_io::log::{LogOptions, TorqueSource};

/// Options of a `twincal.toml` with this text in `[columns]`.
fn columns(text: &str) -> LogOptions {
    let config = Config::parse("twincal.toml", &format!("[columns]\n{text}\n")).unwrap();
    config
        .settings()
        .unwrap()
        .log
        .options(Path::new("run.mcap"))
}

fn all(q: &str, qd: &str, tau: &str) -> LogOptions {
    columns(&format!("q = \"{q}\"\nqd = \"{qd}\"\ntau = \"{tau}\""))
}

const ARM: [&str; 3] = [
    "/arm/state:q[*]",
    "/arm/state:qd[*]",
    "/arm/state:joints[*].effort",
];

pub(crate) fn arm_state() -> LogOptions {
    all(ARM[0], ARM[1], ARM[2])
}

/// The motion, with velocities kept as single precision.
#[track_caller]
fn is_nearly_the_motion(recording: &Recording, count: usize) {
    assert_eq!(recording.time.len(), count);
    for i in 0..count {
        for (joint, channels) in recording.joints.iter().enumerate() {
            let t = i as f64 / 100.0;
            assert!((stamp(recording, i) - START - t).abs() < 3e-7);
            let [q, qd, qdd] = motion(joint, t);
            assert!((channels.q[i] - q).abs() < 1e-12);
            assert!((channels.qd.as_ref().unwrap()[i] - qd).abs() < 1e-6);
            assert!((channels.tau.as_ref().unwrap()[i] - qdd - 0.5 * qd).abs() < 1e-11);
        }
    }
}

#[test]
fn own_types_are_read_in_every_encoding_and_container() {
    for (name, count) in [
        ("mapped.mcap", 60),
        ("mapped_big_endian.mcap", 40),
        ("mapped_ros1.mcap", 40),
        ("mapped_json.mcap", 40),
        ("mapped_db3", 20),
    ] {
        let (recording, findings) = read_with(&fixture(name), &arm_state()).unwrap();
        is_nearly_the_motion(&recording, count);
        contains(
            &says(&findings, "time_source").message,
            &["`/arm/state` is header.stamp", "later by 2.000 ms"],
        );
        // q by the model's order, the torque by the name in each record
        contains(
            &says(&findings, "columns").message,
            &[
                "time = /arm/state:header.stamp",
                "shoulder = /arm/state:q[0] /arm/state:qd[0] /arm/state:joints[shoulder].effort",
            ],
        );
    }
}

#[test]
fn lists_of_names_say_whose_an_entry_is() {
    let feedback = |field: &str| format!("/controller/state:feedback.{field}[*]");
    let options = all(
        &feedback("positions"),
        &feedback("velocities"),
        &feedback("effort"),
    );
    is_the_motion(
        &read_with(&fixture("mapped.mcap"), &options).unwrap().0,
        60,
        START,
    );
    // joints and interfaces change their order halfway, and a gripper comes and goes
    let value = |name: &str| format!("/dynamic_joint_states:interface_values[*].values[{name}]");
    let options = all(&value("position"), &value("velocity"), &value("effort"));
    let (recording, findings) = read_with(&fixture("mapped.mcap"), &options).unwrap();
    is_the_motion(&recording, 60, START);
    contains(
        &says(&findings, "columns").message,
        &["elbow = /dynamic_joint_states:interface_values[elbow].values[position]"],
    );
    // joint by joint, names and numbers mixed, accelerations too
    let options = columns(
        "q = { shoulder = \"/controller/state:feedback.positions[1]\", elbow = \"/controller/state:feedback.positions[elbow]\" }\n\
         qdd = \"/controller/state:feedback.accelerations[*]\"\n\
         tau = { elbow = \"/dynamic_joint_states:interface_values[elbow].values[effort]\", shoulder = \"/arm/state:joints[1].effort\" }",
    );
    let (recording, _) = read_with(&fixture("mapped.mcap"), &options).unwrap();
    for (joint, channels) in recording.joints.iter().enumerate() {
        let [q, qd, qdd] = motion(joint, 0.25);
        assert!((channels.q[25] - q).abs() < 1e-12);
        assert!((channels.qdd.as_ref().unwrap()[25] - qdd).abs() < 1e-12);
        assert!((channels.tau.as_ref().unwrap()[25] - qdd - 0.5 * qd).abs() < 1e-11);
    }
}

#[test]
fn topics_at_other_rates_and_clocks_are_brought_together_and_it_is_said() {
    let options = columns("q = \"/arm/state:q[*]\"\ntau = \"/torques:data[*]\"");
    let (recording, findings) = read_with(&fixture("mapped.mcap"), &options).unwrap();
    assert_eq!(recording.time.len(), 30);
    for i in 0..30 {
        // the recorder's clock is 2 ms late
        let t = 0.02 * i as f64;
        assert!((stamp(&recording, i) - START - t - 0.002).abs() < 3e-7);
        for (joint, channels) in recording.joints.iter().enumerate() {
            let [_, qd, qdd] = motion(joint, t);
            assert_eq!(channels.tau.as_ref().unwrap()[i], qdd + 0.5 * qd);
            // h²/8·max|q̈|, |q̈| < 21
            let [q, ..] = motion(joint, t + 0.002);
            assert!((channels.q[i] - q).abs() < 21.0 * 1e-4 / 8.0);
        }
    }
    let said = says(&findings, "log_time");
    assert_eq!(said.severity, Severity::Warning);
    contains(
        &said.message,
        &[
            "`/torques` (std_msgs/msg/Float64MultiArray)",
            "neither header.stamp nor stamp",
            "jitters",
            "the stamps of the others are 2.000 ms before that clock",
        ],
    );
    contains(
        &says(&findings, "parts_merged").message,
        &[
            "of `/torques` (30 messages, every 20.000 ms)",
            "linear interpolation",
        ],
    );
    contains(
        &says(&findings, "model_order").message,
        &["`/arm/state:q[*]`", "`shoulder`, `elbow`"],
    );
}

#[test]
fn time_is_the_field_that_is_asked_in_the_unit_that_is_said() {
    for time in [
        "time = \"/raw:stamp_us\"\ntime_unit = \"us\"",
        "time = \"/raw:seconds\"",
    ] {
        let options = columns(&format!(
            "{time}\nq = \"/raw:q[*]\"\ntau = \"/raw:qd_mrad[*]\""
        ));
        let (recording, _) = read_with(&fixture("mapped.mcap"), &options).unwrap();
        assert_eq!(recording.time.len(), 60);
        for i in 0..60 {
            let [q, qd, _] = motion(1, i as f64 / 100.0);
            let t = stamp(&recording, i) - START;
            assert!((t - i as f64 / 100.0).abs() < 1e-6, "row {i}");
            assert_eq!(recording.joints[1].q[i], f64::from(q as f32));
            let milli = recording.joints[1].tau.as_ref().unwrap()[i];
            assert!((milli - 1000.0 * qd).abs() <= 0.5 + 1e-9);
        }
    }
    // the recorder's clock instead of header.stamp
    let options =
        columns("time = \"log_time\"\nq = \"/arm/state:q[*]\"\ntau = \"/arm/state:q[*]\"");
    let (recording, findings) = read_with(&fixture("mapped.mcap"), &options).unwrap();
    assert!((stamp(&recording, 0) - START - 0.002).abs() < 3e-7);
    contains(
        &says(&findings, "log_time").message,
        &["as [columns] time says"],
    );
    // a time that stands still
    let options = columns(
        "time = \"/arm/state:temperature\"\nq = \"/arm/state:q[*]\"\ntau = \"/arm/state:q[*]\"",
    );
    contains(
        &refused(read_with(&fixture("mapped.mcap"), &options)),
        &["temperature is 36.5 s in all 60 messages", "log_time"],
    );
}

/// Every text of `[columns]` is refused with its words.
#[track_caller]
fn are_refused(cases: &[(&str, &[&str])]) {
    for (text, words) in cases {
        contains(
            &refused(read_with(&fixture("mapped.mcap"), &columns(text))),
            words,
        );
    }
}

#[test]
fn wrong_paths_are_told_with_what_is_there() {
    are_refused(&[
        (
            "q = \"/arm/stat:q[*]\"",
            &[
                "no topic `/arm/stat`, which [columns] q names",
                "`/arm/state` (my_msgs/msg/ArmState, cdr, 60 messages)",
                "did you mean `/arm/state`?",
            ],
        ),
        (
            "q = \"/arm/state:p[*]\"",
            &[
                "topic `/arm/state` (my_msgs/msg/ArmState, cdr)",
                "has no field `p`",
                "`q` (float64[2])",
                "`codes` (int8[3])",
            ],
        ),
        (
            "q = { elbow = \"/arm/state:q[2]\" }",
            &["`q` is float64[2] and has no number 2", "from 0 to 1"],
        ),
        (
            "q = { elbow = \"/arm/state:qd[2]\" }",
            &[
                "message 1 on `/arm/state`",
                "`qd` has 2 entries, none of number 2",
                "--lenient",
            ],
        ),
        (
            "q = { elbow = \"/raw:counts[1]\" }",
            &["message 1 on `/raw`", "`counts` has 0 entries"],
        ),
        (
            "q = { elbow = \"/arm/state:mode\" }",
            &["`mode` is string, not a number"],
        ),
        (
            "q = { elbow = \"/arm/state:joints[wrist].effort\" }",
            &["`joints` has no entry called `wrist`", "`elbow`"],
        ),
        (
            "q = \"positions\"",
            &["names no topic of a bag", "q = \"/topic:field[*]\""],
        ),
        (
            "q = \"/arm/state:q[*]\"\ntime = \"/raw:seconds\"",
            &["time names topic `/raw`, and no channel"],
        ),
        (
            "q = \"/arm/state:q[*]\"\ntime = \"/arm/state:mode\"",
            &["`mode` is string"],
        ),
    ]);
}

#[test]
fn maps_that_do_not_fit_the_joints_are_refused() {
    are_refused(&[
        (
            "q = \"/arm/state:q[*]\"\ntemperature = \"/arm/state:T[*]\"",
            &["[columns] temperature", "from tables only"],
        ),
        (
            "q = \"/arm/state:codes[*]\"",
            &["`codes` has 3 entries, the model has 2 moving joints"],
        ),
        (
            "q = { wrist = \"/arm/state:q[0]\" }",
            &["names joint `wrist`, which does not move"],
        ),
        (
            "q = { elbow = \"/arm/state:q[*]\" }",
            &["[*], which stands for every joint"],
        ),
        (
            "q = \"/arm/state:q[*]\"",
            &["[columns] maps no torque", "torque = \"none\""],
        ),
        (
            "q = { elbow = \"/arm/state:q[0]\" }",
            &["maps no position of joint `shoulder`", "no joint states"],
        ),
    ]);
}

#[test]
fn messages_without_the_entry_are_left_out_and_counted_when_lenient() {
    let mut lenient = columns("q = { elbow = \"/raw:counts[1]\", shoulder = \"/raw:q[0]\" }");
    lenient.lenient = true;
    lenient.torque.source = Some(TorqueSource::None);
    let (recording, findings) = read_with(&fixture("mapped.mcap"), &lenient).unwrap();
    assert_eq!(recording.time.len(), 20);
    assert_eq!(recording.joints[1].q[3], f64::from(u32::MAX));
    assert_eq!(says(&findings, "unreadable_rows").count, 40);
}

#[test]
fn a_bag_without_joint_states_shows_what_can_be_mapped_and_how() {
    let options = LogOptions::default();
    let message = refused(read_with(&fixture("mapped.mcap"), &options));
    contains(
        &message,
        &[
            "has no topic with sensor_msgs/msg/JointState",
            "`/arm/state` has q[2], qd[]",
            "`/controller/state` has ",
            "feedback.positions[]",
            "`/torques` has data[]",
        ],
    );
    let line = message.split("columns = ").nth(1).unwrap();
    let config = format!("columns = {line}\n[log]\ntorque = \"none\"");
    let config = Config::parse("twincal.toml", &config).unwrap();
    let options = config
        .settings()
        .unwrap()
        .log
        .options(Path::new("run.mcap"));
    read_with(&fixture("mapped.mcap"), &options).unwrap();
}

#[test]
fn definitions_that_are_missing_or_foreign_are_told_with_a_remedy() {
    contains(
        &refused(read_with(&fixture("mapped_db3_bare"), &arm_state())),
        &[
            "topic `/arm/state` (my_msgs/msg/ArmState, cdr)",
            "holds no message definitions",
            "lacks the definition of type `my_msgs/ArmState`",
            "ros2 bag convert",
        ],
    );
    for (encoding, language, text, words) in [
        (
            "protobuf",
            "protobuf",
            "x",
            "messages in `protobuf` cannot be read",
        ),
        (
            "cdr",
            "ros2idl",
            "module x {};",
            "its definition is in `ros2idl`",
        ),
        (
            "cdr",
            "ros2msg",
            "Joint[] q",
            "lacks the definition of type `x/Joint`",
        ),
    ] {
        let mut bag = one_topic(encoding, language, text);
        bag.1.finish().unwrap();
        let bytes = bag.1.into_inner().into_inner();
        let options = all("/x:q[*]", "/x:q[*]", "/x:q[*]");
        contains(
            &refused(read_bytes_with(&bytes, &options)),
            &["topic `/x`", words],
        );
    }
}

type Written = Writer<std::io::Cursor<Vec<u8>>>;

/// A bag with one topic `/x` of type `x/X`.
fn one_topic(encoding: &str, language: &str, text: &str) -> (u16, Written) {
    let options = WriteOptions::new().compression(None::<Compression>);
    let mut writer = options.create(std::io::Cursor::new(Vec::new())).unwrap();
    let schema = writer.add_schema("x/X", language, text.as_bytes()).unwrap();
    let channel = writer
        .add_channel(schema, "/x", encoding, &BTreeMap::new())
        .unwrap();
    (channel, writer)
}

fn messages(text: &str, messages: &[Vec<u8>]) -> Vec<u8> {
    let (channel_id, mut writer) = one_topic("cdr", "ros2msg", text);
    for (i, data) in messages.iter().enumerate() {
        let header = mcap::records::MessageHeader {
            channel_id,
            sequence: i as u32,
            log_time: i as u64 * 1_000_000,
            publish_time: 0,
        };
        writer.write_to_known_channel(&header, data).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

#[test]
fn claims_of_messages_are_compared_with_their_size() {
    let good = |q: f64| {
        [
            &[0, 1, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0][..],
            &q.to_le_bytes(),
            &q.to_le_bytes(),
        ]
        .concat()
    };
    let options = columns("q = \"/x:q[*]\"\ntau = \"/x:q[*]\"");
    for (what, text, bad, words) in [
        (
            "a sequence",
            "uint32[] a\nfloat64[] q",
            vec![0, 1, 0, 0, 255, 255, 255, 255],
            "claims a list of 4294967295 entries in the 0 bytes",
        ),
        (
            "a text",
            "uint32[] a\nfloat64[] q",
            vec![0, 1, 0, 0, 9, 0, 0],
            "reaches past its end",
        ),
        (
            "XCDR2",
            "uint32[] a\nfloat64[] q",
            vec![0, 7, 0, 0, 0, 0, 0, 0],
            "XCDR2 or with parameter lists (encapsulation 00 07)",
        ),
        (
            "no header",
            "uint32[] a\nfloat64[] q",
            vec![0],
            "fewer than a CDR header",
        ),
    ] {
        let data = [good(0.5), bad, good(0.25)];
        let (recording, findings) = read_bytes_with(&messages(text, &data), &options).unwrap();
        assert_eq!(recording.joints[1].q, [0.5, 0.25], "{what}");
        contains(
            &says(&findings, "unreadable_rows").message,
            &["message 2 on `/x`", words],
        );
    }
    // fixed lists that no message can hold, and a wstring before the numbers
    for (text, words) in [
        (
            "float64[99999999999] a\nfloat64[] q",
            "claims a list of 99999999999 entries",
        ),
        ("wstring a\nfloat64[] q", "a wstring stands before"),
    ] {
        contains(
            &refused(read_bytes_with(&messages(text, &[good(1.0)]), &options)),
            &["message 1 on `/x`", words],
        );
    }
}

#[test]
fn the_controllers_own_model_is_no_measurement_on_a_topic_either() {
    let data: Vec<u8> = [&[0, 1, 0, 0][..], &[0; 32]].concat();
    let bytes = messages("float64[2] q\nfloat64[2] tau_J_d", &[data]);
    let mut options = columns("q = \"/x:q[*]\"\ntau = \"/x:tau_J_d[*]\"");
    contains(
        &refused(read_bytes_with(&bytes, &options)),
        &[
            "`/x:tau_J_d[0]`",
            "controller's own model",
            "accept_model_torque",
        ],
    );
    options.torque.accept_model_torque = true;
    read_bytes_with(&bytes, &options).unwrap();
}

#[test]
fn joint_states_and_mapped_topics_go_together() {
    // positions as ever, torque from elsewhere
    let mut bag = Bag::new(None);
    bag.topic("/torque", Some("std_msgs/msg/Float64MultiArray"), "cdr");
    for i in 0..100_u64 {
        let mut message = Message::moving(i, &["elbow", "shoulder"]);
        message.lists[2].clear();
        bag.message("/joint_states", &message);
        // layout.dim, data_offset, count of data, doubles
        let mut data = vec![0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0];
        for joint in 0..2 {
            let [_, qd, qdd] = motion(joint, i as f64 / 100.0);
            data.extend((qdd + 0.5 * qd).to_le_bytes());
        }
        bag.raw("/torque", message.stamp, &data);
    }
    let bytes = bag.finish();
    let mut options = LogOptions::default();
    options.columns.tau = ChannelNames::All("/torque:data[*]".into());
    let (recording, findings) = read_bytes_with(&bytes, &options).unwrap();
    is_the_motion(&recording, 100, 1.0);
    says(&findings, "time_source");
    says(&findings, "log_time");
    // with mapped positions joint states are read only where [log] topic names them
    options.columns.q = ChannelNames::All("/joint_states:position[*]".into());
    let (recording, findings) = read_bytes_with(&bytes, &options).unwrap();
    assert!(recording.joints.iter().all(|joint| joint.qd.is_none()));
    contains(
        &says(&findings, "columns").message,
        &["elbow = /joint_states:position[elbow] /torque:data[1]"],
    );
    options.topics = vec!["/joint_states".into()];
    is_the_motion(&read_bytes_with(&bytes, &options).unwrap().0, 100, 1.0);
}

/// Joint states without effort beside a list of 36 numbers and one of two that is called torque.
#[test]
fn a_torque_that_may_be_on_another_topic_is_proposed() {
    let mut bag = Bag::new(None);
    bag.topic("/joint_states", Some(JOINT_STATE), "cdr")
        .defined("/amcl_pose", "my_msgs/msg/Pose", "float64[36] covariance\n")
        .defined("/joint_torques", "my_msgs/msg/Numbers", "float64[] data\n");
    for mut message in both() {
        message.lists[2].clear();
        bag.message("/joint_states", &message)
            .raw("/amcl_pose", message.stamp, &[0, 1, 0, 0])
            .raw("/joint_torques", message.stamp, &[0, 1, 0, 0]);
    }
    contains(
        &refused(read_bytes_with(&bag.finish(), &LogOptions::default())),
        &[
            "effort[] is empty in all messages",
            "if this is the torque, say it with [columns] tau = \"/joint_torques:data[*]\"; else record",
        ],
    );
    contains(
        &refused(read(&fixture("mapped.mcap"))),
        &["lists of numbers", "columns = {"],
    );
    let options = LogOptions {
        topics: vec!["/torques".into()],
        ..LogOptions::default()
    };
    contains(
        &refused(read_with(&fixture("mapped.mcap"), &options)),
        &["30 messages) cannot be read: its messages are no joint states"],
    );
}
