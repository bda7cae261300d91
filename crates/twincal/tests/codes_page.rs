//! docs/codes.md has the answer of every code that decides; `twincal-io/tests/codes_page.rs` looks at its other part.

use std::fs;
use std::path::Path;
use twincal::Mistake;
use twincal::assess::{Answer, decision_table};

fn page() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/codes.md");
    fs::read_to_string(path).expect("docs/codes.md")
}

#[test]
fn the_page_has_the_answer_of_every_code_that_decides() {
    let page = page();
    let (table, _) = page.split_once("## Exit codes").expect("the table");
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
