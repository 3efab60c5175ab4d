//! Scalar time series (probes, balance): JSON messages and the JSON schema that describes them.

use serde_json::{Map, Value, json};

/// A time series as read back from a log.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// simulated times, s
    pub times: Vec<f64>,
    /// one per quantity, each as long as `times`
    pub columns: Vec<Column>,
}

/// One quantity of a [`Series`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Column {
    /// name of the quantity
    pub name: String,
    /// SI unit
    pub unit: String,
    /// values at the times of the series; what was not finite reads as NaN
    pub values: Vec<f64>,
}

/// The value of one quantity in a row of a time series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry<'a> {
    /// Name of the quantity.
    pub name: &'a str,
    /// SI unit.
    pub unit: &'a str,
    /// Its value.
    pub value: f64,
}

impl<'a> Entry<'a> {
    /// The value of the quantity `name`.
    pub const fn new(name: &'a str, unit: &'a str, value: f64) -> Self {
        Entry { name, unit, value }
    }
}

/// JSON schema of a series; `required` keeps the order of the columns, the keyword `unit`
/// their units.
pub(super) fn schema(columns: &[(String, String)]) -> Value {
    let mut properties = Map::new();
    properties.insert("time".into(), json!({"type": "number", "unit": "s"}));
    for (name, unit) in columns {
        properties.insert(name.clone(), json!({"type": "number", "unit": unit}));
    }
    let mut required = vec!["time"];
    required.extend(columns.iter().map(|(name, _)| name.as_str()));
    json!({"type": "object", "properties": properties, "required": required})
}

/// Names and units of the columns that a [`schema`] describes.
pub(super) fn columns(schema: &[u8]) -> Result<Vec<(String, String)>, serde_json::Error> {
    let schema: Value = serde_json::from_slice(schema)?;
    let names = schema["required"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_str);
    Ok(names
        .filter(|name| *name != "time")
        .map(|name| {
            let unit = schema["properties"][name]["unit"]
                .as_str()
                .unwrap_or_default();
            (name.to_owned(), unit.to_owned())
        })
        .collect())
}

/// One message; what is not finite becomes `null`, because JSON has no word for it.
pub(super) fn message(time: f64, values: &[Entry<'_>]) -> Value {
    let mut message = Map::new();
    message.insert("time".into(), time.into());
    for entry in values {
        message.insert(entry.name.to_owned(), entry.value.into());
    }
    Value::Object(message)
}

impl Series {
    /// The entries of a row.
    pub fn row(&self, row: usize) -> Vec<Entry<'_>> {
        let columns = self.columns.iter();
        let entries = columns.map(|c| Entry::new(&c.name, &c.unit, c.values[row]));
        entries.collect()
    }

    pub(super) fn new(columns: Vec<(String, String)>) -> Self {
        let column = |(name, unit)| Column {
            name,
            unit,
            values: Vec::new(),
        };
        Self {
            times: Vec::new(),
            columns: columns.into_iter().map(column).collect(),
        }
    }

    pub(super) fn push(&mut self, message: &[u8]) -> Result<(), serde_json::Error> {
        let message: Value = serde_json::from_slice(message)?;
        let number = |name: &str| message[name].as_f64().unwrap_or(f64::NAN);
        self.times.push(number("time"));
        for column in &mut self.columns {
            column.values.push(number(&column.name));
        }
        Ok(())
    }
}
