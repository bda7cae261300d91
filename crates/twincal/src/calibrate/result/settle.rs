//! Which effects are established and which sets equivalent, by the error of left-out data.

use super::calibration::{ComponentSummary, Group};
use super::status::{MEDIAN, Status, StatusReason, is_open};
use crate::calibrate::checks::left_out::{LeftOut, LeftOutError};
use crate::calibrate::fit::compact;
use crate::calibrate::fit::heredity;
use crate::plug_in::Fit;
use crate::statistics::Sums;
use crate::term::Library;
use rayon::prelude::*;

/// Probability from which an effect, or a set of them, is claimed.
const CLAIMED: f64 = 0.95;
/// Members of a set that still says something.
const MOST_MEMBERS: usize = 4;
/// Probability from which a member of a set cannot be excluded.
const MEMBER: f64 = 0.05;

impl ComponentSummary {
    /// Whether it is likelier in than not, and the data see it.
    #[must_use]
    pub fn is_in(&self) -> bool {
        self.pip.is_some_and(|pip| pip >= MEDIAN) && self.status != Status::Unidentifiable
    }

    /// Whether its probability is one that is claimed.
    fn is_claimed(&self) -> bool {
        let (pip, mcse) = (self.pip.unwrap_or(0.0), self.pip_mcse.unwrap_or(0.0));
        self.is_in() && pip >= CLAIMED && !is_open(pip, mcse)
    }
}

/// The effects of one fit, with what is needed to leave some of them out.
struct Effects<'a> {
    components: &'a mut [ComponentSummary],
    /// First component of the prior of each, if it has columns.
    own: Vec<Option<usize>>,
    /// Component of the prior without which each is never in.
    parent: &'a [Option<usize>],
    /// Components of the prior that are in.
    inside: Vec<bool>,
    left_out: LeftOut,
}

/// Decides which effects are established and which sets equivalent. Sets of effects that take each other's place in left-out data, so that
/// neither is established alone, are added to `groups`.
pub(in crate::calibrate) fn settle(
    components: &mut [ComponentSummary],
    groups: &mut Vec<Group>,
    fit: &Fit,
    library: &Library,
    training: &Sums,
) {
    let prior = &fit.problem.prior;
    let mut own = vec![None; components.len()];
    for (&component, &column) in prior.component.iter().zip(library.columns()).rev() {
        own[library.terms()[column].component] = Some(component);
    }
    let mut inside = compact::members(&fit.problem, &fit.posterior);
    for likeliest in groups.iter().filter(|group| group.pip >= MEDIAN) {
        let of = |name: &String| components.iter().position(|c| c.name == *name);
        let mut members = likeliest.members.iter().filter_map(|name| own[of(name)?]);
        let first = members.clone().next();
        if let (Some(first), false) = (first, members.any(|member| inside[member])) {
            inside[first] = true;
        }
    }
    heredity::force_parents(&prior.parent, &mut inside);
    let left_out = LeftOut::new(training, fit, &inside);
    let mut effects = Effects {
        components,
        own,
        parent: &prior.parent,
        inside,
        left_out,
    };
    effects.test_each();
    let more = effects.exchanged(groups);
    groups.extend(more);
    groups.iter().for_each(|group| effects.test_set(group));
}

/// The effects of a fleet: what is claimed is established. Sets stay where no member is.
pub(in crate::calibrate) fn by_probability(
    components: &mut [ComponentSummary],
    groups: &mut Vec<Group>,
) {
    for own in components.iter_mut().filter(|own| own.is_claimed()) {
        own.status = Status::Established;
    }
    let established = |name: &String| matches!(components.iter().find(|own| own.name == *name), Some(own) if own.status == Status::Established);
    groups.retain(|group| !group.members.iter().any(established));
}

