//! Distances against closed forms, and what is found, left out and assumed on small robots.

use super::*;
use crate::model::{ModelSettings, parse_model};
use std::collections::BTreeMap;
use std::path::Path as FilePath;
use twincal::design::{JointLimits, StatedLimits, joint_limits};

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::translation(x, y, z)
}

fn near(found: f64, wanted: f64) {
    assert!((found - wanted).abs() < 1e-9, "{found}, not {wanted}");
}

#[test]
fn distances_are_those_of_closed_forms() {
    let apart = |a: &Solid, x: &Pose, b: &Solid, y: &Pose| {
        let there = a.distance(x, b, y, 10.0);
        near(b.distance(y, a, x, 10.0), there);
        there
    };
    let (ball, cuboid) = (Solid::ball(0.5), Solid::cuboid([0.5, 1.0, 1.5]));
    near(
        apart(&ball, &at(0.0, 0.0, 0.0), &ball, &at(3.0, 4.0, 0.0)),
        4.0,
    );
    near(
        apart(&ball, &at(0.0, 0.0, 0.0), &cuboid, &at(3.0, 0.2, 0.1)),
        2.0,
    );
    // Edge to edge: the gap is (1, 1, 0).
    near(
        apart(&cuboid, &at(0.0, 0.0, 0.0), &cuboid, &at(2.0, 3.0, 0.4)),
        2.0_f64.sqrt(),
    );
    near(
        apart(&cuboid, &at(0.0, 0.0, 0.0), &cuboid, &at(0.4, 0.4, 0.4)),
        0.0,
    );
    let lying = Pose::rotation(Vector::new(0.5 * std::f64::consts::PI, 0.0, 0.0));
    let tube = Solid::cylinder(0.3, 1.0);
    near(
        apart(
            &tube,
            &(at(0.0, 0.0, 2.0) * lying),
            &Solid::half_space(),
            &at(5.0, 5.0, 0.5),
        ),
        1.2,
    );
    near(
        apart(
            &tube,
            &at(0.0, 0.0, 2.0),
            &Solid::half_space(),
            &at(5.0, 5.0, 0.5),
        ),
        0.5,
    );
    let capsule = Solid::capsule(Vector::new(0.0, 0.0, -1.0), Vector::new(0.0, 0.0, 1.0), 0.1);
    // Two lines that cross at right angles, 1 m apart.
    near(
        apart(
            &capsule,
            &at(0.0, 0.0, 0.0),
            &capsule,
            &(at(1.0, 0.0, 0.0) * lying),
        ),
        0.8,
    );
    assert!(ball.distance(&at(0.0, 0.0, 0.0), &ball, &at(9.0, 0.0, 0.0), 1.0) > 1.0);
}

/// Points of an uneven surface: all of them are in the solid, and it is hardly larger than they are.
#[test]
fn a_hull_of_many_points_holds_all_of_them() {
    let surface = (0..4000).map(|k| {
        let (a, z) = (
            0.7 * f64::from(k),
            (f64::from(k) * 0.618).fract() * 2.0 - 1.0,
        );
        let across = (1.0 - z * z).sqrt() * (1.0 + 0.2 * (3.0 * a).sin());
        Vector::new(0.2 * across * a.cos(), 0.1 * across * a.sin(), 0.3 * z)
    });
    let points: Vec<Vector> = surface.collect();
    let hull = Solid::hull(&points).expect("points");
    let point = Solid::ball(0.0);
    for p in &points {
        let away = hull.distance(&Pose::IDENTITY, &point, &at(p.x, p.y, p.z), 1.0);
        assert!(away < 1e-9, "{away}");
    }
    // The highest point stands 0.3 high: a plane above it is as far away as it should be, but for 2 mm of skin, 0.3 % of the length.
    let upside_down =
        at(0.0, 0.0, 0.5) * Pose::rotation(Vector::new(std::f64::consts::PI, 0.0, 0.0));
    let above = hull.distance(&Pose::IDENTITY, &Solid::half_space(), &upside_down, 1.0);
    assert!(above > 0.2 - 2e-3 && above < 0.2 + 1e-3, "{above}");
    assert_eq!(Solid::hull(&[]), None);
}

const ARM: &str = r#"<robot name="arm">
<link name="base"><collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
<link name="upper"><collision><origin xyz="0.5 0 0"/><geometry><box size="0.8 0.1 0.1"/></geometry></collision>
  <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
<link name="lower"><collision><origin xyz="0.5 0 0"/><geometry>GEOMETRY</geometry></collision>
  <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
