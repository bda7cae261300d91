//! Names of robots, links, joints, files and twins are data in exported code: in every language it compiles, gives the numbers of a
//! harmless name, and does nothing else.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a broken test may panic, one that is left out says so"
)]

use crate::common::{ARM, QUICK, csv, fitted_copy, run};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;
use twincal_io::artifact::sha256;

/// The same arm as MJCF.
const MJCF: &str = r#"<mujoco model="arm"><option gravity="0 0 -9.81"/><worldbody><body name="upper"><joint name="shoulder" axis="0 0 1"/>
  <inertial pos=".2 0 0" mass="2" diaginertia=".01 .03 .03"/><body name="fore" pos=".4 0 0"><joint name="elbow" axis="0 0 1"/>
  <inertial pos=".15 0 0" mass="1" diaginertia=".005 .01 .01"/></body></body></worldbody></mujoco>"#;

/// What ends, continues or hides a comment or a string somewhere.
const OPENERS: [&str; 17] = [
    "*/",
    "*\\/",
    "**/",
    "*??/\n/",
    "\"\"\"",
    "\\\"\"\"",
    "'''\"",
    "\\",
    "\\\n",
    "x\\N{DASH}\\",
    "\n",
    "\r",
    "\u{2028}",
    "\u{85}",
    "\u{b}",
    "\u{1b}[2J\u{7}",
    "\u{202e}\u{2066}\u{feff}\u{200b}",
];
/// What would then make a file `DONE`: as the file is loaded, or before `main`.
const PAYLOADS: [&str; 3] = [
    "__attribute__((constructor)) static void done(void) { extern int creat(const char *, int); creat(\"DONE\", 511); } /*",
    "\nopen('DONE', 'w')\n\"\"\"",
    "\n#[used] #[unsafe(link_section = \".init_array\")] static S: extern \"C\" fn() = { extern \"C\" fn f() { \
     std::fs::write(\"DONE\", \"\").unwrap(); } f };\n//",
];

/// Every opener before every payload.
fn corpus() -> Vec<String> {
    let all = OPENERS.iter().flat_map(|opener| {
        PAYLOADS
            .iter()
            .map(move |payload| format!("{opener}{payload}"))
    });
    all.collect()
}

/// Text as an attribute's value, every sign by its number.
fn attribute(name: &str) -> String {
    name.chars()
        .map(|c| format!("&#{};", u32::from(c)))
        .collect()
}

/// Folders `k` with a twin each, and where they are.
struct Twins {
    folder: TempDir,
    count: usize,
}

impl Twins {
    /// The next folder, with a log and settings.
    fn next(&mut self) -> PathBuf {
        let path = self.folder.path().join(self.count.to_string());
        fs::create_dir(&path).unwrap();
        fs::write(path.join("quick.toml"), QUICK).unwrap();
        self.count += 1;
        path
    }

    /// Fits a model under a file name.
    fn fit(&mut self, model: &str, file: &str) {
        let path = self.next();
        fs::write(path.join(file), model).unwrap();
        let log = format!("{}.csv", file.split('.').next().unwrap());
        fs::write(path.join(&log), csv(400, &|_, row| row)).unwrap();
        let line = [
            "fit",
            "--model",
            file,
            "--config",
            "quick.toml",
            "-o",
            "twin",
            "--",
            &log,
        ];
        run(&path, line).expect(0);
    }

    /// A twin whose texts are hostile, its checksums right.
    fn change(&mut self, from: &Path, names: &[String; 3]) {
        let path = self.next();
        fs::create_dir(path.join("twin")).unwrap();
        for entry in fs::read_dir(from).unwrap() {
            let entry = entry.unwrap().path();
            fs::copy(&entry, path.join("twin").join(entry.file_name().unwrap())).unwrap();
        }
        let twin = path.join("twin/twin.json");
        let mut stored: Value = serde_json::from_slice(&fs::read(&twin).unwrap()).unwrap();
        rename(&mut stored, &names[..2]);
        for key in ["version", "model", "robot"] {
            stored["context"][key] = Value::from(names[2].as_str());
        }
        let text = stored.to_string();
        fs::write(&twin, &text).unwrap();
        let place = path.join("twin/manifest.json");
        let mut manifest: Value = serde_json::from_slice(&fs::read(&place).unwrap()).unwrap();
        manifest["files"]["twin.json"] =
            serde_json::json!({"bytes": text.len(), "sha256": sha256(text.as_bytes())});
        fs::write(&place, manifest.to_string()).unwrap();
    }
}

/// Puts other names in the place of the joints'.
fn rename(value: &mut Value, names: &[String]) {
    match value {
        Value::String(text) => {
            *text = text
                .replace("shoulder", &names[0])
                .replace("elbow", &names[1]);
        }
        Value::Array(all) => all.iter_mut().for_each(|value| rename(value, names)),
        Value::Object(all) => {
            let own = std::mem::take(all);
            for (key, mut value) in own {
                rename(&mut value, names);
                all.insert(
                    key.replace("shoulder", &names[0])
                        .replace("elbow", &names[1]),
                    value,
                );
            }
        }
        _ => {}
    }
}

