//! Stretches of a log beside the sums over its rows.

use super::*;
use crate::gram::Symmetric;
use crate::observations::{JointObservations, Observations};
use crate::random::Random;
use crate::term::Recipes;
use std::sync::Arc;

const ROWS: usize = 437;

/// Two columns made of three signals, pauses, a second segment, and weights.
fn log(seed: u64, name: &str) -> Observations {
    let mut random = Random::new(seed, 0);
    let recipes = Recipes::new(3, vec![vec![(0, 2.0), (2, -0.5)], vec![(1, 1.0)]]);
    let signals: Vec<f64> = (0..3 * ROWS).map(|_| random.normal()).collect();
    let y: Vec<f64> = (0..ROWS).map(|_| random.normal()).collect();
    Observations {
        log: name.into(),
        cutoff: 0.1,
        time: (0..ROWS).map(|row| row as f64).collect(),
        starts: vec![0, 100],
        q: vec![
            (0..ROWS)
                .map(|row| (0.01 * row as f64).sin())
                .collect::<Vec<_>>()
                .into(),
        ],
        qd: vec![
            (0..ROWS)
                .map(|row| (0.01 * row as f64).cos())
                .collect::<Vec<_>>()
                .into(),
        ],
        qdd: vec![vec![0.0; ROWS].into()],
        joints: vec![JointObservations {
            columns: vec![4, 7],
            recipes: Some(Arc::new(recipes)),
            x: signals,
            measured: y.clone().into(),
            nominal: vec![0.0; ROWS].into(),
            y,
            standstill: (0..ROWS).map(|row| row % 61 == 5).collect(),
            weight: (0..ROWS).map(|row| 0.5 + (row % 3) as f64).collect(),
            ..JointObservations::default()
        }],
    }
}

fn near(a: &Symmetric, b: &Symmetric) {
    assert_eq!(a.size, b.size);
    for (a, b) in a.values.iter().zip(&b.values) {
        assert!((a - b).abs() < 1e-10 * (1.0 + b.abs()), "{a} {b}");
    }
}

/// All stretches together are the uncut log, differences over the cuts and ends of runs too; stretches apart are their rows.
#[test]
fn stretches_add_to_the_uncut_log() {
    let log = log(1, "log");
    let parts = [log.whole()];
    let sums = Sums::of(&parts, Runs::Joined, Purpose::Result);
    let (own, whole) = (sums.total().gram, log.whole().gram());
    let (own, whole) = (&own.joints[0], &whole.joints[0]);
    assert_eq!(
        (&own.columns, own.n, own.starts),
        (&whole.columns, whole.n, whole.starts)
    );
    near(&own.s0, &whole.s0);
    near(&own.d, &whole.d);
    near(&own.first, &whole.first);
    near(&own.last, &whole.last);
    for block in 0..BLOCKS {
        let place = (0, block..block + 1);
        let unit = sums.unit(std::slice::from_ref(&place));
        let rows = rows_of(&parts, place);
        let (own, truth) = (&unit.gram.joints[0], &rows[0].gram().joints[0]);
        assert_eq!(own.n, truth.n);
        near(&own.s0, &truth.s0);
        let torque: f64 = log.joints[0].y[rows[0].rows.clone()]
            .iter()
            .map(|y| y * y)
            .sum();
        assert!((unit.joints[0].torque / torque - 1.0).abs() < 1e-12);
    }
    assert_eq!(sums.rows(), ROWS);
}

/// Units hold every row once, and are fifths of one or two logs, or groups of many.
#[test]
fn units_hold_every_row_once() {
    let logs: Vec<Observations> = (0..45)
        .map(|seed| log(seed, &format!("{seed:02}")))
        .collect();
    for (count, units) in [(1, 5), (2, 5), (4, 4), (5, 5), (45, 6)] {
        let parts: Vec<Part<'_>> = logs[..count].iter().map(Observations::whole).collect();
        let training = Training::new(&Sums::of(&parts, Runs::Apart, Purpose::Result));
        assert_eq!(training.units.len(), units);
        let alone = Training::new(&Sums::of(&parts, Runs::Apart, Purpose::Fit));
        for (unit, own) in training.units.iter().zip(&alone.units) {
            near(&unit.gram.joints[0].s0, &own.gram.joints[0].s0);
            for decoy in 0..unit.joints[0].decoys.count() {
                let square = |unit: &Unit| unit.joints[0].decoys.square(decoy);
                assert!((square(unit) / square(own) - 1.0).abs() < 1e-12);
            }
        }
        let rows = rows_of_units(&parts);
        for (unit, rows) in training.units.iter().zip(&rows) {
            let truth: Gram = rows.iter().collect();
            near(&unit.gram.joints[0].s0, &truth.joints[0].s0);
        }
        let all: usize = rows.iter().flatten().map(|part| part.rows.len()).sum();
        assert_eq!(all, count * ROWS);
    }
}

