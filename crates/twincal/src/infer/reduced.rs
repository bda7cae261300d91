//! Columns that every model with weight holds, integrated out once: what is left is a smaller [`Standard`].
//!
//! With C the columns that are in for certain and O the others, the least of `2 hᵀδ + δᵀA δ` over δ_C is the same form in δ_O,
//!
//! ```text
//! A' = A_OO − A_OC A_CC⁻¹ A_CO,    h' = h_O − A_OC A_CC⁻¹ h_C,    |A_zz| = |A_CC| |A'_{z∩O}|
//! δ_C | δ_O, φ ~ N(−A_CC⁻¹ h_C − T δ_O, φ A_CC⁻¹),    T = A_CC⁻¹ A_CO
//! ```
//!
//! (`h_CᵀA_CC⁻¹h_C` is rounding, squared.) A walk over models needs O alone, and mean and variance of C follow from those
//! of O exactly, model by model or from the averages.

use super::answer::Averages;
use super::certainty::Certain;
use super::standard::{Block, Standard, halves_in, nudged};
use crate::linear_algebra::Cholesky;

/// See the module's text. Sets of components are by place in `open.blocks`.
#[derive(Debug)]
pub(super) struct Reduced<'a> {
    /// All columns.
    pub(super) full: &'a Standard,
    /// The columns that are left, scaled to a unit diagonal again.
    pub(super) open: Standard,
    /// Components of `open` that are in for certain all the same: their bounds may act.
    pub(super) certain: Vec<usize>,
    /// Components of `open` that may be in or out.
    pub(super) active: Vec<usize>,
    /// Place in `full.blocks` of each component of `open`, and of those integrated out.
    places: Vec<usize>,
    gone_places: Vec<usize>,
    /// Position in `full` of each position of `open`, and of those integrated out.
    left: Vec<usize>,
    gone: Vec<usize>,
    /// Units of `open` per unit of `full`.
    stretch: Vec<f64>,
    /// `−A_CC⁻¹ h_C`.
    origin: Vec<f64>,
    /// T by columns, in units of `open`: `response[o * gone + c]`.
    response: Vec<f64>,
    /// `(A_CC⁻¹)_cc`.
    spread: Vec<f64>,
}

/// Moments of the columns integrated out in one model: E[δ] and Var/φ.
#[derive(Debug, Default, Clone)]
pub(super) struct Response {
    pub(super) delta: Vec<f64>,
    pub(super) variance: Vec<f64>,
    /// `Σ_b C_ab T_b` of one member a.
    row: Vec<f64>,
}

impl<'a> Reduced<'a> {
    /// Without the components that are certain and whose bounds never act.
    pub(super) fn new(full: &'a Standard, certain: &Certain) -> Self {
        let goes =
            |block: &Block| certain.sure[block.component] && certain.settled[block.component];
        Self::without(full, certain, goes).unwrap_or_else(|| Self::whole(full, certain))
    }

    /// With every column in the tableau.
    pub(super) fn whole(full: &'a Standard, certain: &Certain) -> Self {
        let (sure, active) =
            (0..full.blocks.len()).partition(|&b| certain.sure[full.blocks[b].component]);
        Self {
            full,
            open: full.clone(),
            certain: sure,
            active,
            places: (0..full.blocks.len()).collect(),
            gone_places: Vec::new(),
            left: (0..full.size()).collect(),
            gone: Vec::new(),
            stretch: vec![1.0; full.size()],
            origin: Vec::new(),
            response: Vec::new(),
            spread: Vec::new(),
        }
    }

