//! Converts messages of the TOML reader and of serde into sentences for users.

use std::ops::Range;
use std::sync::Arc;

use perimelt_core::error::nearest;
use serde_json::Value as Json;

use super::error::{CaseFile, Mistake};
use super::locate::{self, TomlTable};
use super::schema;

/// The section that is being read, for messages.
pub struct SectionContext<'a> {
    /// The case file.
    pub file: &'a Arc<CaseFile>,
    /// Name such as `[time]` or `[[couplers]]`, with the type of a plugin.
    pub name: String,
    /// The header.
    pub header: Range<usize>,
    /// The keys.
    pub table: &'a TomlTable<'a>,
    /// Schema of its keys.
    pub schema: Json,
}

impl SectionContext<'_> {
    /// The keys that lead to the place of `error`; none for the section as a whole.
    pub fn path(&self, error: &toml::de::Error) -> Vec<String> {
        self.place(error).0
    }

    /// The keys that lead to the place of `error`, and the place. An error in a law reports the place of the law, and the keys
    /// below it in its text.
    fn place(&self, error: &toml::de::Error) -> (Vec<String>, Range<usize>) {
        let span = error.span().unwrap_or_else(|| self.header.clone());
        let mut path = match span == self.header {
            true => Vec::new(),
            false => locate::path_to(self.table, &span),
        };
        let (message, mut below) = split_keys(error.message());
        let unknown = quoted(message, UNKNOWN_KEY);
        below.extend(unknown.filter(|key| path.last().is_some_and(|last| last != key)));
        if below.is_empty() {
            return (path, span);
        }
        path.extend(below.into_iter().map(String::from));
        let names: Vec<&str> = path.iter().map(String::as_str).collect();
        let place = locate::find(self.table, &names);
        let place = place.map(|place| match unknown {
            Some(_) => place.key,
            None => place.value,
        });
        (path, place.unwrap_or(span))
    }

    /// The mistake that `error` reports in this section.
    pub fn reword(&self, error: &toml::de::Error) -> Box<Mistake> {
        let (path, span) = self.place(error);
        let (message, _) = split_keys(error.message());
        let at = |message: String| Mistake::new(self.file, message, span.clone());
        let reworded = match Foreign::new(message) {
            Some(Foreign::Unknown { what, name, known }) => {
                let keys = self.known_keys(&path);
                let known = match what == "key" && !keys.is_empty() {
                    true => keys,
                    false => known,
                };
                let reworded = at(format!("unknown {what} `{name}` in {}", self.name));
                let help = match known.is_empty() {
                    true => "there are no keys here".into(),
                    false => format!("known here: {}", known.join(", ")),
                };
                match nearest(name, known.iter().copied()) {
                    Some(close) => {
                        let mut keys = path.clone();
                        if let Some(last) = keys.last_mut() {
                            *last = close.into();
                        }
                        let reworded = reworded.expected(format!("did you mean `{close}`?"));
                        self.documented(reworded, close, &keys)
                    }
                    None => reworded.expected("no such name"),
                }
                .help(help)
            }
            Some(Foreign::Missing(name)) => return self.missing(path, name, span),
            Some(Foreign::WrongType { found, expected }) => {
                let key = path.join(".");
                let reworded = at(format!("`{key}` in {} cannot be {found}", self.name))
                    .expected(format!("expected {expected}"));
                let name = path.last().map_or("", String::as_str);
                self.documented(reworded, name, &path)
            }
            Some(Foreign::NotOneChoice { found }) => {
                let key = path.join(".");
                at(format!("`{key}` in {} has {found}", self.name)).expected("one of them")
            }
            None => at(message.to_string()),
        };
        reworded.within(self.header.clone(), format!("in {}", self.name))
    }

    /// The keys that the schema lists beside the one at `path`: where a table passes its keys to several structs, only the schema has
    /// all of them.
    fn known_keys(&self, path: &[String]) -> Vec<&str> {
        let table = path.split_last().map(|(_, table)| table);
        let table = table.and_then(|table| schema::at(&self.schema, table));
        let keys =
            table.map(|table| schema::resolve(&self.schema, table)["properties"].as_object());
        let keys = keys.flatten().into_iter().flatten();
        keys.map(|(name, _)| name.as_str()).collect()
    }

    /// The mistake with the documentation of the key `name` at `keys` in the schema, if there is one.
    fn documented(&self, mistake: Box<Mistake>, name: &str, keys: &[String]) -> Box<Mistake> {
        let doc = schema::documentation(&self.schema, keys);
        match doc.is_empty() {
            true => mistake,
            false => mistake.help(format!("`{name}`: {doc}")),
        }
    }

    /// The mistake that the table at `path` lacks the key `name`.
    fn missing(&self, path: Vec<String>, name: &str, span: Range<usize>) -> Box<Mistake> {
        let mut keys = path;
        keys.push(name.into());
        let message = format!("key `{}` is missing in {}", keys.join("."), self.name);
        let kind = schema::at(&self.schema, &keys)
            .map_or_else(String::new, |k| schema::type_name(&self.schema, k));
        let mistake = Mistake::new(self.file, message, span).expected(match kind.as_str() {
            "" => format!("needs `{name}`"),
            kind => format!("needs `{name} = <{kind}>`"),
        });
        let mistake = self.documented(mistake, name, &keys);
        mistake.within(self.header.clone(), format!("in {}", self.name))
    }

    /// The mistakes that the section lacks other keys than the one that `error` reports, if it reports one.
    pub fn others_missing(&self, error: &toml::de::Error) -> Vec<Mistake> {
        let Some(Foreign::Missing(reported)) = Foreign::new(error.message()) else {
            return Vec::new();
        };
        if !self.path(error).is_empty() {
            return Vec::new();
        }
        let required = self.schema["required"].as_array().into_iter().flatten();
        let required = required.filter_map(Json::as_str);
        let others = required.filter(|key| *key != reported && !self.table.contains_key(*key));
        let missing = |key| *self.missing(Vec::new(), key, self.header.clone());
        others.map(missing).collect()
    }
}

