//! Robot models: URDF and MJCF files into a [`RobotDescription`]; the root element decides which of the two it is.
//!
//! Only kinematics, inertias and what makes nominal torque are read; [`Model::geometry`] says where the meshes are.

pub(crate) mod xml;
mod include;
pub(crate) mod mjcf;
mod shapes;
mod urdf;
mod urdf_shapes;

use crate::error::{Error, Place, Result};
use crate::log::MAX_NAME;
use crate::open::{InputFile, Refusal};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use twincal::Finding;
use twincal::robot::spatial::{apply, roll_pitch_yaw, transpose};
use twincal::robot::{Robot, RobotDescription};
use xml::{Document, Element};

pub(crate) use mjcf::seen_from;
pub use shapes::{Form, Geometry, LinkShape, MeshFile};
pub(crate) use xml::shorten;

/// Attributes that are names.
const NAMES: [&str; 10] = [
    "name",
    "model",
    "link",
    "joint",
    "joint1",
    "joint2",
    "class",
    "childclass",
    "type",
    "file",
];
/// Most links of a model.
const MAX_LINKS: usize = 10_000;

/// What the user may say about a model.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ModelSettings {
    /// Gravity, m/s², instead of the file's (URDF has none: 0, 0, −9.81): in the base frame, with `base_rpy` in the world's.
    pub gravity: Option<[f64; 3]>,
    /// Orientation of the base (URDF's root link, MJCF's world) in the real world, as URDF's fixed-axis roll, pitch and yaw,
    /// rad: R = R_z(yaw) R_y(pitch) R_x(roll). Gravity in the base frame is then Rᵀ g.
    pub base_rpy: Option<[f64; 3]>,
    /// Count the `damping` of URDF `<dynamics>` as nominal torque.
    pub use_urdf_friction: bool,
    /// Physically impossible inertias are a finding instead of an error.
    pub allow_unphysical: bool,
}

/// Which of the two a file is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ModelFormat {
    /// `<robot>`.
    Urdf,
    /// `<mujoco>`.
    Mjcf,
}

/// A model file as read.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// What it says, unchecked.
    pub description: RobotDescription,
    /// The bytes of the file (of the main file, where there are includes).
    pub bytes: Vec<u8>,
    /// What had to be assumed or was not used.
    pub findings: Vec<Finding>,
    /// Where everything stands, for messages.
    document: Document,
    /// Where MJCF bodies and joints stand, for export; empty for URDF.
    sites: mjcf::Sites,
}

impl Model {
    /// The checked robot and all findings, those of the file first. `locked` fixes moving joints at a position.
    ///
    /// # Errors
    /// What [`Robot::new`] refuses, with the place of the link or joint in the file.
    pub fn robot(&self, locked: &BTreeMap<String, f64>) -> Result<(Robot, Vec<Finding>)> {
        match Robot::new(self.description.clone(), locked) {
            Ok((robot, more)) => {
                let findings = self.findings.iter().cloned().chain(more).collect();
                Ok((robot, findings))
            }
            Err(twincal::Error::Model {
                culprit,
                problem,
                remedy,
            }) => Err(Error::content(
                self.place(&culprit),
                format!("{culprit}: {problem}"),
                remedy,
            )),
            Err(other) => Err(other.into()),
        }
    }

    /// What kind of file it is.
    pub fn format(&self) -> ModelFormat {
        match self.document.elements.first() {
            Some(root) if root.name == "mujoco" => ModelFormat::Mjcf,
            _ => ModelFormat::Urdf,
        }
    }

    /// Name of the main file, as shown to people.
    pub fn name(&self) -> &str {
        self.document.files.first().map_or("", |f| f.name.as_str())
    }

    /// What the file calls the robot (`<robot name>`, `<mujoco model>`); empty without.
    pub fn robot_name(&self) -> &str {
        let root = self.document.elements.first();
        let names = ["name", "model"];
        let named = root.and_then(|root| names.iter().find_map(|name| root.text(name)));
        named.map_or("", str::trim)
    }

    /// Where its bodies and joints stand (MJCF).
    pub(crate) fn sites(&self) -> &mjcf::Sites {
        &self.sites
    }

