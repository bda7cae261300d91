//! What a robot can show of its components, what the logs do show, and which joint should move more for the rest.
//!
//! ```text
//! S = ⟨Φᵀ W Φ⟩ over random states     T = ⟨Φᵀ W Φ⟩ over the rows of the logs that the fit uses
//! null(S): no motion shows it         range(S) with cᵀTc < ε cᵀSc: the robot could show it, these logs do not
//! ```
//! Columns are scaled to torque of size 1 at random states and joints to nominal torque of size 1, so units do not matter.

mod directions;
mod states;
mod words;
#[cfg(test)]
mod tests;

pub(crate) use states::{Reference, reference};
pub use states::{States, random_states};
pub use words::{sentence, sentences};

use crate::gram::Gram;
use crate::robot::Robot;
use crate::term::Library;
use directions::{Directions, Spectrum, shown};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Power of a direction's torque in the logs, as a share of its power at random states, below which the logs do not show
/// it: torque a hundredth as large as in ordinary motion.
const UNSEEN: f64 = 1e-4;
/// The same at random states of one more joint: from here on that joint shows the direction.
const SHOWN: f64 = 1e-3;
/// A direction is what the robot could show if its torque is this share of what its columns have one by one; less is
/// left where angles in the model file are rounded.
const ROBOT_SHOWS: f64 = 1e-3;
/// Random states for S, and rows of the logs that one joint's motion is added to.
pub const STATES: usize = 256;
/// Shares of a direction's torque above which a component takes part in it.
const TAKES_PART: f64 = 0.1;

/// How much of a component the logs show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Seen {
    /// Everything that the robot can show of it, apart from all others.
    Fully,
    /// A part, or only together with others.
    Partly,
    /// Nothing.
    NotAtAll,
    /// No motion of this robot shows it.
    Never,
}

/// One component in the logs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ComponentExcitation {
    /// Name of the component.
    pub name: String,
    /// How much the logs show.
    pub seen: Seen,
    /// rms of its torque per unit of β in the logs, as a share of that at random states (positions within the limits or ±π,
    /// 2 rad/s, 5 rad/s²).
    pub excitation: f64,
    /// Independent columns on its own: over all motions of the robot, and in the logs.
    pub directions: [usize; 2],
}

/// What the robot could show and the logs do not, by the joint that would show it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unseen {
    /// The joint that should move more, or further; `None` where it takes several at once.
    pub joint: Option<String>,
    /// Independent directions that would become visible.
    pub directions: usize,
    /// Components of which the logs show nothing.
    pub nothing_of: Vec<String>,
    /// Components that the logs show only together.
    pub not_apart: Vec<String>,
}

/// What logs show of a library.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Excitation {
    /// Independent directions of all columns: over all motions of the robot (structural rank), and in the logs.
    pub directions: [usize; 2],
    /// One per component of the library.
    pub components: Vec<ComponentExcitation>,
    /// What another motion would show, most first.
    pub unseen: Vec<Unseen>,
}

/// Compares what the robot can show with what the rows in `gram` show. `rows` are some of the logs' states: one joint's
/// motion is added to them to find the joint that should move more.
///
/// `gram` belongs to the columns of `library` and counts the rows that the fit uses, standstill left out. Columns that are
/// no number at some random state are not judged.
///
/// # Source
/// Gautier & Khalil 1990 (structural against trajectory rank of the regressor); generalised eigenvalues of (T, S).
pub fn excitation(robot: &Robot, library: &Library, gram: &Gram, rows: &States) -> Excitation {
    let all = random_states(robot, STATES);
    let reference = states::reference(robot, library, &all);
    let columns: Vec<usize> = (0..library.columns().len())
        .filter(|&k| reference.size[k].is_finite() && reference.size[k] > 0.0)
        .collect();
    let power = Power {
        robot: reference.power(library, &columns, &all),
        logs: reference.power_of_gram(&columns, gram),
    };
    let home = |k: usize| library.terms()[library.columns()[columns[k]]].component;
    let mut own = vec![Vec::new(); library.components().len()];
    (0..columns.len()).for_each(|k| own[home(k)].push(k));

    let spectrum = Spectrum::new(&power.robot, &power.logs, columns.len());
    // What one more joint would show, in the coordinates of the spectrum.
    let with_joint: Vec<Vec<f64>> = (0..robot.dof())
        .into_par_iter()
        .map(|joint| {
            let moved = rows.with_random(joint, &all);
            spectrum.whitened(&reference.power(library, &columns, &moved))
        })
        .collect();

    let hidden = spectrum.all_hidden();
    let mut plan = Plan::of_all(&hidden, &with_joint);
    let allowed: Vec<usize> = plan.steps.iter().filter_map(|step| step.joint).collect();
    let parts: Vec<Part> = (own.iter())
        .map(|columns| power.part(columns, &spectrum))
        .collect();
    let alone = plan.add_parts(&parts, (&with_joint, &allowed), spectrum.rank());
    let names = library.components().iter().map(|own| &own.name);
    let mut components: Vec<ComponentExcitation> = names
        .zip(&parts)
        .map(|(name, part)| part.excitation(name))
        .collect();
    // What is left are directions in which several components cancel.
    let rest = hidden.without(&alone);
    let of_rest = shown(&[&rest], &with_joint);
    for (joint, shown) in rest.by_joint(&of_rest[0], &allowed) {
        let torque: Vec<f64> = own
            .iter()
            .map(|columns| spectrum.torque(&shown, columns))
            .collect();
        let most = torque.iter().fold(0.0_f64, |m, t| m.max(*t));
        for (index, component) in components.iter_mut().enumerate() {
            if torque[index] > TAKES_PART * most && component.directions[1] > 0 {
                component.seen = Seen::Partly;
                plan.add(joint, index, false);
            }
        }
    }
    Excitation {
        directions: [spectrum.rank(), spectrum.rank() - hidden.count()],
        components,
        unseen: plan.finish(robot, library),
    }
}

