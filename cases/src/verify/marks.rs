//! Figures in the text of a document that are results of checks.
//!
//! ```text
//! The drag is <!-- measured: turek-hron-cfd1; mean drag; digits 4 -->13.88<!-- end --> N.
//! ```
//!
//! A mark names what is shown, the case, the quantity or a beginning that no other quantity of the case has, and
//! options, separated by `;`:
//!
//! | mark | shows |
//! |---|---|
//! | `measured` | the measured value, with several values the one with the largest error |
//! | `error` | the error as the limit defines it |
//!
//! | option | |
//! |---|---|
//! | `digits 4` | significant digits, 3 when left out |
//! | `times 1e3` | factor: 1e3 shows metres as millimetres |
//! | `value 2` | the second of several measured values, or its difference from the reference |
//! | `percent` | 100 times the value, with "%" |

use super::results::Results;
use super::table::Outcome;

/// Text behind a figure.
const END: &str = "<!-- end -->";

/// A mark that cannot be filled, with its line in the document.
#[derive(Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {what}")]
pub struct MarkError {
    /// Number of the line.
    pub line: usize,
    /// The mistake.
    pub what: String,
}

/// Part of an outcome that a mark shows.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shown {
    Measured,
    Error,
}

impl Shown {
    /// Marks and what they show.
    const ALL: [(&str, Shown); 2] = [
        ("<!-- measured:", Shown::Measured),
        ("<!-- error:", Shown::Error),
    ];
}

/// The text with the figures of all marks renewed, and the number of marks.
///
/// # Errors
/// A mark that names no result or has an unknown option, or one without end.
pub fn renew(text: &str, results: &Results) -> Result<(String, usize), MarkError> {
    let (mut renewed, mut count) = (String::new(), 0);
    let mut rest = text;
    while let Some(Mark {
        start,
        opening,
        shown,
    }) = next(rest)
    {
        let line = text[..text.len() - rest.len() + start]
            .matches('\n')
            .count()
            + 1;
        let failed = |what: String| MarkError { line, what };
        let inside = start + opening.len();
        let (content, behind) = rest[inside..]
            .split_once("-->")
            .ok_or_else(|| failed("the mark has no `-->`".into()))?;
        let (old, after) = behind
            .split_once(END)
            .filter(|(old, _)| !old.contains("<!--"))
            .ok_or_else(|| failed(format!("the mark has no `{END}` behind its figure")))?;
        let figure = figure(shown, content, results).map_err(failed)?;
        let before = rest.len() - old.len() - END.len() - after.len();
        renewed += &rest[..before];
        renewed += &figure;
        renewed += END;
        rest = after;
        count += 1;
    }
    Ok((renewed + rest, count))
}

/// A mark in a text.
struct Mark {
    /// Its position.
    start: usize,
    /// The text with which it opens.
    opening: &'static str,
    shown: Shown,
}

/// The first mark.
fn next(text: &str) -> Option<Mark> {
    let marks = Shown::ALL.iter().filter_map(|&(opening, shown)| {
        let start = text.find(opening)?;
        Some(Mark {
            start,
            opening,
            shown,
        })
    });
    marks.min_by_key(|mark| mark.start)
}

/// The figure of a mark with this content.
fn figure(shown: Shown, content: &str, results: &Results) -> Result<String, String> {
    // a mark may be broken like any text
    let words: Vec<String> = content
        .split(';')
        .map(|part| part.split_whitespace().collect::<Vec<_>>().join(" "))
        .collect();
    let [case, quantity, options @ ..] = words.as_slice() else {
        return Err("a mark has a case and a quantity, separated by `;`".into());
    };
    let outcome = find(case, quantity, results)?;
    let format = Format::read(options)?;
    let value = match (format.value, shown) {
        (None, Shown::Measured) => Some(outcome.measured),
        (None, Shown::Error) => Some(outcome.error),
        (Some(number), _) => {
            let pair = number.checked_sub(1).and_then(|n| outcome.compared.get(n));
            let &[measured, reference] = pair.ok_or_else(|| {
                let count = outcome.compared.len();
                format!("`value {number}`: `{quantity}` of `{case}` has {count} values")
            })?;
            match shown {
                Shown::Measured => measured,
                Shown::Error => measured.zip(reference).map(|(m, r)| m - r),
            }
        }
    };
    let value = value.filter(|v| v.is_finite());
    let value = value.ok_or_else(|| format!("`{quantity}` of `{case}` has no value"))?;
    let (factor, unit) = if format.percent {
        (100.0, " %")
    } else {
        (1.0, "")
    };
    let number = perimelt_core::text::number(value * factor * format.factor, format.digits);
    Ok(number + unit)
}

