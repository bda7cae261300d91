//! What is true of the simulated arm, beside what was found: `truth.json` of the study, in the parameters of the effects.

use super::super::brief::{unit, value};
use crate::failure::Outcome;
use serde::Deserialize;
use std::collections::BTreeMap;
use twincal::calibrate::{Calibration, ComponentSummary, ParameterSummary, Status, StatusReason};
use twincal::words::significant;
use twincal_io::Error;
use twincal_io::words::probability;

const TRUTH: &str = include_str!("../../../assets/truth.json");
/// Distance of a number from the truth, in spreads, that is said.
const FAR: f64 = 3.0;
/// Columns before what was found.
const FOUND: usize = 34;

/// The file: coefficients of the Lagrangian and friction by name, and the arm that was simulated.
#[derive(Deserialize)]
struct File {
    terms: BTreeMap<String, f64>,
    settings: Settings,
}

#[derive(Deserialize)]
struct Settings {
    hidden: BTreeMap<String, f64>,
    real: Real,
}

#[derive(Deserialize)]
struct Real {
    links: [Link; 2],
    length: f64,
    gravity: [f64; 3],
    payload: f64,
    payload_at: [f64; 3],
}

#[derive(Deserialize)]
struct Link {
    mass: f64,
    com: [f64; 3],
}

/// Mass and centre of both links in the model, along the link: kg, m.
const MODEL: [[f64; 2]; 2] = [[3.0, 0.2], [2.0, 0.15]];

/// One true number.
#[derive(Clone)]
struct Truth {
    /// In words.
    words: &'static str,
    component: &'static str,
    parameter: &'static str,
    value: f64,
}

/// The true numbers. Payload and heavier links act as one body on the forearm: what the upper arm has more acts as mass at the elbow.
fn truths(file: &File) -> Vec<Truth> {
    let term = |name: &str| file.terms.get(name).copied().unwrap_or(f64::NAN);
    let hidden = |name: &str| file.settings.hidden.get(name).copied().unwrap_or(f64::NAN);
    let real = &file.settings.real;
    let moment = |link: usize| {
        let ([mass, centre], own) = (MODEL[link], &real.links[link]);
        own.mass * own.com[0] - mass * centre
    };
    let fore = real.links[1].mass + real.payload - MODEL[1][0];
    let mass = fore + moment(0) / real.length;
    let centre = (moment(1) + real.payload * real.payload_at[0]) / mass;
    let mut truths = FRICTION
        .map(|(words, name)| truth(words, [name, "value"], term(name)))
        .to_vec();
    let hidden_kinetic = "qd2^2*cos(q2)";
    truths.extend([
        truth("payload+links, mass", ["payload", "mass"], mass),
        truth("payload+links, centre", ["payload", "com_x"], centre),
        truth(
            "payload+links, inertia",
            ["payload", "iyy"],
            term("qd1*qd2"),
        ),
        truth("base tilt, gravity x", ["base.tilt", "x"], real.gravity[0]),
        // The Lagrangian is kinetic less potential energy.
        truth(
            "potential, cos q2",
            ["elbow.potential", "cos"],
            -hidden("cos(q2)"),
        ),
        truth(
            "kinetic, qd2² cos q2",
            [hidden_kinetic, "value"],
            hidden(hidden_kinetic),
        ),
    ]);
    truths
}

/// Friction in words, and its name as effect and in the file.
const FRICTION: [(&str, &str); 4] = [
    ("viscous, shoulder", "shoulder.viscous"),
    ("viscous, elbow", "elbow.viscous"),
    ("Coulomb, shoulder", "shoulder.coulomb"),
    ("Coulomb, elbow", "elbow.coulomb"),
];

fn truth(words: &'static str, [component, parameter]: [&'static str; 2], value: f64) -> Truth {
    Truth {
        words,
        component,
        parameter,
        value,
    }
}

/// The table, and what was found that is not simulated.
pub(super) fn beside(calibration: &Calibration, width: usize) -> Outcome<Vec<String>> {
    let file: File = serde_json::from_str(TRUTH).map_err(|e| Error::Internal {
        what: "truth.json".into(),
        problem: e.to_string(),
    })?;
    let truths = truths(&file);
    let mut lines = vec![format!("{:<24}{:>8}  found", "Simulated effect", "truth")];
    let mut missed = 0;
    for truth in &truths {
        let component = calibration
            .components
            .iter()
            .find(|own| own.name == truth.component);
        let (found, is_missed) = found(truth, component);
        missed += usize::from(is_missed);
        let true_value = significant(truth.value, 3);
        lines.push(format!("  {:<22}{true_value:>8}  {found}", truth.words));
        let set = component.filter(|_| !is_missed).and_then(in_a_set);
        let set = crate::commands::wrapped(&set.unwrap_or_default(), width - FOUND);
        let set = set.iter().filter(|line| !line.is_empty());
        lines.extend(set.map(|line| format!("{:FOUND$}{line}", "")));
    }
    let others: Vec<&str> = (calibration.components.iter())
        .filter(|own| own.status == Status::Established)
        .map(|own| own.name.as_str())
        .filter(|name| !truths.iter().any(|truth| truth.component == *name))
        .collect();
    let others = match others[..] {
        [] => "nothing else is established".to_owned(),
        ref names => format!("not simulated, but established: {}", names.join(", ")),
    };
    let text = format!(
        "{} of {} found; {others}",
        truths.len() - missed,
        truths.len()
    );
    let wrapped = crate::commands::wrapped(&text, width - 2);
    lines.extend(wrapped.iter().map(|line| format!("  {line}")));
    Ok(lines)
}

