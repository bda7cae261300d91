//! A component with its parameters in one sentence.

use super::component::Component;
use super::family::CLEAR;
use super::words::estimate;
use super::{Family, words};
use std::f64::consts::TAU;

/// A parameter's value with its spread, as it goes into a sentence.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// `mass`, `com_x`, `stiffness`, …
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Median; NaN where no joint shows it or no model holds it.
    pub value: f64,
    /// Half the width of the central 68.3 % interval.
    pub spread: f64,
    /// Its two ends, where ± does not describe it.
    pub ends: Option<[f64; 2]>,
}

impl Estimate {
    /// The number alone, times `factor`.
    fn number(&self, factor: f64) -> String {
        match self.ends {
            None => estimate(factor * self.value, factor * self.spread),
            Some(ends) => words::with_ends(factor * self.value, ends.map(|end| factor * end)),
        }
    }
}

impl std::fmt::Display for Estimate {
    /// "+1.740 ± 0.004 kg".
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let unit = if self.unit == "1" { "" } else { &self.unit };
        write!(f, "{} {unit}", self.number(1.0))
    }
}

/// Parameters of a component that are told at most; the rest stands in the tables.
const TOLD: usize = 3;

/// "payload at tool0: +1.200 ± 0.030 kg, centre of mass (0, 2, 61) ± 4 mm".
pub(super) fn sentence(component: &Component, parameters: &[Estimate]) -> String {
    if !parameters.iter().any(|p| p.value.is_finite()) {
        return format!("{}: {}", component.story, words::NO_MODEL);
    }
    let text = match component.family {
        Family::Payload => payload(parameters),
        Family::Gain => parameters.first().map(drive).unwrap_or_default(),
        Family::LoadFriction | Family::Density => parameters
            .first()
            .map(|p| format!("{} %", p.number(100.0)))
            .unwrap_or_default(),
        Family::EncoderZero => (parameters.first())
            .map(|p| format!("joint zero {}", angle(p)))
            .unwrap_or_default(),
        Family::Tilt => tilt(parameters),
        _ if parameters.len() == 1 => one(&parameters[0]),
        family => several(family, parameters),
    };
    let remark = parameters
        .first()
        .and_then(|p| component.family.remark(p.value, p.spread));
    let remark = remark.map_or_else(String::new, |remark| format!(" ({remark})"));
    format!("{}: {text}{remark}", component.story)
}

/// "drive constant × 1.050 ± 0.004".
fn drive(p: &Estimate) -> String {
    let factor = Estimate {
        value: 1.0 + p.value,
        ends: p.ends.map(|ends| ends.map(|end| 1.0 + end)),
        ..p.clone()
    };
    let number = factor.number(1.0);
    format!("drive constant × {}", number.trim_start_matches('+'))
}

fn one(p: &Estimate) -> String {
    format!("{} {}", p.number(1.0), p.unit)
}

/// Indices of the parameters that are worth telling, in their order: of a payload its mass, and where that is clear its centre, or its first
/// moments where no mass is known; of a tilt all; of any
/// other component the clearest three that are further from 0 than two spreads, at least one. None where no value is known.
#[must_use]
pub fn told(family: Family, parameters: &[Estimate]) -> Vec<usize> {
    let known = |p: &&usize| parameters[**p].value.is_finite();
    let all: Vec<usize> = (0..parameters.len()).collect();
    match family {
        Family::Payload => {
            let clear = parameters
                .first()
                .is_some_and(|mass| clearness(mass) >= CLEAR);
            let centre = all.iter().take(CENTRE_ENDS).skip(1).filter(known).copied();
            let mass = all.iter().take(1).filter(known).copied();
            let open = parameters.first().is_none_or(|mass| mass.value.is_nan());
            let moments = all.iter().skip(MOMENTS).filter(known).copied();
            let moments = moments.filter(|_| open);
            mass.chain(centre.filter(|_| clear))
                .chain(moments)
                .collect()
        }
        Family::Tilt => all.iter().filter(known).copied().collect(),
        Family::Spring => {
            let mut order = of_spring(parameters);
            order.sort_unstable();
            order
        }
        _ => {
            let mut order = clearest(parameters);
            order.sort_unstable();
            order
        }
    }
}

