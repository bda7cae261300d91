//! Has the robot changed since the twin was fitted? Its residual on new logs against friction, a payload and joint zeros.
//!
//! The residual e of the moving filtered rows is regressed on the columns Z of one change at a time, joints weighed by σ_j, the twin's own
//! held-out error:
//!
//! ```text
//! A = Σ_j Z_jᵀZ_j/σ_j²    s = Σ_j Z_jᵀe_j/σ_j²    C = Σ_j Z_jᵀX_j/σ_j²    δ̂ = A⁻¹ s
//! Cov δ̂ = A⁻¹ (B + C Cov[β | y] Cᵀ) A⁻¹
//! ```
//! with B once what noise of variance σ_j² makes whose rows count as 1/τ_j each, and once the spread of the scores of blocks of rows about δ̂
//! (Liang & Zeger 1986); the larger doubt counts: Hotelling's T² is compared with χ², and with F for as many blocks as there are.

mod logs;

use super::changed_payload::numbers as numbers_of_payload;
use super::misread::Readings;
use crate::error::Result;
use crate::linear_algebra::{Cholesky, dot};
use crate::observations::{JointObservations, Observations, observe};
use crate::signal::Trajectory;
use crate::term::{Family, Library, LibrarySettings};
use crate::twin::Twin;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// Probability that the log of an unchanged robot is said to show any change.
pub const FALSE_ALARM: f64 = 0.01;
/// Share of what a gate on the error lets pass from which on a change matters: what no candidate describes leaves as much in any log.
const MATTERS: f64 = 0.75;
/// Length of a block, in autocorrelation times.
const TIMES: f64 = 4.0;
/// Fewest blocks whose spread says something, and most of one log.
const BLOCKS: (usize, usize) = (8, 64);
/// Least error of a joint, N·m: of one without any there is nothing to weigh by.
const LEAST_ERROR: f64 = 1e-9;
/// Share of a column's own power below which other columns have all of it.
const ROUNDING: f64 = 1e-9;

/// Torque of a change, as a share of the twin's own held-out error on some joint (root mean squares), below which it does not matter. Where the
/// error may grow by a factor r (`[check] rmse_ratio`), a torque of √(r² − 1) makes it do so; three quarters of that matter: 0.5 for 1.2.
#[must_use]
pub fn least_share(rmse_ratio: f64) -> f64 {
    MATTERS * (rmse_ratio * rmse_ratio - 1.0).max(0.0).sqrt()
}

/// What may have changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ChangeKind {
    /// Viscous and Coulomb friction of a joint.
    Friction,
    /// Mass and first moments at the tool.
    Payload,
    /// Zero position of a joint.
    JointZero,
}

/// A number of a change: a coefficient, or what coefficients of a payload say of its mass and centre of mass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChangeNumber {
    /// Name of the column, as `elbow.viscous`; of a payload `payload.mass` and `payload.com_x` …, or first moments `payload.mx` … where the mass
    /// is not clear, in the payload frame.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Estimate.
    pub value: f64,
    /// Its standard error.
    pub sd: f64,
}

/// What logs say of one change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// What may have changed.
    pub kind: ChangeKind,
    /// The joint, or `payload`.
    pub subject: String,
    /// The frame of a payload's numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<String>,
    /// Its numbers.
    pub numbers: Vec<ChangeNumber>,
    /// Probability of such an estimate, or one further from 0, without a change.
    pub chance: f64,
    /// Largest torque over the joints as a share of the twin's held-out error there, or of what else is left there where that is more (root mean squares).
    pub share: f64,
    /// Unlikely without a change, large enough to matter, and not what a larger change makes of it.
    pub changed: bool,
}

/// One change and its columns.
struct Suspect {
    kind: ChangeKind,
    subject: String,
    /// Columns of the library of changes.
    columns: Vec<usize>,
    /// Of each block of rows: A, row-major, and s.
    blocks: Vec<(Vec<f64>, Vec<f64>)>,
}

