//! When a joint stands still: there friction is anywhere between ± its Coulomb value and says nothing.

/// Marks the samples where |q̇| stays below `velocity` for longer than `seconds`.
pub(crate) fn standstill(qd: &[f64], velocity: f64, seconds: f64, interval: f64) -> Vec<bool> {
    let mut still = vec![false; qd.len()];
    let mut start = 0;
    for i in 0..=qd.len() {
        if i < qd.len() && qd[i].abs() < velocity {
            continue;
        }
        if i > start && (i - start - 1) as f64 * interval > seconds {
            still[start..i].fill(true);
        }
        start = i + 1;
    }
    still
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_long_slow_stretches_are_marked() {
        // 0.3 s at rest, motion with one zero crossing, 0.05 s at rest
        let mut qd = vec![0.0; 300];
        qd.extend((0..400).map(|i| (f64::from(i) * 0.0157).sin() + 0.001));
        qd.extend(vec![0.0; 50]);
        let still = standstill(&qd, 0.02, 0.2, 0.001);
        let marked: Vec<usize> = (0..still.len()).filter(|&i| still[i]).collect();
        assert_eq!(marked.first(), Some(&0));
        assert!((300..305).contains(&marked.len()), "{}", marked.len());
        assert!(standstill(&qd, 0.0, 0.2, 0.001).iter().all(|s| !s));
    }
}
