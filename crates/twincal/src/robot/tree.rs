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
    Err(wrong(culprit, problem, remedy))
}

fn wrong(culprit: String, problem: impl Into<String>, remedy: impl Into<String>) -> Error {
    Error::Model {
        culprit,
        problem: problem.into(),
        remedy: remedy.into(),
    }
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

/// Which links joints join, by index.
struct Joined {
    /// `(parent, child)` per joint.
    links: Vec<(usize, usize)>,
    /// The joint whose child a link is.
    above: Vec<Option<usize>>,
    /// The joints whose parent a link is.
    below: Vec<Vec<usize>>,
}

/// Checks that links and joints form one tree.
///
/// # Errors
/// [`Error::Model`] naming the link or joint.
pub(crate) fn plant(description: &RobotDescription) -> Result<Tree> {
    let joined = join(description)?;
    let roots: Vec<usize> = (0..joined.above.len())
        .filter(|&l| joined.above[l].is_none())
        .collect();
    if roots.len() > 1 {
        return Err(several_roots(description, &joined, &roots));
    }
    let (order, reached) = joined.walk(&roots);
    if let Some(lost) = reached.iter().position(|&r| !r) {
        return refuse(
            format!("link `{}`", description.links[lost].name),
            format!(
                "is on or behind a cycle of joints: {}",
                cycle(description, &joined, lost)
            ),
            "reverse or remove one of these joints",
        );
    }
    Ok(Tree {
        order,
        links: joined.links,
    })
}

/// Links by their names; none is the child of two joints.
fn join(description: &RobotDescription) -> Result<Joined> {
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
    let mut joined = Joined {
        links: Vec::with_capacity(joints.len()),
        above: vec![None; by_name.len()],
        below: vec![Vec::new(); by_name.len()],
    };
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
        if let Some(first) = joined.above[child].replace(j) {
            return refuse(
                format!("link `{}`", joint.child),
                format!(
                    "is the child of two joints, `{}` and `{}`: a closed loop",
                    joints[first].name, joint.name
                ),
                "open the loop: twincal works on trees",
            );
        }
        joined.below[parent].push(j);
        joined.links.push((parent, child));
    }
    Ok(joined)
}

impl Joined {
    /// Joints from the root on, parents first, and which links they reach; none where there is no single root.
    fn walk(&self, roots: &[usize]) -> (Vec<usize>, Vec<bool>) {
        let mut order: Vec<usize> = Vec::with_capacity(self.links.len());
        let mut reached = vec![false; self.above.len()];
        if let [root] = *roots {
            // Breadth first, without recursion: a chain may be very long.
            reached[root] = true;
            order.extend(&self.below[root]);
            let mut next = 0;
            while let Some(&j) = order.get(next) {
                let child = self.links[j].1;
                reached[child] = true;
                order.extend(&self.below[child]);
                next += 1;
            }
        }
        (order, reached)
    }
}

/// More than one link has no parent joint; one that no joint names is the culprit.
fn several_roots(description: &RobotDescription, joined: &Joined, roots: &[usize]) -> Error {
    let names: Vec<String> = roots
        .iter()
        .take(4)
        .map(|&l| format!("`{}`", description.links[l].name))
        .collect();
    let problem = format!(
        "{} links have no parent joint ({}): two roots",
        roots.len(),
        names.join(", ")
    );
    match roots.iter().find(|&&l| joined.below[l].is_empty()) {
        Some(&l) => wrong(
            format!("link `{}`", description.links[l].name),
            format!("is an orphan, no joint names it; {problem}"),
            "attach it with a fixed joint or remove it",
        ),
        None => wrong(
            format!("robot `{}`", description.name),
            problem,
            "attach all but one with fixed joints",
        ),
    }
}

/// The cycle above `link` in words; every link above has a parent, so going up must come round.
fn cycle(description: &RobotDescription, joined: &Joined, link: usize) -> String {
    let Joined { links, above, .. } = joined;
    let mut seen = vec![false; above.len()];
    let mut here = link;
    while !seen[here] {
        seen[here] = true;
        let Some(j) = above[here] else { break };
        here = links[j].0;
    }
    let start = here;
    let mut names = vec![format!("`{}`", description.links[start].name)];
    while let Some(j) = above[here] {
        here = links[j].0;
        if here == start || names.len() >= 6 {
            break;
        }
        names.push(format!("`{}`", description.links[here].name));
    }
    names.reverse();
    names.join(" → ")
}
