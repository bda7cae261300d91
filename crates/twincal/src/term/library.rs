//! The library: all candidates of one robot in order, judged, compiled into one tape and one pass over the model.

mod carried;
mod judged;
mod linearised;

use super::candidate::{Candidate, Joint, Proposal};
use super::component::{Component, Meaning};
use super::course::Course;
use super::expression::{Graph, Id, Slot, Tape, Variable, bounded_values};
use super::linearisation::Linearisation;
use super::mixture::Mixture;
use super::model_column::{ModelColumn, ModelColumns, Scratch};
use super::motions::{channels, random_motions};
use super::overlaps;
use super::parameter::{Before, Parameter};
use super::parts::{self, Parts, Torque};
use super::payload::NAME as PAYLOAD;
use super::propose::{About, proposals};
use super::recipes::Recipes;
use super::sentence::{Estimate, sentence};
use super::table::Table;
use super::{Family, LibrarySettings, Status, Term, user};
use crate::error::{Error, Finding, Result};
use crate::robot::{JointKind, Motion, Robot};
use std::sync::Arc;

/// Ordered terms for one robot, ready to be evaluated. Column k of the regression is the k-th term whose status is
/// [`Status::Candidate`].
#[derive(Debug, Clone)]
pub struct Library {
    terms: Vec<Term>,
    components: Vec<Component>,
    /// "viscous friction on elbow", one per term.
    stories: Vec<String>,
    /// Prior sd of the coefficient where physics says one, one per term.
    prior_sds: Vec<Option<f64>>,
    /// φ of each term that is a Lagrangian written as an expression.
    lagrangians: Vec<Option<Id>>,
    /// `(joint, torque)` of each term that is an expression, zero entries left out.
    images: Vec<Vec<(usize, Id)>>,
    /// Terms that are made from the robot model, with the joints where they are not zero by structure.
    sources: Vec<Option<(ModelColumn, Vec<usize>)>>,
    graph: Arc<Graph>,
    columns: Vec<usize>,
    by_joint: Vec<Vec<usize>>,
    tape: Arc<Tape>,
    model: Option<Arc<ModelColumns>>,
    parts: Arc<Parts>,
    /// As the settings say.
    payload_frame: Option<String>,
    /// Parameters of each component that its coefficients mix to.
    mixtures: Vec<Option<Arc<Mixture>>>,
    /// No motion tells its tensor from its mass and first moments.
    payload_is_one: bool,
    /// `None`: about the model as it is.
    linearised: Option<Arc<Linearisation>>,
}

impl Library {
    /// Builds, judges and compiles the candidates for `robot`.
    ///
    /// Order: the user's expressions, generic family, then family by family as in [`Family::NAMED`], joint by joint or link
    /// by link. A total time derivative (its torque is 0 for every motion) becomes [`Status::NullLagrangian`]; a term whose
    /// torque is a combination of others for every motion becomes [`Status::AliasOf`], where the user's expressions stay
    /// before friction, offset and motor inertia, these before generic ones, and the earlier before the later. Every user
    /// term that is dropped is a finding. Components of several columns and those made from the robot model are never
    /// dropped for what others span: they are other stories, told apart by data or said to be one.
    ///
    /// # Errors
    /// [`Error::Term`] for an expression that cannot be read or is nowhere a finite number; [`Error::Setting`] for
    /// settings out of range, too many terms, or no column at all.
    ///
    /// # Source
    /// Paper eq. (2)–(4), method sections 2 and 3.
    ///
    /// # Example
    /// ```
    /// # #[path = "../../examples/two_link.rs"] mod two_link;
    /// use twincal::term::{Family, Library, LibrarySettings, Status};
    ///
    /// # let robot = two_link::arm(2.0)?;
    /// let settings = LibrarySettings {
    ///     terms: vec!["sin(q1 - q2)".into(), "qd1".into()], // in ΔL
    ///     generic: Some(false),
    ///     families: vec![Family::Viscous],
    ///     ..LibrarySettings::default()
    /// };
    /// let (library, findings) = Library::propose(&robot, &settings)?;
    /// let names = library.columns().iter().map(|&term| &library.terms()[term].name);
    /// assert!(names.eq(["sin(q1 - q2)", "shoulder.viscous", "elbow.viscous"]));
    /// assert_eq!(library.terms()[1].status, Status::NullLagrangian); // its torque is 0 for every motion
    /// assert!(findings.iter().any(|finding| finding.subject == "qd1"));
    /// # Ok::<(), twincal::Error>(())
    /// ```
    pub fn propose(robot: &Robot, settings: &LibrarySettings) -> Result<(Self, Vec<Finding>)> {
        Self::build(&About::robot(robot, &joints(robot)), settings, None)
    }

