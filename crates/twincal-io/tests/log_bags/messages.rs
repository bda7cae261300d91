//! What messages say: topics, names, lists, stamps, encodings.

use super::logs::motion;
use super::write::{Bag, JOINT_STATE, Message, bag, both};
use super::{
    START, contains, fixture, is_the_motion, read, read_bytes, read_bytes_with, refused, says,
    stamp,
};
use twincal::Code;
use twincal::Severity;
use twincal_io::log::{LogOptions, TorqueOptions, TorqueSource};

fn topics(names: &[&str]) -> LogOptions {
    LogOptions {
        topics: names.iter().map(|name| (*name).to_owned()).collect(),
        ..LogOptions::default()
    }
}

fn spoiled(spoil: impl Fn(usize, &mut Message)) -> Vec<u8> {
    let mut messages = both();
    for (i, message) in messages.iter_mut().enumerate() {
        spoil(i, message);
    }
    bag(&messages)
}

#[test]
fn bags_of_other_writers_are_read_to_their_numbers() {
    for (name, count) in [
        ("ros2_zstd.mcap", 120),
        ("ros2_lz4.mcap", 60),
        ("ros1.mcap", 40),
    ] {
        let (recording, findings) = read(&fixture(name)).unwrap();
        is_the_motion(&recording, count, START);
        contains(&says(&findings, "joints_left_out").message, &["`gripper`"]);
    }
    // version 2 of the encoding aligns doubles to 4 bytes; its names here leave them unaligned to 8
    let mut states = Bag::new(None);
    states.topic("/joint_states", Some(JOINT_STATE), "cdr");
    for (i, message) in both().iter().enumerate() {
        states.raw("/joint_states", i as u64, &message.encoded([0, 7], 4));
    }
    is_the_motion(&read_bytes(&states.finish()).unwrap().0, 200, 1.0);
}

#[test]
fn time_and_torque_are_header_stamp_and_effort_and_both_are_said() {
    let (_, findings) = read_bytes(&bag(&both())).unwrap();
    contains(
        &says(&findings, "time_source").message,
        &["header.stamp", "`/joint_states`", "later by 1.500 ms"],
    );
    contains(
        &says(&findings, "effort_is_joint_torque").message,
        &["joint's side", "[[log]] torque"],
    );
}

#[test]
fn case_32_an_empty_effort_is_refused_with_its_topic_and_taken_for_prediction() {
    let bytes = spoiled(|_, message| message.lists[2].clear());
    contains(
        &refused(read_bytes(&bytes)),
        &["`/joint_states`", "effort[] is empty", "torque = \"none\""],
    );
    let options = LogOptions {
        torque: TorqueOptions {
            source: Some(TorqueSource::None),
            ..TorqueOptions::default()
        },
        ..LogOptions::default()
    };
    let (recording, _) = read_bytes_with(&bytes, &options).unwrap();
    assert!(recording.joints.iter().all(|joint| joint.tau.is_none()));
}

#[test]
fn case_33_an_effort_shorter_than_its_names_is_refused_at_its_message() {
    let bytes = spoiled(|i, message| {
        if i == 76 {
            message.lists[2].pop();
        }
    });
    contains(
        &refused(read_bytes(&bytes)),
        &[
            "message 77 on `/joint_states`",
            "effort[] has 1 values for 2 names",
            "--lenient",
        ],
    );
    let lenient = LogOptions {
        lenient: true,
        ..LogOptions::default()
    };
    let (recording, findings) = read_bytes_with(&bytes, &lenient).unwrap();
    assert_eq!(recording.time.len(), 199);
    assert_eq!(says(&findings, "unreadable_rows").count, 1);
    // empty from some message on
    let bytes = spoiled(|i, message| {
        if i >= 50 {
            message.lists[1].clear();
        }
    });
    contains(
        &refused(read_bytes(&bytes)),
        &["message 51", "velocity[] has 0 values", "before it had 2"],
    );
}

#[test]
fn case_34_messages_without_names_are_refused() {
    let bytes = spoiled(|_, message| message.names.clear());
    contains(
        &refused(read_bytes(&bytes)),
        &["message 1 on `/joint_states`", "name[] is empty"],
    );
}

