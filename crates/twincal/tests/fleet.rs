//! Fleets: the arm that changes is named with its size and its window, and bad input leaves the answers of the others as they are.

use crate::two_link;
use twincal::Error;
use twincal::calibrate::{
    About, Calibration, CalibrationSettings, Plan, Statistics, Status, plan_about,
};
use twincal::fleet::{Fleet, FleetResult, FleetSettings, Reason};
use twincal::prelude::*;
use twincal::random::Random;

const UNITS: usize = 7;
const WEEKS: usize = 3;
const WEEK: f64 = 7.0 * 86_400.0;
/// A Monday, s since 1970.
const START: f64 = 1_767_571_200.0;

/// kg at the tip that all arms have beyond the model, and that the last one gains in the second week.
const TYPE: f64 = 0.6;
const GAIN: f64 = 0.25;

struct Study {
    nominal: Robot,
    settings: CalibrationSettings,
    plan: Plan,
    /// Unit by unit, week by week.
    logs: Vec<Vec<Recording>>,
}

fn log_of(unit: usize, week: usize, noise: &mut Random) -> Recording {
    let scatter = 0.01 * (unit as f64 - 3.0);
    let gained = if unit + 1 == UNITS && week > 0 {
        GAIN
    } else {
        0.0
    };
    let real = two_link::arm(2.0 + TYPE + scatter + gained).expect("an arm");
    let name = format!("unit{unit}-week{week}");
    let phase = 0.3 + 0.7 * unit as f64 + 0.9 * week as f64;
    let mut log = two_link::log(&name, phase, &real, noise);
    log.start_ns = ((START + WEEK * week as f64 + 3600.0 * unit as f64) * 1e9) as i64;
    log
}

fn study() -> Study {
    let nominal = two_link::arm(2.0).expect("an arm");
    let mut settings = CalibrationSettings::default();
    settings.library.families = vec![Family::Payload, Family::Viscous, Family::Coulomb];
    settings.library.terms = vec!["sin(q1 - q2)".into()];
    let mut noise = Random::new(4, 0);
    let logs: Vec<Vec<Recording>> = (0..UNITS)
        .map(|unit| {
            (0..WEEKS)
                .map(|week| log_of(unit, week, &mut noise))
                .collect()
        })
        .collect();
    let some: Vec<Recording> = logs[0].clone();
    let plan = plan_about(About::Found, &nominal, some, &settings, &|_| {})
        .expect("a plan")
        .0;
    Study {
        nominal,
        settings,
        plan,
        logs,
    }
}

impl Study {
    fn statistics(&self, unit: &str, log: &Recording) -> Statistics {
        Statistics::of((unit, &self.nominal), &self.plan, &Log::from(log), "").expect("statistics")
    }

    /// All logs but those of which `without` says yes.
    fn fleet(&self, without: impl Fn(usize, usize) -> bool) -> Fleet {
        self.added_to(Fleet::default(), without)
    }

    fn added_to(&self, mut fleet: Fleet, without: impl Fn(usize, usize) -> bool) -> Fleet {
        for (unit, logs) in self.logs.iter().enumerate() {
            for (week, log) in logs
                .iter()
                .enumerate()
                .filter(|(week, _)| !without(unit, *week))
            {
                assert!(log.name.ends_with(&format!("week{week}")));
                fleet.add(&self.statistics(&format!("unit{unit}"), log));
            }
        }
        fleet
    }

    fn fit(&self, fleet: Fleet) -> Result<FleetResult, Error> {
        let settings = FleetSettings {
            calibration: self.settings.clone(),
            draws: 100,
            ..FleetSettings::default()
        };
        fleet.fit(&settings, &|_| Ok(()))
    }
}

fn unit<'a>(result: &'a FleetResult, name: &str) -> &'a twincal::fleet::UnitSummary {
    let found = result.units.iter().find(|unit| unit.robot == name);
    found.unwrap_or_else(|| panic!("{name} is missing"))
}

/// Mean and sd of every coefficient of all units but one.
fn others(result: &FleetResult, but: &str) -> Vec<(f64, f64)> {
    let mut units: Vec<_> = result
        .units
        .iter()
        .filter(|unit| unit.robot != but)
        .collect();
    units.sort_by(|a, b| a.robot.cmp(&b.robot));
    let numbers = units.iter().flat_map(|unit| unit.mean.iter().zip(&unit.sd));
    numbers.map(|(mean, sd)| (*mean, *sd)).collect()
}

