//! From names to a tree: unique names, one root, no cycle, every joint after its parent.

use super::RobotDescription;
use super::names::did_you_mean;
use crate::error::{Error, Result};
use std::collections::BTreeMap;

/// Joints in an order in which a parent's joint comes before its child's, with link indices.
#[derive(Debug)]
pub(crate) struct Tree {
    /// Joint indices, parents first.
    pub(crate) order: Vec<usize>,
    /// `(parent, child)` link index per joint.
    pub(crate) links: Vec<(usize, usize)>,
}

fn refuse<T>(culprit: String, problem: impl Into<String>, remedy: impl Into<String>) -> Result<T> {
    Err(Error::Model {
        culprit,
        problem: problem.into(),
        remedy: remedy.into(),
    })
}

/// Index by name; a name used twice is an error.
fn index<'a>(kind: &str, names: impl Iterator<Item = &'a str>) -> Result<BTreeMap<&'a str, usize>> {
    let mut index = BTreeMap::new();
    for (position, name) in names.enumerate() {
        if name.is_empty() {
            return refuse(
                format!("{kind} number {}", position + 1),
                "has no name",
                "give it a unique name",
            );
        }
        if let Some(first) = index.insert(name, position) {
            return refuse(
                format!("{kind} `{name}`"),
                format!(
                    "is defined twice ({kind}s number {} and {})",
                    first + 1,
                    position + 1
                ),
                "rename one of them",
            );
        }
    }
    Ok(index)
}

/// Checks that links and joints form one tree.
///
/// # Errors
/// [`Error::Model`] naming the link or joint.
pub(crate) fn plant(description: &RobotDescription) -> Result<Tree> {
    let joints = &description.joints;
    let by_name = index("link", description.links.iter().map(|l| l.name.as_str()))?;
    index("joint", joints.iter().map(|j| j.name.as_str()))?;
    if by_name.is_empty() {
        return refuse(
            format!("robot `{}`", description.name),
            "has no link",
            "define at least a base and one link",
        );
    }
    let mut links = Vec::with_capacity(joints.len());
    let mut joint_above: Vec<Option<usize>> = vec![None; by_name.len()];
    let mut joints_below: Vec<Vec<usize>> = vec![Vec::new(); by_name.len()];
    for (j, joint) in joints.iter().enumerate() {
        let find = |role: &str, name: &str| match by_name.get(name) {
            Some(&l) => Ok(l),
            None => refuse(
                format!("joint `{}`", joint.name),
                format!("its {role} link `{name}` is not defined"),
                did_you_mean(name, description.links.iter().map(|l| l.name.as_str())),
            ),
        };
        let (parent, child) = (find("parent", &joint.parent)?, find("child", &joint.child)?);
        if parent == child {
            return refuse(
                format!("joint `{}`", joint.name),
                format!("joins link `{}` to itself", joint.child),
                "parent and child must differ",
            );
        }
        if let Some(first) = joint_above[child].replace(j) {
            return refuse(
                format!("link `{}`", joint.child),
                format!(
                    "is the child of two joints, `{}` and `{}`: a closed loop",
                    joints[first].name, joint.name
                ),
                "open the loop: twincal works on trees",
            );
        }
        joints_below[parent].push(j);
        links.push((parent, child));
    }

    let roots: Vec<usize> = (0..by_name.len())
        .filter(|&l| joint_above[l].is_none())
        .collect();
    let mut order: Vec<usize> = Vec::with_capacity(joints.len());
    let mut reached = vec![false; by_name.len()];
    if let [root] = roots[..] {
        // Breadth first, without recursion: a chain may be very long.
        reached[root] = true;
        order.extend(&joints_below[root]);
        let mut next = 0;
        while let Some(&j) = order.get(next) {
            reached[links[j].1] = true;
            order.extend(&joints_below[links[j].1]);
            next += 1;
        }
    }
    if roots.len() > 1 {
        let names: Vec<String> = roots
            .iter()
            .take(4)
            .map(|&l| format!("`{}`", description.links[l].name))
            .collect();
        let lonely = roots.iter().find(|&&l| joints_below[l].is_empty());
        let problem = format!(
            "{} links have no parent joint ({}): two roots",
            roots.len(),
            names.join(", ")
        );
        return match lonely {
            Some(&l) => refuse(
                format!("link `{}`", description.links[l].name),
                format!("is an orphan, no joint names it; {problem}"),
                "attach it with a fixed joint or remove it",
            ),
            None => refuse(
                format!("robot `{}`", description.name),
                problem,
                "attach all but one with fixed joints",
            ),
        };
    }
    if let Some(lost) = reached.iter().position(|&r| !r) {
        return refuse(
            format!("link `{}`", description.links[lost].name),
            format!(
                "is on or behind a cycle of joints: {}",
                cycle(description, &links, &joint_above, lost)
            ),
            "reverse or remove one of these joints",
        );
    }
    Ok(Tree { order, links })
}

/// The cycle above `link` in words; every link above has a parent, so going up must come round.
fn cycle(
    description: &RobotDescription,
    links: &[(usize, usize)],
    joint_above: &[Option<usize>],
    link: usize,
) -> String {
    let mut seen = vec![false; joint_above.len()];
    let mut here = link;
    while !seen[here] {
        seen[here] = true;
        let Some(j) = joint_above[here] else { break };
        here = links[j].0;
    }
    let start = here;
    let mut names = vec![format!("`{}`", description.links[start].name)];
    while let Some(j) = joint_above[here] {
        here = links[j].0;
        if here == start || names.len() >= 6 {
            break;
        }
        names.push(format!("`{}`", description.links[here].name));
    }
    names.reverse();
    names.join(" → ")
}