/// Twins of all names: URDFs first, then MJCFs, then changed twins; the first of either is harmless.
fn twins() -> (Twins, usize) {
    let mut twins = Twins {
        folder: tempfile::tempdir().unwrap(),
        count: 0,
    };
    let corpus = corpus();
    twins.fit(ARM, "arm.urdf");
    for names in corpus.chunks_exact(3) {
        let [robot, shoulder, elbow] = [0, 1, 2].map(|k| attribute(&names[k]));
        let model = ARM.replacen("name=\"arm\"", &format!("name=\"{robot}\""), 1);
        let model = model.replace("\"shoulder\"", &format!("\"{shoulder}\""));
        let model = model.replace("\"elbow\"", &format!("\"{elbow}\""));
        let model = model.replace("\"fore\"", &format!("\"{elbow}{shoulder}\""));
        let file = names[1].replace(['/', '.'], "") + ".urdf";
        twins.fit(&model, &file);
    }
    let harmless = twins.folder.path().join("0/twin");
    for names in corpus.chunks_exact(3) {
        twins.change(&harmless, names.try_into().unwrap());
    }
    let first_mjcf = twins.count;
    twins.fit(MJCF, "arm.xml");
    for names in corpus.chunks_exact(3) {
        let [model, shoulder, elbow] = [2, 0, 1].map(|k| attribute(&names[k]));
        let text = MJCF.replacen("model=\"arm\"", &format!("model=\"{model}\""), 1);
        let text = text.replace("\"shoulder\"", &format!("\"{shoulder}\""));
        let text = text.replace("\"elbow\"", &format!("\"{elbow}\""));
        twins.fit(&text, "arm.xml");
    }
    (twins, first_mjcf)
}

/// Runs a program and gives what it prints.
fn output(command: &mut Command) -> String {
    let done = command.output().unwrap();
    let error = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{command:?}: {error}");
    assert!(!error.contains("error"), "{error}");
    String::from_utf8(done.stdout).unwrap()
}

/// Whether it is there.
fn installed(program: &str) -> bool {
    let there = Command::new(program).arg("--version").output().is_ok();
    if !there {
        println!("skipped: no {program}");
    }
    there
}

const STATE: &str = "{0.3, -0.7}, {0.5, 1.1}, {2.0, -3.0}";

/// Torque and interval of one state by the C of twin `k`, with all warnings that a vehicle's code is compiled with.
fn by_c(folder: &Path, k: usize) -> String {
    let main = format!(
        "#include \"twin{k}.c\"\n#include <stdio.h>\nint main(void) {{\n    const double x[3][2] = {{{STATE}}};\n    double y[3][2];\n    \
         int outside = twincal_evaluate(x[0], x[1], x[2], y[0], y[1], y[2]);\n    for (int i = 0; i < 6; i++) printf(\"%.15e \", \
         y[i / 2][i % 2]);\n    printf(\"%d\\n\", outside);\n    return 0;\n}}\n"
    );
    fs::write(folder.join("main.c"), main).unwrap();
    let mut cc = Command::new("cc");
    let flags = [
        "-std=c99",
        "-trigraphs",
        "-Wall",
        "-Wextra",
        "-Werror",
        "main.c",
        "-o",
        "main",
        "-lm",
    ];
    output(cc.args(flags).current_dir(folder));
    output(Command::new("./main").current_dir(folder))
}

/// A Python and whether it has NumPy: that of the checkout, where there is one.
fn python() -> Option<(PathBuf, bool)> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../.venv/bin/python");
    let mut there = [own, "python3".into()].into_iter().filter_map(|python| {
        let done = Command::new(&python).args(["-c", "import numpy"]).output();
        Some((python, done.ok()?.status.success()))
    });
    there.next()
}

/// The same by the Python of all twins; without NumPy they are imported alone.
fn by_python(folder: &Path, count: usize, (python, numpy): (PathBuf, bool)) -> Option<String> {
    if !numpy {
        println!("no NumPy: the Python is imported and not evaluated");
        fs::write(folder.join("numpy.py"), "").unwrap();
        let text = format!(
            "import importlib\nfor k in range({count}):\n    importlib.import_module(f'twin{{k}}')\n"
        );
        output(Command::new(python).args(["-c", &text]).current_dir(folder));
        return None;
    }
    let text = format!(
        "import importlib\nfor k in range({count}):\n    twin = importlib.import_module(f'twin{{k}}')\n    tau, low, high, outside = \
         twin.evaluate([0.3, -0.7], [0.5, 1.1], [2.0, -3.0])\n    print(*(f'{{x:.15e}}' for y in (tau, low, high) for x in y), \
         int(outside), len(twin.JOINTS))\n"
    );
    fs::write(folder.join("main.py"), text).unwrap();
    Some(output(
        Command::new(python).arg("main.py").current_dir(folder),
    ))
}

