//! Draws of one model's coefficients within their bounds.

use super::{Model, Site};
use crate::linear_algebra::Cholesky;
use crate::random::Random;

/// Sweeps of the sampler over the bounded coefficients: each draws them one after the other from their exact
/// conditional laws.
const SWEEPS: usize = 30;

/// `β_z | φ ~ N(mean, φ A_z⁻¹)` before it is cut off at the bounds.
#[derive(Debug)]
pub(super) struct Law {
    pub(super) mean: Vec<f64>,
    /// L of A_z = L Lᵀ.
    pub(super) factor: Cholesky,
    sites: Vec<Site>,
    /// Coefficients that the bounds speak of, by their index among the members.
    bounded: Vec<usize>,
    /// Columns of A_z⁻¹ that belong to them, one after the other.
    columns: Vec<Vec<f64>>,
    /// Inverse of A_z⁻¹ among them.
    inner: Vec<f64>,
    /// Mean of the matched normal: a point within the bounds, or next to them.
    matched: Vec<f64>,
}

impl Law {
    pub(super) fn new(model: &Model) -> Self {
        let count = model.members.len();
        let matched = Cholesky::from_lower(model.factor.clone(), count);
        let plain = |factor| Self {
            mean: model.mean.clone(),
            factor,
            sites: Vec::new(),
            bounded: Vec::new(),
            columns: Vec::new(),
            inner: Vec::new(),
            matched: Vec::new(),
        };
        if model.sites.is_empty() {
            return plain(matched);
        }
        let (matrix, mut mean) = without_sites(model, &matched);
        let Ok(factor) = Cholesky::new(&matrix, count) else {
            return plain(matched);
        };
        factor.solve(&mut mean);
        let terms = model.sites.iter().flat_map(Site::direction);
        let mut bounded: Vec<usize> = terms.map(|(i, _)| i).collect();
        bounded.sort_unstable();
        bounded.dedup();
        let columns: Vec<Vec<f64>> = bounded
            .iter()
            .map(|&i| {
                let mut x = vec![0.0; count];
                x[i] = 1.0;
                factor.solve(&mut x);
                x
            })
            .collect();
        let among: Vec<f64> = columns
            .iter()
            .flat_map(|column| bounded.iter().map(|&i| column[i]))
            .collect();
        let Ok(inner) = Cholesky::new(&among, columns.len()) else {
            return plain(matched);
        };
        Self {
            mean,
            factor,
            sites: model.sites.clone(),
            bounded,
            inner: inner.inverse(),
            columns,
            matched: model.mean.clone(),
        }
    }

    /// Moves a free draw into the bounds: the bounded coefficients are drawn anew from the cut-off law, the others follow
    /// as their regression on them demands.
    pub(super) fn cut_off(&self, beta: &mut [f64], phi: f64, random: &mut Random) {
        let inside = |beta: &[f64]| self.sites.iter().all(|site| site.value(beta) >= site.lower);
        if inside(beta) {
            return;
        }
        let count = self.bounded.len();
        let mut moved = self.start(beta);
        for _ in 0..SWEEPS {
            for a in 0..count {
                // β_a | others: precision inner_aa/φ
                let (i, row) = (self.bounded[a], &self.inner[a * count..(a + 1) * count]);
                let pull: f64 = (0..count)
                    .filter(|&b| b != a)
                    .map(|b| row[b] * (moved[self.bounded[b]] - self.mean[self.bounded[b]]))
                    .sum();
                let center = self.mean[i] - pull / row[a];
                let sd = (phi / row[a]).sqrt();
                let [low, high] = self.range(&moved, i);
                let ends = [(low - center) / sd, (high - center) / sd];
                moved[i] = (center + sd * random.normal_between(ends))
                    .min(high)
                    .max(low);
            }
        }
        let gap: Vec<f64> = self.bounded.iter().map(|&i| moved[i] - beta[i]).collect();
        for a in 0..count {
            let row = &self.inner[a * count..(a + 1) * count];
            let weight: f64 = row.iter().zip(&gap).map(|(p, g)| p * g).sum();
            for (b, c) in beta.iter_mut().zip(&self.columns[a]) {
                *b += weight * c;
            }
        }
        for &i in &self.bounded {
            beta[i] = moved[i];
        }
    }

