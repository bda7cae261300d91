//! The one list of what findings of each code have: severities and names of their evidence.

use super::Code;
use super::Severity::{self, Degraded, Note, Warning};

/// What findings of a code have.
struct Row {
    code: Code,
    /// In their order.
    severities: &'static [Severity],
    /// By name; not every finding of the code has all of them.
    evidence: &'static [&'static str],
}

macro_rules! table {
    ($($code:ident: $($severity:ident)+ => $($name:literal)*;)+) => {
        /// A code without a row is that of a claim only. A place that makes a finding otherwise fails `tests/finding_sources.rs`.
        const TABLE: &[Row] = &[$(Row {
            code: Code::$code,
            severities: &[$($severity,)+],
            evidence: &[$($name,)*],
        },)+];
    };
}

/// Codes whose messages do not name the log that they are about.
const WITHOUT_THEIR_LOG: &[Code] = &[
    Code::Borders,
    Code::Chapters,
    Code::ChaptersLeftOut,
    Code::ColumnFactor,
    Code::Columns,
    Code::ColumnsAsFitted,
    Code::ColumnsNotAsFitted,
    Code::ConstantTorque,
    Code::Contact,
    Code::ContradictingDuplicates,
    Code::ControllerClock,
    Code::CrowdedStamps,
    Code::CutRow,
    Code::DamagedChunks,
    Code::DamagedData,
    Code::DecimalComma,
    Code::Delimiter,
    Code::DrivesOff,
    Code::DuplicateRows,
    Code::EffortIsJointTorque,
    Code::FactorInDoubt,
    Code::Gaps,
    Code::ImplausibleTimeStep,
    Code::JointNotDriven,
    Code::JointStandsStill,
    Code::JointsLeftOut,
    Code::LateMessages,
    Code::LogTime,
    Code::MissingTorque,
    Code::ModelOrder,
    Code::MotionFilterCapped,
    Code::MotionSpike,
    Code::NoMetadata,
    Code::NotFiniteRows,
    Code::PartsMerged,
    Code::PositionStep,
    Code::RepeatedSamples,
    Code::Resampled,
    Code::SaturatedTorque,
    Code::ShortSegments,
    Code::SlowerChannels,
    Code::Standstill,
    Code::TemperatureLeftOut,
    Code::TemperatureMissing,
    Code::TimeOrigin,
    Code::TimeReplaced,
    Code::TimeSource,
    Code::TimeStepsBack,
    Code::TimeUnit,
    Code::TimestampType,
    Code::TorqueSource,
    Code::Truncated,
    Code::UnreadableRows,
    Code::VelocityMismatch,
    Code::WrappedAngle,
];

impl Code {
    /// True where messages of its findings leave out the log that they are about: it is their subject, and stands before them where there are several.
    #[must_use]
    pub fn leaves_out_its_log(self) -> bool {
        WITHOUT_THEIR_LOG.contains(&self)
    }

    /// Numbers that a finding of a long log has beside its own: the chapter that it is worst in, of how many, and in how many more it was found.
    pub const EVIDENCE_OF_CHAPTERS: &[&str] = &["chapter", "chapters", "chapters_alike"];

    fn row(self) -> Option<&'static Row> {
        TABLE.iter().find(|row| row.code == self)
    }

    /// Severities that its findings can have, in their order; none where only claims have this code.
    #[must_use]
    pub fn severities(self) -> &'static [Severity] {
        self.row().map_or(&[], |row| row.severities)
    }

    /// Names of the numbers that its findings can have, in alphabetical order.
    #[must_use]
    pub fn evidence(self) -> &'static [&'static str] {
        self.row().map_or(&[], |row| row.evidence)
    }
}

