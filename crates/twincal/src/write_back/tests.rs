//! Projection against a long brute-force search; pseudo-inertia against integrals; its metric against the recursion.

use super::metric::torque_metric;
use crate::likelihood::{JointNoise, Spread};
use crate::linear_algebra::Cholesky;
use crate::rigid_body::pseudo_inertia::{factor, inverse, pseudo_inertia, times};
use crate::rigid_body::{Link, project};
use crate::robot::testing::tree;
use crate::robot::{
    Motion, Placement, Robot, body_parameters, inertia_of, nominal_torque, random_states,
};

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

/// A metric in which parameters are independent with these standard deviations: small ones, beside which the weak second part of
/// the objective is nothing.
fn independent(sd: &[f64]) -> Vec<f64> {
    let size = sd.len();
    let mut metric = vec![0.0; size * size];
    (0..size).for_each(|k| metric[k * (size + 1)] = sd[k].powi(-2));
    metric
}

#[test]
fn what_is_physical_stays_to_the_bit() {
    let nominal = points(&[
        (1.0, [0.1, 0.0, 0.0]),
        (1.0, [0.0, 0.1, 0.0]),
        (1.0, [0.0, 0.0, 0.1]),
        (1.0, [-0.1, -0.1, -0.1]),
    ]);
    let mut found = nominal;
    found[0] += 0.25;
    let link = Link {
        name: "link",
        nominal,
        found,
    };
    let (parameters, projection) =
        project(&[link], || unreachable!("no metric is needed")).unwrap();
    assert_eq!(projection, None);
    assert_eq!(parameters[0], found);
}

/// Two parameters, the constraint in closed form: I = diag(a, b, c) about the centre with the triangle inequality.
/// Ixx and Iyy are known with a correlated error, all else is sure; the nearest point of the half plane
/// `Ixx + Iyy ≥ Izz` under the metric Cov⁻¹ is `π̂ + λ Cov n`, n = (1, 1).
#[test]
fn triangle_inequality_is_met_at_the_nearest_point_of_the_metric() {
    let nominal = [2.0, 0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.02, 0.0, 0.03];
    let change = [-0.008, -0.009];
    let mut found = nominal;
    found[4] += change[0];
    found[7] += change[1];
    let covariance = [4e-14, -1e-14, -1e-14, 1e-14];
    let mut metric = independent(&[1e-12; 10]);
    let determinant = covariance[0] * covariance[3] - covariance[1] * covariance[2];
    metric[44] = covariance[3] / determinant;
    metric[77] = covariance[0] / determinant;
    metric[47] = -covariance[1] / determinant;
    metric[74] = -covariance[1] / determinant;
    let link = Link {
        name: "link",
        nominal,
        found,
    };
    let (parameters, projection) = project(&[link], || Ok(metric)).unwrap();
    let projection = projection.unwrap();
    let violation = 0.03 - (0.04 + change[0] + change[1]);
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
    assert!(projection.links == ["link"]);
    assert!(factor(&pseudo_inertia(&parameters[0])).is_some());
}

/// A payload of negative mass where the model has nothing: all that is left is next to nothing.
#[test]
fn a_body_of_negative_mass_becomes_almost_none() {
    let mut found = [0.0; 10];
    found[0] = -0.3;
    let link = Link {
        name: "tool0",
        nominal: [0.0; 10],
        found,
    };
    let (parameters, projection) = project(&[link], || Ok(independent(&[1e-5; 10]))).unwrap();
    assert!(parameters[0][0] > 0.0 && parameters[0][0] < 1e-5);
    assert!((projection.unwrap().distance - 3e4).abs() < 1.0);
    assert!(factor(&pseudo_inertia(&parameters[0])).is_some());
}

/// A point mass is no body in the strict sense: a little of a tensor makes it one, its mass is the found one.
#[test]
fn a_point_mass_gets_a_body() {
    let link = Link {
        name: "link",
        nominal: points(&[(1.0, [0.1, 0.0, 0.0])]),
        found: points(&[(1.5, [0.1, 0.0, 0.0])]),
    };
    let (parameters, projection) = project(&[link], || Ok(independent(&[1e-5; 10]))).unwrap();
    assert!(projection.is_some());
    assert!((parameters[0][0] - 1.5).abs() < 1e-3);
    assert!(factor(&pseudo_inertia(&parameters[0])).is_some());
}

/// Two links whose change is not physical.
fn two_links() -> [Link<'static>; 2] {
    let nominal = points(&[
        (1.0, [0.1, 0.0, 0.0]),
        (1.0, [0.0, 0.12, 0.0]),
        (1.0, [0.0, 0.0, 0.08]),
        (1.0, [-0.1, -0.1, -0.1]),
    ]);
    let link = |name, at: [usize; 3], by: [f64; 3]| {
        let mut found = nominal;
        at.iter().zip(by).for_each(|(&k, by)| found[k] += by);
        Link {
            name,
            nominal,
            found,
        }
    };
    [
        link("a", [4, 7, 9], [-0.04, 0.02, -0.05]),
        link("b", [1, 2, 3], [0.2, -0.25, 0.1]),
    ]
}

