//! `<compiler>`: how angles, orientations and inertias are meant.

use super::super::xml::{Document, Element, shorten};
use super::defaults::View;
use crate::error::Result;
use twincal::robot::Placement;
use twincal::robot::spatial::{
    IDENTITY, Matrix, Vector, add, axis_angle, cross, dot, multiply, norm, quaternion, scale,
    transpose, z_to,
};

/// When inertias come from geoms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FromGeom {
    /// Never.
    No,
    /// Always.
    Yes,
    /// Where a body has no `<inertial>`.
    Auto,
}

/// Settings of all `<compiler>` elements; a later one overrides.
#[derive(Debug, Clone)]
pub(super) struct Compiler {
    /// Radians per unit of angle in the file.
    pub(super) angle: f64,
    eulerseq: String,
    pub(super) autolimits: bool,
    pub(super) inertia_from_geom: FromGeom,
    pub(super) group_range: [f64; 2],
    pub(super) balance: bool,
    pub(super) bound_mass: f64,
    pub(super) bound_inertia: f64,
    pub(super) total_mass: f64,
}

impl Compiler {
    /// Reads all `<compiler>` elements under the root.
    ///
    /// # Errors
    /// For values that MuJoCo does not know and for global coordinates.
    pub(super) fn read(document: &Document, root: &Element) -> Result<Self> {
        let mut settings = Self {
            angle: std::f64::consts::PI / 180.0,
            eulerseq: "xyz".into(),
            autolimits: true,
            inertia_from_geom: FromGeom::Auto,
            group_range: [0.0, 5.0],
            balance: false,
            bound_mass: 0.0,
            bound_inertia: 0.0,
            total_mass: -1.0,
        };
        for element in document.children(root, "compiler") {
            let view = View::plain(document, element);
            let wrong = |name: &str, remedy: &str| {
                let value = shorten(element.text(name).unwrap_or(""));
                Err(document.error(element, format!("<compiler> {name}=\"{value}\""), remedy))
            };
            match element.text("angle") {
                Some("degree") => settings.angle = std::f64::consts::PI / 180.0,
                Some("radian") => settings.angle = 1.0,
                Some(_) => return wrong("angle", "it is degree or radian"),
                None => {}
            }
            if let Some(sequence) = element.text("eulerseq") {
                if sequence.len() != 3 || !sequence.chars().all(|c| "xyzXYZ".contains(c)) {
                    return wrong("eulerseq", "it is three letters of x, y, z, X, Y, Z");
                }
                settings.eulerseq = sequence.into();
            }
            match element.text("coordinate") {
                Some("local") | None => {}
                Some(_) => {
                    return wrong(
                        "coordinate",
                        "save the model with MuJoCo 2.3.3, which writes local coordinates",
                    );
                }
            }
            match element.text("inertiafromgeom") {
                Some("true") => settings.inertia_from_geom = FromGeom::Yes,
                Some("false") => settings.inertia_from_geom = FromGeom::No,
                Some("auto") => settings.inertia_from_geom = FromGeom::Auto,
                Some(_) => return wrong("inertiafromgeom", "it is true, false or auto"),
                None => {}
            }
            settings.autolimits = view.flag("autolimits").unwrap_or(settings.autolimits);
            settings.balance = view.flag("balanceinertia").unwrap_or(settings.balance);
            settings.group_range = view
                .numbers("inertiagrouprange")?
                .unwrap_or(settings.group_range);
            settings.bound_mass = view.number("boundmass")?.unwrap_or(settings.bound_mass);
            settings.bound_inertia = view
                .number("boundinertia")?
                .unwrap_or(settings.bound_inertia);
            settings.total_mass = view.number("settotalmass")?.unwrap_or(settings.total_mass);
        }
        Ok(settings)
    }

