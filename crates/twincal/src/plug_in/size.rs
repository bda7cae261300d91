//! How large a payload is that a log may show: a tool of a few grams, or as much as the arm can carry.
//!
//! ```text
//! s uniform over 1, ½, ¼ …       m | s ~ N(0, (s sd)²) between s sd/√2 and √2 s sd, either sign
//!                                 first and second moments | s ~ N(0, (s sd_k)²)
//! p(y | z) = mean over s of p(y | z, s) · P(m within | y, z, s) / P(m within | s)
//! ```
//! So a payload has a mass, and what else it has is as large as that mass makes likely. The slab is that of one s, which the data choose, and
//! the prior odds have the rest of the mean, by the heaviest model with a payload. The list ends where a payload of that size would cost
//! less than [`SEEN`] in evidence if it were not there: of one that the motion cannot show nothing is asked. Where it shows nothing of a
//! payload, s is 1 and m unbounded.
//!
//! # Source
//! Lindley 1957 (a slab far wider than the effect rejects it whatever the data say); Klugkist & Hoijtink 2007 (evidence of a bounded prior
//! from the unbounded one); Kass & Wasserman 1995 (a slab as wide as the motion can tell).

use crate::likelihood::{Columns, PayloadSize};
use crate::linear_algebra::{Cholesky, dot};
use crate::posterior::student::StudentT;
use crate::posterior::{Model, Posterior, Problem};
use crate::term::PAYLOAD_MASS as MASS;
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// Factors on the slab's sd at most.
const SCALES: usize = 16;
/// Evidence that a payload loses by its volume at least where it is asked for, as ln: 3 for a PIP of 0.05 where it is not there, and as much
/// again that its columns may win from noise.
const SEEN: f64 = 6.0;
/// The scale in force stays where no other one has so much more evidence, as ln.
const CLEARLY: f64 = 1.0;

/// P(|x| ≤ √½) and P(|x| ≤ √2) of a standard normal x.
const BELOW: [f64; 2] = [0.520_499_877_813_046_5, 0.842_700_792_949_714_9];

/// ln p(y | z) in two parts, each but for what no slab changes, and the coefficients.
#[derive(Debug, Clone)]
pub(crate) struct Evidence {
    /// −½ ln(|V| |A|): what the coefficients lose by being free.
    volume: f64,
    /// −(a₀ + n/2) ln(b₀ + RSS/2).
    fit: f64,
    /// Means, and variances over φ.
    mean: Vec<f64>,
    variance: Vec<f64>,
    /// a and b of φ.
    noise: [f64; 2],
}

impl Evidence {
    /// Of a model with some columns whose slab has another sd; `None` where it has no decomposition. Bounds on coefficients are left out.
    pub(crate) fn new(
        problem: &Problem,
        members: &[u32],
        (columns, factor): (&[u32], f64),
    ) -> Option<Self> {
        let (size, all) = (members.len(), problem.names.len());
        let (mut matrix, mut slabs) = (vec![0.0; size * size], 0.0);
        for (i, &a) in members.iter().enumerate() {
            let own = a as usize;
            for (j, &b) in members.iter().enumerate() {
                matrix[i * size + j] = problem.gram[own * all + b as usize];
            }
            let square = match columns.contains(&a) {
                true => factor * factor,
                false => 1.0,
            };
            let slab = problem.prior.slab[own] * square;
            matrix[i * size + i] += 1.0 / slab;
            slabs += slab.ln();
        }
        let xy: Vec<f64> = members.iter().map(|&a| problem.xy[a as usize]).collect();
        let factor = Cholesky::new(&matrix, size).ok()?;
        let mut mean = xy.clone();
        factor.solve(&mut mean);
        let rest = (problem.yy - dot(&xy, &mean)).max(0.0);
        let prior = &problem.prior;
        let noise = [prior.shape + 0.5 * problem.n, prior.scale + 0.5 * rest];
        let inverse = factor.inverse();
        Some(Self {
            volume: -0.5 * (slabs + factor.log_determinant()),
            fit: -noise[0] * noise[1].ln(),
            mean,
            variance: (0..size).map(|i| inverse[i * size + i]).collect(),
            noise,
        })
    }

    /// ln p(y | z).
    pub(crate) fn log(&self) -> f64 {
        self.volume + self.fit
    }

