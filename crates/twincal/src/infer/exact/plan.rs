//! The tables of the tree: which column is decided where, and what the prior says there.
//!
//! Components are decided in the order of [`Standard`]: the certain ones, then the largest first (a large one near the
//! leaves would be eliminated again under every model of those above it). Members of a family are counted in a few bits
//! of one number, so that families need not lie together.

use super::node::{Odds, from_lanes};
use super::subtree::WRITTEN_OUT;
use super::tally::Threshold;
use super::tree::{Choice, Level, Root, Tree};
use pulp::Simd;

/// A column that is decided above the tasks.
pub(super) struct Top<V> {
    /// Bit of its component in a lane's number; `None` if certain.
    pub(super) bit: Option<usize>,
    /// First column of its component.
    pub(super) first: bool,
    pub(super) odds: Odds<V>,
}

/// The tree's tables.
pub(super) struct Plan<V> {
    pub(super) tree: Tree<V>,
    /// Certain columns and those of the lanes, in order.
    pub(super) top: Vec<Top<V>>,
    /// Columns, those included that only fill the lanes.
    pub(super) padded: usize,
}

/// Makes the tables.
pub(super) fn plan<S: Simd>(about: Root<'_>) -> Plan<S::f64s> {
    let Root {
        standard,
        prior,
        certain,
        least,
    } = about;
    let lane_components = S::F64_LANES.ilog2() as usize;
    let free = standard.blocks.len() - certain;
    let counters = counters(about, lane_components);
    let kin = Kin::new(about, lane_components);
    let mut levels = Vec::new();
    let mut top = Vec::new();
    for (index, block) in standard.blocks.iter().enumerate() {
        let seen: Vec<usize> = (0..index)
            .filter(|&e| standard.blocks[e].family == block.family)
            .collect();
        let sure = seen.iter().filter(|&&e| e < certain).count();
        // Number of the component among those that are branched on: the first ones are the lanes.
        let number = index.checked_sub(certain);
        let in_lanes = number.is_none_or(|number| number < lane_components);
        let below = seen
            .iter()
            .filter(|&&e| e >= certain + lane_components)
            .count();
        let factor = |lane: usize, count: usize| {
            let in_lane = seen
                .iter()
                .filter(|&&e| {
                    (certain..certain + lane_components).contains(&e)
                        && lane >> (e - certain) & 1 == 1
                })
                .count();
            let members = (sure + in_lane + count).min(seen.len());
            prior.next(block.family, members, seen.len())
        };
        for d in block.range() {
            let first = d == block.start;
            let root = standard.precision[d].sqrt();
            let counts = if first { 0..=below } else { 0..=0 };
            let include: Vec<S::f64s> = counts
                .clone()
                .map(|count| {
                    from_lanes(|lane| match first {
                        true if !kin.may_enter(index, lane) => 0.0,
                        true => factor(lane, count).0 * block.factor * root,
                        false => root,
                    })
                })
                .collect();
            let exclude: Vec<S::f64s> = counts
                .map(|count| {
                    from_lanes(|lane| match first {
                        true if !kin.may_stay_out(index, lane) => 0.0,
                        true => factor(lane, count).1,
                        false => 1.0,
                    })
                })
                .collect();
            if in_lanes {
                top.push(Top {
                    bit: number,
                    first,
                    odds: (include[0], exclude[0]),
                });
            }
            let (shift, mask) = counters[block.family];
            levels.push(Level {
                center: from_lanes(|_| standard.center[d]),
                precision: standard.precision[d],
                include,
                exclude,
                shift,
                mask: if first { mask } else { 0 },
                step: u32::from(first && !in_lanes) << shift,
                bit: number.map_or(0, |number| 1 << number),
                needs: kin.needs(index),
                bound_by: kin.bound_by(index),
                choice: match (number, first) {
                    (None, _) => Choice::Certain,
                    (_, true) => Choice::Free,
                    (_, false) => Choice::Follows,
                },
                left: standard.blocks.len() - index,
            });
        }
    }
    for filler in free..lane_components {
        let odds = (from_lanes(|_| 0.0), from_lanes(|_| 1.0));
        top.push(Top {
            bit: Some(filler),
            first: true,
            odds,
        });
        levels.push(Level {
            center: from_lanes(|_| 0.0),
            precision: 1.0,
            include: vec![odds.0],
            exclude: vec![odds.1],
            shift: 0,
            mask: 0,
            step: 0,
            bit: 1 << filler,
            needs: 0,
            bound_by: 0,
            choice: Choice::Free,
            left: 0,
        });
    }
    let padded = levels.len();
    levels.reverse();
    let written_out = levels
        .iter()
        .take(WRITTEN_OUT.min(padded - top.len()))
        .take_while(|level| level.choice == Choice::Free && level.needs == 0 && level.bound_by == 0)
        .count();
    let noise = Some(standard.noise_factor())
        .filter(|x| x.is_finite())
        .unwrap_or(0.0);
    Plan {
        tree: Tree {
            levels,
            shape: standard.shape,
            noise,
            written_out,
            heavy: Threshold::new(),
            least,
        },
        top,
        padded,
    }
}

