//! Is the torque of a log what it is said to be? Columns that are turned, exchanged or late look like a robot that changed; here they are tried first.
//!
//! With y_j the filtered measured torque of joint j, p_j the twin's and σ_j its held-out error, the sum S_j = Σ (y_j − p_j)²/σ_j² over the rows in which
//! the joint moves is compared with what is left of it where another column, or the opposite sign, is read in the place of y_j, or where all
//! joints are read d later. None of these readings has more than one free number.

use crate::error::{Code, Finding, Severity};
use crate::observations::Observations;
use crate::words::listed;

/// Share of S that a reading may leave (docs/decisions/080-readings-before-changes.md).
const LEFT: f64 = 0.25;
/// The same of what the best change leaves: in a motion of one frequency more viscous friction is a lag.
const LEFT_OF_CHANGE: f64 = 0.5;
/// Latest and earliest torque that is tried, s.
const LATEST: f64 = 0.25;
/// Shifts that are tried to either side, at most; between two of them torque is a line.
const SHIFTS: usize = 25;

/// Sums of one joint over the rows in which it moves.
#[derive(Debug, Clone, Default)]
struct JointSums {
    rows: f64,
    /// pᵀp of the twin's torque.
    predicted: f64,
    /// Of every column of measured torque: yᵀp, yᵀy, Σ y.
    product: Vec<f64>,
    square: Vec<f64>,
    sum: Vec<f64>,
}

impl JointSums {
    /// What `sign` times a column leaves of this joint's torque, N²·m².
    fn left(&self, (column, sign): (usize, f64)) -> f64 {
        (self.predicted - 2.0 * sign * self.product[column] + self.square[column]).max(0.0)
    }

    /// Share of the variance of a column that the twin's torque of this joint explains; 0 where it is further off than a constant.
    fn explained(&self, reading: (usize, f64)) -> f64 {
        let variance = self.variance(reading.0);
        (1.0 - self.left(reading) / variance.max(f64::MIN_POSITIVE)).max(0.0)
    }

    /// Sum of squares of a column about its mean, N²·m².
    fn variance(&self, column: usize) -> f64 {
        self.square[column] - self.sum[column].powi(2) / self.rows
    }
}

/// Sums over rows whose torque is known at all shifts, of all joints, each divided by σ_j².
#[derive(Debug, Clone, Default)]
struct LagSums {
    /// Time from one shift to the next, s, and rows.
    step: f64,
    stride: usize,
    rows: f64,
    predicted: f64,
    /// Of every shift, the earliest first: yᵀp, yᵀy, and yᵀ of the next shift's y.
    product: Vec<f64>,
    square: Vec<f64>,
    next: Vec<f64>,
}

/// What reading torque later leaves.
struct Late {
    lag: f64,
    /// The lag may be larger: it is the last that is tried.
    at_end: bool,
    sd: f64,
    /// Share of S.
    left: f64,
}

/// Collects rows of one log.
#[derive(Debug, Clone)]
pub(super) struct Readings {
    /// 1/σ_j².
    weight: Vec<f64>,
    joints: Vec<JointSums>,
    late: LagSums,
}

/// What a reading is compared with.
pub(super) struct Limits<'a> {
    /// Factor by which the error of a joint may be above σ_j.
    pub(super) ratio: f64,
    /// What the best change explains of S over all joints.
    pub(super) change: f64,
    /// Longest autocorrelation time of the twin's noise, rows.
    pub(super) autocorrelation_time: f64,
    pub(super) joints: &'a [&'a str],
}

/// How torque has to be read.
enum Reading {
    /// All of it with the opposite sign.
    Turned,
    /// Joints with the column, and the sign, that fits them.
    Columns(Vec<(usize, (usize, f64))>),
    Late(Late),
}

/// A reading with S of the joints that it concerns, as logged and with it.
struct Tried {
    reading: Reading,
    before: f64,
    after: f64,
}

