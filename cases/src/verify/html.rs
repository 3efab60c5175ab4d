//! Results of `perimelt verify` as a page: tables, descriptions of the cases, and plots of measured values against the
//! reference.

use std::fmt::Write;
use std::path::Path;

use perimelt_plot::{Chart, Panel};

use super::VerifyError;
use super::check::{Check, Measure};
use super::results::{Recorded, Results, Session, file_error};
use super::table::{HEADINGS, Outcome};
use crate::case::Case;
use crate::file_names::file_name;
use crate::plot::{PictureFormat, write_picture};
use crate::unit;

const STYLE: &str = include_str!("html.css");
/// Folder of the plots, beside the page.
const PLOTS: &str = "plots";
/// Width of a plot, pixels.
const WIDTH: u32 = 760;

/// Creates the folder of a page and that of its plots.
///
/// # Errors
/// A folder that cannot be created.
pub(super) fn create(folder: &Path) -> Result<(), VerifyError> {
    let plots = folder.join(PLOTS);
    std::fs::create_dir_all(&plots).map_err(|e| file_error(&plots, "cannot be created", e.into()))
}

/// Writes `index.html` and its plots into a folder, which is created.
///
/// # Errors
/// A mistake in a check of a case, or a file that cannot be written.
pub fn write(
    folder: &Path,
    results: &Results,
    cases: &[(String, Case)],
) -> Result<(), VerifyError> {
    create(folder)?;
    let (mut contents, mut sections) = (String::new(), String::new());
    for (name, case) in cases {
        let checks = results.checks.iter().filter(|c| c.outcome.case == *name);
        let checks: Vec<&Recorded> = checks.collect();
        if checks.is_empty() {
            continue;
        }
        let failed = checks.iter().filter(|c| !c.outcome.passed).count();
        let verdict = match failed {
            0 => "<td class=pass>pass".to_owned(),
            _ => format!("<td class=fail>{failed} failed"),
        };
        let seconds = checks.iter().map(|c| c.outcome.seconds).fold(0.0, f64::max);
        let _ = writeln!(
            contents,
            "<tr><td><a href=\"#{name}\">{name}</a><td>{}<td>{}{verdict}<td>{} s",
            escape(&case.case.title),
            checks.len(),
            unit::number(seconds, 2),
        );
        section(&mut sections, folder, name, case, &checks)?;
    }
    let failed = results.checks.iter().filter(|c| !c.outcome.passed).count();
    let page = format!(
        "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content=\"width=device-width\">\n\
         <title>Perimelt: verification</title><style>{STYLE}</style>\n\
         <h1>Verification of Perimelt</h1>\n<p>{} checks, {failed} failed.\n{}\
         <h2>Cases</h2><table><tr><th>case<th>title<th>checks<th><th>run\n{contents}</table>\n{sections}</html>\n",
        results.checks.len(),
        sessions(results),
    );
    let path = folder.join("index.html");
    std::fs::write(&path, page).map_err(|e| file_error(&path, "cannot be written", e.into()))
}

/// Versions, machines and dates.
fn sessions(results: &Results) -> String {
    let mut text = format!(
        "<table><tr><th>session<th>{}\n",
        Session::HEADINGS.join("<th>")
    );
    for (number, session) in results.sessions.iter().enumerate() {
        let cells = session.cells().map(|cell| escape(&cell)).join("<td>");
        let _ = writeln!(text, "<tr><td>{}<td>{cells}", number + 1);
    }
    text + "</table>\n"
}

/// The checks of a case, and a plot of each that compares several values.
fn section(
    text: &mut String,
    folder: &Path,
    name: &str,
    case: &Case,
    recorded: &[&Recorded],
) -> Result<(), VerifyError> {
    let _ = writeln!(
        text,
        "<h2 id=\"{name}\">{name}</h2>\n<p><b>{}</b><p>{}\n<table><tr>",
        escape(&case.case.title),
        escape(&case.case.description)
    );
    for heading in &HEADINGS[1..] {
        let _ = write!(text, "<th>{heading}");
    }
    let _ = writeln!(text, "<th>source<th>session");
    for check in recorded {
        let outcome = &check.outcome;
        let [_, cells @ .., verdict] = outcome.cells();
        let class = if outcome.passed { "pass" } else { "fail" };
        let _ = writeln!(
            text,
            "<tr><td>{}<td class={class}>{verdict}<td>{}<td>{}",
            cells.map(|cell| escape(&cell)).join("<td>"),
            escape(&outcome.source),
            check.session + 1
        );
        if let Some(reason) = &outcome.failure {
            let _ = writeln!(text, "<tr><td colspan=8 class=fail>{}", escape(reason));
        }
    }
    text.push_str("</table>\n");
    let declared: Vec<Check> = case.verify_entries()?;
    for (number, check) in recorded.iter().enumerate() {
        let outcome = &check.outcome;
        let declared = declared.iter().find(|c| c.quantity == outcome.quantity);
        let Some(picture) = chart(outcome, declared).draw(&case.case.title, WIDTH) else {
            continue;
        };
        let file = format!("{PLOTS}/{}-{}.svg", file_name(name), number + 1);
        let path = folder.join(&file);
        write_picture(&picture, &path, PictureFormat::Svg)
            .map_err(|e| file_error(&path, "cannot be written", e.into()))?;
        let _ = writeln!(
            text,
            "<img src=\"{file}\" alt=\"{}\" loading=lazy>",
            escape(&outcome.quantity)
        );
    }
    Ok(())
}

