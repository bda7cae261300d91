//! Stage 5: the answer against other cut-offs, against a likelihood that is not believed, and against what the logs can show.

use super::prepare::Prepared;
use super::rows::Rows;
use super::validate::Validated;
use crate::calibrate::checks::sandwich;
use crate::calibrate::checks::sweep;
use crate::calibrate::checks::sweep::SweepPoint;
use crate::calibrate::fit::compact;
use crate::calibrate::result::summary::SecondOpinion;
use crate::calibrate::result::unseen;
use crate::error::{Finding, Result};
use crate::excitation::Excitation;

/// What was computed to check the answer.
pub(in crate::calibrate) struct Checked {
    pub(in crate::calibrate) sweep: Vec<SweepPoint>,
    pub(in crate::calibrate) opinion: SecondOpinion,
    pub(in crate::calibrate) excitation: Excitation,
}

/// Repeats the fit at other cut-offs, and looks at blocks of rows and at the excitation.
///
/// # Errors
/// Those of rows and fits.
pub(in crate::calibrate) fn check(
    rows: &mut Rows<'static, '_>,
    validated: &Validated,
    findings: &mut Vec<Finding>,
) -> Result<Checked> {
    let Prepared {
        request, settings, ..
    } = &rows.prepared;
    let (data, library, columns) = (&rows.data, &rows.library, &rows.columns);
    let Validated { twin, compact, .. } = validated;
    let fit = &validated.fitted.fit;
    let (problem, posterior) = (&fit.problem, &fit.posterior);
    let ready = &rows.prepared.ready;
    let elsewhere = || sweep::cutoff(twin, library, ready, data, columns, settings, fit);
    let beside = || {
        let opinion = SecondOpinion {
            sandwich: sandwich::sds(fit, compact, &rows.sums),
            compact: compact::summary(library, problem, posterior, compact, &fit.gram),
        };
        let (robot, every_candidate) = (request.robot, &rows.prepared.library);
        let zero = &twin.zero_columns;
        let excitation =
            unseen::excitation(robot, every_candidate, zero, &fit.gram, &rows.facts.states);
        (opinion, excitation)
    };
    let (sweep, (opinion, excitation)) = rayon::join(elsewhere, beside);
    let sweep = sweep?;
    findings.extend(sweep::findings(&sweep, library, posterior));
    rows.prepared.ready = Vec::new();
    Ok(Checked {
        sweep,
        opinion,
        excitation,
    })
}