<link name="tool"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.2"/><axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" velocity="2" effort="100"/></joint>
<joint name="j2" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="1 0 0"/><axis xyz="0 1 0"/>
  <limit lower="-3.1" upper="3.1" velocity="2" effort="100"/></joint>
<joint name="tip" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="1 0 0"/></joint>
</robot>"#;

fn arm(geometry: &str) -> (Robot, Geometry, Vec<JointLimits>) {
    let text = ARM.replace("GEOMETRY", geometry);
    let model =
        parse_model("arm.urdf", text.as_bytes(), &ModelSettings::default()).expect("a model");
    let (robot, _) = model.robot(&BTreeMap::new()).expect("a robot");
    let limits = joint_limits(&robot, &BTreeMap::<String, StatedLimits>::new()).expect("limits");
    (robot, model.geometry().expect("geometry"), limits)
}

use crate::model::Geometry;

const BOX: &str = r#"<box size="0.8 0.1 0.1"/>"#;

fn world(geometry: &str, surroundings: &Surroundings) -> crate::error::Result<CollisionWorld> {
    let (robot, geometry, limits) = arm(geometry);
    CollisionWorld::new(
        &robot,
        (&geometry, FilePath::new("arm.urdf")),
        &limits,
        surroundings,
    )
}

/// A floor so far above the origin of the base, and nothing else.
fn floor_at(height: f64) -> Surroundings {
    Surroundings {
        floor: Some(height),
        ..Surroundings::default()
    }
}

fn at_rest(world: &CollisionWorld, q: [f64; 2]) -> Option<Approach> {
    world.breach(&Path::at_rest(&q), None)
}

#[test]
fn a_link_that_comes_too_close_is_named_with_the_other_and_the_distance() {
    let own = world(BOX, &Surroundings::default()).expect("a world");
    assert!(own.assumed.is_empty() && own.pairs() == 1, "{own:?}");
    assert_eq!(at_rest(&own, [-0.5, 0.5]), None);
    // Folded back by π the lower arm lies on the upper one, and its end at the base.
    let hit = at_rest(&own, [0.0, 3.0]).expect("folded");
    assert_eq!(hit.between, ["base".to_owned(), "lower".to_owned()]);
    // Lower arm from 0.1 to 0.9 m along −x at height 0.2, half 0.05 thick; the base ends 0.05 high: 0.1 m are left.
    let flat = own
        .closest(&Path::at_rest(&[0.0, std::f64::consts::PI]))
        .expect("close");
    assert!((flat.distance - 0.1).abs() < 1e-9, "{flat:?}");
}

#[test]
fn floor_and_boxes_count_for_the_links_that_they_name() {
    let floor = floor_at(-0.5);
    let own = world(BOX, &floor).expect("a world");
    assert_eq!(at_rest(&own, [0.0, 0.0]), None);
    let hit = at_rest(&own, [0.6, 0.0]).expect("below");
    assert_eq!(hit.between[1], "floor");
    let stated = |keep, links: &[&str]| StatedBox {
        name: "cell".into(),
        low: [-0.5, -1.0, -1.0],
        high: [1.5, 1.0, 1.5],
        keep,
        links: links.iter().map(|own| (*own).to_owned()).collect(),
    };
    let boxed = |keep, links: &[&str]| Surroundings {
        boxes: vec![stated(keep, links)],
        ..Surroundings::default()
    };
    // Stretched out the tool is at x = 2, the lower arm ends at 1.9, the upper one at 0.9.
    let tool = world(BOX, &boxed(Keep::Inside, &["tool"])).expect("a world");
    assert_eq!(
        at_rest(&tool, [0.0, 0.0]).expect("outside").between[0],
        "tool"
    );
    let upper = world(BOX, &boxed(Keep::Inside, &["upper"])).expect("a world");
    assert_eq!(at_rest(&upper, [0.0, 0.0]), None);
    let outside = world(BOX, &boxed(Keep::Outside, &["tool"])).expect("a world");
    assert_eq!(at_rest(&outside, [0.0, 0.0]), None);
    assert_eq!(
        at_rest(&outside, [0.0, 2.0]).expect("in the box").between[1],
        "cell"
    );
    for (around, says) in [
        (boxed(Keep::Inside, &["tol"]), "did you mean `tool`"),
        (boxed(Keep::Inside, &["base"]), "does not move"),
        (
            Surroundings {
                margin: -0.1,
                ..Surroundings::default()
            },
            "-0.1 m",
        ),
        (
            Surroundings {
                floor: Some(f64::NAN),
                ..Surroundings::default()
            },
            "NaN",
        ),
        (
            Surroundings {
                ignore: vec![["upper".into(), "x".into()]],
                ..Surroundings::default()
            },
            "`x`",
        ),
    ] {
        let error = world(BOX, &around).expect_err(says).to_string();
        assert!(error.contains(says), "{error}");
    }
}

