//! Rows become coefficients: the columns to choose from, one fit of them, and what a fit asks of the next one.

pub(super) mod columns;
pub(super) mod compact;
pub(super) mod dissipative;
pub(super) mod fitted;
pub(super) mod friction_only;
pub(super) mod heredity;
pub(super) mod lower_band;
pub(super) mod noise_of;
pub(super) mod relinearise;
pub(super) mod ripples;
pub(super) mod smaller_library;
pub(super) mod turning;
pub(super) mod weigh;
pub(super) mod whiteness;
pub(super) mod wider_band;
