//! Containers that are cut, damaged, or claim too much.

use super::write::{Bag, JOINT_STATE, Message, bag, both, plain};
use super::{contains, is_the_motion, read, read_bytes, refused, says};
use std::fs;
use twincal::Code;
use twincal::Severity;

/// Byte ranges of the contents of all records outside chunks with this opcode.
fn records(bytes: &[u8], opcode: u8) -> Vec<std::ops::Range<usize>> {
    let (mut at, mut found) = (8, Vec::new());
    while at + 9 <= bytes.len() - 8 {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        if bytes[at] == opcode {
            found.push(at + 9..at + 9 + length);
        }
        at += 9 + length;
    }
    found
}

const CHUNK: u8 = 0x06;

#[test]
fn case_52_a_truncated_file_gives_what_is_whole() {
    let bytes = bag(&both());
    let chunks = records(&bytes, CHUNK);
    assert!(chunks.len() > 3, "{} chunks", chunks.len());
    let (recording, findings) = read_bytes(&bytes[..chunks[2].start + 40]).unwrap();
    let rows = recording.time.len();
    assert!((20..180).contains(&rows), "{rows}");
    is_the_motion(&recording, rows, 1.0);
    let said = says(&findings, "truncated");
    assert_eq!(said.severity, Severity::Degraded);
    contains(&said.message, &["cut off at byte", "mcap recover"]);
    // behind the messages nothing is lost
    let (recording, findings) = read_bytes(&bytes[..bytes.len() - 30]).unwrap();
    is_the_motion(&recording, 200, 1.0);
    assert_eq!(says(&findings, "truncated").severity, Severity::Warning);
    // within the first chunk there is nothing
    contains(
        &refused(read_bytes(&bytes[..chunks[0].start + 40])),
        &["not one message of it can be read"],
    );
}

#[test]
fn case_53_a_damaged_chunk_is_left_out_and_counted() {
    for make in [bag, plain] {
        let bytes = make(&both());
        let chunks = records(&bytes, CHUNK);
        // also the first, which declares the topic: the summary declares it again
        for number in [0, 2] {
            let mut spoiled = bytes.clone();
            spoiled[chunks[number].end - 20] ^= 0x40;
            let (recording, findings) = read_bytes(&spoiled).unwrap();
            assert!(recording.time.len() < 200 && recording.time.len() > 100);
            let said = says(&findings, "damaged_chunks");
            assert_eq!((said.severity, said.count), (Severity::Degraded, 1));
            contains(
                &said.message,
                &[&format!("1 of {} chunks", chunks.len()), "at byte"],
            );
        }
    }
}

/// Where the uncompressed size of the first chunk stands, and its compression's name.
fn chunk_fields(bytes: &[u8]) -> (usize, usize) {
    let start = records(bytes, CHUNK)[0].start;
    (start + 16, start + 32)
}

#[test]
fn case_54_a_chunk_that_claims_eight_gibibytes_is_refused() {
    let mut bytes = bag(&both());
    let (size, _) = chunk_fields(&bytes);
    bytes[size..size + 8].copy_from_slice(&(8_u64 << 30).to_le_bytes());
    contains(
        &refused(read_bytes(&bytes)),
        &["a chunk claims 8589934592 bytes", "the limit is 268435456"],
    );
    let mut bytes = bag(&both());
    let start = records(&bytes, CHUNK)[0].start;
    bytes[start - 8..start].copy_from_slice(&(8_u64 << 30).to_le_bytes());
    contains(
        &refused(read_bytes(&bytes)),
        &["claims 8589934592 bytes", "the limit is 268435456"],
    );
    // a claim below the limit that is not true costs the chunk
    let mut bytes = bag(&both());
    bytes[size..size + 8].copy_from_slice(&(9_u64 << 20).to_le_bytes());
    let (_, findings) = read_bytes(&bytes).unwrap();
    contains(
        &says(&findings, "damaged_chunks").message,
        &["claims 9437184"],
    );
}

