//! The program that is exported computes what predictions of a filtered twin are, on the same motion.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use std::path::{Path, PathBuf};
use twincal::calibrate::{CalibrationSettings, calibrate};
use twincal::evaluator::Evaluator;
use twincal::rows::{RowBlock, RowSignal, visit_rows};
use twincal::signal::Recording;
use twincal::term::{Family, LibrarySettings};
use twincal::twin::{JointTorque, TorqueSignal, Twin};
use twincal_io::config::Config;
use twincal_io::log::read_log;
use twincal_io::model::{ModelSettings, read_model};

fn asset(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../twincal-cli/assets");
    folder.join(name)
}

/// With the filter on, rows as logged: torque to 1e-9, both ends of the interval within 5 % of its width, the same flags.
#[test]
fn steps_are_the_prediction_on_filtered_motion() {
    let (twin, heldout) = twin_of_every_family();
    let evaluator = Evaluator::new(&twin, None).unwrap();
    let library = twin.library().unwrap();
    let predictor = twin.predictor(&library).unwrap();
    assert!(!twin.pipeline.is_off());
    let (trajectory, _) = twin.align(&heldout).unwrap();
    let (mut rows, mut same) = (0, 0);
    visit_rows(
        &twin.robot,
        &library,
        &twin.pipeline,
        &trajectory,
        RowSignal::Raw,
        &mut |block| {
            let torques = predictor.block(block, TorqueSignal::Raw);
            for row in 0..block.len {
                let outside = compare_row(&evaluator, block, &torques, row);
                rows += 1;
                same +=
                    usize::from(outside == torques.iter().any(|torque| torque.extrapolating[row]));
            }
            Ok(())
        },
    )
    .unwrap();
    assert!(
        rows > 1000 && same as f64 > 0.998 * rows as f64,
        "{same} of {rows}"
    );
}

/// A twin with every family, those with derivatives of the nominal torque too, and its held-out log.
fn twin_of_every_family() -> (Twin, Recording) {
    let model = read_model(&asset("arm.urdf"), &ModelSettings::default()).unwrap();
    let (robot, _) = model.robot(&Default::default()).unwrap();
    let options = Config::default().settings().unwrap().log;
    let read = |name: &str| {
        let path = asset(name);
        read_log(&path, &robot, &options.options(&path)).unwrap().0
    };
    let settings = CalibrationSettings {
        library: LibrarySettings {
            families: Family::NAMED.to_vec(),
            generic: Some(true),
            terms: vec!["exp(-q2^2)*qd1^2".into()],
            nonnegative: true,
            ..LibrarySettings::default()
        },
        ..CalibrationSettings::default()
    };
    let heldout = [read("heldout1.parquet")];
    let result = calibrate(
        &robot,
        &[read("train1.parquet")],
        &heldout,
        &settings,
        &|_| {},
    )
    .unwrap();
    let [heldout] = heldout;
    (result.twin, heldout)
}

/// Compares the steps of one row with its prediction; true where the program finds the state outside of the data.
fn compare_row(
    evaluator: &Evaluator,
    block: &RowBlock<'_>,
    torques: &[JointTorque],
    row: usize,
) -> bool {
    let at = |values: &[f64]| [values[row], values[block.len + row]];
    let (q, qd, qdd) = (at(block.q), at(block.qd), at(block.qdd));
    let (tau, variance) = evaluator.evaluate(&q, &qd, &qdd);
    let mut outside = false;
    for (j, joint) in evaluator.joints.iter().enumerate() {
        let torque = &torques[j];
        assert!(
            (tau[j] - torque.calibrated[row]).abs() < 1e-9,
            "row {row} joint {j}: {} {}",
            tau[j],
            torque.calibrated[row]
        );
        let state = [q[j], qd[j], qdd[j]];
        outside |= variance[j] > joint.noise;
        outside |=
            (0..3).any(|k| state[k] < joint.limits[2 * k] || state[k] > joint.limits[2 * k + 1]);
        if block.joints[j].standstill[row] {
            continue;
        }
        let half =
            evaluator.quantile * (evaluator.ratio * variance[j].max(0.0) + joint.base).sqrt();
        let width = torque.high[row] - torque.low[row];
        assert!(
            (tau[j] + half - torque.high[row]).abs() < 0.05 * width,
            "row {row} joint {j}"
        );
        assert!(
            (tau[j] - half - torque.low[row]).abs() < 0.05 * width,
            "row {row} joint {j}"
        );
    }
    outside
}
