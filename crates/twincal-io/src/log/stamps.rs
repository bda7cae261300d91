//! Stamps in ns since 1970 are too large for a double: in tables they count from an origin, where doubles hold them exactly.

/// ns of a stamp from `origin` on: exact within a hundred days of it.
pub(crate) fn since(origin: i64, stamp: i64) -> f64 {
    (i128::from(stamp) - i128::from(origin)) as f64
}

/// The stamp so many ns from `origin` on.
pub(crate) fn at(origin: i64, ns: f64) -> i64 {
    let stamp = i128::from(origin) + ns as i128;
    stamp.clamp(i64::MIN.into(), i64::MAX.into()) as i64
}

/// A stamp in seconds.
pub(crate) fn seconds(stamp: i64) -> f64 {
    stamp as f64 / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_within_a_hundred_days_come_back() {
        let (origin, days) = (1_700_000_000_123_456_789, 100 * 24 * 3600 * 1_000_000_000);
        for stamp in [
            origin,
            origin + 1,
            origin - 1,
            origin + days + 1,
            origin - days - 1,
        ] {
            assert_eq!(at(origin, since(origin, stamp)), stamp);
        }
        // Far beyond, to the next double, and never around the corner.
        for stamp in [i64::MAX, i64::MIN] {
            let back = at(
                -stamp.signum() * i64::MAX,
                since(-stamp.signum() * i64::MAX, stamp),
            );
            assert!(back.abs_diff(stamp) <= 2048, "{back}");
        }
        assert_eq!(seconds(1_500_000_000), 1.5);
    }
}