#[test]
fn texts_that_claim_more_than_their_record_are_refused_before_they_are_allocated() {
    const HEADER: u8 = 0x01;
    let claim = |at: usize| {
        let mut bytes = bag(&both());
        bytes[at..at + 4].copy_from_slice(&0xFFFF_FFF0_u32.to_le_bytes());
        bytes
    };
    let bytes = bag(&both());
    contains(
        &refused(read_bytes(&claim(records(&bytes, HEADER)[0].start))),
        &["a text in it is longer than the record"],
    );
    let (_, name) = chunk_fields(&bytes);
    let (_, findings) = read_bytes(&claim(name - 4)).unwrap();
    contains(
        &says(&findings, "damaged_chunks").message,
        &["its header is broken"],
    );
}

#[test]
fn case_55_an_unknown_compression_is_refused() {
    let mut bytes = bag(&both());
    let (_, compression) = chunk_fields(&bytes);
    assert_eq!(&bytes[compression..compression + 4], b"zstd");
    bytes[compression..compression + 4].copy_from_slice(b"lzma");
    contains(
        &refused(read_bytes(&bytes)),
        &["compressed with `lzma`", "zstd and lz4"],
    );
}

/// Recorded while nothing was published: what the file holds is said, not what could be mapped.
#[test]
fn a_bag_without_messages_is_named_with_its_topics() {
    let none = Bag::new(None).finish();
    contains(
        &refused(read_bytes(&none)),
        &["holds no messages and no topics", "record it again"],
    );
    let mut silent = Bag::new(None);
    silent
        .topic("/joint_states", Some(JOINT_STATE), "cdr")
        .topic("/tf", Some("tf2_msgs/msg/TFMessage"), "cdr");
    contains(
        &refused(read_bytes(&silent.finish())),
        &[
            "holds no messages on its topics: `/joint_states` (sensor_msgs/msg/JointState",
            "`/tf`",
            "record it again",
        ],
    );
}

#[test]
fn case_56_pointers_and_other_files_are_told() {
    let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n";
    contains(
        &refused(read_bytes(pointer)),
        &["this is a Git LFS pointer", "git lfs pull"],
    );
    contains(
        &refused(read_bytes(b"t,q1\n0,1\n")),
        &["does not begin as an MCAP file does"],
    );
    contains(
        &refused(read_bytes(b"")),
        &["is empty (0 bytes)", "nothing was written to it"],
    );
    contains(
        &refused(read_bytes(b"\x89MCAP9\r\n and more")),
        &["does not begin as an MCAP file does"],
    );
}

#[test]
fn case_57_a_missing_schema_is_refused() {
    let mut states = Bag::new(None);
    states.topic("/joint_states", None, "cdr");
    states.raw("/joint_states", 0, &Message::moving(0, &["shoulder"]).cdr());
    let bytes = states.finish();
    contains(
        &refused(read_bytes(&bytes)),
        &["`/joint_states` (no schema, cdr, 1 messages)"],
    );
    let options = twincal_io::log::LogOptions {
        topics: vec!["/joint_states".into()],
        ..Default::default()
    };
    contains(
        &refused(super::read_bytes_with(&bytes, &options)),
        &["topic `/joint_states`", "its schema is missing"],
    );
}

#[test]
fn a_packed_file_is_unpacked_within_a_limit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap.zstd");
    fs::write(&path, zstd::encode_all(&plain(&both())[..], 3).unwrap()).unwrap();
    is_the_motion(&read(&path).unwrap().0, 200, 1.0);
    let mut zeros = plain(&both());
    zeros.resize(80 << 20, 0);
    fs::write(&path, zstd::encode_all(&zeros[..], 3).unwrap()).unwrap();
    contains(&refused(read(&path)), &["refusing to expand"]);
}

