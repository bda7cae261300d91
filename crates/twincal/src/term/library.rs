//! The library: all candidates of one robot in order, judged, compiled into one tape.

use super::aliases::{Verdict, judge};
use super::candidate::{Candidate, Joint};
use super::expression::{Graph, Id, Scratch, Slot, Tape, Variable, bounded_values};
use super::{
    Family, LibrarySettings, Status, Term, coulomb, generic, motor_inertia, offset, user, viscous,
};
use crate::error::{Error, Finding, Result, Severity};
use crate::robot::{JointKind, Motion, Robot};
use std::sync::Arc;

/// Most terms a library may have.
const TERM_LIMIT: usize = 1000;
/// Joints up to which the generic family is proposed unasked.
const GENERIC_JOINTS: usize = 3;

/// Ordered terms for one robot, ready to be evaluated. Column k of the regression is the k-th term whose status is
/// [`Status::Candidate`].
#[derive(Debug, Clone)]
pub struct Library {
    terms: Vec<Term>,
    /// "viscous friction on elbow", one per term.
    stories: Vec<String>,
    /// φ of each term that is a Lagrangian.
    lagrangians: Vec<Option<Id>>,
    /// `(joint, torque)` of each term, zero entries left out.
    images: Vec<Vec<(usize, Id)>>,
    graph: Arc<Graph>,
    columns: Vec<usize>,
    by_joint: Vec<Vec<usize>>,
    tape: Arc<Tape>,
}

impl Library {
    /// Builds, judges and compiles the candidates for `robot`.
    ///
    /// Order: the user's expressions, generic family, then for each of viscous friction, Coulomb friction, offset and
    /// motor inertia the joints in order. A total time derivative (its torque is 0 for every motion) becomes
    /// [`Status::NullLagrangian`]; a term whose torque is a combination of others for every motion becomes
    /// [`Status::AliasOf`], where the user's expressions stay before friction, offset and motor inertia, these before
    /// generic ones, and the earlier before the later. Every user term that is dropped is a finding.
    ///
    /// # Errors
    /// [`Error::Term`] for an expression that cannot be read or is nowhere a finite number; [`Error::Setting`] for
    /// settings out of range, too many terms, or no column at all.
    ///
    /// # Source
    /// Paper eq. (2)–(4), method sections 2 and 3.
    pub fn propose(robot: &Robot, settings: &LibrarySettings) -> Result<(Self, Vec<Finding>)> {
        let names = robot.joint_names();
        let joint = |(index, name): (usize, &&str)| Joint {
            index,
            name: (*name).to_owned(),
            slides: robot.joint_kind(index) == JointKind::Prismatic,
        };
        let joints: Vec<Joint> = names.iter().enumerate().map(joint).collect();
        Self::build(&joints, robot.is_planar(), settings)
    }

    /// [`Library::propose`] for joints without their robot.
    pub(super) fn build(
        joints: &[Joint],
        parallel: bool,
        settings: &LibrarySettings,
    ) -> Result<(Self, Vec<Finding>)> {
        let mut findings = Vec::new();
        let mut graph = Graph::default();
        let mut candidates = candidates(&mut graph, joints, parallel, settings, &mut findings)?;
        user::fill_units(&graph, joints, &mut candidates);
        let verdicts = judge(&graph, &mut candidates, joints.len());
        let statuses = statuses(&graph, &candidates, &verdicts, &mut findings)?;

        graph.forget_derivatives();
        let mut library = Self {
            terms: Vec::new(),
            stories: Vec::new(),
            lagrangians: Vec::new(),
            images: Vec::new(),
            graph: Arc::new(graph),
            columns: Vec::new(),
            by_joint: vec![Vec::new(); joints.len()],
            tape: Arc::default(),
        };
        for (candidate, status) in candidates.into_iter().zip(statuses) {
            let Candidate {
                name,
                family,
                unit,
                story,
                lagrangian,
                image,
            } = candidate;
            library.terms.push(Term {
                name,
                family,
                unit,
                status,
            });
            library.stories.push(story);
            library.lagrangians.push(lagrangian);
            library.images.push(image);
        }
        library.compile();
        if library.columns.is_empty() {
            return Err(Error::Setting {
                key: "library".to_owned(),
                problem: format!("none of its {} terms is a column", library.terms.len()),
                remedy: "add terms, or allow friction, offset, motor inertia or the generic family"
                    .to_owned(),
            });
        }
        Ok((library, findings))
    }

