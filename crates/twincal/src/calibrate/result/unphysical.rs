//! Found inertias that no rigid body has (case 94).

use super::calibration::Calibration;
use super::status::{Status, StatusReason};
use crate::error::{Code, Finding, Severity};
use crate::posterior::draws::Drawer;
use crate::random::Random;
use crate::rigid_body::Found;
use crate::robot::{PARAMETERS, Robot, base_parameters, inertia_of, principal_axes};
use crate::term::{Library, ModelColumn};
use crate::words::significant;

/// Draws that are looked at.
const DRAWS: usize = 1000;
/// Random stream of those draws.
const STREAM: u64 = (1 << 32) + 2;
/// The first of those of the chances, one per body.
const CHANCES: u64 = 3 << 60;
/// Chance below which the found inertia contradicts every rigid body; above, it is uncertain.
const CONTRADICTS: f64 = 0.01;
/// Share below which it is worth telling.
const WORTH_TELLING: f64 = 0.5;
/// Behind the words of a component that contradicts every rigid body.
const NO_BODY: &str = "; physically inconsistent inertia";
/// Rounding in the triangle inequality, as a share of the largest moment.
const ROUNDING: f64 = 1e-9;
/// The same share for draws: a point mass or a thin rod lies on the bound, and half of what is found of it beyond.
const NEARLY: f64 = 0.01;

/// A found inertia that is none.
pub(in crate::calibrate) struct Unphysical {
    finding: Finding,
    /// Share of the draws that are those of a rigid body.
    share: f64,
    /// Chance that a rigid body is found as far from every one.
    chance: f64,
    /// What was found of it.
    components: Vec<usize>,
}

/// One finding for each body with a found inertial component of which fewer than half of the posterior draws are those of a
/// rigid body: positive mass and a positive semidefinite pseudo-inertia, which is that the principal moments about the
/// centre of mass obey the triangle inequality. Where torque shows nothing of the moments across the joint's axis, only
/// the mass and the moment about the axis are judged.
///
/// Few such draws are no contradiction: a point mass lies at a corner of what bodies can be, and whoever knows its tensor poorly draws
/// hardly ever a body. The found inertia contradicts every body where even the nearest one would be found as far off with a chance of less
/// than a hundredth ([`Found::chance`]).
///
/// # Source
/// Wensing, Kim, Slotine 2018 (linear matrix inequalities for physically consistent inertial parameters).
pub(in crate::calibrate) fn findings(
    robot: &Robot,
    library: &Library,
    calibration: &Calibration,
    drawer: &Drawer<'_>,
    seed: u64,
) -> Vec<Unphysical> {
    let component = |column: usize| library.terms()[library.columns()[column]].component;
    let is_in = |component: usize| calibration.components[component].is_in();
    let columns = columns_of_bodies(robot, library);
    let is_asked =
        |own: &Vec<(usize, [f64; 10])>| own.iter().any(|(column, _)| is_in(component(*column)));
    if !columns.iter().any(is_asked) {
        return Vec::new();
    }
    let hidden = base_parameters(robot).unidentifiable;
    let draws = drawer.draw(DRAWS, seed, STREAM);
    let count = draws.models.len();
    let mut all = Vec::new();
    for (body, name) in robot.bodies().into_iter().enumerate() {
        let across = ["Ixx", "Iyy"].map(|moment| hidden.contains(&format!("{name}.{moment}")));
        let whole = !across.contains(&true);
        let nominal = robot.parameters_of_body(body);
        if !is_asked(&columns[body]) || !is_physical(&nominal, whole, ROUNDING) {
            continue;
        }
        let parameters = |row: usize| {
            let beta = &draws.beta[row * draws.columns..(row + 1) * draws.columns];
            let mut parameters = nominal;
            for (column, weights) in &columns[body] {
                for (parameter, weight) in parameters.iter_mut().zip(weights) {
                    *parameter += weight * beta[*column];
                }
            }
            parameters
        };
        let drawn: Vec<[f64; 10]> = (0..count).map(parameters).collect();
        let bodies = drawn.iter().filter(|own| is_physical(own, whole, NEARLY));
        let share = bodies.count() as f64 / count.max(1) as f64;
        if share < WORTH_TELLING {
            let hidden = PARAMETERS.map(|own| !whole && hidden.contains(&format!("{name}.{own}")));
            let mut random = Random::new(seed, CHANCES + body as u64);
            let chance = found(&drawn, nominal, hidden).chance(&mut random);
            // Where rounding hides it the draws decide.
            let chance = chance.unwrap_or(share);
            let of_columns = columns[body].iter().map(|(column, _)| component(*column));
            let mut components: Vec<usize> = of_columns.collect();
            components.dedup();
            components.retain(|component| is_in(*component));
            all.push(Unphysical {
                finding: finding(name, share, chance),
                share,
                chance,
                components,
            });
        }
    }
    all
}

