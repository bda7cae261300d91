//! The keys of `twincal.toml`, as written: the one source of their names, their documentation and the JSON Schema.

use super::{ColumnsTable, PerJoint};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;
use twincal::calibrate::UnaskedRipple;
use twincal::term::Family;

/// Settings of twincal. Every key is optional; a flag on the command line overrides its key.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields, title = "twincal.toml")]
pub struct ConfigFile {
    /// The robot model.
    pub model: ModelTable,
    /// The logs, one entry each, `[[log]]`; a table `[log]` is read as the first entry.
    #[serde(
        deserialize_with = "super::log_forms::deserialize",
        serialize_with = "super::log_forms::serialize"
    )]
    #[schemars(with = "super::log_forms::LogForms")]
    pub log: LogTable,
    /// Which column of a log is which channel; needed only where the column names do not say it.
    pub columns: ColumnsTable,
    /// The candidates.
    pub library: LibraryTable,
    /// Filters and rates.
    pub signal: SignalTable,
    /// What is believed before the data.
    pub prior: PriorTable,
    /// The likelihood.
    pub noise: NoiseTable,
    /// How the posterior is computed.
    pub inference: InferenceTable,
    /// Gates of `twincal check`.
    pub check: CheckTable,
    /// Where the result goes.
    pub output: OutputTable,
}

/// `[model]`
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct ModelTable {
    /// URDF or MJCF file, relative to this config (flag `--model`).
    pub file: Option<PathBuf>,
    /// Gravity in the base frame, m/s²; default: the file's, else [0, 0, -9.81]. With `base` it is gravity in the world.
    pub gravity: Option<[f64; 3]>,
    /// How the base stands in the world: { rpy = [roll, pitch, yaw] } in rad, as in a URDF origin. On a ceiling
    /// [3.14159265358979, 0, 0], on a wall [0, 1.5707963267949, 0].
    pub base: Option<BaseTable>,
    /// Moving joints that the log does not have, and where they stand (rad or m).
    pub locked: BTreeMap<String, f64>,
    /// Count `<dynamics damping="…">` of a URDF as nominal torque. Vendors put solver values there: default false.
    pub use_urdf_friction: Option<bool>,
    /// What is accepted with a warning instead of being refused (flag `--allow`).
    pub allow: Option<Vec<Allow>>,
}

/// `[model] base`
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct BaseTable {
    /// Roll, pitch and yaw about the world's fixed x, y and z axes, in this order, rad.
    pub rpy: [f64; 3],
}

/// What may be accepted with a warning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Allow {
    /// Physically inconsistent inertia tensors.
    UnphysicalInertia,
    /// Gibbs chains that disagree (R̂ > 1.01): their numbers are reported and labelled.
    DisagreeingChains,
}

/// The logs, as `log_forms` reads them: what holds for all logs without an entry of their own, and the entries.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LogTable {
    /// Logs to score on instead of a split of the fitted ones, relative to this config (flag `--heldout`).
    pub heldout: Option<Vec<PathBuf>>,
    /// Sampling rate, Hz, that replaces the time stamps.
    pub rate_hz: Option<f64>,
    /// Drop and count rows that cannot be read.
    pub lenient: Option<bool>,
    /// Refuse a log where data was lost or degraded beyond the stated limit (flag `--strict`).
    pub strict: Option<bool>,
    /// Topics of a bag that are read.
    pub topic: Option<Topics>,
    /// Whose recorder wrote the table.
    pub preset: Option<PresetWord>,
    /// What the logged torque is.
    pub torque: Option<TorqueWord>,
    /// Turns of the motor per turn of the joint, by joint name.
    pub gear_ratio: BTreeMap<String, f64>,
    /// Motor torque per current, N·m/A, by joint name.
    pub drive_constant: BTreeMap<String, f64>,
    /// Take a column that holds the controller's own model of the torque for a measurement.
    pub accept_model_torque: Option<bool>,
    /// The entries with a file.
    pub entries: Vec<LogEntry>,
}

