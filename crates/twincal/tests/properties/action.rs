//! Hamilton's principle: the torque of a Lagrangian is minus the derivative of its action.
//!
//! ```text
//! d/dε ∮ L(q + εη, q̇ + εη̇) dt = −∮ Σ_i (d/dt ∂L/∂q̇_i − ∂L/∂q_i) η_i dt
//! ```
//! A wrong sign or a missing q̇-term of the Euler–Lagrange operator shows for any motion; nothing here differentiates φ.

use super::motion::{SAMPLES, Wave, cycle_work, sampled, variation, wave, work};
use super::robots::robot;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use twincal::robot::{Motion, Robot, kinetic_energy, nominal_torque, potential_energy};
use twincal::term::{Family, Library, LibrarySettings};

fn close(found: f64, wanted: f64, size: f64) -> Result<(), TestCaseError> {
    prop_assert!(
        (found - wanted).abs() <= 1e-8 * (size + 1.0),
        "{found}, not {wanted} (size {size})"
    );
    Ok(())
}

/// Sums of columns: the torque of one column, `joint * SAMPLES + sample`.
fn column_torque(library: &Library, motion: Motion<'_>, column: usize) -> Vec<f64> {
    let dof = motion.q.len() / motion.len;
    let mut out = vec![Vec::new(); dof];
    library.evaluate(motion, &mut out);
    let mut torque = vec![0.0; dof * motion.len];
    for joint in 0..dof {
        if let Ok(place) = library.columns_of_joint(joint).binary_search(&column) {
            let own = &out[joint][place * motion.len..(place + 1) * motion.len];
            torque[joint * motion.len..(joint + 1) * motion.len].copy_from_slice(own);
        }
    }
    torque
}

/// A random candidate `qdA^m * qdB^n * cos(k1*q1 + … )` with its value, written as the user would.
#[derive(Debug, Clone)]
struct Candidate {
    powers: [i32; 2],
    factors: [i32; 3],
    sine: bool,
}

impl Candidate {
    fn text(&self) -> String {
        let [m, n] = self.powers;
        let [a, b, c] = self.factors;
        let function = if self.sine { "sin" } else { "cos" };
        format!("qd1^{m}*qd2^{n}*{function}({a}*q1 + {b}*q2 - {c}*q1) + 0.5*q1*qd2^2")
    }

    fn value(&self, q: &[f64], qd: &[f64]) -> f64 {
        let [a, b, c] = self.factors.map(f64::from);
        let angle = a * q[0] + b * q[1] - c * q[0];
        let wave = if self.sine { angle.sin() } else { angle.cos() };
        qd[0].powi(self.powers[0]) * qd[1].powi(self.powers[1]) * wave + 0.5 * q[0] * qd[1] * qd[1]
    }
}

fn candidate() -> impl Strategy<Value = Candidate> {
    (
        prop::array::uniform2(0..3_i32),
        prop::array::uniform3(0..3_i32),
        any::<bool>(),
    )
        .prop_map(|(powers, factors, sine)| Candidate {
            powers,
            factors,
            sine,
        })
}

fn waves(dof: usize, size: f64) -> impl Strategy<Value = Vec<Wave>> {
    prop::collection::vec(wave(size), dof)
}

fn with_motion(most: usize) -> impl Strategy<Value = (Robot, Vec<Wave>, Vec<Wave>)> {
    robot(most).prop_flat_map(|robot| {
        let dof = robot.dof();
        (Just(robot), waves(dof, 0.6), waves(dof, 1.0))
    })
}

fn only(terms: Vec<String>) -> LibrarySettings {
    LibrarySettings {
        terms,
        generic: Some(false),
        ..LibrarySettings::default()
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None,
        rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn a_users_term_gives_the_derivative_of_its_action(
        (robot, waves, direction) in with_motion(3).prop_filter("two joints", |(robot, ..)| robot.dof() >= 2),
        candidate in candidate(),
    ) {
        let (library, _) = Library::propose(&robot, &only(vec![candidate.text()])).unwrap();
        let [q, qd, qdd] = sampled(&waves);
        let torque = column_torque(&library, Motion { len: SAMPLES, q: &q, qd: &qd, qdd: &qdd }, 0);
        let [virtual_work, size] = work(&torque, &direction);
        let slope = variation(&waves, &direction, |q, qd| candidate.value(q, qd));
        close(-virtual_work, slope, size)?;
    }

    #[test]
    fn nominal_torque_is_the_derivative_of_the_action_of_its_energies((robot, waves, direction) in with_motion(5)) {
        let [q, qd, qdd] = sampled(&waves);
        let mut tau = vec![0.0; robot.dof() * SAMPLES];
        nominal_torque(&robot, Motion { len: SAMPLES, q: &q, qd: &qd, qdd: &qdd }, &mut tau);
        let [virtual_work, size] = work(&tau, &direction);
        let slope = variation(&waves, &direction, |q, qd| kinetic_energy(&robot, q, qd) - potential_energy(&robot, q));
        close(-virtual_work, slope, size)?;
        // Nothing is won or lost on a closed cycle of a conservative robot.
        let [net, size] = cycle_work(&tau, &qd);
        close(net, 0.0, size)?;
    }

    #[test]
    fn lagrangian_columns_do_no_work_on_a_cycle_and_friction_only_takes((robot, waves, direction) in with_motion(2)) {
        let settings = LibrarySettings {
            generic: Some(true),
            families: vec![Family::Viscous, Family::Coulomb, Family::MotorInertia],
            ..LibrarySettings::default()
        };
        let (library, _) = Library::propose(&robot, &settings).unwrap();
        let [q, qd, qdd] = sampled(&waves);
        let motion = Motion { len: SAMPLES, q: &q, qd: &qd, qdd: &qdd };
        for (column, &index) in library.columns().iter().enumerate() {
            let torque = column_torque(&library, motion, column);
            let [net, size] = cycle_work(&torque, &qd);
            if matches!(library.terms()[index].family, Family::Viscous | Family::Coulomb) {
                prop_assert!(net >= 0.0 && (net - size).abs() <= 1e-12 * size, "friction takes at every sample");
            } else {
                close(net, 0.0, size)?;
                let [virtual_work, size] = work(&torque, &direction);
                let slope = variation(&waves, &direction, |q, qd| library.lagrangian(index, q, qd).unwrap());
                close(-virtual_work, slope, size)?;
            }
        }
    }
}
