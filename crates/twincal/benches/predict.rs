//! How long do 95 % intervals of 4000 rows take, by number of models? One core; `cargo bench --bench predict`.
#![allow(clippy::print_stdout, reason = "a bench prints its numbers")]

use std::time::Instant;
use twincal::likelihood::JointNoise;
use twincal::posterior::{Method, Model, Posterior};
use twincal::random::Random;
use twincal::twin::{JointInput, JointSetting, Predictor, TorqueSignal};

const COLUMNS: usize = 24;
const MEMBERS: usize = 8;
const ROWS: usize = 4000;

/// Models of eight of 24 columns that disagree strongly: the mixtures have many modes and need the most iterations.
fn posterior(count: usize, random: &mut Random) -> Posterior {
    let models = (0..count).map(|_| {
        let mut members: Vec<u32> = (0..COLUMNS as u32).collect();
        while members.len() > MEMBERS {
            members.remove((random.uniform() * members.len() as f64) as usize);
        }
        let lower = |at: usize, random: &mut Random| match (at / MEMBERS).cmp(&(at % MEMBERS)) {
            std::cmp::Ordering::Less => 0.0,
            std::cmp::Ordering::Equal => 20.0,
            std::cmp::Ordering::Greater => random.normal(),
        };
        Model {
            members,
            weight: 1.0 / count as f64,
            scale: 100.0 * (1.0 + 0.01 * random.normal()),
            mean: (0..MEMBERS).map(|_| 1.0 + 0.05 * random.normal()).collect(),
            factor: (0..MEMBERS * MEMBERS).map(|at| lower(at, random)).collect(),
            sites: Vec::new(),
        }
    });
    Posterior {
        models: models.collect(),
        component: (0..COLUMNS).collect(),
        inclusion: vec![0.3; COLUMNS],
        inclusion_mcse: vec![0.0; COLUMNS],
        mean: vec![0.3; COLUMNS],
        sd: vec![0.5; COLUMNS],
        shape: 200.0,
        noise: 0.5,
        models_mass: 1.0,
        log_evidence: None,
        method: Method::Exact {
            models: 1 << COLUMNS,
        },
    }
}

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.expect("one thread");
    let mut random = Random::new(1, 1);
    let noise = JointNoise {
        joint: "elbow".into(),
        sigma: 0.7,
        training_rmse: 0.0,
        rho: 0.0,
        weight: 1.0,
        n: 400.0,
        n_eff: 400.0,
        autocorrelation_time: 1.0,
        misfit: 1.0,
        interval_factor: 1.0,
        spread: Default::default(),
        out_of_band: 0.0,
    };
    let columns: Vec<usize> = (0..COLUMNS).collect();
    let mut normal = |count: usize| -> Vec<f64> { (0..count).map(|_| random.normal()).collect() };
    let (x, nominal, measured) = (normal(ROWS * COLUMNS), normal(ROWS), normal(ROWS));
    for count in [1, 30, 1000] {
        let posterior = posterior(count, &mut random);
        let setting = JointSetting {
            columns: &columns,
            coulomb: None,
            noise: &noise,
            hull: [0.0; 6],
        };
        let start = Instant::now();
        let predictor = Predictor::new(&posterior, &[setting]).expect("a predictor");
        let prepared = start.elapsed();
        let input = JointInput {
            x: &x,
            stride: ROWS,
            nominal: &nominal,
            products: &[],
            measured: &measured,
            standstill: &[],
            motion: [&[]; 3],
        };
        let best = (0..10).map(|_| {
            let start = Instant::now();
            let torque = pool.install(|| predictor.torque(0, &input, TorqueSignal::Filtered));
            assert!(torque.low[0] < torque.high[0]);
            start.elapsed()
        });
        let best = best.min().unwrap_or_default();
        println!("predict/{ROWS} rows/{count} models: {best:.2?}, prepared in {prepared:.2?}");
    }
}