impl LogTable {
    /// Has all logs read at this rate, Hz, whatever their entries say (flag `--rate`).
    pub fn set_rate(&mut self, rate_hz: f64) {
        self.rate_hz = Some(rate_hz);
        let entries = self.entries.iter_mut();
        entries.for_each(|entry| entry.rate_hz = Some(rate_hz));
    }

    /// Has rows of all logs that cannot be read dropped and counted (flag `--lenient`).
    pub fn set_lenient(&mut self) {
        self.lenient = Some(true);
        let entries = self.entries.iter_mut();
        entries.for_each(|entry| entry.lenient = Some(true));
    }
}

/// One log and what is known of it; see `LogKeys` for the keys.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LogEntry {
    /// The log, relative to this config.
    pub file: PathBuf,
    /// What the robot carried beyond its model.
    pub payload: Option<PayloadKey>,
    /// Score on this log instead of fitting it.
    pub heldout: Option<bool>,
    /// Sampling rate, Hz, that replaces the time stamps.
    pub rate_hz: Option<f64>,
    /// Drop and count rows that cannot be read.
    pub lenient: Option<bool>,
    /// Topics of a bag that are read.
    pub topic: Option<Topics>,
    /// Whose recorder wrote the table.
    pub preset: Option<PresetWord>,
    /// What the logged torque is.
    pub torque: Option<TorqueWord>,
    /// Turns of the motor per turn of the joint, by joint name.
    pub gear_ratio: BTreeMap<String, f64>,
    /// Motor torque per current, N·m/A, by joint name.
    pub drive_constant: BTreeMap<String, f64>,
    /// Take a column that holds the controller's own model of the torque for a measurement.
    pub accept_model_torque: Option<bool>,
}

/// One topic or several.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a topic or a list of topics")]
pub enum Topics {
    /// One.
    One(String),
    /// Several.
    Several(Vec<String>),
}

/// A recorder whose column names are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PresetWord {
    /// Universal Robots, RTDE: timestamp, actual_q_0, actual_qd_0, actual_current_0.
    UrRtde,
    /// Franka, libfranka: time in milliseconds, `q[0]`, `dq[0]`, `tau_J[0]`.
    Franka,
}

/// What the logged torque is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TorqueWord {
    /// Torque on the joint's side of the gear, N·m or N.
    Joint,
    /// Torque on the motor's side of the gear, N·m: times gear_ratio.
    Motor,
    /// Motor current, A: times drive_constant and gear_ratio.
    Current,
    /// Left out: a log that is only to be predicted.
    None,
}

/// The word "unknown".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum UnknownWord {
    /// To be found in the log.
    #[serde(rename = "unknown")]
    Unknown,
}

/// A payload or "unknown".
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected { mass = kg, com = [x, y, z] } or \"unknown\""
)]
pub enum PayloadKey {
    /// As given.
    Known {
        /// kg.
        #[schemars(extend("minimum" = 0))]
        mass: f64,
        /// Centre of mass in the payload frame, m.
        com: [f64; 3],
    },
    /// To be found in the log.
    Unknown(UnknownWord),
}

/// `[library]`
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct LibraryTable {
    /// Expressions in ΔL of q1…qn, qd1…qdn: the moving joints in the model's order. Example: "qd1*qd2*cos(q2)".
    pub terms: Vec<String>,
    /// The built-in trigonometric and polynomial family; default: on up to 3 joints.
    pub generic: Option<bool>,
    /// Built-in families of physical components. Default: all but ripple; with own `terms`
    /// or `generic = true`: viscous, coulomb, offset and motor_inertia.
    pub families: Option<Vec<FamilyWord>>,
    /// Link in whose frame the payload is described; default: the last link.
    pub payload_frame: Option<String>,
    /// Total viscous friction, Coulomb friction and motor inertia of a joint are at least 0; default true.
    pub nonnegative: Option<bool>,
    /// Gear ripple: periods per turn of a joint (the gear ratio), by joint name; {} for none, not even where the logs show it.
    pub ripple: Option<BTreeMap<String, f64>>,
    /// Friction per joint; default ["viscous", "coulomb"]; [] for none.
    pub friction: Option<Vec<Friction>>,
    /// A constant torque offset per joint; default true.
    pub offset: Option<bool>,
    /// Reflected motor inertia per joint; default true.
    pub motor_inertia: Option<bool>,
    /// v_s of Coulomb friction tanh(q̇/v_s), rad/s or m/s; 0 is sign(q̇). Default: 0 with cutoff_hz = 0, else chosen by the training data
    /// from 0.005 to 0.08, 0.02 where they have no clear preference.
    #[schemars(extend("minimum" = 0))]
    pub coulomb_velocity: Option<f64>,
}