/// Columns that change the inertia of each body, with what they change.
fn columns_of_bodies(robot: &Robot, library: &Library) -> Vec<Vec<(usize, [f64; 10])>> {
    let mut columns = vec![Vec::new(); robot.bodies().len()];
    for column in 0..library.columns().len() {
        if let Some(ModelColumn::Inertia { body, weights }) = library.model_column(column) {
            columns[*body].push((column, *weights));
        }
    }
    columns
}

/// Says it, and at once where the numbers stand.
pub(in crate::calibrate) fn tell(calibration: &mut Calibration, unphysical: Vec<Unphysical>) {
    for Unphysical {
        finding,
        share,
        chance,
        components,
    } in unphysical
    {
        for component in components {
            let own = &mut calibration.components[component];
            own.rigid_share = Some(share);
            own.no_rigid_body = chance < CONTRADICTS;
            if own.no_rigid_body {
                (own.status, own.reason) =
                    (Status::Tentative, StatusReason::NoRigidBody { chance });
                own.words.push_str(NO_BODY);
            }
        }
        calibration.findings.push(finding);
    }
}

/// What the draws say of the body's parameters.
fn found(drawn: &[[f64; 10]], nominal: [f64; 10], hidden: [bool; 10]) -> Found {
    let count = drawn.len().max(1) as f64;
    let mean: [f64; 10] =
        std::array::from_fn(|k| drawn.iter().map(|own| own[k]).sum::<f64>() / count);
    let mut covariance = vec![0.0; 100];
    for own in drawn {
        for (at, value) in covariance.iter_mut().enumerate() {
            let (i, j) = (at / 10, at % 10);
            *value += (own[i] - mean[i]) * (own[j] - mean[j]) / count;
        }
    }
    Found {
        nominal,
        mean,
        covariance,
        hidden,
    }
}

fn finding(link: &str, share: f64, chance: f64) -> Finding {
    let (severity, remedy) = if chance < CONTRADICTS {
        (
            Severity::Warning,
            "torque is predicted as measured, but do not read these numbers as a body: either these logs show its tensor \
             too little (faster motion of that joint would), or an effect is missing among the candidates, or inertias of the model are wrong",
        )
    } else {
        (
            Severity::Note,
            "these logs leave its inertia open: motion that shows more of it would narrow it",
        )
    };
    Finding::new(
        severity,
        Code::UnphysicalInertiaFound,
        link,
        format!(
            "link `{link}`: {:.1} % of the posterior draws of its inertia (with what it carries) are those of a rigid body (p-value {}); \
             {remedy}",
            100.0 * share,
            significant(chance, 2)
        ),
        0,
    )
    .with([("share", share), ("chance", chance)])
}

/// Positive mass, and moments that a distribution of mass can have; without `whole` only the one about z.
fn is_physical(parameters: &[f64; 10], whole: bool, rounding: f64) -> bool {
    let Some(inertia) = inertia_of(parameters) else {
        return false;
    };
    let ([small, middle, large], _) = principal_axes(&inertia.tensor);
    let rounding = rounding * (large.abs() + parameters[9].abs());
    if whole {
        small >= -rounding && small + middle >= large - rounding
    } else {
        inertia.tensor[2][2] >= -rounding
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rods_and_plates_are_on_the_bound_and_less_is_beyond() {
        // A thin rod of 1 kg and 1 m along x about its end, a plate, and a body whose moments no mass has.
        let rod = [1.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0 / 3.0, 0.0, 1.0 / 3.0];
        let plate = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 3.0];
        let is_physical = |parameters: &[f64; 10], whole| is_physical(parameters, whole, ROUNDING);
        assert!(is_physical(&rod, true) && is_physical(&plate, true));
        let mut wrong = plate;
        wrong[9] = 3.01;
        assert!(!is_physical(&wrong, true) && is_physical(&wrong, false));
        let mut hollow = rod;
        hollow[9] = 0.24; // less than m c²
        assert!(!is_physical(&hollow, false));
        assert!(!is_physical(&[0.0; 10], true));
    }
}
