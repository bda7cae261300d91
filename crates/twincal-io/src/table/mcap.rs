//! A table of torques as an MCAP file: one topic per quantity with `sensor_msgs/msg/JointState` in CDR, as Foxglove and PlotJuggler open it.
//!
//! | columns | topic |
//! |---|---|
//! | `t` | `header.stamp` and log time |
//! | `<joint>.tau_meas`, `.tau_nom`, `.tau`, `.tau_low95`, `.tau_high95` | `/twincal/measured`, `/nominal`, `/calibrated`, `/low95`, `/high95`: `effort` |
//! | `<joint>.<other>` | `/twincal/<other>` |
//! | flags | `/twincal/<name>`, `std_msgs/msg/Bool` |

use super::{ColumnKind, Values};
use crate::log::stamps::of_seconds;
use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{Compression, McapError, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::io::{self, Write};

/// Topics of columns by their last word.
const TOPICS: [(&str, &str); 5] = [
    ("tau_meas", "measured"),
    ("tau_nom", "nominal"),
    ("tau", "calibrated"),
    ("tau_low95", "low95"),
    ("tau_high95", "high95"),
];
const JOINT_STATE: &str = "std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
";

/// A topic and the columns that it carries.
struct Topic {
    channel: u16,
    /// Columns of the table in the order of `names`.
    columns: Vec<usize>,
    /// `name[]` as it is written.
    names: Vec<String>,
    is_flag: bool,
}

/// Writes rows as messages.
pub(super) struct McapTable<W: Write> {
    writer: Writer<NoSeek<W>>,
    topics: Vec<Topic>,
    sequence: u32,
    message: Vec<u8>,
}

fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

impl<W: Write> McapTable<W> {
    /// Begins a file; the first column is time in seconds.
    pub(super) fn new(writer: W, columns: &[(String, ColumnKind)]) -> io::Result<Self> {
        let options = WriteOptions::new()
            .profile("ros2")
            .library(format!("twincal {}", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            // The bytes are the same on any machine.
            .compression_threads(0)
            .disable_seeking(true);
        let mut writer = options.create(NoSeek::new(writer)).map_err(io_error)?;
        let mut topics: Vec<(String, Topic)> = Vec::new();
        for (column, (name, kind)) in columns.iter().enumerate().skip(1) {
            let is_flag = *kind == ColumnKind::Flag;
            let (joint, word) = match name.rsplit_once('.') {
                Some(parts) if !is_flag => parts,
                _ => ("", name.as_str()),
            };
            let known = TOPICS.iter().find(|(column, _)| *column == word);
            let topic = format!("/twincal/{}", known.map_or(word, |(_, topic)| topic));
            if let Some((_, topic)) = topics.iter_mut().find(|(name, _)| *name == topic) {
                topic.columns.push(column);
                topic.names.push(joint.to_owned());
                continue;
            }
            let (kind, definition) = if is_flag {
                ("std_msgs/msg/Bool", "bool data\n")
            } else {
                ("sensor_msgs/msg/JointState", JOINT_STATE)
            };
            let schema =
                (writer.add_schema(kind, "ros2msg", definition.as_bytes())).map_err(io_error)?;
            let channel =
                (writer.add_channel(schema, &topic, "cdr", &BTreeMap::new())).map_err(io_error)?;
            let entry = Topic {
                channel,
                columns: vec![column],
                names: vec![joint.to_owned()],
                is_flag,
            };
            topics.push((topic, entry));
        }
        Ok(Self {
            writer,
            topics: topics.into_iter().map(|(_, topic)| topic).collect(),
            sequence: 0,
            message: Vec::new(),
        })
    }

    /// Adds rows.
    pub(super) fn push(&mut self, blocks: &[Values<'_>], rows: usize) -> io::Result<()> {
        let (start, time) = match blocks.first() {
            Some(Values::Numbers(time)) => (0, time),
            Some(Values::Stamps(start, time)) => (*start, time),
            _ => {
                return Err(io::Error::new(
                    io::ErrorKind::InvalidInput,
                    "the first column is not time",
                ));
            }
        };
        for row in 0..rows {
            let stamp = of_seconds(start, time[row]);
            for topic in &self.topics {
                let number = |column: &usize| match blocks[*column] {
                    Values::Numbers(values) => values[row],
                    Values::Stamps(..) | Values::Flags(_) => f64::NAN,
                };
                if !topic.is_flag && topic.columns.iter().all(|column| number(column).is_nan()) {
                    continue;
                }
                self.message.clear();
                if let (true, Some(Values::Flags(flags))) =
                    (topic.is_flag, topic.columns.first().map(|c| &blocks[*c]))
                {
                    self.message.extend([0, 1, 0, 0, u8::from(flags[row])]);
                } else {
                    let values = topic.columns.iter().map(number);
                    encode(&mut self.message, stamp, &topic.names, values);
                }
                let log_time = u64::try_from(stamp).unwrap_or(0);
                let header = MessageHeader {
                    channel_id: topic.channel,
                    sequence: self.sequence,
                    log_time,
                    publish_time: log_time,
                };
                (self.writer.write_to_known_channel(&header, &self.message)).map_err(io_error)?;
            }
            self.sequence = self.sequence.wrapping_add(1);
        }
        Ok(())
    }

    /// Ends the file and gives the writer back.
    pub(super) fn finish(mut self) -> io::Result<W> {
        self.writer.finish().map_err(io_error)?;
        Ok(self.writer.into_inner().into_inner())
    }
}

/// A `JointState` with names and effort as little-endian CDR.
fn encode(message: &mut Vec<u8>, stamp: i64, names: &[String], effort: impl Iterator<Item = f64>) {
    const HEADER: usize = 4;
    let align = |message: &mut Vec<u8>, size: usize| {
        let length = (message.len() - HEADER).next_multiple_of(size) + HEADER;
        message.resize(length, 0);
    };
    let string = |message: &mut Vec<u8>, text: &str| {
        align(message, 4);
        message.extend((text.len() as u32 + 1).to_le_bytes());
        message.extend(text.as_bytes());
        message.push(0);
    };
    let second = 1_000_000_000;
    message.extend([0, 1, 0, 0]);
    // A float cast saturates, and so does this.
    let seconds = i32::try_from(stamp.div_euclid(second)).unwrap_or(i32::MAX);
    message.extend(seconds.to_le_bytes());
    message.extend((stamp.rem_euclid(second) as u32).to_le_bytes());
    string(message, "");
    align(message, 4);
    message.extend((names.len() as u32).to_le_bytes());
    for name in names {
        string(message, name);
    }
    align(message, 4);
    // No position, no velocity.
    message.extend([0; 8]);
    message.extend((names.len() as u32).to_le_bytes());
    align(message, 8);
    for value in effort {
        message.extend(value.to_le_bytes());
    }
}
