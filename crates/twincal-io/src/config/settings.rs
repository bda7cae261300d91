//! From keys to settings: defaults filled in, ranges checked.

use super::{
    Allow, Config, LagOrAuto, LogForm, MethodWord, NoisePrior, NoiseWord, NumberOrAuto, PayloadKey,
    PerJoint, Slab, VelocityWord,
};
use crate::error::Result;
use crate::log::LogOptions;
use crate::model::ModelSettings;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use twincal::calibrate::CalibrationSettings;
use twincal::infer::{Choice, InferenceSettings, LEAST_CHAINS, LEAST_DRAWS};
use twincal::likelihood::{NoiseModel, NoiseSettings};
use twincal::prior::{Inclusion, PriorSettings};
use twincal::signal::{Auto, Corrections, DerivedFrom, Lag, Payload, SignalSettings};
use twincal::term::{Family, LibrarySettings};

/// Most entries `[[log]]`.
const MAX_LOGS: usize = 10_000;

/// `[[log]]` and `[columns]` with defaults.
#[derive(Debug, Clone, PartialEq)]
pub struct LogSettings {
    /// Held-out logs.
    pub heldout: Vec<PathBuf>,
    /// Sampling rate that replaces the time stamps, Hz.
    pub rate_hz: Option<f64>,
    /// Drop and count unreadable rows.
    pub lenient: bool,
    /// Refuse degraded logs.
    pub strict: bool,
    /// Column names by channel and joint.
    pub columns: super::ColumnsTable,
    /// Recorder, topics and torque of all logs.
    pub form: LogForm,
    /// What is known of single logs (`[[log]]`), in the config's order.
    pub entries: Vec<OneLog>,
}

/// `[[log]]` with defaults.
#[derive(Debug, Clone, PartialEq)]
pub struct OneLog {
    /// The log.
    pub file: PathBuf,
    /// Where it lies when all links are followed; none where there is no such file.
    pub real: Option<PathBuf>,
    /// What the robot carried.
    pub payload: Payload,
    /// Scored on instead of fitted.
    pub heldout: bool,
    /// Sampling rate that replaces the time stamps, Hz.
    pub rate_hz: Option<f64>,
    /// Drop and count unreadable rows.
    pub lenient: bool,
    /// Recorder, topics and torque.
    pub form: LogForm,
}

impl LogSettings {
    /// How a log is read: what its entry says (the same file by any path), else what holds for all.
    pub fn options(&self, path: &Path) -> LogOptions {
        let by_name = self.entries.iter().find(|entry| entry.file == path);
        let entry = by_name.or_else(|| {
            let real = path.canonicalize().ok()?;
            let mut entries = self.entries.iter();
            entries.find(|entry| entry.real.as_ref() == Some(&real))
        });
        let form = entry.map_or(&self.form, |entry| &entry.form).clone();
        LogOptions {
            preset: form.preset,
            topics: form.topics,
            torque: form.torque,
            rate_hz: entry.map_or(self.rate_hz, |entry| entry.rate_hz),
            lenient: entry.map_or(self.lenient, |entry| entry.lenient),
            columns: self.columns.clone(),
            payload: entry.map_or(Payload::None, |entry| entry.payload),
        }
    }

    /// The logs that the config itself names, to be fitted.
    pub fn named(&self) -> Vec<PathBuf> {
        let fitted = self.entries.iter().filter(|entry| !entry.heldout);
        fitted.map(|entry| entry.file.clone()).collect()
    }
}

/// `[check]` with defaults; stored in the twin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Gates {
    /// Largest RMSE of a joint relative to the one stored in the twin.
    pub rmse_ratio: f64,
    /// Smallest and largest coverage of the 95 % interval of a joint, where they are stated; see [`Gates::coverage_of`].
    pub coverage: Option<[f64; 2]>,
}

impl Gates {
    /// Smallest and largest coverage of a joint whose intervals hold the share `own` of the twin's held-out rows: as stated, or 0.90 to 1. Intervals
    /// that held less from the start, as the fit says, are no change: then the least is as much below `own` as that is below 0.90, at most 0.05.
    #[must_use]
    pub fn coverage_of(&self, own: f64) -> [f64; 2] {
        let slack = (LEAST_COVERAGE - own).min(SLACK);
        let least = (own - slack).clamp(0.0, LEAST_COVERAGE);
        self.coverage.unwrap_or([least, 1.0])
    }
}

