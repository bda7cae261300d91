//! One target per reader: where its corpus is, and what is done with an input.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use twincal::robot::{Robot, Workspace, inverse_dynamics};
use twincal::term::{Library, LibrarySettings};
use twincal_io::config::{ChannelNames, Config};
use twincal_io::log::{LogOptions, read_csv, read_log};
use twincal_io::model::{ModelSettings, parse_model};
use twincal_io::twin_json::StoredTwin;

/// A reader under test.
pub(crate) struct Target {
    pub(crate) name: &'static str,
    /// Words that its format knows.
    pub(crate) words: &'static [&'static str],
    /// Good files.
    pub(crate) corpus: fn() -> Vec<Vec<u8>>,
    /// Reads the bytes, which also lie in the file; the answer in words.
    pub(crate) run: fn(&[u8], &Path) -> String,
}

const CSV: &[&str] = &[
    "t,q1,q2,qd1,qd2,tau1,tau2\n",
    ",",
    ";",
    "\t",
    "#",
    "NaN",
    "e",
    ".",
];
const XML: &[&str] = &[
    "<link name=\"a\">",
    "<joint name=\"b\" type=\"revolute\">",
    "</joint>",
    "<!--",
    "-->",
    "<![CDATA[",
    "&#0;",
    "&lt;",
    "<mimic joint=\"b\"/>",
    "type=\"prismatic\"",
    "type=\"fixed\"",
    "xyz=\"0 0 0\"",
    "rpy=\"1 2 3\"",
    "<body>",
    "<default class=\"x\">",
    "class=\"x\"",
    "<geom type=\"mesh\"",
    "fullinertia=\"1 1 1 0 0 0\"",
    "<compiler angle=\"radian\"/>",
    "<include file=\"x\"/>",
    "/>",
    "<",
    ">",
];
const TOML: &[&str] = &[
    "[model]\n",
    "[log]\n",
    "[[log]]\n",
    "[library]\n",
    "[prior]\n",
    "[noise]\n",
    "[inference]\n",
    "= \"auto\"\n",
    "= []\n",
    "= {}\n",
    "= 1e400\n",
    "terms = [",
    "]",
    "locked = { a = 1 }\n",
    "payload = ",
    "families = ",
    "lag = ",
    "\"\"\"",
];
const MATHS: &[&str] = &[
    "q1", "q2", "qd1", "qd2", "q99", "qdd1", "sin(", "cos(", "tan(", "exp(", "log(", "sqrt(",
    "sinh(", "cosh(", "tanh(", "atan(", "pi", "(", ")", "+", "-", "*", "/", "^", "^2", "^-1",
    "^0.5", "((((((((", "--------", "1e308",
];
const YAML: &[&str] = &[
    "rosbag2_bagfile_information:",
    "relative_file_paths:",
    "- ",
    ": ",
    "&a",
    "*a",
    "!!python",
    "{",
    "[",
    "compression_mode: FILE",
    "../../x.mcap",
    "  ",
];
const JSON: &[&str] = &[
    "{", "}", "[", "]", "\"", "null", "true", ":", ",", "1e308", "-0.0", "[]", "{}",
];