    /// `None` where nothing goes, or what goes has no factor.
    fn without(
        full: &'a Standard,
        certain: &Certain,
        goes: impl Fn(&Block) -> bool,
    ) -> Option<Self> {
        let (gone_places, places): (Vec<usize>, Vec<usize>) =
            (0..full.blocks.len()).partition(|&b| goes(&full.blocks[b]));
        if gone_places.is_empty() {
            return None;
        }
        let positions = |places: &[usize]| -> Vec<usize> {
            let blocks = places.iter().map(|&b| full.blocks[b]);
            blocks.flat_map(|block| block.range()).collect()
        };
        let (gone, left) = (positions(&gone_places), positions(&places));
        let elimination = Elimination::new(full, &gone, &left)?;
        let mut matrix = elimination.complement(full, &left);
        let stretch = unit_diagonal(full, &left, &mut matrix);
        let offset = elimination.offset(full, &left, &stretch);
        let (held, log_held) = elimination.held(full, &gone_places, &gone);
        let open = Standard {
            blocks: consecutive(full, &places),
            held,
            log_held,
            matrix,
            offset,
            ..stretched(full, &left, &stretch)
        };
        let (sure, active) =
            (0..open.blocks.len()).partition(|&b| certain.sure[open.blocks[b].component]);
        let spread = elimination.factor.inverse_diagonal();
        let (origin, response) = elimination.solved(&stretch);
        Some(Self {
            full,
            open,
            certain: sure,
            active,
            places,
            gone_places,
            left,
            spread,
            gone,
            stretch,
            origin,
            response,
        })
    }

    /// Whether columns were integrated out.
    pub(super) fn shrinks(&self) -> bool {
        !self.gone.is_empty()
    }

    /// (columns ascending, positions in `full`) of a model, `set` by place in `open.blocks`.
    pub(super) fn members(&self, set: &[u64]) -> (Vec<u32>, Vec<usize>) {
        let mut whole = vec![0u64; self.full.blocks.len().div_ceil(64)];
        let inside = (0..self.places.len()).filter(|b| set[b / 64] >> (b % 64) & 1 == 1);
        for place in inside
            .map(|b| self.places[b])
            .chain(self.gone_places.iter().copied())
        {
            whole[place / 64] |= 1 << (place % 64);
        }
        self.full.members(&whole)
    }

    /// Values by component of `open` in the order of `full.blocks`, `gone` for the others.
    pub(super) fn by_block(&self, values: &[f64], gone: f64) -> Vec<f64> {
        let mut out = vec![gone; self.full.blocks.len()];
        for (&place, value) in self.places.iter().zip(values) {
            out[place] = *value;
        }
        out
    }

    /// First position in `full` of a component of `open`.
    pub(super) fn first_position(&self, block: usize) -> usize {
        self.full.blocks[self.places[block]].start
    }

    /// Position in `full` and units per its unit of every position of `open`.
    pub(super) fn left(&self) -> impl Iterator<Item = (usize, f64)> {
        self.left.iter().copied().zip(self.stretch.iter().copied())
    }

    /// Positions in `full` of the columns integrated out.
    pub(super) fn gone(&self) -> &[usize] {
        &self.gone
    }