/// One sample before the obstacle and one behind it: what lies between is found by how fast the joint is.
#[test]
fn what_happens_between_samples_is_seen() {
    let post = StatedBox {
        name: "post".into(),
        low: [1.93, -0.05, -0.05],
        high: [2.03, 0.05, 0.05],
        keep: Keep::Outside,
        links: vec!["tool".into()],
    };
    let around = Surroundings {
        boxes: vec![post],
        ..Surroundings::default()
    };
    let own = world(BOX, &around).expect("a world");
    // The tool moves along an arc about the second joint, from above the post to below it.
    let path = |samples: usize| {
        let ends = [-0.5, 0.5];
        let step = 1.0 / (samples - 1) as f64;
        let second = (0..samples).map(|k| ends[0] + (ends[1] - ends[0]) * k as f64 * step);
        Path {
            q: std::iter::repeat_n(0.2, samples).chain(second).collect(),
            len: samples,
            step,
            per_span: samples - 1,
            speed: vec![0.0, 1.0],
            start: 3.0,
        }
    };
    for samples in [2, 3, 9, 100] {
        let path = path(samples);
        let ends_are_free =
            [0, samples - 1].map(|k| own.breach(&Path::at_rest(&path.position(k)), None));
        assert_eq!(ends_are_free, [None, None]);
        let hit = own.breach(&path, None).expect("through the arm's way");
        assert!(hit.time >= 3.0 && hit.time <= 4.0, "{hit:?}");
    }
}

#[test]
fn unknown_geometry_is_a_capsule_with_its_reason() {
    for (geometry, says) in [
        (
            r#"<mesh filename="package://x/lower.dae"/>"#,
            "no STL or OBJ",
        ),
        (
            r#"<mesh filename="package://x/lower.stl"/>"#,
            "is not there",
        ),
        (
            r#"<mesh filename="../../../../../../etc/passwd.stl"/>"#,
            "is not there",
        ),
        ("<teapot/>", "teapot"),
    ] {
        let own = world(geometry, &Surroundings::default()).expect("a world");
        let [assumed] = &own.assumed[..] else {
            panic!("{:?}", own.assumed)
        };
        assert!(
            assumed.link == "lower" && assumed.reason.contains(says),
            "{assumed:?}"
        );
        // 8 % of the reach of 1.2 m.
        assert!((assumed.radius - 0.096).abs() < 1e-9, "{assumed:?}");
    }
}

