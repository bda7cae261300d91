//! Text as people read it: names without control characters, numbers with a sensible number of digits.

use std::fmt::Write as _;

/// Narrow no-break space: groups thousands and keeps a unit beside its number.
pub(super) const THIN: char = '\u{202f}';

/// A name as it may be shown: terminal escape sequences, control and direction-changing characters are gone, line
/// breaks and tabs stay. Escaping for HTML is a separate step ([`escape`], or the template's own).
pub(super) fn clean(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        match c {
            '\u{1b}' | '\u{9b}' => {
                // ECMA-48: ESC [ parameters final, or ESC ] text terminated by BEL or ESC \.
                let kind = if c == '\u{9b}' {
                    Some('[')
                } else {
                    rest.next_if(|&n| n == '[' || n == ']')
                };
                match kind {
                    Some('[') => while rest.next().is_some_and(|n| !('@'..='~').contains(&n)) {},
                    Some(_) => {
                        while let Some(n) = rest.next() {
                            if n == '\u{7}'
                                || (n == '\u{1b}' && rest.next_if(|&m| m == '\\').is_some())
                            {
                                break;
                            }
                        }
                    }
                    None => {}
                }
            }
            '\n' | '\t' => out.push(c),
            _ if c.is_control() || is_direction_control(c) => {}
            // Not allowed in XML, and of no use in a name.
            '\u{fffe}' | '\u{ffff}' | '\u{feff}' => {}
            _ => out.push(c),
        }
    }
    out
}

/// Characters that reorder what stands beside them ("trojan source").
fn is_direction_control(c: char) -> bool {
    matches!(c, '\u{200e}' | '\u{200f}' | '\u{061c}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// `text` cleaned and escaped for element content and for attribute values in either kind of quotes.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in clean(text).chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            _ => out.push(c),
        }
    }
    out
}

/// [`escape`]d text with places for line breaks after `_` and `.` before a letter: names break there or nowhere, and
/// only words of more than `whole` letters.
///
/// What stands between two backticks is code; a flag is not broken at its hyphens.
pub(super) fn breakable(text: &str, whole: usize) -> String {
    let text = clean(text);
    let parts: Vec<&str> = text.split('`').collect();
    if parts.len().is_multiple_of(2) {
        return prose(&text, whole);
    }
    let tagged = parts.iter().enumerate().map(|(n, part)| match n % 2 {
        0 => prose(part, whole),
        _ => format!("<code>{}</code>", breaking(part, whole)),
    });
    tagged.collect()
}

/// What is no code.
fn prose(text: &str, whole: usize) -> String {
    let words = text.split_inclusive(char::is_whitespace);
    let tagged = words.map(|word| match flag(word) {
        None => breaking(word, whole),
        Some((before, flag, after)) => format!(
            "{}<code class=\"flag\">{}</code>{}",
            escape(before),
            escape(flag),
            escape(after)
        ),
    });
    tagged.collect()
}

fn breaking(text: &str, whole: usize) -> String {
    let mut out = String::with_capacity(text.len());
    for word in text.split_inclusive(char::is_whitespace) {
        if word.trim_end().chars().count() <= whole {
            out.push_str(&escape(word));
            continue;
        }
        let mut rest = 0;
        let mut letters = word.char_indices().peekable();
        while let Some((at, letter)) = letters.next() {
            let next = letters.peek().map(|(_, next)| *next);
            let breaks = match letter {
                '_' => next.is_some_and(char::is_alphabetic),
                '.' => next.is_some_and(char::is_alphabetic),
                _ => false,
            };
            if breaks {
                out.push_str(&escape(&word[rest..=at]));
                out.push_str("<wbr/>");
                rest = at + 1;
            }
        }
        out.push_str(&escape(&word[rest..]));
    }
    out
}

/// "(--heldout, " as "(", "--heldout" and ", ".
fn flag(word: &str) -> Option<(&str, &str, &str)> {
    let rest = word.trim_start_matches('(');
    let is_flag = rest.starts_with("--") && rest[2..].starts_with(char::is_alphabetic);
    let end = rest.find(|letter: char| letter != '-' && !letter.is_alphanumeric());
    let (flag, after) = rest.split_at(end.unwrap_or(rest.len()));
    is_flag.then(|| (&word[..word.len() - rest.len()], flag, after))
}

