//! Exit codes of results: the answer, and whether data were lost.

use crate::failure::{DEGRADED, GATE};
use twincal::assess::Answer;
use twincal::{Finding, Severity};

/// 3 if data was lost or degraded beyond the stated limit, else 0.
pub(crate) fn of_findings(findings: &[Finding]) -> u8 {
    let mut findings = findings.iter();
    match findings.any(|finding| finding.severity == Severity::Degraded) {
        true => DEGRADED,
        false => 0,
    }
}

/// Of a fit, whose result is written in any case: 3 where the twin is not to be used.
pub(crate) fn of_fit(answer: Answer, findings: &[Finding]) -> u8 {
    match answer {
        Answer::Yes | Answer::YesWithinLimits => of_findings(findings),
        Answer::No | Answer::NotYet => DEGRADED,
    }
}

/// Of a check: 1 where the twin does not hold any more, 3 where that cannot be told.
pub(crate) fn of_check(answer: Answer, findings: &[Finding]) -> u8 {
    match answer {
        Answer::Yes | Answer::YesWithinLimits => of_findings(findings),
        Answer::No => GATE,
        Answer::NotYet => DEGRADED,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use twincal::Code;

    #[test]
    fn codes_follow_the_answer() {
        let lost = [Finding::new(
            Severity::Degraded,
            Code::NotFiniteRows,
            "",
            "",
            1,
        )];
        let all = [
            Answer::Yes,
            Answer::YesWithinLimits,
            Answer::No,
            Answer::NotYet,
        ];
        assert_eq!(all.map(|answer| of_fit(answer, &[])), [0, 0, 3, 3]);
        assert_eq!(all.map(|answer| of_check(answer, &[])), [0, 0, 1, 3]);
        assert_eq!(all.map(|answer| of_fit(answer, &lost)), [3; 4]);
        assert_eq!(all.map(|answer| of_check(answer, &lost)), [3, 3, 1, 3]);
    }
}
