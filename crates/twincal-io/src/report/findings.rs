//! Everything that was dropped, changed, assumed or doubted, by kind: of many of one kind the first are told, the others folded away.

use crate::words::number::count;
use serde::Serialize;
use twincal::calibrate::Calibration;
use twincal::{Code, Severity};

/// Findings of one kind, as the page shows them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Kind {
    pub(super) class: &'static str,
    pub(super) severity: &'static str,
    pub(super) code: Code,
    /// Told in full.
    pub(super) told: Vec<Said>,
    /// Folded away.
    pub(super) more: Vec<Said>,
}

/// One finding.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Said {
    pub(super) subject: String,
    pub(super) message: String,
    pub(super) count: String,
}

/// Findings of one kind that are told in full where there are more.
const TOLD: usize = 2;

/// All findings by kind, the gravest first.
pub(super) fn findings(calibration: &Calibration) -> Vec<Kind> {
    let mut kinds: Vec<Kind> = Vec::new();
    for wanted in [Severity::Degraded, Severity::Warning, Severity::Note] {
        let (class, severity) = match wanted {
            Severity::Note => ("note", "note"),
            Severity::Warning => ("care", "warning"),
            Severity::Degraded => ("bad", "degraded"),
        };
        for f in calibration.findings.iter().filter(|f| f.severity == wanted) {
            let same = |kind: &&mut Kind| (kind.class, kind.code) == (class, f.code);
            let said = Said {
                subject: f.subject.clone(),
                message: f.message.clone(),
                count: if f.count > 0 {
                    count(f.count)
                } else {
                    String::new()
                },
            };
            match kinds.iter_mut().find(same) {
                Some(kind) => kind.more.push(said),
                None => kinds.push(Kind {
                    class,
                    severity,
                    code: f.code,
                    told: vec![said],
                    more: Vec::new(),
                }),
            }
        }
    }
    for kind in &mut kinds {
        let told = match kind.more.len() {
            few if few <= TOLD => few, // not worth a fold
            _ => TOLD - 1,
        };
        kind.told.extend(kind.more.drain(..told));
    }
    kinds
}

/// "There are 19 warnings of 6 kinds to read …"; `None` without any.
pub(super) fn warnings(calibration: &Calibration) -> Option<String> {
    let findings = calibration.findings.iter();
    let all: Vec<Code> = (findings.filter(|f| f.severity == Severity::Warning))
        .map(|f| f.code)
        .collect();
    let mut kinds = all.clone();
    kinds.sort_unstable();
    kinds.dedup();
    let words = match (all.len(), kinds.len()) {
        (0, _) => return None,
        (1, _) => "There is one warning to read".to_owned(),
        (all, 1) => format!("There are {all} warnings of one kind to read"),
        (all, kinds) if kinds < all => format!("There are {all} warnings of {kinds} kinds to read"),
        (all, _) => format!("There are {all} warnings to read"),
    };
    Some(format!(
        "{words} (see “What was read, dropped and filtered”)."
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;
    use twincal::Finding;

    const A: Code = Code::Drift;
    const B: Code = Code::Gaps;

    fn with(codes: &[Code]) -> Calibration {
        let mut calibration = fixture::two_joints();
        let finding = |(i, code): (usize, &Code)| {
            Finding::new(
                Severity::Warning,
                *code,
                format!("joint{i}"),
                format!("message {i}"),
                0,
            )
        };
        calibration.findings = codes.iter().enumerate().map(finding).collect();
        calibration
            .findings
            .push(Finding::new(Severity::Note, Code::Columns, "", "note", 0));
        calibration
    }

    #[test]
    fn of_many_of_one_kind_two_are_told_and_none_is_lost() {
        let shape = |codes: &[Code]| -> Vec<(usize, usize)> {
            let kinds = findings(&with(codes));
            kinds.iter().map(|k| (k.told.len(), k.more.len())).collect()
        };
        assert_eq!(shape(&[A]), [(1, 0), (1, 0)]);
        assert_eq!(shape(&[A, B, A, A]), [(3, 0), (1, 0), (1, 0)]);
        assert_eq!(shape(&[A, B, A, A, A]), [(2, 2), (1, 0), (1, 0)]);
        let told = findings(&with(&[A, A, A, A, A]));
        let messages: Vec<&str> = told[0].more.iter().map(|f| f.message.as_str()).collect();
        assert_eq!(messages, ["message 2", "message 3", "message 4"]);
    }

    #[test]
    fn warnings_are_counted_with_their_kinds() {
        let words = |codes: &[Code]| warnings(&with(codes));
        assert_eq!(words(&[]), None);
        assert!(words(&[A]).unwrap().starts_with("There is one warning"));
        assert!(
            words(&[A, B])
                .unwrap()
                .starts_with("There are 2 warnings to read")
        );
        assert!(words(&[A, A]).unwrap().contains("2 warnings of one kind"));
        assert!(words(&[A, B, A]).unwrap().contains("3 warnings of 2 kinds"));
    }
}
