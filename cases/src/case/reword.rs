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
        let at_key = error.span().filter(|span| *span != self.header);
        at_key.map_or_else(Vec::new, |span| locate::path_to(self.table, &span))
    }

    /// The mistake that `error` reports in this section.
    pub fn reword(&self, error: &toml::de::Error) -> Box<Mistake> {
        let span = error.span().unwrap_or_else(|| self.header.clone());
        let path = self.path(error);
        let message = error.message();
        let at = |message: String| Mistake::new(self.file, message, span.clone());
        let reworded = if let Some((name, known)) = unknown(message) {
            let what = if message.starts_with("unknown variant") {
                "choice"
            } else {
                "key"
            };
            // where a plugin passes its keys to several structs, only its schema lists all of them
            let known = match self.schema["properties"].as_object() {
                Some(keys) if path.len() == 1 && what == "key" => {
                    keys.keys().map(String::as_str).collect()
                }
                _ => known,
            };
            let reworded = at(format!("unknown {what} `{name}` in {}", self.name));
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
            .help(format!("known here: {}", known.join(", ")))
        } else if let Some(name) = quoted(message, "missing field `") {
            return self.missing(path, name, span);
        } else if let Some((found, expected)) = wrong_type(message) {
            let key = path.join(".");
            let reworded = at(format!("`{key}` in {} cannot be {found}", self.name))
                .expected(format!("expected {expected}"));
            let name = path.last().map_or("", String::as_str);
            self.documented(reworded, name, &path)
        } else if message.starts_with("wanted exactly 1 element, more than") {
            let key = path.join(".");
            at(format!("`{key}` in {} has more than one kind", self.name)).expected("one of them")
        } else {
            split_help(at(message.to_string()), message)
        };
        reworded.within(self.header.clone(), format!("in {}", self.name))
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
        let reported = quoted(error.message(), "missing field `");
        let Some(reported) = reported.filter(|_| self.path(error).is_empty()) else {
            return Vec::new();
        };
        let required = self.schema["required"].as_array().into_iter().flatten();
        let required = required.filter_map(Json::as_str);
        let others = required.filter(|key| *key != reported && !self.table.contains_key(*key));
        let missing = |key| *self.missing(Vec::new(), key, self.header.clone());
        others.map(missing).collect()
    }
}

/// Moves what follows the first `; ` or `, did you mean` of a message into its help.
pub fn split_help(mut error: Box<Mistake>, message: &str) -> Box<Mistake> {
    let split = message.split_once("; ").or_else(|| {
        message
            .split_once(", did you")
            .map(|(m, _)| (m, &message[m.len() + 2..]))
    });
    let Some((message, rest)) = split else {
        return error;
    };
    error.message = message.into();
    if rest.starts_with("expected ") || rest.starts_with("did you mean") {
        error.expected(rest)
    } else {
        error.help(rest)
    }
}

fn quoted<'m>(message: &'m str, before: &str) -> Option<&'m str> {
    let name = message.strip_prefix(before)?;
    name.split_once('`').map(|(name, _)| name)
}

/// The unknown name and the known ones.
fn unknown(message: &str) -> Option<(&str, Vec<&str>)> {
    // a choice with keys reports all unknown ones; the first is enough
    if let Some(keys) = message.strip_prefix("unexpected keys in table: ") {
        let (unknown, known) = keys.split_once(", available keys: ")?;
        let name = unknown.split(", ").next().unwrap_or(unknown);
        return Some((name, known.split(", ").collect()));
    }
    let name =
        quoted(message, "unknown field `").or_else(|| quoted(message, "unknown variant `"))?;
    let known = message
        .split_once("expected")
        .map_or("", |(_, known)| known);
    Some((name, known.split('`').skip(1).step_by(2).collect()))
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
