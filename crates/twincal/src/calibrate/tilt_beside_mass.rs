//! Gravity in the base beside found masses: a product of two effects, of which the model of the fit has the sum alone.

use super::result::Calibration;
use crate::error::{Finding, Severity};
use crate::excitation::{STATES, random_states};
use crate::robot::{Motion, Robot};
use crate::term::{Family, Library, ModelColumn, Scratch};

/// Share of the torque of gravity from which it is worth telling: as much as half a standard deviation of a tilt that is clearly found.
const WORTH_TELLING: f64 = 0.05;

/// A warning where gravity in the base and inertia are found together and the latter changes the torque of gravity by 5 % or more.
///
/// Gravity g + δ acts on the masses π + Δπ of the real arm, torque being linear in both,
///
/// ```text
/// τ = G(g) π + G(g) Δπ + G(δ) π + G(δ) Δπ
/// ```
/// and the column of `base.tilt` is G(·) π: the last term is nobody's, and what is told of δ is off by about |G(g) Δπ| / |G(g) π|, the root
/// mean squares over random positions at rest.
pub(super) fn finding(
    robot: &Robot,
    library: &Library,
    calibration: &Calibration,
) -> Option<Finding> {
    let found = |family: &dyn Fn(Family) -> bool| {
        let mut all = calibration.components.iter();
        all.any(|component| component.is_in() && family(component.family))
    };
    let inertial = |family| {
        matches!(family, Family::Density | Family::MassMoments) || Family::is_payload(family)
    };
    if !(found(&|family| family == Family::Tilt) && found(&inertial)) {
        return None;
    }
    let share = share(robot, library, &calibration.twin.posterior.mean)?;
    (share > WORTH_TELLING).then(|| {
        Finding::new(
            Severity::Warning,
            "tilt_beside_mass",
            "base.tilt",
            format!(
                "`base.tilt` is worked out for the masses of the model; the masses found beside it change the torque of gravity by {:.0} %, and \
                 what is told of gravity is off by about as much: state the payload ([[log]] payload = {{ mass, com }}), or fit once more with \
                 the exported model",
                100.0 * share
            ),
            0,
        )
    })
}

/// Torque of gravity on what inertial components add (coefficients `beta`), as a share of that on the model.
fn share(robot: &Robot, library: &Library, beta: &[f64]) -> Option<f64> {
    let states = random_states(robot, STATES);
    let still = vec![0.0; states.q.len()];
    let motion = Motion {
        len: states.len,
        q: &states.q,
        qd: &still,
        qdd: &still,
    };
    let mut out = vec![Vec::new(); robot.dof()];
    library.evaluate_with(motion, &mut out, &mut Scratch::default());
    let gravity = robot.description().gravity;
    let (mut added, mut nominal) = (0.0, 0.0);
    for (joint, values) in out.iter().enumerate() {
        let columns = library.columns_of_joint(joint);
        for state in 0..states.len {
            let (mut more, mut own) = (0.0, 0.0);
            for (place, &column) in columns.iter().enumerate() {
                let value = values[place * states.len + state];
                match library.model_column(column) {
                    Some(ModelColumn::Inertia { .. }) => more += beta[column] * value,
                    Some(ModelColumn::Gravity { axis }) => own += gravity[*axis] * value,
                    _ => {}
                }
            }
            added += more * more;
            nominal += own * own;
        }
    }
    (nominal > 0.0).then(|| (added / nominal).sqrt())
}
