//! `design.json`: what a designed motion shows, for programs.

use super::WARNING;
use crate::collision::{AssumedShape, CollisionWorld, IgnoredPair, StatedBox, Surroundings};
use crate::error::{Error, Result};
use schemars::JsonSchema;
use serde::Serialize;
use twincal::design::{
    Approach, Criterion, Design, DesignSettings, JointLimits, JointUse, Load, OtherRecording,
    Promise, Recorded,
};
use twincal::robot::JointKind;

/// Version of the format.
const SCHEMA: u64 = 1;

/// What else stands in `design.json`.
#[derive(Debug, Clone)]
pub struct About<'a> {
    /// Name of the model.
    pub model: String,
    /// As asked for.
    pub settings: &'a DesignSettings,
    /// In force.
    pub limits: &'a [JointLimits],
    /// What stands around the robot.
    pub surroundings: &'a Surroundings,
    /// Its geometry.
    pub world: &'a CollisionWorld,
    /// What was recorded before.
    pub recorded: Option<&'a Recorded>,
    /// What the robot carries in the motion.
    pub load: Option<&'a Load>,
    /// Kind of each joint: sliders move in m.
    pub kinds: Vec<JointKind>,
}

/// What was looked at for collisions; lengths in m.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Clearance")]
struct ClearanceJson<'a> {
    /// Smallest distance that is allowed.
    margin: f64,
    /// Height of the floor over the origin of the base; null: no floor.
    floor: Option<f64>,
    /// Boxes to stay out of, or in.
    boxes: &'a [StatedBox],
    /// Pairs of things that were looked at.
    pairs: usize,
    /// The smallest distance of the motion; null: nothing comes close.
    closest: Option<Closest<'a>>,
    /// Links whose geometry is assumed.
    assumed: &'a [AssumedShape],
    /// Pairs of links that were not looked at, or without the margin.
    ignored: &'a [IgnoredPair],
}

/// Two things, how far they are apart, and when.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Closest<'a> {
    /// Names of links, boxes or the floor.
    between: [&'a str; 2],
    /// m.
    distance: f64,
    /// s since the motion's start.
    time: f64,
}

impl<'a> From<&'a Approach> for Closest<'a> {
    fn from(own: &'a Approach) -> Self {
        Self {
            between: [&own.between[0], &own.between[1]],
            distance: own.distance,
            time: own.time,
        }
    }
}

/// What a designed motion shows, what it stays within and how much of that it uses.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(deny_unknown_fields, title = "design.json of twincal")]
struct DesignJson<'a> {
    /// Version of the format.
    #[schemars(extend("const" = SCHEMA))]
    schema: u64,
    /// Version of the program.
    twincal: &'static str,
    /// What to know before the motion runs.
    warning: &'static str,
    /// Name of the model.
    model: &'a str,
    /// Length that was asked for, s.
    duration: f64,
    /// Rate of the samples, Hz.
    rate: f64,
    /// Seed of all random numbers.
    seed: u64,
    /// Samples of the motion, both ends included.
    samples: usize,
    /// The search was ended early: the motion is the best one until then.
    stopped: bool,
    /// Logs recorded before, beside those of the twin.
    after: Vec<Before<'a>>,
    /// What the robot is known to carry in the motion; null: nothing that its model does not have.
    load: Option<LoadJson<'a>>,
    /// What was maximised: `determinant` or `condition` of the base parameters' information; null: what decides the open effects of a twin.
    criterion: Option<&'static str>,
    /// Independent base parameters.
    base_parameters: usize,
    /// ln det of the rows' information on the base parameters, those of `after` included, scaled to torque of size 1; null: not finite.
    #[schemars(extend("type" = ["number", "null"]))]
    log_determinant: f64,
    /// Condition number of the rows: largest over smallest singular value; null: not finite.
    #[schemars(extend("type" = ["number", "null"]))]
    condition: f64,
    /// Limits in force, joint by joint in the order of the columns.
    limits: Vec<InForce<'a>>,
    /// What the motion is expected to say of each open effect; empty without a twin.
    promises: Vec<Expected<'a>>,
    /// How much of its limits each joint uses.
    used: Vec<Used<'a>>,
    /// What was looked at for collisions.
    clearance: ClearanceJson<'a>,
}

/// A log that was recorded before.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Before<'a> {
    /// Its name.
    log: &'a str,
    /// Length of what a fit would use of it, s.
    seconds: f64,
}

