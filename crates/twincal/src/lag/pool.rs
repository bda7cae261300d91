//! What most joints, or logs, agree on.

/// A lag is not known to better than this, s: what drives' filters and elastic gears differ by.
const LEAST_SD: f64 = 0.0005;
/// Joints that agree lie within this many standard deviations of what they share.
const AGREE: f64 = 3.0;
/// One differs from the others beyond this many standard deviations, what the others disagree by included.
const DIFFERS: f64 = 4.0;
/// And by this much, s, at least.
const LEAST: f64 = 0.003;

/// Mean and standard deviation over values with errors, with random effects; how much they disagree beyond their errors.
///
/// # Source
/// DerSimonian & Laird 1986.
pub(super) fn pooled(values: &[[f64; 2]]) -> Option<([f64; 2], f64)> {
    let values: Vec<[f64; 2]> = values
        .iter()
        .map(|[x, sd]| [*x, sd.max(LEAST_SD)])
        .collect();
    let sums = |between: f64| -> [f64; 3] {
        let mut sums = [0.0; 3];
        for [x, sd] in &values {
            let weight = 1.0 / (sd * sd + between);
            let terms = [weight, weight * weight, weight * x];
            sums.iter_mut()
                .zip(terms)
                .for_each(|(sum, term)| *sum += term);
        }
        sums
    };
    let count = values.len();
    let [sum, squares, moment] = sums(0.0);
    let mean = moment / sum;
    let q: f64 = values.iter().map(|[x, sd]| ((x - mean) / sd).powi(2)).sum();
    let between = if count > 1 {
        ((q - (count - 1) as f64) / (sum - squares / sum)).max(0.0)
    } else {
        0.0
    };
    let [sum, _, moment] = sums(between);
    (count > 0).then(|| ([moment / sum, sum.recip().sqrt()], between.sqrt()))
}

/// What most of some lags agree on, and which of them differ from the rest.
pub(super) struct Agreed {
    /// Mean and standard deviation of those that do not differ, s; `None` where no more than half of all agree.
    pub(super) common: Option<[f64; 2]>,
    /// For each lag whether it differs.
    pub(super) differs: Vec<bool>,
}

/// Takes out what differs most as long as the rest agrees without it.
pub(super) fn agreed(lags: &[[f64; 2]]) -> Agreed {
    let mut differs = vec![false; lags.len()];
    let rest = |differs: &[bool]| -> Vec<[f64; 2]> {
        let kept = lags.iter().zip(differs).filter(|(_, differs)| !**differs);
        kept.map(|(lag, _)| *lag).collect()
    };
    while 2 * rest(&differs).len() > lags.len() + 1 {
        let beyond = |i: usize| -> Option<(usize, f64)> {
            let mut without = differs.clone();
            without[i] = true;
            let ([mean, sd], between) = pooled(&rest(&without))?;
            let apart = (lags[i][0] - mean).abs();
            let error = (lags[i][1].max(LEAST_SD).powi(2) + sd * sd + between * between).sqrt();
            (apart > LEAST).then_some((i, apart / error))
        };
        let open = (0..lags.len()).filter(|&i| !differs[i]);
        let size = |i: usize| lags[i][0].abs();
        let most = open.filter_map(beyond).max_by(|a, b| match lags.len() {
            // Of two the longer one is taken for the mistake.
            2 => size(a.0).total_cmp(&size(b.0)),
            _ => a.1.total_cmp(&b.1),
        });
        match most {
            Some((i, times)) if times > DIFFERS => differs[i] = true,
            _ => break,
        }
    }
    let common = pooled(&rest(&differs)).and_then(|(common, _)| {
        let agree =
            |[lag, sd]: &&[f64; 2]| (lag - common[0]).abs() <= AGREE * sd.max(2.0 * LEAST_SD);
        let alike = rest(&differs).iter().filter(agree).count();
        (2 * alike > lags.len()).then_some(common)
    });
    Agreed { common, differs }
}