    /// [`Library::propose`] with another v_s than this library of the same robot, all else being equal: what is judged at random motions
    /// stays as it is, since it does not depend on v_s.
    ///
    /// # Errors
    /// Those of [`Library::propose`].
    pub(crate) fn turning(&self, robot: &Robot, settings: &LibrarySettings) -> Result<Self> {
        let joints = joints(robot);
        let about = About::robot(robot, &joints);
        Ok(Self::build(&about, settings, Some(self))?.0)
    }

    /// [`Library::propose`], also for joints without their robot; `like`: what was judged already.
    pub(super) fn build(
        about: &About<'_>,
        settings: &LibrarySettings,
        like: Option<&Self>,
    ) -> Result<(Self, Vec<Finding>)> {
        let joints = about.joints;
        let mut findings = Vec::new();
        let mut graph = Graph::default();
        let proposed = proposals(&mut graph, about, settings, &mut findings)?;
        let (components, mut candidates) = flattened(proposed);
        user::fill_units(&graph, joints, &mut candidates);
        let model = about
            .robot
            .map(|robot| ModelColumns::new(Arc::new(robot.clone())));
        let home = home(&components, candidates.len());
        let (statuses, acting) = match like {
            Some(like) => like.judged(&mut candidates),
            None => {
                let shares = |k: usize| components[home[k]].terms.len() > 1;
                let about = (joints.len(), model.as_ref());
                judged::judged(&graph, &mut candidates, about, &shares, &mut findings)?
            }
        };

        let mixtures = (components.iter())
            .map(|component| candidates[component.terms[0]].mixture.take().map(Arc::new))
            .collect();
        graph.forget_derivatives();
        let mut library = Self {
            components,
            graph: Arc::new(graph),
            model: model.map(Arc::new),
            payload_frame: settings.payload_frame.clone(),
            mixtures,
            ..Self::empty(joints.len())
        };
        library.add_terms(candidates, (statuses, acting), &home);
        library.compile();
        if library.columns.is_empty() {
            return Err(Error::Setting {
                key: "library".to_owned(),
                problem: format!("none of its {} terms is a column", library.terms.len()),
                remedy: "add terms, or allow friction, offset, motor inertia or the generic family"
                    .to_owned(),
            });
        }
        library.find_aliases(like);
        if let (Some(robot), false) = (about.robot, settings.linearised_at.is_empty()) {
            library = library.linearised(robot, &settings.linearised_at)?;
        }
        Ok((library, findings))
    }

    /// Without a term.
    fn empty(joints: usize) -> Self {
        Self {
            terms: Vec::new(),
            components: Vec::new(),
            stories: Vec::new(),
            prior_sds: Vec::new(),
            lagrangians: Vec::new(),
            images: Vec::new(),
            sources: Vec::new(),
            graph: Arc::default(),
            columns: Vec::new(),
            by_joint: vec![Vec::new(); joints],
            tape: Arc::default(),
            model: None,
            parts: Arc::default(),
            payload_frame: None,
            mixtures: Vec::new(),
            payload_is_one: false,
            linearised: None,
        }
    }

    /// Adds judged candidates as terms; `home`: the component of each.
    fn add_terms(
        &mut self,
        candidates: Vec<Candidate>,
        (statuses, acting): judged::Judged,
        home: &[usize],
    ) {
        let judged = candidates.into_iter().zip(statuses).zip(acting);
        for (index, ((candidate, status), acting)) in judged.enumerate() {
            self.terms.push(Term {
                name: candidate.name,
                family: candidate.family,
                unit: candidate.unit,
                status,
                component: home[index],
            });
            self.stories.push(candidate.story);
            self.prior_sds.push(candidate.prior_sd);
            self.lagrangians.push(candidate.lagrangian);
            self.images.push(candidate.image);
            self.sources
                .push(candidate.model.map(|column| (column, acting)));
        }
    }

    /// Which components span the same torque for every motion; `like`: a library of the same robot where it is known.
    fn find_aliases(&mut self, like: Option<&Self>) {
        let names = match like {
            Some(like) => {
                self.payload_is_one = like.payload_is_one;
                let components = like.components.iter();
                components
                    .map(|component| component.alias_of.clone())
                    .collect()
            }
            None => {
                let joints = self.joints();
                let states = random_motions(joints);
                self.payload_is_one = overlaps::payload_is_one(self, joints, &states);
                overlaps::spanning(self, joints, &states)
            }
        };
        for (component, names) in self.components.iter_mut().zip(names) {
            component.alias_of = names;
        }
    }

