//! What the joints of a robot have in common: a number that few independent pieces of a log say of one joint is at least what they
//! say of its joints on average.

/// Each joint's own number, or the geometric mean over the joints where that is more; 1 where nothing was measured.
///
/// Misfit and the width of intervals are measured in a handful of left-out pieces: a joint that shows none by chance is a joint of the same
/// robot, on the same motion, as those that show some. A joint that has more keeps what it has.
pub(super) fn at_least_usual(own: &[Option<f64>]) -> Vec<f64> {
    let measured = || own.iter().flatten();
    let count = measured().count().max(1) as f64;
    let usual = (measured().map(|number| number.ln()).sum::<f64>() / count).exp();
    let of_joint = |number: &Option<f64>| number.map_or(1.0, |number| number.max(usual));
    own.iter().map(of_joint).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_has_its_own_number_or_the_geometric_mean() {
        let found = at_least_usual(&[Some(1.0), Some(8.0), None, Some(1.0)]);
        let expected = [2.0, 8.0, 1.0, 2.0];
        let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-12;
        assert!(found.iter().zip(&expected).all(near), "{found:?}");
        assert_eq!(at_least_usual(&[None, None]), [1.0, 1.0]);
        assert!((at_least_usual(&[Some(3.0)])[0] - 3.0).abs() < 1e-12);
        assert!(at_least_usual(&[]).is_empty());
    }
}
