//! How sharply friction turns round: v_s of `tanh(q̇/v_s)` where the user says nothing, by what training data leave unexplained.
//!
//! Bearings and gears differ. With the wrong v_s every reversal leaves a pulse that looks like noise and moves the effects beside it. A
//! few evenly spread stretches of the training logs are fitted once per v_s, with all components in but hysteresis, and
//!
//! ```text
//! gain(v_s) = Σ_j n_j / (2 τ_j) · ln(s_j²(0.02) / s_j²(v_s))
//! ```
//! is what a v_s explains more than the usual one, in nats: s_j² the mean square of joint j's residual over its n_j moving rows, τ_j their
//! autocorrelation time with the usual v_s. Every v_s has as many coefficients; of what is gained the share K/Σ n_j counts as fitted noise and
//! is taken off. The stretches are on the clock that is made for the usual v_s, which sees sharper friction a little blurred.
//! From the usual one the search doubles and halves as long as a step gains [`CLEARLY`], up to four times; it counts
//! where it takes [`NOTICEABLY`] off the residual.

use super::columns::columns_of;
use crate::calibrate::data::all_logs::{tell_payload_apart, zero_columns};
use crate::calibrate::settings::CalibrationSettings;
use crate::error::{Code, Finding, Result, Severity};
use crate::likelihood::{NoiseModel, NoiseSettings};
use crate::observations::{Observations, Part, observe};
use crate::plug_in::{Fit, FitSettings, Moving, fit, residual_correlation_time, start};
use crate::posterior::Posterior;
use crate::robot::Robot;
use crate::signal::{Log, Payload, Pipeline, ReadyLog, Trajectory, ready, stretches};
use crate::statistics::{Purpose, Runs, Sums};
use crate::term::{Family, Library, LibrarySettings};

/// Factors between neighbouring v_s, and how often one may be applied.
const STEPS: [f64; 2] = [0.5, 2.0];
const MOST_STEPS: usize = 2;
/// Samples of all training logs together that are looked at, about.
const SAMPLES: usize = 1 << 13;
/// Columns beyond which a fit with all of them is no quick look: the usual v_s stays.
const MOST_COLUMNS: usize = 500;
/// Moving rows of all joints per column below which nothing is chosen.
const ROWS_PER_COLUMN: f64 = 3.0;
/// What a step has to gain, nats.
const CLEARLY: f64 = 5.0;
/// What another v_s has to take off the standard deviation of the residual, as the geometric mean of the joints.
const NOTICEABLY: f64 = 0.02;

/// Another v_s than the usual one.
pub(in crate::calibrate) struct Turned {
    /// With that v_s, and fine enough for it.
    pub(in crate::calibrate) pipeline: Pipeline,
    /// Candidates with that v_s.
    pub(in crate::calibrate) library: Library,
    /// What was chosen.
    pub(in crate::calibrate) finding: Finding,
}

impl Turned {
    /// Logs in memory on a clock that is fine enough; those in chapters are prepared whenever they are visited.
    ///
    /// # Errors
    /// Those of [`ready`].
    pub(in crate::calibrate) fn prepare_again<'a>(
        &self,
        robot: &Robot,
        logs: &'a [Log<'_>],
        before: &Pipeline,
        prepared: &mut [ReadyLog<'a>],
    ) -> Result<()> {
        if self.pipeline.motion_interval == before.motion_interval {
            return Ok(());
        }
        for (log, prepared) in logs.iter().zip(prepared) {
            if matches!(prepared, ReadyLog::Whole(_)) {
                *prepared = ready(robot, log, &self.pipeline)?;
            }
        }
        Ok(())
    }
}

