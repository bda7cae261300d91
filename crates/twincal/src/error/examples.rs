//! One message of a finding of each code, as the program prints it; `tests/finding_sources.rs` compares it with the places that make findings.

use super::Code;

macro_rules! examples {
    ($($code:ident: $message:literal;)+) => {
        const EXAMPLES: &[(Code, &str)] = &[$((Code::$code, $message),)+];
    };
}

impl Code {
    /// A message that a finding of it can have; `None` where only claims have this code.
    ///
    /// # Example
    /// ```
    /// use twincal::Code;
    ///
    /// let example = Code::RowsAlias.example().ok_or("none")?;
    /// assert!(example.starts_with("rows at 12 Hz are below twice the cut-off"));
    /// # Ok::<(), &str>(())
    /// ```
    #[must_use]
    pub fn example(self) -> Option<&'static str> {
        let own = EXAMPLES.iter().find(|(code, _)| *code == self);
        own.map(|(_, message)| *message)
    }
}

examples! {
    ActuatorGear: "actuator `lift` has gear 50: torque columns are those of joint `elbow`, which is 50 × the actuator's force; the gear itself changes no nominal torque";
    ActuatorNotUsed: "actuator `muscle` drives no single joint: its inertia and damping are not used";
    Alias: "term `elbow.spring2` has the same torque as +2 × `elbow.spring` for every motion: it is no column; keep one of them";
    AliasUnchecked: "term `log(q1 - 3)` is a finite number at too few states to be compared with the others: whether it repeats one of them was not checked; write it so that it exists for all motions of the robot";
    AlikeInData: "`payload` and `tool.tensor` can explain the same torque in every motion of this robot: at least one of them is in with probability >0.999; which one is open";
    AnotherState: "log `run3`: on motion that training had the 95 % intervals hold 61 % of joint `elbow`, clearly less than 95 %: is it another robot, or another state of it (payload, friction, temperature, gravity)? fit a log of that state too, or hold out another one";
    AxisNormalised: "joint `elbow`: axis [0.0, 0.0, 2.0] has length 2.000000; normalised to 1";
    BaseOrientation: "the torque shows gravity [0, -9.81, 0] m/s² in the base frame, the model has [0, 0, -9.81]: 90° apart, a robot on a wall; with it model and friction explain 97 % of the torque of joint `shoulder` instead of 12 %; nothing was changed: write base = { rpy = [1.5708, 0.0, 0.0] } under [model] in twincal.toml";
    Borders: "the filters need 0.312 s at either end of each segment: 59.375 of 60.000 s become rows";
    ChainsDisagree: "the 4 chains disagree (R-hat 1.034, limit 1.01) and were accepted as allowed: probabilities and coefficients may change with the seed; raise inference.draws";
    Chapters: "the log is long (1200000 samples) and was read in 10 chapters of up to 131072 samples, each cut at its ends";
    ChaptersLeftOut: "1 of 10 chapters cannot be used and were left out; the first is number 4: no stretch between cuts is longer than the motion filter (0.500 s); fix the gaps and NaN rows, or raise [signal] cutoff_hz";
    ClockDrift: "log `run3`: the clock of torque is 0.021 % ± 0.002 slower than that of the motion, so that its lag grows by 2.1 ms in 10 s: log both with one clock, or bring the stamps of torque to that of the motion";
    ClockScale: "log `run3`: the logged velocity of all joints is 2.000 times the change of their position: looks like a clock whose time is 2.000 times too long, or a velocity in another unit; nothing was changed: give the true rate with --rate HZ (2.000 times that of the stamps), or the factor 0.5000 for qd in [columns.factor]";
    ColumnFactor: "logged numbers are multiplied, as told: q of elbow -1";
    Columns: "time = t; elbow = q1 qd1 tau1 (no acceleration)";
    ColumnsAsFitted: "[columns] time, tau as in the fit; a key of [columns] in a --config says otherwise";
    ColumnsNotAsFitted: "the log does not have the columns that [columns] tau named in the fit: columns with the usual names are taken where there are some; [columns] in a --config says otherwise";
    CommonFactor: "torque of all joints is 1.24 ± 0.02 times what the model with its found effects asks for, gravity and inertia alike (`drives.gain`): looks like another unit or gain of the torque columns, drive constants that are all off, or a model in other units of mass, length or time; check the drive constants and the clock, or give [columns.factor] tau = 0.806. It was fitted: other effects are those of the true torque if the model's own masses are right";
    CompactWorse: "the compact twin (effects with probability 0.5 or more alone) predicts held-out torque worse than the average over all models: RMSE 0.412 instead of 0.305 on moving joints; effects below 0.5 matter here: predict with the twin as it is, and do not read the compact one's numbers for the robot's";
    ConstantTorque: "torque never changes while the joint moves (joint `elbow` is 0 throughout): the drives were off, or the column was not recorded; what is found there is wrong unless it swung freely; map the measured torque in [columns] tau, or leave this log out";
    Contact: "contact, collision or push, once: torque that no rigid body and no friction explains, from 12.31 s to 12.58 s (`elbow`, 34.2 N·m). These samples are left out of the fit, for all joints. Look at what touched the robot; nothing has to be done if that is known";
    ContradictingDuplicates: "12 rows (0.020 %) repeat a stamp with other values; the first of each was kept: look at how the log was joined";
    ControllerClock: "no row repeats the row before and 3 controller samples are missing; the stamps are a receiver's, off by 12 % of a step (median), while positions advance by whole steps of 8.000 ms; the rows are placed on that clock; log the controller's own stamps";
    CopiedLog: "log `run3` is a copy of `run1` or of a part of it: 98 % of the patterns in its torque noise are in both (independent recordings have hardly any); nothing is tested by a copy: give another recording instead of it";
    CoulombVelocity: "friction reverses within 0.02 rad/s (m/s) instead of the usual 0.05: the residual is 7 % smaller, 210 nats; [library] coulomb_velocity sets another";
    CoulombVelocityDiffers: "friction reverses within 0.05 rad/s (m/s) before and 0.02 after: its numbers differ for that alone; fit both with [library] coulomb_velocity = 0.05";
    CrowdedStamps: "14 rows follow the row before by less than 10 % of the median step and were dropped: stamp at the source, not at arrival";
    CutRow: "the file ends within line 60002, without a line feed; that row was left out: copy the file again if the recording went on";
    DamagedChunks: "1 of 32 chunks are damaged and were left out with their messages; the first: its checksum is wrong; record or copy the file again";
    DamagedData: "some bytes of the file were changed, its checksum over all data is wrong: values may be wrong; copy the file again";
    DecimalComma: "numbers are written with a decimal comma";
    Delimiter: "fields are separated by semicolons";
    DependsOnCutoff: "`elbow.viscous` moves by 1.8 sd when the cut-off becomes 20 Hz (mean over all models, in or out: from 0.412 to 0.38): do not read its interval as the whole uncertainty";
    DerivedAcceleration: "joint `elbow`: acceleration is not logged and was derived from the logged velocity, by the motion filter at 40.000 Hz; position noise of 1.2e-5, as the spectrum has it, leaves a noise of 0.00024 in velocity and 0.031 in acceleration (SI units, per sample)";
    Drift: "log `run3`, joint `elbow`: friction changed by -0.214 (residual sd 0.305) from the first third of the run to the last, or its motion did; the twin holds the average: warm the joints up before logging, and log as they will be used";
    DriftWithTemperature: "log `run3`, joint `elbow`: friction goes with the temperature, -0.031 ± 0.004 per degree from 24.1 to 38.9 (residual sd 0.305), or with what else changed in that time; the twin holds the average: log at the temperature of work, or fit a twin to each";
    DriveGainIgnored: "an error of 5 % (sd) that all drive constants may share is not in the intervals of masses: that takes `gain` among the candidates ([library] families)";
    DriveGainUncertain: "torque comes from the motors: an error of 5 % (sd) that all drive constants may share is in the intervals of masses, centres of mass and inertias; log two known payloads ([[log]] payload) to be rid of it, or set prior.drive_gain";
    DrivesOff: "brakes or a protective stop, once: all joints are at rest without the torque that would hold them (joint and torque in brackets), from 40.10 s to 44.75 s (`shoulder`, 51.3 N·m). These samples are left out of the fit";
    DuplicateRows: "12 rows repeat the stamp and all values of the row before and were dropped";
    EffortIsJointTorque: "the logged torque (effort[], or what [columns] tau names) counts as torque on the joint's side of the gear, N·m (N for sliders); if it is of the motor or a current, say so with [[log]] torque";
    EncoderStuck: "log `run3`, joint `elbow`: position holds one value from 12.300 to 12.410 s while the joint moves by 0.0412: repair the encoder or its log, and leave that time out";
    EqualityNotUsed: "equality <connect> `loop`: its forces are not part of the nominal torque (twincal works on trees); lock the joints that it holds";
    FactorAsFitted: "logged numbers are multiplied as in the fit: q of elbow by -1; [columns] factor of a --config says otherwise (1.0: as it is logged)";
    FactorInDoubt: "with the factor 0.0174533 of the fit joint `elbow` moves over 0.0412 rad (m), 0.018 of the 2.31 that it moved over in the fit; without it, 1.0 of that. Where this log is in radians (m) already, say [columns.factor] q = { elbow = 1.0 }, and likewise qd and qdd, in a --config";
    FewEffectiveRows: "the 4200 rows of joint `elbow` count as 6.2 independent rows, fewer than 10: what is found on it alone rests on little; log it longer and in faster motion";
    FlagNotUsed: "<flag spring=\"disable\"/> is a simulator's switch: joint springs stay in the nominal torque";
    FluidNotUsed: "<option> states a medium (density, viscosity): its drag is not part of the nominal torque";
    Forced: "`elbow.viscous` is in because prior.forced says so, or names what needs it: its probability of 1 is no evidence";
    FrictionTurnsNegative: "friction of joint `elbow` (1.204 +2.310 v -0.812 v²) is negative above 3.30 rad/s, below the model's velocity limit of 4.00 rad/s (logged: up to 2.10): there the twin would drive the joint; log faster motion, or leave the family quadratic_friction out of [library] families";
    FrictionlossNotUsed: "joint `elbow`: frictionloss 0.5 is dry friction and not part of the nominal torque; Coulomb friction is a candidate";
    Gaps: "2 gaps longer than 5 median steps (0.002000 s), the longest 0.130000 s; the log is cut there";
    GenericFamilyOff: "the robot has 6 moving joints: the generic family, which has 1200 terms for them, is proposed unasked up to 3 joints only; name the terms you want in [library] terms";
    GravcompNotUsed: "body `hand`: gravity compensation (gravcomp) is not part of the nominal torque";
    GravityCompensated: "log `run3`: the torque of all joints holds 0.01 ± 0.02 of the model's gravity and 1.02 ± 0.06 of its inertial torque: looks like torque with gravity compensated, as some controllers publish it; masses fitted to it are wrong: log the measured torque of the drives, or add what was taken off";
    HeavyTails: "joint `elbow`: 84 of 4200 residuals (2.0 %) are beyond 4 robust sd (0.305), normal noise has 0.006 %: contacts, dropped samples or missing physics; they count little in this fit (noise.robust)";
    HeldoutNotScored: "what is left out of run3 is not predicted: the rows that remain for the fit count as 6.2 independent rows at most, fewer than 10; record longer, or give another log with --heldout";
    HistoryNotFollowed: "`hysteresis` of friction is no candidate: no joint travels far enough";
    ImplausibleTimeStep: "the median time step is 2 s; the stamps look like milliseconds (500 Hz); say [columns] time_unit = \"ms\", divide by 1000 where the log is made, or give the right --rate HZ. With the filter off time is only copied";
    InertiaFloor: "the model's inertia is a placeholder for `hand` (no mass): prior widths take at least 1 % of the mass that the joint moves and radii of a tenth of the link's length; give these links their own inertia where you know it";
    JointNotDriven: "joint `elbow` is hardly driven: rms torque 0.0121, 0.4 % of its largest in any log";
    JointNotExcited: "joint `elbow` is at rest in all training logs: its own effects cannot be seen";
    JointOrder: "the log's joints seem exchanged: try `j1` = torque of `j2`, `j2` = torque of `j1`; model and friction then explain at least 96 % of every joint's torque instead of 3 %; nothing was changed: rename the columns, or map them in [columns]";
    JointStandsStill: "joint `elbow` does not move in 99.8 % of this log's filtered samples; its torque there is not used";
    JointTorqueFactor: "joint `elbow`: measured torque is 1.12 ± 0.02 times what the other joints say of the links that it moves: look for a gain, gear ratio or torque constant there, and multiply its torque column by 0.893";
    JointsLeftOut: "joints that do not move in the model were left out: `gripper`";
    LateMessages: "12 of 60000 messages came late, by at most 4.120 ms, and were put in the order of their stamps";
    LinkWithoutInertia: "link `hand` has a shape but no <inertial>: it weighs nothing in the nominal torque; compute mass, centre of mass and inertia from its mesh (MeshLab, or the CAD program) and add them";
    LockedBeyondLimits: "joint `elbow` is locked at 4, outside its limits -3.14 to 3.14";
    LockedFixedJoint: "joint `flange` is fixed in the model anyway: its locked position 0.5 is not used";
    LogTime: "time on topic `/joint_states` is the recorder's log time, as [columns] time says: it jitters with the network and the recorder's load";
    LogTorqueExchanged: "log `run3`: joints `elbow` and `wrist` seem to have each other's torque: what the other logs say explains 4 % of it, 98 % exchanged; nothing was changed: rename the torque columns of this log, or leave it out";
    LogTorqueFactor: "log `run3`: measured torque is 1.12 ± 0.02 times what the other logs say of the same robot: look for a gain, gear ratio or torque constant there, and multiply its torque columns by 0.893; a load that not all logs carry looks alike: state `payload` of this [[log]], \"unknown\" if nobody knows it";
    LogTorqueLag: "log `run3`: torque is written 8 ± 1 ms later behind the motion than in the other logs: log it as the others, or move its stamps by that much";
    LogWasFitted: "run1.csv: this log is one that the twin was fitted to: no independent check";
    LogWasHeldout: "run2.csv: this log is one that the twin was judged by when it was fitted: it repeats those scores";
    LowerBand: "nothing can be concluded at the automatic cut-off of 10 Hz (joint `elbow`: accelerations of a coarse encoder make the model's torque wrong by 3.1 (rms), 2.2 was measured): fitted at 5 Hz, where the coarse encoder spoils less of the motion; [signal] cutoff_hz states another one";
    MasslessFrame: "link `tool0`: mass 0 and no moving joint of its own, taken as a frame";
    MimicFromEquality: "joint `finger2` follows `finger1` (equality): 1 · q + 0";
    Misfit: "joint `elbow`: what no candidate describes counts as 3.1 times the noise; intervals and probabilities allow for it";
    MissingTorque: "measured torque is NaN or infinite in some of 60000 rows (joint `elbow`: 1200): they are predicted all the same, with no measured torque beside";
    ModelOrder: "/command:data[*]: nothing in the messages says whose the entries are, so they were taken in the model's order: `shoulder`, `elbow`";
    ModelTorque: "log `run3`: the torque of all joints holds 0.01 ± 0.02 of the model's gravity and 0.02 ± 0.05 of its inertial torque: looks like measured minus model torque, or an estimate of external torque; masses fitted to it are wrong: log the measured torque of the drives, or add what was taken off";
    MotionFilterCapped: "the motion filter's cut-off is 22.500 Hz here instead of 40.000 Hz: the log has only 50.000 Hz";
    MotionSpike: "joint `elbow`: position leaves its neighbours for one sample, once, most by +0.412 rad at 12.300 s, as no joint moves; the samples were left out and the log is cut there";
    MovesNoMass: "joint `wrist`: nothing beyond it has mass; its nominal torque is 0";
    NoMetadata: "the bag has no metadata.yaml: its 3 files were taken in the order of their names; `ros2 bag reindex` writes it";
    NoiseVariesWithLoad: "joint `elbow`: what is left is 2.4 times larger under some loads than under others; intervals are too wide at some and too narrow at others; try noise.varies_with_load = true, and keep it where the held-out error does not grow";
    NoiseVariesWithSpeed: "joint `elbow`: what is left is 2.4 times larger at some speeds than at others; intervals are too wide at some and too narrow at others; try noise.varies_with_speed = true, and keep it where the held-out error does not grow";
    NoisyVelocity: "joint `elbow`: the logged velocity has a noise of 0.041 per s (after the motion filter), the change of position 0.0021: velocity is taken from position; [signal] velocity = \"logged\" takes the log's";
    NotFiniteRows: "12 of 60000 rows (0.02 %) have values that are NaN, infinite or beyond 1e12 (tau of `elbow`: 12) and were dropped; the log is cut there";
    NotSeen: "not seen: wrist.spring, wrist.viscous; their torque in these logs is small against the noise: move faster, or log longer";
    NotWider: "what is left is an autoregression, but a fit in a wider band with \"ar1\" ends early (refused: too few rows; record longer): fitted in the usual one; [signal] wider_band = false does not try it";
    NothingToCorrect: "the nominal model explains the torque to rounding: nothing to correct";
    NullLagrangian: "term `q1*qd1` has no torque for any motion (it is the time derivative of a function of q): it is no column; delete it or correct it";
    OutliersWeighed: "joint `elbow`: 84 of 4200 rows count less than a quarter (noise.robust)";
    PartsMerged: "joints or channels come in messages of their own: `elbow` on /arm brought to the stamps of `finger` on /hand by linear interpolation; 12 of 6000 rows lie outside or in gaps and are NaN";
    Pipeline: "columns and torque: symmetric FIR at 10 Hz, 0.150 s to either side, white-noise gain 0.199; motion: FIR at 40.000 Hz, 0.038 s; rows at 25 Hz";
    PlugInsNotSettled: "noise weights or slab scale still moved after 50 rounds; probabilities near 0.5 may change in the second digit";
    PointMass: "link `tool`: 1.5 kg with inertia tensor 0: taken as a point mass. What its real tensor adds will be reported as motor inertia of its joint or as the tensor of another link; give the link its own in the model where you know it";
    PositionStep: "joint `elbow`: position steps from one sample to the next, once, most by +0.785 rad at 12.300 s, as no joint moves; the log is cut there; look whether the encoder was reset, then one side has a wrong zero";
    PriorConflict: "`hand.mass` = 4.121 ± 0.11 is 6.9 sd of its prior (sd 0.6) from 0, 6.8 sd of what the prior predicts for its estimate: look whether the model's numbers there are right, or give a wider prior.slab";
    ProgramForgets: "the program knows one state and nothing of what was before: it takes friction as that of steady sliding at mean warmth, which is off for `elbow.hysteresis` by up to 0.41 N·m (N), for some milliradians after a velocity reversal or in a cold robot; `twincal predict` follows the motion";
    QuantisedEncoder: "joint `elbow`: the encoder steps by 0.00153: quantisation alone leaves a noise of 0.011 in velocity and 1.9 in acceleration derived from position (SI units, after the motion filter; its whole noise may be more), and one step within the filter's window is 0.245 per s, below which motion cannot be told from standstill; log the encoder's full resolution";
    RateCapped: "rows are kept at the slowest log's rate of 50.000 Hz instead of 100 Hz";
    RateIgnored: "signal.rate_hz = 100 has no effect: with signal.cutoff_hz = 0 every input row is one row; leave one of them out";
    Relinearised: "effects that multiply each other: the columns were worked out anew about what was found of elbow.offset";
    RepeatedSamples: "600 of 6000 rows (10 %) repeat the row before and 3 controller samples are missing; the stamps are a receiver's, off by 12 % of a step (median), while positions advance by whole steps of 8.000 ms; the repeats are dropped and the rows placed on that clock; log the controller's own stamps";
    Resampled: "the clock is uneven: 99 % of the steps are within 12 % of the median (500.000 Hz), the largest is off by 35 %, 120 by more than 10 %; resampled by a cubic spline; stamp at the source for a better estimate";
    ResidualCorrelated: "joint `elbow`: the residual stays alike for 9.0 rows, which noise.model = \"iid\" ignores: sds are about 3.0 times too small; use \"tempered\"";
    RippleAdded: "joint `elbow`: what the model leaves over repeats 101 times per turn, 0.412 N·m at its height, 70 % of the variance of its rows away from its velocity reversals, over 28 periods forwards and 27 backwards, 110 nats: gear ripple, which is a candidate now; [library] ripple = { \"elbow\" = 101 } states it, another number or family chooses otherwise";
    RippleSeen: "joint `elbow`: what the model leaves over repeats 101 times per turn, 0.412 N·m at its height, 70 % of the variance of its rows away from its velocity reversals, over 28 periods forwards and 27 backwards, 110 nats: gear ripple; [library] ripple = { \"elbow\" = 101 } makes it a candidate";
    RowsAlias: "rows at 12 Hz are below twice the cut-off of 10 Hz: torque between them folds into the estimates as noise";
    SaturatedTorque: "joint `elbow`: torque is flat at its limit of 28.0000 in 420 samples (3 times); the fit and the scores of moving rows leave them out with all that the filter mixes with them and with standstill (4.1 % of the log); the scores over all rows contain them";
    SdTooSmall: "the sd of `elbow.viscous` and 2 more (terms[].sandwich_sd) may be too small: stretches of the logs disagree on it 2.6 times more than the likelihood says";
    ShortSegments: "2 segments between cuts (48 samples) are shorter than the motion filter and were dropped";
    SignFlip: "joint `elbow`: its torque has the opposite sign: model and friction explain 3 % of its torque as logged, 96 % turned; nothing was changed: turn the columns with [columns] factor";
    SlowerChannels: "tau of `elbow` have a value only in every 4th row: the log is read at that rate, from the 15000 rows that hold all channels; they share one clock, so no skew can be estimated";
    SmallerLibrary: "no result with all candidates (4 independent rows, 10 are needed): fitted with friction, motor inertia and link inertias only; log longer and faster motion for the others";
    StaleTorque: "log `run3`: the torque of joint `elbow` holds its value while the joint changes its speed: 3 times, 40 ms at the longest, 0.11 s in all, the first at t = 12.30 s: nothing has to be done";
    Standstill: "joint `elbow` is at rest in 41.2 % of this log's filtered samples; its torque there is not used";
    TemperatureLeftOut: "a temperature is missing in some chapters and was left out of all: drift is not compared with it";
    TemperatureMissing: "the log has no temperature of 2 joints whose friction changes with it: the training logs' mean is taken";
    TendonNotUsed: "tendon `cable`: its spring, damper and inertia are not part of the nominal torque";
    TimeOrigin: "time counts from the stamp 1700000000.123456789 s, the first of the log";
    TimeReplaced: "time stamps were replaced by row / 500 Hz as told";
    TimeSource: "time is header.stamp on topic /joint_states, not the recorder's clock, which is later by 0.412 ms on average";
    TimeStepsBack: "time steps back 2 times; the log is cut there";
    TimeUnit: "time stamps were taken as milliseconds as [columns] time_unit says";
    TimestampType: "column `time` is a time in nanoseconds by its type and was turned into seconds";
    TorqueAsFitted: "the logged torque counts as motor currents, with the drive constants that the logs of the fit had; [[log]] torque of a --config says otherwise (\"joint\": as it is logged)";
    TorqueConstant: "log `run3`: the torque of joint `elbow` is 1.2 throughout while the model needs 8.4 N·m (sd) for its motion: no measurement; map its torque in [columns] tau, or leave this log out";
    TorqueCopied: "log `run3`: the torque of joint `wrist` is that of joint `elbow` in 100 % of the samples: one column was written twice; map the measured torque of `wrist` in [columns] tau, or log it again";
    TorqueHeld: "log `run3`: the torque of joint `elbow` holds its value while the joint changes its speed: 120 times, 210 ms at the longest, 14.30 s in all, the first at t = 0.40 s: log its torque in every row, or leave this log out";
    TorqueLag: "torque is logged 4.1 ± 0.2 ms after the motion, as most joints agree. It is moved back before the fit: left-out rows of the training logs have 12 % less error. [signal] lag = 0 leaves it as logged";
    TorqueScale: "torque is about 1000 times the model's on every joint on which the model tells (shoulder, elbow): looks like N·mm for N·m; nothing was scaled: convert the columns and fit again";
    TorqueSource: "joint torque is motor torque times gear ratio, as told: elbow 100";
    Truncated: "the file is cut off at byte 1048576: what stood whole before was read; `mcap recover` makes a whole file of it";
    UndefinedWorldLink: "link `world` is used but not defined: taken as the fixed base (Drake's convention; Pinocchio refuses it)";
    UnknownElements: "MJCF does not know, and twincal did not use: <jiont> at arm.xml:12:5";
    UnnamedJoint: "joint 1 of body `hand` has no name: called `hand_joint1`";
    UnphysicalInertia: "link `hand`: inertia tensor breaks the triangle inequality: principal moment 3.0000e-2 is more than 1.0000e-2 + 1.0000e-2 kg·m²; used as it is because unphysical inertias are allowed";
    UnphysicalInertiaFound: "link `hand`: 41.2 % of the posterior draws of its inertia (with what it carries) are those of a rigid body (p-value 0.38); these logs leave its inertia open: motion that shows more of it would narrow it";
    UnreadableRows: "3 rows (0.01 %) could not be read and were dropped; the first: line 120, column 4: `abc` is not a number";
    UnseenMotion: "move `elbow` more: these logs show nothing of elbow.viscous";
    UrdfDynamics: "joint `elbow`: <dynamics> states damping 0.5 and friction 0.1: not part of the nominal torque (vendors put solver values there; use_urdf_friction = true counts the damping)";
    VelocityMismatch: "joint `elbow`: the logged velocity is not the change of position (R² 0.412, slope 0.390): scaled, late or of another joint; with [signal] velocity = \"position\" it is not used";
    VelocityOpposite: "joint `elbow` of run3: the logged velocity is the change of position with the opposite sign (slope -0.999): the sign of one of the two is reversed; give that one the factor -1 in [columns.factor]: q or qd = { \"elbow\" = -1.0 }";
    Verdict: "can this twin be used? No: its torque is worse than the model's on held-out logs. Record more motion. (2 more in its report)";
    WiderBand: "below 40 Hz what is left is noise of one memory on every joint, 0.031 s at most (joint `elbow`): cumulated periodogram within 0.04 of white (limit 0.10), variances over speeds 1.3 (limit 2.0). Fitted up to there as such noise instead of below 10 Hz";
    WorseThanModel: "joint `elbow`: on held-out data the calibrated torque is worse than the model's own: RMSE 0.412 N·m instead of 0.305 N·m; its corrections do not hold beyond the motion of the fit: log it longer, in the motion that the twin is for";
    WrappedAngle: "joint `elbow`: 4 jumps by a full turn, unfolded";
    ZeroColumn: "term `wrist.spring` has no torque on any row of these logs and was left out: its joints do not move";
}
