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
use crate::excitation::Excitation;
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
    let pieces = Pieces {
        twin: validated.twin,
        library: &rows.library,
        facts: &rows.facts,
        sums: &rows.sums,
        columns: &rows.columns,
        settings: &rows.prepared.settings,
        fit: validated.fitted.fit,
        validation: validated.validation,
        sweep: checked.sweep,
        opinion: checked.opinion,
        pooled: false,
    };
    let mut calibration = told(pieces, &checked.excitation, findings)?;
    calibration.lags = rows.lags;
    Ok(calibration)
}

/// The calibration that these pieces make, with everything that is said of it.
///
/// # Errors
/// Those of the prior's sensitivity.
pub(in crate::calibrate) fn told(
    pieces: Pieces<'_>,
    excitation: &Excitation,
    findings: &mut Vec<Finding>,
) -> Result<Calibration> {
    let (library, seed) = (pieces.library, pieces.settings.inference.seed);
    let mut calibration = summary::summarise(pieces, findings)?;
    unseen::tell(&mut calibration, excitation);
    let robot = calibration.twin.robot.clone();
    let drawer = Drawer::new(&calibration.twin.posterior);
    let (curves, unphysical) = rayon::join(
        || curves::curves(&robot, library, &calibration, &drawer, seed),
        || unphysical::findings(&robot, library, &calibration, &drawer, seed),
    );
    calibration.curves = curves;
    let components = &calibration.components;
    let negative = negative_friction::findings(&calibration.twin, library, components);
    unphysical::tell(&mut calibration, unphysical);
    calibration.findings.extend(negative);
    Ok(calibration)
}
