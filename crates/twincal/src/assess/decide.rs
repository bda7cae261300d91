//! The answer that claims mean, by the table of answers.

use super::answer::{Answer, TABLE};
use super::claim::Claim;
use crate::error::{Code, Mistake, Severity};

/// Where a claim stands in the order, and what it means; `None` where it does not bear on the answer.
fn rank(claim: &Claim) -> Option<(usize, Answer)> {
    let kinds = TABLE.len();
    if let Some(mistake) = Mistake::of(claim.code, claim.severity) {
        return Some((1 + mistake as usize, Answer::NotYet));
    }
    if let Some(place) = TABLE.iter().position(|(code, _)| *code == claim.code) {
        let behind_mistakes = if place == 0 { 0 } else { kinds + place };
        return Some((behind_mistakes, TABLE[place].1));
    }
    let lost = claim.severity == Severity::Degraded;
    lost.then_some((3 * kinds, Answer::YesWithinLimits))
}

/// The answer that claims mean, and the code that decides: of all that bear on it the first in the order. Nothing bears on a plain "yes",
/// [`Code::Passed`].
///
/// One more claim never makes a twin usable that was not, nor a "yes" of a "yes within limits". `No` and `NotYet` both say: do not use it.
#[must_use]
pub fn decide(claims: &[Claim]) -> (Answer, Code) {
    let ranked = claims.iter().filter_map(|claim| {
        let (place, answer) = rank(claim)?;
        (answer != Answer::Yes).then_some((place, answer, claim.code))
    });
    let first = ranked.min_by_key(|(place, ..)| *place);
    first.map_or((Answer::Yes, Code::Passed), |(_, answer, code)| {
        (answer, code)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assess::{Role, Subject};
    use crate::random::Random;
    use Severity::{Degraded, Note, Warning};

    fn claim(code: Code, severity: Severity) -> Claim {
        Claim {
            severity,
            ..Claim::new(code, Subject::Run, [])
        }
    }

    /// How far a twin may be used.
    fn use_of(claims: &[Claim]) -> Answer {
        decide(claims).0.min(Answer::No)
    }

    /// 20 000 random sets of claims: one more never improves the answer, and their order does not matter.
    #[test]
    fn one_more_claim_never_makes_the_answer_better() {
        let mut random = Random::new(7, 0);
        let mut below = |n: usize| (random.uniform() * n as f64) as usize % n;
        for _ in 0..20_000 {
            let mut claims: Vec<Claim> = Vec::new();
            for _ in 0..below(8) {
                let severity = [Note, Warning, Degraded][below(3)];
                claims.push(claim(Code::ALL[below(Code::ALL.len())], severity));
            }
            let before = use_of(&claims);
            let decided = decide(&claims);
            claims.reverse();
            assert_eq!(decide(&claims).0, decided.0);
            claims.push(claim(Code::ALL[below(Code::ALL.len())], Degraded));
            assert!(use_of(&claims) >= before, "{claims:?}");
        }
    }

    #[test]
    fn every_code_that_forbids_a_yes_does_so_and_nothing_else_does() {
        for (code, severity) in Mistake::codes() {
            assert_eq!(decide(&[claim(code, severity)]), (Answer::NotYet, code));
        }
        for &code in Code::ALL {
            let own = claim(code, Note);
            let forbids = own.role == Role::ForbidsYes || Mistake::of(code, Note).is_some();
            assert_eq!(
                decide(std::slice::from_ref(&own)).0 >= Answer::No,
                forbids,
                "{code}"
            );
        }
        assert_eq!(decide(&[]), (Answer::Yes, Code::Passed));
        assert_eq!(decide(&[claim(Code::Drift, Warning)]).0, Answer::Yes);
        let lost = decide(&[claim(Code::NotFiniteRows, Degraded)]);
        assert_eq!(lost, (Answer::YesWithinLimits, Code::NotFiniteRows));
    }

    /// What decides where several things are wrong: first what was recorded, then whether anything was tested, then torque, then intervals.
    #[test]
    fn the_first_in_the_order_is_the_reason() {
        let order = [
            claim(Code::NotTested, Note),
            claim(Code::SignFlip, Degraded),
            claim(Code::CopiedLog, Degraded),
            claim(Code::FewHeldOutRows, Note),
            claim(Code::WorseThanNominal, Note),
            claim(Code::FrictionAloneIsBetter, Note),
            claim(Code::JointTorqueWorse, Note),
            claim(Code::NarrowIntervals, Note),
            claim(Code::JointIntervalsNarrow, Note),
            claim(Code::NotFiniteRows, Degraded),
        ];
        for k in 0..order.len() {
            let mut from = order[k..].to_vec();
            from.reverse();
            assert_eq!(decide(&from).1, order[k].code);
        }
    }
}
