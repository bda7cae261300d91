//! Files of statistics: everything comes back, and nothing damaged is taken.

use super::*;
use arrow_array::cast::AsArray as _;
use arrow_array::{ArrayRef, RecordBatch, StringArray};
use arrow_ipc::reader::FileReader;
use arrow_ipc::writer::FileWriter;
use proptest::prelude::*;
use std::collections::HashMap;
use std::fs;
use std::sync::{Arc, LazyLock};
use twincal::calibrate::{CalibrationSettings, plan};
use twincal::random::Random;
use twincal::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Robot, RobotDescription,
};
use twincal::signal::{Log, Recording};
use twincal::term::Family;

/// A pendulum with friction, and statistics of a log of it.
fn pendulum() -> StatisticsFile {
    of_log("log", 1)
}

/// The same of a log of this name with other noise.
fn of_log(name: &str, seed: u64) -> StatisticsFile {
    let link = |name: &str, mass: f64| LinkDescription {
        name: name.into(),
        inertia: (mass > 0.0).then_some(Inertia {
            mass,
            com: [0.5, 0.0, 0.0],
            tensor: [[0.0; 3]; 3],
        }),
    };
    let description = RobotDescription {
        name: "pendulum".into(),
        gravity: [0.0, -9.81, 0.0],
        links: vec![link("base", 0.0), link("bob", 2.0)],
        joints: vec![JointDescription::new(
            "pivot",
            JointKind::Revolute,
            "base",
            "bob",
        )],
        allow_unphysical: false,
    };
    let robot = Robot::new(description, &Default::default()).unwrap().0;
    let mut noise = Random::new(seed, 0);
    let time: Vec<f64> = (0..2000).map(|i| 0.01 * f64::from(i)).collect();
    let q = |t: &f64| (1.3 * t + 0.04 * t * t).sin();
    let mut torque = |t: &f64| {
        let rate = 1.3 + 0.08 * t;
        let (sin, cos) = (1.3 * t + 0.04 * t * t).sin_cos();
        let (qd, qdd) = (rate * cos, 0.08 * cos - rate * rate * sin);
        0.5 * qdd + 9.81 * q(t).cos() + 0.4 * qd + 0.05 * noise.normal()
    };
    let tau: Vec<f64> = time.iter().map(&mut torque).collect();
    let log = Recording::new(name, time.clone());
    let positions: Vec<f64> = time.iter().map(q).collect();
    let log = log.joint(positions, tau).unwrap();
    let mut settings = CalibrationSettings::default();
    settings.library.families = vec![Family::Viscous, Family::Coulomb];
    let made = plan(&robot, std::slice::from_ref(&log), &settings, &|_| {});
    let plan = made.unwrap().0;
    StatisticsFile {
        statistics: Statistics::of(("one", &robot), &plan, &Log::from(&log), "").unwrap(),
        model: ModelFile {
            name: "pendulum.urdf".into(),
            stored_as: "model.urdf".into(),
            robot: "pendulum".into(),
            text: "<robot name=\"pendulum\"/>".into(),
            findings: Vec::new(),
        },
    }
}

fn bytes(file: &StatisticsFile) -> Vec<u8> {
    let mut bytes = Vec::new();
    file.write_to(&mut bytes).unwrap().unwrap();
    bytes
}

#[test]
fn a_file_gives_back_what_it_holds_and_is_the_same_bytes_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.arrow");
    let file = pendulum();
    fs::write(&path, bytes(&file)).unwrap();
    let back = StatisticsFile::read(&path).unwrap();
    assert_eq!(back, file);
    assert_eq!(bytes(&back), bytes(&file));
}

