//! Whether a term is a column, and if not, why; written as one string in `result.json`.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Whether a term is a column, and if not, why.
///
/// As text: `candidate`, `alias_of:<name>` (several names are separated by commas), `null_lagrangian`, `zero_column`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Status {
    /// It is a column of the regression.
    Candidate,
    /// Its torque image is a combination of the named terms, for every motion.
    AliasOf(String),
    /// A total time derivative: torque image 0.
    NullLagrangian,
    /// Zero on all data.
    ZeroColumn,
}

const ALIAS: &str = "alias_of:";

impl std::fmt::Display for Status {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Candidate => f.write_str("candidate"),
            Self::AliasOf(name) => write!(f, "{ALIAS}{name}"),
            Self::NullLagrangian => f.write_str("null_lagrangian"),
            Self::ZeroColumn => f.write_str("zero_column"),
        }
    }
}

impl Serialize for Status {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Status {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        match (text.as_str(), text.strip_prefix(ALIAS)) {
            (_, Some(name)) => Ok(Self::AliasOf(name.to_owned())),
            ("candidate", _) => Ok(Self::Candidate),
            ("null_lagrangian", _) => Ok(Self::NullLagrangian),
            ("zero_column", _) => Ok(Self::ZeroColumn),
            _ => Err(serde::de::Error::unknown_variant(
                &text,
                &[
                    "candidate",
                    "alias_of:<name>",
                    "null_lagrangian",
                    "zero_column",
                ],
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_form_is_the_contract_and_comes_back() {
        for (status, text) in [
            (Status::Candidate, r#""candidate""#),
            (
                Status::AliasOf("joint1.motor_inertia".into()),
                r#""alias_of:joint1.motor_inertia""#,
            ),
            (Status::AliasOf("a:\"b\"".into()), r#""alias_of:a:\"b\"""#),
            (Status::NullLagrangian, r#""null_lagrangian""#),
            (Status::ZeroColumn, r#""zero_column""#),
        ] {
            assert_eq!(serde_json::to_string(&status).unwrap(), text);
            assert_eq!(serde_json::from_str::<Status>(text).unwrap(), status);
        }
        assert!(serde_json::from_str::<Status>(r#""alias""#).is_err());
    }
}