/// Share of rows that 95 % intervals hold at least, and how far two logs of one robot may differ in it.
const LEAST_COVERAGE: f64 = 0.90;
const SLACK: f64 = 0.05;

impl Default for Gates {
    fn default() -> Self {
        Self {
            rmse_ratio: 1.2,
            coverage: None,
        }
    }
}

/// Everything a run can be told, complete and in range.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Model file.
    pub model_file: Option<PathBuf>,
    /// How it is read.
    pub model: ModelSettings,
    /// Joints that stand still, rad or m.
    pub locked: BTreeMap<String, f64>,
    /// Logs.
    pub log: LogSettings,
    /// Mathematics.
    pub calibration: CalibrationSettings,
    /// Gates of `check`.
    pub gates: Gates,
    /// Threads; `None`: one per core.
    pub threads: Option<usize>,
    /// Folder of the result.
    pub output: PathBuf,
    /// Replace an earlier result.
    pub force: bool,
    /// Print JSON.
    pub json: bool,
}

impl Config {
    /// Defaults filled in, ranges checked.
    ///
    /// # Errors
    /// [`crate::Error::Content`] at the key's place in the file, or a setting error where a flag set it.
    pub fn settings(&self) -> Result<Settings> {
        let file = &self.file;
        let (model, log, check) = (
            self.model()?,
            self.log()?,
            self.gates_over(Gates::default())?,
        );
        let threads = self.count("inference.threads", file.inference.threads, 1, 4096)?;
        Ok(Settings {
            model_file: file.model.file.clone(),
            model,
            locked: file.model.locked.clone(),
            calibration: self.calibration(&log)?,
            log,
            gates: check,
            threads,
            output: file
                .output
                .directory
                .clone()
                .unwrap_or_else(|| PathBuf::from("twincal-out")),
            force: file.output.force.unwrap_or(false),
            json: file.output.json.unwrap_or(false),
        })
    }

    fn model(&self) -> Result<ModelSettings> {
        let table = &self.file.model;
        for value in table.gravity.iter().flatten() {
            self.number("model.gravity", *value, |_| true, "finite numbers in m/s²")?;
        }
        for angle in table.base.iter().flat_map(|base| base.rpy) {
            self.number("model.base.rpy", angle, |_| true, "finite angles in rad")?;
        }
        for (joint, position) in &table.locked {
            self.number(
                &format!("model.locked.{joint}"),
                *position,
                |_| true,
                "a finite position in rad or m",
            )?;
        }
        Ok(ModelSettings {
            gravity: table.gravity,
            base_rpy: table.base.map(|base| base.rpy),
            use_urdf_friction: table.use_urdf_friction.unwrap_or(false),
            allow_unphysical: self.allows(Allow::UnphysicalInertia),
        })
    }

    fn allows(&self, what: Allow) -> bool {
        self.file
            .model
            .allow
            .as_deref()
            .unwrap_or(&[])
            .contains(&what)
    }

    fn log(&self) -> Result<LogSettings> {
        let table = &self.file.log;
        if let Some(rate) = table.rate_hz {
            self.number(
                "log.rate_hz",
                rate,
                |rate| rate > 0.0,
                "a positive number of Hz",
            )?;
        }
        self.check_factors()?;
        let entries = self.entries()?;
        let heldout = table.heldout.clone().unwrap_or_else(|| {
            let heldout = entries.iter().filter(|entry| entry.heldout);
            heldout.map(|entry| entry.file.clone()).collect()
        });
        Ok(LogSettings {
            heldout,
            rate_hz: table.rate_hz,
            lenient: table.lenient.unwrap_or(false),
            strict: table.strict.unwrap_or(false),
            columns: self.file.columns.clone(),
            form: self.form("log", LogForm::of_table(table))?,
            entries,
        })
    }

