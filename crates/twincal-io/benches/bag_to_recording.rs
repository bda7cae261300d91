//! From a bag to a recording, one core: `cargo bench -p twincal-io --bench bag_to_recording`. The peer is the `mcap` crate's own reader, which
//! unpacks and hands out the messages without looking into them.

#![allow(
    clippy::print_stdout,
    clippy::expect_used,
    clippy::unwrap_used,
    reason = "a bench prints its table and stops where it cannot go on"
)]

#[path = "../tests/common/logs.rs"]
#[allow(dead_code, reason = "the tests use the rest of these generators")]
mod logs;
#[path = "../tests/log_bags/write.rs"]
#[allow(dead_code, reason = "the tests use the rest of these generators")]
mod write;

use mcap::{Compression, MessageStream};
use twincal::robot::JointKind;
use twincal_io::log::{LogOptions, parse_log};
use write::{Bag, Message};

const MESSAGES: u64 = 600_000;

/// Processor time of this process so far, s, of threads that have ended too: chunks are unpacked beside the reading. Counted in
/// hundredths; other work on the machine does not count. Panics where the system is not Linux: there is nothing to measure then.
fn processor_time() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").expect("Linux");
    // The name of the program, in brackets, may hold spaces; user and system time are the 12th and 13th field behind it.
    let (_, fields) = text.rsplit_once(") ").expect("a name");
    let ticks = |field: usize| -> f64 {
        let field = fields.split(' ').nth(field).expect("a field");
        field.parse().expect("a number")
    };
    (ticks(11) + ticks(12)) / 100.0
}

/// Shortest of five runs, s of processor time.
fn shortest(mut run: impl FnMut() -> u64) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        let start = processor_time();
        assert_eq!(run(), MESSAGES);
        best = best.min(processor_time() - start);
    }
    best
}

fn main() {
    let names: Vec<String> = (1..=7).map(|i| format!("panda_joint{i}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let joints: Vec<(&str, JointKind)> = names
        .iter()
        .map(|name| (*name, JointKind::Revolute))
        .collect();
    let robot = logs::robot(&joints);
    println!("7 joints, position, velocity, effort, {MESSAGES} messages");
    for (word, compression) in [("zstd", Some(Compression::Zstd)), ("plain", None)] {
        let mut bag = Bag::with_chunks(compression, 768 << 10);
        for i in 0..MESSAGES {
            let mut message = Message::moving(i, &names);
            // What a sensor adds: digits that do not repeat.
            for (k, value) in message.lists.iter_mut().flatten().enumerate() {
                let noise = (i * 21 + k as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40;
                *value += noise as f64 * 1e-12;
            }
            message.stamp = 1_000_000_000 + i * 1_000_000;
            bag.message("/joint_states", &message);
        }
        let bytes: &'static [u8] = bag.finish().leak();
        let ours = shortest(|| {
            let options = LogOptions::default();
            let (recording, _) = parse_log("run.mcap", bytes, &robot, &options).expect("readable");
            recording.time.len() as u64
        });
        let peer = shortest(|| {
            let messages = MessageStream::new(bytes).expect("readable");
            messages.map(|message| u64::from(message.is_ok())).sum()
        });
        for (who, seconds) in [("twincal", ours), ("mcap crate, undecoded", peer)] {
            println!(
                "{word:<6} {who:<22} {:8.1} ms  {:5.2} M messages/s  {:5.0} MB/s of {:.0} MB",
                seconds * 1e3,
                MESSAGES as f64 / seconds / 1e6,
                bytes.len() as f64 / seconds / 1e6,
                bytes.len() as f64 / 1e6
            );
        }
    }
}
