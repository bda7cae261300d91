//! MJCF bodies and joints into links and joints of a tree.
//!
//! A body with k joints becomes k joints with k − 1 massless links between them. A link's frame has the body's axes and
//! sits on its last joint's anchor (on the body's own origin where there is no hinge).

use super::super::xml::{Document, Element, shorten};
use super::compiler::Compiler;
use super::defaults::{Defaults, View};
use super::inertial::{moved, of_body, shift};
use super::shapes::Placed;
use super::sites::{BodySite, JointSite, Sites};
use crate::error::{Error, Result};
use twincal::robot::spatial::{Matrix, add, apply, axis_angle, norm, scale};
use twincal::robot::{JointDescription, JointKind, Limits, LinkDescription, Placement};
use twincal::{Code, Finding, Severity};

/// An element inside a body, after `<frame>`s are taken away.
#[derive(Debug, Clone)]
pub(super) struct Part<'a> {
    pub(super) element: &'a Element,
    /// The frames around it, in the body's frame.
    pub(super) placement: Placement,
    /// The class for elements that name none.
    pub(super) childclass: Option<&'a str>,
}

/// What the walk over the bodies gathers.
#[derive(Debug)]
pub(super) struct Tree<'a> {
    pub(super) document: &'a Document,
    pub(super) compiler: Compiler,
    pub(super) defaults: Defaults<'a>,
    pub(super) links: Vec<LinkDescription>,
    pub(super) joints: Vec<JointDescription>,
    /// `ref` of each joint, rad or m; 0 for welds.
    pub(super) references: Vec<f64>,
    pub(super) findings: Vec<Finding>,
    pub(super) sites: Sites,
    pub(super) geoms: Vec<Placed<'a>>,
    bodies: usize,
}

/// A body still to be read.
struct Task<'a> {
    element: &'a Element,
    parent: String,
    /// Frame in which the body's own pose is given, in the parent link's frame.
    frame: Placement,
    childclass: Option<&'a str>,
    /// A joint lies between it and the base.
    moves: bool,
}

const WORLD: &str = "world";

impl<'a> Tree<'a> {
    pub(super) fn new(document: &'a Document, compiler: Compiler, defaults: Defaults<'a>) -> Self {
        let links = vec![LinkDescription {
            name: WORLD.into(),
            inertia: None,
        }];
        Self {
            document,
            compiler,
            defaults,
            links,
            joints: vec![],
            references: vec![],
            findings: vec![],
            sites: Sites::default(),
            geoms: vec![],
            bodies: 0,
        }
    }

    /// Reads a `<worldbody>`: bodies depth first, as MuJoCo numbers them. No recursion.
    pub(super) fn read_world(&mut self, world: &'a Element) -> Result<()> {
        let mut tasks = Vec::new();
        let parts = self.parts(world, world.text("childclass"))?;
        if let Some(joint) = parts
            .iter()
            .find(|p| p.element.name == "joint" || p.element.name == "freejoint")
        {
            return Err(self.document.error(
                joint.element,
                "a joint in <worldbody>",
                "put it into a <body>",
            ));
        }
        self.push_geoms(&parts, WORLD, [0.0; 3]);
        self.push_children(&mut tasks, &parts, WORLD, [0.0; 3], false);
        while let Some(task) = tasks.pop() {
            self.read_body(task, &mut tasks)?;
        }
        Ok(())
    }

