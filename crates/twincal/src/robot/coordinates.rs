//! Which joints are coordinates q1…qn, which stand still and which follow another.

use super::names::did_you_mean;
use super::{JointDescription, JointKind, RobotDescription};
use crate::error::{Code, Error, Finding, Result, Severity};
use std::collections::BTreeMap;

/// Where a joint's position comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Source {
    /// It stands at this position, rad or m.
    Still(f64),
    /// `position = multiplier · q[index] + offset`.
    Follows {
        /// 0-based coordinate.
        index: usize,
        /// Ratio of velocities; 1 for the coordinate's own joint.
        multiplier: f64,
        /// Position at q = 0.
        offset: f64,
    },
}

fn refuse<T>(joint: &str, problem: impl Into<String>, remedy: impl Into<String>) -> Result<T> {
    Err(Error::Model {
        culprit: format!("joint `{joint}`"),
        problem: problem.into(),
        remedy: remedy.into(),
    })
}

/// One [`Source`] per joint, and the joint index of each coordinate in the file's order.
///
/// # Errors
/// [`Error::Model`] for a locked or mimicked name that does not exist, a mimic loop, a robot that cannot move.
pub(crate) fn assign(
    description: &RobotDescription,
    locked: &BTreeMap<String, f64>,
    findings: &mut Vec<Finding>,
) -> Result<(Vec<Source>, Vec<usize>)> {
    let joints = &description.joints;
    let by_name: BTreeMap<&str, usize> = joints
        .iter()
        .enumerate()
        .map(|(i, j)| (j.name.as_str(), i))
        .collect();
    let mut sources: Vec<Option<Source>> = vec![None; joints.len()];
    for (name, &position) in locked {
        let Some(&j) = by_name.get(name.as_str()) else {
            return unknown_locked(joints, name);
        };
        sources[j] = lock(&joints[j], position, findings)?;
    }
    let coordinates = number_coordinates(joints, &mut sources);
    // What is left mimics: follow each chain to a known end, then come back along it.
    for j in 0..joints.len() {
        let (chain, end) = mimic_chain(joints, &by_name, &sources, j)?;
        come_back(joints, &chain, end, &mut sources);
    }
    if coordinates.is_empty() {
        return Err(Error::Model {
            culprit: format!("robot `{}`", description.name),
            problem: format!(
                "none of its {} joints can move ({} locked)",
                joints.len(),
                locked.len()
            ),
            remedy: "leave at least one revolute, continuous or prismatic joint unlocked".into(),
        });
    }
    Ok((
        sources
            .into_iter()
            .map(|s| s.unwrap_or(Source::Still(0.0)))
            .collect(),
        coordinates,
    ))
}

/// The error of a locked joint that the model does not have.
fn unknown_locked<T>(joints: &[JointDescription], name: &str) -> Result<T> {
    let moving = joints
        .iter()
        .filter(|j| j.kind != JointKind::Fixed)
        .map(|j| j.name.as_str());
    refuse(
        name,
        "is to be locked, but the model has no such joint",
        did_you_mean(name, moving),
    )
}

/// Source of a joint that is locked at a position; `None` if it is fixed anyway.
fn lock(
    joint: &JointDescription,
    position: f64,
    findings: &mut Vec<Finding>,
) -> Result<Option<Source>> {
    let name = &joint.name;
    if !position.is_finite() {
        return refuse(
            name,
            format!("is to be locked at {position}"),
            "give a finite position in rad or m",
        );
    }
    if joint.kind == JointKind::Fixed {
        let message = format!(
            "joint `{name}` is fixed in the model anyway: its locked position {position} is not used"
        );
        findings.push(
            Finding::new(Severity::Note, Code::LockedFixedJoint, name, message, 1)
                .with([("position", position)]),
        );
        return Ok(None);
    }
    let limits = &joint.limits;
    if limits.lower.is_some_and(|lower| position < lower)
        || limits.upper.is_some_and(|upper| position > upper)
    {
        let message = format!(
            "joint `{name}` is locked at {position}, outside its limits {} to {}",
            limits.lower.unwrap_or(f64::NEG_INFINITY),
            limits.upper.unwrap_or(f64::INFINITY)
        );
        findings.push(
            Finding::new(
                Severity::Warning,
                Code::LockedBeyondLimits,
                name,
                message,
                1,
            )
            .with([
                ("position", position),
                ("low", limits.lower.unwrap_or(f64::NAN)),
                ("high", limits.upper.unwrap_or(f64::NAN)),
            ]),
        );
    }
    Ok(Some(Source::Still(position)))
}

