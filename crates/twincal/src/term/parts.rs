//! Fewer signals than columns: what is evaluated and filtered at the log's rate, kept, and summed.
//!
//! Every inertial column is a fixed combination of entries of the joint-torque regressor, and these depend on each other:
//! what lies on the axis of a joint moves alike on either side of it (regrouped parameters, Khalil and Dombre). A 7-joint arm
//! has 350 inertial columns on its joints with payload, mass moments and tensors; they are combinations of 253 entries, and
//! of 185 that are independent. Where few links have columns their own entries may be fewer: each joint has what is less.

use super::course::Course;
use super::expression::{Graph, Id, Slot, Tape};
use super::model_column::{ModelColumn, ModelColumns, Scratch};
use super::recipes::Recipes;
use super::table::Table;
use crate::robot::{Robot, regrouped};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Shares below this of a column's largest are rounding.
const ROUNDING: f64 = 1e-14;

/// The parts of all columns of a library, ready to be evaluated.
#[derive(Debug, Clone, Default)]
pub(super) struct Parts {
    tape: Tape,
    model: Option<ModelColumns>,
    /// Per joint.
    recipes: Vec<Arc<Recipes>>,
}

/// The torque of a column, and on which joints.
pub(super) enum Torque<'a> {
    /// `(joint, torque)`.
    Expression(&'a [(usize, Id)]),
    /// From the model, on these joints.
    Model(&'a ModelColumn, &'a [usize]),
}

/// An entry of the regressor on a joint: body, parameter.
type Entry = (usize, usize);
/// Σ weight · entry.
type Sum = Vec<(Entry, f64)>;

/// What is known of a joint before its inertial columns are.
#[derive(Debug, Clone, Default)]
struct Joint {
    parts: usize,
    /// Per column; empty where it is inertial.
    columns: Vec<Vec<(usize, f64)>>,
    /// Inertial columns: which, and their entries, as they stand and regrouped.
    inertial: Vec<(usize, [Sum; 2])>,
}

impl Joint {
    /// A part that is a column.
    fn column(&mut self) -> usize {
        self.columns.push(vec![(self.parts, 1.0)]);
        self.parts += 1;
        self.parts - 1
    }

    /// A column of a body's inertia, of the entries that act on this joint.
    fn inertial_column(&mut self, ways: &[Sum; 2], acts: impl Fn(Entry) -> bool) {
        let acting = |way: &Sum| {
            let own = way.iter().filter(|(entry, _)| acts(*entry));
            own.copied().collect()
        };
        self.inertial
            .push((self.columns.len(), [acting(&ways[0]), acting(&ways[1])]));
        self.columns.push(Vec::new());
    }

    /// Makes the inertial columns of the fewest entries; which these are, with their parts.
    fn settle(&mut self) -> BTreeMap<Entry, usize> {
        let entries = |way: usize| {
            let of_columns = self.inertial.iter().flat_map(move |(_, ways)| &ways[way]);
            let numbered = of_columns.map(|(entry, _)| (*entry, 0));
            numbered.collect::<BTreeMap<Entry, usize>>()
        };
        let [own, regrouped] = [entries(0), entries(1)];
        let way = usize::from(regrouped.len() < own.len());
        let mut chosen = if way == 0 { own } else { regrouped };
        for part in chosen.values_mut() {
            *part = self.parts;
            self.parts += 1;
        }
        for (column, ways) in &self.inertial {
            let weights = ways[way]
                .iter()
                .map(|(entry, weight)| (chosen[entry], *weight));
            self.columns[*column] = weights.collect();
        }
        chosen
    }
}