    fn entries(&self) -> Result<Vec<OneLog>> {
        let given = &self.file.log.entries;
        if given.len() > MAX_LOGS {
            let problem = format!("{} entries, the limit is {MAX_LOGS}", given.len());
            return Err(self.out_of_range("log", problem, "fit fewer logs at a time"));
        }
        let mut entries: Vec<OneLog> = Vec::new();
        let mut files = BTreeSet::new();
        for (index, entry) in given.iter().enumerate() {
            let key = |name: &str| format!("log.{index}.{name}");
            if !files.insert(&entry.file) {
                let problem = format!("`{}` has two entries", entry.file.display());
                return Err(self.out_of_range(&key("file"), problem, "keep one of them"));
            }
            if let Some(rate) = entry.rate_hz {
                let range = "a positive number of Hz";
                self.number(&key("rate_hz"), rate, |rate| rate > 0.0, range)?;
            }
            let payload = match entry.payload {
                None => Payload::None,
                Some(PayloadKey::Unknown(_)) => Payload::Unknown,
                Some(PayloadKey::Known { mass, com }) => {
                    let range = "a mass of 0 kg or more";
                    self.number(&key("payload.mass"), mass, |mass| mass >= 0.0, range)?;
                    for value in com {
                        let range = "finite coordinates in m";
                        self.number(&key("payload.com"), value, |_| true, range)?;
                    }
                    Payload::Known { mass, com }
                }
            };
            entries.push(OneLog {
                file: entry.file.clone(),
                real: entry.file.canonicalize().ok(),
                payload,
                heldout: entry.heldout.unwrap_or(false),
                rate_hz: entry.rate_hz,
                lenient: entry.lenient.unwrap_or(false),
                form: self.form(&format!("log.{index}"), LogForm::of_entry(entry))?,
            });
        }
        Ok(entries)
    }

    /// The gates of `[check]`; a key that is not given keeps its gate in `kept`, which may be those of a stored twin.
    ///
    /// # Errors
    /// [`crate::Error::Content`] at the place of a gate that is out of range.
    pub fn gates_over(&self, kept: Gates) -> Result<Gates> {
        let table = &self.file.check;
        let rmse_ratio = table.rmse_ratio.unwrap_or(kept.rmse_ratio);
        self.number(
            "check.rmse_ratio",
            rmse_ratio,
            |ratio| ratio > 0.0,
            "a positive number",
        )?;
        let coverage = table.coverage.or(kept.coverage);
        let is_interval = |[low, high]: [f64; 2]| 0.0 <= low && low <= high && high <= 1.0;
        if let Some([low, high]) = coverage.filter(|stated| !is_interval(*stated)) {
            let problem = format!("[{low}, {high}] is not an interval inside [0, 1]");
            return Err(self.out_of_range(
                "check.coverage",
                problem,
                "give [lowest, highest], such as [0.90, 0.99]",
            ));
        }
        Ok(Gates {
            rmse_ratio,
            coverage,
        })
    }

    fn calibration(&self, log: &LogSettings) -> Result<CalibrationSettings> {
        let signal = self.signal()?;
        Ok(CalibrationSettings {
            library: self.library(&signal)?,
            signal,
            prior: self.prior()?,
            noise: self.noise(),
            inference: self.inference()?,
            unasked_ripple: self.file.library.unasked_ripple(),
            may_widen: self.may_widen(),
            drive_gain_sd: self.drive_gain_sd(log)?,
            most_bytes: None,
            ..CalibrationSettings::default()
        })
    }

    /// Whether the fit may go on in a wider band, which it chooses together with the likelihood.
    fn may_widen(&self) -> bool {
        self.file.signal.wider_band.unwrap_or(true) && self.file.noise.model.is_none()
    }

    fn signal(&self) -> Result<SignalSettings> {
        let table = &self.file.signal;
        let (at_least_zero, positive) = (|hz: f64| hz >= 0.0, |hz: f64| hz > 0.0);
        Ok(SignalSettings {
            cutoff_hz: self.auto(
                "signal.cutoff_hz",
                table.cutoff_hz,
                at_least_zero,
                "\"auto\", 0 or a positive Hz",
            )?,
            rate_hz: self.auto(
                "signal.rate_hz",
                table.rate_hz,
                positive,
                "\"auto\" or a positive Hz",
            )?,
            coulomb_velocity: self.coulomb_velocity()?,
            corrections: Corrections {
                lag: self.lag()?,
                velocity: table.velocity.map(|word| match word {
                    VelocityWord::Logged => DerivedFrom::Velocity,
                    VelocityWord::Position => DerivedFrom::Position,
                }),
            },
            every_sample: !self.file.library.terms.is_empty()
                || self.file.library.ripple.iter().flatten().count() > 0,
        })
    }

