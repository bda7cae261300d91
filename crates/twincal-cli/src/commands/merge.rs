//! `twincal merge`: one file of statistics from several, and how a fit reads them.

use super::{count_of_logs, print_json};
use crate::args::Merge;
use crate::failure::{Failure, Outcome};
use crate::interrupts::require_caller;
use crate::names::display_names;
use crate::progress::Progress;
use crate::terminal::Terminal;
use serde::Serialize;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use twincal_io::artifact::{Inputs, OutputFile, sha256_of_file};
use twincal_io::context::FileHash;
use twincal_io::statistics::{StatisticsFile, StatisticsFiles};

/// What `--json` prints.
#[derive(Serialize)]
struct Merged<'a> {
    output: String,
    robot: &'a str,
    logs: Vec<String>,
}

pub(super) fn run(flags: &Merge, terminal: &mut Terminal) -> Outcome<u8> {
    let mut inputs = Inputs::default();
    flags.files.iter().for_each(|path| inputs.add(path));
    let output = OutputFile::create(&flags.output, flags.force, &inputs)?;
    let progress = Progress::new();
    let mut seen = |path: &Path| progress.step(&format!("reading {}", path.to_string_lossy()));
    let files = StatisticsFiles::open(&flags.files, &mut seen)?;
    let robot = files.robot_name().to_owned();
    let logs: Vec<String> = files.log_names().map(str::to_owned).collect();
    progress.step("writing");
    write(output, |to| files.write_to(to))?;
    terminal.complete(&flags.output);
    drop(progress);
    let place = flags.output.to_string_lossy().into_owned();
    if flags.json {
        let merged = Merged {
            output: place,
            robot: &robot,
            logs,
        };
        print_json(terminal, &merged)?;
    } else {
        let count = count_of_logs(logs.len());
        terminal.say(&format!("statistics of {count} of robot `{robot}`"));
        terminal.say(&place);
    }
    Ok(0)
}

/// The sum of these files for a fit, and their checksums.
pub(super) fn read(
    paths: &[PathBuf],
    progress: &Progress,
) -> Outcome<(StatisticsFile, Vec<FileHash>)> {
    let mut seen = |path: &Path| progress.step(&format!("reading {}", path.to_string_lossy()));
    let sum = StatisticsFiles::open(paths, &mut seen)?.read_for_fit()?;
    let files = paths.iter().zip(display_names(paths)).map(|(path, name)| {
        let sha256 = sha256_of_file(path)?;
        Ok(FileHash { name, sha256 })
    });
    Ok((sum, files.collect::<Outcome<_>>()?))
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
pub(super) fn write(
    mut output: OutputFile,
    content: impl FnOnce(BufWriter<&mut File>) -> twincal_io::Result<io::Result<()>>,
) -> Outcome<()> {
    let written = match output.file() {
        Some(to) => content(BufWriter::new(to))?,
        None => Ok(()),
    };
    require_caller()?;
    Ok(output.commit(written)?)
}
