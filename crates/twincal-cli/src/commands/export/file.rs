//! The model file that an export writes: the fitted one with changed numbers, or a generated one of the other format.

use super::Kind;
use crate::args::Export;
use crate::failure::Outcome;
use twincal::robot::Robot;
use twincal::write_back::WriteBack;
use twincal_io::artifact::{Artifact, MODEL_MJCF, MODEL_URDF};
use twincal_io::export::generate::generate_model;
use twincal_io::export::write_model;
use twincal_io::model::{Model, ModelFormat, ModelSettings, parse_model};
use twincal_io::twin_json::StoredTwin;

/// What model files are made from.
pub(super) enum FileMaker {
    /// The user's file as it was fitted.
    Own(Box<Model>),
    /// The twin's robot; the fitted file is of the other format.
    Generated {
        format: ModelFormat,
        robot: Box<Robot>,
        from: String,
    },
}

/// A file that was made.
pub(super) struct ModelFile {
    pub(super) bytes: Vec<u8>,
    /// Of a generated file: what its format cannot hold or asks for. `None`: the user's own file.
    pub(super) notes: Option<Vec<String>>,
    /// Name of the model that was fitted.
    pub(super) from: String,
}

impl FileMaker {
    /// The twin, and what a file of this kind is made from.
    pub(super) fn read(flags: &Export, kind: Kind) -> Outcome<(StoredTwin, Self)> {
        let artifact = Artifact::open(&flags.twin)?;
        let stored = StoredTwin::read(&artifact, true)?;
        let (own, other) = match kind.format {
            ModelFormat::Urdf => (MODEL_URDF, MODEL_MJCF),
            ModelFormat::Mjcf => (MODEL_MJCF, MODEL_URDF),
        };
        let robot = &stored.calibration.twin.robot;
        if artifact.names().any(|name| name == other) {
            let maker = Self::Generated {
                format: kind.format,
                robot: Box::new(robot.clone()),
                from: stored.context.model.clone(),
            };
            return Ok((stored, maker));
        }
        let bytes = artifact.read(own)?;
        let settings = ModelSettings {
            allow_unphysical: true,
            ..ModelSettings::default()
        };
        let mut model = parse_model(&stored.context.model, &bytes, &settings)?;
        // What counts as nominal was decided when it was fitted.
        model.description = robot.description().clone();
        Ok((stored, Self::Own(Box::new(model))))
    }

    /// The file with a change; it reads back as what was meant.
    pub(super) fn file(&self, change: &WriteBack) -> Outcome<ModelFile> {
        match self {
            Self::Own(model) => Ok(ModelFile {
                bytes: write_model(model, change)?,
                notes: None,
                from: model.name().to_owned(),
            }),
            Self::Generated {
                format,
                robot,
                from,
            } => {
                let generated = generate_model(*format, robot, change, from)?;
                Ok(ModelFile {
                    bytes: generated.bytes,
                    notes: Some(generated.notes),
                    from: from.clone(),
                })
            }
        }
    }
}
