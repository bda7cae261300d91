//! Which components say the same: in these logs, or for every motion of this robot.

use super::calibration::{Calibration, Group};
use super::status::Alike;
use crate::linear_algebra::Cholesky;
use crate::posterior::{Posterior, Problem};
use crate::term::{Library, levels};

/// Columns whose cosine over the rows is above this are hard to tell apart.
const ALIKE: f64 = 0.95;
/// Components whose inclusions are correlated below this stand for each other.
const EXCLUSIVE: f64 = -0.5;
/// Probability below which nobody asks which member it was.
const WORTH_TELLING: f64 = 0.2;
/// Probabilities between which a member keeps the question open which one it is.
const UNLIKELY: f64 = 0.2;
const SURE: f64 = 0.98;
/// Nats by which another component may explain the same torque worse and still stand in for it.
const WORSE: f64 = 1.0;
/// Nats by which a component must explain torque better than nothing before others can stand in for it.
const CLEAR: f64 = 10.0;
/// Standard deviations that a coefficient may be below its bound and still be a matter of noise.
const BELOW: f64 = 2.0;
/// Names that a sentence holds at most.
const TOLD: usize = 6;

/// Sets of components that cannot be told apart, with the probability that at least one is in; what the data leave open
/// first.
///
/// Two components belong together
/// - if they are single columns that are alike in the data (cosine above 0.95) and both have a PIP between 0.02 and 0.98;
/// - if their inclusions exclude each other (correlation below −0.5 over the models);
/// - if one is in (PIP ≥ 0.2) and both span the same torques in every motion: a payload, and all levels of the last link;
/// - if the torque that one explains (PIP ≥ 0.2) another one would explain as well, its prior included:
///
/// ```text
/// min_b ½|Φ_A β_A − Φ_B b|²/φ + ½ bᵀV_B⁻¹b/φ  is at most 1 nat above the same for A itself
/// ```
/// where B is one component or levels of one link (density, first moments, tensor), and A explains at least 10 nats. This holds also where
/// the prior is sure which one it is; the set is `settled` then.
///
/// No component stands for another where a coefficient of its b would have to be below its bound by more than two standard
/// deviations: a motor's inertia, which is never negative, is no name for a tensor that is. Both may still be in one set by way of a third.
pub(in crate::calibrate) fn groups(
    problem: &Problem,
    posterior: &Posterior,
    library: &Library,
) -> Vec<Group> {
    let all = Candidates::new(problem, posterior, library);
    let count = all.columns.len();
    let mut label: Vec<usize> = (0..count).collect();
    // Whether every link of a set holds for all motions; by label.
    let mut structural = vec![true; count];
    let mut join = |a: usize, b: usize, every_motion: bool| {
        let (from, to) = (label[a].max(label[b]), label[a].min(label[b]));
        structural[to] &= structural[from] && every_motion;
        let labels = label.iter_mut().filter(|l| **l == from);
        labels.for_each(|l| *l = to);
    };
    for a in 0..count {
        for b in 0..a {
            let unsure = all.unsure(a) && all.unsure(b);
            // Where models hold either, both have coefficients that they can have.
            let alike = || all.alike(a, b) && !all.forbid(a, b);
            if unsure && (alike() || all.correlation(a, b) < EXCLUSIVE) {
                join(a, b, all.is_alias(a, b) || all.is_alias(b, a));
            }
        }
        if all.pip[a] >= WORTH_TELLING {
            for other in all.others(a) {
                let alike = all.same_span(a, &other) || all.stands_in(a, &other);
                if alike && !all.is_forbidden(a, &other) {
                    other.iter().for_each(|&b| join(a, b, all.is_alias(a, b)));
                }
            }
        }
    }
    // The parts of a payload are one story.
    for inner in (1..count).filter(|&k| all.is_inner(k)) {
        join(inner, inner - 1, true);
    }
    let mut groups: Vec<Group> = (0..count)
        .filter_map(|first| {
            let members: Vec<usize> = (first..count).filter(|&k| label[k] == first).collect();
            if members
                .iter()
                .all(|&k| all.component[k] == all.component[members[0]])
            {
                return None;
            }
            all.group(&members, structural[first])
        })
        .collect();
    groups.sort_by_key(|group| group.settled);
    groups
}