/// Sums of one joint over its moving rows.
#[derive(Default)]
struct JointSums {
    rows: f64,
    /// eᵀe.
    square: f64,
    /// ZᵀZ of the columns that act on this joint, Zᵀe, and ZᵀX, row-major.
    gram: Vec<f64>,
    score: Vec<f64>,
    cross: Vec<f64>,
}

/// Collects rows of logs and says what changed.
pub struct Changes<'a> {
    twin: &'a Twin,
    library: &'a Library,
    columns: Library,
    suspects: Vec<Suspect>,
    /// σ_j, N·m.
    error: Vec<f64>,
    joints: Vec<JointSums>,
    readings: Readings,
}

impl<'a> Changes<'a> {
    /// For a twin and its library; `error` is the root mean square of the twin's held-out error on moving rows of each joint, N·m.
    ///
    /// # Errors
    /// Those of [`Library::propose`].
    pub fn new(twin: &'a Twin, library: &'a Library, error: &[f64]) -> Result<Self> {
        let settings = LibrarySettings {
            families: vec![
                Family::Viscous,
                Family::Coulomb,
                Family::Payload,
                Family::EncoderZero,
            ],
            generic: Some(false),
            coulomb_velocity: twin.library.coulomb_velocity,
            payload_frame: twin.library.payload_frame.clone(),
            ..LibrarySettings::default()
        };
        let (columns, _) = Library::propose(&twin.robot, &settings)?;
        let joints = twin.robot.joint_names();
        let error = twin.noise.iter().zip(error).map(|(noise, error)| {
            let own = noise.sigma * noise.interval_factor;
            let error = if *error > 0.0 { *error } else { own };
            error.max(LEAST_ERROR)
        });
        let error: Vec<f64> = error.collect();
        Ok(Self {
            suspects: suspects(&columns, &joints),
            readings: Readings::new(&error),
            error,
            joints: (0..joints.len()).map(|_| JointSums::default()).collect(),
            columns,
            twin,
            library,
        })
    }

    /// Adds the rows of a log, or of a part of one.
    ///
    /// # Errors
    /// Those of [`observe`].
    pub fn take(&mut self, trajectory: &Trajectory) -> Result<()> {
        let (robot, pipeline) = (&self.twin.robot, &self.twin.pipeline);
        let rows = observe(robot, self.library, pipeline, trajectory)?;
        if rows.is_empty() {
            return Ok(());
        }
        let mut acting = trajectory.clone();
        acting.payload_acts = true;
        let changes = observe(robot, &self.columns, pipeline, &acting)?;
        drop(acting);
        let memory = self.twin.noise.iter().map(|noise| noise.memory());
        let length = TIMES * memory.fold(1.0, f64::max);
        let count = ((rows.len() as f64 / length) as usize).clamp(1, BLOCKS.1);
        for suspect in &mut self.suspects {
            let size = suspect.columns.len();
            let nothing = || (vec![0.0; size * size], vec![0.0; size]);
            suspect.blocks.extend((0..count).map(|_| nothing()));
        }
        let mean = &self.twin.posterior.mean;
        let residual = |joint| (rows.whole()).residual(joint, mean, 0..rows.len());
        let residuals: Vec<Vec<f64>> = (0..self.joints.len()).map(residual).collect();
        self.readings.take(&rows, &residuals);
        for (joint, residual) in residuals.iter().enumerate() {
            let columns = dense(&changes, joint);
            self.joints[joint].add(&rows, joint, (&columns, residual));
            let own = &changes.joints[joint];
            let weight = self.error[joint].powi(-2);
            for suspect in &mut self.suspects {
                suspect.add(own, (&columns, residual), weight, count);
            }
        }
        Ok(())
    }

