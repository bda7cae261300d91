//! `<include file="…"/>` of MJCF: only inside the model's folder, bounded in depth, number and bytes.

use super::xml::{Document, Element, MAX_BYTES, MAX_DEPTH, shorten};
use crate::error::{Error, Result};
use crate::open::{InputFile, Refusal};
use std::path::{Path, PathBuf};

/// Deepest chain of files.
const MAX_CHAIN: usize = 16;
/// Most included files in all.
const MAX_FILES: usize = 1000;

/// Replaces every `<include>` of the document by the children of the named file's root.
///
/// `main` is the main file; `None` (a model from memory) refuses includes.
///
/// # Errors
/// At the `<include>`: outside the folder, not readable, a cycle, over a limit.
pub(super) fn expand(document: &mut Document, main: Option<&Path>) -> Result<()> {
    if !document.elements.iter().any(|e| e.name == "include") {
        return Ok(());
    }
    let folder = match main {
        Some(path) => Some(Folder::of(path)?),
        None => None,
    };
    let chain: Vec<PathBuf> = folder.iter().map(|f| f.main.clone()).collect();
    let mut budget = Budget {
        files: 0,
        bytes: document.files.iter().map(|f| f.text.len()).sum(),
    };
    let range = 0..document.elements.len();
    expand_range(document, folder.as_ref(), range, &chain, &mut budget)?;
    check_depth(document)
}

/// What may be opened.
struct Folder {
    /// The main file, canonical.
    main: PathBuf,
    /// Its folder, canonical: nothing outside it is opened.
    root: PathBuf,
}

impl Folder {
    fn of(main: &Path) -> Result<Self> {
        let fail = |error: &std::io::Error| {
            Error::system(
                main.display().to_string(),
                "resolve",
                error,
                "give the path of an existing file",
            )
        };
        let main = main.canonicalize().map_err(|e| fail(&e))?;
        let root = main.parent().unwrap_or(&main).to_path_buf();
        Ok(Self { main, root })
    }
}

struct Budget {
    files: usize,
    bytes: usize,
}

/// Expands the includes among the elements of one file; recursion is bounded by [`MAX_CHAIN`].
fn expand_range(
    document: &mut Document,
    folder: Option<&Folder>,
    range: std::ops::Range<usize>,
    chain: &[PathBuf],
    budget: &mut Budget,
) -> Result<()> {
    for index in range {
        let children = std::mem::take(&mut document.elements[index].children);
        let mut expanded = Vec::with_capacity(children.len());
        for child in children {
            if document.elements[child].name == "include" {
                let root = open(document, folder, child, chain, budget)?;
                expanded.append(&mut document.elements[root].children);
            } else {
                expanded.push(child);
            }
        }
        document.elements[index].children = expanded;
    }
    Ok(())
}

/// Parses the file of one `<include>` and expands it in turn; returns its root element.
fn open(
    document: &mut Document,
    folder: Option<&Folder>,
    include: usize,
    chain: &[PathBuf],
    budget: &mut Budget,
) -> Result<usize> {
    let element = document.elements[include].clone();
    let Some(file) = element.text("file") else {
        return Err(document.error(
            &element,
            "<include> has no attribute `file`",
            "name the file",
        ));
    };
    let shown = shorten(file);
    let Some(folder) = folder else {
        return Err(document.error(
            &element,
            format!("includes `{shown}`, but this model does not come from a file"),
            "write the parts into one file",
        ));
    };
    let directive = Include {
        document,
        element: &element,
        shown: &shown,
    };
    let path = directive.resolve(folder, file, chain)?;
    let bytes = directive.read(folder, &path, budget)?;
    let start = document.elements.len();
    let root = document.parse(file, &bytes)?;
    let name = &document.elements[root].name;
    if name != "mujoco" && name != "mujocoinclude" {
        let name = shorten(name);
        return Err(document.error(
            &element,
            format!("included file `{shown}` has the root <{name}>"),
            "it must be <mujoco> or <mujocoinclude>",
        ));
    }
    let mut longer = chain.to_vec();
    longer.push(path);
    expand_range(
        document,
        Some(folder),
        start..document.elements.len(),
        &longer,
        budget,
    )?;
    Ok(root)
}

/// One `<include>`.
struct Include<'a> {
    document: &'a Document,
    element: &'a Element,
    /// The file as it is shown.
    shown: &'a str,
}

impl Include<'_> {
    fn fail<T>(&self, problem: String, remedy: &str) -> Result<T> {
        Err(self.document.error(self.element, problem, remedy))
    }

    /// Path of the file: inside the folder and not in the chain of files that include it.
    fn resolve(&self, folder: &Folder, file: &str, chain: &[PathBuf]) -> Result<PathBuf> {
        let shown = self.shown;
        if chain.len() > MAX_CHAIN {
            return self.fail(
                format!("includes are nested deeper than {MAX_CHAIN} files"),
                "flatten the model",
            );
        }
        let path = match folder.root.join(file).canonicalize() {
            Ok(path) => path,
            Err(error) => {
                return self.fail(
                    format!("cannot include `{shown}`: {error}"),
                    "check the path",
                );
            }
        };
        if !path.starts_with(&folder.root) {
            return self.fail(
                format!("includes `{shown}`, which is outside the model's folder"),
                "copy it beside the model: nothing outside that folder is opened",
            );
        }
        if chain.contains(&path) {
            return self.fail(
                format!("includes `{shown}`, which includes this file: a cycle"),
                "remove one of them",
            );
        }
        Ok(path)
    }

    /// Bytes of the file, as far as the budget goes.
    fn read(&self, folder: &Folder, path: &Path, budget: &mut Budget) -> Result<Vec<u8>> {
        let shown = self.shown;
        budget.files += 1;
        let included = InputFile::new(path, MAX_BYTES as u64).inside(&folder.root);
        let mut bytes = Vec::new();
        let size = match included.read() {
            Ok(read) => {
                bytes = read;
                bytes.len() as u64
            }
            // Told below, with what the others have.
            Err(Refusal::TooLarge { bytes, .. }) => bytes,
            Err(refusal) => {
                let problem = format!("cannot include `{shown}`: it {refusal}");
                return self.fail(problem, "check the path");
            }
        };
        budget.bytes = budget
            .bytes
            .saturating_add(usize::try_from(size).unwrap_or(usize::MAX));
        if budget.bytes > MAX_BYTES || budget.files > MAX_FILES {
            return self.fail(
                format!(
                    "included files exceed the limit of {} MiB or {MAX_FILES} files in all (at `{shown}`)",
                    MAX_BYTES >> 20
                ),
                "no robot needs this: is it the right model?",
            );
        }
        Ok(bytes)
    }
}

/// Includes may have stacked more levels than one file may have.
fn check_depth(document: &Document) -> Result<()> {
    let mut stack = vec![(0, 1)];
    while let Some((index, depth)) = stack.pop() {
        let element: &Element = &document.elements[index];
        if depth > MAX_DEPTH {
            return Err(document.error(
                element,
                format!("elements are nested deeper than {MAX_DEPTH} levels"),
                "no robot needs this: is it the right file?",
            ));
        }
        stack.extend(element.children.iter().map(|&c| (c, depth + 1)));
    }
    Ok(())
}