/// Another v_s than that of `pipeline` and `library`, if the training logs clearly ask for it; `unknown`: see [`crate::calibrate::data::all_logs::carry_something`].
/// Where all components together cannot be fitted nothing is chosen: what is wrong is said by the fit itself.
///
/// # Errors
/// Those of candidates and rows, and of chapters that cannot be read.
pub(in crate::calibrate) fn turn(
    robot: &Robot,
    library: &Library,
    (logs, prepared, unknown): (&[Log<'_>], &[ReadyLog<'_>], bool),
    pipeline: &Pipeline,
    settings: &CalibrationSettings,
) -> Result<Option<Turned>> {
    let mut families = settings.library.families.iter();
    let stated = settings.signal.coulomb_velocity.is_some();
    let many = library.columns().len() > MOST_COLUMNS;
    if stated || many || pipeline.is_off() || !families.any(|family| family.turns_round()) {
        return Ok(None);
    }
    let mut trajectories = stretches(prepared, SAMPLES, pipeline)?;
    for trajectory in &mut trajectories {
        trajectory.payload_acts = !unknown || trajectory.payload == Payload::Unknown;
    }
    let trial = Trial {
        robot,
        trajectories,
        pipeline,
        settings,
        payload_apart: tell_payload_apart(logs),
        own: 1.0,
    };
    let Some((usual, fit)) = trial.usual(library)? else {
        return Ok(None);
    };
    let columns = fit.posterior.mean.len() as f64;
    let rows: f64 = usual.iter().map(|left| left.rows).sum();
    if rows < ROWS_PER_COLUMN * columns {
        return Ok(None);
    }
    let trial = Trial {
        own: 1.0 - columns / rows,
        ..trial
    };
    let walk = |factor: f64| trial.walk(library, factor, &usual, &fit);
    let (slower, faster) = rayon::join(|| walk(STEPS[0]), || walk(STEPS[1]));
    let ways = [slower?, faster?].into_iter().flatten();
    let best = ways.max_by(|a, b| a.gain.total_cmp(&b.gain));
    let best = best.filter(|best| best.share > NOTICEABLY);
    Ok(best.map(|best| Turned {
        finding: best.finding(pipeline.coulomb_velocity),
        pipeline: pipeline.turning(best.velocity, &trial.trajectories),
        library: best.library,
    }))
}

/// What a fit leaves of a joint's torque.
struct Left {
    rows: f64,
    mean_square: f64,
    /// Autocorrelation time, rows.
    time: f64,
}

/// Another v_s, and what it explains more than the usual one.
struct Way {
    velocity: f64,
    library: Library,
    /// Nats.
    gain: f64,
    /// Off the residual's standard deviation.
    share: f64,
}

impl Way {
    fn finding(&self, usual: f64) -> Finding {
        let Self {
            velocity,
            gain,
            share,
            ..
        } = self;
        Finding::new(
            Severity::Note,
            Code::CoulombVelocity,
            "",
            format!(
                "friction reverses within {velocity} rad/s (m/s) instead of the usual {usual}: the residual is {:.0} % smaller, \
                 {gain:.0} nats; [library] coulomb_velocity sets another",
                100.0 * share
            ),
            0,
        )
        .with([
            ("velocity", *velocity), ("usual_velocity", usual), ("error_reduction", *share),
            ("nats", *gain),
        ])
    }
}

/// What is fitted again and again.
struct Trial<'a> {
    robot: &'a Robot,
    trajectories: Vec<Trajectory>,
    pipeline: &'a Pipeline,
    settings: &'a CalibrationSettings,
    payload_apart: bool,
    /// Share of what is explained that is not fitted noise.
    own: f64,
}