    /// As if motion told the payload from the link that carries it: where it acts in some of the logs alone.
    pub(crate) fn with_payload_apart(&self) -> Self {
        let mut apart = self.clone();
        for component in &mut apart.components {
            if component.name == PAYLOAD {
                component.alias_of.clear();
            }
            component.alias_of.retain(|name| name != PAYLOAD);
        }
        apart
    }

    /// Numbers the columns and compiles their torque.
    fn compile(&mut self) {
        self.columns = (0..self.terms.len())
            .filter(|&k| self.terms[k].status == Status::Candidate)
            .collect();
        self.by_joint.iter_mut().for_each(Vec::clear);
        let mut outputs = Vec::new();
        let mut model = self.model.as_ref().map(|model| model.emptied());
        for (column, &term) in self.columns.iter().enumerate() {
            let by_joint = &mut self.by_joint;
            let mut row_on = |joint: usize| {
                by_joint[joint].push(column);
                by_joint[joint].len() - 1
            };
            for &(joint, image) in &self.images[term] {
                let row = row_on(joint);
                outputs.push((image, Slot { table: joint, row }));
            }
            if let (Some((source, joints)), Some(model)) = (&self.sources[term], &mut model) {
                let slots = joints.iter().map(|&joint| (joint, row_on(joint)));
                model.push(source.clone(), slots.collect());
            }
        }
        self.tape = Arc::new(Tape::new(&self.graph, &outputs));
        self.model = model.map(Arc::new);
        let torques = self.columns.iter().map(|&term| match &self.sources[term] {
            Some((source, joints)) => Torque::Model(source, joints),
            None => Torque::Expression(&self.images[term]),
        });
        let joints = self.by_joint.len();
        let mut parts = Parts::new(&self.graph, self.model.as_deref(), joints, torques);
        if let Some(factors) = self.factors() {
            parts = parts.scaled(&factors);
        }
        self.parts = Arc::new(parts);
    }

    /// All terms, dropped ones included, in order.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }

    /// All components, in order; every term belongs to one.
    pub fn components(&self) -> &[Component] {
        &self.components
    }

    /// Number of moving joints.
    pub fn joints(&self) -> usize {
        self.by_joint.len()
    }

    /// Root mean square of each column over random states and all joints, N·m per unit of β: how large it is when joints
    /// move. NaN for a column that is no number at some of them.
    pub fn typical_sizes(&self) -> Vec<f64> {
        let joints = self.by_joint.len();
        let states = random_motions(joints);
        let [q, qd, qdd] = channels(&states, joints);
        let motion = Motion {
            len: states.len(),
            q: &q,
            qd: &qd,
            qdd: &qdd,
        };
        let mut out = vec![Vec::new(); joints];
        self.evaluate(motion, &mut out);
        let mut square = vec![0.0; self.columns.len()];
        for (columns, out) in self.by_joint.iter().zip(&out) {
            for (&column, values) in columns.iter().zip(out.chunks_exact(states.len())) {
                square[column] += values.iter().map(|x| x * x).sum::<f64>();
            }
        }
        let count = (states.len() * joints) as f64;
        square.iter().map(|sum| (sum / count).sqrt()).collect()
    }

    /// Prior sd of each column's coefficient in its own unit where physics says one.
    pub fn prior_sds(&self) -> Vec<Option<f64>> {
        self.columns
            .iter()
            .map(|&term| self.prior_sds[term])
            .collect()
    }

    /// The parameters that people know a component by.
    ///
    /// # Panics
    /// If there is no such component.
    pub fn parameters(&self, component: usize) -> Vec<Parameter> {
        let index = component;
        let component = &self.components[component];
        let columns: Vec<(String, String)> = component
            .terms
            .iter()
            .map(|&term| {
                let Term { name, unit, .. } = &self.terms[term];
                let own = name.strip_prefix(&component.name).unwrap_or(name);
                let own = own.strip_prefix('.').unwrap_or(own);
                let own = if own.is_empty() { "value" } else { own };
                (own.to_owned(), unit.clone())
            })
            .collect();
        self.meaning(index).parameters(&columns)
    }

    /// Values of [`Library::parameters`] at coefficients `beta`, one per term of the component (0 for dropped ones).
    pub fn parameter_values(&self, component: usize, beta: &[f64]) -> Vec<f64> {
        self.meaning(component).values(beta)
    }

