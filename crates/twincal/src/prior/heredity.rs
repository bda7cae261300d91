//! Heredity: which models have a prior probability at all, how much the others share, and how many there are.

use super::Prior;

impl Prior {
    /// `ln Σ p(z)` over the models in which every component has its parent, p(z) the product of the families' urns alone: what
    /// those models share, and so what [`Prior::log_model`] lacks to be a normalised prior. 0 without heredity.
    ///
    /// Components hang below their parents as trees. With x_f counting members of family f, a tree has
    ///
    /// ```text
    /// T_c(x) = 1 + x_f(c) Π_{children e} T_e(x),        Σ p(z) = Σ_m [x^m] Π_roots T · Π_f p_f(m_f)
    /// ```
    ///
    /// and the product over all roots is kept as one number per vector m of members, for every set of families that parents and children
    /// connect.
    pub fn log_admissible(&self) -> f64 {
        let sets = self.connected_families();
        sets.iter().map(|part| self.log_share(part)).sum()
    }

    /// Largest number of values that [`Prior::log_admissible`] keeps, Π (C_f + 1) over a connected set of families.
    pub fn heredity_values(&self) -> f64 {
        let sizes = self.family_sizes();
        let sets = self.connected_families();
        let values = sets.iter().map(|part| {
            let sizes = part.iter().map(|&f| sizes[f] as f64 + 1.0);
            sizes.product::<f64>()
        });
        values.fold(1.0, f64::max)
    }

    /// ln of what the models share that are admissible to one connected set of families.
    fn log_share(&self, part: &[usize]) -> f64 {
        let sizes = self.family_sizes();
        let shape = Shape::new(part.iter().map(|&f| sizes[f]).collect());
        let mut all = shape.one();
        for root in (0..self.components()).filter(|&c| self.parent_of(c).is_none()) {
            if part.contains(&self.family[root]) {
                all = shape.product(&all, &self.tree(root, part, &shape));
            }
        }
        let logs: Vec<f64> = all
            .iter()
            .enumerate()
            .filter(|(_, count)| **count > 0.0)
            .map(|(index, count)| {
                let members = shape.members(index);
                let urns = part.iter().zip(members);
                count.ln()
                    + urns
                        .map(|(&f, m)| self.log_family(f, sizes[f], m))
                        .sum::<f64>()
            })
            .collect();
        let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        top + logs.iter().map(|log| (log - top).exp()).sum::<f64>().ln()
    }

    /// Families that parents and children connect, set by set.
    fn connected_families(&self) -> Vec<Vec<usize>> {
        let mut label: Vec<usize> = (0..self.families()).collect();
        let pairs = self.parent.iter().enumerate();
        let pairs: Vec<(usize, usize)> = pairs
            .filter_map(|(child, parent)| parent.map(|p| (self.family[child], self.family[p])))
            .collect();
        for &(a, b) in &pairs {
            let (keep, drop) = (label[a].min(label[b]), label[a].max(label[b]));
            let labels = label.iter_mut().filter(|own| **own == drop);
            labels.for_each(|own| *own = keep);
        }
        let takes_part = |f: &usize| pairs.iter().any(|(a, b)| a == f || b == f);
        let mut sets = vec![Vec::new(); self.families()];
        (0..self.families())
            .filter(takes_part)
            .for_each(|f| sets[label[f]].push(f));
        sets.retain(|set| !set.is_empty());
        sets
    }

    /// Number of models with a prior probability; `u64::MAX` where it does not fit.
    pub fn admissible_models(&self) -> u64 {
        let children = self.children();
        let roots = (0..self.components()).filter(|&c| self.parent_of(c).is_none());
        roots.fold(1, |all: u64, root| {
            all.saturating_mul(models(&children, root))
        })
    }

    /// Component without which this one is never in.
    pub fn parent_of(&self, component: usize) -> Option<usize> {
        self.parent.get(component).copied().flatten()
    }

    /// Components that are never in without each, C.
    pub fn children(&self) -> Vec<Vec<usize>> {
        let mut children = vec![Vec::new(); self.components()];
        for (c, parent) in self.parent.iter().enumerate() {
            if let Some(parent) = *parent {
                children[parent].push(c);
            }
        }
        children
    }