/// Heredity in the tree: of a parent and its child, the one that is decided later is bound by the other.
struct Kin {
    /// By place in `standard.blocks`, those decided earlier only.
    parent: Vec<Option<usize>>,
    children: Vec<Vec<usize>>,
    certain: usize,
    lane_components: usize,
}

impl Kin {
    fn new(about: Root<'_>, lane_components: usize) -> Self {
        let blocks = &about.standard.blocks;
        let (mut parent, mut children) = (vec![None; blocks.len()], vec![Vec::new(); blocks.len()]);
        for (child, block) in blocks.iter().enumerate() {
            let above = about.prior.parent_of(block.component);
            let place = above.and_then(|p| blocks.iter().position(|b| b.component == p));
            match place {
                Some(p) if p < child => parent[child] = Some(p),
                Some(p) => children[p].push(child),
                None => {}
            }
        }
        Self {
            parent,
            children,
            certain: about.certain,
            lane_components,
        }
    }

    /// Whether a lane holds a component; `None` if it is decided below the lanes.
    fn in_lane(&self, index: usize, lane: usize) -> Option<bool> {
        let Some(number) = index.checked_sub(self.certain) else {
            return Some(true);
        };
        (number < self.lane_components).then_some(lane >> number & 1 == 1)
    }

    fn may_enter(&self, index: usize, lane: usize) -> bool {
        self.parent[index].is_none_or(|p| self.in_lane(p, lane).unwrap_or(true))
    }

    fn may_stay_out(&self, index: usize, lane: usize) -> bool {
        let held = |&child: &usize| self.in_lane(child, lane).unwrap_or(false);
        !self.children[index].iter().any(held)
    }

    /// Bit of a component that is decided below the lanes.
    fn bit(&self, index: usize) -> u32 {
        match self.in_lane(index, 0) {
            None => 1 << (index - self.certain),
            Some(_) => 0,
        }
    }

    fn needs(&self, index: usize) -> u32 {
        self.parent[index].map_or(0, |p| self.bit(p))
    }

    fn bound_by(&self, index: usize) -> u32 {
        self.children[index].iter().map(|&c| self.bit(c)).sum()
    }
}

/// `(shift, mask)` of each family's counter: as many bits as its components below the lanes can fill.
fn counters(about: Root<'_>, lane_components: usize) -> Vec<(u32, u32)> {
    let below = about
        .standard
        .blocks
        .iter()
        .skip(about.certain + lane_components);
    let mut sizes = vec![0u32; about.prior.families()];
    below.for_each(|block| sizes[block.family] += 1);
    let mut shift = 0;
    sizes
        .iter()
        .map(|&size| {
            let bits = u32::BITS - size.leading_zeros();
            let own = (shift.min(u32::BITS - 1), (1 << bits) - 1);
            shift += bits;
            own
        })
        .collect()
}
