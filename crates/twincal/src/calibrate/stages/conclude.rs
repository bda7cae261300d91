//! Stage 6: everything that a reader gets.

use super::check::Checked;
use super::rows::Rows;
use super::validate::Validated;
use crate::calibrate::result::calibration::Calibration;
use crate::calibrate::result::curves;
use crate::calibrate::result::negative_friction;
use crate::calibrate::result::summary::{self, Pieces};
use crate::calibrate::result::unphysical;
use crate::calibrate::result::unseen;
use crate::error::{Finding, Result};
use crate::posterior::draws::Drawer;

/// Summarises posterior, validation and checks.
///
/// # Errors
/// Those of the prior's sensitivity.
pub(in crate::calibrate) fn conclude(
    rows: Rows<'_, '_>,
    validated: Validated,
    checked: Checked,
    findings: &mut Vec<Finding>,
) -> Result<Calibration> {
    let (robot, settings) = (rows.prepared.request.robot, &rows.prepared.settings);
    let library = &rows.library;
    let pieces = Pieces {
        twin: validated.twin,
        library,
        data: &rows.data,
        columns: &rows.columns,
        settings,
        fit: validated.fitted.fit,
        validation: validated.validation,
        sweep: checked.sweep,
        opinion: checked.opinion,
    };
    let mut calibration = summary::summarise(pieces, findings)?;
    unseen::tell(&mut calibration, &checked.excitation);
    let seed = settings.inference.seed;
    let twin = &calibration.twin;
    let drawer = Drawer::new(&twin.posterior);
    let (curves, unphysical) = rayon::join(
        || curves::curves(robot, library, &calibration, &drawer, seed),
        || unphysical::findings(robot, library, &calibration, &drawer, seed),
    );
    (calibration.curves, calibration.lags) = (curves, rows.lags);
    let components = &calibration.components;
    let negative = negative_friction::findings(&calibration.twin, library, components);
    unphysical::tell(&mut calibration, unphysical);
    calibration.findings.extend(negative);
    Ok(calibration)
}
