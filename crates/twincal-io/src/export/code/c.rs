//! C99.

use super::{INPUTS, arithmetic, bounds, literal, notes, operand};
use std::fmt::Write as _;
use twincal::evaluator::{Evaluator, Step};
use twincal::term::Function;

pub(super) fn source(evaluator: &Evaluator, about: &[String]) -> String {
    let n = evaluator.joints.len();
    let mut out = String::new();
    // Writing to a string cannot fail.
    for (k, line) in notes(evaluator, about).iter().enumerate() {
        let start = if k == 0 { "/* " } else { " * " };
        let _ = writeln!(out, "{start}{line}");
    }
    let _ = write!(
        out,
        " */\n#include <math.h>\n\n\
         int twincal_evaluate(const double q[{n}], const double qd[{n}], const double qdd[{n}],\n\
         \x20                    double tau[{n}], double low[{n}], double high[{n}]);\n\n\
         int twincal_evaluate(const double q[{n}], const double qd[{n}], const double qdd[{n}],\n\
         \x20                    double tau[{n}], double low[{n}], double high[{n}])\n{{\n"
    );
    for (id, step) in evaluator.steps.iter().enumerate() {
        if let Some(value) = expression(evaluator, step) {
            let _ = writeln!(out, "    const double t{id} = {value};");
        }
    }
    out.push_str("    int outside = 0;\n    double half;\n");
    for (j, joint) in evaluator.joints.iter().enumerate() {
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
             \x20   half = {} * sqrt({} * fmax({variance}, 0.0) + {});\n\
             \x20   tau[{j}] = {};\n    low[{j}] = tau[{j}] - half;\n    high[{j}] = tau[{j}] + half;\n",
            literal(joint.noise),
            literal(evaluator.quantile),
            literal(evaluator.ratio),
            literal(joint.base),
            operand(evaluator, evaluator.torque[j]),
        );
    }
    // A robot may have inputs that nothing depends on.
    out.push_str("    (void)q;\n    (void)qd;\n    (void)qdd;\n    return outside;\n}\n");
    out
}

fn expression(evaluator: &Evaluator, step: &Step) -> Option<String> {
    let name = |id: &u32| operand(evaluator, *id);
    arithmetic(evaluator, step).or_else(|| {
        Some(match step {
            Step::Absolute(a) => format!("fabs({})", name(a)),
            Step::Power(a, exponent) => format!("pow({}, {})", name(a), literal(*exponent)),
            Step::Apply(Function::Sign, a) => {
                let a = name(a);
                format!("(double)(({a} > 0.0) - ({a} < 0.0))")
            }
            Step::Apply(function, a) => format!("{}({})", word(*function), name(a)),
            _ => return None,
        })
    })
}

/// Name in `<math.h>`.
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
        Function::Atan => "atan",
        Function::Sign => "",
    }
}
