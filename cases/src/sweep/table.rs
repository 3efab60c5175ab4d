//! The numbers read off the runs of a sweep, side by side.

use std::fmt;
use std::io::{self, Write};
use std::path::Path;

use super::variants::Variant;
use crate::output::write_whole;
use crate::summary::ReadOff;
use crate::unit;

/// Most runs whose numbers are printed side by side.
const MOST_COLUMNS: usize = 8;

/// Result of a run.
#[derive(Clone, Debug)]
pub struct VariantResult {
    /// Read off the log; `None` without a log.
    pub numbers: Option<Vec<ReadOff>>,
    /// Whether it reached the end of its case.
    pub is_at_end: bool,
}

/// A row for each key that varies and for each number read off, a column for each run.
#[derive(Clone, Debug)]
pub struct SweepTable {
    runs: usize,
    /// Keys with their values as TOML.
    pub(super) keys: Vec<(String, Vec<String>)>,
    pub(super) numbers: Vec<SweepRow>,
    /// Whether each run reached the end of its case.
    is_at_end: Vec<bool>,
}

/// Name of the row and column of the runs that reached the end of their cases.
const AT_END: &str = "reached its end";

fn yes_or_no(yes: bool) -> &'static str {
    if yes { "yes" } else { "no" }
}

/// A number read off the runs.
#[derive(Clone, Debug)]
pub(super) struct SweepRow {
    pub(super) name: String,
    /// SI unit.
    pub(super) unit: String,
    /// Value in each run.
    pub(super) values: Vec<Option<f64>>,
}

impl SweepTable {
    /// The table of runs that have all reached their ends.
    #[cfg(test)]
    pub(super) fn of(keys: Vec<(String, Vec<String>)>, numbers: Vec<SweepRow>) -> Self {
        let runs = keys.first().map_or(0, |(_, values)| values.len());
        SweepTable {
            runs,
            keys,
            numbers,
            is_at_end: vec![true; runs],
        }
    }

    /// The values of the variants, and the results of their runs.
    pub fn new(variants: &[Variant], results: &[VariantResult]) -> Self {
        let first = variants.first().map_or(&[][..], |v| &v.changes);
        let values = |index: usize| {
            let values = variants.iter().map(|v| v.changes[index].value.clone());
            values.collect()
        };
        let keys = first.iter().enumerate();
        let keys = keys.map(|(i, change)| (change.key.clone(), values(i)));
        let mut numbers: Vec<SweepRow> = Vec::new();
        for (run, found) in results.iter().enumerate() {
            let all = found.numbers.iter().flatten();
            for ReadOff {
                of,
                quantity,
                value,
                unit,
                ..
            } in all.filter(|number| number.left_out.is_none())
            {
                let name = match of.as_str() {
                    "" => quantity.clone(),
                    of => format!("{of}: {quantity}"),
                };
                let at = match numbers.iter().position(|row| row.name == name) {
                    Some(at) => at,
                    None => {
                        numbers.push(SweepRow {
                            name,
                            unit: unit.clone(),
                            values: vec![None; results.len()],
                        });
                        numbers.len() - 1
                    }
                };
                numbers[at].values[run] = Some(*value);
            }
        }
        SweepTable {
            runs: results.len(),
            keys: keys.collect(),
            numbers,
            is_at_end: results.iter().map(|r| r.is_at_end).collect(),
        }
    }

    /// Writes a line for each run, in SI units.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_csv(&self, path: &Path) -> io::Result<()> {
        write_whole(path, |file| self.write_lines(file))
    }

    fn write_lines(&self, file: &mut impl Write) -> io::Result<()> {
        let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
        let mut header = vec![quoted("run")];
        header.extend(self.keys.iter().map(|(key, _)| quoted(key)));
        header.push(quoted(AT_END));
        let numbers = self.numbers.iter();
        header.extend(numbers.map(|row| quoted(&format!("{} ({})", row.name, row.unit))));
        writeln!(file, "{}", header.join(","))?;
        for run in 0..self.runs {
            let mut line = vec![(run + 1).to_string()];
            line.extend(self.keys.iter().map(|(_, values)| {
                let value = values[run].as_str();
                match value.parse::<f64>() {
                    Ok(_) => value.to_string(),
                    Err(_) => quoted(value),
                }
            }));
            line.push(yes_or_no(self.is_at_end[run]).into());
            let numbers = self.numbers.iter().map(|row| row.values[run]);
            line.extend(numbers.map(|value| value.map_or_else(String::new, |v| v.to_string())));
            writeln!(file, "{}", line.join(","))?;
        }
        Ok(())
    }
}

impl fmt::Display for SweepTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut lines: Vec<(String, Vec<String>)> = self.keys.clone();
        if self.is_at_end.contains(&false) {
            let shown = self.is_at_end.iter().map(|yes| yes_or_no(*yes).into());
            lines.push((AT_END.into(), shown.collect()));
        }
        lines.push((String::new(), Vec::new()));
        for row in &self.numbers {
            let values = row.values.iter().flatten();
            let largest = values.fold(0.0, |largest: f64, v| largest.max(v.abs()));
            let (factor, unit) = unit::value(&row.unit, largest);
            let shown = row.values.iter().map(|value| match value {
                Some(value) => unit::number(value * factor, 4),
                None => "-".into(),
            });
            let name = match unit.as_str() {
                "" => row.name.clone(),
                unit => format!("{} ({unit})", row.name),
            };
            lines.push((name, shown.collect()));
        }
        let width = |text: &String| text.chars().count();
        let widest = lines.iter().map(|(name, _)| width(name)).max().unwrap_or(0);
        let values = lines.iter().flat_map(|(_, v)| v.iter().take(MOST_COLUMNS));
        let column = values.map(width).max().unwrap_or(0);
        for (name, values) in lines {
            let values = values.iter().take(MOST_COLUMNS);
            let values: String = values.map(|v| format!("  {v:>column$}")).collect();
            writeln!(f, "{}", format!("{name:<widest$}{values}").trim_end())?;
        }
        match self.runs.checked_sub(MOST_COLUMNS) {
            Some(more @ 1..) => writeln!(f, "and {more} more runs in the file:"),
            _ => Ok(()),
        }
    }
}
