//! Heredity while a model walks: which components may move.

use super::standard::Standard;
use super::tableau::Tableau;
use super::walker::Step;
use crate::prior::Prior;

/// Parents and children by place in `standard.blocks`; a parent that was integrated out is in and binds nobody.
pub(super) struct Kin {
    parent: Vec<Option<usize>>,
    children: Vec<Vec<usize>>,
}

impl Kin {
    /// `None` without heredity.
    pub(super) fn new(standard: &Standard, prior: &Prior) -> Option<Self> {
        let mut place = vec![None; prior.components()];
        for (b, block) in standard.blocks.iter().enumerate() {
            place[block.component] = Some(b);
        }
        let above = |component: usize| prior.parent_of(component).and_then(|p| place[p]);
        let blocks = standard.blocks.iter();
        let parent: Vec<Option<usize>> = blocks.map(|block| above(block.component)).collect();
        let mut children = vec![Vec::new(); parent.len()];
        for (b, parent) in parent.iter().enumerate() {
            if let Some(parent) = *parent {
                children[parent].push(b);
            }
        }
        let any = parent.iter().any(Option::is_some);
        any.then_some(Self { parent, children })
    }

    /// Whether a component may come in, or leave, as the others are.
    #[inline]
    pub(super) fn may_flip(&self, tableau: &Tableau<'_>, block: usize) -> bool {
        if tableau.holds(block) {
            !self.children[block].iter().any(|&c| tableau.holds(c))
        } else {
            self.parent[block].is_none_or(|p| tableau.holds(p))
        }
    }

    /// Whether a step from an admissible model leads to one.
    pub(super) fn may_take(&self, tableau: &Tableau<'_>, step: &Step) -> bool {
        let after = |b: usize| {
            step.entering.contains(&b) || (tableau.holds(b) && !step.leaving.contains(&b))
        };
        let alone = |b: &usize| self.children[*b].iter().any(|&c| after(c));
        let orphan = |b: &usize| self.parent[*b].is_some_and(|p| !after(p));
        !step.leaving.iter().any(alone) && !step.entering.iter().any(orphan)
    }

    /// The same for one component against another.
    pub(super) fn may_exchange(&self, tableau: &Tableau<'_>, out: usize, into: usize) -> bool {
        self.may_flip(tableau, out)
            && self.parent[into].is_none_or(|p| p != out && tableau.holds(p))
    }
}