/// Brute force: 20 000 points that are nearer than the answer in the metric, none of them a body. Two links at once, errors correlated.
#[test]
fn nothing_nearer_is_physical() {
    let mut state = 7_u64;
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let links = two_links();
    // Cov = root rootᵀ + 1e-12, T its inverse.
    let root: Vec<f64> = (0..400).map(|_| 3e-6 * uniform()).collect();
    let covariance: Vec<f64> = (0..400)
        .map(|at| {
            let (i, j) = (at / 20, at % 20);
            let sum: f64 = (0..20).map(|k| root[20 * i + k] * root[20 * j + k]).sum();
            sum + if i == j { 1e-12 } else { 0.0 }
        })
        .collect();
    let covariance = Cholesky::new(&covariance, 20).unwrap();
    let (answer, projection) = project(&links, || Ok(covariance.inverse())).unwrap();
    let projection = projection.unwrap();
    assert_eq!(projection.links.len(), 2);
    assert!(answer.iter().all(|p| factor(&pseudo_inertia(p)).is_some()));
    // Towards the answer and about it at random: a ball in twenty dimensions is nearly empty of bodies otherwise.
    let found: Vec<f64> = links.iter().flat_map(|link| link.found).collect();
    let mut towards: Vec<f64> = answer
        .iter()
        .flatten()
        .zip(&found)
        .map(|(a, f)| a - f)
        .collect();
    covariance.solve_lower(&mut towards);
    for _ in 0..20_000 {
        let spread = uniform().abs();
        let direction: Vec<f64> = towards
            .iter()
            .map(|u| u + spread * projection.distance * (uniform() + uniform()))
            .collect();
        let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
        let radius = 0.999 * projection.distance;
        let body = |l: usize| {
            let p: [f64; 10] = std::array::from_fn(|k| {
                let i = 10 * l + k;
                let along = (0..=i).map(|m| covariance.lower()[20 * i + m] * direction[m]);
                found[i] + radius / length * along.sum::<f64>()
            });
            factor(&pseudo_inertia(&p)).is_some()
        };
        assert!(!(body(0) && body(1)), "nearer and physical: {direction:?}");
    }
}

/// Noise that differs from joint to joint; one joint has no effective row.
fn joint_noise(robot: &Robot) -> Vec<JointNoise> {
    (robot.joint_names().iter().enumerate())
        .map(|(j, name)| JointNoise {
            joint: (*name).to_owned(),
            sigma: 0.3 + 0.2 * j as f64,
            training_rmse: 0.0,
            rho: 0.0,
            weight: 1.0,
            n: 900.0,
            n_eff: if j == 1 { 0.0 } else { 100.0 + 50.0 * j as f64 },
            autocorrelation_time: 1.0,
            misfit: 1.0,
            interval_factor: 1.0,
            out_of_band: 0.0,
            spread: Spread::default(),
        })
        .collect()
}

/// δᵀ M δ is what the robot with the change needs of other torque, by the recursion: links of a tree with sliders and a joint that
/// mimics another.
#[test]
fn the_metric_is_the_square_of_the_torque_between_two_robots() {
    let robot = tree();
    let noise = joint_noise(&robot);
    let [q, qd, qdd] = random_states(&robot, 150);
    let motion = Motion {
        len: 150,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let mut description = robot.description().clone();
    let changed = ["link2", "link4", "link6", "link7"];
    let mut links = Vec::new();
    let mut change = Vec::new();
    for (i, name) in changed.into_iter().enumerate() {
        let link = description.links.iter_mut().find(|l| l.name == name);
        let inertia = link.and_then(|link| link.inertia.as_mut()).unwrap();
        let nominal = body_parameters(inertia, &Placement::IDENTITY);
        inertia.mass += 0.2 + 0.1 * i as f64;
        inertia.com[i % 3] += 0.03;
        inertia.tensor[1][1] += 0.004;
        let found = body_parameters(inertia, &Placement::IDENTITY);
        change.extend(found.iter().zip(&nominal).map(|(f, n)| f - n));
        links.push(Link {
            name,
            nominal,
            found,
        });
    }
    let (other, _) = Robot::new(description, robot.locked()).unwrap();
    let torque = |robot: &Robot| {
        let mut torque = vec![0.0; q.len()];
        nominal_torque(robot, motion, &mut torque);
        torque
    };
    let (here, there) = (torque(&robot), torque(&other));
    let mut wanted = 0.0;
    for (at, (a, b)) in here.iter().zip(&there).enumerate() {
        let JointNoise { sigma, n_eff, .. } = noise[at / 150];
        wanted += n_eff / (sigma * sigma * 150.0) * (a - b) * (a - b);
    }
    let metric = torque_metric(&robot, &noise, motion, &links);
    let found: f64 = (0..metric.len())
        .map(|at| change[at / change.len()] * metric[at] * change[at % change.len()])
        .sum();
    assert!((found / wanted - 1.0).abs() < 1e-10, "{found} {wanted}");
}

/// A placeholder in the model, next to a point; its centre of mass was found 0.1 m away. What no torque shows goes to a sound body there, and the
/// torque that was found stays.
#[test]
fn a_found_centre_of_mass_costs_no_torque_where_the_tensor_is_not_seen() {
    let nominal = [5.0, 0.0, 0.0, 0.0, 1e-6, 0.0, 0.0, 1e-6, 0.0, 1e-6];
    let mut found = nominal;
    found[1] = 0.5;
    let link = Link {
        name: "link",
        nominal,
        found,
    };
    // A thousand rows of gravity with 0.5 N·m of noise: the first moments alone are seen.
    let mut metric = vec![0.0; 100];
    for at in [11, 22, 33] {
        metric[at] = 1000.0 * (9.81_f64 / 0.5).powi(2);
    }
    let (parameters, projection) = project(&[link], || Ok(metric)).unwrap();
    let off = parameters[0][1] - 0.5;
    assert!(9.81 * off.abs() < 0.01, "{off}");
    let projection = projection.unwrap();
    assert!((projection.distance - 1000_f64.sqrt() * 9.81 / 0.5 * off.abs()).abs() < 1e-3);
    let moments = inertia_of(&parameters[0]).unwrap();
    assert!((moments.mass - 5.0).abs() < 0.1 && moments.tensor[1][1] > 0.0);
}