    /// T of a component.
    fn tree(&self, component: usize, part: &[usize], shape: &Shape) -> Vec<f64> {
        let mut inside = shape.one();
        for (child, parent) in self.parent.iter().enumerate() {
            if *parent == Some(component) {
                inside = shape.product(&inside, &self.tree(child, part, shape));
            }
        }
        let family = part.iter().position(|&f| f == self.family[component]);
        let step = family.map_or(0, |family| shape.strides[family]);
        let mut out = shape.one();
        let shifted = out.iter_mut().skip(step).zip(&inside);
        shifted.for_each(|(out, inside)| *out += inside);
        out
    }
}

fn models(children: &[Vec<usize>], component: usize) -> u64 {
    let below = children[component].iter();
    below
        .fold(1, |all: u64, &child| {
            all.saturating_mul(models(children, child))
        })
        .saturating_add(1)
}

/// Polynomials in several variables of bounded degree, coefficient of x^m at Σ m_f stride_f.
struct Shape {
    sizes: Vec<usize>,
    strides: Vec<usize>,
    len: usize,
}

impl Shape {
    fn new(sizes: Vec<usize>) -> Self {
        let mut len = 1;
        let strides = sizes
            .iter()
            .map(|size| {
                let stride = len;
                len *= size + 1;
                stride
            })
            .collect();
        Self {
            sizes,
            strides,
            len,
        }
    }

    fn one(&self) -> Vec<f64> {
        let mut one = vec![0.0; self.len];
        one[0] = 1.0;
        one
    }

    /// No degree grows beyond its family's size, so that indices add without carries.
    fn product(&self, a: &[f64], b: &[f64]) -> Vec<f64> {
        let terms = |x: &[f64]| -> Vec<(usize, f64)> {
            let terms = x.iter().copied().enumerate();
            terms.filter(|(_, value)| *value != 0.0).collect()
        };
        let (a, b) = (terms(a), terms(b));
        let mut out = vec![0.0; self.len];
        for (i, x) in &a {
            b.iter().for_each(|(j, y)| out[i + j] += x * y);
        }
        out
    }

    fn members(&self, index: usize) -> impl Iterator<Item = usize> + '_ {
        let digits = self.strides.iter().zip(&self.sizes);
        digits.map(move |(stride, size)| index / stride % (size + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Inclusion, Prior};

    /// Ten components of four families, of which three are connected and one is with itself; a chain of three.
    fn prior(inclusion: Inclusion) -> Prior {
        let family = vec![0, 1, 0, 2, 1, 3, 3, 2, 1, 0];
        let mut prior = Prior::single(vec![1.0; 10], family, inclusion, (1.0, 1.0));
        prior.odds = vec![1.0, 0.4, 3.0, 0.7];
        prior.parent = vec![None; 10];
        for (child, parent) in [(1, 0), (3, 1), (4, 0), (6, 5)] {
            prior.parent[child] = Some(parent);
        }
        prior
    }

    fn admissible(prior: &Prior, model: u32) -> bool {
        (0..10).all(|c| {
            let orphan = prior.parent[c].is_some_and(|p| model >> p & 1 == 0);
            model >> c & 1 == 0 || !orphan
        })
    }

    #[test]
    fn what_admissible_models_share_is_their_sum() {
        for inclusion in [Inclusion::ExpectedTerms(3.0), Inclusion::Probability(0.3)] {
            let prior = prior(inclusion);
            let mut sum = 0.0;
            for model in (0..1024).filter(|&model| admissible(&prior, model)) {
                let mut members = [0; 4];
                (0..10)
                    .filter(|c| model >> c & 1 == 1)
                    .for_each(|c| members[prior.family[c]] += 1);
                sum += prior.log_model(&members).exp();
            }
            assert!((prior.log_admissible() - sum.ln()).abs() < 1e-13, "{sum}");
            assert_eq!(prior.heredity_values(), 4.0 * 4.0 * 3.0);
        }
    }

    #[test]
    fn admissible_models_are_counted() {
        let prior = prior(Inclusion::Probability(0.3));
        let count = (0..1024).filter(|&model| admissible(&prior, model)).count();
        assert_eq!(prior.admissible_models(), count as u64);
        let free = Prior::single(vec![1.0; 10], vec![0; 10], prior.inclusion, (1.0, 1.0));
        assert_eq!(
            (free.admissible_models(), free.log_admissible()),
            (1024, 0.0)
        );
    }
}
