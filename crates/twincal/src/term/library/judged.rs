//! What is judged of candidates at random motions: which are columns, and on which joints they act.

use super::super::Status;
use super::super::aliases::judge;
use super::super::candidate::Candidate;
use super::super::expression::Graph;
use super::super::model_column::{ModelColumn, ModelColumns, Scratch};
use super::super::motions::{Motions, channels, random_motions};
use super::super::verdicts::statuses;
use super::Library;
use crate::error::{Finding, Result};
use crate::robot::Motion;

/// A model column's torque on a joint below this share of the largest of its kind is zero by structure.
const STRUCTURAL_ZERO: f64 = 1e-10;

/// Status of every candidate, and the joints that those of the robot model act on.
pub(super) type Judged = (Vec<Status>, Vec<Vec<usize>>);

/// Judges all candidates of `joints` joints, and removes the entries of their images that are zero for every motion.
///
/// # Errors
/// Those of [`statuses`].
pub(super) fn judged(
    graph: &Graph,
    candidates: &mut [Candidate],
    (joints, model): (usize, Option<&ModelColumns>),
    shares: &dyn Fn(usize) -> bool,
    findings: &mut Vec<Finding>,
) -> Result<Judged> {
    let sources: Vec<(usize, ModelColumn)> = sources(candidates);
    let acting = match model {
        Some(model) => acting_joints(model, candidates, joints),
        None => vec![Vec::new(); candidates.len()],
    };
    let at = |motions: &[&Motions]| match model {
        Some(model) => {
            let mut all = torques(model, &sources, motions, joints);
            // What rounding leaves of a torque that is zero by structure points somewhere, and would stand for whatever points there too.
            for (k, torque) in &mut all {
                for (entry, value) in torque.iter_mut().enumerate() {
                    if !acting[*k].contains(&(entry % joints)) {
                        *value = 0.0;
                    }
                }
            }
            all
        }
        None => Vec::new(),
    };
    let verdicts = judge(graph, candidates, joints, shares, &at);
    let statuses = statuses(graph, candidates, &verdicts, &acting, findings)?;
    Ok((statuses, acting))
}

impl Library {
    /// The same of its own candidates, built once more.
    pub(super) fn judged(&self, candidates: &mut [Candidate]) -> Judged {
        for (candidate, image) in candidates.iter_mut().zip(&self.images) {
            let acts = |joint: usize| image.iter().any(|entry| entry.0 == joint);
            candidate.image.retain(|&(joint, _)| acts(joint));
        }
        let statuses = self.terms.iter().map(|term| term.status.clone()).collect();
        let acting = |source: &Option<(ModelColumn, Vec<usize>)>| match source {
            Some((_, acting)) => acting.clone(),
            None => Vec::new(),
        };
        (statuses, self.sources.iter().map(acting).collect())
    }
}

/// Candidates that are made from the robot model.
fn sources(candidates: &[Candidate]) -> Vec<(usize, ModelColumn)> {
    let with_source = |(k, candidate): (usize, &Candidate)| Some((k, candidate.model.clone()?));
    candidates
        .iter()
        .enumerate()
        .filter_map(with_source)
        .collect()
}

/// Torque of model columns on all joints at some states: `(candidate, torque[state * joints + joint])`.
fn torques(
    model: &ModelColumns,
    sources: &[(usize, ModelColumn)],
    motions: &[&Motions],
    joints: usize,
) -> Vec<(usize, Vec<f64>)> {
    let len = motions.len();
    let mut all = model.emptied();
    for (row, (_, source)) in sources.iter().enumerate() {
        let slots = (0..joints).map(|joint| (joint, row)).collect();
        all.push(source.clone(), slots);
    }
    let [q, qd, qdd] = channels(motions, joints);
    let motion = Motion {
        len,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let mut out = vec![vec![0.0; sources.len() * len]; joints];
    all.evaluate(motion, motion.len, &mut out, &mut Scratch::default());
    sources
        .iter()
        .enumerate()
        .map(|(row, &(k, _))| {
            let value = |state: usize, joint: usize| out[joint][row * len + state];
            let torque = (0..len).flat_map(|state| (0..joints).map(move |joint| (state, joint)));
            (k, torque.map(|(s, j)| value(s, j)).collect())
        })
        .collect()
}

/// Joints on which each model column is not zero by structure, from random states.
fn acting_joints(model: &ModelColumns, candidates: &[Candidate], joints: usize) -> Vec<Vec<usize>> {
    let mut acting = vec![Vec::new(); candidates.len()];
    let sources = sources(candidates);
    let motions = random_motions(joints);
    let motions: Vec<&Motions> = motions.iter().collect();
    let torques = torques(model, &sources, &motions, joints);
    let size = |torque: &[f64]| torque.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let largest = |unit: &str| {
        let same = torques.iter().filter(|(k, _)| candidates[*k].unit == unit);
        same.map(|(_, torque)| size(torque)).fold(0.0, f64::max)
    };
    for (k, torque) in &torques {
        let limit = STRUCTURAL_ZERO * largest(&candidates[*k].unit);
        acting[*k] = (0..joints)
            .filter(|&joint| {
                let own = torque.iter().skip(joint).step_by(joints);
                own.fold(0.0_f64, |m, x| m.max(x.abs())) > limit
            })
            .collect();
    }
    acting
}