impl Readings {
    pub(super) fn new(error: &[f64]) -> Self {
        let sums = || JointSums {
            product: vec![0.0; error.len()],
            square: vec![0.0; error.len()],
            sum: vec![0.0; error.len()],
            ..JointSums::default()
        };
        Self {
            weight: error.iter().map(|error| error.powi(-2)).collect(),
            joints: error.iter().map(|_| sums()).collect(),
            late: LagSums::default(),
        }
    }

    /// Adds rows with what the twin leaves of them, joint by joint.
    pub(super) fn take(&mut self, rows: &Observations, residual: &[Vec<f64>]) {
        let measured: Vec<_> = rows.joints.iter().map(|own| own.measured.get()).collect();
        self.late.start(&rows.time);
        let runs = rows.whole().runs_between_starts();
        for (joint, sums) in self.joints.iter_mut().enumerate() {
            let still = &rows.joints[joint].standstill;
            let own = &measured[joint];
            let twin: Vec<f64> = own
                .iter()
                .zip(&residual[joint])
                .map(|(y, e)| y - e)
                .collect();
            for row in (0..rows.len()).filter(|row| !still[*row]) {
                sums.rows += 1.0;
                sums.predicted += twin[row] * twin[row];
                for (column, measured) in measured.iter().enumerate() {
                    let y = measured[row];
                    sums.product[column] += y * twin[row];
                    sums.square[column] += y * y;
                    sums.sum[column] += y;
                }
            }
            for run in &runs {
                let part = (&own[run.clone()], &twin[run.clone()], &still[run.clone()]);
                self.late.add(part, self.weight[joint]);
            }
        }
    }

    /// What the log is, if any change of the robot leaves twice as much of its torque; empty where the torque is near the twin's, or nothing else is.
    pub(super) fn findings(&self, log: &str, limits: &Limits<'_>) -> Vec<Finding> {
        let tried = [self.turned(limits), self.columns(limits), self.late(limits)];
        let clear = |own: &Tried| own.after < LEFT_OF_CHANGE * (own.before - limits.change);
        let best = tried.into_iter().flatten().filter(clear);
        let gain = |own: &Tried| own.before - own.after;
        match best.max_by(|a, b| gain(a).total_cmp(&gain(b))) {
            None => Vec::new(),
            Some(own) => match own.reading {
                Reading::Turned => vec![self.all_turned(log)],
                Reading::Columns(columns) => self.of_columns(log, &columns, limits.joints),
                Reading::Late(late) => vec![late.finding(log)],
            },
        }
    }

    fn moving(&self) -> impl Iterator<Item = usize> {
        (0..self.joints.len()).filter(|&joint| self.joints[joint].rows > 0.0)
    }

    /// S_j with a column in the place of the joint's.
    fn left(&self, joint: usize, reading: (usize, f64)) -> f64 {
        self.weight[joint] * self.joints[joint].left(reading)
    }

    /// S_j as logged.
    fn logged(&self, joint: usize) -> f64 {
        self.left(joint, (joint, 1.0))
    }

    /// Whether the error of a joint is above its gate.
    fn fails(&self, joint: usize, limits: &Limits<'_>) -> bool {
        self.logged(joint) > limits.ratio.powi(2) * self.joints[joint].rows
    }

    /// All joints with the opposite sign.
    fn turned(&self, limits: &Limits<'_>) -> Option<Tried> {
        let before: f64 = self.moving().map(|joint| self.logged(joint)).sum();
        let after: f64 = self.moving().map(|j| self.left(j, (j, -1.0))).sum();
        let fails = self.moving().any(|joint| self.fails(joint, limits));
        let several = self.moving().count() > 1;
        (several && fails && after < LEFT * before).then_some(Tried {
            reading: Reading::Turned,
            before,
            after,
        })
    }

