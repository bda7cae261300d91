//! Kept rows are what they were made of.

use super::*;
use crate::signal::{Channels, Payload};

fn temperatures(time: &[f64], logged: &[f64]) -> Vec<f64> {
    let mut observations = Observations {
        time: vec![-1.0, 0.0, 0.5, 1.5, 3.0],
        joints: vec![JointObservations::default()],
        ..Observations::default()
    };
    let len = time.len();
    observations.set_temperatures(&Recording {
        unfolded: false,
        start_ns: 0,
        name: "run".into(),
        time: time.to_vec(),
        joints: vec![Channels {
            q: vec![0.0; len],
            qd: None,
            qdd: None,
            tau: None,
            temperature: Some(logged.to_vec()),
        }],
        payload: Payload::None,
    });
    observations.joints.remove(0).temperature
}

#[test]
fn temperatures_are_linear_between_samples_that_are_numbers() {
    let found = temperatures(&[0.0, 1.0, 1.2, 2.0], &[30.0, 40.0, f64::NAN, 60.0]);
    assert_eq!(found, [30.0, 30.0, 35.0, 50.0, 60.0]);
    assert!(temperatures(&[0.0, 1.0], &[f64::NAN; 2]).is_empty());
}

#[test]
fn a_log_whose_stamps_step_back_has_no_temperatures() {
    assert!(temperatures(&[0.0, 1.0, 0.9, 2.0], &[30.0, 40.0, 41.0, 60.0]).is_empty());
    // A step between samples without a number binds nobody.
    let hidden = temperatures(&[0.0, 1.0, 0.9, 2.0], &[30.0, 40.0, f64::NAN, 60.0]);
    assert_eq!(hidden, [30.0, 30.0, 35.0, 50.0, 60.0]);
}

/// 600 rows of one joint in two segments as parts, and the same as columns; some stand still, some count less.
fn parts_and_columns() -> [Observations; 2] {
    let (len, count) = (600, 4);
    let number = |i: usize| (1.0 + 0.37 * (i as f64).powf(1.3)).sin();
    let recipes = Recipes::new(
        count,
        vec![
            vec![(0, 1.0)],
            vec![(0, 2.0), (3, -1.0)],
            vec![(1, 0.5)],
            vec![(2, 1.0), (0, 0.25)],
            vec![(0, 2.0), (3, -1.0)],
        ],
    );
    let x: Vec<f64> = (0..count * len).map(number).collect();
    let mut columns = Vec::new();
    recipes.combine(&x, len, len, &mut columns);
    let of = |x: Vec<f64>, recipes: Option<Arc<Recipes>>| Observations {
        time: (0..len).map(|row| 0.01 * row as f64).collect(),
        starts: vec![0, 250],
        joints: vec![JointObservations {
            columns: vec![0, 2, 3, 5, 6],
            x,
            recipes,
            measured: vec![0.0; len].into(),
            nominal: vec![0.0; len].into(),
            y: (0..len).map(|row| number(7000 + row)).collect(),
            standstill: (0..len).map(|row| row % 50 == 3).collect(),
            weight: (0..len).map(|row| 1.0 / (1 + row % 3) as f64).collect(),
            ..JointObservations::default()
        }],
        q: vec![vec![0.0; len].into()],
        qd: vec![vec![0.0; len].into()],
        qdd: vec![vec![0.0; len].into()],
        ..Observations::default()
    };
    [of(x, Some(Arc::new(recipes))), of(columns, None)]
}

fn close(a: &[f64], b: &[f64], what: &str) {
    assert_eq!(a.len(), b.len(), "{what}");
    let size = b.iter().fold(1e-300_f64, |m, x| m.max(x.abs()));
    for (a, b) in a.iter().zip(b) {
        assert!((a - b).abs() < 1e-13 * size, "{what}: {a} {b}");
    }
}

/// What is asked of rows is the same whether they are kept as parts or as columns, before and after columns are dropped.
#[test]
fn rows_of_parts_answer_as_rows_of_columns() {
    let [mut parts, mut columns] = parts_and_columns();
    for (dropped, signals) in [(vec![], 4), (vec![3, 5], 2)] {
        parts.drop_columns(&dropped);
        columns.drop_columns(&dropped);
        assert_eq!(parts.joints[0].columns, columns.joints[0].columns);
        assert_eq!(parts.joints[0].signals(), signals);
        let beta: Vec<f64> = (0..7).map(|k| 0.3 + k as f64).collect();
        let covariance: Vec<f64> = (0..49)
            .map(|at| 1.0 / (1 + at / 7 + at % 7) as f64)
            .collect();
        for (a, b) in parts.cut(3).iter().zip(&columns.cut(3)) {
            close(
                &a.residual(0, &beta, a.rows.clone()),
                &b.residual(0, &beta, b.rows.clone()),
                "residual",
            );
            close(
                &a.quadratic_forms(0, &covariance, 7),
                &b.quadratic_forms(0, &covariance, 7),
                "quadratic forms",
            );
            let (a, b) = (a.gram(), b.gram());
            assert_eq!(a.joints[0].columns, b.joints[0].columns);
            assert_eq!(a.joints[0].n.to_bits(), b.joints[0].n.to_bits());
            close(&a.joints[0].s0.values, &b.joints[0].s0.values, "sums");
            close(&a.joints[0].d.values, &b.joints[0].d.values, "differences");
        }
        let blocks = |rows: &Observations| {
            let mut all = Vec::new();
            rows.visit_since(2.0, &mut |block| {
                let joint = &block.joints[0];
                assert!(joint.recipes.is_none());
                for row in 0..block.len {
                    let columns = 0..joint.columns.len();
                    all.extend(columns.map(|i| joint.x[i * joint.stride + row]));
                }
            });
            all
        };
        assert_eq!(
            blocks(&columns).len(),
            400 * columns.joints[0].columns.len()
        );
        close(&blocks(&parts), &blocks(&columns), "blocks");
    }
}
