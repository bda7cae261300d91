//! A log in chapters says what the same log in memory says: the truth, the same incidents, and what is wrong with single chapters.

mod motion;

use crate::two_link;
use std::f64::consts::TAU;
use std::sync::{Arc, Mutex};
use twincal::calibrate::{Calibration, CalibrationSettings, Statistics, calibrate, plan};
use twincal::random::Random;
use twincal::robot::{Workspace, inverse_dynamics};
use twincal::signal::{Channels, Log, LongLog, Payload, ReadChapter, Recording, Shelf};
use twincal::term::Family;

const RATE: f64 = 200.0;
const SAMPLES: usize = 48_000;
const CHAPTERS: usize = 4;
/// What the arm carries and its model does not know, kg at the tip; friction, N·m·s/rad and N·m.
const LOAD: f64 = 0.6;
const VISCOUS: f64 = 0.7;
const COULOMB: f64 = 0.5;

/// Four minutes of the arm, with white noise of 0.1 N·m.
fn recording() -> Recording {
    let real = two_link::arm(2.0 + LOAD).expect("an arm");
    let mut noise = Random::new(3, 0);
    let (mut workspace, mut tau) = (Workspace::new(&real), [0.0; 2]);
    let mut joints = [(); 2].map(|()| [(); 3].map(|()| Vec::with_capacity(SAMPLES)));
    let time: Vec<f64> = (0..SAMPLES).map(|i| i as f64 / RATE).collect();
    let rates = [[0.11, 0.37, 0.53], [0.17, 0.29, 0.61]];
    for t in &time {
        let wave = |joint: usize, derivative: i32| -> f64 {
            let one = |f: f64| {
                let w = TAU * f;
                0.5 * w.powi(derivative) * (w * t + 0.25 * TAU * f64::from(derivative)).sin()
            };
            rates[joint].into_iter().map(one).sum()
        };
        let [q, qd, qdd] = [0, 1, 2].map(|derivative| [wave(0, derivative), wave(1, derivative)]);
        inverse_dynamics(&real, &mut workspace, &q, &qd, &qdd, &mut tau);
        tau[0] += VISCOUS * qd[0];
        tau[1] += COULOMB * (qd[1] / 0.02).tanh();
        for (j, channels) in joints.iter_mut().enumerate() {
            let values = [q[j], qd[j], tau[j] + 0.1 * noise.normal()];
            channels
                .iter_mut()
                .zip(values)
                .for_each(|(all, value)| all.push(value));
        }
    }
    let joints = joints.map(|[q, qd, tau]| Channels {
        q,
        qd: Some(qd),
        qdd: None,
        tau: Some(tau),
        temperature: None,
    });
    Recording {
        unfolded: false,
        start_ns: 0,
        name: "run".into(),
        time,
        joints: joints.to_vec(),
        payload: Payload::None,
    }
}

/// A recording cut where a reader would cut it.
#[derive(Debug)]
struct Cut {
    recording: Recording,
    /// First samples of the chapters, and the end of the last.
    edges: Vec<usize>,
}

impl Cut {
    fn range(&self, chapter: usize) -> std::ops::Range<usize> {
        self.edges[chapter]..self.edges[chapter + 1]
    }
}

impl ReadChapter for Cut {
    fn read(&self, chapter: usize) -> twincal::Result<Recording> {
        let part = |values: &Vec<f64>| values[self.range(chapter)].to_vec();
        let joint = |joint: &Channels| Channels {
            q: part(&joint.q),
            qd: joint.qd.as_ref().map(part),
            qdd: joint.qdd.as_ref().map(part),
            tau: joint.tau.as_ref().map(part),
            temperature: None,
        };
        Ok(Recording {
            unfolded: false,
            start_ns: 0,
            name: String::new(),
            time: part(&self.recording.time),
            joints: self.recording.joints.iter().map(joint).collect(),
            payload: Payload::None,
        })
    }
}

/// Rows that are put away are in no vector of the calibration's own.
#[derive(Debug, Default)]
struct Attic {
    numbers: Mutex<Vec<f64>>,
    broken: bool,
    /// Numbers that there is room for; `None`: any.
    room: Option<usize>,
}

impl Shelf for Attic {
    fn put(&self, numbers: &[f64]) -> twincal::Result<u64> {
        let mut all = self.numbers.lock().expect("no panic");
        all.extend_from_slice(numbers);
        if let Some(failure) = self.room.filter(|room| all.len() > *room).map(|_| full()) {
            return Err(failure);
        }
        Ok((all.len() - numbers.len()) as u64)
    }

    fn get(&self, place: u64, skip: usize, numbers: &mut [f64]) {
        let all = self.numbers.lock().expect("no panic");
        numbers.copy_from_slice(&all[place as usize + skip..][..numbers.len()]);
        if self.broken {
            numbers.fill(f64::NAN);
        }
    }

