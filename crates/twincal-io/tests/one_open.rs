//! Files are opened for reading in one place, `twincal-io/src/open.rs`, which refuses what is no regular file and what is too large.

#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use std::fs;
use std::path::{Path, PathBuf};

/// Ways to open a file for reading.
const WAYS: [&str; 12] = [
    "File::open(",
    "File::options(",
    "OpenOptions",
    "openat(",
    "fs::read(",
    "fs::read_to_string(",
    "fs::copy(",
    "from_path(",
    "try_from(path",
    "Connection::open",
    "mmap",
    "stdin()",
];

/// Where one of them stands all the same, how often, and why.
const EXCEPTIONS: [(&str, &str, usize, &str); 4] = [
    ("twincal-io/src/open.rs", "openat(", 3, "this is the place"),
    (
        "twincal-io/src/artifact/beside.rs",
        "OpenOptions",
        3,
        "makes the lock file, which is written",
    ),
    (
        "twincal-io/src/artifact/write.rs",
        "File::open(",
        1,
        "opens the output folder to sync it",
    ),
    (
        "twincal-io/src/log/bag/sqlite.rs",
        "Connection::open",
        1,
        "SQLite opens by path: after open.rs, and compared with what that opened",
    ),
];

#[test]
fn files_are_opened_for_reading_in_one_place() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut files = 0;
    let mut found = Vec::new();
    for part in ["twincal-io/src", "twincal-cli/src"] {
        for path in sources(&crates.join(part)) {
            files += 1;
            let name = path.strip_prefix(&crates).unwrap().display().to_string();
            let code = shipped(&fs::read_to_string(&path).unwrap());
            for way in WAYS {
                let count = code.matches(way).count();
                let allowed = (EXCEPTIONS.iter())
                    .find(|(file, known, ..)| *file == name && *known == way)
                    .map_or(0, |(_, _, count, _)| *count);
                if count != allowed {
                    found.push(format!("{name}: {count} × `{way}`, allowed are {allowed}"));
                }
            }
        }
    }
    assert!(files > 100, "{files} files");
    assert!(
        found.is_empty(),
        "open files with `open::InputFile`:\n{}",
        found.join("\n")
    );
}

#[test]
fn the_reader_of_sources_sees_what_it_should() {
    let code = shipped(
        "//! fs::read(\nlet a = fs::read(path); // File::open(\n#[cfg(test)]\nmod tests { File::open(x) }\n",
    );
    assert_eq!(code.trim(), "let a = fs::read(path);");
}

/// Every file below `root` that is no file of tests.
fn sources(root: &Path) -> Vec<PathBuf> {
    let (mut folders, mut files) = (vec![root.to_path_buf()], Vec::new());
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() && name != "tests" {
                folders.push(path);
            } else if name.ends_with(".rs") && !["tests.rs", "fixture.rs"].contains(&&*name) {
                files.push(path);
            }
        }
    }
    files
}

/// The code without comments and without the tests, which stand at the end of a file.
fn shipped(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or("");
    code.lines()
        .map(|line| line.split("//").next().unwrap_or("").trim_end().to_owned() + "\n")
        .collect()
}
