//! The numbers read off the runs of a sweep, drawn over the value that varies, with formulas to compare them with.

use perimelt_core::Formula;

use super::SweepError;
use super::table::{Row, Table};
use crate::plot::curves::{Chart, Panel};
use crate::plot::unit::{self, Shown};

/// A formula with which a number read off is compared, from `quantity=formula`.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Part of the name of the number.
    quantity: String,
    /// Formula in `x`, the value that varies, in the SI unit of the number; other variables are zero.
    formula: Formula,
    /// The formula as given.
    text: String,
}

impl Comparison {
    /// Reads `quantity=formula`.
    ///
    /// # Errors
    /// No `=`, or a mistake in the formula.
    pub fn new(given: &str) -> Result<Comparison, SweepError> {
        let wrong = |message: String| SweepError::Compare {
            given: given.into(),
            message,
        };
        let parts = given.split_once('=');
        let (quantity, text) = parts.ok_or_else(|| wrong("there is no `=`".into()))?;
        let formula = Formula::new(text.trim()).map_err(|e| wrong(e.to_string()))?;
        Ok(Comparison {
            quantity: quantity.trim().into(),
            formula,
            text: text.trim().into(),
        })
    }
}

/// A chart of the numbers over the value of the only key that varies: those that are compared with a formula, or
/// without comparisons all that change. `None` where several keys vary, where the values are no numbers, or where there
/// is nothing to draw.
///
/// # Errors
/// A comparison with a number that no run has, or where no single number varies.
pub fn chart(
    table: &Table,
    title: &str,
    compared: &[Comparison],
) -> Result<Option<Chart>, SweepError> {
    let missing = |c: &Comparison, message: &str| SweepError::Compare {
        given: format!("{}={}", c.quantity, c.text),
        message: message.into(),
    };
    let Some((key, values)) = varying(table) else {
        let first = compared.first();
        return first.map_or(Ok(None), |c| {
            Err(missing(
                c,
                "one key must vary, and its values must be numbers",
            ))
        });
    };
    let is_meant = |row: &Row, c: &Comparison| row.name.contains(&c.quantity);
    if let Some(c) = compared
        .iter()
        .find(|c| !table.numbers.iter().any(|row| is_meant(row, c)))
    {
        return Err(missing(c, "no number with this name was read off"));
    }
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let horizontal: Vec<f64> = order.iter().map(|run| values[*run]).collect();

    let mut panels = Vec::new();
    for row in &table.numbers {
        let measured = order.iter().map(|run| row.values[*run].unwrap_or(f64::NAN));
        let mut lines: Vec<(String, Vec<f64>)> = vec![("runs".into(), measured.collect())];
        let formulas = compared.iter().filter(|c| is_meant(row, c));
        lines.extend(formulas.map(|Comparison { formula, text, .. }| {
            let at = horizontal.iter().map(|x| formula.at([*x, 0.0, 0.0], 0.0));
            (text.clone(), at.collect())
        }));
        let is_drawn = match compared {
            [] => lines[0].1.windows(2).any(|pair| pair[0] != pair[1]),
            _ => lines.len() > 1,
        };
        if is_drawn {
            panels.push(panel(row, lines));
        }
    }
    let chart = Chart {
        title: title.into(),
        horizontal_label: key.into(),
        horizontal,
        panels,
    };
    Ok(Some(chart).filter(|chart| !chart.panels.is_empty()))
}

/// Lines in SI units, in the unit that suits their size.
fn panel(row: &Row, mut lines: Vec<(String, Vec<f64>)>) -> Panel {
    let finite = lines.iter().flat_map(|(_, values)| values);
    let largest = finite
        .filter(|v| v.is_finite())
        .fold(0.0, |largest: f64, v| largest.max(v.abs()));
    let shown = Shown::new(&row.unit, largest, false);
    for value in lines.iter_mut().flat_map(|(_, values)| values) {
        *value = shown.of(*value);
    }
    Panel {
        label: unit::label(&row.name, &shown.unit),
        lines,
        ..Panel::default()
    }
}

/// The only key with different values, where these are numbers.
fn varying(table: &Table) -> Option<(&str, Vec<f64>)> {
    let mut keys = table.keys.iter().filter(|(_, values)| {
        let first = values.first();
        values.iter().any(|value| Some(value) != first)
    });
    let (Some((key, values)), None) = (keys.next(), keys.next()) else {
        return None;
    };
    let numbers: Result<Vec<f64>, _> = values.iter().map(|v| v.parse()).collect();
    Some((key, numbers.ok()?))
}