/// Every byte that is changed, and every end that is cut off, is an error or changes nothing that is read: padding alone may differ.
#[test]
fn damaged_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.arrow");
    let file = pendulum();
    let good = bytes(&file);
    let mut random = Random::new(2, 0);
    let mut refused = 0;
    for _ in 0..600 {
        let mut bad = good.clone();
        let at = (random.uniform() * bad.len() as f64) as usize;
        bad[at] ^= 1 << (random.uniform() * 8.0) as u32;
        fs::write(&path, bad).unwrap();
        let files = StatisticsFiles::open(std::slice::from_ref(&path), &mut |_| {});
        let mut merged = Vec::new();
        if files.and_then(|files| files.write_to(&mut merged)).is_ok() {
            assert!(merged == good, "byte {at}");
        }
        match StatisticsFile::read(&path) {
            Ok(back) => assert_eq!(back, file, "byte {at}"),
            Err(_) => refused += 1,
        }
    }
    // The schema stands twice in such a file, and its first copy is not read.
    assert!(refused > 300, "{refused}");
    for share in [0.0, 0.01, 0.3, 0.7, 0.99, 0.9999] {
        fs::write(&path, &good[..(share * good.len() as f64) as usize]).unwrap();
        let error = StatisticsFile::read(&path).unwrap_err().to_string();
        assert!(error.contains("log.arrow"), "{error}");
    }
}

