//! Limits hold everywhere, motions repeat, and what is impossible is refused with its cause.

use super::*;
use crate::robot::Robot;
use crate::robot::testing::tree;
use crate::term::{Family, Library, LibrarySettings};
use std::collections::BTreeMap;

pub(super) fn library(robot: &Robot) -> Library {
    let settings = LibrarySettings {
        families: vec![
            Family::Density,
            Family::MassMoments,
            Family::Tensor,
            Family::Viscous,
            Family::Coulomb,
        ],
        ..LibrarySettings::default()
    };
    Library::propose(robot, &settings).expect("a library").0
}

pub(super) fn stated(robot: &Robot, torque: Option<f64>) -> BTreeMap<String, StatedLimits> {
    let own = StatedLimits {
        position: Some([-1.1, 1.3]),
        velocity: Some(1.7),
        acceleration: Some(6.0),
        jerk: Some(70.0),
        torque,
        start: Some(0.1),
    };
    let names = robot.joint_names().into_iter();
    names.map(|name| (name.to_owned(), own)).collect()
}

pub(super) fn short() -> DesignSettings {
    DesignSettings {
        duration: 8.0,
        rate: 250.0,
        proposals: 400,
        chains: 2,
        ..DesignSettings::default()
    }
}

pub(super) fn designed(
    robot: &Robot,
    limits: &[JointLimits],
    settings: &DesignSettings,
) -> Result<Design> {
    let library = library(robot);
    let torque = NominalTorque::new(robot, limits);
    let task = Task {
        robot,
        library: &library,
        questions: None,
        recorded: None,
        limits,
        torque: Some(&torque),
        clearance: None,
    };
    design(&task, settings, &|_| Ok(()))
}

/// Every sample, and jerk by differences of the acceleration between samples.
#[test]
fn no_limit_is_broken_and_both_ends_rest() {
    let robot = tree();
    let limits = joint_limits(&robot, &stated(&robot, Some(400.0))).expect("limits");
    let found = designed(&robot, &limits, &short()).expect("a motion");
    let (motion, len) = (&found.motion, found.motion.len);
    assert_eq!(len, 2001);
    for (j, own) in limits.iter().enumerate() {
        let of = |all: &[f64]| all[j * len..(j + 1) * len].to_vec();
        let (q, qd, qdd) = (of(&motion.q), of(&motion.qd), of(&motion.qdd));
        let most = |x: &[f64]| x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        assert!(
            q.iter()
                .all(|q| (own.position[0]..=own.position[1]).contains(q))
        );
        assert!(most(&qd) <= own.velocity && most(&qdd) <= own.acceleration);
        let jerk: Vec<f64> = (qdd.windows(2))
            .map(|pair| (pair[1] - pair[0]) * motion.rate)
            .collect();
        assert!(most(&jerk) <= own.jerk);
        assert!(most(&q) > 0.2 && most(&qd) > 0.2, "joint {j} moves");
        for end in [0, len - 1] {
            assert!((q[end] - own.start).abs() < 1e-12);
            assert!(qd[end].abs() < 1e-9 && qdd[end].abs() < 1e-9);
        }
    }
    let states = States {
        len,
        q: motion.q.clone(),
        qd: motion.qd.clone(),
        qdd: motion.qdd.clone(),
        still: vec![false; motion.q.len()],
    };
    assert!(
        NominalTorque::new(&robot, &limits)
            .exceeded(&states)
            .is_none()
    );
}

/// A motion of the same search that only draws feasible changes shows less than one that chooses them.
#[test]
fn a_longer_search_shows_more() {
    let robot = tree();
    let limits = joint_limits(&robot, &stated(&robot, None)).expect("limits");
    let value = |proposals: usize, steps: usize| {
        let settings = DesignSettings {
            proposals,
            steps,
            ..short()
        };
        let found = designed(&robot, &limits, &settings).expect("a motion");
        (found.log_determinant, found.condition)
    };
    let (few, many) = (value(20, 0), value(800, 0));
    assert!(many.0 > few.0 + 1.0 && many.1 < few.1, "{few:?} {many:?}");
    let uphill = value(20, 150);
    assert!(uphill.0 > many.0 + 1.0, "{uphill:?} {many:?}");
}

