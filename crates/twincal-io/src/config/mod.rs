//! `twincal.toml`: reading, checking, and the settings that follow from it.
//!
//! [`ConfigFile`] is the file as written, [`Config::read`] refuses unknown keys and wrong types with their place in the
//! file, [`Config::settings`] fills in defaults and checks ranges. Flags of the program are written into
//! [`Config::file`] before that: a flag overrides its key.

mod channel_names;
mod drive_gain;
mod factors;
mod families;
mod file;
mod kept_columns;
mod log_form;
mod log_forms;
mod per_joint;
mod proposal;
mod read_as;
mod settings;
mod unknown_keys;

pub use channel_names::{ChannelNames, ColumnsTable, TimeUnit};
pub use factors::FactorTable;
pub use file::{
    Allow, AutoWord, BaseTable, CheckTable, ConfigFile, FamilyWord, Friction, InclusionTable,
    InferenceTable, LagOrAuto, LibraryTable, LogEntry, LogTable, MethodWord, ModelTable,
    NoisePrior, NoiseTable, NoiseWord, NumberOrAuto, OutputTable, PayloadKey, PresetWord,
    PriorTable, SignalTable, Slab, Topics, TorqueWord, UnknownWord, VelocityWord,
};
pub use kept_columns::Attempt;
pub use log_form::LogForm;
pub use per_joint::PerJoint;
pub use proposal::{Proposal, key};
pub use read_as::ReadAs;
pub use settings::{Gates, LogSettings, OneLog, Settings};

use crate::artifact::sha256;
use crate::error::{Error, Place, Result};
use crate::open::{InputFile, Refusal};
use std::path::{Path, PathBuf};
use toml::de::{DeTable, DeValue};

/// Largest config that is read, bytes.
pub const SIZE_LIMIT: u64 = 1 << 20;

/// A config and where it came from.
///
/// # Example
/// ```
/// use twincal::term::Family;
/// use twincal_io::config::Config;
///
/// let text = "[library]\nfamilies = [\"viscous\", \"coulomb\"]\n[inference]\nseed = 7\n";
/// let settings = Config::parse("twincal.toml", text)?.settings()?.calibration;
/// assert_eq!(settings.library.families, [Family::Viscous, Family::Coulomb]);
/// assert_eq!(settings.inference.seed, 7);
/// let error = Config::parse("twincal.toml", "[library]\nfamilys = []\n").unwrap_err();
/// assert!(error.to_string().starts_with("twincal.toml:2:1: "));
/// # Ok::<(), twincal_io::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Config {
    /// The keys; flags may be written into it.
    pub file: ConfigFile,
    source: Option<Source>,
}

#[derive(Debug, Clone, PartialEq)]
struct Source {
    name: String,
    text: String,
    /// Where the config was read from; none: from memory.
    path: Option<PathBuf>,
}

impl Config {
    /// Reads a config. Paths in it are taken relative to its folder.
    ///
    /// # Errors
    /// [`Error::System`] if it cannot be read, [`Error::Content`] for wrong TOML, an unknown key or a wrong type.
    pub fn read(path: &Path) -> Result<Self> {
        let name = path.to_string_lossy().into_owned();
        let remedy = "give an existing file with --config";
        let bytes = (InputFile::new(path, SIZE_LIMIT).read()).map_err(|refusal| match refusal {
            Refusal::TooLarge { .. } => refusal.into_error(&name, "this is not a twincal.toml"),
            other => other.into_error(&name, remedy),
        })?;
        let text = String::from_utf8(bytes).map_err(|e| {
            let place = Place::of_offset(&name, e.as_bytes(), e.utf8_error().valid_up_to());
            Error::content(place, "not UTF-8", "save the file as UTF-8")
        })?;
        let mut config = Self::parse(&name, &text)?;
        if let Some(source) = &mut config.source {
            source.path = Some(path.to_owned());
        }
        config.relative_to(path.parent().unwrap_or(Path::new("")));
        Ok(config)
    }

    /// The file that it was read from, as given, and its SHA-256; none for defaults.
    pub fn read_from(&self) -> Option<(&Path, String)> {
        let source = self.source.as_ref()?;
        Some((source.path.as_deref()?, sha256(source.text.as_bytes())))
    }

    /// The file that it was read from; `None` for settings of flags alone.
    pub fn path(&self) -> Option<&Path> {
        self.source.as_ref()?.path.as_deref()
    }

