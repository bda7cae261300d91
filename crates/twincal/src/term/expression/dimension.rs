//! Units of expressions: metres, seconds and radians of every node, as far as the joints decide them.

use super::graph::{Function, Graph, Node, Variable};

/// Powers of metre, second and radian of an expression.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Dimension {
    /// A number: it takes whatever unit is needed.
    Any,
    /// m^length s^time rad^angle.
    Known {
        /// Power of metre.
        length: f64,
        /// Power of second.
        time: f64,
        /// Power of radian, kept only to write N·m/rad instead of N·m.
        angle: f64,
    },
    /// A sum of unlike things.
    Mixed,
}

const PURE: Dimension = Dimension::Known {
    length: 0.0,
    time: 0.0,
    angle: 0.0,
};

/// Dimension of every node; `slides(i)` says whether joint i is a slider.
///
/// The argument of a function is taken as a number: constants inside it carry what unit it takes, as 3 does in
/// `sin(3*q1)`.
pub(crate) fn dimensions(graph: &Graph, slides: impl Fn(usize) -> bool) -> Vec<Dimension> {
    let mut all: Vec<Dimension> = Vec::with_capacity(graph.nodes().len());
    for node in graph.nodes() {
        let dimension = match node {
            Node::Constant(_) => Dimension::Any,
            &Node::Variable(variable) => {
                let known = |joint: usize, time: f64| {
                    let slider = f64::from(u8::from(slides(joint)));
                    Dimension::Known {
                        length: slider,
                        time,
                        angle: 1.0 - slider,
                    }
                };
                match variable {
                    Variable::Position(joint) => known(joint, 0.0),
                    Variable::Velocity(joint) => known(joint, -1.0),
                    Variable::Acceleration(joint) => known(joint, -2.0),
                    Variable::History(_) => Dimension::Any,
                }
            }
            Node::Sum(_, parts) => parts
                .iter()
                .map(|&(_, part)| all[part.0 as usize])
                .fold(Dimension::Any, added),
            Node::Product(factors) => {
                let factors = factors
                    .iter()
                    .map(|&(f, e)| scaled(all[f.0 as usize], f64::from(e)));
                factors.fold(Dimension::Any, multiplied)
            }
            &Node::Power(base, exponent) => scaled(all[base.0 as usize], exponent.get()),
            &Node::Function(Function::Sqrt, argument) => scaled(all[argument.0 as usize], 0.5),
            Node::Function(_, _) => PURE,
        };
        all.push(dimension);
    }
    all
}

fn added(a: Dimension, b: Dimension) -> Dimension {
    use Dimension::{Any, Known, Mixed};
    match (a, b) {
        (Any, x) | (x, Any) => x,
        (
            Known {
                length,
                time,
                angle,
            },
            Known {
                length: l,
                time: t,
                angle: r,
            },
        ) if length == l && time == t => Known {
            length,
            time,
            angle: if angle == r { angle } else { 0.0 },
        },
        _ => Mixed,
    }
}

fn scaled(a: Dimension, by: f64) -> Dimension {
    match a {
        Dimension::Known {
            length,
            time,
            angle,
        } => Dimension::Known {
            length: length * by,
            time: time * by,
            angle: angle * by,
        },
        other => other,
    }
}

fn multiplied(a: Dimension, b: Dimension) -> Dimension {
    use Dimension::{Any, Known, Mixed};
    match (a, b) {
        (Any, x) | (x, Any) => x,
        (
            Known {
                length,
                time,
                angle,
            },
            Known {
                length: l,
                time: t,
                angle: r,
            },
        ) => Known {
            length: length + l,
            time: time + t,
            angle: angle + r,
        },
        _ => Mixed,
    }
}

impl Dimension {
    /// Unit of β in an energy β φ, where φ has this dimension; `None` where it cannot be told.
    ///
    /// ```text
    /// J / (m^l s^t rad^r) = kg m^(2−l) s^(−2−t) / rad^r
    /// ```
    /// Radians are written only beside N·m, as in N·m/rad.
    pub(crate) fn unit_of_coefficient(self) -> Option<String> {
        let (length, time, angle) = match self {
            Self::Any => (0.0, 0.0, 0.0),
            Self::Known {
                length,
                time,
                angle,
            } => (length, time, angle),
            Self::Mixed => return None,
        };
        let (metres, seconds) = (2.0 - length, -2.0 - time);
        let mut unit = Vec::new();
        let mut below = Vec::new();
        let mut factor = |symbol: &str, power: f64| {
            let side = if power > 0.0 { &mut unit } else { &mut below };
            match power.abs() {
                0.0 => {}
                1.0 => side.push(symbol.to_owned()),
                2.0 => side.push(format!("{symbol}²")),
                3.0 => side.push(format!("{symbol}³")),
                p => side.push(format!("{symbol}^{p}")),
            }
        };
        // forces as newtons, inertias as kilograms
        if seconds == -2.0 || seconds == -1.0 {
            factor("N", 1.0);
            factor("m", metres - 1.0);
            factor("s", seconds + 2.0);
            if seconds == -2.0 && length == 0.0 && angle > 0.0 {
                // a potential in angles: J/rad^r = N·m/rad^(r−1)
                factor("rad", 1.0 - angle);
            }
        } else {
            factor("kg", 1.0);
            factor("m", metres);
            factor("s", seconds);
        }
        let unit = unit.join("·");
        Some(match &below[..] {
            [] => unit,
            [one] => format!("{unit}/{one}"),
            more => format!("{unit}/({})", more.join("·")),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::parse;
    use super::*;

    fn unit(text: &str) -> Option<String> {
        // joint 1 turns, joint 2 slides
        let mut graph = Graph::default();
        let id = parse(&mut graph, text, &["turn", "slide"]).unwrap();
        dimensions(&graph, |joint| joint == 1)[id.0 as usize].unit_of_coefficient()
    }

    #[test]
    fn units_follow_from_energy() {
        for (text, expected) in [
            ("qd1^2", "kg·m²"),
            ("qd1^2*cos(q1)", "kg·m²"),
            ("qd2^2", "kg"),
            ("qd1*qd2*sin(q1)", "kg·m"),
            ("cos(q1)", "N·m"),
            ("sin(q1 + 0.3)", "N·m"),
            ("q1^2", "N·m/rad"),
            ("q1^3", "N·m/rad²"),
            ("q1", "N·m"),
            ("q2", "N"),
            ("q2^2", "N/m"),
            ("(q2 - 0.1)^2", "N/m"),
            ("q2*cos(q1)", "N"),
            ("qd1*q1^2", "N·m·s"),
            ("qd1^3", "kg·m²·s"),
            ("7", "N·m"),
        ] {
            assert_eq!(unit(text).as_deref(), Some(expected), "{text}");
        }
        assert_eq!(unit("qd1^2 + cos(q1)"), None);
        assert_eq!(unit("q1 + q2"), None);
    }
}
