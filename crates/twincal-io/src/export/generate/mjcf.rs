//! A whole MJCF: nested bodies, hinges and slides, equalities for mimicking joints, a motor per moving joint.

use super::super::edit::{digits, list};
use super::super::mjcf::{quaternion, six};
use super::{Plan, attribute, nonzero};
use crate::error::{Error, Place, Result};
use crate::model::xml::MAX_DEPTH;
use std::fmt::Write as _;
use twincal::robot::spatial::IDENTITY;
use twincal::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Placement, principal_axes,
};
use twincal::words::quoted;

/// The name that MuJoCo reserves for the base.
const WORLD: &str = "world";
/// Levels of elements around and inside the bodies: `<mujoco>`, `<worldbody>`, `<inertial>`.
const AROUND: usize = 3;
/// Share of a robot's mass, and of its largest moment of inertia, that a moving link without any gets.
const TINY: f64 = 1e-12;
/// Least mass, kg, and least moment, kg·m², that MuJoCo takes with certainty.
const LEAST: f64 = 1e-13;
/// By how much of the largest principal moment the triangle inequality holds in the file: twelve digits round it.
const MARGIN: f64 = 1e-11;
/// Excess of the largest moment, as a share of it, that counts as rounding.
const ROUNDING: f64 = 1e-8;

/// The file's text; inertias in the plan become those that are written.
pub(super) fn write(plan: &mut Plan) -> Result<String> {
    let (children, below, root) = plan.tree();
    refuse_names(plan, root)?;
    let order = walk(&children, &below, root);
    refuse_depth(plan, &order)?;
    make_acceptable(plan, &children, &below, root)?;
    note_limits(plan);
    note_order(plan, &order);
    let description = &plan.description;
    let mut text = format!("<mujoco model=\"{}\">\n", attribute(&description.name));
    text += &plan
        .comment("MJCF")
        .replace("<!--", "  <!--")
        .replace("\n     ", "\n       ");
    text += "  <compiler angle=\"radian\" autolimits=\"true\"/>\n";
    let _ = writeln!(
        text,
        "  <option gravity=\"{}\"/>",
        list(&description.gravity)
    );
    text += "  <worldbody>\n";
    let has_base = description.links[root].name != WORLD;
    if has_base {
        open(&mut text, plan, &description.links[root], None, 2);
    }
    let base = usize::from(has_base);
    for step in &order {
        match *step {
            Step::Open { joint, depth } => {
                let link = &description.links[children[joint]];
                let joint = &description.joints[joint];
                open(&mut text, plan, link, Some(joint), depth + base + 1);
            }
            Step::Close { depth } => {
                let _ = writeln!(text, "{}</body>", "  ".repeat(depth + base + 1));
            }
        }
    }
    if has_base {
        text += "    </body>\n";
    }
    text += "  </worldbody>\n";
    equalities(&mut text, &description.joints);
    actuators(&mut text, &description.joints);
    text += "</mujoco>\n";
    Ok(text)
}

/// A step of the walk over the tree; `depth`: bodies around it and itself, without the base.
enum Step {
    Open { joint: usize, depth: usize },
    Close { depth: usize },
}

/// Depth first, each parent's joints in the model's order. No recursion.
fn walk(children: &[usize], below: &[Vec<usize>], root: usize) -> Vec<Step> {
    let mut steps = Vec::new();
    let push = |stack: &mut Vec<Step>, link: usize, depth: usize| {
        let joints = below[link].iter().rev();
        stack.extend(joints.map(|&joint| Step::Open { joint, depth }));
    };
    let mut stack = Vec::new();
    push(&mut stack, root, 1);
    while let Some(step) = stack.pop() {
        if let Step::Open { joint, depth } = step {
            stack.push(Step::Close { depth });
            push(&mut stack, children[joint], depth + 1);
        }
        steps.push(step);
    }
    steps
}

