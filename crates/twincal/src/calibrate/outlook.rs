//! Before anything is fitted: what would be looked for, and what the logs cannot show of it.

use crate::error::{Finding, Result};
use crate::excitation::{Excitation, STATES, States, excitation};
use crate::gram::{Gram, JointAccumulator, Workspace};
use crate::incidents::{Incident, leave_out};
use crate::robot::Robot;
use crate::rows::{RowBlock, RowSignal, count_rows, visit_rows};
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
    let mut rows = 0;
    for LookedAt {
        log, trajectory, ..
    } in logs
    {
        rows += match log {
            Log::Whole(_) => count_rows(pipeline, trajectory, RowSignal::Filtered),
            Log::Long(_) => ready(robot, log, pipeline)?.rows_at_most(pipeline),
        };
    }
    let mut sums = RowSums::new(library, (rows / STATES).max(1));
    let mut look = |trajectory: &Trajectory| {
        let mut add = |block: &RowBlock<'_>| {
            sums.add(block);
            Ok(())
        };
        let signal = RowSignal::Filtered;
        visit_rows(robot, library, pipeline, trajectory, signal, &mut add)
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
    Ok(sums.finish())
}

/// Sums over rows of every joint, and the states of every `step`-th row.
struct RowSums {
    accumulators: Vec<JointAccumulator>,
    workspace: Workspace,
    /// Rows from one kept state to the next.
    step: usize,
    rows: usize,
    /// Position, velocity and acceleration of every joint in the kept states.
    kept: Vec<[Vec<f64>; 3]>,
    /// Whether a joint is at rest in them.
    at_rest: Vec<Vec<bool>>,
}

impl RowSums {
    fn new(library: &Library, step: usize) -> Self {
        let accumulator = |joint: usize| {
            let columns = library.columns_of_joint(joint).iter();
            JointAccumulator::new(columns.map(|&column| column as u32).collect())
        };
        let joints = library.joints();
        Self {
            accumulators: (0..joints).map(accumulator).collect(),
            workspace: Workspace::default(),
            step,
            rows: 0,
            kept: vec![[(); 3].map(|()| Vec::new()); joints],
            at_rest: vec![Vec::new(); joints],
        }
    }

    fn add(&mut self, block: &RowBlock<'_>) {
        let wanted: Vec<usize> = (0..block.len)
            .filter(|k| (self.rows + k).is_multiple_of(self.step))
            .collect();
        self.rows += block.len;
        let no_torque = vec![0.0; block.len];
        for (joint, rows) in block.joints.iter().enumerate() {
            let keep: Vec<bool> = rows.standstill.iter().map(|still| !still).collect();
            self.accumulators[joint].push_block(
                rows.x,
                rows.stride,
                &no_torque,
                &keep,
                block.first,
                &mut self.workspace,
            );
            for &k in &wanted {
                let at = joint * block.len + k;
                let state = [block.q, block.qd, block.qdd];
                for (kept, values) in self.kept[joint].iter_mut().zip(state) {
                    kept.push(values[at]);
                }
                self.at_rest[joint].push(rows.standstill[k]);
            }
        }
    }

    fn finish(self) -> (Gram, States) {
        let channel = |k: usize| -> Vec<f64> {
            let of_joints = self.kept.iter().flat_map(|joint| joint[k].iter());
            of_joints.copied().collect()
        };
        let states = States {
            len: self.at_rest.first().map_or(0, Vec::len),
            q: channel(0),
            qd: channel(1),
            qdd: channel(2),
            still: self.at_rest.concat(),
        };
        let joints = self.accumulators.into_iter().map(JointAccumulator::finish);
        (
            Gram {
                joints: joints.collect(),
            },
            states,
        )
    }
}
