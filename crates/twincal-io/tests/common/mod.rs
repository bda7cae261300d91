//! What tests of several readers need.

pub(crate) mod logs;
pub(crate) mod refusals;
