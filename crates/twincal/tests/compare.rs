//! `compare` against the difference of two distributions in closed form, and against simulated arms of which one carries
//! something.

use crate::two_link;
use statrs::distribution::{ContinuousCDF, Normal};
use std::sync::LazyLock;
use twincal::calibrate::{Calibration, CalibrationSettings, Status, calibrate};
use twincal::compare::{Became, ParameterChange, compare, hindrances};
use twincal::posterior::{Model, Posterior};
use twincal::random::Random;
use twincal::signal::Auto;
use twincal::term::Family;
use twincal::twin::Twin;

/// A twin of a model that believes in 2 kg at the tip, from logs of an arm that carries `fore` kg.
fn calibrated(fore: f64, seed: u64) -> Calibration {
    let (nominal, real) = (
        two_link::arm(2.0).expect("an arm"),
        two_link::arm(fore).expect("an arm"),
    );
    let mut noise = Random::new(seed, 0);
    let training = two_link::log("training", 0.3, &real, &mut noise);
    let heldout = two_link::log("held-out", 1.9, &real, &mut noise);
    let mut settings = CalibrationSettings::default();
    settings.library.terms = vec!["sin(q1 - q2)".into()];
    settings.library.families = vec![Family::Payload, Family::Viscous, Family::MotorInertia];
    settings.signal.cutoff_hz = Auto::Value(0.0);
    calibrate(&nominal, &[training], &[heldout], &settings, &|_| {}).expect("a calibration")
}

/// A calibration with this twin whose statuses follow from the probabilities.
fn with_status(twin: Twin) -> Calibration {
    let mut calibration = LOADED.clone();
    let library = twin.library().expect("a library");
    // A component's own probability is that of its first column.
    let columns = library.columns().iter().zip(&twin.posterior.inclusion);
    for (&column, pip) in columns.rev() {
        let own = &library.components()[library.terms()[column].component].name;
        let all = calibration.components.iter_mut();
        let summary = all
            .into_iter()
            .find(|c| c.name == *own)
            .expect("a component");
        summary.status = match pip {
            pip if *pip >= 0.95 => Status::Established,
            pip if *pip >= 0.2 => Status::Tentative,
            _ => Status::Absent,
        };
    }
    Calibration {
        twin,
        ..calibration
    }
}

static EMPTY: LazyLock<Calibration> = LazyLock::new(|| calibrated(2.0, 11));
static LOADED: LazyLock<Calibration> = LazyLock::new(|| calibrated(2.6, 12));

/// False alarm below 1e-3: two estimates within 4.5 sd, and each of the unchanged components' parameters is called changed
/// with probability 0.02; the seeds are fixed.
#[test]
fn the_load_is_what_changed_and_nothing_else() {
    let changes = compare(&EMPTY, &LOADED).expect("twins of one robot");
    let changed: Vec<&str> = changes
        .iter()
        .filter(|change| change.changed)
        .map(|change| change.name.as_str())
        .collect();
    assert_eq!(changed, ["payload"]);
    // The hidden effect is in both logs: it is compared, and is as before.
    let hidden = changes.iter().find(|c| c.name == "sin(q1 - q2)");
    let hidden = &hidden.expect("the hidden effect").parameters[0];
    assert!(hidden.difference.abs() < 4.5 * hidden.sd, "{hidden:?}");
    let payload = changes.iter().find(|c| c.name == "payload");
    let payload = payload.expect("the payload");
    let mass = &payload.parameters[0];
    assert!((mass.difference - 0.6).abs() < 4.5 * mass.sd, "{mass:?}");
    assert!(mass.sd < 0.1 && mass.certainty > 0.999, "{mass:?}");
    assert!(
        payload.words.starts_with("payload at fore: mass +0."),
        "{}",
        payload.words
    );

    // The other way round the load went.
    let back = compare(&LOADED, &EMPTY).expect("twins of one robot");
    let back = back.iter().find(|c| c.name == "payload");
    let mass = &back.expect("the payload").parameters[0];
    assert!((mass.difference + 0.6).abs() < 4.5 * mass.sd, "{mass:?}");
}