    /// P(low < |β| ≤ high | y, z) of a coefficient.
    fn within(&self, at: usize, [low, high]: [f64; 2]) -> f64 {
        let [a, b] = self.noise;
        let sd = (self.variance[at] * b / a).sqrt();
        let student = StudentT::new(2.0 * a);
        // From the side on which nothing cancels.
        let between = |from: f64, to: f64| match from + to > 0.0 {
            true => student.cdf(-from) - student.cdf(-to),
            false => student.cdf(to) - student.cdf(from),
        };
        let mean = self.mean[at];
        let above = between((low - mean) / sd, (high - mean) / sd);
        above + between((-high - mean) / sd, (-low - mean) / sd)
    }
}

/// What a posterior says of the payload's size; as it is where there is no payload among the candidates.
pub(super) fn payload_size(
    columns: &Columns,
    now: PayloadSize,
    problem: &Problem,
    posterior: &Posterior,
) -> PayloadSize {
    let own: Vec<u32> = (0..columns.names.len() as u32)
        .filter(|k| columns.is_payload(*k as usize))
        .collect();
    let Some(first) = posterior.models.first().filter(|_| !own.is_empty()) else {
        return now;
    };
    let holds = |model: &&Model| model.members.iter().any(|k| own.contains(k));
    let members = match posterior.models.iter().find(holds) {
        Some(model) => model.members.clone(),
        None => {
            let mut all = [&first.members[..], &own[..]].concat();
            all.sort_unstable();
            all
        }
    };
    let mass = (own.iter().copied())
        .find(|&k| columns.names[k as usize] == MASS)
        .and_then(|k| Some((k, columns.prior_sd[k as usize]?)));
    chosen(problem, (&members, &own), mass, now.scale).unwrap_or(now)
}

