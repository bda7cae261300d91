//! Flags of `twincal design`.

use clap::{Args, ValueEnum};
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct Design {
    /// Folder that `twincal fit` wrote: the motion is to decide what it leaves open.
    #[arg(long, value_name = "DIR", required_unless_present = "model")]
    pub(crate) twin: Option<PathBuf>,
    /// Robot model (URDF, MJCF): the motion is to show body, motors and friction.
    /// With --twin: where its meshes are found.
    #[arg(long, value_name = "MODEL")]
    pub(crate) model: Option<PathBuf>,
    /// Effects to decide; without it those with a probability of 0.05 to 0.95.
    #[arg(long, value_name = "NAME", num_args = 1.., requires = "twin")]
    pub(crate) decide: Vec<String>,
    /// What the motion maximises without a twin.
    #[arg(long, value_enum, default_value_t = Criterion::Determinant, conflicts_with = "twin")]
    pub(crate) criterion: Criterion,
    /// Logs that are recorded already, beside those of the twin: what they show the motion need
    /// not show again. Their torque is not looked at.
    #[arg(long, value_name = "LOG", num_args = 1..)]
    pub(crate) after: Vec<PathBuf>,
    /// Settings file: how the base of --model stands, and how logs of --after are read;
    /// without it as the model says, and as those of the twin were read.
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Length of the motion in seconds.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 20.0,
        allow_negative_numbers = true
    )]
    pub(crate) duration: f64,
    /// The controller's rate in Hz.
    #[arg(
        long,
        value_name = "HZ",
        default_value_t = 500.0,
        allow_negative_numbers = true
    )]
    pub(crate) rate: f64,
    /// Limits and start of joints, over those of the model: TOML with
    /// [joint.NAME] position = [a, b], velocity, acceleration, jerk, torque, start;
    /// load = { mass, com } that it is known to carry; margin, floor, [[box]] and ignore for collisions.
    #[arg(long, value_name = "FILE")]
    pub(crate) limits: Option<PathBuf>,
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

/// A criterion by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Criterion {
    /// Information on all base parameters: the narrowest intervals.
    Determinant,
    /// A smaller condition number, at the price of wider intervals.
    Condition,
}