    fn failure(&self) -> Option<twincal::Error> {
        let used = self.numbers.lock().expect("no panic").len();
        if self.room.is_some_and(|room| used > room) {
            return Some(full());
        }
        self.broken.then(|| twincal::Error::Log {
            log: "run".into(),
            problem: "the attic burnt down".into(),
            remedy: "build another".into(),
        })
    }
}

fn full() -> twincal::Error {
    twincal::Error::Log {
        log: "run".into(),
        problem: "the attic is full".into(),
        remedy: "throw something away".into(),
    }
}

fn in_chapters(recording: Recording) -> Log<'static> {
    cut(recording, CHAPTERS)
}

fn cut(recording: Recording, chapters: usize) -> Log<'static> {
    let edges = (0..=chapters).map(|chapter| chapter * SAMPLES / chapters);
    cut_at(recording, edges.collect())
}

fn cut_at(recording: Recording, edges: Vec<usize>) -> Log<'static> {
    let (name, chapters) = (recording.name.clone(), edges.len() - 1);
    let cut = Cut { recording, edges };
    let samples = (0..chapters).map(|chapter| cut.range(chapter).len());
    Log::Long(long(name, samples.collect(), cut))
}

fn long(name: String, samples: Vec<usize>, source: impl ReadChapter + 'static) -> LongLog {
    let robot = two_link::arm(2.0).expect("an arm");
    let mut long = LongLog::new(&robot, samples, Arc::new(source)).expect("positions");
    long.name = name;
    long
}

fn calibrated(log: Log<'static>) -> Calibration {
    let nominal = two_link::arm(2.0).expect("an arm");
    let mut settings = CalibrationSettings::default();
    settings.library.families = vec![
        Family::Payload,
        Family::Viscous,
        Family::Coulomb,
        Family::Offset,
    ];
    let none: &[Recording] = &[];
    calibrate(&nominal, vec![log], none, &settings, &|_| {}).expect("a calibration")
}

fn selected(result: &Calibration) -> Vec<&str> {
    let all = result.components.iter().filter(|c| c.is_in());
    all.map(|component| component.name.as_str()).collect()
}

fn said<'a>(result: &'a Calibration, code: &str) -> Vec<&'a str> {
    let all = result.findings.iter().filter(|f| f.code.as_str() == code);
    all.map(|finding| finding.message.as_str()).collect()
}