impl LibraryTable {
    /// `ripple = {}` is none; where `families` stands, be it the usual ones, nothing is added to them.
    pub(super) fn unasked_ripple(&self) -> UnaskedRipple {
        match (&self.ripple, &self.families) {
            (Some(stated), _) if stated.is_empty() => UnaskedRipple::Ignored,
            (_, Some(_)) => UnaskedRipple::Told,
            (_, None) => UnaskedRipple::Candidate,
        }
    }
}

/// A kind of joint friction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Friction {
    /// Proportional to velocity.
    Viscous,
    /// Constant against the motion.
    Coulomb,
}

/// A built-in family of components.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FamilyWord {
    /// `<joint>.viscous`: friction proportional to velocity.
    Viscous,
    /// `<joint>.coulomb`: constant friction against the motion.
    Coulomb,
    /// `<joint>.offset`: constant torque.
    Offset,
    /// `<joint>.motor_inertia`: rotor inertia seen through the gear.
    MotorInertia,
    /// `payload`: a body at the tool.
    Payload,
    /// `<link>.density`: mass, first moments and tensor of a link by one factor.
    Density,
    /// `<link>.mass_moments`: first moments of a link beside its density: its centre of mass.
    MassMoments,
    /// `<link>.tensor`: inertia tensor of a link beside its density.
    Tensor,
    /// `base.tilt`: direction and size of gravity in the base.
    Tilt,
    /// `<joint>.spring`: spring with rest position.
    Spring,
    /// `<joint>.potential`: conservative torque of one joint, two harmonics.
    Potential,
    /// `<joint>.asymmetry`: friction that depends on the direction.
    Asymmetry,
    /// `<joint>.stribeck`: friction that falls from breakaway to sliding.
    Stribeck,
    /// `<joint>.quadratic_friction`: friction that is not in proportion to the speed.
    QuadraticFriction,
    /// `<joint>.load_friction`: friction that grows with the load.
    LoadFriction,
    /// `<a>+<b>.coupled_friction`: friction of a motor that turns with two joints.
    CoupledFriction,
    /// `<a>+<b>.coupled_inertia`: rotor inertia of a motor that turns with two joints.
    CoupledInertia,
    /// `<joint>.gain`: torque scaled by a factor (drive constant).
    Gain,
    /// `<joint>.encoder_zero`: zero position of an encoder.
    EncoderZero,
    /// `<joint>.ripple`: gear ripple; needs `ripple = { joint = gear ratio }`.
    Ripple,
    /// `<joint>.hysteresis`: friction that builds up over milliradians after a velocity reversal.
    Hysteresis,
    /// `<joint>.warm_up`: friction that changes with the time since the log's start, or with logged temperature.
    WarmUp,
}

impl From<FamilyWord> for Family {
    fn from(word: FamilyWord) -> Self {
        match word {
            FamilyWord::Viscous => Self::Viscous,
            FamilyWord::Coulomb => Self::Coulomb,
            FamilyWord::Offset => Self::Offset,
            FamilyWord::MotorInertia => Self::MotorInertia,
            FamilyWord::Payload => Self::Payload,
            FamilyWord::Density => Self::Density,
            FamilyWord::MassMoments => Self::MassMoments,
            FamilyWord::Tensor => Self::Tensor,
            FamilyWord::Tilt => Self::Tilt,
            FamilyWord::Spring => Self::Spring,
            FamilyWord::Potential => Self::Potential,
            FamilyWord::Asymmetry => Self::Asymmetry,
            FamilyWord::Stribeck => Self::Stribeck,
            FamilyWord::QuadraticFriction => Self::QuadraticFriction,
            FamilyWord::LoadFriction => Self::LoadFriction,
            FamilyWord::CoupledFriction => Self::CoupledFriction,
            FamilyWord::CoupledInertia => Self::CoupledInertia,
            FamilyWord::Gain => Self::Gain,
            FamilyWord::EncoderZero => Self::EncoderZero,
            FamilyWord::Ripple => Self::Ripple,
            FamilyWord::Hysteresis => Self::Hysteresis,
            FamilyWord::WarmUp => Self::WarmUp,
        }
    }
}

