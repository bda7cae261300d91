//! Feeds damaged files to every reader, in-process: `cargo run --release -p twincal-fuzz -- --minutes 10`.
//!
//! An input counts as a find if the reader panics, overflows its stack, runs for more than ten seconds or asks for memory beyond the limit.
//! Each target runs in a process of its own, so that what ends a process is seen too; the input lies in a file before it is read, and a find
//! is kept in `fuzz/found/TARGET-…`. `cargo run --release -p twincal-fuzz -- TARGET FILE` runs one input again.

#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a program of the developers that prints what it does"
)]

mod mutate;
mod targets;

use mutate::{Mutator, Random};
use rustix::process::{Resource, Rlimit, setrlimit};
use std::collections::BTreeSet;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use targets::{TARGETS, Target};

/// Longest run of one input.
const TIME: Duration = Duration::from_secs(10);
/// Address space of a target's process, bytes.
const MEMORY: u64 = 2 << 30;
/// Most inputs that are kept because they gave a new answer.
const KEPT: usize = 1000;
/// Exit code of a process that found something.
const FOUND: u8 = 1;

const USAGE: &str = "usage: fuzz [TARGET]... [--minutes N] [--seed N] | fuzz TARGET FILE";

/// What the command line says.
struct Arguments {
    words: Vec<String>,
    minutes: f64,
    seed: u64,
    /// Run the only target here instead of in a process of its own.
    here: bool,
}

fn arguments() -> Option<Arguments> {
    let mut all = Arguments {
        words: Vec::new(),
        minutes: 1.0,
        seed: 1,
        here: false,
    };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--minutes" => all.minutes = words.next()?.parse().ok()?,
            "--seed" => all.seed = words.next()?.parse().ok()?,
            "--here" => all.here = true,
            _ if word.starts_with('-') => return None,
            _ => all.words.push(word),
        }
    }
    Some(all)
}

fn main() -> ExitCode {
    let Some(arguments) = arguments() else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    let find = |word: &String| TARGETS.iter().find(|target| target.name == *word);
    if let [word, file] = &arguments.words[..]
        && let (Some(target), None) = (find(word), find(file))
    {
        return again(target, Path::new(file));
    }
    let known: Option<Vec<&Target>> = arguments.words.iter().map(find).collect();
    let Some(known) = known else {
        let names: Vec<&str> = TARGETS.iter().map(|target| target.name).collect();
        eprintln!("{USAGE}\ntargets: {}", names.join(", "));
        return ExitCode::from(2);
    };
    if let ([target], true) = (&known[..], arguments.here) {
        return run(target, &arguments);
    }
    let all: Vec<&Target> = TARGETS.iter().collect();
    let mut code = ExitCode::SUCCESS;
    for target in if known.is_empty() { all } else { known } {
        if !in_its_own_process(target, &arguments) {
            code = ExitCode::from(FOUND);
        }
    }
    code
}

/// One input, with the panic and its place on the terminal.
fn again(target: &Target, file: &Path) -> ExitCode {
    let ready = std::fs::read(file).and_then(|bytes| {
        // Readers may look beside their file.
        let folder = tempfile::tempdir()?;
        let input = folder.path().join("input");
        std::fs::write(&input, &bytes)?;
        Ok((bytes, folder, input))
    });
    match ready {
        Ok((bytes, _folder, input)) => {
            println!("{}", (target.run)(&bytes, &input));
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{}: cannot read: {error}", file.display());
            ExitCode::from(2)
        }
    }
}

/// Runs a target in a child; false if something was found.
fn in_its_own_process(target: &Target, arguments: &Arguments) -> bool {
    let own = std::env::current_exe().unwrap_or_else(|_| "fuzz".into());
    let status = Command::new(own)
        .args([target.name, "--here", "--minutes"])
        .arg(arguments.minutes.to_string())
        .args(["--seed", &arguments.seed.to_string()])
        .env("RUST_BACKTRACE", "1")
        .status();
    match status {
        Ok(status) if status.success() => true,
        Ok(status) => {
            if status.code() != Some(i32::from(FOUND)) {
                println!(
                    "{}: {status}; see {}",
                    target.name,
                    current(target).display()
                );
            }
            false
        }
        Err(error) => {
            eprintln!("{}: cannot run: {error}", target.name);
            false
        }
    }
}

