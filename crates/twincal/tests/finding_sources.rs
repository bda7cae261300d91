//! The table of what findings hold (`error/table.rs`) and the places of the three crates that make findings say the same.

use crate::size::source::files_below;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use twincal::Code;

/// A token of a source file: comments and white space are left out.
#[derive(Debug, Clone, PartialEq)]
enum Token {
    Word(String),
    Text(String),
    Sign(char),
}

/// A place that makes findings, or adds numbers to one. A variable stands for all that its function names, else its file.
#[derive(Debug, Default)]
struct Place {
    file: String,
    codes: BTreeSet<String>,
    /// Empty where numbers are added to a finding.
    severities: BTreeSet<String>,
    names: BTreeSet<String>,
}

impl Place {
    /// Whether it may make a finding of this code.
    fn makes(&self, code: Code) -> bool {
        self.codes.contains(&format!("{code:?}"))
    }

    /// Codes that it may make.
    fn codes(&self) -> impl Iterator<Item = Code> {
        Code::ALL.iter().copied().filter(|code| self.makes(*code))
    }
}

/// Names of severities and of evidence that the table has of a code.
fn listed(code: Code) -> [BTreeSet<String>; 2] {
    let severities = code.severities().iter().map(|own| format!("{own:?}"));
    let names = code.evidence().iter().map(|name| (*name).to_owned());
    [severities.collect(), names.collect()]
}

