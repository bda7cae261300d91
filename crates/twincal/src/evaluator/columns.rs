//! Columns of a library as steps.

use super::dynamics::{self, Load, Moving, Screw};
use super::trace::{Id, Step, Trace};
use crate::robot::{Robot, regrouped};
use crate::term::{Function, Graph, GraphId, Library, ModelColumn, Node, Variable};
use std::collections::HashMap;

/// Everything that columns share.
pub(super) struct Columns<'a> {
    pub(super) robot: &'a Robot,
    pub(super) library: &'a Library,
    /// Nominal motion.
    pub(super) moving: Vec<Moving>,
    /// Screws of every body, once a column asks for them.
    screws: Option<Vec<Vec<Screw>>>,
    /// Nominal torque, once a column asks for it.
    nominal: Option<Vec<Id>>,
    expressions: HashMap<GraphId, Id>,
}

impl<'a> Columns<'a> {
    /// Columns of a library, about the robot that it is linearised about.
    pub(super) fn new(t: &mut Trace, robot: &'a Robot, library: &'a Library) -> Self {
        let robot = library.robot(robot);
        Self {
            robot,
            library,
            moving: dynamics::motion(t, robot, robot.description().gravity, true),
            screws: None,
            nominal: None,
            expressions: HashMap::new(),
        }
    }

    /// Torque of one column per unit of its coefficient: `(joint, step)` where it is not zero by structure.
    pub(super) fn column(&mut self, t: &mut Trace, column: usize) -> Vec<(usize, Id)> {
        let mut all = self.on_all_joints(t, column);
        let library = self.library;
        all.retain(|(joint, _)| {
            library
                .columns_of_joint(*joint)
                .binary_search(&column)
                .is_ok()
        });
        if self.library.is_scaled_by_gain(column) {
            self.times_gain(t, &mut all);
        }
        all
    }

    /// Multiplies torque of the robot's numbers with the drive gains about which columns are taken.
    pub(super) fn times_gain(&self, t: &mut Trace, torque: &mut [(usize, Id)]) {
        for (joint, x) in torque {
            *x = t.scale(self.library.gain(*joint), *x);
        }
    }

    fn on_all_joints(&mut self, t: &mut Trace, column: usize) -> Vec<(usize, Id)> {
        match self.library.model_column(column) {
            None => {
                let image = self.library.image(column).to_vec();
                let joints = image.into_iter();
                joints
                    .map(|(joint, id)| (joint, self.expression(t, id)))
                    .collect()
            }
            Some(ModelColumn::Inertia { body, weights }) => self.inertia(t, *body, weights),
            Some(ModelColumn::Gravity { axis }) => {
                let mut gravity = [0.0; 3];
                gravity[*axis] = 1.0;
                self.gravity(t, gravity)
            }
            Some(ModelColumn::Nominal { joint: Some(joint) }) => {
                vec![(*joint, self.nominal(t)[*joint])]
            }
            Some(ModelColumn::Nominal { joint: None }) => {
                self.nominal(t).into_iter().enumerate().collect()
            }
            Some(ModelColumn::LoadFriction { joint, velocity }) => {
                let torque = self.nominal(t)[*joint];
                let size = t.step(Step::Absolute(torque));
                let rate = t.step(Step::Velocity(*joint));
                let sense = direction(t, rate, *velocity);
                vec![(*joint, t.multiply(size, sense))]
            }
            Some(ModelColumn::PositionDerivative { joint }) => {
                let nominal = self.nominal(t);
                let change = t.position_derivative(*joint, &nominal);
                change.into_iter().enumerate().collect()
            }
        }
    }

    /// Torque of a body with these parameters on every joint that moves it.
    pub(super) fn inertia(
        &mut self,
        t: &mut Trace,
        body: usize,
        parameters: &[f64; 10],
    ) -> Vec<(usize, Id)> {
        let (robot, moving) = (self.robot, &self.moving);
        let screws = self
            .screws
            .get_or_insert_with(|| dynamics::screws(t, robot, moving));
        dynamics::column(t, &self.moving[body], &screws[body], parameters)
    }