/// The scale of some columns of a model whose slab has the scale `now`; `mass`: the one that has to be as large as the scale says, with its
/// prior sd.
fn chosen(
    problem: &Problem,
    (members, own): (&[u32], &[u32]),
    mass: Option<(u32, f64)>,
    now: f64,
) -> Option<PayloadSize> {
    let others: Vec<u32> = (members.iter().copied())
        .filter(|k| !own.contains(k))
        .collect();
    let without = Evidence::new(problem, &others, (own, 1.0))?;
    let of = |at: usize| {
        let scale = 0.5_f64.powi(at as i32);
        Some((scale, Evidence::new(problem, members, (own, scale / now))?))
    };
    let first = of(0)?;
    let asked = (1..SCALES)
        .map_while(of)
        .take_while(|(_, evidence)| without.volume - evidence.volume >= SEEN);
    let all: Vec<(f64, Evidence)> = [first].into_iter().chain(asked).collect();
    let bounded = mass.filter(|_| all.len() > 1).and_then(|(column, sd)| {
        let place = members.iter().position(|k| *k == column)?;
        Some((place, sd))
    });
    let weighed = |(at, (scale, evidence)): (usize, &(f64, Evidence))| {
        let Some((place, sd)) = bounded else {
            return evidence.log();
        };
        let (low, low_prior) = match at + 1 == all.len() {
            true => (0.0, 0.0),
            false => (FRAC_1_SQRT_2, BELOW[0]),
        };
        let (high, high_prior) = match at {
            0 => (f64::INFINITY, 1.0),
            _ => (SQRT_2, BELOW[1]),
        };
        let within = evidence.within(place, [low * scale * sd, high * scale * sd]);
        evidence.log() + within.max(0.0).ln() - (high_prior - low_prior).ln()
    };
    let logs: Vec<f64> = all.iter().enumerate().map(weighed).collect();
    let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let is_now = |at: &usize| all[*at].0 == now && logs[*at] >= best - CLEARLY;
    let kept = (0..all.len()).find(is_now);
    let at = kept.or_else(|| logs.iter().position(|own| *own == best))?;
    let (scale, evidence) = &all[at];
    let sum: f64 = logs.iter().map(|own| (own - evidence.log()).exp()).sum();
    let odds = sum / all.len() as f64;
    Some(PayloadSize {
        scale: *scale,
        odds,
    })
    .filter(|_| odds.is_finite() && odds > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::infer::approximate;
    use crate::prior::{Inclusion, Prior};

    /// Two columns of one effect, each seen in one row, and a third row that no column is in: y = X β + noise.
    const SLAB: [f64; 2] = [4.0, 9.0];
    const BOTH: (&[u32], &[u32]) = (&[0, 1], &[0, 1]);

    fn problem(rows: [f64; 2], y: [f64; 3], n: f64) -> Problem {
        let inclusion = Inclusion::Probability(0.5);
        Problem {
            gram: vec![rows[0] * rows[0], 0.0, 0.0, rows[1] * rows[1]],
            xy: vec![rows[0] * y[0], rows[1] * y[1]],
            yy: y.iter().map(|y| y * y).sum(),
            n,
            log_constant: 0.0,
            prior: Prior {
                component: vec![0, 0],
                family: vec![0],
                ..Prior::single(SLAB.to_vec(), vec![0, 0], inclusion, (2.0, 1.0))
            },
            names: vec!["a".into(), "b".into()],
        }
    }

    /// p(y | s) up to a constant: y is of a t distribution whose scale matrix I + s² X V Xᵀ is diagonal; s = 0: without the effect.
    fn closed_form(rows: [f64; 2], y: [f64; 3], n: f64, s: f64) -> f64 {
        let spread = [0, 1].map(|k| 1.0 + s * s * SLAB[k] * rows[k] * rows[k]);
        let sum = y[0] * y[0] / spread[0] + y[1] * y[1] / spread[1] + y[2] * y[2];
        (spread[0] * spread[1]).powf(-0.5) * (1.0 + 0.5 * sum).powf(-2.0 - 0.5 * n)
    }

    /// P(low < |β₁| ≤ high | y, s) by Simpson's rule over the closed form of its t distribution.
    fn within(rows: [f64; 2], y: [f64; 3], n: f64, s: f64, [low, high]: [f64; 2]) -> f64 {
        let (a, v) = (2.0 + 0.5 * n, s * s * SLAB[0]);
        let precision = rows[0] * rows[0] + 1.0 / v;
        let mean = rows[0] * y[0] / precision;
        let of = |k: usize| y[k] * y[k] / (1.0 + s * s * SLAB[k] * rows[k] * rows[k]);
        let b = 1.0 + 0.5 * (of(0) + of(1) + y[2] * y[2]);
        let density = |x: f64| (1.0 + 0.5 * precision * (x - mean).powi(2) / b).powf(-a - 0.5);
        let simpson = |from: f64, to: f64| {
            let step = (to - from) / 20_000.0;
            let value = |i: usize| {
                let factor = match i {
                    0 | 20_000 => 1.0,
                    i if i % 2 == 1 => 4.0,
                    _ => 2.0,
                };
                factor * density(from + step * i as f64)
            };
            (0..=20_000).map(value).sum::<f64>() * step / 3.0
        };
        let wide = 30.0 * (b / precision / a).sqrt();
        let part = |from: f64, to: f64| {
            let (from, to) = (from.max(mean - wide), to.min(mean + wide));
            if from < to { simpson(from, to) } else { 0.0 }
        };
        (part(low, high) + part(-high, -low)) / simpson(mean - wide, mean + wide)
    }

    /// The list by its definition: scales at which the volume is e⁶ at least.
    fn scales(rows: [f64; 2]) -> Vec<f64> {
        let volume = |s: f64| {
            let of = |k: usize| 1.0 + s * s * SLAB[k] * rows[k] * rows[k];
            0.5 * (of(0) * of(1)).ln()
        };
        let all = (1..16).map(|at| 0.5_f64.powi(at));
        let asked = all.take_while(|&s| volume(s) >= 6.0);
        [1.0].into_iter().chain(asked).collect()
    }

    /// The PIP with the chosen slab and its odds is that of the mean over all slabs, whichever scale was in force before.
    #[test]
    fn the_probability_is_that_of_all_sizes_together() {
        let (rows, n) = ([900.0, 300.0], 60.0);
        for y in [[0.3, -0.5, 7.0], [9.0, 2.0, 7.0], [40.0, -30.0, 7.0]] {
            let all = scales(rows);
            assert!(all.len() > 5, "{all:?}");
            let sd = 2.0; // of the first slab where φ is 1
            let bounded = |(at, &s): (usize, &f64)| {
                let low = if at + 1 == all.len() {
                    0.0
                } else {
                    0.5_f64.sqrt()
                };
                let high = if at == 0 { 1e9 } else { 2.0_f64.sqrt() };
                let normal = |x: f64| statrs::function::erf::erf(x / 2.0_f64.sqrt());
                let share = within(rows, y, n, s, [low * s * sd, high * s * sd]);
                closed_form(rows, y, n, s) * share / (normal(high) - normal(low))
            };
            let sum: f64 = all.iter().enumerate().map(bounded).sum();
            let mean = sum / all.len() as f64;
            let wanted = mean / (mean + closed_form(rows, y, n, 0.0));
            for before in [1.0, 0.125] {
                let mut own = problem(rows, y, n);
                own.prior
                    .slab
                    .iter_mut()
                    .for_each(|v| *v *= before * before);
                let found = chosen(&own, BOTH, Some((0, sd)), before).expect("a size");
                let factor = found.scale / before;
                own.prior
                    .slab
                    .iter_mut()
                    .for_each(|v| *v *= factor * factor);
                own.prior.odds[0] *= found.odds;
                let pip = approximate(&own, None).expect("two models").inclusion[0];
                assert!((pip - wanted).abs() < 1e-7, "{y:?}: {pip} {wanted}");
            }
        }
    }

    /// Four and a half standard errors of each of two columns, a slab of tens of thousands: alone that slab says no, whatever the size.
    #[test]
    fn an_effect_far_smaller_than_its_slab_is_found() {
        let (rows, n) = ([30_000.0, 30_000.0], 2000.0);
        let y = [4.5, 4.5, 44.0];
        let alone = problem(rows, y, n);
        let before = approximate(&alone, None).expect("two models").inclusion[0];
        let found = chosen(&alone, BOTH, Some((0, 2.0)), 1.0).expect("a size");
        let mut own = alone;
        own.prior
            .slab
            .iter_mut()
            .for_each(|v| *v *= found.scale * found.scale);
        own.prior.odds[0] *= found.odds;
        let after = approximate(&own, None).expect("two models").inclusion[0];
        assert!(before < 0.7 && after > 0.99, "{before} {after} {found:?}");
        assert!(found.scale < 1e-2, "{found:?}");
    }

    /// A motion that would not show it asks for no other size, and the prior stays as it is.
    #[test]
    fn where_nothing_is_seen_the_size_is_the_priors() {
        let own = problem([0.1, 0.1], [0.3, 0.2, 5.0], 30.0);
        let found = chosen(&own, BOTH, Some((0, 2.0)), 1.0).expect("a size");
        assert_eq!(found, PayloadSize::default());
    }

    /// A quarter of the sd and a fifth of the odds where the payload is, nothing else, and back.
    #[test]
    fn a_size_is_in_the_slab_of_the_payload_alone() {
        use crate::gram::Gram;
        use crate::likelihood::{PlugIn, assemble};
        use crate::prior::PriorSettings;
        use crate::signal::Auto;
        use crate::term::Family;
        let columns = Columns {
            names: vec![MASS.into(), "hand.density".into(), "payload.s1".into()],
            component: vec![0, 1, 2],
            family: vec![0, 1, 2],
            families: vec![Family::Payload, Family::Density, Family::PayloadTensor],
            prior_sd: vec![Some(5.0), Some(0.5), Some(0.0625)],
            lower: vec![f64::NEG_INFINITY; 3],
            forced: Vec::new(),
            parent: vec![None, None, Some(0)],
            second_choice: Vec::new(),
            one_motion: false,
            halves: Vec::new(),
        };
        let prior = PriorSettings {
            scaled_variance: Auto::Auto,
            inclusion: None,
            noise: None,
            families: Vec::new(),
            forced: Vec::new(),
            heredity: None,
        };
        let payload = PayloadSize {
            scale: 0.25,
            odds: 0.2,
        };
        let of = |payload| {
            let plug_in = PlugIn {
                noise: 2.0,
                payload,
                ..PlugIn::start(0, 3, 1.0)
            };
            let gram = Gram { joints: Vec::new() };
            assemble(&gram, &columns, &plug_in, &prior)
                .expect("a problem")
                .prior
        };
        let (before, after) = (of(PayloadSize::default()), of(payload));
        assert_eq!(before.slab, [12.5, 0.125, 0.001953125]);
        assert_eq!(after.slab, [12.5 / 16.0, 0.125, 0.001953125 / 16.0]);
        let ratio = |family: usize| after.odds[family] / before.odds[family];
        assert_eq!([0, 1, 2].map(ratio), [0.2, 1.0, 1.0]);
        let undone = payload.undone(&after, &columns);
        assert_eq!(undone.slab, before.slab);
        assert!((undone.odds[0] / before.odds[0] - 1.0).abs() < 1e-15);
    }
}