fn with_shelf(log: Log<'static>, shelf: Arc<dyn Shelf>) -> Log<'static> {
    match log {
        Log::Long(long) => Log::Long(long.with_shelf(shelf)),
        whole => whole,
    }
}

/// Where rows lie changes no more than the order of sums.
#[test]
fn rows_on_a_shelf_are_rows() {
    let attic = Arc::new(Attic::default());
    let kept = calibrated(in_chapters(recording()));
    let put_away = calibrated(with_shelf(in_chapters(recording()), attic.clone()));
    assert!(attic.numbers.lock().expect("no panic").len() > 10_000);
    assert_eq!(kept.validation.split, put_away.validation.split);
    let close = |a: f64, b: f64, what: &str| {
        assert!(
            (a - b).abs() <= 1e-6 * a.abs().max(1e-6),
            "{what}: {a}, {b}"
        );
    };
    for (a, b) in kept.terms.iter().zip(&put_away.terms) {
        for (a, b) in [
            (a.pip, b.pip),
            (a.conditional_mean, b.conditional_mean),
            (a.conditional_sd, b.conditional_sd),
            (a.sandwich_sd, b.sandwich_sd),
        ] {
            assert_eq!(a.is_some(), b.is_some());
            close(a.unwrap_or(0.0), b.unwrap_or(0.0), "a term");
        }
    }
    for (a, b) in (kept.validation.filtered.joints.iter()).zip(&put_away.validation.filtered.joints)
    {
        close(a.rmse_calibrated, b.rmse_calibrated, "held-out error");
        close(a.epistemic_sd, b.epistemic_sd, "its epistemic part");
    }
    for (a, b) in kept.sweep.iter().zip(&put_away.sweep) {
        close(a.cutoff_hz, b.cutoff_hz, "cut-off");
        a.mean
            .iter()
            .zip(&b.mean)
            .for_each(|(a, b)| close(*a, *b, "sweep"));
    }
    assert_eq!((kept.sweep.len(), put_away.sweep.len()), (3, 3));
}

/// A chapter that is shorter than the filter has no rows (0.9 s; the filter asks for 1.3 s at 5 Hz). Wherever it stands, and wherever rows
/// lie, the truth is found: 3 parameters at 4.5 sd, 6 logs: false alarm 1e-4; the seed is fixed.
#[test]
fn a_chapter_without_rows_changes_nothing() {
    let (first, short) = (SAMPLES / 4, 180);
    let edges = [
        vec![0, short, first, 2 * first],
        vec![0, first, first + short, 2 * first],
        vec![0, first, 2 * first, 2 * first + short],
    ];
    for edges in edges {
        for shelf in [false, true] {
            let mut log = cut_at(recording(), edges.clone());
            if shelf {
                log = with_shelf(log, Arc::new(Attic::default()));
            }
            let result = calibrated(log);
            let mut found = selected(&result);
            found.sort_unstable();
            let wanted = ["elbow.coulomb", "payload", "shoulder.viscous"];
            assert_eq!(found, wanted, "{edges:?}, on a shelf: {shelf}");
            for (name, value) in [
                ("payload", LOAD),
                ("shoulder.viscous", VISCOUS),
                ("elbow.coulomb", COULOMB),
            ] {
                let component = result.components.iter().find(|c| c.name == name);
                let found = &component.expect("a component").parameters[0];
                assert!(
                    (found.mean - value).abs() < 4.5 * found.sd,
                    "{edges:?}, on a shelf: {shelf}: {name}: {} ± {}",
                    found.mean,
                    found.sd
                );
            }
        }
    }
}

#[test]
fn rows_that_do_not_come_back_end_the_calibration_with_the_reason() {
    let attic = Attic {
        broken: true,
        ..Attic::default()
    };
    let log = with_shelf(in_chapters(recording()), Arc::new(attic));
    let nominal = two_link::arm(2.0).expect("an arm");
    let none: &[Recording] = &[];
    let settings = CalibrationSettings::default();
    let (known, _) = plan(&nominal, vec![recording()], &settings, &|_| {}).expect("a plan");
    let error = Statistics::of(("arm", &nominal), &known, &log, "").expect_err("no rows");
    assert!(error.to_string().contains("the attic burnt down"));
    let stopped = calibrate(&nominal, vec![log], none, &settings, &|_| {}).expect_err("no rows");
    assert!(stopped.error.to_string().contains("the attic burnt down"));
}

/// No room is no fault of a chapter, wherever it is noticed: nothing is fitted to a part of the log.
#[test]
fn a_shelf_that_is_full_ends_the_calibration() {
    let nominal = two_link::arm(2.0).expect("an arm");
    let settings = CalibrationSettings::default();
    let (known, _) = plan(&nominal, vec![recording()], &settings, &|_| {}).expect("a plan");
    for room in [0, 20_000, 100_000, 200_000] {
        let attic = Attic {
            room: Some(room),
            ..Attic::default()
        };
        let log = with_shelf(in_chapters(recording()), Arc::new(attic));
        let none: &[Recording] = &[];
        let error = Statistics::of(("arm", &nominal), &known, &log, "").expect_err("no room");
        assert!(error.to_string().contains("the attic is full"), "{room}");
        let stopped =
            calibrate(&nominal, vec![log], none, &settings, &|_| {}).expect_err("no room");
        assert!(
            stopped.error.to_string().contains("the attic is full"),
            "{room}"
        );
    }
}

/// Of many short chapters motion is kept, too: raw scores, the lag and the noise out of the band are there.
#[test]
fn many_chapters_lose_no_raw_rows() {
    let long = calibrated(cut(recording(), 40));
    assert_eq!(long.logs[0].segments, 40);
    assert!(
        long.validation
            .raw
            .joints
            .iter()
            .all(|joint| joint.rows > 200)
    );
    assert!((long.validation.raw.rmse_calibrated - 0.1).abs() < 0.01);
    // White noise of 0.1 N·m: what the filter takes out is nearly all of it.
    for noise in &long.twin.noise {
        assert!((noise.out_of_band - 0.1).abs() < 0.02, "{noise:?}");
    }
}

/// 3 parameters at 4.5 sd: false alarm 2e-5 for either log; the seed is fixed.
#[test]
fn chapters_say_what_the_whole_log_says() {
    let recording = recording();
    let long = calibrated(in_chapters(recording.clone()));
    let whole = calibrated(Log::Whole(std::borrow::Cow::Owned(recording)));
    let truth = [
        ("payload", LOAD),
        ("shoulder.viscous", VISCOUS),
        ("elbow.coulomb", COULOMB),
    ];
    for result in [&whole, &long] {
        assert_eq!(
            selected(result).len(),
            truth.len(),
            "{:?}",
            selected(result)
        );
        for (name, value) in truth {
            let component = result.components.iter().find(|c| c.name == name);
            let found = &component.expect("a component").parameters[0];
            let far = (found.mean - value).abs() / found.sd;
            assert!(
                far < 4.5,
                "{name}: {} ± {}, in truth {value}",
                found.mean,
                found.sd
            );
        }
        assert!((result.validation.raw.rmse_calibrated - 0.1).abs() < 0.005);
    }
    // The sweep's rows of a log in chapters are made with those of the fit, and are the same but for the ends of chapters.
    for (a, b) in whole.sweep.iter().zip(&long.sweep) {
        for (k, (a, b)) in a.mean.iter().zip(&b.mean).enumerate() {
            let sd = whole.terms[k].conditional_sd.unwrap_or(f64::INFINITY);
            assert!(
                (a - b).abs() < 0.5 * sd,
                "{}: {a}, {b} ± {sd}",
                whole.terms[k].term.name
            );
        }
    }
    let (logs, of_whole) = (&long.logs[0], &whole.logs[0]);
    assert_eq!(
        (logs.samples, logs.segments),
        (SAMPLES as u64, CHAPTERS as u64)
    );
    assert!((logs.rate_hz - RATE).abs() < 1e-6 && logs.duration == of_whole.duration);
    // Three cuts cost the filters' two ends each, no more: 1.3 s at 5 Hz, 12.5 rows/s.
    let lost = of_whole.rows[0] - logs.rows[0];
    assert!((1..=3 * 20).contains(&lost), "{lost} rows");
    assert_eq!(said(&long, "chapters").len(), 1, "{:?}", long.findings);
    assert_eq!(said(&whole, "chapters").len(), 0);
    // What is told of single logs is told once, not once per chapter.
    assert_eq!(said(&long, "borders").len(), 1);
    assert!(said(&long, "borders")[0].ends_with("(in chapter 1 of 4; 3 more are alike)"));
}

#[test]
fn what_is_wrong_with_a_chapter_is_told_and_costs_no_other() {
    let mut recording = recording();
    // Something is hit in the second chapter, and the torque of the third is gone.
    for i in 0..20 {
        recording.joints[1].tau.as_mut().expect("torque")[18_000 + i] += 15.0;
    }
    for row in SAMPLES / 2..3 * SAMPLES / 4 {
        recording.joints[0].tau.as_mut().expect("torque")[row] = f64::NAN;
    }
    let long = calibrated(in_chapters(recording.clone()));
    let whole = calibrated(Log::Whole(std::borrow::Cow::Owned(recording)));
    assert_eq!(said(&long, "contact"), said(&whole, "contact"));
    assert!(
        said(&long, "contact")[0].contains("once"),
        "{:?}",
        long.findings
    );
    let left_out = said(&long, "chapters_left_out");
    assert!(left_out[0].starts_with("1 of 4 chapters cannot be used and were left out; the first is number 3: torque of joint `shoulder`"), "{left_out:?}");
    assert_eq!(selected(&long), selected(&whole));
    assert_eq!(long.logs[0].segments, 3);
}

#[test]
fn without_a_usable_chapter_the_first_says_why() {
    let mut recording = recording();
    recording.joints[0].q.fill(f64::NAN);
    let nominal = two_link::arm(2.0).expect("an arm");
    let none: &[Recording] = &[];
    let settings = CalibrationSettings::default();
    let logs = vec![in_chapters(recording)];
    let stopped = calibrate(&nominal, logs, none, &settings, &|_| {}).expect_err("no position");
    let words = stopped.error.to_string();
    assert!(
        words.contains("position of joint `shoulder` is NaN or infinite"),
        "{words}"
    );
}

/// What a reader says when a chapter cannot be read again is the error, not a chapter that is left out.
#[test]
fn a_chapter_that_cannot_be_read_again_ends_the_calibration() {
    #[derive(Debug)]
    struct Broken(Arc<dyn ReadChapter>);
    impl ReadChapter for Broken {
        fn read(&self, chapter: usize) -> twincal::Result<Recording> {
            if chapter == 3 {
                return Err(twincal::Error::Log {
                    log: "run".into(),
                    problem: "the disk is gone".into(),
                    remedy: "look for it".into(),
                });
            }
            self.0.read(chapter)
        }

        fn positions(&self, chapter: usize, joint: usize) -> twincal::Result<Vec<f64>> {
            self.0.positions(chapter, joint)
        }
    }
    let nominal = two_link::arm(2.0).expect("an arm");
    let Log::Long(good) = in_chapters(recording()) else {
        unreachable!("it is long");
    };
    let broken = Broken(good.source().clone());
    let log = Log::Long(long("run".into(), good.samples().to_vec(), broken));
    let none: &[Recording] = &[];
    let settings = CalibrationSettings::default();
    let stopped = calibrate(&nominal, vec![log], none, &settings, &|_| {}).expect_err("no disk");
    assert!(stopped.error.to_string().contains("the disk is gone"));
}