table! {
    ActuatorGear: Note => "gear";
    ActuatorNotUsed: Warning =>;
    Alias: Note Warning =>;
    AliasUnchecked: Note Warning =>;
    AlikeInData: Note Warning => "pip";
    AnotherState: Warning => "coverage95" "level";
    AxisNormalised: Note => "axis_x" "axis_y" "axis_z" "length";
    BaseOrientation: Degraded => "angle" "explained" "explained_before" "gravity_x" "gravity_y" "gravity_z" "pitch" "roll" "yaw";
    Borders: Note => "border" "seconds" "seconds_used";
    ChainsDisagree: Warning => "limit" "r_hat";
    Chapters: Note => "chapters" "samples_at_most";
    ChaptersLeftOut: Warning Degraded => "chapters" "chapters_left_out" "first_chapter";
    ClockDrift: Warning => "drift" "drift_sd" "logs";
    ClockScale: Degraded => "inertia_factor" "inertia_factor_sd" "slope" "time_factor";
    ColumnFactor: Note =>;
    Columns: Note =>;
    ColumnsAsFitted: Note =>;
    ColumnsNotAsFitted: Warning =>;
    CommonFactor: Warning Degraded => "factor" "factor_sd";
    CompactWorse: Warning => "rms_calibrated" "rms_compact";
    ConstantTorque: Warning Degraded => "torque";
    Contact: Warning => "first_from" "first_to" "first_torque" "times";
    ContradictingDuplicates: Warning Degraded => "share";
    ControllerClock: Note => "interval" "jitter" "missing" "rows" "share";
    CopiedLog: Degraded => "correlation" "correlation_sd" "first_row" "first_row_of_original" "seconds" "share";
    CoulombVelocity: Note => "error_reduction" "nats" "usual_velocity" "velocity";
    CoulombVelocityDiffers: Warning => "velocity_after" "velocity_before";
    CrowdedStamps: Warning => "share_of_step";
    CutRow: Warning => "line";
    DamagedChunks: Degraded => "chunks";
    DamagedData: Warning Degraded =>;
    DecimalComma: Note =>;
    Delimiter: Note =>;
    DependsOnCutoff: Warning => "change_in_sd" "cutoff" "mean" "mean_at_cutoff";
    DerivedAcceleration: Note => "acceleration_noise" "motion_cutoff" "position_noise" "velocity_noise";
    Drift: Warning => "change" "residual_sd";
    DriftWithTemperature: Warning => "residual_sd" "slope" "slope_sd" "temperature_high" "temperature_low";
    DriveGainIgnored: Warning => "gain_sd";
    DriveGainUncertain: Note => "gain_sd";
    DrivesOff: Warning => "first_from" "first_to" "first_torque" "times";
    DuplicateRows: Note =>;
    EffortIsJointTorque: Note =>;
    EncoderStuck: Warning => "from" "moved" "to";
    EqualityNotUsed: Warning =>;
    FactorAsFitted: Note =>;
    FactorInDoubt: Warning => "factor" "range" "range_in_fit";
    FewEffectiveRows: Warning => "independent_rows" "needed";
    FlagNotUsed: Warning =>;
    FluidNotUsed: Warning =>;
    Forced: Note =>;
    FrictionTurnsNegative: Warning => "coulomb" "quadratic" "velocity" "velocity_limit" "velocity_logged" "viscous";
    FrictionlossNotUsed: Note => "friction";
    Gaps: Note => "interval" "longest" "steps";
    GenericFamilyOff: Note => "joints" "joints_at_most" "terms";
    GravcompNotUsed: Warning =>;
    GravityCompensated: Degraded => "gravity_factor" "gravity_factor_sd" "inertia_factor" "inertia_factor_sd";
    HeavyTails: Warning => "limit_in_sd" "robust_sd" "rows" "share";
    HeldoutNotScored: Warning => "independent_rows" "needed";
    HistoryNotFollowed: Note => "joints";
    ImplausibleTimeStep: Warning => "interval" "rate";
    InertiaFloor: Note =>;
    JointNotDriven: Note => "rms_torque" "share";
    JointNotExcited: Warning =>;
    JointOrder: Degraded => "explained" "explained_before";
    JointStandsStill: Warning => "cutoff" "rest_velocity" "share_at_rest";
    JointTorqueFactor: Warning => "factor" "factor_sd";
    JointsLeftOut: Note =>;
    LateMessages: Note Warning => "latest" "messages";
    LinkWithoutInertia: Warning =>;
    LockedBeyondLimits: Warning => "high" "low" "position";
    LockedFixedJoint: Note => "position";
    LogTime: Warning => "lag_of_others";
    LogTorqueExchanged: Warning => "explained" "explained_before";
    LogTorqueFactor: Warning => "factor" "factor_sd";
    LogTorqueLag: Warning => "lag" "lag_sd";
    LogWasFitted: Note =>;
    LogWasHeldout: Note =>;
    LowerBand: Warning => "cutoff" "cutoff_tried";
    MasslessFrame: Note Warning => "largest_moment";
    MimicFromEquality: Note => "multiplier" "offset";
    Misfit: Note => "misfit";
    MissingTorque: Warning => "rows";
    ModelOrder: Note =>;
    ModelTorque: Degraded => "gravity_factor" "gravity_factor_sd" "inertia_factor" "inertia_factor_sd";
    MotionFilterCapped: Note Warning => "cutoff" "cutoff_wanted" "rate";
    MotionSpike: Warning => "largest" "largest_at";
    MovesNoMass: Warning =>;
    NoMetadata: Warning => "files";
    NoiseVariesWithLoad: Note => "ratio";
    NoiseVariesWithSpeed: Note => "ratio";
    NoisyVelocity: Warning => "velocity_noise" "velocity_noise_of_position";
    NotFiniteRows: Warning Degraded => "limit" "rows" "share";
    NotSeen: Note =>;
    NotWider: Note =>;
    NothingToCorrect: Note =>;
    NullLagrangian: Note Warning =>;
    OutliersWeighed: Note => "rows";
    PartsMerged: Note Warning => "rows";
    Pipeline: Note => "cutoff" "half_length" "motion_cutoff" "motion_half_length" "noise_gain" "rate";
    PlugInsNotSettled: Warning =>;
    PointMass: Note => "mass" "radius_of_gyration" "radius_of_tungsten";
    PositionStep: Warning => "largest" "largest_at";
    PriorConflict: Warning => "distance_in_sd" "mean" "noise_variance" "noise_variance_of_prior" "prior_sd" "sd";
    ProgramForgets: Note => "largest";
    QuantisedEncoder: Warning => "acceleration_noise" "step" "step_velocity" "velocity_noise";
    RateCapped: Note => "rate" "rate_wanted";
    RateIgnored: Warning => "rate";
    Relinearised: Note Warning => "change_in_sd";
    RepeatedSamples: Warning => "dropped" "first_at" "interpolated" "interval" "jitter" "missing" "most_on_a_joint" "rows" "share";
    Resampled: Note Warning => "jitter99" "jitter_largest" "jitter_limit" "rate" "steps_beyond";
    ResidualCorrelated: Warning => "autocorrelation_time" "sd_factor";
    RippleAdded: Note => "amplitude" "nats" "periods" "periods_backwards" "periods_forwards" "share";
    RippleSeen: Warning => "amplitude" "nats" "periods" "periods_backwards" "periods_forwards" "share";
    RowsAlias: Warning => "cutoff" "rate";
    SaturatedTorque: Warning => "level" "share_left_out" "times";
    SdTooSmall: Warning => "ratio";
    ShortSegments: Warning => "segments";
    SignFlip: Degraded => "explained" "explained_before";
    SlowerChannels: Warning => "every" "rows";
    SmallerLibrary: Warning =>;
    StaleTorque: Note => "first_at" "longest" "seconds";
    Standstill: Note => "cutoff" "rest_velocity" "share_at_rest";
    TemperatureLeftOut: Warning =>;
    TemperatureMissing: Warning =>;
    TendonNotUsed: Warning =>;
    TimeOrigin: Note => "origin";
    TimeReplaced: Note => "rate";
    TimeSource: Note => "lag";
    TimeStepsBack: Warning =>;
    TimeUnit: Note => "ticks_per_second";
    TimestampType: Note =>;
    TorqueAsFitted: Warning =>;
    TorqueConstant: Degraded => "torque" "torque_needed_sd";
    TorqueCopied: Degraded => "share";
    TorqueHeld: Degraded => "first_at" "longest" "seconds";
    TorqueLag: Note Warning Degraded => "error_reduction" "lag" "lag_of_others" "lag_sd";
    TorqueScale: Degraded => "effort_limit" "factor" "factor_sd" "largest_torque";
    TorqueSource: Note =>;
    Truncated: Warning Degraded => "byte";
    UndefinedWorldLink: Note =>;
    UnknownElements: Warning =>;
    UnnamedJoint: Note => "number";
    UnphysicalInertia: Warning => "principal_moment_1" "principal_moment_2" "principal_moment_3";
    UnphysicalInertiaFound: Note Warning => "chance" "share";
    UnreadableRows: Warning Degraded => "share";
    UnseenMotion: Note =>;
    UrdfDynamics: Note => "damping" "friction";
    VelocityMismatch: Warning => "r2" "slope";
    VelocityOpposite: Warning => "slope";
    Verdict: Warning =>;
    WiderBand: Note => "cutoff" "memory" "periodogram_distance" "periodogram_limit" "usual_cutoff" "variance_ratio" "variance_ratio_limit";
    WorseThanModel: Warning => "rms_calibrated" "rms_nominal";
    WrappedAngle: Note Warning =>;
    ZeroColumn: Warning =>;
}
