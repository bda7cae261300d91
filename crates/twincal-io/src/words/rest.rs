//! Joints that stand still: there friction is whatever it takes, so that errors are another matter than in motion.

use super::NAMED;
use super::grounds::change;
use super::list::{first_of, list};
use super::number::{number, percent};
use super::units::{pooled_unit, unit_of};
use twincal::Code;
use twincal::assess::{Assessment, Claim, Subject};
use twincal::calibrate::Calibration;

/// RMSE before and after of joints that stand still, where one of these codes claims something of it, and the joints on which it got worse.
pub(super) fn error(
    assessment: &Assessment,
    calibration: &Calibration,
    codes: &[Code],
) -> Option<String> {
    let mut claims = assessment.claims.iter();
    let claim = claims.find(|claim| codes.contains(&claim.code))?;
    let told = change(claim, pooled_unit(calibration));
    let only = matches!(claim.subject, Subject::Joint(_)).then(|| claim.subject.name());
    let mut about: Vec<String> = only.map(str::to_owned).into_iter().collect();
    about.extend(pauses(claim));
    let place = match about.is_empty() {
        true => "At standstill".to_owned(),
        false => format!("At standstill ({})", about.join("; ")),
    };
    let worse = assessment.claims(Code::JointWorseAtRest);
    let names = worse.filter(|_| only.is_none()).map(|own| {
        let joint = own.subject.name();
        let [before, after] =
            ["rms_nominal", "rms_calibrated"].map(|name| number(own.number(name), 3));
        format!(
            "{joint} ({before} → {after} {})",
            unit_of(calibration, joint)
        )
    });
    let names = first_of(names.collect(), NAMED);
    Some(match names.is_empty() {
        true => format!("{place}: {told}."),
        false => format!("{place}: {told}; worse on {}.", list(&names)),
    })
}

/// "one pause, 0.960 s"; `None` where there are more than a few.
fn pauses(claim: &Claim) -> Option<String> {
    let most = claim.evidence.get("pauses")?;
    let seconds = number(claim.number("seconds_at_rest"), 2);
    Some(match most {
        1.0 => format!("one pause, {seconds} s"),
        most => format!("at most {most} pauses of a joint, {seconds} s"),
    })
}

/// What joints do at rest in the logs and hardly in held-out rows.
pub(super) fn not_tested(assessment: &Assessment, calibration: &Calibration) -> Option<String> {
    let claim = assessment.claims(Code::RestNotTested).next()?;
    let (tested, held_out) = match claim.number("rows_at_rest") {
        0.0 => ("not", "but no held-out row is at rest".to_owned()),
        1.0 => ("hardly", "but only one held-out row is at rest".to_owned()),
        n => ("hardly", format!("but only {n} held-out rows are at rest")),
    };
    let error = match claim.has("rms_calibrated") {
        true => format!(" (error {})", change(claim, pooled_unit(calibration))),
        false => String::new(),
    };
    Some(format!(
        "Standstill is {tested} tested: {} is at rest in {} of the logs' rows, {held_out}{error}.",
        claim.subject.name(),
        percent(claim.number("share_at_rest"))
    ))
}

#[cfg(all(test, feature = "report"))]
mod tests {
    use crate::report::fixture;
    use twincal::assess::few_pauses;
    use twincal::calibrate::Calibration;

    /// Rows 0.1 s apart, of which these stand still, in every trace of the first log; none in the others.
    fn resting(rows: &[std::ops::Range<usize>]) -> Calibration {
        let mut calibration = fixture::two_joints();
        let log = calibration.validation.traces[0].log.clone();
        for trace in &mut calibration.validation.traces {
            let first = trace.log == log;
            trace.time = (0..trace.time.len()).map(|row| 0.1 * row as f64).collect();
            trace.standstill = (0..trace.time.len())
                .map(|row| first && rows.iter().any(|rows| rows.contains(&row)))
                .collect();
        }
        calibration
    }

    #[test]
    fn few_pauses_are_counted_and_many_are_not_told() {
        let pauses = [3..13, 20..25, 30..32];
        let of = |first: usize| {
            let own = few_pauses(&resting(&pauses[..first]))?;
            Some((own.most, (10.0 * own.seconds).round()))
        };
        assert_eq!([of(0), of(1)], [None, Some((1, 10.0))]);
        assert_eq!([of(2), of(3)], [Some((2, 15.0)), None]);
    }
}
