//! Reflected inertia of the motor: torque +q̈ per unit of β, energy ½ q̇².

use super::Family;
use super::candidate::{Candidate, Joint};
use super::euler_lagrange::euler_lagrange;
use super::expression::Graph;

/// `<joint>.motor_inertia`: rotor inertia seen through the gear, kg·m² (kg for a slider). Lagrangian ½ q̇².
pub(super) fn candidate(graph: &mut Graph, joint: &Joint) -> Candidate {
    let rate = joint.velocity(graph);
    let square = graph.product(&[(rate, 2)]);
    let energy = graph.scaled(0.5, square);
    Candidate {
        name: format!("{}.motor_inertia", joint.name),
        family: Family::MotorInertia,
        unit: if joint.slides { "kg" } else { "kg·m²" }.to_owned(),
        story: format!("motor inertia on {}", joint.name),
        lagrangian: Some(energy),
        image: euler_lagrange(graph, energy),
    }
}
