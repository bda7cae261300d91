//! `design.html`: a designed motion for people, as the value and its settings say it; nothing is concluded here.

use super::forms::quantities;
use super::{About, WARNING};
use crate::error::Result;
use crate::report::design::{Cell, Curve, DesignPage, Joint, Number, Question, Row, render};
use crate::words::design as words;
use crate::words::number::{count, number};
use crate::words::units::Units;
use twincal::design::{Design, JointLimits, JointUse, Promise};

/// The page as HTML.
///
/// # Errors
/// [`crate::Error::Internal`] if the template and the values that fill it do not fit together.
pub fn design_page(design: &Design, about: &About<'_>) -> Result<String> {
    let structural = design.promises.iter().filter(|own| own.structural);
    let purpose = words::purpose(design, about.settings.criterion);
    let page = DesignPage {
        headline: words::headline(design),
        about: format!(
            "{}: {} joints, {} samples, seed {}",
            about.model,
            design.motion.joints.len(),
            count(design.motion.len as u64),
            about.settings.seed
        ),
        warning: WARNING.into(),
        clearance: words::clearance(design, about.world),
        purpose: match about.load {
            Some(load) => format!("{purpose} {}", words::carried(load)),
            None => purpose,
        },
        numbers: numbers(design, about),
        questions: design.promises.iter().map(question).collect(),
        decided: words::DECIDED,
        undecidable: structural
            .map(|own| words::undecidable(own, about.load.is_some()))
            .collect(),
        joints: (0..design.motion.joints.len())
            .map(|joint| curves(design, about, joint))
            .collect(),
        some_assumed: (about.limits.iter()).any(|own| own.assumed.iter().any(|key| *key != "jerk")),
        limits: (about.limits.iter().zip(&design.used))
            .enumerate()
            .map(|(joint, (limits, used))| row(limits, used, units(about, joint)))
            .collect(),
        shares: words::SHARES.into(),
        assumed: [
            words::beyond_model(about.limits),
            words::assumed(about.limits),
        ]
        .concat(),
    };
    render(&page)
}

fn numbers(design: &Design, about: &About<'_>) -> Vec<Number> {
    let before = about.recorded.map(|own| Number {
        value: words::seconds(own.seconds),
        name: "recorded before",
    });
    let own = [
        Number {
            value: design.columns.to_string(),
            name: "base parameters",
        },
        Number {
            value: number(design.log_determinant, 3),
            name: "ln det of their information",
        },
        Number {
            value: number(design.condition, 3),
            name: "condition number",
        },
    ];
    own.into_iter().chain(before).collect()
}

fn question(own: &Promise) -> Question {
    // Where no motion distinguishes it from others there is nothing to decide.
    let decided = |share: f64| match own.structural {
        true => "–".to_owned(),
        false => words::share(share),
    };
    Question {
        effect: own.effect.clone(),
        pip: words::chance(own.pip),
        right: decided(own.right),
        wrong: decided(own.wrong),
        sd: own.sd.map_or_else(|| "–".into(), |sd| number(sd, 2)),
        structural: own.structural,
    }
}

fn units(about: &About<'_>, joint: usize) -> Units {
    Units::of(about.kinds[joint])
}

/// Position, velocity and acceleration of one joint.
fn curves(design: &Design, about: &About<'_>, joint: usize) -> Joint {
    let (motion, limits, units) = (&design.motion, &about.limits[joint], units(about, joint));
    let name = &motion.joints[joint];
    let both = |largest: f64| [-largest, largest];
    let kinds = [
        ("position", units.position, limits.position),
        ("velocity", units.velocity, both(limits.velocity)),
        (
            "acceleration",
            units.acceleration,
            both(limits.acceleration),
        ),
    ];
    let curves = kinds.into_iter().zip(quantities(motion));
    let curves = curves.map(|((quantity, unit, limits_of), all)| Curve {
        quantity,
        unit,
        rate: motion.rate,
        values: all[joint * motion.len..(joint + 1) * motion.len].to_vec(),
        limits: limits_of,
        assumed: limits.assumed.contains(&quantity),
        label: words::curve(name, quantity, unit, limits_of),
    });
    Joint {
        name: name.clone(),
        curves: curves.map(|own| own.svg()).collect(),
    }
}

