//! Vectors, rotations and frames in three dimensions, on plain arrays.

use super::{JointKind, Placement};

/// A vector.
pub type Vector = [f64; 3];
/// A 3 × 3 matrix, row-major.
pub type Matrix = [[f64; 3]; 3];

/// The identity matrix.
pub const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// a + b.
pub fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// s·a.
pub fn scale(s: f64, a: Vector) -> Vector {
    [s * a[0], s * a[1], s * a[2]]
}

/// aᵀb.
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a × b.
pub fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// |a|, without overflow.
pub fn norm(a: Vector) -> f64 {
    a[0].hypot(a[1]).hypot(a[2])
}

/// M v.
pub fn apply(m: &Matrix, v: Vector) -> Vector {
    [dot(m[0], v), dot(m[1], v), dot(m[2], v)]
}

/// Mᵀ.
pub fn transpose(m: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

/// A B.
pub fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    let bt = transpose(b);
    std::array::from_fn(|i| std::array::from_fn(|j| dot(a[i], bt[j])))
}

/// Half a turn leaves 6e-17 where 0 is meant.
const ROUNDING: f64 = 3e-16;

/// A rotation without the rounding of its zeros.
pub(crate) fn clean(matrix: &Matrix) -> Matrix {
    matrix.map(|row| row.map(|v| if v.abs() < ROUNDING { 0.0 } else { v }))
}

/// R M Rᵀ: a tensor given in the inner frame, seen from the outer frame.
pub fn rotate_tensor(r: &Matrix, m: &Matrix) -> Matrix {
    let full = multiply(&multiply(r, m), &transpose(r));
    // Rounding must not make it asymmetric.
    std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (full[i][j] + full[j][i])))
}

/// Rotation by `angle` about the unit vector `axis` (Rodrigues): `I + sin·[u]× + (1 − cos)(u uᵀ − I)`.
pub fn axis_angle(axis: Vector, angle: f64) -> Matrix {
    let (s, c) = angle.sin_cos();
    let [x, y, z] = axis;
    let k = 1.0 - c;
    [
        [c + k * x * x, k * x * y - s * z, k * x * z + s * y],
        [k * y * x + s * z, c + k * y * y, k * y * z - s * x],
        [k * z * x - s * y, k * z * y + s * x, c + k * z * z],
    ]
}

/// True for a rotation about x, to the last bit.
pub fn is_about_x(m: &Matrix) -> bool {
    m[0] == [1.0, 0.0, 0.0] && m[1][0] == 0.0 && m[2][0] == 0.0
}

/// Rotation from roll, pitch, yaw about FIXED x, y, z (URDF): `Rz(yaw) Ry(pitch) Rx(roll)`.
pub fn roll_pitch_yaw([roll, pitch, yaw]: Vector) -> Matrix {
    let x = axis_angle([1.0, 0.0, 0.0], roll);
    let y = axis_angle([0.0, 1.0, 0.0], pitch);
    let z = axis_angle([0.0, 0.0, 1.0], yaw);
    multiply(&z, &multiply(&y, &x))
}

/// Rotation from a quaternion (w, x, y, z) of any length; `None` when the length is 0 or not finite.
pub fn quaternion(q: [f64; 4]) -> Option<Matrix> {
    let length = q[0].hypot(q[1]).hypot(q[2]).hypot(q[3]);
    if !(length.is_finite() && length > 0.0) {
        return None;
    }
    let [w, x, y, z] = q.map(|v| v / length);
    Some([
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ])
}

/// The least rotation that turns z into the unit vector `axis`.
pub fn z_to(axis: Vector) -> Matrix {
    let turn = cross([0.0, 0.0, 1.0], axis);
    let sine = norm(turn);
    if sine == 0.0 {
        // Along z already, or half a turn about x.
        return if axis[2] >= 0.0 {
            IDENTITY
        } else {
            [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]
        };
    }
    axis_angle(scale(1.0 / sine, turn), sine.atan2(axis[2]))
}

impl Placement {
    /// What a joint adds to its own placement at a position, rad (m): a rotation about its axis, of length 1, or for a slider a shift along it.
    #[must_use]
    pub fn of_joint(kind: JointKind, axis: [f64; 3], position: f64) -> Self {
        match kind {
            JointKind::Prismatic => Self {
                rotation: IDENTITY,
                translation: scale(position, axis),
            },
            JointKind::Revolute | JointKind::Continuous | JointKind::Fixed => Self {
                rotation: axis_angle(axis, position),
                translation: [0.0; 3],
            },
        }
    }

    /// The frame of the parent itself.
    pub const IDENTITY: Self = Self {
        rotation: IDENTITY,
        translation: [0.0; 3],
    };

    /// The frame `inner`, given in this frame, seen from this frame's parent.
    pub fn compose(&self, inner: &Self) -> Self {
        Self {
            rotation: multiply(&self.rotation, &inner.rotation),
            translation: self.point(inner.translation),
        }
    }

    /// A point of this frame, seen from the parent.
    pub fn point(&self, x: Vector) -> Vector {
        add(apply(&self.rotation, x), self.translation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: &Matrix, b: &Matrix) {
        for i in 0..3 {
            for j in 0..3 {
                assert!((a[i][j] - b[i][j]).abs() < 1e-15, "{a:?}\n{b:?}");
            }
        }
    }

    #[test]
    fn rotations_agree_with_each_other() {
        let u = scale(1.0 / 14f64.sqrt(), [1.0, -2.0, 3.0]);
        let (s, c) = 0.35f64.sin_cos();
        close(
            &axis_angle(u, 0.7),
            &quaternion([2.0 * c, 2.0 * s * u[0], 2.0 * s * u[1], 2.0 * s * u[2]]).unwrap(),
        );
        // A yaw of 90 degrees sends x to y.
        let r = roll_pitch_yaw([0.0, 0.0, std::f64::consts::FRAC_PI_2]);
        assert!((r[1][0] - 1.0).abs() < 1e-15);
        for axis in [
            u,
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
            [1.0, 0.0, 0.0],
            [1e-9, 0.0, -1.0],
        ] {
            let z = apply(&z_to(axis), [0.0, 0.0, 1.0]);
            assert!(norm(add(z, scale(-1.0, axis))) < 1e-15, "{axis:?} {z:?}");
        }
        assert_eq!(quaternion([0.0; 4]), None);
    }
}
