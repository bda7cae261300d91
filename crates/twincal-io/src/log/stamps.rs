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
