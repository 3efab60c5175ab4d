//! The numbers read off the runs of a sweep, drawn over the value that varies, with formulas to compare them with.

use perimelt_core::Formula;
use perimelt_plot::{Chart, Panel};

use super::SweepError;
use super::table::{SweepRow, SweepTable};
use crate::plot::charts;

/// A formula with which a number read off is compared, from `quantity=formula`.
#[derive(Clone, Debug)]
pub struct FormulaComparison {
    /// Part of the name of the number.
    quantity: String,
    /// Formula in `x`, the value that varies, in the SI unit of the number; other variables are zero.
    formula: Formula,
    /// The formula as given.
    text: String,
}

impl FormulaComparison {
    /// Reads `quantity=formula`.
    ///
    /// # Errors
    /// No `=`, or a mistake in the formula.
    pub fn new(given: &str) -> Result<FormulaComparison, SweepError> {
        let wrong = |message: String| SweepError::Compare {
            given: given.into(),
            message,
        };
        let parts = given.split_once('=');
        let (quantity, text) = parts.ok_or_else(|| wrong("there is no `=`".into()))?;
        let formula = Formula::new(text.trim()).map_err(|e| wrong(e.to_string()))?;
        Ok(FormulaComparison {
            quantity: quantity.trim().into(),
            formula,
            text: text.trim().into(),
        })
    }
}

/// What is drawn.
#[derive(Clone, Debug, Default)]
pub struct Choice {
    /// Formulas to compare numbers with; only these numbers are drawn then.
    pub compared: Vec<FormulaComparison>,
    /// Parts of the names of the numbers that are drawn; all that change without.
    pub only: Vec<String>,
}

/// Most panels of a picture without `--only`.
const MOST_PANELS: usize = 8;

/// Parts of the names of numbers that are drawn first where there are more than fit, in this order.
const FIRST: [&str; 9] = [
    "melt pool, steady part",
    "fusion zone",
    "melt pool",
    "cooling time",
    "hardness",
    "displacement",
    "stress",
    "shrinkage",
    "temperature",
];

/// A chart of the numbers over the values of the key that varies: those that are compared with a formula, those requested, or
/// those that change. Where several keys vary, the one with the most numbers is the horizontal axis, and each combination of the
/// others has a line. `None` where no key with numbers varies, or where there is nothing to draw.
///
/// # Errors
/// A requested comparison or number that no run has, or that does not vary.
pub fn chart(
    table: &SweepTable,
    title: &str,
    choice: &Choice,
) -> Result<Option<Chart>, SweepError> {
    let compared = &choice.compared[..];
    let missing = |c: &FormulaComparison, message: &str| SweepError::Compare {
        given: format!("{}={}", c.quantity, c.text),
        message: message.into(),
    };
    let Some(runs) = Runs::new(table) else {
        let first = compared.first();
        return first.map_or(Ok(None), |c| {
            Err(missing(c, "a key with numbers as values must vary"))
        });
    };
    let is_meant = |row: &SweepRow, c: &FormulaComparison| row.name.contains(&c.quantity);
    if let Some(c) = compared
        .iter()
        .find(|c| !table.numbers.iter().any(|row| is_meant(row, c)))
    {
        return Err(missing(c, "no number with this name was read off"));
    }
    let is_known = |only: &&String| table.numbers.iter().any(|row| row.name.contains(&**only));
    if let Some(only) = choice.only.iter().find(|only| !is_known(only)) {
        return Err(SweepError::Only(only.clone()));
    }
    let mut panels = Vec::new();
    for row in &table.numbers {
        let mut lines = runs.lines(row);
        let changes = {
            let values = || row.values.iter().flatten().filter(|v| v.is_finite());
            values().any(|v| Some(v) != values().next())
        };
        let formulas = compared.iter().filter(|c| is_meant(row, c));
        let measured = lines.len();
        lines.extend(formulas.map(|FormulaComparison { formula, text, .. }| {
            let at = runs
                .horizontal
                .iter()
                .map(|x| formula.at([*x, 0.0, 0.0], 0.0));
            (text.clone(), at.collect())
        }));
        let is_asked = choice.only.iter().any(|only| row.name.contains(only));
        let is_drawn = match (compared, &choice.only[..]) {
            ([], []) => changes && !row.name.starts_with("relative error"),
            ([], _) => is_asked,
            _ => lines.len() > measured || is_asked,
        };
        if is_drawn {
            panels.push(panel(row, lines));
        }
    }
    if compared.is_empty() && choice.only.is_empty() && panels.len() > MOST_PANELS {
        let rank = |panel: &Panel| {
            let first = FIRST.iter().position(|name| panel.title.contains(name));
            first.unwrap_or(FIRST.len())
        };
        panels.sort_by_key(rank);
        panels.truncate(MOST_PANELS);
    }
    let chart = Chart {
        title: title.into(),
        horizontal_label: runs.key,
        horizontal: runs.horizontal,
        panels,
    };
    Ok(Some(chart).filter(|chart| !chart.panels.is_empty()))
}

