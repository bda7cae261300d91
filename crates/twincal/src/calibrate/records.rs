//! Statistics as a header and a table of numbers, which files hold, and back; what does not fit together is refused.

use super::log_statistics::{About, LogStatistics, Statistics};
use super::plan::Plan;
use crate::error::{Error, Result};
use crate::gram::{JointGram, Symmetric};
use crate::likelihood::NoiseModel;
use crate::robot::Robot;
use crate::rows::recipes_of_log;
use crate::signal::Payload;
use crate::statistics::{BLOCKS, Bands, JointBlock, JointDecoys, JointSums, LogSums, Weighing};
use crate::term::{Library, Recipes};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// What statistics are of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The robot that was logged.
    pub robot_name: String,
    /// The nominal robot.
    pub robot: Robot,
    /// How the logs were read.
    pub plan: Plan,
    /// Log by log.
    logs: Vec<LogHeader>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct LogHeader {
    about: About,
    /// Rows of each stretch.
    rows: Vec<usize>,
    /// Cycles per row.
    cutoff: f64,
    /// Rows of the longest run of each joint.
    longest: Vec<usize>,
}

/// One list of numbers of one joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Number of the log in the header.
    pub log: u32,
    /// Number of the joint.
    pub joint: u32,
    /// What the numbers are.
    pub quantity: Quantity,
    /// Stretch of the log, or band of frequencies.
    pub block: u32,
    /// Rows n, where the quantity counts them.
    pub rows: f64,
    /// Runs of consecutive rows that start there.
    pub runs: f64,
    /// Symmetric matrices as their lower triangle, row by row; empty where all are 0.
    pub values: Vec<f64>,
}

/// What the numbers of a [`Record`] are; x is the signals of the joint and its residual torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Σ x xᵀ of a stretch.
    Products,
    /// The same of the differences of consecutive rows.
    Differences,
    /// Σ x xᵀ of the first rows of runs.
    First,
    /// The same of their last rows.
    Last,
    /// Σ φ_k xᵀ over decoys φ_k.
    Decoys,
    /// Σ φ_k².
    DecoySquares,
    /// Σ τ² of the measured torque, stretch by stretch.
    Torque,
    /// Power of x in a band of frequencies.
    Power,
    /// Σ x xᵀ of torque as logged, at some of the samples.
    Logged,
    /// Σ x xᵀ of the filtered rows at the same times.
    Filtered,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Products,
        Self::Differences,
        Self::First,
        Self::Last,
        Self::Decoys,
        Self::DecoySquares,
        Self::Torque,
        Self::Power,
        Self::Logged,
        Self::Filtered,
    ];

    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Products => "products",
            Self::Differences => "differences",
            Self::First => "first",
            Self::Last => "last",
            Self::Decoys => "decoys",
            Self::DecoySquares => "decoy_squares",
            Self::Torque => "torque",
            Self::Power => "power",
            Self::Logged => "logged",
            Self::Filtered => "filtered",
        }
    }

    /// The quantity of this name.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|own| own.name() == name)
    }
}

impl Statistics {
    /// What the numbers of [`Statistics::records`] are of.
    #[must_use]
    pub fn header(&self) -> Header {
        let of_log = |log: &LogStatistics| LogHeader {
            about: log.about.clone(),
            rows: log.sums.rows.clone(),
            cutoff: log.sums.cutoff,
            longest: (log.sums.joints.iter())
                .map(|joint| joint.bands.longest)
                .collect(),
        };
        Header {
            robot_name: self.robot_name.clone(),
            robot: self.robot.clone(),
            plan: self.plan.clone(),
            logs: self.logs.iter().map(of_log).collect(),
        }
    }

    /// All numbers, in the order of logs, joints, quantities and stretches.
    #[must_use]
    pub fn records(&self) -> Vec<Record> {
        let mut records = Vec::new();
        for (number, log) in (0..).zip(&self.logs) {
            for (joint, sums) in (0..).zip(&log.sums.joints) {
                let raw = log.raw.get(joint as usize);
                records.extend(of_joint((number, joint), sums, raw));
            }
        }
        records
    }

    /// Statistics from what [`Statistics::header`] and [`Statistics::records`] gave.
    ///
    /// # Errors
    /// [`Error::Statistics`] for another version, for records that are missing, twice or of another size than the candidates of the plan have,
    /// for numbers that are none, and for logs that are there twice.
    pub fn from_records(header: Header, records: Vec<Record>) -> Result<Self> {
        header.plan.require_version()?;
        let (library, _) = Library::propose(&header.robot, &header.plan.library)?;
        let mut by_place = BTreeMap::new();
        for record in records {
            let place = (record.log, record.joint, record.quantity, record.block);
            if !record.values.iter().all(|value| value.is_finite()) {
                return Err(damaged(&header, record.log, "holds numbers that are none"));
            }
            if by_place.insert(place, record).is_some() {
                return Err(damaged(&header, place.0, "holds a record twice"));
            }
        }
        let mut all = Self {
            robot_name: header.robot_name.clone(),
            robot: header.robot.clone(),
            plan: header.plan.clone(),
            logs: Vec::new(),
        };
        for (number, log) in (0..).zip(&header.logs) {
            let mut taken = Taken {
                records: &mut by_place,
                header: &header,
                log: number,
            };
            let one = Self {
                logs: vec![taken.log(log, &library)?],
                ..all.clone_without_logs()
            };
            all.try_merge(&one)?;
        }
        match by_place.into_keys().next() {
            Some((log, ..)) => Err(damaged(
                &header,
                log,
                "holds more records than its header says",
            )),
            None => Ok(all),
        }
    }

