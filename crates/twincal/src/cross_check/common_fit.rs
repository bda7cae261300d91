//! One rigid robot for all joints and logs: least squares with free inertial parameters, each joint's friction free in each log.
//!
//! ```text
//! τ_jl = τ_nominal + X_j θ + F_jl φ_jl + ε,   ε ~ σ_j
//! ```
//! θ are all inertial parameters and the motors' inertias, the same for all joints and logs; φ_jl is eliminated (Frisch & Waugh 1933). What a wrong mass
//! does, θ explains on all joints at once; torque that is scaled, turned or late in one log or joint it does not. A suspicion is one
//! column c more, whose coefficient is `γ = c̃ᵀe / c̃ᵀRc̃`, R the residual maker; its sd comes from sums over seconds (Liang & Zeger 1986), so that
//! correlated residuals do not count as many.

use super::excerpt::TRIPLE;
use super::rows::{Block, FRICTION};
use crate::linear_algebra::{Cholesky, dot};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Share of its own size by which a parameter is held at the model's: directions that no motion shows stay there.
const RIDGE: f64 = 1e-6;
/// Time over which residuals are taken as one, s.
const CLUSTER: f64 = 1.0;
/// Fewest moving rows of a joint in a log.
const FEWEST: usize = 30;

/// Rows with their projection off friction.
struct Rows {
    block: Block,
    /// FᵀF of the live rows.
    friction: Cholesky,
    /// XᵀMX and XᵀMτ, XᵀMτ_nominal, M off friction and live.
    gram: Vec<f64>,
    right: [Vec<f64>; 2],
    /// τᵀMτ, τᵀMτ_nominal and τ_nominalᵀMτ_nominal.
    squares: [f64; 3],
    live: f64,
    /// What measured torque is divided by.
    factor: f64,
    /// 1/σ of its joint.
    weight: f64,
    /// Torque of the model with θ, and with friction, all rows.
    rigid: Vec<f64>,
    all: Vec<f64>,
    /// Residual off friction, live rows, times the weight.
    residual: Vec<f64>,
}

/// The fit.
pub(super) struct CommonFit {
    size: usize,
    rows: Vec<Rows>,
    matrix: Cholesky,
    theta: Vec<f64>,
}

/// What one more column says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Effect {
    /// Coefficient.
    pub(super) size: f64,
    /// Its standard deviation; infinite before [`CommonFit::judged`].
    pub(super) sd: f64,
    /// Seconds of the logs that have the column.
    pub(super) clusters: usize,
    /// By how much the sum of squares falls.
    pub(super) gain: f64,
    /// That over what is left of it in its rows.
    pub(super) explains: f64,
}

impl Effect {
    /// Standard deviations from 0.
    pub(super) fn z(&self) -> f64 {
        (self.size / self.sd).abs()
    }
}

impl CommonFit {
    /// Fits `blocks` with `size` common parameters; `None` where too little moves.
    pub(super) fn new(blocks: Vec<Block>, size: usize) -> Option<Self> {
        let mut rows: Vec<Rows> = blocks.into_iter().filter_map(Rows::new).collect();
        weigh(&mut rows, size)?;
        let matrix = normal_matrix(&rows, size, |own| own.weight * own.weight)?;
        let theta = vec![0.0; size];
        let mut fit = Self {
            size,
            rows,
            matrix,
            theta,
        };
        fit.solve();
        Some(fit)
    }

    /// Divides the torque of the blocks for which `which` holds by `factor`, and fits again.
    pub(super) fn divide(&mut self, which: impl Fn(&Block) -> bool, factor: f64) {
        let own = self.rows.iter_mut().filter(|own| which(&own.block));
        own.for_each(|own| own.factor *= factor);
        self.solve();
    }

    /// Takes a lag of `lags[log]` s out of each log's torque, to first order, and fits again.
    pub(super) fn advance(&mut self, lags: &BTreeMap<usize, f64>) {
        for own in &mut self.rows {
            let lag = lags.get(&own.block.log).copied().unwrap_or(0.0);
            let rate = Fitted(own).rate();
            for (tau, rate) in own.block.measured.iter_mut().zip(&rate) {
                *tau += lag * own.factor * rate;
            }
            own.sum_torque();
        }
        self.solve();
    }