/// Lines in SI units, in the unit that suits their size.
fn panel(row: &SweepRow, lines: Vec<(String, Vec<f64>)>) -> Panel {
    Panel {
        title: row.name.clone(),
        has_dots: true,
        ..charts::panel(&row.unit, lines, false)
    }
}

/// The runs of a sweep by the values of their keys.
struct Runs {
    /// key of the horizontal axis
    key: String,
    /// values of this key, each once, in order
    horizontal: Vec<f64>,
    /// names of the lines: the values of the other keys that vary
    lines: Vec<String>,
    /// by run: line and place on the horizontal axis
    places: Vec<[usize; 2]>,
}

impl Runs {
    /// `None` where no key with numbers varies.
    fn new(table: &SweepTable) -> Option<Self> {
        let different = |values: &[String]| {
            let mut different: Vec<String> = values.to_vec();
            different.sort();
            different.dedup();
            different.len()
        };
        let numbers = |values: &[String]| -> Option<Vec<f64>> {
            values.iter().map(|v| v.parse().ok()).collect()
        };
        let varying: Vec<_> = table
            .keys
            .iter()
            .filter(|(_, v)| different(v) > 1)
            .collect();
        let (key, values) = varying
            .iter()
            .filter(|(_, values)| numbers(values).is_some())
            // the first of several with equally many values
            .rev()
            .max_by_key(|(_, values)| different(values))?;
        let of_runs = numbers(values)?;
        let mut horizontal = of_runs.clone();
        horizontal.sort_by(f64::total_cmp);
        horizontal.dedup();
        // keys that vary together with that of the axis do not distinguish lines
        let others = varying.iter().filter(|(other, _)| other != key);
        let is_independent = |(_, other): &&&(String, Vec<String>)| {
            (0..other.len())
                .any(|a| (0..other.len()).any(|b| of_runs[a] == of_runs[b] && other[a] != other[b]))
        };
        let others: Vec<_> = others.filter(is_independent).collect();
        let mut lines: Vec<String> = Vec::new();
        let places = of_runs.iter().enumerate().map(|(run, x)| {
            let names = others.iter().map(|(key, values)| {
                let short = key.rsplit('.').next().unwrap_or(key);
                format!("{short} = {}", values[run])
            });
            let name = names.collect::<Vec<_>>().join(", ");
            let line = lines.iter().position(|line| *line == name);
            let line = line.unwrap_or_else(|| {
                lines.push(name);
                lines.len() - 1
            });
            let place = horizontal.iter().position(|h| h == x).unwrap_or(0);
            [line, place]
        });
        let places = places.collect();
        Some(Runs {
            key: key.clone(),
            horizontal,
            lines,
            places,
        })
    }