    fn clone_without_logs(&self) -> Self {
        Self {
            robot_name: self.robot_name.clone(),
            robot: self.robot.clone(),
            plan: self.plan.clone(),
            logs: Vec::new(),
        }
    }
}

fn damaged(header: &Header, log: u32, problem: &str) -> Error {
    let own = header.logs.get(log as usize);
    let name = own.map_or("?", |log| log.about.facts.summary.name.as_str());
    Error::Statistics {
        problem: format!("the table of log `{name}` {problem}"),
        remedy: "the file is damaged: make it anew from the log".into(),
    }
}

fn of_joint(
    (log, joint): (u32, u32),
    sums: &JointSums,
    raw: Option<&[JointGram; 2]>,
) -> Vec<Record> {
    let record = |quantity, block: usize, counts: [f64; 2], values| Record {
        log,
        joint,
        quantity,
        block: block as u32,
        rows: counts[0],
        runs: counts[1],
        values,
    };
    let none = [0.0; 2];
    let mut records = Vec::new();
    for (block, own) in sums.blocks.iter().enumerate() {
        let gram = &own.gram;
        let counts = [gram.n, gram.starts];
        records.push(record(Quantity::Products, block, counts, lower(&gram.s0)));
        if gram.d.size > 0 {
            records.push(record(Quantity::Differences, block, none, lower(&gram.d)));
            records.push(record(Quantity::First, block, none, lower(&gram.first)));
            records.push(record(Quantity::Last, block, none, lower(&gram.last)));
        }
        if let Some((cross, squares)) = own.decoys.numbers() {
            let (cross, squares) = (cross.to_vec(), squares.to_vec());
            records.push(record(Quantity::Decoys, block, none, cross));
            records.push(record(Quantity::DecoySquares, block, none, squares));
        }
    }
    let torque = sums.blocks.iter().map(|own| own.torque).collect();
    records.push(record(Quantity::Torque, 0, none, torque));
    for (band, power) in sums.bands.power.iter().enumerate() {
        records.push(record(Quantity::Power, band, none, lower(power)));
    }
    let kinds = [Quantity::Logged, Quantity::Filtered].into_iter();
    for (quantity, gram) in kinds.zip(raw.into_iter().flatten()) {
        let counts = [gram.n, gram.starts];
        records.push(record(quantity, 0, counts, lower(&gram.s0)));
    }
    records.sort_by_key(|record| (record.quantity, record.block));
    records
}

/// The lower triangle, row by row; empty where all is 0.
fn lower(matrix: &Symmetric) -> Vec<f64> {
    if matrix.values.iter().all(|value| *value == 0.0) {
        return Vec::new();
    }
    let rows = 0..matrix.size;
    rows.flat_map(|i| (0..=i).map(move |j| matrix.at(i, j)))
        .collect()
}

/// The matrix of this lower triangle.
fn full(lower: &[f64], size: usize) -> Option<Symmetric> {
    let mut matrix = Symmetric::zeros(size);
    if lower.is_empty() {
        return Some(matrix);
    }
    if lower.len() != size * (size + 1) / 2 {
        return None;
    }
    let pairs = (0..size).flat_map(|i| (0..=i).map(move |j| (i, j)));
    for ((i, j), value) in pairs.zip(lower) {
        matrix.values[i * size + j] = *value;
        matrix.values[j * size + i] = *value;
    }
    Some(matrix)
}

/// Records by log, joint, quantity and block.
type ByPlace = BTreeMap<(u32, u32, Quantity, u32), Record>;

/// The records of one log, as they are taken.
struct Taken<'a> {
    records: &'a mut ByPlace,
    header: &'a Header,
    log: u32,
}