    /// Torque of this change of gravity on the nominal robot.
    fn gravity(&self, t: &mut Trace, gravity: [f64; 3]) -> Vec<(usize, Id)> {
        let loads = self.gravity_loads(t, gravity);
        let torque = dynamics::torque(t, self.robot, &self.moving, loads);
        torque.into_iter().enumerate().collect()
    }

    /// What the bodies of the nominal robot need against this change of gravity.
    pub(super) fn gravity_loads(&self, t: &mut Trace, gravity: [f64; 3]) -> Vec<Load> {
        let still = dynamics::motion(t, self.robot, gravity, false);
        dynamics::loads(t, &still, &nominal_parameters(self.robot))
    }

    /// Nominal torque per joint.
    pub(super) fn nominal(&mut self, t: &mut Trace) -> Vec<Id> {
        let (robot, moving) = (self.robot, &self.moving);
        let nominal = self.nominal.get_or_insert_with(|| {
            let loads = dynamics::loads(t, moving, &nominal_parameters(robot));
            let rigid = dynamics::torque(t, robot, moving, loads);
            let passive = dynamics::passive(t, robot, moving);
            let both = rigid.into_iter().zip(passive);
            both.map(|(a, b)| t.add(a, b)).collect()
        });
        nominal.clone()
    }

    /// A node of the library's expressions; operands stand before it, so recursion is bounded by their depth.
    fn expression(&mut self, t: &mut Trace, id: GraphId) -> Id {
        if let Some(&known) = self.expressions.get(&id) {
            return known;
        }
        let library = self.library;
        let graph: &Graph = library.graph();
        let step = match graph.node(id) {
            Node::Constant(value) => t.number(value.get()),
            Node::Variable(Variable::Position(joint)) => t.step(Step::Position(*joint)),
            Node::Variable(Variable::Velocity(joint)) => t.step(Step::Velocity(*joint)),
            Node::Variable(Variable::Acceleration(joint)) => t.step(Step::Acceleration(*joint)),
            // A program knows one state: of what was before, what every channel is where nothing is known.
            Node::Variable(Variable::History(_)) => t.number(0.0),
            Node::Sum(constant, parts) => {
                let mut sum = t.number(constant.get());
                for &(coefficient, part) in parts {
                    let part = self.expression(t, part);
                    let part = t.scale(coefficient.get(), part);
                    sum = t.add(sum, part);
                }
                sum
            }
            Node::Product(factors) => {
                let mut above = t.number(1.0);
                let mut below = above;
                for &(factor, exponent) in factors {
                    let factor = self.expression(t, factor);
                    let power = t.integer_power(factor, exponent.unsigned_abs());
                    if exponent > 0 {
                        above = t.multiply(above, power);
                    } else {
                        below = t.multiply(below, power);
                    }
                }
                t.divide(above, below)
            }
            Node::Power(base, exponent) => {
                let base = self.expression(t, *base);
                t.step(Step::Power(base, exponent.get()))
            }
            Node::Function(function, argument) => {
                let argument = self.expression(t, *argument);
                t.apply(*function, argument)
            }
        };
        self.expressions.insert(id, step);
        step
    }
}

/// Parameters of every body as the model file has them.
pub(super) fn parameters(robot: &Robot) -> Vec<[f64; 10]> {
    (0..robot.layout().len())
        .map(|body| robot.parameters_of_body(body))
        .collect()
}

/// The same torque from fewer of them.
pub(super) fn nominal_parameters(robot: &Robot) -> Vec<[f64; 10]> {
    regrouped(robot, parameters(robot))
}

/// tanh(rate/v_s), or the sign for v_s = 0.
pub(super) fn direction(t: &mut Trace, rate: Id, velocity: f64) -> Id {
    if velocity == 0.0 {
        t.apply(Function::Sign, rate)
    } else {
        let relative = t.scale(1.0 / velocity, rate);
        t.apply(Function::Tanh, relative)
    }
}