/// Limits of one joint, each with what the motion uses of it.
fn row(limits: &JointLimits, used: &JointUse, units: Units) -> Row {
    let jerk = format!("{}/s³", units.position);
    let cell = |quantity: &'static str, limit: String, used: String| Cell {
        quantity,
        limit,
        used,
        assumed: limits.assumed.contains(&quantity),
    };
    let most = |x: f64, unit: &str| format!("±{} {unit}", number(x, 3));
    let [low, high] = limits.position.map(|x| number(x, 3));
    Row {
        joint: limits.joint.clone(),
        cells: vec![
            cell(
                "position",
                format!("{low} to {high} {}", units.position),
                words::range_used(used.position),
            ),
            cell(
                "velocity",
                most(limits.velocity, units.velocity),
                words::used(used.share[0]),
            ),
            cell(
                "acceleration",
                most(limits.acceleration, units.acceleration),
                words::used(used.share[1]),
            ),
            cell("jerk", most(limits.jerk, &jerk), words::used(used.share[2])),
            cell(
                "torque",
                match limits.torque {
                    Some(torque) => most(torque, units.torque),
                    None => words::NOT_LIMITED.into(),
                },
                used.torque.map_or_else(String::new, words::used),
            ),
            cell(
                "start and end",
                format!("{} {}", number(limits.start, 3), units.position),
                String::new(),
            ),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::Surroundings;
    use crate::design::fixture;
    use quick_xml::events::Event;
    use twincal::robot::JointKind;

    fn page(design: &Design, limits: &[JointLimits]) -> String {
        let settings = fixture::settings(design);
        let about = About {
            model: "arm <b>.urdf".into(),
            settings: &settings,
            limits,
            surroundings: &Surroundings::default(),
            world: &fixture::world(),
            recorded: None,
            load: None,
            kinds: vec![JointKind::Revolute; limits.len()],
        };
        design_page(design, &about).expect("a page")
    }

    /// Elements, values of attributes, and the text between them, of a page that is well-formed.
    #[derive(Default)]
    struct Parsed {
        elements: Vec<String>,
        attributes: Vec<(String, String)>,
        text: String,
    }

    fn parse(html: &str) -> Parsed {
        let body = html.strip_prefix("<!DOCTYPE html>").expect("HTML 5");
        let mut reader = quick_xml::Reader::from_str(body);
        reader.config_mut().check_end_names = true;
        let (mut parsed, mut style) = (Parsed::default(), false);
        loop {
            match reader.read_event().expect("well-formed") {
                Event::Start(tag) | Event::Empty(tag) => {
                    for own in tag.attributes() {
                        let own = own.expect("an attribute");
                        let key = own.key.as_ref().to_owned();
                        parsed.attributes.push((key, own.value.into_owned()));
                    }
                    style = tag.name().as_ref() == "style";
                    parsed.elements.push(tag.name().as_ref().to_owned());
                }
                Event::End(_) => {
                    style = false;
                    parsed.text.push('\n');
                }
                Event::Text(text) if !style => parsed.text.push_str(&text),
                Event::GeneralRef(own) => match &*own {
                    "lt" => parsed.text.push('<'),
                    "gt" => parsed.text.push('>'),
                    "amp" => parsed.text.push('&'),
                    "quot" => parsed.text.push('"'),
                    _ => {
                        let letter = own.resolve_char_ref().expect("a reference");
                        parsed.text.extend(letter);
                    }
                },
                Event::Eof => return parsed,
                _ => {}
            }
        }
    }

    /// Elements of the page do not depend on names, which stand in it as they are, beside no script.
    #[test]
    fn names_are_text() {
        let made = |names: &[&str]| {
            let design = fixture::design(names, names, 300);
            parse(&page(&design, &fixture::limits(names)))
        };
        let (hostile, plain) = (made(&fixture::HOSTILE), made(&["a", "b", "c"]));
        assert_eq!(hostile.elements, plain.elements);
        assert!(!hostile.elements.iter().any(|own| own == "script"));
        let keys = |own: &Parsed| own.attributes.iter().map(|(key, _)| key.clone()).collect();
        let (keys, other): (Vec<_>, Vec<_>) = (keys(&hostile), keys(&plain));
        assert_eq!(keys, other);
        for name in fixture::HOSTILE {
            assert!(hostile.text.matches(name).count() >= 3, "{name}");
        }
        assert!(hostile.text.contains("arm <b>.urdf"));
    }

    /// Numbers in paths and boxes are finite, and no text is a float's word for what is no number.
    #[test]
    fn every_number_is_finite() {
        let names = ["a", "b"];
        let mut design = fixture::design(&names, &["x", "y"], 1);
        (design.condition, design.log_determinant) = (f64::INFINITY, f64::NAN);
        design.motion.qdd[1] = f64::NAN;
        design.used[0].share = [f64::NAN; 3];
        let parsed = parse(&page(&design, &fixture::limits(&names)));
        let is_none = |text: &str| {
            let mut words = text.split(|c: char| !c.is_alphanumeric());
            words.any(|word| ["NaN", "inf"].contains(&word))
        };
        assert!(!is_none(&parsed.text), "{}", parsed.text);
        let drawn = ["d", "x", "y", "width", "height", "viewBox", "transform"];
        let drawn = parsed
            .attributes
            .iter()
            .filter(|(key, _)| drawn.contains(&key.as_str()));
        for (key, value) in drawn {
            assert!(
                !value.contains("NaN") && !value.contains("inf"),
                "{key}={value}"
            );
        }
    }

    #[test]
    fn a_long_motion_is_drawn_with_its_limits_in_few_points() {
        let names = ["a", "b", "c", "d", "e", "f", "g"];
        let design = fixture::design(&names, &[], 30_000);
        let html = page(&design, &fixture::limits(&names));
        let parsed = parse(&html);
        let of_class = |class: &str| -> Vec<String> {
            let own = parsed
                .attributes
                .windows(2)
                .filter(|pair| pair[0] == ("class".into(), class.into()) && pair[1].0 == "d");
            own.map(|pair| pair[1].1.clone()).collect()
        };
        // One of each is that of the legend.
        assert_eq!(of_class("c").len(), 1 + 3 * 7);
        assert_eq!(
            of_class("limit").len() + of_class("limit assumed").len(),
            2 + 6 * 7
        );
        assert_eq!(of_class("limit assumed").len(), 1 + 2);
        for path in of_class("c") {
            assert!(path.matches('l').count() <= 1500);
        }
        assert!(html.len() < 700_000, "{}", html.len());
        assert_eq!(html, page(&design, &fixture::limits(&names)));
    }

    /// What the page is for: purpose, questions, warning, limits, what is assumed.
    #[test]
    fn what_the_value_says_is_on_the_page() {
        let names = ["a", "b"];
        let design = fixture::design(&names, &["payload", "elbow.spring"], 501);
        let text = parse(&page(&design, &fixture::limits(&names))).text;
        for says in [
            "Motion of 2 s at 250 Hz",
            WARNING,
            "Smallest distance 0.031",
            "Designed to decide 2 effects of the twin.",
            "0.31",
            "unidentifiable",
            "89\u{202f}%",
            "elbow.spring: no motion of this robot distinguishes it",
            "−1.00 to 1.50 rad",
            "±55.0 rad/s³",
            "not limited",
            "jerk limit assumed: acceleration / 0.1 s (a)",
        ] {
            assert!(text.contains(says), "{says}: {text}");
        }
        let without = fixture::design(&names, &[], 501);
        let text = parse(&page(&without, &fixture::limits(&names))).text;
        assert!(text.contains("Designed to show body, motors and friction."));
        assert!(!text.contains("PIP"));
    }
}
