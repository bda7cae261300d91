//! Stage 2: rows of residual torque and columns of the candidates, filtered alike (eq. (1)–(4)).

use super::prepare::Prepared;
use crate::calibrate::data::aligned;
use crate::calibrate::data::all_logs::{self, Data, Trajectories};
use crate::calibrate::data::cross_checked;
use crate::calibrate::data::facts::Facts;
use crate::calibrate::data::other_cutoffs;
use crate::calibrate::data::room;
use crate::calibrate::exit::{Exit, Pass};
use crate::calibrate::fit::columns::columns_of;
use crate::calibrate::fit::dissipative;
use crate::calibrate::fit::fitted;
use crate::calibrate::fit::lower_band::TooFew;
use crate::calibrate::fit::weigh;
use crate::calibrate::request::Goal;
use crate::error::{Error, Finding, Result};
use crate::lag::Lags;
use crate::likelihood::{Columns, Spread};
use crate::self_check::self_check;
use crate::signal::{ReadyLog, ready};
use crate::statistics::{Purpose, Sums};
use crate::term::Library;

/// Rows and columns of all logs.
pub(in crate::calibrate) struct Rows<'a, 'r> {
    pub(in crate::calibrate) prepared: Prepared<'a, 'r>,
    pub(in crate::calibrate) data: Data,
    pub(in crate::calibrate) trajectories: Trajectories,
    pub(in crate::calibrate) lags: Option<Lags>,
    /// Candidates with torque in these logs.
    pub(in crate::calibrate) library: Library,
    /// Columns of the other candidates.
    pub(in crate::calibrate) zero_columns: Vec<usize>,
    pub(in crate::calibrate) columns: Columns,
    /// See [`Data::nominal_misfit`].
    pub(in crate::calibrate) misfit: Option<(usize, [f64; 2])>,
    /// How the noise of each joint varies, once rows are weighed.
    pub(in crate::calibrate) spreads: Vec<Spread>,
    /// What a fit takes of the rows, once they are weighed.
    pub(in crate::calibrate) sums: Sums,
    /// What else is known of the logs.
    pub(in crate::calibrate) facts: Facts,
}

/// Makes the rows, compares logs with each other, and drops columns without torque.
///
/// # Errors
/// [`Exit::TooFew`] with fewer rows than columns need, and those of logs and settings.
pub(in crate::calibrate) fn read<'a, 'r>(
    mut prepared: Prepared<'a, 'r>,
    findings: &mut Vec<Finding>,
) -> Pass<Rows<'a, 'r>> {
    let (robot, goal) = (prepared.request.robot, prepared.request.goal);
    let (mut data, trajectories) = observe(&prepared)?;
    let Prepared {
        pipeline, settings, ..
    } = &prepared;
    let compared = self_check(robot, pipeline, trajectories.all())?;
    if goal != Goal::Count {
        let odd = cross_checked::as_filtered(robot, pipeline, &trajectories, &compared);
        findings.extend(odd);
    }
    findings.extend(compared);
    let of_all = aligned::of_every_log(robot, pipeline, settings, &trajectories, findings);
    let (library, zero_columns) = data.drop_zero_columns(prepared.library.clone());
    let payload_apart = all_logs::tell_payload_apart(prepared.recorded.fit);
    let mut columns = columns_of(robot, &library, settings, payload_apart)?;
    columns.one_motion = prepared.recorded.fit.len() == 1;
    let facts = data.facts();
    columns.halves = dissipative::halves(robot, &prepared.library_settings, &columns, &facts.hull);
    findings.append(&mut data.findings);
    let fitted = &facts.summaries[..data.fit.len()];
    let cutoff = settings.signal.cutoff_hz;
    let enough = all_logs::require_enough((robot, &library), fitted, &columns, cutoff);
    let rows = Rows {
        lags: of_all.or(prepared.lags.take()),
        misfit: None,
        spreads: Vec::new(),
        sums: Sums::default(),
        facts,
        prepared,
        data,
        trajectories,
        library,
        zero_columns,
        columns,
    };
    match enough {
        Ok(()) => Ok(Rows {
            misfit: rows.data.nominal_misfit(),
            ..rows
        }),
        Err(error) => Err(rows.too_few(error)),
    }
}

/// Rows and motion of all logs, if they fit in memory.
fn observe(prepared: &Prepared<'_, '_>) -> Result<(Data, Trajectories)> {
    let Prepared {
        pipeline,
        settings,
        library,
        ..
    } = prepared;
    let robot = prepared.request.robot;
    let heldout = prepared.recorded.heldout.iter();
    let heldout: Vec<ReadyLog<'_>> = heldout
        .map(|log| ready(robot, log, pipeline))
        .collect::<Result<_>>()?;
    let logs = (&prepared.ready[..], &heldout[..]);
    let sweeps = !settings.noise.weighs_rows();
    room::require(settings.most_bytes, library, pipeline, logs, sweeps)?;
    let elsewhere = other_cutoffs::pipelines(pipeline, settings);
    let pipelines = (pipeline, &elsewhere[..]);
    Data::read(robot, library, pipelines, logs.0, logs.1)
}

impl<'r> Rows<'_, 'r> {
    /// Weighs the rows of the fit logs as the settings ask, and adds them up.
    ///
    /// # Errors
    /// Those of [`weigh::weigh`].
    pub(in crate::calibrate) fn weigh(&mut self, findings: &mut Vec<Finding>) -> Result<()> {
        let Prepared {
            request, settings, ..
        } = &self.prepared;
        let (data, columns) = (&mut self.data, &self.columns);
        self.spreads = weigh::weigh(request.robot, data, columns, settings, findings)?;
        self.sums = fitted::sums(&data.training(), settings, Purpose::Result);
        Ok(())
    }

    /// The end of a pass in this band for want of rows.
    pub(in crate::calibrate) fn too_few(&self, error: Error) -> Exit {
        Exit::TooFew(TooFew {
            error,
            cutoff_hz: self.prepared.pipeline.cutoff_hz,
        })
    }

    /// The rows alone: what follows reads the smoothed logs at other cut-offs and nothing of the recordings.
    pub(in crate::calibrate) fn without_recordings(self) -> Rows<'static, 'r> {
        drop(self.trajectories);
        Rows {
            prepared: self.prepared.without_recordings(),
            data: self.data,
            trajectories: Trajectories::default(),
            lags: self.lags,
            library: self.library,
            zero_columns: self.zero_columns,
            columns: self.columns,
            misfit: self.misfit,
            spreads: self.spreads,
            sums: self.sums,
            facts: self.facts,
        }
    }
}
