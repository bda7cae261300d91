//! Projection against a long brute-force search; pseudo-inertia against integrals.

use super::projection::{Block, project};
use super::pseudo_inertia::{factor, inverse, pseudo_inertia, times};

/// Ten parameters of point masses: Σ m (1, x, |x|² E − x xᵀ).
fn points(masses: &[(f64, [f64; 3])]) -> [f64; 10] {
    let mut p = [0.0; 10];
    for &(m, [x, y, z]) in masses {
        let own = [
            1.0,
            x,
            y,
            z,
            y * y + z * z,
            -x * y,
            -x * z,
            x * x + z * z,
            -y * z,
            x * x + y * y,
        ];
        for (p, own) in p.iter_mut().zip(own) {
            *p += m * own;
        }
    }
    p
}

#[test]
fn pseudo_inertia_is_the_integral_of_second_moments() {
    let masses = [
        (1.0, [0.3, -0.1, 0.2]),
        (0.5, [-0.2, 0.4, 0.1]),
        (2.0, [0.1, 0.1, -0.3]),
        (0.7, [0.0, -0.5, 0.2]),
        (0.2, [0.4, 0.2, 0.2]),
    ];
    let p = pseudo_inertia(&points(&masses));
    for i in 0..4 {
        for j in 0..4 {
            let direct: f64 = masses
                .iter()
                .map(|&(m, [x, y, z])| {
                    let v = [x, y, z, 1.0];
                    m * v[i] * v[j]
                })
                .sum();
            assert!((p[i][j] - direct).abs() < 1e-15, "{i} {j}");
        }
    }
    let product = times(&inverse(&factor(&p).unwrap()), &p);
    for (i, row) in product.iter().enumerate() {
        for (j, value) in row.iter().enumerate() {
            assert!((value - f64::from(u8::from(i == j))).abs() < 1e-10);
        }
    }
    // Negative mass somewhere is no body.
    assert!(factor(&pseudo_inertia(&points(&[(-0.1, [0.1, 0.0, 0.0])]))).is_none());
}

#[test]
fn what_is_physical_stays_to_the_bit() {
    let nominal = points(&[
        (1.0, [0.1, 0.0, 0.0]),
        (1.0, [0.0, 0.1, 0.0]),
        (1.0, [0.0, 0.0, 0.1]),
        (1.0, [-0.1, -0.1, -0.1]),
    ]);
    let mut block = Block::new(nominal, 1);
    block.directions[0][0] = 1.0;
    let (parameters, projection) = project(&[block], &[0.25], &[1.0], &["link"]).unwrap();
    assert_eq!(projection, None);
    assert_eq!(parameters[0][0], nominal[0] + 0.25);
    assert_eq!(parameters[0][1..], nominal[1..]);
}

/// Two coefficients, the constraint in closed form: I = diag(a, b, c) about the centre with the triangle inequality.
/// Coefficients change Ixx and Iyy with a correlated posterior; the nearest point of the half plane
/// `Ixx + Iyy ≥ Izz` under the metric Cov⁻¹ is `β̂ + λ Cov n`, n = (1, 1).
#[test]
fn triangle_inequality_is_met_at_the_nearest_point_of_the_metric() {
    let nominal = [2.0, 0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.02, 0.0, 0.03];
    let mut block = Block::new(nominal, 2);
    block.directions[0][4] = 1.0;
    block.directions[1][7] = 1.0;
    let beta = [-0.008, -0.009];
    let covariance = [4e-6, -1e-6, -1e-6, 1e-6];
    let (parameters, projection) = project(&[block], &beta, &covariance, &["link"]).unwrap();
    let projection = projection.unwrap();
    let violation = 0.03 - (0.04 + beta[0] + beta[1]);
    let along = [covariance[0] + covariance[1], covariance[2] + covariance[3]];
    let lambda = violation / (along[0] + along[1]);
    let wanted = [0.012 + lambda * along[0], 0.011 + lambda * along[1]];
    // The margin is 1e-6 of the link's own size: 2 kg · (0.035/2) m² · 1e-6 = 3.5e-8, twice that in Ixx + Iyy.
    assert!(
        (parameters[0][4] - wanted[0]).abs() < 2e-7,
        "{parameters:?}"
    );
    assert!(
        (parameters[0][7] - wanted[1]).abs() < 2e-7,
        "{parameters:?}"
    );
    let distance = violation / (along[0] + along[1]).sqrt();
    assert!((projection.distance - distance).abs() < 1e-3 * distance);
    assert!(projection.gap <= 1e-9 * projection.distance.powi(2));
    assert!(!projection.beyond && projection.links == ["link"]);
    assert!(factor(&pseudo_inertia(&parameters[0])).is_some());
}

/// A payload of negative mass where the model has nothing: all that is left is next to nothing.
#[test]
fn a_body_of_negative_mass_becomes_almost_none() {
    let mut block = Block::new([0.0; 10], 10);
    for k in 0..10 {
        block.directions[k][k] = 1.0;
    }
    let mut beta = [0.0; 10];
    beta[0] = -0.3;
    let mut covariance = [0.0; 100];
    for k in 0..10 {
        covariance[k * 11] = 1e-4;
    }
    let (parameters, projection) = project(&[block], &beta, &covariance, &["tool0"]).unwrap();
    assert!(parameters[0][0] > 0.0 && parameters[0][0] < 1e-5);
    assert!((projection.unwrap().distance - 30.0).abs() < 0.1);
    assert!(factor(&pseudo_inertia(&parameters[0])).is_some());
}

/// A point mass whose mass alone is free has no interior: parameters that no component has move a little.
#[test]
fn a_point_mass_gets_a_body() {
    let nominal = points(&[(1.0, [0.1, 0.0, 0.0])]);
    let mut block = Block::new(nominal, 1);
    block.directions[0] = points(&[(1.0, [0.1, 0.0, 0.0])]);
    let (parameters, projection) = project(&[block], &[0.5], &[1e-4], &["link"]).unwrap();
    assert!(projection.unwrap().beyond);
    assert!((parameters[0][0] - 1.5).abs() < 1e-3);
    assert!(factor(&pseudo_inertia(&parameters[0])).is_some());
}
