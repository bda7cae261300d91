//! Complete or absent: every step of writing, and every way in which an artefact can be wrong.

use super::beside::Beside;
use super::write::{exchange, exchange_in_two_steps, stage};
use super::*;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

fn files(word: &str) -> Vec<(&'static str, Pieces)> {
    vec![
        (RESULT, format!("{{\"is\":\"{word}\"}}").into_bytes().into()),
        (REPORT, vec![b'x'; 100_000].into()),
    ]
}

fn write(target: &Path, word: &str, replace: Replace) -> crate::Result<()> {
    Claim::new(target, replace, &Inputs::default())?.commit(Maker::Fit, files(word))
}

fn word(target: &Path) -> String {
    let artifact = Artifact::open(target).unwrap();
    artifact.verify_except(&[]).unwrap();
    String::from_utf8(artifact.read(RESULT).unwrap()).unwrap()
}

fn leftovers(folder: &Path) -> Vec<PathBuf> {
    let mut all: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    all.retain(|path| {
        path.file_name()
            .unwrap()
            .to_string_lossy()
            .starts_with(".twincal-")
    });
    all
}

#[test]
fn written_replaced_and_nothing_left_beside() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out");
    write(&target, "first", Replace::Never).unwrap();
    assert_eq!(word(&target), "{\"is\":\"first\"}");
    let refused = write(&target, "second", Replace::Never)
        .unwrap_err()
        .to_string();
    assert!(
        refused.contains("exists already") && refused.contains("--force"),
        "{refused}"
    );
    write(&target, "second", Replace::Artifact).unwrap();
    assert_eq!(word(&target), "{\"is\":\"second\"}");
    assert!(leftovers(folder.path()).is_empty());
}

#[test]
fn case_97_killed_after_each_step_the_artefact_is_whole() {
    let steps: [fn(&Beside); 4] = [
        |b| fs::create_dir(&b.staging).unwrap(),
        |b| stage(b, &files("new")[..1]).unwrap(),
        |b| {
            fs::create_dir(&b.staging).unwrap();
            fs::File::create(b.staging.join(RESULT))
                .unwrap()
                .write_all(b"{\"is")
                .unwrap();
        },
        |b| {
            stage(b, &files("new")).unwrap();
            fs::rename(&b.target, &b.old).unwrap();
        },
    ];
    for (number, step) in steps.iter().enumerate() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out");
        write(&target, "old", Replace::Never).unwrap();
        step(&Beside::new(&target, OTHER_OUTPUT).unwrap());
        if number < 3 {
            assert_eq!(word(&target), "{\"is\":\"old\"}", "step {number}");
        }
        // The next run cleans up, and brings the old artefact back before it does its own work.
        drop(Claim::new(&target, Replace::Artifact, &Inputs::default()).unwrap());
        assert_eq!(word(&target), "{\"is\":\"old\"}", "step {number}");
        assert!(leftovers(folder.path()).is_empty(), "step {number}");
    }
}

#[test]
fn both_kinds_of_exchange_swap_the_folders() {
    for swap in [exchange, exchange_in_two_steps] {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out");
        write(&target, "old", Replace::Never).unwrap();
        let beside = Beside::new(&target, OTHER_OUTPUT).unwrap();
        stage(&beside, &files("new")).unwrap();
        swap(&beside).unwrap();
        assert_eq!(fs::read(target.join(RESULT)).unwrap(), b"{\"is\":\"new\"}");
    }
}

