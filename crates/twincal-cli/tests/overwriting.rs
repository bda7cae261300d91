//! No command writes over what it reads, or over what the twin was made from: every command, every spelling of a path.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common::{files, fit, fitted_copy, run};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Another path of the same file.
type Spelling = fn(&Path, &str) -> PathBuf;

/// As it is, by an absolute path, by a detour, through a folder that is a link, and by a hard link.
const SPELLINGS: [(&str, Spelling); 5] = [
    ("plain", |_, name| name.into()),
    ("absolute", |folder, name| folder.join(name)),
    ("detour", |_, name| format!("twin/../{name}").into()),
    ("linked folder", |folder, name| {
        let link = folder.join("link");
        let _ = std::os::unix::fs::symlink(folder, &link);
        link.join(name)
    }),
    ("hard link", |folder, name| {
        let path = folder.join(format!("hard{}", ending(name)));
        let _ = fs::remove_file(&path);
        fs::hard_link(folder.join(name), &path).unwrap();
        path
    }),
];

/// `.csv`
fn ending(name: &str) -> String {
    let ending = Path::new(name).extension().unwrap().to_string_lossy();
    format!(".{ending}")
}

/// Every file of a folder with its bytes, but for `hard.*` and what lies behind `link`.
fn content(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let _ = fs::remove_file(folder.join("link"));
    let own = files(folder).into_iter();
    let own =
        own.filter(|path| !path.starts_with("hard") && path.file_stem() != Some("hard".as_ref()));
    own.map(|path| (path.clone(), fs::read(folder.join(&path)).unwrap()))
        .collect()
}

/// A folder with a twin, its log, its model, a config and an MJCF with an include, none of which may change.
fn prepared() -> TempDir {
    let folder = fitted_copy();
    let main = "<mujoco><include file=\"part.xml\"/></mujoco>";
    let part = "<mujoco><worldbody><body name=\"upper\"><joint name=\"shoulder\" axis=\"0 0 1\"/><inertial pos=\".2 0 0\" \
                mass=\"2\" diaginertia=\".01 .03 .03\"/><body name=\"fore\" pos=\".4 0 0\"><joint name=\"elbow\" axis=\"0 0 \
                1\"/><inertial pos=\".15 0 0\" mass=\"1\" diaginertia=\".005 .01 .01\"/></body></body></worldbody></mujoco>";
    fs::write(folder.path().join("main.xml"), main).unwrap();
    fs::write(folder.path().join("part.xml"), part).unwrap();
    folder
}

/// `twincal …`, one line, `{}` is the output.
const COMMANDS: [(&str, &[&str]); 8] = [
    (
        "init run.csv --model arm.urdf --config quick.toml -o {} --force",
        &["run.csv", "arm.urdf", "quick.toml"],
    ),
    (
        "init run.csv --model main.xml -o {} --force",
        &["main.xml", "part.xml"],
    ),
    (
        "predict run.csv --twin twin --config quick.toml -o {} --force",
        &["run.csv"],
    ),
    ("export --twin twin --to urdf -o {} --force", EXPORT),
    ("export --twin twin --to c -o {} --force", EXPORT),
    ("export --twin twin --to rust -o {} --force", EXPORT),
    ("export --twin twin --to python -o {} --force", EXPORT),
    ("export --twin twin --to json -o {} --force", EXPORT),
];
/// What an export reads, and what its twin was made from.
const EXPORT: &[&str] = &[
    "twin/manifest.json",
    "twin/twin.json",
    "twin/model.urdf",
    "twin/report.html",
    "arm.urdf",
    "run.csv",
];

