//! The exact Euler–Lagrange operator (paper eq. 3–4): from a candidate Lagrangian to its torque.

use super::expression::{Graph, Id, Variable};

/// Torque images of φ(q, q̇), as `(joint, D_joint(φ))` for the joints where they are not structurally zero.
///
/// ```text
/// Dᵢ(φ) = Σⱼ ∂²φ/∂q̇ᵢ∂q̇ⱼ · q̈ⱼ + Σⱼ ∂²φ/∂q̇ᵢ∂qⱼ · q̇ⱼ − ∂φ/∂qᵢ
/// ```
/// Exact: d/dt is carried out by the chain rule, never by differences in time.
///
/// # Source
/// Method section 2; checked against SymPy's own time derivative in `tests/reference/term/`.
pub(super) fn euler_lagrange(graph: &mut Graph, phi: Id) -> Vec<(usize, Id)> {
    let coordinates = graph.variables(phi);
    let mut joints: Vec<usize> = coordinates
        .iter()
        .filter_map(|&coordinate| match coordinate {
            Variable::Velocity(joint)
            | Variable::Position(joint)
            | Variable::Acceleration(joint) => Some(joint),
            Variable::History(_) => None,
        })
        .collect();
    joints.sort_unstable();
    joints.dedup();

    let mut images = Vec::new();
    for joint in joints {
        let momentum = graph.derivative(phi, Variable::Velocity(joint));
        let mut parts = Vec::new();
        for &coordinate in &coordinates {
            // d/dt ∂φ/∂q̇ᵢ: velocities change by q̈, positions by q̇
            let rate = match coordinate {
                Variable::Velocity(other) => Variable::Acceleration(other),
                Variable::Position(other) => Variable::Velocity(other),
                Variable::Acceleration(_) | Variable::History(_) => continue,
            };
            let slope = graph.derivative(momentum, coordinate);
            if !graph.is_zero(slope) {
                let rate = graph.variable(rate);
                parts.push((1.0, graph.product(&[(slope, 1), (rate, 1)])));
            }
        }
        parts.push((-1.0, graph.derivative(phi, Variable::Position(joint))));
        let image = graph.sum(0.0, &parts);
        if !graph.is_zero(image) {
            images.push((joint, image));
        }
    }
    images
}

#[cfg(test)]
mod tests {
    use super::super::expression::parse;
    use super::*;

    fn image(text: &str) -> Vec<(usize, Id)> {
        let mut graph = Graph::default();
        let phi = parse(&mut graph, text, &["a", "b"]).unwrap();
        euler_lagrange(&mut graph, phi)
    }

    /// Others vanish only numerically, because sums are not multiplied out: `aliases.rs` finds those.
    #[test]
    fn simple_total_time_derivatives_vanish_by_construction() {
        for text in [
            "3",
            "qd1",
            "qd1*sin(q1)",
            "qd1*exp(2*q1)",
            "qd1*q2 + q1*qd2",
            "sin(q1)^2 + cos(q1)^2",
        ] {
            assert!(image(text).is_empty(), "{text}");
        }
    }

    #[test]
    fn only_the_joints_a_term_touches_are_rows() {
        let joints = |text| {
            image(text)
                .iter()
                .map(|&(joint, _)| joint)
                .collect::<Vec<_>>()
        };
        assert_eq!(joints("qd1^2"), [0]);
        assert_eq!(joints("cos(q2)"), [1]);
        assert_eq!(joints("qd1^2*cos(q2)"), [0, 1]);
        assert_eq!(joints("qd1*q2"), [0, 1]); // a gyroscopic pair: Coriolis-like, no energy
    }
}
