//! A table that ends within its last row: the recorder was killed, the disk was full, a copy broke off.

use super::lines::Line;
use twincal::{Code, Finding, Severity};

/// Rows before the last one that its last field is compared with.
const NEIGHBOURS: usize = 100;
/// Fewest rows that say how long a last field is.
const FEWEST: usize = 20;

/// Lengths of the last fields of the rows before.
pub(super) struct LastFields {
    delimiter: u8,
    lengths: [usize; NEIGHBOURS],
    seen: usize,
}

impl LastFields {
    pub(super) fn new(delimiter: u8) -> Self {
        Self {
            delimiter,
            lengths: [0; NEIGHBOURS],
            seen: 0,
        }
    }

    /// Takes a row, with its line end or without.
    #[inline]
    pub(super) fn see(&mut self, line: &[u8]) {
        self.lengths[self.seen % NEIGHBOURS] = self.last(line).len();
        self.seen += 1;
    }

    /// The last field of a line.
    fn last<'a>(&self, line: &'a [u8]) -> &'a [u8] {
        let is_end = |byte: &u8| matches!(byte, b'\r' | b'\n');
        let end = line
            .iter()
            .rposition(|byte| !is_end(byte))
            .map_or(0, |at| at + 1);
        let begins = line[..end].iter().rposition(|byte| *byte == self.delimiter);
        &line[begins.map_or(0, |at| at + 1)..end]
    }

    /// Whether the file's last line, which has no line feed, is cut: it is no row (`is_row`), or its last field is shorter than that of
    /// each of up to [`NEIGHBOURS`] rows before. A whole last row has the shortest field of so many by a chance of 1 in 101 at most
    /// (of [`FEWEST`], 1 in 21); it is lost then.
    pub(super) fn cut(&self, file: &str, line: &Line, is_row: bool) -> Option<Finding> {
        let number = line.number;
        let rows = self.seen.min(NEIGHBOURS);
        let last = self.last(&line.text);
        let shortest = self.lengths[..rows].iter().min().copied().unwrap_or(0);
        let message = if !is_row {
            format!(
                "the file ends within line {number}, without a line feed; that row was left out: copy the file again if the recording \
                 went on"
            )
        } else if rows >= FEWEST && last.len() < shortest {
            format!(
                "the file ends without a line feed, and the last field of line {number}, `{}`, is shorter than those of the {rows} rows \
                 before: it may be cut, and the row was left out; copy the file again, or end it with a line feed",
                String::from_utf8_lossy(last)
            )
        } else {
            return None;
        };
        Some(
            Finding::new(Severity::Warning, Code::CutRow, file, message, 1)
                .with([("line", number as f64)]),
        )
    }
}

#[cfg(test)]
mod tests {
    use crate::log::{LogOptions, read_csv};
    use std::fmt::Write as _;
    use twincal::Code;
    use twincal::robot::{Robot, RobotDescription};

    /// One joint, 200 rows of six decimals; the text up to each of its last bytes.
    #[test]
    fn a_row_that_is_cut_is_left_out_and_said() {
        let text = "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"><inertial><mass value=\"1\"/><inertia ixx=\"1\" \
                    iyy=\"1\" izz=\"1\"/></inertial></link><joint name=\"j\" type=\"continuous\"><parent link=\"a\"/><child \
                    link=\"b\"/></joint></robot>";
        let model = crate::model::parse_model("r.urdf", text.as_bytes(), &Default::default());
        let description: RobotDescription = model.unwrap().description;
        let robot = Robot::new(description, &Default::default()).unwrap().0;
        let mut table = String::from("t,q1,tau1\n");
        for row in 0..200 {
            let t = f64::from(row) / 100.0;
            let _ = writeln!(table, "{t:.2},{:.6},{:.6}", t.sin(), 100.0 + t.cos());
        }
        let last = table.trim_end().rfind('\n').unwrap() + 1;
        for end in last..=table.len() {
            let read = read_csv(
                &table.as_bytes()[..end],
                0,
                "run.csv",
                &robot,
                &LogOptions::default(),
            );
            let (recording, findings) = read.unwrap();
            let said = findings.iter().any(|finding| finding.code == Code::CutRow);
            // Nothing of the row is there, or all of it but perhaps the line feed.
            let is_whole = end + 1 >= table.len();
            assert_eq!(said, !is_whole && end > last, "{:?}", &table[last..end]);
            let rows = 199 + usize::from(is_whole);
            assert_eq!(recording.time.len(), rows, "{:?}", &table[last..end]);
        }
    }

    /// Numbers in their shortest form, as Python writes them, without a line feed at the end: 1000 whole tables, at most 1 in 101 of
    /// them loses its last row. Exceeding 25 has a probability below 1e-4 (Poisson, mean 9.9).
    #[test]
    fn whole_tables_without_a_line_feed_keep_their_last_row() {
        let mut state = 7_u64;
        let mut lost = 0;
        for _ in 0..1000 {
            let mut fields = super::LastFields::new(b',');
            let mut line = super::Line::default();
            for _ in 0..=super::NEIGHBOURS {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                let value = (state >> 11) as f64 / (1_u64 << 53) as f64;
                fields.see(&line.text);
                line.text = format!("1,{value}").into_bytes();
            }
            lost += usize::from(fields.cut("x", &line, true).is_some());
        }
        assert!(lost <= 25, "{lost}");
    }
}
