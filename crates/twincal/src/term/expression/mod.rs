//! Expressions: text → hash-consed graph → derivatives → instructions over blocks of samples.

mod bounds;
mod derivative;
mod dimension;
mod graph;
mod parse;
mod tape;

pub(crate) use bounds::{Bounded, bounded_values};
pub(crate) use dimension::{Dimension, dimensions};
pub use graph::Function;
pub(crate) use graph::{Graph, Id, Node, Variable};
pub(crate) use parse::parse;
pub(crate) use tape::{Scratch as TapeScratch, Slot, Tape};