    /// Its elements.
    pub(crate) fn document(&self) -> &Document {
        &self.document
    }

    /// Where "link `x`" or "joint `x`" is defined (the last time, if twice); else the file.
    fn place(&self, culprit: &str) -> Place {
        let defines = |element: &&Element| {
            let kind = match element.name.as_str() {
                "link" | "body" => "link",
                "joint" | "freejoint" => "joint",
                _ => return false,
            };
            let name = element.text("name").unwrap_or("");
            culprit
                .strip_prefix(kind)
                .is_some_and(|rest| rest.trim() == format!("`{name}`"))
        };
        match self.document.elements.iter().rfind(defines) {
            Some(element) => self.document.place(element),
            None => Place::file(self.name()),
        }
    }
}

/// Reads a URDF or MJCF file; MJCF includes are followed inside the file's folder only.
///
/// # Errors
/// [`Error`] with file, line and column: not readable, too large, not XML, a kind of joint that twincal does not
/// support, a number that is none, a format that must be converted first.
///
/// # Example
/// A pendulum on the moon; `path` is its URDF.
/// ```
/// use twincal_io::model::{ModelFormat, ModelSettings, read_model};
///
/// # let text = r#"<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="1"/>
/// # <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
/// # <joint name="pivot" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"#;
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("arm.urdf");
/// # std::fs::write(&path, text)?;
/// let settings = ModelSettings { gravity: Some([0.0, 0.0, -1.62]), ..ModelSettings::default() };
/// let model = read_model(&path, &settings)?;
/// assert_eq!((model.format(), model.robot_name()), (ModelFormat::Urdf, "pendulum"));
/// let (robot, findings) = model.robot(&Default::default())?; // no joint locked
/// assert_eq!(robot.description().gravity[2], -1.62);
/// for finding in &findings {
///     println!("{}", finding.message); // what the file left to be assumed
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_model(path: &Path, settings: &ModelSettings) -> Result<Model> {
    let name = path.display().to_string();
    refuse_by_extension(&name, path)?;
    let bytes = read_limited(path, &name)?;
    parse(&name, bytes, Some(path), settings)
}

/// The files that a model consists of: itself and what an MJCF includes, as far as it can be read.
pub fn files_of(path: &Path) -> Vec<PathBuf> {
    let mut files = vec![path.to_owned()];
    let name = path.display().to_string();
    // A pipe can be read once.
    if path.is_file()
        && let Ok(bytes) = read_limited(path, &name)
    {
        let mut document = Document::default();
        // What is wrong with it is said when the model is read.
        let _ = (document.parse(&name, &bytes))
            .and_then(|_| include::expand(&mut document, Some(path)));
        let included = document.files.iter().skip(1);
        files.extend(included.map(|file| path.with_file_name("").join(&file.name)));
    }
    files
}

/// Reads a model from memory; `name` stands in messages. MJCF includes are refused.
///
/// # Errors
/// As [`read_model`].
pub fn parse_model(name: &str, bytes: &[u8], settings: &ModelSettings) -> Result<Model> {
    refuse_by_extension(name, Path::new(name))?;
    parse(name, bytes.to_vec(), None, settings)
}

