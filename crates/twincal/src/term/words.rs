//! Estimates as people write them.

/// What is said of a parameter that only models too light to be listed hold.
pub(super) const NO_MODEL: &str = "in no model that counts";

/// "+0.120 ± 0.010": the spread with two digits, the value to the same place; one power of ten where they are tiny or huge.
///
/// The value is the posterior's median, the spread half the width of its central 68.3 % interval: one sd where it is normal,
/// and not blown up by a few models far off.
pub(crate) fn estimate(value: f64, spread: f64) -> String {
    let size = value.abs().max(spread.abs());
    if !(value.is_finite() && spread.is_finite()) {
        return format!("{value:+} ± {spread}");
    }
    if size != 0.0 && !(1e-3..1e6).contains(&size) {
        let power = size.log10().floor() as i32;
        let unit = 10.0_f64.powi(power);
        return format!("({})·10^{power}", plain(value / unit, spread / unit));
    }
    plain(value, spread)
}

fn plain(value: f64, spread: f64) -> String {
    let decimals = if spread > 0.0 {
        (1.0 - spread.log10().floor()).clamp(0.0, 6.0) as usize
    } else {
        4
    };
    format!("{value:+.decimals$} ± {spread:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::estimate;

    #[test]
    fn two_digits_of_the_spread_and_the_value_to_the_same_place() {
        for (value, spread, expected) in [
            (0.12, 0.01, "+0.120 ± 0.010"),
            (-12.345, 0.99, "-12.35 ± 0.99"),
            (1234.5, 120.0, "+1234 ± 120"),
            (0.0, 0.5, "+0.00 ± 0.50"),
            (2.5e-7, 1.2e-8, "(+2.50 ± 0.12)·10^-7"),
            (3.0e9, 1.0e7, "(+3.000 ± 0.010)·10^9"),
            (0.31, 0.0, "+0.3100 ± 0.0000"),
            (1.0, 1e-12, "+1.000000 ± 0.000000"),
        ] {
            assert_eq!(estimate(value, spread), expected);
        }
    }
}
