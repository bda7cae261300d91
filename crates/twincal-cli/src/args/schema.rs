//! Flags of `twincal schema`.

use clap::{Args, ValueEnum};

#[derive(Debug, Args)]
pub(crate) struct Schema {
    /// The file that it describes.
    #[arg(value_name = "FILE", value_enum, default_value_t = Described::Config)]
    pub(crate) of: Described,
}

/// A file with a schema that is made from the program's own types.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Described {
    /// twincal.toml.
    Config,
    /// What design takes as --limits.
    Limits,
    /// design.json.
    Design,
}