/// How serde begins the message of an unknown key.
const UNKNOWN_KEY: &str = "unknown field `";

/// A message without the lines at its end that name the keys that lead to its place, from the inner ones to the outer ones, and
/// the keys from the outer ones on.
fn split_keys(message: &str) -> (&str, Vec<&str>) {
    let mut rest = message.trim_end();
    let mut keys = Vec::new();
    while let Some((before, line)) = rest.rsplit_once('\n')
        && let Some(names) = quoted(line, "in `")
    {
        keys.extend(names.split('.'));
        rest = before.trim_end();
    }
    (rest, keys)
}

/// A message of serde or of the TOML reader.
#[derive(Debug, PartialEq)]
enum Foreign<'m> {
    /// A key or a choice that there is not, and the known ones.
    Unknown {
        what: &'static str,
        name: &'m str,
        known: Vec<&'m str>,
    },
    /// A key that is missing.
    Missing(&'m str),
    /// Found and expected type, in words.
    WrongType { found: String, expected: String },
    /// None or more than one of several choices, in words.
    NotOneChoice { found: &'static str },
}

impl<'m> Foreign<'m> {
    /// Recognises a message by its first words; `None` for messages of Perimelt.
    fn new(message: &'m str) -> Option<Self> {
        if let Some(found) = message.strip_prefix("wanted exactly 1 element, ") {
            let found = match found.starts_with("more than") {
                true => "more than one kind",
                false => "no kind",
            };
            return Some(Foreign::NotOneChoice { found });
        }
        // a choice with keys reports all unknown ones; the first is enough
        if let Some(keys) = message.strip_prefix("unexpected keys in table: ") {
            let (unknown, known) = keys.split_once(", available keys: ")?;
            return Some(Foreign::Unknown {
                what: "key",
                name: unknown.split(", ").next().unwrap_or(unknown),
                known: known.split(", ").collect(),
            });
        }
        for (what, before) in [("key", UNKNOWN_KEY), ("choice", "unknown variant `")] {
            if let Some(name) = quoted(message, before) {
                let known = message
                    .split_once("expected")
                    .map_or("", |(_, known)| known);
                let known = known.split('`').skip(1).step_by(2).collect();
                return Some(Foreign::Unknown { what, name, known });
            }
        }
        if let Some(name) = quoted(message, "missing field `") {
            return Some(Foreign::Missing(name));
        }
        let (found, expected) = wrong_type(message)?;
        Some(Foreign::WrongType { found, expected })
    }
}

fn quoted<'m>(message: &'m str, before: &str) -> Option<&'m str> {
    let name = message.strip_prefix(before)?;
    name.split_once('`').map(|(name, _)| name)
}

