//! The tables of `docs/benchmarks.md`, from a file of results.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use super::check::{Check, Level};
use super::results::{Recorded, Results, Session, file_error};
use super::table::{HEADINGS, number};
use super::{VerifyError, marks};
use crate::case::Case;

/// Line of a document above its tables.
pub const BEGIN: &str = "<!-- tables of `perimelt verify --report`; do not edit -->";

/// Line of a document below its tables.
pub const END: &str = "<!-- end of the tables -->";

/// Sessions, checks that failed, and one table of all checks in Markdown. Checks of `cases` without a result are
/// listed as not run.
///
/// # Errors
/// A mistake in a check of a case.
pub fn tables(results: &Results, cases: &[(String, Case)]) -> Result<String, VerifyError> {
    let mut text = String::new();
    let mut by_case: BTreeMap<&str, Vec<&Recorded>> = BTreeMap::new();
    for check in &results.checks {
        by_case.entry(&check.outcome.case).or_default().push(check);
    }
    sessions(&mut text, results);
    let failed: Vec<&Recorded> = results
        .checks
        .iter()
        .filter(|c| !c.outcome.passed)
        .collect();
    let _ = writeln!(
        text,
        "\n{} of {} checks failed.\n",
        failed.len(),
        results.checks.len()
    );
    heading(&mut text);
    for (name, case) in cases {
        let recorded = by_case.get(name.as_str()).map_or(&[][..], |c| c);
        rows(&mut text, name, recorded);
        let checks: Vec<Check> = case.verify_entries()?;
        let is_recorded = |c: &Check| recorded.iter().any(|r| r.outcome.quantity == c.quantity);
        let missing: Vec<&Check> = checks.iter().filter(|c| !is_recorded(c)).collect();
        if !missing.is_empty() {
            let nightly = missing.iter().filter(|c| c.level == Level::Nightly).count();
            let name = if recorded.is_empty() {
                format!("`{name}`")
            } else {
                String::new()
            };
            let count = missing.len();
            let _ = writeln!(
                text,
                "| {name} | {count} checks, {nightly} nightly | not run | | | | | |"
            );
        }
    }
    Ok(text)
}

fn sessions(text: &mut String, results: &Results) {
    let headings = Session::HEADINGS.join(" | ");
    let _ = writeln!(text, "| session | {headings} | checks |");
    let _ = writeln!(text, "|{}", "---|".repeat(Session::HEADINGS.len() + 2));
    for (number, session) in results.sessions.iter().enumerate() {
        let checks = results
            .checks
            .iter()
            .filter(|c| c.session == number)
            .count();
        let cells = session.cells().join(" | ");
        let _ = writeln!(text, "| {} | {cells} | {checks} |", number + 1);
    }
}

fn heading(text: &mut String) {
    let _ = writeln!(text, "| {} | time | session |", HEADINGS.join(" | "));
    let _ = writeln!(text, "|{}", "---|".repeat(HEADINGS.len() + 2));
}

/// Rows of the checks of a case, and one row of all its audits that passed, with the worst error.
fn rows(text: &mut String, name: &str, recorded: &[&Recorded]) {
    let is_summed = |c: &&&Recorded| c.outcome.passed && c.outcome.quantity.starts_with("audit");
    let (audits, checks): (Vec<&Recorded>, Vec<&Recorded>) =
        recorded.iter().partition(|c| is_summed(c));
    let mut first = format!("`{name}`");
    let mut row = |cells: [String; 6], c: &Recorded| {
        let seconds = match first.is_empty() {
            true => String::new(),
            false => format!("{} s", number(rounded(c.outcome.seconds))),
        };
        let cells = cells.join(" | ");
        let _ = writeln!(
            text,
            "| {first} | {cells} | {seconds} | {} |",
            c.session + 1
        );
        first.clear();
    };
    for check in checks {
        let [_, cells @ ..] = check.outcome.cells();
        row(cells, check);
    }
    let worst = audits
        .iter()
        .max_by(|a, b| a.outcome.error.total_cmp(&b.outcome.error));
    if let Some(worst) = worst {
        let [_, _, cells @ ..] = worst.outcome.cells();
        let [measured, reference, error, limit, verdict] = cells;
        let names = audits.len();
        let quantity = match names {
            1 => worst.outcome.quantity.clone(),
            _ => format!("{} (worst of {names} audits)", worst.outcome.quantity),
        };
        row(
            [quantity, measured, reference, error, limit, verdict],
            worst,
        );
    }
}

/// Two significant digits.
fn rounded(seconds: f64) -> f64 {
    let unit = 10f64.powi(seconds.max(1e-3).log10().floor() as i32 - 1);
    (seconds / unit).round() * unit
}

/// Replaces the tables of a document and the figures of its text that are results.
///
/// # Errors
/// It cannot be read or written, has neither, or a figure has no result.
pub fn renew(document: &Path, tables: &str, results: &Results) -> Result<(), VerifyError> {
    let path = || document.into();
    let text = std::fs::read_to_string(document)
        .map_err(|e| file_error(document, "cannot be read", e.into()))?;
    let renewed = with_tables(&text, tables);
    let has_tables = renewed.is_some();
    let (text, figures) = marks::renew(renewed.as_ref().unwrap_or(&text), results)
        .map_err(|mark| VerifyError::Mark { path: path(), mark })?;
    if !has_tables && figures == 0 {
        return Err(VerifyError::NoMarks { path: path() });
    }
    std::fs::write(document, text).map_err(|e| file_error(document, "cannot be written", e.into()))
}

fn with_tables(text: &str, tables: &str) -> Option<String> {
    let (before, rest) = text.split_once(BEGIN)?;
    let (_, after) = rest.split_once(END)?;
    Some(format!("{before}{BEGIN}\n\n{tables}\n{END}{after}"))
}

#[cfg(test)]
mod tests {
    use super::super::table::Outcome;
    use super::*;

    #[test]
    fn tables_replace_what_stands_between_the_marks() {
        let document = format!("before\n{BEGIN}\nold\n{END}\nafter");
        let renewed = with_tables(&document, "new").expect("marks");
        assert_eq!(renewed, format!("before\n{BEGIN}\n\nnew\n{END}\nafter"));
        assert_eq!(with_tables(&renewed, "new"), Some(renewed.clone()));
        assert_eq!(with_tables("no marks", "new"), None);
    }

    #[test]
    fn audits_that_passed_share_a_row() {
        let audit = |name: &str, error| Recorded {
            session: 0,
            outcome: Outcome::audit("case", format!("audit of {name}"), error, 1e-10),
        };
        let all = [
            audit("heat", 2e-13),
            audit("mass", 5e-13),
            audit("momentum.x", 1.0),
        ];
        let mut text = String::new();
        rows(&mut text, "case", &all.iter().collect::<Vec<_>>());
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 2, "{text}");
        assert!(
            lines[0].starts_with("| `case` | audit of momentum.x | 1 |"),
            "{text}"
        );
        assert!(
            lines[1].starts_with("|  | audit of mass (worst of 2 audits) | 5e-13 |"),
            "{text}"
        );
    }
}
