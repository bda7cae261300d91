//! Text to f64, correctly rounded, with a short way for the numbers that logs are made of.

/// Powers of ten that are exact in f64.
const EXACT: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// The number in a cell: NaN if the cell is empty or says that there is none, `None` if it is text.
#[inline]
pub(super) fn parse(field: &[u8], decimal_comma: bool) -> Option<f64> {
    let point = if decimal_comma { b',' } else { b'.' };
    short(field, point).or_else(|| long(field, decimal_comma))
}

/// Sign, at most 15 digits, at most one decimal sign, small exponent: mantissa and power of ten are exact and one rounding is
/// left (Clinger 1990).
#[inline]
fn short(field: &[u8], point: u8) -> Option<f64> {
    let (negative, digits) = match field.first()? {
        b'-' => (true, &field[1..]),
        b'+' => (false, &field[1..]),
        _ => (false, field),
    };
    let (mut mantissa, mut count, mut decimals, mut seen_point) = (0_u64, 0_u32, 0_i32, false);
    let mut i = 0;
    while i < digits.len() {
        let byte = digits[i];
        if byte.is_ascii_digit() {
            mantissa = mantissa * 10 + u64::from(byte - b'0');
            count += 1;
            decimals += i32::from(seen_point);
            // Leading zeros do not count: they leave the mantissa 0.
            if mantissa == 0 {
                count = 1;
            }
            if count > 15 {
                return None;
            }
        } else if byte == point && !seen_point {
            seen_point = true;
        } else {
            break;
        }
        i += 1;
    }
    if count == 0 {
        return None;
    }
    let mut power = -decimals;
    if i < digits.len() {
        if digits[i] != b'e' && digits[i] != b'E' {
            return None;
        }
        let (sign, rest) = match digits.get(i + 1)? {
            b'-' => (-1, &digits[i + 2..]),
            b'+' => (1, &digits[i + 2..]),
            _ => (1, &digits[i + 1..]),
        };
        if rest.is_empty() || rest.len() > 3 || !rest.iter().all(u8::is_ascii_digit) {
            return None;
        }
        power += sign * rest.iter().fold(0, |n, b| n * 10 + i32::from(b - b'0'));
    }
    let scale = EXACT.get(power.unsigned_abs() as usize)?;
    let value = if power < 0 {
        mantissa as f64 / scale
    } else {
        mantissa as f64 * scale
    };
    Some(if negative { -value } else { value })
}

/// Everything else, by the standard library; the words for "no value".
#[cold]
fn long(field: &[u8], decimal_comma: bool) -> Option<f64> {
    let text = std::str::from_utf8(field).ok()?;
    if text.is_empty() {
        return Some(f64::NAN);
    }
    let number = if decimal_comma {
        if text.contains('.') {
            return None;
        }
        text.replace(',', ".").parse().ok()
    } else {
        text.parse().ok()
    };
    number.or_else(|| {
        let word = text.to_ascii_lowercase();
        match word.as_str() {
            "na" | "n/a" | "null" | "none" | "-nan" | "nan(ind)" | "-nan(ind)" => Some(f64::NAN),
            "1.#inf" => Some(f64::INFINITY),
            "-1.#inf" => Some(f64::NEG_INFINITY),
            _ => None,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_way_to_write_a_number_gives_the_nearest_double(bits in any::<u64>(), digits in 0..18_usize, exponent in -30..30_i32) {
            let value = f64::from_bits(bits);
            prop_assume!(value.is_finite());
            let scaled = (bits as i64 as f64) * 1e-9;
            for text in [
                format!("{value}"),
                format!("{value:e}"),
                format!("{scaled:.digits$}"),
                format!("{scaled:.digits$e}"),
                format!("{}e{exponent}", bits % 1_000_000),
                format!("+0.000{}E+{}", bits % 1_000_000, exponent.abs()),
            ] {
                let expected: f64 = text.parse().unwrap();
                prop_assert_eq!(parse(text.as_bytes(), false).map(f64::to_bits), Some(expected.to_bits()), "{}", text);
                let comma = text.replace('.', ",");
                prop_assert_eq!(parse(comma.as_bytes(), true).map(f64::to_bits), Some(expected.to_bits()), "{}", comma);
            }
        }
    }

    #[test]
    fn words_and_text() {
        for text in ["", "nan", "NaN", "NA", "null", "-nan", "None"] {
            assert!(
                parse(text.as_bytes(), false).is_some_and(f64::is_nan),
                "{text}"
            );
        }
        assert_eq!(parse(b"inf", false), Some(f64::INFINITY));
        assert_eq!(parse(b"-Infinity", false), Some(f64::NEG_INFINITY));
        for text in [
            "abc", "1.2.3", "1,5", "1e", "--1", "0x10", "1 2", "e5", ".", "-", "1.5 m",
        ] {
            assert_eq!(parse(text.as_bytes(), false), None, "{text}");
        }
        assert_eq!(parse(b"1,5", true), Some(1.5));
        assert_eq!(parse(b"1.5", true), None);
        assert_eq!(parse(b"-.5", false), Some(-0.5));
        assert_eq!(parse(b"5.", false), Some(5.0));
    }
}
