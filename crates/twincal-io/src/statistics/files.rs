//! Several files of statistics as one, row by row.

use super::reader::{Reader, look, table};
use super::write::written;
use super::{Entry, FORMAT, MAX_BYTES, Metadata, ModelFile, StatisticsFile};
use crate::error::{Error, Place, Result};
use crate::log::Row;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use twincal::calibrate::{FromTables, Header, Identity, clash};

/// Files that are open at a time.
const OPEN: usize = 64;

/// Files of statistics that belong together: one robot, one plan, every log once. Of their logs nothing is kept but what they are.
#[derive(Debug)]
pub struct StatisticsFiles {
    files: Vec<Known>,
    header: Header,
    /// The model of the file that has the first log by name.
    model: ModelFile,
    /// In the order of names.
    logs: Vec<Placed>,
}

/// A file that was looked at.
#[derive(Debug)]
struct Known {
    path: PathBuf,
    /// Where its rows begin.
    batches: Vec<u64>,
}

/// A log, its file and its row there.
#[derive(Debug)]
struct Placed {
    entry: Entry,
    file: usize,
    row: usize,
}

impl StatisticsFiles {
    /// Looks at all files; `seen` is called before each.
    ///
    /// # Errors
    /// [`Error::Content`] with the file for one that is damaged, of another plan, version or robot than the first, or that holds a log of another
    /// file or overlaps in time with one.
    pub fn open(paths: &[PathBuf], seen: &mut dyn FnMut(&Path)) -> Result<Self> {
        let mut common: Option<Header> = None;
        let (mut files, mut logs) = (Vec::new(), Vec::new());
        let mut models: Vec<(ModelFile, usize)> = Vec::new();
        for (file, path) in paths.iter().enumerate() {
            seen(path);
            let (metadata, batches) = look(path)?;
            match &common {
                None => {
                    let Header { plan, robot, .. } = &metadata.header;
                    let fits = plan.require_for(robot);
                    fits.map_err(|e| of_file(path, e))?;
                    common = Some(metadata.header);
                }
                Some(first) => {
                    let same = first.require_same(&metadata.header);
                    same.map_err(|e| of_file(path, e))?;
                }
            }
            // Runs of files have one model.
            if models
                .last()
                .is_none_or(|(last, _)| *last != metadata.model)
            {
                models.push((metadata.model, file));
            }
            let path = path.clone();
            files.push(Known { path, batches });
            let rows = (0..).zip(metadata.logs);
            logs.extend(rows.map(|(row, entry)| Placed { entry, file, row }));
        }
        require_distinct(&logs, paths)?;
        logs.sort_by(|a, b| a.entry.name.cmp(&b.entry.name));
        let first = logs.first().map(|own| own.file);
        let model = models
            .into_iter()
            .rev()
            .find(|(_, from)| Some(*from) <= first);
        let (Some(header), Some((model, _))) = (common, model) else {
            return Err(Error::Core(twincal::Error::Statistics {
                problem: "no log in these files of statistics".into(),
                remedy: "give files that `twincal statistics` wrote".into(),
            }));
        };
        Ok(Self {
            files,
            header,
            model,
            logs,
        })
    }

    /// The robot that was logged.
    #[must_use]
    pub fn robot_name(&self) -> &str {
        &self.header.robot_name
    }

    /// Names of the logs.
    pub fn log_names(&self) -> impl Iterator<Item = &str> {
        self.logs.iter().map(|own| own.entry.name.as_str())
    }

    /// The sums of all logs.
    ///
    /// # Errors
    /// [`Error::Content`] for a file that is damaged, or was changed since it was looked at; those of [`FromTables`] with the file.
    pub fn read(self) -> Result<StatisticsFile> {
        self.sums(|tables, _| tables)
    }

    /// The sums of all logs with what a fit takes of them, see [`FromTables::for_fit`].
    ///
    /// # Errors
    /// Those of [`StatisticsFiles::read`].
    pub fn read_for_fit(self) -> Result<StatisticsFile> {
        self.sums(FromTables::for_fit)
    }