/// The same by the Rust of all twins.
fn by_rust(folder: &Path, count: usize) -> String {
    let mut text = String::from("#![allow(unused_attributes)]\n");
    for k in 0..count {
        text += &format!("#[path = \"twin{k}.rs\"]\nmod twin{k};\n");
    }
    text += "fn main() {\n    let x = [[0.3, -0.7], [0.5, 1.1], [2.0, -3.0]];\n    let mut y = [[0.0; 2]; 3];\n";
    for k in 0..count {
        text += &format!(
            "    let [a, b, c] = &mut y;\n    let outside = twin{k}::evaluate(&x[0], &x[1], &x[2], a, b, c);\n    for v in \
             y.as_flattened() {{ print!(\"{{v:.15e}} \"); }}\n    println!(\"{{}}\", u8::from(outside));\n"
        );
    }
    fs::write(folder.join("main.rs"), text + "}\n").unwrap();
    output(
        Command::new("rustc")
            .args(["--edition", "2021", "main.rs"])
            .current_dir(folder),
    );
    output(Command::new("./main").current_dir(folder))
}

/// The steps of the JSON of twin `k` and its joints' names.
fn by_json(folder: &Path, k: usize) -> (Value, Vec<String>) {
    let text = fs::read_to_string(folder.join(format!("twin{k}.json"))).unwrap();
    assert!(
        text.trim_end()
            .bytes()
            .all(|byte| (b' '..=b'~').contains(&byte))
    );
    let all: Value = serde_json::from_str(&text).unwrap();
    let joints = all["joints"].as_array().unwrap().iter();
    let names = joints.map(|joint| joint["name"].as_str().unwrap().to_owned());
    (all["steps"].clone(), names.collect())
}

/// The numbers of a printed line.
fn numbers(line: &str) -> Vec<f64> {
    line.split_whitespace()
        .map(|word| word.parse().unwrap())
        .collect()
}

#[track_caller]
fn same(lines: &[String], first_mjcf: usize) {
    for (k, line) in lines.iter().enumerate() {
        let harmless = if k < first_mjcf { 0 } else { first_mjcf };
        for (x, y) in numbers(line).iter().zip(numbers(&lines[harmless])) {
            assert!(
                (x - y).abs() <= 1e-12 * y.abs(),
                "{k}: {line}\n{}",
                lines[harmless]
            );
        }
    }
}

#[test]
fn names_are_data_in_every_language() {
    let (twins, first_mjcf) = twins();
    let (folder, count) = (twins.folder.path(), twins.count);
    for k in 0..count {
        for (language, ending) in [
            ("c", "c"),
            ("python", "py"),
            ("rust", "rs"),
            ("json", "json"),
        ] {
            let (twin, output) = (format!("{k}/twin"), format!("twin{k}.{ending}"));
            run(
                folder,
                ["export", "--twin", &twin, "--to", language, "-o", &output],
            )
            .expect(0);
        }
    }
    let (steps, names) = by_json(folder, 0);
    assert_eq!(names, ["shoulder", "elbow"]);
    let corpus = corpus();
    for k in 1..first_mjcf {
        let (own, names) = by_json(folder, k);
        assert_eq!(own, steps);
        let at = 3 * ((k - 1) % (corpus.len() / 3));
        let expected = if k <= corpus.len() / 3 {
            &corpus[at + 1..at + 3]
        } else {
            &corpus[at..at + 2]
        };
        assert_eq!(names, expected, "{k}");
    }
    if installed("cc") {
        let lines: Vec<String> = (0..count).map(|k| by_c(folder, k)).collect();
        same(&lines, first_mjcf);
    }
    let lines = |text: String| text.lines().map(str::to_owned).collect::<Vec<_>>();
    if let Some(text) = python().and_then(|python| by_python(folder, count, python)) {
        let lines = lines(text);
        assert_eq!(lines.len(), count);
        same(&lines, first_mjcf);
    }
    if installed("rustc") {
        let lines = lines(by_rust(folder, count));
        assert_eq!(lines.len(), count);
        same(&lines, first_mjcf);
    }
    assert!(!folder.join("DONE").exists());
}

/// A NUL byte stands in no XML, by whatever spelling.
#[test]
fn a_nul_in_a_name_is_refused() {
    let folder = fitted_copy();
    for name in ["shoul\0der", "shoul&#0;der"] {
        let model = ARM.replace("\"shoulder\"", &format!("\"{name}\""));
        fs::write(folder.path().join("nul.urdf"), model).unwrap();
        run(folder.path(), ["inspect", "nul.urdf"]).expect(2);
    }
}
