//! Which joints are coordinates q1…qn, which stand still and which follow another.

use super::names::did_you_mean;
use super::{JointKind, RobotDescription};
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
            let moving = joints
                .iter()
                .filter(|j| j.kind != JointKind::Fixed)
                .map(|j| j.name.as_str());
            return refuse(
                name,
                "is to be locked, but the model has no such joint",
                did_you_mean(name, moving),
            );
        };
        if !position.is_finite() {
            return refuse(
                name,
                format!("is to be locked at {position}"),
                "give a finite position in rad or m",
            );
        }
        if joints[j].kind == JointKind::Fixed {
            let message = format!(
                "joint `{name}` is fixed in the model anyway: its locked position {position} is not used"
            );
            findings.push(Finding::new(
                Severity::Note,
                Code::LockedFixedJoint,
                name,
                message,
                1,
            ));
            continue;
        }
        let limits = &joints[j].limits;
        if limits.lower.is_some_and(|lower| position < lower)
            || limits.upper.is_some_and(|upper| position > upper)
        {
            let message = format!(
                "joint `{name}` is locked at {position}, outside its limits {} to {}",
                limits.lower.unwrap_or(f64::NEG_INFINITY),
                limits.upper.unwrap_or(f64::INFINITY)
            );
            findings.push(Finding::new(
                Severity::Warning,
                Code::LockedBeyondLimits,
                name,
                message,
                1,
            ));
        }
        sources[j] = Some(Source::Still(position));
    }
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
    // What is left mimics: follow each chain to a known end, then come back along it.
    for j in 0..joints.len() {
        let mut chain = Vec::new();
        let mut end = j;
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
        for &follower in chain.iter().rev() {
            let (Some(mimic), Some(source)) = (&joints[follower].mimic, sources[end]) else {
                break;
            };
            let (m, c) = (mimic.multiplier, mimic.offset);
            sources[follower] = Some(match source {
                Source::Still(position) => Source::Still(m * position + c),
                Source::Follows { multiplier, .. } if m * multiplier == 0.0 => {
                    let Source::Follows { offset, .. } = source else {
                        break;
                    };
                    Source::Still(m * offset + c)
                }
                Source::Follows {
                    index,
                    multiplier,
                    offset,
                } => Source::Follows {
                    index,
                    multiplier: m * multiplier,
                    offset: m * offset + c,
                },
            });
            end = follower;
        }
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