/// Found and expected type, in words.
fn wrong_type(message: &str) -> Option<(String, String)> {
    let rest = message
        .strip_prefix("invalid type: ")
        .or_else(|| message.strip_prefix("invalid value: "))
        .or_else(|| message.strip_prefix("invalid length "))?;
    let (found, expected) = rest.split_once(", expected ")?;
    let found = match found.split_once(' ') {
        Some(("string", text)) => format!("the text {text}"),
        Some(("integer" | "floating", _)) => {
            format!("the number {}", found.split('`').nth(1).unwrap_or(found))
        }
        Some(("boolean", text)) => text.trim_matches('`').to_string(),
        _ => match found {
            "map" => "a table".into(),
            "sequence" => "a list".into(),
            "unit variant" => "a name alone".into(),
            length if length.parse::<usize>().is_ok() => format!("a list of {length}"),
            other => other.into(),
        },
    };
    let expected = match expected {
        "f64" | "f32" => "a number".into(),
        "u64" | "usize" | "u32" | "i64" => "a whole number".into(),
        "a boolean" => "true or false".into(),
        "a string" => "text in quotes".into(),
        "a sequence" => "a list in [ ]".into(),
        "newtype variant" | "struct variant" => {
            "`name = { ... }` with the keys of that choice".into()
        }
        "an array of length 3" => "three numbers, [x, y, z]".into(),
        e if e.starts_with("struct ") || e == "a map" => "a table".into(),
        other => other.into(),
    };
    Some((found, expected))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code, reason = "read only")]
    struct Table {
        number: Option<f64>,
        count: Option<usize>,
        on: Option<bool>,
        text: Option<String>,
        list: Option<Vec<f64>>,
        at: Option<[f64; 3]>,
        choice: Option<Choice>,
        needs: Option<Needs>,
    }

    #[derive(Debug, Deserialize)]
    #[allow(dead_code, reason = "read only")]
    struct Needs {
        key: f64,
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "snake_case", deny_unknown_fields)]
    #[allow(dead_code, reason = "read only")]
    enum Choice {
        Simple,
        Keyed { first: f64 },
    }

    fn message(text: &str) -> String {
        let error = toml::from_str::<Table>(text).expect_err("a mistake");
        error.message().to_string()
    }

    /// The messages of the libraries in use; a new release with other words fails here.
    #[test]
    fn unknown_keys_and_choices_of_serde_and_toml_are_recognised() {
        for (text, what, name, known) in [
            ("nmber = 1", "key", "nmber", "number"),
            ("choice = 'other'", "choice", "other", "simple"),
            (
                "choice.keyed = { first = 1, second = 2 }",
                "key",
                "second",
                "first",
            ),
        ] {
            let message = message(text);
            let Some(Foreign::Unknown {
                what: w,
                name: n,
                known: k,
            }) = Foreign::new(&message)
            else {
                panic!("{message}");
            };
            assert_eq!((w, n), (what, name), "{message}");
            assert!(k.contains(&known), "{message}");
        }
    }

    #[test]
    fn missing_keys_and_several_choices_are_recognised() {
        assert_eq!(
            Foreign::new(&message("needs = {}")),
            Some(Foreign::Missing("key"))
        );
        let keyed = "choice = { keyed = { first = 1 }, simple = {} }";
        for (case, found) in [(keyed, "more than one kind"), ("choice = {}", "no kind")] {
            let wrong = message(case);
            assert_eq!(
                Foreign::new(&wrong),
                Some(Foreign::NotOneChoice { found }),
                "{wrong}"
            );
        }
    }

    /// An error that passed through `erased_serde` twice, as that of a table in a law.
    #[test]
    fn keys_at_the_end_of_a_message_are_split_off() {
        let message = "invalid type: boolean\nin `factor`\n\nin `hardening`\n";
        let split = split_keys(message);
        assert_eq!(
            split,
            ("invalid type: boolean", vec!["hardening", "factor"])
        );
        assert_eq!(split_keys("the width in `m`"), ("the width in `m`", vec![]));
    }

    #[test]
    fn wrong_types_are_recognised_and_named() {
        for (text, found, expected) in [
            ("number = 'a'", "the text \"a\"", "a number"),
            ("count = 1.5", "the number 1.5", "a whole number"),
            ("on = 1", "the number 1", "true or false"),
            ("text = true", "true", "text in quotes"),
            ("list = {}", "a table", "a list in [ ]"),
            ("at = [1, 2]", "a list of 2", "three numbers, [x, y, z]"),
            ("needs = 1", "the number 1", "a table"),
            (
                "choice = 'keyed'",
                "a name alone",
                "`name = { ... }` with the keys of that choice",
            ),
        ] {
            let message = message(text);
            let (found, expected) = (found.to_string(), expected.to_string());
            let wrong = Foreign::WrongType { found, expected };
            assert_eq!(Foreign::new(&message), Some(wrong), "{message}");
        }
        assert_eq!(Foreign::new("`power` must be positive"), None);
    }
}
