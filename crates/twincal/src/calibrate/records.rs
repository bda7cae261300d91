//! Statistics as a header and a table of numbers, which files hold, and back; what does not fit together is refused.

use super::distinct::{Identity, require_distinct};
use super::log_statistics::{About, LogStatistics, Statistics, require_same};
use super::plan::Plan;
use super::quantity::Quantity;
use crate::cross_check::{Excerpt, Sketch};
use crate::error::{Error, Result};
use crate::excitation::States;
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

/// What statistics are of, whatever their logs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The robot that was logged.
    pub robot_name: String,
    /// The nominal robot.
    pub robot: Robot,
    /// How the logs were read.
    pub plan: Plan,
}

/// Statistics of one log as a header and numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct LogTable {
    /// What is known of the log.
    pub header: LogHeader,
    /// All numbers, in the order of joints, quantities and stretches.
    pub records: Vec<Record>,
}

/// What is known of a log beside its numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LogHeader {
    about: About,
    /// Rows of each stretch.
    rows: Vec<usize>,
    /// Cycles per row.
    cutoff: f64,
    /// Rows of the longest run of each joint.
    longest: Vec<usize>,
    /// See [`Identity::sums`].
    sums: u64,
}

impl LogHeader {
    /// Name of the log.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.about.facts.summary.name
    }

    /// What distinguishes the log from others.
    #[must_use]
    pub fn identity(&self) -> Identity<'_> {
        Identity {
            name: self.name(),
            source: &self.about.source,
            ends: self.about.facts.ends,
            sums: self.sums,
        }
    }
}

/// One list of numbers of one joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
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

impl Header {
    /// # Errors
    /// [`Error::Statistics`] for another plan, version or robot: sums of the two do not add.
    pub fn require_same(&self, other: &Self) -> Result<()> {
        let [own, other] = [self, other].map(|own| (&*own.robot_name, &own.robot, &own.plan));
        require_same(own, other)
    }
}

impl LogStatistics {
    fn table(&self) -> LogTable {
        let header = LogHeader {
            about: self.about.clone(),
            rows: self.sums.rows.clone(),
            cutoff: self.sums.cutoff,
            longest: (self.sums.joints.iter())
                .map(|joint| joint.bands.longest)
                .collect(),
            sums: self.identity().sums,
        };
        let mut records = Vec::new();
        for (joint, sums) in (0..).zip(&self.sums.joints) {
            records.extend(of_joint(joint, sums, self.raw.get(joint as usize)));
            records.extend(of_states(joint, &self.about.facts.states));
            records.push(of_noise(joint, &self.noise));
            records.extend(of_excerpt(joint, &self.excerpt));
        }
        LogTable { header, records }
    }
}

impl Statistics {
    /// What the tables of [`Statistics::tables`] have in common.
    #[must_use]
    pub fn header(&self) -> Header {
        Header {
            robot_name: self.robot_name.clone(),
            robot: self.robot.clone(),
            plan: self.plan.clone(),
        }
    }

    /// Log by log, in the order of their names.
    pub fn tables(&self) -> impl ExactSizeIterator<Item = LogTable> + '_ {
        self.logs.iter().map(LogStatistics::table)
    }
}

/// Statistics that are put together from what [`Statistics::header`] and [`Statistics::tables`] gave, table by table.
#[derive(Debug)]
pub struct FromTables {
    statistics: Statistics,
    library: Library,
    /// See [`FromTables::for_fit`].
    logs: usize,
}

impl FromTables {
    /// Without a log.
    ///
    /// # Errors
    /// [`Error::Statistics`] for a plan of another version or robot; those of [`Library::propose`].
    pub fn new(header: Header) -> Result<Self> {
        header.plan.require_for(&header.robot)?;
        let (library, _) = Library::propose(&header.robot, &header.plan.library)?;
        let statistics = Statistics {
            robot_name: header.robot_name,
            robot: header.robot,
            plan: header.plan,
            logs: Vec::new(),
        };
        Ok(Self {
            statistics,
            library,
            logs: 0,
        })
    }

