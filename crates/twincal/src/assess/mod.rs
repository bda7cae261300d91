//! May a twin be used, why, and what to record next: a value of codes and numbers, without a word. Everything that tells people (terminal, page,
//! `result.json`) renders it.
//!
//! # Example
//! ```
//! # #[path = "../../examples/two_link.rs"] mod two_link;
//! # use two_link::{arm, log};
//! use twincal::assess::{Answer, assess};
//! use twincal::prelude::*;
//!
//! # let mut noise = twincal::random::Random::new(1, 0);
//! # let (robot, real) = (arm(2.0)?, arm(2.6)?);
//! # let mut run = |name: &str, phase: f64| log(name, phase, &real, &mut noise);
//! # let (log, other) = (run("run1", 0.3), run("run2", 1.9));
//! # let mut settings = Settings::default();
//! # settings.library.families = vec![Family::Payload, Family::Viscous];
//! let fit = Calibrate::new(&robot).logs([log]).heldout([other]).settings(settings).run()?;
//! let assessment = assess(&fit);
//! for claim in &assessment.claims {
//!     println!("{} {:?} {:?}", claim.code, claim.subject, claim.evidence);
//! }
//! assert!(assessment.answer <= Answer::YesWithinLimits);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod answer;
mod beyond;
mod claim;
mod decide;
mod explanation;
mod intervals;
mod next;
mod numbers;
mod of_torque;
mod rest;
mod scores;
mod shape;

pub use crate::error::Evidence;
pub use answer::{Answer, decision_table};
pub use claim::{Claim, Role, Subject};
pub use decide::decide;
pub use explanation::{Explanation, TensorElement, explanations};
pub use next::{Request, RequestCode, open_effects};
pub use numbers::NUMBERS;
pub use rest::{AtRest, Pauses, all_at_rest, at_rest, few_pauses, standstill};
pub use scores::{
    converged, decisive, friction_only, has_standstill, independent_rows, memory, rows_of,
};

use crate::calibrate::Calibration;
use crate::error::{Code, Finding};
use serde::Serialize;

/// What may be concluded from a calibration.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Assessment {
    /// May the twin be used?
    pub answer: Answer,
    /// The code that decides; [`Code::Passed`] where nothing speaks against a "yes".
    pub reason: Code,
    /// What speaks for and against it: what decides first, then by weight.
    pub claims: Vec<Claim>,
    /// What to record next.
    pub next: Vec<Request>,
}

impl Assessment {
    /// The claims of this code.
    pub fn claims(&self, code: Code) -> impl Iterator<Item = &Claim> {
        self.claims.iter().filter(move |claim| claim.code == code)
    }
}

/// What gates on new `logs` mean for a twin: they decide, and where they hold, or there are none, a mistake in those logs does. Torque that is not what
/// it is said to be says nothing of the robot: give no gates of such logs.
#[must_use]
pub fn of_gates(
    gates: Vec<Claim>,
    findings: &[Finding],
    (calibration, logs): (&Calibration, &[&str]),
) -> Assessment {
    let (answer, reason) = decide(&gates);
    let found = findings.iter().map(|finding| {
        let name = finding.subject.as_str();
        match logs.contains(&name) {
            true => Claim::found(finding, Subject::Log(name.to_owned())),
            false => Claim::of_finding(finding, calibration),
        }
    });
    let found: Vec<Claim> = found.collect();
    let mut claims = gates;
    let decided = answer > Answer::YesWithinLimits;
    claims.extend(found);
    let (answer, reason) = match decided {
        true => (answer, reason),
        false => decide(&claims),
    };
    claims.sort_by_key(|claim| (claim.code != reason, claim.role));
    Assessment {
        answer,
        reason,
        claims,
        next: Vec::new(),
    }
}

/// Assesses a calibration. The answer follows from the claims alone ([`decide`]).
#[must_use]
pub fn assess(calibration: &Calibration) -> Assessment {
    let mut claims = of_torque::claims(calibration);
    // Without a test, and of an exact model, nothing else is said.
    if claims.iter().any(|claim| claim.code == Code::TorqueError) {
        claims.extend(intervals::claims(calibration));
        claims.extend(shape::claims(calibration));
        claims.extend(rest::claims(calibration));
        claims.extend(beyond::claims(calibration));
    }
    claims.extend(of_torque::of_effects(calibration));
    let all = calibration.findings.iter();
    claims.extend(all.map(|finding| Claim::of_finding(finding, calibration)));
    let (answer, reason) = decide(&claims);
    claims.sort_by_key(|claim| (claim.code != reason, claim.role));
    let next = next::requests(calibration, &claims);
    Assessment {
        answer,
        reason,
        claims,
        next,
    }
}
