//! A rosbag2 folder: which files belong to it, from `metadata.yaml` or, without one, by their names.

use crate::error::{Error, Place, Result};
use crate::open::{InputFile, Refusal};
use saphyr_parser::{Event, Parser};
use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};
use twincal::{Code, Finding, Severity};

const METADATA: &str = "metadata.yaml";
/// Largest metadata, bytes, and deepest nesting in it.
const MAX_METADATA: u64 = 16 << 20;
const MAX_DEPTH: usize = 32;
/// Most values, keys and brackets of the metadata: 10 000 files and 4000 topics have about 300 000. Ten million of them take seconds.
const MAX_ITEMS: usize = 1_000_000;
/// Most files of a bag: 24 hours in files of 10 s are 8640.
const MAX_FILES: usize = 10_000;
/// Endings of files that hold messages.
const ENDINGS: [&str; 4] = [".mcap", ".db3", ".mcap.zstd", ".db3.zstd"];

/// The files of a bag in the order of their recording.
///
/// # Errors
/// [`Error::Content`] for metadata that is broken, has YAML aliases or tags, or names files outside the folder or missing; for a folder
/// without a bag.
pub(super) fn files(folder: &Path) -> Result<(Vec<PathBuf>, Vec<Finding>)> {
    let metadata = folder.join(METADATA);
    if metadata.exists() {
        return Ok((files_of_metadata(folder, &metadata)?, Vec::new()));
    }
    let (files, finding) = files_by_name(folder)?;
    Ok((files, vec![finding]))
}

/// What a folder that cannot be read is refused with.
fn unreadable(folder: &Path, error: &std::io::Error) -> Error {
    let name = folder.display().to_string();
    Error::system(&name, "read", error, "check its permissions")
}

/// The files that the metadata names.
fn files_of_metadata(folder: &Path, metadata: &Path) -> Result<Vec<PathBuf>> {
    let place = metadata.display().to_string();
    let text = text_of(folder, metadata, &place)?;
    let listed = listed_files(&place, &text)?;
    too_many(&place, listed.len())?;
    if listed.is_empty() {
        return Err(Error::content(
            Place::file(place),
            "names no file in relative_file_paths",
            "write it anew with `ros2 bag reindex`, or remove it: the files are then taken by name",
        ));
    }
    let mut files = Vec::with_capacity(listed.len());
    let mut known = BTreeSet::new();
    for path in &listed {
        let file = inside(folder, &place, path)?;
        if !known.insert(file.canonicalize().map_err(|e| unreadable(folder, &e))?) {
            return Err(Error::content(
                Place::file(place),
                format!("names the file `{path}` twice: its messages would count twice"),
                "write it anew with `ros2 bag reindex`, or name every file once in relative_file_paths",
            ));
        }
        files.push(file);
    }
    Ok(files)
}

/// The files of a folder without metadata that end as a bag's do, in the order of their names.
fn files_by_name(folder: &Path) -> Result<(Vec<PathBuf>, Finding)> {
    let name = folder.display().to_string();
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| unreadable(folder, &e))? {
        let path = entry.map_err(|e| unreadable(folder, &e))?.path();
        let file = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        if path.is_file() && ENDINGS.iter().any(|ending| file.ends_with(ending)) {
            files.push((natural(&file), path));
        }
    }
    files.sort();
    too_many(&name, files.len())?;
    if files.is_empty() {
        return Err(Error::content(
            Place::file(name),
            "is a folder without metadata.yaml and without .mcap or .db3 files",
            "give a log file or a rosbag2 folder",
        ));
    }
    let message = format!(
        "the bag has no metadata.yaml: its {} files were taken in the order of their names; `ros2 bag reindex` writes it",
        files.len()
    );
    let finding = Finding::new(Severity::Warning, Code::NoMetadata, name, message, 0)
        .with([("files", files.len() as f64)]);
    Ok((files.into_iter().map(|(_, path)| path).collect(), finding))
}

/// The text of the metadata, which is a file of the folder.
fn text_of(folder: &Path, metadata: &Path, place: &str) -> Result<String> {
    let remedy = "write it anew with `ros2 bag reindex`";
    let bytes = InputFile::new(metadata, MAX_METADATA)
        .inside(folder)
        .read()
        .map_err(|refusal| refusal.into_error(place, remedy))?;
    let not_text = |_| Error::content(Place::file(place), "is not UTF-8", remedy);
    String::from_utf8(bytes).map_err(not_text)
}

/// Refuses a bag of more files than any recorder makes.
fn too_many(place: &str, files: usize) -> Result<()> {
    if files <= MAX_FILES {
        return Ok(());
    }
    Err(Error::content(
        Place::file(place),
        format!("names {files} files, the limit of a bag is {MAX_FILES}"),
        "record larger files, or make several bags of it",
    ))
}

