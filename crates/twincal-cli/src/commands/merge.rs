//! `twincal merge`: one file of statistics from several, and how a fit reads them.

use super::{count_of_logs, print_json};
use crate::args::Merge;
use crate::failure::{Failure, Outcome};
use crate::names::display_names;
use crate::progress::Progress;
use crate::terminal::Terminal;
use serde::Serialize;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use twincal_io::artifact::{Inputs, OutputFile, sha256_of_file};
use twincal_io::context::FileHash;
use twincal_io::statistics::StatisticsFile;

/// What `--json` prints.
#[derive(Serialize)]
struct Merged<'a> {
    output: String,
    robot: &'a str,
    logs: Vec<&'a str>,
}

pub(super) fn run(flags: &Merge, terminal: &mut Terminal) -> Outcome<u8> {
    let mut inputs = Inputs::default();
    flags.files.iter().for_each(|path| inputs.add(path));
    let output = OutputFile::create(&flags.output, flags.force, &inputs)?;
    let progress = Progress::new();
    let (file, _) = read(&flags.files, &progress)?;
    write(&file, output)?;
    terminal.complete(&flags.output);
    drop(progress);
    let logs: Vec<&str> = file.statistics.log_names().collect();
    let place = flags.output.to_string_lossy().into_owned();
    if flags.json {
        let merged = Merged {
            output: place,
            robot: &file.statistics.robot_name,
            logs,
        };
        print_json(terminal, &merged)?;
    } else {
        terminal.say(&format!(
            "statistics of {} of robot `{}`",
            count_of_logs(logs.len()),
            file.statistics.robot_name
        ));
        terminal.say(&place);
    }
    Ok(0)
}

/// The sum of these files, and their checksums.
pub(super) fn read(
    paths: &[PathBuf],
    progress: &Progress,
) -> Outcome<(StatisticsFile, Vec<FileHash>)> {
    let mut sum: Option<StatisticsFile> = None;
    let mut files = Vec::new();
    for (path, name) in paths.iter().zip(display_names(paths)) {
        progress.step(&format!("reading {}", path.to_string_lossy()));
        let file = StatisticsFile::read(path)?;
        files.push(FileHash {
            name,
            sha256: sha256_of_file(path)?,
        });
        match &mut sum {
            None => sum = Some(file),
            Some(sum) => add(sum, &file, path)?,
        }
    }
    let sum = sum.ok_or_else(|| {
        Failure::usage(
            "no file of statistics",
            "give files that `twincal statistics` wrote",
        )
    })?;
    Ok((sum, files))
}

/// Adds statistics of more logs.
pub(super) fn add(sum: &mut StatisticsFile, file: &StatisticsFile, path: &Path) -> Outcome<()> {
    let merged = sum.statistics.try_merge(&file.statistics);
    merged.map_err(|error| {
        let (problem, remedy) = match error {
            twincal::Error::Statistics { problem, remedy } => (problem, remedy),
            other => (other.to_string(), "leave this file out".into()),
        };
        Failure::usage(format!("{}: {problem}", path.to_string_lossy()), &remedy)
    })
}

/// Writes statistics to a file, complete or not at all.
pub(super) fn write(file: &StatisticsFile, mut output: OutputFile) -> Outcome<()> {
    let written = match output.file() {
        Some(to) => file.write_to(BufWriter::new(to))?,
        None => Ok(()),
    };
    Ok(output.commit(written)?)
}
