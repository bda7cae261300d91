//! Which order of gear ripple a joint's residual shows, and whether it is one.
//!
//! ```text
//! r_c ≈ a sin(N q)_c + b cos(N q)_c,      gain = −½ n ln(1 − R²)   nats
//! ```
//! `c` are cells: a quarter of a period of N, gone through in one direction; each is the mean of its rows and counts once, however often the
//! motion came by. n, what counts as independent, is the number of (period, direction) that hold rows, or the rows over their memory where
//! that is less. So a path that is repeated is one path, and what a model lacks at k places has a share of about k/n of the cells and gains
//! about k/2 nats, for any N: only what goes on over the whole range gains more.
//!
//! N is looked for among all orders that the motion tells apart. Without ripple 2 · gain of one order is at most χ² with two degrees of
//! freedom, so that a gain of g nats comes by chance with probability e^−g or less at each.

use std::f64::consts::TAU;

/// Periods per turn, or per metre of a slider: below, it may be anything that a model lacks; above are no gears of arms.
const PERIODS: [f64; 2] = [8.0, 400.0];
/// Gain from which an order is told, nats. Of noise alone with 10 joints of 4000 orders: less than one false alarm in a million fits, one
/// in ten if the effective rows were half as many.
const GAIN: f64 = 25.0;
/// Share of the variance of the rows that count from which it is worth a word.
const SHARE: f64 = 0.1;
/// Periods that the motion must go through in each direction. With fewer, 25 nats ask for an R² of 0.96, which nothing real has but
/// what two waves fit by chance at a few places.
const PLACES: usize = 8;
/// R² in each direction and in each half of the positions, with the same a and b, as a share of R² of all cells: friction turns its sign with
/// the direction, and what a model lacks at one end of the range is not there at the other, but a gear is the same everywhere.
const EVERYWHERE: f64 = 0.5;
/// Cells of a period: enough to see a wave.
const CELLS: usize = 4;
/// Orders that are looked at: of a joint that turns round and round, so many as its motion tells apart within a turn and a half.
const ORDERS: f64 = 4096.0;
/// Fewest rows at an order.
const FEWEST: usize = 30;

/// A row that may count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Row {
    pub(super) position: f64,
    pub(super) velocity: f64,
    pub(super) residual: f64,
}

/// What repeats.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ripple {
    /// Radians of it per radian (metre) of the joint.
    pub(super) order: f64,
    pub(super) amplitude: f64,
    /// Of the variance of the rows that count.
    pub(super) share: f64,
    pub(super) gain: f64,
    /// Periods gone through with the coordinate rising.
    pub(super) forwards: usize,
    pub(super) backwards: usize,
    /// The least R² of the cells of a direction or a half, as a share of that of all.
    pub(super) least: f64,
}

impl Ripple {
    fn is_one(&self) -> bool {
        self.gain > GAIN
            && self.share > SHARE
            && self.forwards.min(self.backwards) >= PLACES
            && self.least > EVERYWHERE
    }
}

/// What is looked for in the rows of one joint, which ascend in speed; positions are about the middle of their range.
struct Search {
    rows: Vec<Row>,
    range: f64,
    /// So many rows in a row count as one.
    memory: f64,
    /// A row counts where the filter keeps the ripple, below it.
    cutoff_hz: f64,
    cells: Vec<Sums>,
}

/// Sums, or means, over rows of sin, cos and residual; and their number.
type Sums = [f64; 4];

/// Products of sin, cos and residual.
#[derive(Debug, Clone, Copy, Default)]
struct Products {
    ss: f64,
    sc: f64,
    cc: f64,
    sr: f64,
    cr: f64,
    rr: f64,
}

impl Products {
    fn add(&mut self, s: f64, c: f64, r: f64) {
        self.ss += s * s;
        self.sc += s * c;
        self.cc += c * c;
        self.sr += s * r;
        self.cr += c * r;
        self.rr += r * r;
    }

    /// Least squares of r on a sin + b cos; `None` where the two look alike.
    fn solve(&self) -> Option<[f64; 2]> {
        let Self {
            ss, sc, cc, sr, cr, ..
        } = *self;
        let determinant = ss * cc - sc * sc;
        let apart = self.rr > 0.0 && determinant >= 0.01 * ss * cc && determinant > 0.0;
        apart.then(|| {
            [
                (cc * sr - sc * cr) / determinant,
                (ss * cr - sc * sr) / determinant,
            ]
        })
    }

    /// R² of a sin + b cos; −∞ where there is nothing.
    fn explained(&self, [a, b]: [f64; 2]) -> f64 {
        if self.rr <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let size = a * a * self.ss + 2.0 * a * b * self.sc + b * b * self.cc;
        (2.0 * (a * self.sr + b * self.cr) - size) / self.rr
    }
}

