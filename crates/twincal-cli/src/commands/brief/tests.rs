//! Calibrations of robots with 2 to 44 joints and much to say: the lines that are printed, and what they hold.

#[path = "../../../../twincal/examples/two_link.rs"]
#[allow(dead_code, reason = "its `main` and its study are not needed here")]
mod two_link;

use super::*;
use std::fmt::Write as _;
use twincal::calibrate::{ComponentSummary, Status, StatusReason};
use twincal::prelude::*;
use twincal::random::Random;
use twincal::term::Family;
use twincal::{Code, Finding, Mistake, Severity};
use twincal_io::model::{ModelSettings, parse_model};

/// A fit in a moment, of which the tests change what they are about.
pub(in crate::commands) fn fitted() -> Calibration {
    let robot = two_link::arm(2.0).expect("an arm");
    let mut noise = Random::new(1, 0);
    let mut log = |name: &str, phase: f64| two_link::log(name, phase, &robot, &mut noise);
    let logs = [log("training", 0.3), log("held-out", 1.9)];
    let mut settings = Settings::default();
    settings.library.families = vec![Family::Viscous];
    settings.signal.cutoff_hz = Auto::Value(0.0);
    let fit = Calibrate::new(&robot).logs([&logs[0]]).heldout([&logs[1]]);
    fit.settings(settings).run().expect("a calibration")
}

/// A chain of so many joints.
fn robot(joints: usize, name: fn(usize) -> String) -> Robot {
    let mut text = String::from("<robot name=\"chain\"><link name=\"l0\"/>");
    for joint in 1..=joints {
        let (name, parent) = (name(joint), joint - 1);
        let _ = write!(
            text,
            "<link name=\"l{joint}\"><inertial><mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link>\
             <joint name=\"{name}\" type=\"continuous\"><parent link=\"l{parent}\"/><child link=\"l{joint}\"/><axis xyz=\"0 1 0\"/></joint>"
        );
    }
    text.push_str("</robot>");
    let model = parse_model("chain.urdf", text.as_bytes(), &ModelSettings::default());
    model
        .expect("a model")
        .robot(&Default::default())
        .expect("a robot")
        .0
}

/// An effect with one number.
fn effect(like: &ComponentSummary, name: &str, family: Family, status: Status) -> ComponentSummary {
    let mut own = like.clone();
    (own.name, own.family, own.status) = (name.into(), family, status);
    (own.pip, own.reason) = (Some(0.99), StatusReason::Probability);
    own.words =
        format!("{name}, in words that name the link, its mass and its centre: +1.74 ± 0.02 kg");
    let number = &mut own.parameters[0];
    (number.seen, number.median) = (true, 12.345);
    (number.interval68, number.interval95) = ([12.0, 12.7], [11.6, 13.1]);
    own
}

/// Everything that a joint can have, and twelve warnings.
fn much_to_say(joints: usize, name: fn(usize) -> String) -> Calibration {
    let mut calibration = fitted();
    let like = calibration.components[0].clone();
    calibration.twin.robot = robot(joints, name);
    calibration.components.clear();
    let mut add = |name: String, family, status| {
        calibration
            .components
            .push(effect(&like, &name, family, status));
    };
    for joint in 1..=joints {
        let joint = name(joint);
        add(
            format!("{joint}.viscous"),
            Family::Viscous,
            Status::Established,
        );
        add(
            format!("{joint}.coulomb"),
            Family::Coulomb,
            Status::Established,
        );
        add(format!("{joint}.offset"), Family::Offset, Status::Tentative);
        add(
            format!("{joint}.motor_inertia"),
            Family::MotorInertia,
            Status::Established,
        );
        add(
            format!("{joint}.stribeck"),
            Family::Stribeck,
            Status::Established,
        );
        add(
            format!("l{joint}.density"),
            Family::Density,
            Status::Established,
        );
        add(
            format!("l{joint}.tensor"),
            Family::Tensor,
            Status::Tentative,
        );
    }
    add("payload".into(), Family::Payload, Status::Established);
    let codes = Code::ALL.iter().copied().filter(|&code| {
        code != Code::AlikeInData && Mistake::of(code, Severity::Warning).is_none()
    });
    calibration.findings = codes
        .take(12)
        .map(|code| {
            let words = format!(
                "warning {code}: {}",
                "what, where, how much, what to do. ".repeat(8)
            );
            Finding::new(Severity::Warning, code, "", words, 1)
        })
        .collect();
    calibration
}

fn answer() -> Answer {
    let limit = |number: usize| {
        format!(
            "Limit {number}: {}",
            "prediction biased by +0.82 N·m. ".repeat(9)
        )
    };
    Answer {
        answer: twincal::assess::Answer::YesWithinLimits,
        reason: Code::JointIntervalsNarrow,
        headline: "Yes, within limits: to predict torque below 5 Hz, with the exceptions below."
            .into(),
        lead: String::new(),
        grounds: Vec::new(),
        limits: (0..3).map(limit).collect(),
        folded: (3..9).map(limit).collect(),
        next: Some("one to fit with these, with more motion of many joints. ".repeat(6)),
    }
}