#[test]
fn the_motion_is_the_same_on_any_number_of_threads() {
    let robot = tree();
    let limits = joint_limits(&robot, &stated(&robot, None)).expect("limits");
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads")
            .install(|| designed(&robot, &limits, &short()).expect("a motion"))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn whoever_ends_the_search_gets_the_best_motion_so_far() {
    let robot = tree();
    let limits = joint_limits(&robot, &stated(&robot, None)).expect("limits");
    let library = library(&robot);
    let task = Task {
        robot: &robot,
        library: &library,
        questions: None,
        recorded: None,
        limits: &limits,
        torque: None,
        clearance: None,
    };
    let after = |stage: DesignStage| match stage.done >= 200 {
        true => Err(Error::Cancelled),
        false => Ok(()),
    };
    let found = design(&task, &short(), &after).expect("a motion");
    assert!(found.stopped && found.log_determinant.is_finite());
    let most = found
        .motion
        .qd
        .iter()
        .fold(0.0_f64, |most, x| most.max(x.abs()));
    assert!(most > 0.1, "{most}");
}

struct Wall;

impl Clearance for Wall {
    fn breach(&self, path: &Path, _: Option<usize>) -> Option<Approach> {
        self.closest(path).filter(|own| own.distance < 0.0)
    }

    fn nearness(&self, q: &[f64], len: usize) -> Vec<f64> {
        let of = |q: &f64| ((0.5 - q) / 0.05).clamp(1e-3, 1.0).ln();
        q[..len].iter().map(of).collect()
    }

    fn nearness_slopes(&self, q: &[f64], len: usize, _: &[f64]) -> Vec<NearSlope> {
        let near = q[..len]
            .iter()
            .enumerate()
            .filter(|(_, q)| (0.45..0.49995).contains(*q));
        let joints = q.len() / len.max(1);
        near.map(|(state, q)| {
            let mut slopes = vec![0.0; joints];
            slopes[0] = -1.0 / (0.5 - q);
            NearSlope { state, slopes }
        })
        .collect()
    }

    fn closest(&self, path: &Path) -> Option<Approach> {
        let first = &path.q[..path.len];
        let (at, q) = (first.iter().enumerate()).max_by(|a, b| a.1.total_cmp(b.1))?;
        let fastest = path.speed[..path.spans()]
            .iter()
            .fold(0.0_f64, |a, b| a.max(*b));
        Some(Approach {
            between: ["link1".into(), "wall".into()],
            distance: 0.5 - q - 0.5 * path.step * fastest,
            time: path.start + at as f64 * path.step,
        })
    }
}

#[test]
fn forbidden_space_is_kept_free() {
    let robot = tree();
    let limits = joint_limits(&robot, &stated(&robot, None)).expect("limits");
    let library = library(&robot);
    let task = |limits| Task {
        robot: &robot,
        library: &library,
        questions: None,
        recorded: None,
        limits,
        torque: None,
        clearance: Some(&Wall),
    };
    let found = design(&task(&limits), &short(), &|_| Ok(())).expect("a motion");
    let first = &found.motion.q[..found.motion.len];
    let largest = first.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
    assert!(largest <= 0.5 && largest > 0.3, "{largest}");
    let closest = found.closest.expect("a wall");
    assert!(
        closest.distance >= 0.0 && closest.distance < 0.2,
        "{closest:?}"
    );
    let at = (closest.time * found.motion.rate).round() as usize;
    assert!(
        (first[at] - largest).abs() < 0.02,
        "{} {largest}",
        first[at]
    );
    let mut corner = limits.clone();
    corner[0].start = 0.5;
    corner
        .iter_mut()
        .skip(1)
        .for_each(|own| own.position = [own.start - 1e-12, own.start + 1e-12]);
    corner[0].position = [0.5 - 1e-12, 0.6];
    let error = design(&task(&corner), &short(), &|_| Ok(())).expect_err("no way");
    let text = error.to_string();
    assert!(
        text.contains("no motion") && text.contains("`wall`"),
        "{text}"
    );
    let mut inside = limits.clone();
    inside[0].start = 0.6;
    let error = design(&task(&inside), &short(), &|_| Ok(())).expect_err("in the wall");
    let text = error.to_string();
    assert!(
        matches!(error, Error::Refused { .. }) && text.contains("`wall`"),
        "{text}"
    );
}

#[test]
fn what_is_impossible_is_refused_by_name() {
    let robot = tree();
    let weak = joint_limits(&robot, &stated(&robot, Some(0.5))).expect("limits");
    let error = designed(&robot, &weak, &short()).expect_err("no torque");
    assert!(matches!(error, Error::Refused { .. }), "{error}");
    let wrong = |change: &dyn Fn(&mut StatedLimits), says: &str| {
        let mut stated = stated(&robot, None);
        change(stated.get_mut("joint2").expect("joint2"));
        let error = joint_limits(&robot, &stated).expect_err(says);
        let text = error.to_string();
        assert!(text.contains("joint2") && text.contains(says), "{text}");
    };
    wrong(&|own| own.velocity = None, "velocity");
    wrong(&|own| own.position = Some([1.0, -1.0]), "1 to -1");
    wrong(&|own| own.start = Some(3.0), "starts at 3");
    wrong(&|own| own.jerk = Some(-1.0), "jerk");
    wrong(&|own| own.acceleration = Some(f64::NAN), "acceleration");
    let mut unknown = stated(&robot, None);
    unknown.insert("joint22".into(), StatedLimits::default());
    let error = joint_limits(&robot, &unknown).expect_err("unknown");
    assert!(error.to_string().contains("joint22"), "{error}");
    for (duration, rate) in [
        (0.0, 500.0),
        (f64::NAN, 500.0),
        (0.1, 500.0),
        (20.0, -1.0),
        (1e9, 1e9),
    ] {
        let settings = DesignSettings {
            duration,
            rate,
            ..short()
        };
        let limits = joint_limits(&robot, &stated(&robot, None)).expect("limits");
        let error = designed(&robot, &limits, &settings).expect_err("settings");
        assert!(matches!(error, Error::Setting { .. }), "{error}");
    }
}
