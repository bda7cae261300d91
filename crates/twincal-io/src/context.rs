//! Where a result comes from: program, settings, files and their hashes.

/// A run beside its result: only things that are the same when the run is repeated.
#[derive(Debug, Clone, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub struct ReportContext {
    /// Version of the program.
    pub version: String,
    /// What the model file calls the robot; empty where it has no name.
    #[serde(default)]
    pub robot: String,
    /// File name of the robot model, without its folder.
    pub model: String,
    /// Command line that repeats the run, with paths as given; the caller leaves out the folders of absolute ones.
    pub command: String,
    /// Settings in force, as TOML.
    pub settings: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// The config, as given without the folders of an absolute path; none where only flags and defaults hold.
    #[serde(default)]
    pub config: Option<FileHash>,
    /// Input files, in the order given.
    pub files: Vec<FileHash>,
}

/// An input file and what it held.
#[derive(Debug, Clone, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub struct FileHash {
    /// File name as given; the caller leaves out the folder of an absolute one.
    pub name: String,
    /// SHA-256, hexadecimal; empty for what came through a pipe, which earlier versions read.
    pub sha256: String,
}