/// Commands are of the paths as typed; where those are long the command stands for itself.
#[test]
fn doubted_twins_get_the_command_that_was_typed() {
    let paths = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
    let said = |reason, logs: &[&str]| {
        let (logs, heldout) = (paths(logs), paths(&["new run.csv"]));
        let typed = Typed {
            model: Path::new("arm.urdf"),
            logs: &logs,
            heldout: &heldout,
        };
        let answer = Answer { reason, ..answer() };
        doubted(&answer, Some(typed), "out")
    };
    assert_eq!(
        said(Code::FewHeldOutRows, &["run1.csv"]),
        "twincal doctor run1.csv 'new run.csv' --model arm.urdf says what is wrong with a log or the model"
    );
    assert_eq!(
        said(Code::AnotherState, &["run1.csv"]),
        "twincal check 'new run.csv' --twin out says what may have changed"
    );
    let long = "x".repeat(LETTERS);
    assert!(said(Code::FewHeldOutRows, &[&long]).starts_with("twincal doctor LOG --model MODEL "));
}

fn printed(calibration: &Calibration, columns: usize) -> Vec<String> {
    let around = Around {
        output: Path::new("twincal-out"),
        format: "urdf",
        instead: &[],
        behind: 0,
        typed: None,
    };
    let steps = Steps {
        answer: &answer(),
        output: "twincal-out".into(),
        command: "twincal export --twin twincal-out --to urdf -o calibrated.urdf".into(),
    };
    let page = page(calibration, &steps, around, columns);
    page.texts().into_iter().map(str::to_owned).collect()
}

/// Joints, and the name of each.
type NamedJoints = (usize, fn(usize) -> String);

const ROBOTS: [NamedJoints; 4] = [
    (2, |joint| format!("joint{joint}")),
    (6, |joint| format!("shoulder_{joint}_lift_joint")),
    (7, |joint| format!("panda_joint{joint}")),
    (44, |joint| {
        format!("left_hand_index_finger_proximal_joint_{joint}")
    }),
];

#[test]
fn no_robot_takes_more_lines_or_columns_than_promised() {
    for (joints, name) in ROBOTS {
        let calibration = much_to_say(joints, name);
        for (columns, most) in [(60, 55), (79, 55), (80, 40), (120, 40)] {
            let lines = printed(&calibration, columns);
            // The answer stands before, the report's path behind.
            let count = 2 + answer().headline.chars().count() / columns + lines.len();
            assert!(
                count <= most,
                "{joints} joints, {columns} columns: {count}\n{lines:#?}"
            );
            let wide = lines.iter().find(|line| text::columns(line) > columns);
            assert_eq!(wide, None, "{joints} joints, {columns} columns");
        }
    }
}

#[test]
fn what_is_left_out_is_counted() {
    let (joints, name) = ROBOTS[3];
    let lines = printed(&much_to_say(joints, name), 120).join("\n");
    for said in [
        "more joints (-v)",
        "more effects (-v)",
        "Limit 0:",
        "more (-v)",
        "twincal export",
    ] {
        assert!(lines.contains(said), "{said}: {lines}");
    }
}

#[test]
fn tentative_effects_have_no_number() {
    let mut calibration = much_to_say(2, ROBOTS[0].1);
    for component in &mut calibration.components {
        component.status = Status::Tentative;
    }
    let lines = printed(&calibration, 120).join("\n");
    assert!(!lines.contains("12."), "{lines}");
    assert!(
        lines.contains("tentative: offset, motor inertia, Stribeck"),
        "{lines}"
    );
}

#[test]
fn names_are_short_and_cannot_steer_the_terminal() {
    assert_eq!(text::short_name("elbow", 8), "elbow");
    assert_eq!(text::short_name("shoulder_pan_joint", 9), "shou…oint");
    assert_eq!(text::short_name("a\u{1b}[31m\nb", 24), "a\u{fffd}[31m b");
}

/// All held-out rows may be left out of a split: there is no error then.
#[test]
fn without_a_held_out_row_no_error_is_printed() {
    let mut calibration = fitted();
    let validation = &mut calibration.validation;
    for scores in [&mut validation.filtered, &mut validation.moving] {
        scores.joints.iter_mut().for_each(|joint| joint.rows = 0);
        (scores.rmse_nominal, scores.rmse_calibrated) = (f64::NAN, f64::NAN);
    }
    let mut page = Page::default();
    scores(&calibration, Width(80), &mut page);
    let text = page.texts().join(" ");
    assert!(
        text.starts_with("Torque error: not tested.") && !text.contains('–'),
        "{text}"
    );
}

/// The next step is a command that works: code of the twin where `export` would refuse the file.
#[test]
fn no_file_that_is_worse_than_the_model_is_proposed() {
    let mut calibration = fitted();
    let of = |calibration: &Calibration| export(calibration, "urdf", "out");
    let file = "twincal export --twin out --to urdf -o calibrated.urdf";
    assert_eq!(of(&calibration), file);
    for component in &mut calibration.components {
        component.status = Status::Established;
    }
    // Damping of 100 N·m·s/rad, which no joint of the logs has.
    calibration.twin.posterior.mean.fill(100.0);
    let said = of(&calibration);
    assert!(
        said.starts_with("twincal export --twin out --to c -o twin.c writes the whole twin"),
        "{said}"
    );
    assert!(said.contains("export refuses the URDF alone"), "{said}");
}

/// Before calibration is without the friction that the file states: the line of the error says so where it states some.
#[test]
fn the_line_of_the_torque_error_says_what_before_is() {
    let mut calibration = fitted();
    let of = |calibration: &Calibration| {
        let mut page = Page::default();
        scores(calibration, Width(120), &mut page);
        page.texts().join(" ")
    };
    let said = "before: your model without the friction";
    assert!(!of(&calibration).contains(said));
    let mut description = calibration.twin.robot.description().clone();
    description.joints[0].unused_damping = 0.1;
    let (robot, _) = Robot::new(description, &std::collections::BTreeMap::new()).expect("a robot");
    calibration.twin.robot = robot;
    assert!(of(&calibration).contains(said), "{}", of(&calibration));
}