    /// Joints whose torque is that of another column, or of their own turned.
    fn columns(&self, limits: &Limits<'_>) -> Option<Tried> {
        let failing: Vec<usize> = self.moving().filter(|j| self.fails(*j, limits)).collect();
        let best = |&joint: &usize| {
            let all = failing.iter().flat_map(|&from| [(from, 1.0), (from, -1.0)]);
            let best = all.min_by(|a, b| {
                let left = |reading| self.left(joint, reading);
                left(*a).total_cmp(&left(*b))
            })?;
            let clear = self.left(joint, best) < LEFT * self.logged(joint);
            clear.then_some((joint, best))
        };
        let read: Vec<(usize, (usize, f64))> = failing.iter().filter_map(best).collect();
        let once = |joint: &usize| read.iter().filter(|(_, (from, _))| from == joint).count() == 1;
        if read.is_empty() || !read.iter().all(|(joint, _)| once(joint)) {
            return None;
        }
        // Said once of all joints together.
        let all_turned = read.iter().all(|(joint, (from, _))| joint == from);
        if all_turned && read.len() > 1 && read.len() == self.moving().count() {
            return None;
        }
        let sum = |left: &dyn Fn(usize, (usize, f64)) -> f64| -> f64 {
            read.iter().map(|&(joint, own)| left(joint, own)).sum()
        };
        Some(Tried {
            before: sum(&|joint, _| self.logged(joint)),
            after: sum(&|joint, own| self.left(joint, own)),
            reading: Reading::Columns(read),
        })
    }

    /// All joints earlier or later.
    fn late(&self, limits: &Limits<'_>) -> Option<Tried> {
        let late = self.late.best(limits.autocorrelation_time)?;
        let logged: f64 = self.moving().map(|joint| self.logged(joint)).sum();
        let fails = self.moving().any(|joint| self.fails(joint, limits));
        (fails && late.left < LEFT).then_some(Tried {
            before: logged,
            after: late.left * logged,
            reading: Reading::Late(late),
        })
    }

    fn all_turned(&self, log: &str) -> Finding {
        let variance: f64 = self
            .moving()
            .map(|joint| self.weight[joint] * self.joints[joint].variance(joint))
            .sum();
        let share = |sign: f64| {
            let left: f64 = self.moving().map(|j| self.left(j, (j, sign))).sum();
            (1.0 - left / variance.max(f64::MIN_POSITIVE)).max(0.0)
        };
        let [before, after] = [share(1.0), share(-1.0)];
        let message = format!(
            "log `{log}`: torque of all joints has the opposite sign: the twin explains {} of it turned, {} as logged; turn the columns with \
             [columns] factor",
            percent(after),
            percent(before)
        );
        Finding::new(Severity::Degraded, Code::SignFlip, log, message, 0)
            .with([("explained", after), ("explained_before", before)])
    }

    fn of_columns(
        &self,
        log: &str,
        columns: &[(usize, (usize, f64))],
        joints: &[&str],
    ) -> Vec<Finding> {
        let shares = |&(joint, reading): &(usize, (usize, f64))| {
            let sums = &self.joints[joint];
            [sums.explained((joint, 1.0)), sums.explained(reading)]
        };
        let (own, moved): (Vec<_>, Vec<_>) = columns.iter().partition(|(j, (from, _))| j == from);
        let turned = own.iter().map(|column| {
            let ([before, after], name) = (shares(column), joints[column.0]);
            let message = format!(
                "joint `{name}`: its torque in log `{log}` has the opposite sign: the twin explains {} of it turned, {} as logged; turn the column \
                 with [columns] factor",
                percent(after),
                percent(before)
            );
            Finding::new(Severity::Degraded, Code::SignFlip, name, message, 0)
                .with([("explained", after), ("explained_before", before)])
        });
        let mut findings: Vec<Finding> = turned.collect();
        if moved.is_empty() {
            return findings;
        }
        let worst = |which: usize| {
            let all = moved.iter().map(|column| shares(column)[which]);
            all.fold(1.0, f64::min)
        };
        let [before, after] = [worst(0), worst(1)];
        let places = moved.iter().map(|(joint, (from, sign))| {
            let minus = if *sign < 0.0 { "the negative of " } else { "" };
            format!(
                "`{}` = {minus}torque of `{}`",
                joints[*joint], joints[*from]
            )
        });
        let message = format!(
            "log `{log}`: torque columns seem exchanged: try {}; the twin then explains at least {} of each one's torque instead of {}; rename the \
             columns, or map them in [columns]",
            listed(places, ", "),
            percent(after),
            percent(before)
        );
        let count = moved.len() as u64;
        let exchanged = Finding::new(Severity::Degraded, Code::JointOrder, log, message, count);
        findings.push(exchanged.with([("explained", after), ("explained_before", before)]));
        findings
    }
}

