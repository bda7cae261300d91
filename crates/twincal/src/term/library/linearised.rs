//! A library about a robot with effects: its columns there, and the torque that none of them moves.

use super::super::linearisation::{Linearisation, Moved};
use super::{Library, ModelColumn, Table};
use crate::error::{Error, Result};
use crate::robot::{Motion, Robot, nominal_torque};
use std::collections::BTreeMap;
use std::sync::Arc;

impl Library {
    /// The same candidates about `robot` with coefficients by name of their term: names, prior and meaning stay, columns change.
    ///
    /// # Errors
    /// [`Error::Setting`] with the key `twin` for a name that no term of the robot model has, or a coefficient that is no number: they come from a fit
    /// alone.
    pub(crate) fn linearised(&self, robot: &Robot, at: &BTreeMap<String, f64>) -> Result<Self> {
        let is_of_model = |name: &String| {
            let term = self.terms.iter().position(|term| term.name == *name);
            term.is_some_and(|term| self.sources[term].is_some())
        };
        if let Some((name, value)) = at
            .iter()
            .find(|(name, v)| !(is_of_model(name) && v.is_finite()))
        {
            return Err(Error::Setting {
                key: "twin".into(),
                problem: format!(
                    "its columns are worked out about {value} of `{name}`, which is no effect of the robot model"
                ),
                remedy: "the twin's file is damaged or from another version: fit again".into(),
            });
        }
        let terms = self.terms.iter().zip(&self.sources).map(|(term, source)| {
            Some(Moved {
                column: &source.as_ref()?.0,
                value: at.get(&term.name).copied().unwrap_or(0.0),
                is_payload: term.family.is_payload(),
            })
        });
        let mut library = self.clone();
        library.linearised = Some(Arc::new(Linearisation::new(self.joints(), terms)));
        library = library.on(robot);
        library.compile();
        Ok(library)
    }

    /// The library in a log: `robot` is the model with what that log is known to carry, and the payload acts or does not.
    pub(crate) fn in_log(&self, robot: &Robot, payload_acts: bool) -> Self {
        let changed = self
            .linearised
            .as_ref()
            .map(|at| at.robot(robot, payload_acts));
        let robot = changed.as_ref().unwrap_or(robot);
        let model = self.model.as_ref().map(|model| Arc::new(model.on(robot)));
        Self {
            parts: Arc::new(self.parts.on(model.as_deref())),
            model,
            ..self.clone()
        }
    }

    /// Whether columns in logs without the payload are others than in logs with it.
    pub(crate) fn changes_with_payload(&self) -> bool {
        self.linearised.as_ref().is_some_and(|at| at.carries())
    }

    /// The robot whose torque the columns are derivatives of: the model, with the effects about which the library is linearised.
    pub(crate) fn robot<'a>(&'a self, nominal: &'a Robot) -> &'a Robot {
        self.model.as_ref().map_or(nominal, |model| model.robot())
    }

    /// Whether it is linearised about effects.
    pub(crate) fn has_products(&self) -> bool {
        self.linearised.is_some()
    }

    /// Drive gain of a joint about which columns are taken, 1 + g: inertial columns, those of gravity and of zeros are multiplied with it.
    pub(crate) fn gain(&self, joint: usize) -> f64 {
        self.linearised.as_ref().map_or(1.0, |at| at.gain(joint))
    }

    /// Per joint, coefficients of its columns whose torque is taken off the changed robot's in [`Library::products`]: those about which the library
    /// is linearised, but for gains. Empty where it is not.
    pub(crate) fn taken_off(&self) -> Vec<Vec<f64>> {
        if self.linearised.is_none() {
            return Vec::new();
        }
        let value = |&column: &usize| self.about(column);
        let joints = self.by_joint.iter();
        joints
            .map(|columns| columns.iter().map(value).collect())
            .collect()
    }

    /// The coefficient that a column's effect has in [`Library::robot`] beside the model; 0 of gains, and of all others.
    pub(crate) fn about(&self, column: usize) -> f64 {
        let source = self.model_column(column);
        self.linearised
            .as_ref()
            .map_or(0.0, |at| at.taken_off(self.columns[column], source))
    }