/// Names that MJCF has another meaning for.
fn refuse_names(plan: &Plan, root: usize) -> Result<()> {
    let links = plan.description.links.iter().enumerate();
    let mut worlds = links.filter(|(number, link)| *number != root && link.name == WORLD);
    match worlds.next() {
        None => Ok(()),
        Some((number, _)) => Err(Error::content(
            Place::file(&plan.from),
            format!(
                "link `world` (number {}) is not the base, and an MJCF calls the base so",
                number + 1
            ),
            "rename the link and fit again, or use --to urdf",
        )),
    }
}

/// More bodies in each other than readers take.
fn refuse_depth(plan: &Plan, order: &[Step]) -> Result<()> {
    let depths = order.iter().filter_map(|step| match step {
        Step::Open { joint, depth } => Some((*depth, *joint)),
        Step::Close { .. } => None,
    });
    let Some((depth, joint)) = depths.max() else {
        return Ok(());
    };
    let limit = MAX_DEPTH - AROUND - 1;
    if depth <= limit {
        return Ok(());
    }
    let problem = format!(
        "{depth} joints lie between the base and link {}; bodies of an MJCF stand inside each other, at most {limit} deep",
        quoted([&plan.description.joints[joint].child])
    );
    let remedy = "merge links that fixed joints hold, or use --to urdf";
    Err(Error::content(Place::file(&plan.from), problem, remedy))
}

/// Gives moving links what MuJoCo asks of a body: a mass, and principal moments A ≤ B ≤ C above 0 with A + B ≥ C.
fn make_acceptable(
    plan: &mut Plan,
    children: &[usize],
    below: &[Vec<usize>],
    root: usize,
) -> Result<()> {
    let moves = moving_links(plan, children, below, root);
    let mut has_joint = vec![false; moves.len()];
    for (joint, child) in plan.description.joints.iter().zip(children) {
        has_joint[*child] = joint.kind != JointKind::Fixed;
    }
    let (mass, moment) = least_inertia(&plan.description.links);
    let (mut small, mut unused) = (Vec::new(), Vec::new());
    for (number, link) in plan.description.links.iter_mut().enumerate() {
        let Some(inertia) = link.inertia.as_mut() else {
            if has_joint[number] {
                link.inertia = Some(Inertia {
                    mass,
                    com: [0.0; 3],
                    tensor: IDENTITY.map(|row| row.map(|one| moment * one)),
                });
                small.push(link.name.clone());
            }
            continue;
        };
        match lifted(inertia, moment) {
            Ok(is_small) => {
                if inertia.mass < mass || is_small {
                    small.push(link.name.clone());
                }
                inertia.mass = inertia.mass.max(mass);
            }
            Err(_) if !moves[number] => {
                link.inertia = None;
                unused.push(link.name.clone());
            }
            Err(moments) => return Err(no_body(&plan.from, &link.name, moments)),
        }
    }
    if plan.description.links[root].name == WORLD && plan.description.links[root].inertia.is_some()
    {
        plan.description.links[root].inertia = None;
        unused.push(WORLD.into());
    }
    note_small(plan, [mass, moment], &small);
    if !unused.is_empty() {
        plan.notes.push(format!(
            "Inertia of links that do not move is left out: {}.",
            quoted(&unused)
        ));
    }
    Ok(())
}

/// Least mass, kg, and least moment, kg·m², of a moving link.
fn least_inertia(links: &[LinkDescription]) -> (f64, f64) {
    let inertias = || links.iter().filter_map(|link| link.inertia);
    let total: f64 = inertias().map(|inertia| inertia.mass).sum();
    let traces = inertias().map(|own| (0..3).map(|k| own.tensor[k][k]).sum());
    let largest = traces.fold(0.0_f64, f64::max);
    ((TINY * total).max(LEAST), (TINY * largest).max(LEAST))
}

/// Says which links got a mass, kg, or a moment, kg·m², that the model does not have.
fn note_small(plan: &mut Plan, [mass, moment]: [f64; 2], links: &[String]) {
    if !links.is_empty() {
        plan.notes.push(format!(
            "MuJoCo refuses moving bodies without mass or moments of inertia: at least {} kg and {} kg·m² stand at {}.",
            digits(mass),
            digits(moment),
            quoted(links)
        ));
    }
}

