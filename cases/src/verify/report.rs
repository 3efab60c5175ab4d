//! The overview of `docs/benchmarks.md` and the pages of `docs/benchmarks/`, from a file of results.

use std::collections::BTreeMap;
use std::fmt::{self, Write};
use std::path::Path;

use super::check::{Check, Level};
use super::results::{Recorded, Results, Session, file_error};
use super::table::{HEADINGS, Outcome, number};
use super::topic::Topic;
use super::{VerifyError, marks};
use crate::case::Case;

/// Line of a document above its tables.
pub const BEGIN: &str = "<!-- tables of `perimelt verify --report`; do not edit -->";

/// Line of a document below its tables.
pub const END: &str = "<!-- end of the tables -->";

/// Contents of a report: an overview for a document, and a page of each topic.
#[derive(Debug)]
pub struct Report {
    /// Sessions, numbers of checks by topic, and the checks that failed, in Markdown.
    pub overview: String,
    /// Topics and the pages with all their checks.
    pub pages: Vec<(Topic, String)>,
}

impl Report {
    /// Makes the report of the results. Checks of `cases` without a result are listed as not run. `folder` is the
    /// folder of the pages as seen from the overview.
    ///
    /// # Errors
    /// A mistake in a check of a case.
    pub fn new(
        results: &Results,
        cases: &[(String, Case)],
        folder: &str,
    ) -> Result<Report, VerifyError> {
        let mut by_case: BTreeMap<&str, Vec<&Recorded>> = BTreeMap::new();
        for check in &results.checks {
            by_case.entry(&check.outcome.case).or_default().push(check);
        }
        let mut by_topic: BTreeMap<Topic, Vec<CaseResults<'_>>> = BTreeMap::new();
        for (name, case) in cases {
            let recorded = by_case.remove(name.as_str()).unwrap_or_default();
            let entry = CaseResults::new(name, case, recorded)?;
            by_topic.entry(Topic::of(case)).or_default().push(entry);
        }
        let mut overview = String::new();
        sessions(&mut overview, results);
        topics(&mut overview, &by_topic, folder);
        failures(&mut overview, results);
        let pages = by_topic.iter().map(|(&topic, cases)| {
            let mut text = format!("# Benchmarks: {}\n\n{BEGIN}\n\n", topic.title());
            heading(&mut text);
            cases.iter().for_each(|case| case.write(&mut text));
            (topic, text + "\n" + END + "\n")
        });
        let pages = pages.collect();
        Ok(Report { overview, pages })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.overview)?;
        self.pages
            .iter()
            .try_for_each(|(_, page)| write!(f, "\n{page}"))
    }
}

/// Results of a case, and the checks that were not run.
struct CaseResults<'a> {
    name: &'a str,
    recorded: Vec<&'a Recorded>,
    missing: Vec<Check>,
}

impl<'a> CaseResults<'a> {
    fn new(
        name: &'a str,
        case: &Case,
        recorded: Vec<&'a Recorded>,
    ) -> Result<CaseResults<'a>, VerifyError> {
        let mut missing: Vec<Check> = case.verify_entries()?;
        missing.retain(|c| !recorded.iter().any(|r| r.outcome.quantity == c.quantity));
        Ok(CaseResults {
            name,
            recorded,
            missing,
        })
    }

    /// Rows of the case in the table of its topic.
    fn write(&self, text: &mut String) {
        rows(text, self.name, &self.recorded);
        if self.missing.is_empty() {
            return;
        }
        let nightly = self.missing.iter().filter(|c| c.level == Level::Nightly);
        let (count, nightly) = (self.missing.len(), nightly.count());
        let name = if self.recorded.is_empty() {
            format!("`{}`", self.name)
        } else {
            String::new()
        };
        let _ = writeln!(
            text,
            "| {name} | {count} checks, {nightly} nightly | not run | | | | | |"
        );
    }
}

