//! Numbers behind a finding or a claim, by name.

use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Numbers behind a finding or a claim by name, in SI units and radians; shares are 0 … 1. A number that does not exist is NaN, in JSON `null`.
///
/// # Example
/// ```
/// use twincal::assess::Evidence;
///
/// let lag = Evidence::of([("lag", 0.004), ("lag_sd", 0.0002)]);
/// assert_eq!(lag.get("lag"), Some(0.004));
/// assert_eq!(lag.get("gain"), None);
/// ```
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(from = "BTreeMap<String, Option<f64>>")]
pub struct Evidence(BTreeMap<Cow<'static, str>, f64>);

impl Evidence {
    /// Of these numbers.
    #[must_use]
    pub fn of<const N: usize>(numbers: [(&'static str, f64); N]) -> Self {
        let mut evidence = Self::default();
        evidence.extend(numbers);
        evidence
    }

    /// The number of this name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<f64> {
        self.0.get(name).copied()
    }

    /// All numbers, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&str, f64)> {
        self.0.iter().map(|(name, number)| (&**name, *number))
    }

    /// True without any number.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl Extend<(&'static str, f64)> for Evidence {
    fn extend<T: IntoIterator<Item = (&'static str, f64)>>(&mut self, numbers: T) {
        // JSON has no infinity.
        let known = |number: f64| if number.is_finite() { number } else { f64::NAN };
        let numbers = numbers.into_iter();
        self.0
            .extend(numbers.map(|(name, number)| (Cow::Borrowed(name), known(number))));
    }
}

/// Numbers that do not exist are equal: what was read back equals what was written.
impl PartialEq for Evidence {
    fn eq(&self, other: &Self) -> bool {
        let alike = |(a, b): (f64, f64)| a == b || a.is_nan() && b.is_nan();
        self.0.keys().eq(other.0.keys())
            && self
                .0
                .values()
                .copied()
                .zip(other.0.values().copied())
                .all(alike)
    }
}

impl From<BTreeMap<String, Option<f64>>> for Evidence {
    fn from(numbers: BTreeMap<String, Option<f64>>) -> Self {
        let known =
            |(name, number): (String, Option<f64>)| (Cow::Owned(name), number.unwrap_or(f64::NAN));
        Self(numbers.into_iter().map(known).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_and_one_that_does_not_exist_is_null() {
        let written = Evidence::of([("share", 0.25), ("lag", f64::NAN)]);
        let json = serde_json::to_string(&written).unwrap();
        assert_eq!(json, r#"{"lag":null,"share":0.25}"#);
        let read: Evidence = serde_json::from_str(&json).unwrap();
        assert_eq!(read, written);
        assert_ne!(read, Evidence::of([("share", 0.25)]));
        assert_ne!(read, Evidence::of([("share", 0.5), ("lag", f64::NAN)]));
    }
}