    /// What the bounds leave to one coefficient beside the others.
    fn range(&self, beta: &[f64], own: usize) -> [f64; 2] {
        let mut range = [f64::NEG_INFINITY, f64::INFINITY];
        for site in &self.sites {
            let factor = site.direction().find(|(i, _)| *i == own);
            let Some((_, factor)) = factor.filter(|(_, f)| *f != 0.0) else {
                continue;
            };
            let rest = site.lower - (site.value(beta) - factor * beta[own]);
            match factor > 0.0 {
                true => range[0] = range[0].max(rest / factor),
                false => range[1] = range[1].min(rest / factor),
            }
        }
        // Bounds that meet, but for rounding.
        [range[0].min(range[1]), range[1]]
    }

    /// A point within the bounds as near to a free draw as the way from the matched mean allows.
    fn start(&self, beta: &[f64]) -> Vec<f64> {
        let mut from = self.matched.clone();
        for site in self.sites.iter().filter(|site| site.terms.is_empty()) {
            let own = &mut from[site.place as usize];
            *own = own.max(site.lower);
        }
        // A mean outside sums' bounds: the first of their terms makes up for it.
        for site in self.sites.iter().filter(|site| !site.terms.is_empty()) {
            let missing = site.lower - site.value(&from);
            if let Some((i, f)) = site.direction().next().filter(|_| missing > 0.0) {
                from[i] += missing / f;
            }
        }
        let mut share: f64 = 1.0;
        for site in &self.sites {
            let (here, there) = (
                site.value(&from) - site.lower,
                site.value(beta) - site.lower,
            );
            if there < 0.0 {
                share = share.min(here.max(0.0) / (here - there));
            }
        }
        let pairs = from.iter().zip(beta);
        pairs.map(|(from, to)| from + share * (to - from)).collect()
    }
}

