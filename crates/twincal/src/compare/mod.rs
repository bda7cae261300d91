//! What changed between two twins of one robot: before and after a collision, a service, a tool change.
//!
//! The two posteriors come from different logs and are independent, so that the difference of a parameter is the
//! difference of independent draws. A component that a twin does not hold is 0 in it.

mod rivals;

use crate::calibrate::{Calibration, Status};
use crate::error::{Code, Error, Finding, Result, Severity};
use crate::posterior::draws::{CoefficientDraws, draw};
use crate::term::{Before, Estimate, Family, Library, Parameter};
use crate::twin::Twin;
use serde::Serialize;

/// Draws of either twin.
const DRAWS: usize = 4000;
/// Random streams of the two; both start from this seed.
const STREAMS: (u64, u64) = ((1 << 32) + 2, (1 << 32) + 3);
const SEED: u64 = 1;
/// A parameter changed if the probability of a change in the other direction, or of none, is below this.
const DOUBT: f64 = 0.01;
/// Probability of friction from which a twin is likely to hold it.
const LIKELY: f64 = 0.2;

/// What became of a component, by its [`Status`] before and after: in where it is established, out where it is absent, unidentifiable or no
/// candidate, open otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Became {
    /// Out before, in after, and a number that differs for certain.
    New,
    /// In before, out after, and a number that differs for certain.
    Gone,
    /// Out before, in or open after, where it is open or no number differs for certain.
    PerhapsNew,
    /// In or open before, out after, where it is open or no number differs for certain.
    PerhapsGone,
    /// It or its rival is in on both sides: one effect under two names, and these logs leave open which.
    OneOfTwo,
    /// In or open on both sides, with another number.
    Changed,
    /// Nothing that these logs can tell.
    AsBefore,
}

impl Became {
    fn of(status: [Option<Status>; 2], changed: bool) -> Self {
        let inside = |side: usize| status[side] == Some(Status::Established);
        let out = |side: usize| is_out(status[side]);
        match [out(0), out(1)] {
            [true, false] if inside(1) && changed => Self::New,
            [false, true] if inside(0) && changed => Self::Gone,
            [true, false] => Self::PerhapsNew,
            [false, true] => Self::PerhapsGone,
            [false, false] if changed => Self::Changed,
            _ => Self::AsBefore,
        }
    }
}

/// Whether a component counts as none.
fn is_out(status: Option<Status>) -> bool {
    use Status::{Absent, Unidentifiable};
    matches!(status, None | Some(Absent | Unidentifiable))
}

/// What became of one component.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Change {
    /// Name of the component.
    pub name: String,
    /// Family.
    pub family: Family,
    /// Physical story: "payload at tool0".
    pub story: String,
    /// New, gone, changed, …
    pub became: Became,
    /// Of [`Became::OneOfTwo`]: the component that stands for it where it is not in.
    pub rival: Option<String>,
    /// False where the numbers of the two are not the same quantity (`coulomb_velocity_differs`).
    pub comparable: bool,
    /// Inclusion probability before and after; `None` where the twin does not have the component.
    pub pip: [Option<f64>; 2],
    /// Status before and after; `None` where the twin does not have the component.
    pub status: [Option<Status>; 2],
    /// True if at least one of its parameters changed with probability above 0.99.
    pub changed: bool,
    /// "payload at tool0: mass +1.740 ± 0.004 kg": the surest differences.
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
    /// The parameter before.
    pub before: Value,
    /// The parameter after.
    pub after: Value,
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

/// A parameter of one twin, 0 in the models that do not hold its component.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Value {
    /// Median.
    pub median: f64,
    /// Central 68.3 % interval.
    pub interval68: [f64; 2],
    /// Central 95 % interval.
    pub interval95: [f64; 2],
}

impl Value {
    /// Of draws.
    fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let at = |level: f64| quantile(&values, level);
        Self {
            median: at(0.5),
            interval68: ONE_SD.map(at),
            interval95: [at(0.025), at(0.975)],
        }
    }
}

/// Levels one standard deviation below and above the middle of a normal distribution.
const ONE_SD: [f64; 2] = [0.158_655, 0.841_345];

/// The value of sorted draws at a level.
fn quantile(sorted: &[f64], level: f64) -> f64 {
    sorted[((sorted.len() as f64 - 1.0) * level).round() as usize]
}

