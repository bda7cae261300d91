//! The elimination tree: what is decided at each of its levels, and what is the same in all of it.

use super::tally::Threshold;
use crate::infer::standard::Standard;
use crate::prior::Prior;

/// ln of the factor on all weights: puts the misfit of the full model at e^600, so that both far better priors and far
/// worse misfits stay within the range of a double.
pub(super) const LOG_REFERENCE: f64 = 600.0;

/// Prior factors (included, excluded) of one column.
pub(super) type Odds<V> = (V, V);

/// One column in the tree. `V` is a vector with one model per lane.
pub(super) struct Level<V> {
    /// β̂.
    pub(super) center: V,
    /// Least pivot 1/v.
    pub(super) precision: f64,
    /// P(z = 1 | members of the family so far) · √(1/v), by members decided below the lanes.
    pub(super) include: Vec<V>,
    /// P(z = 0 | …).
    pub(super) exclude: Vec<V>,
    /// Where the family's members are counted: the bits of a packed count.
    pub(super) shift: u32,
    pub(super) mask: u32,
    /// One more member, in packed counts.
    pub(super) step: u32,
    /// Bit of this column's component in a set.
    pub(super) bit: u32,
    /// Heredity: components that must be in `set` for the including branch to exist, and must not be for the excluding one.
    pub(super) needs: u32,
    pub(super) bound_by: u32,
    /// What is to be decided here.
    pub(super) choice: Choice,
    /// Components yet to decide, this one included.
    pub(super) left: usize,
}

/// What a level decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Choice {
    /// In or out: the first column of a component.
    Free,
    /// As the component's first column.
    Follows,
    /// In: leaving it out is not worth a visit.
    Certain,
}

impl<V: Copy> Level<V> {
    /// Prior factors by the packed count of members.
    #[inline(always)]
    pub(super) fn odds(&self, count: u32) -> Odds<V> {
        let members = (count >> self.shift & self.mask) as usize;
        (self.include[members], self.exclude[members])
    }

    /// Whether the including and the excluding branch exist below the components of `set`.
    #[inline(always)]
    pub(super) fn branches(&self, set: u32) -> (bool, bool) {
        match self.choice {
            Choice::Free => (set & self.needs == self.needs, set & self.bound_by == 0),
            Choice::Follows => {
                let inside = set & self.bit != 0;
                (inside, !inside)
            }
            Choice::Certain => (true, false),
        }
    }
}

/// Everything that is the same in the whole tree.
pub(super) struct Tree<V> {
    /// By number of columns yet to decide, minus one.
    pub(super) levels: Vec<Level<V>>,
    /// a_n.
    pub(super) shape: f64,
    /// Mean of φ per (1 + c), or 0 where φ has no mean.
    pub(super) noise: f64,
    /// Last columns whose subtrees are written out.
    pub(super) written_out: usize,
    pub(super) heavy: Threshold,
    /// A subtree is not visited where its node's weight times its ceiling is below this.
    pub(super) least: f64,
}

/// What the tree is about.
#[derive(Clone, Copy)]
pub(super) struct Root<'a> {
    pub(super) standard: &'a Standard,
    pub(super) prior: &'a Prior,
    /// The first components, which every model holds.
    pub(super) certain: usize,
    /// See [`Tree::least`].
    pub(super) least: f64,
}
