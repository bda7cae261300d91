//! From the user's words to heredity: which component is in only where another is.

use crate::error::{Error, Result};
use crate::prior::HEREDITY;
use crate::term::Family;

/// A component as heredity sees it.
pub(in crate::calibrate) struct Named<'a> {
    pub(in crate::calibrate) name: &'a str,
    pub(in crate::calibrate) family: Family,
}

impl Named<'_> {
    /// The name of what another family has on the same joint or link: `elbow.stribeck` → `elbow.coulomb`.
    fn of_family(&self, word: &str) -> Option<String> {
        let own = self.name.strip_suffix(self.family.word())?;
        Some(format!("{own}{word}"))
    }
}

/// Parent of each component; a component of two parts stands twice, one after the other. A pair of families binds the components of one joint or link to each other where both are candidates;
/// what is said of a component by name goes before what is said of its family.
///
/// # Errors
/// [`Error::Setting`] for a name that is neither a candidate's nor a family's, for a given pair of families that never share a joint
/// or link, and for a component that would be its own ancestor.
pub(in crate::calibrate) fn parents(
    components: &[Named<'_>],
    given: Option<&[(String, String)]>,
) -> Result<Vec<Option<usize>>> {
    let pairs = match given {
        Some(pairs) => pairs.to_vec(),
        None => HEREDITY.map(|(a, b)| (a.into(), b.into())).to_vec(),
    };
    let place = |name: &str| components.iter().position(|c| c.name == name);
    let is_family = |word: &str| {
        let mut known = Family::UNNAMED.into_iter().chain(Family::NAMED);
        place(word).is_none() && known.any(|family| family.word() == word)
    };
    if let Some((child, above)) =
        (pairs.iter()).find(|(child, _)| child == Family::PayloadTensor.word())
    {
        return Err(Error::Setting {
            key: format!("prior.heredity.{child}"),
            problem: format!("a payload's tensor needs the payload, not `{above}` as well"),
            remedy: "leave this pair out".into(),
        });
    }
    let mut parent = vec![None; components.len()];
    for (child, above) in pairs.iter().filter(|(child, _)| is_family(child)) {
        let named = place(above);
        if named.is_none() && !is_family(above) {
            return Err(unknown(child, above));
        }
        let own = components.iter().enumerate();
        let own: Vec<_> = own.filter(|(_, c)| c.family.word() == child).collect();
        let mut bound = 0;
        for &(c, component) in &own {
            let same = || component.of_family(above).and_then(|name| place(&name));
            parent[c] = named.or_else(same);
            bound += usize::from(parent[c].is_some());
        }
        let is_candidate = || components.iter().any(|c| c.family.word() == above);
        if given.is_some() && bound == 0 && !own.is_empty() && is_candidate() {
            return Err(Error::Setting {
                key: format!("prior.heredity.{child}"),
                problem: format!("no {child} stands on a joint or link that has a {above}"),
                remedy: "bind components by name, such as \"elbow.stribeck\" = \"payload\"".into(),
            });
        }
    }
    for (child, above) in pairs.iter().filter(|(child, _)| !is_family(child)) {
        let own = place(child).ok_or_else(|| unknown(child, child))?;
        parent[own] = Some(place(above).ok_or_else(|| unknown(child, above))?);
    }
    // What is in or out by itself within a component needs the rest of it.
    for (c, pair) in components.windows(2).enumerate() {
        if pair[0].name == pair[1].name {
            parent[c + 1] = Some(c);
        }
    }
    refuse_circles(components, &parent)?;
    Ok(parent)
}

/// An error for a component that is its own ancestor.
fn refuse_circles(components: &[Named<'_>], parent: &[Option<usize>]) -> Result<()> {
    for (c, component) in components.iter().enumerate() {
        let up = std::iter::successors(parent[c], |&p| parent[p]).take(components.len());
        if up.into_iter().any(|p| p == c) {
            return Err(Error::Setting {
                key: "prior.heredity".into(),
                problem: format!("`{}` needs itself to be in", component.name),
                remedy: "leave out one of the pairs that lead back to it".into(),
            });
        }
    }
    Ok(())
}

/// What is forced in brings what it needs.
pub(in crate::calibrate) fn force_parents(parent: &[Option<usize>], forced: &mut [bool]) {
    for child in 0..forced.len() {
        let of = |c: usize| parent.get(c).copied().flatten();
        let mut above = of(child).filter(|_| forced[child]);
        while let Some(own) = above.filter(|&p| !forced[p]) {
            forced[own] = true;
            above = of(own);
        }
    }
}

fn unknown(child: &str, name: &str) -> Error {
    Error::Setting {
        key: format!("prior.heredity.{child}"),
        problem: format!("no candidate `{name}` that has torque in these logs"),
        remedy: "pair components by name, as `twincal fit` prints them (\"elbow.stribeck\" = \"elbow.coulomb\"), or families (stribeck = \"coulomb\")"
            .into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [(&str, Family); 7] = [
        ("elbow.stribeck", Family::Stribeck),
        ("elbow.coulomb", Family::Coulomb),
        ("wrist.asymmetry", Family::Asymmetry),
        ("wrist.coulomb", Family::Coulomb),
        ("hip.stribeck", Family::Stribeck),
        ("sin(2*q1)", Family::User),
        ("payload", Family::Payload),
    ];

    fn heredity(given: Option<&[(&str, &str)]>) -> Result<Vec<Option<usize>>> {
        let components = ALL.map(|(name, family)| Named { name, family });
        let given = given.map(|pairs| {
            let own = pairs.iter().map(|&(a, b)| (a.into(), b.into()));
            own.collect::<Vec<(String, String)>>()
        });
        parents(&components, given.as_deref())
    }

    /// Unless anything else is said, on one joint and on a pair of joints.
    #[test]
    fn what_is_a_change_of_another_needs_it() {
        let names = [
            ("elbow.viscous", Family::Viscous, None),
            (
                "elbow.quadratic_friction",
                Family::QuadraticFriction,
                Some(0),
            ),
            ("wrist.quadratic_friction", Family::QuadraticFriction, None),
            (
                "elbow+wrist.coupled_inertia",
                Family::CoupledInertia,
                Some(5),
            ),
            ("elbow-wrist.coupled_inertia", Family::CoupledInertia, None),
            (
                "elbow+wrist.coupled_friction",
                Family::CoupledFriction,
                None,
            ),
        ];
        let components = names.map(|(name, family, _)| Named { name, family });
        let expected = names.map(|(_, _, parent)| parent);
        assert_eq!(parents(&components, None).unwrap(), expected);
    }

    #[test]
    fn families_bind_joint_by_joint_and_names_go_before() {
        let none = vec![None; 7];
        let with = |pairs: &[(usize, usize)]| {
            let mut parent = none.clone();
            pairs.iter().for_each(|&(c, p)| parent[c] = Some(p));
            parent
        };
        // The hip's Coulomb friction is no candidate: its Stribeck effect stands alone.
        assert_eq!(heredity(None).unwrap(), with(&[(0, 1), (2, 3)]));
        assert_eq!(heredity(Some(&[])).unwrap(), none);
        let mine = [
            ("sin(2*q1)", "payload"),
            ("stribeck", "coulomb"),
            ("elbow.stribeck", "wrist.coulomb"),
        ];
        assert_eq!(heredity(Some(&mine)).unwrap(), with(&[(5, 6), (0, 3)]));
        let all = [("coulomb", "payload")];
        assert_eq!(heredity(Some(&all)).unwrap(), with(&[(1, 6), (3, 6)]));
    }

    #[test]
    fn impossible_pairs_are_named() {
        let loops = [
            ("sin(2*q1)", "payload"),
            ("payload", "hip.stribeck"),
            ("hip.stribeck", "sin(2*q1)"),
        ];
        let cases: [(&[(&str, &str)], &str); 8] = [
            (&[("payload_tensor", "coulomb")], "needs the payload"),
            (&[("coulomb", "coulomb")], "needs itself"),
            (&[("user", "coulomb")], "no user stands on"),
            (&[("payload", "coulomb")], "`coulomb`"),
            (&[("stribek", "coulomb")], "`stribek`"),
            (&[("stribeck", "colomb")], "`colomb`"),
            (&[("payload", "elbow.spring")], "`elbow.spring`"),
            (&loops, "needs itself"),
        ];
        for (pairs, said) in cases {
            let text = heredity(Some(pairs)).unwrap_err().to_string();
            assert!(
                text.contains(said) && text.contains("prior.heredity"),
                "{text}"
            );
        }
    }

    #[test]
    fn a_part_of_a_component_needs_the_rest_of_it() {
        let named = |name, family| Named { name, family };
        let components = [
            named("elbow.coulomb", Family::Coulomb),
            named("payload", Family::Payload),
            named("payload", Family::PayloadTensor),
        ];
        for given in [None, Some(("payload", "elbow.coulomb"))] {
            let pairs = given.map(|(a, b)| vec![(a.to_owned(), b.to_owned())]);
            let above = given.map(|_| 0);
            let parents = parents(&components, pairs.as_deref()).unwrap();
            assert_eq!(parents, [None, above, Some(1)]);
        }
    }

    #[test]
    fn what_is_forced_brings_what_it_needs() {
        let parent = [Some(1), Some(2), None, Some(2), None];
        let mut forced = [true, false, false, false, false];
        force_parents(&parent, &mut forced);
        assert_eq!(forced, [true, true, true, false, false]);
    }
}