/// Numbers that no robot has: a capsule, never a panic in the distances.
#[test]
fn geometry_beyond_every_robot_is_assumed() {
    let huge = [
        r#"<box size="1e308 1 1"/>"#,
        r#"<cylinder radius="1e300" length="1"/>"#,
        r#"<sphere radius="1e5"/>"#,
    ];
    for geometry in huge {
        let own = world(geometry, &Surroundings::default()).expect("a world");
        assert_eq!(own.assumed.len(), 1, "{geometry}");
        let farther = own.assumed[0].reason.contains("farther than 10000 m");
        assert!(farther, "{:?}", own.assumed);
        assert!(at_rest(&own, [0.0, 3.0]).is_some());
    }
    let far_away = ARM.replace(r#"xyz="0.5 0 0""#, r#"xyz="1e308 0 0""#);
    let text = far_away.replace("GEOMETRY", BOX);
    let model = parse_model("arm.urdf", text.as_bytes(), &ModelSettings::default());
    let model = model.expect("a model");
    let geometry = model.geometry().expect("geometry");
    let (robot, _, limits) = arm(BOX);
    let around = Surroundings::default();
    let at = (&geometry, FilePath::new("arm.urdf"));
    let own = CollisionWorld::new(&robot, at, &limits, &around).expect("a world");
    assert_eq!(own.assumed.len(), 2);
    // A slider that leaves the numbers: an overlap.
    let (ball, away) = (Solid::ball(0.1), Pose::translation(f64::INFINITY, 0.0, 0.0));
    assert_eq!(ball.distance(&away, &ball, &away, 1.0), 0.0);
}

#[test]
fn links_that_no_joint_parts_are_left_out_and_named() {
    let wide = r#"<box size="4 4 4"/>"#;
    let own = world(wide, &Surroundings::default()).expect("a world");
    assert_eq!(own.pairs(), 0);
    assert_eq!((own.ignored.len(), own.ignored[0].reason), (1, "always"));
    let stated = Surroundings {
        ignore: vec![["lower".into(), "base".into()]],
        ..Surroundings::default()
    };
    let own = world(BOX, &stated).expect("a world");
    assert_eq!((own.pairs(), own.ignored[0].reason), (0, "stated"));
}

/// The same arm as MJCF, its second geom as a mesh in the file: the same distances.
#[test]
fn mjcf_geoms_are_where_mujoco_has_them() {
    let text = r#"<mujoco model="arm"><compiler angle="radian"/>
<default><geom contype="1"/><default class="seen"><geom contype="0" conaffinity="0"/></default></default>
<asset><mesh name="bar" vertex="-.4 -.05 -.05 .4 -.05 -.05 -.4 .05 -.05 .4 .05 -.05 -.4 -.05 .05 .4 -.05 .05 -.4 .05 .05 .4 .05 .05"/></asset>
<worldbody><body name="base"><geom type="box" size="0.1 0.1 0.05"/>
<body name="upper" pos="0 0 0.2"><joint name="j1" axis="0 1 0" range="-2 2"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<geom type="box" pos="0.5 0 0" size="0.4 0.05 0.05"/><geom class="seen" type="sphere" size="3"/>
<body name="lower" pos="0.9 0 0"><joint name="j2" axis="0 1 0" pos="0.1 0 0" range="-3.1 3.1"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<frame pos="0.1 0 0"><geom type="mesh" mesh="bar" pos="0.5 0 0"/></frame></body></body></body></worldbody></mujoco>"#;
    let model =
        parse_model("arm.xml", text.as_bytes(), &ModelSettings::default()).expect("a model");
    let (robot, _) = model.robot(&BTreeMap::new()).expect("a robot");
    let stated = StatedLimits {
        velocity: Some(2.0),
        ..StatedLimits::default()
    };
    let stated = ["j1", "j2"].map(|name| (name.to_owned(), stated));
    let limits = joint_limits(&robot, &stated.into_iter().collect()).expect("limits");
    let geometry = model.geometry().expect("geometry");
    let around = Surroundings::default();
    let mjcf = CollisionWorld::new(
        &robot,
        (&geometry, FilePath::new("arm.xml")),
        &limits,
        &around,
    )
    .expect("a world");
    let urdf = world(BOX, &around).expect("a world");
    assert_eq!(mjcf.pairs(), urdf.pairs());
    for q in [[0.0, 3.1], [0.3, -2.5], [-0.4, 2.8]] {
        let both = [&mjcf, &urdf].map(|own| own.closest(&Path::at_rest(&q)));
        assert_eq!(both[0].is_some(), both[1].is_some());
        if let [Some(a), Some(b)] = both {
            near(a.distance, b.distance);
        }
    }
}

/// A ball over the floor: ln(height beyond the margin) changes as the closed form says, with a second body far above.
#[test]
fn slopes_of_what_is_near_are_those_of_closed_forms() {
    let floor = floor_at(-0.5);
    let own = world(r#"<sphere radius="0.1"/>"#, &floor).expect("a world");
    // The centre is 0.2 − sin q₁ − 0.5 sin(q₁ + q₂) high.
    let [one, both] = [0.3_f64, 0.534];
    let left = 0.2 - one.sin() - 0.5 * both.sin() + 0.5 - 0.1 - own.margin();
    assert!((0.02..0.04).contains(&left), "{left}");
    let q = [0.0, one, 0.0, both - one];
    let near = own.nearness(&q, 2);
    assert_eq!(near[0], 0.0, "far in the first state");
    assert!((near[1] - (left / 0.05).ln()).abs() < 1e-6, "{near:?}");
    let found = own.nearness_slopes(&q, 2, &[1e-3, 1e-3]);
    assert!(found.len() == 1 && found[0].state == 1, "{found:?}");
    let second = -0.5 * both.cos() / left;
    let wanted = [second - one.cos() / left, second];
    for (found, wanted) in found[0].slopes.iter().zip(wanted) {
        assert!((found / wanted - 1.0).abs() < 1e-3, "{found} {wanted}");
    }
}

/// A path on which a single joint differs: what that joint does not move is not looked at again.
#[test]
fn what_another_joint_moves_is_not_looked_at_again() {
    let floor = floor_at(-0.23);
    let own = world(BOX, &floor).expect("a world");
    // The end of the upper arm is below the floor, whatever the second joint does; the lower arm points up.
    let below = Path::at_rest(&[0.45, -1.95]);
    assert!(own.breach(&below, None).is_some() && own.breach(&below, Some(0)).is_some());
    assert_eq!(own.breach(&below, Some(1)), None);
}
