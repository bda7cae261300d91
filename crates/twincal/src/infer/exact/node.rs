//! One node of the elimination tree, owned or borrowed, and the lanes of its vectors.

use super::sums::triangle;
use pulp::bytemuck;

/// What is known at a node: `c + 2 hᵀδ + δᵀS δ` over the m columns yet to decide, the weight so far, the
/// packed counts of members per family, and the set of included components below the lanes.
pub(super) struct Node<V> {
    pub(super) s: Vec<V>,
    pub(super) h: Vec<V>,
    pub(super) c: V,
    pub(super) weight: V,
    /// No model below has a likelihood above this: see [`super::ahead`].
    pub(super) ceiling: V,
    /// A column was excluded since the ceiling was found.
    pub(super) stale: bool,
    pub(super) count: u32,
    pub(super) set: u32,
}

/// The same, borrowed.
#[derive(Clone, Copy)]
pub(super) struct View<'a, V> {
    pub(super) s: &'a [V],
    pub(super) h: &'a [V],
    pub(super) c: V,
    pub(super) weight: V,
    /// No model below has a likelihood above this: see [`super::ahead`].
    pub(super) ceiling: V,
    /// A column was excluded since the ceiling was found.
    pub(super) stale: bool,
    pub(super) count: u32,
    pub(super) set: u32,
}

impl<V: bytemuck::Pod> Node<V> {
    pub(super) fn blank(m: usize) -> Self {
        let zero = V::zeroed();
        Self {
            s: vec![zero; triangle(m)],
            h: vec![zero; m],
            c: zero,
            weight: zero,
            ceiling: zero,
            stale: false,
            count: 0,
            set: 0,
        }
    }

    pub(super) fn view(&self) -> View<'_, V> {
        View {
            s: &self.s,
            h: &self.h,
            c: self.c,
            weight: self.weight,
            ceiling: self.ceiling,
            stale: self.stale,
            count: self.count,
            set: self.set,
        }
    }
}

/// The lanes of a vector as numbers.
pub(super) fn lanes<V: bytemuck::Pod>(vector: &V) -> &[f64] {
    bytemuck::cast_slice(std::slice::from_ref(vector))
}

/// A vector from a function of the lane.
pub(super) fn from_lanes<V: bytemuck::Pod>(value: impl Fn(usize) -> f64) -> V {
    let mut vector = [V::zeroed()];
    let numbers: &mut [f64] = bytemuck::cast_slice_mut(&mut vector);
    numbers
        .iter_mut()
        .enumerate()
        .for_each(|(lane, number)| *number = value(lane));
    vector[0]
}