    fn lag(&self) -> Result<Lag> {
        let range = "seconds between -1 and 1";
        let number = |key: &str, lag: f64| self.number(key, lag, |lag| lag.abs() <= 1.0, range);
        Ok(match &self.file.signal.lag {
            None | Some(LagOrAuto::Auto(_)) => Lag::Unsaid,
            Some(LagOrAuto::Given(PerJoint::All(lag))) => Lag::All(number("signal.lag", *lag)?),
            Some(LagOrAuto::Given(PerJoint::ByJoint(joints))) => {
                for (joint, lag) in joints {
                    number(&format!("signal.lag.{joint}"), *lag)?;
                }
                Lag::Joints(joints.clone())
            }
        })
    }

    fn coulomb_velocity(&self) -> Result<Option<f64>> {
        let Some(v) = self.file.library.coulomb_velocity else {
            return Ok(None);
        };
        self.number(
            "library.coulomb_velocity",
            v,
            |v| v >= 0.0,
            "0 or a positive velocity in rad/s or m/s",
        )?;
        Ok(Some(v))
    }

    fn library(&self, signal: &SignalSettings) -> Result<LibrarySettings> {
        let table = &self.file.library;
        let default_velocity = if signal.cutoff_hz == Auto::Value(0.0) {
            0.0
        } else {
            0.02
        };
        for (joint, &periods) in table.ripple.iter().flatten() {
            self.number(
                &format!("library.ripple.{joint}"),
                periods,
                |periods| periods > 0.0,
                "the gear ratio, a positive number",
            )?;
        }
        Ok(LibrarySettings {
            terms: table.terms.clone(),
            generic: table.generic,
            families: table.families(),
            coulomb_velocity: signal.coulomb_velocity.unwrap_or(default_velocity),
            payload_frame: table.payload_frame.clone(),
            nonnegative: table.nonnegative.unwrap_or(true),
            ripple: table.ripple.clone().unwrap_or_default(),
            linearised_at: BTreeMap::new(),
        })
    }

    fn prior(&self) -> Result<PriorSettings> {
        let table = &self.file.prior;
        let scaled_variance = match table.slab {
            None | Some(Slab::Auto(_)) => Auto::Auto,
            Some(Slab::Given { scaled_variance: v }) => Auto::Value(self.number(
                "prior.slab.scaled_variance",
                v,
                |v| v > 0.0,
                "a positive number",
            )?),
        };
        let noise = match table.noise {
            None | Some(NoisePrior::Auto(_)) => None,
            Some(NoisePrior::Given { shape, scale }) => Some((
                self.number("prior.noise.shape", shape, |a| a > 0.0, "a positive number")?,
                self.number(
                    "prior.noise.scale",
                    scale,
                    |b| b > 0.0,
                    "a positive number in (N·m)²",
                )?,
            )),
        };
        Ok(PriorSettings {
            scaled_variance,
            inclusion: self.inclusion()?,
            noise,
            families: self.expected_families()?,
            forced: table.forced.clone().unwrap_or_default(),
            heredity: table
                .heredity
                .clone()
                .map(|pairs| pairs.into_iter().collect()),
        })
    }

    /// `[prior] families`: words of families and expected numbers.
    fn expected_families(&self) -> Result<Vec<(Family, f64)>> {
        let known = || Family::UNNAMED.into_iter().chain(Family::NAMED);
        let mut out = Vec::new();
        for (word, &expected) in &self.file.prior.families {
            let key = format!("prior.families.{word}");
            let Some(family) = known().find(|family| family.word() == word) else {
                let words: Vec<&str> = known().map(Family::word).collect();
                let remedy = format!("use one of {}", words.join(", "));
                return Err(self.out_of_range(&key, format!("no family `{word}`"), &remedy));
            };
            let range = "a positive number of components";
            out.push((family, self.number(&key, expected, |m| m > 0.0, range)?));
        }
        Ok(out)
    }