/// Every reader.
pub(crate) const TARGETS: &[Target] = &[
    Target {
        name: "urdf",
        words: XML,
        corpus: || texts("urdf"),
        run: |bytes, _| model("fuzz.urdf", bytes),
    },
    Target {
        name: "mjcf",
        words: XML,
        corpus: || texts("mjcf"),
        run: |bytes, _| model("fuzz.xml", bytes),
    },
    Target {
        name: "csv",
        words: CSV,
        corpus: || texts("csv"),
        run: |bytes, _| csv(bytes),
    },
    Target {
        name: "mcap",
        words: &[],
        corpus: || [fixtures(&["bags"], "mcap"), texts("mcap")].concat(),
        run: |_, file| log(file),
    },
    Target {
        name: "mapped",
        words: &[
            "float64",
            "float64[] q\n",
            "uint8[<=3]",
            "[2]",
            "[]",
            "string",
            "MSG: my_msgs/Joint\n",
            "===\n",
            "my_msgs/Joint",
            "ros2msg",
            "cdr",
            "\u{ff}\u{ff}",
        ],
        corpus: mapped,
        run: |_, file| answer(read_log(file, &arm(), &mapping())),
    },
    Target {
        name: "npz",
        words: &[
            "descr",
            "<f8",
            ">f8",
            "|O",
            "fortran_order",
            "True",
            "(2,",
            "shape",
        ],
        corpus: || fixtures(&["npz"], "npz"),
        run: |_, file| log(file),
    },
    Target {
        name: "parquet",
        words: &[],
        corpus: parquet,
        run: |_, file| log(file),
    },
    Target {
        name: "arrow",
        words: &[],
        corpus: || {
            [
                fixtures(&["arrow"], "arrow"),
                fixtures(&["arrow"], "arrows"),
                fixtures(&["arrow"], "feather"),
            ]
            .concat()
        },
        run: |_, file| log(file),
    },
    Target {
        name: "rosbag2",
        words: YAML,
        corpus: || texts("rosbag2"),
        run: |bytes, file| folder(bytes, file),
    },
    Target {
        name: "sqlite",
        words: &["sensor_msgs/msg/JointState", "cdr", "topics", "messages"],
        corpus: sqlite,
        run: |_, file| log(file),
    },
    Target {
        name: "config",
        words: TOML,
        corpus: || texts("config"),
        run: |bytes, _| config(bytes),
    },
    Target {
        name: "expression",
        words: MATHS,
        corpus: || texts("expression"),
        run: |bytes, _| expression(bytes),
    },
    Target {
        name: "twin_json",
        words: JSON,
        corpus: || texts("twin_json"),
        run: |bytes, _| twin(bytes),
    },
];

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// Files of a folder, in the order of their names.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .collect();
    files.sort();
    files
}

/// `fuzz/corpus/NAME`.
fn texts(name: &str) -> Vec<Vec<u8>> {
    let paths = files(&here("corpus").join(name));
    paths.iter().flat_map(std::fs::read).collect()
}

/// What the tests read, by ending.
fn fixtures(folders: &[&str], ending: &str) -> Vec<Vec<u8>> {
    let root = here("../crates/twincal-io/tests/fixtures");
    let paths = folders.iter().flat_map(|folder| files(&root.join(folder)));
    let paths = paths.filter(|path| path.extension().is_some_and(|e| e == ending));
    paths.flat_map(std::fs::read).collect()
}

fn sqlite() -> Vec<Vec<u8>> {
    let packed = fixtures(&["bags/bag_db3_zstd"], "zstd");
    packed
        .iter()
        .flat_map(|bytes| zstd::stream::decode_all(&bytes[..]))
        .collect()
}

/// Bags of mapped topics, their checksums set to "none" so that damage reaches definitions and messages.
fn mapped() -> Vec<Vec<u8>> {
    let root = here("../crates/twincal-io/tests/fixtures/bags");
    let paths = files(&root).into_iter().filter(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("mapped") && name.ends_with(".mcap")
    });
    let mut bags: Vec<Vec<u8>> = paths.flat_map(std::fs::read).collect();
    for bytes in &mut bags {
        let mut at = 8;
        while let Some(&[opcode, a, b, c, d, e, f, g, h]) = bytes.get(at..at + 9) {
            let length = u64::from_le_bytes([a, b, c, d, e, f, g, h]);
            // A chunk's checksum stands behind two times and its size.
            if opcode == 0x06
                && let Some(checksum) = bytes.get_mut(at + 33..at + 37)
            {
                checksum.fill(0);
            }
            at = at.saturating_add(9).saturating_add(length as usize);
        }
    }
    bags.extend(std::fs::read(root.join("mapped_db3/mapped_db3.db3")));
    bags
}

/// Paths into those bags by order, by name and in lists of records.
fn mapping() -> LogOptions {
    let mut options = LogOptions::default();
    options.columns.q = ChannelNames::All("/arm/state:q[*]".into());
    options.columns.qd = ChannelNames::All("/arm/state:qd[*]".into());
    options.columns.tau = ChannelNames::All("/arm/state:joints[*].effort".into());
    options
}

