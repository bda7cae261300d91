//! The command line: commands, flags and their help, examples first.

mod design;
mod fleet;
mod schema;

pub(crate) use design::{Criterion, Design};
pub(crate) use fleet::Fleet;
pub(crate) use schema::{Described, Schema};

use clap::error::{ContextKind, ContextValue};
use clap::{Args, CommandFactory as _, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use twincal::robot::nearest_names;

const TOP: &str = "\
Examples:
  twincal demo                                        the whole road, offline
  twincal doctor run.csv --model arm.urdf             what is wrong with this log?
  twincal fit run*.csv --model arm.urdf               what does my model miss?
  twincal check today.csv --twin twincal-out          is the twin still right?
  twincal predict run.csv --twin twincal-out -o p.csv torque with intervals
";

/// Finds the physics missing from a robot's digital twin.
#[derive(Debug, Parser)]
#[command(name = "twincal", version, before_help = TOP, max_term_width = 80, subcommand_required = true)]
#[command(arg_required_else_help = true, disable_help_subcommand = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// The paper's study, from simulated logs to a report in ./twincal-demo.
    #[command(before_help = "Example:\n  twincal demo\n")]
    Demo(Demo),
    /// What a model and logs hold: joints, rates, gaps, motion, torque.
    #[command(before_help = "\
Examples:
  twincal inspect arm.urdf
  twincal inspect run1.csv run2.parquet --model arm.urdf
  twincal inspect run1.csv --model arm.urdf --json
")]
    Inspect(Inspect),
    /// What is wrong with these logs or this model, and how to fix it.
    #[command(
        before_help = "\
Examples:
  twincal doctor run.csv --model arm.urdf
  twincal doctor run1.csv run2.csv --model arm.urdf --json
  twincal doctor run.csv --model arm.urdf --trial   tries the fit as well
  twincal init run.csv --model arm.urdf      writes the proposed twincal.toml
",
        after_help = "The exit code is what `twincal fit` would end with for the same reason. What only a\nfit can tell (too few independent rows) is found with --trial."
    )]
    Doctor(Doctor),
    /// Write the twincal.toml that `doctor` proposes.
    #[command(before_help = "\
Examples:
  twincal init run*.csv --model arm.urdf
  twincal fit                                reads ./twincal.toml
")]
    Init(Init),
    /// Discover what the model misses, estimate it, validate on held-out data.
    #[command(
        before_help = "\
Examples:
  twincal fit run1.csv --model arm.urdf
  twincal fit run*.csv --model arm.urdf --heldout other.csv -o calibrated
  twincal fit run*.csv --model arm.urdf --config twincal.toml --force --json
  twincal fit run*.csv --model arm.urdf -v --open    everything, and the page
",
        after_help = "\
Exit code 0: the twin may be used; 3: it may not, or data were degraded (the result is
written); 2: wrong usage or input; 4: the data cannot answer the question."
    )]
    Fit(Fit),
    /// What a fit takes of each log, as a small file: such files add, and `fit`
    /// takes them in the place of the logs.
    #[command(before_help = "\
