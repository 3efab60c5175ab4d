//! A case with other values at some of its keys.

use std::ops::Range;

use perimelt_core::error::nearest;
use toml::de::{DeTable, DeValue};

use super::locate::{TomlTable, TomlValue};
use super::{Case, CaseError, Result};

/// Another value of a key.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Names that lead to the key, with dots between them; a physics or a coupler by its `name`, its `type` or its number
    /// from 0, such as `couplers.goldak.power`.
    pub key: String,
    /// The value as TOML.
    pub value: String,
}

/// No `=` between key and value.
#[derive(Debug, thiserror::Error)]
#[error("expected a key and its value, such as `couplers.goldak.power=2000`")]
pub struct NoChange;

impl std::str::FromStr for Change {
    type Err = NoChange;

    fn from_str(text: &str) -> std::result::Result<Self, NoChange> {
        let (key, value) = text.split_once('=').ok_or(NoChange)?;
        Ok(Change {
            key: key.trim().into(),
            value: value.trim().into(),
        })
    }
}

impl Case {
    /// The same case with other values; keys that the file does not give cannot change.
    ///
    /// # Errors
    /// A key that is not in the file, or the first mistake of the new case.
    pub fn changed(&self, changes: &[Change]) -> Result<Case> {
        let mut text = self.file.text.clone();
        for change in changes {
            let place = place_of(&text, &change.key).map_err(|(message, hint)| {
                let error = CaseError::of_file(&self.file, message);
                match hint {
                    Some(hint) => error.help(hint),
                    None => error,
                }
            })?;
            text.replace_range(place, &change.value);
        }
        Case::parse(&self.file.name, text, &self.folder)
    }
}

/// A message, and a hint.
type Missing = (String, Option<String>);

/// Bytes of the value of a key.
fn place_of(text: &str, key: &str) -> std::result::Result<Range<usize>, Missing> {
    let parsed = DeTable::parse(text).map_err(|e| (e.message().to_string(), None))?;
    let whole = parsed.get_ref();
    let mut names = key.split('.');
    let first = names.next().unwrap_or(key);
    let mut value = in_table(whole, first, key)?;
    for name in names {
        value = match value.get_ref() {
            DeValue::Table(table) => in_table(table, name, key)?,
            DeValue::Array(list) => in_list(list, name, key)?,
            _ => return Err((format!("`{key}` has nothing below `{name}`"), None)),
        };
    }
    match value.get_ref() {
        DeValue::Table(table) => Err((
            format!("`{key}` is a table"),
            Some(format!("its keys are {}", listed(keys(table)))),
        )),
        _ => Ok(value.span()),
    }
}

fn in_table<'t, 'i>(
    table: &'t TomlTable<'i>,
    name: &str,
    key: &str,
) -> std::result::Result<&'t TomlValue<'i>, Missing> {
    table.get(name).ok_or_else(|| {
        let hint = match nearest(name, keys(table)) {
            Some(close) => format!("did you mean `{close}`?"),
            None => format!("keys there are {}", listed(keys(table))),
        };
        (
            format!("the case does not give `{key}`: no `{name}`"),
            Some(hint),
        )
    })
}

/// The element of a list with a `name`, a `type` or a number.
fn in_list<'t, 'i>(
    list: &'t [TomlValue<'i>],
    name: &str,
    key: &str,
) -> std::result::Result<&'t TomlValue<'i>, Missing> {
    if let Ok(number) = name.parse::<usize>() {
        let missing = || {
            (
                format!("`{key}`: the list has {} elements", list.len()),
                None,
            )
        };
        return list.get(number).ok_or_else(missing);
    }
    let text = |element: &'t TomlValue<'i>, of: &str| {
        element.get_ref().as_table()?.get(of)?.get_ref().as_str()
    };
    let named = |of| list.iter().filter(move |e| text(e, of) == Some(name));
    if let Some(element) = named("name").next() {
        return Ok(element);
    }
    let mut of_type = named("type");
    match (of_type.next(), of_type.next()) {
        (Some(element), None) => Ok(element),
        (Some(_), Some(_)) => Err((
            format!("`{key}`: several are of type `{name}`"),
            Some("give them a `name`, or count from 0".into()),
        )),
        (None, _) => {
            let known = list
                .iter()
                .filter_map(|e| text(e, "name").or(text(e, "type")));
            let hint = format!("there are {}", listed(known));
            Err((
                format!("`{key}`: nothing there is called `{name}`"),
                Some(hint),
            ))
        }
    }
}

fn keys<'t>(table: &'t TomlTable<'_>) -> impl Iterator<Item = &'t str> {
    table.keys().map(|key| &**key.get_ref())
}

fn listed<'t>(names: impl Iterator<Item = &'t str>) -> String {
    let names: Vec<String> = names.map(|name| format!("`{name}`")).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[time]\nend = 5 # s\n[[couplers]]\ntype = \"goldak\"\nname = \"torch\"\npower = 2000\ntoolpath.line = { start = [0, 0, 0], speed = 1e-3 }\n[[couplers]]\ntype = \"radiation\"\n[[couplers]]\ntype = \"convection\"\n[[couplers]]\ntype = \"convection\"\ncoefficient = 3\n";

    fn at(key: &str) -> &'static str {
        &TEXT[place_of(TEXT, key).expect("it is there")]
    }

    #[test]
    fn values_are_found_by_names_types_and_numbers() {
        assert_eq!(at("time.end"), "5");
        assert_eq!(at("couplers.torch.power"), "2000");
        assert_eq!(at("couplers.goldak.toolpath.line.speed"), "1e-3");
        assert_eq!(at("couplers.0.toolpath.line.start"), "[0, 0, 0]");
        assert_eq!(at("couplers.3.coefficient"), "3");
    }

    #[test]
    fn keys_that_are_not_there_are_told_with_those_that_are() {
        let told = |key: &str| {
            let (message, hint) = place_of(TEXT, key).expect_err("missing");
            format!("{message} {}", hint.unwrap_or_default())
        };
        assert!(told("couplers.torch.powr").contains("did you mean `power`?"));
        assert!(told("couplers.convection.coefficient").contains("several"));
        assert!(told("couplers.laser.power").contains("`torch`, `radiation`"));
        assert!(told("couplers.9.power").contains("4 elements"));
        assert!(told("couplers.torch.toolpath.line").contains("`speed`, `start`"));
        assert!(told("time.end.x").contains("nothing below"));
    }
}