/// Logs count in the order of their names: the same bits in whatever order they come.
#[test]
fn the_order_of_logs_changes_no_bit() {
    let mut logs: Vec<Observations> = (0..5)
        .map(|seed| log(seed, &format!("log{seed}")))
        .collect();
    let of = |logs: &[Observations]| {
        let parts: Vec<Part<'_>> = logs.iter().map(Observations::whole).collect();
        Training::new(&Sums::of(&parts, Runs::Apart, Purpose::Result)).units
    };
    let in_order = of(&logs);
    logs.swap(0, 3);
    logs.swap(2, 4);
    assert!(of(&logs) == in_order);
}

/// What was left out of a unit's squares and of the epistemic variance is what rows say, one by one.
#[test]
fn left_out_squares_are_those_of_rows() {
    let log = log(3, "log");
    let unit = Sums::of(&[log.whole()], Runs::Apart, Purpose::Result).total();
    let gram = &unit.gram.joints[0];
    let beta = [0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0, -1.2];
    let own = residual_form(&gram.s0, &of_joint(gram, &beta));
    let residual = log.whole().residual(0, &beta, 0..ROWS);
    let joint = &log.joints[0];
    let moving = (0..ROWS).filter(|row| !joint.standstill[*row]);
    let truth: f64 = moving
        .map(|row| joint.weight[row] * residual[row].powi(2))
        .sum();
    assert!((own / truth - 1.0).abs() < 1e-12, "{own} {truth}");
}

/// Both are sums over the same rows.
fn alike(own: &Sums, other: &Sums) {
    assert_eq!(own.rows(), other.rows());
    let (ours, theirs) = (own.total(), other.total());
    let [ours, theirs] = [&ours, &theirs].map(|of| (&of.gram.joints[0], &of.joints[0]));
    assert_eq!(ours.0.n, theirs.0.n);
    near(&ours.0.s0, &theirs.0.s0);
    near(&ours.0.d, &theirs.0.d);
    assert!((ours.1.torque / theirs.1.torque - 1.0).abs() < 1e-12);
    assert_eq!(ours.1.decoys.count(), theirs.1.decoys.count());
    for decoy in 0..ours.1.decoys.count() {
        let [ours, theirs] = [ours, theirs].map(|of| of.1.decoys.square(decoy));
        assert!((ours / theirs - 1.0).abs() < 1e-12, "{ours} {theirs}");
    }
    let time =
        |of: &Sums| of.spectra[0].autocorrelation_time(&[0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0, -1.2]);
    let (ours, theirs) = (time(own), time(other));
    assert!(
        (ours - theirs).abs() < 1e-9 * (1.0 + theirs),
        "{ours} {theirs}"
    );
}

/// Logs of a group that are added up together are those that are added one by one.
#[test]
fn logs_together_are_those_one_by_one() {
    let logs: Vec<Observations> = (0..90)
        .map(|seed| log(seed, &format!("{seed:02}")))
        .collect();
    let parts: Vec<Part<'_>> = logs.iter().map(Observations::whole).collect();
    for runs in [Runs::Apart, Runs::Joined] {
        let together = Sums::of(&parts, runs, Purpose::Result);
        let mut one_by_one = Sums::empty(runs, (parts.len(), Purpose::Result));
        let stretches = one_by_one.stretches();
        for part in &parts {
            one_by_one.add(&LogSums::of(&[part], stretches, runs));
        }
        assert_eq!(together.groups(), one_by_one.groups());
        for group in 0..together.groups() {
            let [ours, theirs] =
                [&together, &one_by_one].map(|of| of.unit(&[(group, 0..BLOCKS)]).gram);
            near(&ours.joints[0].s0, &theirs.joints[0].s0);
        }
        alike(&together, &one_by_one);
    }
}

/// All sets but one are their logs.
#[test]
fn a_set_that_is_left_out_leaves_the_logs_of_the_others() {
    let logs: Vec<Observations> = (0..23)
        .map(|seed| log(seed, &format!("{seed:02}")))
        .collect();
    let set = |out: usize| logs.iter().skip(out).step_by(5).map(Observations::whole);
    let sets: Vec<Vec<Part<'_>>> = (0..5).map(|out| set(out).collect()).collect();
    for runs in [Runs::Apart, Runs::Joined] {
        let sums = Sums::of_sets(&sets, runs, Purpose::Fit);
        for out in 0..sets.len() {
            let others = (0..sets.len()).filter(|of| *of != out);
            let others: Vec<Part<'_>> = others.flat_map(set).collect();
            alike(
                &Sums::without(&sums, out),
                &Sums::of(&others, runs, Purpose::Fit),
            );
        }
    }
}
