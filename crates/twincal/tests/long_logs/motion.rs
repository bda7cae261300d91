//! What chapters are made of: their motion where they meet, their angles, what is told of them before a fit.

use super::{CHAPTERS, RATE, SAMPLES, in_chapters, recording, two_link};
use std::f64::consts::{PI, TAU};
use twincal::calibrate::{LookedAt, outlook};
use twincal::incidents::motion;
use twincal::robot::Robot;
use twincal::rows::{RowSignal, visit_rows};
use twincal::signal::{
    Channels, Log, LongLog, Payload, Pipeline, Recording, Trajectory, align, describe,
};
use twincal::term::{Family, Library, LibrarySettings};
use twincal::{Code, Finding};

fn long(recording: Recording) -> LongLog {
    match in_chapters(recording) {
        Log::Long(long) => long,
        Log::Whole(_) => unreachable!("it is long"),
    }
}

/// Two minutes of position and velocity at `stamps`, both exact.
fn swinging(time: Vec<f64>) -> Recording {
    let joint = |f: f64| Channels {
        q: time.iter().map(|t| (TAU * f * t).sin()).collect(),
        qd: Some(time.iter().map(|t| TAU * f * (TAU * f * t).cos()).collect()),
        qdd: None,
        tau: Some(vec![f64::NAN; time.len()]),
        temperature: None,
    };
    Recording {
        unfolded: false,
        start_ns: 0,
        name: "run".into(),
        joints: vec![joint(0.31), joint(0.47)],
        payload: Payload::None,
        time,
    }
}

/// Every row of motion of the whole log is there once, and the same: where chapters meet, where the clock is uneven, and where the log
/// is cut beside or at the end of a chapter.
#[test]
fn motion_is_that_of_the_whole_log_where_chapters_meet() {
    let robot = two_link::arm(2.0).expect("an arm");
    let even = |i: usize| i as f64 / RATE;
    let uneven = |i: usize| even(i) + 2e-4 * (i as f64 * 1.7).sin();
    // A grid of its own starts anew in every piece, so that its last sample may stand elsewhere.
    for (stamp, thinned, slack, missing_at) in [
        (&even as &dyn Fn(usize) -> f64, 0.0, 0, 30),
        (&even, 0.0, 0, 0),
        (&uneven, 0.0, 4, 30),
        (&even, 0.02, 4 * 4, 30),
    ] {
        let mut recording = swinging((0..SAMPLES).map(stamp).collect());
        let [edge, second] = [SAMPLES / CHAPTERS, 2 * SAMPLES / CHAPTERS];
        // A gap just before chapters meet, NaN just behind or right there, and a gap right where they do.
        recording.time[edge - 40..]
            .iter_mut()
            .for_each(|t| *t += 0.7);
        recording.joints[0].q[second + missing_at] = f64::NAN;
        let third = 3 * SAMPLES / CHAPTERS;
        recording.time[third..].iter_mut().for_each(|t| *t += 0.3);
        let pipeline = Pipeline {
            cutoff_hz: 5.0,
            motion_cutoff_hz: 20.0,
            rate_hz: 12.5,
            motion_interval: thinned,
            standstill_velocity: vec![0.02; 2],
            ..Pipeline::off(2)
        };
        let findings = compare(&robot, recording, &pipeline, slack);
        // What was borrowed is not told: one row is NaN, in one chapter.
        let lost: Vec<u64> = (findings.iter())
            .filter(|f| f.code == Code::NotFiniteRows)
            .map(|f| f.count)
            .collect();
        assert_eq!(lost, [1]);
        assert!(
            findings
                .iter()
                .all(|f| f.code != Code::ShortSegments && f.code != Code::Borders)
        );
    }
}

/// A table that joins topics of different rates: positions in every fourth row.
#[test]
fn motion_in_some_of_the_rows_goes_on_where_chapters_meet() {
    let robot = two_link::arm(2.0).expect("an arm");
    let mut recording = swinging((0..SAMPLES).map(|i| i as f64 / RATE).collect());
    for joint in &mut recording.joints {
        joint.qd = None;
        (0..SAMPLES)
            .filter(|row| row % 4 != 1)
            .for_each(|row| joint.q[row] = f64::NAN);
    }
    let pipeline = Pipeline {
        cutoff_hz: 5.0,
        motion_cutoff_hz: 20.0,
        rate_hz: 12.5,
        standstill_velocity: vec![0.02; 2],
        ..Pipeline::off(2)
    };
    compare(&robot, recording, &pipeline, 0);
}

