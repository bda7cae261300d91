//! What changed between two twins of one robot: before and after a collision, a service, a tool change.
//!
//! The two posteriors come from different logs and are independent, so that the difference of a parameter is the
//! difference of independent draws. A component that a twin does not hold is 0 in it.

use crate::error::{Error, Finding, Result, Severity};
use crate::posterior::draws::{CoefficientDraws, draw};
use crate::term::{Estimate, Family, Library};
use crate::twin::Twin;
use serde::Serialize;

/// Draws of either twin.
const DRAWS: usize = 4000;
/// Random streams of the two; both start from this seed.
const STREAMS: (u64, u64) = ((1 << 32) + 2, (1 << 32) + 3);
const SEED: u64 = 1;
/// A parameter changed if the probability of a change in the other direction, or of none, is below this.
const DOUBT: f64 = 0.01;
/// Probability of a component that makes it worth comparing.
const WORTH_COMPARING: f64 = 0.2;

/// What became of one component.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Change {
    /// Name of the component.
    pub name: String,
    /// Family.
    pub family: Family,
    /// Inclusion probability before and after; `None` where the twin does not have the component.
    pub pip: [Option<f64>; 2],
    /// True if at least one of its parameters changed with probability above 0.99.
    pub changed: bool,
    /// "payload at tool0: mass +0.000 → +1.740 kg (+1.740 ± 0.004)".
    pub words: String,
    /// Parameters in their order.
    pub parameters: Vec<ParameterChange>,
}

/// What became of one parameter: means over structures and coefficients, 0 where the component is not in.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterChange {
    /// `mass`, `stiffness`, …
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Mean before and after.
    pub mean: [f64; 2],
    /// Mean of the difference, after − before.
    pub difference: f64,
    /// Its sd.
    pub sd: f64,
    /// Its central 95 % interval.
    pub interval95: [f64; 2],
    /// Its median: what the words tell.
    pub median: f64,
    /// Its central 68.3 % interval; half its width stands behind ± in the words.
    pub interval68: [f64; 2],
    /// The larger of P(difference > 0) and P(difference < 0).
    pub certainty: f64,
}

/// Compares `after` with `before`, component by component in the order of `before` and then of what only `after` has.
/// Components that neither twin gives a probability of 0.2 are left out.
///
/// # Errors
/// [`Error::Setting`] with the key `twin` if the twins belong to different robots or a twin is damaged.
pub fn compare(before: &Twin, after: &Twin) -> Result<Vec<Change>> {
    if before.robot.joint_names() != after.robot.joint_names() {
        return Err(Error::Setting {
            key: "twin".into(),
            problem: format!(
                "the twins belong to different robots, with joints {} and {}",
                before.robot.joint_names().join(", "),
                after.robot.joint_names().join(", ")
            ),
            remedy: "give two twins of the same robot".into(),
        });
    }
    let sides = [Side::new(before, STREAMS.0)?, Side::new(after, STREAMS.1)?];
    let mut names: Vec<&str> = sides[0].names().collect();
    names.extend(
        sides[1]
            .names()
            .filter(|name| sides[0].find(name).is_none()),
    );
    Ok(names
        .into_iter()
        .filter_map(|name| change(name, &sides))
        .collect())
}

/// What has to be known before two twins are compared: friction that turns round within another velocity is another column, and its number
/// is not the same.
///
/// # Errors
/// [`Error::Setting`] if a twin is damaged.
pub fn hindrances(before: &Twin, after: &Twin) -> Result<Vec<Finding>> {
    let [old, new] = [before, after].map(|twin| twin.library.coulomb_velocity);
    if old == new || !turns_round(before)? || !turns_round(after)? {
        return Ok(Vec::new());
    }
    let message = format!(
        "friction turns round within {old} rad/s (m/s) before and {new} after: its numbers differ for that alone; fit both with \
         [library] coulomb_velocity = {old}"
    );
    Ok(vec![Finding::new(
        Severity::Warning,
        "coulomb_velocity_differs",
        "",
        message,
        0,
    )])
}

/// Whether a twin is likely to hold friction that turns round.
fn turns_round(twin: &Twin) -> Result<bool> {
    let library = twin.library()?;
    let mut columns = library.columns().iter().zip(&twin.posterior.inclusion);
    Ok(columns
        .any(|(&term, pip)| *pip > WORTH_COMPARING && library.terms()[term].family.turns_round()))
}

/// A twin with its library and draws.
struct Side {
    library: Library,
    draws: CoefficientDraws,
    inclusion: Vec<f64>,
}

impl Side {
    fn new(twin: &Twin, stream: u64) -> Result<Self> {
        Ok(Self {
            library: twin.library()?,
            draws: draw(&twin.posterior, DRAWS, SEED, stream),
            inclusion: twin.posterior.inclusion.clone(),
        })
    }

    fn names(&self) -> impl Iterator<Item = &str> {
        self.library.components().iter().map(|c| c.name.as_str())
    }

    fn find(&self, name: &str) -> Option<usize> {
        self.library
            .components()
            .iter()
            .position(|c| c.name == name)
    }

    /// Column of each term of a component.
    fn columns(&self, component: usize) -> Vec<Option<usize>> {
        let terms = self.library.components()[component].terms.iter();
        let column = |term: &usize| self.library.columns().iter().position(|c| c == term);
        terms.map(column).collect()
    }

