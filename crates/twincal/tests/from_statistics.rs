//! Statistics of logs, and fits from them: the same numbers as from the logs; sums that do not depend on who adds them; refusals.

use crate::two_link;
use twincal::Code;
use twincal::calibrate::{
    Calibration, CalibrationSettings, FromTables, Plan, Quantity, Record, Statistics, Stopped,
    calibrate, calibrate_statistics, plan,
};
use twincal::prelude::*;
use twincal::random::Random;
use twincal::validate::Split;

struct Study {
    robot: Robot,
    logs: Vec<Recording>,
    settings: CalibrationSettings,
}

/// A two-link arm whose payload is 0.6 kg heavier than its model says; `count` logs.
fn study(count: usize) -> Study {
    let robot = two_link::arm(2.0).expect("an arm");
    let real = two_link::arm(2.6).expect("an arm");
    let mut noise = Random::new(1, 0);
    let log = |number: usize| {
        let name = format!("log{number}");
        two_link::log(&name, 0.3 + 0.8 * number as f64, &real, &mut noise)
    };
    let mut settings = CalibrationSettings::default();
    settings.library.families = vec![
        Family::Payload,
        Family::Viscous,
        Family::Coulomb,
        Family::MotorInertia,
    ];
    Study {
        robot,
        logs: (0..count).map(log).collect(),
        settings,
    }
}

impl Study {
    fn plan(&self) -> Plan {
        let made = plan(&self.robot, &self.logs[..], &self.settings, &|_| {});
        made.expect("a plan").0
    }

    fn statistics(&self, plan: &Plan, log: usize) -> Statistics {
        let model = ("arm", &self.robot);
        let log = Log::from(&self.logs[log]);
        Statistics::of(model, plan, &log, "").expect("statistics")
    }

    /// Of these logs, added in this order.
    fn merged(&self, plan: &Plan, logs: impl IntoIterator<Item = usize>) -> Statistics {
        let mut logs = logs.into_iter().map(|log| self.statistics(plan, log));
        let mut sum = logs.next().expect("a log");
        logs.for_each(|other| sum.try_merge(&other).expect("the same plan"));
        sum
    }
}

/// Every number of terms, effects, noise and prior.
fn numbers(fit: &Calibration) -> Vec<f64> {
    let mut all = Vec::new();
    for term in &fit.terms {
        let own = [
            term.pip,
            term.mean,
            term.sd,
            term.conditional_median,
            term.column_rms,
        ];
        all.extend(own.into_iter().chain([term.sandwich_sd]).flatten());
    }
    for component in &fit.components {
        all.extend(component.pip);
        all.extend(
            component
                .parameters
                .iter()
                .flat_map(|own| [own.median, own.sd]),
        );
    }
    for noise in &fit.noise {
        all.extend([noise.sigma, noise.rho, noise.weight, noise.n, noise.n_eff]);
        all.extend([noise.autocorrelation_time, noise.misfit]);
        all.extend([noise.interval_factor, noise.out_of_band]);
    }
    all.extend(fit.autocorrelation.iter().flatten());
    all.extend(fit.twin.hull.iter().flatten());
    all.extend(fit.prior.scaled_variance.iter().map(|own| own.1));
    all
}

/// A fit from statistics has the numbers of the fit to the logs, whatever their number: one, two, and more than are left out one by one.
#[test]
fn numbers_are_those_of_the_logs() {
    for count in [1, 2, 8] {
        let study = study(count);
        let plan = study.plan();
        let statistics = study.merged(&plan, 0..count);
        let none: &[Recording] = &[];
        let own = calibrate_statistics(&statistics, none, &study.settings, &|_| {});
        let own = own.expect("a calibration");
        let whole = calibrate(
            &study.robot,
            &study.logs[..],
            none,
            &study.settings,
            &|_| {},
        );
        let whole = whole.expect("a calibration");
        let statuses = |fit: &Calibration| -> Vec<_> {
            fit.components
                .iter()
                .map(|own| (own.name.clone(), own.status))
                .collect()
        };
        assert_eq!(statuses(&own), statuses(&whole), "{count} logs");
        let (a, b) = (numbers(&own), numbers(&whole));
        assert_eq!(a.len(), b.len());
        for (at, (a, b)) in a.iter().zip(&b).enumerate() {
            let near = (a - b).abs() <= 1e-9 * (1e-3 + b.abs()) || (a.is_nan() && b.is_nan());
            assert!(near, "{count} logs, number {at}: {a} {b}");
        }
        assert_eq!(own.validation.split, Split::NotTested);
        assert!(own.sweep.is_empty());
    }
}