    /// For a fit to so many logs, which compares fewer rows of each: those that it does not need take no memory.
    #[must_use]
    pub fn for_fit(self, logs: usize) -> Self {
        Self { logs, ..self }
    }

    /// Adds a log.
    ///
    /// # Errors
    /// [`Error::Statistics`] for records that are missing, twice or of another size than the candidates of the plan have, and for numbers that are
    /// none.
    pub fn add(&mut self, table: LogTable) -> Result<()> {
        let LogTable { header, records } = table;
        let mut by_place = BTreeMap::new();
        for record in records {
            let place = (record.joint, record.quantity, record.block);
            if !record.values.iter().all(|value| value.is_finite()) {
                return Err(damaged(&header, "holds numbers that are none"));
            }
            if by_place.insert(place, record).is_some() {
                return Err(damaged(&header, "holds a record twice"));
            }
        }
        let mut taken = Taken {
            records: by_place,
            robot: &self.statistics.robot,
            plan: &self.statistics.plan,
            header: &header,
        };
        let mut log = taken.log(&self.library)?;
        if !taken.records.is_empty() {
            return Err(damaged(&header, "holds more records than its header says"));
        }
        if log.identity().sums != header.sums {
            return Err(damaged(&header, "holds other sums than its header says"));
        }
        if self.logs > 0 {
            log.excerpt = log.excerpt.among(self.logs);
        }
        self.statistics.logs.push(log);
        Ok(())
    }

    /// The statistics.
    ///
    /// # Errors
    /// [`Error::Statistics`] for logs that are there twice or overlap in time.
    pub fn finish(mut self) -> Result<Statistics> {
        let logs = &mut self.statistics.logs;
        require_distinct(&logs.iter().map(LogStatistics::identity).collect::<Vec<_>>())?;
        logs.sort_by(|a, b| a.name().cmp(b.name()));
        Ok(self.statistics)
    }
}

fn damaged(header: &LogHeader, problem: &str) -> Error {
    Error::Statistics {
        problem: format!("the table of log `{}` {problem}", header.name()),
        remedy: "the file is damaged: make it anew from the log".into(),
    }
}

/// Positions, velocities and accelerations of a joint in some rows, and whether it stands still there.
fn of_states(joint: u32, states: &States) -> [Record; 4] {
    let own = joint as usize * states.len..(joint as usize + 1) * states.len;
    let still = states.still[own.clone()].iter();
    let still = still.map(|still| f64::from(u8::from(*still))).collect();
    let of = |values: &[f64]| values[own.clone()].to_vec();
    [
        (Quantity::Positions, of(&states.q)),
        (Quantity::Velocities, of(&states.qd)),
        (Quantity::Accelerations, of(&states.qdd)),
        (Quantity::Still, still),
    ]
    .map(|(quantity, values)| Record {
        joint,
        quantity,
        block: 0,
        rows: 0.0,
        runs: 0.0,
        values,
    })
}

/// Lists of an excerpt for each joint; that of the stamps stands behind those of the first one.
const CHANNELS: usize = 5;

fn of_excerpt(joint: u32, excerpt: &Excerpt) -> Vec<Record> {
    let stamps = (joint == 0).then(|| excerpt.stamps().to_vec());
    let lists = excerpt.numbers(joint as usize).into_iter().chain(stamps);
    let record = |(block, values)| Record {
        joint,
        quantity: Quantity::Excerpt,
        block,
        rows: 0.0,
        runs: 0.0,
        values,
    };
    (0..).zip(lists).map(record).collect()
}

fn of_noise(joint: u32, noise: &Sketch) -> Record {
    Record {
        joint,
        quantity: Quantity::Noise,
        block: 0,
        rows: 0.0,
        runs: 0.0,
        values: noise.numbers(joint as usize),
    }
}