fn found() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("found")
}

/// The input that is being read.
fn current(target: &Target) -> PathBuf {
    found().join(format!("{}-current", target.name))
}

/// Runs a target for its time.
fn run(target: &'static Target, arguments: &Arguments) -> ExitCode {
    let begin = Instant::now();
    let limit = Rlimit {
        current: Some(MEMORY),
        maximum: Some(MEMORY),
    };
    if let Err(error) = std::fs::create_dir_all(found()).and_then(|()| {
        setrlimit(Resource::As, limit)?;
        Ok(())
    }) {
        eprintln!("{}: cannot begin: {error}", target.name);
        return ExitCode::from(2);
    }
    watch(target);
    let mut corpus = (target.corpus)();
    let mut answers = BTreeSet::new();
    let mut random = Random::new(arguments.seed);
    let mutator = Mutator {
        words: target.words,
    };
    let (mut runs, mut finds, seeds) = (0_u64, 0_u64, corpus.len());
    let end = begin + Duration::from_secs_f64(60.0 * arguments.minutes.max(0.0));
    while Instant::now() < end || runs < seeds as u64 {
        // What is in the corpus first, then damaged forms of it.
        let bytes = match corpus.get(runs as usize) {
            Some(seed) if runs < seeds as u64 => seed.clone(),
            _ => mutator.mutate(&corpus, &mut random),
        };
        runs += 1;
        let input = current(target);
        if let Err(error) = std::fs::write(&input, &bytes) {
            eprintln!("{}: cannot write: {error}", input.display());
            return ExitCode::from(2);
        }
        STARTED.store(milliseconds(begin), Ordering::SeqCst);
        let answer = catch_unwind(|| (target.run)(&bytes, &input));
        STARTED.store(0, Ordering::SeqCst);
        match answer {
            Ok(answer) => {
                if answers.insert(shape(&answer)) && corpus.len() < seeds + KEPT {
                    corpus.push(bytes);
                }
            }
            Err(_) => {
                finds += 1;
                let kept = found().join(format!("{}-{}-{runs}", target.name, arguments.seed));
                let _ = std::fs::write(&kept, &bytes);
                println!("{}: panic; the input is {}", target.name, kept.display());
            }
        }
    }
    let _ = std::fs::remove_file(current(target));
    println!(
        "{:<12} {runs:>9} inputs in {:.0} s, {} different answers, {finds} finds",
        target.name,
        begin.elapsed().as_secs_f64(),
        answers.len()
    );
    ExitCode::from(if finds > 0 { FOUND } else { 0 })
}

/// When the current input began, ms since the process began; 0 between inputs.
static STARTED: AtomicU64 = AtomicU64::new(0);

/// Never 0.
fn milliseconds(begin: Instant) -> u64 {
    u64::try_from(begin.elapsed().as_millis()).unwrap_or(u64::MAX) + 1
}

/// Ends the process when one input takes too long.
fn watch(target: &'static Target) {
    let begin = Instant::now();
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(Duration::from_millis(250));
            let started = STARTED.load(Ordering::SeqCst);
            if started > 0
                && u128::from(milliseconds(begin).saturating_sub(started)) > TIME.as_millis()
            {
                let kept = found().join(format!("{}-slow-{started}", target.name));
                let _ = std::fs::copy(current(target), &kept);
                println!(
                    "{}: more than {} s; the input is {}",
                    target.name,
                    TIME.as_secs(),
                    kept.display()
                );
                std::process::exit(i32::from(FOUND));
            }
        }
    });
}

/// An answer without its numbers and quotations: inputs of another shape are worth keeping.
fn shape(answer: &str) -> String {
    let mut quoted = false;
    let plain = answer.chars().filter(|c| {
        quoted ^= *c == '`';
        !quoted && (c.is_alphabetic() || *c == ' ')
    });
    plain.take(200).collect()
}
