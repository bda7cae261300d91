//! The calibrated model as files: the user's own model with only the changed numbers changed, or a whole file of the other format.

pub mod code;
mod edit;
pub mod generate;
mod mjcf;
mod urdf;
#[cfg(test)]
mod tests;

use crate::error::{Error, Result};
use crate::model::{Model, ModelFormat, ModelSettings, parse_model};
use twincal::robot::Inertia;
use twincal::write_back::WriteBack;

/// What a file says at a link whose inertia is no body's.
const NO_BODY: &str = "<!-- twincal: the inertia that was found here is physically inconsistent. These numbers are a body with the \
                       nearest torque: do not read them as mass or inertia of this link. -->";

/// The user's file with the change, byte by byte the same elsewhere.
///
/// # Errors
/// [`Error::Content`] at the place in the file that cannot hold a change; [`Error::Internal`] if what was written does not
/// read back as what was meant.
///
/// # Example
/// `text` is the URDF of a pendulum of 1 kg. Its mass changes, and with it one number of the file.
/// ```
/// use twincal::write_back::{LinkChange, WriteBack};
/// use twincal_io::export::write_model;
/// use twincal_io::model::parse_model;
///
/// # let text = r#"<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="1"/>
/// # <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
/// # <joint name="pivot" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"#;
/// let model = parse_model("pendulum.urdf", text.as_bytes(), &Default::default())?;
/// let before = model.description.links[1].inertia;
/// let mut after = before.ok_or("no inertia")?;
/// after.mass = 1.5;
/// let link = LinkChange { link: "rod".into(), before, after, no_body: false }; // as of `twincal::write_back::Writer`
/// let change = WriteBack { links: vec![link], ..WriteBack::default() };
/// let written = String::from_utf8(write_model(&model, &change)?)?;
/// assert_eq!(written, text.replace("<mass value=\"1\"/>", "<mass value=\"1.5\"/>"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_model(model: &Model, change: &WriteBack) -> Result<Vec<u8>> {
    let bytes = match model.format() {
        ModelFormat::Urdf => urdf::write(model, change)?,
        ModelFormat::Mjcf => mjcf::write(model, change)?,
    };
    verify(model, change, &bytes)?;
    Ok(bytes)
}

/// Largest share by which a number that was read back may differ: twelve digits are written.
const DIGITS: f64 = 1e-9;

/// Reads back what was written: the inertias are those that were meant.
fn verify(model: &Model, change: &WriteBack, bytes: &[u8]) -> Result<()> {
    let again = parse_model(model.name(), bytes, &ModelSettings::default())?;
    for link in &change.links {
        let mut links = again.description.links.iter();
        let found = links.find(|other| other.name == link.link);
        let found = found.and_then(|link| link.inertia);
        if !found.is_some_and(|found| close(&found, &link.after)) {
            return Err(Error::Internal {
                what: format!("export of link `{}`", link.link),
                problem: format!("meant {:?}, reads back as {found:?}", link.after),
            });
        }
    }
    Ok(())
}

fn close(a: &Inertia, b: &Inertia) -> bool {
    let size = |i: &Inertia| {
        i.tensor
            .as_flattened()
            .iter()
            .fold(0.0_f64, |m, x| m.max(x.abs()))
    };
    let length = |i: &Inertia| i.com.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let near = |x: f64, y: f64, size: f64| (x - y).abs() <= DIGITS * size;
    near(a.mass, b.mass, b.mass)
        && a.com
            .iter()
            .zip(b.com)
            .all(|(x, y)| near(*x, y, length(b).max(1e-6)))
        && (a.tensor.as_flattened().iter().zip(b.tensor.as_flattened()))
            .all(|(x, y)| near(*x, *y, size(b)))
}
