//! "Did you mean": the names nearest to one that does not exist.

use crate::words::{listed, quoted, shortened};

/// Up to three candidates nearest to `name` by edit distance (insert, delete, replace, swap neighbours; letter case is
/// free; at most a third of the letters), nearest first, ties in the given order; none when nothing is near.
///
/// # Example
/// ```
/// use twincal::robot::nearest_names;
///
/// assert_eq!(nearest_names("elbw", ["shoulder", "elbow", "wrist"]), ["elbow"]);
/// assert!(nearest_names("gripper", ["shoulder", "elbow"]).is_empty());
/// ```
pub fn nearest_names<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Vec<&'a str> {
    let wanted: Vec<char> = letters(name).collect();
    let limit = wanted.len().div_ceil(3).min(wanted.len().saturating_sub(1));
    let mut letters_of: Vec<char> = Vec::new();
    let mut scored: Vec<(usize, &str)> = (candidates.into_iter())
        .filter_map(|candidate| {
            letters_of.clear();
            letters_of.extend(letters(candidate));
            // Every letter more or less is an edit.
            let near = letters_of.len().abs_diff(wanted.len()) <= limit;
            let d = near.then(|| distance(&wanted, &letters_of))?;
            (d <= limit).then_some((d, candidate))
        })
        .collect();
    scored.sort_by_key(|&(d, _)| d);
    scored
        .into_iter()
        .take(3)
        .map(|(_, candidate)| candidate)
        .collect()
}

/// The first 64 letters of a name in lower case.
fn letters(name: &str) -> impl Iterator<Item = char> {
    (name.chars().take(64))
        .flat_map(char::to_lowercase)
        .take(64)
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

/// Edit distance with swaps of neighbours (optimal string alignment); only the last two rows of its table are kept.
fn distance(a: &[char], b: &[char]) -> usize {
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = Vec::with_capacity(b.len() + 1);
        row.push(i);
        for j in 1..=b.len() {
            let replaced = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut best = replaced.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                best = best.min(before[j - 2] + 1);
            }
            row.push(best);
        }
        before = std::mem::replace(&mut last, row);
    }
    last[b.len()]
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