fn find<'r>(case: &str, quantity: &str, results: &'r Results) -> Result<&'r Outcome, String> {
    let outcomes = results.checks.iter().map(|check| &check.outcome);
    let of_case: Vec<&Outcome> = outcomes.filter(|outcome| outcome.case == case).collect();
    if of_case.is_empty() {
        return Err(format!("no result is of a case `{case}`"));
    }
    let named = |is_named: &dyn Fn(&str) -> bool| -> Vec<&'r Outcome> {
        let named = of_case.iter().filter(|outcome| is_named(&outcome.quantity));
        named.copied().collect()
    };
    let exactly = named(&|name| name == quantity);
    if let [outcome, ..] = exactly[..] {
        return Ok(outcome);
    }
    if let [outcome] = named(&|name| name.starts_with(quantity))[..] {
        return Ok(outcome);
    }
    let known: Vec<&str> = of_case.iter().map(|o| o.quantity.as_str()).collect();
    Err(format!(
        "`{quantity}` names no result of case `{case}`, or several; it has\n  {}",
        known.join("\n  ")
    ))
}

/// Format of a figure.
struct Format {
    digits: usize,
    factor: f64,
    /// number of one of several values, from 1
    value: Option<usize>,
    percent: bool,
}

impl Format {
    fn read(options: &[String]) -> Result<Format, String> {
        let mut format = Format {
            digits: 3,
            factor: 1.0,
            value: None,
            percent: false,
        };
        for option in options {
            let (name, number) = option.split_once(' ').unwrap_or((option, ""));
            let is_read = match name {
                "digits" => read_into(number, &mut format.digits) && format.digits > 0,
                "times" => read_into(number, &mut format.factor),
                "value" => read_into(number, format.value.insert(0)),
                "percent" => {
                    format.percent = true;
                    number.is_empty()
                }
                _ => false,
            };
            if !is_read {
                return Err(format!(
                    "unknown option `{option}`; write `digits 4`, `times 1e3`, `value 2` or `percent`"
                ));
            }
        }
        Ok(format)
    }
}

