use super::*;
use crate::random::Random;

/// 60 s at 33 rows per second, back and forth over 4 rad at changing speed, with noise of 1 whose neighbours have correlation ρ.
fn moved(rho: f64, seed: u64, ripple: impl Fn(f64) -> f64) -> Vec<Row> {
    let mut random = Random::new(seed, 0);
    let mut noise = 0.0;
    let row = |t: f64, noise: f64| {
        let [a, b] = [0.7 * t, 0.31 * t];
        let position = 1.5 * a.sin() + 0.7 * b.sin();
        Row {
            position,
            velocity: 1.5 * 0.7 * a.cos() + 0.7 * 0.31 * b.cos(),
            residual: ripple(position) + noise,
        }
    };
    (0..2000)
        .map(|i| {
            noise = rho * noise + (1.0 - rho * rho).sqrt() * random.normal();
            row(0.03 * f64::from(i), noise)
        })
        .collect()
}

#[test]
fn a_ripple_is_told_with_its_order_and_height() {
    for (order, phase) in [(16.0_f64, 0.3), (30.7, 1.0), (101.0, 2.0), (320.0, 4.0)] {
        let rows = moved(0.0, 5, |q| 1.2 * (order * q + phase).sin());
        let (found, told_apart) = strongest(rows, 1.0, 1.0, f64::INFINITY).expect("a ripple");
        assert!((told_apart - 1.0 / 4.4).abs() < 0.02, "{told_apart}");
        assert!((found.order - order).abs() < 0.05, "{order}: {found:?}");
        assert!((found.amplitude - 1.2).abs() < 0.12, "{order}: {found:?}");
        assert!((found.share - 0.72 / 1.72).abs() < 0.06, "{found:?}");
        let periods = 4.4 * order / TAU;
        for seen in [found.forwards, found.backwards] {
            assert!(
                (seen as f64 - periods).abs() < 2.0 + 0.02 * periods,
                "{periods}: {found:?}"
            );
        }
    }
    // A joint that turned round 35 times, and a slider.
    for (stretch, per) in [(50.0, 1.0), (0.2, TAU)] {
        let order = 30.7 * per;
        let mut rows = moved(0.0, 5, |_| 0.0);
        for row in &mut rows {
            row.position *= stretch;
            row.residual += 2.0 * (order * row.position).sin();
        }
        let found = strongest(rows, per, 1.0, f64::INFINITY);
        let order = found.expect("a ripple").0.order / per;
        assert!((order - 30.7).abs() < 0.05, "{stretch}: {order}");
    }
    // What the filter takes away is not looked for: 320 periods per radian at 0.1 rad/s are 5 Hz.
    let rows = moved(0.0, 5, |q| 1.2 * (320.0 * q).sin());
    assert_eq!(strongest(rows, 1.0, 1.0, 0.2), None);
}

/// Smooth errors of a model are no ripple, and noise is none in 200 logs, with memory as without: a false alarm in all of them has a
/// probability below 200 · 1800 orders · e⁻²⁵ < 1e-5.
#[test]
fn noise_and_smooth_errors_have_none() {
    for smooth in [2.0, 5.0] {
        let rows = moved(0.0, 9, |q: f64| 3.0 * (smooth * q).sin());
        assert_eq!(strongest(rows, 1.0, 1.0, f64::INFINITY), None, "{smooth}");
    }
    for seed in 0..100 {
        for rho in [0.0, 0.9] {
            let memory = (1.0 + rho) / (1.0 - rho);
            let rows = moved(rho, 100 + seed, |_| 0.0);
            let found = strongest(rows, 1.0, memory, f64::INFINITY);
            assert_eq!(found, None, "seed {seed}, correlation {rho}");
        }
    }
    assert_eq!(strongest(Vec::new(), 1.0, 1.0, 5.0), None);
    let still = [Row {
        position: 1.0,
        velocity: 0.0,
        residual: 1.0,
    }; 50];
    assert_eq!(strongest(still.to_vec(), 1.0, 1.0, 5.0), None);
}

/// What is wrong along one path, without any order, stays wrong when it is gone through 60 times: 40 steps of 0.075 rad, each of its own
/// height with an sd of twice the noise. Were every row independent, 14 of these logs would have a ripple.
#[test]
fn a_path_that_is_repeated_is_one_path() {
    for seed in 0..20 {
        let mut random = Random::new(300 + seed, 0);
        let steps: Vec<f64> = (0..41).map(|_| 2.0 * random.normal()).collect();
        let mut row = |phase: f64| {
            let position = 1.5 * phase.sin();
            let step = ((position + 1.5) / 0.075) as usize;
            Row {
                position,
                velocity: 1.5 * phase.cos(),
                residual: steps[step] + random.normal(),
            }
        };
        let rows = (0..2000).map(|i| row(TAU * 0.0301 * f64::from(i)));
        let found = strongest(rows.collect(), 1.0, 1.0, f64::INFINITY);
        assert_eq!(found, None, "seed {seed}");
    }
}

/// A wave in one direction only, in one half of the range only, or of the other sign on the way back is no gear's.
#[test]
fn a_gear_is_the_same_in_both_directions_and_everywhere() {
    let waved = |where_: &dyn Fn(&Row) -> f64| {
        let mut rows = moved(0.0, 7, |_| 0.0);
        for row in &mut rows {
            row.residual += 3.0 * where_(row) * (100.0 * row.position).sin();
        }
        strongest(rows, 1.0, 1.0, f64::INFINITY)
    };
    assert!(waved(&|_| 1.0).is_some());
    assert_eq!(waved(&|row| row.velocity.signum()), None);
    for side in [-1.0, 1.0] {
        let only = |inside: bool| if inside { 1.0 } else { 0.0 };
        assert_eq!(waved(&|row| only(side * row.velocity > 0.0)), None);
        assert_eq!(waved(&|row| only(side * row.position > 0.0)), None);
    }
}

/// Of 6 periods nothing is told, whatever their height, nor of a wave that is clear but is a twelfth of the variance of its rows: 20000 of
/// them on one path say it with 40 nats.
#[test]
fn few_periods_and_small_waves_are_not_told() {
    let mut rows = moved(0.0, 8, |_| 0.0);
    for row in &mut rows {
        row.position *= 0.2;
        row.residual += 30.0 * (43.0 * row.position).sin();
    }
    assert_eq!(strongest(rows, 1.0, 1.0, f64::INFINITY), None);
    let waved = |height: f64| {
        let logs = (0..10).flat_map(|seed| moved(0.0, 20 + seed, |q| height * (30.7 * q).sin()));
        strongest(logs.collect(), 1.0, 1.0, f64::INFINITY)
    };
    assert_eq!(waved(0.42), None);
    assert!(waved(0.55).is_some());
}
