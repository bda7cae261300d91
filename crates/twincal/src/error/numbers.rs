//! The one list of what the numbers of findings are: unit and meaning of every name of the evidence.

use super::Code;

/// What a number in the evidence of findings is.
///
/// # Example
/// ```
/// use twincal::Code;
///
/// let level = Code::SaturatedTorque.number("level").ok_or("a number of this code")?;
/// println!("{} [{}]: {}", level.name, level.unit, level.meaning);
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FindingNumber {
    /// Its name in the evidence.
    pub name: &'static str,
    /// The codes in which the name has this meaning; none: all codes without a row of their own.
    pub codes: &'static [Code],
    /// SI unit, that of a slider in brackets; `count`, `share` (0 … 1), `factor` or `index` of a number without one.
    pub unit: &'static str,
    /// In a phrase.
    pub meaning: &'static str,
}

macro_rules! numbers {
    ($($name:literal $([$($code:ident)+])? $unit:literal $meaning:literal;)+) => {
        /// Numbers in the evidence of findings by name, those of single codes behind the general one.
        pub const FINDING_NUMBERS: &[FindingNumber] = &[$(FindingNumber {
            name: $name,
            codes: &[$($(Code::$code,)+)?],
            unit: $unit,
            meaning: $meaning,
        },)+];
    };
}

