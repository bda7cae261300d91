//! Text to expression: the grammar of `[library] terms`.
//!
//! ```text
//! sum      = product { ("+" | "-") product }
//! product  = unary { ("*" | "/") unary }
//! unary    = ("-" | "+") unary | power
//! power    = atom [ "^" unary ]                      -q1^2 is -(q1^2); the exponent is a number
//! atom     = number | "pi" | q1…qn | qd1…qdn | function "(" sum ")" | "(" sum ")"
//! function = sin cos tan exp log sqrt sinh cosh tanh atan
//! ```

use super::graph::{Function, Graph, Id, Variable};
use crate::error::{Error, Result};

/// Longest expression, characters.
const LENGTH_LIMIT: usize = 10_000;
/// Deepest nesting of parentheses, signs and exponents.
const DEPTH_LIMIT: usize = 100;

/// The functions of the grammar. All are twice differentiable where they are defined, as a Lagrangian must be.
const FUNCTIONS: [(&str, Function); 10] = [
    ("sin", Function::Sin),
    ("cos", Function::Cos),
    ("tan", Function::Tan),
    ("exp", Function::Exp),
    ("log", Function::Log),
    ("sqrt", Function::Sqrt),
    ("sinh", Function::Sinh),
    ("cosh", Function::Cosh),
    ("tanh", Function::Tanh),
    ("atan", Function::Atan),
];

/// Reads `text` as an expression in q1…qn and qd1…qdn of a robot with these moving joints.
///
/// # Errors
/// [`Error::Term`] with the character (1-based) where it went wrong.
pub(crate) fn parse(graph: &mut Graph, text: &str, joints: &[&str]) -> Result<Id> {
    let characters: Vec<char> = text.chars().collect();
    let mut parser = Parser {
        graph,
        text,
        characters,
        position: 0,
        depth: 0,
        joints,
    };
    if parser.characters.len() > LENGTH_LIMIT {
        let problem = format!(
            "the expression has {} characters, the limit is {LENGTH_LIMIT}",
            parser.characters.len()
        );
        return Err(parser.error_with(LENGTH_LIMIT, problem, "split it into several terms", true));
    }
    parser.skip_space();
    if parser.peek().is_none() {
        return Err(parser.error(
            0,
            "the expression is empty",
            "write something like `cos(q1)` or delete the entry",
        ));
    }
    let expression = parser.sum()?;
    match parser.peek() {
        None => Ok(expression),
        Some(')') => Err(parser.here(
            "this `)` closes nothing",
            "delete it or add the missing `(`",
        )),
        Some(_) => Err(parser.unexpected("an operator (+ - * / ^) or the end")),
    }
}

struct Parser<'a> {
    graph: &'a mut Graph,
    text: &'a str,
    characters: Vec<char>,
    position: usize,
    depth: usize,
    joints: &'a [&'a str],
}

