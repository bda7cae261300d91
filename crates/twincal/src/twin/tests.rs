//! Predictions against brute force, simulation and each other.

use super::*;
use crate::posterior::Site;
use crate::posterior::draws::draw;
use crate::random::Random;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Made by `tests/reference/twin/make_predictions.py` with NumPy and SciPy.
#[derive(Deserialize)]
struct Reference {
    columns: Vec<Vec<usize>>,
    noise: Vec<JointNoise>,
    cases: BTreeMap<String, Case>,
}

#[derive(Deserialize)]
struct Case {
    posterior: Posterior,
    rows: Vec<Row>,
}

#[derive(Deserialize)]
struct Row {
    joint: usize,
    signal: TorqueSignal,
    x: Vec<f64>,
    low: f64,
    high: f64,
    mean: f64,
    epistemic: f64,
    residual: f64,
    pit: f64,
}

const NOWHERE: [f64; 6] = [f64::MIN, f64::MAX, f64::MIN, f64::MAX, f64::MIN, f64::MAX];

impl Reference {
    fn read() -> Self {
        serde_json::from_str(include_str!("../../tests/reference/twin/predictions.json")).unwrap()
    }

    fn predictor(&self, posterior: &Posterior) -> Predictor {
        let settings: Vec<JointSetting<'_>> = (0..2)
            .map(|j| JointSetting {
                columns: &self.columns[j],
                coulomb: Some(0),
                noise: &self.noise[j],
                hull: NOWHERE,
            })
            .collect();
        Predictor::new(posterior, &settings).unwrap()
    }
}

fn input<'a>(
    x: &'a [f64],
    nominal: &'a [f64],
    measured: &'a [f64],
    standstill: &'a [bool],
) -> JointInput<'a> {
    JointInput {
        x,
        stride: nominal.len(),
        nominal,
        products: &[],
        measured,
        standstill,
        motion: [&[]; 3],
    }
}

/// `count` rows of standard normal columns for joint 0 of the reference, with nominal and measured torque.
fn block(count: usize) -> [Vec<f64>; 3] {
    let mut random = Random::new(4, 4);
    let mut normal = |n: usize| -> Vec<f64> { (0..n).map(|_| random.normal()).collect() };
    [normal(4 * count), normal(count), normal(count)]
}

#[test]
fn intervals_are_those_of_the_brute_force_mixture() {
    let reference = Reference::read();
    for (name, case) in &reference.cases {
        let predictor = reference.predictor(&case.posterior);
        for row in &case.rows {
            let nominal = [7.0];
            let measured = [7.0 + row.residual];
            let torque = predictor.torque(
                row.joint,
                &input(&row.x, &nominal, &measured, &[]),
                row.signal,
            );
            let width = row.high - row.low;
            let close = |got: f64, wanted: f64, what: &str| {
                // 1e-9 of the mass is left out; where modes stand apart that moves a quantile by more than 1e-9 of the width.
                let tolerance = 1e-7 * width + 1e-13;
                assert!(
                    (got - wanted).abs() < tolerance,
                    "{name}, joint {}: {what} {got}, not {wanted}",
                    row.joint
                );
            };
            close(torque.low[0], 7.0 + row.low, "low");
            close(torque.high[0], 7.0 + row.high, "high");
            close(torque.calibrated[0], 7.0 + row.mean, "mean");
            close(torque.epistemic[0], row.epistemic, "epistemic");
            assert!(
                (torque.pit[0] - row.pit).abs() < 2e-9,
                "{name}: pit {} {}",
                torque.pit[0],
                row.pit
            );
            assert_eq!(torque.nominal[0], 7.0);
        }
    }
}

#[test]
fn one_model_gives_the_closed_t_interval_to_rounding() {
    let reference = Reference::read();
    let case = &reference.cases["one_model"];
    let predictor = reference.predictor(&case.posterior);
    for row in &case.rows {
        let torque = predictor.torque(row.joint, &input(&row.x, &[0.0], &[], &[]), row.signal);
        assert!(
            (torque.low[0] - row.low).abs() < 1e-11 && (torque.high[0] - row.high).abs() < 1e-11
        );
        assert!(torque.pit.is_empty());
    }
}