#[test]
fn merged_files_are_what_merged_statistics_are() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let files = [("b", 2), ("a", 1), ("c", 3)].map(|(name, seed)| of_log(name, seed));
    let mut whole = files[0].clone();
    for (file, name) in files.iter().zip(["b", "a", "c"]) {
        fs::write(at(name), bytes(file)).unwrap();
        if name != "b" {
            whole.statistics.try_merge(&file.statistics).unwrap();
        }
    }
    let merged = |names: &[&str]| {
        let paths: Vec<_> = names.iter().map(|name| at(name)).collect();
        let mut seen = 0;
        let files = StatisticsFiles::open(&paths, &mut |_| seen += 1)?;
        assert_eq!(seen, names.len());
        let mut bytes = Vec::new();
        files.write_to(&mut bytes)?.unwrap();
        Ok::<_, Error>(bytes)
    };
    assert_eq!(merged(&["c", "a", "b"]).unwrap(), bytes(&whole));
    fs::write(at("ac"), merged(&["c", "a"]).unwrap()).unwrap();
    assert_eq!(merged(&["b", "ac"]).unwrap(), bytes(&whole));
    assert_eq!(
        StatisticsFile::read(&at("ac"))
            .unwrap()
            .statistics
            .log_names()
            .count(),
        2
    );
    let says = |names: &[&str], words: &str| {
        let error = merged(names).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    says(&["ac", "b", "c"], "log `c` is there twice");
    fs::write(at("again"), bytes(&of_log("other", 2))).unwrap();
    says(&["b", "again"], "log `other` is log `b` under another name");
    says(&[], "no log in these files");
    // Between two looks.
    let files = StatisticsFiles::open(&[at("a"), at("b")], &mut |_| {}).unwrap();
    fs::write(at("b"), bytes(&of_log("b", 7))).unwrap();
    let error = files.write_to(Vec::new()).unwrap_err().to_string();
    assert!(error.contains("/b: is damaged"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 100,
        rng_seed: proptest::test_runner::RngSeed::Fixed(1),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    /// Whichever two of seven sets are added next, as values or as files: the same bytes.
    #[test]
    fn any_tree_of_merges_has_the_same_bytes(
        pairs in proptest::collection::vec(any::<[prop::sample::Index; 2]>(), 6),
        by_file in any::<[bool; 6]>(),
    ) {
        static LOGS: LazyLock<(Vec<StatisticsFile>, Vec<u8>)> = LazyLock::new(|| {
            let logs: Vec<_> = (0..7).map(|log| of_log(&format!("log{log}"), log)).collect();
            let mut whole = logs[0].clone();
            for log in &logs[1..] {
                whole.statistics.try_merge(&log.statistics).unwrap();
            }
            (logs, bytes(&whole))
        });
        let folder = tempfile::tempdir().unwrap();
        let (mut left, whole) = (LOGS.0.clone(), &LOGS.1);
        for ([one, other], by_file) in pairs.iter().zip(by_file) {
            let mut one = left.swap_remove(one.index(left.len()));
            let other = left.swap_remove(other.index(left.len()));
            if by_file {
                let paths = ["one", "other"].map(|name| folder.path().join(name));
                fs::write(&paths[0], bytes(&one)).unwrap();
                fs::write(&paths[1], bytes(&other)).unwrap();
                one = StatisticsFiles::open(&paths, &mut |_| {}).unwrap().read().unwrap();
            } else {
                one.statistics.try_merge(&other.statistics).unwrap();
            }
            left.push(one);
        }
        prop_assert!(bytes(&left[0]) == *whole, "{pairs:?} {by_file:?}");
    }
}

/// Names interleave, so that every row is in another file than the one before; more files than are open at a time.
#[test]
fn more_files_than_are_open_at_a_time_are_merged() {
    let folder = tempfile::tempdir().unwrap();
    let count = 70;
    let mut paths = Vec::new();
    for file in 0..count {
        let [early, late] =
            [0, count].map(|more| of_log(&format!("log{:03}", file + more), file + more));
        let mut both = early;
        both.statistics.try_merge(&late.statistics).unwrap();
        paths.push(folder.path().join(format!("{file}.arrow")));
        fs::write(&paths[file as usize], bytes(&both)).unwrap();
    }
    let files = StatisticsFiles::open(&paths, &mut |_| {}).unwrap();
    let names: Vec<String> = files.log_names().map(str::to_owned).collect();
    assert_eq!(names.len() as u64, 2 * count);
    let mut merged = Vec::new();
    files.write_to(&mut merged).unwrap().unwrap();
    let path = folder.path().join("all.arrow");
    fs::write(&path, merged).unwrap();
    let back = StatisticsFile::read(&path).unwrap();
    assert!(
        back.statistics
            .log_names()
            .eq(names.iter().map(String::as_str))
    );
}

/// The model of the first log by name, whatever the order of the files.
#[test]
fn the_model_is_that_of_the_first_log() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for (seed, name) in [(1, "a"), (2, "b"), (3, "c")] {
        let mut file = of_log(name, seed);
        file.model.text = format!("<!-- {name} -->");
        fs::write(at(name), bytes(&file)).unwrap();
    }
    for names in [["a", "b", "c"], ["c", "a", "b"], ["b", "c", "a"]] {
        let files = StatisticsFiles::open(&names.map(at), &mut |_| {}).unwrap();
        assert_eq!(files.read().unwrap().model.text, "<!-- a -->");
    }
}

/// What a file of one log says of itself and holds.
struct Crafted {
    metadata: Metadata,
    batches: Vec<RecordBatch>,
}

impl Crafted {
    /// A good one.
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("good.arrow");
        fs::write(&path, bytes(&pendulum())).unwrap();
        let (metadata, _) = reader::look(&path).unwrap();
        let file = FileReader::try_new(fs::File::open(&path).unwrap(), None).unwrap();
        Self {
            metadata,
            batches: file.map(|batch| batch.unwrap()).collect(),
        }
    }

    /// Written with the right checksum of its metadata.
    fn written(mut self, path: &Path) {
        self.metadata.checksum = self.metadata.own_checksum().unwrap();
        let metadata = HashMap::from([(KEY.to_owned(), json(&self.metadata).unwrap())]);
        let schema = self.batches[0]
            .schema()
            .as_ref()
            .clone()
            .with_metadata(metadata);
        let to = fs::File::create(path).unwrap();
        let mut writer = FileWriter::try_new(to, &schema).unwrap();
        let schema = Arc::new(schema);
        for batch in self.batches {
            let columns = batch.columns().to_vec();
            let batch = RecordBatch::try_new(Arc::clone(&schema), columns).unwrap();
            writer.write(&batch).unwrap();
        }
        writer.finish().unwrap();
    }

    /// A good one with a change.
    fn with(change: impl FnOnce(&mut Self)) -> Self {
        let mut crafted = Self::new();
        change(&mut crafted);
        crafted
    }

    /// Another text of the only row, with its checksum.
    fn with_text(mut self, text: &str) -> Self {
        self.metadata.logs[0].text = sha256(text.as_bytes());
        let columns: Vec<ArrayRef> = vec![
            Arc::new(StringArray::from(vec![text])),
            Arc::clone(self.batches[0].column(1)),
        ];
        self.batches[0] = RecordBatch::try_new(self.batches[0].schema(), columns).unwrap();
        self
    }
}