/// Held-out logs are predicted as by the fit to the logs.
#[test]
fn held_out_logs_are_scored() {
    let study = study(4);
    let (fitted, heldout) = study.logs.split_at(3);
    let settings = &study.settings;
    let whole = calibrate(&study.robot, fitted, heldout, settings, &|_| {});
    let whole = whole.expect("a calibration");
    let plan = plan(&study.robot, fitted, settings, &|_| {})
        .expect("a plan")
        .0;
    let statistics = study.merged(&plan, 0..3);
    let own = calibrate_statistics(&statistics, heldout, settings, &|_| {}).expect("a calibration");
    assert_eq!(own.validation.split, Split::HeldoutLogs);
    for (a, b) in own
        .validation
        .moving
        .joints
        .iter()
        .zip(&whole.validation.moving.joints)
    {
        assert_eq!(a.joint, b.joint);
        assert!(
            (a.rmse_calibrated / b.rmse_calibrated - 1.0).abs() < 1e-9,
            "{a:?} {b:?}"
        );
    }
    assert_eq!(own.logs.len(), whole.logs.len());
}

/// The same bits for any split of the set of logs and any order of merging.
#[test]
fn the_order_of_merging_changes_no_bit() {
    let study = study(5);
    let plan = study.plan();
    let sum = study.merged(&plan, 0..5);
    assert_eq!(study.merged(&plan, [3, 0, 4, 2, 1]), sum);
    let mut halves = study.merged(&plan, [4, 1]);
    halves
        .try_merge(&study.merged(&plan, [2, 3, 0]))
        .expect("the same plan");
    assert_eq!(halves, sum);
    assert_eq!(
        sum.log_names().collect::<Vec<_>>(),
        ["log0", "log1", "log2", "log3", "log4"]
    );
}

/// Header and records give the statistics back, to the last bit.
#[test]
fn records_hold_everything() {
    let study = study(2);
    let sum = study.merged(&study.plan(), 0..2);
    let mut back = FromTables::new(sum.header()).expect("the same version");
    let tables = sum.tables().collect::<Vec<_>>().into_iter().rev();
    tables.for_each(|table| back.add(table).expect("a table"));
    let back = back.finish().expect("statistics");
    assert_eq!(back, sum);
}

#[track_caller]
fn refused<T>(result: Result<T, Error>, words: &str) {
    let Err(error) = result else {
        panic!("was taken");
    };
    let text = error.to_string();
    assert!(text.contains(words), "{text}");
}