/// The number that was found, and whether the effect was missed.
fn found(truth: &Truth, component: Option<&ComponentSummary>) -> (String, bool) {
    let claimed =
        |own: &&ComponentSummary| matches!(own.status, Status::Established | Status::Equivalent);
    let parameter = |own: &ComponentSummary| {
        let mut all = own.parameters.iter();
        all.find(|own| own.name == truth.parameter && own.seen)
            .cloned()
    };
    match component.filter(claimed).and_then(parameter) {
        Some(own) => (with_distance(&own, truth.value), false),
        None => {
            let pip = component.and_then(|own| own.pip);
            let probability = probability(pip.unwrap_or(f64::NAN));
            (format!("missed (PIP {probability})"), true)
        }
    }
}

/// "in a set with elbow.offset": at least one of the set is in, and which one is open.
fn in_a_set(component: &ComponentSummary) -> Option<String> {
    let StatusReason::SameTorque { members, .. } = &component.reason else {
        return None;
    };
    let others = members.iter().filter(|name| **name != component.name);
    let others: Vec<&str> = others.map(String::as_str).collect();
    Some(format!("in a set with {}", others.join(", ")))
}

/// "+0.3988 ± 0.0021 N·m·s/rad", with its distance from the truth where that is large.
fn with_distance(number: &ParameterSummary, truth: f64) -> String {
    let (median, spread) = number.told();
    let distance = (median - truth).abs() / spread;
    let far = match distance > FAR {
        true => format!(", {distance:.1} sd off"),
        false => String::new(),
    };
    format!("{} {}{far}", value(number), unit(number))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::brief::tests::fitted;
    use twincal::calibrate::Alike;
    use twincal::term::Family;

    /// A tilt of gravity along x by 0.40 ± 0.02 m/s², of this status.
    fn tilt(status: Status, reason: StatusReason) -> ComponentSummary {
        let parameter = ParameterSummary {
            name: "x".into(),
            unit: "m/s²".into(),
            mean: 0.4,
            sd: 0.02,
            interval95: [0.36, 0.44],
            median: 0.4,
            interval68: [0.38, 0.42],
            seen: true,
        };
        ComponentSummary {
            name: "base.tilt".into(),
            family: Family::Tilt,
            story: "tilt of the base".into(),
            columns: Vec::new(),
            pip: Some(0.31),
            pip_mcse: None,
            status,
            reason,
            alias_of: Vec::new(),
            told_as: None,
            no_rigid_body: false,
            rigid_share: None,
            words: String::new(),
            parameters: vec![parameter],
        }
    }

    #[test]
    fn an_effect_is_found_found_in_a_set_or_missed() {
        let truth = truth("base tilt, gravity x", ["base.tilt", "x"], 0.41);
        let of = |status, reason| found(&truth, Some(&tilt(status, reason)));
        let value = "+0.400 ± 0.020 m/s²";
        let established = of(Status::Established, StatusReason::Probability);
        assert_eq!(established, (value.into(), false));
        let same = StatusReason::SameTorque {
            members: ["elbow.offset", "base.tilt"].map(str::to_owned).to_vec(),
            pip: 0.99,
            alike: Alike::TheseLogs,
        };
        let set = in_a_set(&tilt(Status::Equivalent, same.clone()));
        assert_eq!(set.as_deref(), Some("in a set with elbow.offset"));
        assert_eq!(of(Status::Equivalent, same), (value.into(), false));
        let missed = of(Status::Tentative, StatusReason::Probability);
        assert_eq!(missed, ("missed (PIP 0.310)".into(), true));
        assert_eq!(found(&truth, None), ("missed (PIP –)".into(), true));
    }

    #[test]
    fn missed_effects_are_counted() {
        let mut calibration = fitted();
        calibration.components.clear();
        let lines = beside(&calibration, 80).expect("a table");
        let missed = lines.iter().filter(|line| line.contains("missed (PIP –)"));
        assert_eq!(missed.count(), 10);
        let last = "  0 of 10 found; nothing else is established";
        assert_eq!(lines.last().map(String::as_str), Some(last));
    }

    /// First moments by the coefficients of the Lagrangian that the study's own script wrote, which are worked out otherwise.
    #[test]
    fn true_numbers_are_those_of_the_lagrangian() {
        let file: File = serde_json::from_str(TRUTH).expect("truth.json");
        let truths = truths(&file);
        let of = |component: &str, parameter: &str| {
            let mut all = truths.iter();
            let own = all.find(|own| (own.component, own.parameter) == (component, parameter));
            own.expect("a true number").value
        };
        let moment = |angle: &str, of_model: f64| {
            let z = file.settings.real.gravity[2];
            (file.terms[angle] - of_model * 9.81) / z - of_model
        };
        let mass = moment("sin(q1)", 3.0 * 0.2 + 2.0 * 0.4) / 0.4;
        let centre = moment("sin(q1+q2)", 2.0 * 0.15) / mass;
        assert!((of("payload", "mass") - mass).abs() < 1e-9);
        assert!((of("payload", "com_x") - centre).abs() < 1e-9);
        assert_eq!(of("elbow.potential", "cos"), -0.8);
        assert_eq!(of("shoulder.coulomb", "value"), 0.6);
        assert!(truths.iter().all(|own| own.value.is_finite()));
    }
}