    /// What all rows say, change by change; those that cannot be seen in these logs are left out. `least`: see [`least_share`].
    #[must_use]
    pub fn finish(self, least: f64) -> Vec<Change> {
        let covariance = self.twin.posterior.covariance();
        let estimates = self.suspects.iter();
        let estimates: Vec<(&Suspect, Estimate)> = estimates
            .filter_map(|suspect| Some((suspect, self.estimate(suspect, &covariance)?)))
            .collect();
        let limit = FALSE_ALARM / estimates.len().max(1) as f64;
        let is_change = |estimate: &Estimate| estimate.chance < limit && estimate.share >= least;
        // What explains most, by Schwarz's criterion, is a change; what else is one beside it. A zero of the last joint acts like a first moment at
        // the tool, which has four numbers for it.
        let clear = || estimates.iter().filter(|(_, own)| is_change(own));
        let inflation = clear().fold(1.0_f64, |most, (_, own)| most.max(own.inflation));
        let rows = self.joints.iter().map(|joint| joint.rows).sum::<f64>();
        let worth = |(suspect, own): &(&Suspect, Estimate)| {
            own.explained / inflation - suspect.columns.len() as f64 * rows.max(1.0).ln()
        };
        let first = clear().max_by(|a, b| worth(a).total_cmp(&worth(b)));
        let changes = estimates.iter().map(|(suspect, own)| {
            let changed = is_change(own)
                && first.is_some_and(|(other, most)| {
                    std::ptr::eq(*other, *suspect)
                        || self.beside((*suspect, own), (*other, most), [limit, least])
                });
            self.told(suspect, own, changed)
        });
        changes.collect()
    }

    fn told(&self, suspect: &Suspect, own: &Estimate, changed: bool) -> Change {
        let size = own.value.len();
        let number = |(place, &column): (usize, &usize)| {
            let term = &self.columns.terms()[self.columns.columns()[column]];
            ChangeNumber {
                name: term.name.clone(),
                unit: term.unit.clone(),
                value: own.value[place],
                sd: own.covariance[place * size + place].sqrt(),
            }
        };
        let numbers = || suspect.columns.iter().enumerate().map(number).collect();
        let estimate = (&own.value[..], &own.covariance[..]);
        let payload = match suspect.kind {
            ChangeKind::Payload => numbers_of_payload(&self.columns, &suspect.columns, estimate),
            ChangeKind::Friction | ChangeKind::JointZero => None,
        };
        let frame = || self.columns.payload_frame(&self.twin.robot).to_owned();
        Change {
            kind: suspect.kind,
            subject: suspect.subject.clone(),
            frame: payload.is_some().then(frame),
            numbers: payload.unwrap_or_else(numbers),
            chance: own.chance,
            share: own.share,
            changed,
        }
    }

    /// A of two sets of columns, each row counting `weight(joint)`.
    fn products(&self, a: &[usize], b: &[usize], weight: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut sum = vec![0.0; a.len() * b.len()];
        for (joint, sums) in self.joints.iter().enumerate().filter(|(_, s)| s.rows > 0.0) {
            let columns = self.columns.columns_of_joint(joint);
            let place = |column: &usize| columns.iter().position(|own| own == column);
            for (row, i) in a.iter().enumerate() {
                for (col, j) in b.iter().enumerate() {
                    if let (Some(i), Some(j)) = (place(i), place(j)) {
                        sum[row * b.len() + col] +=
                            weight(joint) * sums.gram[i * columns.len() + j];
                    }
                }
            }
        }
        sum
    }

    /// s of some columns.
    fn score(&self, columns: &[usize]) -> Vec<f64> {
        let mut score = vec![0.0; columns.len()];
        for (joint, sums) in self.joints.iter().enumerate().filter(|(_, s)| s.rows > 0.0) {
            let acting = self.columns.columns_of_joint(joint);
            for (sum, column) in score.iter_mut().zip(columns) {
                if let Some(at) = acting.iter().position(|own| own == column) {
                    *sum += sums.score[at] / self.error[joint].powi(2);
                }
            }
        }
        score
    }

