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

/// "+294 (284 … 378)": the value and both ends of its 95 % interval, where ± does not describe it.
pub(super) fn with_ends(value: f64, [low, high]: [f64; 2]) -> String {
    let spread = 0.5 * (high - low);
    let size = value.abs().max(spread);
    let usual = size == 0.0 || (1e-3..1e6).contains(&size);
    let power = if usual {
        0
    } else {
        size.log10().floor() as i32
    };
    let unit = 10.0_f64.powi(power);
    let decimals = decimals(spread / unit);
    let [value, low, high] = [value, low, high].map(|x| x / unit);
    let text = format!("{value:+.decimals$} ({low:.decimals$} … {high:.decimals$})");
    match usual {
        true => text,
        false => format!("({text})·10^{power}"),
    }
}

/// Decimals that show two digits of a spread.
fn decimals(spread: f64) -> usize {
    if spread > 0.0 {
        (1.0 - spread.log10().floor()).clamp(0.0, 6.0) as usize
    } else {
        4
    }
}

fn plain(value: f64, spread: f64) -> String {
    let decimals = decimals(spread);
    format!("{value:+.decimals$} ± {spread:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::{estimate, with_ends};

    #[test]
    fn both_ends_have_the_digits_of_their_half_distance() {
        assert_eq!(with_ends(293.9, [284.5, 378.1]), "+294 (284 … 378)");
        assert_eq!(
            with_ends(-0.7466, [-0.9815, -0.4411]),
            "-0.75 (-0.98 … -0.44)"
        );
        assert_eq!(with_ends(2e-5, [1e-5, 9e-5]), "(+2.0 (1.0 … 9.0))·10^-5");
    }

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