/// A row for each topic: numbers of cases and checks, and the largest ratio of an error to its limit among the checks
/// that passed.
fn topics(text: &mut String, by_topic: &BTreeMap<Topic, Vec<CaseResults<'_>>>, folder: &str) {
    let headings =
        "| topic | cases | checks | failed | not run | largest error / limit | of the check |";
    let _ = writeln!(text, "\n{headings}\n|{}", "---|".repeat(7));
    for (topic, cases) in by_topic {
        let checks: Vec<&Outcome> = cases
            .iter()
            .flat_map(|case| case.recorded.iter().map(|c| &c.outcome))
            .collect();
        let failed = checks.iter().filter(|o| !o.passed).count();
        let missing: usize = cases.iter().map(|case| case.missing.len()).sum();
        let ratios = checks.iter().filter(|o| o.passed);
        let ratios = ratios.filter_map(|o| Some((o.ratio_to_limit()?, *o)));
        let worst = ratios.max_by(|(a, _), (b, _)| a.total_cmp(b));
        let (ratio, check) = worst.map_or_else(Default::default, |(ratio, o)| {
            let ratio = perimelt_core::text::number(ratio, 3);
            (ratio, format!("`{}`: {}", o.case, o.quantity))
        });
        let (title, file) = (topic.title(), topic.file());
        let _ = writeln!(
            text,
            "| [{title}]({folder}/{file}) | {} | {} | {failed} | {missing} | {ratio} | {check} |",
            cases.len(),
            checks.len(),
        );
    }
}

/// The checks that failed.
fn failures(text: &mut String, results: &Results) {
    let failed: Vec<&Recorded> = results
        .checks
        .iter()
        .filter(|c| !c.outcome.passed)
        .collect();
    let all = results.checks.len();
    let _ = writeln!(text, "\n{} of {all} checks failed.", failed.len());
    if failed.is_empty() {
        return;
    }
    text.push('\n');
    heading(text);
    for check in failed {
        rows(text, &check.outcome.case, &[check]);
    }
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

/// Renews the figures of a document that are results. A document with marks of tables gets the overview between them, and
/// the pages of the topics in the folder of its name.
///
/// # Errors
/// A mistake in a check of a case. A file cannot be read or written. The document has neither marks of tables nor figures,
/// or a figure has no result.
pub fn renew(
    document: &Path,
    results: &Results,
    cases: &[(String, Case)],
) -> Result<(), VerifyError> {
    let path = || document.into();
    let unwritable =
        |path: &Path, e: std::io::Error| file_error(path, "cannot be written", e.into());
    let mut text = std::fs::read_to_string(document)
        .map_err(|e| file_error(document, "cannot be read", e.into()))?;
    let folder = document.with_extension("");
    let report = Report::new(results, cases, &name(&folder))?;
    let renewed = with_tables(&text, &report.overview);
    let has_tables = renewed.is_some();
    if let Some(renewed) = renewed {
        text = renewed;
        std::fs::create_dir_all(&folder).map_err(|e| unwritable(&folder, e))?;
        for (topic, page) in &report.pages {
            let path = folder.join(topic.file());
            std::fs::write(&path, page).map_err(|e| unwritable(&path, e))?;
        }
    }
    let (text, figures) =
        marks::renew(&text, results).map_err(|mark| VerifyError::Mark { path: path(), mark })?;
    if !has_tables && figures == 0 {
        return Err(VerifyError::NoMarks { path: path() });
    }
    std::fs::write(document, text).map_err(|e| unwritable(document, e))
}

/// Name of a folder.
fn name(folder: &Path) -> String {
    let name = folder.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
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

    /// `perimelt verify --report docs/benchmarks.json --into docs/benchmarks.md` writes them.
    #[test]
    fn pages_of_the_documents_are_made_from_the_results() {
        let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
        let results = Results::read(&docs.join("benchmarks.json")).expect("results");
        let benchmarks = super::super::benchmarks::load(None).expect("valid cases");
        let report = Report::new(&results, &benchmarks.cases, "benchmarks").expect("a report");
        let read = |path: &str| std::fs::read_to_string(docs.join(path)).expect("a page");
        assert!(
            read("benchmarks.md").contains(&report.overview),
            "the overview of docs/benchmarks.md is old"
        );
        let mut all = String::new();
        for (topic, page) in &report.pages {
            let path = format!("benchmarks/{}", topic.file());
            assert!(read(&path) == *page, "docs/{path} is old");
            all += page;
        }
        for Recorded { outcome, .. } in &results.checks {
            assert!(
                all.contains(&format!("| `{}` |", outcome.case)),
                "no page has the results of `{}`",
                outcome.case
            );
        }
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