#[test]
fn case_99_file_symlink_read_only_and_foreign_folders_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("file"), "x").unwrap();
    std::os::unix::fs::symlink("elsewhere", at("link")).unwrap();
    fs::create_dir(at("foreign")).unwrap();
    fs::write(at("foreign/notes.txt"), "mine").unwrap();
    fs::create_dir(at("closed")).unwrap();
    let mut closed = fs::metadata(at("closed")).unwrap().permissions();
    closed.set_readonly(true);
    fs::set_permissions(at("closed"), closed).unwrap();
    for (name, words) in [
        ("file", "is a file"),
        ("link", "is a symbolic link"),
        ("foreign", "holds `notes.txt`, which twincal did not write"),
        ("closed", "read-only"),
        ("closed/out", "read-only"),
        ("..", "cannot be replaced"),
    ] {
        let error = write(&at(name), "x", Replace::Artifact)
            .unwrap_err()
            .to_string();
        assert!(error.contains(words), "{name}: {error}");
        // A command with one name for its output has no -o.
        let error = write(&at(name), "x", Replace::MadeBy(Maker::Demo)).expect_err(name);
        let (crate::Error::Content { remedy, .. } | crate::Error::System { remedy, .. }) = error
        else {
            panic!("{name}: another error");
        };
        assert!(!remedy.contains("-o "), "{name}: {remedy}");
    }
    assert_eq!(fs::read(at("foreign/notes.txt")).unwrap(), b"mine");
    // A folder that is missing is made.
    write(&at("absent/too/out"), "x", Replace::Never).unwrap();
    assert!(at("absent/too/out").is_dir());
    let proc = write(Path::new("/proc/twincal-out"), "x", Replace::Never)
        .unwrap_err()
        .to_string();
    assert!(
        proc.contains("cannot write") || proc.contains("read-only"),
        "{proc}"
    );
}

#[test]
fn case_101_second_writer_is_refused_while_the_first_works() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out");
    let first = Claim::new(&target, Replace::Never, &Inputs::default()).unwrap();
    let second = Claim::new(&target, Replace::Artifact, &Inputs::default())
        .unwrap_err()
        .to_string();
    assert!(second.contains("another twincal is writing"), "{second}");
    first.commit(Maker::Fit, files("first")).unwrap();
    assert_eq!(word(&target), "{\"is\":\"first\"}");
    write(&target, "third", Replace::Artifact).unwrap();
}

#[test]
fn case_114_and_115_newer_and_damaged_artefacts_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out");
    write(&target, "good", Replace::Never).unwrap();
    let path = target.join(RESULT);
    let mut bytes = fs::read(&path).unwrap();
    bytes[3] ^= 1;
    fs::write(&path, &bytes).unwrap();
    let artifact = Artifact::open(&target).unwrap();
    let error = artifact.read(RESULT).unwrap_err().to_string();
    assert!(
        error.contains("checksum") && error.contains("result.json"),
        "{error}"
    );
    artifact.verify_except(&[RESULT]).unwrap();

    let manifest = fs::read_to_string(target.join(MANIFEST)).unwrap();
    for (from, to, words) in [
        ("\"format\": 1", "\"format\": 2", "needs twincal >= 0.1.0"),
        (
            "\"needs\": \"0.1.0\"",
            "\"needs\": \"99.0.0\"",
            "needs twincal >= 99.0.0",
        ),
        ("\"format\": 1", "\"format\": ", "manifest is damaged"),
        ("result.json", "../result.json", "plain file name"),
    ] {
        assert!(manifest.contains(from));
        fs::write(target.join(MANIFEST), manifest.replace(from, to)).unwrap();
        let error = Artifact::open(&target)
            .and_then(|a| a.verify_except(&[RESULT]))
            .unwrap_err()
            .to_string();
        assert!(error.contains(words), "{error}");
    }
    let error = Artifact::open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("is no twin"), "{error}");
}