fn parse(
    name: &str,
    bytes: Vec<u8>,
    path: Option<&Path>,
    settings: &ModelSettings,
) -> Result<Model> {
    refuse_usd(name, &bytes)?;
    let mut document = Document::default();
    document.parse(name, &bytes)?;
    if document.elements[0].name == "mujoco" {
        include::expand(&mut document, path)?;
    }
    refuse_too_many(&document)?;
    refuse_long_names(&document)?;
    let root = &document.elements[0];
    let mut sites = mjcf::Sites::default();
    let (mut description, findings) = match root.name.as_str() {
        "robot" => urdf::read(&document, settings)?,
        "mujoco" => {
            let (description, findings, where_they_stand) = mjcf::read(&document)?;
            sites = where_they_stand;
            (description, findings)
        }
        "sdf" => {
            return Err(document.error(
                root,
                "this is an SDF file, twincal reads URDF and MJCF",
                "convert it: sdf2mjcf of the Python package sdformat-mjcf, as in sdf2mjcf model.sdf model.xml",
            ));
        }
        other => {
            return Err(document.error(
                root,
                format!("the root element is <{}>", xml::shorten(other)),
                "a URDF begins with <robot>, an MJCF with <mujoco>",
            ));
        }
    };
    if description.links.len() > MAX_LINKS {
        return Err(too_many(root, &document, description.links.len()));
    }
    if let Some(gravity) = settings.gravity {
        description.gravity = gravity;
    }
    if let Some(angles) = settings.base_rpy {
        let base = roll_pitch_yaw(angles);
        description.gravity = apply(&transpose(&base), description.gravity);
    }
    description.allow_unphysical = settings.allow_unphysical;
    Ok(Model {
        description,
        bytes,
        findings,
        document,
        sites,
    })
}

/// Refuses links and bodies beyond the limit before anything is made of them.
fn refuse_too_many(document: &Document) -> Result<()> {
    let is_link = |element: &&Element| matches!(element.name.as_str(), "link" | "body");
    let links = || document.elements.iter().filter(is_link);
    match links().nth(MAX_LINKS) {
        Some(first_beyond) => Err(too_many(first_beyond, document, links().count())),
        None => Ok(()),
    }
}

/// Refuses names that no program writes: they would fill every message and table.
fn refuse_long_names(document: &Document) -> Result<()> {
    for element in &document.elements {
        let mut names = element.attributes.iter().filter(|attribute| {
            attribute.value.len() > MAX_NAME && NAMES.contains(&attribute.name.as_str())
        });
        if let Some(long) = names.next() {
            let problem = format!(
                "<{}> {}=\"{}\" has {} bytes, the limit is {MAX_NAME}",
                xml::shorten(&element.name),
                long.name,
                xml::shorten(&long.value),
                long.value.len()
            );
            return Err(document.attribute_error(element, long, problem, "give it a shorter name"));
        }
    }
    Ok(())
}

fn too_many(at: &Element, document: &Document, links: usize) -> Error {
    let problem = format!("the model has {links} links, the limit is {MAX_LINKS}");
    document.error(at, problem, "no robot has so many: is it the right model?")
}

/// A file's bytes, never more than the limit.
fn read_limited(path: &Path, name: &str) -> Result<Vec<u8>> {
    match InputFile::new(path, xml::MAX_BYTES as u64).read() {
        Ok(bytes) => Ok(bytes),
        Err(Refusal::TooLarge { bytes, .. }) => xml::too_large(name, bytes),
        Err(refusal) => Err(refusal.into_error(name, "give a URDF or MJCF file")),
    }
}

/// Files that must be turned into URDF or MJCF first, by their name.
fn refuse_by_extension(name: &str, path: &Path) -> Result<()> {
    let extension = path
        .extension()
        .map(|e| e.to_string_lossy().to_ascii_lowercase())
        .unwrap_or_default();
    let stem = path
        .file_stem()
        .map(|s| s.to_string_lossy().into_owned())
        .unwrap_or_default();
    let stem = stem.strip_suffix(".urdf").unwrap_or(&stem);
    match extension.as_str() {
        "xacro" => Err(Error::content(
            Place::file(name),
            "this is a xacro template, not a URDF",
            format!("expand it: xacro '{name}' > '{stem}.urdf'"),
        )),
        "usd" | "usda" | "usdc" | "usdz" => usd_error(name),
        _ => Ok(()),
    }
}

fn refuse_usd(name: &str, bytes: &[u8]) -> Result<()> {
    if bytes.starts_with(b"PXR-USDC") || bytes.starts_with(b"#usda") {
        usd_error(name)
    } else {
        Ok(())
    }
}

fn usd_error(name: &str) -> Result<()> {
    Err(Error::content(
        Place::file(name),
        "this is a USD file, twincal reads URDF and MJCF",
        "convert it: Isaac Sim's USD to URDF exporter, or the Python package nvidia-srl-usd-to-urdf",
    ))
}