    /// Moments of the columns integrated out, from δ of `open` and the rows of (A'_zz)⁻¹ of its members.
    #[inline(always)]
    pub(super) fn respond<'r>(
        &self,
        delta: &[f64],
        members: &[usize],
        row: impl Fn(usize) -> &'r [f64],
        into: &mut Response,
    ) {
        let out = self.gone.len();
        into.delta.clear();
        into.delta.extend_from_slice(&self.origin);
        into.variance.clear();
        into.variance.extend_from_slice(&self.spread);
        if out == 0 {
            return;
        }
        for (delta, column) in delta.iter().zip(self.response.chunks_exact(out)) {
            for (value, t) in into.delta.iter_mut().zip(column) {
                *value -= t * delta;
            }
        }
        let column = |o: usize| &self.response[o * out..(o + 1) * out];
        for (place, &a) in members.iter().enumerate() {
            let covariance = row(a);
            // Twice the half below the diagonal, and the diagonal.
            into.row.clear();
            into.row.extend(column(a).iter().map(|t| covariance[a] * t));
            for &b in &members[..place] {
                let twice = 2.0 * covariance[b];
                for (value, t) in into.row.iter_mut().zip(column(b)) {
                    *value += twice * t;
                }
            }
            for ((value, t), sum) in into.variance.iter_mut().zip(column(a)).zip(&into.row) {
                *value += t * sum;
            }
        }
    }

    /// Averages over models of all columns from those of `open`; `products` is E[δ δᵀ], needed where columns are gone.
    pub(super) fn widen(&self, open: Averages, products: &[f64]) -> Averages {
        let (size, count, out) = (self.full.size(), self.left.len(), self.gone.len());
        let mut wide = Averages {
            inclusion: vec![1.0; size],
            mcse: vec![0.0; size],
            shift: vec![0.0; size],
            moment: vec![0.0; size],
            misfit: open.misfit,
        };
        for (i, (d, stretch)) in self.left().enumerate() {
            wide.inclusion[d] = open.inclusion[i];
            wide.mcse[d] = open.mcse[i];
            wide.shift[d] = open.shift[i] / stretch;
            wide.moment[d] = open.moment[i] / (stretch * stretch);
        }
        let factor = self.full.noise_factor();
        let phi = if factor.is_finite() {
            open.misfit * factor
        } else {
            0.0
        };
        let mut row = vec![0.0; count];
        for (c, &d) in self.gone.iter().enumerate() {
            let own: Vec<f64> = (0..count).map(|o| self.response[o * out + c]).collect();
            let t = |o: usize| own[o];
            // T E[δ δᵀ] Tᵀ
            for (i, value) in row.iter_mut().enumerate() {
                let entries = &products[i * count..(i + 1) * count];
                *value = entries.iter().enumerate().map(|(j, m)| m * t(j)).sum();
            }
            let square: f64 = row.iter().enumerate().map(|(i, m)| m * t(i)).sum();
            let along: f64 = (0..count).map(|o| t(o) * open.shift[o]).sum();
            let origin = self.origin[c];
            wide.shift[d] = origin - along;
            wide.moment[d] = origin * origin - 2.0 * origin * along + square + phi * self.spread[c];
        }
        wide
    }
}

/// A_CC factored, and what couples it to the columns that are left.
struct Elimination {
    /// L of A_CC.
    factor: Cholesky,
    /// Columns of C.
    out: usize,
    /// L⁻¹ A_CO by columns.
    cross: Vec<f64>,
    /// L⁻¹ h_C.
    origin: Vec<f64>,
}

impl Elimination {
    /// `None` where A_CC has no factor.
    fn new(full: &Standard, gone: &[usize], left: &[usize]) -> Option<Self> {
        let (size, out) = (full.size(), gone.len());
        let at = |i: usize, j: usize| full.matrix[i * size + j];
        let mut square = Vec::with_capacity(out * out);
        for &i in gone {
            square.extend(gone.iter().map(|&j| at(i, j)));
        }
        let factor = nudged(&square, out).ok()?;
        let mut cross: Vec<f64> = left
            .iter()
            .flat_map(|&o| gone.iter().map(move |&c| at(c, o)))
            .collect();
        cross
            .chunks_exact_mut(out)
            .for_each(|column| factor.solve_lower(column));
        let mut origin: Vec<f64> = gone.iter().map(|&c| full.offset[c]).collect();
        factor.solve_lower(&mut origin);
        Some(Self {
            factor,
            out,
            cross,
            origin,
        })
    }

    /// Column o of L⁻¹ A_CO.
    fn column(&self, o: usize) -> &[f64] {
        &self.cross[o * self.out..(o + 1) * self.out]
    }

    /// A_OO − A_OC A_CC⁻¹ A_CO.
    fn complement(&self, full: &Standard, left: &[usize]) -> Vec<f64> {
        let (size, count) = (full.size(), left.len());
        let mut matrix = vec![0.0; count * count];
        for i in 0..count {
            for j in 0..=i {
                let value = full.matrix[left[i] * size + left[j]]
                    - inner_product(self.column(i), self.column(j));
                matrix[i * count + j] = value;
                matrix[j * count + i] = value;
            }
        }
        matrix
    }

