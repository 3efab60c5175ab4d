//! A value by time: a number, a formula, or a table of numbers, in place or in a file.

use std::borrow::Cow;
use std::fmt;
use std::path::{Path, PathBuf};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::ser::{SerializeMap, Serializer};
use serde::{Deserialize, Serialize};

use crate::folder;
use crate::formula::Formula;
use crate::input;
use crate::material::Table;
use crate::samples::{FieldFile, NumberTable, SamplesError, SamplesFault, Wanted};
use crate::text::number;

/// A number that may change in time: a formula, or piecewise linear through the rows of a table, constant
/// before the first and after the last. A jump is two rows a moment apart.
///
/// ```toml
/// value = 300
/// value = { time = [0, 10], value = [300, 500] }   # s
/// value = "300 + 5 * t * exp(-2 * t)"              # t in s
/// value = { file = "thermocouple.csv" }            # columns `time` (s) and `value`, or one that `column` names
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum InTime {
    /// A constant.
    Constant(f64),
    /// Rows of time (s) and value.
    Table(Table),
    /// A formula in the time t (s).
    Formula(Formula),
    /// The rows of a file.
    File(FieldFile, Table),
}

impl InTime {
    /// Value at `time` (s).
    pub fn at(&self, time: f64) -> f64 {
        match self {
            InTime::Constant(value) => *value,
            InTime::Table(table) | InTime::File(_, table) => table.at(time),
            InTime::Formula(formula) => formula.at([0.0; 3], time),
        }
    }

    /// The value of the key of a plugin at a time (s).
    ///
    /// # Errors
    /// A formula without a finite value.
    pub fn value_at(&self, key: &'static str, time: f64) -> Result<f64, WrongValue> {
        let value = self.at(time);
        match value.is_finite() {
            true => Ok(value),
            false => Err(WrongValue {
                key,
                value,
                time,
                expected: "a finite number",
            }),
        }
    }

    /// The first row later than `after` (s): a kink, on which steps should land.
    pub fn next_event(&self, after: f64) -> Option<f64> {
        match self {
            InTime::Constant(_) | InTime::Formula(_) => None,
            InTime::Table(table) | InTime::File(_, table) => {
                table.abscissae().iter().copied().find(|t| *t > after)
            }
        }
    }

    /// The last time at which the value changes, s: the end of the last row but those that hold a value. `None` for a constant and
    /// for a formula, which has no end.
    pub fn last_change(&self) -> Option<f64> {
        let InTime::Table(table) = self else {
            return None;
        };
        let values = table.values();
        let last = (1..values.len())
            .rev()
            .find(|&row| values[row] != values[row - 1])?;
        table.abscissae().get(last).copied()
    }

    /// All numbers given: every value lies between the least and the largest of them. Empty for a formula.
    pub fn values(&self) -> &[f64] {
        match self {
            InTime::Constant(value) => std::slice::from_ref(value),
            InTime::Table(table) | InTime::File(_, table) => table.values(),
            InTime::Formula(_) => &[],
        }
    }

    /// The rows of a file.
    ///
    /// # Errors
    /// The file cannot be read, or its mistake.
    pub fn of_file(file: &FieldFile) -> Result<InTime, SamplesError> {
        let path = folder::path(&file.file);
        let rows = rows(&path, file.column.clone());
        let rows = rows.map_err(|fault| SamplesError { path, fault })?;
        Ok(InTime::File(file.clone(), rows))
    }
}

/// A value by time that makes no sense at a time of the run.
#[derive(Clone, Debug, thiserror::Error)]
#[error("`{key}` is {} at t = {} s, expected {expected}", number(*value, 6), number(*time, 6))]
pub struct WrongValue {
    /// The key of the plugin.
    pub key: &'static str,
    /// The value.
    pub value: f64,
    /// s.
    pub time: f64,
    /// What is expected.
    pub expected: &'static str,
}