    /// Sum of squares with the torque of one of these logs turned, over that as it is.
    pub(super) fn turned(&self, logs: &[usize]) -> Vec<f64> {
        let so_far = self.right();
        let as_it_is = self.left_of(&so_far);
        let of = |log: &usize| {
            let mut changed = so_far.clone();
            for own in &self.rows[self.rows_of(Some(*log))] {
                let turn = |of: &[f64]| of.iter().map(|tau| -2.0 * tau).collect::<Vec<f64>>();
                own.change(
                    &mut changed,
                    (&turn(&own.right[0]), -2.0 * own.squares[1], 0.0),
                );
            }
            self.left_of(&changed) / as_it_is
        };
        logs.iter().map(of).collect()
    }

    /// The log of these, and its two joints, which exchange their torque with the least squares left, and by how much these fall.
    pub(super) fn exchange(&self, logs: &[usize]) -> Option<(usize, [usize; 2], f64)> {
        let so_far = self.right();
        let as_it_is = self.left_of(&so_far);
        let pairs = logs.iter().flat_map(|log| {
            let own = self.rows_of(Some(*log));
            own.clone()
                .flat_map(move |a| (a + 1..own.end).map(move |b| (*log, a, b)))
        });
        let gains = pairs.map(|(log, a, b)| {
            let mut changed = so_far.clone();
            let [a, b] = [&self.rows[a], &self.rows[b]];
            a.replace(&mut changed, &b.block.measured);
            b.replace(&mut changed, &a.block.measured);
            let joints = [a.block.joint, b.block.joint];
            (log, joints, as_it_is - self.left_of(&changed))
        });
        gains.max_by(|one, other| one.2.total_cmp(&other.2))
    }

    /// Exchanges the torque of two joints of a log, and fits again.
    pub(super) fn swap(&mut self, log: usize, joints: [usize; 2]) {
        let place = |joint: usize| {
            let is_it = |own: &Rows| own.block.log == log && own.block.joint == joint;
            self.rows.iter().position(is_it)
        };
        let [Some(a), Some(b)] = joints.map(place) else {
            return;
        };
        let first = std::mem::take(&mut self.rows[a].block.measured);
        self.rows[a].block.measured = std::mem::replace(&mut self.rows[b].block.measured, first);
        for own in [a, b] {
            self.rows[own].sum_torque();
        }
        self.solve();
    }

    /// What a right side and a sum of squares leave of the latter.
    fn left_of(&self, (right, square): &(Vec<f64>, f64)) -> f64 {
        let mut solution = right.clone();
        self.matrix.solve(&mut solution);
        square - dot(right, &solution)
    }

    /// Right side of the normal equations and sum of squares.
    fn right(&self) -> (Vec<f64>, f64) {
        let (mut right, mut square) = (vec![0.0; self.size], 0.0);
        for own in &self.rows {
            let (w, s) = (own.weight * own.weight, 1.0 / own.factor);
            for ((&k, tau), nominal) in own
                .block
                .columns
                .iter()
                .zip(&own.right[0])
                .zip(&own.right[1])
            {
                right[k] += w * (s * tau - nominal);
            }
            let [tau, both, nominal] = own.squares;
            square += w * (s * s * tau - 2.0 * s * both + nominal);
        }
        (right, square)
    }

    fn solve(&mut self) {
        (self.theta, _) = self.right();
        self.matrix.solve(&mut self.theta);
        for own in &mut self.rows {
            own.update(&self.theta);
        }
    }

    /// The last three common parameters: change of gravity in the base, m/s².
    pub(super) fn gravity(&self) -> [f64; 3] {
        std::array::from_fn(|axis| self.theta[self.size - 3 + axis])
    }

    /// Logs and joints that have rows.
    pub(super) fn logs(&self) -> Vec<usize> {
        self.places(|block| block.log)
    }

    pub(super) fn joints(&self) -> Vec<usize> {
        self.places(|block| block.joint)
    }

    fn places(&self, of: impl Fn(&Block) -> usize) -> Vec<usize> {
        let mut places: Vec<usize> = self.rows.iter().map(|own| of(&own.block)).collect();
        places.sort_unstable();
        places.dedup();
        places
    }

    /// Sum of squares in the blocks for which `which` holds.
    pub(super) fn squares(&self, which: impl Fn(&Block) -> bool) -> f64 {
        let own = self.rows.iter().filter(|own| which(&own.block));
        own.map(|own| dot(&own.residual, &own.residual)).sum()
    }

    /// Share of torque's sum of squares about friction that is left in the blocks for which `which` holds.
    pub(super) fn left(&self, which: impl Fn(&Block) -> bool) -> f64 {
        let (mut left, mut all) = (0.0, 0.0);
        for own in self.rows.iter().filter(|own| which(&own.block)) {
            left += dot(&own.residual, &own.residual);
            all += own.squares[0] * (own.weight / own.factor).powi(2);
        }
        left / all
    }

