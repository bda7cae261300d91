//! Nominal torque of the real robots' models against Pinocchio, state by state.

use std::collections::BTreeMap;
use std::path::Path;
use twincal::robot::{Motion, Robot, Workspace, inverse_dynamics, nominal_torque};
use twincal_io::model::{ModelSettings, read_model};

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");

/// Columns of a CSV with a header, `columns[c][row]`.
fn columns(path: &Path) -> Vec<Vec<f64>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let width = reader.headers().unwrap().len();
    let mut columns = vec![Vec::new(); width];
    for record in reader.records() {
        for (c, field) in record.unwrap().iter().enumerate() {
            columns[c].push(field.parse().unwrap());
        }
    }
    columns
}

/// Largest |ours − Pinocchio| of each joint relative to the joint's largest torque.
fn worst(robot: &Robot, golden: &[Vec<f64>]) -> f64 {
    let (n, len) = (robot.dof(), golden[0].len());
    assert_eq!(
        golden.len(),
        4 * n,
        "the golden file belongs to another robot"
    );
    let flat = |group: usize| golden[group * n..(group + 1) * n].concat();
    let (q, qd, qdd, expected) = (flat(0), flat(1), flat(2), flat(3));
    let mut batch = vec![0.0; n * len];
    nominal_torque(
        robot,
        Motion {
            len,
            q: &q,
            qd: &qd,
            qdd: &qdd,
        },
        &mut batch,
    );
    let mut workspace = Workspace::new(robot);
    let mut worst = 0f64;
    for sample in 0..len {
        let pick = |v: &[f64]| (0..n).map(|j| v[j * len + sample]).collect::<Vec<_>>();
        let mut one = vec![0.0; n];
        inverse_dynamics(
            robot,
            &mut workspace,
            &pick(&q),
            &pick(&qd),
            &pick(&qdd),
            &mut one,
        );
        for j in 0..n {
            let largest = expected[j * len..(j + 1) * len]
                .iter()
                .fold(0f64, |m, v| m.max(v.abs()));
            for torque in [one[j], batch[j * len + sample]] {
                worst = worst.max((torque - expected[j * len + sample]).abs() / largest.max(1e-6));
            }
        }
    }
    worst
}

#[test]
fn nominal_torque_of_real_robots_is_pinocchios() {
    // The golden files hold 12 digits of the state, which a large acceleration turns into 2e-11 of the torque.
    for (file, robots, tolerance) in [(
        "model.urdf",
        &[
            "double_pendulum",
            "kuka_kr300",
            "simple_pendulum",
            "staubli_tx40",
            "ur10",
        ][..],
        1e-10,
    )] {
        for robot in robots {
            let folder = Path::new(DATA).join(robot);
            if !folder.is_dir() {
                println!("skipped: {robot} is not there");
                continue;
            }
            let model = read_model(&folder.join(file), &ModelSettings::default()).unwrap();
            let (built, _) = Robot::new(model.description, &BTreeMap::new()).unwrap();
            let error = worst(
                &built,
                &columns(&folder.join("golden_nominal_pinocchio.csv")),
            );
            println!("{robot}/{file}: {error:.1e}");
            assert!(error < tolerance, "{robot}/{file}: {error:.1e}");
        }
    }
}
