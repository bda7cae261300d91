//! What the numbers behind claims are, and which codes have them.

use crate::error::Code;

/// Numbers behind claims by name: what each is. Errors of torque are root mean squares in N·m (N of a slider) over held-out rows, as the filter
/// passes them and of moving joints where there is standstill; shares are 0 … 1.
pub const NUMBERS: &[(&str, &str)] = &[
    ("bias", "mean of measured minus predicted torque, N·m or N"),
    ("coverage50", "share of rows inside the 50 % interval"),
    ("coverage95", "share of rows inside the 95 % interval"),
    ("coverage95_at_rest", "that of rows at rest"),
    (
        "coverage95_beyond",
        "that of rows of which training says less",
    ),
    ("coverage95_within", "that of rows like those of training"),
    (
        "distance",
        "largest distance between the distribution of predicted probabilities and the uniform one (Kolmogorov)",
    ),
    (
        "distance_limit",
        "distance that honest predictions pass with probability 0.05",
    ),
    ("equivalent_sets", "sets of effects with the same torque"),
    ("established", "effects that are established"),
    ("found", "effects with probability 0.5 or more"),
    (
        "hardly_driven_held_out",
        "1: the joint is hardly driven in a held-out log",
    ),
    ("high", "upper limit of the gate"),
    (
        "independent_rows",
        "held-out rows over the autocorrelation time of their residual",
    ),
    ("joints", "joints with held-out rows"),
    (
        "joints_above_torque",
        "joints whose error is as large as the torque's standard deviation",
    ),
    (
        "joints_better",
        "joints that friction and an offset alone predict better than the model",
    ),
    (
        "joints_large",
        "joints whose error is more than half of the torque's standard deviation",
    ),
    ("links", "links whose inertia is physically inconsistent"),
    ("low", "lower limit of the gate"),
    ("needed", "independent rows that are needed"),
    ("pauses", "pauses of the joint that has most"),
    ("rms_beyond", "error on rows of which training says less"),
    ("rms_calibrated", "error of the twin"),
    (
        "rms_friction",
        "error of the model with friction and an offset alone",
    ),
    (
        "rms_nominal",
        "error of the model as it was, without the friction that its file states",
    ),
    ("rms_within", "error on rows like those of training"),
    ("rows", "held-out rows"),
    ("rows_at_rest", "held-out rows at rest"),
    ("rows_beyond", "held-out rows of which training says less"),
    ("seconds", "held-out time, s"),
    ("seconds_at_rest", "longest time at rest of a joint, s"),
    ("share_above", "share of rows above the predicted middle"),
    (
        "share_at_rest",
        "share of the logs' rows in which the joint is at rest",
    ),
    ("slight", "1: off by no more than is tolerated"),
    ("tentative", "effects that are tentative"),
    (
        "torque_sd",
        "standard deviation of the measured torque, N·m or N",
    ),
    (
        "value",
        "what the gate judges: an error in N·m or N, a share, or of a change the probability of such an estimate without one",
    ),
    (
        "width_needed",
        "part of the intervals' width that would have held 95 % of the rows",
    ),
];

const ERRORS: &[&str] = &["rms_calibrated", "rms_friction", "rms_nominal"];
const ERRORS_OF_ALL: &[&str] = &[
    "joints",
    "joints_above_torque",
    "joints_large",
    "rms_calibrated",
    "rms_friction",
    "rms_nominal",
];
const ERRORS_OF_JOINT: &[&str] = &["rms_calibrated", "rms_friction", "rms_nominal", "torque_sd"];
const BEFORE_AND_AFTER: &[&str] = &["rms_calibrated", "rms_nominal"];
const SHARE_OF_ALL: &[&str] = &[
    "coverage95",
    "coverage95_at_rest",
    "rows",
    "rows_at_rest",
    "seconds",
    "width_needed",
];
const SHARE_OF_JOINT: &[&str] = &["coverage95", "independent_rows"];
const DISTANCE: &[&str] = &["distance", "distance_limit"];
const SHAPE: &[&str] = &[
    "bias",
    "coverage50",
    "distance",
    "distance_limit",
    "share_above",
    "slight",
];
const BEYOND: &[&str] = &[
    "coverage95_beyond",
    "coverage95_within",
    "rms_beyond",
    "rms_within",
    "rows",
    "rows_beyond",
];
const AT_REST: &[&str] = &["pauses", "rms_calibrated", "rms_nominal", "seconds_at_rest"];
const EFFECTS: &[&str] = &["equivalent_sets", "established", "found", "tentative"];
const GATE: &[&str] = &["high", "low", "value"];