    fn read_body(&mut self, task: Task<'a>, tasks: &mut Vec<Task<'a>>) -> Result<()> {
        self.bodies += 1;
        let element = task.element;
        let name = match element.text("name") {
            Some(name) if !name.is_empty() => name.to_string(),
            _ => format!("body{}", self.bodies),
        };
        let view = View::plain(self.document, element);
        if view.number("gravcomp")?.unwrap_or(0.0) != 0.0 {
            let message = format!(
                "body `{name}`: gravity compensation (gravcomp) is not part of the nominal torque"
            );
            self.findings.push(Finding::new(
                Severity::Warning,
                Code::GravcompNotUsed,
                &name,
                message,
                1,
            ));
        }
        let parts = self.parts(element, element.text("childclass").or(task.childclass))?;
        // Pose of the body while its joints are at their reference, in the parent link's frame.
        let pose = task.frame.compose(&self.compiler.placement(&view)?);
        let joints: Vec<&Part<'a>> = parts
            .iter()
            .filter(|p| p.element.name == "joint" || p.element.name == "freejoint")
            .collect();
        let moves = task.moves || !joints.is_empty();
        let origin = self.lay_joints(&joints, &name, (task.parent, pose))?;
        let inertia = of_body(
            self.document,
            &self.compiler,
            &self.defaults,
            &parts,
            &name,
            moves,
        )?;
        let inertial = self.inertial_site(&parts)?;
        self.sites.bodies.push(BodySite {
            link: name.clone(),
            offset: element.offset,
            inertial,
            origin,
        });
        self.links.push(LinkDescription {
            name: name.clone(),
            inertia: inertia.map(|i| moved(i, origin)),
        });
        self.push_geoms(&parts, &name, origin);
        self.push_children(tasks, &parts, &name, origin, moves);
        Ok(())
    }

