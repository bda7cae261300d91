//! A fit is not believed before it is checked: against its residual, rows that it has not seen, other cut-offs and its prior.

pub(super) mod another_state;
pub(super) mod correlate;
pub(super) mod drift;
pub(super) mod heavy_tails;
pub(super) mod held_out;
pub(super) mod independent_rows;
pub(super) mod left_out;
pub(super) mod misfit;
pub(super) mod prior_conflict;
pub(super) mod sandwich;
pub(super) mod sweep;
pub(super) mod uneven_noise;
pub(super) mod unsettled;
pub(super) mod worse;
