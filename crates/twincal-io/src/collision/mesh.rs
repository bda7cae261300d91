//! Corners of a mesh: STL (binary or text) and OBJ. Only where they are matters, not how they are joined.
//!
//! A header may claim any number of triangles: what counts is how many bytes there are.

use crate::model::{Form, MeshFile, seen_from};
use crate::open::InputFile;
use parry3d_f64::math::Vector;
use std::path::{Path, PathBuf};

/// Largest mesh, bytes.
const MAX_BYTES: u64 = 256 << 20;
/// Head of a binary STL, and one of its triangles, bytes.
const HEAD: usize = 84;
const TRIANGLE: usize = 50;
/// Largest coordinate, m.
pub(super) const FARTHEST: f64 = 1e4;

/// Corners of a mesh in its geometry's frame, or why there are none.
pub(super) fn corners(mesh: &MeshFile, model: &Path) -> Result<Vec<Vector>, String> {
    let name = mesh.file.rsplit('/').next().unwrap_or("");
    let end = name.rsplit_once('.').map_or("", |(_, end)| end);
    let end = end.to_ascii_lowercase();
    if !["stl", "obj"].contains(&end.as_str()) {
        return Err(format!(
            "`{}` is no STL or OBJ file",
            crate::model::shorten(name)
        ));
    }
    let Some(path) = find(mesh, model) else {
        return Err(format!(
            "`{}` is not there",
            crate::model::shorten(&mesh.file)
        ));
    };
    let bytes = (InputFile::new(&path, MAX_BYTES).read()).map_err(|refusal| refusal.to_string())?;
    let points = match end.as_str() {
        "stl" => stl(&bytes),
        _ => obj(&bytes),
    };
    let placed: Vec<Vector> = (points.into_iter())
        .map(|p| {
            seen_from(
                &mesh.reference,
                std::array::from_fn(|k| p[k] * mesh.scale[k]),
            )
            .into()
        })
        .collect();
    readable(placed, name)
}

/// Corners, where there are some and all are numbers that a robot can have.
fn readable(corners: Vec<Vector>, name: &str) -> Result<Vec<Vector>, String> {
    let fits = |p: &Vector| p.is_finite() && p.abs().max_element() < FARTHEST;
    match corners.is_empty() || !corners.iter().all(fits) {
        true => Err(format!(
            "`{}` has no corners that can be read",
            crate::model::shorten(name)
        )),
        false => Ok(corners),
    }
}

/// The file that a model means: `package://NAME/rest` is looked for in the folders above the model file.
fn find(mesh: &MeshFile, model: &Path) -> Option<PathBuf> {
    let absolute = std::path::absolute(model).ok()?;
    let folder = absolute.parent()?;
    let in_package = (mesh.file.strip_prefix("package://")).or(mesh.file.strip_prefix("model://"));
    let candidates: Vec<PathBuf> = match in_package {
        Some(rest) => {
            let (package, inside) = rest.split_once('/')?;
            let above = folder.ancestors().flat_map(|at| {
                let own = (at.file_name()? == package).then(|| at.join(inside));
                Some([own, Some(at.join(rest))])
            });
            above.flatten().flatten().collect()
        }
        None => {
            let file = mesh.file.strip_prefix("file://").unwrap_or(&mesh.file);
            vec![folder.join(&mesh.folder).join(file)]
        }
    };
    candidates.into_iter().find(|path| path.is_file())
}

/// Corners of an STL.
fn stl(bytes: &[u8]) -> Vec<[f64; 3]> {
    let count = bytes.get(80..HEAD).and_then(|n| n.try_into().ok());
    let count = count.map_or(0, |n: [u8; 4]| u32::from_le_bytes(n) as usize);
    // A text may begin like any binary head, and a head like a text: the length says which it is.
    if count > 0 && bytes.len() == HEAD + TRIANGLE * count {
        let triangles = bytes[HEAD..].chunks_exact(TRIANGLE);
        let corners = triangles.flat_map(|triangle| triangle[12..48].chunks_exact(12));
        return corners
            .map(|corner| std::array::from_fn(|k| single(corner, 4 * k)))
            .collect();
    }
    text(bytes, "vertex")
}

/// A little-endian float at a place.
fn single(bytes: &[u8], at: usize) -> f64 {
    let own = [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
    f64::from(f32::from_le_bytes(own))
}

/// Corners of an OBJ.
fn obj(bytes: &[u8]) -> Vec<[f64; 3]> {
    text(bytes, "v")
}

/// The three numbers behind a word at the beginning of lines.
fn text(bytes: &[u8], word: &str) -> Vec<[f64; 3]> {
    let lines = bytes.split(|byte| *byte == b'\n' || *byte == b'\r');
    let numbers = lines.filter_map(|line| {
        let mut words = std::str::from_utf8(line).ok()?.split_ascii_whitespace();
        (words.next()? == word).then_some(())?;
        let mut next = || words.next()?.parse().ok();
        Some([next()?, next()?, next()?])
    });
    numbers.collect()
}

/// Corners of a form that has some; `None` for a primitive.
pub(super) fn of_form(form: &Form, model: &Path) -> Option<Result<Vec<Vector>, String>> {
    match form {
        Form::Mesh(mesh) => Some(corners(mesh, model)),
        Form::Points(points) => {
            let points = points.iter().map(|p| Vector::from(*p)).collect();
            Some(readable(points, "vertex"))
        }
        Form::Other(what) => Some(Err(format!("{what} has no convex hull"))),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn binary(corners: &[[f32; 3]], count: u32) -> Vec<u8> {
        let mut bytes = b"solid that is none".to_vec();
        bytes.resize(80, 0);
        bytes.extend(count.to_le_bytes());
        for triangle in corners.chunks(3) {
            bytes.extend([0; 12]);
            bytes.extend(triangle.iter().flatten().flat_map(|x| x.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    #[test]
    fn corners_are_read_from_all_three_kinds() {
        let triangle = [[0.0, 0.5, 1.0], [1.0, 0.0, 0.0], [0.0, -2.0, 0.25]];
        let wanted = triangle.map(|p: [f32; 3]| p.map(f64::from)).to_vec();
        assert_eq!(stl(&binary(&triangle, 1)), wanted);
        let facet = "solid x\nfacet normal 0 0 1\n outer loop\n vertex 0 0.5 1\r\n vertex 1 0 0\n vertex 0 -2e0 .25\n endloop";
        assert_eq!(stl(facet.as_bytes()), wanted);
        let obj_text = "# v 9 9 9\nvn 0 0 1\nv 0 0.5 1 1.0\nv 1 0 0\nv 0 -2 0.25\nf 1 2 3\n";
        assert_eq!(obj(obj_text.as_bytes()), wanted);
    }

    /// A head that claims four thousand million triangles reserves nothing.
    #[test]
    fn damaged_meshes_have_no_corners() {
        let triangle = [[0.0, 0.5, 1.0], [1.0, 0.0, 0.0], [0.0, -2.0, 0.25]];
        assert!(stl(&binary(&triangle, u32::MAX)).is_empty());
        assert!(stl(&binary(&triangle, 1)[..100]).is_empty());
        assert!(stl(b"").is_empty() && obj(b"v 1 2\nv a b c\n\xff\xfe").is_empty());
    }
}
