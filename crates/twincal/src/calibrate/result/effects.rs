//! What was found, effect by effect, for people who read it and programs that go on from it.

use super::calibration::{Calibration, ComponentSummary, ParameterSummary};
use super::status::Status;
use crate::term::Family;
use crate::twin::Twin;
use std::fmt;

/// One effect that the data speak for: established, tentative, or one of a set that they cannot tell apart.
///
/// It prints as one line: status, probability, and what it is with its numbers.
///
/// # Example
/// The tip of the arm carries 0.6 kg more than its model says.
/// ```
/// # #[path = "../../../examples/two_link.rs"] mod two_link;
/// # let fit = two_link::study()?;
/// let payload = fit.effects().find(|effect| effect.name() == "payload").ok_or("none")?;
/// let mass = payload.parameter("mass").ok_or("none")?;
/// assert!((mass.mean - 0.6).abs() < 0.01 && payload.pip() > 0.99);
/// assert!(payload.to_string().starts_with("established   PIP"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effect<'a> {
    component: &'a ComponentSummary,
    pip: f64,
}

impl<'a> Effect<'a> {
    /// Its name: `payload`, `elbow.spring`, …
    #[must_use]
    pub fn name(&self) -> &'a str {
        &self.component.name
    }

    /// Kind of effect.
    #[must_use]
    pub fn family(&self) -> Family {
        self.component.family
    }

    /// What the data say of it.
    #[must_use]
    pub fn status(&self) -> Status {
        self.component.status
    }

    /// Posterior inclusion probability.
    #[must_use]
    pub fn pip(&self) -> f64 {
        self.pip
    }

    /// Its numbers with intervals, given that it is in.
    #[must_use]
    pub fn parameters(&self) -> &'a [ParameterSummary] {
        &self.component.parameters
    }

    /// A number by name, such as `mass`; `None` where it has none of that name.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<&'a ParameterSummary> {
        self.component.parameters.iter().find(|p| p.name == name)
    }

    /// Everything that `result.json` has of it.
    #[must_use]
    pub fn component(&self) -> &'a ComponentSummary {
        self.component
    }
}

impl fmt::Display for Effect<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = if self.component.words.is_empty() {
            &self.component.story
        } else {
            &self.component.words
        };
        let (status, pip) = (self.component.status.word(), self.pip);
        write!(f, "{status:<13} PIP {pip:.3}  {words}")
    }
}

impl Calibration {
    /// The calibrated twin: it predicts torque with intervals.
    #[must_use]
    pub fn twin(&self) -> &Twin {
        &self.twin
    }

    /// What the data speak for: established effects, then those of sets, then tentative ones, each by falling probability. Effects that are absent,
    /// or that these data cannot see, are in [`Calibration::components`].
    pub fn effects(&self) -> impl Iterator<Item = Effect<'_>> {
        let rank = |status: Status| match status {
            Status::Established => Some(0),
            Status::Equivalent => Some(1),
            Status::Tentative => Some(2),
            Status::Absent | Status::Unidentifiable => None,
        };
        let own = self.components.iter().filter_map(move |component| {
            let pip = component.pip?;
            Some((rank(component.status)?, Effect { component, pip }))
        });
        let mut all: Vec<(u8, Effect<'_>)> = own.collect();
        all.sort_by(|(a, x), (b, y)| a.cmp(b).then(y.pip.total_cmp(&x.pip)));
        all.into_iter().map(|(_, effect)| effect)
    }
}