    /// Torque beside the nominal one that no coefficient moves, because effects multiply each other, `joint * len + sample`, N·m (N): that of the
    /// changed robot, less the nominal, less [`Library::taken_off`] × columns, which `take_off(joint, torque)` does. Empty where there is none.
    pub(crate) fn products(
        &self,
        motion: Motion<'_>,
        nominal: &[f64],
        products: &mut Vec<f64>,
        mut take_off: impl FnMut(usize, &mut [f64]),
    ) {
        products.clear();
        let (true, Some(model)) = (self.has_products(), &self.model) else {
            return;
        };
        products.resize(nominal.len(), 0.0);
        nominal_torque(model.robot(), motion, products);
        for (torque, nominal) in products.iter_mut().zip(nominal) {
            *torque -= nominal;
        }
        for (joint, torque) in products.chunks_exact_mut(motion.len.max(1)).enumerate() {
            take_off(joint, torque);
        }
    }

    /// Whether a column's coefficient is one of the robot's numbers, or a gain of its drives.
    pub(crate) fn is_number_of_robot(&self, column: usize) -> bool {
        let own = self.model_column(column);
        own.is_some_and(|own| !matches!(own, ModelColumn::LoadFriction { .. }))
    }

    /// Whether a column is multiplied with the drive gain of its joint about which columns are taken.
    pub(crate) fn is_scaled_by_gain(&self, column: usize) -> bool {
        let own = self.model_column(column);
        self.is_number_of_robot(column) && !matches!(own, Some(ModelColumn::Nominal { .. }))
    }

    /// Nominal torque with that of products and Σ β x, `joint * len + sample`, where the payload acts or does not. The library is that of this log
    /// ([`Library::in_log`]).
    pub(crate) fn torque_with(
        &self,
        robot: &Robot,
        motion: Motion<'_>,
        payload_acts: bool,
        beta: &[f64],
    ) -> Vec<f64> {
        let len = motion.len;
        let mut columns = vec![Vec::new(); self.joints()];
        self.evaluate(motion, &mut columns);
        for (joint, row) in self.payload_entries().into_iter().filter(|_| !payload_acts) {
            columns[joint][row * len..(row + 1) * len].fill(0.0);
        }
        let add = |joint: usize, factors: &[f64], torque: &mut [f64]| {
            for (factor, x) in factors.iter().zip(columns[joint].chunks_exact(len.max(1))) {
                let torque = torque.iter_mut().zip(x);
                torque.for_each(|(torque, x)| *torque += factor * x);
            }
        };
        let mut torque = vec![0.0; self.joints() * len];
        nominal_torque(robot, motion, &mut torque);
        let (taken_off, mut products) = (self.taken_off(), Vec::new());
        self.products(motion, &torque, &mut products, |joint, products| {
            let off: Vec<f64> = taken_off[joint].iter().map(|value| -value).collect();
            add(joint, &off, products);
        });
        torque
            .iter_mut()
            .zip(&products)
            .for_each(|(torque, more)| *torque += more);
        for (joint, torque) in torque.chunks_exact_mut(len.max(1)).enumerate() {
            let own = self
                .columns_of_joint(joint)
                .iter()
                .map(|&column| beta[column]);
            add(joint, &own.collect::<Vec<_>>(), torque);
        }
        torque
    }

    /// What the columns of each joint are multiplied with; `None`: nothing.
    pub(super) fn factors(&self) -> Option<Vec<Vec<f64>>> {
        let at = self.linearised.as_ref()?;
        let of_joint = |(joint, columns): (usize, &Vec<usize>)| {
            let factor = |&column: &usize| {
                let source = self.sources[self.columns[column]].as_ref();
                source.map_or(1.0, |(source, _)| at.factor(source, joint))
            };
            columns.iter().map(factor).collect()
        };
        Some(self.by_joint.iter().enumerate().map(of_joint).collect())
    }

    /// Multiplies evaluated columns, `out[joint][row * len + sample]`.
    pub(super) fn scale<T: Table>(&self, len: usize, out: &mut [T]) {
        for (factors, out) in self.factors().iter().flatten().zip(out) {
            for (factor, column) in factors.iter().zip(out.chunks_mut(len.max(1))) {
                column.iter_mut().for_each(|x| *x *= factor);
            }
        }
    }
}