/// Measured values and reference along the line of the positions, or by number.
fn chart(outcome: &Outcome, check: Option<&Check>) -> Chart {
    let part = |part: usize| -> Vec<f64> {
        let values = outcome.compared.iter();
        values.map(|pair| pair[part].unwrap_or(f64::NAN)).collect()
    };
    let count = outcome.compared.len();
    let (horizontal_label, horizontal) = check
        .and_then(|check| distances(&check.measure, count))
        .unwrap_or_else(|| {
            (
                "number of the value".into(),
                (1..=count).map(|n| n as f64).collect(),
            )
        });
    Chart {
        title: outcome.quantity.clone(),
        horizontal_label,
        horizontal,
        panels: vec![Panel {
            lines: vec![("measured".into(), part(0)), ("reference".into(), part(1))],
            ..Panel::default()
        }],
    }
}

/// Distances of the positions of a measurement from the first, where they lie on a line in this order.
fn distances(measure: &Measure, count: usize) -> Option<(String, Vec<f64>)> {
    let at = match measure {
        Measure::Field(field) => &field.at,
        Measure::Passing(passing) => &passing.at,
        _ => return None,
    };
    let first = at.first().filter(|_| at.len() == count)?;
    let apart = |x: &[f64; 3]| {
        (0..3)
            .map(|a| (x[a] - first[a]).powi(2))
            .sum::<f64>()
            .sqrt()
    };
    let distances: Vec<f64> = at.iter().map(apart).collect();
    let last = *distances.last()?;
    let is_straight = |(x, d): (&[f64; 3], &f64)| {
        let end = at[count - 1];
        (0..3).all(|a| {
            ((x[a] - first[a]) * last - (end[a] - first[a]) * d).abs() <= 1e-9 * last * last
        })
    };
    let in_order = distances.windows(2).all(|d| d[0] < d[1]);
    if !(in_order && at.iter().zip(&distances).all(is_straight)) {
        return None;
    }
    let length = unit::length(last);
    let label = unit::label("distance from the first position", length.unit);
    Some((label, distances.iter().map(|d| d * length.factor).collect()))
}

/// Text in HTML.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for sign in text.chars() {
        match sign {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            other => escaped.push(other),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::check::Level;

    const CASE: &str = r#"
        case.title = "A bar & its ends"
        [bodies.bar]
        shape.box = { min = [0, 0, 0], max = [1, 0, 0] }
        dimension = 1
        spacing = 0.1
        material = "steel"
        [[physics]]
        type = "thermal"
        [time]
        end = 1
        [log]
        interval = 1
        [[verify]]
        quantity = "T < 400"
        measure.field = { field = "temperature", at = [[0.1, 0, 0], [0.2, 0, 0], [0.4, 0, 0]] }
        reference = [1, 2, 4]
        limit.absolute = 0.1
        source = "none"
    "#;

    #[test]
    fn a_page_has_tables_and_plots_of_what_was_compared() {
        let case = Case::parse("bar.toml", CASE.to_owned(), Path::new("")).expect("a valid case");
        let check: Check = case.verify_entries().expect("valid").remove(0);
        let (label, distances) = distances(&check.measure, 3).expect("on a line");
        assert_eq!(label, "distance from the first position (mm)");
        assert!(
            distances
                .iter()
                .zip([0.0, 100.0, 300.0])
                .all(|(d, e)| (d - e).abs() < 1e-9)
        );

        let mut results = Results::default();
        let outcome = Outcome::new("bar", &check, &[1.0, 2.0, 4.5]);
        results.add(Session::now(Level::Everyday), &[outcome]);
        let folder = tempfile::tempdir().expect("a folder");
        write(folder.path(), &results, &[("bar".into(), case)]).expect("written");
        let page = std::fs::read_to_string(folder.path().join("index.html")).expect("a page");
        assert!(page.contains("1 checks, 1 failed"), "{page}");
        assert!(
            page.contains("A bar &amp; its ends") && page.contains("T &lt; 400"),
            "{page}"
        );
        let plot = folder.path().join("plots/bar-1.svg");
        let plot = std::fs::read_to_string(plot).expect("a plot");
        assert!(
            plot.contains("measured") && plot.contains("reference"),
            "{plot}"
        );
    }

    #[test]
    fn positions_off_a_line_are_numbered() {
        let at = |at: [[f64; 3]; 3]| {
            let text = format!("field = {{ field = \"temperature\", at = {at:?} }}");
            toml::from_str::<Measure>(&text).expect("a measure")
        };
        let bent = at([[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]);
        let back = at([[0.0; 3], [2.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
        assert!(distances(&bent, 3).is_none() && distances(&back, 3).is_none());
    }
}