/// `bag_2` before `bag_10`: runs of digits count as numbers.
fn natural(name: &str) -> Vec<(String, u64)> {
    let mut parts = vec![(String::new(), 0_u64)];
    let mut in_digits = false;
    for c in name.chars() {
        match c.to_digit(10) {
            Some(digit) => {
                if let Some((_, number)) = parts.last_mut() {
                    *number = number.saturating_mul(10).saturating_add(u64::from(digit));
                }
                in_digits = true;
            }
            None => {
                if in_digits {
                    parts.push((String::new(), 0));
                    in_digits = false;
                }
                if let Some((text, _)) = parts.last_mut() {
                    text.push(c);
                }
            }
        }
    }
    parts
}

/// A file that the metadata names, if it lies within the folder.
fn inside(folder: &Path, place: &str, listed: &str) -> Result<PathBuf> {
    let refuse =
        |problem: String, remedy: &str| Err(Error::content(Place::file(place), problem, remedy));
    let relative = Path::new(listed);
    let plain = (relative.components())
        .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if !plain || listed.is_empty() {
        return refuse(
            format!("names the file `{listed}`, which lies outside the bag's folder"),
            "a bag's files lie in its folder: put them there and correct relative_file_paths",
        );
    }
    // Packed and unpacked files go by the same name in some versions of rosbag2.
    let other = match listed.strip_suffix(".zstd") {
        Some(unpacked) => unpacked.to_owned(),
        None => format!("{listed}.zstd"),
    };
    let candidates = [folder.join(relative), folder.join(other)];
    let Some(path) = candidates.into_iter().find(|path| path.is_file()) else {
        return refuse(
            format!("names the file `{listed}`, which is not there"),
            "copy the whole bag again, or remove metadata.yaml to read the files that are there",
        );
    };
    match InputFile::new(&path, u64::MAX).inside(folder).open() {
        Err(Refusal::Outside) => refuse(
            format!("names the file `{listed}`, a link that leads outside the bag's folder"),
            "copy the file into the folder",
        ),
        // What else is wrong with it is said when it is read.
        _ => Ok(path),
    }
}

enum Level {
    Map(Option<String>),
    List,
}

/// `relative_file_paths` of `rosbag2_bagfile_information`.
fn listed_files(place: &str, text: &str) -> Result<Vec<String>> {
    let refuse = |line: usize, problem: String| {
        Error::content(
            Place::line(place, line as u64),
            problem,
            "write it anew with `ros2 bag reindex`",
        )
    };
    let (mut levels, mut files): (Vec<Level>, Vec<String>) = (Vec::new(), Vec::new());
    for (item, event) in Parser::new_from_str(text).enumerate() {
        let (event, span) =
            event.map_err(|e| refuse(e.marker().line(), format!("is not YAML: {}", e.info())))?;
        let line = span.start.line();
        if item >= MAX_ITEMS {
            return Err(refuse(
                line,
                format!("has more than {MAX_ITEMS} values, keys and brackets"),
            ));
        }
        if let Some(what) = unneeded(&event) {
            return Err(refuse(line, format!("has a YAML {what}, which is refused")));
        }
        if levels.len() > MAX_DEPTH {
            return Err(refuse(line, format!("is nested deeper than {MAX_DEPTH}")));
        }
        let in_list = match levels.as_slice() {
            [Level::Map(Some(top)), Level::Map(Some(key)), Level::List] => {
                top == "rosbag2_bagfile_information" && key == "relative_file_paths"
            }
            _ => false,
        };
        match event {
            Event::MappingStart(..) => levels.push(Level::Map(None)),
            Event::SequenceStart(..) => levels.push(Level::List),
            Event::MappingEnd | Event::SequenceEnd => {
                levels.pop();
                value_ended(&mut levels);
            }
            Event::Scalar(text, ..) => {
                if in_list {
                    files.push(text.into_owned());
                } else if let Some(Level::Map(key)) = levels.last_mut() {
                    *key = match key {
                        None => Some(text.into_owned()),
                        Some(_) => None,
                    };
                }
            }
            _ => {}
        }
    }
    Ok(files)
}

/// What of YAML no metadata needs.
fn unneeded(event: &Event<'_>) -> Option<&'static str> {
    match event {
        Event::Alias(_) => Some("alias"),
        Event::Scalar(_, _, _, Some(_))
        | Event::SequenceStart(_, Some(_))
        | Event::MappingStart(_, Some(_)) => Some("tag"),
        _ => None,
    }
}

/// A map waits for its next key once a value has ended; a map or list as a key counts as an empty one.
fn value_ended(levels: &mut [Level]) {
    if let Some(Level::Map(key)) = levels.last_mut() {
        *key = match key {
            None => Some(String::new()),
            Some(_) => None,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_a_bag_are_ordered_by_their_numbers() {
        let mut names = ["bag_10.mcap", "bag_2.mcap", "bag_0.mcap"];
        names.sort_by_key(|name| natural(name));
        assert_eq!(names, ["bag_0.mcap", "bag_2.mcap", "bag_10.mcap"]);
    }
}