    /// Why an `<inertial>` is not what the simulator uses, if it is not.
    pub(super) fn overrides(&self) -> Option<&'static str> {
        if self.inertia_from_geom == FromGeom::Yes {
            Some("inertiafromgeom=\"true\"")
        } else if self.total_mass > 0.0 {
            Some("settotalmass")
        } else {
            None
        }
    }

    /// `pos` and the orientation of an element in its parent.
    ///
    /// # Errors
    /// At the attribute that cannot be read, or for two orientations in one element.
    pub(super) fn placement(&self, view: &View<'_, '_>) -> Result<Placement> {
        Ok(Placement {
            rotation: self.rotation(view)?,
            translation: view.numbers("pos")?.unwrap_or([0.0; 3]),
        })
    }

    /// `refquat` of a mesh: orientation of the frame that it is seen from.
    ///
    /// # Errors
    /// At the attribute that is no orientation.
    pub(super) fn reference_rotation(&self, view: &View<'_, '_>) -> Result<Matrix> {
        let Some((element, attribute)) = view.get("refquat") else {
            return Ok(IDENTITY);
        };
        let document = view.document;
        quaternion(document.exactly(element, attribute)?).ok_or_else(|| {
            let problem = format!(
                "refquat=\"{}\" is no orientation",
                shorten(&attribute.value)
            );
            document.attribute_error(
                element,
                attribute,
                problem,
                "give four numbers, not all zero",
            )
        })
    }

    /// Orientation by `quat`, `axisangle`, `xyaxes`, `zaxis` or `euler`.
    pub(super) fn rotation(&self, view: &View<'_, '_>) -> Result<Matrix> {
        const WAYS: [&str; 5] = ["quat", "axisangle", "xyaxes", "zaxis", "euler"];
        let own: Vec<&str> = WAYS
            .into_iter()
            .filter(|w| view.element.get(w).is_some())
            .collect();
        let ways = if own.is_empty() {
            WAYS.into_iter().filter(|w| view.get(w).is_some()).collect()
        } else {
            own
        };
        let (way, (element, attribute)) = match ways[..] {
            [] => return Ok(IDENTITY),
            [way] => match view.get(way) {
                Some(found) => (way, found),
                None => return Ok(IDENTITY),
            },
            _ => {
                return Err(view.document.error(
                    view.element,
                    format!(
                        "<{}> has several orientations ({})",
                        view.element.name,
                        ways.join(", ")
                    ),
                    "give one",
                ));
            }
        };
        let document = view.document;
        let rotation = match way {
            "quat" => quaternion(document.exactly(element, attribute)?),
            "axisangle" => {
                let [x, y, z, angle] = document.exactly(element, attribute)?;
                unit([x, y, z]).map(|axis| axis_angle(axis, angle * self.angle))
            }
            "xyaxes" => {
                let [a, b, c, d, e, f] = document.exactly(element, attribute)?;
                xy_axes([a, b, c], [d, e, f])
            }
            "zaxis" => unit(document.exactly(element, attribute)?).map(z_to),
            _ => self.euler(document.exactly(element, attribute)?),
        };
        match rotation {
            Some(rotation) => Ok(rotation),
            None => Err(document.attribute_error(
                element,
                attribute,
                format!(
                    "<{}> {way}=\"{}\" is no orientation",
                    element.name,
                    shorten(&attribute.value)
                ),
                "give finite numbers, not all zero",
            )),
        }
    }

    /// Rotations in the order of `eulerseq`: lower case about moving axes, upper case about fixed ones.
    fn euler(&self, angles: Vector) -> Option<Matrix> {
        let mut total = IDENTITY;
        for (letter, angle) in self.eulerseq.chars().zip(angles) {
            let axis = match letter.to_ascii_lowercase() {
                'x' => [1.0, 0.0, 0.0],
                'y' => [0.0, 1.0, 0.0],
                _ => [0.0, 0.0, 1.0],
            };
            let turn = axis_angle(axis, angle * self.angle);
            total = if letter.is_ascii_lowercase() {
                multiply(&total, &turn)
            } else {
                multiply(&turn, &total)
            };
        }
        angles.iter().all(|a| a.is_finite()).then_some(total)
    }
}

fn unit(v: Vector) -> Option<Vector> {
    let length = norm(v);
    (length.is_finite() && length > 0.0).then(|| scale(1.0 / length, v))
}

/// X along the first, Y the second made orthogonal to it, Z = X × Y.
fn xy_axes(x: Vector, y: Vector) -> Option<Matrix> {
    let x = unit(x)?;
    let y = unit(add(y, scale(-dot(x, y), x)))?;
    Some(transpose(&[x, y, cross(x, y)]))
}
