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

/// Where the time of a log counts from: its first stamp that is within a hundred days of the last (none that nobody filled in).
pub(crate) fn start(stamps: &[i64]) -> i64 {
    const HUNDRED_DAYS: u64 = 100 * 24 * 3600 * 1_000_000_000;
    let last = stamps.last().copied().unwrap_or(0);
    let mut near = stamps
        .iter()
        .filter(|stamp| stamp.abs_diff(last) <= HUNDRED_DAYS);
    near.next().copied().unwrap_or(last)
}

/// The stamp of a time in seconds from `start` on.
pub(crate) fn of_seconds(start: i64, seconds: f64) -> i64 {
    at(start, (seconds * 1e9).round())
}

/// A stamp in seconds, to the nearest double.
pub(crate) fn seconds(stamp: i64) -> f64 {
    stamp as f64 / 1e9
}

/// A stamp in seconds with every digit.
pub(crate) fn digits(stamp: i64) -> String {
    const SECOND: u64 = 1_000_000_000;
    let (sign, size) = (if stamp < 0 { "-" } else { "" }, stamp.unsigned_abs());
    format!("{sign}{}.{:09}", size / SECOND, size % SECOND)
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

    #[test]
    fn a_stamp_that_nobody_filled_in_is_no_start() {
        let first = 1_700_000_000_123_456_789;
        assert_eq!(start(&[first, first + 1]), first);
        assert_eq!(start(&[0, 0, first, first + 1]), first);
        assert_eq!(start(&[first + 5, first, first + 9]), first + 5);
        assert_eq!((start(&[]), start(&[i64::MIN, i64::MAX])), (0, i64::MAX));
    }

    #[test]
    fn stamps_keep_every_digit() {
        for (stamp, text) in [
            (1_700_000_000_123_456_789, "1700000000.123456789"),
            (5, "0.000000005"),
            (-1_500_000_000, "-1.500000000"),
        ] {
            assert_eq!(digits(stamp), text);
        }
        let start = 1_700_000_000_123_456_789;
        for ns in [0, 1, 999_999_999, 86_400_000_000_001_i64, -7] {
            assert_eq!(of_seconds(start, ns as f64 / 1e9), start + ns);
        }
    }
}
