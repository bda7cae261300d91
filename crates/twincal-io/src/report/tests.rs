//! The page as a whole: safe, self-contained, repeatable, small, and complete for every kind of result.

use super::{fixture, render, script};
use crate::context::{FileHash, ReportContext};
use quick_xml::events::{BytesRef, Event};
use twincal::calibrate::Calibration;

fn context() -> ReportContext {
    ReportContext {
        config: None,
        version: "0.1.0".into(),
        robot: "planar arm".into(),
        model: "planar_arm.urdf".into(),
        command: "twincal fit run0.csv run1.csv run2.csv --model planar_arm.urdf".into(),
        settings: "[noise]\nmodel = \"tempered\"\n\n[inference]\nmethod = \"auto\"\nseed = 1\n"
            .into(),
        seed: 1,
        files: ["planar_arm.urdf", "run0.csv", "run1.csv"]
            .map(|name| FileHash {
                name: name.into(),
                sha256: "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08".into(),
            })
            .to_vec(),
    }
}

fn specimens() -> Vec<(&'static str, Calibration)> {
    vec![
        ("two_joints", fixture::two_joints()),
        ("many_logs", fixture::many_logs()),
        ("seven_joints", fixture::seven_joints()),
        ("gibbs", fixture::gibbs()),
        ("nothing_found", fixture::nothing_found()),
        ("single_row", fixture::single_row()),
        ("no_validation", fixture::no_validation()),
        ("hostile", fixture::hostile()),
    ]
}

/// The page without the one script of ours, which must stand in it once at most, word by word.
fn without_script(html: &str) -> String {
    let script = format!("<script>{}</script>", script::text());
    assert!(html.matches(&script).count() <= 1);
    html.replace(&script, "")
}

/// All element names, attributes and texts of a page, which must be well-formed XML but for its script.
struct Parsed {
    elements: Vec<String>,
    attributes: Vec<(String, String)>,
    /// Text outside of SVG and CSS, one line per element.
    text: String,
    /// Text inside of SVG.
    drawn: Vec<String>,
}

/// Elements whose end ends a line of text.
const ENDS_A_LINE: [&str; 14] = [
    "p", "li", "h1", "h2", "h3", "th", "td", "dt", "dd", "summary", "tr", "a", "span", "title",
];

fn parse(html: &str) -> Parsed {
    let html = without_script(html);
    let body = html
        .trim_start()
        .strip_prefix("<!DOCTYPE html>")
        .expect("an HTML 5 page");
    let mut reader = quick_xml::Reader::from_str(body);
    reader.config_mut().check_end_names = true;
    let mut parsed = Parsed {
        elements: vec![],
        attributes: vec![],
        text: String::new(),
        drawn: vec![],
    };
    let mut open: Vec<String> = Vec::new();
    loop {
        let event = reader.read_event().expect("well-formed");
        let empty = matches!(event, Event::Empty(_));
        match event {
            Event::Start(tag) | Event::Empty(tag) => {
                let name = tag.name().as_ref().to_owned();
                for attribute in tag.attributes() {
                    let attribute = attribute.expect("well-formed attribute");
                    let key = attribute.key.as_ref().to_owned();
                    parsed.attributes.push((key, attribute.value.into_owned()));
                }
                parsed.elements.push(name.clone());
                if !empty {
                    open.push(name);
                }
            }
            Event::End(_) => {
                let closed = open.pop().unwrap();
                if ENDS_A_LINE.contains(&closed.as_str()) {
                    parsed.text.push('\n');
                }
            }
            Event::Text(text) => {
                let text: &str = &text;
                if open.iter().any(|o| o == "svg") {
                    parsed.drawn.push(text.to_owned());
                } else if !open.iter().any(|o| o == "style" || o == "script")
                    && !text.trim().is_empty()
                {
                    parsed.text.push_str(text.trim_matches('\n'));
                }
            }
            Event::GeneralRef(reference) => {
                let shown = referenced(&reference);
                if !open.iter().any(|o| o == "svg") {
                    parsed.text.push_str(&shown);
                }
            }
            Event::Eof => break,
            _ => {}
        }
    }
    assert!(open.is_empty(), "unclosed: {open:?}");
    parsed
}

/// What an entity or a character reference shows.
fn referenced(reference: &BytesRef<'_>) -> String {
    match &**reference {
        "lt" => "<".into(),
        "gt" => ">".into(),
        "amp" => "&".into(),
        "quot" => "\"".into(),
        _ => reference.resolve_char_ref().unwrap().unwrap().to_string(),
    }
}