/// True for links with a moving joint between them and the base.
fn moving_links(plan: &Plan, children: &[usize], below: &[Vec<usize>], root: usize) -> Vec<bool> {
    let mut moves = vec![false; plan.description.links.len()];
    let mut stack = vec![root];
    while let Some(link) = stack.pop() {
        for &joint in &below[link] {
            let is_fixed = plan.description.joints[joint].kind == JointKind::Fixed;
            moves[children[joint]] = moves[link] || !is_fixed;
            stack.push(children[joint]);
        }
    }
    moves
}

/// Adds to the diagonal of the tensor what is missing for A + B ≥ C and A ≥ `moment`; true where A was below it.
///
/// # Errors
/// The principal moments, where more than rounding is.
fn lifted(inertia: &mut Inertia, moment: f64) -> std::result::Result<bool, [f64; 3]> {
    let (moments, _) = principal_axes(&inertia.tensor);
    let [a, b, c] = moments;
    let excess = c - a - b;
    if excess > ROUNDING * c || a < -ROUNDING * c {
        return Err(moments);
    }
    let lift = (excess + MARGIN * c).max(moment - a).max(0.0);
    for (k, row) in inertia.tensor.iter_mut().enumerate() {
        row[k] += lift;
    }
    Ok(a < moment)
}

fn no_body(from: &str, link: &str, moments: [f64; 3]) -> Error {
    let [a, b, c] = moments.map(digits);
    Error::content(
        Place::file(from),
        format!(
            "link {} has principal moments {a}, {b} and {c} kg·m², and MuJoCo refuses a body whose largest one is above the sum of the others or whose smallest one is not above 0",
            quoted([link])
        ),
        "correct the link's inertia in the model and fit again, or use --to urdf",
    )
}

/// Limits of the model that no MJCF states.
fn note_limits(plan: &mut Plan) {
    let joints = || plan.description.joints.iter();
    let speeds = joints().filter(|joint| joint.limits.velocity.is_some_and(|v| v > 0.0));
    let speeds: Vec<&str> = speeds.map(|joint| joint.name.as_str()).collect();
    let stated = |joint: &&JointDescription| {
        joint.kind != JointKind::Continuous
            && (joint.limits.lower.is_some() || joint.limits.upper.is_some())
    };
    let odd = joints().filter(|joint| stated(joint) && range(joint).is_none());
    let odd: Vec<&str> = odd.map(|joint| joint.name.as_str()).collect();
    let mut notes = Vec::new();
    if !speeds.is_empty() {
        notes.push(format!(
            "An MJCF cannot hold velocity limits: {}.",
            quoted(&speeds)
        ));
    }
    if !odd.is_empty() {
        notes.push(format!(
            "Position limits are left out where the lower one is missing or not below the upper one: {}.",
            quoted(&odd)
        ));
    }
    plan.notes.extend(notes);
}

/// MuJoCo numbers joints as the bodies stand in the file.
fn note_order(plan: &mut Plan, order: &[Step]) {
    let names: Vec<&str> = (order.iter())
        .filter_map(|step| match step {
            Step::Open { joint, .. } => Some(plan.description.joints[*joint].name.as_str()),
            Step::Close { .. } => None,
        })
        .filter(|name| plan.coordinates.iter().any(|own| own == name))
        .collect();
    if names != plan.coordinates {
        let note = format!(
            "Joints have another order than in the twin: {}.",
            quoted(&names)
        );
        plan.notes.push(note);
    }
}

