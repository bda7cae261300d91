//! An exchange as one block pivot: components leave while others enter, without a walk there and back.
//!
//! With the leaving positions L of a model and the entering ones E, in the tableau's terms,
//!
//! ```text
//! M = [C_LL T_LE; T_LEᵀ −S_EE],   g = [β_L; −u_E],   v_i = [C_iL t_iE]
//! β_i −= v_i M⁻¹ g,   C_ii −= v_i M⁻¹ v_iᵀ   (what stays)       β_E = (M⁻¹ g)_E,   C_EE = −(M⁻¹)_EE   (what enters)
//! ```
//!
//! M is quasi-definite: `L D Lᵀ` exists in any order (Vanderbei 1995), first the leaving positions, then the entering ones.

use super::tableau::Tableau;

/// See the module's text.
#[derive(Debug)]
pub(super) struct Pivot {
    /// Leaving positions, then the entering ones.
    pub(super) positions: Vec<usize>,
    /// How many leave.
    pub(super) leaving: usize,
    /// Unit upper factor: row i right of the diagonal.
    factor: Vec<f64>,
    /// D.
    pub(super) pivots: Vec<f64>,
    /// `L⁻¹ g`.
    rhs: Vec<f64>,
    /// The weight is multiplied by `d^−½` beside prior and misfit, as in [`Tableau::block`].
    pub(super) determinant: f64,
    /// What is added to c.
    pub(super) change: f64,
}

impl Pivot {
    /// The exchange of the components `leaving` for the components `entering`, by place in `standard.blocks`.
    pub(super) fn new(tableau: &Tableau<'_>, leaving: &[usize], entering: &[usize]) -> Self {
        let blocks = &tableau.standard.blocks;
        let columns = |of: &[usize]| of.iter().map(|&b| blocks[b].len).sum::<usize>();
        let (out, all) = (columns(leaving), columns(leaving) + columns(entering));
        let mut pivot = Self {
            positions: leaving
                .iter()
                .chain(entering)
                .flat_map(|&b| blocks[b].range())
                .collect(),
            leaving: out,
            factor: vec![0.0; all * all],
            pivots: vec![0.0; all],
            rhs: vec![0.0; all],
            determinant: 1.0,
            change: 0.0,
        };
        for a in 0..out {
            let row = tableau.row(pivot.positions[a]);
            pivot.rhs[a] = tableau.gradient[pivot.positions[a]];
            for (b, &k) in pivot.positions.iter().enumerate().skip(a) {
                pivot.factor[a * all + b] = row[k];
            }
        }
        let mut from = out;
        for (at, &block) in entering.iter().enumerate() {
            pivot.enter(tableau, from, block, &entering[at + 1..]);
            from += blocks[block].len;
        }
        pivot.eliminate(tableau);
        pivot
    }

    /// Fills the rows of an entering component; `later` enter after it.
    fn enter(&mut self, tableau: &Tableau<'_>, from: usize, block: usize, later: &[usize]) {
        let (all, own) = (self.pivots.len(), tableau.standard.blocks[block]);
        for i in 0..own.len {
            let row = from + i;
            self.rhs[row] = -tableau.gradient[own.start + i];
            if own.len == 1 {
                self.factor[row * all + row] = -tableau.diagonal[own.start];
            } else {
                let square = &tableau.square(block)[i * own.len..(i + 1) * own.len];
                for (k, value) in square.iter().enumerate().skip(i) {
                    self.factor[row * all + from + k] = -value;
                }
            }
            let mut column = from + own.len;
            for &other in later {
                for j in tableau.standard.blocks[other].range() {
                    self.factor[row * all + column] = -tableau.schur(own.start + i, j);
                    column += 1;
                }
            }
        }
    }

    fn eliminate(&mut self, tableau: &Tableau<'_>) {
        let all = self.pivots.len();
        for i in 0..all {
            let inside = i < self.leaving;
            let (least, unit) = tableau.least(self.positions[i], inside);
            let sign = if inside { 1.0 } else { -1.0 };
            let size = (sign * self.factor[i * all + i]).max(least);
            self.pivots[i] = sign * size;
            self.determinant *= size * unit;
            self.change += sign * self.rhs[i] * self.rhs[i] / size;
            let inverse = sign / size;
            let (top, below) = self.factor.split_at_mut((i + 1) * all);
            let row = &mut top[i * all..];
            for l in i + 1..all {
                let factor = row[l] * inverse;
                let other = &mut below[(l - i - 1) * all..(l - i) * all];
                for k in l..all {
                    other[k] -= factor * row[k];
                }
                self.rhs[l] -= factor * self.rhs[i];
            }
            row[i + 1..all].iter_mut().for_each(|x| *x *= inverse);
        }
    }

    /// `(v M⁻¹ g, v M⁻¹ vᵀ)`; `v` becomes `L⁻¹ v`, so that `v M⁻¹ wᵀ` of two such rows is their product by D⁻¹.
    pub(super) fn forms(&self, v: &mut [f64]) -> (f64, f64) {
        let all = self.pivots.len();
        let (mut with_gradient, mut with_itself) = (0.0, 0.0);
        for i in 0..all {
            let own = v[i];
            let scaled = own / self.pivots[i];
            with_gradient += scaled * self.rhs[i];
            with_itself += scaled * own;
            let row = &self.factor[i * all..(i + 1) * all];
            for k in i + 1..all {
                v[k] -= row[k] * own;
            }
        }
        (with_gradient, with_itself)
    }
}

#[cfg(test)]
mod tests;