    /// Reads a config from its text; `name` is used in messages.
    ///
    /// # Errors
    /// [`Error::Content`] for wrong TOML, an unknown key or a wrong type.
    pub fn parse(name: &str, text: &str) -> Result<Self> {
        let place = |span: Option<std::ops::Range<usize>>| match span {
            Some(span) => Place::of_offset(name, text.as_bytes(), span.start),
            None => Place::file(name),
        };
        let document = DeTable::parse(text).map_err(|e| {
            if let Some(error) = both_forms(name, text) {
                return error;
            }
            Error::content(
                place(e.span()),
                one_line(e.message()),
                "see https://toml.io for the syntax",
            )
        })?;
        if let Some(error) =
            unknown_keys::first_unknown(document.get_ref(), &schema_value(), name, text)
        {
            return Err(error);
        }
        let file = toml::from_str(text).map_err(|e| {
            let key = e
                .span()
                .and_then(|span| key_of(document.get_ref(), span.start, ""));
            let subject = key.map(|key| format!("key `{key}`: ")).unwrap_or_default();
            let remedy = "`twincal schema` prints every key with its type";
            Error::content(
                place(e.span()),
                format!("{subject}{}", one_line(e.message())),
                remedy,
            )
        })?;
        Ok(Self {
            file,
            source: Some(Source {
                name: name.into(),
                text: text.into(),
                path: None,
            }),
        })
    }

    /// The keys that change the result, as TOML for the report: no paths, threads or output.
    pub fn in_force(&self) -> String {
        let mut file = self.file.clone();
        file.model.file = None;
        file.log.heldout = None;
        for entry in &mut file.log.entries {
            let name = entry.file.file_name().unwrap_or_default();
            entry.file = PathBuf::from(name.to_string_lossy().into_owned());
        }
        file.inference.threads = None;
        file.output = OutputTable::default();
        match toml::Table::try_from(&file) {
            Ok(mut table) => {
                if file.log == LogTable::default() {
                    table.remove("log");
                }
                prune(&mut table);
                table.to_string()
            }
            // Only paths and seeds beyond TOML's numbers can fail to be written: none of the first is left, settings refuse the others.
            Err(_) => String::new(),
        }
    }

    fn relative_to(&mut self, folder: &Path) {
        let join = |path: &mut PathBuf| *path = folder.join(&*path);
        self.file.model.file.iter_mut().for_each(join);
        self.file.output.directory.iter_mut().for_each(join);
        self.file.log.heldout.iter_mut().flatten().for_each(join);
        let entries = self.file.log.entries.iter_mut();
        entries.for_each(|entry| join(&mut entry.file));
    }

    /// Place of a dotted key in the file, if it stands there.
    fn place(&self, key: &str) -> Option<Place> {
        let source = self.source.as_ref()?;
        let document = DeTable::parse(&source.text).ok()?;
        let offset = offset_of(document.get_ref(), &as_written(document.get_ref(), key))?;
        Some(Place::of_offset(
            &source.name,
            source.text.as_bytes(),
            offset,
        ))
    }

    /// The error with the place of its term or setting in the config, where it stands there.
    #[must_use]
    pub fn locate(&self, error: twincal::Error) -> Error {
        let (key, problem, remedy) = match &error {
            twincal::Error::Term {
                term,
                column,
                problem,
                remedy,
            } => {
                let mut terms = self.file.library.terms.iter();
                let Some(index) = terms.position(|own| own == term) else {
                    return error.into();
                };
                let problem = format!("term `{term}`, column {column}: {problem}");
                (format!("library.terms.{index}"), problem, remedy)
            }
            twincal::Error::Setting {
                key,
                problem,
                remedy,
            } => (key.clone(), format!("key `{key}`: {problem}"), remedy),
            _ => return error.into(),
        };
        match self.place(&key) {
            Some(place) => Error::content(place, problem, remedy),
            None => error.into(),
        }
    }

    /// The error for a value that is out of its range.
    fn out_of_range(&self, key: &str, problem: String, remedy: &str) -> Error {
        match self.place(key) {
            Some(place) => Error::content(place, format!("key `{key}`: {problem}"), remedy),
            None => twincal::Error::Setting {
                key: key.into(),
                problem,
                remedy: remedy.into(),
            }
            .into(),
        }
    }
}