#[test]
fn case_35_partial_messages_are_merged_by_name() {
    // the elbow at half the rate, 3 ms after the shoulder
    let mut messages = Vec::new();
    for i in 0..400_u64 {
        messages.push(Message::moving(i, &["shoulder"]));
        if i % 2 == 0 {
            let mut message = Message::moving(i, &["elbow"]);
            message.stamp += 3_000_000;
            let moves = motion(1, (i as f64 + 0.3) / 100.0);
            message.lists = [vec![moves[0]], vec![moves[1]], vec![moves[2]]];
            messages.push(message);
        }
    }
    let (recording, findings) = read_bytes(&bag(&messages)).unwrap();
    let said = says(&findings, "parts_merged");
    contains(
        &said.message,
        &[
            "`shoulder` of `/joint_states` (400 messages, every 10.000 ms)",
            "`elbow`",
            "every 20.000 ms",
            "linear interpolation",
        ],
    );
    assert_eq!(recording.time.len(), 200);
    for i in 0..200 {
        let t = stamp(&recording, i) - 1.0;
        assert!((t - (0.02 * i as f64 + 0.003)).abs() < 1e-9);
        assert!((recording.joints[1].q[i] - motion(1, t)[0]).abs() < 1e-9);
        // h²/8·max|q̈|, |q̈| ≤ ω₁² + 0.3 ω₂² < 21
        assert!((recording.joints[0].q[i] - motion(0, t)[0]).abs() < 21.0 * 1e-4 / 8.0);
    }
    // parts that do not meet in time
    let mut messages: Vec<Message> = (0..50).map(|i| Message::moving(i, &["shoulder"])).collect();
    messages.extend((100..150).map(|i| Message::moving(i, &["elbow"])));
    contains(
        &refused(read_bytes(&bag(&messages))),
        &["hardly overlap in time", "`shoulder`", "`elbow`"],
    );
}

#[test]
fn names_in_another_order_in_every_message_are_one_log() {
    let mut messages = both();
    for message in messages.iter_mut().skip(1).step_by(2) {
        message.names.reverse();
        message.lists.iter_mut().for_each(|list| list.reverse());
    }
    let (recording, _) = read_bytes(&bag(&messages)).unwrap();
    is_the_motion(&recording, 200, 1.0);
}