numbers! {
    "acceleration_noise" "rad/s² (m/s²)" "noise of the derived acceleration that the noise of position leaves";
    "acceleration_noise" [QuantisedEncoder] "rad/s² (m/s²)" "noise of the derived acceleration that the steps of the encoder leave";
    "amplitude" "N·m (N)" "height of the ripple";
    "angle" "rad" "angle between the gravity that the torque shows and that of the model";
    "autocorrelation_time" "rows" "autocorrelation time of the residual";
    "axis_x" "–" "x of the axis as the file has it";
    "axis_y" "–" "y of that axis";
    "axis_z" "–" "z of that axis";
    "border" "s" "time that the filters take at either end of a segment";
    "byte" "index" "byte at which the file is cut off";
    "chance" "share" "p-value: such a share, or a smaller one, of a body that is physical";
    "change" "N·m (N)" "change from the first third of the log to the last; of friction against the motion";
    "change_in_sd" "sd" "change of a coefficient, in its standard deviations";
    "chapter" "index" "chapter of a long log in which it is worst, counted from 1";
    "chapters" "count" "chapters of the log";
    "chapters_alike" "count" "further chapters with the same finding";
    "chapters_left_out" "count" "chapters that are left out";
    "chunks" "count" "chunks of the file, damaged or not";
    "correlation" "–" "correlation of the torque noise of both logs";
    "correlation_sd" "–" "standard deviation of that of independent recordings";
    "coulomb" "N·m (N)" "Coulomb friction found";
    "coverage95" "share" "least share of rows of a joint in the 95 % intervals, on motion that training had";
    "cutoff" "Hz" "cut-off of columns and torque that is used or compared";
    "cutoff" [MotionFilterCapped] "Hz" "cut-off of the motion filter that is used";
    "cutoff_tried" "Hz" "automatic cut-off, at which nothing can be concluded";
    "cutoff_wanted" "Hz" "cut-off of the motion filter without the limit of the log's rate";
    "damping" "N·m·s/rad (N·s/m)" "damping that the file states";
    "distance_in_sd" "sd" "distance of the estimate from 0, in standard deviations of what the prior predicts";
    "drift" "s/s" "time by which the lag of torque grows per second; above 0 its clock is slower";
    "drift_sd" "s/s" "its standard deviation";
    "dropped" "count" "rows that are dropped";
    "effort_limit" "N·m (N)" "effort limit of the model";
    "error_reduction" "share" "share by which the residual falls";
    "every" "count" "rows from one value of the slower channels to the next";
    "explained" "share" "share of torque that model and friction explain with the change; of exchanged joints the least";
    "explained" [LogTorqueExchanged] "share" "share of both joints' torque that the other logs explain, exchanged";
    "explained_before" "share" "that share without the change";
    "factor" "factor" "measured torque over that of the model or of the others";
    "factor" [FactorInDoubt] "factor" "factor of the column in the fit";
    "factor_sd" "factor" "its standard deviation";
    "files" "count" "files of the bag";
    "first_at" "s" "time stamp of the first";
    "first_chapter" "index" "first chapter that is left out, counted from 1";
    "first_from" "s" "time stamp at which the first begins";
    "first_row" "index" "row of this log at which the copy begins";
    "first_row_of_original" "index" "row of the other log at which it begins";
    "first_to" "s" "time stamp at which the first ends";
    "first_torque" "N·m (N)" "torque of the first that is not explained";
    "first_torque" [DrivesOff] "N·m (N)" "torque that would hold the joint, of the first";
    "friction" "N·m (N)" "dry friction that the file states";
    "from" "s" "time stamp from which the position is held";
    "gain_sd" "share" "standard deviation of the error that all drive constants share";
    "gear" "factor" "gear of the actuator";
    "gravity_factor" "factor" "gravity in the torque, over that of the model";
    "gravity_factor_sd" "factor" "its standard deviation";
    "gravity_x" "m/s²" "x of the gravity that the torque shows, in the base frame";
    "gravity_y" "m/s²" "y of that gravity";
    "gravity_z" "m/s²" "z of that gravity";
    "half_length" "s" "half length of the filter of columns and torque";
    "high" "rad (m)" "upper limit of the joint";
    "independent_rows" "count" "rows over the autocorrelation time of their residual";
    "inertia_factor" "factor" "inertial torque in the log, over that of the model";
    "inertia_factor_sd" "factor" "its standard deviation";
    "interpolated" "count" "repeated rows that are interpolated";
    "interval" "s" "median time step";
    "interval" [ControllerClock RepeatedSamples] "s" "time step of the controller";
    "jitter" "share" "median error of the stamps, as a share of a step of the controller";
    "jitter99" "share" "deviation from the median step that 99 % of the steps do not pass";
    "jitter_largest" "share" "largest deviation from the median step";
    "jitter_limit" "share" "deviation from which a step counts in `steps_beyond`";
    "joints" "count" "joints that move";
    "joints_at_most" "count" "joints up to which the family is proposed unasked";
    "lag" "s" "time from the motion to its torque";
    "lag" [LogTorqueLag] "s" "time from the motion of that log to its torque, by what the other logs, or the twin, say";
    "lag" [TimeSource] "s" "mean time by which the recorder's clock is later than the stamps";
    "lag_of_others" "s" "lag of the other joints";
    "lag_of_others" [LogTime] "s" "mean time by which the recorder's clock is later than the other topics' stamps";
    "lag_sd" "s" "standard deviation of the lag";
    "largest" "rad (m)" "largest jump of position; of velocity per s, of acceleration per s²";
    "largest" [ProgramForgets] "N·m (N)" "largest torque that depends on earlier motion";
    "largest_at" "s" "time stamp of the largest jump";
    "largest_moment" "kg·m²" "largest element of the inertia tensor that is left out";
    "largest_torque" "N·m (N)" "largest torque of the log";
    "latest" "s" "time by which the latest message is late";
    "length" "–" "length of the axis as the file has it";
    "level" [AnotherState] "share" "share that the intervals promise";
    "level" [SaturatedTorque] "N·m (N)" "torque at which it is flat";
    "limit" [ChainsDisagree] "factor" "R̂ above which chains disagree";
    "limit" [NotFiniteRows] "–" "size beyond which a value is no measurement";
    "limit_in_sd" "sd" "residual from which a row counts as far, in robust standard deviations";
    "line" "index" "line of the file, counted from 1";
    "logs" "count" "logs that it rests on";
    "longest" "s" "time of the longest";
    "low" "rad (m)" "lower limit of the joint";
    "mass" "kg" "mass of the link";
    "mean" "unit of the coefficient" "posterior mean of the coefficient";
    "mean_at_cutoff" "unit of the coefficient" "its posterior mean at the other cut-off";
    "memory" "s" "longest memory of the noise over all joints";
    "messages" "count" "messages that are read";
    "misfit" "factor" "what no candidate describes, over the noise";
    "missing" "count" "samples of the controller that the log has not";
    "most_on_a_joint" "count" "repeats of the joint that has most";
    "motion_cutoff" "Hz" "cut-off of the motion filter";
    "motion_half_length" "s" "half length of the motion filter";
    "moved" "rad (m)" "way of the joint that the held position does not show";
    "multiplier" "factor" "motion of the joint over that of the joint it follows";
    "nats" "nats" "gain of log likelihood";
    "needed" "count" "independent rows that are needed";
    "noise_gain" "factor" "variance of white noise after the filter, over that before";
    "noise_variance" "(N·m)²" "variance of the noise that was found";
    "noise_variance_of_prior" "(N·m)²" "variance that `prior.noise` expects";
    "number" "index" "number of the joint in its body, counted from 1";
    "offset" "rad (m)" "position of the joint where the joint it follows is at 0";
    "origin" "s" "first stamp of the log, from which time counts";
    "periodogram_distance" "–" "distance of the cumulated periodogram from that of white noise, of the worst joint";
    "periodogram_limit" "–" "distance up to which the wider band is taken";
    "periods" "count" "periods per turn (per m)";
    "periods_backwards" "count" "periods that the joint passed backwards";
    "periods_forwards" "count" "periods that the joint passed forwards";
    "pip" "share" "probability that at least one of them is in";
    "pitch" "rad" "pitch of the base that the torque shows";
    "position" "rad (m)" "position at which the joint is locked";
    "position_noise" "rad (m)" "noise of the position per sample";
    "principal_moment_1" "kg·m²" "principal moment of inertia";
    "principal_moment_2" "kg·m²" "principal moment of inertia";
    "principal_moment_3" "kg·m²" "principal moment of inertia";
    "prior_sd" "unit of the coefficient" "standard deviation of its prior";
    "quadratic" "N·m·s²/rad² (N·s²/m²)" "quadratic friction found";
    "r2" "–" "R² of the logged velocity and the change of position";
    "r_hat" "factor" "R̂ of the chains";
    "radius_of_gyration" "m" "radius of gyration of the link";
    "radius_of_tungsten" "m" "radius of gyration of a ball of tungsten of its mass";
    "range" "rad (m)" "range of the joint in this log, with the factor";
    "range_in_fit" "rad (m)" "its range in the fit";
    "rate" "Hz" "sampling rate of the log, or of the slowest log";
    "rate" [ImplausibleTimeStep] "Hz" "rate in the unit that the stamps look like";
    "rate" [Pipeline RateCapped RowsAlias] "Hz" "rate at which rows are kept";
    "rate" [RateIgnored] "Hz" "rate of rows in the settings, which has no effect";
    "rate_wanted" "Hz" "rate of rows without the limit of the slowest log";
    "ratio" "factor" "residual where it is large, over that where it is small";
    "ratio" [SdTooSmall] "factor" "disagreement of stretches of the logs, over what the likelihood says";
    "residual_sd" "N·m (N)" "standard deviation of the residual";
    "rest_velocity" "rad/s (m/s)" "velocity below which the joint counts as at rest";
    "rms_calibrated" "N·m (N)" "torque error (RMS) of the twin on held-out rows";
    "rms_compact" "N·m (N)" "torque error (RMS) of the compact twin on held-out rows";
    "rms_nominal" "N·m (N)" "torque error (RMS) of the model, without the friction that its file states";
    "rms_torque" "N·m (N)" "rms torque of the joint in this log";
    "robust_sd" "N·m (N)" "robust standard deviation of the residual";
    "roll" "rad" "roll of the base that the torque shows";
    "rows" "count" "rows of the log, or of the joint over all logs";
    "rows" [SlowerChannels] "count" "rows that hold all channels";
    "samples_at_most" "count" "samples of a chapter at most";
    "sd" "unit of the coefficient" "posterior standard deviation of the coefficient";
    "sd_factor" "factor" "factor by which standard deviations are too small";
    "seconds" "s" "time of all of them";
    "seconds" [Borders] "s" "time of the log";
    "seconds" [CopiedLog] "s" "time of the part that both logs have";
    "seconds_used" "s" "time of the log that becomes rows";
    "segments" "count" "segments that are dropped";
    "share" "share" "share of rows that are concerned";
    "share" [CopiedLog] "share" "share of the patterns of its torque noise that both logs have";
    "share" [JointNotDriven] "share" "rms torque, over the joint's largest in any log";
    "share" [RippleAdded RippleSeen] "share" "share of the variance away from velocity reversals";
    "share" [UnphysicalInertiaFound] "share" "share of posterior draws that are inertias of a rigid body";
    "share_at_rest" "share" "share of filtered samples in which the joint is at rest";
    "share_left_out" "share" "share of the log that is left out";
    "share_of_step" "share" "share of the median step below which stamps are one";
    "slope" "factor" "logged velocity over the change of position";
    "slope" [DriftWithTemperature] "N·m (N) per degree" "change of the residual per degree; of friction against the motion";
    "slope_sd" "N·m (N) per degree" "its standard deviation";
    "step" "rad (m)" "step of the encoder";
    "step_velocity" "rad/s (m/s)" "velocity of one encoder step within the filter's window";
    "steps" "count" "median steps from which on a step is a gap";
    "steps_beyond" "count" "steps beyond `jitter_limit`";
    "temperature_high" "degrees as logged" "highest temperature of the log";
    "temperature_low" "degrees as logged" "lowest temperature of the log";
    "terms" "count" "terms that the family has for this robot";
    "ticks_per_second" "1/s" "units of the stamps per second";
    "time_factor" "factor" "factor by which the time of the log is too long";
    "times" "count" "how often it happened";
    "to" "s" "time stamp up to which the position is held";
    "torque" "N·m (N)" "value that the torque has throughout";
    "torque_needed_sd" "N·m (N)" "standard deviation of the torque that the model needs for the motion";
    "usual_cutoff" "Hz" "cut-off of the usual band";
    "usual_velocity" "rad/s (m/s)" "usual reversal velocity of friction";
    "variance_ratio" "factor" "largest over least variance of the noise by speed, of the worst joint";
    "variance_ratio_limit" "factor" "ratio up to which the wider band is taken";
    "velocity" [CoulombVelocity] "rad/s (m/s)" "reversal velocity of friction";
    "velocity" [FrictionTurnsNegative] "rad/s (m/s)" "velocity above which friction is negative";
    "velocity_after" "rad/s (m/s)" "reversal velocity of friction in the twin after";
    "velocity_before" "rad/s (m/s)" "reversal velocity of friction in the twin before";
    "velocity_limit" "rad/s (m/s)" "velocity limit of the model";
    "velocity_logged" "rad/s (m/s)" "largest logged velocity";
    "velocity_noise" "rad/s (m/s)" "noise of the derived velocity that the noise of position leaves";
    "velocity_noise" [NoisyVelocity] "rad/s (m/s)" "noise of the logged velocity, after the motion filter";
    "velocity_noise" [QuantisedEncoder] "rad/s (m/s)" "noise of the derived velocity that the steps of the encoder leave";
    "velocity_noise_of_position" "rad/s (m/s)" "noise of the velocity derived from position, after the motion filter";
    "viscous" "N·m·s/rad (N·s/m)" "viscous friction found, with the damping of the model";
    "yaw" "rad" "yaw of the base that the torque shows";
}

