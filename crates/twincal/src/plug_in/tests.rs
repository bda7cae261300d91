//! The fixed point on a regression whose answer is known in closed form.

use super::*;
use crate::likelihood::{AUTO_SHAPE, NoiseUncertainty};
use crate::observations::{JointObservations, Observations};
use crate::posterior::random::Random;
use crate::prior::Inclusion;
use crate::term::Family;

const ROWS: usize = 300;

/// `y = 1000 x + ε`, x and ε standard normal.
fn log(rows: usize) -> Observations {
    let mut random = Random::new(7, 0);
    let x: Vec<f64> = (0..rows).map(|_| random.normal()).collect();
    let y: Vec<f64> = x.iter().map(|x| 1000.0 * x + random.normal()).collect();
    Observations {
        log: "log".into(),
        cutoff: 0.0,
        time: (0..rows).map(|row| 0.01 * row as f64).collect(),
        starts: vec![0],
        q: vec![vec![0.0; rows].into()],
        qd: vec![vec![1.0; rows].into()],
        qdd: vec![vec![0.0; rows].into()],
        joints: vec![JointObservations {
            recipes: None,
            columns: vec![0],
            x,
            measured: y.clone().into(),
            nominal: vec![0.0; rows].into(),
            y,
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
        names: vec!["x".into()],
        component: vec![0],
        family: vec![0],
        families: vec![Family::User],
        prior_sd: vec![None],
        lower: vec![f64::NEG_INFINITY],
        forced: Vec::new(),
        parent: Vec::new(),
        second_choice: Vec::new(),
        one_motion: false,
        halves: Vec::new(),
    }
}

fn prior() -> PriorSettings {
    PriorSettings {
        scaled_variance: Auto::Auto,
        inclusion: Some(Inclusion::Probability(0.5)),
        noise: None,
        families: Vec::new(),
        forced: Vec::new(),
        heredity: None,
    }
}

fn noise(model: NoiseModel) -> NoiseSettings {
    NoiseSettings {
        model,
        per_joint: true,
        robust: false,
        varies_with_speed: false,
        varies_with_load: false,
        uncertainty: NoiseUncertainty::PlugIn,
    }
}

/// One column explains all but a millionth of the squares. What is left is noise, and E[φ] = (b0 + RSS/2)/(a0 + n/2 − 1) with b0 a
/// thousandth of the noise must be RSS/(n − 2): no row more than there is.
#[test]
fn the_automatic_prior_adds_no_noise_where_nearly_all_is_explained() {
    let log = log(ROWS);
    let joint = &log.joints[0];
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let beta = dot(&joint.x, &joint.y) / dot(&joint.x, &joint.x);
    let left: f64 = (joint.x.iter().zip(&joint.y))
        .map(|(x, y)| (y - beta * x) * (y - beta * x))
        .sum();
    let (columns, prior) = (columns(), prior());
    let settings = FitSettings {
        noise: noise(NoiseModel::Iid),
        prior: &prior,
    };
    let parts = [log.whole()];
    let first = start(&parts, &columns, &prior);
    let fit = fit(&parts, &columns, settings, &first, Moving::All, None).unwrap();
    // The slab adds β²/(2v) to b_n: less than one unit of noise at the scale that it learns.
    let exact = left / (ROWS as f64 + 2.0 * AUTO_SHAPE - 2.0);
    assert!(fit.converged && fit.posterior.inclusion[0] > 0.999);
    assert!(
        (fit.posterior.noise / exact - 1.0).abs() < 0.01,
        "{} instead of {exact}",
        fit.posterior.noise
    );
}

/// What one of two rows leaves out predicts nothing: there is no score then, and none that is no number.
#[test]
fn rows_too_few_to_score_leave_no_score() {
    let (columns, prior) = (columns(), prior());
    let settings = FitSettings {
        noise: noise(NoiseModel::Tempered),
        prior: &prior,
    };
    for (rows, scored) in [(2, false), (ROWS, true)] {
        let log = log(rows);
        let (_, left_out) = fit_tempered(&[log.whole()], &columns, settings).unwrap();
        assert!(left_out.scores.iter().all(|(_, score)| score.is_finite()));
        assert_eq!(!left_out.scores.is_empty(), scored, "{rows}");
    }
}

/// Beside x a column that a motion too fast for it leaves at 1e-38: a coefficient of the size of the residual over that is a
/// torque of 1e38 where the motion is slow. Of a shape that is at most 1 it is known that it cannot be: the noise has sd 1, and the data
/// say nothing of it.
#[test]
fn a_shape_that_the_motion_hardly_shows_has_a_coefficient_of_usual_size() {
    let mut log = log(ROWS);
    log.joints[0].columns.push(1);
    let faint = (0..ROWS).map(|row| 1e-38 * (row as f64 / 50.0).sin());
    log.joints[0].x.extend(faint);
    let second = |families: [Family; 2]| {
        let columns = Columns {
            names: vec!["x".into(), "faint".into()],
            component: vec![0, 1],
            family: vec![0, 1],
            families: families.into(),
            prior_sd: vec![None; 2],
            lower: vec![f64::NEG_INFINITY; 2],
            ..columns()
        };
        let prior = prior();
        let settings = FitSettings {
            noise: noise(NoiseModel::Iid),
            prior: &prior,
        };
        let parts = [log.whole()];
        let first = start(&parts, &columns, &prior);
        let fit = fit(&parts, &columns, settings, &first, Moving::All, None).unwrap();
        assert!(fit.posterior.inclusion[0] > 0.999);
        [fit.posterior.mean[1].abs(), fit.posterior.sd[1]]
    };
    let [mean, sd] = second([Family::User, Family::Stribeck]);
    // v_0 = mean(y²)/E[φ] is 1e6 here: √v / √LEAST_SHARE = 1e4, in half of the models.
    assert!(mean < 1e-3 && sd < 1e4, "{mean} ± {sd}");
    let [mean, sd] = second([Family::User, Family::Generic]);
    assert!(mean > 1e30 && sd > 1e30, "{mean} ± {sd}");
}