/// The order that gains most of those that are ripple, and what orders the motion tells apart; `per`: the order of one period per turn or
/// metre, `memory` rows count as one. A row has a part where the filter keeps the ripple, below `cutoff_hz`.
pub(super) fn strongest(
    mut rows: Vec<Row>,
    per: f64,
    memory: f64,
    cutoff_hz: f64,
) -> Option<(Ripple, f64)> {
    let [first, last] = PERIODS.map(|periods| periods * per);
    let widest = ORDERS / (last - first);
    rows.sort_by(|a, b| a.position.total_cmp(&b.position));
    let median = rows.get(rows.len() / 2)?.position;
    rows.retain(|row| (row.position - median).abs() <= 0.5 * widest);
    let ends = [rows.first()?.position, rows.last()?.position];
    let (middle, range) = (0.5 * (ends[0] + ends[1]), ends[1] - ends[0]);
    if !(range.is_finite() && range > 0.0) {
        return None;
    }
    rows.sort_by(|a, b| a.velocity.abs().total_cmp(&b.velocity.abs()));
    rows.iter_mut().for_each(|row| row.position -= middle);
    // The phase between the ends of the motion changes by less than a radian from one order to the next. Of fewer periods than must be
    // gone through nothing is told.
    let step = 1.0 / range;
    let lowest = f64::max(first, (PLACES - 1) as f64 * TAU / range);
    if lowest > last {
        return None;
    }
    let steps = ((last - lowest) / step) as usize;
    let (mut now, turn) = (waves(&rows, lowest), waves(&rows, step));
    let mut search = Search {
        rows,
        range,
        memory,
        cutoff_hz,
        cells: Vec::new(),
    };
    let mut best: Option<Ripple> = None;
    for i in 0..=steps {
        best = better(best, search.ripple(&now, lowest + i as f64 * step));
        for ([sin, cos], [s, c]) in now.iter_mut().zip(&turn) {
            (*sin, *cos) = (*sin * c + *cos * s, *cos * c - *sin * s);
        }
    }
    // n jumps by one where another period begins: between two orders the rows decide.
    let coarse = best?;
    let near = (-10..=10).map(|i| coarse.order + 0.1 * f64::from(i) * step);
    let near = near.filter_map(|order| search.ripple(&waves(&search.rows, order), order));
    let closer = |best: Ripple, other: Ripple| {
        let closer = other.is_one() && other.share > best.share;
        if closer { other } else { best }
    };
    Some((near.fold(coarse, closer), step))
}

/// The one that gains more, of those that are ripple.
fn better(best: Option<Ripple>, other: Option<Ripple>) -> Option<Ripple> {
    let other = other.filter(Ripple::is_one);
    match (best, other) {
        (Some(best), Some(other)) if other.gain > best.gain => Some(other),
        (Some(best), _) => Some(best),
        (None, other) => other,
    }
}

/// sin(N q) and cos(N q) of every row.
fn waves(rows: &[Row], order: f64) -> Vec<[f64; 2]> {
    let wave = |row: &Row| {
        let (sin, cos) = (order * row.position).sin_cos();
        [sin, cos]
    };
    rows.iter().map(wave).collect()
}

impl Search {
    /// Least squares of one order on the cells of the rows that are slow enough for it.
    fn ripple(&mut self, waves: &[[f64; 2]], order: f64) -> Option<Ripple> {
        let fast = TAU * self.cutoff_hz;
        let slow = |row: &Row| order * row.velocity.abs() < fast;
        let count = self.rows.partition_point(slow);
        if count < FEWEST {
            return None;
        }
        // Cells forwards and backwards stand side by side, in the order of their positions.
        let per_length = order * CELLS as f64 / TAU;
        let cells = 2 * ((self.range * per_length) as usize + 1);
        self.cells.clear();
        self.cells
            .resize(cells.next_multiple_of(2 * CELLS), [0.0; 4]);
        let mut of_rows = Products::default();
        for (row, [s, c]) in self.rows[..count].iter().zip(waves) {
            of_rows.add(*s, *c, row.residual);
            let place = ((row.position + 0.5 * self.range) * per_length) as usize;
            let cell = 2 * place + usize::from(row.velocity > 0.0);
            let cell = self.cells.get_mut(cell)?;
            for (sum, value) in cell.iter_mut().zip([*s, *c, row.residual, 1.0]) {
                *sum += value;
            }
        }
        let mut periods = [0; 2];
        for period in self.cells.chunks(2 * CELLS) {
            for (direction, seen) in periods.iter_mut().enumerate() {
                let mut cells = period.iter().skip(direction).step_by(2);
                *seen += usize::from(cells.any(|[_, _, _, count]| *count > 0.0));
            }
        }
        let (mut all, mut directions, mut halves) = <([Products; 1], [_; 2], [_; 2])>::default();
        let occupied = self.cells.iter().filter(|[.., count]| *count > 0.0).count();
        let mut before = 0;
        for (place, [s, c, r, count]) in self.cells.iter().enumerate() {
            if *count > 0.0 {
                let half = usize::from(2 * before >= occupied);
                before += 1;
                for products in [&mut all[0], &mut directions[place % 2], &mut halves[half]] {
                    Products::add(products, s / count, c / count, r / count);
                }
            }
        }
        let [a, b] = all[0].solve()?;
        let parts = directions.iter().chain(&halves);
        let least = parts.map(|part| part.explained([a, b]));
        let explained = all[0].explained([a, b]);
        let left = (1.0 - explained).clamp(f64::MIN_POSITIVE, 1.0);
        let independent = f64::min((periods[0] + periods[1]) as f64, count as f64 / self.memory);
        Some(Ripple {
            order,
            amplitude: a.hypot(b),
            share: of_rows.explained([a, b]),
            gain: -0.5 * independent * left.ln(),
            forwards: periods[1],
            backwards: periods[0],
            least: least.fold(1.0, f64::min) / explained,
        })
    }
}

#[cfg(test)]
mod tests;
