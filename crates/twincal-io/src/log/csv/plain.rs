//! Rows of plain numbers, the most of every log: cut and read in one pass.

use super::dialect::Dialect;
use super::number;

/// Reads the wanted fields of the line that `text` begins with, which has `fields` of them. Bytes of the line with its end, where
/// `text` may hold more lines; `None` where anything but plain numbers stands in its way (a quotation mark, blanks around a
/// field, too many fields) or its end does not: then the line has to be looked at field by field. Where `whole`, `text` is one
/// line without its end.
///
/// `order` holds, in file order, the field and the place in `row` of every wanted column.
pub(super) fn read(
    text: &[u8],
    whole: bool,
    dialect: Dialect,
    fields: usize,
    order: &[(usize, usize)],
    row: &mut [f64],
) -> Option<usize> {
    let Dialect {
        delimiter,
        decimal_comma,
    } = dialect;
    let point = if decimal_comma { b',' } else { b'.' };
    let mut wanted = order.iter().peekable();
    let mut at = 0;
    for field in 0..fields {
        if field > 0 {
            if text.get(at) != Some(&delimiter) {
                return None;
            }
            at += 1;
        }
        let rest = &text[at..];
        if wanted.peek().is_none_or(|(from, _)| *from != field) {
            at += length(rest, delimiter)?;
            continue;
        }
        let value = match number::leading(rest, point) {
            Some((value, length)) => {
                at += length;
                value
            }
            // No value, or a number of another form.
            None => {
                let length = length(rest, delimiter)?;
                at += length;
                number::parse(&rest[..length], decimal_comma)?
            }
        };
        while let Some((_, to)) = wanted.next_if(|(from, _)| *from == field) {
            row[*to] = value;
        }
    }
    // A delimiter at the end is no field.
    if delimiter != b' ' && text.get(at) == Some(&delimiter) {
        at += 1;
    }
    match &text[at..] {
        [] if whole => Some(at),
        [b'\n', ..] if !whole => Some(at + 1),
        [b'\r', b'\n', ..] if !whole => Some(at + 2),
        _ => None,
    }
}

/// Bytes up to the next delimiter or the end; none if a quotation mark, a blank or the end of a line comes before. Between spaces
/// there are no empty fields.
fn length(rest: &[u8], delimiter: u8) -> Option<usize> {
    let stops =
        |byte: &u8| *byte == delimiter || matches!(byte, b'"' | b' ' | b'\t' | b'\r' | b'\n');
    let at = rest.iter().position(stops).unwrap_or(rest.len());
    let is_whole =
        (rest.get(at)).is_none_or(|byte| *byte == delimiter || matches!(byte, b'\r' | b'\n'));
    (is_whole && (at > 0 || delimiter != b' ')).then_some(at)
}
