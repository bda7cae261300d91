//! The file of `--limits`: what a motion must stay within.
//!
//! ```toml
//! [joint.elbow]
//! position = [-2.0, 2.0]   # rad
//! velocity = 1.5           # rad/s
//! acceleration = 6.0       # rad/s²
//! jerk = 60.0              # rad/s³
//! torque = 50.0            # N·m
//! start = 0.4              # rad
//! ```
//! What it carries in the motion beside what its model has, in the payload frame:
//! ```toml
//! load = { mass = 2.0, com = [0.0, 0.0, 0.05] } # kg, m
//! ```
//! What stands around it, in the frame of the base:
//! ```toml
//! margin = 0.02            # m
//! floor = 0.0              # m, height against gravity
//! ignore = [["wrist_1_link", "wrist_3_link"]]
//! [[box]]
//! name = "table"
//! low = [0.2, -0.5, -0.1]  # m
//! high = [1.0, 0.5, 0.3]
//! keep = "outside"         # or "inside"
//! links = ["tool0"]        # without: all that move
//! ```

use crate::collision::{Keep, StatedBox, Surroundings};
use crate::error::{Error, Place, Result};
use crate::open::InputFile;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;
use twincal::design::StatedLimits;

/// Largest file, bytes.
const MAX_BYTES: u64 = 1 << 20;
const REMEDY: &str = "keys of [joint.NAME] are position, velocity, acceleration, jerk, torque and start, of [[box]] name, low, high, keep and \
                      links, of load mass and com; those of the file are joint, load, box, margin, floor and ignore";

/// What the file states.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Limits {
    /// By name of the joint.
    pub joints: BTreeMap<String, StatedLimits>,
    /// What the robot carries in the motion.
    pub load: Option<StatedLoad>,
    /// What stands around the robot.
    pub surroundings: Surroundings,
}

/// A point mass that the robot is known to carry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StatedLoad {
    /// kg.
    pub mass: f64,
    /// Centre of mass in the payload frame, m.
    pub com: [f64; 3],
}

/// Limits of a motion, over those of the model file.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "limits of twincal design")]
struct File {
    /// Joints by name, `[joint.NAME]`.
    #[serde(default)]
    joint: BTreeMap<String, JointTable>,
    /// What the robot is known to carry in the motion beside what its model has; its shape is not looked at.
    load: Option<LoadTable>,
    /// Smallest distance between any two things, m; without it 0.02.
    margin: Option<f64>,
    /// Height of a floor over the origin of the base, against gravity, m; without it there is no floor.
    floor: Option<f64>,
    /// Pairs of links that are not checked against each other.
    #[serde(default)]
    ignore: Vec<[String; 2]>,
    /// Boxes with their edges along the axes of the base.
    #[serde(default, rename = "box")]
    boxes: Vec<BoxTable>,
}

/// A point mass.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Load")]
struct LoadTable {
    /// Mass, kg.
    #[schemars(extend("exclusiveMinimum" = 0))]
    mass: f64,
    /// Centre of mass in the payload frame, m.
    com: [f64; 3],
}

/// A box to stay out of, or in.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Box")]
struct BoxTable {
    /// Name in what is said.
    name: String,
    /// Smallest coordinates, m.
    low: [f64; 3],
    /// Largest coordinates, m.
    high: [f64; 3],
    /// Which side is allowed.
    #[serde(default)]
    keep: Keep,
    /// Links or frames that it is for; without it all that move.
    #[serde(default)]
    links: Vec<String>,
}

/// `[joint.NAME]`: limits of one joint; of a slider in m and N.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct JointTable {
    /// Smallest and largest position, rad.
    position: Option<[f64; 2]>,
    /// Largest speed, rad/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    velocity: Option<f64>,
    /// Largest acceleration, rad/s²; default: velocity / 0.2 s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    acceleration: Option<f64>,
    /// Largest jerk, rad/s³; default: acceleration / 0.1 s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    jerk: Option<f64>,
    /// Largest torque, N·m; default: that of the model file, else not limited.
    #[schemars(extend("exclusiveMinimum" = 0))]
    torque: Option<f64>,
    /// Position at the motion's start and end, rad; default: 0, or the middle where 0 is outside.
    start: Option<f64>,
}

/// The JSON Schema of a limits file, as published in `schema/limits.schema.json`.
#[must_use]
pub fn limits_schema() -> String {
    format!("{:#}\n", schemars::schema_for!(File).to_value())
}

/// Reads limits from a file.
///
/// # Errors
/// A file that cannot be read, wrong TOML, an unknown key or a wrong type, with line and column.
///
/// # Example
/// ```
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("limits.toml");
/// std::fs::write(&path, "[joint.elbow]\nposition = [-2.0, 2.0]\nvelocity = 1.5\n")?;
/// let limits = twincal_io::design::read_limits(&path)?; // for `twincal::design::joint_limits`
/// assert_eq!(limits.joints["elbow"].position, Some([-2.0, 2.0]));
/// assert_eq!(limits.joints["elbow"].acceleration, None); // velocity / 0.2 s then
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_limits(path: &Path) -> Result<Limits> {
    let name = path.display().to_string();
    let bytes = InputFile::new(path, MAX_BYTES)
        .read()
        .map_err(|refusal| refusal.into_error(&name, "give an existing file with --limits"))?;
    let text = String::from_utf8(bytes).map_err(|e| {
        let place = Place::of_offset(&name, e.as_bytes(), e.utf8_error().valid_up_to());
        Error::content(place, "not UTF-8", "save the file as UTF-8")
    })?;
    parse(&name, &text)
}