    fn inclusion(&self) -> Result<Option<Inclusion>> {
        let Some(table) = self.file.prior.inclusion else {
            return Ok(None);
        };
        match (table.probability, table.expected_terms) {
            (Some(p), None) => {
                let range = "a probability between 0 and 1, both excluded";
                let p = self.number(
                    "prior.inclusion.probability",
                    p,
                    |p| p > 0.0 && p < 1.0,
                    range,
                )?;
                Ok(Some(Inclusion::Probability(p)))
            }
            (None, Some(m)) => {
                let m = self.number(
                    "prior.inclusion.expected_terms",
                    m,
                    |m| m > 0.0,
                    "a positive number of terms",
                )?;
                Ok(Some(Inclusion::ExpectedTerms(m)))
            }
            (given, _) => {
                let problem = if given.is_some() {
                    "both keys are given"
                } else {
                    "neither key is given"
                };
                let remedy = "give either { expected_terms = 5 } or { probability = 0.2 }";
                Err(self.out_of_range("prior.inclusion", problem.into(), remedy))
            }
        }
    }

    fn noise(&self) -> NoiseSettings {
        let table = &self.file.noise;
        let model = match table.model {
            None | Some(NoiseWord::Tempered) => NoiseModel::Tempered,
            Some(NoiseWord::Ar1) => NoiseModel::Ar1,
            Some(NoiseWord::Iid) => NoiseModel::Iid,
        };
        NoiseSettings {
            model,
            per_joint: table.per_joint.unwrap_or(true),
            robust: table.robust.unwrap_or(false),
            varies_with_speed: table.varies_with_speed.unwrap_or(false),
            varies_with_load: table.varies_with_load.unwrap_or(false),
        }
    }

    fn inference(&self) -> Result<InferenceSettings> {
        let table = &self.file.inference;
        Ok(InferenceSettings {
            method: match table.method {
                None | Some(MethodWord::Auto) => Choice::Auto,
                Some(MethodWord::Exact) => Choice::Exact,
                Some(MethodWord::Gibbs) => Choice::Gibbs,
            },
            chains: self
                .count("inference.chains", table.chains, LEAST_CHAINS as u64, 1024)?
                .unwrap_or(4),
            draws: self
                .count(
                    "inference.draws",
                    table.draws,
                    LEAST_DRAWS as u64,
                    10_000_000,
                )?
                .unwrap_or(5000),
            seed: self.seed(table.seed)?,
            allow_disagreement: self.allows(Allow::DisagreeingChains),
        })
    }

    /// Whole numbers of TOML, in which the report repeats the settings, go no further.
    fn seed(&self, seed: Option<u64>) -> Result<u64> {
        let seed = seed.unwrap_or(1);
        if i64::try_from(seed).is_ok() {
            return Ok(seed);
        }
        let remedy = format!("give a whole number from 0 to {}", i64::MAX);
        Err(self.out_of_range("inference.seed", format!("{seed} is out of range"), &remedy))
    }

    pub(super) fn number(
        &self,
        key: &str,
        value: f64,
        good: impl Fn(f64) -> bool,
        expected: &str,
    ) -> Result<f64> {
        if value.is_finite() && good(value) {
            return Ok(value);
        }
        Err(self.out_of_range(
            key,
            format!("{value} is out of range"),
            &format!("give {expected}"),
        ))
    }

    fn auto(
        &self,
        key: &str,
        value: Option<NumberOrAuto>,
        good: impl Fn(f64) -> bool,
        expected: &str,
    ) -> Result<Auto> {
        match value {
            None | Some(NumberOrAuto::Auto(_)) => Ok(Auto::Auto),
            Some(NumberOrAuto::Number(value)) => {
                self.number(key, value, good, expected).map(Auto::Value)
            }
        }
    }

    fn count(&self, key: &str, value: Option<u64>, least: u64, most: u64) -> Result<Option<usize>> {
        match value {
            Some(n) if n < least || n > most => {
                let remedy = format!("give a whole number from {least} to {most}");
                Err(self.out_of_range(key, format!("{n} is out of range"), &remedy))
            }
            // `most` fits any usize.
            other => Ok(other.map(|n| n as usize)),
        }
    }
}
