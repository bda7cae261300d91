//! The stages of one pass over the logs: each takes the value of the stage before it and gives the next one.

mod check;
mod conclude;
mod estimate;
mod prepare;
mod rows;
mod validate;

pub(super) use check::check;
pub(super) use conclude::{conclude, told};
pub(super) use estimate::{count, estimate};
pub(super) use prepare::prepare;
pub(super) use rows::read;
pub(super) use validate::validate;
