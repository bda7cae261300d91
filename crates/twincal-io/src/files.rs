//! What a program needs of files in four functions, with the settings of an empty `twincal.toml`.

use crate::artifact::{Artifact, Claim, Inputs, Maker, Replace};
use crate::config::Gates;
use crate::context::ReportContext;
use crate::error::Result;
use crate::log::{LogOptions, read_log};
use crate::model::{ModelSettings, read_model};
use crate::twin_json::StoredTwin;
use std::collections::BTreeMap;
use std::path::Path;
use twincal::calibrate::Calibration;
use twincal::robot::Robot;
use twincal::signal::Recording;

/// A robot of a URDF or MJCF file, every movable joint moving. What the file left to be assumed is in the findings of
/// [`read_model`](crate::model::read_model), which also takes settings.
///
/// # Errors
/// Those of [`read_model`](crate::model::read_model) and [`Model::robot`](crate::model::Model::robot), with file, line and column.
///
/// # Example
/// ```no_run
/// let robot = twincal_io::read_robot("arm.urdf")?;
/// println!("{}", robot.joint_names().join(", "));
/// # Ok::<(), twincal_io::Error>(())
/// ```
pub fn read_robot(path: impl AsRef<Path>) -> Result<Robot> {
    let model = read_model(path.as_ref(), &ModelSettings::default())?;
    Ok(model.robot(&BTreeMap::new())?.0)
}

/// A log of any kind that is read, its columns matched to the joints by name. What had to be dropped or assumed is in the findings of
/// [`read_log`](crate::log::read_log), which also takes options.
///
/// # Errors
/// Those of [`read_log`](crate::log::read_log).
pub fn read_recording(path: impl AsRef<Path>, robot: &Robot) -> Result<Recording> {
    Ok(read_log(path.as_ref(), robot, &LogOptions::default())?.0)
}

/// Writes a calibration as `twincal fit` does: `result.json`, `twin.json` and, with the feature `report`, `report.html` in a new folder, complete or not at all. The model file is
/// not among them, so that `twincal export` has to be given one.
///
/// # Errors
/// A folder that is there already; the system's refusal.
pub fn save(calibration: &Calibration, folder: impl AsRef<Path>) -> Result<()> {
    let robot = calibration.twin.robot.description().name.clone();
    let stored = StoredTwin {
        gates: Gates::default(),
        read_as: None,
        context: ReportContext {
            version: env!("CARGO_PKG_VERSION").into(),
            model: robot.clone(),
            robot,
            ..ReportContext::default()
        },
        calibration: calibration.clone(),
    };
    let claim = Claim::new(folder.as_ref(), Replace::Never, &Inputs::default())?;
    stored.write(claim, Maker::Fit, String::new(), Vec::new())
}

/// Reads a calibration that [`save`] or `twincal fit` wrote.
///
/// # Errors
/// A folder that holds none, a file that is damaged or of another version.
pub fn load(folder: impl AsRef<Path>) -> Result<Calibration> {
    let stored = StoredTwin::read(&Artifact::open(folder.as_ref())?, false)?;
    Ok(stored.calibration)
}