/// Per component of the library, if it is likelier in than not: those of [`ComponentSummary::alias_of`] that can have its torque
/// without a coefficient below its bound.
///
/// [`ComponentSummary::alias_of`]: super::calibration::ComponentSummary::alias_of
pub(in crate::calibrate) fn told_as(
    problem: &Problem,
    posterior: &Posterior,
    library: &Library,
) -> Vec<Option<Vec<String>>> {
    let all = Candidates::new(problem, posterior, library);
    let mut told = vec![None; library.components().len()];
    let outer = (0..all.columns.len()).filter(|&k| !all.is_inner(k));
    for own in outer.filter(|&k| all.pip[k] >= 0.5) {
        let component = &library.components()[all.component[own]];
        let may = |name: &&String| {
            let mut others = 0..all.columns.len();
            let other = others.find(|&k| all.name(k) == *name);
            other.is_none_or(|other| !all.is_forbidden(own, &[other]))
        };
        let names = component.alias_of.iter().filter(may).cloned();
        told[all.component[own]] = Some(names.collect());
    }
    told
}

/// The components that have columns, numbered as in the problem's prior.
struct Candidates<'a> {
    problem: &'a Problem,
    posterior: &'a Posterior,
    library: &'a Library,
    columns: Vec<Vec<usize>>,
    /// Index in the library.
    component: Vec<usize>,
    pip: Vec<f64>,
    /// Per listed model, which components it holds.
    holds: Vec<Vec<bool>>,
}

impl<'a> Candidates<'a> {
    fn new(problem: &'a Problem, posterior: &'a Posterior, library: &'a Library) -> Self {
        let columns = problem.prior.columns();
        let holds = |members: &[u32]| {
            let mut holds = vec![false; columns.len()];
            for &member in members {
                holds[problem.prior.component[member as usize]] = true;
            }
            holds
        };
        Self {
            holds: posterior.models.iter().map(|m| holds(&m.members)).collect(),
            component: (columns.iter())
                .map(|own| library.terms()[library.columns()[own[0]]].component)
                .collect(),
            pip: columns
                .iter()
                .map(|own| posterior.inclusion[own[0]])
                .collect(),
            columns,
            problem,
            posterior,
            library,
        }
    }

    fn name(&self, k: usize) -> &str {
        &self.library.components()[self.component[k]].name
    }

    /// A payload's tensor: in or out by itself, but part of the payload.
    fn is_inner(&self, k: usize) -> bool {
        k > 0 && self.component[k] == self.component[k - 1]
    }

    fn unsure(&self, k: usize) -> bool {
        (0.02..SURE).contains(&self.pip[k])
    }

    /// No motion tells what `a` does from what `b`, maybe with others, can do.
    fn is_alias(&self, a: usize, b: usize) -> bool {
        let names = &self.library.components()[self.component[a]].alias_of;
        names.iter().any(|name| name == self.name(b))
    }

    /// Every motion gives both sides the same torques: payload, and all levels of the last link.
    fn same_span(&self, own: usize, others: &[usize]) -> bool {
        let both = |&b: &usize| self.is_alias(own, b) && self.is_alias(b, own);
        others.iter().all(both)
    }

    /// Posterior mass of the models that pass a test on which components they hold.
    fn share(&self, test: &dyn Fn(&[bool]) -> bool) -> f64 {
        let models = self.posterior.models.iter().zip(&self.holds);
        models.filter(|(_, h)| test(h)).map(|(m, _)| m.weight).sum()
    }

    /// Correlation of two inclusions over the models.
    fn correlation(&self, a: usize, b: usize) -> f64 {
        let both = self.share(&|holds| holds[a] && holds[b]);
        let variance = |k: usize| self.pip[k] * (1.0 - self.pip[k]);
        (both - self.pip[a] * self.pip[b]) / (variance(a) * variance(b)).sqrt()
    }