/// Holds the motion of a log in chapters against that of the whole: each row once, and the same; of whole rows none may be missing, and at
/// most `slack` be there beside them. What chapters said.
fn compare(robot: &Robot, recording: Recording, pipeline: &Pipeline, slack: usize) -> Vec<Finding> {
    let mut wanted = vec![None; SAMPLES];
    let mut motion = recording.clone();
    motion.take_torque();
    let (whole, _) = align(robot, &motion, pipeline).expect("motion");
    rows(robot, pipeline, &whole, |row, values| {
        wanted[row] = Some(values)
    });
    let mut got = vec![None; SAMPLES];
    let (mut first, mut findings) = (0, Vec::new());
    long(recording)
        .visit_motion(pipeline, &mut findings, |part, said| {
            assert_eq!(part.own.len(), part.chapter.time.len());
            assert_eq!(part.motion.time[part.own.clone()], part.chapter.time);
            let (trajectory, more) = align(robot, &part.motion, pipeline)?;
            said.extend(more);
            rows(robot, pipeline, &trajectory, |row, values| {
                if part.own.contains(&row) {
                    let row = first + row - part.own.start;
                    assert!(
                        got[row].replace(values).is_none(),
                        "row {row} is there twice"
                    );
                }
            });
            first += part.own.len();
            Ok(())
        })
        .expect("chapters");
    let all = wanted.iter().flatten().count();
    assert!(all > SAMPLES / 5);
    let missing = (0..SAMPLES).filter(|&row| wanted[row].is_some() && got[row].is_none());
    assert_eq!(missing.collect::<Vec<usize>>(), Vec::<usize>::new());
    assert!(got.iter().flatten().count() <= all + slack);
    for (row, (wanted, got)) in wanted.iter().zip(&got).enumerate() {
        for (wanted, got) in wanted.iter().zip(got).flat_map(|(a, b)| a.iter().zip(b)) {
            assert!(
                (wanted - got).abs() < 1e-6,
                "row {row}: {got}, not {wanted}"
            );
        }
    }
    findings
}

/// Position, velocity and acceleration of both joints at every input row that the filter reaches.
fn rows(
    robot: &Robot,
    pipeline: &Pipeline,
    trajectory: &Trajectory,
    mut take: impl FnMut(usize, Vec<f64>) + Send,
) {
    let settings = LibrarySettings {
        families: vec![Family::Viscous],
        ..LibrarySettings::default()
    };
    let (library, _) = Library::propose(robot, &settings).expect("a library");
    visit_rows(
        robot,
        &library,
        pipeline,
        trajectory,
        RowSignal::Raw,
        &mut |block| {
            for (i, &row) in block.input_rows.iter().enumerate() {
                let motion = [block.q, block.qd, block.qdd];
                let values = motion.map(|channel| [channel[i], channel[block.len + i]]);
                take(row, values.concat());
            }
            Ok(())
        },
    )
    .expect("rows");
}

/// An angle that turns on through several chapters, folded into ± π: unfolded as that of the whole log, and told once.
#[test]
fn angles_are_unfolded_as_those_of_the_whole_log() {
    let robot = two_link::arm(2.0).expect("an arm");
    let mut recording = swinging((0..SAMPLES).map(|i| i as f64 / RATE).collect());
    let truth: Vec<f64> = (recording.time.iter())
        .map(|t| 0.2 * t + 0.5 * (TAU * 0.3 * t).sin())
        .collect();
    recording.joints[1].q = (truth.iter())
        .map(|q| (q + PI).rem_euclid(TAU) - PI)
        .collect();
    recording.joints[1].q[100] = f64::NAN;
    let jumps = recording.joints[1].q.windows(2);
    let jumps = jumps.filter(|q| (q[1] - q[0]).abs() > PI).count();
    assert!(jumps > 5);
    let log = long(recording.clone());
    let whole = log.whole().expect("chapters");
    assert_eq!(whole.joints[0].q, recording.joints[0].q);
    for (row, (got, wanted)) in whole.joints[1].q.iter().zip(&truth).enumerate() {
        assert!((got - wanted).abs() < 1e-9 || row == 100, "row {row}");
    }
    let mut findings = Vec::new();
    log.visit(&mut findings, |_, _, _| Ok(()))
        .expect("chapters");
    assert_eq!(findings.len(), 1);
    assert_eq!(
        (findings[0].code.as_str(), findings[0].count),
        ("wrapped_angle", jumps as u64)
    );
    // A joint that leaves one turn was not folded, whatever jumps it has: not in the log, and in no chapter of it.
    recording.joints[1].q[200] = 9.0;
    recording.take_torque();
    let log = long(recording.clone());
    assert_eq!(
        log.whole().expect("chapters").joints[1].q[101..],
        recording.joints[1].q[101..]
    );
    let (of_whole, said) = describe(&robot, &Log::from(&recording)).expect("a log");
    let (of_chapters, also_said) = describe(&robot, &Log::Long(log)).expect("a log");
    assert_eq!(of_whole.joints[1].q_range, of_chapters.joints[1].q_range);
    for said in [said, also_said] {
        assert!(
            said.iter().all(|f| f.code != Code::WrappedAngle),
            "{said:?}"
        );
    }
}