impl Code {
    /// What a number in the evidence of its findings is; `None` where they have none of that name.
    #[must_use]
    pub fn number(self, name: &str) -> Option<&'static FindingNumber> {
        let has = self.evidence().contains(&name) || Self::EVIDENCE_OF_CHAPTERS.contains(&name);
        let rows = || FINDING_NUMBERS.iter().filter(|row| row.name == name);
        let own = rows().find(|row| row.codes.contains(&self));
        own.or_else(|| rows().find(|row| row.codes.is_empty()))
            .filter(|_| has)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_of_findings_has_one_row_and_every_row_a_code() {
        let key = |row: &FindingNumber| (row.name, row.codes.first().map(|code| code.as_str()));
        assert!(FINDING_NUMBERS.is_sorted_by(|one, next| key(one) < key(next)));
        let mut used = vec![false; FINDING_NUMBERS.len()];
        for &code in Code::ALL {
            for name in code.evidence().iter().chain(Code::EVIDENCE_OF_CHAPTERS) {
                let row = code.number(name);
                let row = row.unwrap_or_else(|| panic!("{code}: `{name}` has no row"));
                let at = FINDING_NUMBERS.iter().position(|own| own == row);
                used[at.expect("a row of the list")] = true;
            }
        }
        for (row, used) in FINDING_NUMBERS.iter().zip(used) {
            let foreign = row
                .codes
                .iter()
                .find(|code| !code.evidence().contains(&row.name));
            assert_eq!(foreign, None, "`{}`", row.name);
            assert!(used, "no code has `{}` of {:?}", row.name, row.codes);
        }
    }
}
