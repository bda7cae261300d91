//! Bytes changed at random: any answer but a crash, and what is read stays small.

use super::fixture;
use super::logs::arm;
use super::mapped::arm_state;
use super::write::{Message, plain};
use proptest::prelude::*;
use twincal_io::log::{LogOptions, parse_log};

fn small() -> Vec<u8> {
    let messages: Vec<Message> = (0..20)
        .map(|i| Message::moving(i, &["shoulder", "elbow"]))
        .collect();
    plain(&messages)
}

/// Checksums of chunks are set to "none": damage reaches the messages.
fn without_checksum(mut bytes: Vec<u8>) -> Vec<u8> {
    let mut at = 8;
    while at + 9 <= bytes.len() - 8 {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        if bytes[at] == 0x06 {
            bytes[at + 9 + 24..at + 9 + 28].fill(0);
        }
        at += 9 + length;
    }
    bytes
}

/// Bags of mapped topics in CDR, in the form of ROS 1 and in JSON, with their definitions.
fn mapped() -> Vec<Vec<u8>> {
    [
        "mapped_big_endian.mcap",
        "mapped_ros1.mcap",
        "mapped_json.mcap",
    ]
    .map(|name| without_checksum(std::fs::read(fixture(name)).unwrap()))
    .to_vec()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_bytes_in_a_mapped_bag_are_answered(
        which in any::<prop::sample::Index>(),
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        within in 200_usize..2000,
    ) {
        let bags = mapped();
        let mut bytes = bags[which.index(bags.len())].clone();
        for (at, value) in changes {
            // The definition and the first messages: what stands behind is read alike.
            let at = at.index(within.min(bytes.len()));
            bytes[at] = value;
        }
        let read = parse_log("run.mcap", bytes.leak(), &arm(), &arm_state());
        if let Ok((recording, _)) = read {
            prop_assert!(recording.time.len() <= 40);
        }
    }

    #[test]
    fn any_bytes_in_a_bag_are_answered(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in proptest::option::of(any::<prop::sample::Index>()),
    ) {
        let mut bytes = without_checksum(small());
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        // The memory of one small bag per case: `parse_log` borrows for good.
        let read = parse_log("run.mcap", bytes.leak(), &arm(), &LogOptions::default());
        if let Ok((recording, _)) = read {
            prop_assert!(recording.time.len() <= 20);
        }
    }
}