    /// The values of a number by line; NaN where a run has none.
    fn lines(&self, row: &SweepRow) -> Vec<(String, Vec<f64>)> {
        let name = |line: &String| match line.as_str() {
            "" => "runs".to_string(),
            line => line.to_string(),
        };
        let empty = || vec![f64::NAN; self.horizontal.len()];
        let mut lines: Vec<_> = self
            .lines
            .iter()
            .map(|line| (name(line), empty()))
            .collect();
        for ([line, place], value) in self.places.iter().zip(&row.values) {
            lines[*line].1[*place] = value.unwrap_or(f64::NAN);
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(keys: &[(&str, &[&str])], numbers: &[(&str, &[f64])]) -> SweepTable {
        let keys = keys.iter().map(|(key, values)| {
            let values = values.iter().map(|v| v.to_string()).collect();
            (key.to_string(), values)
        });
        let numbers = numbers.iter().map(|(name, values)| SweepRow {
            name: name.to_string(),
            unit: "m".into(),
            values: values.iter().map(|v| Some(*v)).collect(),
        });
        SweepTable::of(keys.collect(), numbers.collect())
    }

    fn drawn(table: &SweepTable, choice: &Choice) -> Chart {
        let chart = chart(table, "sweep", choice).expect("valid");
        chart.expect("something to draw")
    }

    #[test]
    fn two_keys_have_a_line_for_each_value_of_the_second() {
        let table = table(
            &[
                ("a.power", &["200", "200", "100", "100", "300", "300"]),
                ("a.speed", &["1e-3", "2e-3", "1e-3", "2e-3", "1e-3", "2e-3"]),
            ],
            &[
                ("plate: width", &[2e-3, 1e-3, 1e-3, 0.5e-3, 3e-3, 1.5e-3]),
                ("plate: constant", &[1.0; 6]),
            ],
        );
        let chart = drawn(&table, &Choice::default());
        assert_eq!(
            (&*chart.horizontal_label, &chart.horizontal[..]),
            ("a.power", &[100.0, 200.0, 300.0][..])
        );
        assert_eq!(chart.panels.len(), 1);
        let lines = &chart.panels[0].lines;
        assert_eq!(lines[0], ("speed = 1e-3".into(), vec![1.0, 2.0, 3.0]));
        assert_eq!(lines[1], ("speed = 2e-3".into(), vec![0.5, 1.0, 1.5]));
    }

    #[test]
    fn keys_that_vary_together_have_one_line() {
        let table = table(
            &[("power", &["1", "2"]), ("voltage", &["10", "20"])],
            &[("width", &[1e-3, 2e-3])],
        );
        let chart = drawn(&table, &Choice::default());
        assert_eq!(
            chart.panels[0].lines,
            [("runs".to_string(), vec![1.0, 2.0])]
        );
    }

    #[test]
    fn a_picture_has_the_numbers_asked_for_or_the_most_important_ones() {
        let names: Vec<String> = (0..20).map(|i| format!("energy {i}")).collect();
        let mut numbers: Vec<(&str, &[f64])> =
            names.iter().map(|n| (&**n, &[1.0, 2.0][..])).collect();
        numbers.push(("plate: width of the fusion zone", &[1.0, 3.0]));
        let table = table(&[("power", &["1", "2"])], &numbers);
        let chart = drawn(&table, &Choice::default());
        assert_eq!(chart.panels.len(), MOST_PANELS);
        assert_eq!(chart.panels[0].title, "plate: width of the fusion zone");
        let only = |names: &[&str]| Choice {
            only: names.iter().map(|n| n.to_string()).collect(),
            ..Choice::default()
        };
        assert_eq!(drawn(&table, &only(&["energy 7"])).panels.len(), 1);
        let unknown = super::chart(&table, "sweep", &only(&["depth"])).expect_err("unknown");
        assert!(unknown.to_string().contains("`--only depth`"), "{unknown}");
    }
}