/// The torque drawn from the posterior and the noise must have a uniform PIT under the interval's own distribution:
/// draws and mixture are two roads to the same law. Kolmogorov–Smirnov, false alarm 1e-4 (√n·D > 2.225), seed fixed.
#[test]
fn simulated_torque_has_a_uniform_pit() {
    const COUNT: usize = 20_000;
    let reference = Reference::read();
    let posterior = &reference.cases["all_models"].posterior;
    let predictor = reference.predictor(posterior);
    let draws = draw(posterior, COUNT, 3, 0);
    let mut random = Random::new(3, 1);
    let noise = &reference.noise[0];
    let factor = noise.interval_factor.powi(2) / (noise.weight * (1.0 - noise.rho * noise.rho));
    let [x, nominal, _] = block(COUNT);
    let measured: Vec<f64> = (0..COUNT)
        .map(|row| {
            let beta = &draws.beta[row * 5..row * 5 + 5];
            let correction: f64 = reference.columns[0]
                .iter()
                .enumerate()
                .map(|(i, &k)| x[i * COUNT + row] * beta[k])
                .sum();
            nominal[row] + correction + (draws.noise[row] * factor).sqrt() * random.normal()
        })
        .collect();
    let torque = predictor.torque(
        0,
        &input(&x, &nominal, &measured, &[]),
        TorqueSignal::Filtered,
    );
    let inside = (0..COUNT)
        .filter(|&i| measured[i] >= torque.low[i] && measured[i] <= torque.high[i])
        .count();
    // Binomial(20000, 0.95), sd 30.8: 4 sd, false alarm 6e-5.
    assert!(
        (inside as f64 - 0.95 * COUNT as f64).abs() < 4.0 * 30.9,
        "{inside}"
    );
    let mut pit = torque.pit;
    pit.sort_by(f64::total_cmp);
    let n = COUNT as f64;
    let worst = pit
        .iter()
        .enumerate()
        .fold(0.0_f64, |w, (i, p)| w.max((p - (i as f64 + 0.5) / n).abs()));
    assert!(worst * n.sqrt() < 2.225, "{}", worst * n.sqrt());
}

#[test]
fn blocks_and_threads_change_no_bit() {
    let reference = Reference::read();
    let predictor = reference.predictor(&reference.cases["all_models"].posterior);
    let [x, nominal, measured] = block(1500);
    let whole = predictor.torque(0, &input(&x, &nominal, &measured, &[]), TorqueSignal::Raw);
    let one_thread = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    assert_eq!(
        one_thread.install(|| predictor.torque(
            0,
            &input(&x, &nominal, &measured, &[]),
            TorqueSignal::Raw
        )),
        whole
    );
    let mut pieces = JointTorque::default();
    for (start, end) in [(0, 3), (3, 704), (704, 704), (704, 1500)] {
        // The stride stays that of the whole block.
        let part = JointInput {
            x: &x[start..],
            stride: 1500,
            nominal: &nominal[start..end],
            products: &[],
            measured: &measured[start..end],
            standstill: &[],
            motion: [&[]; 3],
        };
        pieces.append(predictor.torque(0, &part, TorqueSignal::Raw));
    }
    assert_eq!(pieces, whole);
}

#[test]
fn json_gives_the_same_predictions_to_the_bit() {
    let reference = Reference::read();
    let posterior = &reference.cases["all_models"].posterior;
    let text = serde_json::to_string(posterior).unwrap();
    let again: Posterior = serde_json::from_str(&text).unwrap();
    let [x, nominal, measured] = block(64);
    let rows = input(&x, &nominal, &measured, &[]);
    let [one, other] = [posterior, &again].map(|p| {
        reference
            .predictor(p)
            .torque(0, &rows, TorqueSignal::Filtered)
    });
    assert_eq!(one, other);
}

#[test]
fn standstill_widens_by_the_coulomb_coefficient_and_pit_agrees_with_the_interval() {
    let reference = Reference::read();
    let posterior = &reference.cases["all_models"].posterior;
    let predictor = reference.predictor(posterior);
    let coulomb = posterior.mean[0].abs();
    let [x, nominal, measured] = block(400);
    // Some rows at the ends of the band.
    let still = vec![true; 400];
    let moving = predictor.torque(
        0,
        &input(&x, &nominal, &measured, &[]),
        TorqueSignal::Filtered,
    );
    let widened = predictor.torque(
        0,
        &input(&x, &nominal, &measured, &still),
        TorqueSignal::Filtered,
    );
    let mut outside = 0;
    for row in 0..400 {
        assert!((widened.low[row] - (moving.low[row] - coulomb)).abs() < 1e-12);
        assert!((widened.high[row] - (moving.high[row] + coulomb)).abs() < 1e-12);
        assert_eq!(widened.calibrated[row], moving.calibrated[row]);
        let inside = measured[row] >= widened.low[row] && measured[row] <= widened.high[row];
        assert_eq!((widened.pit[row] - 0.5).abs() <= 0.475, inside, "row {row}");
        outside += usize::from(!inside);
    }
    assert!(outside > 0, "the test must see both sides");
}