/// A payload's mass is its first parameter, its centre of mass the next three.
const CENTRE_ENDS: usize = 4;
/// Its first moments are its last parameters.
const MOMENTS: usize = 10;

fn clearness(p: &Estimate) -> f64 {
    p.value.abs() / p.spread.max(f64::MIN_POSITIVE)
}

/// The parameters worth telling, the clearest first.
fn clearest(parameters: &[Estimate]) -> Vec<usize> {
    let clear = |p: usize| clearness(&parameters[p]);
    let known = |p: &usize| parameters[*p].value.is_finite();
    let mut order: Vec<usize> = (0..parameters.len()).filter(known).collect();
    order.sort_by(|&a, &b| clear(b).total_cmp(&clear(a)));
    let count = order.iter().filter(|&&p| clear(p) > CLEAR).count();
    order.truncate(count.clamp(1, TOLD));
    order
}

/// Those of a spring: its rest position where a joint may stand there, else its preload.
fn of_spring(parameters: &[Estimate]) -> Vec<usize> {
    let [_, rest, _] = parameters else {
        return clearest(parameters);
    };
    let left_out = if is_place(rest) { 2 } else { 1 };
    let mut own = clearest(parameters);
    own.retain(|p| *p != left_out);
    match own.is_empty() {
        true => vec![0],
        false => own,
    }
}

/// Whether a joint may stand at a spring's rest position: within a turn of zero (or 2π m), and known to one rad (or m).
#[must_use]
pub fn is_place(rest: &Estimate) -> bool {
    rest.value.abs() <= TAU && rest.spread <= KNOWN_PLACE
}

/// Spread up to which a rest position is a place, rad or m.
const KNOWN_PLACE: f64 = 1.0;

/// The clearest parameters by name.
fn several(family: Family, parameters: &[Estimate]) -> String {
    let order = match family {
        Family::Spring => of_spring(parameters),
        _ => clearest(parameters),
    };
    let told: Vec<String> = (order.into_iter())
        .map(|p| &parameters[p])
        .map(|p| format!("{} {}", p.name.replace('_', " "), one(p)))
        .collect();
    told.join(", ")
}

/// Torque of a payload may be known where its mass is not: on a joint that turns about its centre, or beside what weighs the same.
const MASS_NOT_SEEN: &str = "mass not seen by these data";

fn payload(parameters: &[Estimate]) -> String {
    let Some((mass, rest)) = parameters.split_first() else {
        return String::new();
    };
    let com = &rest[..(CENTRE_ENDS - 1).min(rest.len())];
    if mass.value.is_nan() {
        let moments = rest.iter().skip(MOMENTS - 1);
        let moments: Vec<String> = moments
            .filter(|p| p.value.is_finite())
            .map(|p| format!("{} {}", p.name, one(p)))
            .collect();
        return match moments.is_empty() {
            true => MASS_NOT_SEEN.into(),
            false => format!("{MASS_NOT_SEEN}, first moments {}", moments.join(", ")),
        };
    }
    let mass_text = one(mass);
    // Without a clear mass there is no centre of it.
    if told(Family::Payload, parameters).len() < 2 {
        return mass_text;
    }
    format!("{mass_text}, centre of mass {} mm", place(com))
}

/// A place in mm: "(0, 2, 61) ± 4"; where some coordinate is known by far better than another "(20 ± 1, 1 ± 11, 59 ± 1)".
fn place(coordinates: &[Estimate]) -> String {
    let shown = |spread: f64| format!("{spread:.*}", usize::from(spread < 1.0));
    let spreads = || coordinates.iter().map(|c| 1e3 * c.spread);
    let spreads = || spreads().filter(|spread| spread.is_finite());
    let worst = spreads().fold(0.0, f64::max);
    let apart = worst > UNEVEN * spreads().fold(f64::INFINITY, f64::min);
    let one = |c: &Estimate| match (1e3 * c.value).round() {
        // Minus zero is zero.
        value if value.is_finite() && apart => {
            format!("{} ± {}", value + 0.0, shown(1e3 * c.spread))
        }
        value if value.is_finite() => format!("{}", value + 0.0),
        _ => "–".into(), // no joint shows it
    };
    let all: Vec<String> = coordinates.iter().map(one).collect();
    match apart {
        true => format!("({})", all.join(", ")),
        false => format!("({}) ± {}", all.join(", "), shown(worst)),
    }
}