/// Only where both hold friction that turns round, and each otherwise.
#[test]
fn friction_of_two_shapes_is_told() {
    let twin = |velocity: f64, size: f64| {
        let arm = two_link::arm(2.0).expect("an arm");
        let mut log = two_link::log("log", 0.3, &arm, &mut Random::new(13, 0));
        for joint in &mut log.joints {
            let rates = joint.qd.clone().expect("a velocity");
            for (tau, qd) in joint.tau.iter_mut().flatten().zip(rates) {
                *tau += size * (qd / velocity).tanh();
            }
        }
        let mut settings = CalibrationSettings::default();
        settings.library.terms = vec!["sin(q1 - q2)".into()];
        settings.library.families = vec![Family::Coulomb];
        settings.signal.cutoff_hz = Auto::Value(0.0);
        settings.signal.coulomb_velocity = Some(velocity);
        let none: &[twincal::signal::Recording] = &[];
        calibrate(&arm, &[log], none, &settings, &|_| {})
            .expect("a calibration")
            .twin
    };
    let [sharp, soft, without] =
        [(0.02, 1.0), (0.08, 1.0), (0.08, 0.0)].map(|(v, size)| twin(v, size));
    let told = |a: &Twin, b: &Twin| hindrances(a, b).expect("twins");
    let said = told(&sharp, &soft);
    assert_eq!(said.len(), 1);
    assert_eq!(said[0].code, twincal::Code::CoulombVelocityDiffers);
    assert!(
        said[0]
            .message
            .contains("within 0.02 rad/s (m/s) before and 0.08 after")
    );
    assert_eq!(told(&sharp, &sharp), []);
    assert_eq!(told(&sharp, &without), [], "no friction, no other number");
}

/// Mean and covariance factors of two coefficients: `sin(q1 - q2)` and the payload's mass.
struct Given {
    mean: [f64; 2],
    /// Lower factor of the precision over φ: l11, l21, l22.
    factor: [f64; 3],
    /// Noise variance.
    noise: f64,
    /// Probability that both are in; otherwise nothing is.
    inside: f64,
}

impl Given {
    /// Mean and variance of the two coefficients, out counted as 0.
    fn moments(&self) -> [[f64; 2]; 2] {
        let [a, b, c] = self.factor;
        let within = [
            self.noise * (1.0 + b * b / (c * c)) / (a * a),
            self.noise / (c * c),
        ];
        [0, 1].map(|i| {
            let (p, mean) = (self.inside, self.mean[i]);
            [p * mean, p * within[i] + p * (1.0 - p) * mean * mean]
        })
    }

    /// The calibrated twin with this for a posterior; φ is all but known.
    fn twin(&self) -> Twin {
        let mut twin = EMPTY.twin.clone();
        let library = twin.library().expect("a library");
        let columns = library.columns();
        let at = |name: &str| {
            let place = columns
                .iter()
                .position(|&k| library.terms()[k].name == name);
            place.expect("a column") as u32
        };
        let members = vec![at("sin(q1 - q2)"), at("payload.m")];
        assert!(members[0] < members[1], "members are ascending");
        let shape = 1e9;
        let [a, b, c] = self.factor;
        let model = |members: Vec<u32>, weight: f64, mean: &[f64], factor: &[f64]| Model {
            members,
            weight,
            scale: shape * self.noise,
            mean: mean.to_vec(),
            factor: factor.to_vec(),
            sites: Vec::new(),
        };
        let mut models = vec![model(members, self.inside, &self.mean, &[a, 0.0, b, c])];
        if self.inside < 1.0 {
            models.push(model(Vec::new(), 1.0 - self.inside, &[], &[]));
        }
        let inclusion = vec![self.inside; columns.len()];
        twin.posterior = Posterior {
            models,
            inclusion,
            shape,
            noise: self.noise,
            ..twin.posterior
        };
        twin
    }
}

/// Statistics of 4000 draws are allowed 4.5 standard errors: false alarm below 1e-4, the draws' seed is fixed.
fn is_the_difference(change: &ParameterChange, before: [f64; 2], after: [f64; 2], normal: bool) {
    let (mean, sd) = (after[0] - before[0], (before[1] + after[1]).sqrt());
    let root = 4000f64.sqrt();
    assert!(
        (change.difference - mean).abs() < 4.5 * sd / root,
        "mean {mean}: {change:?}"
    );
    assert!(
        (change.mean[0] - before[0]).abs() < 4.5 * before[1].sqrt() / root
            && (change.mean[1] - after[0]).abs() < 4.5 * after[1].sqrt() / root,
        "{before:?} {after:?}: {change:?}"
    );
    // The sd of an sd is sd / √(2n) for a normal, and less than twice that for the mixture below.
    let tolerance = if normal { 4.5 } else { 9.0 } * sd / (2f64.sqrt() * root);
    assert!((change.sd - sd).abs() < tolerance, "sd {sd}: {change:?}");
    if !normal {
        return;
    }
    let of = Normal::new(mean, sd).expect("a distribution");
    let quantile = |level: f64, got: f64| {
        // sd of an empirical quantile: √(p (1 − p) / n) over the density there.
        let (value, z) = (of.inverse_cdf(level), (of.inverse_cdf(level) - mean) / sd);
        let density = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt() / sd;
        let error = (level * (1.0 - level)).sqrt() / root / density;
        assert!(
            (got - value).abs() < 4.5 * error,
            "quantile {level} is {value}: {change:?}"
        );
    };
    quantile(0.5, change.median);
    quantile(0.025, change.interval95[0]);
    quantile(0.975, change.interval95[1]);
    quantile(0.158_655, change.interval68[0]);
    quantile(0.841_345, change.interval68[1]);
    let sure = of.cdf(0.0).max(1.0 - of.cdf(0.0));
    let error = (sure * (1.0 - sure)).sqrt() / root;
    assert!(
        (change.certainty - sure).abs() < 4.5 * error + 1e-9,
        "certainty {sure}: {change:?}"
    );
}