    /// Two single columns that point the same way over the rows.
    fn alike(&self, a: usize, b: usize) -> bool {
        let (&[a], &[b]) = (&self.columns[a][..], &self.columns[b][..]) else {
            return false;
        };
        let at = |i: usize, j: usize| self.gram(i, j);
        (at(a, b) / (at(a, a) * at(b, b)).sqrt()).abs() > ALIKE
    }

    fn gram(&self, i: usize, j: usize) -> f64 {
        self.problem.gram[i * self.problem.names.len() + j]
    }

    /// What could stand in for a component: any other, or levels of one link.
    fn others(&self, own: usize) -> Vec<Vec<usize>> {
        let same = |k: usize| self.component[k] == self.component[own];
        let all = (0..self.columns.len()).filter(|&k| !same(k));
        let mut others: Vec<Vec<usize>> = all.map(|k| vec![k]).collect();
        for levels in levels(self.library.components()) {
            let place = |c: &usize| self.component.iter().position(|own| own == c);
            let places: Option<Vec<usize>> = levels.iter().map(place).collect();
            others.extend(places.filter(|places| !places.contains(&own)));
        }
        others
    }

    /// Whether others would explain what a component explains.
    fn stands_in(&self, own: usize, others: &[usize]) -> bool {
        let columns = self.columns_of(others);
        let loss = |columns: &[usize]| Some(self.instead(own, columns)?.loss);
        match (loss(&self.columns[own]), loss(&columns), loss(&[])) {
            (Some(itself), Some(other), Some(nothing)) => {
                other <= itself + WORSE && nothing > itself + CLEAR
            }
            _ => false,
        }
    }

    /// Whether others would need a coefficient that they cannot have.
    fn is_forbidden(&self, own: usize, others: &[usize]) -> bool {
        let columns = self.columns_of(others);
        let bound = |k: usize| self.problem.prior.lower[k];
        if columns.iter().all(|&k| bound(k) == f64::NEG_INFINITY) {
            return false;
        }
        let Some(Instead { mean, sd, .. }) = self.instead(own, &columns) else {
            return false;
        };
        let mut all = columns.iter().zip(mean.iter().zip(&sd));
        all.any(|(&k, (mean, sd))| *mean < bound(k) - BELOW * sd)
    }

    /// The same for either of two in the place of the other.
    fn forbid(&self, a: usize, b: usize) -> bool {
        self.is_forbidden(a, &[b]) || self.is_forbidden(b, &[a])
    }

    fn columns_of(&self, components: &[usize]) -> Vec<usize> {
        let columns = components.iter().flat_map(|&k| &self.columns[k]);
        columns.copied().collect()
    }

    /// What `columns`, under their prior, make of the torque Φ_own β.
    fn instead(&self, own: usize, columns: &[usize]) -> Option<Instead> {
        let own = &self.columns[own];
        // Given that it is in, about.
        let inside = |&k: &usize| self.posterior.mean[k] / self.posterior.inclusion[k];
        let beta: Vec<f64> = own.iter().map(inside).collect();
        let product = |k: usize| -> f64 {
            let pairs = own.iter().zip(&beta);
            pairs.map(|(&i, b)| self.gram(k, i) * b).sum()
        };
        let energy: f64 = own.iter().zip(&beta).map(|(&i, b)| b * product(i)).sum();
        let mut normal = Vec::with_capacity(columns.len() * columns.len());
        for &i in columns {
            normal.extend(columns.iter().map(|&j| self.gram(i, j)));
        }
        for (place, &k) in columns.iter().enumerate() {
            normal[place * columns.len() + place] += 1.0 / self.problem.prior.slab[k];
        }
        let noise = self.posterior.noise;
        let factor = Cholesky::new(&normal, columns.len()).ok()?;
        let mut mean: Vec<f64> = columns.iter().map(|&k| product(k)).collect();
        factor.solve_lower(&mut mean);
        let explained: f64 = mean.iter().map(|x| x * x).sum();
        factor.solve_upper(&mut mean);
        // Beside the noise what is open of β, at most: as if all of it went the same way.
        let mut open = vec![0.0; columns.len()];
        for &i in own {
            let mut share: Vec<f64> = columns.iter().map(|&k| self.gram(k, i)).collect();
            factor.solve(&mut share);
            let spread = self.spread(i);
            let shares = open.iter_mut().zip(&share);
            shares.for_each(|(open, share)| *open += spread * share.abs());
        }
        let variances = factor.inverse_diagonal();
        let pairs = variances.iter().zip(&open);
        Some(Instead {
            loss: 0.5 * (energy - explained).max(0.0) / noise,
            mean,
            sd: pairs
                .map(|(v, open)| (noise * v + open * open).sqrt())
                .collect(),
        })
    }

