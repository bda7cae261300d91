//! Flags of `twincal fleet`.

use clap::{Args, ValueEnum};
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct Fleet {
    /// Files that `twincal statistics` or `twincal merge` wrote, of three robots
    /// at least, all with one plan.
    #[arg(value_name = "STATISTICS", required = true)]
    pub(crate) files: Vec<PathBuf>,
    /// What is one unit.
    #[arg(long, value_name = "WHAT", value_enum, default_value = "robot")]
    pub(crate) by: By,
    /// Folder for the twin of the type: what a robot does of which no log is there.
    #[arg(long, value_name = "DIR")]
    pub(crate) type_twin: Option<PathBuf>,
    /// Folder for the twin of one robot, in its last window; can be repeated.
    #[arg(long, value_name = "ROBOT=DIR")]
    pub(crate) twin: Vec<String>,
    /// Length of a window; a robot's change begins with one: 7d, 12h.
    #[arg(long, value_name = "LENGTH", default_value = "7d")]
    pub(crate) window: String,
    /// Expected share of named robots that do not deviate, at most.
    #[arg(long, value_name = "SHARE", default_value_t = 0.05)]
    pub(crate) fdr: f64,
    /// Folder of the result.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Replace an earlier result.
    #[arg(long)]
    pub(crate) force: bool,
    /// Seed of all random numbers.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Threads; the result is the same for any number.
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<u64>,
    /// Print the result as JSON on standard output.
    #[arg(long)]
    pub(crate) json: bool,
}

/// What the logs of a fleet belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum By {
    /// The robot that `twincal statistics --robot NAME` named.
    Robot,
}