/// `text` cut to about `width` pixels at `size` pixels per em, with an ellipsis in the middle (names differ at their ends).
pub(super) fn shorten(text: &str, width: f64, size: f64) -> String {
    let text = clean(text).replace(['\n', '\t'], " ");
    if text_width(&text, size) <= width {
        return text;
    }
    let letters: Vec<char> = text.chars().collect();
    let mut keep = letters.len();
    while keep > 2 {
        keep -= 1;
        let head: String = letters[..keep.div_ceil(2)].iter().collect();
        let tail: String = letters[letters.len() - keep / 2..].iter().collect();
        let cut = format!("{head}…{tail}");
        if text_width(&cut, size) <= width {
            return cut;
        }
    }
    "…".into()
}

/// Estimated width of `text` in pixels at `size` pixels per em in a proportional sans-serif face (a little too wide).
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    let ems: f64 = text
        .chars()
        .map(|c| match c {
            'i' | 'l' | 'j' | 'I' | '.' | ',' | '\'' | '|' | '(' | ')' | '^' | ' ' | 'f' | 't'
            | 'r' | '/' | '·' => 0.39,
            'm' | 'w' | 'M' | 'W' | '@' | '%' | '…' | '−' | '+' | '=' => 0.92,
            'A'..='Z' => 0.7,
            _ if (c as u32) >= 0x2e80 => 1.05,
            _ => 0.61,
        })
        .sum();
    ems * size
}

