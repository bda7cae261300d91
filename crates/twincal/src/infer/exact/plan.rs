//! The tables of the tree: which column is decided where, and what the prior says there.
//!
//! Components are decided in the order of [`Standard`]: the certain ones, then the largest first (a large one near the
//! leaves would be eliminated again under every model of those above it). Members of a family are counted in a few bits
//! of one number, so that families need not lie together.

use super::node::from_lanes;
use super::subtree::WRITTEN_OUT;
use super::tally::Threshold;
use super::tree::{Choice, Level, Odds, Root, Tree};
use pulp::Simd;
use pulp::bytemuck::Pod;

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
        standard, certain, ..
    } = about;
    let lane_components = S::F64_LANES.ilog2() as usize;
    let free = standard.blocks.len() - certain;
    let counters = counters(about, lane_components);
    let kin = Kin::new(about, lane_components);
    let mut levels = Vec::new();
    let mut top = Vec::new();
    for (index, block) in standard.blocks.iter().enumerate() {
        let decision = Decision::new(about, &kin, index);
        for d in block.range() {
            let level = decision.level(d, counters[block.family]);
            if decision.in_lanes() {
                top.push(Top {
                    bit: decision.number,
                    first: d == block.start,
                    odds: (level.include[0], level.exclude[0]),
                });
            }
            levels.push(level);
        }
    }
    for lane_bit in free..lane_components {
        let odds = (from_lanes(|_| 0.0), from_lanes(|_| 1.0));
        top.push(Top {
            bit: Some(lane_bit),
            first: true,
            odds,
        });
        levels.push(filler(lane_bit, odds));
    }
    let padded = levels.len();
    levels.reverse();
    let tree = tree_of(about, levels, padded - top.len());
    Plan { tree, top, padded }
}

/// The tree over `levels`, of which the first `below` are decided below the lanes.
fn tree_of<V: Copy>(about: Root<'_>, levels: Vec<Level<V>>, below: usize) -> Tree<V> {
    let standard = about.standard;
    let written_out = levels
        .iter()
        .take(WRITTEN_OUT.min(below))
        .take_while(|level| level.choice == Choice::Free && level.needs == 0 && level.bound_by == 0)
        .count();
    let noise = Some(standard.noise_factor())
        .filter(|x| x.is_finite())
        .unwrap_or(0.0);
    Tree {
        levels,
        shape: standard.shape,
        noise,
        written_out,
        heavy: Threshold::new(),
        least: about.least,
    }
}

/// A column without data that only fills a lane: always out.
fn filler<V: Pod>(lane_bit: usize, odds: Odds<V>) -> Level<V> {
    Level {
        center: from_lanes(|_| 0.0),
        precision: 1.0,
        include: vec![odds.0],
        exclude: vec![odds.1],
        shift: 0,
        mask: 0,
        step: 0,
        bit: 1 << lane_bit,
        needs: 0,
        bound_by: 0,
        choice: Choice::Free,
        left: 0,
    }
}

/// What the decision on one component depends on: those decided before it.
struct Decision<'a> {
    about: Root<'a>,
    kin: &'a Kin,
    /// Place in `standard.blocks`.
    index: usize,
    /// Number among the components that are branched on, the first of which are the lanes; `None` if certain.
    number: Option<usize>,
    /// Places of its family's components that are decided before it.
    seen: Vec<usize>,
    /// How many of those are certain.
    sure: usize,
    /// How many of those are decided below the lanes.
    below: usize,
}

impl<'a> Decision<'a> {
    fn new(about: Root<'a>, kin: &'a Kin, index: usize) -> Self {
        let blocks = &about.standard.blocks;
        let seen: Vec<usize> = (0..index)
            .filter(|&e| blocks[e].family == blocks[index].family)
            .collect();
        let first_below = about.certain + kin.lane_components;
        Self {
            about,
            kin,
            index,
            number: index.checked_sub(about.certain),
            sure: seen.iter().filter(|&&e| e < about.certain).count(),
            below: seen.iter().filter(|&&e| e >= first_below).count(),
            seen,
        }
    }

    /// Whether it is decided above the tasks.
    fn in_lanes(&self) -> bool {
        self.number
            .is_none_or(|number| number < self.kin.lane_components)
    }

    /// P(z = 1) and P(z = 0) in a lane, with `count` members of the family below the lanes.
    fn prior(&self, lane: usize, count: usize) -> (f64, f64) {
        let certain = self.about.certain;
        let lanes = certain..certain + self.kin.lane_components;
        let in_lane = (self.seen.iter())
            .filter(|&&e| lanes.contains(&e) && lane >> (e - certain) & 1 == 1)
            .count();
        let members = (self.sure + in_lane + count).min(self.seen.len());
        let family = self.about.standard.blocks[self.index].family;
        self.about.prior.next(family, members, self.seen.len())
    }

    /// Factors of the including and the excluding branch at a position, by members of the family below the lanes.
    fn odds<V: Pod>(&self, d: usize) -> (Vec<V>, Vec<V>) {
        let (standard, kin, index) = (self.about.standard, self.kin, self.index);
        let block = standard.blocks[index];
        let first = d == block.start;
        let root = standard.precision[d].sqrt();
        let counts = if first { 0..=self.below } else { 0..=0 };
        let include = |count: usize| {
            from_lanes(|lane| match first {
                true if !kin.may_enter(index, lane) => 0.0,
                true => self.prior(lane, count).0 * block.factor * root,
                false => root,
            })
        };
        let exclude = |count: usize| {
            from_lanes(|lane| match first {
                true if !kin.may_stay_out(index, lane) => 0.0,
                true => self.prior(lane, count).1,
                false => 1.0,
            })
        };
        (
            counts.clone().map(include).collect(),
            counts.map(exclude).collect(),
        )
    }

    /// The table of one of its columns; `counter`: (shift, mask) of its family's.
    fn level<V: Pod>(&self, d: usize, counter: (u32, u32)) -> Level<V> {
        let standard = self.about.standard;
        let (shift, mask) = counter;
        let first = d == standard.blocks[self.index].start;
        let (include, exclude) = self.odds(d);
        Level {
            center: from_lanes(|_| standard.center[d]),
            precision: standard.precision[d],
            include,
            exclude,
            shift,
            mask: if first { mask } else { 0 },
            step: u32::from(first && !self.in_lanes()) << shift,
            bit: self.number.map_or(0, |number| 1 << number),
            needs: self.kin.needs(self.index),
            bound_by: self.kin.bound_by(self.index),
            choice: match (self.number, first) {
                (None, _) => Choice::Certain,
                (_, true) => Choice::Free,
                (_, false) => Choice::Follows,
            },
            left: standard.blocks.len() - self.index,
        }
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
