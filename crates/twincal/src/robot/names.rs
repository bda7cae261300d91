//! "Did you mean": the names nearest to one that does not exist.

use crate::words::{listed, quoted, shortened};

/// Up to three candidates nearest to `name` by edit distance (insert, delete, replace, swap neighbours; letter case is
/// free; at most a third of the letters), nearest first, ties in the given order; none when nothing is near.
pub fn nearest_names<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Vec<&'a str> {
    let wanted: Vec<char> = (name.chars().take(64))
        .flat_map(char::to_lowercase)
        .take(64)
        .collect();
    let limit = wanted.len().div_ceil(3).min(wanted.len().saturating_sub(1));
    let mut scored: Vec<(usize, &str)> = candidates
        .into_iter()
        .map(|candidate| {
            (
                distance(
                    &wanted,
                    &(candidate.chars().take(64))
                        .flat_map(char::to_lowercase)
                        .take(64)
                        .collect::<Vec<_>>(),
                ),
                candidate,
            )
        })
        .filter(|&(d, _)| d <= limit)
        .collect();
    scored.sort_by_key(|&(d, _)| d);
    scored
        .into_iter()
        .take(3)
        .map(|(_, candidate)| candidate)
        .collect()
}

/// "did you mean `a` or `b`?", or a list of what there is.
pub fn did_you_mean<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    let all: Vec<&str> = candidates.into_iter().collect();
    let near = nearest_names(name, all.iter().copied());
    if !near.is_empty() {
        let near = near.iter().map(|name| format!("`{}`", shortened(name)));
        return format!("did you mean {}?", listed(near, " or "));
    }
    match all.len() {
        0 => "there are none".into(),
        _ => format!("there are {}", quoted(&all)),
    }
}

/// Edit distance with swaps of neighbours (optimal string alignment).
fn distance(a: &[char], b: &[char]) -> usize {
    let mut rows = vec![vec![0usize; b.len() + 1]; a.len() + 1];
    for i in 0..=a.len() {
        for j in 0..=b.len() {
            rows[i][j] = if i == 0 || j == 0 {
                i + j
            } else {
                let replaced = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
                let mut best = replaced.min(rows[i - 1][j] + 1).min(rows[i][j - 1] + 1);
                if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                    best = best.min(rows[i - 2][j - 2] + 1);
                }
                best
            };
        }
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_first_and_nothing_far() {
        let joints = [
            "shoulder_pan",
            "shoulder_lift",
            "elbow",
            "wrist_1",
            "wrist_2",
        ];
        assert_eq!(nearest_names("eblow", joints), ["elbow"]);
        assert_eq!(nearest_names("Wrist_3", joints), ["wrist_1", "wrist_2"]);
        assert!(nearest_names("finger", joints).is_empty());
        assert!(nearest_names("e", ["d", "main"]).is_empty());
        assert_eq!(did_you_mean("elbo", joints), "did you mean `elbow`?");
        assert!(did_you_mean("finger", joints).starts_with("there are `shoulder_pan`"));
    }
}
