//! The pseudo-inertia of a body: positive semidefinite exactly for what mass can do.

/// A symmetric 4 × 4 matrix.
pub(crate) type Four = [[f64; 4]; 4];

/// Pseudo-inertia of ten parameters about the same origin.
///
/// ```text
/// P = ∫ (x, 1)(x, 1)ᵀ dm = [[½ tr(I) E − I, mc], [mcᵀ, m]]
/// ```
/// # Source
/// Wensing, Kim, Slotine 2018: linear matrix inequalities for physically consistent inertial parameters.
pub(crate) fn pseudo_inertia(p: &[f64; 10]) -> Four {
    let half = 0.5 * (p[4] + p[7] + p[9]);
    [
        [half - p[4], -p[5], -p[6], p[1]],
        [-p[5], half - p[7], -p[8], p[2]],
        [-p[6], -p[8], half - p[9], p[3]],
        [p[1], p[2], p[3], p[0]],
    ]
}

/// Lower Cholesky factor; `None` if the matrix is not positive definite.
pub(crate) fn factor(a: &Four) -> Option<Four> {
    let mut lower = [[0.0; 4]; 4];
    for i in 0..4 {
        for j in 0..=i {
            let dot: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
            let rest = a[i][j] - dot;
            if i == j {
                if rest.is_nan() || rest <= 0.0 {
                    return None;
                }
                lower[i][i] = rest.sqrt();
            } else {
                lower[i][j] = rest / lower[j][j];
            }
        }
    }
    Some(lower)
}

/// Inverse from a lower Cholesky factor.
pub(crate) fn inverse(lower: &Four) -> Four {
    let mut columns = [[0.0; 4]; 4];
    for (k, x) in columns.iter_mut().enumerate() {
        x[k] = 1.0;
        for i in 0..4 {
            let dot: f64 = (0..i).map(|j| lower[i][j] * x[j]).sum();
            x[i] = (x[i] - dot) / lower[i][i];
        }
        for i in (0..4).rev() {
            let dot: f64 = (i + 1..4).map(|j| lower[j][i] * x[j]).sum();
            x[i] = (x[i] - dot) / lower[i][i];
        }
    }
    // The inverse is symmetric: its columns are its rows, up to rounding that is averaged away.
    std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (columns[i][j] + columns[j][i])))
}

/// A B.
pub(crate) fn times(a: &Four, b: &Four) -> Four {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

/// tr(A B) of symmetric matrices.
pub(crate) fn inner(a: &Four, b: &Four) -> f64 {
    let rows = a.iter().zip(b);
    rows.map(|(x, y)| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>())
        .sum()
}

/// ln |A| from a lower Cholesky factor.
pub(crate) fn log_determinant(lower: &Four) -> f64 {
    2.0 * (0..4).map(|i| lower[i][i].ln()).sum::<f64>()
}
