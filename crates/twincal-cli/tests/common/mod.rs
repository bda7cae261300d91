//! What all tests of the program share: a small robot, small logs, and the program run as a user runs it.
#![allow(
    dead_code,
    clippy::unwrap_used,
    reason = "every test file uses its part; a broken test may panic"
)]

pub(crate) mod faulty;

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use tempfile::TempDir;

/// What a run of the program left.
pub(crate) struct Run {
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl Run {
    /// Checks the exit code.
    #[track_caller]
    pub(crate) fn expect(self, code: i32) -> Self {
        assert_eq!(
            self.code,
            Some(code),
            "stdout:\n{}\nstderr:\n{}",
            self.out,
            self.err
        );
        self
    }

    /// Checks that standard error says each of these.
    #[track_caller]
    pub(crate) fn says(self, words: &[&str]) -> Self {
        for word in words {
            assert!(
                self.err.contains(word),
                "{word:?} is missing in:\n{}",
                self.err
            );
        }
        self
    }
}

/// The program, in `folder`, with a clean environment.
pub(crate) fn command(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_twincal"));
    command.current_dir(folder).env_clear().stdin(Stdio::null());
    command
}

/// Runs the program in `folder`.
pub(crate) fn run(folder: &Path, arguments: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Run {
    finish(command(folder).args(arguments))
}

/// Runs a shell line in which `$TWINCAL` is the program.
pub(crate) fn shell(folder: &Path, line: &str) -> Run {
    let mut command = Command::new("/bin/bash");
    command
        .arg("-c")
        .arg(line)
        .current_dir(folder)
        .env("TWINCAL", env!("CARGO_BIN_EXE_twincal"));
    finish(command.stdin(Stdio::null()))
}

/// Runs a command to its end.
pub(crate) fn finish(command: &mut Command) -> Run {
    let output = command.output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
    Run {
        code: output.status.code(),
        out: text(output.stdout),
        err: text(output.stderr),
    }
}

/// A folder with `arm.urdf`, `run.csv`, `quick.toml`.
pub(crate) fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fill(folder.path());
    folder
}

fn fill(folder: &Path) {
    std::fs::write(folder.join("arm.urdf"), ARM).unwrap();
    std::fs::write(folder.join("run.csv"), csv(400, &|_, row| row)).unwrap();
    std::fs::write(folder.join("quick.toml"), QUICK).unwrap();
}

/// Writes `later.csv`: the robot of `run.csv` some time later, which no twin of these tests was fitted to.
pub(crate) fn write_later(folder: &Path) {
    let both = csv(1000, &|_, row| row);
    let rows = both.lines().enumerate();
    let later = rows.filter(|(number, _)| *number == 0 || *number > 500);
    let later: String = later.map(|(_, line)| format!("{line}\n")).collect();
    std::fs::write(folder.join("later.csv"), later).unwrap();
}

/// `twincal fit run.csv …` with the quick settings.
pub(crate) fn fit(folder: &Path, more: &[&str]) -> Run {
    let base = [
        "fit",
        "run.csv",
        "--model",
        "arm.urdf",
        "--config",
        "quick.toml",
    ];
    run(folder, base.iter().chain(more))
}

/// A folder with a fitted twin in `twin`; made once, so tests must not change it.
pub(crate) fn fitted() -> &'static Path {
    static FITTED: OnceLock<TempDir> = OnceLock::new();
    FITTED
        .get_or_init(|| {
            let folder = folder();
            fit(folder.path(), &["-o", "twin"]).expect(0);
            folder
        })
        .path()
}

/// A folder of one's own with a fitted twin in `twin`.
pub(crate) fn fitted_copy() -> TempDir {
    let folder = folder();
    std::fs::create_dir(folder.path().join("twin")).unwrap();
    for entry in std::fs::read_dir(fitted().join("twin")).unwrap() {
        let from = entry.unwrap().path();
        std::fs::copy(
            &from,
            folder.path().join("twin").join(from.file_name().unwrap()),
        )
        .unwrap();
    }
    folder
}

/// Every file below a folder, relative, sorted.
pub(crate) fn files(folder: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                all.push(path.strip_prefix(folder).unwrap().to_owned());
            }
        }
    }
    all.sort();
    all
}

/// Exact rows, three candidates: a fit in a moment.
pub(crate) const QUICK: &str = "[signal]\ncutoff_hz = 0\n[library]\nterms = [\"sin(q2)\"]\ngeneric = false\n\
                         friction = [\"viscous\"]\noffset = false\nmotor_inertia = false\n";

/// Two links in a plane, gravity across it: nominal torque is inertia only.
pub(crate) const ARM: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="fore"><inertial><origin xyz="0.15 0 0"/><mass value="1"/>
    <inertia ixx="0.005" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="100" velocity="10"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="100" velocity="10"/></joint>
</robot>
"#;

/// One row: t, then q, qd, qdd, tau of either joint.
pub(crate) type Row = Vec<String>;

/// A log at 50 Hz, each row changed by `change(number, row)`. Torque is that of [`ARM`] in closed form, viscous friction
/// of 0.4 and 0.2 N·m·s/rad, a potential 0.9 sin(q2), and noise of sd 0.02 N·m.
pub(crate) fn csv(rows: usize, change: &dyn Fn(usize, Row) -> Row) -> String {
    let mut text = "t,q1,q2,qd1,qd2,qdd1,qdd2,tau1,tau2\n".to_owned();
    let mut state = 1_u64;
    let mut uniform = || {
        // Knuth's linear congruential generator.
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    // Twelve uniforms less six: almost normal, sd 1.
    let mut noise = || 0.02 * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0);
    for number in 0..rows {
        let t = number as f64 / 50.0;
        let wave = |amplitude: f64, w: f64| {
            let (s, c) = (w * t).sin_cos();
            [amplitude * s, amplitude * w * c, -amplitude * w * w * s]
        };
        let ([q1, v1, a1], [q2, v2, a2]) = (wave(0.8, 1.3), wave(0.6, 2.1));
        // M = [m1 c1² + I1 + m2 (l² + c2² + 2 l c2 cos q2) + I2, …], h = m2 l c2 sin q2
        let (far, near, cross) = (0.11 + 0.16 + 0.0325, 0.0325, 0.06);
        let (s, c) = q2.sin_cos();
        let tau1 = (far + 2.0 * cross * c) * a1 + (near + cross * c) * a2
            - cross * s * v2 * (2.0 * v1 + v2);
        let tau2 = (near + cross * c) * a1 + near * a2 + cross * s * v1 * v1;
        let (tau1, tau2) = (
            tau1 + 0.4 * v1 + noise(),
            tau2 + 0.2 * v2 - 0.9 * c + noise(),
        );
        let row = [t, q1, q2, v1, v2, a1, a2, tau1, tau2]
            .iter()
            .map(f64::to_string)
            .collect();
        let _ = writeln!(text, "{}", change(number, row).join(","));
    }
    text
}