/// The elbow moves for ten seconds of every minute, where no sample that is kept of the chapters may lie: what the log shows is what all
/// of its rows show.
#[test]
fn what_a_long_log_shows_is_what_all_of_it_shows() {
    let robot = two_link::arm(2.0).expect("an arm");
    let mut recording = recording();
    let still: Vec<bool> = (0..SAMPLES)
        .map(|row| !(6000..8000).contains(&(row % (SAMPLES / CHAPTERS))))
        .collect();
    for (row, _) in still.iter().enumerate().filter(|(_, still)| **still) {
        recording.joints[1].q[row] = 0.3;
        recording.joints[1].qd.as_mut().expect("velocity")[row] = 0.0;
    }
    let pipeline = Pipeline {
        cutoff_hz: 5.0,
        motion_cutoff_hz: 20.0,
        rate_hz: 12.5,
        coulomb_velocity: 0.02,
        standstill_velocity: vec![0.02; 2],
        ..Pipeline::off(2)
    };
    let directions = |log: &Log<'_>| {
        let (mut trajectory, _, _) = motion(&robot, &pipeline, log).expect("motion");
        // As if none of the kept samples had seen the elbow move.
        if let Log::Long(_) = log {
            for segment in &mut trajectory.segments {
                segment.standstill.fill(true);
            }
        }
        let seen = LookedAt {
            log,
            trajectory: &mut trajectory,
            incidents: &[],
        };
        let settings = LibrarySettings::default();
        let outlook = outlook(&robot, &settings, Some((&pipeline, vec![seen]))).expect("rows");
        outlook.excitation.expect("of a log").directions
    };
    let whole = directions(&Log::from(&recording));
    assert_eq!(directions(&Log::Long(long(recording))), whole);
    assert!(whole[1] > 8, "{whole:?}");
}

/// What is told of chapters is told of the log: one stretch, the mean and the range of all of it.
#[test]
fn a_long_log_is_described_as_a_whole_one() {
    let robot = two_link::arm(2.0).expect("an arm");
    let mut recording = recording();
    recording.time[SAMPLES / 3..]
        .iter_mut()
        .for_each(|t| *t += 5.0);
    let (whole, _) = describe(&robot, &Log::from(&recording)).expect("a log");
    let (long, _) = describe(&robot, &in_chapters(recording.clone())).expect("a log");
    assert_eq!((whole.segments, whole.samples), (2, SAMPLES as u64));
    assert_eq!((long.segments, long.samples), (2, SAMPLES as u64));
    assert!((long.duration - whole.duration).abs() < 1e-6 && long.resampled == whole.resampled);
    let close = |a: f64, b: f64| assert!((a - b).abs() <= 1e-12 * a.abs(), "{a}, {b}");
    for ((a, b), channels) in whole.joints.iter().zip(&long.joints).zip(&recording.joints) {
        assert_eq!(a.q_range, b.q_range);
        close(a.q_sd, b.q_sd);
        close(a.qd_rms, b.qd_rms);
        close(a.tau_sd.expect("torque"), b.tau_sd.expect("torque"));
        // Against the definition.
        let square: f64 = channels.tau.iter().flatten().map(|t| t * t).sum();
        close((square / SAMPLES as f64).sqrt(), b.tau_rms.expect("torque"));
    }
    // Torque in every third row is one stretch as well, wherever chapters meet.
    let mut sparse = recording.clone();
    for joint in &mut sparse.joints {
        let tau = joint.tau.iter_mut().flatten().enumerate();
        tau.filter(|(row, _)| row % 3 != 1)
            .for_each(|(_, tau)| *tau = f64::NAN);
    }
    let (whole, _) = describe(&robot, &Log::from(&sparse)).expect("a log");
    let (long, _) = describe(&robot, &in_chapters(sparse)).expect("a log");
    assert_eq!((whole.segments, long.segments), (2, 2));
    // A cut five rows before chapters meet: those rows are too few to be a stretch of their chapter, and what follows is one of the log.
    recording.time[3 * SAMPLES / CHAPTERS - 5..]
        .iter_mut()
        .for_each(|t| *t += 5.0);
    let (long, _) = describe(&robot, &in_chapters(recording)).expect("a log");
    assert_eq!(long.segments, 3);
}