    /// Numbers the columns and compiles their torque.
    fn compile(&mut self) {
        self.columns = (0..self.terms.len())
            .filter(|&k| self.terms[k].status == Status::Candidate)
            .collect();
        self.by_joint.iter_mut().for_each(Vec::clear);
        let mut outputs = Vec::new();
        for (column, &term) in self.columns.iter().enumerate() {
            for &(joint, image) in &self.images[term] {
                outputs.push((
                    image,
                    Slot {
                        table: joint,
                        row: self.by_joint[joint].len(),
                    },
                ));
                self.by_joint[joint].push(column);
            }
        }
        self.tape = Arc::new(Tape::new(&self.graph, &outputs));
    }

    /// All terms, dropped ones included, in order.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }

    /// Index in `terms()` of each column, ascending.
    pub fn columns(&self) -> &[usize] {
        &self.columns
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
    pub fn evaluate_with(&self, motion: Motion<'_>, out: &mut [Vec<f64>], scratch: &mut Scratch) {
        for (columns, out) in self.by_joint.iter().zip(out.iter_mut()) {
            out.resize(columns.len() * motion.len, 0.0);
        }
        self.tape.evaluate(motion, out, scratch);
    }

    /// φ(q, q̇) of a term (index into [`Library::terms`]) at one state, J per unit of β; `None` where the term
    /// dissipates and has no Lagrangian. `q` and `qd` have one entry per joint.
    pub fn lagrangian(&self, term: usize, q: &[f64], qd: &[f64]) -> Option<f64> {
        let phi = self.lagrangians[term]?;
        let values = bounded_values(&self.graph, |variable| match variable {
            Variable::Position(joint) => q[joint],
            Variable::Velocity(joint) => qd[joint],
            Variable::Acceleration(_) => 0.0, // no Lagrangian holds one
        });
        Some(values[phi.0 as usize].value)
    }

    /// A term (index into [`Library::terms`]) with its coefficient in one sentence, e.g.
    /// "viscous friction on elbow: +0.120 ± 0.010 N·m·s/rad".
    pub fn words(&self, term: usize, mean: f64, sd: f64) -> String {
        // What no motor or brake can do on its own is said of the model.
        let hint = match self.terms[term].family {
            Family::MotorInertia if mean < 0.0 => {
                " (negative: the model has too much inertia there)"
            }
            Family::Viscous | Family::Coulomb if mean < 0.0 => {
                " (negative: the model has too much friction there)"
            }
            _ => "",
        };
        format!(
            "{}: {} {}{hint}",
            self.stories[term],
            super::words::estimate(mean, sd),
            self.terms[term].unit
        )
    }
}

/// All candidates in the order of `terms[]`.
fn candidates(
    graph: &mut Graph,
    joints: &[Joint],
    parallel: bool,
    settings: &LibrarySettings,
    findings: &mut Vec<Finding>,
) -> Result<Vec<Candidate>> {
    let velocity = settings.coulomb_velocity;
    if !(velocity.is_finite()
        && velocity >= 0.0
        && (velocity == 0.0 || (1.0 / velocity).is_finite()))
    {
        return Err(Error::Setting {
            key: "library.coulomb_velocity".to_owned(),
            problem: format!("{velocity} is not a velocity"),
            remedy: "give 0 or a positive number, rad/s".to_owned(),
        });
    }
    let generic = settings.generic.unwrap_or(joints.len() <= GENERIC_JOINTS);
    if settings.generic.is_none() && !generic {
        findings.push(Finding::new(
            Severity::Note,
            "generic_family_off",
            "",
            format!(
                "the robot has {} moving joints: the generic family, which has {} terms for them, is proposed unasked up \
                 to {GENERIC_JOINTS} joints only; name the terms you want in [library] terms",
                joints.len(),
                generic::count(joints, parallel)
            ),
            0,
        ));
    }
    let count = settings.terms.len() as f64
        + if generic {
            generic::count(joints, parallel)
        } else {
            0.0
        };
    if count > TERM_LIMIT as f64 {
        return Err(Error::Setting {
            key: if settings.terms.len() > TERM_LIMIT {
                "library.terms"
            } else {
                "library.generic"
            }
            .to_owned(),
            problem: format!(
                "{count} terms for {} joints, the limit is {TERM_LIMIT}",
                joints.len()
            ),
            remedy: "name the terms you want in `terms` and set `generic = false`".to_owned(),
        });
    }

    let mut all = Vec::new();
    for text in &settings.terms {
        all.push(user::candidate(graph, text, Family::User, joints)?);
    }
    if generic {
        for name in generic::names(joints, parallel) {
            all.push(user::candidate(graph, &name, Family::Generic, joints)?);
        }
    }
    if settings.viscous {
        all.extend(joints.iter().map(|joint| viscous::candidate(graph, joint)));
    }
    if settings.coulomb {
        all.extend(
            joints
                .iter()
                .map(|joint| coulomb::candidate(graph, joint, velocity)),
        );
    }
    if settings.offset {
        all.extend(joints.iter().map(|joint| offset::candidate(graph, joint)));
    }
    if settings.motor_inertia {
        all.extend(
            joints
                .iter()
                .map(|joint| motor_inertia::candidate(graph, joint)),
        );
    }
    Ok(all)
}

/// Verdicts as statuses, with a finding for everything the user wrote in vain.
fn statuses(
    graph: &Graph,
    candidates: &[Candidate],
    verdicts: &[Verdict],
    findings: &mut Vec<Finding>,
) -> Result<Vec<Status>> {
    let mut repeated = Vec::new();
    let mut statuses = Vec::with_capacity(candidates.len());
    for (candidate, verdict) in candidates.iter().zip(verdicts) {
        let name = &candidate.name;
        let severity = if candidate.family == Family::User {
            Severity::Warning
        } else {
            Severity::Note
        };
        statuses.push(match verdict {
            Verdict::New => Status::Candidate,
            Verdict::NeverFinite(states) => {
                return Err(Error::Term {
                    term: name.clone(),
                    column: 1,
                    problem: format!("it or its torque is not a finite number at any of {states} random states"),
                    remedy: "check the domains of log, sqrt and powers, and divisions by zero".to_owned(),
                });
            }
            Verdict::Null => {
                let why = if candidate.lagrangian.is_some_and(|phi| graph.as_constant(phi).is_some()) {
                    "it is constant"
                } else {
                    "it is the time derivative of a function of q"
                };
                let message =
                    format!("term `{name}` has no torque for any motion ({why}): it is no column; delete it or correct it");
                findings.push(Finding::new(severity, "null_lagrangian", name, message, 1));
                Status::NullLagrangian
            }
            Verdict::NotCompared => {
                let message = format!(
                    "term `{name}` is a finite number at too few states to be compared with the others: whether it repeats \
                     one of them was not checked; write it so that it exists for all motions of the robot"
                );
                findings.push(Finding::new(severity, "alias_unchecked", name, message, 1));
                Status::Candidate
            }
            Verdict::Combination(combination) => {
                let others: Vec<&str> = combination.iter().map(|&(_, k)| candidates[k].name.as_str()).collect();
                if candidate.family == Family::User {
                    let formula: Vec<String> =
                        combination.iter().map(|&(factor, k)| share(factor, &candidates[k].name)).collect();
                    let message = format!(
                        "term `{name}` has the same torque as {} for every motion: it is no column; keep one of them",
                        formula.join(" ")
                    );
                    findings.push(Finding::new(severity, "alias", name, message, 1));
                } else {
                    repeated.push(format!("{name} (by {})", others.join(", ")));
                }
                Status::AliasOf(others.join(","))
            }
        });
    }
    if !repeated.is_empty() {
        let shown = repeated
            .iter()
            .take(10)
            .cloned()
            .collect::<Vec<_>>()
            .join("; ");
        let more = if repeated.len() > 10 {
            format!("; and {} more", repeated.len() - 10)
        } else {
            String::new()
        };
        let message = format!(
            "built-in terms whose torque others have for every motion are no columns: {shown}{more}"
        );
        findings.push(Finding::new(
            Severity::Note,
            "alias",
            "",
            message,
            repeated.len() as u64,
        ));
    }
    Ok(statuses)
}

/// "+2 × `name`", with six significant digits.
fn share(factor: f64, name: &str) -> String {
    let rounded: f64 = format!("{factor:.5e}").parse().unwrap_or(factor);
    if (1e-4..1e6).contains(&rounded.abs()) {
        format!("{rounded:+} × `{name}`")
    } else {
        format!("{rounded:+e} × `{name}`")
    }
}