#[test]
fn a_twin_is_made_of_its_own_files_and_of_no_more_than_a_twin_needs() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out");
    write(&target, "good", Replace::Never).unwrap();
    let manifest = fs::read_to_string(target.join(MANIFEST)).unwrap();
    let refused = |artifact: crate::Result<Artifact>| {
        let read = artifact.and_then(|artifact| artifact.verify_except(&[]));
        read.unwrap_err().to_string()
    };
    // A link to the right bytes in another folder.
    let result = target.join(RESULT);
    let outside = folder.path().join("outside.json");
    fs::rename(&result, &outside).unwrap();
    std::os::unix::fs::symlink(&outside, &result).unwrap();
    let error = refused(Artifact::open(&target));
    assert!(
        error.contains("result.json: is a link that leads outside"),
        "{error}"
    );
    fs::remove_file(&result).unwrap();
    fs::rename(&outside, &result).unwrap();
    // The manifest too.
    fs::rename(target.join(MANIFEST), &outside).unwrap();
    std::os::unix::fs::symlink(&outside, target.join(MANIFEST)).unwrap();
    let error = refused(Artifact::open(&target));
    assert!(
        error.contains("manifest.json: is a link that leads outside"),
        "{error}"
    );
    fs::remove_file(target.join(MANIFEST)).unwrap();
    // Sizes are compared with their limits before anything is read.
    let claims = manifest.replace("\"bytes\": 100000", "\"bytes\": 5000000000");
    assert_ne!(claims, manifest);
    fs::write(target.join(MANIFEST), &claims).unwrap();
    let report = fs::File::options()
        .write(true)
        .open(target.join(REPORT))
        .unwrap();
    report.set_len(5_000_000_000).unwrap();
    let error = refused(Artifact::open(&target));
    assert!(
        error.contains("has 5000000000 bytes by the manifest"),
        "{error}"
    );
    let file = fs::File::create(target.join(MANIFEST)).unwrap();
    file.set_len(1 << 40).unwrap();
    let error = refused(Artifact::open(&target));
    assert!(
        error.contains("manifest.json: has 1099511627776 bytes"),
        "{error}"
    );
}

#[test]
fn case_108_any_file_name_works() {
    use std::os::unix::ffi::OsStrExt as _;
    let folder = tempfile::tempdir().unwrap();
    let long = "x".repeat(255);
    for name in [
        b"with space".as_slice(),
        "Größe π".as_bytes(),
        b"bad\xff\xfebytes",
        b"-rf",
        long.as_bytes(),
    ] {
        let target = folder.path().join(std::ffi::OsStr::from_bytes(name));
        write(&target, "one", Replace::Never).unwrap();
        write(&target, "two", Replace::Artifact).unwrap();
        assert_eq!(word(&target), "{\"is\":\"two\"}");
    }
    assert!(leftovers(folder.path()).is_empty());
}

#[test]
fn only_its_own_maker_replaces_a_demo() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("twincal-demo");
    write(&target, "fit", Replace::Never).unwrap();
    let error = Claim::new(&target, Replace::MadeBy(Maker::Demo), &Inputs::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("not written by this command"), "{error}");
    fs::remove_dir_all(&target).unwrap();
    Claim::new(&target, Replace::Never, &Inputs::default())
        .unwrap()
        .commit(Maker::Demo, files("demo"))
        .unwrap();
    Claim::new(&target, Replace::MadeBy(Maker::Demo), &Inputs::default())
        .unwrap()
        .commit(Maker::Demo, files("again"))
        .unwrap();
    assert_eq!(word(&target), "{\"is\":\"again\"}");
}

#[test]
fn output_file_appears_only_when_complete() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.csv");
    let mut output = OutputFile::create(&path, false, &Inputs::default()).unwrap();
    let written = output.file().unwrap().write_all(b"t\n");
    assert!(!path.exists());
    output.commit(written).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"t\n");
    assert!(
        OutputFile::create(&path, false, &Inputs::default())
            .unwrap_err()
            .to_string()
            .contains("--force")
    );
    let output = OutputFile::create(&path, true, &Inputs::default()).unwrap();
    let error = output
        .commit(Err(std::io::Error::other("disk full")))
        .unwrap_err()
        .to_string();
    assert!(error.contains("disk full"), "{error}");
    assert_eq!(fs::read(&path).unwrap(), b"t\n");
    assert!(leftovers(folder.path()).is_empty());
}
