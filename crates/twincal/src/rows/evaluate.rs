//! Columns and nominal torque of a stretch of samples.

use crate::lanes::Aligned;
use crate::robot::{Motion, Robot, nominal_torque};
use crate::signal::Segment;
use crate::term::{Course, Library, Recipes, Scratch};
use std::sync::Arc;

/// Torque that no coefficient moves.
pub(super) struct Constant<'a> {
    /// Of the model.
    pub(super) nominal: &'a mut [f64],
    /// Of products of the effects about which columns are linearised; empty without.
    pub(super) products: &'a mut Vec<f64>,
}

/// Where nominal torque and columns come from.
///
/// Parts are signals whose fixed linear combinations are all columns: what is filtered, because they are fewer.
pub(super) trait Source {
    /// Structurally non-zero columns of a joint.
    fn columns(&self, joint: usize) -> &[usize];
    /// How the columns of a joint follow from its parts.
    fn recipes(&self, joint: usize) -> &Arc<Recipes>;
    /// Whether there is torque that no coefficient moves beside the nominal.
    fn has_products(&self) -> bool {
        false
    }
    /// `nominal[joint * len + sample]`, products likewise, `out[joint][i * len + sample]`.
    fn evaluate(&mut self, course: Course<'_>, torque: Constant<'_>, out: &mut [Aligned]);
    /// `nominal[joint * len + sample]`, products likewise, `out[joint][part * stride + sample]`.
    fn evaluate_parts(
        &mut self,
        course: Course<'_>,
        torque: Constant<'_>,
        stride: usize,
        out: &mut [Aligned],
    );
}

/// `(joint, row)` of the columns that do not act in a log where the payload acts, or does not.
fn absent(library: &Library, payload_acts: bool) -> Vec<(usize, usize)> {
    if payload_acts {
        Vec::new()
    } else {
        library.payload_entries()
    }
}

/// Recipes of every joint, in which `absent` columns are 0.
fn recipes(library: &Library, absent: &[(usize, usize)]) -> Vec<Arc<Recipes>> {
    let of_joint = |joint: usize| {
        let rows = absent.iter().filter(|entry| entry.0 == joint);
        let rows: Vec<usize> = rows.map(|entry| entry.1).collect();
        let all = library.recipes(joint);
        if rows.is_empty() {
            all.clone()
        } else {
            Arc::new(all.without(&rows))
        }
    };
    (0..library.joints()).map(of_joint).collect()
}

/// How columns follow from parts in a log where the payload acts, or does not; per joint, whether the log has rows or not.
pub(crate) fn recipes_of_log(library: &Library, payload_acts: bool) -> Vec<Arc<Recipes>> {
    recipes(library, &absent(library, payload_acts))
}

/// The columns of a library on a robot.
pub(super) struct OfLibrary<'a> {
    robot: &'a Robot,
    library: &'a Library,
    /// `(joint, row)` of columns that do not act in this log.
    absent: Vec<(usize, usize)>,
    /// Of every joint, in which those columns are 0.
    recipes: Vec<Arc<Recipes>>,
    /// Per joint, coefficients of columns and of parts, see [`Library::taken_off`]; empty without products.
    taken_off: Vec<[Vec<f64>; 2]>,
    scratch: Scratch,
}

impl<'a> OfLibrary<'a> {
    /// In a log where the payload acts, or does not.
    pub(super) fn new(robot: &'a Robot, library: &'a Library, payload_acts: bool) -> Self {
        let absent = absent(library, payload_acts);
        let recipes = recipes(library, &absent);
        let taken_off = library.taken_off().into_iter().zip(&recipes);
        let taken_off = taken_off.map(|(columns, recipes)| {
            let parts = recipes.of_parts(&columns);
            [columns, parts]
        });
        Self {
            robot,
            library,
            taken_off: taken_off.collect(),
            recipes,
            absent,
            scratch: Scratch::default(),
        }
    }
}

impl Source for OfLibrary<'_> {
    fn columns(&self, joint: usize) -> &[usize] {
        self.library.columns_of_joint(joint)
    }

    fn recipes(&self, joint: usize) -> &Arc<Recipes> {
        &self.recipes[joint]
    }

    fn has_products(&self) -> bool {
        self.library.has_products()
    }

    fn evaluate(&mut self, course: Course<'_>, torque: Constant<'_>, out: &mut [Aligned]) {
        nominal_torque(self.robot, course.motion, torque.nominal);
        self.library.evaluate_with(course, out, &mut self.scratch);
        let len = course.motion.len;
        for &(joint, row) in &self.absent {
            out[joint][row * len..(row + 1) * len].fill(0.0);
        }
        self.products(course, torque, 0, (len, out));
    }

    fn evaluate_parts(
        &mut self,
        course: Course<'_>,
        torque: Constant<'_>,
        stride: usize,
        out: &mut [Aligned],
    ) {
        nominal_torque(self.robot, course.motion, torque.nominal);
        self.library
            .evaluate_parts(course, stride, out, &mut self.scratch);
        self.products(course, torque, 1, (stride, out));
    }
}