/// The error for `[log]` beside `[[log]]`, which no TOML can have, at the second of them.
fn both_forms(name: &str, text: &str) -> Option<Error> {
    let line_of = |header: &str| {
        let is_header =
            |line: &str| line.split('#').next().unwrap_or("").replace(' ', "") == header;
        text.lines().position(|line| is_header(line.trim()))
    };
    let (table, entry) = (line_of("[log]")? + 1, line_of("[[log]]")? + 1);
    let problem =
        format!("has a table [log] in line {table} and entries [[log]] from line {entry} on");
    Some(Error::content(
        Place::line(name, table.max(entry) as u64),
        problem,
        "write [[log]] in both lines: an entry without `file` holds for all logs without an entry of their own",
    ))
}

/// The key of an entry `log.N`, counted among those with a file, or of what holds for all logs, as it stands in the file.
fn as_written(document: &DeTable<'_>, key: &str) -> String {
    let Some(rest) = key.strip_prefix("log.") else {
        return key.into();
    };
    let log = document.iter().find(|(name, _)| name.get_ref() == "log");
    let Some(DeValue::Array(items)) = log.map(|(_, value)| value.get_ref()) else {
        // The only entry, as a table.
        return format!("log.{}", rest.strip_prefix("0.").unwrap_or(rest));
    };
    let has_file = |place: &usize| match items.get(*place).map(toml::Spanned::get_ref) {
        Some(DeValue::Table(entry)) => entry.iter().any(|(name, _)| name.get_ref() == "file"),
        _ => false,
    };
    let (first, after) = rest.split_once('.').unwrap_or((rest, ""));
    match first.parse::<usize>() {
        Ok(number) => match (0..items.len()).filter(has_file).nth(number) {
            Some(place) => format!("log.{place}.{after}"),
            None => key.into(),
        },
        Err(_) => match (0..items.len()).find(|place| !has_file(place)) {
            Some(place) => format!("log.{place}.{rest}"),
            None => key.into(),
        },
    }
}

/// Removes empty tables, and the empty list of terms that means nothing.
fn prune(table: &mut toml::Table) {
    if let Some(toml::Value::Table(library)) = table.get_mut("library")
        && library
            .get("terms")
            .and_then(toml::Value::as_array)
            .is_some_and(Vec::is_empty)
    {
        library.remove("terms");
    }
    table.retain(|_, value| match value {
        toml::Value::Table(inner) => {
            prune(inner);
            !inner.is_empty()
        }
        _ => true,
    });
}

/// Dotted name of the innermost key whose value holds byte `offset`.
fn key_of(table: &DeTable<'_>, offset: usize, path: &str) -> Option<String> {
    table.iter().find_map(|(key, value)| {
        let name = if path.is_empty() {
            key.get_ref().to_string()
        } else {
            format!("{path}.{}", key.get_ref())
        };
        let inside = match value.get_ref() {
            DeValue::Table(inner) => key_of(inner, offset, &name),
            DeValue::Array(items) => items.iter().find_map(|item| match item.get_ref() {
                DeValue::Table(inner) => key_of(inner, offset, &name),
                _ => None,
            }),
            _ => None,
        };
        inside.or_else(|| {
            (value.span().contains(&offset) || key.span().contains(&offset)).then_some(name)
        })
    })
}

/// Byte offset of the value of a dotted key.
fn offset_of(table: &DeTable<'_>, key: &str) -> Option<usize> {
    // A name may have dots of its own.
    if let Some((_, value)) = table.iter().find(|(name, _)| name.get_ref() == key) {
        return Some(value.span().start);
    }
    let (first, rest) = key
        .split_once('.')
        .map_or((key, None), |(first, rest)| (first, Some(rest)));
    let value = table.iter().find(|(name, _)| name.get_ref() == first)?.1;
    match (rest, value.get_ref()) {
        (None, _) => Some(value.span().start),
        (Some(rest), DeValue::Table(inner)) => offset_of(inner, rest).or(Some(value.span().start)),
        (Some(rest), DeValue::Array(items)) => {
            let (index, rest) = rest.split_once('.').unwrap_or((rest, ""));
            let item = items.get(index.parse::<usize>().ok()?)?;
            match item.get_ref() {
                DeValue::Table(inner) => offset_of(inner, rest).or(Some(item.span().start)),
                _ => Some(item.span().start),
            }
        }
        (Some(_), _) => Some(value.span().start),
    }
}

fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn schema_value() -> serde_json::Value {
    schemars::schema_for!(ConfigFile).to_value()
}

/// The JSON Schema of `twincal.toml`, as published in `schema/twincal.schema.json`.
pub fn schema() -> String {
    // A `Value` of our own making is always written.
    format!("{:#}\n", schema_value())
}

#[cfg(test)]
mod tests;
