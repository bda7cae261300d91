use super::*;
use crate::random::Random;

type Four = [[f64; 4]; 4];

/// `∫ (x, 1)(x, 1)ᵀ dm` about the origin.
fn pseudo(p: &Ten) -> Four {
    let half = 0.5 * (p[4] + p[7] + p[9]);
    [
        [half - p[4], -p[5], -p[6], p[1]],
        [-p[5], half - p[7], -p[8], p[2]],
        [-p[6], -p[8], half - p[9], p[3]],
        [p[1], p[2], p[3], p[0]],
    ]
}

fn times(a: &Four, b: &Four) -> Four {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transposed(a: &Four) -> Four {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

/// Gauss–Jordan elimination with pivots.
fn inverse(a: &Four) -> Four {
    let mut rows: Vec<Vec<f64>> = (0..4)
        .map(|i| {
            let unit = (0..4).map(|j| f64::from(u8::from(i == j)));
            a[i].iter().copied().chain(unit).collect()
        })
        .collect();
    for k in 0..4 {
        let pivot = (k..4).max_by(|&i, &j| rows[i][k].abs().total_cmp(&rows[j][k].abs()));
        rows.swap(k, pivot.unwrap());
        let top: Vec<f64> = rows[k].iter().map(|x| x / rows[k][k]).collect();
        for (i, row) in rows.iter_mut().enumerate() {
            let factor = row[k];
            for (x, t) in row.iter_mut().zip(&top) {
                *x = if i == k { *t } else { *x - factor * t };
            }
        }
    }
    std::array::from_fn(|i| std::array::from_fn(|j| rows[i][4 + j]))
}

/// tr(J⁻¹ dJ J⁻¹ dJ).
fn metric(j: &Four, d: &Four) -> f64 {
    let one = times(&inverse(j), d);
    let both = times(&one, &one);
    (0..4).map(|i| both[i][i]).sum()
}

/// Points of mass anywhere.
fn cloud(random: &mut Random) -> Vec<(f64, [f64; 3])> {
    (0..7)
        .map(|_| {
            let place = std::array::from_fn(|_| random.normal());
            (random.uniform() + 0.1, place)
        })
        .collect()
}

fn parameters(points: &[(f64, [f64; 3])]) -> Ten {
    let mut ten = [0.0; 10];
    for (m, [x, y, z]) in points {
        let own = [
            1.0,
            *x,
            *y,
            *z,
            y * y + z * z,
            -x * y,
            -x * z,
            x * x + z * z,
            -y * z,
            x * x + y * y,
        ];
        ten.iter_mut()
            .zip(own)
            .for_each(|(ten, own)| *ten += m * own);
    }
    ten
}

/// A body about which the floor has nothing to say.
fn body(points: &[(f64, [f64; 3])]) -> Body {
    let ten = parameters(points);
    let centre = [1, 2, 3].map(|k| ten[k] / ten[0]);
    let body = floored(&ten, (1e-9, centre), 1e-9);
    Body {
        second: second_moments(&ten, centre),
        ..body
    }
}

/// Mass, first and second moments, each in its directions.
fn all_directions(body: &Body) -> Vec<Ten> {
    let mut all = vec![body.of_mass().map(|x| body.mass * x)];
    all.extend(body.of_first_moments());
    all.extend(body.of_second_moments());
    all
}

fn change(directions: &[Ten], coefficients: &[f64]) -> Ten {
    std::array::from_fn(|p| {
        let pairs = directions.iter().zip(coefficients);
        pairs.map(|(direction, c)| c * direction[p]).sum()
    })
}

/// The square of the metric is the sum of the squared coefficients; a change of density by a is 2 |a| long.
#[test]
fn the_directions_are_orthonormal_in_the_metric() {
    let mut random = Random::new(1, 0);
    for _ in 0..50 {
        let body = body(&cloud(&mut random));
        let j = pseudo(&body.shape);
        let z: Vec<f64> = (0..10).map(|_| random.normal()).collect();
        let d = pseudo(&change(&all_directions(&body), &z));
        let expected: f64 = z.iter().map(|z| z * z).sum();
        let got = metric(&j, &d);
        assert!((got / expected - 1.0).abs() < 1e-8, "{got} {expected}");
        let scaled = body.shape.map(|x| 0.1 * x);
        assert!((metric(&j, &pseudo(&scaled)) - 0.04).abs() < 1e-9);
    }
}

/// Any affine map of space carries the prior of one body into that of the other: the same change is as far away for both.
#[test]
fn no_affine_map_changes_a_distance() {
    let mut random = Random::new(2, 0);
    for _ in 0..50 {
        let points = cloud(&mut random);
        let mut map: Four = std::array::from_fn(|_| std::array::from_fn(|_| random.normal()));
        map[3] = [0.0, 0.0, 0.0, 1.0];
        let moved: Vec<(f64, [f64; 3])> = (points.iter())
            .map(|(m, p)| {
                let row = |i: usize| map[i][0] * p[0] + map[i][1] * p[1] + map[i][2] * p[2];
                (*m, [0, 1, 2].map(|i| row(i) + map[i][3]))
            })
            .collect();
        let (one, other) = (body(&points), body(&moved));
        let z: Vec<f64> = (0..10).map(|_| random.normal()).collect();
        let d = pseudo(&change(&all_directions(&one), &z));
        let carried = times(&times(&map, &d), &transposed(&map));
        // Its coefficients for the other body, level by level: what is a change of mass, first and second moments stays one.
        let j = pseudo(&other.shape);
        let got = metric(&j, &carried);
        let expected: f64 = z.iter().map(|z| z * z).sum();
        assert!((got / expected - 1.0).abs() < 1e-6, "{got} {expected}");
        let first: f64 = z[1..4].iter().map(|z| z * z).sum();
        let level = pseudo(&change(&one.of_first_moments(), &z[1..4]));
        let carried = times(&times(&map, &level), &transposed(&map));
        let own = pseudo(&change(&other.of_first_moments(), &z[1..4]));
        assert!((metric(&j, &carried) / first - 1.0).abs() < 1e-6);
        assert!((metric(&j, &own) / first - 1.0).abs() < 1e-6);
    }
}

/// A ball of 1000 kg/m³: its second moments are m r²/5.
#[test]
fn a_balls_density_is_its_own() {
    let radius: f64 = 0.07;
    let mass = 1000.0 * 4.0 / 3.0 * PI * radius.powi(3);
    let moment = 0.2 * mass * radius * radius;
    assert!((density(mass, [moment; 3]) - 1000.0).abs() < 1e-9);
}

/// Placeholders have the floor's widths and a reason, honest bodies keep theirs.
#[test]
fn placeholders_have_a_floor() {
    let about = |mass: f64, moments: [f64; 3]| {
        let mut ten = [0.0; 10];
        (ten[0], ten[4], ten[7], ten[9]) = (mass, moments[0], moments[1], moments[2]);
        floored(&ten, (0.05, [0.0; 3]), 0.4)
    };
    let radii = |body: &Body| [0, 1, 2].map(|i| (body.second[i][i] / body.mass).sqrt());
    let honest = about(2.0, [0.02, 0.02, 0.02]);
    assert!(honest.floored.is_none() && honest.mass == 2.0);
    assert!((radii(&honest)[0] - 0.005_f64.sqrt()).abs() < 1e-12);
    for (own, reason) in [
        (about(0.0, [0.0; 3]), "mass"),
        (about(1e-6, [1e-9; 3]), "mass"),
        (about(2.0, [0.0; 3]), "point"),
        (about(2.0, [0.1, 0.01, 0.01]), "impossible"),
        (about(2.0, [9.0, 9.0, 9.0]), "too large"),
    ] {
        assert!(
            own.floored.is_some_and(|told| told.contains(reason)),
            "{own:?}"
        );
        let radii = radii(&own);
        assert!(own.mass >= 0.05 && radii.iter().all(|r| *r >= 0.04 - 1e-12));
        assert!(own.shape[0] >= 0.05);
    }
    // A thin rod is a body: its width across is the floor's.
    let rod = about(3.0, [0.04, 0.04, 0.0]);
    assert!(rod.floored.is_none() && radii(&rod)[0] >= 0.04 - 1e-12);
}
