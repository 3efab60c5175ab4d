//! Columns of a table: quantity and unit from its header, or from the documentation of its format.
//!
//! A header names a column by its quantity, in any order and case, with a unit in brackets: `X(mm)`, `power [W]`, `pmod`.
//! Lengths without a unit have the unit of the format. Unknown names and units are refused.

use std::path::Path;

use nalgebra::Vector3;

use crate::toolpath::no_power;
use perimelt_core::SetupError;

/// Quantity of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    /// s.
    Time,
    /// m.
    X,
    Y,
    Z,
    /// W.
    Power,
    /// Power as a factor of that of the source.
    Factor,
    /// 0: a move; 1: a rest.
    Mode,
    /// Speed of a move (m/s), duration of a rest (s).
    Parameter,
    /// Trigger of a camera; not used.
    Trigger,
    /// Whether the path waits.
    Wait,
}

use Quantity::{Factor, Mode, Parameter, Power, Time, Trigger, Wait, X, Y, Z};

impl Quantity {
    /// The quantity of a name in lower case; `with_modes`: the rows of the format have a mode, so that a time is a parameter.
    fn of(name: &str, with_modes: bool) -> Option<Quantity> {
        Some(match name {
            "time" | "t" if !with_modes => Time,
            "x" => X,
            "y" => Y,
            "z" => Z,
            "power" | "p" => Power,
            "pmod" | "power_modifier" | "modifier" | "factor" => Factor,
            "mode" if with_modes => Mode,
            "param" | "parameter" | "tparam" | "time" if with_modes => Parameter,
            "trigger" => Trigger,
            "wait" => Wait,
            _ => return None,
        })
    }

    /// SI value of a unit, in lower case.
    fn unit(self, unit: &str) -> Option<f64> {
        let units: &[(&str, f64)] = match self {
            Time => &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("µs", 1e-6)],
            X | Y | Z => &[
                ("m", 1.0),
                ("cm", 1e-2),
                ("mm", 1e-3),
                ("um", 1e-6),
                ("µm", 1e-6),
            ],
            Power => &[("w", 1.0), ("kw", 1e3)],
            Parameter => &[
                ("s", 1.0),
                ("m/s", 1.0),
                ("s or m/s", 1.0),
                ("m/s or s", 1.0),
            ],
            Factor | Trigger | Wait | Mode => &[("-", 1.0), ("1", 1.0)],
        };
        units
            .iter()
            .find(|(name, _)| *name == unit)
            .map(|(_, value)| *value)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Column {
    quantity: Quantity,
    /// SI value of its unit.
    unit: f64,
}

/// Layout of a format.
#[derive(Debug)]
pub(super) struct Layout {
    /// Columns of a file without a header, in the form of a header. Lengths without a unit have the unit of x.
    pub header: &'static str,
    /// Whether a file must have a header.
    pub needs_header: bool,
    /// Columns that must be there, besides one of a power where `needs_power` says so.
    pub needed: &'static [Quantity],
    /// Columns that may be there.
    pub optional: &'static [Quantity],
    /// Whether there must be a power or a factor.
    pub needs_power: bool,
}

/// The numbers of a file.
#[derive(Debug)]
pub(super) struct Numbers<'a> {
    path: &'a Path,
    columns: Vec<Column>,
    pub rows: Vec<TableRow>,
}

/// A row of numbers, in SI units; `None` for empty entries.
#[derive(Debug)]
pub(super) struct TableRow {
    /// Line in the file, counted from 1.
    pub line: u64,
    values: Vec<Option<f64>>,
}

/// Entries of a line: between commas, or between blanks where it has none.
fn entries(text: &str) -> Vec<&str> {
    match text.contains(',') {
        true => text.split(',').map(str::trim).collect(),
        false => text.split_whitespace().collect(),
    }
}

/// Names of a header; a unit may be separated from its name by a blank.
fn names(text: &str) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for entry in text.split(|c: char| c == ',' || c.is_whitespace()) {
        match names.last_mut() {
            Some(last) if entry.starts_with(['(', '[']) => last.push_str(entry),
            _ if entry.is_empty() => {}
            _ => names.push(entry.into()),
        }
    }
    names
}

