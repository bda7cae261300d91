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

/// Step of a quantised channel: the smallest change, if changes are multiples of it and many are 0 or 1 steps.
pub(crate) fn quantum<'a>(runs: impl Iterator<Item = &'a [f64]> + Clone) -> Option<f64> {
    let changes = || {
        runs.clone()
            .flat_map(|run| run.windows(2))
            .map(|pair| (pair[1] - pair[0]).abs())
    };
    // What is smaller is rounding of the file's decimals.
    let scale = runs.clone().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
    let step = changes()
        .filter(|c| *c > 1e-7 * scale)
        .fold(f64::INFINITY, f64::min);
    if !step.is_finite() {
        return None;
    }
    let (mut all, mut multiples, mut small) = (0_u64, 0_u64, 0_u64);
    for change in changes() {
        let units = change / step;
        all += 1;
        multiples += u64::from((units - units.round()).abs() < (0.05 + 1e-3 * units).min(0.2));
        small += u64::from(units < 1.5);
    }
    (multiples as f64 > 0.95 * all as f64 && small as f64 > 0.05 * all as f64).then_some(step)
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

    #[test]
    fn the_encoder_step_is_found_and_smooth_data_has_none() {
        let smooth: Vec<f64> = (0..2000).map(|i| (f64::from(i) * 0.003).sin()).collect();
        let coarse: Vec<f64> = smooth
            .iter()
            .map(|q| (q / 3.8e-4).round() * 3.8e-4)
            .collect();
        let step = quantum(std::iter::once(coarse.as_slice())).unwrap();
        assert!((step / 3.8e-4 - 1.0).abs() < 1e-6);
        assert_eq!(quantum(std::iter::once(smooth.as_slice())), None);
    }
}
