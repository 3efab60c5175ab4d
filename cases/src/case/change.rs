//! A case with other values at some of its keys.

use std::ops::Range;

use perimelt_core::error::nearest;
use toml::de::{DeTable, DeValue};

use super::locate::{TomlTable, TomlValue};
use super::{Case, CaseError, Mistake, Result, SECTIONS};

/// Another value of a key.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Names that lead to the key, with dots between them; a physics or a coupler by its `name`, its `type` or its number
    /// from 0, such as `couplers.goldak.power`.
    pub key: String,
    /// The value as TOML.
    pub value: String,
}

/// Why a text gives no change.
#[derive(Debug, thiserror::Error)]
pub enum NoChange {
    /// No `=` between key and value.
    #[error("expected a key and its value, such as `couplers.goldak.power=2000`")]
    NoValue,
    /// The value is not TOML.
    #[error(
        "`{value}` is not a number, text in quotes (`{key}=\"...\"`), a list or a table of TOML"
    )]
    NotToml {
        /// The key.
        key: String,
        /// The value.
        value: String,
    },
}

impl std::str::FromStr for Change {
    type Err = NoChange;

    fn from_str(text: &str) -> std::result::Result<Self, NoChange> {
        let (key, value) = text.split_once('=').ok_or(NoChange::NoValue)?;
        let (key, value) = (key.trim().to_string(), value.trim().to_string());
        match DeValue::parse(&value) {
            Ok(_) => Ok(Change { key, value }),
            Err(_) => Err(NoChange::NotToml { key, value }),
        }
    }
}

impl Case {
    /// The case with other values, also for keys that the file does not give.
    ///
    /// # Errors
    /// A key whose place cannot be found, or the mistakes of the new case.
    pub fn changed(&self, changes: &[Change]) -> Result<Case, CaseError> {
        let mut text = self.file.text.clone();
        for change in changes {
            let edit = edit(&text, &change.key).map_err(|(message, hint)| {
                let error = Mistake::of_file(&self.file, message);
                match hint {
                    Some(hint) => error.help(hint),
                    None => error,
                }
            })?;
            edit.write(&mut text, &change.value);
        }
        Case::parse(&self.file.name, text, &self.folder)
    }
}

/// A message, and a hint.
type Missing = (String, Option<String>);

/// Place at which a value is written.
#[derive(Debug)]
struct Edit {
    /// Bytes that are replaced.
    place: Range<usize>,
    /// Text before the value.
    before: String,
    /// Text after the value.
    after: &'static str,
}

impl Edit {
    fn insert(at: usize, before: String, after: &'static str) -> Edit {
        let place = at..at;
        Edit {
            place,
            before,
            after,
        }
    }

    fn write(self, text: &mut String, value: &str) {
        text.replace_range(self.place, &format!("{}{value}{}", self.before, self.after));
    }
}

/// Place of the value of a key, or place at which the key may be inserted.
fn edit(text: &str, key: &str) -> std::result::Result<Edit, Missing> {
    let parsed = DeTable::parse(text).map_err(|e| (e.message().to_string(), None))?;
    let mut table = parsed.get_ref();
    let mut place = parsed.span();
    let mut rest = key;
    loop {
        let (name, below) = rest.split_once('.').unwrap_or((rest, ""));
        let Some(found) = table.get(name) else {
            let is_of_file = rest == key;
            let is_section = SECTIONS.contains(&name);
            return insertion(text, table, rest)
                .or_else(|| first_key(text, table, place, rest))
                .filter(|_| is_section || !is_of_file)
                .or_else(|| new_table(text, key).filter(|_| is_section && is_of_file))
                .ok_or_else(|| match is_of_file {
                    true => no_section(table, name, key),
                    false => missing(table, name, key),
                });
        };
        let (mut value, mut below) = (found, below);
        while let DeValue::Array(list) = value.get_ref()
            && !below.is_empty()
        {
            let (name, next) = below.split_once('.').unwrap_or((below, ""));
            (value, below) = (in_list(list, name, key)?, next);
        }
        match value.get_ref() {
            DeValue::Table(inner) if below.is_empty() => {
                let hint = format!("its keys are {}", listed(keys(inner)));
                return Err((format!("`{key}` is a table"), Some(hint)));
            }
            DeValue::Table(inner) => (table, place, rest) = (inner, value.span(), below),
            _ if below.is_empty() => {
                return Ok(Edit {
                    place: value.span(),
                    before: String::new(),
                    after: "",
                });
            }
            _ => {
                return Err((
                    format!("`{name}` in `{key}` is a value and has no keys"),
                    None,
                ));
            }
        }
    }
}

/// A key beside the first one that a table gives, other than as the header of another table.
fn insertion(text: &str, table: &TomlTable<'_>, name: &str) -> Option<Edit> {
    // such as `toolpath.line.` of a key with dots
    let is_of_key = |c: char| c.is_alphanumeric() || "_-.\"'".contains(c);
    let beside = |key: usize| {
        let start = text[..key].trim_end_matches(is_of_key).len();
        let before = text[..start].trim_end_matches([' ', '\t']);
        let after = match before.chars().next_back() {
            Some('[') => return None,
            Some('{' | ',') => ", ",
            _ => "\n",
        };
        let prefix = &text[start..key];
        Some(Edit::insert(start, format!("{prefix}{name} = "), after))
    };
    let mut starts: Vec<usize> = table.keys().map(|key| key.span().start).collect();
    starts.sort_unstable();
    starts.into_iter().find_map(beside)
}

