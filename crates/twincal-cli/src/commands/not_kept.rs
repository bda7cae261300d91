//! What was weighed and not kept, and what could not be weighed.

use super::summary::{ENDS, has_ends, paragraph, tells_ends};
use super::table::{print_table, table};
use crate::terminal::{Terminal, clean};
use twincal::calibrate::{Calibration, ComponentSummary, TermSummary};
use twincal::term::Status;
use twincal_io::report::MENTIONED;
use twincal_io::result_json::status_word;
use twincal_io::words::probability;

/// What the table of components that were not kept holds.
const VALUE: &str = "value: median, given that it is in; ±: half of the central 68 % interval";

/// What was weighed and not kept, as far as it is worth mentioning; one of several columns has its numbers in the report and in
/// result.json.
pub(super) fn others(calibration: &Calibration, terminal: &mut Terminal) {
    let mut table = table(&["component", "PIP", "value", "±", "unit"]);
    let (mut rare, mut lopsided) = (0, false);
    for component in calibration
        .components
        .iter()
        .filter(|c| !c.is_in() && calibration.sees(c))
        .filter(|c| c.status != twincal::calibrate::Status::Equivalent)
    {
        match component.pip {
            Some(p) if p >= MENTIONED => {
                table.add_row(row(component, &calibration.terms));
                lopsided |= terms_of(component, &calibration.terms).count() == 1
                    && component.parameters.first().is_some_and(has_ends);
            }
            Some(_) => rare += 1,
            // It stands among what was left out.
            None => {}
        }
    }
    let dropped: Vec<&TermSummary> = (calibration.terms.iter())
        .filter(|term| term.term.status != Status::Candidate)
        .collect();
    if table.is_empty() && rare == 0 && dropped.is_empty() {
        return;
    }
    terminal.heading("Not selected");
    print_table(&table, terminal);
    if !table.is_empty() {
        paragraph(VALUE, terminal);
    }
    if lopsided && !tells_ends(calibration) {
        paragraph(ENDS, terminal);
    }
    if rare > 0 {
        let more = if table.is_empty() { "" } else { "more " };
        terminal.say(&format!("  {rare} {more}below PIP {MENTIONED}"));
    }
    if !dropped.is_empty() {
        paragraph(&format!("left out: {}", left_out(&dropped)), terminal);
    }
    terminal.say("");
}

/// Columns that say nothing of their own, by reason: "a, b (no torque in any motion); c (torque of d)".
fn left_out(dropped: &[&TermSummary]) -> String {
    let mut by_reason: Vec<(String, Vec<&str>)> = Vec::new();
    for term in dropped {
        let reason = match &term.term.status {
            Status::AliasOf(other) => format!("torque of {other}"),
            Status::NullLagrangian => "no torque in any motion".into(),
            status => status_word(status).replace('_', " "),
        };
        match by_reason.iter_mut().find(|(own, _)| *own == reason) {
            Some((_, names)) => names.push(&term.term.name),
            None => by_reason.push((reason, vec![&term.term.name])),
        }
    }
    let told = by_reason
        .iter()
        .map(|(reason, names)| format!("{} ({reason})", names.join(", ")));
    told.collect::<Vec<_>>().join("; ")
}

/// A component's terms.
fn terms_of<'a>(
    component: &'a ComponentSummary,
    terms: &'a [TermSummary],
) -> impl Iterator<Item = &'a TermSummary> {
    let own = |term: &&TermSummary| component.columns.contains(&term.term.name);
    terms.iter().filter(own)
}

fn row(component: &ComponentSummary, terms: &[TermSummary]) -> [String; 5] {
    let name = clean(&component.name);
    let p = probability(component.pip.unwrap_or(f64::NAN));
    let own: Vec<&TermSummary> = terms_of(component, terms).collect();
    match own[..] {
        [term] => {
            let (value, spread) = match component.parameters.first() {
                Some(parameter) if parameter.seen => match (parameter.told(), parameter.ends()) {
                    ((value, _), _) if !value.is_finite() => ("–".into(), String::new()),
                    ((value, _), Some(ends)) => (with_ends(value, ends), String::new()),
                    ((value, spread), None) => with_sd(value, spread),
                },
                _ => ("not seen".into(), String::new()),
            };
            [name, p, value, spread, clean(&term.term.unit)]
        }
        _ => {
            let size = match component.parameters.iter().filter(|p| p.seen).count() {
                0 => "not seen".into(),
                1 => "1 number".into(),
                seen => format!("{seen} numbers"),
            };
            [name, p, size, String::new(), String::new()]
        }
    }
}

/// A value and what stands behind ±, which gives two digits.
pub(super) fn with_sd(mean: f64, sd: f64) -> (String, String) {
    let size = sd.abs().max(mean.abs());
    if !(sd > 0.0 && (1e-4..1e6).contains(&size)) {
        return (format!("{mean:+.3e}"), format!("{sd:.1e}"));
    }
    let places = (1 - sd.log10().floor() as i32).clamp(0, 9) as usize;
    (format!("{mean:+.places$}"), format!("{sd:.places$}"))
}

/// A value and both ends of its interval, which give two digits.
pub(super) fn with_ends(value: f64, [low, high]: [f64; 2]) -> String {
    let size = value.abs().max(high - low);
    if !(1e-4..1e6).contains(&size) {
        return format!("{value:+.3e} ({low:.1e} … {high:.1e})");
    }
    let places = (1 - (0.5 * (high - low)).log10().floor() as i32).clamp(0, 9) as usize;
    format!("{value:+.places$} ({low:.places$} … {high:.places$})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_as_people_write_them() {
        assert_eq!(with_sd(0.123456, 0.0123), ("+0.123".into(), "0.012".into()));
        assert_eq!(with_sd(-12.3456, 3.1), ("-12.3".into(), "3.1".into()));
        assert_eq!(with_sd(0.0, 0.0), ("+0.000e0".into(), "0.0e0".into()));
        assert_eq!(with_sd(1e-7, 2e-8), ("+1.000e-7".into(), "2.0e-8".into()));
        assert_eq!(
            [
                with_ends(263.4, [-40.2, 5000.0]),
                with_ends(0.0321, [0.02, 0.09])
            ],
            ["+263 (-40 … 5000)", "+0.032 (0.020 … 0.090)"]
        );
    }
}