#[test]
fn no_command_writes_over_what_it_reads() {
    let folder = prepared();
    let before = content(folder.path());
    for (line, targets) in COMMANDS {
        for target in targets {
            for (spelling, path) in SPELLINGS {
                let output = path(folder.path(), target);
                let line: Vec<_> = (line.split(' '))
                    .map(|word| {
                        if word == "{}" {
                            output.clone().into_os_string()
                        } else {
                            word.into()
                        }
                    })
                    .collect();
                let done = run(folder.path(), &line);
                let what = format!("{line:?} ({spelling}): {}", done.err);
                assert_eq!(done.code, Some(2), "{what}");
                assert!(done.err.contains("would be overwritten"), "{what}");
                assert!(done.err.contains("another output with -o"), "{what}");
                assert!(content(folder.path()) == before, "{what}");
            }
        }
    }
}

/// A symbolic link to an input is named as such or as the input; the input stays.
#[test]
fn a_symbolic_link_to_an_input_leads_nowhere() {
    let folder = prepared();
    std::os::unix::fs::symlink("run.csv", folder.path().join("log.csv")).unwrap();
    let before = content(folder.path());
    for line in [
        "init run.csv --model arm.urdf -o log.csv --force",
        "predict run.csv --twin twin -o log.csv --force",
        "predict log.csv --twin twin -o run.csv --force",
        "export --twin twin --to c -o log.csv --force",
        "fit run.csv --model arm.urdf --config quick.toml -o log.csv --force",
    ] {
        run(folder.path(), line.split(' ')).expect(2);
        assert!(content(folder.path()) == before, "{line}");
    }
}

/// Folders: of a twin that is read, of a fit whose inputs lie in an earlier result (those of the demo do), of a bag.
#[test]
fn no_folder_takes_the_place_of_what_is_read() {
    let folder = prepared();
    // An artefact that lists its inputs, as that of `twincal demo`.
    let twin = folder.path().join("twin");
    let manifest = fs::read_to_string(twin.join("manifest.json")).unwrap();
    let listed = "\"run.csv\": { \"bytes\": 1, \"sha256\": \"\" }, \"arm.urdf\": { \"bytes\": 1, \"sha256\": \"\" },";
    let more = manifest.replacen("\"files\": {", &format!("\"files\": {{ {listed}"), 1);
    assert_ne!(manifest, more);
    let old = folder.path().join("old");
    fs::create_dir(&old).unwrap();
    fs::write(old.join("manifest.json"), more).unwrap();
    for name in ["run.csv", "arm.urdf"] {
        fs::copy(folder.path().join(name), old.join(name)).unwrap();
    }
    let before = content(folder.path());
    for line in [
        "fit old/run.csv --model arm.urdf --config quick.toml -o old --force",
        "fit run.csv --model old/arm.urdf --config quick.toml -o ./twin/../old --force",
        "fit run.csv --model twin/model.urdf --config quick.toml -o twin --force",
        "export --twin twin --to urdf --draws 2 -o twin --force",
        "export --twin ./twin --to urdf --draws 2 -o twin/../twin --force",
    ] {
        let done = run(folder.path(), line.split(' ')).expect(2);
        done.says(&["would be overwritten"]);
        assert!(content(folder.path()) == before, "{line}");
    }
    // The same folder where nothing of it is read.
    fit(folder.path(), &["-o", "old", "--force"]).expect(0);
}

/// A file in the folder of a bag, listed in its metadata or not, and the metadata.
#[test]
fn parts_of_a_bag_stay() {
    let folder = fitted_copy();
    let bag = folder.path().join("bag");
    fs::create_dir(&bag).unwrap();
    run(
        folder.path(),
        [
            "predict",
            "run.csv",
            "--twin",
            "twin",
            "-o",
            "bag/part.mcap",
        ],
    )
    .expect(0);
    let metadata = "rosbag2_bagfile_information:\n  relative_file_paths:\n    - part.mcap\n";
    fs::write(bag.join("metadata.yaml"), metadata).unwrap();
    fs::hard_link(bag.join("part.mcap"), folder.path().join("other.mcap")).unwrap();
    let before = content(folder.path());
    for output in ["bag/part.mcap", "other.mcap", "./twin/../bag/part.mcap"] {
        let line = ["predict", "bag", "--twin", "twin", "-o", output, "--force"];
        run(folder.path(), line)
            .expect(2)
            .says(&["would be overwritten"]);
        assert!(content(folder.path()) == before, "{output}");
    }
    for output in ["bag/metadata.yaml", "bag/part.mcap", "other.mcap"] {
        let line = [
            "init", "bag", "--model", "arm.urdf", "-o", output, "--force",
        ];
        run(folder.path(), line)
            .expect(2)
            .says(&["would be overwritten"]);
        assert!(content(folder.path()) == before, "{output}");
    }
}