    /// What is known before the data of a parameter that is not its term's.
    pub(crate) fn before(&self, component: usize, parameter: usize) -> Option<Before> {
        let terms = self.components[component].terms.iter();
        let live: Vec<bool> = terms
            .map(|&term| self.terms[term].status == Status::Candidate)
            .collect();
        self.meaning(component).before(parameter, &live)
    }

    fn meaning(&self, component: usize) -> Meaning<'_> {
        let mixture = self.mixtures[component].as_deref();
        Meaning::of(self.components[component].family, mixture)
    }

    /// The same library for a robot with other inertias and the same joints.
    pub fn on(&self, robot: &Robot) -> Self {
        self.in_log(robot, true)
    }

    /// True if parameter `parameter` of a component is the coefficient of its term at the same place.
    pub fn is_coefficient(&self, component: usize, parameter: usize) -> bool {
        match self.meaning(component) {
            Meaning::Coefficients => true,
            Meaning::Mixture(_) => false,
            Meaning::Payload(_) | Meaning::Spring => parameter == 0,
        }
    }

    /// A component with its parameters in one sentence, e.g. "payload at tool0: +1.20 ± 0.03 kg, centre of mass (0, 2, 61)
    /// ± 4 mm".
    pub fn component_words(&self, component: usize, parameters: &[Estimate]) -> String {
        sentence(&self.components[component], parameters)
    }

    /// Least value of a term's coefficient if friction, motor inertia and stiffness cannot be negative: minus what the model has; −∞
    /// where any value is physical. (A joint that a spring drives away from a position inside its range has a potential.)
    ///
    /// # Panics
    /// If there is no such term or the robot is another one.
    pub fn least_value(&self, term: usize, robot: &Robot) -> f64 {
        let Term { name, family, .. } = &self.terms[term];
        let joint = |suffix: &str| {
            let own = name.strip_suffix(suffix)?;
            let index = robot.joint_names().iter().position(|joint| *joint == own)?;
            Some(robot.joint(index))
        };
        match family {
            Family::Viscous => joint(".viscous").map_or(0.0, |joint| -joint.damping),
            Family::MotorInertia => joint(".motor_inertia").map_or(0.0, |joint| -joint.armature),
            Family::Coulomb
            | Family::CoupledFriction
            | Family::CoupledInertia
            | Family::Hysteresis => 0.0,
            Family::Spring => match joint(".spring.stiffness") {
                Some(joint) => -joint.stiffness,
                None => UNBOUNDED,
            },
            _ => f64::NEG_INFINITY,
        }
    }

    /// Index in `terms()` of each column, ascending.
    pub fn columns(&self) -> &[usize] {
        &self.columns
    }

    /// `(joint, torque)` of a column that is an expression, nodes of [`Library::graph`].
    pub(crate) fn image(&self, column: usize) -> &[(usize, Id)] {
        &self.images[self.columns[column]]
    }

    /// All expressions.
    pub(crate) fn graph(&self) -> &Graph {
        &self.graph
    }

    /// What a column is made of where it comes from the robot model.
    pub(crate) fn model_column(&self, column: usize) -> Option<&ModelColumn> {
        let source = self.sources[self.columns[column]].as_ref();
        source.map(|(source, _)| source)
    }

    /// Columns that are not zero for every motion on `joint` (0-based), ascending.
    pub fn columns_of_joint(&self, joint: usize) -> &[usize] {
        &self.by_joint[joint]
    }

    /// The library without these columns (indices into [`Library::columns`]), which were zero on all data: their terms
    /// become [`Status::ZeroColumn`], the columns behind them move up.
    pub fn without_columns(&self, columns: &[usize]) -> Self {
        let mut rest = self.clone();
        for &column in columns {
            rest.terms[self.columns[column]].status = Status::ZeroColumn;
        }
        rest.compile();
        rest
    }

    /// Evaluates every column on every joint where it is not structurally zero: for joint j and the i-th entry of
    /// `columns_of_joint(j)`, `out[j][i * motion.len + sample]`, N·m (N) per unit of β.
    ///
    /// `out` has one vector per joint; each is resized to `columns_of_joint(j).len() * motion.len`.
    ///
    /// # Panics
    /// If `out` or an array of `motion` is shorter than the number of joints demands.
    pub fn evaluate(&self, motion: Motion<'_>, out: &mut [Vec<f64>]) {
        self.evaluate_with(motion, out, &mut Scratch::default());
    }

    /// [`Library::evaluate`] with working memory that is kept between calls: for many short batches.
    pub fn evaluate_with<'a, T: Table>(
        &self,
        course: impl Into<Course<'a>>,
        out: &mut [T],
        scratch: &mut Scratch,
    ) {
        let course = course.into();
        let counts = self.by_joint.iter().map(Vec::len);
        parts::evaluate(
            counts,
            &self.tape,
            self.model.as_deref(),
            course,
            (course.motion.len, out),
            scratch,
        );
        self.scale(course.motion.len, out);
    }

    /// How the columns of a joint follow from the signals of [`Library::evaluate_parts`].
    pub fn recipes(&self, joint: usize) -> &Arc<Recipes> {
        self.parts.recipes(joint)
    }

    /// Evaluates few signals whose fixed linear combinations are all columns: `out[j][part * stride + sample]`, each
    /// vector resized. What is linear (a filter) or quadratic (sums of products) is cheaper before [`Recipes`] are followed than after.
    ///
    /// # Panics
    /// As [`Library::evaluate`], or if `stride` is less than `motion.len`.
    pub fn evaluate_parts<'a, T: Table>(
        &self,
        course: impl Into<Course<'a>>,
        stride: usize,
        out: &mut [T],
        scratch: &mut Scratch,
    ) {
        let course = course.into();
        let len = course.motion.len;
        assert!(
            stride >= len,
            "signals of {len} samples every {stride} numbers"
        );
        self.parts.evaluate(course, stride, out, scratch);
    }

    /// φ(q, q̇) of a term (index into [`Library::terms`]) at one state, J per unit of β; `None` where the term
    /// dissipates and has no Lagrangian. `q` and `qd` have one entry per joint.
    pub fn lagrangian(&self, term: usize, q: &[f64], qd: &[f64]) -> Option<f64> {
        let phi = self.lagrangians[term]?;
        let values = bounded_values(&self.graph, |variable| match variable {
            Variable::Position(joint) => q[joint],
            Variable::Velocity(joint) => qd[joint],
            Variable::Acceleration(_) | Variable::History(_) => 0.0, // no Lagrangian holds one
        });
        Some(values[phi.0 as usize].value)
    }

    /// What a term (index into [`Library::terms`]) is, in words: "viscous friction on elbow".
    pub fn story(&self, term: usize) -> &str {
        &self.stories[term]
    }

    /// A term (index into [`Library::terms`]) with its coefficient in one sentence, e.g.
    /// "viscous friction on elbow: +0.120 ± 0.010 N·m·s/rad"; `spread` is half the width of the central 68.3 % interval, `ends` what is
    /// told where ± does not describe it. NaN: no model that counts holds it.
    pub fn words(&self, term: usize, value: f64, spread: f64, ends: Option<[f64; 2]>) -> String {
        let story = &self.stories[term];
        if !value.is_finite() {
            return format!("{story}: {}", super::words::NO_MODEL);
        }
        // A payload is judged by its mass, which is not each of its terms.
        let family = Some(self.terms[term].family).filter(|family| *family != Family::Payload);
        let remark = family.and_then(|family| family.remark(value, spread));
        let remark = remark.map_or_else(String::new, |remark| format!(" ({remark})"));
        let number = match ends {
            None => super::words::estimate(value, spread),
            Some(ends) => super::words::with_ends(value, ends),
        };
        format!("{story}: {number} {}{remark}", self.terms[term].unit)
    }
}

