//! Text to f64, correctly rounded, with a short way for the numbers that logs are made of.

/// Powers of ten that are exact in f64.
static EXACT: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// Powers of ten up to that of seven digits.
static POWERS: [u64; 8] = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000];

/// Powers of five below 2^63.
static FIVES: [u64; 28] = {
    let mut fives = [1; 28];
    let mut k = 1;
    while k < fives.len() {
        fives[k] = 5 * fives[k - 1];
        k += 1;
    }
    fives
};

/// The number in a cell: NaN if the cell is empty or says that there is none, `None` if it is text.
#[inline]
pub(super) fn parse(field: &[u8], decimal_comma: bool) -> Option<f64> {
    let point = if decimal_comma { b',' } else { b'.' };
    short(field, point).or_else(|| long(field, decimal_comma))
}

/// A field that is a plain number from its first byte to its last.
#[inline]
fn short(field: &[u8], point: u8) -> Option<f64> {
    let (value, end) = leading(field, point)?;
    (end == field.len()).then_some(value)
}

/// The number that `text` begins with and the byte after it: a sign, at most 19 digits with at most one decimal sign, a small
/// exponent. `None` for all other forms.
#[inline]
pub(super) fn leading(text: &[u8], point: u8) -> Option<(f64, usize)> {
    let usual = text.first_chunk().and_then(|text| decimal(text, point));
    usual.or_else(|| of_any_form(text, point))
}

/// The same for at most seven digits, a decimal sign and at most 23 digits, with something behind them: the most of every log, in
/// a few steps without a branch that changes from number to number.
#[inline]
fn decimal(text: &[u8; 40], point: u8) -> Option<(f64, usize)> {
    let eight = |at: usize| u64::from_le_bytes(*text[at..].first_chunk().unwrap_or(&[0; 8]));
    let negative = text[0] == b'-';
    let start = usize::from(negative);
    let bytes = eight(start);
    let whole = leading_digits(bytes);
    if whole == 8 || text[start + whole] != point {
        return None;
    }
    let first = start + whole + 1;
    let (mut mantissa, mut end) = (few_digits(bytes, whole), first);
    loop {
        let bytes = eight(end);
        let count = leading_digits(bytes);
        if count < 8 {
            mantissa =
                (mantissa.wrapping_mul(POWERS[count])).wrapping_add(few_digits(bytes, count));
            end += count;
            break;
        }
        mantissa = (mantissa.wrapping_mul(100_000_000)).wrapping_add(eight_digits(bytes));
        end += 8;
        if end > first + 16 {
            return None;
        }
    }
    let decimals = end - first;
    if !(1..=19).contains(&(whole + decimals)) || matches!(text[end], b'e' | b'E') {
        return None;
    }
    let value = scaled(mantissa, -(decimals as i32))?;
    Some((signed(value, negative), end))
}

/// A sign without a branch; `value` has none.
#[inline]
fn signed(value: f64, negative: bool) -> f64 {
    f64::from_bits(value.to_bits() | u64::from(negative) << 63)
}

/// [`leading`] for every form.
#[inline(never)]
fn of_any_form(text: &[u8], point: u8) -> Option<(f64, usize)> {
    let first = *text.first()?;
    let negative = first == b'-';
    let start = usize::from(negative || first == b'+');
    let (mut mantissa, mut end) = digits(text, start, 0);
    let mut count = end - start;
    let mut power = 0;
    if text.get(end) == Some(&point) {
        let decimals = end + 1;
        (mantissa, end) = digits(text, decimals, mantissa);
        count += end - decimals;
        power = -((end - decimals).min(1 << 20) as i32);
    }
    if count == 0 {
        return None;
    }
    if count > 19 && too_many(&text[start..end]) {
        return None;
    }
    if matches!(text.get(end), Some(b'e' | b'E')) {
        let (exponent, after) = exponent(text, end + 1)?;
        power = exponent.checked_add(power)?;
        end = after;
    }
    let value = scaled(mantissa, power)?;
    Some((signed(value, negative), end))
}

/// Whether more than 19 digits are left without the zeros in front, which are no digits of the mantissa.
#[cold]
fn too_many(number: &[u8]) -> bool {
    let is_digit = |byte: &&u8| byte.is_ascii_digit();
    let rest = number
        .iter()
        .filter(is_digit)
        .skip_while(|byte| **byte == b'0');
    rest.count() > 19
}

/// Appends the digits from `start` on to `mantissa`, eight at a time; where they end. More than 19 digits wrap.
#[inline]
fn digits(text: &[u8], start: usize, mut mantissa: u64) -> (u64, usize) {
    let mut end = start;
    while let Some(eight) = text.get(end..).and_then(<[u8]>::first_chunk) {
        let bytes = u64::from_le_bytes(*eight);
        let count = leading_digits(bytes);
        if count == 8 {
            mantissa = mantissa
                .wrapping_mul(100_000_000)
                .wrapping_add(eight_digits(bytes));
            end += 8;
            continue;
        }
        let few = few_digits(bytes, count);
        let mantissa = mantissa.wrapping_mul(POWERS[count]).wrapping_add(few);
        return (mantissa, end + count);
    }
    last_digits(text, end, mantissa)
}

