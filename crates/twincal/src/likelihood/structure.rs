//! From the user's words to the prior over structures: expected numbers, in total and per family, and what is forced in.

use super::Columns;
use crate::error::{Error, Result};
use crate::prior::{Inclusion, PriorSettings, SETTLED};
use crate::term::Family;

/// Components that are expected where nothing is said.
const DEFAULT_EXPECTED: f64 = 5.0;
/// Prior probability of a component that says what a more usual one says: so small that models which hold both, and share the
/// effect between them in any way that the slabs allow, do not widen what is said of either (with 1/1000 a payload of
/// 1.740 ± 0.002 kg was ± 0.055), and that one number (a last link's density) does not win over the payload's many.
const SECOND_CHOICE: f64 = 1e-12;

/// Factor on the prior probability of what asks for two motions where there is one ([`Family::asks_for_two_motions`]).
const ONE_MOTION: f64 = 0.1;

/// Family of every component, r_f of every family, and the inclusion prior, as [`crate::prior::Prior`] wants them.
///
/// With C free components (those that are not forced in) and C_f of family f
///
/// ```text
/// b_f = C/m0 − 1             m0 components expected in total, families by their size
/// b_f = C_f/m_f − 1          m_f expected of family f, where the user says so
/// b_f = 1/p − 1              unasked, with the probability p of what is more or less usual than the rest ([`Family::usual`]); of one log
///                            a tenth of it for what asks for two motions
/// b_f = 1e12 − 1             second choices, which no motion tells from something more usual (P(z = 1) = 1e-12)
/// ```
/// What a payload's tensor adds to the payload's probability, as its child, is taken off: with and without tensor together have p.
/// Second choices are a family of their own after the others unless the user says how many are expected of theirs, or how likely
/// anything is; forced components are another one, with odds that no data outweigh.
///
/// # Errors
/// [`Error::Setting`] for a probability outside (0, 1), and an expected number that is not between 0 and the number of
/// candidates.
pub(super) fn structure(
    columns: &Columns,
    settings: &PriorSettings,
) -> Result<(Vec<usize>, Vec<f64>, Inclusion)> {
    let count = columns.family.len();
    let forced = |c: usize| columns.forced.get(c).copied().unwrap_or(false);
    let free = (0..count).filter(|&c| !forced(c)).count();
    let given = |index: usize| {
        let mut all = settings.families.iter();
        all.find(|(f, _)| *f == columns.families[index])
    };
    let second_choice = |c: usize| {
        let marked = columns.second_choice.get(c).copied().unwrap_or(false);
        let free_to_say = settings.inclusion.is_none() && given(columns.family[c]).is_none();
        marked && free_to_say && !forced(c)
    };
    let inclusion = if free == 0 && count > 0 {
        Inclusion::Probability(0.5) // of nothing
    } else {
        inclusion(settings.inclusion, free)?
    };
    let with_probability = |p: f64| reference(inclusion, count) * p / (1.0 - p);
    let mut odds = Vec::with_capacity(columns.families.len() + 2);
    for (index, &family) in columns.families.iter().enumerate() {
        let own = (0..count).filter(|&c| columns.family[c] == index && !forced(c));
        let size = own.count() as f64;
        odds.push(match given(index) {
            Some(&(_, expected)) => wanted(inclusion, free, count, family, size, expected)?,
            None => match family.usual() {
                // A prior that the user gives holds for all families alike.
                Some(p) if settings.inclusion.is_none() => {
                    let alone = columns.one_motion && family.asks_for_two_motions();
                    with_probability(if alone { ONE_MOTION * p } else { p })
                }
                _ => reference(inclusion, count) / reference(inclusion, free),
            },
        });
    }
    refuse_absent(columns, settings)?;
    let parts = [Family::Payload, Family::PayloadTensor].map(|own| columns.place_of(own));
    if let ([Some(payload), Some(tensor)], None) = (parts, settings.inclusion) {
        odds[payload] /= 1.0 + odds[tensor] / reference(inclusion, count);
    }
    let mut family = columns.family.clone();
    let rare: Vec<usize> = (0..count).filter(|&c| second_choice(c)).collect();
    if !rare.is_empty() {
        rare.iter().for_each(|&c| family[c] = odds.len());
        odds.push(with_probability(SECOND_CHOICE));
    }
    if free < count {
        (0..count)
            .filter(|&c| forced(c))
            .for_each(|c| family[c] = odds.len());
        odds.push(SETTLED);
    }
    Ok((family, odds, inclusion))
}

/// An error for an expected number of a family without a candidate.
fn refuse_absent(columns: &Columns, settings: &PriorSettings) -> Result<()> {
    for (family, expected) in &settings.families {
        if !columns.families.contains(family) {
            return Err(Error::Setting {
                key: format!("prior.families.{}", family.word()),
                problem: format!(
                    "{expected} components expected of a family that has no candidate here"
                ),
                remedy: "leave the key out, or ask for the family in [library]".into(),
            });
        }
    }
    Ok(())
}