    /// One more column, cheaply: without an sd. It is 0 in other logs than this one, where one is named.
    pub(super) fn effect(
        &self,
        log: Option<usize>,
        column: impl Fn(Fitted<'_>) -> Option<Vec<f64>>,
    ) -> Option<Effect> {
        let own = self.rows_of(log);
        let (columns, right) = self.column(own.clone(), column);
        let mut solution = right.clone();
        self.matrix.solve(&mut solution);
        let (mut square, mut product, mut left) = (-dot(&right, &solution), 0.0, 0.0);
        for (own, column) in self.rows[own].iter().zip(&columns) {
            let Some(column) = column else { continue };
            square += dot(column, column);
            product += dot(column, &own.residual);
            left += dot(&own.residual, &own.residual);
        }
        let size = product / square;
        let gain = product * size;
        (square > 0.0 && size.is_finite()).then_some(Effect {
            size,
            sd: f64::INFINITY,
            clusters: 0,
            gain,
            explains: gain / (left - gain).max(f64::MIN_POSITIVE),
        })
    }

    /// One more column, with the sd of its coefficient; see [`CommonFit::effect`].
    pub(super) fn judged(
        &self,
        log: Option<usize>,
        column: impl Fn(Fitted<'_>) -> Option<Vec<f64>>,
    ) -> Option<Effect> {
        let effect = self.effect(log, &column)?;
        let range = self.rows_of(log);
        let (columns, mut solution) = self.column(range.clone(), column);
        self.matrix.solve(&mut solution);
        // r = R c̃, the residual without it, and their products: by log and second, and by second since the log began, as logs of one
        // programme have one error.
        let mut square = 0.0;
        let mut sums = [(); 2].map(|()| BTreeMap::<(usize, i64), f64>::new());
        let mut says = BTreeSet::new();
        for (number, own) in self.rows.iter().enumerate() {
            let column = number.checked_sub(range.start);
            let column = column.and_then(|at| columns.get(at)?.as_ref());
            let mut r = own.times(&solution);
            own.project(&mut r);
            for (i, r) in r.iter_mut().enumerate() {
                *r = column.map_or(0.0, |column| column[i]) - own.weight * *r;
            }
            if let Some(column) = column {
                square += dot(&r, column);
            }
            let began = own.block.time.first().copied().unwrap_or_default();
            for (i, r) in r.iter().enumerate() {
                let second = |time: f64| (time / CLUSTER).floor() as i64;
                let [at, since] = [0.0, began].map(|from| second(own.block.time[i] - from));
                let product = r * (own.residual[i] - effect.size * r);
                if column.is_some() {
                    says.insert((own.block.log, at));
                }
                let places = [(own.block.log, at), (0, since)];
                for (sums, place) in sums.iter_mut().zip(places) {
                    *sums.entry(place).or_default() += product;
                }
            }
        }
        let squares = sums.map(|sums| sums.values().map(|sum| sum * sum).sum::<f64>());
        Some(Effect {
            sd: squares[0].max(squares[1]).sqrt() / square,
            clusters: says.len(),
            ..effect
        })
    }

    /// Where the rows of a log stand, or all of them.
    fn rows_of(&self, log: Option<usize>) -> Range<usize> {
        let before = |log: usize| self.rows.partition_point(|own| own.block.log < log);
        match log {
            Some(log) => before(log)..before(log + 1),
            None => 0..self.rows.len(),
        }
    }

    /// Columns of these rows off friction times their weight, and their products with the regressor.
    fn column(
        &self,
        rows: Range<usize>,
        column: impl Fn(Fitted<'_>) -> Option<Vec<f64>>,
    ) -> (Vec<Option<Vec<f64>>>, Vec<f64>) {
        let mut right = vec![0.0; self.size];
        let columns = self.rows[rows].iter().map(|own| {
            let mut values = column(Fitted(own))?;
            own.project(&mut values);
            values.iter_mut().for_each(|v| *v *= own.weight);
            for (k, &parameter) in own.block.columns.iter().enumerate() {
                right[parameter] += own.weight * dot(own.block.column(k), &values);
            }
            Some(values)
        });
        let columns = columns.collect();
        (columns, right)
    }
}

/// A block with what the fit says of it.
#[derive(Clone, Copy)]
pub(super) struct Fitted<'a>(&'a Rows);

impl Fitted<'_> {
    pub(super) fn block(&self) -> &Block {
        &self.0.block
    }

    /// Torque of the model with its fitted parameters, without friction.
    pub(super) fn rigid(&self) -> Vec<f64> {
        self.0.rigid.clone()
    }

    /// Change of the fitted torque, friction included, N·m/s: that of the parabola through three neighbours.
    pub(super) fn rate(&self) -> Vec<f64> {
        let (block, torque) = (&self.0.block, &self.0.all);
        let mut rates = vec![0.0; block.rows()];
        let (triples, _) = torque.as_chunks::<TRIPLE>();
        let (times, _) = block.time.as_chunks::<TRIPLE>();
        let (own, _) = rates.as_chunks_mut::<TRIPLE>();
        for ((rate, [before, here, after]), time) in own.iter_mut().zip(triples).zip(times) {
            let per_second = 1.0 / (time[2] - time[0]);
            *rate = [
                4.0 * here - 3.0 * before - after,
                after - before,
                before - 4.0 * here + 3.0 * after,
            ]
            .map(|change| change * per_second);
        }
        rates
    }
}

impl Rows {
    /// `None` for a joint that hardly moves.
    fn new(block: Block) -> Option<Self> {
        let count = block.live.iter().filter(|live| **live).count();
        let rows = block.rows();
        let masked = |k: usize| -> Vec<f64> {
            let values = block.friction[k * rows..(k + 1) * rows].iter();
            values
                .zip(&block.live)
                .map(|(v, live)| if *live { *v } else { 0.0 })
                .collect()
        };
        let shapes: Vec<Vec<f64>> = (0..FRICTION).map(masked).collect();
        let mut products = vec![0.0; FRICTION * FRICTION];
        for (i, shape) in shapes.iter().enumerate() {
            for (j, other) in shapes.iter().enumerate() {
                products[i * FRICTION + j] = dot(shape, other);
            }
            products[i * FRICTION + i] *= 1.0 + 1e-9;
        }
        let friction = Cholesky::new(&products, FRICTION).ok()?;
        if count < FEWEST {
            return None;
        }
        let mut own = Self {
            live: count as f64,
            factor: 1.0,
            weight: 1.0,
            friction,
            gram: Vec::new(),
            right: [Vec::new(), Vec::new()],
            squares: [0.0; 3],
            rigid: Vec::new(),
            all: Vec::new(),
            residual: Vec::new(),
            block,
        };
        own.gram = own.products();
        own.sum_torque();
        Some(own)
    }

