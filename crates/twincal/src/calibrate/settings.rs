//! What a calibration can be told.

use crate::infer::{Choice, InferenceSettings};
use crate::likelihood::{NoiseModel, NoiseSettings};
use crate::prior::PriorSettings;
use crate::signal::{Auto, Corrections, SignalSettings};
use crate::term::{Family, LibrarySettings};

/// Everything a calibration can be told; each field but the last four is a table of `twincal.toml`.
///
/// # Example
/// Friction alone, and a filter at 5 Hz; everything else stays as an empty `twincal.toml` has it.
/// ```
/// use twincal::prelude::*;
///
/// let mut settings = Settings::default(); // the prelude's name of it
/// settings.library.families.retain(|family| family.is_friction());
/// settings.signal.cutoff_hz = Auto::Value(5.0);
/// assert_eq!(settings.library.families.len(), 9);
/// assert_eq!((settings.inference.chains, settings.inference.draws), (4, 5000));
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationSettings {
    /// `[library]`.
    pub library: LibrarySettings,
    /// `[signal]`.
    pub signal: SignalSettings,
    /// `[prior]`.
    pub prior: PriorSettings,
    /// `[noise]`.
    pub noise: NoiseSettings,
    /// `[inference]`.
    pub inference: InferenceSettings,
    /// What becomes of gear ripple that nobody asked for: what `[library]` families and ripple say beside `library`.
    pub unasked_ripple: UnaskedRipple,
    /// `[signal] wider_band` with no `[noise] model`: where nobody chose a cut-off either and the noise allows it, the fit goes on in a wider
    /// band with `ar1`.
    pub may_widen: bool,
    /// Prior sd of a factor on torque that all drives share (`[prior] drive_gain`); 0: torque is measured at the joints.
    pub drive_gain_sd: f64,
    /// How often columns are worked out anew about what a fit found, where found effects multiply each other (no key of `twincal.toml`).
    pub relinearise: usize,
    /// Bytes that are free for what is made of the recordings (no key of `twincal.toml`); `None`: any number.
    pub most_bytes: Option<u64>,
}

impl Default for CalibrationSettings {
    /// What an empty `twincal.toml` means: every candidate family, everything else chosen from the data.
    fn default() -> Self {
        Self {
            library: LibrarySettings {
                families: Family::DEFAULT.to_vec(),
                nonnegative: true,
                ..LibrarySettings::default()
            },
            signal: SignalSettings {
                cutoff_hz: Auto::Auto,
                rate_hz: Auto::Auto,
                coulomb_velocity: None,
                corrections: Corrections::default(),
                every_sample: false,
            },
            prior: PriorSettings {
                scaled_variance: Auto::Auto,
                inclusion: None,
                noise: None,
                families: Vec::new(),
                forced: Vec::new(),
                heredity: None,
            },
            noise: NoiseSettings {
                model: NoiseModel::Tempered,
                per_joint: true,
                robust: false,
                varies_with_speed: false,
                varies_with_load: false,
            },
            inference: InferenceSettings {
                method: Choice::Auto,
                chains: 4,
                draws: 5000,
                seed: 1,
                allow_disagreement: false,
            },
            unasked_ripple: UnaskedRipple::Candidate,
            may_widen: true,
            drive_gain_sd: 0.0,
            relinearise: 3,
            most_bytes: None,
        }
    }
}

/// What becomes of gear ripple that is no candidate and that the residual shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UnaskedRipple {
    /// A candidate, where `library.families` are the usual ones: nobody said otherwise.
    #[default]
    Candidate,
    /// The warning `ripple_seen`: families were chosen.
    Told,
    /// Nothing, it is not looked for: `ripple = {}`.
    Ignored,
}
