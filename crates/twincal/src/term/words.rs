//! Estimates as people write them.

/// "+0.120 ± 0.010": the sd with two digits, the mean to the same place; one power of ten where they are tiny or huge.
pub(super) fn estimate(mean: f64, sd: f64) -> String {
    let size = mean.abs().max(sd.abs());
    if !(mean.is_finite() && sd.is_finite()) {
        return format!("{mean:+} ± {sd}");
    }
    if size != 0.0 && !(1e-3..1e6).contains(&size) {
        let power = size.log10().floor() as i32;
        let unit = 10.0_f64.powi(power);
        return format!("({})·10^{power}", plain(mean / unit, sd / unit));
    }
    plain(mean, sd)
}

fn plain(mean: f64, sd: f64) -> String {
    let decimals = if sd > 0.0 {
        (1.0 - sd.log10().floor()).clamp(0.0, 6.0) as usize
    } else {
        4
    };
    format!("{mean:+.decimals$} ± {sd:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::estimate;

    #[test]
    fn two_digits_of_the_sd_and_the_mean_to_the_same_place() {
        for (mean, sd, expected) in [
            (0.12, 0.01, "+0.120 ± 0.010"),
            (-12.345, 0.99, "-12.35 ± 0.99"),
            (1234.5, 120.0, "+1234 ± 120"),
            (0.0, 0.5, "+0.00 ± 0.50"),
            (2.5e-7, 1.2e-8, "(+2.50 ± 0.12)·10^-7"),
            (3.0e9, 1.0e7, "(+3.000 ± 0.010)·10^9"),
            (0.31, 0.0, "+0.3100 ± 0.0000"),
            (1.0, 1e-12, "+1.000000 ± 0.000000"),
        ] {
            assert_eq!(estimate(mean, sd), expected);
        }
    }
}