#[test]
fn what_does_not_belong_together_is_refused() {
    let study = study(3);
    let plan = study.plan();
    let sum = study.merged(&plan, 0..2);
    let third = study.statistics(&plan, 2);
    let with = |change: &dyn Fn(&mut Statistics)| {
        let mut other = third.clone();
        change(&mut other);
        sum.clone().try_merge(&other)
    };
    assert!(with(&|_| ()).is_ok());
    refused(
        with(&|other| other.plan.version += 1),
        "version 3 of the plan",
    );
    refused(
        with(&|other| other.plan.pipeline.cutoff_hz *= 2.0),
        "another plan",
    );
    refused(
        with(&|other| other.robot_name = "other".into()),
        "of robot `other`",
    );
    refused(
        with(&|other| other.robot = two_link::arm(2.1).expect("an arm")),
        "of another model file than the others",
    );
    let mut exchanged = study.robot.description().clone();
    exchanged.joints.swap(0, 1);
    let exchanged = Robot::new(exchanged, &Default::default()).expect("an arm");
    refused(
        with(&|other| other.robot = exchanged.0.clone()),
        "with joints `elbow`, `shoulder`, the others with `shoulder`, `elbow`, in this order",
    );
    let mut twice = sum.clone();
    refused(
        twice.try_merge(&study.statistics(&plan, 1)),
        "log `log1` is there twice",
    );
    assert_eq!(twice, sum);
    let mut renamed = study.logs[1].clone();
    renamed.name = "other".into();
    let renamed = Statistics::of(("arm", &study.robot), &plan, &Log::from(&renamed), "");
    refused(
        twice.try_merge(&renamed.expect("statistics")),
        "log `other` is log `log1` under another name",
    );
    // Stamps since 1970 that overlap.
    let late = |number: usize, shift: f64| {
        let mut log = study.logs[number].clone();
        log.time.iter_mut().for_each(|time| *time += 1.7e9 + shift);
        Statistics::of(("arm", &study.robot), &plan, &Log::from(&log), "").expect("statistics")
    };
    refused(late(0, 0.0).try_merge(&late(1, 3.0)), "overlap in time by");
    assert!(late(0, 0.0).try_merge(&late(1, 3600.0)).is_ok());
}

/// What a log says of itself is kept with its statistics: torque with the other sign on one joint forbids a "Yes" from them too.
#[test]
fn what_is_wrong_with_a_log_stays_with_it() {
    let study = study(3);
    let plan = study.plan();
    let mut wrong = study.logs[2].clone();
    wrong.joints[1]
        .tau
        .iter_mut()
        .flatten()
        .for_each(|tau| *tau = -*tau);
    let wrong = Statistics::of(("arm", &study.robot), &plan, &Log::from(&wrong), "");
    let note = Finding::new(
        Severity::Degraded,
        Code::NotFiniteRows,
        "log2",
        "half of it",
        7,
    );
    let wrong = wrong
        .expect("statistics")
        .with_reading(String::new(), vec![note.clone()]);
    let mut sum = study.merged(&plan, 0..2);
    sum.try_merge(&wrong).expect("the same plan");
    let none: &[Recording] = &[];
    let fit = calibrate_statistics(&sum, none, &study.settings, &|_| {}).expect("a calibration");
    assert!(fit.findings.contains(&note));
    let mistakes: Vec<_> = fit.findings.iter().filter_map(Finding::mistake).collect();
    assert!(!mistakes.is_empty(), "{:?}", fit.findings);
}

/// A payload that acts in some logs only is one of the plan's logs or none.
#[test]
fn an_unknown_payload_has_to_be_in_the_plan() {
    let study = study(2);
    let plan = study.plan();
    let mut carries = study.logs[1].clone();
    carries.payload = Payload::Unknown;
    let own = Statistics::of(("arm", &study.robot), &plan, &Log::from(&carries), "");
    refused(
        own,
        "carries something unknown, which no log of the plan did",
    );
}

#[test]
fn damaged_tables_and_odd_logs_are_refused() {
    let study = study(4);
    let plan = study.plan();
    let sum = study.merged(&plan, 0..2);
    let with = |change: &dyn Fn(&mut Vec<Record>)| {
        let mut tables = FromTables::new(sum.header())?;
        for mut table in sum.tables() {
            if table.header.name() == "log0" {
                change(&mut table.records);
            }
            tables.add(table)?;
        }
        tables.finish()
    };
    refused(
        with(&|all| drop(all.remove(5))),
        "the table of log `log0` has no",
    );
    refused(with(&|all| all[5].joint = 7), "has no");
    refused(
        with(&|all| all.push(all[0].clone())),
        "holds a record twice",
    );
    refused(
        with(&|all| all[0].values[0] = f64::NAN),
        "numbers that are none",
    );
    refused(with(&|all| all[0].values.push(1.0)), "of another size");
    let with_states = |all: &mut Vec<Record>| {
        let mut states = all.iter_mut().rev();
        let own = states.find(|own| own.quantity == Quantity::Velocities);
        own.expect("velocities").values.push(1.0);
    };
    refused(with(&with_states), "another number of states");
    let more = |all: &mut Vec<Record>| {
        let mut more = all[0].clone();
        more.block = 77;
        all.push(more);
    };
    refused(with(&more), "more records than its header says");
    let mut twice = FromTables::new(sum.header()).expect("the same version");
    for table in sum.tables().chain(sum.tables()) {
        twice.add(table).expect("a table");
    }
    refused(twice.finish(), "log `log0` is there twice");
    assert_eq!(Quantity::of_name("power"), Some(Quantity::Power));
    let none: &[Recording] = &[];
    // Rows are weighed one by one.
    let mut robust = study.settings.clone();
    robust.noise.robust = true;
    let fit = calibrate_statistics(&sum, none, &robust, &|_| {});
    refused(fit.map_err(Error::from), "weigh rows one by one");
}

