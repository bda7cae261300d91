//! Sums of autocorrelations, cut where they are noise (Geyer 1992).

/// Sample spans below this are constant chains (NumPy's `finfo.resolution`).
const CONSTANT: f64 = 1e-15;

/// Integrated autocorrelation time of a series given as runs, in samples: `τ = 1 + 2 Σ_{t≥1} r_t`, truncated where the
/// sum of an adjacent pair of autocorrelations turns negative (Geyer's initial positive sequence, made monotone).
///
/// The mean is taken as 0: the series is a residual. 1 for fewer than 4 samples or a series of zeros; never below 1.
///
/// # Source
/// Geyer (1992), "Practical Markov chain Monte Carlo", section 3.3.
pub fn integrated_autocorrelation_time(runs: &[&[f64]]) -> f64 {
    let samples: usize = runs.iter().map(|run| run.len()).sum();
    let product = |lag: usize| -> f64 { runs.iter().map(|run| lagged_product(run, lag)).sum() };
    let zero = product(0);
    if samples < 4 || !(zero > 0.0 && zero.is_finite()) {
        return 1.0;
    }
    let longest = runs.iter().map(|run| run.len()).max().unwrap_or(0);
    initial_positive_sequence(longest, |lag| product(lag) / zero).max(1.0)
}

/// `−1 + 2 Σ (r_{2i} + r_{2i+1})` over the pairs of autocorrelations that are positive from the first on, each at most as large as the
/// one before (Geyer 1992); lags below `longest`.
pub(crate) fn initial_positive_sequence(longest: usize, correlation: impl Fn(usize) -> f64) -> f64 {
    let (mut sum, mut pair_before, mut lag) = (-1.0, f64::INFINITY, 0);
    while lag + 1 < longest {
        let pair = (correlation(lag) + correlation(lag + 1)).min(pair_before);
        if pair <= 0.0 {
            break;
        }
        sum += 2.0 * pair;
        pair_before = pair;
        lag += 2;
    }
    sum
}

/// `Σ_t x_t x_{t+lag}`, four sums at a time.
fn lagged_product(x: &[f64], lag: usize) -> f64 {
    let Some(later) = x.get(lag..) else {
        return 0.0;
    };
    let earlier = &x[..later.len()];
    let mut sums = [0.0; 8];
    let (mut a, mut b) = (earlier.chunks_exact(8), later.chunks_exact(8));
    for (a, b) in a.by_ref().zip(b.by_ref()) {
        for i in 0..8 {
            sums[i] += a[i] * b[i];
        }
    }
    let rest: f64 = a
        .remainder()
        .iter()
        .zip(b.remainder())
        .map(|(a, b)| a * b)
        .sum();
    rest + sums.iter().sum::<f64>()
}

/// Effective sample size of chains (not split any more): n chains × draws / τ, with Geyer's initial positive and
/// monotone sequence over the chains' mean autocovariance. A constant chain counts in full, and so does a single draw.
pub(super) fn effective_samples<C: AsRef<[f64]>>(chains: &[C]) -> f64 {
    let count = chains.len() as f64;
    let draws = chains[0].as_ref().len();
    let length = draws as f64;
    let all = || chains.iter().flat_map(|c| c.as_ref());
    let span = all().fold(f64::NEG_INFINITY, |a, &x| a.max(x))
        - all().fold(f64::INFINITY, |a, &x| a.min(x));
    if span < CONSTANT || draws < 2 {
        return count * length;
    }
    let means: Vec<f64> = chains
        .iter()
        .map(|c| c.as_ref().iter().sum::<f64>() / length)
        .collect();
    let centered: Vec<Vec<f64>> = chains
        .iter()
        .zip(&means)
        .map(|(c, mean)| c.as_ref().iter().map(|x| x - mean).collect())
        .collect();
    let covariance = |lag: usize| -> f64 {
        centered
            .iter()
            .map(|c| lagged_product(c, lag) / length)
            .sum::<f64>()
            / count
    };
    let within = covariance(0) * length / (length - 1.0);
    let mut total = within * (length - 1.0) / length;
    if chains.len() > 1 {
        total += super::mean_and_variance(&means).1;
    }
    let correlation = |lag: usize| 1.0 - (within - covariance(lag)) / total;

    let time = autocorrelation_time(draws, correlation);
    let samples = count * length;
    samples / time.max(1.0 / samples.log10())
}

/// τ of so many draws by Geyer's sequences, from the correlation at a lag.
fn autocorrelation_time(draws: usize, correlation: impl Fn(usize) -> f64) -> f64 {
    // Initial positive sequence: pairs (even, odd) as long as their sum is positive.
    let mut rho = vec![0.0; draws];
    let (mut even, mut odd) = (1.0, correlation(1));
    (rho[0], rho[1]) = (even, odd);
    let mut t = 1;
    while t + 3 < draws && even + odd > 0.0 {
        (even, odd) = (correlation(t + 1), correlation(t + 2));
        if even + odd >= 0.0 {
            (rho[t + 1], rho[t + 2]) = (even, odd);
        }
        t += 2;
    }
    // The lag before the last pair; −1 where not even the first pair was followed by another.
    let last = t as isize - 2;
    if even > 0.0 {
        rho[(last + 1) as usize] = even;
    }
    // Initial monotone sequence.
    let mut t = 1;
    while t as isize <= last - 2 {
        let before = rho[t - 1] + rho[t];
        if rho[t + 1] + rho[t + 2] > before {
            (rho[t + 1], rho[t + 2]) = (before / 2.0, before / 2.0);
        }
        t += 2;
    }
    let kept = (last + 1) as usize;
    -1.0 + 2.0 * rho[..kept].iter().sum::<f64>() + rho[kept]
}