/// These read and print; `report` writes its twin anew and changes the report alone.
#[test]
fn commands_without_an_output_change_nothing() {
    let folder = prepared();
    let before = content(folder.path());
    for (line, code) in [
        ("inspect run.csv --model arm.urdf", 0),
        ("inspect main.xml", 0),
        ("doctor run.csv --model arm.urdf --config quick.toml", 0),
        ("diff twin twin", 0),
        ("report --twin twin --force", 0),
    ] {
        run(folder.path(), line.split(' ')).expect(code);
        assert!(content(folder.path()) == before, "{line}");
    }
    let _ = run(folder.path(), ["check", "run.csv", "--twin", "twin"]);
    assert!(content(folder.path()) == before);
    std::os::unix::fs::symlink("twin", folder.path().join("same")).unwrap();
    run(folder.path(), ["report", "--twin", "same", "--force"]).expect(2);
    fs::remove_file(folder.path().join("same")).unwrap();
    assert!(content(folder.path()) == before);
}

/// An output that belongs to nobody is written with --force as before, also the same export twice.
#[test]
fn earlier_outputs_are_replaced() {
    let folder = prepared();
    for _ in 0..2 {
        for line in [
            "init run.csv --model arm.urdf -o new.toml --force",
            "predict run.csv --twin twin -o p.csv --force",
            "export --twin twin --to urdf -o new.urdf --force",
            "export --twin twin --to c -o new.c --force",
            "export --twin twin --to urdf --draws 2 -o models --force",
        ] {
            run(folder.path(), line.split(' ')).expect(0);
        }
    }
}

/// A link that lies where the file is written meanwhile is not followed.
#[test]
fn a_link_beside_the_output_is_not_followed() {
    let folder = fitted_copy();
    let digest = twincal_io::artifact::sha256(b"new.c");
    let staging = format!(".twincal-{}.staging", &digest[..16]);
    std::os::unix::fs::symlink("run.csv", folder.path().join(staging)).unwrap();
    let log = fs::read(folder.path().join("run.csv")).unwrap();
    let line = ["export", "--twin", "twin", "--to", "c", "-o", "new.c"];
    run(folder.path(), line).expect(0);
    assert!(fs::read(folder.path().join("run.csv")).unwrap() == log);
}

/// A link or a pipe in the place of the lock ends the command; it waits for nobody.
#[test]
fn a_lock_that_is_no_file_is_refused() {
    let folder = fitted_copy();
    let digest = twincal_io::artifact::sha256(b"new.c");
    let lock = folder
        .path()
        .join(format!(".twincal-{}.lock", &digest[..16]));
    let line = ["export", "--twin", "twin", "--to", "c", "-o", "new.c"];
    std::os::unix::fs::symlink("run.csv", &lock).unwrap();
    let log = fs::read(folder.path().join("run.csv")).unwrap();
    run(folder.path(), line).expect(2);
    assert!(fs::read(folder.path().join("run.csv")).unwrap() == log);
    fs::remove_file(&lock).unwrap();
    let made = std::process::Command::new("mkfifo").arg(&lock).status();
    assert!(made.unwrap().success());
    run(folder.path(), line).expect(2);
    assert!(!folder.path().join("new.c").exists());
}
