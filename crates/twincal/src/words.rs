//! Numbers as people write them.

/// `value` with this many significant digits: plain between 10⁻⁴ and 10⁶, scientific beyond; "–" if it is not a number.
pub fn significant(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let size = value.abs();
    if size != 0.0 && !(1e-4..1e6).contains(&size) {
        return format!("{value:.*e}", (digits - 1).max(0) as usize);
    }
    let exponent = if size == 0.0 {
        0
    } else {
        size.log10().floor() as i32
    };
    format!("{value:.*}", (digits - 1 - exponent).clamp(0, 9) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_are_asked_for() {
        for (value, digits, text) in [
            (0.13712, 3, "0.137"),
            (1234.5, 3, "1234"),
            (1.5387, 2, "1.5"),
            (0.0029142, 3, "0.00291"),
            (2.4e-5, 2, "2.4e-5"),
            (0.0, 3, "0.00"),
            (f64::NAN, 3, "–"),
        ] {
            assert_eq!(significant(value, digits), text);
        }
    }
}
