//! What changes in a file is what was meant, and nothing else.

use super::edit::digits;
use super::write_model;
use crate::model::{ModelSettings, parse_model};
use twincal::robot::Inertia;
use twincal::write_back::{JointChange, LinkChange, WriteBack};

fn change(links: Vec<LinkChange>, joints: Vec<JointChange>) -> WriteBack {
    WriteBack {
        links,
        joints,
        ..WriteBack::default()
    }
}

fn joint(name: &str, damping: Option<f64>, friction: Option<f64>) -> JointChange {
    JointChange {
        joint: name.into(),
        damping,
        friction,
        armature: None,
        spring: None,
    }
}

fn exported(text: &str, change: &WriteBack) -> String {
    let model = parse_model("m.urdf", text.as_bytes(), &ModelSettings::default()).unwrap();
    String::from_utf8(write_model(&model, change).unwrap()).unwrap()
}

const ARM: &str = "\u{feff}<?xml version='1.0'?>\r
<!-- a comment with <mass value=\"1\"/> in it -->\r
<robot name='r'>\r
\t<link name='base'/>\r
\t<link  name = 'arm' >\r
\t\t<inertial>\r
\t\t\t<mass value=' 1.50 '/> <!-- kg -->\r
\t\t\t<origin rpy='0 0 1.5707963267948966'  xyz='0.1  0\t0.0'/>\r
\t\t\t<inertia izz='0.03' ixx='0.01' ixy='0' ixz='0' iyy='0.025' iyz='0'/>\r
\t\t</inertial>\r
\t</link>\r
\t<link name='tool' />\r
\t<joint name='j' type='continuous'><parent link='base'/><child link='arm'/></joint>\r
\t<joint name='w' type='fixed'><parent link='arm'/><child link='tool'/></joint>\r
</robot>\r
<!-- end -->";

#[test]
fn nothing_to_change_changes_nothing() {
    assert_eq!(exported(ARM, &change(vec![], vec![])), ARM);
}

#[test]
fn only_the_changed_words_change() {
    let after = Inertia {
        mass: 1.5,
        com: [0.1, 0.02, 0.0],
        // In the file's axes, turned by 90 degrees about z: xx and yy change places.
        tensor: [[0.025, 0.0, 0.0], [0.0, 0.012, 0.0], [0.0, 0.0, 0.03]],
    };
    let link = LinkChange {
        link: "arm".into(),
        before: None,
        after,
        no_body: false,
    };
    let wanted = ARM
        .replace("xyz='0.1  0\t0.0'", "xyz='0.1  0.02\t0.0'")
        .replace("ixx='0.01'", "ixx='0.012'");
    assert_eq!(exported(ARM, &change(vec![link], vec![])), wanted);
}

#[test]
fn what_is_missing_is_added_with_the_indentation_around_it() {
    let link = LinkChange {
        link: "tool".into(),
        before: None,
        after: Inertia {
            mass: 0.25,
            com: [0.0, 0.0, 1e-7],
            tensor: [[1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0], [0.0, 0.0, 1e-3]],
        },
        no_body: false,
    };
    let joint = joint("j", Some(0.5), Some(0.125));
    let wanted = ARM
        .replace(
            "<link name='tool' />",
            "<link name='tool'>\r\n\t\t<inertial>\r\n\t\t\t<origin xyz=\"0 0 1e-7\" rpy=\"0 0 0\"/>\r\n\t\t\t<mass value=\"0.25\"/>\r\n\
             \t\t\t<inertia ixx=\"0.001\" ixy=\"0\" ixz=\"0\" iyy=\"0.001\" iyz=\"0\" izz=\"0.001\"/>\r\n\t\t</inertial>\r\n\t</link>",
        )
        .replace(
            "<child link='arm'/></joint>",
            "<child link='arm'/>\r\n\t\t<dynamics damping=\"0.5\" friction=\"0.125\"/>\r\n\t</joint>",
        );
    assert_eq!(exported(ARM, &change(vec![link], vec![joint])), wanted);
}

#[test]
fn friction_joins_what_stands_there() {
    let text = ARM.replace(
        "<child link='arm'/></joint>",
        "<child link='arm'/><dynamics friction='7'/></joint>",
    );
    let changed = exported(
        &text,
        &change(vec![], vec![joint("j", Some(0.5), Some(0.25))]),
    );
    assert_eq!(
        changed,
        text.replace("friction='7'", "friction='0.25' damping='0.5'")
    );
}

#[test]
fn numbers_have_twelve_digits_and_no_more_than_they_need() {
    for (value, text) in [
        (0.1 + 0.2, "0.3"),
        (-1.0 / 3.0, "-0.333333333333"),
        (1e-7, "1e-7"),
        (1234.5, "1234.5"),
        (-0.0, "0"),
        (2.5e20, "2.5e20"),
    ] {
        assert_eq!(digits(value), text);
    }
}

const MJCF: &str = "<mujoco>
  <default><joint damping='0.5' armature='0.1'/></default>
  <worldbody>
    <body name='a' pos='0 0 1'>
      <joint name='j' axis='0 1 0' pos='0 0 0.1' springref='90' />
      <!-- kg m^2 -->
      <inertial pos='0.1 0 0' mass='2' euler='0 0 90' diaginertia='0.03 0.02 0.04'/>
      <body name='b'><joint name='k' damping='0.25'/><geom type='sphere' size='0.1'/></body>
    </body>
  </worldbody>
</mujoco>
";