/// A point mass that is known.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Load")]
struct LoadJson<'a> {
    /// Link that it is fixed to.
    frame: &'a str,
    /// Mass, kg.
    mass: f64,
    /// Centre of mass in the frame of that link, m.
    com: [f64; 3],
}

/// Limits of one joint in force: rad, rad/s, rad/s², rad/s³, N·m; m and N for sliders.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Limits")]
struct InForce<'a> {
    /// Name of the joint.
    joint: &'a str,
    /// Smallest and largest position.
    position: [f64; 2],
    /// Largest speed.
    velocity: f64,
    /// Largest acceleration.
    acceleration: f64,
    /// Largest jerk.
    jerk: f64,
    /// Largest torque; null: not limited.
    torque: Option<f64>,
    /// Position at the start and at the end.
    start: f64,
    /// Keys of limits that nobody stated.
    assumed: &'a [&'static str],
    /// Keys whose stated limit is beyond that of the model file.
    beyond_model: &'a [&'static str],
}

impl<'a> From<&'a JointLimits> for InForce<'a> {
    fn from(own: &'a JointLimits) -> Self {
        let JointLimits {
            joint,
            position,
            velocity,
            acceleration,
            jerk,
            torque,
            start,
            assumed,
            beyond_model,
        } = own;
        Self {
            joint,
            position: *position,
            velocity: *velocity,
            acceleration: *acceleration,
            jerk: *jerk,
            torque: *torque,
            start: *start,
            assumed,
            beyond_model,
        }
    }
}

/// What the motion is expected to say of one effect, by simulation from the posterior.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Promise")]
struct Expected<'a> {
    /// Name of the effect.
    effect: &'a str,
    /// Its posterior inclusion probability now.
    pip: f64,
    /// Probability that its PIP leaves 0.05 to 0.95 on the side of the truth.
    right: f64,
    /// Probability that its PIP leaves 0.05 to 0.95 on the other side.
    wrong: f64,
    /// Median standard deviation of its first coefficient afterwards, where it is there.
    sd: Option<f64>,
    /// No motion of this robot distinguishes it from the others.
    structural: bool,
    /// What does, where it is structural.
    decided_by: Vec<OtherRecordingJson>,
}

/// A recording that is not of the robot as it stands.
#[derive(Debug, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "OtherRecording")]
enum OtherRecordingJson {
    /// With a load that is known, in one fit with the logs of the twin.
    KnownLoad,
    /// With the base on a wall, fitted by itself.
    OtherBase,
}

impl From<&OtherRecording> for OtherRecordingJson {
    fn from(own: &OtherRecording) -> Self {
        match own {
            OtherRecording::KnownLoad => Self::KnownLoad,
            OtherRecording::OtherBase => Self::OtherBase,
        }
    }
}

impl<'a> From<&'a Promise> for Expected<'a> {
    fn from(own: &'a Promise) -> Self {
        let Promise {
            effect,
            pip,
            right,
            wrong,
            sd,
            structural,
            decided_by,
        } = own;
        Self {
            effect,
            pip: *pip,
            right: *right,
            wrong: *wrong,
            sd: *sd,
            structural: *structural,
            decided_by: decided_by.iter().map(OtherRecordingJson::from).collect(),
        }
    }
}

/// How much of its limits one joint uses, at the samples.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Use")]
struct Used<'a> {
    /// Name of the joint.
    joint: &'a str,
    /// Smallest and largest position.
    position: [f64; 2],
    /// Largest velocity, acceleration and jerk as a share of their limits; jerk as differences of acceleration.
    share: [f64; 3],
    /// Largest torque as a share of its limit; null: not limited.
    torque: Option<f64>,
}

impl<'a> From<&'a JointUse> for Used<'a> {
    fn from(own: &'a JointUse) -> Self {
        let JointUse {
            joint,
            position,
            share,
            torque,
        } = own;
        Self {
            joint,
            position: *position,
            share: *share,
            torque: *torque,
        }
    }
}

/// The JSON Schema of `design.json`, as published in `schema/design.schema.json`.
#[must_use]
pub fn design_schema() -> String {
    let settings = schemars::generate::SchemaSettings::draft2020_12().for_serialize();
    let schema = settings
        .into_generator()
        .into_root_schema_for::<DesignJson<'_>>();
    format!("{:#}\n", schema.to_value())
}