/// Gives fixed joints their position and every joint that moves by itself a coordinate; the joints of the coordinates.
fn number_coordinates(joints: &[JointDescription], sources: &mut [Option<Source>]) -> Vec<usize> {
    let mut coordinates = Vec::new();
    for (j, joint) in joints.iter().enumerate() {
        if joint.kind == JointKind::Fixed {
            sources[j] = Some(Source::Still(0.0));
        } else if sources[j].is_none() && joint.mimic.is_none() {
            sources[j] = Some(Source::Follows {
                index: coordinates.len(),
                multiplier: 1.0,
                offset: 0.0,
            });
            coordinates.push(j);
        }
    }
    coordinates
}

/// Joints from `start` on of which each mimics the next, and the one that the last of them mimics, whose source is known.
fn mimic_chain(
    joints: &[JointDescription],
    by_name: &BTreeMap<&str, usize>,
    sources: &[Option<Source>],
    start: usize,
) -> Result<(Vec<usize>, usize)> {
    let mut chain = Vec::new();
    let mut end = start;
    while sources[end].is_none() {
        let Some(mimic) = &joints[end].mimic else {
            break;
        };
        let name = &joints[end].name;
        if chain.len() > joints.len() || mimic.joint == *name {
            return refuse(
                name,
                format!("mimics `{}` in a loop", mimic.joint),
                "let one joint of the loop move",
            );
        }
        if !(mimic.multiplier.is_finite() && mimic.offset.is_finite()) {
            return refuse(
                name,
                format!(
                    "mimics with multiplier {} and offset {}",
                    mimic.multiplier, mimic.offset
                ),
                "give finite numbers",
            );
        }
        let Some(&target) = by_name.get(mimic.joint.as_str()) else {
            return refuse(
                name,
                format!("mimics `{}`, which does not exist", mimic.joint),
                did_you_mean(&mimic.joint, by_name.keys().copied()),
            );
        };
        if joints[target].kind == JointKind::Fixed {
            return refuse(
                name,
                format!("mimics `{}`, which is fixed", mimic.joint),
                "make it a fixed joint too",
            );
        }
        chain.push(end);
        end = target;
    }
    Ok((chain, end))
}

/// Gives every joint of a chain its source, from the known end back to the start.
fn come_back(
    joints: &[JointDescription],
    chain: &[usize],
    end: usize,
    sources: &mut [Option<Source>],
) {
    let mut end = end;
    for &follower in chain.iter().rev() {
        let (Some(mimic), Some(source)) = (&joints[follower].mimic, sources[end]) else {
            break;
        };
        sources[follower] = Some(mimicked(source, mimic.multiplier, mimic.offset));
        end = follower;
    }
}

/// Source of a joint at `m · position + c` of another.
fn mimicked(source: Source, m: f64, c: f64) -> Source {
    match source {
        Source::Still(position) => Source::Still(m * position + c),
        Source::Follows {
            multiplier, offset, ..
        } if m * multiplier == 0.0 => Source::Still(m * offset + c),
        Source::Follows {
            index,
            multiplier,
            offset,
        } => Source::Follows {
            index,
            multiplier: m * multiplier,
            offset: m * offset + c,
        },
    }
}
