//! rosbag2 folders and SQLite bags.

use super::write::{bag, both};
use super::{START, contains, fixture, is_the_motion, read, refused, says};
use std::fs;
use std::path::Path;
use tempfile::TempDir;
use twincal::Code;

/// A folder with the bag of `both` cut into parts, named so that the order of the alphabet is wrong.
fn parts() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let messages = both();
    for (name, range) in [
        ("run_2.mcap", 0..60),
        ("run_9.mcap", 60..130),
        ("run_10.mcap", 130..200),
    ] {
        fs::write(folder.path().join(name), bag(&messages[range])).unwrap();
    }
    folder
}

fn metadata(folder: &Path, paths: &[&str]) {
    let list: String = paths.iter().map(|path| format!("    - {path}\n")).collect();
    let text = format!(
        "rosbag2_bagfile_information:\n  version: 9\n  relative_file_paths:\n{list}  message_count: 200\n"
    );
    fs::write(folder.join("metadata.yaml"), text).unwrap();
}

/// The carried SQLite bag, unpacked into a folder of its own.
fn db3() -> (TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let packed = fs::read(fixture("bag_db3_zstd/bag_db3_zstd.db3.zstd")).unwrap();
    let path = folder.path().join("run 1?.db3");
    fs::write(&path, zstd::decode_all(&packed[..]).unwrap()).unwrap();
    (folder, path)
}

#[test]
fn folders_of_other_writers_are_read() {
    let (recording, _) = read(&fixture("bag_mcap")).unwrap();
    is_the_motion(&recording, 40, START);
}

#[test]
fn case_62_a_folder_without_metadata_is_read_by_names() {
    let folder = parts();
    let (recording, findings) = read(folder.path()).unwrap();
    is_the_motion(&recording, 200, 1.0);
    contains(
        &says(&findings, "no_metadata").message,
        &["3 files", "order of their names", "ros2 bag reindex"],
    );
    metadata(folder.path(), &["run_2.mcap", "run_9.mcap", "run_10.mcap"]);
    let (same, findings) = read(folder.path()).unwrap();
    assert_eq!(same, recording);
    assert!(!findings.iter().any(|f| f.code == Code::NoMetadata));
    let empty = tempfile::tempdir().unwrap();
    contains(
        &refused(read(empty.path())),
        &["without .mcap or .db3 files"],
    );
    metadata(folder.path(), &["run_3.mcap"]);
    contains(
        &refused(read(folder.path())),
        &["`run_3.mcap`, which is not there"],
    );
}

#[test]
fn a_file_that_is_named_twice_is_refused() {
    let folder = parts();
    for again in ["run_9.mcap", "./run_9.mcap", "run_9.mcap.zstd"] {
        metadata(folder.path(), &["run_2.mcap", "run_9.mcap", again]);
        contains(
            &refused(read(folder.path())),
            &[
                "metadata.yaml",
                &format!("`{again}` twice"),
                "every file once",
            ],
        );
    }
}

#[test]
fn case_63_metadata_that_leads_outside_is_refused() {
    let folder = parts();
    let inner = folder.path().join("inner");
    fs::create_dir(&inner).unwrap();
    let absolute = folder.path().join("run_2.mcap").display().to_string();
    for path in ["../run_2.mcap", absolute.as_str(), "a/../../run_2.mcap"] {
        metadata(&inner, &[path]);
        contains(
            &refused(read(&inner)),
            &["metadata.yaml", path, "outside the bag's folder"],
        );
    }
    std::os::unix::fs::symlink(folder.path().join("run_2.mcap"), inner.join("link.mcap")).unwrap();
    metadata(&inner, &["link.mcap"]);
    contains(
        &refused(read(&inner)),
        &["`link.mcap`, a link that leads outside"],
    );
}

#[test]
fn case_112_yaml_bombs_and_tags_are_refused() {
    let folder = parts();
    let refuse = |text: &str, parts: &[&str]| {
        fs::write(folder.path().join("metadata.yaml"), text).unwrap();
        contains(&refused(read(folder.path())), parts);
    };
    let mut bomb = "a: &a [x, x, x, x, x, x, x, x, x]\n".to_owned();
    for level in 'b'..='j' {
        let below = char::from(level as u8 - 1);
        let aliases = format!("*{below}, ").repeat(9);
        bomb += &format!("{level}: &{level} [{aliases}]\n");
    }
    refuse(&bomb, &["metadata.yaml:2", "YAML alias"]);
    refuse(
        "rosbag2_bagfile_information: !!python/object/apply:os.system ['true']\n",
        &["metadata.yaml:1", "YAML tag"],
    );
    refuse(&"[".repeat(100_000), &["metadata.yaml"]);
    refuse("a: b: c", &["metadata.yaml:1", "is not YAML"]);
    refuse(
        "rosbag2_bagfile_information:\n  relative_file_paths: []\n",
        &["names no file"],
    );
}

#[test]
fn sqlite_bags_are_read_and_left_alone() {
    let (folder, path) = db3();
    is_the_motion(&read(&path).unwrap().0, 60, START);
    let names: Vec<_> = fs::read_dir(folder.path())
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    assert_eq!(names, ["run 1?.db3"]);
}

#[test]
fn case_64_a_malformed_page_is_refused() {
    let (_folder, path) = db3();
    let mut bytes = fs::read(&path).unwrap();
    let page = 4096;
    let pages = bytes.len() / page;
    // every page but the first two loses its kind
    for number in 2..pages {
        bytes[number * page] = 0xFF;
    }
    fs::write(&path, &bytes).unwrap();
    contains(
        &refused(read(&path)),
        &["is not a whole SQLite bag", "malformed"],
    );
    fs::write(&path, &bytes[..page + 100]).unwrap();
    contains(&refused(read(&path)), &["is not a whole SQLite bag"]);
}

#[test]
fn case_65_a_bag_that_is_still_written_is_refused() {
    let (folder, path) = db3();
    fs::write(folder.path().join("run 1?.db3-wal"), [1; 100]).unwrap();
    contains(&refused(read(&path)), &["still being written", "100 bytes"]);
    // an empty one is what a recorder that ended well may leave
    fs::write(folder.path().join("run 1?.db3-wal"), []).unwrap();
    read(&path).unwrap();
}

#[test]
fn case_66_a_packed_bag_is_unpacked_within_a_limit() {
    is_the_motion(&read(&fixture("bag_db3_zstd")).unwrap().0, 60, START);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.db3.zstd");
    let packed = fs::read(fixture("bag_db3_zstd/bag_db3_zstd.db3.zstd")).unwrap();
    fs::write(&path, &packed[..packed.len() / 2]).unwrap();
    contains(&refused(read(&path)), &["cannot be unpacked"]);
    let mut file = zstd::Encoder::new(fs::File::create(&path).unwrap(), 3).unwrap();
    std::io::copy(
        &mut std::io::Read::take(std::io::repeat(0), 200 << 20),
        &mut file,
    )
    .unwrap();
    file.finish().unwrap();
    contains(&refused(read(&path)), &["refusing to expand"]);
}
