//! Up to twelve logs are left out one by one, more in five groups of logs that follow each other: every one is predicted once.

use crate::two_link;
use twincal::calibrate::{CalibrationSettings, calibrate};
use twincal::random::Random;
use twincal::signal::{Auto, Recording};
use twincal::term::Family;
use twincal::validate::{Split, Validation};

fn validation(count: u32) -> Validation {
    let (nominal, real) = (two_link::arm(2.0), two_link::arm(2.6));
    let (nominal, real) = (nominal.expect("an arm"), real.expect("an arm"));
    let mut noise = Random::new(3, 0);
    let log = |number: u32| -> Recording {
        let name = format!("log {number:02}");
        let mut log = two_link::log(&name, 0.17 * f64::from(number), &real, &mut noise);
        log.time.truncate(100);
        for joint in &mut log.joints {
            joint.q.truncate(100);
            let others = [&mut joint.qd, &mut joint.qdd, &mut joint.tau];
            others
                .into_iter()
                .flatten()
                .for_each(|channel| channel.truncate(100));
        }
        log
    };
    let logs: Vec<Recording> = (0..count).map(log).collect();
    let mut settings = CalibrationSettings::default();
    settings.library.terms = vec!["sin(q1 - q2)".into()];
    settings.library.families = vec![Family::Payload];
    settings.signal.cutoff_hz = Auto::Value(0.0);
    let nobody: [Recording; 0] = [];
    let result = calibrate(&nominal, &logs[..], &nobody[..], &settings, &|_| {});
    result.expect("a calibration").validation
}

#[test]
fn every_log_is_predicted_once_by_twins_that_do_not_know_it() {
    for (count, split) in [(12, Split::LeaveOneLogOut), (13, Split::LeaveLogGroupsOut)] {
        let validation = validation(count);
        assert_eq!(validation.split, split);
        let logs: Vec<&str> = validation
            .traces
            .iter()
            .map(|trace| trace.log.as_str())
            .collect();
        let wanted: Vec<String> = (0..count)
            .flat_map(|n| [n, n])
            .map(|n| format!("log {n:02}"))
            .collect();
        assert_eq!(logs, wanted);
        assert_eq!(validation.filtered.joints[0].rows, u64::from(count) * 100);
        // Noise has 0.1 N·m; 1200 rows: within 5 % of it by 2.4 sd, and no better than it.
        let rmse = validation.filtered.rmse_calibrated;
        assert!((0.093..0.108).contains(&rmse), "{rmse}");
    }
}