#[test]
fn findings_are_made_as_the_table_says() {
    let mut wrong = Vec::new();
    for place in places() {
        let all: Vec<[BTreeSet<String>; 2]> = place.codes().map(listed).collect();
        let has = |kind: usize, name: &String| all.iter().any(|own| own[kind].contains(name));
        let severities = place.severities.iter().filter(|own| !has(0, own));
        let of_chapters = |name: &&String| Code::EVIDENCE_OF_CHAPTERS.contains(&name.as_str());
        let names = place.names.iter().filter(|own| !has(1, own));
        let names = names.filter(|name| !of_chapters(name));
        for unknown in severities.chain(names) {
            wrong.push(format!(
                "{}: {:?} has no `{unknown}`",
                place.file, place.codes
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_table_lists_nothing_that_no_place_makes() {
    let places = places();
    assert!(places.len() > 140, "{} places", places.len());
    let mut unmade = Vec::new();
    for &code in Code::ALL {
        let own = || places.iter().filter(|place| place.makes(code));
        let [severities, names] = listed(code);
        let severities =
            (severities.iter()).filter(|name| !own().any(|place| place.severities.contains(*name)));
        let names = names
            .iter()
            .filter(|name| !own().any(|place| place.names.contains(*name)));
        unmade.extend(
            severities
                .chain(names)
                .map(|name| format!("{code}: {name}")),
        );
        // Codes that only claims have make no finding.
        let makes = own().any(|place| !place.severities.is_empty());
        if makes == code.severities().is_empty() {
            unmade.push(format!("{code}: severities"));
        }
    }
    assert!(unmade.is_empty(), "{}", unmade.join("\n"));
}

#[test]
fn names_of_evidence_are_in_snake_case_and_in_order() {
    for &code in Code::ALL {
        let names = code.evidence();
        assert!(names.is_sorted(), "{code}: {names:?}");
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        assert!(names.iter().all(|name| name.chars().all(plain)), "{code}");
        assert!(code.severities().is_sorted(), "{code}");
    }
}

#[test]
fn every_example_is_a_message_that_some_place_makes() {
    let read = |(file, text): (String, String)| {
        let texts = templates(&without_tests(tokens(&text)));
        (places_of(&file, &text), texts)
    };
    let files: Vec<(Vec<Place>, Vec<Vec<String>>)> = sources().into_iter().map(read).collect();
    let mut wrong = Vec::new();
    for &code in Code::ALL {
        let Some(example) = code.example() else {
            if !code.severities().is_empty() {
                wrong.push(format!("{code}: no example"));
            }
            continue;
        };
        // Some sentences are made in files of their own.
        let made = files.iter().any(|(places, texts)| {
            let own = places.iter().any(|place| place.makes(code));
            let least = if own { SHORTEST } else { LONG };
            texts.iter().any(|text| is_made_by(example, text, least))
        });
        if !made {
            wrong.push(format!("{code}: {example}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_message_is_matched_by_its_template_alone() {
    let made = |message: &str, template: &str| is_made_by(message, &pieces(template), 3);
    assert!(made(
        "joint `a`: 3 of 7 rows",
        "joint `{name}`: {} of {} rows"
    ));
    assert!(made("q = { a = -1.0 }", "q = {{ {name} = -1.0 }}"));
    assert!(made("a long sentence", "a long \\\n      sentence"));
    assert!(made("it says \"no\"", "it says \\\"{}\\\""));
    assert!(!made(
        "joint `a`: 3 of 7 samples",
        "joint `{name}`: {} of {} rows"
    ));
    assert!(!made("3 of 7 rows, say", "{} of {} rows"));
    assert!(!made("7 a", "{} a"), "too short to say anything");
}

#[test]
fn places_are_read_as_they_are_written() {
    let text = r##"
        use twincal::{Code, Finding}; // Finding::new(Severity::Note, Code::Comment)
        fn one(k: [f64; 2]) -> Finding {
            let s = r#"Finding::new("#;
            Finding::new(Severity::Note, Code::One, 'x', "fn \" a", 0).with([("a", 1.0), ("b", f(2))]).of_joint(s)
        }
        fn two<'a>(many: bool) -> Finding {
            let (severity, code) = if many { (Severity::Warning, Code::Two) } else { (Severity::Note, Code::Three) };
            let finding = Finding::new(severity, code, "", "", 0);
            finding.with([("c", 1.0)])
        }
        fn more(finding: Finding) -> Finding { finding.with(Some(("d", 2.0))) }
        #[cfg(all(test, feature = "report"))]
        mod tests { fn f() { Finding::new(Severity::Degraded, Code::Test, "", "", 0); } }
    "##;
    let found: Vec<String> = places_of("f", text)
        .iter()
        .map(|own| format!("{:?} {:?} {:?}", own.codes, own.severities, own.names))
        .collect();
    let wanted = [
        r#"{"One"} {"Note"} {"a", "b"}"#,
        r#"{"Three", "Two"} {"Note", "Warning"} {"c"}"#,
        r#"{"One", "Three", "Two"} {} {"d"}"#,
    ];
    assert_eq!(found, wanted);
}

/// All places of the three crates.
fn places() -> Vec<Place> {
    let sources = sources().into_iter();
    let own = sources.filter(|(_, text)| text.contains("Finding"));
    own.flat_map(|(file, text)| places_of(&file, &text))
        .collect()
}

/// Paths and texts of the three crates' files.
fn sources() -> Vec<(String, String)> {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    // Claims have evidence of their own, and `error` defines findings.
    let skipped = |name: &str| {
        ["assess", "error", "testing", "fixture"].contains(&name) || name.ends_with("tests")
    };
    let of_crate = |name| {
        let folder = crates.join(name).join("src");
        let mut files = files_below(&folder);
        files.retain(|path| {
            let inside = path.strip_prefix(&folder).expect("a file below the folder");
            let inside = inside.with_extension("");
            let mut parts = inside.components();
            !parts.any(|part| skipped(&part.as_os_str().to_string_lossy()))
        });
        files
    };
    let files = ["twincal", "twincal-io", "twincal-cli"].map(of_crate);
    let read = |path: PathBuf| {
        let text = fs::read_to_string(&path).expect("a readable source tree");
        (path.to_string_lossy().into_owned(), text)
    };
    files.concat().into_iter().map(read).collect()
}

/// Letters that a template of a message has at least, in the file that makes the finding.
const SHORTEST: usize = 5;
/// The same in another file.
const LONG: usize = 12;

/// Texts of a file, each as what stands between its placeholders.
fn templates(tokens: &[Token]) -> Vec<Vec<String>> {
    let texts = tokens.iter().filter_map(|token| match token {
        Token::Text(text) => Some(pieces(text)),
        _ => None,
    });
    texts.collect()
}

/// Whether a `format!` with these pieces of at least so many letters can print the message.
fn is_made_by(message: &str, pieces: &[String], letters: usize) -> bool {
    let own = |piece: &String| piece.chars().filter(|c| !c.is_whitespace()).count();
    let (Some((first, others)), true) = (
        pieces.split_first(),
        pieces.iter().map(own).sum::<usize>() >= letters,
    ) else {
        return false;
    };
    let Some(mut rest) = message.strip_prefix(first.as_str()) else {
        return false;
    };
    let Some((last, between)) = others.split_last() else {
        return rest.is_empty();
    };
    for piece in between {
        match rest.find(piece.as_str()) {
            Some(at) => rest = &rest[at + piece.len()..],
            None => return false,
        }
    }
    rest.ends_with(last.as_str())
}

/// What stands between the placeholders of a template, escapes resolved.
fn pieces(template: &str) -> Vec<String> {
    let (mut pieces, mut piece) = (Vec::new(), String::new());
    let mut rest = template;
    while let Some(c) = rest.chars().next() {
        let mut len = c.len_utf8();
        if rest.starts_with("{{") || rest.starts_with("}}") {
            (len, piece) = (2, piece + &rest[..1]);
        } else if c == '{' {
            len = rest.find('}').map_or(rest.len(), |end| end + 1);
            pieces.push(std::mem::take(&mut piece));
        } else if let Some(next) = rest.strip_prefix("\\\n") {
            len = rest.len() - next.trim_start().len();
        } else if c == '\\' {
            len = 1 + rest[1..].chars().next().map_or(0, char::len_utf8);
            piece += &rest[1..len];
        } else {
            piece.push(c);
        }
        rest = &rest[len..];
    }
    pieces.push(piece);
    pieces
}

/// Places of one file.
fn places_of(file: &str, text: &str) -> Vec<Place> {
    let tokens = without_tests(tokens(text));
    let (mut places, mut at) = (Vec::new(), 0);
    // What stands outside functions makes nothing.
    let is_function = |at: &usize| {
        is_word(&tokens[*at], "fn") && matches!(tokens.get(at + 1), Some(Token::Word(_)))
    };
    while let Some(start) = (at..tokens.len()).find(is_function) {
        let body = body(&tokens, start);
        at = body.end.max(start + 1);
        places.extend(of_function(file, &tokens, &tokens[body]));
    }
    places
}

/// Places of one function of a file.
fn of_function(file: &str, whole: &[Token], body: &[Token]) -> Vec<Place> {
    if !body
        .iter()
        .any(|token| is_word(token, "with") || is_word(token, "Finding"))
    {
        return Vec::new();
    }
    let mut free = body.to_vec();
    let (mut places, mut chains) = (Vec::new(), Vec::new());
    for at in (0..body.len()).filter(|at| starts(&body[*at..], "Finding : : new (")) {
        let call = at..closed(body, at + 4);
        let (mut end, mut names) = (call.end, BTreeSet::new());
        while starts(&body[end..], ". with (") {
            let with = end..closed(body, end + 2);
            end = with.end;
            names.extend(names_in(&body[with.clone()]));
            free[with].fill(Token::Sign(' '));
        }
        let pick = |of: &str| {
            let ways = [&body[call.clone()], body, whole].map(|tokens| behind(tokens, of));
            ways.into_iter().find(|found| !found.is_empty())
        };
        chains.push(end > call.end);
        places.push(Place {
            file: file.to_owned(),
            codes: pick("Code").unwrap_or_default(),
            severities: pick("Severity").unwrap_or_default(),
            names,
        });
    }
    // Numbers that a variable holds, or that a finding gets later.
    let names = names_in(&free);
    let later = (0..free.len()).any(|at| starts(&free[at..], ". with ("));
    let (codes, only) = (behind(whole, "Code"), places.len() == 1);
    for (place, chained) in places.iter_mut().zip(chains) {
        let open = place.names.is_empty() && (chained || later) || only && later;
        place.names.extend(names.iter().filter(|_| open).cloned());
    }
    if places.is_empty() && later && !names.is_empty() && !codes.is_empty() {
        places.push(Place {
            file: file.to_owned(),
            codes,
            names,
            ..Place::default()
        });
    }
    places
}

/// What follows `of::` and begins with a capital.
fn behind(tokens: &[Token], of: &str) -> BTreeSet<String> {
    let path = format!("{of} : :");
    let at = (0..tokens.len()).filter(|at| starts(&tokens[*at..], &path));
    let next = at.filter_map(|at| match tokens.get(at + 3) {
        Some(Token::Word(word)) if word.starts_with(char::is_uppercase) => Some(word.clone()),
        _ => None,
    });
    next.filter(|word| word != "ALL").collect()
}

/// Texts that begin a pair: `("name", …)`.
fn names_in(tokens: &[Token]) -> BTreeSet<String> {
    let plain = |name: &str| name.chars().all(|c| c.is_alphanumeric() || c == '_');
    let pairs = tokens.windows(3).filter_map(|own| match own {
        [Token::Sign('('), Token::Text(name), Token::Sign(',')] => Some(name.clone()),
        _ => None,
    });
    pairs.filter(|name| plain(name)).collect()
}

fn is_word(token: &Token, word: &str) -> bool {
    matches!(token, Token::Word(own) if own == word)
}

/// Whether tokens begin like this.
fn starts(tokens: &[Token], wanted: &str) -> bool {
    let mut tokens = tokens.iter();
    wanted.split(' ').all(|word| match tokens.next() {
        Some(Token::Word(own)) => own == word,
        Some(Token::Sign(own)) => word.starts_with(*own),
        Some(Token::Text(_)) | None => false,
    })
}

/// Place behind the bracket that closes the first one from `at` on.
fn closed(tokens: &[Token], at: usize) -> usize {
    let mut level = 0;
    for (place, token) in tokens.iter().enumerate().skip(at) {
        level += match token {
            Token::Sign('(' | '[' | '{') => 1,
            Token::Sign(')' | ']' | '}') => -1,
            _ => 0,
        };
        if level == 0 && matches!(token, Token::Sign(')' | ']' | '}')) {
            return place + 1;
        }
    }
    tokens.len()
}

/// A function from its name to the end of its body.
fn body(tokens: &[Token], start: usize) -> std::ops::Range<usize> {
    let mut at = start;
    while let Some(token) = tokens.get(at) {
        match token {
            Token::Sign('{') => return start..closed(tokens, at),
            Token::Sign(';') => return start..at,
            Token::Sign('(' | '[') => at = closed(tokens, at),
            _ => at += 1,
        }
    }
    start..tokens.len()
}

/// Tokens without `#[cfg(test)]` items, `#[cfg(all(test, …))]` either.
fn without_tests(tokens: Vec<Token>) -> Vec<Token> {
    let mut kept = Vec::with_capacity(tokens.len());
    let mut at = 0;
    while at < tokens.len() {
        let attribute = at..closed(&tokens, at);
        let words = |word| {
            tokens[attribute.clone()]
                .iter()
                .any(|own| is_word(own, word))
        };
        if starts(&tokens[at..], "# [ cfg (") && words("test") && !words("not") {
            at = attribute.end;
            at = match (at..tokens.len()).find(|at| matches!(tokens[*at], Token::Sign('{' | ';'))) {
                Some(open) if tokens[open] == Token::Sign('{') => closed(&tokens, open),
                Some(end) => end + 1,
                None => tokens.len(),
            };
        } else {
            kept.push(tokens[at].clone());
            at += 1;
        }
    }
    kept
}

/// The tokens of a source file.
fn tokens(text: &str) -> Vec<Token> {
    let mut tokens = Vec::new();
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let raw = rest.trim_start_matches('r').trim_start_matches('#');
        let hashes = rest.len() - raw.len();
        let len = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if c == 'r' && hashes < 6 && raw.starts_with('"') {
            let close = format!("\"{}", "#".repeat(hashes - 1));
            let end = raw[1..].find(&close).map_or(raw.len() - 1, |end| end + 1);
            tokens.push(Token::Text(raw[1..end].to_owned()));
            hashes + end + close.len()
        } else if c == '"' {
            let end = quoted(rest, '"');
            tokens.push(Token::Text(rest[1..end - 1].to_owned()));
            end
        } else if c == '\'' {
            let after: Vec<char> = rest.chars().skip(1).take(2).collect();
            match after[..] {
                ['\\', _] | [_, '\''] => quoted(rest, '\''),
                _ => 1,
            }
        } else if c.is_alphanumeric() || c == '_' {
            let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_');
            let end = end.unwrap_or(rest.len());
            tokens.push(Token::Word(rest[..end].to_owned()));
            end
        } else {
            if !c.is_whitespace() {
                tokens.push(Token::Sign(c));
            }
            c.len_utf8()
        };
        rest = &rest[len..];
    }
    tokens
}

/// Length of a literal with escapes, both quotes included.
fn quoted(rest: &str, quote: char) -> usize {
    let mut escaped = false;
    for (at, c) in rest.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            _ if c == quote => return at + 1,
            _ => {}
        }
    }
    rest.len()
}