    /// Products of measured torque with the columns and with that of the model.
    fn sum_torque(&mut self) {
        let [mut tau, mut nominal] = [self.block.measured.clone(), self.block.nominal.clone()];
        self.project(&mut tau);
        self.project(&mut nominal);
        self.squares = [
            dot(&tau, &tau),
            dot(&tau, &nominal),
            dot(&nominal, &nominal),
        ];
        // What is off friction needs no second projection.
        let columns = 0..self.block.columns.len();
        self.right = [&tau, &nominal].map(|of| {
            let products = columns.clone().map(|k| dot(self.block.column(k), of));
            products.collect()
        });
    }

    /// XᵀMX.
    fn products(&self) -> Vec<f64> {
        let count = self.block.columns.len();
        let projected = (0..count).map(|k| {
            let mut column = self.block.column(k).to_vec();
            self.project(&mut column);
            column
        });
        let projected: Vec<Vec<f64>> = projected.collect();
        let mut gram = vec![0.0; count * count];
        for (i, column) in projected.iter().enumerate() {
            for (j, other) in projected[..=i].iter().enumerate() {
                let product = dot(column, other);
                gram[i * count + j] = product;
                gram[j * count + i] = product;
            }
        }
        gram
    }

    /// Changes a right side and a sum of squares: by what is added to the products of torque with the columns, with that of the model, and to its square.
    fn change(
        &self,
        (right, square): &mut (Vec<f64>, f64),
        (columns, nominal, own): (&[f64], f64, f64),
    ) {
        let (w, s) = (self.weight * self.weight, 1.0 / self.factor);
        for (&k, change) in self.block.columns.iter().zip(columns) {
            right[k] += w * s * change;
        }
        *square += w * s * (s * own - 2.0 * nominal);
    }

    /// The same for this torque instead of that which was measured.
    fn replace(&self, sums: &mut (Vec<f64>, f64), torque: &[f64]) {
        let mut tau = torque.to_vec();
        self.project(&mut tau);
        let before = self.right[0].iter().enumerate();
        let columns: Vec<f64> = before
            .map(|(k, before)| dot(self.block.column(k), &tau) - before)
            .collect();
        let nominal = dot(&self.block.nominal, &tau) - self.squares[1];
        self.change(sums, (&columns, nominal, dot(&tau, &tau) - self.squares[0]));
    }