impl ParameterChange {
    /// Half the central 68.3 % interval of the difference: one sd where it is normal.
    #[must_use]
    pub fn spread(&self) -> f64 {
        0.5 * (self.interval68[1] - self.interval68[0])
    }

    /// True where ± would mislead: one arm of the central 68.3 % interval is more than twice the other, or an end of the 95 % interval lies
    /// more than twice as far out as the spread says of a normal distribution.
    #[must_use]
    pub fn lopsided(&self) -> bool {
        let arms = |[low, high]: [f64; 2]| [self.median - low, high - self.median];
        let (near, far) = (arms(self.interval68), arms(self.interval95));
        let (short, long) = (near[0].min(near[1]), near[0].max(near[1]));
        long > 2.0 * short || far[0].max(far[1]) > 2.0 * 1.96 * self.spread()
    }

    /// True if the probability of a change in the other direction, or of none, is below 0.01.
    #[must_use]
    pub fn changed(&self) -> bool {
        self.certainty > 1.0 - DOUBT
    }
}

/// The parameters worth telling, the surest first: those that changed, else the two whose difference is clearest; none where most
/// draws show no difference.
#[must_use]
pub fn surest(parameters: &[ParameterChange]) -> Vec<&ParameterChange> {
    let clearness = |p: &ParameterChange| p.median.abs() / p.spread().max(f64::MIN_POSITIVE);
    let mut order: Vec<&ParameterChange> = (parameters.iter())
        .filter(|p| p.median.is_finite() && (p.median != 0.0 || p.spread() != 0.0))
        .collect();
    order.sort_by(|a, b| clearness(b).total_cmp(&clearness(a)));
    let changed = order.iter().filter(|p| p.changed()).count();
    if changed > 0 {
        order.retain(|p| p.changed());
    } else {
        order.truncate(2);
    }
    order
}

/// Compares `after` with `before`, component by component in the order of `before` and then of what only `after` has.
/// Components that are out on both sides are left out.
///
/// # Errors
/// [`Error::Setting`] with the key `twin` if the twins belong to different robots or a twin is damaged.
///
/// # Example
/// A load of 0.6 kg at the tip is what changed.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::compare::compare;
/// # use twincal::prelude::*;
/// # let (after, robot, mut noise) = (two_link::study()?, two_link::arm(2.0)?, twincal::random::Random::new(11, 0));
/// # let mut settings = Settings { library: after.twin().library.clone(), ..Settings::default() };
/// # settings.signal.cutoff_hz = Auto::Value(0.0);
/// # let log = two_link::log("without", 0.3, &robot, &mut noise);
/// # let before = Calibrate::new(&robot).logs([log]).settings(settings).run()?;
/// let changes = compare(&before, &after)?;
/// let payload = changes.iter().find(|change| change.name == "payload").ok_or("none")?;
/// assert!(payload.changed && (payload.parameters[0].difference - 0.6).abs() < 0.02); // kg
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn compare(before: &Calibration, after: &Calibration) -> Result<Vec<Change>> {
    let components = [&before.components, &after.components];
    let (before, after) = (&before.twin, &after.twin);
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
    let apart = !hindrances(before, after)?.is_empty();
    let sides = [Side::new(before, STREAMS.0)?, Side::new(after, STREAMS.1)?];
    let mut names: Vec<&str> = sides[0].names().collect();
    names.extend(
        sides[1]
            .names()
            .filter(|name| sides[0].find(name).is_none()),
    );
    let mut changes: Vec<Change> = names
        .into_iter()
        .filter_map(|name| {
            let own = components.map(|all| all.iter().find(|own| own.name == name));
            let status = own.map(|own| own.map(|own| own.status));
            change(name, status, &sides, apart)
        })
        .collect();
    rivals::mark(&mut changes, &sides);
    Ok(changes)
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
        "friction reverses within {old} rad/s (m/s) before and {new} after: its numbers differ for that alone; fit both with \
         [library] coulomb_velocity = {old}"
    );
    let (severity, code) = (Severity::Warning, Code::CoulombVelocityDiffers);
    let numbers = [("velocity_before", old), ("velocity_after", new)];
    Ok(vec![
        Finding::new(severity, code, "", message, 0).with(numbers),
    ])
}