#[test]
fn case_58_a_length_past_the_end_drops_the_message_and_counts_it() {
    let mut states = Bag::new(None);
    states.topic("/joint_states", Some(JOINT_STATE), "cdr");
    for (i, message) in both().iter().enumerate() {
        let mut data = message.cdr();
        if i == 100 {
            // the length of frame_id
            data[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
        }
        if i == 101 {
            data.truncate(60);
        }
        states.raw("/joint_states", i as u64, &data);
    }
    let (recording, findings) = read_bytes(&states.finish()).unwrap();
    assert_eq!(recording.time.len(), 198);
    let said = says(&findings, "unreadable_rows");
    assert_eq!((said.count, said.severity), (2, Severity::Warning));
    contains(
        &said.message,
        &["message 101 on `/joint_states`", "frame_id", "past its end"],
    );
    // nothing readable at all
    let mut states = Bag::new(None);
    states.topic("/joint_states", Some(JOINT_STATE), "cdr");
    states.raw("/joint_states", 0, &[0, 1]);
    contains(
        &refused(read_bytes(&states.finish())),
        &["not one of 1 messages could be read", "2 bytes"],
    );
}

#[test]
fn case_59_big_endian_messages_are_read() {
    let (recording, _) = read(&fixture("big_endian.mcap")).unwrap();
    is_the_motion(&recording, 40, START);
}

#[test]
fn case_60_topics_in_another_encoding_are_listed() {
    let mut states = Bag::new(None);
    states
        .topic("/js", Some("sensor_msgs/JointState"), "json")
        .topic("/arm", Some("foxglove.JointStates"), "protobuf");
    states
        .raw("/js", 1, b"{\"name\": [\"shoulder\"]}")
        .raw("/arm", 2, b"\x08\x01");
    let bytes = states.finish();
    contains(
        &refused(read_bytes(&bytes)),
        &[
            "no topic with sensor_msgs/msg/JointState in CDR",
            "`/js` (sensor_msgs/JointState, json, 1 messages)",
            "`/arm` (foxglove.JointStates, protobuf, 1 messages)",
            "convert",
        ],
    );
    contains(
        &refused(read_bytes_with(&bytes, &topics(&["/js"]))),
        &[
            "topic `/js` (sensor_msgs/JointState, json",
            "cannot be read",
        ],
    );
}

#[test]
fn case_61_late_messages_are_put_in_the_order_of_their_stamps() {
    // by another writer: every tenth message two places late
    let (recording, findings) = read(&fixture("ros2_zstd.mcap")).unwrap();
    is_the_motion(&recording, 120, START);
    let said = says(&findings, "late_messages");
    assert_eq!((said.count, said.severity), (11, Severity::Warning));
    contains(&said.message, &["11 of 120", "20.000 ms"]);
    // a clock that is set back by more than half a second is not late: the log is cut there later on
    let mut messages = both();
    for message in messages.iter_mut().skip(120) {
        message.stamp -= 900_000_000;
    }
    let (recording, findings) = read_bytes(&bag(&messages)).unwrap();
    assert!(!findings.iter().any(|f| f.code == Code::LateMessages));
    let back = recording.time.windows(2).filter(|w| w[1] < w[0]).count();
    assert_eq!((back, recording.time.len()), (1, 200));
}

#[test]
fn more_than_one_topic_has_to_be_chosen() {
    let mut states = Bag::new(None);
    for message in both() {
        let mut other = message.clone();
        other.lists.iter_mut().flatten().for_each(|v| *v += 1.0);
        states
            .message("/commands", &other)
            .message("/joint_states", &message);
    }
    let bytes = states.finish();
    contains(
        &refused(read_bytes(&bytes)),
        &[
            "more than one topic",
            "`/commands` (sensor_msgs/msg/JointState, cdr, 200 messages)",
            "`/joint_states`",
            "[[log]] topic",
        ],
    );
    let (recording, _) = read_bytes_with(&bytes, &topics(&["/joint_states"])).unwrap();
    is_the_motion(&recording, 200, 1.0);
    contains(
        &refused(read_bytes_with(&bytes, &topics(&["/joint_state"]))),
        &["no topic `/joint_state`", "did you mean `/joint_states`?"],
    );
}

#[test]
fn a_list_of_topics_takes_each_channel_from_the_first_that_has_it() {
    let mut states = Bag::new(None);
    for message in both() {
        let (mut motion, mut effort) = (message.clone(), message);
        motion.lists[2].clear();
        effort.lists[0].iter_mut().for_each(|v| *v = 9.0);
        effort.lists[1].clear();
        states
            .message("/motion", &motion)
            .message("/effort", &effort);
    }
    let bytes = states.finish();
    let (recording, findings) = read_bytes_with(&bytes, &topics(&["/motion", "/effort"])).unwrap();
    is_the_motion(&recording, 200, 1.0);
    says(&findings, "parts_merged");
}

/// What a user has to type stands in the message.
#[test]
fn topics_that_are_left_aside_are_named_in_the_remedy() {
    let mut states = Bag::new(None);
    for message in both() {
        let (mut motion, mut effort) = (message.clone(), message);
        motion.lists[2].clear();
        effort.lists[0].clear();
        effort.lists[1].clear();
        states
            .message("/motion", &motion)
            .message("/effort", &effort);
    }
    let bytes = states.finish();
    contains(
        &refused(read_bytes(&bytes)),
        &["more than one topic", "topic = [\"/motion\", \"/effort\"]"],
    );
    contains(
        &refused(read_bytes_with(&bytes, &topics(&["/effort"]))),
        &["position[] of joint", "if `/motion` has them"],
    );
    // A file that is cut off in its first chunk has no topic for that reason.
    contains(
        &refused(read_bytes(&bytes[..600])),
        &[
            "not one message of it can be read",
            "cut off at byte",
            "mcap recover",
        ],
    );
}

#[test]
fn joints_that_are_missing_or_named_otherwise() {
    let messages: Vec<Message> = (0..200)
        .map(|i| Message::moving(i, &["shoulder", "elbow_joint"]))
        .collect();
    let bytes = bag(&messages);
    contains(
        &refused(read_bytes(&bytes)),
        &[
            "no joint `elbow` of the model",
            "it names `elbow_joint`",
            "[columns] q",
            "locked",
        ],
    );
    let mut options = LogOptions::default();
    options.columns.q = [("elbow".into(), "elbow_joint".into())]
        .into_iter()
        .collect();
    is_the_motion(&read_bytes_with(&bytes, &options).unwrap().0, 200, 1.0);
}

#[test]
fn motor_torque_and_current_become_joint_torque_by_stated_numbers_only() {
    let bytes = bag(&both());
    let (plain, _) = read_bytes(&bytes).unwrap();
    let numbers = |elbow: Option<f64>| {
        let mut table = std::collections::BTreeMap::from([("shoulder".to_owned(), 100.0)]);
        table.extend(elbow.map(|number| ("elbow".to_owned(), number)));
        table
    };
    let mut options = LogOptions::default();
    options.torque.source = Some(TorqueSource::Motor);
    options.torque.gear_ratio = numbers(None);
    contains(
        &refused(read_bytes_with(&bytes, &options)),
        &["log.gear_ratio", "no number for joint `elbow`"],
    );
    options.torque.gear_ratio = numbers(Some(-50.0));
    let (motor, findings) = read_bytes_with(&bytes, &options).unwrap();
    contains(
        &says(&findings, "torque_source").message,
        &["gear ratio", "shoulder 100, elbow -50"],
    );
    options.torque.source = Some(TorqueSource::Current);
    options.torque.drive_constant =
        [("shoulder".to_owned(), 0.5), ("elbow".to_owned(), 0.25)].into();
    let (current, _) = read_bytes_with(&bytes, &options).unwrap();
    let tau = |recording: &twincal::signal::Recording, joint: usize| {
        recording.joints[joint].tau.clone().unwrap()[42]
    };
    for (joint, gear, constant) in [(0, 100.0, 0.5), (1, -50.0, 0.25)] {
        assert_eq!(tau(&motor, joint), gear * tau(&plain, joint));
        assert_eq!(tau(&current, joint), constant * gear * tau(&plain, joint));
    }
    options.torque.drive_constant = [("knee".to_owned(), 0.5)].into();
    contains(
        &refused(read_bytes_with(&bytes, &options)),
        &["joint `knee`, which does not move"],
    );
}
