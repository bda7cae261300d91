//! (to be written)

/// Integrated autocorrelation time of a series given as runs, in samples: `τ = 1 + 2 Σ_{t≥1} r_t`, truncated where the
/// sum of an adjacent pair of autocorrelations turns negative (Geyer's initial positive sequence, made monotone).
/// The mean is taken as 0: the series is a residual. 1 for fewer than 4 samples or a series of zeros.
pub fn integrated_autocorrelation_time(runs: &[&[f64]]) -> f64 {
    let samples: usize = runs.iter().map(|run| run.len()).sum();
    let product = |lag: usize| -> f64 {
        runs.iter()
            .map(|run| {
                run.iter()
                    .zip(run.iter().skip(lag))
                    .map(|(a, b)| a * b)
                    .sum::<f64>()
            })
            .sum()
    };
    let zero = product(0);
    if samples < 4 || zero <= 0.0 {
        return 1.0;
    }
    let longest = runs.iter().map(|run| run.len()).max().unwrap_or(0);
    let (mut sum, mut pair_before, mut lag) = (-1.0, f64::INFINITY, 0);
    while lag + 1 < longest {
        let pair = ((product(lag) + product(lag + 1)) / zero).min(pair_before);
        if pair <= 0.0 {
            break;
        }
        sum += 2.0 * pair;
        pair_before = pair;
        lag += 2;
    }
    sum.max(1.0)
}