impl Parser<'_> {
    fn peek(&self) -> Option<char> {
        self.characters.get(self.position).copied()
    }

    fn skip_space(&mut self) {
        while self.peek().is_some_and(char::is_whitespace) {
            self.position += 1;
        }
    }

    /// Takes `wanted` if it comes next.
    fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        if found {
            self.position += 1;
            self.skip_space();
        }
        found
    }

    fn error_with(
        &self,
        at: usize,
        problem: impl Into<String>,
        remedy: impl Into<String>,
        shorten: bool,
    ) -> Error {
        let term = if shorten {
            self.characters.iter().take(60).collect::<String>() + "…"
        } else {
            self.text.to_owned()
        };
        Error::Term {
            term,
            column: at + 1,
            problem: problem.into(),
            remedy: remedy.into(),
        }
    }

    fn error(&self, at: usize, problem: impl Into<String>, remedy: impl Into<String>) -> Error {
        self.error_with(at, problem, remedy, self.characters.len() > 200)
    }

    fn here(&self, problem: impl Into<String>, remedy: impl Into<String>) -> Error {
        self.error(self.position, problem, remedy)
    }

    fn unexpected(&self, expected: &str) -> Error {
        let remedy = match self.peek() {
            None => "complete the expression".to_owned(),
            Some(c) if c.is_alphanumeric() || c == '(' => {
                "write every multiplication, as in `2*q1*cos(q2)`".to_owned()
            }
            Some(_) => {
                "the grammar has numbers, q1, qd1, + - * / ^, functions and parentheses".to_owned()
            }
        };
        let found = self
            .peek()
            .map_or("the end".to_owned(), |c| format!("`{}`", c.escape_debug()));
        self.here(format!("expected {expected}, found {found}"), remedy)
    }

    /// One level deeper, or an error.
    fn descend(&mut self) -> Result<()> {
        self.depth += 1;
        if self.depth > DEPTH_LIMIT {
            return Err(self.here(
                format!("nested deeper than {DEPTH_LIMIT} levels"),
                "simplify the expression",
            ));
        }
        Ok(())
    }

    /// Numbers must stay numbers: 1/0 is found where it is written.
    fn finite(&self, at: usize, id: Id) -> Result<Id> {
        match self.graph.as_constant(id) {
            Some(value) if !value.is_finite() => {
                let problem = format!("the number computed here is {value}");
                Err(self.error(at, problem, "use numbers that can be computed"))
            }
            _ => Ok(id),
        }
    }

    fn sum(&mut self) -> Result<Id> {
        let start = self.position;
        let mut parts = vec![(1.0, self.product()?)];
        loop {
            if self.take('+') {
                parts.push((1.0, self.product()?));
            } else if self.take('-') {
                parts.push((-1.0, self.product()?));
            } else {
                break;
            }
        }
        let sum = self.graph.sum(0.0, &parts);
        self.finite(start, sum)
    }

    fn product(&mut self) -> Result<Id> {
        let start = self.position;
        let mut factors = vec![(self.unary()?, 1)];
        loop {
            if self.take('*') {
                if self.peek() == Some('*') {
                    return Err(self.here("`**` is not an operator here", "write powers with `^`"));
                }
                factors.push((self.unary()?, 1));
            } else if self.peek() == Some('/') {
                let at = self.position;
                self.take('/');
                let divisor = self.unary()?;
                if self.graph.is_zero(divisor) {
                    return Err(self.error(
                        at,
                        "division by zero",
                        "divide by something that is not 0",
                    ));
                }
                factors.push((divisor, -1));
            } else {
                break;
            }
        }
        let product = self.graph.product(&factors);
        self.finite(start, product)
    }

    fn unary(&mut self) -> Result<Id> {
        if self.peek() != Some('-') && self.peek() != Some('+') {
            return self.power();
        }
        let negative = self.peek() == Some('-');
        self.descend()?;
        self.take(if negative { '-' } else { '+' });
        let operand = self.unary()?;
        self.depth -= 1;
        Ok(if negative {
            self.graph.scaled(-1.0, operand)
        } else {
            operand
        })
    }

    fn power(&mut self) -> Result<Id> {
        let start = self.position;
        let base = self.atom()?;
        if self.peek() != Some('^') {
            return Ok(base);
        }
        self.descend()?;
        self.take('^');
        let at = self.position;
        let exponent = self.unary()?;
        self.depth -= 1;
        let Some(exponent) = self.graph.as_constant(exponent) else {
            let remedy = "write a^b with a variable exponent as exp(b*log(a))";
            return Err(self.error(at, "the exponent must be a number", remedy));
        };
        if self.graph.is_zero(base) && exponent < 0.0 {
            return Err(self.error(
                at,
                "zero to a negative power",
                "divide by something that is not 0",
            ));
        }
        let power = self.graph.power(base, exponent);
        self.finite(start, power)
    }

    fn atom(&mut self) -> Result<Id> {
        match self.peek() {
            Some('(') => {
                let inner = self.parenthesis()?;
                Ok(inner)
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() || c == '_' => self.name(),
            _ => Err(self.unexpected("a number, q1, qd1, a function or `(`")),
        }
    }

    /// `( sum )`.
    fn parenthesis(&mut self) -> Result<Id> {
        let open = self.position;
        self.descend()?;
        self.take('(');
        let inner = self.sum()?;
        if !self.take(')') {
            if self.peek().is_some() {
                return Err(self.unexpected("an operator (+ - * / ^) or `)`"));
            }
            return Err(self.error(open, "this `(` is never closed", "add the missing `)`"));
        }
        self.depth -= 1;
        Ok(inner)
    }

    fn number(&mut self) -> Result<Id> {
        let start = self.position;
        let digits = |parser: &mut Self| {
            while parser.peek().is_some_and(|c| c.is_ascii_digit()) {
                parser.position += 1;
            }
        };
        digits(self);
        if self.peek() == Some('.') {
            self.position += 1;
            digits(self);
        }
        let mantissa = self.position;
        if matches!(self.peek(), Some('e' | 'E')) {
            self.position += 1;
            if matches!(self.peek(), Some('+' | '-')) {
                self.position += 1;
            }
            let exponent = self.position;
            digits(self);
            if self.position == exponent {
                self.position = mantissa; // not an exponent after all: `2exp(q1)` is reported as a missing `*`
            }
        }
        let text: String = self.characters[start..self.position].iter().collect();
        let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
        let Some(value) = value else {
            let problem = format!("`{text}` is not a number that fits in 64 bits");
            return Err(self.error(start, problem, "write it like 0.5 or 1e-3"));
        };
        self.skip_space();
        Ok(self.graph.constant(value))
    }

    fn name(&mut self) -> Result<Id> {
        let start = self.position;
        while self.peek().is_some_and(|c| c.is_alphanumeric() || c == '_') {
            self.position += 1;
        }
        let name: String = self.characters[start..self.position].iter().collect();
        self.skip_space();
        if let Some(&(_, function)) = FUNCTIONS.iter().find(|(known, _)| *known == name) {
            if self.peek() != Some('(') {
                return Err(self.error(
                    start,
                    format!("`{name}` needs an argument"),
                    format!("write `{name}(q1)`"),
                ));
            }
            let argument = self.parenthesis()?;
            let value = self.graph.function(function, argument);
            return self.finite(start, value);
        }
        if name == "pi" {
            return Ok(self.graph.constant(std::f64::consts::PI));
        }
        match self.coordinate(start, &name)? {
            Some(variable) => Ok(self.graph.variable(variable)),
            None => Err(self.error(
                start,
                format!("`{name}` is unknown"),
                self.suggestion(&name),
            )),
        }
    }

    /// The coordinate of a name such as `q2` or `qd2`, which starts at `start`; `None` for any other name.
    fn coordinate(&self, start: usize, name: &str) -> Result<Option<Variable>> {
        let index = |prefix: &str| {
            let digits = name.strip_prefix(prefix)?;
            (!digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit())).then_some(digits)
        };
        if index("qdd").is_some() {
            let remedy = "use q and qd; the Euler-Lagrange operator brings the accelerations in";
            return Err(self.error(
                start,
                format!("a Lagrangian has no acceleration `{name}`"),
                remedy,
            ));
        }
        for prefix in ["qd", "q"] {
            let Some(digits) = index(prefix) else {
                continue;
            };
            let n = self.joints.len();
            let joint = digits
                .parse::<usize>()
                .ok()
                .filter(|i| (1..=n).contains(i) && !digits.starts_with('0'));
            return match joint {
                None => Err(self.no_joint(start, name, prefix)),
                Some(joint) if prefix == "qd" => Ok(Some(Variable::Velocity(joint - 1))),
                Some(joint) => Ok(Some(Variable::Position(joint - 1))),
            };
        }
        Ok(None)
    }

    /// The error for a coordinate of a joint that is not there.
    fn no_joint(&self, start: usize, name: &str, prefix: &str) -> Error {
        let n = self.joints.len();
        let range = if n == 1 {
            format!("{prefix}1")
        } else {
            format!("{prefix}1 to {prefix}{n}")
        };
        let problem = format!(
            "there is no `{name}`: the robot has {n} moving joint{}",
            if n == 1 { "" } else { "s" }
        );
        self.error(
            start,
            problem,
            format!("use {range} ({})", self.listed_joints()),
        )
    }

    /// "q1 = shoulder, q2 = elbow", cut after eight.
    fn listed_joints(&self) -> String {
        let mut listed: Vec<String> = self
            .joints
            .iter()
            .take(8)
            .enumerate()
            .map(|(i, joint)| format!("q{} = {joint}", i + 1))
            .collect();
        if self.joints.len() > 8 {
            listed.push("…".to_owned());
        }
        listed.join(", ")
    }

    /// What the writer may have meant.
    fn suggestion(&self, name: &str) -> String {
        if let Some(joint) = self.joints.iter().position(|joint| *joint == name) {
            return format!("joint `{name}` is q{0}, its velocity qd{0}", joint + 1);
        }
        if matches!(name, "abs" | "sign" | "max" | "min") {
            return format!(
                "`{name}` is not twice differentiable; sqrt(x^2 + 1e-6) is a smooth |x|, tanh(x/1e-3) a smooth sign"
            );
        }
        if matches!(name, "ln" | "log10") {
            return "the natural logarithm is `log`".to_owned();
        }
        let lower = name.to_lowercase();
        for prefix in ["dq", "qdot", "qp", "q_dot", "dtheta", "v", "qd_"] {
            if let Some(i) = lower
                .strip_prefix(prefix)
                .filter(|i| !i.is_empty() && i.bytes().all(|b| b.is_ascii_digit()))
            {
                return format!("did you mean `qd{i}`?");
            }
        }
        for prefix in ["theta", "q_", "x", "th", "phi"] {
            if let Some(i) = lower
                .strip_prefix(prefix)
                .filter(|i| !i.is_empty() && i.bytes().all(|b| b.is_ascii_digit()))
            {
                return format!("did you mean `q{i}`?");
            }
        }
        let mut best: Option<(usize, String)> = None;
        let variables =
            (1..=self.joints.len().min(50)).flat_map(|i| [format!("q{i}"), format!("qd{i}")]);
        let known = FUNCTIONS
            .iter()
            .map(|(known, _)| (*known).to_owned())
            .chain(["pi".to_owned()])
            .chain(variables);
        for candidate in known {
            let distance = edit_distance(&lower, &candidate);
            if distance <= 2
                && distance < candidate.len()
                && best.as_ref().is_none_or(|(least, _)| distance < *least)
            {
                best = Some((distance, candidate));
            }
        }
        match best {
            Some((_, candidate)) => format!("did you mean `{candidate}`?"),
            None => format!(
                "known are {}, pi and {}",
                FUNCTIONS.map(|(known, _)| known).join(" "),
                self.listed_joints()
            ),
        }
    }
}

/// Insertions, deletions and exchanges that turn `a` into `b` (Levenshtein); long words are far from everything.
fn edit_distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    if a.len() > 20 {
        return usize::MAX;
    }
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for i in 0..a.len() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for j in 0..b.len() {
            let exchanged = diagonal + usize::from(a[i] != b[j]);
            diagonal = row[j + 1];
            row[j + 1] = exchanged.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}