impl OfLibrary<'_> {
    /// Torque that no coefficient moves beside the nominal, with evaluated columns (`form` 0) or parts (1).
    fn products(
        &self,
        course: Course<'_>,
        torque: Constant<'_>,
        form: usize,
        (stride, out): (usize, &[Aligned]),
    ) {
        let Constant { nominal, products } = torque;
        let (library, len) = (self.library, course.motion.len);
        library.products(course.motion, nominal, products, |joint, torque| {
            for (i, weight) in self.taken_off[joint][form].iter().enumerate() {
                if *weight != 0.0 {
                    let signal = &out[joint][i * stride..i * stride + len];
                    let torque = torque.iter_mut().zip(signal);
                    torque.for_each(|(torque, x)| *torque -= weight * x);
                }
            }
        });
    }
}

/// What is evaluated of a segment: positions, velocities, accelerations, history.
pub(super) fn channels(segment: &Segment) -> [&[f64]; 4] {
    [&segment.q, &segment.qd, &segment.qdd, &segment.history]
}

/// Motion of a stretch of samples, and what was evaluated there.
#[derive(Debug, Default)]
pub(super) struct Stretch {
    /// Samples.
    pub(super) len: usize,
    /// `joint * len + sample`.
    pub(super) q: Vec<f64>,
    /// Velocity.
    pub(super) qd: Vec<f64>,
    /// Acceleration.
    pub(super) qdd: Vec<f64>,
    /// History channels, `channel * len + sample`.
    pub(super) history: Vec<f64>,
    /// Nominal torque.
    pub(super) nominal: Vec<f64>,
    /// Torque of products likewise; empty without.
    pub(super) products: Vec<f64>,
    /// Columns or parts: `values[joint][i * len + sample]`.
    pub(super) values: Vec<Aligned>,
}

impl Stretch {
    /// Memory for the joints of a robot.
    pub(super) fn new(dof: usize) -> Self {
        Self {
            values: vec![Aligned::default(); dof],
            ..Self::default()
        }
    }

    /// Takes samples `from .. from + len` of arrays `joint * total + sample`.
    pub(super) fn load(&mut self, from: usize, len: usize, total: usize, source: [&[f64]; 4]) {
        self.len = len;
        for (to, from_all) in self.channels().into_iter().zip(source) {
            to.clear();
            for joint in from_all.chunks_exact(total) {
                to.extend_from_slice(&joint[from..from + len]);
            }
        }
    }

    /// What is loaded: positions, velocities, accelerations, history.
    pub(super) fn channels(&mut self) -> [&mut Vec<f64>; 4] {
        [&mut self.q, &mut self.qd, &mut self.qdd, &mut self.history]
    }

    /// Torque of products on a joint; empty without.
    pub(super) fn products(&self, joint: usize) -> &[f64] {
        let own = joint * self.len..(joint + 1) * self.len;
        self.products.get(own).unwrap_or_default()
    }

    /// Evaluates nominal torque and columns of the loaded motion.
    pub(super) fn evaluate(&mut self, source: &mut dyn Source) {
        let (course, torque, values) = self.split();
        source.evaluate(course, torque, values);
    }

    /// Evaluates nominal torque and parts of the loaded motion, `values[joint][part * stride + sample]`.
    pub(super) fn evaluate_parts(&mut self, source: &mut dyn Source, stride: usize) {
        let (course, torque, values) = self.split();
        source.evaluate_parts(course, torque, stride, values);
    }

    fn split(&mut self) -> (Course<'_>, Constant<'_>, &mut [Aligned]) {
        let len = self.len;
        self.nominal.resize(self.values.len() * len, 0.0);
        let motion = Motion {
            len,
            q: &self.q,
            qd: &self.qd,
            qdd: &self.qdd,
        };
        let course = Course {
            motion,
            history: &self.history,
        };
        let torque = Constant {
            nominal: &mut self.nominal,
            products: &mut self.products,
        };
        (course, torque, &mut self.values)
    }
}