/// Whether a twin is likely to hold friction that turns round.
fn turns_round(twin: &Twin) -> Result<bool> {
    let library = twin.library()?;
    let mut columns = library.columns().iter().zip(&twin.posterior.inclusion);
    Ok(columns.any(|(&term, pip)| *pip > LIKELY && library.terms()[term].family.turns_round()))
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

    /// Whether each draw holds a component; never where the twin does not know it.
    fn holds(&self, name: &str) -> Vec<bool> {
        let own = self.find(name).map(|component| self.columns(component));
        let columns: Vec<usize> = own.into_iter().flatten().flatten().collect();
        let beta = |row: usize, k: usize| self.draws.beta[row * self.draws.columns + k];
        let holds = |row| columns.iter().any(|&k| beta(row, k) != 0.0);
        (0..DRAWS).map(holds).collect()
    }

    /// `count` parameters of a component, draw by draw; all 0 where the twin does not know it.
    fn table(&self, component: Option<usize>, count: usize) -> Vec<Vec<f64>> {
        let Some(component) = component else {
            return vec![vec![0.0; count]; DRAWS];
        };
        let columns = self.columns(component);
        let row = |row| self.values(component, &columns, row);
        (0..DRAWS).map(row).collect()
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

/// What became of a component; `apart` where friction reverses within another velocity.
fn change(
    name: &str,
    status: [Option<Status>; 2],
    sides: &[Side; 2],
    apart: bool,
) -> Option<Change> {
    let at = [sides[0].find(name), sides[1].find(name)];
    let pip = [0, 1].map(|side| at[side].and_then(|component| sides[side].pip(component)));
    if status.into_iter().all(is_out) {
        return None;
    }
    let (library, component) = match at {
        [Some(component), _] => (&sides[0].library, component),
        [None, component] => (&sides[1].library, component?),
    };
    let parameters = library.parameters(component);
    let table = [0, 1].map(|side: usize| sides[side].table(at[side], parameters.len()));
    let table = without_rounding(table, &parameters);
    // A payload's first moments are its mass and centre once more.
    let twice = |name: &str| {
        let family = library.components()[component].family;
        family == Family::Payload && matches!(name, "mx" | "my" | "mz")
    };
    let parameters: Vec<ParameterChange> = parameters
        .into_iter()
        .enumerate()
        .filter(|(p, own)| {
            !twice(&own.name) && library.before(component, *p) != Some(Before::Hidden)
        })
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
    let changed = parameters.iter().any(ParameterChange::changed);
    let component = &library.components()[component];
    Some(Change {
        name: name.to_owned(),
        family: component.family,
        story: component.story.clone(),
        became: Became::of(status, changed),
        rival: None,
        comparable: !(apart && component.family.turns_round()),
        pip,
        status,
        changed,
        words: words(&component.story, component.family, &parameters),
        parameters,
    })
}

/// Share of the largest number of the same unit below which a number is what rounding leaves of zero.
const ROUNDING: f64 = 1e-12;

/// Draws of a component's parameters before and after, what is rounding alone set to zero.
fn without_rounding(mut table: [Vec<Vec<f64>>; 2], parameters: &[Parameter]) -> [Vec<Vec<f64>>; 2] {
    let size = |p: usize| -> f64 {
        let alike = |k: &usize| parameters[*k].unit == parameters[p].unit;
        let alike: Vec<usize> = (0..parameters.len()).filter(alike).collect();
        let rows = table.iter().flatten();
        let sizes = rows.flat_map(|row| alike.iter().map(|k| row[*k].abs()));
        sizes.fold(0.0, f64::max)
    };
    let sizes: Vec<f64> = (0..parameters.len()).map(size).collect();
    for row in table.iter_mut().flatten() {
        for (value, size) in row.iter_mut().zip(&sizes) {
            if value.abs() < ROUNDING * size {
                *value = 0.0;
            }
        }
    }
    table
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
    let at = |level: f64| quantile(&difference, level);
    let share =
        |test: fn(f64) -> bool| difference.iter().filter(|d| test(**d)).count() as f64 / count;
    ParameterChange {
        name,
        unit,
        mean: [mean(&before), mean(&after)],
        before: Value::of(before),
        after: Value::of(after),
        difference: centre,
        sd: (square / (count - 1.0)).sqrt(),
        interval95: [at(0.025), at(0.975)],
        median: at(0.5),
        interval68: ONE_SD.map(at),
        certainty: share(|d| d > 0.0).max(share(|d| d < 0.0)),
    }
}

/// The surest changes of a component in one sentence.
fn words(story: &str, family: Family, parameters: &[ParameterChange]) -> String {
    let mut order = surest(parameters);
    order.truncate(2);
    let told: Vec<String> = order
        .iter()
        .map(|p| {
            let name = if p.name == "value" {
                String::new()
            } else {
                format!("{} ", p.name.replace('_', " "))
            };
            let (factor, unit) = family.told_in(&p.unit);
            let difference = Estimate {
                name: p.name.clone(),
                unit: unit.to_owned(),
                value: factor * p.median,
                spread: factor * p.spread(),
                ends: None,
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

    #[test]
    fn what_rounding_leaves_of_zero_is_no_difference() {
        let parameter = |name: &str, unit: &str| Parameter {
            name: name.into(),
            unit: unit.into(),
        };
        let all = [
            parameter("mass", "kg"),
            parameter("ixx", "kg·m²"),
            parameter("ixy", "kg·m²"),
        ];
        let after = vec![vec![1.0, 6e-4, 7e-36], vec![1.1, 5e-4, 6e-36]];
        let before = vec![vec![0.0; 3]; 2];
        let [_, after] = without_rounding([before, after], &all);
        assert_eq!(after, [[1.0, 6e-4, 0.0], [1.1, 5e-4, 0.0]]);
    }

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
            words("payload", Family::Payload, &[unseen.clone(), change]),
            "payload: mass +1.50 ± 0.34 kg"
        );
        assert_eq!(
            words("payload", Family::Payload, &[unseen]),
            "payload: no difference"
        );
    }

    /// Of a normal distribution ± is all there is to say; of one with a tenth of its draws far below, and of one that ends where most of its
    /// draws lie, it is not.
    #[test]
    fn an_interval_of_which_one_side_is_longer_is_lopsided() {
        let of = |draws: Vec<f64>| {
            let none = vec![0.0; draws.len()];
            parameter_change("value".into(), "N·m".into(), none, draws).lopsided()
        };
        // Logistic quantiles: symmetric, 95 % at 2.15 instead of 1.96 spreads.
        let even = |i: i32| {
            let p = (f64::from(i) + 0.5) / 1000.0;
            6.8 + (p / (1.0 - p)).ln()
        };
        assert!(!of((0..1000).map(even).collect()));
        let split = |i: i32| if i < 100 { -8.0 } else { even(i) };
        assert!(of((0..1000).map(split).collect()));
        let square = |i: i32| (f64::from(i) / 1000.0).powi(3);
        assert!(of((0..1000).map(square).collect()));
        assert!(!of(vec![0.0; 1000]));
    }

    #[test]
    fn what_became_of_a_component_follows_from_both_statuses() {
        use Status::{Absent, Equivalent, Established, Tentative, Unidentifiable};
        for (before, after, changed, became) in [
            (Some(Absent), Some(Established), true, Became::New),
            (None, Some(Established), true, Became::New),
            (None, Some(Established), false, Became::PerhapsNew),
            (Some(Established), Some(Absent), false, Became::PerhapsGone),
            (Some(Established), None, true, Became::Gone),
            (Some(Established), Some(Unidentifiable), true, Became::Gone),
            (Some(Absent), Some(Tentative), true, Became::PerhapsNew),
            (Some(Equivalent), Some(Absent), false, Became::PerhapsGone),
            (Some(Tentative), Some(Established), true, Became::Changed),
            (Some(Tentative), Some(Equivalent), false, Became::AsBefore),
            (Some(Established), Some(Established), true, Became::Changed),
            (
                Some(Established),
                Some(Established),
                false,
                Became::AsBefore,
            ),
        ] {
            let found = Became::of([before, after], changed);
            assert_eq!(found, became, "{before:?} → {after:?}");
        }
    }

    #[test]
    fn parts_are_told_in_per_cent_and_centres_of_mass_in_millimetres() {
        let told = |name: &str, unit: &str, family| {
            let draws: Vec<f64> = (0..101).map(|i| 0.02 + 1e-5 * f64::from(i)).collect();
            let change = parameter_change(name.into(), unit.into(), vec![0.0; 101], draws);
            words("it", family, &[change])
        };
        assert_eq!(
            told("value", "1", Family::LoadFriction),
            "it: +2.050 ± 0.034 %"
        );
        assert_eq!(
            told("com_x", "m", Family::Payload),
            "it: com x +20.50 ± 0.34 mm"
        );
        assert_eq!(
            told("value", "rad", Family::EncoderZero),
            "it: +1.175 ± 0.019 °"
        );
    }
}