/// The file, see `schema/design.schema.json`.
///
/// # Errors
/// [`Error::Internal`] if it cannot be written as JSON.
pub fn design_json(design: &Design, about: &About<'_>) -> Result<Vec<u8>> {
    let file = DesignJson {
        schema: SCHEMA,
        twincal: env!("CARGO_PKG_VERSION"),
        warning: WARNING,
        model: &about.model,
        duration: about.settings.duration,
        rate: about.settings.rate,
        seed: about.settings.seed,
        samples: design.motion.len,
        stopped: design.stopped,
        after: (about.recorded.iter().flat_map(|own| &own.logs))
            .map(|(log, seconds)| Before {
                log,
                seconds: *seconds,
            })
            .collect(),
        load: about.load.map(|own| LoadJson {
            frame: &own.frame,
            mass: own.mass,
            com: own.com,
        }),
        criterion: design
            .promises
            .is_empty()
            .then_some(match about.settings.criterion {
                Criterion::Determinant => "determinant",
                Criterion::Condition => "condition",
            }),
        base_parameters: design.columns,
        log_determinant: design.log_determinant,
        condition: design.condition,
        limits: about.limits.iter().map(InForce::from).collect(),
        promises: design.promises.iter().map(Expected::from).collect(),
        used: design.used.iter().map(Used::from).collect(),
        clearance: ClearanceJson {
            margin: about.surroundings.margin,
            floor: about.surroundings.floor,
            boxes: &about.surroundings.boxes,
            pairs: about.world.pairs(),
            closest: design.closest.as_ref().map(Closest::from),
            assumed: &about.world.assumed,
            ignored: &about.world.ignored,
        },
    };
    let mut bytes = serde_json::to_vec_pretty(&file).map_err(|e| Error::Internal {
        what: "a design as JSON".into(),
        problem: e.to_string(),
    })?;
    bytes.push(b'\n');
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::fixture;
    use serde_json::Value;

    #[test]
    fn published_schema_is_current() {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../schema/design.schema.json"
        );
        let published = std::fs::read_to_string(path).unwrap_or_default();
        assert!(
            published == design_schema(),
            "schema/design.schema.json is stale: write it anew with `twincal schema design`"
        );
    }

    /// Keys of a value and of what describes it are the same ones, and all are required.
    fn same_keys(value: &Value, schema: &Value, of: &str) {
        let said: Vec<_> = value.as_object().expect(of).keys().collect();
        let described: Vec<_> = schema["properties"].as_object().expect(of).keys().collect();
        assert_eq!(said, described, "{of}");
        assert_eq!(
            schema["required"].as_array().expect(of).len(),
            said.len(),
            "{of}"
        );
    }

    #[test]
    fn a_design_has_the_keys_of_its_schema() {
        let names = ["a", "b"];
        let (mut design, limits) = (
            fixture::design(&names, &["x"], 100),
            fixture::limits(&names),
        );
        design.condition = f64::INFINITY;
        let settings = fixture::settings(&design);
        let recorded = Recorded {
            states: twincal::excitation::States::default(),
            seconds: 12.5,
            logs: vec![("monday.csv".into(), 12.5)],
        };
        let about = About {
            model: "arm.urdf".into(),
            settings: &settings,
            limits: &limits,
            surroundings: &Surroundings::default(),
            world: &super::super::fixture::world(),
            recorded: Some(&recorded),
            load: Some(&Load {
                frame: "tool0".into(),
                mass: 2.0,
                com: [0.0, 0.0, 0.05],
            }),
            kinds: vec![JointKind::Revolute; 2],
        };
        let bytes = design_json(&design, &about).expect("JSON");
        let value: Value = serde_json::from_slice(&bytes).expect("JSON");
        let schema: Value = serde_json::from_str(&design_schema()).expect("JSON");
        same_keys(&value, &schema, "design");
        same_keys(&value["after"][0], &schema["$defs"]["Before"], "after");
        same_keys(&value["load"], &schema["$defs"]["Load"], "load");
        same_keys(&value["limits"][0], &schema["$defs"]["Limits"], "limits");
        same_keys(
            &value["promises"][0],
            &schema["$defs"]["Promise"],
            "promises",
        );
        same_keys(&value["used"][0], &schema["$defs"]["Use"], "used");
        assert!(value["condition"].is_null() && value["limits"][1]["torque"].is_null());
    }
}