impl LagSums {
    /// Chooses the shifts by the first rows.
    fn start(&mut self, time: &[f64]) {
        let steps = time.windows(2).map(|pair| pair[1] - pair[0]);
        let step = steps.fold(f64::INFINITY, f64::min);
        if self.stride > 0 || !step.is_finite() || step <= 0.0 {
            return;
        }
        self.stride = (LATEST / (SHIFTS as f64 * step)).ceil().max(1.0) as usize;
        self.step = self.stride as f64 * step;
        let count = 2 * self.side() + 1;
        for sums in [&mut self.product, &mut self.square, &mut self.next] {
            *sums = vec![0.0; count];
        }
    }

    /// Shifts to either side.
    fn side(&self) -> usize {
        ((LATEST / self.step) as usize).clamp(1, SHIFTS)
    }

    /// Adds consecutive rows of a joint.
    fn add(&mut self, (measured, twin, still): (&[f64], &[f64], &[bool]), weight: f64) {
        if self.stride == 0 {
            return;
        }
        let edge = self.side() * self.stride;
        for row in (edge..twin.len().saturating_sub(edge)).filter(|row| !still[*row]) {
            self.rows += 1.0;
            self.predicted += weight * twin[row] * twin[row];
            let all = measured[row - edge..=row + edge]
                .iter()
                .step_by(self.stride);
            let mut before: Option<(usize, f64)> = None;
            for (shift, &y) in all.enumerate() {
                self.product[shift] += weight * y * twin[row];
                self.square[shift] += weight * y * y;
                if let Some((shift, before)) = before {
                    self.next[shift] += weight * before * y;
                }
                before = Some((shift, y));
            }
        }
    }

    /// The lag that leaves least.
    fn best(&self, autocorrelation_time: f64) -> Option<Late> {
        if self.rows == 0.0 {
            return None;
        }
        let side = self.side();
        let at = |k: usize| self.predicted - 2.0 * self.product[k] + self.square[k];
        // Of (1 − a) y_k + a y_{k+1}: a parabola of a.
        let between = |k: usize| {
            let slope = self.square[k] - 2.0 * self.next[k] + self.square[k + 1];
            let along = self.product[k + 1] - self.product[k] - self.next[k] + self.square[k];
            let a = (along / slope.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            (k, a, slope, at(k) - 2.0 * a * along + a * a * slope)
        };
        let all = (0..2 * side).map(between);
        let (k, a, slope, left) = all.min_by(|x, y| x.3.total_cmp(&y.3))?;
        let shift = k as f64 + a;
        let variance =
            autocorrelation_time * left.max(0.0) / self.rows / slope.max(f64::MIN_POSITIVE);
        Some(Late {
            lag: self.step * (shift - side as f64),
            at_end: shift <= 0.0 || shift >= 2.0 * side as f64,
            sd: self.step * variance.sqrt(),
            left: left / at(side).max(f64::MIN_POSITIVE),
        })
    }
}

impl Late {
    fn finding(&self, log: &str) -> Finding {
        let size = 1e3 * self.lag.abs();
        let size = match self.at_end {
            true => format!("at least {size:.0} ms"),
            false => format!("{size:.0} ± {:.0} ms", (1e3 * self.sd).max(1.0)),
        };
        let order = match self.lag > 0.0 {
            true => "later behind",
            false => "further ahead of",
        };
        let message = format!(
            "log `{log}`: torque is written {size} {order} the motion than in the logs of the fit: log it as those, or move its stamps by that much"
        );
        Finding::new(Severity::Warning, Code::LogTorqueLag, log, message, 0)
            .with([("lag", self.lag), ("lag_sd", self.sd)])
    }
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}