/// The word "auto".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum AutoWord {
    /// Chosen from the data and stated in the result.
    #[serde(rename = "auto")]
    Auto,
}

/// A number or "auto".
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a number or \"auto\"")]
pub enum NumberOrAuto {
    /// As given.
    Number(f64),
    /// Chosen from the data.
    Auto(AutoWord),
}

/// A lag, or "auto".
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected \"auto\", seconds, or seconds by joint such as { elbow = 0.008 }"
)]
pub enum LagOrAuto {
    /// Estimated from the training logs.
    Auto(AutoWord),
    /// As given.
    Given(PerJoint),
}

/// `[signal]`
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct SignalTable {
    /// Cut-off of the low-pass on torque and columns, Hz; default "auto". 0: every input row is one row, no filter,
    /// decimation, resampling, trimming or standstill mask.
    pub cutoff_hz: Option<NumberOrAuto>,
    /// Rate of the kept rows, Hz; default "auto" = 2.5 × cut-off.
    pub rate_hz: Option<NumberOrAuto>,
    /// How much later than the motion torque was logged, s: torque is moved back by it. Default "auto": estimated from the training logs and
    /// applied where it is clear. One number for all joints, or { joint = seconds }; negative where torque comes first; 0 leaves torque as logged.
    pub lag: Option<LagOrAuto>,
    /// Default true: where what is left of the torque is noise of one memory (an AR(1)) on every joint, the fit goes on up to four
    /// times the automatic cut-off with `noise.model = "ar1"`; a note says so. false: never. Nor does it where `cutoff_hz`, `rate_hz` or
    /// `noise.model` is stated, or rows are weighed (`noise.robust`, `varies_with_…`).
    pub wider_band: Option<bool>,
    /// "logged": as logged, where they are; "position": not used but derived from position. Default: as logged, but from position where the
    /// logged one has by far more noise (finding `noisy_velocity`).
    pub velocity: Option<VelocityWord>,
}

/// Where velocity comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum VelocityWord {
    /// The log.
    Logged,
    /// The change of position.
    Position,
}

/// `[prior]`
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct PriorTable {
    /// Slab: { scaled_variance = v } for β_k·rms(column k) ~ N(0, v φ); default "auto": learned.
    pub slab: Option<Slab>,
    /// { expected_terms = m } (default) or { probability = p }.
    pub inclusion: Option<InclusionTable>,
    /// { shape = a0, scale = b0 } of φ ~ InvGamma(a0, b0), scale in (N·m)²; default "auto".
    pub noise: Option<NoisePrior>,
    /// Expected number of components of single families, such as { spring = 0.5, potential = 0.2 }: more than 0 and fewer than
    /// the family has candidates, before heredity. The names are those of `terms[].family`.
    #[schemars(extend("additionalProperties" = { "type": "number", "exclusiveMinimum": 0 }))]
    pub families: BTreeMap<String, f64>,
    /// Components that are in, whatever the data say, such as ["elbow.viscous"].
    pub forced: Option<Vec<String>>,
    /// Heredity: what is in only where something else is, such as { stribeck = "coulomb", "sin(2*q2)" = "sin(q2)" }; families joint by
    /// joint, or components by name. Default: { asymmetry = "coulomb", stribeck = "coulomb", quadratic_friction = "viscous", coupled_inertia = "coupled_friction", hysteresis = "coulomb", warm_up = "coulomb", mass_moments = "density" }; {} binds nothing.
    pub heredity: Option<BTreeMap<String, String>>,
    /// Prior sd of a factor on torque that all drives share, as a share of 1: it widens the intervals of masses and inertias unless two known
    /// payloads were logged. Default: 0.07 where the torque of `[[log]]` is "motor" or "current", else 0; set it where the torque in the log was made of
    /// currents and catalogue constants.
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 1))]
    pub drive_gain: Option<f64>,
}