Examples:
  twincal statistics run*.mcap --model arm.urdf -o statistics
  twincal statistics new.mcap --model arm.urdf --plan statistics/plan.json -o statistics
  twincal fit --statistics statistics/*.arrow --heldout other.mcap
")]
    Statistics(StatisticsFlags),
    /// One file of statistics from several.
    #[command(before_help = "\
Example:
  twincal merge statistics/*.arrow -o all.arrow
")]
    Merge(Merge),
    /// Which robots of a type deviate, and what is wrong with the model of all.
    #[command(before_help = "\
Examples:
  twincal fleet statistics/*/*.arrow -o fleet
  twincal fleet statistics/*/*.arrow --window 1d --fdr 0.01 -o fleet
")]
    Fleet(Fleet),
    /// The motion to record: within the robot's limits, what shows most.
    #[command(before_help = "\
Examples:
  twincal design --model arm.urdf -o motion
  twincal design --twin twincal-out -o motion
  twincal design --twin twincal-out --decide payload -o motion
  twincal design --model arm.urdf --limits limits.toml --duration 30 -o motion
")]
    Design(Design),
    /// Score a twin on new logs: exit code 0, or 1 where a gate says no.
    #[command(
        before_help = "\
Examples:
  twincal check today.csv --twin twincal-out
  twincal check today.csv --twin twincal-out --config gates.toml --json
",
        after_help = "\
Gates of each joint: RMSE at most 1.2 times the twin's own, at least 90 % of rows
in 95 % intervals ([check] of twincal.toml). Changes: friction of each joint, a
payload, joint zeros; an unchanged robot fails these with probability 1 % at most.
Exit code 3: the logs are too short to tell (fewer than 10 independent rows)."
    )]
    Check(Check),
    /// Torque with 95 % intervals, row by row.
    #[command(before_help = "\
Examples:
  twincal predict job.csv --twin twincal-out -o torque.csv
  twincal predict job.mcap --twin twincal-out -o torque.mcap
  twincal predict job.csv --twin twincal-out | head
")]
    Predict(Predict),
    /// What changed between two twins of the same robot.
    #[command(before_help = "\
Examples:
  twincal diff before after
  twincal diff before after --json
")]
    Diff(Diff),
    /// The calibrated model: your own file with only the changed numbers changed,
    /// or code that computes torque and interval.
    #[command(before_help = "\
Examples:
  twincal export --twin twincal-out --to urdf -o calibrated.urdf
  twincal export --twin twincal-out --to urdf --draws 64 -o models
  twincal export --twin twincal-out --to urdf | diff arm.urdf -
  twincal export --twin twincal-out --to c -o arm.c
  twincal export --twin twincal-out --to c --beyond urdf -o rest.c
  twincal export --twin twincal-out --to csv -o effects.csv
")]
    Export(Export),
    /// Write report.html anew from the stored result.
    #[command(before_help = "Example:\n  twincal report --twin twincal-out\n")]
    Report(Report),
    /// Print a script that completes commands and flags in your shell.
    #[command(before_help = "\
Examples:
  twincal completions bash > ~/.local/share/bash-completion/completions/twincal
  twincal completions zsh > ~/.zfunc/_twincal
  twincal completions fish > ~/.config/fish/completions/twincal.fish
")]
    Completions(Completions),
    /// Print the JSON Schema of twincal.toml or of another file.
    #[command(before_help = "\
Examples:
  twincal schema > twincal.schema.json
  twincal schema limits > limits.schema.json
")]
    Schema(Schema),
}

impl Command {
    /// True where a program reads standard output.
    pub(crate) fn wants_json(&self) -> bool {
        match self {
            Self::Demo(flags) => flags.json,
            Self::Inspect(flags) => flags.log.json,
            Self::Doctor(flags) => flags.look.log.json,
            Self::Fit(flags) => flags.log.json,
            Self::Statistics(flags) => flags.log.json,
            Self::Merge(flags) => flags.json,
            Self::Fleet(flags) => flags.json,
            Self::Design(flags) => flags.json,
            Self::Check(flags) => flags.log.json,
            Self::Predict(flags) => flags.log.json,
            Self::Diff(flags) => flags.json,
            Self::Export(flags) => flags.json,
            Self::Report(flags) => flags.json,
            Self::Init(_) | Self::Completions(_) | Self::Schema(_) => false,
        }
    }
}

/// Flags of every command that reads logs.
#[derive(Debug, Args)]
pub(crate) struct LogFlags {
    /// Settings; a flag overrides its key. fit, doctor and inspect read
    /// ./twincal.toml where there is one.
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Sampling rate in Hz that replaces missing or wrong time stamps.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub(crate) rate: Option<f64>,
    /// Drop and count rows that cannot be read instead of refusing the file.
    #[arg(long)]
    pub(crate) lenient: bool,
    /// Refuse logs in which data was lost or degraded beyond the stated limit.
    #[arg(long)]
    pub(crate) strict: bool,
    /// Threads; the result is the same for any number.
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<u64>,
    /// Print the result as JSON on standard output.
    #[arg(long)]
    pub(crate) json: bool,
}

/// How much of a result is printed for people.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct PrintFlags {
    /// Print everything, not only what matters most.
    #[arg(short, long, conflicts_with = "quiet")]
    pub(crate) verbose: bool,
    /// Print the answer alone, in one line.
    #[arg(short, long, conflicts_with = "json")]
    pub(crate) quiet: bool,
    /// Open the report in the browser.
    #[arg(long)]
    pub(crate) open: bool,
}

/// What may be accepted with a warning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Allow {
    /// Physically inconsistent inertia tensors.
    UnphysicalInertia,
    /// Gibbs chains that disagree (R-hat > 1.01).
    DisagreeingChains,
}

/// The same where nothing is fitted: a model only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum AllowModel {
    /// Physically inconsistent inertia tensors.
    UnphysicalInertia,
}

#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// Seed of all random numbers [default: 1].
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Threads; the result is the same for any number.
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<u64>,
    #[command(flatten)]
    pub(crate) print: PrintFlags,
    /// Print the result as JSON on standard output.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Inspect {
    /// Logs (CSV, Parquet, Arrow, NPZ, MCAP, rosbag2); without --model the first
    /// path is the model.
    #[arg(value_name = "PATH")]
    pub(crate) paths: Vec<PathBuf>,
    /// Robot model (URDF, MJCF).
    #[arg(long, value_name = "MODEL")]
    pub(crate) model: Option<PathBuf>,
    /// Accept with a warning what would be refused.
    #[arg(long, value_name = "WHAT", value_enum)]
    pub(crate) allow: Vec<AllowModel>,
    /// Leave out ./twincal.toml.
    #[arg(long, conflicts_with = "config")]
    pub(crate) no_config: bool,
    #[command(flatten)]
    pub(crate) log: LogFlags,
}

/// Logs beside a model.
#[derive(Debug, Args)]
#[allow(
    rustdoc::broken_intra_doc_links,
    reason = "[[log]] is a table of twincal.toml, and this text is printed as help"
)]
pub(crate) struct Look {
    /// Logs to look at (CSV, Parquet, Arrow, NPZ, MCAP, rosbag2) [default: those of [[log]] in the config].
    #[arg(value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Robot model (URDF, MJCF).
    #[arg(long, value_name = "MODEL")]
    pub(crate) model: Option<PathBuf>,
    /// Accept with a warning what would be refused.
    #[arg(long, value_name = "WHAT", value_enum)]
    pub(crate) allow: Vec<AllowModel>,
    /// Leave out ./twincal.toml.
    #[arg(long, conflicts_with = "config")]
    pub(crate) no_config: bool,
    #[command(flatten)]
    pub(crate) log: LogFlags,
}

#[derive(Debug, Args)]
pub(crate) struct Doctor {
    #[command(flatten)]
    pub(crate) look: Look,
    /// Try the fit as well; it takes as long as `fit`.
    #[arg(long)]
    pub(crate) trial: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Init {
    #[command(flatten)]
    pub(crate) look: Look,
    /// File to write [default: twincal.toml].
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Replace an existing file.
    #[arg(long)]
    pub(crate) force: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Diff {
    /// Folder of the earlier twin.
    #[arg(value_name = "BEFORE")]
    pub(crate) before: PathBuf,
    /// Folder of the later twin.
    #[arg(value_name = "AFTER")]
    pub(crate) after: PathBuf,
    /// Print the result as JSON on standard output.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
#[allow(
    rustdoc::broken_intra_doc_links,
    reason = "[[log]] is a table of twincal.toml, and this text is printed as help"
)]
pub(crate) struct Fit {
    /// Logs to fit (CSV, Parquet, Arrow, NPZ, MCAP, rosbag2); each is a trajectory
    /// of its own [default: those of [[log]] in the config].
    #[arg(value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Files that `twincal statistics` wrote, in the place of logs and model;
    /// without --heldout the twin is not tested.
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["logs", "model"])]
    pub(crate) statistics: Vec<PathBuf>,
    /// Robot model (URDF, MJCF).
    #[arg(long, value_name = "MODEL")]
    pub(crate) model: Option<PathBuf>,
    /// Logs to score on; without them some of the fitted data is left out.
    #[arg(long, value_name = "LOG", num_args = 1..)]
    pub(crate) heldout: Vec<PathBuf>,
    /// Folder of the result [default: twincal-out].
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Replace an earlier result.
    #[arg(long)]
    pub(crate) force: bool,
    /// Seed of all random numbers [default: 1].
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Accept with a warning what would be refused.
    #[arg(long, value_name = "WHAT", value_enum)]
    pub(crate) allow: Vec<Allow>,
    /// Leave out ./twincal.toml.
    #[arg(long, conflicts_with = "config")]
    pub(crate) no_config: bool,
    #[command(flatten)]
    pub(crate) print: PrintFlags,
    #[command(flatten)]
    pub(crate) log: LogFlags,
}

#[derive(Debug, Args)]
pub(crate) struct StatisticsFlags {
    /// Logs (CSV, Parquet, Arrow, NPZ, MCAP, rosbag2).
    #[arg(value_name = "LOG", required = true)]
    pub(crate) logs: Vec<PathBuf>,
    /// Robot model (URDF, MJCF).
    #[arg(long, value_name = "MODEL")]
    pub(crate) model: Option<PathBuf>,
    /// A plan that was written before, or `auto`: that of the folder where there
    /// is one, else one is made by a fit to these logs (twelve of them at most);
    /// `fleet`: the same with columns about what that fit finds, for many robots.
    #[arg(long, value_name = "FILE", default_value = "auto")]
    pub(crate) plan: PathBuf,
    /// The robot that was logged [default: the model's name].
    #[arg(long, value_name = "NAME")]
    pub(crate) robot: Option<String>,
    /// Folder for plan.json and a file per log; what is there already is kept.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Make files anew that are there already.
    #[arg(long)]
    pub(crate) force: bool,
    /// Accept with a warning what would be refused.
    #[arg(long, value_name = "WHAT", value_enum)]
    pub(crate) allow: Vec<AllowModel>,
    /// Leave out ./twincal.toml.
    #[arg(long, conflicts_with = "config")]
    pub(crate) no_config: bool,
    #[command(flatten)]
    pub(crate) log: LogFlags,
}

#[derive(Debug, Args)]
pub(crate) struct Merge {
    /// Files that `twincal statistics` or `twincal merge` wrote.
    #[arg(value_name = "FILE", required = true)]
    pub(crate) files: Vec<PathBuf>,
    /// File to write.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Replace an existing file.
    #[arg(long)]
    pub(crate) force: bool,
    /// Print the result as JSON on standard output.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Check {
    /// Logs to score the twin on.
    #[arg(value_name = "LOG", required = true)]
    pub(crate) logs: Vec<PathBuf>,
    /// Folder that `twincal fit` wrote.
    #[arg(long, value_name = "DIR")]
    pub(crate) twin: PathBuf,
    #[command(flatten)]
    pub(crate) log: LogFlags,
}

#[derive(Debug, Args)]
pub(crate) struct Predict {
    /// Logs to predict; their rows follow each other.
    #[arg(value_name = "LOG", required = true)]
    pub(crate) logs: Vec<PathBuf>,
    /// Folder that `twincal fit` wrote.
    #[arg(long, value_name = "DIR")]
    pub(crate) twin: PathBuf,
    /// .csv, .parquet or .mcap; without it CSV goes to standard output.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Replace an existing file.
    #[arg(long)]
    pub(crate) force: bool,
    #[command(flatten)]
    pub(crate) log: LogFlags,
}

/// What a twin is written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExportFormat {
    /// The URDF that was fitted, with inertias and friction; from an MJCF a
    /// generated one without meshes.
    Urdf,
    /// The MJCF that was fitted; also motor inertia, springs and gravity. From
    /// a URDF a generated one without meshes.
    Mjcf,
    /// C99: torque, interval and "outside the data" in one function.
    C,
    /// Rust without its standard library.
    Rust,
    /// Python with NumPy.
    Python,
    /// The steps of the calculation, for other languages.
    Json,
    /// The table of effects, for spreadsheets.
    Csv,
}

/// What an export may be in spite of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum AllowExport {
    /// A model file that predicts torque of some joint worse than yours does.
    WorseThanModel,
}

/// A model file that was exported.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Beyond {
    /// What --to urdf cannot say.
    Urdf,
    /// What --to mjcf cannot say.
    Mjcf,
}

#[derive(Debug, Args)]
pub(crate) struct Export {
    /// Folder that `twincal fit` wrote.
    #[arg(long, value_name = "DIR")]
    pub(crate) twin: PathBuf,
    /// What to write.
    #[arg(long, value_name = "FORMAT", value_enum)]
    pub(crate) to: ExportFormat,
    /// Code for the rest only: what is missing in the exported model file.
    #[arg(long, value_name = "FORMAT", value_enum)]
    pub(crate) beyond: Option<Beyond>,
    /// Write this many models drawn from the posterior; -o is then a folder.
    #[arg(long, value_name = "N")]
    pub(crate) draws: Option<usize>,
    /// Seed of the draws [default: that of the fit].
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// File to write; without it the model goes to standard output.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Replace an existing file or an earlier folder.
    #[arg(long)]
    pub(crate) force: bool,
    /// Accept with a warning what would be refused.
    #[arg(long, value_name = "WHAT", value_enum)]
    pub(crate) allow: Vec<AllowExport>,
    /// Print what was written and what was not as JSON on standard output.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Report {
    /// Folder that `twincal fit` wrote.
    #[arg(long, value_name = "DIR")]
    pub(crate) twin: PathBuf,
    /// Rewrite a report that was changed by hand.
    #[arg(long)]
    pub(crate) force: bool,
    /// Open the report in the browser.
    #[arg(long)]
    pub(crate) open: bool,
    /// Print the path of the report as JSON on standard output.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Completions {
    /// Your shell.
    #[arg(value_name = "SHELL", value_enum)]
    pub(crate) shell: clap_complete::Shell,
}

/// The script for a shell.
pub(crate) fn completions(shell: clap_complete::Shell) -> Vec<u8> {
    let (mut command, mut script) = (Arguments::command(), Vec::new());
    clap_complete::generate(shell, &mut command, "twincal", &mut script);
    script
}

/// Adds the nearest command to an error about an unknown one, where clap has none (`fti`).
pub(crate) fn with_suggestion(mut error: clap::Error) -> clap::Error {
    if let (Some(ContextValue::String(given)), None) = (
        error.get(ContextKind::InvalidSubcommand),
        error.get(ContextKind::SuggestedSubcommand),
    ) {
        let command = Arguments::command();
        let near = nearest_names(
            given,
            command.get_subcommands().map(clap::Command::get_name),
        );
        if let Some(name) = near.first() {
            let suggested = ContextValue::Strings(vec![(*name).to_owned()]);
            error.insert(ContextKind::SuggestedSubcommand, suggested);
        }
    }
    error
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_do_not_contradict_each_other() {
        Arguments::command().debug_assert();
    }
}
