//! Kept rows as the blocks that made them: what predictors and scores take.

use super::Observations;
use crate::rows::{JointRows, MAX_BLOCK, RowBlock};
use crate::signal::Numbers;
use std::borrow::Cow;

impl Observations {
    /// Visits the rows at or after time `since` (s; −∞: all of them), in order, as [`crate::rows::visit_rows`] does but for the input
    /// rows, which are not kept.
    pub(crate) fn visit_since(&self, since: f64, visit: &mut dyn FnMut(&RowBlock<'_>)) {
        let ends = self.starts.iter().skip(1).copied();
        let ends = ends.chain(std::iter::once(self.len()));
        for (segment, (&start, end)) in self.starts.iter().zip(ends).enumerate() {
            let mut from = start + self.time[start..end].partition_point(|t| *t < since);
            while from < end {
                let joints = self.joints.iter();
                let together = joints.map(|joint| joint.together_until(from, end)).min();
                let to = end.min(from + MAX_BLOCK).min(together.unwrap_or(end));
                self.visit_block(segment, from == start, from..to, visit);
                from = to;
            }
        }
    }

    fn visit_block(
        &self,
        segment: usize,
        first: bool,
        rows: std::ops::Range<usize>,
        visit: &mut dyn FnMut(&RowBlock<'_>),
    ) {
        let gather = |joints: &[Numbers]| -> Vec<f64> {
            let own = joints.iter().map(|joint| joint.some(rows.clone()));
            own.flat_map(|own| own.into_owned()).collect()
        };
        // The columns of all joints at these rows, which are together.
        let mut held = vec![(Vec::new(), self.len()); self.joints.len()];
        for (joint, held) in self.joints.iter().zip(&mut held) {
            if joint.shelved.is_some() || joint.recipes.is_some() {
                joint.visit_columns(self.len(), rows.clone(), &mut |_, columns| {
                    *held = (columns.x.to_vec(), columns.stride);
                });
            }
        }
        let torques = self.joints.iter().map(|joint| {
            let [measured, nominal] = [&joint.measured, &joint.nominal];
            [measured.some(rows.clone()), nominal.some(rows.clone())]
        });
        let torques: Vec<[Cow<'_, [f64]>; 2]> = torques.collect();
        let products: Vec<Vec<f64>> = (self.joints.iter())
            .map(|joint| joint.products(rows.clone()))
            .collect();
        let torques = torques.iter().zip(&products);
        let joints = self.joints.iter().zip(&held).zip(torques);
        let joints = joints.map(
            |((joint, (held, stride)), ([measured, nominal], products))| JointRows {
                columns: &joint.columns,
                recipes: None,
                stride: *stride,
                x: if joint.shelved.is_some() || joint.recipes.is_some() {
                    held
                } else {
                    joint.x.get(rows.start..).unwrap_or_default()
                },
                measured,
                nominal,
                products,
                standstill: &joint.standstill[rows.clone()],
            },
        );
        visit(&RowBlock {
            segment,
            first,
            len: rows.len(),
            time: &self.time[rows.clone()],
            input_rows: &[],
            q: &gather(&self.q),
            qd: &gather(&self.qd),
            qdd: &gather(&self.qdd),
            joints: joints.collect(),
        });
    }
}