    fn pip(&self, component: usize) -> Option<f64> {
        let first = self.columns(component).into_iter().flatten().next()?;
        Some(self.inclusion[first])
    }

    /// Parameters of a component in one draw; all 0 where it is not in.
    fn values(&self, component: usize, columns: &[Option<usize>], row: usize) -> Vec<f64> {
        let value = |column: &Option<usize>| {
            column.map_or(0.0, |k| self.draws.beta[row * self.draws.columns + k])
        };
        let beta: Vec<f64> = columns.iter().map(value).collect();
        if beta.iter().all(|b| *b == 0.0) {
            return vec![0.0; self.library.parameters(component).len()];
        }
        self.library.parameter_values(component, &beta)
    }
}

fn change(name: &str, sides: &[Side; 2]) -> Option<Change> {
    let at = [sides[0].find(name), sides[1].find(name)];
    let pip = [0, 1].map(|side| at[side].and_then(|component| sides[side].pip(component)));
    if pip.iter().all(|pip| pip.unwrap_or(0.0) < WORTH_COMPARING) {
        return None;
    }
    let (library, component) = match at {
        [Some(component), _] => (&sides[0].library, component),
        [None, component] => (&sides[1].library, component?),
    };
    let parameters = library.parameters(component);
    let table = [0, 1].map(|side: usize| -> Vec<Vec<f64>> {
        let rows = 0..DRAWS;
        match at[side] {
            Some(component) => {
                let columns = sides[side].columns(component);
                rows.map(|row| sides[side].values(component, &columns, row))
                    .collect()
            }
            None => rows.map(|_| vec![0.0; parameters.len()]).collect(),
        }
    });
    let parameters: Vec<ParameterChange> = parameters
        .into_iter()
        .enumerate()
        .map(|(p, parameter)| {
            let of = |side: usize| table[side].iter().map(move |row| row[p]);
            parameter_change(
                parameter.name,
                parameter.unit,
                of(0).collect(),
                of(1).collect(),
            )
        })
        .collect();
    let changed = parameters.iter().any(|p| p.certainty > 1.0 - DOUBT);
    let words = words(&library.components()[component].story, &parameters);
    Some(Change {
        name: name.to_owned(),
        family: library.components()[component].family,
        pip,
        changed,
        words,
        parameters,
    })
}

fn parameter_change(
    name: String,
    unit: String,
    before: Vec<f64>,
    after: Vec<f64>,
) -> ParameterChange {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let mut difference: Vec<f64> = after.iter().zip(&before).map(|(a, b)| a - b).collect();
    difference.sort_by(f64::total_cmp);
    let count = difference.len() as f64;
    let centre = mean(&difference);
    let square: f64 = difference.iter().map(|d| (d - centre) * (d - centre)).sum();
    let quantile = |level: f64| difference[((count - 1.0) * level).round() as usize];
    let share =
        |test: fn(f64) -> bool| difference.iter().filter(|d| test(**d)).count() as f64 / count;
    ParameterChange {
        name,
        unit,
        mean: [mean(&before), mean(&after)],
        difference: centre,
        sd: (square / (count - 1.0)).sqrt(),
        interval95: [quantile(0.025), quantile(0.975)],
        median: quantile(0.5),
        interval68: [quantile(0.158_655), quantile(0.841_345)],
        certainty: share(|d| d > 0.0).max(share(|d| d < 0.0)),
    }
}

/// The surest changes of a component in one sentence.
fn words(story: &str, parameters: &[ParameterChange]) -> String {
    let spread = |p: &ParameterChange| 0.5 * (p.interval68[1] - p.interval68[0]);
    let clearness = |p: &ParameterChange| p.median.abs() / spread(p).max(f64::MIN_POSITIVE);
    let mut order: Vec<&ParameterChange> = parameters
        .iter()
        .filter(|p| p.median.is_finite() && (p.median != 0.0 || spread(p) != 0.0))
        .collect();
    order.sort_by(|a, b| clearness(b).total_cmp(&clearness(a)));
    order.truncate(2);
    let told: Vec<String> = order
        .iter()
        .map(|p| {
            let name = if p.name == "value" {
                String::new()
            } else {
                format!("{} ", p.name.replace('_', " "))
            };
            let difference = Estimate {
                name: p.name.clone(),
                unit: p.unit.clone(),
                value: p.median,
                spread: spread(p),
            };
            format!("{name}{difference}")
        })
        .collect();
    if told.is_empty() {
        return format!("{story}: no difference");
    }
    format!("{story}: {}", told.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A thousand draws between 1 and 2 and one far off: the sd is that one's doing, the words are not.
    #[test]
    fn one_draw_far_off_moves_the_sd_and_not_the_words() {
        let mut after: Vec<f64> = (0..1001).map(|i| 1.0 + 0.001 * f64::from(i)).collect();
        after[1000] = 1e4;
        let change = parameter_change("mass".into(), "kg".into(), vec![0.0; 1001], after);
        assert!(change.sd > 300.0, "{change:?}");
        // The uniform distribution on 1 … 2: median 1.5, central 68.3 % ± 0.3415.
        let unseen = parameter_change("com_x".into(), "m".into(), vec![0.0; 9], vec![0.0; 9]);
        assert_eq!(
            words("payload", &[unseen.clone(), change]),
            "payload: mass +1.50 ± 0.34 kg"
        );
        assert_eq!(words("payload", &[unseen]), "payload: no difference");
    }
}