#[test]
fn rows_outside_the_training_motion_or_with_more_doubt_than_noise_are_extrapolating() {
    let reference = Reference::read();
    let posterior = &reference.cases["all_models"].posterior;
    let hull = [-1.0, 1.0, -2.0, 2.0, -10.0, 10.0];
    let setting = JointSetting {
        columns: &reference.columns[0],
        coulomb: None,
        noise: &reference.noise[0],
        hull,
    };
    let predictor = Predictor::new(posterior, &[setting]).unwrap();
    // 5 % of the range 2 is 0.1, of 4 is 0.2, of 20 is 1.
    let q = [0.0, 1.09, 1.11, 0.0, 0.0, 0.0, 0.0];
    let qd = [0.0, 0.0, 0.0, -2.19, -2.21, 0.0, 0.0];
    let qdd = [0.0, 0.0, 0.0, 0.0, 0.0, 11.1, 0.0];
    let mut x = vec![0.0; 4 * 7];
    x[6] = 100.0;
    let rows = JointInput {
        x: &x,
        stride: 7,
        nominal: &[0.0; 7],
        products: &[],
        measured: &[],
        standstill: &[],
        motion: [&q, &qd, &qdd],
    };
    let torque = predictor.torque(0, &rows, TorqueSignal::Filtered);
    assert_eq!(
        torque.extrapolating,
        [false, false, true, false, true, true, true]
    );
    // The last row has more doubt than noise, in motion that training had.
    assert_eq!(
        torque.new_motion,
        [false, false, true, false, true, true, false]
    );
    assert_eq!(torque.epistemic[0], 0.0);
}

#[test]
fn models_that_differ_elsewhere_are_one_component_here() {
    // Columns 0 and 1 on joint 0, column 2 on joint 1, no coupling: A is diagonal.
    let model = |members: &[u32], weight: f64, scale: f64| {
        let size = members.len();
        let factor = (0..size * size)
            .map(|i| if i / size == i % size { 2.0 } else { 0.0 })
            .collect();
        crate::posterior::Model {
            members: members.to_vec(),
            weight,
            scale,
            mean: members.iter().map(|&k| f64::from(k) + 1.0).collect(),
            factor,
            sites: Vec::new(),
        }
    };
    let mut posterior = Reference::read().cases["one_model"].posterior.clone();
    posterior.models = vec![
        model(&[0], 0.5, 1.0),
        model(&[0, 2], 0.3, 1.000_01),
        model(&[0, 1], 0.2, 0.9),
    ];
    let components = components::Components::of_joint(&posterior, &[0, 1]);
    assert_eq!(
        (components.geometries.len(), components.components.len()),
        (2, 2)
    );
    assert!((components.components[0].weight - 0.8).abs() < 1e-15);
    // A model below the ignored mass is left out, and alone it would be all there is.
    posterior.models = vec![model(&[0], 1.0 - 1e-10, 1.0), model(&[1], 1e-10, 1.0)];
    assert_eq!(
        components::Components::of_joint(&posterior, &[0, 1])
            .components
            .len(),
        1
    );
}

#[test]
fn a_damaged_posterior_is_an_error_and_no_panic() {
    let reference = Reference::read();
    let good = &reference.cases["all_models"].posterior;
    let spoil = |change: &dyn Fn(&mut Posterior)| {
        let mut posterior = good.clone();
        change(&mut posterior);
        let setting = JointSetting {
            columns: &reference.columns[0],
            coulomb: None,
            noise: &reference.noise[0],
            hull: NOWHERE,
        };
        Predictor::new(&posterior, &[setting]).is_err()
    };
    assert!(!spoil(&|_| {}));
    assert!(spoil(&|p| p.models.clear()));
    assert!(spoil(&|p| p.models[0].mean.push(0.0)));
    assert!(spoil(&|p| p.models[0].factor[0] = 0.0));
    assert!(spoil(&|p| p.models[0].members = vec![70]));
    assert!(spoil(&|p| p.models[1].scale = f64::NAN));
    assert!(spoil(&|p| p.models[0].weight = 1e308));
    assert!(spoil(&|p| p.models[0].weight = -0.1));
    let site = |place, terms| Site {
        place,
        terms,
        lower: 0.0,
        precision: 1.0,
        shift: 0.0,
    };
    assert!(spoil(&|p| p.models[0].sites = vec![site(70, Vec::new())]));
    assert!(spoil(
        &|p| p.models[0].sites = vec![site(0, vec![(70, 1.0)])]
    ));
    assert!(spoil(&|p| p.shape = -1.0));
    assert!(spoil(&|p| p.mean.truncate(2)));
}