fn rows(path: &Path, column: Option<String>) -> Result<Table, SamplesFault> {
    let text = input::read_text(path, input::LIMIT)?;
    let table = NumberTable::new(&text);
    let names = table.names();
    let time = table
        .find("time")
        .ok_or_else(|| SamplesFault::NoTime(names.to_vec()))?;
    let values: Vec<usize> = (0..names.len()).filter(|c| *c != time).collect();
    let wanted = Wanted {
        column,
        field: "value".into(),
    };
    let chosen = wanted.choose(values.iter().map(|c| names[*c].clone()).collect())?;
    Ok(Table::new(
        table.column(time)?,
        table.column(values[chosen])?,
    )?)
}

/// The earlier of two events.
pub fn earlier(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.into_iter().chain(b).min_by(f64::total_cmp)
}

const FORMS: &str = "a number, { time = [...], value = [...] } with times in seconds, { file = \"...\" }, or a formula in t (s)";

/// The keys of the tables of a value by time, in place and in a file, for values that have other forms besides.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rows {
    /// Times, s.
    pub time: Option<Vec<f64>>,
    /// Values at these times.
    pub value: Option<Vec<f64>>,
    /// File with the rows.
    pub file: Option<PathBuf>,
    /// Its column of the values.
    pub column: Option<String>,
}

impl Rows {
    /// The value by time that the keys give.
    ///
    /// # Errors
    /// Keys that are missing or do not go together, rows that are no table, a file that cannot be read.
    pub fn value<E: de::Error>(self) -> Result<InTime, E> {
        match (self.time, self.value, self.file) {
            (Some(time), Some(value), None) if self.column.is_none() => Table::new(time, value)
                .map(InTime::Table)
                .map_err(E::custom),
            (None, None, Some(file)) => {
                let column = self.column;
                InTime::of_file(&FieldFile { file, column }).map_err(E::custom)
            }
            (None, Some(_), None) => Err(E::missing_field("time")),
            (Some(_), None, None) => Err(E::missing_field("value")),
            _ => Err(E::custom(format_args!("expected {FORMS}"))),
        }
    }
}

impl<'de> Deserialize<'de> for InTime {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(InTimeVisitor)
    }
}

struct InTimeVisitor;