/// Merges the only file of `odd.arrow` and reads it.
fn read(crafted: Crafted) -> Result<StatisticsFile> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("odd.arrow");
    crafted.written(&path);
    let files = StatisticsFiles::open(std::slice::from_ref(&path), &mut |_| {})?;
    let mut merged = Vec::new();
    files.write_to(&mut merged)?.unwrap();
    StatisticsFile::read(&path)
}

#[track_caller]
fn refused(crafted: Crafted, words: &str) {
    let error = read(crafted).unwrap_err().to_string();
    assert!(
        error.contains("odd.arrow") && error.contains(words),
        "{error}"
    );
}

type Change = fn(&mut Crafted);

/// Files whose checksums are right and that are wrong otherwise.
#[test]
fn what_no_program_of_ours_wrote_is_refused() {
    assert_eq!(read(Crafted::new()).unwrap(), pendulum());
    let ours = format!("this program reads {FORMAT}");
    let older = format!("has format 1, {ours}; make it anew");
    refused(Crafted::with(|own| own.metadata.format = 1), &older);
    let newer = format!("has format {}, {ours}; read it with a newer", FORMAT + 1);
    refused(
        Crafted::with(|own| own.metadata.format = FORMAT + 1),
        &newer,
    );
    let changes: [(Change, &str); 5] = [
        (
            |own| own.metadata.logs.clear(),
            "has 1 rows, its metadata name 0",
        ),
        (
            |own| own.metadata.logs[0].name = "other".into(),
            "row 0 is another log",
        ),
        (|own| own.metadata.logs[0].sums += 1, "row 0 is another log"),
        (
            |own| own.metadata.logs[0].numbers = "x".into(),
            "is damaged",
        ),
        (
            |own| own.batches[0] = own.batches[0].project(&[0]).unwrap(),
            "has other columns than a text and a list",
        ),
    ];
    for (change, words) in changes {
        refused(Crafted::with(change), words);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("odd.arrow");
    fs::write(&path, "t,q\n0,1\n").unwrap();
    let error = StatisticsFile::read(&path).unwrap_err().to_string();
    assert!(
        error.contains("is no Arrow file; give a file that"),
        "{error}"
    );
}

/// Numbers stay as they are; the checksum is that of the text.
#[test]
fn texts_that_contradict_their_numbers_are_refused() {
    refused(Crafted::new().with_text("{}"), "row 0 cannot be read");
    let text = Crafted::new().batches[0]
        .column(0)
        .as_string::<i32>()
        .value(0)
        .to_owned();
    let fewer = text.replacen(",[0,\"products\"", ",[9,\"products\"", 1);
    refused(
        Crafted::new().with_text(&fewer),
        "has no `products` of joint 1",
    );
    let records = text.find("\"records\":[").unwrap();
    let none = format!("{}\"records\":[]}}", &text[..records]);
    refused(Crafted::new().with_text(&none), "another count of numbers");
    let sums = pendulum()
        .statistics
        .tables()
        .next()
        .unwrap()
        .header
        .identity()
        .sums;
    let other = text.replace(&format!("\"sums\":{sums}"), "\"sums\":7");
    let mut crafted = Crafted::new().with_text(&other);
    crafted.metadata.logs[0].sums = 7;
    refused(crafted, "holds other sums than its header says");
    let other = text.replace("\"torque_rms\":[", "\"torque_rms\":[1.0,");
    assert_ne!(other, text);
    let crafted = Crafted::new().with_text(&other);
    refused(crafted, "has another number of joints");
}

/// More names than the metadata of a file may have.
#[test]
fn what_could_not_be_read_again_is_not_written() {
    let mut metadata = Crafted::new().metadata;
    metadata.logs[0].name = "x".repeat(1 << 20);
    metadata.logs = vec![metadata.logs[0].clone(); 80];
    let mut to = Vec::new();
    let error = write::written(metadata, std::iter::empty(), &mut to)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("80 logs take 80 MB") && to.is_empty(),
        "{error}"
    );
}