fn parse(name: &str, text: &str) -> Result<Limits> {
    let file: File = toml::from_str(text).map_err(|e| {
        let place = match e.span() {
            Some(span) => Place::of_offset(name, text.as_bytes(), span.start),
            None => Place::file(name),
        };
        let problem = e.message().split_whitespace().collect::<Vec<_>>().join(" ");
        Error::content(place, problem, REMEDY)
    })?;
    let joints = file.joint.into_iter().map(|(name, own)| {
        let stated = StatedLimits {
            position: own.position,
            velocity: own.velocity,
            acceleration: own.acceleration,
            jerk: own.jerk,
            torque: own.torque,
            start: own.start,
        };
        (name, stated)
    });
    let boxes = file.boxes.into_iter().map(|own| StatedBox {
        name: own.name,
        low: own.low,
        high: own.high,
        keep: own.keep,
        links: own.links,
    });
    Ok(Limits {
        joints: joints.collect(),
        load: file.load.map(|own| stated_load(name, own)).transpose()?,
        surroundings: Surroundings {
            margin: file.margin.unwrap_or(Surroundings::default().margin),
            floor: file.floor,
            boxes: boxes.collect(),
            ignore: file.ignore,
        },
    })
}

/// # Errors
/// Of a mass that is not positive, or numbers that are not finite.
fn stated_load(name: &str, own: LoadTable) -> Result<StatedLoad> {
    let refused = |key: &str, value: f64, remedy: &str| {
        let problem = format!("key `load.{key}`: {value} is out of range");
        Err(Error::content(Place::file(name), problem, remedy))
    };
    if !(own.mass > 0.0 && own.mass.is_finite()) {
        return refused("mass", own.mass, "give a positive mass in kg");
    }
    if let Some(value) = own.com.iter().find(|own| !own.is_finite()) {
        return refused("com", *value, "give three finite numbers in m");
    }
    Ok(StatedLoad {
        mass: own.mass,
        com: own.com,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_schema_is_current() {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../schema/limits.schema.json"
        );
        let published = std::fs::read_to_string(path).unwrap_or_default();
        assert!(
            published == limits_schema(),
            "schema/limits.schema.json is stale: write it anew with `twincal schema limits`"
        );
    }

    #[test]
    fn stated_limits_are_read() {
        let text =
            "[joint.elbow]\nposition = [-2.0, 2]\nvelocity = 1.5\n[joint.\"a b\"]\nstart = 1\n";
        let limits = parse("limits.toml", text).expect("limits");
        assert_eq!(limits.joints["elbow"].position, Some([-2.0, 2.0]));
        assert_eq!(limits.joints["a b"].start, Some(1.0));
        assert_eq!(limits.joints["elbow"].jerk, None);
        assert_eq!(limits.surroundings, Surroundings::default());
        assert_eq!(limits.load, None);
        let text = "load = { mass = 2, com = [0.0, 0.0, 0.05] }\n";
        let load = parse("limits.toml", text).expect("a load").load;
        let stated = StatedLoad {
            mass: 2.0,
            com: [0.0, 0.0, 0.05],
        };
        assert_eq!(load, Some(stated));
        let text = "floor = -0.1\nignore = [[\"a\", \"b\"]]\n[[box]]\nname = \"w\"\nlow = [0, 0, 0]\nhigh = [1, 1, 1]\nkeep = \"inside\"\n";
        let around = parse("limits.toml", text)
            .expect("surroundings")
            .surroundings;
        assert_eq!((around.floor, around.margin), (Some(-0.1), 0.02));
        assert_eq!(
            (around.boxes[0].keep, around.ignore.len()),
            (Keep::Inside, 1)
        );
    }

    #[test]
    fn what_is_wrong_is_said_with_its_place() {
        for (text, says) in [
            ("[joint.elbow]\nvelocty = 1\n", ":2:"),
            ("[joint.elbow]\nposition = [1]\n", ":2:"),
            ("[joints.elbow]\n", "joints"),
            ("[[box]]\nname = \"w\"\nkeep = \"out\"\n", "outside"),
            ("ignore = [[\"a\"]]\n", ":1:"),
            ("velocity = ", ":1:"),
            ("load = { mass = 2 }\n", "com"),
            ("load = 2\n", ":1:"),
            ("load = { mass = -1, com = [0, 0, 0] }\n", "`load.mass`: -1"),
            (
                "load = { mass = nan, com = [0, 0, 0] }\n",
                "`load.mass`: NaN",
            ),
            (
                "load = { mass = 1, com = [0, inf, 0] }\n",
                "`load.com`: inf",
            ),
        ] {
            let error = parse("limits.toml", text).expect_err(text).to_string();
            assert!(
                error.contains(says) && error.contains("limits.toml"),
                "{error}"
            );
        }
    }
}
