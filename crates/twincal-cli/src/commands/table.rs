//! Tables as wide as the terminal. A cell is broken between words, after `_` and after `.`, never inside a part of a name:
//! a table that still does not fit is wider.

use crate::terminal::Terminal;
use comfy_table::presets::NOTHING;
use comfy_table::{Cell, CellAlignment, ContentArrangement, Row, Table};

/// Spaces around a cell.
const PADDING: usize = 2;

/// A table without lines; numbers stand right.
pub(super) fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_style(NOTHING)
        .set_content_arrangement(ContentArrangement::Disabled);
    table.set_header(header);
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

pub(super) fn print_table(table: &Table, terminal: &mut Terminal) {
    for line in lines(table, terminal.width()) {
        terminal.say(&line);
    }
}

fn lines(all: &Table, room: usize) -> Vec<String> {
    let cells = |row: &Row| -> Vec<String> {
        let text = |cell: &Cell| cell.content().replace('\n', " ");
        row.cell_iter().map(text).collect()
    };
    let header = all.header().map(cells).unwrap_or_default();
    let body: Vec<Vec<String>> = all.row_iter().map(cells).collect();
    let widths = widths(&header, &body, room);
    let fit = |row: &[String]| -> Vec<String> {
        let each = row.iter().zip(&widths);
        each.map(|(text, limit)| broken(text, *limit)).collect()
    };
    let header = fit(&header);
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let mut fitted = table(&header);
    for row in &body {
        fitted.add_row(fit(row));
    }
    let line = |line: String| format!(" {}", line.trim_end());
    fitted.lines().map(line).collect()
}

/// Width of each column: headings give way first, then what is widest, none below its longest part.
fn widths(header: &[String], body: &[Vec<String>], room: usize) -> Vec<usize> {
    let part = |text: &String| parts(text).into_iter().map(width).max().unwrap_or(0);
    let whole = |text: &String| width(text);
    let cells = |column: usize| body.iter().filter_map(move |row| row.get(column));
    let names = |column: usize| cells(column).map(whole).max().unwrap_or(0);
    let parts_of_names = |column: usize| cells(column).map(part).max().unwrap_or(0);
    let columns = || header.iter().enumerate();
    let mut widths: Vec<usize> = columns()
        .map(|(column, head)| names(column).max(whole(head)))
        .collect();
    let names_whole: Vec<usize> = columns()
        .map(|(column, head)| names(column).max(part(head)))
        .collect();
    let least: Vec<usize> = columns()
        .map(|(column, head)| parts_of_names(column).max(part(head)))
        .collect();
    for bounds in [names_whole, least] {
        while widths.iter().map(|width| width + PADDING).sum::<usize>() > room {
            let wide = (0..widths.len()).filter(|&column| widths[column] > bounds[column]);
            // Of equally wide ones the last.
            let Some(widest) = wide.max_by_key(|&column| widths[column]) else {
                break;
            };
            widths[widest] -= 1;
        }
    }
    widths
}

/// The text in lines of at most `limit` columns, where its parts are no longer.
fn broken(text: &str, limit: usize) -> String {
    let mut lines = vec![String::new()];
    for part in parts(text) {
        match lines.last_mut() {
            Some(line) if line.is_empty() || width(&format!("{line}{part}")) <= limit => {
                line.push_str(part);
            }
            _ => lines.push(part.to_owned()),
        }
    }
    let lines: Vec<&str> = lines.iter().map(|line| line.trim_end()).collect();
    lines.join("\n")
}

/// What a text may be broken into: words, and parts of a name that end in `_` or in `.` before a letter.
fn parts(text: &str) -> Vec<&str> {
    let (mut parts, mut start) = (Vec::new(), 0);
    let mut letters = text.char_indices().peekable();
    while let Some((at, letter)) = letters.next() {
        let ends = match letter {
            ' ' | '_' => true,
            '.' => letters.peek().is_some_and(|(_, next)| next.is_alphabetic()),
            _ => false,
        };
        if ends {
            let end = at + letter.len_utf8();
            parts.push(&text[start..end]);
            start = end;
        }
    }
    if start < text.len() {
        parts.push(&text[start..]);
    }
    parts
}

/// Columns that a text takes at the end of a line; combining marks (the dot above q) take none.
fn width(text: &str) -> usize {
    let letters = text.trim_end().chars();
    letters
        .filter(|letter| !('\u{300}'..='\u{36f}').contains(letter))
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 80;

    fn fit(lines: &[String]) -> bool {
        lines.iter().all(|line| line.chars().count() <= WIDTH)
    }

    #[test]
    fn names_break_after_an_underscore_or_a_dot_and_nowhere_else() {
        let heads = ["joint", "position", "velocity", "acceleration", "torque"];
        let mut rows = table(&heads);
        for joint in ["shoulder_pan_joint", "elbow_joint"] {
            let column = |what: &str| format!("actual.{what}_of_{joint}");
            rows.add_row([
                joint.to_owned(),
                column("position"),
                column("velocity"),
                "–".to_owned(),
                column("current"),
            ]);
        }
        let lines = lines(&rows, WIDTH);
        assert!(fit(&lines), "{lines:#?}");
        for word in lines.iter().flat_map(|line| line.split_whitespace()) {
            let ends = word.ends_with(['_', '.']) || word.ends_with("joint");
            assert!(
                heads.contains(&word) || word == "–" || ends,
                "{word}: {lines:#?}"
            );
        }
    }

    #[test]
    fn headings_give_way_before_names() {
        let mut rows = table(&[
            "joint",
            "model and friction",
            "friction alone",
            "factor at the model",
            "read better as",
        ]);
        let name = "left_shoulder_pan_joint";
        rows.add_row([name, "100.0 %", "100.0 %", "0.967", ""]);
        let lines = lines(&rows, WIDTH);
        assert!(fit(&lines), "{lines:#?}");
        assert!(
            lines[lines.len() - 1].starts_with(&format!("  {name}")),
            "{lines:#?}"
        );
    }

    #[test]
    fn a_name_without_a_place_to_break_is_kept_whole() {
        let name = "x".repeat(100);
        let mut rows = table(&["joint", "rate"]);
        rows.add_row([name.as_str(), "0.5"]);
        assert!(lines(&rows, WIDTH)[1].contains(&name));
        assert_eq!(
            parts("q_1.viscous 0.25 Hz"),
            ["q_", "1.", "viscous ", "0.25 ", "Hz"]
        );
    }
}