impl<'de> Visitor<'de> for InTimeVisitor {
    type Value = InTime;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(FORMS)
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<InTime, E> {
        if value.is_finite() {
            Ok(InTime::Constant(value))
        } else {
            Err(E::custom(format_args!("{value} is not a finite number")))
        }
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<InTime, E> {
        Ok(InTime::Constant(value as f64))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<InTime, E> {
        Ok(InTime::Constant(value as f64))
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<InTime, E> {
        let formula = Formula::new(text).map_err(E::custom)?;
        match formula.is_of_time() {
            true => Ok(InTime::Formula(formula)),
            false => Err(E::custom(format_args!(
                "the formula `{text}` depends on the position; expected {FORMS}"
            ))),
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<InTime, A::Error> {
        Rows::deserialize(MapAccessDeserializer::new(map))?.value()
    }
}

impl Serialize for InTime {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            InTime::Constant(value) => serializer.serialize_f64(*value),
            InTime::Formula(formula) => formula.serialize(serializer),
            InTime::Table(table) => {
                let mut map = serializer.serialize_map(Some(2))?;
                map.serialize_entry("time", table.abscissae())?;
                map.serialize_entry("value", table.values())?;
                map.end()
            }
            InTime::File(file, _) => file.serialize(serializer),
        }
    }
}

impl JsonSchema for InTime {
    fn schema_name() -> Cow<'static, str> {
        "InTime".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A value by time: a number, a formula, or a table of numbers, in place or in a file",
            "anyOf": [
                { "type": "number", "description": "The same at all times" },
                { "type": "string", "description": "Formula in the time t (s), such as \"300 + 5 * t * exp(-2 * t)\"" },
                {
                    "type": "object",
                    "description": "Piecewise linear in time, constant outside the rows",
                    "properties": {
                        "time": {
                            "type": "array", "items": { "type": "number" }, "minItems": 1,
                            "description": "Times of the rows [s], strictly increasing"
                        },
                        "value": {
                            "type": "array", "items": { "type": "number" }, "minItems": 1,
                            "description": "Values of the rows"
                        }
                    },
                    "required": ["time", "value"],
                    "additionalProperties": false
                },
                {
                    "type": "object",
                    "description": "Rows of a file (CSV), piecewise linear as well",
                    "properties": {
                        "file": { "type": "string", "description": "Table with a column `time` [s], relative to the case file" },
                        "column": { "type": "string", "description": "Column of the values; default `value`, or the only one" }
                    },
                    "required": ["file"],
                    "additionalProperties": false
                }
            ]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Serialize, Deserialize)]
    struct Holder {
        value: InTime,
    }

    fn read(value: &str) -> Result<InTime, toml::de::Error> {
        toml::from_str::<Holder>(&format!("value = {value}")).map(|h| h.value)
    }

    #[test]
    fn tables_are_linear_in_time_with_an_event_at_each_row() {
        let ramp = read("{ time = [1, 3], value = [10, 30] }").expect("valid");
        for (time, value) in [(0.0, 10.0), (2.0, 20.0), (9.0, 30.0)] {
            assert_eq!(ramp.at(time), value);
        }
        for (after, event) in [(0.0, Some(1.0)), (1.0, Some(3.0)), (3.0, None)] {
            assert_eq!(ramp.next_event(after), event);
        }
        assert_eq!(read("5").expect("valid").at(7.0), 5.0);
        let pulse = read("'300 + 5 * t * exp(-2 * t)'").expect("valid");
        assert_eq!((pulse.at(0.0), pulse.next_event(0.0)), (300.0, None));
        assert!((pulse.at(2.0) - 300.0 - 10.0 * (-4.0_f64).exp()).abs() < 1e-12);
        assert_eq!(earlier(Some(2.0), None), Some(2.0));
        assert_eq!(earlier(Some(2.0), Some(1.0)), Some(1.0));
    }

    #[test]
    fn mistakes_are_explained() {
        for (text, message) in [
            ("'hot'", "`hot` in the formula `hot` is unknown"),
            (
                "'300 + x'",
                "depends on the position; expected a number, { time =",
            ),
            ("true", "a number, { time ="),
            ("inf", "not a finite number"),
            ("{ time = [0, 1], value = [1] }", "one value per row"),
            ("{ time = [0, 1] }", "missing field `value`"),
            ("{ value = [0, 1] }", "missing field `time`"),
            ("{ file = 'no.csv' }", "no.csv: the file cannot be read"),
            (
                "{ file = 'a.csv', value = [1] }",
                "expected a number, { time =",
            ),
            ("{ times = [0, 1] }", "unknown field `times`"),
        ] {
            let error = read(text).expect_err(text);
            assert!(error.message().contains(message), "{text}: {error}");
        }
    }

    #[test]
    fn a_file_has_the_rows_of_a_table() {
        let folder = tempfile::tempdir().expect("a folder");
        let write =
            |text: &str| std::fs::write(folder.path().join("t.csv"), text).expect("written");
        let read = |value: &str| folder::within(folder.path(), || read(value));
        write("time;left;right\n0;300;300\n10;400;500");
        let value = read("{ file = 't.csv', column = 'right' }").expect("valid");
        assert_eq!((value.at(5.0), value.next_event(0.0)), (400.0, Some(10.0)));
        let error = read("{ file = 't.csv' }")
            .expect_err("two columns")
            .to_string();
        assert!(
            error.contains("none of its columns `left`, `right` is called `value`"),
            "{error}"
        );
        write("time,temperature\n0,300\n10,500");
        assert_eq!(read("{ file = 't.csv' }").expect("valid").at(2.0), 340.0);
        for (text, message) in [
            ("t,value\n0,1", "no column `time`"),
            ("time,value\n0,hot", "line 2: `hot` in the column `value`"),
            ("time,value\n1,3\n0,4", "the table must increase"),
        ] {
            write(text);
            let error = read("{ file = 't.csv' }").expect_err(text).to_string();
            assert!(error.contains(message), "{error}");
        }
    }

    #[test]
    fn writing_and_reading_gives_the_same() {
        for text in [
            "5.5",
            "{ time = [1, 3], value = [10, 30] }",
            "'5 * t * exp(-2 * t)'",
        ] {
            let value = read(text).expect("valid");
            let json = serde_json::to_string(&value).expect("serialises");
            assert_eq!(serde_json::from_str::<InTime>(&json).expect("reads"), value);
        }
    }
}
