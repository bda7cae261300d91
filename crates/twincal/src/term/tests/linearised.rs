//! A library about effects that multiply each other.

use super::super::motions::{channels, random_motions};
use super::super::{Family, Library, LibrarySettings, ModelColumn};
use crate::robot::testing::tree;
use crate::robot::{Change, Motion, Robot, nominal_torque};
use std::collections::BTreeMap;

/// Effects of every kind: names of terms and coefficients.
fn effects(library: &Library) -> BTreeMap<String, f64> {
    let terms = library.columns().iter().enumerate();
    let own = terms.filter(|(column, _)| library.is_number_of_robot(*column));
    own.map(|(column, &term)| {
        let size = 0.03 * ((2.3 * column as f64).sin() + 1.5);
        (library.terms()[term].name.clone(), size)
    })
    .collect()
}

/// Coefficients by column.
fn by_column(library: &Library, effects: &BTreeMap<String, f64>) -> Vec<f64> {
    let columns = library.columns().iter();
    columns
        .map(|&term| {
            effects
                .get(&library.terms()[term].name)
                .copied()
                .unwrap_or(0.0)
        })
        .collect()
}

/// Torque of the robot with effects, not linear in them: (1 + g_j) τ_j(θ).
fn truth(robot: &Robot, library: &Library, motion: Motion<'_>, beta: &[f64]) -> Vec<f64> {
    let (mut change, mut gain) = (Change::default(), vec![1.0; robot.dof()]);
    for (column, beta) in beta.iter().enumerate() {
        match library.model_column(column) {
            Some(ModelColumn::Inertia { body, weights }) => {
                change.inertia.push((*body, weights.map(|w| beta * w)));
            }
            Some(ModelColumn::Gravity { axis }) => change.gravity[*axis] += beta,
            Some(ModelColumn::PositionDerivative { joint }) => change.zero.push((*joint, *beta)),
            Some(ModelColumn::Nominal { joint: Some(joint) }) => gain[*joint] += beta,
            Some(ModelColumn::Nominal { joint: None }) => gain.iter_mut().for_each(|g| *g += beta),
            _ => assert_eq!(*beta, 0.0),
        }
    }
    let mut torque = vec![0.0; robot.dof() * motion.len];
    nominal_torque(&robot.changed(&change), motion, &mut torque);
    for (torque, gain) in torque.chunks_exact_mut(motion.len).zip(gain) {
        torque.iter_mut().for_each(|t| *t *= gain);
    }
    torque
}

/// A robot with effects of every kind: its library, the library about these effects, a motion.
struct World {
    robot: Robot,
    plain: Library,
    there: Library,
    /// Effects by column.
    at: Vec<f64>,
    /// Positions, velocities, accelerations.
    channels: [Vec<f64>; 3],
}

impl World {
    fn new() -> Self {
        let robot = tree();
        let settings = LibrarySettings {
            families: vec![
                Family::Payload,
                Family::Density,
                Family::Tilt,
                Family::EncoderZero,
                Family::Gain,
                Family::LoadFriction,
                Family::Viscous,
            ],
            generic: Some(false),
            coulomb_velocity: 0.02,
            ..LibrarySettings::default()
        };
        let (plain, _) = Library::propose(&robot, &settings).unwrap();
        let effects = effects(&plain);
        let linearised_at = effects.clone();
        let (there, _) = Library::propose(
            &robot,
            &LibrarySettings {
                linearised_at,
                ..settings
            },
        )
        .unwrap();
        Self {
            at: by_column(&plain, &effects),
            channels: channels(&random_motions(robot.dof()), robot.dof()),
            robot,
            plain,
            there,
        }
    }

    fn motion(&self) -> Motion<'_> {
        let [q, qd, qdd] = &self.channels;
        let len = q.len() / self.robot.dof();
        Motion { len, q, qd, qdd }
    }

    /// Torque of the robot with effects of these sizes.
    fn truth(&self, beta: &[f64]) -> Vec<f64> {
        truth(&self.robot, &self.plain, self.motion(), beta)
    }

    /// Length of the torque at the effects.
    fn size(&self) -> f64 {
        let torque = self.truth(&self.at);
        distance(&torque, &vec![0.0; torque.len()])
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
    squares.sum::<f64>().sqrt()
}

/// At the effects the linear model is the robot with them, and beside them it is off by the square of how far: truth is that robot, from its numbers.
#[test]
fn a_library_about_effects_is_their_torque_to_first_order() {
    let world = World::new();
    let (plain, there) = (&world.plain, &world.there);
    assert_eq!(there.terms(), plain.terms());
    assert_eq!(there.prior_sds(), plain.prior_sds());
    let error = |library: &Library, step: f64| -> f64 {
        let is_moved = |column: usize| plain.is_number_of_robot(column);
        let beta: Vec<f64> = (world.at.iter().enumerate())
            .map(|(k, at)| {
                at + if is_moved(k) {
                    step * (1.1 * k as f64).cos()
                } else {
                    0.0
                }
            })
            .collect();
        let found = library.torque_with(&world.robot, world.motion(), true, &beta);
        distance(&found, &world.truth(&beta))
    };
    let size = world.size();
    assert!(error(there, 0.0) < 1e-12 * size);
    assert!(
        error(plain, 0.0) > 1e-3 * size,
        "these effects multiply each other"
    );
    let [near, far] = [error(there, 1e-4), error(there, 2e-4)];
    assert!(
        (far / near - 4.0).abs() < 0.05,
        "second order: {near} {far}"
    );
}

#[test]
fn without_the_payload_it_is_the_torque_of_the_other_effects() {
    let world = World::new();
    let plain = &world.plain;
    let mut without = world.at.clone();
    for (k, &term) in plain.columns().iter().enumerate() {
        if plain.terms()[term].family.is_payload() {
            without[k] = 0.0;
        }
    }
    let library = world.there.in_log(&world.robot, false);
    let found = library.torque_with(&world.robot, world.motion(), false, &world.at);
    let left = distance(&found, &world.truth(&without));
    assert!(left < 1e-12 * world.size(), "{left}");
}

/// A twin's file may say anything.
#[test]
fn effects_that_are_none_are_refused() {
    let robot = tree();
    for (name, value) in [
        ("base.tilt.x", f64::NAN),
        ("joint0.viscous", 1.0),
        ("nobody", 1.0),
    ] {
        let settings = LibrarySettings {
            families: vec![Family::Tilt, Family::Viscous],
            generic: Some(false),
            linearised_at: BTreeMap::from([(name.to_owned(), value)]),
            ..LibrarySettings::default()
        };
        let error = Library::propose(&robot, &settings).unwrap_err();
        assert!(error.to_string().contains(name), "{error}");
    }
}