/// The slab or "auto".
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected { scaled_variance = number } or \"auto\""
)]
pub enum Slab {
    /// As given.
    Given {
        /// v in β_k·rms(column k) ~ N(0, v φ).
        #[schemars(extend("exclusiveMinimum" = 0))]
        scaled_variance: f64,
    },
    /// Learned by evidence.
    Auto(AutoWord),
}

/// How many terms are expected; exactly one of the keys.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields, extend("minProperties" = 1, "maxProperties" = 1))]
pub struct InclusionTable {
    /// Every column independently with this probability, in (0, 1).
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub probability: Option<f64>,
    /// Beta–Binomial per family so that this many terms are expected in total.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub expected_terms: Option<f64>,
}

/// The prior of the noise variance or "auto".
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected { shape = number, scale = number } or \"auto\""
)]
pub enum NoisePrior {
    /// As given.
    Given {
        /// a0.
        #[schemars(extend("exclusiveMinimum" = 0))]
        shape: f64,
        /// b0, (N·m)².
        #[schemars(extend("exclusiveMinimum" = 0))]
        scale: f64,
    },
    /// (1e-3, 1e-3 · the noise that the fit finds).
    Auto(AutoWord),
}

/// `[noise]`
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct NoiseTable {
    /// Likelihood; default "tempered".
    pub model: Option<NoiseWord>,
    /// A variance per joint (default); false: one for all joints.
    pub per_joint: Option<bool>,
    /// Outliers count less: rows are weighed as a Student-t likelihood with 4 degrees of freedom weighs them; with "tempered"
    /// only; default false.
    pub robust: Option<bool>,
    /// The noise of a joint may change with its speed (learned from the residual, in intervals too); with "tempered" only;
    /// default false.
    pub varies_with_speed: Option<bool>,
    /// The noise of a joint may change with the size of its nominal torque (likewise); with "tempered" only; default false.
    pub varies_with_load: Option<bool>,
}

/// A likelihood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NoiseWord {
    /// Independent rows, statistics divided by the residual's autocorrelation time.
    Tempered,
    /// First-order autoregression per joint.
    Ar1,
    /// Independent rows (the paper's).
    Iid,
}

/// `[inference]`
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct InferenceTable {
    /// Default "auto": exact where every model can be summed, else Gibbs.
    pub method: Option<MethodWord>,
    /// Gibbs chains; default 4.
    #[schemars(extend("minimum" = twincal::infer::LEAST_CHAINS))]
    pub chains: Option<u64>,
    /// Draws per chain after warm-up; default 5000.
    #[schemars(extend("minimum" = twincal::infer::LEAST_DRAWS))]
    pub draws: Option<u64>,
    /// Seed of all random numbers; default 1 (flag `--seed`).
    pub seed: Option<u64>,
    /// Threads; the result is the same for any number; default: one per core (flag `--threads`).
    #[schemars(extend("minimum" = 1))]
    pub threads: Option<u64>,
}

/// A method of inference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MethodWord {
    /// Exact where possible.
    Auto,
    /// Every model is summed.
    Exact,
    /// Collapsed Gibbs sampling.
    Gibbs,
}

/// `[check]`
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct CheckTable {
    /// Largest allowed RMSE of a joint relative to the RMSE stored in the twin; default 1.2.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub rmse_ratio: Option<f64>,
    /// Smallest and largest allowed coverage of the 95 % interval of a joint; default: 0.90, or up to 0.05 below the twin's own where that is less than 0.90, to 1.0.
    pub coverage: Option<[f64; 2]>,
}

/// `[output]`
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct OutputTable {
    /// Folder of the result, relative to this config (flag `-o`); default `twincal-out` in the working folder.
    pub directory: Option<PathBuf>,
    /// Replace an earlier result (flag `--force`).
    pub force: Option<bool>,
    /// Print the result as JSON (flag `--json`).
    pub json: Option<bool>,
}