impl Code {
    /// Names of the numbers that claims with this code can have beside those of its findings, in alphabetical order; see [`NUMBERS`].
    ///
    /// # Example
    /// ```
    /// use twincal::Code;
    ///
    /// assert_eq!(Code::FewHeldOutRows.evidence_of_claims(), ["independent_rows", "needed"]);
    /// ```
    #[must_use]
    pub fn evidence_of_claims(self) -> &'static [&'static str] {
        match self {
            Self::FewHeldOutRows => &["independent_rows", "needed"],
            Self::NarrowIntervals
            | Self::NarrowIntervalsInMotion
            | Self::WideIntervals
            | Self::IntervalsHold => SHARE_OF_ALL,
            Self::JointIntervalsNarrow
            | Self::JointIntervalsWide
            | Self::JointCoverageByChance
            | Self::JointCoverageOff => SHARE_OF_JOINT,
            Self::DistributionWide
            | Self::DistributionNarrow
            | Self::TorqueAbovePrediction
            | Self::TorqueBelowPrediction
            | Self::JointDistributionOff => DISTANCE,
            Self::ShapeWide
            | Self::ShapeNarrow
            | Self::ShapeAbove
            | Self::ShapeBelow
            | Self::ShapeUneven => SHAPE,
            Self::WorseOnNewMotion | Self::WorseOnOpenTorque => BEYOND,
            Self::TestedOnNewMotion | Self::TestedOnOpenTorque => &["rows", "rows_beyond"],
            Self::WorseAtRest | Self::WorseInFewPauses | Self::TorqueErrorAtRest => AT_REST,
            Self::RestNotTested => &[
                "rms_calibrated",
                "rms_nominal",
                "rows_at_rest",
                "share_at_rest",
            ],
            Self::NothingEstablished | Self::EffectsEstablished => EFFECTS,
            Self::UnphysicalLinks => &["links"],
            Self::ErrorAboveGate
            | Self::CoverageOutsideGate
            | Self::FrictionChanged
            | Self::PayloadChanged
            | Self::JointZeroChanged => GATE,
            _ => self.errors(),
        }
    }

    /// Of those of its claims that compare errors of torque.
    fn errors(self) -> &'static [&'static str] {
        match self {
            Self::TorqueError => ERRORS,
            Self::WorseThanNominal
            | Self::ErrorAboveTorque
            | Self::ErrorAboveTorqueOnMostJoints
            | Self::NothingFound
            | Self::NoBetterThanNominal
            | Self::FrictionAloneIsBetter
            | Self::LargeError
            | Self::LargeErrorOnMostJoints => ERRORS_OF_ALL,
            Self::JointErrorAboveTorque => &[
                "hardly_driven_held_out",
                "rms_calibrated",
                "rms_friction",
                "rms_nominal",
                "torque_sd",
            ],
            Self::JointTorqueWorse | Self::JointErrorLarge | Self::JointFrictionAlone => {
                ERRORS_OF_JOINT
            }
            Self::RawTorqueError | Self::RawTorqueWorse | Self::JointWorseAtRest => {
                BEFORE_AND_AFTER
            }
            Self::JointRawErrorAboveTorque => &["rms_calibrated", "torque_sd"],
            Self::FrictionAlone => &["joints_better", "rms_friction", "rms_nominal"],
            Self::JointFrictionAloneWorse => &["rms_friction", "rms_nominal"],
            _ => &[],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::fs;
    use std::path::Path;

    /// Names in the sources of this folder, as they stand before a number: `("name", `.
    fn written() -> BTreeSet<String> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/assess");
        let files = fs::read_dir(folder).expect("the sources").map(|file| {
            let path = file.expect("a file").path();
            let text = fs::read_to_string(&path).expect("a source file");
            let code = text.split("#[cfg(test)]").next().unwrap_or_default();
            let lines = code.lines().filter(|line| !line.trim().starts_with("//"));
            (path, lines.collect::<String>())
        });
        let own = |path: &Path| {
            ["numbers.rs", "next.rs"]
                .iter()
                .any(|name| path.ends_with(name))
        };
        let files = files.filter(|(path, _)| !own(path));
        let names = files.flat_map(|(_, code)| {
            let places = code.split("(\"").skip(1).map(str::to_owned);
            places.collect::<Vec<_>>()
        });
        // How many samples a finding is of stands in its count.
        let name = |place: String| {
            let (name, behind) = place.split_once('"')?;
            let own = behind.starts_with(", ") && !["", "count"].contains(&name);
            own.then(|| name.to_owned())
        };
        names.filter_map(name).collect()
    }

    #[test]
    fn every_number_has_a_meaning_and_a_code() {
        let meant: BTreeSet<String> = NUMBERS.iter().map(|own| own.0.to_owned()).collect();
        assert!(NUMBERS.is_sorted_by(|one, next| one.0 < next.0));
        assert_eq!(written(), meant);
        let of = |code: &Code| code.evidence_of_claims().iter();
        let owned: BTreeSet<String> = (Code::ALL.iter())
            .flat_map(|code| of(code).map(|name| (*name).to_owned()))
            .collect();
        assert_eq!(owned, meant);
        for code in Code::ALL {
            assert!(of(code).is_sorted(), "{code}");
        }
    }
}