impl Effects<'_> {
    /// How much these effects, with what needs them, lower the error of left-out data together.
    fn lowered(&self, effects: &[usize]) -> Option<LeftOutError> {
        let own: Vec<usize> = effects.iter().filter_map(|&e| self.own[e]).collect();
        let parent = |c: usize| self.parent.get(c).copied().flatten();
        let goes = |c: usize| {
            let mut up = std::iter::successors(Some(c), |&c| parent(c));
            up.any(|c| own.contains(&c))
        };
        let rest: Vec<bool> = (0..self.inside.len())
            .map(|c| self.inside[c] && !goes(c))
            .collect();
        self.left_out.lowered(&rest, &own)
    }

    /// Each effect alone whose probability is one that is claimed.
    fn test_each(&mut self) {
        let claimed: Vec<usize> = (0..self.components.len())
            .filter(|&e| self.components[e].is_claimed())
            .collect();
        let lowered = |&effect: &usize| (effect, self.lowered(&[effect]));
        let tested: Vec<_> = claimed.par_iter().map(lowered).collect();
        for (effect, lowered) in tested {
            let own = &mut self.components[effect];
            let Some(lowered) = lowered else { continue };
            if lowered.is_clear() {
                own.status = Status::Established;
            }
            own.reason = StatusReason::LeftOut(lowered);
        }
    }

    /// Sets of effects with a high probability each, neither of which lowers the error alone, but any two linked ones do together: one takes
    /// the other's place.
    fn exchanged(&self, groups: &[Group]) -> Vec<Group> {
        let open: Vec<usize> = (0..self.components.len())
            .filter(|&e| self.components[e].is_claimed())
            .filter(|&e| self.components[e].status == Status::Tentative)
            .collect();
        let name = |e: usize| &self.components[e].name;
        let known = |e: usize| groups.iter().any(|g| g.members.contains(name(e)));
        let open: Vec<usize> = open.into_iter().filter(|&e| !known(e)).collect();
        let mut label: Vec<usize> = (0..open.len()).collect();
        for a in 0..open.len() {
            for b in 0..a {
                let both = self.lowered(&[open[a], open[b]]);
                if both.is_some_and(|both| both.is_clear()) {
                    let (from, to) = (label[a].max(label[b]), label[a].min(label[b]));
                    let labels = label.iter_mut().filter(|l| **l == from);
                    labels.for_each(|l| *l = to);
                }
            }
        }
        let members = |first: usize| -> Vec<usize> {
            let own = (0..open.len()).filter(|&k| label[k] == first);
            own.map(|k| open[k]).collect()
        };
        let sets = (0..open.len()).map(members);
        let sets = sets.filter(|set| (2..=MOST_MEMBERS).contains(&set.len()));
        sets.map(|set| {
            let pips = set.iter().filter_map(|&e| self.components[e].pip);
            let names = set.iter().map(|&e| name(e).clone()).collect();
            Group::in_these_logs(names, pips.fold(0.0, f64::max))
        })
        .collect()
    }

    /// A set none of whose members is established alone.
    fn test_set(&mut self, group: &Group) {
        let members: Vec<usize> = (0..self.components.len())
            .filter(|&e| group.members.contains(&self.components[e].name))
            .collect();
        let is = |e: &usize, status| self.components[*e].status == status;
        if members.iter().any(|e| is(e, Status::Established)) {
            return;
        }
        let claimed = group.pip >= CLAIMED && group.members.len() <= MOST_MEMBERS;
        let lowered = self.lowered(&members).filter(|_| claimed);
        let clear = lowered.as_ref().is_some_and(LeftOutError::is_clear);
        for e in members {
            let own = &mut self.components[e];
            let seen = own.status != Status::Unidentifiable;
            if clear && seen && own.pip.is_some_and(|pip| pip >= MEMBER) {
                own.status = Status::Equivalent;
            }
            let of_its_own = matches!(own.reason, StatusReason::LeftOut(_));
            if own.status == Status::Equivalent || own.status == Status::Tentative && !of_its_own {
                own.reason = match &lowered {
                    Some(lowered) if !clear => StatusReason::LeftOut(lowered.clone()),
                    _ => StatusReason::SameTorque {
                        members: group.members.clone(),
                        pip: group.pip,
                        alike: group.alike,
                    },
                };
            }
        }
    }
}
