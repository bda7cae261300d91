//! Rust without its standard library: the functions that `core` lacks come along.

use super::{INPUTS, arithmetic, bounds, literal, notes, operand};
use crate::error::{Error, Place, Result};
use std::fmt::Write as _;
use twincal::evaluator::{Evaluator, Step};
use twincal::term::Function;

/// Functions in the order in which they are written, each with those that it uses.
const MATHEMATICS: [(&str, &[&str], &str); 6] = [
    ("sqrt", &[], include_str!("mathematics/sqrt.rs.txt")),
    ("sin", &["reduce"], include_str!("mathematics/sin.rs.txt")),
    ("cos", &["reduce"], include_str!("mathematics/cos.rs.txt")),
    ("reduce", &[], include_str!("mathematics/reduce.rs.txt")),
    ("tanh", &["exp"], include_str!("mathematics/tanh.rs.txt")),
    ("exp", &[], include_str!("mathematics/exp.rs.txt")),
];

pub(super) fn source(evaluator: &Evaluator, about: &[String]) -> Result<String> {
    let n = evaluator.joints.len();
    let mut out = String::new();
    // Writing to a string cannot fail.
    for line in notes(evaluator, about) {
        let _ = writeln!(out, "//! {line}");
    }
    let _ = write!(
        out,
        "#![no_std]\n#![allow(clippy::all, unused_parens)]\n\n\
         /// Torque and the ends of its interval; true outside the data.\n\
         pub fn evaluate(\n    q: &[f64; {n}],\n    qd: &[f64; {n}],\n    qdd: &[f64; {n}],\n\
         \x20   tau: &mut [f64; {n}],\n    low: &mut [f64; {n}],\n    high: &mut [f64; {n}],\n) -> bool {{\n"
    );
    let mut used = vec!["sqrt"];
    for (id, step) in evaluator.steps.iter().enumerate() {
        if let Some(value) = expression(evaluator, step, &mut used)? {
            let _ = writeln!(out, "    let t{id}: f64 = {value};");
        }
    }
    out.push_str("    let mut outside = false;\n    let mut half: f64;\n");
    for joint in 0..n {
        write_joint(&mut out, evaluator, joint);
    }
    out.push_str("    let _ = (q, qd, qdd);\n    outside\n}\n");
    write_mathematics(&mut out, used);
    Ok(out)
}

/// Whether a joint's state is outside the data, its torque and the ends of its interval.
fn write_joint(out: &mut String, evaluator: &Evaluator, j: usize) {
    let joint = &evaluator.joints[j];
    for (k, low, high) in bounds(&joint.limits) {
        let input = INPUTS[k];
        let _ = writeln!(
            out,
            "    outside |= !({input}[{j}] >= {} && {input}[{j}] <= {});",
            literal(low),
            literal(high)
        );
    }
    let variance = operand(evaluator, evaluator.variance[j]);
    let _ = write!(
        out,
        "    outside |= !({variance} <= {});\n\
         \x20   half = {} * sqrt({} * f64::max({variance}, 0.0) + {});\n\
         \x20   tau[{j}] = {};\n    low[{j}] = tau[{j}] - half;\n    high[{j}] = tau[{j}] + half;\n",
        literal(joint.noise),
        literal(evaluator.quantile),
        literal(evaluator.ratio),
        literal(joint.base),
        operand(evaluator, evaluator.torque[j]),
    );
}

/// The functions that are `used`, with those that they use.
fn write_mathematics(out: &mut String, mut used: Vec<&'static str>) {
    for _ in 0..2 {
        let more: Vec<&str> = (MATHEMATICS.iter())
            .filter(|(name, ..)| used.contains(name))
            .flat_map(|(_, needs, _)| needs.iter().copied())
            .collect();
        used.extend(more);
    }
    for (_, _, text) in MATHEMATICS.iter().filter(|(name, ..)| used.contains(name)) {
        out.push('\n');
        out.push_str(text);
    }
}

fn expression(
    evaluator: &Evaluator,
    step: &Step,
    used: &mut Vec<&'static str>,
) -> Result<Option<String>> {
    if let Some(text) = arithmetic(evaluator, step) {
        return Ok(Some(text));
    }
    let mut call = |name: &'static str, a: &u32| {
        used.push(name);
        format!("{name}({})", operand(evaluator, *a))
    };
    Ok(Some(match step {
        Step::Absolute(a) => {
            let a = operand(evaluator, *a);
            format!("if {a} < 0.0 {{ -{a} }} else {{ {a} }}")
        }
        Step::Apply(Function::Sin, a) => call("sin", a),
        Step::Apply(Function::Cos, a) => call("cos", a),
        Step::Apply(Function::Tan, a) => format!("{} / {}", call("sin", a), call("cos", a)),
        Step::Apply(Function::Exp, a) => call("exp", a),
        Step::Apply(Function::Tanh, a) => call("tanh", a),
        Step::Apply(Function::Sqrt, a) => call("sqrt", a),
        Step::Apply(Function::Sinh, a) => {
            let e = call("exp", a);
            format!("0.5 * ({e} - 1.0 / {e})")
        }
        Step::Apply(Function::Cosh, a) => {
            let e = call("exp", a);
            format!("0.5 * ({e} + 1.0 / {e})")
        }
        Step::Apply(Function::Sign, a) => {
            let a = operand(evaluator, *a);
            format!("if {a} > 0.0 {{ 1.0 }} else if {a} < 0.0 {{ -1.0 }} else {{ 0.0 }}")
        }
        Step::Power(..) | Step::Apply(Function::Log | Function::Atan, _) => {
            return Err(Error::content(
                Place::file("export to Rust"),
                "a term has a logarithm, an arc tangent or a broken power, which core has not",
                "export --to c, or write the term without it",
            ));
        }
        _ => return Ok(None),
    }))
}