/// b of a family with r = 1 among `count` components; 1 where components are independent, so that only ratios matter.
fn reference(inclusion: Inclusion, count: usize) -> f64 {
    match inclusion {
        Inclusion::ExpectedTerms(m) => count as f64 / m - 1.0,
        Inclusion::Probability(_) => 1.0,
    }
}

/// r_f with which a family of `size` free components has the expected number that the user asks for.
fn wanted(
    inclusion: Inclusion,
    free: usize,
    count: usize,
    family: Family,
    size: f64,
    expected: f64,
) -> Result<f64> {
    if size == 0.0 && free < count {
        return Ok(1.0); // all of them are forced in
    }
    if !(expected > 0.0 && expected < size) {
        return Err(Error::Setting {
            key: format!("prior.families.{}", family.word()),
            problem: format!("{expected} components expected of {size} candidates"),
            remedy: format!("give a number above 0 and below {size}, or leave the key out"),
        });
    }
    let own = size / expected - 1.0;
    Ok(match inclusion {
        Inclusion::ExpectedTerms(_) => reference(inclusion, count) / own,
        Inclusion::Probability(p) => (1.0 - p) / p / own,
    })
}

/// The inclusion prior in force over the free components: as given, or 5 expected components (C/2 when there are fewer than 10).
///
/// # Errors
/// [`Error::Setting`] for a probability outside (0, 1) or an expected number that is not below C.
fn inclusion(given: Option<Inclusion>, columns: usize) -> Result<Inclusion> {
    match given {
        None => Ok(Inclusion::ExpectedTerms(
            (columns as f64 / 2.0).min(DEFAULT_EXPECTED),
        )),
        Some(Inclusion::Probability(p)) if p > 0.0 && p < 1.0 => Ok(Inclusion::Probability(p)),
        Some(Inclusion::Probability(p)) => Err(Error::Setting {
            key: "prior.inclusion.probability".into(),
            problem: format!("{p} is not between 0 and 1"),
            remedy: "give a probability above 0 and below 1, e.g. 0.2".into(),
        }),
        Some(Inclusion::ExpectedTerms(m)) if m > 0.0 && m < columns as f64 => {
            Ok(Inclusion::ExpectedTerms(m))
        }
        Some(Inclusion::ExpectedTerms(m)) => Err(Error::Setting {
            key: "prior.inclusion.expected_terms".into(),
            problem: format!("{m} terms expected of {columns} candidates"),
            remedy: format!("give a number above 0 and below {columns}, or leave it out"),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prior::Prior;
    use crate::signal::Auto;

    /// Nine components: four of `User`, three of `Stribeck`, two of `Viscous`.
    fn columns(forced: &[usize]) -> Columns {
        Columns {
            names: (0..9).map(|k| format!("x{k}")).collect(),
            component: (0..9).collect(),
            family: vec![0, 1, 0, 2, 1, 0, 0, 2, 1],
            families: vec![Family::User, Family::Stribeck, Family::Viscous],
            prior_sd: vec![None; 9],
            lower: vec![f64::NEG_INFINITY; 9],
            forced: (0..9).map(|c| forced.contains(&c)).collect(),
            parent: Vec::new(),
            second_choice: Vec::new(),
            one_motion: false,
            halves: Vec::new(),
        }
    }

    fn settings(inclusion: Option<Inclusion>, families: &[(Family, f64)]) -> PriorSettings {
        PriorSettings {
            scaled_variance: Auto::Value(1.0),
            inclusion,
            noise: None,
            families: families.to_vec(),
            forced: Vec::new(),
            heredity: None,
        }
    }

    /// Expected number of components in each of the three families, over all 2^9 models.
    fn expected(columns: &Columns, settings: &PriorSettings) -> [f64; 3] {
        let (family, odds, inclusion) = structure(columns, settings).unwrap();
        let mut prior = Prior::single(vec![1.0; 9], family, inclusion, (1.0, 1.0));
        prior.odds = odds;
        let (mut total, mut sum) = (0.0, [0.0; 3]);
        for model in 0u32..512 {
            let mut members = vec![0; prior.families()];
            let inside: Vec<usize> = (0..9).filter(|c| model >> c & 1 == 1).collect();
            inside.iter().for_each(|&c| members[prior.family[c]] += 1);
            let p = prior.log_model(&members).exp();
            total += p;
            inside.iter().for_each(|&c| sum[columns.family[c]] += p);
        }
        assert!((total - 1.0).abs() < 1e-12, "{total}");
        sum
    }

    #[track_caller]
    fn near(a: [f64; 3], b: [f64; 3]) {
        let off = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-12, "{a:?} {b:?}");
    }

    #[test]
    fn families_have_the_expected_numbers_that_the_user_gives() {
        let free = columns(&[]);
        // Unasked: m0 = 4.5 of 9, by size; viscous friction is as likely there as not.
        near(expected(&free, &settings(None, &[])), [2.0, 1.5, 1.0]);
        let mine = [(Family::Stribeck, 0.3), (Family::Viscous, 1.9)];
        near(expected(&free, &settings(None, &mine)), [2.0, 0.3, 1.9]);
        let terms = Some(Inclusion::ExpectedTerms(1.8));
        near(expected(&free, &settings(terms, &[])), [0.8, 0.6, 0.4]);
        near(expected(&free, &settings(terms, &mine)), [0.8, 0.3, 1.9]);
        let half = Some(Inclusion::Probability(0.25));
        near(expected(&free, &settings(half, &mine)), [1.0, 0.3, 1.9]);
    }

    /// One torque offset in thirty joints, whatever else is expected; as many as the rest where the user says how many terms.
    #[test]
    fn torque_offsets_are_rarer_than_the_rest() {
        let mut free = columns(&[]);
        free.families[1] = Family::Offset;
        near(expected(&free, &settings(None, &[])), [2.0, 0.1, 1.0]);
        let terms = Some(Inclusion::ExpectedTerms(1.8));
        near(expected(&free, &settings(terms, &[])), [0.8, 0.6, 0.4]);
    }

    /// A spring in thirty joints; with one log one in three hundred.
    #[test]
    fn one_motion_makes_springs_rarer() {
        let mut free = columns(&[]);
        free.families[1] = Family::Spring;
        near(expected(&free, &settings(None, &[])), [2.0, 0.1, 1.0]);
        free.one_motion = true;
        near(expected(&free, &settings(None, &[])), [2.0, 0.01, 1.0]);
        free.families[1] = Family::Offset;
        near(expected(&free, &settings(None, &[])), [2.0, 0.1, 1.0]);
    }

    #[test]
    fn forced_components_are_in_and_count_for_nobody() {
        let some = columns(&[0, 3]);
        // Seven are free: m0 = 3.5 of 7 by size; one viscous is forced, the other at even odds.
        near(expected(&some, &settings(None, &[])), [2.5, 1.5, 1.5]);
        let terms = Some(Inclusion::ExpectedTerms(1.4));
        near(expected(&some, &settings(terms, &[])), [1.6, 0.6, 1.2]);
        let mine = [(Family::Stribeck, 0.3)];
        near(expected(&some, &settings(None, &mine)), [2.5, 0.3, 1.5]);
        let all = columns(&[0, 1, 2, 3, 4, 5, 6, 7, 8]);
        near(expected(&all, &settings(None, &[])), [4.0, 3.0, 2.0]);
    }

    #[test]
    fn second_choices_are_rare_unless_the_user_speaks_of_them() {
        let mut some = columns(&[]);
        some.second_choice = (0..9).map(|c| c == 1 || c == 4).collect();
        // The third of their family is expected as the others are, m0 = 4.5 of 9.
        near(
            expected(&some, &settings(None, &[])),
            [2.0, 0.500_000_000_002, 1.0],
        );
        let mine = [(Family::Stribeck, 0.3)];
        near(expected(&some, &settings(None, &mine)), [2.0, 0.3, 1.0]);
        let half = Some(Inclusion::Probability(0.25));
        near(expected(&some, &settings(half, &[])), [1.0, 0.75, 0.5]);
        some.forced[1] = true;
        let one = expected(&some, &settings(None, &[]))[1];
        assert!((one - 1.500_000_000_001).abs() < 1e-12, "{one}");
    }

    /// Out, in without its tensor, in with it: 2/3, and of the other third 1 in 1000 without.
    #[test]
    fn a_payload_is_as_probable_as_it_is_whatever_its_tensor_is() {
        let mut some = columns(&[]);
        some.families = vec![Family::User, Family::Payload, Family::PayloadTensor];
        some.family = vec![0, 0, 0, 0, 0, 0, 0, 1, 2];
        let share = |settings: &PriorSettings| {
            let (family, odds, inclusion) = structure(&some, settings).unwrap();
            let mut prior = Prior::single(vec![1.0; 9], family, inclusion, (1.0, 1.0));
            prior.odds = odds;
            prior.parent = vec![None; 9];
            prior.parent[8] = Some(7);
            let p = |payload: usize, tensor: usize| {
                let all = (0..=7).map(|m| {
                    let ways = (1..=m).fold(1.0, |n, k| n * (8 - k) as f64 / k as f64);
                    ways * prior.log_model(&[m, payload, tensor]).exp()
                });
                all.sum::<f64>() / prior.log_admissible().exp()
            };
            [p(0, 0), p(1, 0), p(1, 1)]
        };
        near(share(&settings(None, &[])), [2.0 / 3.0, 0.001 / 3.0, 0.333]);
        let mine = [(Family::Payload, 0.1), (Family::PayloadTensor, 0.5)];
        near(share(&settings(None, &mine)), [0.9, 0.05, 0.05]);
    }

    #[test]
    fn impossible_numbers_name_their_key() {
        for (family, number) in [
            (Family::Stribeck, 3.0),
            (Family::Stribeck, 0.0),
            (Family::Payload, 1.0),
        ] {
            let error = structure(&columns(&[]), &settings(None, &[(family, number)]));
            let text = error.unwrap_err().to_string();
            assert!(text.contains(family.word()), "{text}");
        }
    }
}
