//! A calibration put together step by step, as a program asks for it.

use crate::calibrate::{Calibration, CalibrationSettings, Stage, Stopped, calibrate_watched};
use crate::error::Error;
use crate::robot::Robot;
use crate::signal::{Log, Logs};
use std::ops::ControlFlow;

/// A watcher that wants to know nothing.
fn unwatched(_: Stage) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Which logs of which robot are calibrated, and how.
///
/// # Example
/// The paper's arm: it carries 0.6 kg more than its model says.
/// ```
/// # #[path = "../examples/two_link.rs"] mod two_link;
/// # use two_link::{arm, log};
/// use twincal::prelude::*;
///
/// # let mut noise = twincal::random::Random::new(1, 0);
/// # let (robot, real) = (arm(2.0)?, arm(2.6)?);
/// # let mut run = |name: &str, phase: f64| log(name, phase, &real, &mut noise);
/// # let (log, other) = (run("run1", 0.3), run("run2", 1.9));
/// let mut settings = Settings::default();
/// settings.library.families = vec![Family::Payload, Family::Viscous];
/// settings.library.terms = vec!["sin(q1 - q2)".into()];
/// let fit = Calibrate::new(&robot).logs([log]).heldout([other]).settings(settings).run()?;
/// let payload = fit.effects().find(|effect| effect.name() == "payload").ok_or("none")?;
/// let mass = payload.parameter("mass").ok_or("none")?;
/// let [low, high] = mass.interval95;
/// assert!(low < 0.6 && 0.6 < high && payload.status() == Status::Established);
/// for finding in &fit.findings {
///     println!("{}", finding.message); // what was dropped, assumed or looks wrong
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Calibrate<'a> {
    robot: &'a Robot,
    logs: Vec<Log<'a>>,
    heldout: Vec<Log<'a>>,
    settings: CalibrationSettings,
    watch: Box<dyn Fn(Stage) -> ControlFlow<()> + Send + Sync + 'a>,
}

impl<'a> Calibrate<'a> {
    /// Of this robot, with default settings and no log yet.
    #[must_use]
    pub fn new(robot: &'a Robot) -> Self {
        Self {
            robot,
            logs: Vec::new(),
            heldout: Vec::new(),
            settings: CalibrationSettings::default(),
            watch: Box::new(unwatched),
        }
    }

    /// Adds logs that are fitted. What is given away is dropped as soon as nobody needs it.
    #[must_use]
    pub fn logs<L: Into<Log<'a>>>(mut self, logs: impl IntoIterator<Item = L>) -> Self {
        self.logs.extend(logs.into_iter().map(Into::into));
        self
    }

    /// Adds logs that are predicted and never fitted; without any, parts of the fitted ones are left out in turn.
    #[must_use]
    pub fn heldout<L: Into<Log<'a>>>(mut self, logs: impl IntoIterator<Item = L>) -> Self {
        self.heldout.extend(logs.into_iter().map(Into::into));
        self
    }

    /// Everything that can be chosen; [`CalibrationSettings::default`] unless given.
    #[must_use]
    pub fn settings(mut self, settings: CalibrationSettings) -> Self {
        self.settings = settings;
        self
    }

    /// Is called with each stage before it begins, by the thread that runs; `Break` ends the calibration with [`Error::Cancelled`].
    ///
    /// # Example
    /// The callback ends the calibration at its first stage.
    /// ```
    /// # #[path = "../examples/two_link.rs"] mod two_link;
    /// use std::ops::ControlFlow;
    /// use twincal::prelude::*;
    ///
    /// # let (robot, mut noise) = (two_link::arm(2.0)?, twincal::random::Random::new(1, 0));
    /// # let log = two_link::log("run1", 0.3, &robot, &mut noise);
    /// let watch = |stage: Stage| {
    ///     println!("{stage:?}");
    ///     ControlFlow::Break(())
    /// };
    /// let stopped = Calibrate::new(&robot).logs([log]).progress(watch).run().unwrap_err();
    /// assert_eq!(stopped.error, Error::Cancelled);
    /// # Ok::<(), Error>(())
    /// ```
    #[must_use]
    pub fn progress(mut self, watch: impl Fn(Stage) -> ControlFlow<()> + Send + Sync + 'a) -> Self {
        self.watch = Box::new(watch);
        self
    }

    /// Runs it.
    ///
    /// # Errors
    /// Those of [`calibrate`](crate::calibrate::calibrate), and [`Error::Cancelled`]; each with what was found before.
    pub fn run(self) -> Result<Calibration, Stopped> {
        let watch = |stage: Stage| match (self.watch)(stage) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Error::Cancelled),
        };
        let (logs, heldout) = (Logs::from(self.logs), Logs::from(self.heldout));
        calibrate_watched(self.robot, (logs, heldout), &self.settings, &watch)
    }
}
