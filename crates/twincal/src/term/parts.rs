//! Fewer signals than columns: what has to be filtered at the log's rate.
//!
//! Every inertial column is a fixed combination of entries of the joint-torque regressor, and a filter is linear: the
//! entries are filtered, and columns are combined where a row is kept. A 7-joint arm has 245 entries and, with payload,
//! mass moments and tensors, 350 inertial columns on its joints; at 1 kHz and 12.5 rows per second combining afterwards
//! is 80 times cheaper.

use super::expression::{Graph, Id, Slot, Tape};
use super::model_column::{ModelColumn, ModelColumns, Scratch};
use crate::robot::Motion;
use std::collections::BTreeMap;

/// How a column follows from the parts of its joint.
#[derive(Debug, Clone, PartialEq)]
enum Recipe {
    /// It is one.
    Part(usize),
    /// Σ weight · part.
    Sum(Vec<(usize, f64)>),
}

/// The parts of all columns of a library, ready to be evaluated.
#[derive(Debug, Clone, Default)]
pub(super) struct Parts {
    tape: Tape,
    model: Option<ModelColumns>,
    /// Per joint.
    counts: Vec<usize>,
    /// Per joint, per column of that joint.
    recipes: Vec<Vec<Recipe>>,
}

/// The torque of a column, and on which joints.
pub(super) enum Torque<'a> {
    /// `(joint, torque)`.
    Expression(&'a [(usize, Id)]),
    /// From the model, on these joints.
    Model(&'a ModelColumn, &'a [usize]),
}

impl Parts {
    /// The parts of columns in order; `model` knows the robot.
    pub(super) fn new<'a>(
        graph: &Graph,
        model: Option<&ModelColumns>,
        joints: usize,
        columns: impl Iterator<Item = Torque<'a>>,
    ) -> Self {
        let mut parts = Self {
            tape: Tape::default(),
            model: model.map(ModelColumns::emptied),
            counts: vec![0; joints],
            recipes: vec![Vec::new(); joints],
        };
        let mut outputs = Vec::new();
        // (joint, body, parameter) → part
        let mut entries: BTreeMap<(usize, usize, usize), usize> = BTreeMap::new();
        for column in columns {
            match column {
                Torque::Expression(image) => {
                    for &(joint, torque) in image {
                        let row = parts.next(joint);
                        outputs.push((torque, Slot { table: joint, row }));
                        parts.recipes[joint].push(Recipe::Part(row));
                    }
                }
                Torque::Model(&ModelColumn::Inertia { body, weights }, on) => {
                    for &joint in on {
                        let used = (0..10).filter(|&k| {
                            weights[k] != 0.0
                                && parts
                                    .model
                                    .as_ref()
                                    .is_some_and(|model| model.acts(joint, body, k))
                        });
                        let sum: Vec<(usize, f64)> = used
                            .collect::<Vec<_>>()
                            .into_iter()
                            .map(|k| {
                                let part = entries
                                    .entry((joint, body, k))
                                    .or_insert_with(|| parts.entry(joint, body, k));
                                (*part, weights[k])
                            })
                            .collect();
                        parts.recipes[joint].push(Recipe::Sum(sum));
                    }
                }
                Torque::Model(other, on) => {
                    let slots: Vec<(usize, usize)> =
                        on.iter().map(|&joint| (joint, parts.next(joint))).collect();
                    for &(joint, row) in &slots {
                        parts.recipes[joint].push(Recipe::Part(row));
                    }
                    if let Some(model) = &mut parts.model {
                        model.push(other.clone(), slots);
                    }
                }
            }
        }
        parts.tape = Tape::new(graph, &outputs);
        parts
    }

    /// The same parts of a robot with other inertias.
    pub(super) fn on(&self, model: Option<&ModelColumns>) -> Self {
        Self {
            model: self
                .model
                .as_ref()
                .zip(model)
                .map(|(own, model)| own.of(model)),
            ..self.clone()
        }
    }

    /// A new part of a joint.
    fn next(&mut self, joint: usize) -> usize {
        self.counts[joint] += 1;
        self.counts[joint] - 1
    }

    /// A new part: what parameter `k` of `body` adds to the torque of `joint`.
    fn entry(&mut self, joint: usize, body: usize, k: usize) -> usize {
        let part = self.next(joint);
        let weights = std::array::from_fn(|i| f64::from(u8::from(i == k)));
        if let Some(model) = &mut self.model {
            model.push(ModelColumn::Inertia { body, weights }, vec![(joint, part)]);
        }
        part
    }

    /// Parts of a joint.
    pub(super) fn count(&self, joint: usize) -> usize {
        self.counts[joint]
    }

    /// Writes every part: `out[joint][part * len + sample]`.
    pub(super) fn evaluate(&self, motion: Motion<'_>, out: &mut [Vec<f64>], scratch: &mut Scratch) {
        let counts = self.counts.iter().copied();
        evaluate(
            counts,
            &self.tape,
            self.model.as_ref(),
            motion,
            out,
            scratch,
        );
    }

    /// Columns of a joint from its filtered parts: `parts[part * stride + row]` to `out[column * rows + row]`.
    pub(super) fn combine(
        &self,
        joint: usize,
        parts: &[f64],
        stride: usize,
        rows: usize,
        out: &mut Vec<f64>,
    ) {
        let recipes = &self.recipes[joint];
        out.resize(recipes.len() * rows, 0.0);
        for (recipe, cells) in recipes.iter().zip(out.chunks_exact_mut(rows.max(1))) {
            match recipe {
                Recipe::Part(part) => {
                    cells.copy_from_slice(&parts[part * stride..part * stride + rows]);
                }
                Recipe::Sum(sum) => {
                    cells.fill(0.0);
                    for &(part, weight) in sum {
                        let part = &parts[part * stride..part * stride + rows];
                        for (cell, value) in cells.iter_mut().zip(part) {
                            *cell += weight * value;
                        }
                    }
                }
            }
        }
    }
}

/// Writes what a tape and a model make of a motion, `counts` signals on each joint: `out[joint][signal * len + sample]`.
pub(super) fn evaluate(
    counts: impl Iterator<Item = usize>,
    tape: &Tape,
    model: Option<&ModelColumns>,
    motion: Motion<'_>,
    out: &mut [Vec<f64>],
    scratch: &mut Scratch,
) {
    for (count, out) in counts.zip(out.iter_mut()) {
        out.resize(count * motion.len, 0.0);
    }
    tape.evaluate(motion, out, &mut scratch.tape);
    if let Some(model) = model {
        model.evaluate(motion, out, scratch);
    }
}