    /// h_O − A_OC A_CC⁻¹ h_C in the units of the columns that are left.
    fn offset(&self, full: &Standard, left: &[usize], stretch: &[f64]) -> Vec<f64> {
        (0..left.len())
            .map(|i| {
                (full.offset[left[i]] - inner_product(self.column(i), &self.origin)) / stretch[i]
            })
            .collect()
    }

    /// `held` and `log_held` of a [`Standard`] without these columns.
    fn held(&self, full: &Standard, gone_places: &[usize], gone: &[usize]) -> (Vec<usize>, f64) {
        let mut held = full.held.clone();
        let mut log_held = full.log_held - 0.5 * self.factor.log_determinant();
        for &b in gone_places {
            held[full.blocks[b].family] += 1;
            log_held += full.blocks[b].factor.ln();
        }
        log_held += gone
            .iter()
            .map(|&c| 0.5 * full.precision[c].ln())
            .sum::<f64>();
        (held, log_held)
    }

    /// `−A_CC⁻¹ h_C`, and T in the units of the columns that are left.
    fn solved(self, stretch: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let Self {
            factor,
            out,
            cross: mut response,
            mut origin,
        } = self;
        for (column, stretch) in response.chunks_exact_mut(out).zip(stretch) {
            factor.solve_upper(column);
            column.iter_mut().for_each(|x| *x /= stretch);
        }
        factor.solve_upper(&mut origin);
        origin.iter_mut().for_each(|x| *x = -*x);
        (origin, response)
    }
}

/// `xᵀy`.
fn inner_product(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// Scales the matrix of the columns that are left to a unit diagonal; units of each per unit of `full`.
fn unit_diagonal(full: &Standard, left: &[usize], matrix: &mut [f64]) -> Vec<f64> {
    let count = left.len();
    let stretch: Vec<f64> = left
        .iter()
        .enumerate()
        // A ⪰ V⁻¹: no Schur complement is smaller than the slab's part.
        .map(|(i, &d)| matrix[i * count + i].max(full.precision[d]).sqrt())
        .collect();
    for i in 0..count {
        for j in 0..count {
            matrix[i * count + j] /= stretch[i] * stretch[j];
        }
        matrix[i * count + i] = 1.0;
    }
    stretch
}

/// The blocks at some places, one after the other.
fn consecutive(full: &Standard, places: &[usize]) -> Vec<Block> {
    let mut start = 0;
    places
        .iter()
        .map(|&b| {
            let block = Block {
                start,
                ..full.blocks[b]
            };
            start += block.len;
            block
        })
        .collect()
}

/// Some positions of `full` in other units; blocks, matrix and offset are empty.
fn stretched(full: &Standard, left: &[usize], stretch: &[f64]) -> Standard {
    let with = |values: &[f64], scaled: fn(f64, f64) -> f64| -> Vec<f64> {
        let pairs = left.iter().zip(stretch);
        pairs
            .map(|(&d, stretch)| scaled(values[d], *stretch))
            .collect()
    };
    let lower = with(&full.lower, |lower, stretch| lower * stretch);
    // Of those with a column that goes none acts.
    let halves = halves_in(&full.halves, left, |i| 1.0 / stretch[i]);
    Standard {
        order: left.iter().map(|&d| full.order[d]).collect(),
        names: left.iter().map(|&d| full.names[d].clone()).collect(),
        component: full.component.clone(),
        blocks: Vec::new(),
        held: Vec::new(),
        log_held: 0.0,
        scale: with(&full.scale, |scale, stretch| scale * stretch),
        unit: full.unit,
        matrix: Vec::new(),
        center: with(&full.center, |center, stretch| center * stretch),
        offset: Vec::new(),
        precision: with(&full.precision, |own, stretch| own / (stretch * stretch)),
        bounded: lower.iter().any(|&l| l > f64::NEG_INFINITY) || !halves.is_empty(),
        lower,
        halves,
        shape: full.shape,
        full_scale: full.full_scale,
        log_constant: full.log_constant,
    }
}

#[cfg(test)]
mod tests;
