//! The fixed point on a regression whose answer is known in closed form.

use super::*;
use crate::likelihood::AUTO_SHAPE;
use crate::observations::{JointObservations, Observations};
use crate::prior::Inclusion;
use crate::random::Random;
use crate::statistics::{Purpose, Runs, Sums};
use crate::term::Family;

const ROWS: usize = 300;

/// `y = 1000 x + ε`, x and ε standard normal.
fn log(rows: usize) -> Observations {
    let mut random = Random::new(7, 0);
    let x: Vec<f64> = (0..rows).map(|_| random.normal()).collect();
    let y: Vec<f64> = x.iter().map(|x| 1000.0 * x + random.normal()).collect();
    log_of(vec![0.0; rows], vec![1.0; rows], x, y)
}

/// A log of one joint: position, velocity, columns one after the other, residual torque.
pub(super) fn log_of(q: Vec<f64>, qd: Vec<f64>, x: Vec<f64>, y: Vec<f64>) -> Observations {
    let rows = y.len();
    Observations {
        log: "log".into(),
        cutoff: 0.0,
        time: (0..rows).map(|row| 0.01 * row as f64).collect(),
        starts: vec![0],
        q: vec![q.into()],
        qd: vec![qd.into()],
        qdd: vec![vec![0.0; rows].into()],
        joints: vec![JointObservations {
            recipes: None,
            columns: (0..x.len() / rows).collect(),
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

pub(super) fn prior() -> PriorSettings {
    PriorSettings {
        scaled_variance: Auto::Auto,
        inclusion: Some(Inclusion::Probability(0.5)),
        noise: None,
        families: Vec::new(),
        forced: Vec::new(),
        heredity: None,
    }
}

pub(super) fn noise(model: NoiseModel) -> NoiseSettings {
    NoiseSettings {
        model,
        per_joint: true,
        robust: false,
        varies_with_speed: false,
        varies_with_load: false,
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
    let training = Sums::of(&[log.whole()], Runs::Joined, Purpose::Result);
    let first = start(&training, &columns, &prior);
    let fit = fit(&training, &columns, settings, &first, Moving::All, None).unwrap();
    // The slab adds β²/(2v) to b_n: less than one unit of noise at the scale that it learns.
    let exact = left / (ROWS as f64 + 2.0 * AUTO_SHAPE - 2.0);
    assert!(fit.converged && fit.posterior.inclusion[0] > 0.999);
    assert!(
        (fit.posterior.noise / exact - 1.0).abs() < 0.01,
        "{} instead of {exact}",
        fit.posterior.noise
    );
}

/// What one of two rows leaves out predicts nothing: its intervals are as wide as the noise says, and no number is none.
#[test]
fn rows_too_few_to_predict_widen_nothing() {
    let (columns, prior) = (columns(), prior());
    let settings = FitSettings {
        noise: noise(NoiseModel::Tempered),
        prior: &prior,
    };
    for rows in [2, ROWS] {
        let log = log(rows);
        let (fit, factors) = fit_tempered(
            &Sums::of(&[log.whole()], Runs::Apart, Purpose::Result),
            &[log.whole()],
            &columns,
            settings,
        )
        .unwrap();
        assert!(factors.iter().all(|f| f.is_finite() && *f >= 1.0), "{rows}");
        assert!(
            fit.plug_in
                .misfit
                .iter()
                .all(|l| l.is_finite() && *l >= 1.0)
        );
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
        let training = Sums::of(&[log.whole()], Runs::Joined, Purpose::Result);
        let first = start(&training, &columns, &prior);
        let fit = fit(&training, &columns, settings, &first, Moving::All, None).unwrap();
        assert!(fit.posterior.inclusion[0] > 0.999);
        [fit.posterior.mean[1].abs(), fit.posterior.sd[1]]
    };
    let [mean, sd] = second([Family::User, Family::Stribeck]);
    // v_0 = mean(y²)/E[φ] is 1e6 here: √v / √LEAST_SHARE = 1e4, in half of the models.
    assert!(mean < 1e-3 && sd < 1e4, "{mean} ± {sd}");
    let [mean, sd] = second([Family::User, Family::Generic]);
    assert!(mean > 1e30 && sd > 1e30, "{mean} ± {sd}");
}