    /// C Cov[β | y] Cᵀ of some columns.
    fn doubt(&self, columns: &[usize], covariance: &[f64]) -> Vec<f64> {
        let all = self.twin.posterior.mean.len();
        let mut cross = vec![0.0; columns.len() * all];
        for (joint, sums) in self.joints.iter().enumerate().filter(|(_, s)| s.rows > 0.0) {
            let acting = self.columns.columns_of_joint(joint);
            let known = self.library.columns_of_joint(joint);
            for (row, column) in columns.iter().enumerate() {
                let Some(at) = acting.iter().position(|own| own == column) else {
                    continue;
                };
                for (k, &beta) in known.iter().enumerate() {
                    cross[row * all + beta] +=
                        sums.cross[at * known.len() + k] / self.error[joint].powi(2);
                }
            }
        }
        let half: Vec<f64> = (cross.chunks_exact(all.max(1)))
            .flat_map(|row| {
                let products = covariance.chunks_exact(all.max(1));
                products.map(move |column| dot(row, column))
            })
            .collect();
        let rows = || cross.chunks_exact(all.max(1));
        (half.chunks_exact(all.max(1)))
            .flat_map(|half| rows().map(move |row| dot(half, row)))
            .collect()
    }

    fn estimate(&self, suspect: &Suspect, covariance: &[f64]) -> Option<Estimate> {
        let (columns, size) = (&suspect.columns, suspect.columns.len());
        let weight = |joint: usize| self.error[joint].powi(-2);
        let normal = self.products(columns, columns, weight);
        let factor = factor(&normal, size)?;
        let score = self.score(columns);
        let mut value = score.clone();
        factor.solve(&mut value);
        let doubt = self.doubt(columns, covariance);
        let noise = self.products(columns, columns, |joint| {
            weight(joint) * self.twin.noise[joint].memory()
        });
        // T² about 0 of the scores: s'(B + doubt)⁻¹ s.
        let square = |spread: &[f64]| -> Option<f64> {
            let both: Vec<f64> = spread.iter().zip(&doubt).map(|(a, b)| a + b).collect();
            let mut half = score.clone();
            Cholesky::new(&both, size).ok()?.solve_lower(&mut half);
            Some(dot(&half, &half))
        };
        let of_noise = square(&noise)?;
        let mut chance = ChiSquared::new(size as f64).ok()?.sf(of_noise);
        let (mut least, mut spread) = (of_noise, noise);
        let count = suspect.blocks.len();
        if count >= BLOCKS.0 {
            let of_blocks = suspect.spread(&value);
            let scaled = square(&of_blocks)?;
            let (p, b) = (size as f64, count as f64);
            let fisher = FisherSnedecor::new(p, b - p).ok()?;
            chance = chance.max(fisher.sf(scaled * (b - p) / (p * (b - 1.0))));
            if scaled < least {
                (least, spread) = (scaled, of_blocks);
            }
        }
        let inverse = factor.inverse();
        let row = |k: usize| &inverse[k * size..(k + 1) * size];
        let element = |k: usize, l: usize| {
            let along = (0..size).map(|i| {
                let both =
                    (0..size).map(|j| (spread[i * size + j] + doubt[i * size + j]) * row(l)[j]);
                row(k)[i] * both.sum::<f64>()
            });
            along.sum::<f64>()
        };
        let all = (0..size).flat_map(|k| (0..size).map(move |l| (k, l)));
        let explained = dot(&value, &score);
        Some(Estimate {
            covariance: all.map(|(k, l)| element(k, l)).collect(),
            share: self.share(columns, &value),
            inflation: explained / least.max(f64::MIN_POSITIVE),
            value,
            chance,
            explained,
        })
    }

