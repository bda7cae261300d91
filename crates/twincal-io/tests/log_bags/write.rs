//! Bags for tests: messages encoded here, containers by the `mcap` crate.

use super::logs::motion;
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::io::Cursor;

pub(crate) const JOINT_STATE: &str = "sensor_msgs/msg/JointState";

/// A JointState before it is encoded.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Message {
    pub(crate) stamp: u64,
    pub(crate) names: Vec<String>,
    pub(crate) lists: [Vec<f64>; 3],
}

impl Message {
    /// Sample `i` at 100 Hz of the joints `names` (`shoulder` is 0, any other 1).
    pub(crate) fn moving(i: u64, names: &[&str]) -> Self {
        let moves: Vec<[f64; 3]> = names
            .iter()
            .map(|name| motion(usize::from(*name != "shoulder"), i as f64 / 100.0))
            .collect();
        Self {
            stamp: 1_000_000_000 + i * 10_000_000,
            names: names.iter().map(|name| (*name).to_owned()).collect(),
            lists: [
                moves.iter().map(|m| m[0]).collect(),
                moves.iter().map(|m| m[1]).collect(),
                moves.iter().map(|m| m[2] + 0.5 * m[1]).collect(),
            ],
        }
    }

    /// As little-endian CDR, version 1.
    pub(crate) fn cdr(&self) -> Vec<u8> {
        self.encoded([0, 1], 8)
    }

    /// As little-endian CDR with this header and largest alignment.
    pub(crate) fn encoded(&self, header: [u8; 2], alignment: usize) -> Vec<u8> {
        let mut body: Vec<u8> = Vec::new();
        body.extend(((self.stamp / 1_000_000_000) as u32).to_le_bytes());
        body.extend(((self.stamp % 1_000_000_000) as u32).to_le_bytes());
        let align = |body: &mut Vec<u8>, size: usize| {
            while !body.len().is_multiple_of(size.min(alignment)) {
                body.push(0);
            }
        };
        let string = |body: &mut Vec<u8>, text: &str| {
            align(body, 4);
            body.extend((text.len() as u32 + 1).to_le_bytes());
            body.extend(text.as_bytes());
            body.push(0);
        };
        string(&mut body, "base");
        align(&mut body, 4);
        body.extend((self.names.len() as u32).to_le_bytes());
        for name in &self.names {
            string(&mut body, name);
        }
        for list in &self.lists {
            align(&mut body, 4);
            body.extend((list.len() as u32).to_le_bytes());
            if !list.is_empty() {
                align(&mut body, 8);
            }
            for value in list {
                body.extend(value.to_le_bytes());
            }
        }
        [vec![header[0], header[1], 0, 0], body].concat()
    }
}

/// 200 samples of both joints.
pub(crate) fn both() -> Vec<Message> {
    (0..200)
        .map(|i| Message::moving(i, &["shoulder", "elbow"]))
        .collect()
}

/// An MCAP file in the making.
pub(crate) struct Bag {
    writer: Writer<Cursor<Vec<u8>>>,
    channels: BTreeMap<String, u16>,
    sequence: u32,
}

impl Bag {
    pub(crate) fn new(compression: Option<Compression>) -> Self {
        Self::with_chunks(compression, 4096)
    }

    pub(crate) fn with_chunks(compression: Option<Compression>, size: u64) -> Self {
        let options = WriteOptions::new()
            .compression(compression)
            .chunk_size(Some(size));
        Self {
            writer: options.create(Cursor::new(Vec::new())).unwrap(),
            channels: BTreeMap::new(),
            sequence: 0,
        }
    }

    /// Declares a topic; no schema where `kind` is `None`.
    pub(crate) fn topic(&mut self, topic: &str, kind: Option<&str>, encoding: &str) -> &mut Self {
        let schema = kind.map_or(0, |kind| {
            let encoding = if encoding == "cdr" {
                "ros2msg"
            } else {
                encoding
            };
            self.writer.add_schema(kind, encoding, b"").unwrap()
        });
        let channel = self
            .writer
            .add_channel(schema, topic, encoding, &BTreeMap::new())
            .unwrap();
        self.channels.insert(topic.to_owned(), channel);
        self
    }

    /// Declares a topic of CDR messages with a definition.
    pub(crate) fn defined(&mut self, topic: &str, kind: &str, definition: &str) -> &mut Self {
        let text = definition.as_bytes();
        let schema = self.writer.add_schema(kind, "ros2msg", text).unwrap();
        let channel = (self.writer)
            .add_channel(schema, topic, "cdr", &BTreeMap::new())
            .unwrap();
        self.channels.insert(topic.to_owned(), channel);
        self
    }

    pub(crate) fn raw(&mut self, topic: &str, log_time: u64, data: &[u8]) -> &mut Self {
        self.sequence += 1;
        let header = MessageHeader {
            channel_id: self.channels[topic],
            sequence: self.sequence,
            log_time,
            publish_time: log_time,
        };
        self.writer.write_to_known_channel(&header, data).unwrap();
        self
    }

    pub(crate) fn message(&mut self, topic: &str, message: &Message) -> &mut Self {
        if !self.channels.contains_key(topic) {
            self.topic(topic, Some(JOINT_STATE), "cdr");
        }
        self.raw(topic, message.stamp + 1_500_000, &message.cdr())
    }

    pub(crate) fn finish(mut self) -> Vec<u8> {
        self.writer.finish().unwrap();
        self.writer.into_inner().into_inner()
    }
}

/// A bag of one topic with these messages, Zstandard.
pub(crate) fn bag(messages: &[Message]) -> Vec<u8> {
    with(Some(Compression::Zstd), messages)
}

/// A bag whose chunks are not packed, so that a test can spoil them.
pub(crate) fn plain(messages: &[Message]) -> Vec<u8> {
    with(None, messages)
}

fn with(compression: Option<Compression>, messages: &[Message]) -> Vec<u8> {
    let mut bag = Bag::new(compression);
    for message in messages {
        bag.message("/joint_states", message);
    }
    bag.finish()
}