impl Layout {
    fn with_modes(&self) -> bool {
        self.needed.contains(&Mode)
    }

    /// Columns of a header; an error says what is wrong with it.
    fn columns(&self, text: &str) -> Result<Vec<Column>, String> {
        let of_format = match text == self.header {
            true => 1.0,
            false => self
                .columns(self.header)?
                .iter()
                .find(|c| c.quantity == X)
                .map_or(1.0, |c| c.unit),
        };
        let mut columns: Vec<Column> = Vec::new();
        for name in names(text) {
            let (bare, unit) = match name.split_once(['(', '[']) {
                Some((bare, unit)) => (bare, Some(unit.trim_end_matches([')', ']']))),
                None => (name.as_str(), None),
            };
            let quantity = Quantity::of(&bare.to_lowercase(), self.with_modes());
            let known = quantity.filter(|q| {
                self.needed.contains(q) || self.optional.contains(q) || matches!(q, Power | Factor)
            });
            let quantity = known.ok_or_else(|| format!("column `{name}` is not known"))?;
            let unit = match unit {
                Some(unit) => quantity
                    .unit(&unit.to_lowercase())
                    .ok_or_else(|| format!("the unit of column `{name}` is not known"))?,
                None if matches!(quantity, X | Y | Z) => of_format,
                None => 1.0,
            };
            if columns.iter().any(|c| c.quantity == quantity) {
                return Err(format!("column `{name}` is there twice"));
            }
            columns.push(Column { quantity, unit });
        }
        let has = |quantity: &Quantity| columns.iter().any(|c| c.quantity == *quantity);
        if let Some(missing) = self.needed.iter().find(|q| !has(q)) {
            return Err(format!("the column of `{missing:?}` is missing").to_lowercase());
        }
        match [Power, Factor].iter().filter(|q| has(q)).count() {
            0 if self.needs_power => Err("the column of the power is missing".into()),
            2 => Err("both a power and a factor of the power are given".into()),
            _ => Ok(columns),
        }
    }

    /// Reads a file. `as_factor`: what a power is in a file without a header.
    pub fn read<'a>(
        &self,
        content: &str,
        path: &'a Path,
        as_factor: bool,
    ) -> Result<Numbers<'a>, SetupError> {
        let wrong = |line: u64, problem: String| {
            let line = in_file(line, path);
            let message = format!("{line} cannot be read: {problem}");
            let expected = format!("the columns `{}`", self.header);
            SetupError::value("file", message, expected)
        };
        let mut columns: Option<Vec<Column>> = None;
        let mut announced: Option<(usize, u64)> = None;
        let mut rows = Vec::new();
        let content = content.trim_start_matches('\u{feff}');
        let mut lines = (1..)
            .zip(content.lines().map(str::trim))
            .filter(|(_, text)| !text.is_empty());
        while let Some((line, text)) = lines.next() {
            if let Some(comment) = text.strip_prefix('#') {
                // a header may be a comment
                let header = self.columns(comment.trim()).ok();
                columns = columns.or(header.filter(|_| rows.is_empty()));
                continue;
            }
            if columns.is_none() && text.to_lowercase().starts_with("number of path segments") {
                let count = lines
                    .next()
                    .and_then(|(line, text)| Some((text.parse::<usize>().ok()?, line)));
                let missing = || wrong(line, "no number of segments follows".into());
                announced = Some(count.ok_or_else(missing)?);
                continue;
            }
            let entries = entries(text);
            let is_number = |entry: &&str| entry.is_empty() || entry.parse::<f64>().is_ok();
            let must_be_header = columns.is_none() && self.needs_header;
            if rows.is_empty() && (must_be_header || !entries.iter().all(is_number)) {
                columns = Some(self.columns(text).map_err(|problem| wrong(line, problem))?);
                continue;
            }
            if columns.is_none() {
                columns = Some(
                    self.documented(as_factor)
                        .map_err(|problem| wrong(line, problem))?,
                );
            }
            let columns = columns.as_deref().unwrap_or(&[]);
            rows.push(
                self.row(line, &entries, columns)
                    .map_err(|problem| wrong(line, problem))?,
            );
        }
        if let Some((count, line)) = announced.filter(|(count, _)| *count != rows.len()) {
            let problem = format!("{count} segments are announced, but {} follow", rows.len());
            return Err(wrong(line, problem));
        }
        Ok(Numbers {
            path,
            columns: columns.unwrap_or_default(),
            rows,
        })
    }

    /// The columns of a file without a header.
    fn documented(&self, as_factor: bool) -> Result<Vec<Column>, String> {
        let mut columns = self.columns(self.header)?;
        for column in columns
            .iter_mut()
            .filter(|c| as_factor && c.quantity == Power)
        {
            column.quantity = Factor;
        }
        Ok(columns)
    }

    fn row(&self, line: u64, entries: &[&str], columns: &[Column]) -> Result<TableRow, String> {
        let optional = columns
            .iter()
            .rev()
            .take_while(|c| self.optional.contains(&c.quantity));
        let needed = columns.len() - optional.count();
        if !(needed..=columns.len()).contains(&entries.len()) {
            return Err(format!("it has {} entries", entries.len()));
        }
        let number = |(entry, column): (&&str, &Column)| match (*entry, column.quantity) {
            ("", Power | Factor | Wait) => Ok(None),
            (entry, _) => match entry.parse::<f64>() {
                Ok(number) => Ok(Some(number * column.unit)),
                Err(_) => Err(format!("`{entry}` is not a number")),
            },
        };
        let values = entries
            .iter()
            .zip(columns)
            .map(number)
            .collect::<Result<_, _>>()?;
        Ok(TableRow { line, values })
    }
}