#[test]
fn the_arm_that_gained_mass_is_named_with_its_week() {
    let study = study();
    let result = study.fit(study.fleet(|_, _| false)).expect("a fleet");
    assert_eq!(result.windows.len(), WEEKS);
    assert!(result.left_out.is_empty());
    let payload = result
        .type_effects
        .iter()
        .find(|own| own.name == "payload")
        .expect("payload");
    assert!(payload.pip > 0.99, "{payload:?}");
    let mass = &payload.parameters[0];
    assert!((mass.value - TYPE).abs() < 0.05, "{mass:?}");
    let named: Vec<&str> = (result.units.iter().filter(|unit| unit.deviates))
        .map(|unit| unit.robot.as_str())
        .collect();
    assert_eq!(named, ["unit6"]);
    let own = &unit(&result, "unit6").deviations[0];
    assert_eq!(own.name, "payload");
    assert_eq!(own.since, Some(result.windows[1]));
    let gained = &own.parameters[0];
    assert!(
        gained.interval95[0] < GAIN && GAIN < gained.interval95[1],
        "{gained:?}"
    );
    assert_eq!(own.course.len(), WEEKS);
}

/// A twin has the moments that the fleet says of its robot, and nothing changes for being asked; a robot without logs is refused.
#[test]
fn twins_are_what_the_fleet_says() {
    let study = study();
    let plain = study.fit(study.fleet(|_, _| false)).expect("a fleet");
    let asked = ["unit6", "unit2"].map(String::from);
    let fleet = study.added_to(Fleet::with_twins(asked), |_, _| false);
    let result = study.fit(fleet).expect("a fleet");
    assert_eq!(result.units, plain.units);
    assert_eq!(result.type_effects, plain.type_effects);
    assert!(plain.twins.is_empty());
    let robots: Vec<&str> = (result.twins.iter())
        .map(|twin| twin.robot.as_str())
        .collect();
    assert_eq!(robots, ["unit2", "unit6"]);
    for twin in &result.twins {
        let (own, summary) = (&twin.calibration.twin, unit(&result, &twin.robot));
        assert_eq!(own.posterior.mean, summary.mean);
        for (sd, of_window) in own.posterior.sd.iter().zip(&summary.sd) {
            assert!(sd >= of_window, "a window to come scatters, too");
        }
    }
    let mass = |calibration: &Calibration| {
        let payload = calibration.components.iter().find(|c| c.name == "payload");
        let payload = payload.expect("payload");
        assert_eq!(payload.status, Status::Established);
        payload.parameters[0].mean
    };
    let of_type = result.type_twin.as_ref().expect("the twin of the type");
    for (a, b) in of_type.twin.posterior.mean.iter().zip(&result.mean) {
        assert!((a - b).abs() <= 1e-9 * b.abs(), "{a} {b}"); // the same sum in another order
    }
    assert!((mass(of_type) - TYPE).abs() < 0.05, "{}", mass(of_type));
    let changed = TYPE + 0.03 + GAIN;
    let found = mass(&result.twins[1].calibration);
    assert!((found - changed).abs() < 0.05, "{found} for {changed}");
    // Of the robot that changed only the logs since then say what its torque is like.
    assert_eq!(result.twins[1].calibration.logs.len(), WEEKS - 1);
    assert_eq!(result.twins[0].calibration.logs.len(), WEEKS);
    let nobody = study.added_to(Fleet::with_twins(["ghost".to_owned()]), |_, _| false);
    let error = study.fit(nobody).expect_err("no such robot");
    assert!(error.to_string().contains("`ghost`"), "{error}");
}