/// Components and their columns, numbered.
fn flattened(proposed: Vec<Proposal>) -> (Vec<Component>, Vec<Candidate>) {
    let mut components = Vec::with_capacity(proposed.len());
    let mut candidates: Vec<Candidate> = Vec::new();
    for Proposal { name, columns } in proposed {
        let (first, count) = (candidates.len(), columns.len());
        if let Some(column) = columns.first() {
            components.push(Component {
                name,
                family: column.family,
                story: column.story.clone(),
                terms: (first..first + count).collect(),
                alias_of: Vec::new(),
            });
        }
        candidates.extend(columns);
    }
    (components, candidates)
}

/// The moving joints of a robot.
fn joints(robot: &Robot) -> Vec<Joint> {
    let names = robot.joint_names();
    let joint = |(index, name): (usize, &&str)| Joint {
        index,
        name: (*name).to_owned(),
        slides: robot.joint_kind(index) == JointKind::Prismatic,
    };
    names.iter().enumerate().map(joint).collect()
}

/// Component of each term.
fn home(components: &[Component], terms: usize) -> Vec<usize> {
    let mut home = vec![0; terms];
    for (index, component) in components.iter().enumerate() {
        component.terms.iter().for_each(|&term| home[term] = index);
    }
    home
}

/// Bound that never acts: all columns of a component have bounds, or none.
const UNBOUNDED: f64 = -1e100;
