//! docs/codes.md has every code with its meaning, and with what its findings hold: severities, numbers, remedy and a message.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use twincal::assess::NUMBERS;
use twincal::error::{FINDING_NUMBERS, FindingNumber};
use twincal::{Code, Severity};
use twincal_io::words::{When, remedy};

#[test]
fn the_page_has_every_code_with_what_its_findings_hold() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/codes.md");
    let page = fs::read_to_string(path).expect("docs/codes.md");
    let start = page.find("\n### ").expect("the first code");
    let wanted: String = Code::ALL.iter().map(|code| section(*code)).collect();
    if page[start..] != wanted {
        let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("codes.md");
        fs::write(&file, page[..start].to_owned() + &wanted).expect("a page");
        panic!(
            "docs/codes.md differs: {} is how it has to be",
            file.display()
        );
    }
}

#[test]
fn the_page_has_every_number_of_claims() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/codes.md");
    let page = fs::read_to_string(path).expect("docs/codes.md");
    let row = |(name, meaning): &(&str, &str)| format!("| `{name}` | {meaning} |\n");
    let table: String = NUMBERS.iter().map(row).collect();
    let head = "| number | what it is |\n|---|---|\n";
    assert!(page.contains(&format!("{head}{table}\n")), "{table}");
}

#[test]
fn the_page_has_every_number_of_findings() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/codes.md");
    let page = fs::read_to_string(path).expect("docs/codes.md");
    let row = |row: &FindingNumber| {
        let codes: Vec<String> = row.codes.iter().map(|code| format!("`{code}`")).collect();
        let of = if codes.is_empty() { "" } else { " of " };
        let (name, unit, meaning) = (row.name, row.unit, row.meaning);
        format!(
            "| `{name}`{of}{} | {unit} | {meaning} |\n",
            codes.join(", ")
        )
    };
    let table: String = FINDING_NUMBERS.iter().map(row).collect();
    let head = "| number | unit | what it is |\n|---|---|---|\n";
    assert!(page.contains(&format!("{head}{table}\n")), "{table}");
}

/// What the page says of a code.
fn section(code: Code) -> String {
    let mut text = format!("\n### `{code}`\n{}\n\n", code.meaning());
    let mut line = |what: &str, words: &str| {
        let _ = writeln!(text, "- {what}: {words}");
    };
    let severities = code.severities().iter().map(|own| match own {
        Severity::Note => "note",
        Severity::Warning => "warning",
        Severity::Degraded => "degraded",
    });
    let severities: Vec<&str> = severities.collect();
    match severities[..] {
        [] => line("Severity", "only claims have this code"),
        _ => line("Severity", &severities.join(", ")),
    }
    if code.leaves_out_its_log() {
        line("Subject", "the log, which the message does not name");
    }
    let numbers: Vec<String> = (code.evidence().iter())
        .map(|name| format!("`{name}`"))
        .collect();
    if !numbers.is_empty() {
        line("Evidence", &numbers.join(", "));
    }
    let numbers: Vec<String> = (code.evidence_of_claims().iter())
        .map(|name| format!("`{name}`"))
        .collect();
    if !numbers.is_empty() {
        line("Evidence of claims", &numbers.join(", "));
    }
    if let Some((_, own)) = remedy(code) {
        let when = match own.when {
            When::Now => "Remedy, with these logs",
            When::NextLog => "Remedy, in the next log",
            When::Never => "Remedy",
        };
        line(when, &own.text.replace('<', "\\<"));
    }
    if let Some(example) = code.example() {
        let _ = write!(text, "\n```text\n{example}\n```\n");
    }
    text
}
