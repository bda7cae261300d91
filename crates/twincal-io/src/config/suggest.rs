//! "Did you mean": the known name nearest to a mistyped one.

/// The nearest of `known` to `name`, if it is near enough to be meant (a third of its letters may differ).
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |s: &str| s.to_lowercase().replace('-', "_");
    let wanted = plain(name);
    let limit = (wanted.chars().count() / 3).max(1);
    known
        .into_iter()
        .map(|candidate| {
            let other = plain(candidate);
            let prefix =
                wanted.len() >= 3 && (other.starts_with(&wanted) || wanted.starts_with(&other));
            let distance = strsim::damerau_levenshtein(&wanted, &other);
            (
                if prefix {
                    distance.min(limit)
                } else {
                    distance
                },
                candidate,
            )
        })
        .filter(|&(distance, _)| distance <= limit)
        .min_by_key(|&(distance, _)| distance)
        .map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn nearest_name_or_none() {
        let known = ["cutoff_hz", "rate_hz", "coulomb_velocity"];
        for (given, expected) in [
            ("cutof_hz", Some("cutoff_hz")),
            ("cutoff-hz", Some("cutoff_hz")),
            ("cutoff", Some("cutoff_hz")),
            ("Rate_Hz", Some("rate_hz")),
            ("reta_hz", Some("rate_hz")),
            ("banana", None),
            ("x", None),
        ] {
            assert_eq!(nearest(given, known), expected, "{given}");
        }
    }
}