/// One definition is for all messages of a topic: where its channels differ, some of them would be read as what they are not, or left out.
#[test]
fn joint_states_on_channels_that_differ_are_refused() {
    let first_and_second = [
        (
            (None, "cdr"),
            (Some(JOINT_STATE), "cdr"),
            "type no schema and of type sensor_msgs/msg/JointState",
        ),
        (
            (Some(JOINT_STATE), "cdr"),
            (Some(JOINT_STATE), "ros1"),
            "JointState (cdr) and of type sensor_msgs/msg/JointState (ros1)",
        ),
        (
            (Some("std_msgs/msg/Empty"), "cdr"),
            (Some(JOINT_STATE), "cdr"),
            "type std_msgs/msg/Empty and of type",
        ),
    ];
    for ((kind, encoding), second, words) in first_and_second {
        let mut states = Bag::new(None);
        states.topic("/joint_states", kind, encoding);
        states.topic("/joint_states", second.0, second.1);
        for message in both() {
            states.raw("/joint_states", message.stamp, &message.cdr());
        }
        contains(
            &refused(read_bytes(&states.finish())),
            &["topic `/joint_states` is of ", words],
        );
    }
    // What nobody reads may differ.
    let mut states = Bag::new(None);
    states.topic("/diagnostics", Some("std_msgs/msg/Empty"), "cdr");
    states.topic("/diagnostics", Some("std_msgs/msg/String"), "cdr");
    for message in both() {
        states.message("/joint_states", &message);
    }
    is_the_motion(&read_bytes(&states.finish()).unwrap().0, 200, 1.0);
}

#[test]
fn an_empty_bag_is_refused() {
    let mut states = Bag::new(None);
    states.topic("/joint_states", Some(JOINT_STATE), "cdr");
    contains(
        &refused(read_bytes(&states.finish())),
        &["holds no messages on its topics: `/joint_states`"],
    );
}

/// rosbag2's `compression_mode: MESSAGE`: every message is a Zstandard frame of its own. One that is broken is dropped and counted.
#[test]
fn messages_that_are_packed_one_by_one_are_read() {
    let mut packed = Bag::new(None);
    packed.topic("/joint_states", Some(super::write::JOINT_STATE), "cdr");
    for message in both() {
        let data = zstd::bulk::compress(&message.cdr(), 3).unwrap();
        packed.raw("/joint_states", message.stamp, &data);
    }
    let broken = &zstd::bulk::compress(&both()[0].cdr(), 3).unwrap()[..40];
    packed.raw("/joint_states", 9_000_000_000, broken);
    let (recording, findings) = read_bytes(&packed.finish()).unwrap();
    is_the_motion(&recording, 200, 1.0);
    assert_eq!(says(&findings, "unreadable_rows").count, 1);
}

/// Without chunks there is only the checksum of the whole data section. Between chunks that have their own nothing is lost.
#[test]
fn the_checksum_of_the_data_section_is_compared() {
    use mcap::{WriteOptions, Writer};
    const DATA_END: u8 = 0x0F;
    let options = WriteOptions::new().use_chunks(false);
    let mut writer: Writer<_> = options.create(std::io::Cursor::new(Vec::new())).unwrap();
    let schema = writer
        .add_schema(super::write::JOINT_STATE, "ros2msg", b"")
        .unwrap();
    let channel = writer
        .add_channel(schema, "/joint_states", "cdr", &Default::default())
        .unwrap();
    for message in both() {
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: message.stamp,
            publish_time: message.stamp,
        };
        writer
            .write_to_known_channel(&header, &message.cdr())
            .unwrap();
    }
    writer.finish().unwrap();
    let whole = writer.into_inner().into_inner();
    let (recording, findings) = read_bytes(&whole).unwrap();
    is_the_motion(&recording, 200, 1.0);
    assert!(!findings.iter().any(|f| f.code == Code::DamagedData));
    let mut changed = whole.clone();
    let end = records(&whole, DATA_END)[0].start - 9;
    changed[end - 3] ^= 0x10;
    let (_, findings) = read_bytes(&changed).unwrap();
    let said = says(&findings, "damaged_data");
    assert_eq!(said.severity, Severity::Degraded);
    contains(
        &said.message,
        &["bytes of the file were changed", "copy the file again"],
    );
    // No checksum is none that is wrong.
    let claim = records(&whole, DATA_END)[0].clone();
    changed[claim].copy_from_slice(&[0; 4]);
    let (_, findings) = read_bytes(&changed).unwrap();
    assert!(!findings.iter().any(|f| f.code == Code::DamagedData));

    let mut chunks = bag(&both());
    let index = records(&chunks, 0x07)[0].clone();
    chunks[index.end - 1] ^= 0x10;
    let (recording, findings) = read_bytes(&chunks).unwrap();
    is_the_motion(&recording, 200, 1.0);
    assert_eq!(says(&findings, "damaged_data").severity, Severity::Warning);
}