    fn sums(self, start: impl FnOnce(FromTables, usize) -> FromTables) -> Result<StatisticsFile> {
        let mut readers = Readers::new(&self.files);
        let mut tables = start(FromTables::new(self.header)?, self.logs.len());
        for own in &self.logs {
            let reader = readers.of(own.file)?;
            let (row, text) = reader.row(own.row, &own.entry)?;
            let added = tables.add(table(&row, text));
            added.map_err(|e| of_file(&self.files[own.file].path, e))?;
        }
        Ok(StatisticsFile {
            statistics: tables.finish()?,
            model: self.model,
        })
    }

    /// Writes the same bytes for the same logs, however they are spread over files.
    ///
    /// # Errors
    /// [`Error::Content`] for a file that is damaged, or was changed since it was looked at; [`Error::Core`] for more than can be read again;
    /// [`Error::Internal`] for what has no JSON. The inner error is the system's refusal to write.
    pub fn write_to(self, to: impl Write) -> Result<io::Result<()>> {
        self.require_readable()?;
        let metadata = Metadata {
            format: FORMAT,
            checksum: String::new(),
            model: self.model,
            header: self.header,
            logs: self.logs.iter().map(|own| own.entry.clone()).collect(),
        };
        let mut readers = Readers::new(&self.files);
        let rows = self.logs.iter().map(|own| -> Result<Row> {
            let (row, _) = readers.of(own.file)?.row(own.row, &own.entry)?;
            Ok(row)
        });
        written(metadata, rows, to)
    }

    /// # Errors
    /// [`Error::Core`] where the files together are larger than one may be.
    fn require_readable(&self) -> Result<()> {
        let length = |own: &Known| std::fs::metadata(&own.path).map_or(0, |own| own.len());
        let bytes: u64 = self.files.iter().map(length).sum();
        if bytes <= MAX_BYTES {
            return Ok(());
        }
        Err(Error::Core(twincal::Error::Statistics {
            problem: format!("these files have {bytes} bytes, the limit of one is {MAX_BYTES}"),
            remedy: "merge fewer files at a time, and give `fit` several".into(),
        }))
    }
}

/// The files that were read from last; the newest stands last.
struct Readers<'a> {
    files: &'a [Known],
    open: Vec<(usize, Reader)>,
}

impl<'a> Readers<'a> {
    fn new(files: &'a [Known]) -> Self {
        let open = Vec::new();
        Self { files, open }
    }

    fn of(&mut self, file: usize) -> Result<&mut Reader> {
        let known = self.open.iter().position(|(own, _)| *own == file);
        let reader = match known {
            Some(at) => self.open.remove(at),
            None => {
                let Known { path, batches } = &self.files[file];
                (file, Reader::open(path, batches)?)
            }
        };
        if self.open.len() == OPEN {
            self.open.remove(0);
        }
        Ok(&mut self.open.push_mut(reader).1)
    }
}

/// # Errors
/// [`Error::Content`] with both files, for a log that two of them hold, and for logs that overlap in time.
fn require_distinct(logs: &[Placed], paths: &[PathBuf]) -> Result<()> {
    let identities: Vec<Identity<'_>> = logs.iter().map(|own| own.entry.identity()).collect();
    let Some(found) = clash(&identities) else {
        return Ok(());
    };
    let [one, other] = (found.logs).map(|log| paths[logs[log].file].display().to_string());
    Err(Error::content(
        Place::file(&other),
        format!("{} ({one})", found.problem),
        "give every log once",
    ))
}

fn of_file(path: &Path, error: twincal::Error) -> Error {
    let (problem, remedy) = match error {
        twincal::Error::Statistics { problem, remedy } => (problem, remedy),
        other => (other.to_string(), "leave this file out".into()),
    };
    Error::content(Place::file(path.display().to_string()), problem, remedy)
}
