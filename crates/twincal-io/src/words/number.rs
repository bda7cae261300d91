//! The one formatter of numbers for people: a sensible number of digits, "–" for what is no number.

/// Narrow no-break space: groups thousands and keeps a unit beside its number.
pub(crate) const THIN: char = '\u{202f}';

/// `x` with `digits` significant digits; scientific beyond 10⁵ and below 10⁻³; "–" if it is not a number.
pub(crate) fn number(x: f64, digits: usize) -> String {
    if !x.is_finite() {
        return "–".into();
    }
    if x == 0.0 {
        return "0".into();
    }
    // Rounding first: 9.996 with three digits has the exponent of 10.0.
    let rounded: f64 = format!("{x:.*e}", digits.saturating_sub(1))
        .parse()
        .unwrap_or(x);
    let exponent = rounded.abs().log10().floor() as i32;
    if !(-3..5).contains(&exponent) {
        return scientific(rounded, digits.saturating_sub(1));
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    signed(&format!("{rounded:.decimals$}"))
}

/// `x` rounded where its standard deviation `sd` has its second digit, and `sd` the same: ("1.203", "0.031").
pub(crate) fn with_sd(x: f64, sd: f64) -> (String, String) {
    if !(sd.is_finite() && sd > 0.0 && x.is_finite()) {
        return (number(x, 4), number(sd, 2));
    }
    let place = sd.log10().floor() as i32 - 1;
    if place < -9 || x.abs().max(sd) >= 1e6 {
        return (number(x, 4), number(sd, 2));
    }
    let decimals = (-place).max(0) as usize;
    if x.abs().max(sd) < 1e-3 {
        return (number(x, 3), number(sd, 2));
    }
    (
        signed(&format!("{x:.decimals$}")),
        format!("{sd:.decimals$}"),
    )
}

/// Both ends of an interval with the digits that its width supports: "0.98 … 1.21".
pub(crate) fn interval(ends: [f64; 2]) -> String {
    let width = ends[1] - ends[0];
    if !(width.is_finite() && width > 0.0) {
        return format!("{} … {}", number(ends[0], 3), number(ends[1], 3));
    }
    let (low, _) = with_sd(ends[0], width / 4.0);
    let (high, _) = with_sd(ends[1], width / 4.0);
    format!("{low} … {high}")
}

/// `x` and both ends of an interval around it, with the digits that its width supports: "294 (284 … 378)".
pub(crate) fn with_ends(x: f64, ends: [f64; 2]) -> String {
    let spread = 0.5 * (ends[1] - ends[0]);
    let [x, low, high] = [x, ends[0], ends[1]].map(|x| with_sd(x, spread).0);
    format!("{x} ({low} … {high})")
}

/// A probability with three decimals that never rounds to certainty: 0.9991 and 1 are ">0.999".
///
/// # Example
/// ```
/// use twincal_io::words::probability;
///
/// assert_eq!(probability(0.5), "0.500");
/// assert_eq!(probability(1.0), ">0.999");
/// assert_eq!(probability(f64::NAN), "–");
/// ```
#[must_use]
pub fn probability(p: f64) -> String {
    match p {
        _ if !p.is_finite() => "–".into(),
        _ if p > 0.999 => ">0.999".into(),
        _ if p < 0.001 => "<0.001".into(),
        _ => format!("{p:.3}"),
    }
}

/// A share as per cent with one decimal.
#[must_use]
pub fn percent(share: f64) -> String {
    if share.is_finite() {
        signed(&format!("{:.1}{THIN}%", 100.0 * share))
    } else {
        "–".into()
    }
}

/// `x` with a fixed number of decimals.
pub(crate) fn fixed(x: f64, decimals: usize) -> String {
    if x.is_finite() {
        signed(&format!("{x:.decimals$}"))
    } else {
        "–".into()
    }
}

/// A count with its thousands apart.
pub(crate) fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(THIN);
        }
        out.push(c);
    }
    out
}

/// A real minus sign, and none before a rounded zero.
fn signed(text: &str) -> String {
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| !('1'..='9').contains(&c)) => rest.into(),
        Some(rest) => format!("−{rest}"),
        None => text.into(),
    }
}

fn scientific(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let power: String = exponent
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            _ => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹']
                [c.to_digit(10).unwrap_or(0) as usize],
        })
        .collect();
    format!("{}{THIN}·{THIN}10{power}", signed(mantissa))
}

/// "mean ± sd" with matching digits.
pub(crate) fn plus_minus(mean: f64, sd: f64) -> String {
    let (mean, sd) = with_sd(mean, sd);
    format!("{mean} ± {sd}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_significant_digits() {
        for (x, digits, expected) in [
            (0.123_456, 3, "0.123"),
            (9.996, 3, "10.0"),
            (-1.5, 2, "−1.5"),
            (12_345.6, 3, "12300"),
            (f64::NAN, 3, "–"),
            (0.0, 3, "0"),
            (-0.0, 3, "0"),
            (1.23e-7, 2, "1.2\u{202f}·\u{202f}10⁻⁷"),
            (2.0e12, 1, "2\u{202f}·\u{202f}10¹²"),
        ] {
            assert_eq!(number(x, digits), expected, "{x}");
        }
        assert_eq!(with_sd(1.203_4, 0.031), ("1.203".into(), "0.031".into()));
        assert_eq!(with_sd(-0.000_01, 0.5), ("0.00".into(), "0.50".into()));
        assert_eq!(with_sd(843.9, 12.0), ("844".into(), "12".into()));
        assert_eq!(interval([0.981_2, 1.209_9]), "0.981 … 1.210");
        assert_eq!(
            (fixed(-0.001, 2), fixed(-0.126, 2)),
            ("0.00".into(), "−0.13".into())
        );
        let pips = [1.0, 0.999_1, 0.999, 0.5, 0.0, f64::NAN].map(probability);
        assert_eq!(pips, [">0.999", ">0.999", "0.999", "0.500", "<0.001", "–"]);
        assert_eq!(with_ends(293.9, [284.5, 378.1]), "294 (284 … 378)");
        assert_eq!(percent(0.946_4), "94.6\u{202f}%");
        assert_eq!(count(1_048_576), "1\u{202f}048\u{202f}576");
    }
}
