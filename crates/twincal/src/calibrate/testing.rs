//! Small regressions with known truth for the tests of this module: one joint, white columns, no robot behind them.

use super::fit::compact::refit;
use crate::likelihood::{Columns, assemble};
use crate::observations::{JointObservations, Observations, Part};
use crate::plug_in::{Fit, start};
use crate::posterior::Posterior;
use crate::prior::{Inclusion, PriorSettings};
use crate::random::Random;
use crate::signal::Auto;
use crate::statistics::{Purpose, Runs, Sums};
use crate::term::Family;

pub(in crate::calibrate) struct Regression {
    pub(in crate::calibrate) random: Random,
    rows: usize,
}

pub(in crate::calibrate) fn part(log: &Observations) -> Part<'_> {
    log.whole()
}

impl Regression {
    pub(in crate::calibrate) fn new(seed: u64, rows: usize) -> Self {
        Self {
            random: Random::new(seed, 0),
            rows,
        }
    }

    /// Rows `y = Xβ + σε` with standard normal X and ε.
    pub(in crate::calibrate) fn log(&mut self, beta: &[f64], sigma: f64) -> Observations {
        let rows = self.rows;
        let x: Vec<f64> = (0..rows * beta.len())
            .map(|_| self.random.normal())
            .collect();
        let y: Vec<f64> = (0..rows)
            .map(|row| {
                let signal: f64 = (0..beta.len()).map(|k| beta[k] * x[k * rows + row]).sum();
                signal + sigma * self.random.normal()
            })
            .collect();
        Observations {
            log: "log".into(),
            cutoff: 0.0,
            time: (0..rows).map(|row| 0.01 * row as f64).collect(),
            starts: vec![0],
            q: vec![vec![0.0; rows].into()],
            qd: vec![vec![1.0; rows].into()],
            qdd: vec![vec![0.0; rows].into()],
            joints: vec![JointObservations {
                columns: (0..beta.len()).collect(),
                recipes: None,
                x,
                measured: y.clone().into(),
                nominal: vec![0.0; rows].into(),
                y,
                has_products: false,
                standstill: vec![false; rows],
                weight: Vec::new(),
                shelved: None,
                temperature: Vec::new(),
                spread: Vec::new(),
            }],
        }
    }

    fn columns() -> Columns {
        Columns {
            names: vec!["q1".into(), "q1^2".into()],
            component: vec![0, 1],
            family: vec![0, 0],
            families: vec![Family::User],
            prior_sd: vec![None; 2],
            lower: vec![f64::NEG_INFINITY; 2],
            forced: Vec::new(),
            parent: Vec::new(),
            second_choice: Vec::new(),
            one_motion: false,
            halves: Vec::new(),
        }
    }

    pub(in crate::calibrate) fn prior() -> PriorSettings {
        PriorSettings {
            scaled_variance: Auto::Value(100.0),
            inclusion: Some(Inclusion::Probability(0.5)),
            noise: None,
            families: Vec::new(),
            forced: Vec::new(),
            heredity: None,
        }
    }

    /// Independent rows, and the structure with both columns.
    pub(in crate::calibrate) fn fitted(&self, logs: &[Part<'_>]) -> (Fit, Posterior) {
        let (columns, prior) = (Self::columns(), Self::prior());
        let plug_in = start(
            &Sums::of(logs, Runs::Joined, Purpose::Result),
            &columns,
            &prior,
        );
        let gram = logs.iter().collect();
        let problem = assemble(&gram, &columns, &plug_in, &prior).unwrap();
        let posterior = crate::infer::approximate(&problem, None).unwrap();
        let compact = refit(&problem, &[true, true], &posterior).unwrap();
        let fit = Fit {
            gram,
            plug_in,
            problem,
            posterior,
            rounds: 1,
            converged: true,
        };
        (fit, compact)
    }
}
