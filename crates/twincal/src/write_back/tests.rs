//! Projection against a long brute-force search; pseudo-inertia against integrals.

use super::projection::{Block, project};
use super::pseudo_inertia::{factor, inverse, pseudo_inertia, times};

#[test]
fn a_reason_says_nothing_that_the_sign_of_the_effect_could_contradict() {
    assert_eq!(
        super::reason(crate::term::Family::Stribeck, "URDF"),
        "a URDF cannot hold friction that changes with speed"
    );
}

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

/// Brute force: 20 000 points that are nearer than the answer in the metric, none of them a body. Six coefficients on two
/// links at once, correlated.
#[test]
fn nothing_nearer_is_physical() {
    let mut state = 7_u64;
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let nominal = points(&[
        (1.0, [0.1, 0.0, 0.0]),
        (1.0, [0.0, 0.12, 0.0]),
        (1.0, [0.0, 0.0, 0.08]),
        (1.0, [-0.1, -0.1, -0.1]),
    ]);
    let mut blocks = [Block::new(nominal, 6), Block::new(nominal, 6)];
    for k in 0..3 {
        blocks[0].directions[k][4 + [0, 3, 5][k]] = 1.0;
        blocks[1].directions[3 + k][1 + k] = 1.0;
    }
    let root: Vec<f64> = (0..36).map(|_| 0.05 * uniform()).collect();
    let covariance: Vec<f64> = (0..36)
        .map(|at| {
            let (i, j) = (at / 6, at % 6);
            let sum: f64 = (0..6).map(|k| root[6 * i + k] * root[6 * j + k]).sum();
            sum + if i == j { 1e-4 } else { 0.0 }
        })
        .collect();
    let beta = [-0.04, 0.02, -0.05, 0.2, -0.25, 0.1];
    let names = ["a", "b"];
    let (answer, projection) = project(&blocks, &beta, &covariance, &names).unwrap();
    let projection = projection.unwrap();
    assert_eq!(projection.links.len(), 2);
    assert!(answer.iter().all(|p| factor(&pseudo_inertia(p)).is_some()));
    let lower = crate::linear_algebra::Cholesky::new(&covariance, 6).unwrap();
    for _ in 0..20_000 {
        let direction: Vec<f64> = (0..6).map(|_| uniform() + uniform() + uniform()).collect();
        let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
        let radius = 0.999 * projection.distance * (uniform() + 0.5).powf(1.0 / 6.0);
        let moved: Vec<f64> = (0..6)
            .map(|i| {
                let along = (0..=i).map(|k| lower.lower()[6 * i + k] * direction[k]);
                beta[i] + radius / length * along.sum::<f64>()
            })
            .collect();
        let body = |l: usize| {
            let p: [f64; 10] = std::array::from_fn(|k| {
                let terms = blocks[l].directions.iter().zip(&moved);
                nominal[k] + terms.map(|(d, b)| d[k] * b).sum::<f64>()
            });
            factor(&pseudo_inertia(&p)).is_some()
        };
        assert!(!(body(0) && body(1)), "nearer and physical: {moved:?}");
    }
}