fn in_file(line: u64, path: &Path) -> String {
    format!("line {line} of the toolpath table {}", path.display())
}

impl Numbers<'_> {
    /// A row in messages.
    pub fn line(&self, row: &TableRow) -> String {
        in_file(row.line, self.path)
    }

    /// The value of a quantity in a row, SI units; `None` where the row has none.
    pub fn get(&self, row: &TableRow, quantity: Quantity) -> Result<Option<f64>, SetupError> {
        let at = self.columns.iter().position(|c| c.quantity == quantity);
        let value = at.and_then(|at| row.values.get(at).copied().flatten());
        match value {
            Some(value) if !value.is_finite() => {
                Err(self.wrong(row, quantity, value, "a finite number"))
            }
            value => Ok(value),
        }
    }

    /// The value of a quantity that every row has.
    pub fn need(&self, row: &TableRow, quantity: Quantity) -> Result<f64, SetupError> {
        Ok(self.get(row, quantity)?.unwrap_or(0.0))
    }

    /// Power in a row, W: as given, as a factor of that of the source (`usual`), or that of the source.
    pub fn power(&self, row: &TableRow, usual: Option<f64>) -> Result<f64, SetupError> {
        let no_power = || no_power("power");
        let given = self.get(row, Power)?;
        let factor = self.get(row, Factor)?;
        let positive = |quantity, value: f64| match value >= 0.0 {
            true => Ok(value),
            false => Err(self.wrong(row, quantity, value, "a finite number, zero or greater")),
        };
        match (given, factor) {
            (Some(power), _) => positive(Power, power),
            (None, Some(factor)) => Ok(positive(Factor, factor)? * usual.ok_or_else(no_power)?),
            (None, None) => usual.ok_or_else(no_power),
        }
    }

    /// The place in a row, m.
    pub fn place(&self, row: &TableRow) -> Result<Vector3<f64>, SetupError> {
        Ok([self.need(row, X)?, self.need(row, Y)?, self.need(row, Z)?].into())
    }

    /// Error of a value outside its range.
    pub fn wrong(
        &self,
        row: &TableRow,
        quantity: Quantity,
        value: f64,
        expected: &str,
    ) -> SetupError {
        let column = match quantity {
            Time => "time",
            X => "x",
            Y => "y",
            Z => "z",
            Power => "power",
            Factor => "factor",
            Mode => "mode",
            Parameter => "parameter",
            Trigger => "trigger",
            Wait => "wait",
        };
        let message = format!("{}: `{column}` is {value}", self.line(row));
        SetupError::value("file", message, expected)
    }

    /// A file with fewer rows than a path needs.
    pub fn too_short(&self) -> SetupError {
        let (path, rows) = (self.path.display(), self.rows.len());
        let message = format!("the toolpath table {path} has {rows} rows");
        SetupError::value("file", message, "two rows or more")
    }

    /// The file.
    pub fn path(&self) -> &Path {
        self.path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    static SEGMENTS: Layout = Layout {
        header: "Mode X(mm) Y(mm) Z(mm) Pmod Time(s)",
        needs_header: false,
        needed: &[Mode, X, Y, Z, Parameter],
        optional: &[],
        needs_power: true,
    };

    #[test]
    fn headers_name_quantities_and_units_in_any_order_and_case() {
        let values = |header: &str, row: &str| {
            let content = format!("{header}\n{row}\n");
            let numbers = SEGMENTS
                .read(&content, Path::new("p"), false)
                .expect(header);
            let row = &numbers.rows[0];
            let all = [Mode, X, Y, Z, Power, Factor, Parameter]
                .map(|q| numbers.get(row, q).expect("finite"));
            all.map(|v| v.map_or(f64::NAN, |v| (v * 1e9).round() / 1e9))
                .map(|v| v.to_string())
                .join(" ")
        };
        for (header, row, expected) in [
            (
                "Mode X(mm) Y(mm) Z(mm) Pmod Time(s)",
                "0 1 2 3 0.5 4",
                "0 0.001 0.002 0.003 NaN 0.5 4",
            ),
            ("", "0 1 2 3 0.5 4", "0 0.001 0.002 0.003 NaN 0.5 4"),
            (
                "# written by hand",
                "0 1 2 3 0.5 4",
                "0 0.001 0.002 0.003 NaN 0.5 4",
            ),
            (
                "# mode x(m) y(m) z(m) pmod param",
                "0 1 2 3 0.5 4",
                "0 1 2 3 NaN 0.5 4",
            ),
            (
                "MODE x y z PMOD tParam",
                "0 1 2 3 0.5 4",
                "0 0.001 0.002 0.003 NaN 0.5 4",
            ),
            (
                "param, Power(kW), z(um), Y[cm], X (m), mode",
                "4,5,3,2,1,0",
                "0 1 0.02 0.000003 5000 NaN 4",
            ),
            (
                "mode\tX(m)\tY(m)\tZ(m)\tPower (W)\tparameter(m/s)",
                "1\t1\t2\t3\t5\t4",
                "1 1 2 3 5 NaN 4",
            ),
        ] {
            assert_eq!(values(header, row), expected, "{header}");
        }
    }

    #[test]
    fn what_a_header_does_not_say_is_told() {
        for (header, message) in [
            ("mode x y z powr param", "column `powr` is not known"),
            (
                "mode x(inch) y z pmod param",
                "the unit of column `x(inch)` is not known",
            ),
            (
                "mode x y z power(hp) param",
                "the unit of column `power(hp)`",
            ),
            ("mode x x z power param", "column `x` is there twice"),
            ("mode x y pmod param", "the column of `z` is missing"),
            ("mode x y z param", "the column of the power is missing"),
            ("mode x y z power pmod param", "both a power and a factor"),
            ("mode x y z power param wait", "column `wait` is not known"),
            ("0 0 0 O 0 0", "column `0` is not known"),
            (
                "Number of path segments\nmany",
                "line 1 of the toolpath table p cannot be read: no number",
            ),
        ] {
            let content = format!("{header}\n0 0 0 0 0 0\n");
            let found = SEGMENTS
                .read(&content, Path::new("p"), false)
                .expect_err(header);
            assert!(found.to_string().contains(message), "{header}: {found}");
        }
    }
}
