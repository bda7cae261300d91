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
/// A pendulum of 1 kg at 0.5 m; `arm.urdf` is its model.
/// ```
/// use twincal::robot::{Workspace, inverse_dynamics};
///
/// # let text = r#"<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="1"/>
/// # <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
/// # <joint name="pivot" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"#;
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("arm.urdf");
/// # std::fs::write(&path, text)?;
/// let robot = twincal_io::read_robot(&path)?;
/// assert_eq!(robot.joint_names(), ["pivot"]);
/// let mut tau = [0.0]; // held level
/// inverse_dynamics(&robot, &mut Workspace::new(&robot), &[std::f64::consts::FRAC_PI_2], &[0.0], &[0.0], &mut tau);
/// assert!((tau[0] - 9.81 * 1.0 * 0.5).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
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
///
/// # Example
/// ```
/// # use twincal_io::model::parse_model;
/// # let text = r#"<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="1"/>
/// # <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
/// # <joint name="pivot" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"#;
/// # let (robot, _) = parse_model("pendulum.urdf", text.as_bytes(), &Default::default())?.robot(&Default::default())?;
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("run1.csv");
/// std::fs::write(&path, "t,pivot.q,pivot.tau\n0,0.1,0.5\n0.01,0.2,1\n0.02,0.3,1.5\n")?;
/// let log = twincal_io::read_recording(&path, &robot)?;
/// assert_eq!(log.time, [0.0, 0.01, 0.02]);
/// assert_eq!(log.joints[0].q, [0.1, 0.2, 0.3]);
/// assert_eq!(log.joints[0].tau, Some(vec![0.5, 1.0, 1.5]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_recording(path: impl AsRef<Path>, robot: &Robot) -> Result<Recording> {
    Ok(read_log(path.as_ref(), robot, &LogOptions::default())?.0)
}

/// Writes a calibration as `twincal fit` does: `result.json`, `twin.json` and, with the feature `report`, `report.html` in a new folder, complete or not at all. The model file is
/// not among them, so that `twincal export` has to be given one.
///
/// # Errors
/// A folder that is there already; the system's refusal.
///
/// # Example
/// ```
/// # #[path = "../../twincal/examples/two_link.rs"] mod two_link;
/// # let folder = tempfile::tempdir()?;
/// # let folder = folder.path().join("twin");
/// # let fit = two_link::study()?;
/// twincal_io::save(&fit, &folder)?;
/// let result: serde_json::Value = serde_json::from_slice(&std::fs::read(folder.join("result.json"))?)?;
/// assert_eq!(result["components"].as_array().map(Vec::len), Some(fit.components.len()));
/// assert!(twincal_io::save(&fit, &folder).is_err()); // nothing is replaced
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
///
/// # Example
/// A twin predicts the same before it was written and after it was read.
/// ```
/// # #[path = "../../twincal/examples/two_link.rs"] mod two_link;
/// # let folder = tempfile::tempdir()?;
/// # let folder = folder.path().join("twin");
/// # let fit = two_link::study()?;
/// # twincal_io::save(&fit, &folder)?;
/// let again = twincal_io::load(&folder)?;
/// let (q, qd, qdd) = ([0.3, -0.2], [0.5, 0.1], [-0.2, 0.4]);
/// assert_eq!(again.twin().torque(&q, &qd, &qdd)?, fit.twin().torque(&q, &qd, &qdd)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load(folder: impl AsRef<Path>) -> Result<Calibration> {
    let stored = StoredTwin::read(&Artifact::open(folder.as_ref())?, false)?;
    Ok(stored.calibration)
}
