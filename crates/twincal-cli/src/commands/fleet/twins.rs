//! Twins and model files of a fleet: the type's, and those of robots that were asked for.

use super::super::calibration::quoted;
use crate::args::Fleet as Flags;
use crate::failure::{Failure, Outcome};
use crate::names::display_names;
use crate::terminal::Terminal;
use std::path::{Path, PathBuf};
use twincal::calibrate::Calibration;
use twincal::fleet::FleetResult;
use twincal::write_back::{Holds, Writer};
use twincal_io::artifact::{Claim, Inputs, MODEL_MJCF, MODEL_URDF, Maker, Replace, sha256};
use twincal_io::config::Gates;
use twincal_io::context::{FileHash, ReportContext};
use twincal_io::export::write_model;
use twincal_io::fleet::{TYPE_MJCF, TYPE_URDF};
use twincal_io::model::{ModelSettings, parse_model};
use twincal_io::statistics::ModelFile;
use twincal_io::twin_json::StoredTwin;

/// Files that a command names.
const NAMED: usize = 100;

/// Whose twin goes where; the type's has no robot.
struct Asked {
    robot: Option<String>,
    folder: PathBuf,
    claim: Claim,
}

/// Folders of twins, claimed before any work.
pub(super) struct Twins {
    asked: Vec<Asked>,
    command: String,
    seed: u64,
}

impl Twins {
    /// # Errors
    /// A flag without a robot or a folder, and the refusal of a folder.
    pub(super) fn claim(flags: &Flags, replace: Replace, inputs: &Inputs) -> Outcome<Self> {
        let mut folders = Vec::new();
        if let Some(folder) = &flags.type_twin {
            folders.push((None, folder.clone()));
        }
        for text in &flags.twin {
            folders.push(robot_and_folder(text)?);
        }
        let claimed = folders.into_iter().map(|(robot, folder)| {
            let claim = Claim::new(&folder, replace, inputs)?;
            Ok(Asked {
                robot,
                folder,
                claim,
            })
        });
        Ok(Self {
            asked: claimed.collect::<Outcome<_>>()?,
            command: command(flags),
            seed: flags.seed,
        })
    }

    pub(super) fn robots(&self) -> impl Iterator<Item = String> + '_ {
        self.asked.iter().filter_map(|asked| asked.robot.clone())
    }

    /// Writes every twin into its folder.
    ///
    /// # Errors
    /// The system's refusal.
    pub(super) fn write(
        self,
        result: &FleetResult,
        model: &ModelFile,
        terminal: &mut Terminal,
    ) -> Outcome<()> {
        for asked in self.asked {
            let calibration = match &asked.robot {
                None => result.type_twin.as_ref(),
                Some(robot) => {
                    let own = result.twins.iter().find(|twin| twin.robot == *robot);
                    own.map(|twin| &twin.calibration)
                }
            };
            let Some(calibration) = calibration else {
                continue;
            };
            let stored = StoredTwin {
                gates: Gates::default(),
                read_as: None,
                context: ReportContext {
                    version: env!("CARGO_PKG_VERSION").into(),
                    robot: asked.robot.unwrap_or_else(|| model.robot.clone()),
                    model: model.name.clone(),
                    command: self.command.clone(),
                    settings: String::new(),
                    seed: self.seed,
                    config: None,
                    files: vec![FileHash {
                        name: display_names(&[Path::new(&model.name)]).remove(0),
                        sha256: sha256(model.text.as_bytes()),
                    }],
                },
                calibration: calibration.clone(),
            };
            let source = (stored_as(model), model.text.clone().into_bytes());
            stored.write(asked.claim, Maker::Fleet, String::new(), vec![source])?;
            terminal.complete(&asked.folder);
        }
        Ok(())
    }
}

/// The command that repeats the run; of very many files the first.
fn command(flags: &Flags) -> String {
    let shown = &flags.files[..flags.files.len().min(NAMED)];
    let names = display_names(shown).into_iter().map(|name| quoted(&name));
    let mut text = format!("twincal fleet {}", names.collect::<Vec<_>>().join(" "));
    if shown.len() < flags.files.len() {
        text.push_str(&format!(" … ({} files)", flags.files.len()));
    }
    text.push_str(&format!(" --window {} --seed {}", flags.window, flags.seed));
    text
}

/// `ROBOT=DIR`.
fn robot_and_folder(text: &str) -> Outcome<(Option<String>, PathBuf)> {
    match text.split_once('=') {
        Some((robot, folder)) if !robot.is_empty() && !folder.is_empty() => {
            Ok((Some(robot.to_owned()), PathBuf::from(folder)))
        }
        _ => Err(Failure::usage(
            format!("--twin {text}: no robot with a folder"),
            "give the robot's name and a folder, such as --twin ur5_07=twins/ur5_07",
        )),
    }
}

fn stored_as(model: &ModelFile) -> &'static str {
    match model.stored_as == MODEL_MJCF {
        true => MODEL_MJCF,
        false => MODEL_URDF,
    }
}

/// The model file with what is wrong for all robots put right: its name in the folder, and its bytes.
///
/// # Errors
/// [`twincal::Error::Refused`] where no physical inertia can be found, and an export that does not read back as what was meant.
pub(super) fn model_of_type(
    calibration: &Calibration,
    model: &ModelFile,
) -> Outcome<(&'static str, Vec<u8>)> {
    let (name, holds) = match stored_as(model) == MODEL_MJCF {
        true => (TYPE_MJCF, Holds::MJCF),
        false => (TYPE_URDF, Holds::URDF),
    };
    let settings = ModelSettings {
        allow_unphysical: true,
        ..ModelSettings::default()
    };
    let mut own = parse_model(&model.name, model.text.as_bytes(), &settings)?;
    // What counts as nominal was decided when the statistics were made.
    own.description = calibration.twin.robot.description().clone();
    let change = Writer::new(calibration, holds)?.mean()?;
    Ok((name, write_model(&own, &change)?))
}
