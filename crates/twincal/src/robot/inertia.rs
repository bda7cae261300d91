//! Rigid-body inertia: is it physically possible, and how inertias move to another frame and add.

use super::spatial::{IDENTITY, Matrix, add, rotate_tensor, scale};
use super::{Inertia, Placement};
use crate::error::{Code, Error, Finding, Result, Severity};

/// Rounding that a file may show: a thin rod or a flat plate sits exactly on the bound of what is possible.
const TOLERANCE: f64 = 1e-9;

/// Mass, first moments and inertia about the ORIGIN of a frame: the three that simply add.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Moments {
    /// kg.
    pub(crate) mass: f64,
    /// mass × centre of mass, kg·m.
    pub(crate) first: [f64; 3],
    /// About the frame's origin, kg·m².
    pub(crate) tensor: Matrix,
}

impl Moments {
    /// The inertia of a link whose frame sits at `placement`, seen from the outer frame.
    pub(crate) fn placed(inertia: &Inertia, placement: &Placement) -> Self {
        let com = placement.point(inertia.com);
        let about_com = rotate_tensor(&placement.rotation, &inertia.tensor);
        // Parallel axes (Steiner): I_origin = I_com + m (|c|² E − c cᵀ)
        let square = com[0] * com[0] + com[1] * com[1] + com[2] * com[2];
        let tensor = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let diagonal = if i == j { square } else { 0.0 };
                about_com[i][j] + inertia.mass * (diagonal - com[i] * com[j])
            })
        });
        Self {
            mass: inertia.mass,
            first: scale(inertia.mass, com),
            tensor,
        }
    }

    /// Both bodies as one.
    pub(crate) fn plus(&self, other: &Self) -> Self {
        let tensor = std::array::from_fn(|i| add(self.tensor[i], other.tensor[i]));
        Self {
            mass: self.mass + other.mass,
            first: add(self.first, other.first),
            tensor,
        }
    }
}

/// Principal moments of a symmetric matrix in increasing order, with their axes as the columns of a rotation (up to
/// sign): `tensor = R diag(moments) Rᵀ`. Jacobi rotations, error about 1e-16 of the norm.
pub fn principal_axes(tensor: &Matrix) -> ([f64; 3], Matrix) {
    let mut a = *tensor;
    let mut r = IDENTITY;
    for _ in 0..30 {
        if a[0][1] == 0.0 && a[0][2] == 0.0 && a[1][2] == 0.0 {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            // t = tan of the angle that makes a[p][q] zero, the smaller root
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let c = 1.0 / t.hypot(1.0);
            let s = t * c;
            for k in 0..3 {
                (a[k][p], a[k][q]) = (c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]);
                (r[k][p], r[k][q]) = (c * r[k][p] - s * r[k][q], s * r[k][p] + c * r[k][q]);
            }
            for k in 0..3 {
                (a[p][k], a[q][k]) = (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
            }
            (a[p][q], a[q][p]) = (0.0, 0.0);
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &k| a[i][i].total_cmp(&a[k][k]));
    (order.map(|i| a[i][i]), r.map(|row| order.map(|i| row[i])))
}

/// Largest mass, length, moment of inertia or drive constant of a model, SI units: far above every machine, and far below numbers whose
/// products overflow.
pub(crate) const LARGEST: f64 = 1e12;

/// Refuses what no body can have: a mass that is not positive, a tensor that is not positive definite or breaks the
/// triangle inequality (one principal moment above the sum of the others). Thin rods, flat plates and point masses are
/// the bounds and pass. With `allow_unphysical` an impossible tensor, or a tensor without mass, is a finding.
///
/// # Errors
/// [`Error::Model`] naming the link.
pub(crate) fn check(
    link: &str,
    inertia: &Inertia,
    allow_unphysical: bool,
) -> Result<Option<Finding>> {
    let Inertia { mass, tensor, .. } = inertia;
    let zero_tensor = tensor.as_flattened().iter().all(|&v| v == 0.0);
    let hollow = *mass == 0.0 && !zero_tensor;
    if !mass.is_finite() || *mass < 0.0 || (hollow && !allow_unphysical) {
        return refuse(
            link,
            format!("mass is {mass} kg"),
            "give it a positive mass (0 only for a link without any inertia)",
        );
    }
    check_numbers(link, inertia)?;
    if *mass == 0.0 && zero_tensor {
        return Ok(None);
    }
    if zero_tensor {
        return Ok(Some(Finding::new(
            Severity::Note,
            Code::PointMass,
            link,
            format!(
                "link `{link}`: {mass} kg with inertia tensor 0: taken as a point mass. What its real tensor adds will be reported as motor inertia \
                 of its joint or as the tensor of another link; give the link its own in the model where you know it"
            ),
            1,
        )
        .with([("mass", *mass)])));
    }
    let Some(problem) = impossible(tensor, hollow) else {
        return Ok(None);
    };
    if !allow_unphysical {
        return refuse(
            link,
            problem,
            "no body has such an inertia: correct the model (tensor about the centre of mass, axes of its own frame), \
             or go on with a warning by allow = [\"unphysical_inertia\"]",
        );
    }
    let message =
        format!("link `{link}`: {problem}; used as it is because unphysical inertias are allowed");
    let ([i1, i2, i3], _) = principal_axes(tensor);
    Ok(Some(
        Finding::new(Severity::Warning, Code::UnphysicalInertia, link, message, 1).with([
            ("principal_moment_1", i1),
            ("principal_moment_2", i2),
            ("principal_moment_3", i3),
        ]),
    ))
}

fn refuse<T>(link: &str, problem: String, remedy: &str) -> Result<T> {
    Err(Error::Model {
        culprit: format!("link `{link}`"),
        problem,
        remedy: remedy.into(),
    })
}

/// Numbers are finite and within [`LARGEST`], and the tensor is symmetric.
fn check_numbers(link: &str, inertia: &Inertia) -> Result<()> {
    let Inertia { mass, com, tensor } = inertia;
    if !com.iter().all(|v| v.is_finite()) {
        return refuse(
            link,
            format!("centre of mass is {com:?}"),
            "give three finite numbers in m",
        );
    }
    if !tensor.as_flattened().iter().all(|v| v.is_finite()) {
        return refuse(
            link,
            format!("inertia tensor is {tensor:?}"),
            "give six finite numbers in kg·m²",
        );
    }
    let numbers = [(mass, "mass", "kg")].into_iter();
    let numbers = numbers.chain(com.iter().map(|v| (v, "centre of mass", "m")));
    let tensor_entries = tensor.as_flattened().iter();
    let mut numbers =
        numbers.chain(tensor_entries.map(|v| (v, "an entry of the inertia tensor", "kg·m²")));
    if let Some((value, what, unit)) = numbers.find(|(v, ..)| v.abs() > LARGEST) {
        return refuse(
            link,
            format!("{what} is {value:e} {unit}, the limit is {LARGEST:e}"),
            "correct the number or its unit",
        );
    }
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let (a, b) = (tensor[i][j], tensor[j][i]);
        if (a - b).abs() > TOLERANCE * (tensor[i][i].abs() + tensor[j][j].abs()) {
            return refuse(
                link,
                format!("inertia tensor is not symmetric ({a} and {b})"),
                "make it symmetric",
            );
        }
    }
    Ok(())
}

