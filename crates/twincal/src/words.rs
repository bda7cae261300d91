//! Numbers and lists of names as people write them.

use std::borrow::Cow;

/// Most names that a sentence lists; the others are counted.
pub const NAMED: usize = 10;
/// Longest name in a sentence, characters: two lines of a terminal.
const LONGEST: usize = 160;

/// A name for a sentence: the end of one above 160 characters is left out.
pub fn shortened(name: &str) -> Cow<'_, str> {
    match name.char_indices().nth(LONGEST) {
        None => Cow::Borrowed(name),
        Some((end, _)) => Cow::Owned(format!("{}…", &name[..end])),
    }
}

/// The first ten items with `separator` between them, and how many there are beyond: "a, b and 7 more".
pub fn listed(items: impl IntoIterator<Item = impl AsRef<str>>, separator: &str) -> String {
    let (mut text, mut count) = (String::new(), 0);
    for item in items {
        if count < NAMED {
            if count > 0 {
                text.push_str(separator);
            }
            text.push_str(item.as_ref());
        }
        count += 1;
    }
    match count - count.min(NAMED) {
        0 => text,
        more => format!("{text} and {more} more"),
    }
}

/// The first ten names, shortened and in backticks, and how many there are beyond: "`a`, `b` and 7 more".
pub fn quoted(names: impl IntoIterator<Item = impl AsRef<str>>) -> String {
    let quoted = |(at, name): (usize, _)| match at {
        0..NAMED => format!("`{}`", shortened(AsRef::<str>::as_ref(&name))),
        // Only counted.
        _ => String::new(),
    };
    listed(names.into_iter().enumerate().map(quoted), ", ")
}

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
    fn a_list_names_ten_and_counts_the_rest() {
        let names: Vec<String> = (0..12).map(|i| format!("j{i}")).collect();
        assert_eq!(quoted(&names[..2]), "`j0`, `j1`");
        assert_eq!(quoted(&names[..10]).matches('`').count(), 20);
        assert!(quoted(&names).ends_with("`j9` and 2 more"));
        assert_eq!(listed(&names[..3], " or "), "j0 or j1 or j2");
        assert_eq!(listed([""; 0], ", "), "");
        // A name of a million characters takes no more room than one of 160.
        let long = "ä".repeat(1_000_000);
        assert_eq!(quoted([&long, &long]).chars().count(), 2 * 163 + 2);
        assert_eq!(shortened(&long[..320]), long[..320]);
    }

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