/// `<body>` with its inertia and joint, left open.
fn open(
    text: &mut String,
    plan: &Plan,
    link: &LinkDescription,
    joint: Option<&JointDescription>,
    level: usize,
) {
    let indent = "  ".repeat(level);
    let inside = "  ".repeat(level + 1);
    let pose = joint.map_or(String::new(), |joint| pose(&joint.placement));
    let _ = writeln!(
        text,
        "{indent}<body name=\"{}\"{pose}>",
        attribute(&link.name)
    );
    text.push_str(&plan.warning(&link.name, &inside));
    if let Some(Inertia { mass, com, tensor }) = link.inertia {
        let _ = writeln!(
            text,
            "{inside}<inertial pos=\"{}\" mass=\"{}\" fullinertia=\"{}\"/>",
            list(&com),
            digits(mass),
            list(&six(&tensor))
        );
    }
    if let Some(joint) = joint.filter(|joint| joint.kind != JointKind::Fixed) {
        let _ = writeln!(text, "{inside}<joint {}/>", joint_attributes(joint));
    }
}

/// ` pos="…" quat="…"`, each only where it is not that of the parent.
fn pose(placement: &Placement) -> String {
    let mut text = String::new();
    if placement.translation != [0.0; 3] {
        let _ = write!(text, " pos=\"{}\"", list(&placement.translation));
    }
    if placement.rotation != IDENTITY {
        let _ = write!(text, " quat=\"{}\"", list(&quaternion(&placement.rotation)));
    }
    text
}

fn joint_attributes(joint: &JointDescription) -> String {
    let mut text = format!("name=\"{}\"", attribute(&joint.name));
    if joint.kind == JointKind::Prismatic {
        text += " type=\"slide\"";
    }
    let _ = write!(text, " axis=\"{}\"", list(&joint.axis));
    if let Some(range) = range(joint) {
        let _ = write!(text, " range=\"{}\"", list(&range));
    }
    text += &nonzero("damping", joint.damping);
    text += &nonzero("frictionloss", joint.unused_friction);
    text += &nonzero("armature", joint.armature);
    text += &nonzero("stiffness", joint.stiffness);
    if joint.stiffness != 0.0 {
        text += &nonzero("springref", joint.spring_reference);
    }
    if let Some(effort) = effort(joint) {
        let _ = write!(text, " actuatorfrcrange=\"{}\"", list(&[-effort, effort]));
    }
    text
}

/// Position limits that MuJoCo takes.
fn range(joint: &JointDescription) -> Option<[f64; 2]> {
    let (lower, upper) = joint.limits.lower.zip(joint.limits.upper)?;
    let is_range = lower.is_finite() && upper.is_finite() && lower < upper;
    (is_range && joint.kind != JointKind::Continuous).then_some([lower, upper])
}

/// Largest torque or force; a limit of 0 is a placeholder.
fn effort(joint: &JointDescription) -> Option<f64> {
    joint
        .limits
        .effort
        .filter(|effort| effort.is_finite() && *effort > 0.0)
}

/// `<equality>`: q = offset + multiplier · q of the other.
fn equalities(text: &mut String, joints: &[JointDescription]) {
    let moves = joints.iter().filter(|joint| joint.kind != JointKind::Fixed);
    let mimics: Vec<_> = moves
        .filter_map(|joint| Some((joint, joint.mimic.as_ref()?)))
        .collect();
    if mimics.is_empty() {
        return;
    }
    text.push_str("  <equality>\n");
    for (joint, mimic) in mimics {
        let _ = writeln!(
            text,
            "    <joint joint1=\"{}\" joint2=\"{}\" polycoef=\"{} 0 0 0\"/>",
            attribute(&joint.name),
            attribute(&mimic.joint),
            list(&[mimic.offset, mimic.multiplier])
        );
    }
    text.push_str("  </equality>\n");
}

/// `<actuator>`: a motor per joint that follows none, with the joint's name.
fn actuators(text: &mut String, joints: &[JointDescription]) {
    text.push_str("  <actuator>\n");
    let drives =
        |joint: &&JointDescription| joint.kind != JointKind::Fixed && joint.mimic.is_none();
    for joint in joints.iter().filter(drives) {
        let name = attribute(&joint.name);
        let limit = effort(joint).map_or(String::new(), |effort| {
            format!(" ctrlrange=\"{}\"", list(&[-effort, effort]))
        });
        let _ = writeln!(text, "    <motor name=\"{name}\" joint=\"{name}\"{limit}/>");
    }
    text.push_str("  </actuator>\n");
}
