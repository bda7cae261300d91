//! Where a pass over the logs ends before its result, with what another pass needs to know.

use super::fit::lower_band::TooFew;
use super::fit::ripples::Seen;
use super::fit::wider_band::Wider;
use crate::error::Error;
use std::collections::BTreeMap;

/// Why a pass ends without a result.
pub(super) enum Exit {
    /// The residual shows gear ripple that is no candidate.
    Ripple(Vec<Seen>),
    /// Effects multiply each other: columns are needed about these, by name of their term.
    Elsewhere(BTreeMap<String, f64>),
    /// The noise allows a wider band.
    Wider(Box<Wider>),
    /// Too few rows in this band.
    TooFew(TooFew),
    /// A coarse encoder masks the torque of the model in this band.
    Masked(TooFew),
    /// Chains over the models of all candidates disagree.
    Disagreeing(Error),
    /// An error that has nothing to do with the band.
    Failed(Error),
}

/// A stage of a pass: its value, or the end of the pass.
pub(super) type Pass<T> = std::result::Result<T, Exit>;

impl From<Error> for Exit {
    fn from(error: Error) -> Self {
        Self::Failed(error)
    }
}
