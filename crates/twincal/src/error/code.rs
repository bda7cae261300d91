//! The one list of what a finding can say: a name that programs read, and its meaning.

use serde::{Deserialize, Serialize};

macro_rules! codes {
    ($($(#[doc = $meaning:literal])+ $code:ident = $name:literal,)+) => {
        /// What a [`Finding`](super::Finding) says. In files it is [`Code::as_str`], which does not change from version to version.
        ///
        /// # Example
        /// ```
        /// use twincal::Code;
        ///
        /// assert_eq!(Code::EncoderStuck.as_str(), "encoder_stuck");
        /// assert_eq!(Code::named("encoder_stuck"), Some(Code::EncoderStuck));
        /// println!("{}", Code::EncoderStuck.meaning());
        /// ```
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[non_exhaustive]
        pub enum Code {
            $($(#[doc = $meaning])+ #[serde(rename = $name)] $code,)+
        }

        impl Code {
            /// All of them, by name.
            pub const ALL: &[Self] = &[$(Self::$code,)+];

            /// Its name in files: snake_case.
            #[must_use]
            pub const fn as_str(self) -> &'static str {
                match self {
                    $(Self::$code => $name,)+
                }
            }

            /// What it means, in a sentence or two.
            #[must_use]
            pub const fn meaning(self) -> &'static str {
                match self {
                    $(Self::$code => concat!($($meaning,)+).trim_ascii(),)+
                }
            }
        }
    };
}

codes! {
    /// The gear of an actuator turns its force into torque of the joint.
    ActuatorGear = "actuator_gear",
    /// A part of an actuator of the model is not read.
    ActuatorNotUsed = "actuator_not_used",
    /// A candidate has the torque of others on every motion and was left out.
    Alias = "alias",
    /// Whether a candidate has the torque of others could not be told.
    AliasUnchecked = "alias_unchecked",
    /// In these logs effects have the same torque: the data do not tell which of them is there.
    AlikeInData = "alike_in_data",
    /// On motion that training had, a held-out log leaves the intervals: it is of another robot, or of another state of it.
    AnotherState = "another_state",
    /// A joint's axis was not of length 1.
    AxisNormalised = "axis_normalised",
    /// The torque shows gravity in another direction than the model.
    BaseOrientation = "base_orientation",
    /// Filters use up the ends of each segment.
    Borders = "borders",
    /// Chains of the sampler disagree and were accepted as the settings allow.
    ChainsDisagree = "chains_disagree",
    /// A long log was read in chapters.
    Chapters = "chapters",
    /// Some chapters of a long log cannot be used.
    ChaptersLeftOut = "chapters_left_out",
    /// The clock of torque runs at another rate than that of the motion.
    ClockDrift = "clock_drift",
    /// The clock of a log runs several times too fast or too slow.
    ClockScale = "clock_scale",
    /// Logged numbers are multiplied by factors, as told.
    ColumnFactor = "column_factor",
    /// Which columns of a table were taken.
    Columns = "columns",
    /// Columns are read as those of the fit were.
    ColumnsAsFitted = "columns_as_fitted",
    /// Columns cannot be read as those of the fit were.
    ColumnsNotAsFitted = "columns_not_as_fitted",
    /// All joints' torque is off by one factor.
    CommonFactor = "common_factor",
    /// The compact twin predicts worse than the average of all models.
    CompactWorse = "compact_worse",
    /// Torque never changes while joints move.
    ConstantTorque = "constant_torque",
    /// The robot touched something; those samples are left out.
    Contact = "contact",
    /// Rows of one stamp have different values.
    ContradictingDuplicates = "contradicting_duplicates",
    /// Samples repeat because the controller's clock is slower than the log's.
    ControllerClock = "controller_clock",
    /// A log is a copy of another one.
    CopiedLog = "copied_log",
    /// Friction reverses within another velocity than usual.
    CoulombVelocity = "coulomb_velocity",
    /// Two twins have different reversal velocities of friction.
    CoulombVelocityDiffers = "coulomb_velocity_differs",
    /// On new logs the 95 % intervals of a joint hold a share of the rows outside the gate.
    CoverageOutsideGate = "coverage_outside_gate",
    /// Stamps lie in bunches.
    CrowdedStamps = "crowded_stamps",
    /// The last row of a table is cut off.
    CutRow = "cut_row",
    /// Chunks of a bag are damaged.
    DamagedChunks = "damaged_chunks",
    /// The data of a bag are damaged.
    DamagedData = "damaged_data",
    /// A decimal comma was read.
    DecimalComma = "decimal_comma",
    /// Which character separates the columns of a table.
    Delimiter = "delimiter",
    /// A coefficient changes with the cut-off.
    DependsOnCutoff = "depends_on_cutoff",
    /// Acceleration was derived, and how much noise that leaves.
    DerivedAcceleration = "derived_acceleration",
    /// Predicted distributions are too narrow, over all joints.
    DistributionNarrow = "distribution_narrow",
    /// Predicted distributions are wider than they need to be, over all joints.
    DistributionWide = "distribution_wide",
    /// The residual changes over a run.
    Drift = "drift",
    /// The residual goes with the temperature.
    DriftWithTemperature = "drift_with_temperature",
    /// A common error of all drive constants is in no interval.
    DriveGainIgnored = "drive_gain_ignored",
    /// A common error of all drive constants is in the intervals of masses.
    DriveGainUncertain = "drive_gain_uncertain",
    /// The drives were off; those samples are left out.
    DrivesOff = "drives_off",
    /// Rows that are there twice.
    DuplicateRows = "duplicate_rows",
    /// Effects are established.
    EffectsEstablished = "effects_established",
    /// The field `effort` is taken as joint torque.
    EffortIsJointTorque = "effort_is_joint_torque",
    /// Position holds one value while the joint moves.
    EncoderStuck = "encoder_stuck",
    /// An equality of the model is not read.
    EqualityNotUsed = "equality_not_used",
    /// On new logs the error of a joint is above the gate.
    ErrorAboveGate = "error_above_gate",
    /// The error left is larger than the torque itself, on every joint.
    ErrorAboveTorque = "error_above_torque",
    /// The error left is larger than the torque itself, on most joints.
    ErrorAboveTorqueOnMostJoints = "error_above_torque_on_most_joints",
    /// Factors of columns are those of the fit.
    FactorAsFitted = "factor_as_fitted",
    /// A factor of the fit's columns does not seem to belong to this log.
    FactorInDoubt = "factor_in_doubt",
    /// The rows of a joint count as few independent ones.
    FewEffectiveRows = "few_effective_rows",
    /// The held-out rows count as too few independent ones.
    FewHeldOutRows = "few_held_out_rows",
    /// A flag of the model is not read.
    FlagNotUsed = "flag_not_used",
    /// The drag of a medium is not read.
    FluidNotUsed = "fluid_not_used",
    /// An effect is in because the settings say so.
    Forced = "forced",
    /// What viscous and Coulomb friction and an offset alone would leave of the error.
    FrictionAlone = "friction_alone",
    /// Friction and an offset alone predict held-out torque better than the twin.
    FrictionAloneIsBetter = "friction_alone_is_better",
    /// On new logs the friction of a joint is another than that of the twin.
    FrictionChanged = "friction_changed",
    /// Friction would drive the joint at higher speed than was logged.
    FrictionTurnsNegative = "friction_turns_negative",
    /// Friction that the model states is no part of its torque.
    FrictionlossNotUsed = "frictionloss_not_used",
    /// Stamps have gaps.
    Gaps = "gaps",
    /// The robot has too many joints for the generic candidates.
    GenericFamilyOff = "generic_family_off",
    /// Gravity compensation of a body is not read.
    GravcompNotUsed = "gravcomp_not_used",
    /// Torque lacks gravity.
    GravityCompensated = "gravity_compensated",
    /// Residuals have more outliers than normal noise.
    HeavyTails = "heavy_tails",
    /// What is left out of a log cannot be predicted: too little remains for the fit.
    HeldoutNotScored = "heldout_not_scored",
    /// Friction with memory was not followed.
    HistoryNotFollowed = "history_not_followed",
    /// Steps of time are implausible.
    ImplausibleTimeStep = "implausible_time_step",
    /// The model's inertia is a placeholder: prior widths take a least one.
    InertiaFloor = "inertia_floor",
    /// The 95 % intervals hold what they promise, over all joints.
    IntervalsHold = "intervals_hold",
    /// The 95 % intervals of a joint hold another share than promised, which chance explains for so few rows.
    JointCoverageByChance = "joint_coverage_by_chance",
    /// The 95 % intervals of a joint hold a little less than 92 % or more than 98 % of its rows.
    JointCoverageOff = "joint_coverage_off",
    /// The predicted distribution of a joint is more than a little off.
    JointDistributionOff = "joint_distribution_off",
    /// The error left on a joint is as large as its torque: a constant would do as well.
    JointErrorAboveTorque = "joint_error_above_torque",
    /// The error left on a joint is more than half of the standard deviation of its torque.
    JointErrorLarge = "joint_error_large",
    /// On a joint friction and an offset alone do about as well.
    JointFrictionAlone = "joint_friction_alone",
    /// On a joint friction and an offset alone would be worse than the model.
    JointFrictionAloneWorse = "joint_friction_alone_worse",
    /// The 95 % intervals of a joint are too narrow.
    JointIntervalsNarrow = "joint_intervals_narrow",
    /// The 95 % intervals of a joint are wider than they need to be.
    JointIntervalsWide = "joint_intervals_wide",
    /// A joint is hardly driven in a log.
    JointNotDriven = "joint_not_driven",
    /// A joint is at rest in all training logs.
    JointNotExcited = "joint_not_excited",
    /// The joints of a log seem exchanged.
    JointOrder = "joint_order",
    /// The error left in a joint's torque as it was logged is as large as that torque.
    JointRawErrorAboveTorque = "joint_raw_error_above_torque",
    /// A joint does not move in a log.
    JointStandsStill = "joint_stands_still",
    /// The torque of one joint has another scale in one log.
    JointTorqueFactor = "joint_torque_factor",
    /// The torque of a joint got worse by calibration.
    JointTorqueWorse = "joint_torque_worse",
    /// At standstill the torque of a joint got worse by calibration.
    JointWorseAtRest = "joint_worse_at_rest",
    /// On new logs the zero of a joint is another than that of the twin.
    JointZeroChanged = "joint_zero_changed",
    /// Joints of a log that the model does not have.
    JointsLeftOut = "joints_left_out",
    /// The error that is left is large on every joint.
    LargeError = "large_error",
    /// The error that is left is large on most joints.
    LargeErrorOnMostJoints = "large_error_on_most_joints",
    /// Messages come out of order.
    LateMessages = "late_messages",
    /// A link with a moving joint has no inertia.
    LinkWithoutInertia = "link_without_inertia",
    /// A joint is locked outside its limits.
    LockedBeyondLimits = "locked_beyond_limits",
    /// A joint that is locked is fixed in the model.
    LockedFixedJoint = "locked_fixed_joint",
    /// Time is that of the recorder.
    LogTime = "log_time",
    /// Two joints of one log have each other's torque.
    LogTorqueExchanged = "log_torque_exchanged",
    /// The torque of one log has another scale than that of the others.
    LogTorqueFactor = "log_torque_factor",
    /// Torque of one log is later or earlier than in the others.
    LogTorqueLag = "log_torque_lag",
    /// The twin was fitted to this log.
    LogWasFitted = "log_was_fitted",
    /// The twin was tested on this log when it was fitted.
    LogWasHeldout = "log_was_heldout",
    /// A lower cut-off was taken.
    LowerBand = "lower_band",
    /// A link without inertia is taken as a frame.
    MasslessFrame = "massless_frame",
    /// An equality of the model is read as a coupled joint.
    MimicFromEquality = "mimic_from_equality",
    /// What no candidate describes counts as noise.
    Misfit = "misfit",
    /// Torque is missing in some rows.
    MissingTorque = "missing_torque",
    /// Entries without names were taken in the model's order.
    ModelOrder = "model_order",
    /// Torque lacks what the model predicts.
    ModelTorque = "model_torque",
    /// The cut-off of the motion filter is lower than wanted.
    MotionFilterCapped = "motion_filter_capped",
    /// Single samples of the motion are off and left out.
    MotionSpike = "motion_spike",
    /// A joint moves no mass.
    MovesNoMass = "moves_no_mass",
    /// The 95 % intervals hold too little, over all joints.
    NarrowIntervals = "narrow_intervals",
    /// The 95 % intervals of joints that move hold too little; at standstill torque got worse.
    NarrowIntervalsInMotion = "narrow_intervals_in_motion",
    /// Held-out torque is no better than that of the model.
    NoBetterThanNominal = "no_better_than_nominal",
    /// A bag has no metadata.
    NoMetadata = "no_metadata",
    /// Noise varies with load.
    NoiseVariesWithLoad = "noise_varies_with_load",
    /// Noise varies with speed.
    NoiseVariesWithSpeed = "noise_varies_with_speed",
    /// Logged velocity is noisier than the one derived from position.
    NoisyVelocity = "noisy_velocity",
    /// The sampler has not converged.
    NotConverged = "not_converged",
    /// Rows with values that are no numbers.
    NotFiniteRows = "not_finite_rows",
    /// Effects that these logs do not show.
    NotSeen = "not_seen",
    /// No row was held out.
    NotTested = "not_tested",
    /// A wider band was tried and not taken.
    NotWider = "not_wider",
    /// Effects were found, and none of them is established.
    NothingEstablished = "nothing_established",
    /// None of the candidates is in these logs.
    NothingFound = "nothing_found",
    /// The nominal model explains the torque to rounding.
    NothingToCorrect = "nothing_to_correct",
    /// A candidate has no torque at all: its Lagrangian is null.
    NullLagrangian = "null_lagrangian",
    /// Outliers count less.
    OutliersWeighed = "outliers_weighed",
    /// Joints that come in messages of their own were brought to one clock.
    PartsMerged = "parts_merged",
    /// All checks are passed.
    Passed = "passed",
    /// On new logs the payload is another than that of the twin.
    PayloadChanged = "payload_changed",
    /// The filters that were chosen.
    Pipeline = "pipeline",
    /// Estimates that the posterior takes as given had not settled.
    PlugInsNotSettled = "plug_ins_not_settled",
    /// A link with mass has no tensor.
    PointMass = "point_mass",
    /// Position jumps and stays there.
    PositionStep = "position_step",
    /// What was found is far out in its prior.
    PriorConflict = "prior_conflict",
    /// An exported program leaves out what depends on the past.
    ProgramForgets = "program_forgets",
    /// The steps of an encoder are coarse.
    QuantisedEncoder = "quantised_encoder",
    /// Rows are kept at the rate of the slowest log.
    RateCapped = "rate_capped",
    /// The rate of rows has no effect without a filter.
    RateIgnored = "rate_ignored",
    /// The error of torque as it was logged, which is another than that of filtered torque.
    RawTorqueError = "raw_torque_error",
    /// Unfiltered torque is predicted worse than by the model.
    RawTorqueWorse = "raw_torque_worse",
    /// Candidates were linearised about what was found.
    Relinearised = "relinearised",
    /// Samples are logged several times.
    RepeatedSamples = "repeated_samples",
    /// An uneven clock was resampled.
    Resampled = "resampled",
    /// The residual is correlated, which the settings ignore.
    ResidualCorrelated = "residual_correlated",
    /// A joint is at rest in the logs and hardly in held-out rows.
    RestNotTested = "rest_not_tested",
    /// Gear ripple was found in the residual and added to the candidates.
    RippleAdded = "ripple_added",
    /// The residual repeats with the joint's angle.
    RippleSeen = "ripple_seen",
    /// Rows are further apart than the cut-off allows.
    RowsAlias = "rows_alias",
    /// Torque is flat at its limit.
    SaturatedTorque = "saturated_torque",
    /// Stretches of the logs disagree more than the stated sd says.
    SdTooSmall = "sd_too_small",
    /// The torque of a joint, or of all joints together, lies above the middle of the prediction too often.
    ShapeAbove = "shape_above",
    /// The torque of a joint, or of all joints together, lies below the middle of the prediction too often.
    ShapeBelow = "shape_below",
    /// The predicted distribution of a joint, or of all joints together, is too narrow.
    ShapeNarrow = "shape_narrow",
    /// The predicted probabilities of a joint are not evenly spread.
    ShapeUneven = "shape_uneven",
    /// The predicted distribution of a joint, or of all joints together, is wider than it needs to be.
    ShapeWide = "shape_wide",
    /// Segments are shorter than the filters.
    ShortSegments = "short_segments",
    /// The sign of a joint's columns is turned.
    SignFlip = "sign_flip",
    /// Some channels are logged at a lower rate.
    SlowerChannels = "slower_channels",
    /// The fit took fewer candidates.
    SmallerLibrary = "smaller_library",
    /// Torque repeats its last value for some rows.
    StaleTorque = "stale_torque",
    /// A joint is at rest in some rows; its torque there is not fitted.
    Standstill = "standstill",
    /// A temperature that is missing in some chapters was left out.
    TemperatureLeftOut = "temperature_left_out",
    /// The log has no temperature of joints whose friction changes with it.
    TemperatureMissing = "temperature_missing",
    /// A tendon of the model is not read.
    TendonNotUsed = "tendon_not_used",
    /// Most held-out rows of a joint are motion that training did not have.
    TestedOnNewMotion = "tested_on_new_motion",
    /// On most held-out rows of a joint training leaves its torque open.
    TestedOnOpenTorque = "tested_on_open_torque",
    /// Time starts elsewhere than at 0.
    TimeOrigin = "time_origin",
    /// Stamps are replaced by a given rate.
    TimeReplaced = "time_replaced",
    /// Where stamps come from.
    TimeSource = "time_source",
    /// Stamps step back.
    TimeStepsBack = "time_steps_back",
    /// The unit of stamps.
    TimeUnit = "time_unit",
    /// A column is time by its type.
    TimestampType = "timestamp_type",
    /// New logs are too short to tell whether the twin still holds.
    TooShortToCheck = "too_short_to_check",
    /// Measured torque lies above its prediction too often, over all joints.
    TorqueAbovePrediction = "torque_above_prediction",
    /// Torque is read as that of the fit.
    TorqueAsFitted = "torque_as_fitted",
    /// Measured torque lies below its prediction too often, over all joints.
    TorqueBelowPrediction = "torque_below_prediction",
    /// Torque of a joint never changes.
    TorqueConstant = "torque_constant",
    /// Two joints have the same torque.
    TorqueCopied = "torque_copied",
    /// The error of held-out torque.
    TorqueError = "torque_error",
    /// The error at standstill, which is another than that of moving joints.
    TorqueErrorAtRest = "torque_error_at_rest",
    /// Torque holds its value while the joint changes its speed.
    TorqueHeld = "torque_held",
    /// Torque is logged later or earlier than the motion.
    TorqueLag = "torque_lag",
    /// Torque has another scale than the model's.
    TorqueScale = "torque_scale",
    /// What torque is measured by.
    TorqueSource = "torque_source",
    /// A bag is cut off.
    Truncated = "truncated",
    /// The link `world` is used and not defined.
    UndefinedWorldLink = "undefined_world_link",
    /// Elements of the model are not known.
    UnknownElements = "unknown_elements",
    /// A joint has no name.
    UnnamedJoint = "unnamed_joint",
    /// The inertia of a link in the model is physically inconsistent.
    UnphysicalInertia = "unphysical_inertia",
    /// The inertia that was found of a link is physically inconsistent.
    UnphysicalInertiaFound = "unphysical_inertia_found",
    /// The inertia that was found of several links is physically inconsistent.
    UnphysicalLinks = "unphysical_links",
    /// Cells of a table are no numbers.
    UnreadableRows = "unreadable_rows",
    /// Motion that the robot can make and the logs do not have.
    UnseenMotion = "unseen_motion",
    /// Friction that the model states is no part of its torque: all of it is found.
    UrdfDynamics = "urdf_dynamics",
    /// Logged velocity is not the derivative of position.
    VelocityMismatch = "velocity_mismatch",
    /// Logged velocity has the opposite sign of the change of position.
    VelocityOpposite = "velocity_opposite",
    /// The answer about a twin, where it is not a plain yes.
    Verdict = "verdict",
    /// The 95 % intervals hold more than they promise, over all joints.
    WideIntervals = "wide_intervals",
    /// The fit took a wider band.
    WiderBand = "wider_band",
    /// At standstill torque got worse by calibration.
    WorseAtRest = "worse_at_rest",
    /// In the few pauses of the held-out logs torque got worse by calibration.
    WorseInFewPauses = "worse_in_few_pauses",
    /// On motion that training did not have a joint is predicted worse.
    WorseOnNewMotion = "worse_on_new_motion",
    /// Where training leaves the torque of a joint open it is predicted worse.
    WorseOnOpenTorque = "worse_on_open_torque",
    /// The twin predicts torque worse than the model.
    WorseThanModel = "worse_than_model",
    /// Held-out torque is worse than that of the model.
    WorseThanNominal = "worse_than_nominal",
    /// Angles jump by a full turn.
    WrappedAngle = "wrapped_angle",
    /// A candidate has no torque in these logs.
    ZeroColumn = "zero_column",
}

impl Code {
    /// The code of this name; `None` where there is none.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|own| own.as_str() == name)
    }
}

impl std::fmt::Display for Code {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::Code;

    #[test]
    fn names_are_the_identifiers_in_snake_case_in_order_and_each_means_something() {
        let snake = |code: Code| {
            let mut name = String::new();
            for letter in format!("{code:?}").chars() {
                if letter.is_uppercase() && !name.is_empty() {
                    name.push('_');
                }
                name.extend(letter.to_lowercase());
            }
            name
        };
        for &code in Code::ALL {
            assert_eq!(code.as_str(), snake(code));
            assert_eq!(Code::named(code.as_str()), Some(code));
            assert!(code.meaning().ends_with('.'), "{code}: {}", code.meaning());
        }
        assert_eq!(Code::named("no_such_code"), None);
    }
}