    /// Largest torque of a change over the joints, as a share of the error there, or of what it leaves of the residual where that is more: where a twin is
    /// far off for other reasons, a little of it looks like any change.
    fn share(&self, columns: &[usize], value: &[f64]) -> f64 {
        let size = columns.len();
        let of_joint = |joint: usize| {
            let only = |other: usize| f64::from(u8::from(other == joint));
            let gram = self.products(columns, columns, only);
            let row = |i: usize| dot(&gram[i * size..(i + 1) * size], value);
            let square: f64 = (0..size).map(|i| value[i] * row(i)).sum();
            let (sums, square) = (&self.joints[joint], square.max(0.0));
            let left = ((sums.square - square).max(0.0) / sums.rows).sqrt();
            (square / sums.rows).sqrt() / self.error[joint].max(left)
        };
        let moving = (0..self.joints.len()).filter(|&joint| self.joints[joint].rows > 0.0);
        moving.map(of_joint).fold(0.0, f64::max)
    }

    /// Whether a change is one beside another that explains more: what is left of it without that is as unlikely.
    fn beside(
        &self,
        (suspect, own): (&Suspect, &Estimate),
        (other, most): (&Suspect, &Estimate),
        [limit, least]: [f64; 2],
    ) -> bool {
        let weight = |joint: usize| self.error[joint].powi(-2);
        let (a, b) = (&suspect.columns, &other.columns);
        let cross = self.products(a, b, weight);
        let mut rest = self.products(a, a, weight);
        let Some(factor) = factor(&self.products(b, b, weight), b.len()) else {
            return false;
        };
        let mut score = self.score(a);
        for (i, row) in cross.chunks_exact(b.len()).enumerate() {
            score[i] -= dot(row, &most.value);
            let mut along = row.to_vec();
            factor.solve(&mut along);
            for (j, other) in cross.chunks_exact(b.len()).enumerate() {
                rest[i * a.len() + j] -= dot(&along, other);
            }
        }
        let Some(factor) = self::factor(&rest, a.len()) else {
            return false;
        };
        let mut value = score.clone();
        factor.solve(&mut value);
        let square = dot(&value, &score) / own.inflation.max(1.0);
        let chance = ChiSquared::new(a.len() as f64).map_or(1.0, |chi| chi.sf(square));
        chance < limit && self.share(a, &value) >= least
    }
}

/// What is known of one change.
struct Estimate {
    value: Vec<f64>,
    /// Row by row.
    covariance: Vec<f64>,
    chance: f64,
    share: f64,
    /// `δ̂ᵀA δ̂`, and how much of it is T².
    explained: f64,
    inflation: f64,
}

/// The factor of A; `None` where a column has no torque of its own.
fn factor(normal: &[f64], size: usize) -> Option<Cholesky> {
    let factor = Cholesky::new(normal, size).ok()?;
    let left = |k: usize| factor.lower()[k * size + k].powi(2) / normal[k * size + k];
    ((0..size).all(|k| left(k) > ROUNDING)).then_some(factor)
}

fn suspects(columns: &Library, joints: &[&str]) -> Vec<Suspect> {
    let of = |wanted: &dyn Fn(Family, &str) -> bool| -> Vec<usize> {
        let terms = columns.columns().iter().map(|&term| &columns.terms()[term]);
        let own = terms.enumerate().filter(|(_, term)| {
            let joint = term.name.rsplit_once('.').map_or("", |(joint, _)| joint);
            wanted(term.family, joint)
        });
        own.map(|(column, _)| column).collect()
    };
    let suspect = |kind: ChangeKind, subject: &str, columns: Vec<usize>| Suspect {
        kind,
        subject: subject.to_owned(),
        columns,
        blocks: Vec::new(),
    };
    let friction = |joint: &&str| {
        let wanted = |family: Family, own: &str| {
            matches!(family, Family::Viscous | Family::Coulomb) && own == *joint
        };
        suspect(ChangeKind::Friction, joint, of(&wanted))
    };
    let zero = |joint: &&str| {
        let wanted = |family: Family, own: &str| family == Family::EncoderZero && own == *joint;
        suspect(ChangeKind::JointZero, joint, of(&wanted))
    };
    let payload = of(&|family, _| family == Family::Payload);
    let mut all: Vec<Suspect> = joints.iter().map(friction).collect();
    all.push(suspect(ChangeKind::Payload, "payload", payload));
    all.extend(joints.iter().map(zero));
    all.retain(|suspect| !suspect.columns.is_empty());
    all
}