#[test]
fn case_109_names_are_text_everywhere() {
    let mut run = context();
    run.model = "<script>alert(8)</script>\u{1b}]0;x\u{7}.urdf".into();
    run.command = "twincal fit '<script>alert(9)</script>'".into();
    run.settings = "a = '</code></pre><script>alert(10)</script>'".into();
    run.files[0].name = "<script>".into();
    run.files[0].sha256 = "\"><script>".into();
    let html = render(&fixture::hostile(), &run).unwrap();
    let parsed = parse(&html);

    let known = [
        "html", "head", "meta", "title", "style", "body", "header", "main", "section", "nav", "a",
        "h1", "h2", "h3", "p", "ul", "li", "span", "div", "table", "thead", "tbody", "tr", "th",
        "td", "code", "pre", "details", "summary", "dl", "dt", "dd", "figure", "svg", "path",
        "rect", "circle", "text", "wbr", "strong", "label", "select", "button", "output", "script",
    ];
    assert!(
        parsed.elements.iter().all(|e| known.contains(&e.as_str())),
        "{:?}",
        parsed.elements
    );
    let scripts = parsed.elements.iter().filter(|e| *e == "script").count();
    assert_eq!(scripts, 1, "the data block and no other");
    assert!(html.contains("\\u003cscript\\u003ealert(1)"));
    assert!(
        parsed
            .attributes
            .iter()
            .all(|(key, _)| !key.starts_with("on") && key != "src"),
        "an event handler or a source"
    );
    assert!(
        parsed
            .attributes
            .iter()
            .filter(|(key, _)| key == "href")
            .all(|(_, value)| value.starts_with('#'))
    );
    assert!(
        html.contains("&lt;script&gt;alert(1)&lt;/script&gt;")
            || html.contains("&lt;script&gt;alert(1)&lt;&#x2f;script&gt;")
    );
    for c in ['\u{1b}', '\u{7}', '\u{202e}', '\u{9b}', '\0'] {
        assert!(!html.contains(c), "{c:?}");
    }
    assert!(parsed.text.contains("red") && !html.contains("[31m"));
}

#[test]
fn every_kind_of_result_gives_a_whole_page() {
    for (name, calibration) in specimens() {
        let html = render(&calibration, &context()).unwrap();
        let parsed = parse(&html);
        for id in [
            "answer",
            "torque",
            "use",
            "grounds",
            "effects",
            "joints",
            "intervals",
            "residual",
            "limits",
            "sensitivity",
            "data",
            "reproduce",
        ] {
            assert!(
                parsed.attributes.contains(&("id".into(), id.into())),
                "{name}: no section {id}"
            );
        }
        for bad in ["NaN", "inf ", "Infinity", "undefined", "None", "none\n"] {
            assert!(
                !parsed.text.contains(bad),
                "{name}: {bad} in {}",
                parsed.text
            );
            assert!(
                !parsed.drawn.iter().any(|t| t.contains(bad)),
                "{name}: {bad} in a figure"
            );
        }
        for (key, value) in &parsed.attributes {
            assert!(
                !value.contains("NaN") && !value.contains("inf"),
                "{name}: {key}={value}"
            );
        }
        let images = parsed
            .attributes
            .iter()
            .filter(|(key, value)| key == "role" && value == "img")
            .count();
        let labels = parsed
            .attributes
            .iter()
            .filter(|(key, value)| key == "aria-label" && !value.is_empty())
            .count();
        assert!(labels >= images, "{name}: {images} images, {labels} labels");
    }
}

#[test]
fn nothing_is_fetched_and_one_script_may_run() {
    for (name, calibration) in specimens() {
        let whole = render(&calibration, &context()).unwrap();
        let html = without_script(&whole);
        for bad in [
            "http:",
            "https:",
            "url(",
            "@import",
            "<script>",
            "<link",
            "<iframe",
            "<img",
            "javascript:",
        ] {
            assert!(!html.contains(bad), "{name}: {bad}");
        }
        let policy = format!(
            "content=\"default-src 'none'; style-src 'unsafe-inline'; script-src {}\"",
            script::source(&script::text())
        );
        assert!(html.contains(&policy), "{name}");
        // Script and data stand there together or not at all.
        let blocks = html.matches("<script").count();
        assert_eq!(blocks, usize::from(html != whole), "{name}");
    }
}

#[test]
fn the_same_result_gives_the_same_bytes() {
    let render = || render(&fixture::two_joints(), &context()).unwrap();
    assert_eq!(render(), render());
}

#[test]
fn eight_logs_and_seven_joints_stay_below_two_megabytes() {
    let html = render(&fixture::many_logs(), &context()).unwrap();
    assert!(html.len() < 2_000_000, "{} bytes", html.len());
    for seven in [fixture::seven_joints(), fixture::many_joints_and_logs()] {
        let html = render(&seven, &context()).unwrap();
        assert!(html.len() < 2_000_000, "{} bytes", html.len());
    }
    assert!(
        html.len() > 100_000,
        "{} bytes: where are the figures?",
        html.len()
    );
}

#[test]
fn text_of_a_small_report() {
    let html = render(&fixture::two_joints(), &context()).unwrap();
    let lines: Vec<String> = parse(&html)
        .text
        .lines()
        .map(|l| l.trim().to_owned())
        .filter(|l| !l.is_empty())
        .collect();
    insta::assert_snapshot!(lines.join("\n"));
}

#[test]
#[ignore = "writes the specimens to target/report-specimens, to be looked at in a browser"]
fn write_specimens() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../target/report-specimens");
    std::fs::create_dir_all(folder).unwrap();
    for (name, calibration) in specimens() {
        let html = render(&calibration, &context()).unwrap();
        std::fs::write(format!("{folder}/{name}.html"), html).unwrap();
    }
}
