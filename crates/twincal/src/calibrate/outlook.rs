//! Before anything is fitted: what would be looked for, and what the logs cannot show of it.

use crate::error::{Finding, Result};
use crate::excitation::{Excitation, STATES, States, excitation};
use crate::gram::{Gram, JointAccumulator, Workspace};
use crate::incidents::{Incident, leave_out};
use crate::robot::Robot;
use crate::rows::{RowSignal, count_rows, visit_rows};
use crate::signal::{Log, Payload, Pipeline, Raw, Trajectory, prepare, ready};
use crate::term::{Library, LibrarySettings};

/// v_s where neither settings nor logs say one, rad/s: the names of the candidates do not depend on it.
const COULOMB_VELOCITY: f64 = 0.02;

/// What [`outlook`] gives.
#[derive(Debug, Clone)]
pub struct Outlook {
    /// The candidates that [`super::calibrate`] would weigh.
    pub library: Library,
    /// What the logs show of them; `None` without logs.
    pub excitation: Option<Excitation>,
    /// What the library has to say.
    pub findings: Vec<Finding>,
}

/// A log whose rows are to be looked at.
#[derive(Debug)]
pub struct LookedAt<'a> {
    /// The log itself: one in chapters is visited again.
    pub log: &'a Log<'a>,
    /// Its motion, or that of some of its chapters.
    pub trajectory: &'a mut Trajectory,
    /// What is left out of it.
    pub incidents: &'a [Incident],
}

/// The candidates for `robot`, and what some logs, as aligned by `pipeline`, can show of them. The rows are streamed:
/// memory does not grow with the logs.
///
/// # Errors
/// Those of [`Library::propose`] and [`visit_rows`].
pub fn outlook(
    robot: &Robot,
    settings: &LibrarySettings,
    logs: Option<(&Pipeline, Vec<LookedAt<'_>>)>,
) -> Result<Outlook> {
    let velocity = match &logs {
        Some((pipeline, _)) => pipeline.coulomb_velocity,
        None if settings.coulomb_velocity > 0.0 => settings.coulomb_velocity,
        None => COULOMB_VELOCITY,
    };
    let mut settings = LibrarySettings {
        coulomb_velocity: velocity,
        ..settings.clone()
    };
    // States say nothing of what remembers: a fit follows the logs.
    settings.families.retain(|family| !family.remembers());
    let (library, findings) = Library::propose(robot, &settings)?;
    let excitation = match logs {
        Some((pipeline, mut logs)) if !logs.is_empty() => {
            let unknown = logs.iter().any(|at| at.log.payload() == Payload::Unknown);
            for LookedAt {
                log, trajectory, ..
            } in &mut logs
            {
                trajectory.payload_acts = !unknown || log.payload() == Payload::Unknown;
            }
            let (gram, rows) = statistics(robot, &library, pipeline, &logs)?;
            Some(excitation(robot, &library, &gram, &rows))
        }
        _ => None,
    };
    Ok(Outlook {
        library,
        excitation,
        findings,
    })
}

/// Statistics of the rows that a fit would use, and some of their states.
fn statistics(
    robot: &Robot,
    library: &Library,
    pipeline: &Pipeline,
    logs: &[LookedAt<'_>],
) -> Result<(Gram, States)> {
    let dof = robot.dof();
    let mut count = 0;
    for LookedAt {
        log, trajectory, ..
    } in logs
    {
        count += match log {
            Log::Whole(_) => count_rows(pipeline, trajectory, RowSignal::Filtered),
            Log::Long(_) => ready(robot, log, pipeline)?.rows_at_most(pipeline),
        };
    }
    let step = (count / STATES).max(1);
    let mut accumulators: Vec<JointAccumulator> = (0..dof)
        .map(|joint| {
            let columns = library.columns_of_joint(joint).iter();
            JointAccumulator::new(columns.map(|&column| column as u32).collect())
        })
        .collect();
    let mut workspace = Workspace::default();
    let mut kept = vec![[(); 3].map(|()| Vec::new()); dof];
    let mut still = vec![Vec::new(); dof];
    let mut row = 0;
    let mut look = |trajectory: &Trajectory| {
        visit_rows(
            robot,
            library,
            pipeline,
            trajectory,
            RowSignal::Filtered,
            &mut |block| {
                let wanted: Vec<usize> = (0..block.len).filter(|k| (row + k) % step == 0).collect();
                row += block.len;
                let nothing = vec![0.0; block.len];
                for (joint, rows) in block.joints.iter().enumerate() {
                    let keep: Vec<bool> = rows.standstill.iter().map(|still| !still).collect();
                    accumulators[joint].push_block(
                        rows.x,
                        rows.stride,
                        &nothing,
                        &keep,
                        block.first,
                        &mut workspace,
                    );
                    for &k in &wanted {
                        let at = joint * block.len + k;
                        for (kept, values) in
                            kept[joint].iter_mut().zip([block.q, block.qd, block.qdd])
                        {
                            kept.push(values[at]);
                        }
                        still[joint].push(rows.standstill[k]);
                    }
                }
                Ok(())
            },
        )
    };
    for LookedAt {
        log,
        trajectory,
        incidents,
    } in logs
    {
        match log {
            Log::Whole(_) => look(trajectory)?,
            Log::Long(long) => long.visit(&mut Vec::new(), |_, chapter, _| {
                let (mut part, _) =
                    prepare(robot, chapter, pipeline)?.align(pipeline, Raw::None)?;
                part.payload_acts = trajectory.payload_acts;
                leave_out(pipeline, &mut part, incidents);
                look(&part)
            })?,
        }
    }
    let channel = |k: usize| -> Vec<f64> {
        let of_joints = kept.iter().flat_map(|joint| joint[k].iter());
        of_joints.copied().collect()
    };
    let states = States {
        len: still.first().map_or(0, Vec::len),
        q: channel(0),
        qd: channel(1),
        qdd: channel(2),
        still: still.concat(),
    };
    let joints = accumulators.into_iter().map(JointAccumulator::finish);
    Ok((
        Gram {
            joints: joints.collect(),
        },
        states,
    ))
}