impl Parts {
    /// The parts of columns in order; `model` knows the robot.
    pub(super) fn new<'a>(
        graph: &Graph,
        model: Option<&ModelColumns>,
        joints: usize,
        columns: impl Iterator<Item = Torque<'a>>,
    ) -> Self {
        let mut made = model.map(ModelColumns::emptied);
        let mut all = vec![Joint::default(); joints];
        let mut outputs = Vec::new();
        for column in columns {
            match (column, model) {
                (Torque::Expression(image), _) => {
                    for &(joint, torque) in image {
                        let row = all[joint].column();
                        outputs.push((torque, Slot { table: joint, row }));
                    }
                }
                (Torque::Model(&ModelColumn::Inertia { body, weights }, on), Some(model)) => {
                    let ways = ways(model.robot(), body, &weights);
                    for &joint in on {
                        let acts = |(body, k): Entry| model.acts(joint, body, k);
                        all[joint].inertial_column(&ways, acts);
                    }
                }
                (Torque::Model(other, on), _) => {
                    let slots = on
                        .iter()
                        .map(|&joint| (joint, all[joint].column()))
                        .collect();
                    if let Some(made) = &mut made {
                        made.push(other.clone(), slots);
                    }
                }
            }
        }
        for (joint, own) in all.iter_mut().enumerate() {
            let entries = own.settle();
            for ((body, k), part) in entries {
                let weights = std::array::from_fn(|i| f64::from(u8::from(i == k)));
                if let Some(made) = &mut made {
                    made.push(ModelColumn::Inertia { body, weights }, vec![(joint, part)]);
                }
            }
        }
        Self {
            tape: Tape::new(graph, &outputs),
            model: made.map(ModelColumns::trimmed),
            recipes: all
                .into_iter()
                .map(|joint| Arc::new(Recipes::new(joint.parts, joint.columns)))
                .collect(),
        }
    }

    /// The same parts of a robot with other inertias.
    pub(super) fn on(&self, model: Option<&ModelColumns>) -> Self {
        Self {
            model: self
                .model
                .as_ref()
                .zip(model)
                .map(|(own, model)| own.of(model).trimmed()),
            ..self.clone()
        }
    }

    /// The same parts, of which the columns of a joint are made with these factors.
    pub(super) fn scaled(mut self, factors: &[Vec<f64>]) -> Self {
        for (recipes, factors) in self.recipes.iter_mut().zip(factors) {
            *recipes = Arc::new(recipes.scaled(factors));
        }
        self
    }

    /// How the columns of a joint follow from its parts.
    pub(super) fn recipes(&self, joint: usize) -> &Arc<Recipes> {
        &self.recipes[joint]
    }

    /// Writes every part: `out[joint][part * stride + sample]`.
    pub(super) fn evaluate<T: Table>(
        &self,
        course: Course<'_>,
        stride: usize,
        out: &mut [T],
        scratch: &mut Scratch,
    ) {
        let counts = self.recipes.iter().map(|recipes| recipes.parts());
        evaluate(
            counts,
            &self.tape,
            self.model.as_ref(),
            course,
            (stride, out),
            scratch,
        );
    }
}

/// An inertial column's entries: those of its own body, and regrouped ones.
fn ways(robot: &Robot, body: usize, weights: &[f64; 10]) -> [Sum; 2] {
    let mut parameters = vec![[0.0; 10]; robot.bodies().len()];
    parameters[body] = *weights;
    let entries = |parameters: &[[f64; 10]]| {
        let all = parameters.iter().enumerate();
        let all = all.flat_map(|(body, own)| (0..10).map(move |k| ((body, k), own[k])));
        let largest = parameters
            .iter()
            .flatten()
            .fold(0.0_f64, |m, x| m.max(x.abs()));
        all.filter(|(_, weight)| weight.abs() > ROUNDING * largest)
            .collect()
    };
    let own = entries(&parameters);
    [own, entries(&regrouped(robot, parameters))]
}

/// Writes what a tape and a model make of a motion, `counts` signals on each joint: `out[joint][signal * stride + sample]`.
pub(super) fn evaluate<T: Table>(
    counts: impl Iterator<Item = usize>,
    tape: &Tape,
    model: Option<&ModelColumns>,
    course: Course<'_>,
    (stride, out): (usize, &mut [T]),
    scratch: &mut Scratch,
) {
    for (count, out) in counts.zip(out.iter_mut()) {
        out.resize(count * stride);
    }
    tape.evaluate(course, stride, out, &mut scratch.tape);
    if let Some(model) = model {
        model.evaluate(course.motion, stride, out, scratch);
    }
}