/// A and A μ of a model, without the sites that its matched normal holds.
fn without_sites(model: &Model, matched: &Cholesky) -> (Vec<f64>, Vec<f64>) {
    let count = model.members.len();
    // A = L Lᵀ − Σ precision a aᵀ, A μ = L Lᵀ mean − Σ shift a.
    let lower = matched.lower();
    let mut matrix = vec![0.0; count * count];
    let mut mean = vec![0.0; count];
    for i in 0..count {
        for k in 0..count {
            let value: f64 = (0..=i.min(k))
                .map(|j| lower[i * count + j] * lower[k * count + j])
                .sum();
            matrix[i * count + k] = value;
            mean[i] += value * model.mean[k];
        }
    }
    for site in &model.sites {
        for (i, f) in site.direction() {
            for (k, g) in site.direction() {
                matrix[i * count + k] -= site.precision * f * g;
            }
            mean[i] -= site.shift * f;
        }
    }
    (matrix, mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean and variance of a cut-off normal by Mills' ratio; 40 000 draws, 5 standard errors (false alarm 6e-7 each).
    #[test]
    fn cut_off_normals_have_their_moments() {
        let mut random = Random::new(3, 0);
        // (bound, mean) with λ = φ(t)/(1 − Φ(t)) from tables.
        for (lowest, mean) in [
            (-1.0, 0.287_599_971),
            (0.0, 0.797_884_561),
            (2.0, 2.373_215_532),
        ] {
            let n = 40_000.0f64;
            let draws: Vec<f64> = (0..40_000).map(|_| random.normal_above(lowest)).collect();
            assert!(draws.iter().all(|&x| x >= lowest));
            let got = draws.iter().sum::<f64>() / n;
            let variance = 1.0 + lowest * mean - mean * mean;
            assert!(
                (got - mean).abs() < 5.0 * (variance / n).sqrt(),
                "{lowest}: {got}"
            );
        }
    }

    /// A site that matches one coefficient cut off at 0; the other follows by its regression. Closed form.
    #[test]
    fn the_others_follow() {
        // A⁻¹ = [[1, 0.6], [0.6, 1]] (φ = 1), mean 0, cut at 0: E β_0 = 0.79788, E β_1 = 0.6 · 0.79788.
        let rho: f64 = 0.6;
        let scale = 1.0 / (1.0 - rho * rho);
        let matrix = [scale + 1.0, -rho * scale, -rho * scale, scale];
        let factor = Cholesky::new(&matrix, 2).unwrap();
        let mut mean = vec![2.0, 0.0];
        factor.solve(&mut mean);
        let model = Model {
            members: vec![0, 1],
            weight: 1.0,
            scale: 1.0,
            mean,
            factor: factor.into_lower(),
            sites: vec![Site {
                place: 0,
                terms: Vec::new(),
                lower: 0.0,
                precision: 1.0,
                shift: 2.0,
            }],
        };
        let law = Law::new(&model);
        assert!(law.mean.iter().all(|m| m.abs() < 1e-12));
        let mut random = Random::new(4, 0);
        let n = 20_000.0f64;
        let mut sums = [0.0; 2];
        for _ in 0..20_000 {
            let mut beta = vec![random.normal(), random.normal()];
            law.factor.solve_upper(&mut beta);
            law.cut_off(&mut beta, 1.0, &mut random);
            assert!(beta[0] >= 0.0);
            sums[0] += beta[0] / n;
            sums[1] += beta[1] / n;
        }
        // Standard errors 0.0043 and 0.0062; five of them.
        assert!(
            (sums[0] - 0.797_885).abs() < 0.022 && (sums[1] - 0.478_731).abs() < 0.031,
            "{sums:?}"
        );
    }

    /// Means of c, a and c a under the density of two normals of variance 1 and correlation `rho` about `free`, on a grid within |a| ≤ c.
    fn moments_on_a_grid(rho: f64, free: [f64; 2]) -> [f64; 3] {
        let scale = 1.0 / (1.0 - rho * rho);
        let density = |c: f64, a: f64| {
            let (x, y) = (c - free[0], a - free[1]);
            (-0.5 * scale * (x * x + y * y - 2.0 * rho * x * y)).exp()
        };
        let (mut mass, mut sums) = (0.0, [0.0; 3]);
        for i in 0..2000 {
            for k in 0..2000 {
                let (c, a) = (0.003 * f64::from(i), 0.006 * (f64::from(k) - 999.5));
                if a.abs() <= c {
                    let p = density(c, a);
                    mass += p;
                    sums[0] += p * c;
                    sums[1] += p * a;
                    sums[2] += p * c * a;
                }
            }
        }
        sums.map(|sum| sum / mass)
    }

    /// Coulomb friction c and asymmetry a of variance 1 and correlation 0.8, |a| ≤ c: mean and extent by numerical integration on a grid;
    /// 20 000 draws that keep the bounds, standard errors below 0.006 (five of them).
    #[test]
    fn draws_keep_bounds_on_sums() {
        let rho: f64 = 0.8;
        let scale = 1.0 / (1.0 - rho * rho);
        let conjugate = [scale, -rho * scale, -rho * scale, scale];
        let free = [0.3, 0.9];
        let truth = moments_on_a_grid(rho, free);
        // Sites need not match for draws to be exact: any do.
        let site = |sign: f64| Site {
            place: 0,
            terms: vec![(0, 1.0), (1, sign)],
            lower: 0.0,
            precision: 0.5,
            shift: 0.7,
        };
        let sites = vec![site(1.0), site(-1.0)];
        // Σ precision a aᵀ = diag(1, 1), Σ shift a = (1.4, 0).
        let matrix = [
            conjugate[0] + 1.0,
            conjugate[1],
            conjugate[2],
            conjugate[3] + 1.0,
        ];
        let factor = Cholesky::new(&matrix, 2).unwrap();
        let mut mean = vec![
            scale * (free[0] - rho * free[1]) + 1.4,
            scale * (free[1] - rho * free[0]),
        ];
        factor.solve(&mut mean);
        let model = Model {
            members: vec![0, 1],
            weight: 1.0,
            scale: 1.0,
            mean,
            factor: factor.into_lower(),
            sites,
        };
        let law = Law::new(&model);
        assert!(
            law.mean
                .iter()
                .zip(free)
                .all(|(m, f)| (m - f).abs() < 1e-12)
        );
        let mut random = Random::new(5, 0);
        let (n, mut sums) = (20_000.0, [0.0; 3]);
        for _ in 0..20_000 {
            let mut beta = vec![random.normal(), random.normal()];
            law.factor.solve_upper(&mut beta);
            beta.iter_mut().zip(&law.mean).for_each(|(b, m)| *b += m);
            law.cut_off(&mut beta, 1.0, &mut random);
            assert!(beta[1].abs() <= beta[0] + 1e-12, "{beta:?}");
            let own = [beta[0], beta[1], beta[0] * beta[1]];
            sums.iter_mut().zip(own).for_each(|(s, x)| *s += x / n);
        }
        for (got, truth) in sums.into_iter().zip(truth) {
            assert!((got - truth).abs() < 0.03, "{sums:?} {truth:?}");
        }
    }
}
