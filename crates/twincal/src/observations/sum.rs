//! Statistics of the rows of many parts, added up as they come: what a part costs is its rows, however short it is.

use super::Part;
use crate::gram::{Gram, JointAccumulator, JointGram};
use crate::term::Recipes;
use rayon::prelude::*;
use std::sync::Arc;

/// Sums that go on from part to part. (A Gram per part would cost as much as hundreds of rows, each.)
#[derive(Debug, Default)]
pub(crate) struct GramSum {
    joints: Vec<JointSum>,
}

/// Sums of one joint.
#[derive(Debug, Default)]
struct JointSum {
    /// One accumulator for all parts whose columns follow alike from what is kept: one, or two where a payload acts in some logs only.
    sums: Vec<(Option<Arc<Recipes>>, JointAccumulator)>,
}

impl GramSum {
    /// Adds the rows of one more part; standstill rows are left out and end a run.
    ///
    /// # Panics
    /// If it belongs to another robot or library than those before.
    pub(crate) fn add(&mut self, part: &Part<'_>) {
        let joints = part.observations.joints.len();
        if self.joints.is_empty() {
            self.joints.resize_with(joints, JointSum::default);
        }
        assert_eq!(
            self.joints.len(),
            joints,
            "statistics of different robots do not add"
        );
        let sums = self.joints.par_iter_mut().enumerate();
        sums.for_each(|(joint, sum)| sum.add(part, joint));
    }

    /// Of all parts; default without any.
    pub(crate) fn finish(self) -> Gram {
        let joints = self.joints.into_iter().map(JointSum::finish);
        Gram {
            joints: joints.collect(),
        }
    }
}

impl JointSum {
    fn add(&mut self, part: &Part<'_>, joint: usize) {
        let rows = &part.observations.joints[joint];
        let known = (self.sums.iter()).position(|(recipes, _)| *recipes == rows.recipes);
        let at = known.unwrap_or_else(|| {
            let new = (rows.recipes.clone(), part.accumulator(joint));
            self.sums.push(new);
            self.sums.len() - 1
        });
        part.add_joint(joint, &mut self.sums[at].1);
    }

    fn finish(self) -> JointGram {
        let mut sum = JointGram::default();
        for (_, accumulator) in self.sums {
            sum += &accumulator.finish();
        }
        sum
    }
}

impl<'a> FromIterator<&'a Part<'a>> for Gram {
    /// Sum over parts.
    fn from_iter<I: IntoIterator<Item = &'a Part<'a>>>(parts: I) -> Self {
        let parts: Vec<&Part<'_>> = parts.into_iter().collect();
        let joints = parts
            .first()
            .map_or(0, |part| part.observations.joints.len());
        let of_joint = |joint: usize| {
            let mut sum = JointSum::default();
            parts.iter().for_each(|part| sum.add(part, joint));
            sum.finish()
        };
        let joints = (0..joints).into_par_iter().map(of_joint);
        Gram {
            joints: joints.collect(),
        }
    }
}