/// Why no body has such a tensor about its centre of mass; `hollow`: it has no mass.
fn impossible(tensor: &Matrix, hollow: bool) -> Option<String> {
    let ([i1, i2, i3], _) = principal_axes(tensor);
    let problem = if hollow {
        format!("it has an inertia tensor (up to {i3:.4e} kg·m²) but no mass")
    } else if i1 < -TOLERANCE * i3.abs() || i3 <= 0.0 {
        format!(
            "inertia tensor is not positive definite (principal moments {i1:.4e}, {i2:.4e}, {i3:.4e} kg·m²)"
        )
    } else if i3 > (i1 + i2) * (1.0 + TOLERANCE) + TOLERANCE * i3 {
        format!(
            "inertia tensor breaks the triangle inequality: principal moment {i3:.4e} is more than {i1:.4e} + {i2:.4e} kg·m²"
        )
    } else {
        return None;
    };
    Some(problem)
}

#[cfg(test)]
mod tests {
    use super::super::spatial::{axis_angle, norm};
    use super::*;

    fn diagonal(d: [f64; 3]) -> Matrix {
        std::array::from_fn(|i| scale(d[i], IDENTITY[i]))
    }

    #[test]
    fn principal_moments_survive_rotation() {
        let u = scale(1.0 / norm([1.0, 2.0, -0.5]), [1.0, 2.0, -0.5]);
        for d in [
            [1.0, 2.0, 2.5],
            [1e-12, 1.0, 1.0],
            [3.0, 3.0, 3.0],
            [-1.0, 0.0, 4.0],
        ] {
            for angle in [0.0, 1e-9, 0.3, 1.5, 2.9] {
                let tensor = rotate_tensor(&axis_angle(u, angle), &diagonal(d));
                let (found, axes) = principal_axes(&tensor);
                let again = rotate_tensor(&axes, &diagonal(found));
                for i in 0..3 {
                    assert!(
                        (found[i] - d[i]).abs() < 4e-15,
                        "{d:?} at {angle}: {found:?}"
                    );
                    for k in 0..3 {
                        assert!((again[i][k] - tensor[i][k]).abs() < 8e-15, "{again:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn possible_and_impossible() {
        let body = |mass, d| Inertia {
            mass,
            com: [0.1, 0.0, 0.0],
            tensor: diagonal(d),
        };
        let turned = |d| Inertia {
            mass: 1.0,
            com: [0.0; 3],
            tensor: rotate_tensor(&axis_angle([0.6, 0.0, 0.8], 0.77), &diagonal(d)),
        };
        // On the bound: thin rod, flat plate, also after a rotation that rounds.
        for ok in [
            body(1.0, [0.0, 2.0, 2.0]),
            body(1.0, [1.0, 2.0, 3.0]),
            turned([0.0, 2.0, 2.0]),
            turned([1.0, 2.0, 3.0]),
        ] {
            assert_eq!(check("l", &ok, false), Ok(None), "{ok:?}");
        }
        assert_eq!(check("l", &body(0.0, [0.0; 3]), false), Ok(None));
        assert_eq!(
            check("l", &body(1.0, [0.0; 3]), false)
                .unwrap()
                .unwrap()
                .code,
            Code::PointMass
        );
        for bad in [f64::NAN, f64::INFINITY, -1.0] {
            let text = check("fore", &body(bad, [1.0; 3]), true)
                .unwrap_err()
                .to_string();
            assert!(
                text.contains("link `fore`") && text.contains("mass"),
                "{text}"
            );
        }
        assert!(check("l", &body(0.0, [1.0; 3]), false).is_err());
        assert_eq!(
            check("l", &body(0.0, [1.0; 3]), true)
                .unwrap()
                .unwrap()
                .code,
            Code::UnphysicalInertia
        );
        for bad in [[-1e-3, 1.0, 1.0], [1.0, 2.0, 3.001], [-1.0, -1.0, -1.0]] {
            assert!(check("l", &turned(bad), false).is_err(), "{bad:?}");
            assert_eq!(
                check("l", &turned(bad), true).unwrap().unwrap().code,
                Code::UnphysicalInertia
            );
        }
    }
}