impl Trial<'_> {
    /// The usual v_s; `None` where nothing can be fitted.
    fn usual(&self, library: &Library) -> Result<Option<(Vec<Left>, Fit)>> {
        self.fitted(library, None)
    }

    /// Steps from the usual v_s in one direction as long as each gains enough.
    fn walk(
        &self,
        library: &Library,
        factor: f64,
        usual: &[Left],
        fit: &Fit,
    ) -> Result<Option<Way>> {
        let mut best: Option<Way> = None;
        let mut velocity = self.pipeline.coulomb_velocity;
        for _ in 0..MOST_STEPS {
            velocity *= factor;
            let settings = LibrarySettings {
                coulomb_velocity: velocity,
                ..self.settings.library.clone()
            };
            let library = library.turning(self.robot, &settings)?;
            let Some((left, _)) = self.fitted(&library, Some(fit))? else {
                break;
            };
            let (gain, share) = compared(usual, &left);
            let gain = self.own * gain;
            if gain < best.as_ref().map_or(0.0, |best| best.gain) + CLEARLY {
                break;
            }
            best = Some(Way {
                velocity,
                library,
                gain,
                share,
            });
        }
        Ok(best)
    }

    /// A fit with all components in, plug-ins as in `like` or at their fixed point, and what it leaves.
    fn fitted(&self, library: &Library, like: Option<&Fit>) -> Result<Option<(Vec<Left>, Fit)>> {
        let (logs, library) = self.observed(library)?;
        let parts: Vec<Part<'_>> = logs.iter().map(Observations::whole).collect();
        let joints = 0..self.robot.dof();
        let moves = |joint: usize| parts.iter().any(|part| part.moving_rows(joint) > 0.0);
        if library.columns().is_empty() || !joints.clone().any(moves) {
            return Ok(None);
        }
        // What is asked for may be zero in these stretches: the whole log decides.
        let columns = columns_of(self.robot, &library, self.settings, self.payload_apart);
        let Ok(mut columns) = columns else {
            return Ok(None);
        };
        columns.forced.fill(true);
        // One model without bounds is one solution of a linear system.
        columns.lower.fill(f64::NEG_INFINITY);
        let fit_settings = FitSettings {
            noise: NoiseSettings {
                model: NoiseModel::Iid,
                ..self.settings.noise
            },
            prior: &self.settings.prior,
        };
        let sums = Sums::of(&parts, Runs::Apart, Purpose::Fit);
        let fit = match like {
            None => {
                let start = start(&sums, &columns, &self.settings.prior);
                fit(&sums, &columns, fit_settings, &start, Moving::All, None)
            }
            Some(like) => {
                let alike = |known: &&Posterior| known.mean.len() == columns.names.len();
                let known = Some(&like.posterior).filter(alike);
                let moving = Moving::SlabScaleRoughly;
                fit(&sums, &columns, fit_settings, &like.plug_in, moving, known)
            }
        };
        // All components at once may be more than the data and the user's prior can bear, where those that are there are not.
        let Ok(fit) = fit else {
            return Ok(None);
        };
        let beta = &fit.posterior.mean;
        let of_joint = |joint: usize| {
            let (mut sum, mut rows) = (0.0, 0.0);
            for run in (parts.iter()).flat_map(|part| part.residual_runs(joint, beta)) {
                sum += run.iter().map(|r| r * r).sum::<f64>();
                rows += run.len() as f64;
            }
            Left {
                rows,
                mean_square: sum / rows,
                time: residual_correlation_time(&parts, joint, beta),
            }
        };
        Ok(Some((joints.map(of_joint).collect(), fit)))
    }

    /// The rows of the stretches, and the library of the columns that act there.
    fn observed(&self, library: &Library) -> Result<(Vec<Observations>, Library)> {
        let mut logs: Vec<Observations> = (self.trajectories.iter())
            .map(|trajectory| observe(self.robot, library, self.pipeline, trajectory))
            .collect::<Result<_>>()?;
        let mut zero = zero_columns(logs.iter(), library);
        zero.extend(hysteresis(library));
        zero.sort_unstable();
        zero.dedup();
        for log in &mut logs {
            log.drop_columns(&zero);
        }
        Ok((logs, library.without_columns(&zero)))
    }
}

/// Columns of hysteresis: their channels are made for one v_s.
fn hysteresis(library: &Library) -> impl Iterator<Item = usize> {
    let terms = library.columns().iter().enumerate();
    let family = |term: usize| library.terms()[term].family;
    terms
        .filter(move |(_, term)| family(**term) == Family::Hysteresis)
        .map(|(column, _)| column)
}

/// Nats that `other` explains more than `usual`, and what it takes off the residual's standard deviation (geometric mean of the
/// joints that move).
fn compared(usual: &[Left], other: &[Left]) -> (f64, f64) {
    let (mut gain, mut logarithm, mut joints) = (0.0, 0.0, 0.0);
    for (usual, other) in usual.iter().zip(other) {
        let ratio = (usual.mean_square / other.mean_square).ln();
        if ratio.is_finite() {
            gain += usual.rows / (2.0 * usual.time) * ratio;
            logarithm += ratio / 2.0;
            joints += 1.0;
        }
    }
    (gain, 1.0 - (-logarithm / f64::max(joints, 1.0)).exp())
}