impl Taken<'_> {
    fn log(&mut self, own: &LogHeader, library: &Library) -> Result<LogStatistics> {
        let joints = self.header.robot.dof();
        let facts = &own.about.facts;
        let states = &facts.states;
        let cells = joints * states.len;
        let fits = own.rows.len() == BLOCKS
            && own.longest.len() == joints
            && facts.hull.len() == joints
            && facts.summary.rows.len() == joints
            && [&states.q, &states.qd, &states.qdd]
                .iter()
                .all(|own| own.len() == cells)
            && states.still.len() == cells;
        if !fits {
            return Err(
                self.damaged("has another number of joints or stretches than its header says")
            );
        }
        let acts = !self.header.plan.payload_where_unknown || facts.payload == Payload::Unknown;
        let recipes = recipes_of_log(library, acts);
        let filtered = self.header.plan.pipeline.cutoff_hz != 0.0;
        let (mut sums, mut raw) = (Vec::new(), Vec::new());
        for (joint, recipes) in recipes.into_iter().enumerate() {
            let size = recipes.parts() + 1;
            if filtered {
                let both = [Quantity::Logged, Quantity::Filtered]
                    .map(|quantity| self.gram(joint, quantity, size));
                let [logged, filtered] = both;
                raw.push([logged?, filtered?]);
            }
            let columns = library.columns_of_joint(joint).to_vec();
            sums.push(self.joint(joint, (columns, recipes), own.longest[joint])?);
        }
        Ok(LogStatistics {
            about: own.about.clone(),
            sums: LogSums {
                cutoff: own.cutoff,
                rows: own.rows.clone(),
                joints: sums,
            },
            raw,
        })
    }

    fn joint(
        &mut self,
        joint: usize,
        (columns, recipes): (Vec<usize>, Arc<Recipes>),
        longest: usize,
    ) -> Result<JointSums> {
        let size = recipes.parts() + 1;
        let torque = self.take(joint, Quantity::Torque, 0)?.values;
        if torque.len() != BLOCKS {
            return Err(self.damaged("has another number of stretches than ten"));
        }
        let mut blocks = Vec::new();
        for (block, torque) in torque.into_iter().enumerate() {
            let mut gram = self.gram_at(joint, (Quantity::Products, block), size)?;
            if self.header.plan.noise == NoiseModel::Ar1 {
                gram.d = self.matrix(joint, (Quantity::Differences, block), size)?;
                gram.first = self.matrix(joint, (Quantity::First, block), size)?;
                gram.last = self.matrix(joint, (Quantity::Last, block), size)?;
            } else {
                gram.forget_runs();
            }
            blocks.push(JointBlock {
                gram,
                decoys: self.decoys(joint, block, size)?,
                torque,
                weighing: Weighing::default(),
            });
        }
        let power = (0..Bands::COUNT)
            .map(|band| self.matrix(joint, (Quantity::Power, band), size))
            .collect::<Result<_>>()?;
        Ok(JointSums {
            columns,
            recipes: Some(recipes),
            blocks,
            bands: Bands { power, longest },
        })
    }

    /// Of every fifth, which the first of its two stretches has; none where the likelihood asks for none.
    fn decoys(&mut self, joint: usize, block: usize, size: usize) -> Result<JointDecoys> {
        if self.header.plan.noise == NoiseModel::Ar1 || block % 2 == 1 {
            return Ok(JointDecoys::default());
        }
        let cross = self.take(joint, Quantity::Decoys, block)?.values;
        let squares = self.take(joint, Quantity::DecoySquares, block)?.values;
        let decoys = JointDecoys::of_numbers(size - 1, cross, squares);
        decoys.ok_or_else(|| self.of_another_size(joint))
    }

    fn gram(&mut self, joint: usize, quantity: Quantity, size: usize) -> Result<JointGram> {
        let mut gram = self.gram_at(joint, (quantity, 0), size)?;
        gram.forget_runs();
        Ok(gram)
    }

    fn gram_at(
        &mut self,
        joint: usize,
        (quantity, block): (Quantity, usize),
        size: usize,
    ) -> Result<JointGram> {
        let record = self.take(joint, quantity, block)?;
        let mut gram = JointGram::empty((0..size as u32 - 1).collect());
        let s0 = full(&record.values, size);
        gram.s0 = s0.ok_or_else(|| self.of_another_size(joint))?;
        (gram.n, gram.starts) = (record.rows, record.runs);
        Ok(gram)
    }

    fn matrix(
        &mut self,
        joint: usize,
        (quantity, block): (Quantity, usize),
        size: usize,
    ) -> Result<Symmetric> {
        let record = self.take(joint, quantity, block)?;
        full(&record.values, size).ok_or_else(|| self.of_another_size(joint))
    }

    fn take(&mut self, joint: usize, quantity: Quantity, block: usize) -> Result<Record> {
        let place = (self.log, joint as u32, quantity, block as u32);
        let missing = format!("has no `{}` of joint {}", quantity.name(), joint + 1);
        let record = self.records.remove(&place);
        record.ok_or_else(|| self.damaged(&missing))
    }

    fn of_another_size(&self, joint: usize) -> Error {
        let problem = format!(
            "is of another size than the candidates of joint {}",
            joint + 1
        );
        self.damaged(&problem)
    }

    fn damaged(&self, problem: &str) -> Error {
        damaged(self.header, self.log, problem)
    }
}
