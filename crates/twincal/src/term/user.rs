//! A candidate Lagrangian given as text: the user's own, and the generic family's, which is written the same way.

use super::Family;
use super::candidate::{Candidate, Joint};
use super::expression::{Dimension, Function, Graph, Id, Node, Variable, dimensions, parse};
use crate::error::{Error, Result};

/// The expressions as candidates of `family`, named verbatim. Units are filled in by [`fill_units`].
///
/// # Errors
/// [`Error::Term`] with the character that cannot be understood, or when the derivatives grow beyond all bounds.
pub(super) fn candidate(
    graph: &mut Graph,
    text: &str,
    family: Family,
    joints: &[Joint],
) -> Result<Candidate> {
    let names: Vec<&str> = joints.iter().map(|joint| joint.name.as_str()).collect();
    let phi = parse(graph, text, &names)?;
    let story = format!("{} {}", kind(graph, phi), text.trim());
    let candidate = Candidate::lagrangian(graph, text.to_owned(), family, "", story, phi);
    if graph.is_exhausted() {
        return Err(Error::Term {
            term: text.to_owned(),
            column: 1,
            problem: "its Euler-Lagrange torque has more than two million operations".to_owned(),
            remedy: "simplify the expression or split it into several terms".to_owned(),
        });
    }
    Ok(candidate)
}

/// Writes the unit of β of every expression: J divided by the unit of φ.
pub(super) fn fill_units(graph: &Graph, joints: &[Joint], candidates: &mut [Candidate]) {
    let all = dimensions(graph, |joint| joints[joint].slides);
    for candidate in candidates
        .iter_mut()
        .filter(|candidate| candidate.unit.is_empty())
    {
        let dimension = candidate
            .lagrangian
            .map_or(Dimension::Mixed, |phi| all[phi.0 as usize]);
        candidate.unit = dimension
            .unit_of_coefficient()
            .unwrap_or_else(|| "J per unit of the expression".to_owned());
    }
}

/// What a Lagrangian looks like, in words.
fn kind(graph: &Graph, phi: Id) -> &'static str {
    let variables = graph.variables(phi);
    let rates = variables
        .iter()
        .filter(|variable| matches!(variable, Variable::Velocity(_)))
        .count();
    match (rates, variables.len()) {
        (0, 0) => "constant",
        (0, _) if is_polynomial(graph, phi) => "spring-like potential",
        (0, _) if is_periodic(graph, phi) => "gravity-like potential",
        (0, _) => "potential",
        (1, _) => "kinetic term",
        (_, _) => "kinetic coupling",
    }
}

/// True if no function and no division occurs.
fn is_polynomial(graph: &Graph, id: Id) -> bool {
    let own = match graph.node(id) {
        Node::Function(..) | Node::Power(..) => false,
        Node::Product(factors) => factors.iter().all(|&(_, exponent)| exponent > 0),
        _ => true,
    };
    let mut all = own;
    graph.operands(id, |operand| all = all && is_polynomial(graph, operand));
    all
}

/// True if sines and cosines are the only functions and there is one.
fn is_periodic(graph: &Graph, id: Id) -> bool {
    match graph.node(id) {
        Node::Function(function, _) => matches!(function, Function::Sin | Function::Cos),
        _ => {
            let mut any = false;
            graph.operands(id, |operand| any = any || is_periodic(graph, operand));
            any
        }
    }
}