/// Columns of a joint, `column * rows + row`, with zeros where it stands still.
fn dense(rows: &Observations, joint: usize) -> Vec<f64> {
    let (own, len) = (&rows.joints[joint], rows.len());
    let mut out = vec![0.0; own.columns.len() * len];
    own.visit_columns(len, 0..len, &mut |piece, columns| {
        for (i, out) in out.chunks_exact_mut(len.max(1)).enumerate() {
            let values = columns.of(i, 0, piece.len());
            for (row, value) in piece.clone().zip(values) {
                out[row] = if own.standstill[row] { 0.0 } else { *value };
            }
        }
    });
    out
}

impl JointSums {
    /// Adds rows with these columns of changes and this residual.
    fn add(&mut self, rows: &Observations, joint: usize, (columns, residual): (&[f64], &[f64])) {
        let (own, len) = (&rows.joints[joint], rows.len());
        let count = columns.len() / len.max(1);
        let known = own.columns.len();
        self.gram.resize(count * count, 0.0);
        self.score.resize(count, 0.0);
        self.cross.resize(count * known, 0.0);
        let moving = residual
            .iter()
            .zip(&own.standstill)
            .filter(|(_, still)| !**still);
        let (square, rows) = moving.fold((0.0, 0.0), |(square, rows), (e, _)| {
            (square + e * e, rows + 1.0)
        });
        self.square += square;
        self.rows += rows;
        let column = |i: usize| &columns[i * len..(i + 1) * len];
        for i in 0..count {
            self.score[i] += dot(column(i), residual);
            for j in 0..count {
                self.gram[i * count + j] += dot(column(i), column(j));
            }
        }
        own.visit_columns(len, 0..len, &mut |piece, known_columns| {
            for i in 0..count {
                let z = &column(i)[piece.clone()];
                for k in 0..known {
                    self.cross[i * known + k] += dot(z, known_columns.of(k, 0, piece.len()));
                }
            }
        });
    }
}

impl Suspect {
    /// Adds a joint's rows to the last `count` blocks.
    fn add(
        &mut self,
        own: &JointObservations,
        (columns, residual): (&[f64], &[f64]),
        weight: f64,
        count: usize,
    ) {
        let (len, size) = (residual.len(), self.columns.len());
        let place: Vec<Option<usize>> = (self.columns.iter())
            .map(|column| own.columns.iter().position(|other| other == column))
            .collect();
        let first = self.blocks.len() - count;
        for (block, (gram, score)) in self.blocks[first..].iter_mut().enumerate() {
            let rows = block * len / count..(block + 1) * len / count;
            let column = |at: usize| &columns[at * len..(at + 1) * len][rows.clone()];
            for (i, a) in place.iter().enumerate() {
                let Some(a) = *a else { continue };
                score[i] += weight * dot(column(a), &residual[rows.clone()]);
                for (j, b) in place.iter().enumerate() {
                    if let Some(b) = *b {
                        gram[i * size + j] += weight * dot(column(a), column(b));
                    }
                }
            }
        }
    }

    /// `B/(B−1) Σ_b (s_b − A_b δ̂)(s_b − A_b δ̂)ᵀ`.
    fn spread(&self, value: &[f64]) -> Vec<f64> {
        let size = self.columns.len();
        let count = self.blocks.len() as f64;
        let mut sum = vec![0.0; size * size];
        for (gram, score) in &self.blocks {
            let rest: Vec<f64> = (score.iter().zip(gram.chunks_exact(size)))
                .map(|(score, row)| score - dot(row, value))
                .collect();
            for i in 0..size {
                for j in 0..size {
                    sum[i * size + j] += count / (count - 1.0) * rest[i] * rest[j];
                }
            }
        }
        sum
    }
}