    /// Standard deviation of a column's coefficient given that it is in.
    fn spread(&self, column: usize) -> f64 {
        let (mean, sd) = (self.posterior.mean[column], self.posterior.sd[column]);
        let inside = self.posterior.inclusion[column];
        let square = (sd * sd + mean * mean) / inside - (mean / inside).powi(2);
        square.max(0.0).sqrt()
    }

    fn group(&self, members: &[usize], every_motion: bool) -> Option<Group> {
        let pip = self.share(&|holds: &[bool]| members.iter().any(|&k| holds[k]));
        let most = members.iter().fold(0.0_f64, |m, &k| m.max(self.pip[k]));
        // The listed models may miss what the members' own probabilities have.
        let pip = pip.max(most).min(1.0);
        if pip < WORTH_TELLING {
            return None;
        }
        // One story has it all, and no other is likely.
        let mut stories = members.iter().filter(|&&k| !self.is_inner(k));
        let settled = most >= SURE && stories.all(|&k| !(UNLIKELY..SURE).contains(&self.pip[k]));
        let alike = if every_motion {
            Alike::EveryMotion
        } else {
            Alike::TheseLogs
        };
        let mut order = members.to_vec();
        order.sort_by(|&a, &b| self.pip[b].total_cmp(&self.pip[a]));
        let mut told: Vec<&str> = Vec::new();
        for name in order.iter().map(|&k| self.name(k)) {
            if !told.contains(&name) {
                told.push(name);
            }
        }
        // By way of others, where not each has the torque of each.
        let aliases = |k: usize| &self.library.components()[self.component[k]].alias_of;
        let pairs = members.iter().enumerate();
        let mut pairs = pairs.flat_map(|(i, &a)| members[..i].iter().map(move |&b| (a, b)));
        let whole = told.len() < 3
            || every_motion
                && pairs.all(|(a, b)| {
                    let [left, right] = [a, b].map(|k| self.name(k));
                    let alias = aliases(a).iter().any(|n| n == right)
                        || aliases(b).iter().any(|n| n == left);
                    left == right || alias && !self.forbid(a, b)
                });
        let words = words(&told, pip, (alike, whole), settled);
        let names = told.into_iter().map(str::to_owned).collect();
        Some(Group {
            members: names,
            pip,
            alike,
            settled,
            words,
        })
    }
}

impl Group {
    /// A set whose members take each other's place in these logs.
    pub(in crate::calibrate) fn in_these_logs(members: Vec<String>, pip: f64) -> Self {
        let names: Vec<&str> = members.iter().map(String::as_str).collect();
        Self {
            words: words(&names, pip, (Alike::TheseLogs, true), false),
            members,
            pip,
            alike: Alike::TheseLogs,
            settled: false,
        }
    }
}

/// What columns make of another's torque.
struct Instead {
    /// Nats that are lost.
    loss: f64,
    /// Their coefficients.
    mean: Vec<f64>,
    sd: Vec<f64>,
}