/// Whether a text is a number, which replaces `number`.
fn read_into<T: std::str::FromStr>(text: &str, number: &mut T) -> bool {
    text.parse().map(|read| *number = read).is_ok()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn results() -> Results {
        let checks = [
            r#""case":"a","quantity":"width, m","measured":0.0081284,"reference":0.008116,"error":1.24e-5,"limit":{"absolute":1e-4},"values":1"#,
            r#""case":"a","quantity":"drag, N","measured":13.877,"reference":14.29,"error":0.0289,"limit":{"relative":0.05},"values":1"#,
            r#""case":"b","quantity":"tip, m","measured":0.0602,"reference":0.061,"error":8e-4,"limit":{"absolute":5e-3},"values":2,"compared":[[0.0602,0.061],[null,0.047]]"#,
        ];
        let rest = r#""session":0,"passed":true,"source":"","level":"everyday","seconds":1"#;
        let checks = checks.map(|check| format!("{{{check},{rest}}}")).join(",");
        let text = format!("{{\"sessions\":[],\"checks\":[{checks}]}}");
        serde_json::from_str(&text).expect("results")
    }

    #[test]
    fn figures_are_those_of_the_results() {
        for (mark, figure) in [
            ("measured: a; drag, N", "13.9"),
            ("measured: a; drag, N; digits 4", "13.88"),
            ("measured: a;\nwidth,\n m; times 1e3; digits 2", "8.1"),
            ("measured: a; drag", "13.9"),
            ("error: a; drag, N", "0.0289"),
            ("error: a; drag, N; percent; digits 2", "2.9 %"),
            ("error: a; width, m", "1.24e-5"),
            ("error: a; width, m; times 1e6", "12.4"),
            ("measured: a; drag, N; percent; digits 5", "1387.7 %"),
            ("measured: b; tip, m; value 1; times 1e3; digits 2", "60"),
            ("error: b; tip, m; value 1; times 1e3; digits 1", "-0.8"),
        ] {
            let document = |figure: &str| format!("1\n<!-- {mark} -->{figure}<!-- end -->.\n");
            let renewed = renew(&document("old"), &results());
            assert_eq!(renewed, Ok((document(figure), 1)), "{mark}");
        }
        let two = "<!-- error: a; drag, N; percent -->x<!-- end -->, <!-- measured: a; drag, N -->y<!-- end -->";
        let (renewed, count) = renew(two, &results()).expect("two marks");
        assert_eq!((renewed.matches("2.89 %").count(), count), (1, 2));
        assert!(renewed.ends_with("-->13.9<!-- end -->"), "{renewed}");
        let none = "text <!-- a comment --> text";
        assert_eq!(renew(none, &results()), Ok((none.into(), 0)));
    }

    #[test]
    fn a_mark_that_names_no_result_is_refused_with_its_line() {
        for (mark, what) in [
            (
                "measured: c; drag, N -->1<!-- end -->",
                "no result is of a case `c`",
            ),
            (
                "measured: a; lift, N -->1<!-- end -->",
                "`lift, N` names no result of case `a`, or several; it has\n  width, m\n  drag, N",
            ),
            ("measured: a;  -->1<!-- end -->", "or several"),
            ("measured: a -->1<!-- end -->", "a case and a quantity"),
            (
                "error: a; drag, N; digit 3 -->1<!-- end -->",
                "unknown option `digit 3`",
            ),
            (
                "error: a; drag, N; digits 0 -->1<!-- end -->",
                "unknown option `digits 0`",
            ),
            (
                "error: a; drag, N; times x -->1<!-- end -->",
                "unknown option `times x`",
            ),
            (
                "error: a; drag, N; value 1 -->1<!-- end -->",
                "has 0 values",
            ),
            (
                "measured: b; tip, m; value 0 -->1<!-- end -->",
                "has 2 values",
            ),
            (
                "measured: b; tip, m; value 2 -->1<!-- end -->",
                "has no value",
            ),
            ("measured: a; drag, N", "no `-->`"),
            ("measured: a; drag, N -->1", "no `<!-- end -->`"),
            (
                "measured: a; drag, N -->1 <!-- b --> <!-- end -->",
                "no `<!-- end -->`",
            ),
        ] {
            let refused = renew(&format!("1\n2\n<!-- {mark}\n"), &results());
            let error = refused.expect_err(mark);
            assert!(
                error.line == 3 && error.what.contains(what),
                "{mark}: {error}"
            );
        }
    }

    /// `perimelt verify --report docs/benchmarks.json --into <document>` renews them; those of a page with results of its own
    /// are made from them.
    #[test]
    fn figures_of_the_documents_are_those_of_the_results() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let docs = root.join("docs");
        let of_cases = Results::read(&docs.join("benchmarks.json")).expect("results");
        let mut documents = vec![root.join("README.md")];
        let mut folders = vec![root.join("docs")];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(&folder).expect("a folder") {
                let path = entry.expect("an entry").path();
                match path.extension() {
                    _ if path.is_dir() => folders.push(path),
                    Some(extension) if extension == "md" => documents.push(path),
                    _ => {}
                }
            }
        }
        let mut count = 0;
        for path in documents {
            let name = path.display();
            let text = std::fs::read_to_string(&path).expect("a document");
            let stem = path.file_stem().expect("a name");
            let own = Results::read(&docs.join(stem).with_extension("json")).ok();
            let renewed = renew(&text, own.as_ref().unwrap_or(&of_cases))
                .unwrap_or_else(|e| panic!("{name}: {e}"));
            count += renewed.1;
            let differs = text.lines().zip(renewed.0.lines()).find(|(a, b)| a != b);
            assert_eq!(differs, None, "{name} has an old figure");
        }
        assert!(count > 100, "{count} marks");
    }
}