/// `x` with `digits` significant digits; scientific beyond 10⁵ and below 10⁻³; "–" if it is not a number.
pub(super) fn number(x: f64, digits: usize) -> String {
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
pub(super) fn with_sd(x: f64, sd: f64) -> (String, String) {
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
pub(super) fn interval(ends: [f64; 2]) -> String {
    let width = ends[1] - ends[0];
    if !(width.is_finite() && width > 0.0) {
        return format!("{} … {}", number(ends[0], 3), number(ends[1], 3));
    }
    let (low, _) = with_sd(ends[0], width / 4.0);
    let (high, _) = with_sd(ends[1], width / 4.0);
    format!("{low} … {high}")
}

/// `x` and both ends of an interval around it, with the digits that its width supports: "294 (284 … 378)".
pub(super) fn with_ends(x: f64, ends: [f64; 2]) -> String {
    let spread = 0.5 * (ends[1] - ends[0]);
    let [x, low, high] = [x, ends[0], ends[1]].map(|x| with_sd(x, spread).0);
    format!("{x} ({low} … {high})")
}

/// Joints as the subject of a sentence; "joint" is not said twice where they are called so.
pub(super) fn subject<S: AsRef<str>>(joints: &[S]) -> String {
    let is_said = |name: &S| name.as_ref().to_lowercase().starts_with("joint");
    let word = match joints {
        all if all.iter().all(is_said) => "",
        [_] => "Joint ",
        _ => "Joints ",
    };
    format!("{word}{}", list(joints))
}

/// A probability with two decimals that never rounds to certainty: 0.999 and 1 are "> 0.99".
pub(super) fn probability(p: f64) -> String {
    match p {
        _ if !p.is_finite() => "–".into(),
        _ if p > 0.995 => format!(">{THIN}0.99"),
        _ if p < 0.005 => format!("<{THIN}0.01"),
        _ => format!("{p:.2}"),
    }
}

/// A share as per cent with one decimal.
pub(super) fn percent(share: f64) -> String {
    if share.is_finite() {
        signed(&format!("{:.1}{THIN}%", 100.0 * share))
    } else {
        "–".into()
    }
}

/// `x` with a fixed number of decimals.
pub(super) fn fixed(x: f64, decimals: usize) -> String {
    if x.is_finite() {
        signed(&format!("{x:.decimals$}"))
    } else {
        "–".into()
    }
}

/// A count with its thousands apart.
pub(super) fn count(n: u64) -> String {
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

/// At most so many names; the others are counted, as the last one: "2 more".
pub(super) fn first_of(mut names: Vec<String>, most: usize) -> Vec<String> {
    let more = names.len().saturating_sub(most);
    names.truncate(most);
    if more > 0 {
        names.push(format!("{more} more"));
    }
    names
}

/// "a", "a and b", "a, b and c".
pub(super) fn list<S: AsRef<str>>(items: &[S]) -> String {
    let mut out = String::new();
    for (i, item) in items.iter().enumerate() {
        let join = if i == 0 {
            ""
        } else if i + 1 == items.len() {
            " and "
        } else {
            ", "
        };
        let _ = write!(out, "{join}{}", item.as_ref());
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escape_sequences_controls_and_direction_marks_are_stripped() {
        assert_eq!(clean("a\u{1b}[31;1mred\u{1b}[0m b"), "ared b");
        assert_eq!(clean("x\u{1b}]0;title\u{7}y\u{1b}]8;;u\u{1b}\\z"), "xyz");
        assert_eq!(clean("c1\u{9b}2Jd\0\u{8}\u{7f}e"), "c1de");
        assert_eq!(clean("\u{202e}gpj.exe\u{2066}"), "gpj.exe");
        assert_eq!(
            clean("line\nbreak\tand Gelenk_β"),
            "line\nbreak\tand Gelenk_β"
        );
        assert_eq!(clean("open\u{1b}["), "open");
    }

    #[test]
    fn escaping_covers_content_and_attributes() {
        assert_eq!(
            escape(r#"<a b="c" d='e'>&"#),
            "&lt;a b=&quot;c&quot; d=&#39;e&#39;&gt;&amp;"
        );
    }

    #[test]
    fn names_break_after_an_underscore_or_a_dot_before_a_letter() {
        assert_eq!(
            breakable("shoulder_pan.<b> 0.25 q_1.viscous: end.", 0),
            "shoulder_<wbr/>pan.&lt;b&gt; 0.25 q_1.<wbr/>viscous: end."
        );
        assert_eq!(breakable("é_ü_", 0), "é_<wbr/>ü_");
        assert_eq!(
            breakable("logs (--held-out, or `--rate HZ`) -- no -3", 0),
            "logs (<code class=\"flag\">--held-out</code>, or <code>--rate HZ</code>) -- no -3"
        );
        assert_eq!(
            breakable("of elbow_joint and left_elbow_joint", 11),
            "of elbow_joint and left_<wbr/>elbow_<wbr/>joint"
        );
    }

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
        assert_eq!(probability(0.999_9), ">\u{202f}0.99");
        assert_eq!(probability(1.0), ">\u{202f}0.99");
        assert_eq!(probability(1e-6), "<\u{202f}0.01");
        assert_eq!(probability(0.0), "<\u{202f}0.01");
        assert_eq!(with_ends(293.9, [284.5, 378.1]), "294 (284 … 378)");
        assert_eq!(subject(&["joint_4"]), "joint_4");
        assert_eq!(subject(&["Joint1", "joint2"]), "Joint1 and joint2");
        assert_eq!(subject(&["elbow"]), "Joint elbow");
        assert_eq!(subject(&["joint1", "elbow"]), "Joints joint1 and elbow");
        assert_eq!(percent(0.946_4), "94.6\u{202f}%");
        assert_eq!(count(1_048_576), "1\u{202f}048\u{202f}576");
        assert_eq!(list(&["a", "b", "c"]), "a, b and c");
    }

    #[test]
    fn long_names_keep_both_ends() {
        let short = shorten("shoulder_pan_joint_of_the_left_arm.viscous", 120.0, 12.0);
        assert!(
            short.starts_with("should") && short.ends_with("cous") && short.contains('…'),
            "{short}"
        );
        assert!(text_width(&short, 12.0) <= 120.0);
        assert_eq!(shorten("q1", 120.0, 12.0), "q1");
        assert_eq!(shorten("wide", 1.0, 12.0), "…");
    }
}
