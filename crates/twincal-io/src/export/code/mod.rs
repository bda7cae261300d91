//! The calibrated twin as source code: one file, no dependencies, no allocation; the same steps in every language.
//! What stands in it beside numbers goes through `text.rs`.

mod c;
mod json;
mod python;
mod rust;
mod text;

use crate::error::Result;
pub(super) use text::comment_text;
use twincal::evaluator::{Evaluator, Step};

/// A language that an [`Evaluator`] is printed in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Language {
    /// C99 with `<math.h>`.
    C,
    /// Rust without its standard library.
    Rust,
    /// Python with NumPy, one state or arrays of states.
    Python,
    /// The steps themselves, for other languages.
    Json,
}

/// The source text; `about` are lines of a comment that say where it comes from.
///
/// # Errors
/// [`crate::Error::Content`] for a function that the language has not.
///
/// # Example
/// The same program as C, and as steps for another language.
/// ```
/// # #[path = "../../../../twincal/examples/two_link.rs"] mod two_link;
/// use twincal::evaluator::Evaluator;
/// use twincal_io::export::code::{Language, source};
///
/// # let fit = two_link::study()?;
/// let program = Evaluator::new(fit.twin(), None)?;
/// let c = source(&program, Language::C, &["Arm of two links.".into()])?;
/// assert!(c.starts_with("/* Arm of two links.") && c.contains("int twincal_evaluate(const double q[2]"));
/// let steps: serde_json::Value = serde_json::from_str(&source(&program, Language::Json, &[])?)?;
/// assert_eq!(steps["joints"][1]["name"], "elbow");
/// assert_eq!(steps["steps"].as_array().map(Vec::len), Some(program.steps.len()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn source(evaluator: &Evaluator, language: Language, about: &[String]) -> Result<String> {
    match language {
        Language::C => Ok(c::source(evaluator, about)),
        Language::Rust => rust::source(evaluator, about),
        Language::Python => Ok(python::source(evaluator, about)),
        Language::Json => json::source(evaluator, about),
    }
}

/// What every file says of itself: lines of a comment in any language.
fn notes(evaluator: &Evaluator, about: &[String]) -> Vec<String> {
    let joints = (evaluator.joints.iter().enumerate())
        .map(|(k, joint)| format!("  {k}: {} ({})", joint.name, joint.unit));
    let told = [
        "In: position, velocity, acceleration per joint; rad or m, SI units.",
        "Out: calibrated torque, and the ends of its 95 % interval for torque as",
        "measured. 1 (true) outside the data that the twin was fitted to, else 0.",
        "While a joint is at rest, stiction may add up to its Coulomb friction.",
        "Joints:",
    ];
    let lines = about.iter().cloned().chain(told.map(str::to_owned));
    lines
        .chain(joints)
        .map(|line| text::comment_text(&line))
        .collect()
}

/// Every digit, read as a double in all languages.
fn literal(value: f64) -> String {
    let text = format!("{value:e}");
    if value < 0.0 {
        format!("({text})")
    } else {
        text
    }
}

/// What a step is called where another uses it: numbers and inputs by themselves.
fn operand(evaluator: &Evaluator, id: u32) -> String {
    match evaluator.steps[id as usize] {
        Step::Constant(value) => literal(value),
        Step::Position(joint) => format!("q[{joint}]"),
        Step::Velocity(joint) => format!("qd[{joint}]"),
        Step::Acceleration(joint) => format!("qdd[{joint}]"),
        _ => format!("t{id}"),
    }
}

/// The four operations, the same in every language; `None` for inputs, numbers and functions.
fn arithmetic(evaluator: &Evaluator, step: &Step) -> Option<String> {
    let name = |id: &u32| operand(evaluator, *id);
    Some(match step {
        Step::Add(a, b) => format!("{} + {}", name(a), name(b)),
        Step::Subtract(a, b) => format!("{} - {}", name(a), name(b)),
        Step::Multiply(a, b) => format!("{} * {}", name(a), name(b)),
        Step::Divide(a, b) => format!("{} / {}", name(a), name(b)),
        Step::Negate(a) => format!("-{}", name(a)),
        _ => return None,
    })
}

/// Bounds that can be left: `(index in q, qd, qdd as 0, 1, 2, low, high)`.
fn bounds(limits: &[f64; 6]) -> impl Iterator<Item = (usize, f64, f64)> {
    (0..3)
        .map(|k| (k, limits[2 * k], limits[2 * k + 1]))
        .filter(|&(_, low, high)| low > f64::MIN && high < f64::MAX)
}

/// Names of the three inputs.
const INPUTS: [&str; 3] = ["q", "qd", "qdd"];
