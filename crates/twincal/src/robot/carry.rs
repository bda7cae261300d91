//! A robot that carries something known: a tool or a workpiece, rigid, at a link.

use super::{Inertia, JointDescription, JointKind, LinkDescription, Robot};
use crate::error::{Error, Result};

impl Robot {
    /// Where a tool is mounted: the last of the links that move with the last body of the longest chain. Frames without
    /// inertia (`tool0`, `flange`) come behind the link that carries them; what hangs from a locked joint is a finger, and holds no tool.
    pub fn last_link(&self) -> &str {
        let last = self.bodies().len().saturating_sub(1);
        let links = self.links_of_body(last);
        let mount = links.iter().rfind(|link| !self.hangs_from_locked(link));
        mount.or(links.last()).copied().unwrap_or("")
    }

    /// True if one of the joints between a link and the base is locked.
    fn hangs_from_locked(&self, link: &str) -> bool {
        let mut joints = self.description().joints.iter();
        joints.find(|joint| joint.child == link).is_some_and(|own| {
            self.locked().contains_key(&own.name) || self.hangs_from_locked(&own.parent)
        })
    }

    /// The same robot with a point mass fixed to `link`: `mass` in kg at `com` in the link's frame, m.
    ///
    /// # Errors
    /// [`Error::Model`] for a mass that is not positive, a centre that is not finite, or an unknown link.
    pub fn carrying(&self, link: &str, mass: f64, com: [f64; 3]) -> Result<Self> {
        let refuse = |problem: String, remedy: &str| {
            Err(Error::Model {
                culprit: format!("payload at link `{link}`"),
                problem,
                remedy: remedy.into(),
            })
        };
        if !(mass > 0.0 && mass.is_finite()) {
            return refuse(format!("mass is {mass} kg"), "give a positive mass");
        }
        if !com.iter().all(|x| x.is_finite()) {
            return refuse(
                format!("centre of mass is {com:?}"),
                "give three finite numbers in m",
            );
        }
        let mut description = self.description.clone();
        if !description.links.iter().any(|other| other.name == link) {
            return refuse(
                "the model has no such link".into(),
                "name a link of the model",
            );
        }
        let taken = |name: &str| {
            let links = description.links.iter().any(|other| other.name == name);
            links || description.joints.iter().any(|other| other.name == name)
        };
        let mut name = "known payload".to_owned();
        while taken(&name) {
            name.push('+');
        }
        description.links.push(LinkDescription {
            name: name.clone(),
            inertia: Some(Inertia {
                mass,
                com,
                tensor: [[0.0; 3]; 3],
            }),
        });
        let joint = JointDescription::new(&name, JointKind::Fixed, link, &name);
        description.joints.push(joint);
        Ok(Self::new(description, &self.locked)?.0)
    }
}