/// Whatever else is among the statistics, what is said of the other arms stays within a tenth of a standard deviation.
#[test]
fn bad_input_is_left_out_by_name_and_moves_nobody() {
    let study = study();
    let alone = study.fit(study.fleet(|_, _| false)).expect("a fleet");
    let same = |result: &FleetResult, what: &str| {
        let (own, before) = (others(result, "bad"), others(&alone, "bad"));
        assert_eq!(own.len(), before.len());
        for ((a, _), (b, sd)) in own.iter().zip(before) {
            assert!((a - b).abs() <= 0.1 * sd, "{what}: {a} and {b} ± {sd}");
        }
    };
    let mut noise = Random::new(9, 0);
    let mut strange = log_of(1, 1, &mut noise);
    strange.name = "strange".into();
    // Torque in another unit.
    let mut scaled = strange.clone();
    for joint in &mut scaled.joints {
        joint.tau.iter_mut().flatten().for_each(|tau| *tau *= 100.0);
    }
    let mut fleet = study.fleet(|_, _| false);
    fleet.add(&study.statistics("bad", &scaled));
    let result = study.fit(fleet).expect("a fleet");
    assert!(
        matches!(result.left_out[..], [ref own] if own.robot == "bad" && matches!(own.reason, Reason::Size { .. }))
    );
    same(&result, "torque");
    // The log of another arm.
    let mut fleet = study.fleet(|unit, week| unit == 2 && week == 1);
    let twice = study.logs[2][1].clone();
    fleet.add(&study.statistics("unit2", &twice));
    fleet.add(&study.statistics("bad", &twice));
    let result = study.fit(fleet).expect("a fleet");
    let names: Vec<&str> = result
        .left_out
        .iter()
        .map(|own| own.robot.as_str())
        .collect();
    assert_eq!(names, ["bad", "unit2"]);
    assert!(
        result
            .left_out
            .iter()
            .all(|own| matches!(own.reason, Reason::Twice { .. }))
    );
    // Another robot, and another plan.
    let other = two_link::arm(1.5).expect("an arm");
    let mut fleet = study.fleet(|_, _| false);
    let alike = [strange.clone()];
    let of_other = plan_about(About::Found, &other, &alike[..], &study.settings, &|_| {});
    let of_other = of_other.expect("a plan").0;
    let foreign = Statistics::of(("bad", &other), &of_other, &Log::from(&strange), "");
    fleet.add(&foreign.expect("statistics"));
    let mut plan = study.plan.clone();
    plan.library.families.pop();
    let planned = Statistics::of(("worse", &study.nominal), &plan, &Log::from(&strange), "");
    fleet.add(&planned.expect("statistics"));
    let result = study.fit(fleet).expect("a fleet");
    let reasons: Vec<&Reason> = result.left_out.iter().map(|own| &own.reason).collect();
    assert_eq!(reasons, [&Reason::OtherRobot, &Reason::OtherPlan]);
    same(&result, "robot");
}

/// A week without a log of one arm, and a clock a day off, change what is said of that arm alone.
#[test]
fn a_week_may_be_empty_and_a_clock_a_day_off() {
    let study = study();
    let result = study
        .fit(study.fleet(|unit, week| unit == 1 && week == 1))
        .expect("a fleet");
    assert_eq!(unit(&result, "unit1").logs.len(), WEEKS - 1);
    assert!(unit(&result, "unit6").deviates && !unit(&result, "unit1").deviates);
    let mut fleet = study.fleet(|unit, week| unit == 1 && week == 1);
    let mut late = study.logs[1][1].clone();
    late.start_ns += 86_400_000_000_000;
    fleet.add(&study.statistics("unit1", &late));
    let result = study.fit(fleet).expect("a fleet");
    assert!(unit(&result, "unit6").deviates && !unit(&result, "unit1").deviates);
}

#[test]
fn fewer_than_three_units_and_impossible_settings_are_refused() {
    let study = study();
    let error = study.fit(study.fleet(|unit, _| unit > 1)).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("robots with the same model and plan"),
        "{error}"
    );
    let settings = FleetSettings {
        window: 0.0,
        ..FleetSettings::default()
    };
    let error = study
        .fleet(|_, _| false)
        .fit(&settings, &|_| Ok(()))
        .unwrap_err();
    assert!(error.to_string().contains("fleet.window"), "{error}");
    let stopped = study
        .fleet(|_, _| false)
        .fit(&FleetSettings::default(), &|_| Err(Error::Cancelled));
    assert_eq!(
        stopped.unwrap_err().to_string(),
        Error::Cancelled.to_string()
    );
}
