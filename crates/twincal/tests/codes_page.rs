//! docs/codes.md has every code with its meaning, and the answer of every code that decides.

use std::fs;
use std::path::Path;
use twincal::assess::{Answer, decision_table};
use twincal::{Code, Mistake};

fn page() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/codes.md");
    fs::read_to_string(path).expect("docs/codes.md")
}

#[test]
fn the_page_has_every_code_with_its_meaning() {
    let page = page();
    let (_, all) = page.split_once("## All codes").expect("the list");
    let rows: Vec<&str> = all.lines().filter(|line| line.starts_with("| `")).collect();
    let wanted: Vec<String> = Code::ALL
        .iter()
        .map(|code| format!("| `{code}` | {} |", code.meaning()))
        .collect();
    assert_eq!(rows, wanted);
}

#[test]
fn the_page_has_the_answer_of_every_code_that_decides() {
    let page = page();
    let (table, _) = page.split_once("## All codes").expect("the table");
    let rows: Vec<(&str, &str)> = table
        .lines()
        .filter_map(|line| {
            let (code, answer) = line.strip_prefix("| `")?.split_once('`')?;
            Some((code, answer.rsplit('`').nth(1)?))
        })
        .collect();
    let decides = decision_table().filter(|(_, answer)| *answer != Answer::Yes);
    let mut wanted: Vec<(&str, &str)> = decides
        .map(|(code, answer)| (code.as_str(), answer.as_str()))
        .collect();
    let mut mistakes: Vec<_> = Mistake::codes()
        .map(|(code, severity)| (Mistake::of(code, severity), code))
        .collect();
    mistakes.sort_by_key(|(mistake, _)| *mistake);
    let mistakes = mistakes.iter().map(|(_, code)| (code.as_str(), "not_yet"));
    wanted.splice(1..1, mistakes);
    assert_eq!(rows, wanted);
}