/// The first key of a table that is written as `{}`.
fn first_key(text: &str, table: &TomlTable<'_>, place: Range<usize>, name: &str) -> Option<Edit> {
    let is_inline = table.is_empty() && text[place.clone()].starts_with('{');
    is_inline.then(|| Edit {
        place,
        before: format!("{{ {name} = "),
        after: " }",
    })
}

/// A key in a table of the file that it does not give.
fn new_table(text: &str, key: &str) -> Option<Edit> {
    let (table, name) = key.rsplit_once('.')?;
    let before = format!("\n[{table}]\n{name} = ");
    Some(Edit::insert(text.len(), before, "\n"))
}

fn missing(table: &TomlTable<'_>, name: &str, key: &str) -> Missing {
    let hint = match nearest(name, keys(table)) {
        Some(close) => format!("did you mean `{close}`?"),
        None => format!("keys there are {}", listed(keys(table))),
    };
    (
        format!("the case does not give `{key}`: no `{name}`"),
        Some(hint),
    )
}

/// A key whose path does not start with a section, with the paths that end with it.
fn no_section(table: &TomlTable<'_>, name: &str, key: &str) -> Missing {
    let mut paths = Vec::new();
    collect_paths(table, "", &mut paths);
    paths.retain(|path| path.ends_with(&format!(".{key}")));
    let hint = match (paths.is_empty(), nearest(name, SECTIONS)) {
        (false, _) => format!("did you mean {}?", listed(paths.iter().map(String::as_str))),
        (true, Some(close)) => format!("did you mean `{close}`?"),
        (true, None) => format!("sections are {}", listed(SECTIONS.into_iter())),
    };
    let message = format!("`{key}` does not start with a section of the case, such as `couplers`");
    (message, Some(hint))
}

/// The paths of all keys below `table`, each with `prefix`; elements of lists by their names or types, else by numbers.
fn collect_paths(table: &TomlTable<'_>, prefix: &str, paths: &mut Vec<String>) {
    for (key, value) in table {
        let path = format!("{prefix}{}", key.get_ref());
        match value.get_ref() {
            DeValue::Table(inner) => collect_paths(inner, &format!("{path}."), paths),
            DeValue::Array(list) => {
                for (number, element) in list.iter().enumerate() {
                    let Some(inner) = element.get_ref().as_table() else {
                        continue;
                    };
                    let text = |of: &str| inner.get(of)?.get_ref().as_str();
                    let name = text("name").or(text("type"));
                    let is_clear = |name: &&str| {
                        in_list(list, name, "").is_ok_and(|found| std::ptr::eq(found, element))
                    };
                    let label = name
                        .filter(is_clear)
                        .map_or(number.to_string(), String::from);
                    collect_paths(inner, &format!("{path}.{label}."), paths);
                }
            }
            _ => {}
        }
        paths.push(path);
    }
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
            format!("`{key}`: several tables have the type `{name}`"),
            Some("give them a `name`, or count from 0".into()),
        )),
        (None, _) => {
            let known = list
                .iter()
                .filter_map(|e| text(e, "name").or(text(e, "type")));
            let hint = format!("there are {}", listed(known));
            Err((format!("`{key}`: no table is called `{name}`"), Some(hint)))
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
        &TEXT[edit(TEXT, key).expect("it is there").place]
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
    fn keys_that_are_not_given_are_inserted_in_their_table() {
        let text = "[bodies.plate]\nspacing = 1\nshape.box = { min = [0, 0, 0], max = [1, 1, 1] }\n\
                    [[physics]]\ntype = 'thermal'\nsolver.steady = {}\n[materials.steel]\nlatent = { data.x = 1 }\n";
        for key in [
            "bodies.plate.dimension",
            "bodies.plate.shape.box.depth",
            "bodies.plate.shape.turn",
            "bodies.plate.initial.temperature",
            "physics.thermal.horizon",
            "physics.0.solver.tolerance",
            "physics.thermal.solver.steady.tolerance",
            "materials.steel.density",
            "materials.steel.latent.data.y",
            "materials.steel.latent.unit",
            "time.stages.first",
            "log.interval",
        ] {
            let edit = edit(text, key).expect("a place");
            assert!(["", "{}"].contains(&&text[edit.place.clone()]), "{key}");
            let mut changed = text.to_string();
            edit.write(&mut changed, "7");
            let parsed: toml::Table = toml::from_str(&changed).unwrap_or_else(|e| panic!("{e}"));
            let mut value = &toml::Value::Table(parsed);
            for name in key.split('.') {
                value = match value {
                    toml::Value::Array(list) => &list[0],
                    value => value.get(name).unwrap_or_else(|| panic!("{changed}")),
                };
            }
            assert_eq!(value.as_integer(), Some(7), "{key}: {changed}");
        }
    }

    #[test]
    fn keys_without_a_place_are_told_with_those_that_are_there() {
        let told = |key: &str| {
            let (message, hint) = edit(TEXT, key).expect_err("missing");
            format!("{message} {}", hint.unwrap_or_default())
        };
        assert!(told("couplers.convection.coefficient").contains("several"));
        assert!(told("couplers.laser.power").contains("`torch`, `radiation`"));
        assert!(told("couplers.9.power").contains("4 elements"));
        assert!(told("couplers.torch.toolpath.line").contains("`speed`, `start`"));
        assert!(told("time.end.x").contains("`end` in `time.end.x` is a value and has no keys"));
        assert!(told("tim").contains("did you mean `time`?"));
        assert!(told("power").contains("did you mean `couplers.torch.power`?"));
        assert!(told("line.speed").contains("`couplers.torch.toolpath.line.speed`"));
        assert!(told("coefficient").contains("`couplers.3.coefficient`"));
        assert!(told("torch.efficiency").contains("sections are `case`"));
    }
}