    /// Takes what friction explains away; rows that are not live become 0.
    fn project(&self, values: &mut [f64]) {
        for (value, live) in values.iter_mut().zip(&self.block.live) {
            *value *= f64::from(u8::from(*live));
        }
        let rows = self.block.rows();
        let shapes = |k: usize| &self.block.friction[k * rows..(k + 1) * rows];
        let mut of: Vec<f64> = (0..FRICTION).map(|k| dot(shapes(k), values)).collect();
        self.friction.solve(&mut of);
        for (k, of) in of.iter().enumerate() {
            let shaped = values.iter_mut().zip(shapes(k)).zip(&self.block.live);
            for ((value, shape), live) in shaped {
                *value -= of * shape * f64::from(u8::from(*live));
            }
        }
    }

    /// X θ.
    fn times(&self, theta: &[f64]) -> Vec<f64> {
        let mut sum = vec![0.0; self.block.rows()];
        for (k, &parameter) in self.block.columns.iter().enumerate() {
            for (sum, x) in sum.iter_mut().zip(self.block.column(k)) {
                *sum += theta[parameter] * x;
            }
        }
        sum
    }

    fn update(&mut self, theta: &[f64]) {
        self.rigid = self.times(theta);
        for (rigid, nominal) in self.rigid.iter_mut().zip(&self.block.nominal) {
            *rigid += nominal;
        }
        let measured = self.block.measured.iter().zip(&self.rigid);
        let rest: Vec<f64> = measured
            .map(|(tau, rigid)| tau / self.factor - rigid)
            .collect();
        let mut residual = rest.clone();
        self.project(&mut residual);
        // What was projected away is friction.
        let rows = self.block.rows();
        let shapes = |k: usize| &self.block.friction[k * rows..(k + 1) * rows];
        let live: Vec<f64> = (rest.iter().zip(&self.block.live))
            .map(|(r, live)| r * f64::from(u8::from(*live)))
            .collect();
        let mut of: Vec<f64> = (0..FRICTION).map(|k| dot(shapes(k), &live)).collect();
        self.friction.solve(&mut of);
        self.all = self.rigid.clone();
        for (k, of) in of.iter().enumerate() {
            for (all, shape) in self.all.iter_mut().zip(shapes(k)) {
                *all += of * shape;
            }
        }
        residual.iter_mut().for_each(|r| *r *= self.weight);
        self.residual = residual;
    }
}

/// 1/σ of each joint, by a fit of its own over all logs.
fn weigh(rows: &mut [Rows], size: usize) -> Option<()> {
    let last = rows.iter().map(|own| own.block.joint).max()?;
    for joint in 0..=last {
        let of = |own: &Rows| f64::from(u8::from(own.block.joint == joint));
        if !rows.iter().any(|own| own.block.joint == joint) {
            continue;
        }
        let matrix = normal_matrix(rows, size, of)?;
        let (mut right, mut square, mut count) = (vec![0.0; size], 0.0, 0.0);
        for own in rows.iter().filter(|own| own.block.joint == joint) {
            for ((&k, tau), nominal) in own
                .block
                .columns
                .iter()
                .zip(&own.right[0])
                .zip(&own.right[1])
            {
                right[k] += tau - nominal;
            }
            let [tau, both, nominal] = own.squares;
            square += tau - 2.0 * both + nominal;
            count += own.live;
        }
        let mut theta = right.clone();
        matrix.solve(&mut theta);
        let sd = ((square - dot(&right, &theta)).max(1e-12 * square) / count).sqrt();
        if !(sd > 0.0 && sd.is_finite()) {
            return None;
        }
        let own = rows.iter_mut().filter(|own| own.block.joint == joint);
        own.for_each(|own| own.weight = 1.0 / sd);
    }
    Some(())
}

/// Σ w XᵀMX with its diagonal a little larger.
fn normal_matrix(rows: &[Rows], size: usize, weight: impl Fn(&Rows) -> f64) -> Option<Cholesky> {
    let mut matrix = vec![0.0; size * size];
    for own in rows {
        let (w, count) = (weight(own), own.block.columns.len());
        for (i, &row) in own.block.columns.iter().enumerate() {
            for (j, &column) in own.block.columns.iter().enumerate() {
                matrix[row * size + column] += w * own.gram[i * count + j];
            }
        }
    }
    for k in 0..size {
        let own = &mut matrix[k * size + k];
        *own = if *own > 0.0 {
            *own * (1.0 + RIDGE)
        } else {
            1.0
        };
    }
    Cholesky::new(&matrix, size).ok()
}