/// Four columns of sixty rows, as twincal writes them.
fn parquet() -> Vec<Vec<u8>> {
    use twincal_io::table::{ColumnKind, TableFormat, TableWriter, Values};
    let columns = ["t", "q1", "q2", "tau1"].map(|name| (name.to_owned(), ColumnKind::Number));
    let values: Vec<f64> = (0..60).map(|i| f64::from(i) * 0.01).collect();
    let blocks = [
        Values::Numbers(&values),
        Values::Numbers(&values),
        Values::Numbers(&values),
        Values::Numbers(&values),
    ];
    let written =
        TableWriter::new(Vec::new(), TableFormat::Parquet, &columns).and_then(|mut table| {
            table.push(&blocks)?;
            table.finish()
        });
    written.into_iter().collect()
}

const ARM: &str = include_str!("../corpus/urdf/arm.urdf");

/// Two joints, `shoulder` and `elbow`.
fn arm() -> Robot {
    let model = parse_model("arm.urdf", ARM.as_bytes(), &ModelSettings::default());
    let robot = model.and_then(|model| model.robot(&BTreeMap::new()));
    match robot {
        Ok((robot, _)) => robot,
        Err(error) => panic!("fuzz/corpus/urdf/arm.urdf: {error}"),
    }
}

fn model(name: &str, bytes: &[u8]) -> String {
    let read = parse_model(name, bytes, &ModelSettings::default());
    match read.and_then(|model| model.robot(&BTreeMap::new())) {
        Ok((robot, findings)) => {
            let n = robot.dof();
            let mut tau = vec![0.0; n];
            let mut workspace = Workspace::new(&robot);
            inverse_dynamics(
                &robot,
                &mut workspace,
                &vec![0.1; n],
                &vec![0.2; n],
                &vec![0.3; n],
                &mut tau,
            );
            findings
                .iter()
                .map(|f| f.code.as_str())
                .collect::<Vec<_>>()
                .join(" ")
        }
        Err(error) => error.to_string(),
    }
}

fn answer(read: twincal_io::Result<(twincal::signal::Recording, Vec<twincal::Finding>)>) -> String {
    match read {
        Ok((_, findings)) => findings
            .iter()
            .map(|f| f.code.as_str())
            .collect::<Vec<_>>()
            .join(" "),
        Err(error) => error.to_string(),
    }
}

fn csv(bytes: &[u8]) -> String {
    let strict = read_csv(
        bytes,
        bytes.len() as u64,
        "fuzz",
        &arm(),
        &LogOptions::default(),
    );
    let options = LogOptions {
        lenient: true,
        ..LogOptions::default()
    };
    let lenient = read_csv(bytes, bytes.len() as u64, "fuzz", &arm(), &options);
    answer(strict) + &answer(lenient)
}

fn log(file: &Path) -> String {
    let options = LogOptions {
        lenient: true,
        ..LogOptions::default()
    };
    answer(read_log(file, &arm(), &LogOptions::default()))
        + &answer(read_log(file, &arm(), &options))
}

/// A bag's folder whose `metadata.yaml` is the input.
fn folder(bytes: &[u8], file: &Path) -> String {
    let folder = file.with_extension("folder");
    let bag = here("../crates/twincal-io/tests/fixtures/bags/bag_mcap/bag_mcap.mcap");
    let ready = std::fs::create_dir_all(&folder)
        .and_then(|()| std::fs::copy(bag, folder.join("bag_mcap.mcap")))
        .and_then(|_| std::fs::write(folder.join("metadata.yaml"), bytes));
    let answered = match ready {
        Ok(()) => answer(read_log(&folder, &arm(), &LogOptions::default())),
        Err(error) => error.to_string(),
    };
    let _ = std::fs::remove_dir_all(&folder);
    answered
}

fn config(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    match Config::parse("fuzz.toml", &text).and_then(|config| config.settings()) {
        Ok(_) => "accepted".into(),
        Err(error) => error.to_string(),
    }
}

fn expression(bytes: &[u8]) -> String {
    let settings = LibrarySettings {
        terms: vec![String::from_utf8_lossy(bytes).into_owned()],
        generic: Some(false),
        ..LibrarySettings::default()
    };
    match Library::propose(&arm(), &settings) {
        Ok((library, findings)) => format!("{} {}", library.columns().len(), findings.len()),
        Err(error) => error.to_string(),
    }
}

/// What stands behind the checksum of an artefact.
fn twin(bytes: &[u8]) -> String {
    match serde_json::from_slice::<StoredTwin>(bytes) {
        Ok(twin) => twin
            .result_json()
            .map_or_else(|e| e.to_string(), |_| "read".into()),
        Err(error) => error.to_string(),
    }
}