impl Calibration {
    /// Groups of which the prior alone prefers a member, in a sentence for those alike in every motion and one for those alike in these logs:
    /// "not distinguishable in every motion, the prior alone prefers the first: payload or tool.tensor; …".
    #[must_use]
    pub fn told_apart_by_the_prior(&self) -> Vec<String> {
        let kinds = [
            (Alike::EveryMotion, "in every motion"),
            (Alike::TheseLogs, "in these logs"),
        ];
        let in_a_group =
            |name: &String| self.groups.iter().any(|group| group.members.contains(name));
        let sentence = |(alike, place): (Alike, &str)| {
            let own = self.groups.iter().filter(|group| group.settled);
            let own = own.filter(|group| group.alike == alike);
            let mut told: Vec<String> = own
                .map(|group| named(&group.members).join(" or "))
                .collect();
            // What several others have together only.
            let spanned = self.components.iter().filter(|own| {
                alike == Alike::EveryMotion
                    && own.is_in()
                    && !own.names_beside().is_empty()
                    && !in_a_group(&own.name)
            });
            told.extend(
                spanned.map(|own| format!("{} or {}", own.name, own.names_beside().join(" + "))),
            );
            (!told.is_empty()).then(|| {
                format!(
                    "not distinguishable {place}, the prior alone prefers the first: {}",
                    told.join("; ")
                )
            })
        };
        kinds.into_iter().filter_map(sentence).collect()
    }
}

/// Names of a group's members; of a spring beside the offset of its joint it is the preload that is alike.
fn named<S: AsRef<str>>(members: &[S]) -> Vec<String> {
    let offset = |joint: &str| {
        let own = format!("{joint}.offset");
        members.iter().any(|member| member.as_ref() == own)
    };
    let name = |member: &S| match member.as_ref().strip_suffix(".spring") {
        Some(joint) if offset(joint) => format!("{} (its preload)", member.as_ref()),
        _ => member.as_ref().to_owned(),
    };
    members.iter().map(name).collect()
}

/// "payload and link_6.tensor are one direction here: …", the likeliest name first.
fn words(names: &[&str], pip: f64, (alike, whole): (Alike, bool), settled: bool) -> String {
    let told = named(names);
    let list = match &told[..] {
        [] => String::new(),
        _ if told.len() > TOLD => {
            format!("{} and {} more", told[..TOLD].join(", "), told.len() - TOLD)
        }
        [others @ .., last] => format!("{} and {last}", others.join(", ")),
    };
    let same = match (alike, whole) {
        (Alike::EveryMotion, true) => "can explain the same torque in every motion of this robot",
        (Alike::EveryMotion, false) => {
            "are equivalent in every motion of this robot, directly or by way of others"
        }
        (Alike::TheseLogs, true) => "are equivalent in these logs",
        (Alike::TheseLogs, false) => "are equivalent in these logs, directly or by way of others",
    };
    let pip = if pip > 0.999 {
        "> 0.999".to_owned()
    } else {
        format!("{pip:.3}")
    };
    let which = match (settled, alike) {
        (true, _) => format!("the prior alone prefers `{}`", names[0]),
        (false, Alike::EveryMotion) => "which one is open".to_owned(),
        (false, Alike::TheseLogs) => "another motion would tell more".to_owned(),
    };
    format!("{list} {same}: at least one of them is in with probability {pip}; {which}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_in_words() {
        let names = ["payload", "fore.tensor"];
        assert_eq!(
            words(&names, 0.9999, (Alike::EveryMotion, true), true),
            "payload and fore.tensor can explain the same torque in every motion of this robot: at least one of them is in with \
             probability > 0.999; the prior alone prefers `payload`"
        );
        let springs = ["a.spring", "a.offset"];
        assert!(
            words(&springs, 0.98, (Alike::EveryMotion, true), false)
                .starts_with("a.spring (its preload) and a.offset can explain")
        );
        let by_way = words(&names, 0.98, (Alike::EveryMotion, false), false);
        assert!(
            by_way.contains("directly or by way of others: at least one"),
            "{by_way}"
        );
        let open = words(&names, 0.98, (Alike::TheseLogs, true), false);
        assert!(
            open.ends_with("0.980; another motion would tell more"),
            "{open}"
        );
    }
}