/// S and T, row-major over the columns that are judged.
struct Power {
    robot: Vec<f64>,
    logs: Vec<f64>,
}

/// The columns of one component by themselves.
struct Part {
    /// See [`ComponentExcitation::directions`].
    directions: [usize; 2],
    /// See [`ComponentExcitation::excitation`].
    excitation: f64,
    /// What the logs do not show of them, in the coordinates of all columns.
    hidden: Directions,
}

impl Power {
    fn part(&self, columns: &[usize], all: &Spectrum) -> Part {
        let own = Spectrum::new(
            &directions::block(&self.robot, columns),
            &directions::block(&self.logs, columns),
            columns.len(),
        );
        let hidden = own.hidden(columns, all);
        let ratio = columns.iter().map(|&k| {
            let at = k * all.size() + k;
            self.logs[at] / self.robot[at]
        });
        Part {
            directions: [own.rank(), own.rank() - hidden.count()],
            excitation: (ratio.sum::<f64>() / columns.len().max(1) as f64).sqrt(),
            hidden,
        }
    }
}

impl Part {
    fn excitation(&self, name: &str) -> ComponentExcitation {
        ComponentExcitation {
            name: name.to_owned(),
            seen: match self.directions {
                [0, _] => Seen::Never,
                [_, 0] => Seen::NotAtAll,
                [all, some] if some < all => Seen::Partly,
                _ => Seen::Fully,
            },
            excitation: self.excitation,
            directions: self.directions,
        }
    }
}

/// What moving one joint more would show.
#[derive(Default)]
struct Step {
    joint: Option<usize>,
    directions: usize,
    nothing_of: Vec<usize>,
    not_apart: Vec<usize>,
}

/// One step after the other.
#[derive(Default)]
struct Plan {
    steps: Vec<Step>,
}

impl Plan {
    /// How many of the hidden directions each joint would show, whatever component they are of.
    fn of_all(hidden: &Directions, with_joint: &[Vec<f64>]) -> Self {
        let every: Vec<usize> = (0..with_joint.len()).collect();
        let of_all = shown(&[hidden], with_joint);
        let by_joint = hidden.by_joint(&of_all[0], &every).into_iter();
        let step = |(joint, shown): (Option<usize>, Directions)| Step {
            joint,
            directions: shown.count(),
            ..Step::default()
        };
        Self {
            steps: by_joint.map(step).collect(),
        }
    }

    /// Adds what is hidden of each component by itself, and gives all of that.
    fn add_parts(
        &mut self,
        parts: &[Part],
        (with_joint, allowed): (&[Vec<f64>], &[usize]),
        rank: usize,
    ) -> Directions {
        let sets: Vec<&Directions> = parts.iter().map(|part| &part.hidden).collect();
        let of_parts = shown(&sets, with_joint);
        let mut alone = Directions::empty(rank);
        for (index, part) in parts.iter().enumerate() {
            for (joint, _) in part.hidden.by_joint(&of_parts[index], allowed) {
                self.add(joint, index, part.directions[1] == 0);
            }
            alone.join(&part.hidden);
        }
        alone
    }

    fn add(&mut self, joint: Option<usize>, member: usize, nothing: bool) {
        let known = self.steps.iter().position(|step| step.joint == joint);
        let at = known.unwrap_or_else(|| {
            self.steps.push(Step {
                joint,
                ..Step::default()
            });
            self.steps.len() - 1
        });
        let step = &mut self.steps[at];
        let list = if nothing {
            &mut step.nothing_of
        } else {
            &mut step.not_apart
        };
        if !list.contains(&member) {
            list.push(member);
        }
    }

    fn finish(mut self, robot: &Robot, library: &Library) -> Vec<Unseen> {
        let joints = robot.joint_names();
        let names = |list: &[usize]| -> Vec<String> {
            let names = list.iter().map(|&c| library.components()[c].name.clone());
            names.collect()
        };
        self.steps
            .retain(|step| !(step.nothing_of.is_empty() && step.not_apart.is_empty()));
        self.steps.sort_by_key(|step| {
            (
                std::cmp::Reverse(step.nothing_of.len()),
                std::cmp::Reverse(step.directions),
                step.joint.unwrap_or(usize::MAX),
            )
        });
        let steps = self.steps.into_iter();
        steps
            .map(|mut step| {
                step.not_apart.sort_unstable();
                step.not_apart
                    .retain(|member| !step.nothing_of.contains(member));
                Unseen {
                    joint: step.joint.map(|joint| joints[joint].to_owned()),
                    directions: step.directions,
                    nothing_of: names(&step.nothing_of),
                    not_apart: names(&step.not_apart),
                }
            })
            .collect()
    }
}