    /// Lays the joints of a body one after the other from its parent link on, a weld where there is none, with the links between them; gives the
    /// origin of the body's link in the body's frame. `pose`: of the body in the frame of `parent`.
    fn lay_joints(
        &mut self,
        joints: &[&Part<'a>],
        name: &str,
        (mut parent, pose): (String, Placement),
    ) -> Result<[f64; 3]> {
        let mut pending = pose; // pose of the next joint's link before that joint, in `parent`
        let mut origin = [0.0; 3]; // origin of `parent`'s frame in the body's frame, once a joint has been laid
        for (k, part) in joints.iter().enumerate() {
            let child = if k + 1 == joints.len() {
                name.to_owned()
            } else {
                format!("{name}.link{}", k + 1)
            };
            let (mut joint, anchor, reference) = self.read_joint(part, name, k)?;
            joint.parent = parent;
            joint.child = child.clone();
            joint.placement = if joint.kind == JointKind::Prismatic {
                // Slid back by the reference; the link keeps its origin.
                pending.compose(&shift(scale(-reference, joint.axis)))
            } else {
                // Onto the anchor, turned back by the reference.
                let step = add(anchor, scale(-1.0, origin));
                origin = anchor;
                let turn = axis_angle(joint.axis, -reference);
                pending.compose(&Placement {
                    rotation: turn,
                    translation: step,
                })
            };
            if k + 1 < joints.len() {
                self.links.push(LinkDescription {
                    name: child.clone(),
                    inertia: None,
                });
            }
            self.joints.push(joint);
            self.references.push(reference);
            parent = child;
            pending = Placement::IDENTITY;
        }
        if joints.is_empty() {
            let mut weld =
                JointDescription::new(&format!("{name}.weld"), JointKind::Fixed, &parent, name);
            weld.placement = pose;
            self.joints.push(weld);
            self.references.push(0.0);
        }
        Ok(origin)
    }

    /// Where the `<inertial>` of a body stands: its place in the file, the frames around it, its own rotation.
    fn inertial_site(&self, parts: &[Part<'a>]) -> Result<Option<(usize, Placement, Matrix)>> {
        let mut site = None;
        for part in parts.iter().filter(|p| p.element.name == "inertial") {
            let view = View::plain(self.document, part.element);
            let own = self.compiler.placement(&view)?.rotation;
            site = Some((part.element.offset, part.placement, own));
        }
        Ok(site)
    }

    /// Geoms of a body, whose link has its origin there.
    fn push_geoms(&mut self, parts: &[Part<'a>], link: &str, origin: [f64; 3]) {
        let geoms = parts.iter().filter(|p| p.element.name == "geom");
        self.geoms.extend(geoms.map(|part| Placed {
            part: part.clone(),
            link: link.to_owned(),
            origin,
        }));
    }

    /// Child bodies as tasks; the last pushed is the next read, so in reverse.
    fn push_children(
        &self,
        tasks: &mut Vec<Task<'a>>,
        parts: &[Part<'a>],
        parent: &str,
        origin: [f64; 3],
        moves: bool,
    ) {
        for part in parts.iter().rev().filter(|p| p.element.name == "body") {
            tasks.push(Task {
                element: part.element,
                parent: parent.into(),
                frame: shift(scale(-1.0, origin)).compose(&part.placement),
                childclass: part.childclass,
                moves,
            });
        }
    }

    /// What stands in a body in document order, `<frame>`s resolved.
    fn parts(&self, body: &'a Element, childclass: Option<&'a str>) -> Result<Vec<Part<'a>>> {
        let mut parts = Vec::new();
        let mut stack = vec![Part {
            element: body,
            placement: Placement::IDENTITY,
            childclass,
        }];
        while let Some(part) = stack.pop() {
            let outer = std::ptr::eq(part.element, body);
            if !outer && part.element.name != "frame" {
                if ["replicate", "composite", "flexcomp", "attach"]
                    .contains(&part.element.name.as_str())
                {
                    return Err(self.document.error(
                        part.element,
                        format!("<{}> makes bodies that are not written out in the file", part.element.name),
                        "save the model as MuJoCo compiled it: in Python m = mujoco.MjModel.from_xml_path(…); \
                         mujoco.mj_saveLastXML('flat.xml', m)",
                    ));
                }
                parts.push(part);
                continue;
            }
            let (mut placement, mut class) = (part.placement, part.childclass);
            if !outer {
                let view = View::plain(self.document, part.element);
                placement = placement.compose(&self.compiler.placement(&view)?);
                class = part.element.text("childclass").or(class);
            }
            for &child in part.element.children.iter().rev() {
                stack.push(Part {
                    element: &self.document.elements[child],
                    placement,
                    childclass: class,
                });
            }
        }
        Ok(parts)
    }

    /// One `<joint>`: the joint without placement, its anchor in the body's frame, its reference position.
    fn read_joint(
        &mut self,
        part: &Part<'a>,
        body: &str,
        number: usize,
    ) -> Result<(JointDescription, [f64; 3], f64)> {
        let view = self
            .defaults
            .view(self.document, part.element, part.childclass)?;
        let name = match part.element.text("name") {
            Some(name) if !name.is_empty() => name.to_string(),
            _ => format!("{body}.joint{}", number + 1),
        };
        let (kind, angle) = self.joint_kind(&view, &name, body)?;
        refuse_nonlinear_springs(&view, &name)?;
        let mut joint = JointDescription::new(&name, kind, "", "");
        joint.axis = joint_axis(&view, &name, &part.placement)?;
        joint.armature = view.number("armature")?.unwrap_or(0.0);
        joint.damping = view.linear("damping")?;
        joint.stiffness = view.linear("stiffness")?;
        joint.spring_reference = angle * view.number("springref")?.unwrap_or(0.0);
        joint.unused_friction = view.number("frictionloss")?.unwrap_or(0.0);
        self.sites.joints.push(JointSite {
            joint: name.clone(),
            offset: part.element.offset,
            angle,
            damping: joint.damping,
            armature: joint.armature,
            frictionloss: joint.unused_friction,
            stiffness: joint.stiffness,
            spring_reference: joint.spring_reference,
        });
        limit(&mut joint, &view, angle, self.compiler.autolimits)?;
        let anchor = part
            .placement
            .point(view.numbers("pos")?.unwrap_or([0.0; 3]));
        let reference = angle * view.number("ref")?.unwrap_or(0.0);
        if part.element.text("name").is_none_or(str::is_empty) {
            self.findings.push(unnamed_joint(&name, body, number));
        }
        if joint.unused_friction != 0.0 {
            self.findings
                .push(unused_friction(&name, joint.unused_friction));
        }
        Ok((joint, anchor, reference))
    }

    /// Hinge or slider, and the radians or metres per unit of its angles.
    fn joint_kind(&self, view: &View<'_, '_>, name: &str, body: &str) -> Result<(JointKind, f64)> {
        let kind = if view.element.name == "freejoint" {
            "free"
        } else {
            view.text("type").unwrap_or("hinge")
        };
        match kind {
            "hinge" => Ok((JointKind::Revolute, self.compiler.angle)),
            "slide" => Ok((JointKind::Prismatic, 1.0)),
            "free" => Err(joint_error(
                view,
                name,
                format!("body `{body}` floats freely"),
                "twincal needs a fixed base: remove the free joint of the robot's root body",
            )),
            other => Err(joint_error(
                view,
                name,
                format!("its type is `{}`", shorten(other)),
                "twincal supports hinge and slide (a ball joint is three hinges)",
            )),
        }
    }
}

/// An error at a joint.
fn joint_error(view: &View<'_, '_>, name: &str, problem: String, remedy: &str) -> Error {
    let problem = format!("joint `{name}`: {problem}");
    view.document.error(view.element, problem, remedy)
}

/// Refuses springs that are not given by a stiffness or are not linear.
fn refuse_nonlinear_springs(view: &View<'_, '_>, name: &str) -> Result<()> {
    if view
        .numbers::<2>("springdamper")?
        .is_some_and(|s| s != [0.0; 2])
    {
        return Err(joint_error(
            view,
            name,
            "its spring and damper follow from springdamper".into(),
            "give stiffness and damping: MuJoCo prints them as m.jnt_stiffness and m.dof_damping",
        ));
    }
    if view.number("springyield")?.is_some_and(|y| y != 0.0) {
        return Err(joint_error(
            view,
            name,
            "its spring yields (springyield)".into(),
            "twincal's nominal torque has linear springs only",
        ));
    }
    Ok(())
}

/// Axis of a joint in the body's frame, of length 1. MuJoCo itself normalises every axis: nothing to report.
fn joint_axis(view: &View<'_, '_>, name: &str, placement: &Placement) -> Result<[f64; 3]> {
    let axis = apply(
        &placement.rotation,
        view.numbers("axis")?.unwrap_or([0.0, 0.0, 1.0]),
    );
    let length = norm(axis);
    if !(length.is_finite() && length > 1e-14) {
        return Err(joint_error(
            view,
            name,
            format!("axis {axis:?} has length {length}"),
            "give a direction other than zero",
        ));
    }
    Ok(scale(1.0 / length, axis))
}

/// Limits of position and effort; a hinge without limits of position is continuous.
fn limit(
    joint: &mut JointDescription,
    view: &View<'_, '_>,
    angle: f64,
    autolimits: bool,
) -> Result<()> {
    let range = view.numbers::<2>("range")?;
    let limited = view
        .flag("limited")
        .unwrap_or(autolimits && range.is_some());
    if let (true, Some([lower, upper])) = (limited, range) {
        joint.limits = Limits {
            lower: Some(angle * lower),
            upper: Some(angle * upper),
            ..joint.limits
        };
    } else if joint.kind == JointKind::Revolute {
        joint.kind = JointKind::Continuous;
    }
    joint.limits.effort = view
        .numbers::<2>("actuatorfrcrange")?
        .map(|[low, high]| low.abs().max(high.abs()));
    Ok(())
}

/// Says what a joint without a name is called.
fn unnamed_joint(name: &str, body: &str, number: usize) -> Finding {
    let message = format!(
        "joint {} of body `{body}` has no name: called `{name}`",
        number + 1
    );
    Finding::new(Severity::Note, Code::UnnamedJoint, name, message, 1)
        .with([("number", (number + 1) as f64)])
}

/// Says that a joint's dry friction is left out.
fn unused_friction(name: &str, friction: f64) -> Finding {
    let message = format!(
        "joint `{name}`: frictionloss {friction} is dry friction and not part of the nominal torque; Coulomb \
         friction is a candidate"
    );
    Finding::new(Severity::Note, Code::FrictionlossNotUsed, name, message, 1)
        .with([("friction", friction)])
}
