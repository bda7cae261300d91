//! What explains the numbers of one effect: what the model file says beside it, and what its size means.

use crate::calibrate::{Calibration, ComponentSummary};
use crate::error::Code;
use crate::term::Family;

/// Change of the size of gravity, as a share, that no place on earth explains.
const SIZE_OF_GRAVITY: f64 = 0.01;

/// What explains an effect's numbers.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Explanation {
    /// Elements of a link's tensor in the model, and what they would have to be: nothing else of the link was found.
    Tensor(Vec<TensorElement>),
    /// The friction is all of it: what the model file states is no part of the nominal torque.
    AllFriction,
    /// The motor inertia has in it the tensor that this link lacks in the model.
    TensorOfLink(String),
    /// Gravity would be of this size, m/s²: a tilt does not change it.
    SizeOfGravity(f64),
}

/// A diagonal element of a link's tensor, kg·m².
#[derive(Debug, Clone, PartialEq)]
pub struct TensorElement {
    /// Its name: `ixx`, `iyy` or `izz`.
    pub name: String,
    /// In the model.
    pub before: f64,
    /// What was found.
    pub after: f64,
}

/// What explains the numbers of a component of a calibration.
#[must_use]
pub fn explanations(component: &ComponentSummary, calibration: &Calibration) -> Vec<Explanation> {
    let own = (component, calibration);
    let all = [
        tensor(own),
        all_friction(own),
        of_a_point_mass(own),
        size_of_gravity(own),
    ];
    all.into_iter().flatten().collect()
}

/// A component and where it was found.
type Own<'a> = (&'a ComponentSummary, &'a Calibration);

/// The joint of a component that belongs to one.
fn joint_of(component: &ComponentSummary) -> Option<&str> {
    component.name.rsplit_once('.').map(|(joint, _)| joint)
}

fn is_found(calibration: &Calibration, code: Code, subject: &str) -> bool {
    let mut findings = calibration.findings.iter();
    findings.any(|finding| finding.code == code && finding.subject == subject)
}

fn all_friction((component, calibration): Own<'_>) -> Option<Explanation> {
    let friction = [Family::Viscous, Family::Coulomb].contains(&component.family);
    let joint = joint_of(component).filter(|_| friction && component.is_in())?;
    is_found(calibration, Code::UrdfDynamics, joint).then_some(Explanation::AllFriction)
}

/// Motor inertia of a joint whose link has no tensor in the model.
fn of_a_point_mass((component, calibration): Own<'_>) -> Option<Explanation> {
    let joint = joint_of(component).filter(|_| component.family == Family::MotorInertia)?;
    let joints = &calibration.twin.robot.description().joints;
    let link = &joints.iter().find(|own| own.name == joint)?.child;
    (component.is_in() && is_found(calibration, Code::PointMass, link))
        .then(|| Explanation::TensorOfLink(link.clone()))
}

/// A tensor's elements in the model and as found: known where nothing else of the link was found, and no other link is fixed to it.
fn tensor((component, calibration): Own<'_>) -> Option<Explanation> {
    let link = component.name.strip_suffix(".tensor")?;
    if !component.is_in() || !is_alone(link, calibration) {
        return None;
    }
    let links = &calibration.twin.robot.description().links;
    let inertia = links.iter().find(|own| own.name == link)?.inertia?;
    let axis = |letter: char| "xyz".find(letter);
    let elements = component.parameters.iter().filter_map(|parameter| {
        let mut letters = parameter.name.strip_prefix('i')?.chars();
        let (i, j) = (axis(letters.next()?)?, axis(letters.next()?)?);
        let before = inertia.tensor[i][j];
        let (change, _) = parameter.told();
        let worth = parameter.seen && i == j && before > 0.0 && change.is_finite();
        worth.then(|| TensorElement {
            name: parameter.name.clone(),
            before,
            after: before + change,
        })
    });
    let elements: Vec<_> = elements.collect();
    (!elements.is_empty()).then_some(Explanation::Tensor(elements))
}

/// Whether the tensor is all that was found of a link, and the link all of its body that has inertia.
fn is_alone(link: &str, calibration: &Calibration) -> bool {
    let levels = ["density", "mass_moments"].map(|level| format!("{link}.{level}"));
    let mut found = calibration.components.iter().filter(|other| other.is_in());
    let robot = &calibration.twin.robot;
    let last = robot.links_of_body(robot.bodies().len().saturating_sub(1));
    let others = found.any(|other| {
        levels.contains(&other.name) || other.family.is_payload() && last.contains(&link)
    });
    // Links that are fixed to it are part of the body whose tensor changes.
    let of_body = match robot.body_of_link(link) {
        Some((body, _)) => robot.links_of_body(body),
        None => Vec::new(),
    };
    let links = robot.description().links.iter();
    let heavy = links.filter(|own| own.inertia.is_some() && of_body.contains(&own.name.as_str()));
    !others && heavy.count() <= 1
}

/// A tilt turns gravity; what changes its size is something else.
fn size_of_gravity((component, calibration): Own<'_>) -> Option<Explanation> {
    if component.family != Family::Tilt {
        return None;
    }
    let nominal = calibration.twin.robot.description().gravity;
    let changed = |axis: usize| {
        let names = ["x", "y", "z"];
        let own = component.parameters.iter().find(|p| p.name == names[axis]);
        let change = own.map_or(0.0, |p| p.told().0);
        nominal[axis] + if change.is_finite() { change } else { 0.0 }
    };
    let size = |g: [f64; 3]| g.iter().map(|g| g * g).sum::<f64>().sqrt();
    let (before, after) = (size(nominal), size([0, 1, 2].map(changed)));
    ((after / before - 1.0).abs() > SIZE_OF_GRAVITY).then_some(Explanation::SizeOfGravity(after))
}