/// A plan is of one robot; another model file has other columns and other joints.
#[test]
fn a_plan_is_of_one_robot() {
    let study = study(1);
    let plan = study.plan();
    let log = Log::from(&study.logs[0]);
    let heavier = two_link::arm(2.1).expect("an arm");
    let own = Statistics::of(("arm", &heavier), &plan, &log, "");
    refused(own, "made for another robot or model file than this one");
}

/// Whatever stands in a plan's file, it is read or refused: no filter is made of it that no memory holds, and nothing indexes beyond a list.
#[test]
fn odd_numbers_in_a_plan_are_refused() {
    let study = study(1);
    let plan = serde_json::to_value(study.plan()).expect("JSON");
    let keys = [
        "cutoff_hz",
        "motion_cutoff_hz",
        "rate_hz",
        "motion_interval",
        "coulomb_velocity",
        "standstill_velocity",
        "derived_from",
        "velocity_from",
        "corrections",
        "history",
    ];
    let odd = ["0", "-1", "1e-9", "1e12", "[]"];
    let used = |place: [&str; 2], value: &str| {
        let mut plan = plan.clone();
        plan[place[0]][place[1]] = serde_json::from_str(value).expect("JSON");
        let Ok(plan) = serde_json::from_value::<Plan>(plan) else {
            return false;
        };
        let log = Log::from(&study.logs[0]);
        Statistics::of(("arm", &study.robot), &plan, &log, "").is_ok()
    };
    let mut taken = Vec::new();
    for (key, value) in keys.iter().flat_map(|key| odd.map(|value| (*key, value))) {
        if used(["pipeline", key], value) {
            taken.push((key, value));
        }
    }
    let harmless = [
        ("motion_interval", "0"),
        ("motion_interval", "1e-9"),
        ("velocity_from", "[]"),
        ("corrections", "[]"),
        ("history", "[]"),
    ];
    assert_eq!(taken, harmless);
    let odd = odd.map(|value| ("coulomb_velocity", value));
    let unknown = [
        ("payload_frame", r#""nowhere""#),
        ("ripple", r#"{"nowhere": 3.0}"#),
        ("linearised_at", r#"{"nowhere": 3.0}"#),
    ];
    for (key, value) in odd.into_iter().chain(unknown) {
        assert!(!used(["library", key], value), "library.{key} = {value}");
    }
    assert!(used(["library", "ripple"], r#"{"elbow": 3.0}"#));
    let mut narrow = study.plan();
    narrow.pipeline.cutoff_hz = 1e-9;
    narrow.pipeline.motion_cutoff_hz = 4e-9;
    let log = Log::from(&study.logs[0]);
    let own = Statistics::of(("arm", &study.robot), &narrow, &log, "");
    refused(own, "pipeline.cutoff_hz = 1e-9");
}

/// A log of another unit is refused by what the model says of it.
#[test]
fn torque_of_another_unit_is_refused_with_its_log() {
    let study = study(1);
    let plan = study.plan();
    let of = |joints: std::ops::Range<usize>| {
        let mut loud = study.logs[0].clone();
        for joint in &mut loud.joints[joints] {
            joint.tau.iter_mut().flatten().for_each(|tau| *tau *= 1e6);
        }
        Statistics::of(("arm", &study.robot), &plan, &Log::from(&loud), "")
    };
    refused(of(0..2), "log `log0`: the torque of");
    // The model may have a wrong mass behind a single joint: that is a finding.
    assert!(of(0..1).is_ok() && of(1..2).is_ok());
}

/// A held-out log that is a fitted one, cut and rounded, is named; one of the same hours is refused.
#[test]
fn a_held_out_copy_is_named() {
    let study = study(3);
    let plan = study.plan();
    let sum = study.merged(&plan, 0..2);
    let copies = |heldout: &Recording| -> Result<Vec<String>, Error> {
        let heldout = std::slice::from_ref(heldout);
        let fit = calibrate_statistics(&sum, heldout, &study.settings, &|_| {})?;
        let copied = fit.findings.into_iter();
        let copied = copied.filter(|finding| finding.code == Code::CopiedLog);
        Ok(copied.map(|finding| finding.subject).collect())
    };
    assert_eq!(copies(&study.logs[2]).expect("a calibration"), [""; 0]);
    let mut copy = study.logs[1].clone();
    copy.name = "other".into();
    copy.time.drain(..150);
    for joint in &mut copy.joints {
        joint.q.drain(..150);
        for channel in [&mut joint.qd, &mut joint.qdd, &mut joint.tau] {
            channel.as_mut().expect("all channels").drain(..150);
        }
        let tau = joint.tau.iter_mut().flatten();
        tau.for_each(|tau| *tau = (*tau * 1000.0).round() / 1000.0);
    }
    assert_eq!(copies(&copy).expect("a calibration"), ["other"]);
    let late = |log: &Recording, name: &str| {
        let mut log = log.clone();
        log.name = name.into();
        log.time.iter_mut().for_each(|time| *time += 1.7e9);
        log
    };
    let fitted = Statistics::of(
        ("arm", &study.robot),
        &plan,
        &Log::from(&late(&study.logs[0], "log0")),
        "",
    );
    let heldout = late(&study.logs[2], "log2");
    let fit = calibrate_statistics(
        &fitted.expect("statistics"),
        std::slice::from_ref(&heldout),
        &study.settings,
        &|_| {},
    );
    refused(fit.map_err(Error::from), "overlap in time by");
}

/// Torque of a log that the others contradict is named with the same factor as by a fit to the logs, fitted or held out: the coefficient of a good log
/// passes 12 standard deviations with probability below 1e-12.
#[test]
fn a_log_whose_torque_is_scaled_is_named_as_by_the_fit_to_the_logs() {
    let plan = study(4).plan();
    for odd in [None, Some(1), Some(3)] {
        let mut study = study(4);
        if let Some(odd) = odd {
            for joint in &mut study.logs[odd].joints {
                let tau = joint.tau.iter_mut().flatten();
                tau.for_each(|tau| *tau *= 1.4);
            }
        }
        let (fitted, heldout) = study.logs.split_at(3);
        let settings = &study.settings;
        let sum = study.merged(&plan, 0..3);
        let own = calibrate_statistics(&sum, heldout, settings, &|_| {});
        let whole = calibrate(&study.robot, fitted, heldout, settings, &|_| {});
        // A fit to one such log may be refused: what was found says why.
        let of_torque = |fit: std::result::Result<Calibration, Stopped>| -> Vec<Finding> {
            let findings = fit.map_or_else(|stopped| stopped.findings, |fit| fit.findings);
            let odd = [Code::LogTorqueFactor, Code::JointTorqueFactor];
            let all = findings.into_iter();
            all.filter(|own| odd.contains(&own.code)).collect()
        };
        let (own, whole) = (of_torque(own), of_torque(whole));
        assert_eq!(own, whole);
        let named: Vec<&str> = own.iter().map(|own| own.subject.as_str()).collect();
        let expected = odd.map(|log| format!("log{log}"));
        assert_eq!(
            named,
            expected.iter().map(String::as_str).collect::<Vec<_>>()
        );
    }
}
