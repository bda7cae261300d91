//! What a generated file refuses, notes and writes; its torque is held against MuJoCo and Pinocchio in tests/python.

use super::{Generated, generate_model};
use crate::error::Result;
use crate::model::{ModelFormat, ModelSettings, parse_model};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use twincal::robot::Inertia;
use twincal::write_back::{Dropped, JointChange, LinkChange, WriteBack};

const BODY: &str = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1'/></inertial>";

/// A chain of links with these names, a hinge between each and the next.
fn chain(names: &[&str]) -> String {
    let mut text = "<robot name='r'>".to_owned();
    for name in names {
        let _ = write!(text, "<link name='{name}'>{BODY}</link>");
    }
    for pair in names.windows(2) {
        let _ = write!(
            text,
            "<joint name='{}' type='continuous'><parent link='{}'/><child link='{}'/></joint>",
            pair[1], pair[0], pair[1]
        );
    }
    text + "</robot>"
}

fn generated(text: &str, change: &WriteBack) -> Result<(String, Vec<String>)> {
    let settings = ModelSettings {
        allow_unphysical: true,
        ..ModelSettings::default()
    };
    let model = parse_model("m.urdf", text.as_bytes(), &settings)?;
    let (robot, _) = model.robot(&BTreeMap::new())?;
    let format = match model.format() {
        ModelFormat::Urdf => ModelFormat::Mjcf,
        ModelFormat::Mjcf => ModelFormat::Urdf,
    };
    let Generated { bytes, notes } = generate_model(format, &robot, change, "m.urdf")?;
    Ok((String::from_utf8(bytes).unwrap(), notes))
}

#[track_caller]
fn refused(text: &str, words: &[&str]) {
    let error = generated(text, &WriteBack::default()).unwrap_err();
    assert!(matches!(error, crate::Error::Content { .. }), "{error:?}");
    let error = error.to_string();
    for word in words {
        assert!(error.contains(word), "{word:?} is missing in: {error}");
    }
}

#[test]
fn what_an_mjcf_has_no_words_for_is_refused() {
    let names: Vec<String> = (0..254).map(|number| format!("l{number}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    refused(
        &chain(&names),
        &["m.urdf: 253 joints", "`l253`", "at most 252", "--to urdf"],
    );
    assert!(generated(&chain(&names[..253]), &WriteBack::default()).is_ok());
    refused(
        &chain(&["base", "world", "tool"]),
        &["link `world` (number 2)", "rename"],
    );
    let flat = chain(&["base", "arm"]).replace("izz='1'", "izz='2.5'");
    refused(
        &flat,
        &["link `arm`", "1, 1 and 2.5 kg·m²", "MuJoCo refuses"],
    );
}

/// Moments that keep A + B ≥ C up to rounding only, and none at all, are written so that MuJoCo takes them.
#[test]
fn bounds_of_inertia_are_lifted_by_rounding() {
    let flat = chain(&["base", "arm"]).replace("izz='1'", "izz='2'");
    let (text, notes) = generated(&flat, &WriteBack::default()).unwrap();
    assert!(
        text.contains("fullinertia=\"1.00000000002 1.00000000002 2.00000000002 0 0 0\""),
        "{text}"
    );
    assert!(notes.is_empty(), "{notes:?}");
    let none = chain(&["base", "arm", "tool"]).replacen(BODY, "", 2);
    let (text, notes) = generated(&none, &WriteBack::default()).unwrap();
    assert!(
        text.contains("mass=\"1e-12\" fullinertia=\"3e-12 3e-12 3e-12"),
        "{text}"
    );
    assert!(
        notes[0].ends_with("1e-12 kg and 3e-12 kg·m² stand at `arm`."),
        "{notes:?}"
    );
}

/// What changes, what the file stated before, and the warning of a link that is no body.
#[test]
fn changes_are_in_both_formats() {
    let stated = "<dynamics damping='0.5' friction='0.25'/></joint></robot>";
    let urdf = chain(&["base", "arm", "tool"]).replace("</joint></robot>", stated);
    let change = |armature| WriteBack {
        links: vec![LinkChange {
            link: "arm".into(),
            before: None,
            after: Inertia {
                mass: 2.5,
                com: [0.5, 0.0, 0.0],
                tensor: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            },
            no_body: true,
        }],
        joints: vec![JointChange {
            joint: "arm".into(),
            damping: Some(0.75),
            friction: Some(0.125),
            armature,
            spring: armature.map(|_| [4.0, 0.5]),
        }],
        gravity: armature.map(|_| [1.0, 0.0, -9.5]),
        ..WriteBack::default()
    };
    let (mjcf, _) = generated(&urdf, &change(Some(0.1))).unwrap();
    let springs = "damping=\"0.75\" frictionloss=\"0.125\" armature=\"0.1\" stiffness=\"4\" springref=\"0.5\"/>";
    for words in [
        "<option gravity=\"1 0 -9.5\"/>",
        "pos=\"0.5 0 0\" mass=\"2.5\"",
        springs,
        "<joint name=\"tool\" axis=\"1 0 0\" damping=\"0.5\" frictionloss=\"0.25\"/>",
        "<motor name=\"arm\" joint=\"arm\"/>",
        super::NO_BODY,
    ] {
        assert!(mjcf.contains(words), "{words} is missing in {mjcf}");
    }
    let dropped = |name: &str, armature, stiffness| Dropped {
        joint: name.into(),
        armature,
        stiffness,
        spring_reference: 0.5,
    };
    let mut change = change(None);
    change.dropped = vec![dropped("arm", 0.1, 4.0)];
    let (text, notes) = generated(&mjcf, &change).unwrap();
    assert!(
        text.contains("<dynamics damping=\"1.5\" friction=\"0.125\"/>"),
        "{text}"
    );
    assert!(text.contains(super::NO_BODY) && text.contains("<mass value=\"2.5\"/>"));
    assert!(
        notes[0].contains("gravity") && notes[0].contains("(1, 0, -9.5)"),
        "{notes:?}"
    );
    assert!(
        text.starts_with("<robot name=\"r\">\n  <!-- Generated by twincal "),
        "{text}"
    );
}

/// A model whose spring stays although the format has none would read back as another robot.
#[test]
fn a_file_that_is_another_robot_is_no_file() {
    let mjcf = "<mujoco><worldbody><body><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><joint armature='0.1'/></body></worldbody></mujoco>";
    let error = generated(mjcf, &WriteBack::default())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("joint `body1.joint1`") && error.contains("mistake in twincal"),
        "{error}"
    );
}
