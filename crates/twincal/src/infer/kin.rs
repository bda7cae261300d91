//! Heredity while a model walks: which components may move.

use super::standard::Standard;
use super::tableau::Tableau;
use crate::prior::Prior;

/// A step: components that leave and enter.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Step {
    pub(super) leaving: Vec<usize>,
    pub(super) entering: Vec<usize>,
}

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

    /// A component and its ancestors.
    pub(super) fn line(&self, block: usize) -> Vec<usize> {
        std::iter::successors(Some(block), |&b| self.parent[b]).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::infer::testing::grouped;
    use crate::infer::walker::Walker;

    /// From every admissible model of seven components (a chain of three with a second child, a pair, one alone): what may move is
    /// what leads to an admissible model, for flips, exchanges, and steps of one or two components on either side.
    #[test]
    fn what_may_move_leads_to_an_admissible_model() {
        let pairs = [(0, 3), (3, 1), (5, 3), (2, 6)];
        let data = grouped(1, &[1, 2, 1, 1, 3, 1, 2], 30, true).with_parents(&pairs);
        let (problem, count) = (&data.problem, 7);
        let standard = Standard::new(problem).unwrap();
        let kin = Kin::new(&standard, &problem.prior).unwrap();
        let place = |c: usize| standard.blocks.iter().position(|b| b.component == c);
        let places = pairs.map(|(c, p)| (place(c).unwrap(), place(p).unwrap()));
        let admissible = |set: u32| {
            let orphan = |&(c, p): &(usize, usize)| set >> c & 1 == 1 && set >> p & 1 == 0;
            !places.iter().any(orphan)
        };
        let (mut may, mut may_not) = (0, 0);
        for set in (0..1u32 << count).filter(|&set| admissible(set)) {
            let mut walker = Walker::new(&standard, &problem.prior);
            let (inside, outside): (Vec<usize>, Vec<usize>) =
                (0..count).partition(|&b| set >> b & 1 == 1);
            let flips = inside.iter();
            flips.for_each(|&b| walker.flip(b));
            let tableau = &walker.tableau;
            for block in 0..count {
                let then = admissible(set ^ 1 << block);
                assert_eq!(kin.may_flip(tableau, block), then, "{set:b} {block}");
            }
            for leaving in some(&inside) {
                for entering in some(&outside) {
                    let change = leaving.iter().chain(&entering).map(|b| 1 << b);
                    let then = admissible(set ^ change.sum::<u32>());
                    if let ([out], [into]) = (&leaving[..], &entering[..]) {
                        let got = kin.may_exchange(tableau, *out, *into);
                        assert_eq!(got, then, "{set:b} {out} {into}");
                    }
                    let (leaving, entering) = (leaving.clone(), entering);
                    let step = Step { leaving, entering };
                    assert_eq!(kin.may_take(tableau, &step), then, "{set:b} {step:?}");
                    *if then { &mut may } else { &mut may_not } += 1;
                }
            }
        }
        assert!(may > 300 && may_not > 300, "{may} {may_not}");
    }

    /// All choices of one or two.
    fn some(of: &[usize]) -> Vec<Vec<usize>> {
        let pairs = |i: usize| of[i + 1..].iter().map(move |&b| vec![of[i], b]);
        let two = (0..of.len()).flat_map(pairs);
        of.iter().map(|&b| vec![b]).chain(two).collect()
    }
}
