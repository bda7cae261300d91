//! What a fleet's posterior says, in sentences and cells of tables.

use super::number::{number, probability, with_sd};
use super::utc;
use twincal::fleet::{DeviationSummary, FleetResult, Value, WindowSpan};
use twincal::posterior::CHAINS_APART;

/// Half of a central 95 % interval of a normal distribution, in standard deviations.
const HALF_OF_95: f64 = 1.96;

/// One sentence: how many robots deviate.
#[must_use]
pub fn headline(result: &FleetResult) -> String {
    let all = result.units.len();
    let named = result.units.iter().filter(|unit| unit.deviates).count();
    match named {
        0 => format!("None of {all} robots is named as deviating from its type."),
        1 => format!("1 of {all} robots deviates from its type."),
        n => format!("{n} of {all} robots deviate from their type."),
    }
}

/// What is wrong for all: one sentence.
#[must_use]
pub fn of_type(result: &FleetResult) -> String {
    let sure = result.type_effects.iter().filter(|own| own.pip >= 0.5);
    match sure.count() {
        0 => "No effect that all robots have in common is more likely than not.".into(),
        1 => "The model file misses 1 effect that all robots have in common.".into(),
        n => format!("The model file misses {n} effects that all robots have in common."),
    }
}

/// The parameter that stands for an effect: a mass where there is one, else the first.
#[must_use]
pub fn main_value(values: &[Value]) -> Option<&Value> {
    let mass = values
        .iter()
        .find(|own| own.name == "mass" || own.name == "m");
    mass.or(values.first())
}

/// A value with its 95 % interval: "3.276 N·m (95 %: 3.241–3.310)".
#[must_use]
pub fn value(own: &Value) -> String {
    let [low, high] = own.interval95;
    let sd = 0.5 * (high - low) / HALF_OF_95;
    let [value, low, high] = [own.value, low, high].map(|x| with_sd(x, sd).0);
    let unit = match own.unit.as_str() {
        "1" => String::new(),
        unit => format!(" {unit}"),
    };
    format!("{value}{unit} (95 %: {low} to {high})")
}

/// The same of a difference, with its sign.
#[must_use]
pub fn difference(own: &Value) -> String {
    let sign = if own.value > 0.0 { "+" } else { "" };
    format!("{sign}{}", value(own))
}

/// Since when a robot deviates.
#[must_use]
pub fn since(own: &DeviationSummary) -> String {
    match own.since {
        Some(span) => format!("since {}", day(span)),
        None => "from its first window on".into(),
    }
}

/// What makes the answer doubtful: chains that disagree.
#[must_use]
pub fn doubt(result: &FleetResult) -> Option<String> {
    (result.spread > CHAINS_APART).then(|| {
        format!(
            "The chains differ by up to {:.2} in the probability of a robot: read probabilities as that uncertain.",
            result.spread
        )
    })
}

/// When a window starts: `2026-01-19`, and the time where that is not midnight.
#[must_use]
pub fn day(span: WindowSpan) -> String {
    match span.since {
        Some(since) => {
            let text = utc(since.max(0.0) as u64);
            match &text[11..16] {
                "00:00" => text[..10].to_owned(),
                time => format!("{} {time} UTC", &text[..10]),
            }
        }
        None => "no date".into(),
    }
}

/// A probability, never rounded to certainty.
#[must_use]
pub fn chance(p: f64) -> String {
    probability(p)
}

/// Scatter between robots: "0.31 N·m".
#[must_use]
pub fn scatter(sd: Option<f64>, values: &[Value]) -> String {
    match (sd, values) {
        (Some(sd), [own]) => format!("{} {}", number(sd, 2), own.unit),
        _ => "–".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_has_the_digits_of_its_interval() {
        let own = Value {
            name: "value".into(),
            unit: "N·m".into(),
            value: 0.075_94,
            interval95: [0.0562, 0.0947],
        };
        assert_eq!(difference(&own), "+0.0759 N·m (95 %: 0.0562 to 0.0947)");
        let gain = Value {
            unit: "1".into(),
            value: -0.02,
            interval95: [-0.03, -0.01],
            ..own
        };
        assert_eq!(difference(&gain), "−0.0200 (95 %: −0.0300 to −0.0100)");
    }
}