/// Mass, centre and tensor of a link as the reader understands the text.
fn inertia_in(text: &str, link: &str) -> Inertia {
    let model = parse_model("m.xml", text.as_bytes(), &ModelSettings::default()).unwrap();
    let found = model.description.links.iter().find(|l| l.name == link);
    found.unwrap().inertia.unwrap()
}

fn mjcf(change: &WriteBack) -> String {
    let model = parse_model("m.xml", MJCF.as_bytes(), &ModelSettings::default()).unwrap();
    String::from_utf8(write_model(&model, change).unwrap()).unwrap()
}

#[test]
fn mjcf_inertias_keep_their_form_where_it_can_say_them() {
    assert_eq!(mjcf(&WriteBack::default()), MJCF);
    let mut after = inertia_in(MJCF, "a");
    let same = LinkChange {
        link: "a".into(),
        before: None,
        after,
        no_body: false,
    };
    assert_eq!(mjcf(&change(vec![same.clone()], vec![])), MJCF);
    // Turned by 90 degrees about z, the file's x is the body's y. The link's frame sits on the joint, 0.1 m up.
    after.mass = 2.5;
    after.com = [0.1, 0.0, -0.1 + 0.02];
    after.tensor[1][1] = 0.035;
    let text = mjcf(&change(
        vec![LinkChange {
            after,
            ..same.clone()
        }],
        vec![],
    ));
    let wanted = MJCF
        .replace("pos='0.1 0 0' mass='2'", "pos='0.1 0 0.02' mass='2.5'")
        .replace("'0.03 0.02 0.04'", "'0.035 0.02 0.04'");
    assert_eq!(text, wanted);
    // Off the file's axes: a quaternion takes the place of the Euler angles.
    after.tensor[0][1] = 0.004;
    after.tensor[1][0] = 0.004;
    let text = mjcf(&change(vec![LinkChange { after, ..same }], vec![]));
    assert!(
        text.contains(" quat='") && !text.contains("euler"),
        "{text}"
    );
    let again = inertia_in(&text, "a");
    for (x, y) in again
        .tensor
        .as_flattened()
        .iter()
        .zip(after.tensor.as_flattened())
    {
        assert!((x - y).abs() < 1e-12, "{again:?}");
    }
}

#[test]
fn mjcf_joints_and_gravity_change_and_classes_do_not() {
    let mut one = joint("j", Some(0.25), Some(0.125));
    one.armature = Some(0.5);
    one.spring = Some([4.0, std::f64::consts::PI / 6.0]);
    let two = joint("k", Some(-0.125), None);
    let b = inertia_in(MJCF, "b");
    let link = LinkChange {
        link: "b".into(),
        before: None,
        after: Inertia { mass: 1.0, ..b },
        no_body: false,
    };
    let mut change = change(vec![link], vec![one, two]);
    change.gravity = Some([0.1, 0.0, -9.8]);
    let text = mjcf(&change);
    let wanted = "<joint name='j' axis='0 1 0' pos='0 0 0.1' springref='30' damping='0.75' frictionloss='0.125' armature='0.6' stiffness='4' />";
    assert!(text.contains(wanted), "{text}");
    assert!(text.contains("<joint name='k' damping='0.125'/>"), "{text}");
    assert!(text.contains("<default><joint damping='0.5' armature='0.1'/></default>"));
    assert!(text.starts_with("<mujoco>\n  <option gravity=\"0.1 0 -9.8\"/>\n  <default>"));
    assert!((inertia_in(&text, "b").mass - 1.0).abs() < 1e-12);
}

/// Where the inertia is no body's the file says so at the link, and once, however often it goes through.
#[test]
fn what_is_no_body_is_said_at_the_link() {
    let impossible = |link: &str, after| LinkChange {
        link: link.into(),
        before: None,
        after,
        no_body: true,
    };
    let arm = |text: &str, link: &str| {
        let model = parse_model("m.urdf", text.as_bytes(), &ModelSettings::default()).unwrap();
        let mut inertia = model.description.links[1].inertia.unwrap();
        inertia.mass = 1.75;
        change(vec![impossible(link, inertia)], vec![])
    };
    let text = exported(ARM, &arm(ARM, "arm"));
    let wanted = ARM.replace("value=' 1.50 '", "value=' 1.75 '").replace(
        "'arm' >\r\n",
        &format!("'arm' >\r\n\t\t{}\r\n", super::NO_BODY),
    );
    assert_eq!(text, wanted);
    assert_eq!(exported(&text, &arm(&text, "arm")), wanted);
    let text = exported(ARM, &arm(ARM, "tool"));
    let begin = format!(
        "<link name='tool'>\r\n\t\t{}\r\n\t\t<inertial>\r\n",
        super::NO_BODY
    );
    assert!(text.contains(&begin), "{text}");
    for (body, before) in [("a", "<joint name='j'"), ("b", "<inertial ")] {
        let after = Inertia {
            mass: 3.0,
            ..inertia_in(MJCF, body)
        };
        let text = mjcf(&change(vec![impossible(body, after)], vec![]));
        let (_, rest) = text.split_once(super::NO_BODY).unwrap();
        assert!(rest.trim_start().starts_with(before), "{text}");
        assert_eq!(text.matches("<!-- twincal").count(), 1);
    }
    // XML has no comment with two hyphens inside.
    let inside = super::NO_BODY.strip_prefix("<!--").unwrap();
    assert_eq!(inside.find("--"), Some(inside.len() - 3));
}
