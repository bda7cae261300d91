//! Functions of at most 60 lines in files of at most 600, in every crate, tests and benches included.

#[path = "common/source.rs"]
pub(crate) mod source;

use source::{blanked, files_below};
use std::fs;
use std::path::Path;

/// Most lines of a function, from its `fn` to the brace that closes it.
const FUNCTION: usize = 60;
const FILE: usize = 600;

#[test]
fn functions_and_files_are_short() {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    let crates = manifest.parent().expect("the folder of all crates");
    let root = crates.parent().expect("the folder of the workspace");
    let files = [files_below(crates), files_below(&root.join("fuzz"))].concat();
    assert!(files.len() > 800, "{} files", files.len());
    let mut long = Vec::new();
    for path in files {
        let text = fs::read_to_string(&path).expect("a readable source tree");
        let name = path.strip_prefix(root).expect("a file below the folder");
        long.extend(too_long(&name.display().to_string(), &text));
    }
    assert!(
        long.is_empty(),
        "{} are too long:\n{}",
        long.len(),
        long.join("\n")
    );
}

#[test]
fn what_is_too_long_is_named_with_its_line() {
    let of = |lines: usize| {
        let body = "    step();\n".repeat(lines - 2);
        format!("/// A comment.\n#[test]\nfn long() {{\n{body}}}\n")
    };
    assert!(too_long("a.rs", &of(60)).is_empty());
    assert_eq!(
        too_long("a.rs", &of(61)),
        ["a.rs:3: `long` has 61 lines, the limit is 60"]
    );
    assert!(too_long("b.rs", &"\n".repeat(600)).is_empty());
    assert_eq!(
        too_long("b.rs", &"\n".repeat(601)),
        ["b.rs: 601 lines, the limit is 600"]
    );
}

#[test]
fn signatures_end_in_a_body_or_a_semicolon() {
    let text = "
trait Area {
    fn none(
        &self,
        corners: [f64; 3],
    ) -> [f64; 2];
    fn one(&self) -> fn(f64) -> f64 { f64::sin }
}
pub(crate) fn many<'a>(
    text: &'a str,
) -> [u8; 2]
where
    u8: Sized,
{
    [text.len() as u8, b'}']
}
";
    assert_eq!(sizes(text), ["one 7 1", "many 9 8"]);
}

#[test]
fn braces_in_texts_and_comments_close_nothing() {
    let text = r##"fn outer() {
    /* { */ let raw = r#"
}
fn raw() {
"#;
    let escaped = "\"}"; // } fn comment() {
    fn inner() {
        call('}');
    }
    let closure = |x: usize| { x };
}
fn after() {}
"##;
    assert_eq!(sizes(text), ["outer 1 11", "inner 7 3", "after 12 1"]);
}

/// Name, line and lines of every function.
fn sizes(text: &str) -> Vec<String> {
    let code = blanked(text);
    let all = functions(&code).into_iter();
    all.map(|own| format!("{} {} {}", own.name, own.line, own.lines))
        .collect()
}

/// What is too long in a file, or the file itself.
fn too_long(name: &str, text: &str) -> Vec<String> {
    let mut long = Vec::new();
    let lines = text.lines().count();
    if lines > FILE {
        long.push(format!("{name}: {lines} lines, the limit is {FILE}"));
    }
    let code = blanked(text);
    let functions = functions(&code).into_iter();
    long.extend(functions.filter(|own| own.lines > FUNCTION).map(|own| {
        format!(
            "{name}:{}: `{}` has {} lines, the limit is {FUNCTION}",
            own.line, own.name, own.lines
        )
    }));
    long
}

struct Function<'a> {
    name: &'a str,
    /// Line of its `fn`.
    line: usize,
    lines: usize,
}

/// Every function with a body, those within another too.
fn functions(code: &str) -> Vec<Function<'_>> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let of = |(at, word): (usize, &str)| {
        let (before, function) = code.split_at(at);
        let end = body_end(function).filter(|_| !before.ends_with(is_word))?;
        let name = &function[word.len()..];
        Some(Function {
            name: &name[..name.find(|c| !is_word(c)).unwrap_or(name.len())],
            line: 1 + before.matches('\n').count(),
            lines: 1 + function[..end].matches('\n').count(),
        })
    };
    code.match_indices("fn ").filter_map(of).collect()
}

/// Where the brace stands that closes the body; none of a signature that ends in a semicolon.
fn body_end(function: &str) -> Option<usize> {
    let mut level = 0;
    for (at, c) in function.char_indices() {
        match c {
            '(' | '[' | '{' => level += 1,
            ')' | ']' | '}' => level -= 1,
            _ => {}
        }
        if level == 0 && (c == '}' || c == ';') {
            return (c == '}').then_some(at);
        }
    }
    None
}
