//! Text in the page: names without control characters, escaped, broken and cut where they are long.

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