fn of_joint(joint: u32, sums: &JointSums, raw: Option<&[JointGram; 2]>) -> Vec<Record> {
    let record = |quantity, block: usize, counts: [f64; 2], values| Record {
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

/// Records by joint, quantity and block.
type ByPlace = BTreeMap<(u32, Quantity, u32), Record>;

/// The records of one log, as they are taken.
struct Taken<'a> {
    records: ByPlace,
    robot: &'a Robot,
    plan: &'a Plan,
    header: &'a LogHeader,
}

impl Taken<'_> {
    fn log(&mut self, library: &Library) -> Result<LogStatistics> {
        let (joints, own) = (self.robot.dof(), self.header);
        let mut about = own.about.clone();
        let facts = &mut about.facts;
        let fits = own.rows.len() == BLOCKS
            && own.longest.len() == joints
            && facts.hull.len() == joints
            && own.about.torque_rms.len() == joints
            && facts.summary.rows.len() == joints;
        if !fits {
            return Err(
                self.damaged("has another number of joints or stretches than its header says")
            );
        }
        facts.states = self.states(joints)?;
        let (noise, excerpt) = (self.noise(joints)?, self.excerpt(joints)?);
        let acts = !self.plan.payload_where_unknown || facts.payload == Payload::Unknown;
        let recipes = recipes_of_log(library, acts);
        let filtered = self.plan.pipeline.cutoff_hz != 0.0;
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
            about,
            sums: LogSums {
                cutoff: own.cutoff,
                rows: own.rows.clone(),
                joints: sums,
            },
            raw,
            noise,
            excerpt,
        })
    }

    /// Some rows of all joints.
    fn excerpt(&mut self, joints: usize) -> Result<Excerpt> {
        let mut list = |joint, place| -> Result<Vec<f64>> {
            Ok(self.take(joint, Quantity::Excerpt, place)?.values)
        };
        let stamps = list(0, CHANNELS)?;
        let of_joint = |joint| -> Result<[Vec<f64>; CHANNELS]> {
            let mut numbers: [Vec<f64>; CHANNELS] = Default::default();
            for (place, values) in numbers.iter_mut().enumerate() {
                *values = list(joint, place)?;
            }
            Ok(numbers)
        };
        let numbers = (0..joints).map(of_joint).collect::<Result<Vec<_>>>()?;
        let excerpt = Excerpt::of_numbers(stamps, &numbers);
        excerpt.ok_or_else(|| self.damaged("has an excerpt of rows that is none"))
    }

    /// The noise of all joints.
    fn noise(&mut self, joints: usize) -> Result<Sketch> {
        let numbers = (0..joints).map(|joint| Ok(self.take(joint, Quantity::Noise, 0)?.values));
        let numbers = numbers.collect::<Result<Vec<_>>>()?;
        let noise = Sketch::of_numbers(&numbers);
        noise.ok_or_else(|| self.damaged("has a noise of torque that is none"))
    }

    /// States of all joints, as many of each.
    fn states(&mut self, joints: usize) -> Result<States> {
        let mut states = States::default();
        for joint in 0..joints {
            let [q, qd, qdd, still] = [
                self.take(joint, Quantity::Positions, 0)?.values,
                self.take(joint, Quantity::Velocities, 0)?.values,
                self.take(joint, Quantity::Accelerations, 0)?.values,
                self.take(joint, Quantity::Still, 0)?.values,
            ];
            let len = if joint == 0 { q.len() } else { states.len };
            if [&q, &qd, &qdd, &still].iter().any(|own| own.len() != len) {
                return Err(self.damaged("has another number of states on every joint"));
            }
            states.len = len;
            states.q.extend(q);
            states.qd.extend(qd);
            states.qdd.extend(qdd);
            states.still.extend(still.iter().map(|still| *still != 0.0));
        }
        Ok(states)
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
            if self.plan.noise == NoiseModel::Ar1 {
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
        if self.plan.noise == NoiseModel::Ar1 || block % 2 == 1 {
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
        let place = (joint as u32, quantity, block as u32);
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
        damaged(self.header, problem)
    }
}
