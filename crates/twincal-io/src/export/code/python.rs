//! Python with NumPy: one state or whole arrays of them.

use super::text::python_string;
use super::{INPUTS, arithmetic, bounds, literal, notes, operand};
use std::fmt::Write as _;
use twincal::evaluator::{Evaluator, Step};
use twincal::term::Function;

pub(super) fn source(evaluator: &Evaluator, about: &[String]) -> String {
    let n = evaluator.joints.len();
    let mut out = String::from("\"\"\"");
    // Writing to a string cannot fail.
    for line in notes(evaluator, about) {
        let _ = writeln!(out, "{line}");
    }
    let _ = write!(
        out,
        "\"\"\"\n\nimport numpy as np\n\nJOINTS = [{}]\n\n\ndef evaluate(q, qd, qdd):\n\
         \x20   \"\"\"Torque, low, high ({n} or {n} x samples) and whether the state is outside the data.\n\n\
         \x20   q, qd, qdd: {n} numbers, or arrays with the joint as first axis.\n    \"\"\"\n\
         \x20   q, qd, qdd = (np.asarray(x, dtype=float) for x in (q, qd, qdd))\n",
        evaluator
            .joints
            .iter()
            .map(|joint| python_string(&joint.name))
            .collect::<Vec<_>>()
            .join(", ")
    );
    for (id, step) in evaluator.steps.iter().enumerate() {
        if let Some(value) = expression(evaluator, step) {
            let _ = writeln!(out, "    t{id} = {value}");
        }
    }
    let list = |ids: &[u32]| -> String {
        let names: Vec<String> = ids.iter().map(|&id| operand(evaluator, id)).collect();
        names.join(", ")
    };
    let _ = write!(
        out,
        "    shape = np.broadcast_shapes(q[0].shape, qd[0].shape, qdd[0].shape)\n\
         \x20   tau = np.array([np.broadcast_to(t, shape) for t in ({},)])\n\
         \x20   variance = np.array([np.broadcast_to(t, shape) for t in ({},)])\n\
         \x20   outside = np.zeros(shape, dtype=bool)\n    half = np.empty_like(tau)\n",
        list(&evaluator.torque),
        list(&evaluator.variance)
    );
    for joint in 0..n {
        write_joint(&mut out, evaluator, joint);
    }
    out.push_str("    return tau, tau - half, tau + half, outside\n");
    out
}

/// Whether a joint's state is outside the data, and half the width of its torque's interval.
fn write_joint(out: &mut String, evaluator: &Evaluator, j: usize) {
    let joint = &evaluator.joints[j];
    for (k, low, high) in bounds(&joint.limits) {
        let input = INPUTS[k];
        let _ = writeln!(
            out,
            "    outside |= ~(({input}[{j}] >= {}) & ({input}[{j}] <= {}))",
            literal(low),
            literal(high)
        );
    }
    let _ = write!(
        out,
        "    outside |= ~(variance[{j}] <= {})\n\
         \x20   half[{j}] = {} * np.sqrt({} * np.maximum(variance[{j}], 0.0) + {})\n",
        literal(joint.noise),
        literal(evaluator.quantile),
        literal(evaluator.ratio),
        literal(joint.base)
    );
}

fn expression(evaluator: &Evaluator, step: &Step) -> Option<String> {
    let name = |id: &u32| operand(evaluator, *id);
    arithmetic(evaluator, step).or_else(|| {
        Some(match step {
            Step::Absolute(a) => format!("np.abs({})", name(a)),
            Step::Power(a, exponent) => format!("np.power({}, {})", name(a), literal(*exponent)),
            Step::Apply(function, a) => format!("np.{}({})", word(*function), name(a)),
            _ => return None,
        })
    })
}

/// Name in NumPy.
fn word(function: Function) -> &'static str {
    match function {
        Function::Sin => "sin",
        Function::Cos => "cos",
        Function::Tan => "tan",
        Function::Exp => "exp",
        Function::Log => "log",
        Function::Sqrt => "sqrt",
        Function::Sinh => "sinh",
        Function::Cosh => "cosh",
        Function::Tanh => "tanh",
        Function::Atan => "arctan",
        Function::Sign => "sign",
    }
}
