//! The built-in generic family: trigonometric and polynomial Lagrangians of a chain of joints.

use super::candidate::Joint;

/// Names, that is expressions, of the generic family, kinetic terms first.
///
/// ```text
/// kinetic    q̇ᵢ q̇ⱼ Π_{m ≥ 2} h(q_m)     h ∈ {1, cos, sin}, with axes in all directions also {cos 2q, sin 2q}
/// potential  sin and cos of every sum of consecutive joint angles      axes parallel
///            Π_m h(q_m),  h ∈ {1, cos, sin}                            axes in all directions
/// spring     qᵢ²
/// ```
/// A slider has h ∈ {1, q, q²} in kinetic terms and {1, q} in potentials. These spans hold the kinetic and the
/// potential energy of any mass that moves with a chain of such joints; a planar 2R arm has 17 of them.
pub(super) fn names(joints: &[Joint], parallel: bool) -> Vec<String> {
    let q = |joint: &Joint| format!("q{}", joint.index + 1);
    let choices: Vec<Vec<String>> = joints
        .iter()
        .skip(1)
        .map(|joint| match (joint.slides, parallel) {
            (true, _) => vec![String::new(), q(joint), format!("{}^2", q(joint))],
            (false, true) => trigonometric(&q(joint)),
            (false, false) => {
                let mut all = trigonometric(&q(joint));
                all.extend(
                    trigonometric(&format!("2*{}", q(joint)))
                        .into_iter()
                        .skip(1),
                );
                all
            }
        })
        .collect();
    let shapes = products(&choices);
    let mut names = Vec::new();
    for i in 0..joints.len() {
        for j in i..joints.len() {
            let rates = if i == j {
                format!("qd{}^2", i + 1)
            } else {
                format!("qd{}*qd{}", i + 1, j + 1)
            };
            names.extend(shapes.iter().map(|shape| joined(&rates, shape)));
        }
    }
    if parallel {
        // a slider along the common axis does not change the angles
        let turning: Vec<String> = joints.iter().filter(|joint| !joint.slides).map(q).collect();
        for length in 1..=turning.len() {
            for run in turning.windows(length) {
                names.extend(trigonometric(&run.join("+")).into_iter().skip(1).rev());
            }
        }
        names.extend(joints.iter().filter(|joint| joint.slides).map(q));
    } else {
        let choices: Vec<Vec<String>> = joints
            .iter()
            .map(|joint| {
                if joint.slides {
                    vec![String::new(), q(joint)]
                } else {
                    trigonometric(&q(joint))
                }
            })
            .collect();
        names.extend(products(&choices).into_iter().skip(1));
    }
    names.extend(joints.iter().map(|joint| format!("{}^2", q(joint))));
    names
}

/// Number of names, without making them.
pub(super) fn count(joints: &[Joint], parallel: bool) -> f64 {
    let n = joints.len() as f64;
    let sliders = joints.iter().filter(|joint| joint.slides).count() as f64;
    let turning = n - sliders;
    let shapes: f64 = joints
        .iter()
        .skip(1)
        .map(|joint| if joint.slides || parallel { 3.0 } else { 5.0 })
        .product();
    let potentials = if parallel {
        turning * (turning + 1.0) + sliders
    } else {
        3.0_f64.powf(turning) * 2.0_f64.powf(sliders) - 1.0
    };
    n * (n + 1.0) / 2.0 * shapes + potentials + n
}

/// 1, cos, sin of an angle; 1 is the empty string.
fn trigonometric(angle: &str) -> Vec<String> {
    vec![
        String::new(),
        format!("cos({angle})"),
        format!("sin({angle})"),
    ]
}

fn joined(left: &str, right: &str) -> String {
    match (left, right) {
        ("", other) | (other, "") => other.to_owned(),
        _ => format!("{left}*{right}"),
    }
}

/// All products of one choice each, the last choice changing fastest.
fn products(choices: &[Vec<String>]) -> Vec<String> {
    choices
        .iter()
        .fold(vec![String::new()], |products, choices| {
            products
                .iter()
                .flat_map(|left| choices.iter().map(move |right| joined(left, right)))
                .collect()
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joints(slides: &[bool]) -> Vec<Joint> {
        let joint = |(index, &slides)| Joint {
            index,
            name: format!("j{index}"),
            slides,
        };
        slides.iter().enumerate().map(joint).collect()
    }

    #[test]
    fn a_planar_arm_with_two_joints_has_these_seventeen() {
        let expected = "qd1^2 qd1^2*cos(q2) qd1^2*sin(q2) qd1*qd2 qd1*qd2*cos(q2) qd1*qd2*sin(q2) qd2^2 qd2^2*cos(q2) \
                        qd2^2*sin(q2) sin(q1) cos(q1) sin(q2) cos(q2) sin(q1+q2) cos(q1+q2) q1^2 q2^2";
        assert_eq!(
            names(&joints(&[false, false]), true),
            expected.split_whitespace().collect::<Vec<_>>()
        );
    }

    #[test]
    fn the_count_is_right_before_anything_is_made() {
        for slides in [
            &[false][..],
            &[true],
            &[false, true],
            &[false, false, false],
            &[false, true, true, false],
        ] {
            for parallel in [true, false] {
                let joints = joints(slides);
                assert_eq!(
                    names(&joints, parallel).len() as f64,
                    count(&joints, parallel),
                    "{slides:?} {parallel}"
                );
            }
        }
        // method section 3: 65 625 kinetic terms for six hinges
        let six = joints(&[false; 6]);
        assert_eq!(count(&six, false), 65_625.0 + 728.0 + 6.0);
    }

    #[test]
    fn a_slider_has_polynomials() {
        let names = names(&joints(&[false, true]), false);
        for expected in [
            "qd1^2*q2^2",
            "qd1*qd2*q2",
            "q2*cos(q1)",
            "cos(q1)*q2",
            "q2^2",
        ] {
            let found = names.iter().any(|name| name == expected);
            assert_eq!(found, expected != "q2*cos(q1)", "{expected}");
        }
        assert!(!names.iter().any(|name| name.contains("cos(q2)")));
    }
}
