//! Which families `[library]` asks for, by several keys.

use super::{Friction, LibraryTable};
use twincal::term::Family;

impl LibraryTable {
    /// `families`, or what is proposed unasked: everything an industrial arm may have; with own `terms`, or where the
    /// generic family is asked for, these compete with friction, offset and motor inertia alone. The keys `friction`, `offset`
    /// and `motor_inertia` switch their own families.
    pub(super) fn families(&self) -> Vec<Family> {
        let own = !self.terms.is_empty() || self.generic == Some(true);
        let mut families: Vec<Family> = match &self.families {
            Some(given) => given.iter().map(|&word| word.into()).collect(),
            None if own => Family::JOINT.to_vec(),
            None => Family::DEFAULT.to_vec(),
        };
        let friction = self.friction.as_ref();
        let switches = [
            (
                Family::Viscous,
                friction.map(|f| f.contains(&Friction::Viscous)),
            ),
            (
                Family::Coulomb,
                friction.map(|f| f.contains(&Friction::Coulomb)),
            ),
            (Family::Offset, self.offset),
            (Family::MotorInertia, self.motor_inertia),
        ];
        for (family, switch) in switches {
            match switch {
                Some(true) => families.push(family),
                Some(false) => families.retain(|&f| f != family),
                None => {}
            }
        }
        // With all friction switched off by its old key, none of the finer kinds is meant either.
        if friction.is_some_and(Vec::is_empty) && self.families.is_none() {
            families.retain(|family| !family.is_friction());
        }
        families.sort_unstable();
        families.dedup();
        families
    }
}