#[test]
fn two_normal_posteriors_differ_by_their_closed_form() {
    let before = Given {
        mean: [0.8, 0.5],
        factor: [4.0, 1.5, 2.0],
        noise: 0.04,
        inside: 1.0,
    };
    let after = Given {
        mean: [0.9, 1.1],
        factor: [2.0, -1.0, 5.0],
        noise: 0.09,
        inside: 1.0,
    };
    let perhaps = Given {
        inside: 0.7,
        ..before
    };
    let other = with_status(after.twin());
    for given in [&before, &perhaps] {
        let changes = compare(&with_status(given.twin()), &other).expect("twins of one robot");
        for (i, name) in ["sin(q1 - q2)", "payload"].into_iter().enumerate() {
            let change = changes.iter().find(|change| change.name == name);
            let change = change.expect("it is in both");
            assert_eq!(change.pip, [Some(given.inside), Some(1.0)]);
            let (before, after) = (given.moments()[i], after.moments()[i]);
            let parameter = &change.parameters[0];
            is_the_difference(parameter, before, after, given.inside == 1.0);
            // 0.1 ± 0.19 is no change; 0.6 ± 0.12 is one, unless the payload may not have been there.
            if given.inside == 1.0 {
                assert_eq!(change.changed, name == "payload", "{change:?}");
            }
        }
    }
}

/// The payload or the hidden effect, never both: 0.94 and 0.06 before, 0.1 and 0.9 after.
#[test]
fn one_effect_under_two_names_is_as_before() {
    let given = Given {
        mean: [0.8, 0.5],
        factor: [4.0, 1.5, 2.0],
        noise: 0.04,
        inside: 1.0,
    };
    let twin = |share: f64| {
        let mut twin = given.twin();
        let both = twin.posterior.models.remove(0);
        let one = |k: usize, weight: f64| Model {
            members: vec![both.members[k]],
            weight,
            mean: vec![both.mean[k]],
            factor: vec![4.0],
            ..both.clone()
        };
        twin.posterior.models = vec![one(0, 1.0 - share), one(1, share)];
        for k in [0, 1] {
            twin.posterior.inclusion[both.members[k] as usize] = [1.0 - share, share][k];
        }
        twin
    };
    let [before, after] = [0.94, 0.1].map(|share| with_status(twin(share)));
    let changes = compare(&before, &after).expect("twins of one robot");
    let of = |name: &str| changes.iter().find(|c| c.name == name).expect("compared");
    let (payload, hidden) = (of("payload"), of("sin(q1 - q2)"));
    assert_eq!(payload.became, Became::OneOfTwo);
    assert_eq!(payload.rival.as_deref(), Some("sin(q1 - q2)"));
    assert_eq!(hidden.rival.as_deref(), Some("payload"));
    // Where the other does not stand for it, it went.
    let mut without = twin(0.1);
    without.posterior.models[0].members.clear();
    without.posterior.models[0].mean.clear();
    without.posterior.models[0].factor.clear();
    let changes = compare(&before, &with_status(without)).expect("twins of one robot");
    let payload = changes.iter().find(|c| c.name == "payload");
    assert_eq!(payload.expect("compared").became, Became::PerhapsGone);
}

#[test]
fn a_twin_beside_itself_shows_no_change() {
    let changes = compare(&LOADED, &LOADED).expect("twins of one robot");
    assert!(changes.len() >= 2);
    assert!(changes.iter().all(|change| !change.changed), "{changes:?}");
}