/// Ratio of the largest to the smallest spread of coordinates from which each has its own.
const UNEVEN: f64 = 3.0;

fn angle(p: &Estimate) -> String {
    if p.unit == "m" {
        return format!("{} mm", p.number(1e3));
    }
    format!(
        "{}°",
        estimate(p.value.to_degrees(), p.spread.to_degrees()).replace(" ± ", "° ± ")
    )
}

fn tilt(parameters: &[Estimate]) -> String {
    let values: Vec<String> = parameters
        .iter()
        .filter(|p| p.value.is_finite()) // the others no joint shows
        .map(|p| format!("{} {}", p.name, p.number(1.0)))
        .collect();
    format!("{} m/s²", values.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn component(family: Family, story: &str) -> Component {
        Component {
            name: story.into(),
            family,
            story: story.into(),
            terms: vec![0],
            alias_of: Vec::new(),
        }
    }

    fn estimates(values: &[(&str, &str, f64, f64)]) -> Vec<Estimate> {
        let one = |&(name, unit, value, spread): &(&str, &str, f64, f64)| Estimate {
            name: name.into(),
            unit: unit.into(),
            value,
            spread,
            ends: None,
        };
        values.iter().map(one).collect()
    }

    #[test]
    fn a_payload_has_mass_and_centre() {
        let parameters = estimates(&[
            ("mass", "kg", 1.2, 0.03),
            ("com_x", "m", 0.0, 0.002),
            ("com_y", "m", 0.002, 0.003),
            ("com_z", "m", 0.061, 0.004),
        ]);
        assert_eq!(
            sentence(&component(Family::Payload, "payload at tool0"), &parameters),
            "payload at tool0: +1.200 ± 0.030 kg, centre of mass (0, 2, 61) ± 4 mm"
        );
    }

    #[test]
    fn a_coordinate_that_is_known_worse_has_its_own_spread() {
        let parameters = estimates(&[
            ("mass", "kg", 1.2, 0.03),
            ("com_x", "m", 0.02, 0.0006),
            ("com_y", "m", -0.0001, 0.011),
            ("com_z", "m", 0.059, 0.0012),
        ]);
        let payload = component(Family::Payload, "payload at tool0");
        assert_eq!(
            sentence(&payload, &parameters),
            "payload at tool0: +1.200 ± 0.030 kg, centre of mass (20 ± 0.6, 0 ± 11, 59 ± 1) mm"
        );
    }

    #[test]
    fn what_no_joint_shows_has_no_number() {
        let parameters = estimates(&[
            ("mass", "kg", 1.2, 0.03),
            ("com_x", "m", 0.002, 0.002),
            ("com_y", "m", f64::NAN, f64::NAN),
            ("com_z", "m", 0.061, 0.004),
        ]);
        let payload = component(Family::Payload, "payload at tool0");
        assert_eq!(
            sentence(&payload, &parameters),
            "payload at tool0: +1.200 ± 0.030 kg, centre of mass (2, –, 61) ± 4 mm"
        );
        let tilt = estimates(&[("x", "m/s²", 0.2, 0.01), ("y", "m/s²", f64::NAN, f64::NAN)]);
        assert_eq!(
            sentence(&component(Family::Tilt, "gravity"), &tilt),
            "gravity: x +0.200 ± 0.010 m/s²"
        );
        let no_mass = estimates(&[
            ("mass", "kg", f64::NAN, f64::NAN),
            ("com_x", "m", 0.002, 0.002),
        ]);
        assert_eq!(
            sentence(&payload, &no_mass),
            "payload at tool0: mass not seen by these data"
        );
        let mut skewed = estimates(&[("value", "N·m", 293.9, 46.8)]);
        skewed[0].ends = Some([284.5, 378.1]);
        assert_eq!(
            sentence(&component(Family::Coulomb, "friction on a"), &skewed),
            "friction on a: +294 (284 … 378) N·m"
        );
        let nothing = estimates(&[("value", "N·m", f64::NAN, f64::NAN)]);
        assert_eq!(
            sentence(&component(Family::Offset, "offset on a"), &nothing),
            "offset on a: in no model that counts"
        );
    }

    #[test]
    fn a_spring_has_a_rest_position_only_where_a_joint_may_stand_there() {
        let spring = |rest: (f64, f64), preload: (f64, f64)| {
            let parameters = estimates(&[
                ("stiffness", "N·m/rad", 0.144, 0.016),
                ("rest_position", "rad", rest.0, rest.1),
                ("preload", "N·m", preload.0, preload.1),
            ]);
            let spring = component(Family::Spring, "spring on a");
            let by_name: Vec<&str> = (told(Family::Spring, &parameters).into_iter())
                .map(|p| parameters[p].name.as_str())
                .collect();
            (sentence(&spring, &parameters), by_name.join(" "))
        };
        let (words, told) = spring((-0.88, 0.17), (0.127, 0.02));
        assert!(words.ends_with("rest position -0.88 ± 0.17 rad"), "{words}");
        assert_eq!(told, "stiffness rest_position");
        let (words, told) = spring((-13.0, 0.6), (0.753, 0.032));
        assert_eq!(
            words,
            "spring on a: preload +0.753 ± 0.032 N·m, stiffness +0.144 ± 0.016 N·m/rad"
        );
        assert_eq!(told, "stiffness preload");
        let (_, told) = spring((-4.0, 1.4), (0.01, 0.032));
        assert_eq!(told, "stiffness");
    }

    #[test]
    fn the_clearest_parameters_are_told() {
        let parameters = estimates(&[
            ("ixx", "kg·m²", 0.001, 0.01),
            ("izz", "kg·m²", 0.5, 0.01),
            ("iyy", "kg·m²", -0.1, 0.01),
        ]);
        assert_eq!(
            sentence(
                &component(Family::Tensor, "inertia tensor of arm"),
                &parameters
            ),
            "inertia tensor of arm: izz +0.500 ± 0.010 kg·m², iyy -0.100 ± 0.010 kg·m²"
        );
    }

    #[test]
    fn a_sign_is_explained_where_it_is_known() {
        let of = |value, spread| {
            let parameters = estimates(&[("value", "N·m", value, spread)]);
            sentence(
                &component(Family::Stribeck, "Stribeck friction on a"),
                &parameters,
            )
        };
        assert!(of(-11.5, 0.8).ends_with("(negative: friction grows with speed here)"));
        assert!(of(-1.1, 2.1).ends_with("N·m"));
    }

    #[test]
    fn a_table_tells_what_the_sentence_tells() {
        let of = |family, values: &[(f64, f64)]| {
            let one = |&(value, spread): &(f64, f64)| ("p", "kg", value, spread);
            told(
                family,
                &estimates(&values.iter().map(one).collect::<Vec<_>>()),
            )
        };
        let body = [
            (1.2, 0.03),
            (0.0, 0.002),
            (f64::NAN, 0.0),
            (0.06, 0.004),
            (5.0, 0.1),
        ];
        assert_eq!(of(Family::Payload, &body), [0, 1, 3]);
        assert_eq!(of(Family::Payload, &[(0.1, 0.2), (0.06, 0.004)]), [0]);
        assert_eq!(
            of(Family::Tilt, &[(0.1, 0.2), (f64::NAN, 0.0), (0.3, 0.2)]),
            [0, 2]
        );
        let moments = [
            (1.0, 1.0),
            (-30.0, 1.0),
            (2.5, 1.0),
            (40.0, 1.0),
            (3.0, 1.0),
        ];
        assert_eq!(of(Family::MassMoments, &moments), [1, 3, 4]);
        assert_eq!(of(Family::MassMoments, &[(0.1, 1.0), (0.2, 1.0)]), [1]);
        assert_eq!(of(Family::MassMoments, &[(f64::NAN, 1.0)]), [0; 0]);
        assert_eq!(of(Family::Payload, &[]), [0; 0]);
    }

    #[test]
    fn drive_constants_are_factors_and_joint_zeros_degrees() {
        let gain = estimates(&[("value", "1", 0.05, 0.01)]);
        assert_eq!(
            sentence(&component(Family::Gain, "torque gain of a"), &gain),
            "torque gain of a: drive constant × 1.050 ± 0.010"
        );
        let zero = estimates(&[("value", "rad", 0.0175, 0.00175)]);
        assert_eq!(
            sentence(&component(Family::EncoderZero, "zero position of a"), &zero),
            "zero position of a: joint zero +1.00° ± 0.10°"
        );
    }
}