/// The same, one at a time: there are no eight bytes any more.
#[cold]
fn last_digits(text: &[u8], mut end: usize, mut mantissa: u64) -> (u64, usize) {
    while let Some(digit) = text
        .get(end)
        .map(|byte| byte.wrapping_sub(b'0'))
        .filter(|digit| *digit < 10)
    {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
        end += 1;
    }
    (mantissa, end)
}

/// How many of eight bytes, the first in the lowest place, are digits before one that is none.
#[inline]
fn leading_digits(bytes: u64) -> usize {
    // Digits become 0 to 9; with 0x76 more all others have their highest bit set, or had it. A carry only reaches bytes behind
    // the first of these.
    let digits = bytes ^ 0x3030_3030_3030_3030;
    let others = (digits | digits.wrapping_add(0x7676_7676_7676_7676)) & 0x8080_8080_8080_8080;
    others.trailing_zeros() as usize / 8
}

/// The number that the first `count` of eight bytes write, fewer than eight: moved to the end, behind zeros.
#[inline]
fn few_digits(bytes: u64, count: usize) -> u64 {
    eight_digits(bytes << 8 << (56 - 8 * count))
}

/// The number that eight digits write, the first in the lowest place; zero bytes count as zeros.
#[inline]
fn eight_digits(bytes: u64) -> u64 {
    // Neighbours are joined: pairs, fours, eight (D. Lemire, "Quickly parsing eight digits").
    let pairs = (bytes & 0x0F0F_0F0F_0F0F_0F0F).wrapping_mul(2561) >> 8;
    let fours = (pairs & 0x00FF_00FF_00FF_00FF).wrapping_mul(6_553_601) >> 16;
    (fours & 0x0000_FFFF_0000_FFFF).wrapping_mul(42_949_672_960_001) >> 32
}

/// A signed exponent of one to three digits from `start` on; where it ends.
fn exponent(text: &[u8], start: usize) -> Option<(i32, usize)> {
    let sign = *text.get(start)?;
    let first = start + usize::from(sign == b'-' || sign == b'+');
    let (value, end) = digits(text, first, 0);
    if !(1..=3).contains(&(end - first)) {
        return None;
    }
    let value = i32::try_from(value).ok()?;
    Some((if sign == b'-' { -value } else { value }, end))
}

/// The double nearest to mantissa · 10^power, where that takes no long arithmetic.
#[inline]
fn scaled(mantissa: u64, power: i32) -> Option<f64> {
    let size = power.unsigned_abs() as usize;
    // Both factors are doubles and one rounding is left (Clinger 1990).
    if mantissa <= 1 << 53 && size < EXACT.len() {
        // Signed: one instruction.
        let (value, scale) = (mantissa as i64 as f64, EXACT[size]);
        return Some(if power < 0 {
            value / scale
        } else {
            value * scale
        });
    }
    if mantissa == 0 {
        return Some(0.0);
    }
    (power < 0 && size < FIVES.len()).then(|| quotient(mantissa, FIVES[size], power))
}

/// The double nearest to mantissa / five · 2^power, by whole numbers: the mantissa is not 0, `five` a power of 5.
fn quotient(mantissa: u64, five: u64, power: i32) -> f64 {
    let (up, down) = (mantissa.leading_zeros(), five.leading_zeros());
    // Both have their highest bit set: the quotient has 63 or 64 bits.
    let (upper, lower) = (u128::from(mantissa << up) << 63, u128::from(five << down));
    let whole = upper / lower;
    // What is left counts as the last bit, ten below those of a double: rounding to even needs no more of it.
    let bits = whole as u64 | u64::from(upper != whole * lower);
    // 2^-152 to 2^-1: an exact factor.
    let exponent = 960 + i64::from(down) - i64::from(up) + i64::from(power);
    bits as f64 * f64::from_bits((exponent as u64) << 52)
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
                format!("{}.{:0digits$}", bits >> 40, bits % 100_000_000),
                format!("0.{:0width$}", bits >> 1, width = 19 + digits),
                format!("{bits}e{}", -exponent.abs()),
            ] {
                let expected: f64 = text.parse().unwrap();
                prop_assert_eq!(parse(text.as_bytes(), false).map(f64::to_bits), Some(expected.to_bits()), "{}", text);
                let comma = text.replace('.', ",");
                prop_assert_eq!(parse(comma.as_bytes(), true).map(f64::to_bits), Some(expected.to_bits()), "{}", comma);
                // The same within a line.
                let line = format!("{text};{value};-0.123456789;12345678901234567890;");
                let found = leading(line.as_bytes(), b'.').map(|(value, end)| (value.to_bits(), end));
                let alone = short(text.as_bytes(), b'.').map(|value| (value.to_bits(), text.len()));
                prop_assert_eq!(found, alone, "{}", line);
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
            "abc",
            "1.2.3",
            "1,5",
            "1e",
            "--1",
            "0x10",
            "1 2",
            "e5",
            ".",
            "-",
            "1.5 m",
            "1e+",
            "+",
            "12345678/",
            "1234567:1",
        ] {
            assert_eq!(parse(text.as_bytes(), false), None, "{text}");
        }
        assert_eq!(parse(b"1,5", true), Some(1.5));
        assert_eq!(parse(b"1.5", true), None);
        assert_eq!(parse(b"-.5", false), Some(-0.5));
        assert_eq!(parse(b"5.", false), Some(5.0));
    }
}
