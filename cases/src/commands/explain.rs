//! `perimelt explain`: the keys of a plugin or section, from its schema; fields, materials and their properties.

use std::io::Write;

use perimelt_core::error::nearest;
use perimelt_core::material::{MaterialSection, ValueRange, find_property, known_properties};
use perimelt_core::plugin::{Registration, registered};
use perimelt_core::{Coupler, Physics, field};
use schemars::schema_for;
use serde_json::Value;

use super::schema::PLUGIN_NAME;
use super::{Done, list, synonyms};
use crate::case::schema;
use crate::case::sections::{BodySection, CaseSection, LogSection, TimeSection};
use crate::library;
use crate::probe::ProbeSection;
use crate::verify::check::Check;

#[derive(clap::Args, Debug)]
pub struct ExplainArgs {
    /// A section of the case file; the type of a physics or coupler; a key or a choice of one of these, such as
    /// `goldak.toolpath.polyline`, `polyline` or `rkl2`; a field, a material property, or a material of the library
    name: String,
    /// Also the keys of nested tables
    #[arg(long)]
    all: bool,
}

/// An unknown name.
#[derive(Debug, thiserror::Error)]
#[error("nothing is called `{name}`{}; see `perimelt list`", hint(.close.as_deref(), .mentions))]
struct Unknown {
    name: String,
    close: Option<String>,
    /// What has a description that mentions the name, when no name is close.
    mentions: Vec<String>,
}

fn hint(close: Option<&str>, mentions: &[String]) -> String {
    match (close, mentions) {
        (Some(close), _) => format!("; did you mean `{close}`?"),
        (None, []) => String::new(),
        (None, found) => format!("; it is mentioned by `{}`", found.join("`, `")),
    }
}

pub fn run(args: &ExplainArgs) -> Done {
    let out = &mut crate::terminal::output();
    let known = known();
    let name = args.name.as_str();
    match name {
        "physics" => return plugins::<dyn Physics>(out, name),
        "couplers" => return plugins::<dyn Coupler>(out, name),
        "type" => return Ok(writeln!(out, "type = <text>\n    {TYPE}")?),
        "name" => writeln!(
            out,
            "name = <text>\n    Of a physics or a coupler: {PLUGIN_NAME}\n"
        )?,
        _ => {}
    }
    let of_plugin = |section| name.strip_prefix(section);
    let name = of_plugin("physics.")
        .or(of_plugin("couplers."))
        .unwrap_or(name);
    let first = name.split('.').next().unwrap_or(name);
    if let Some(found) = known.iter().find(|known| known.name == first) {
        let schema = &found.schema;
        let path: Vec<String> = name.split('.').skip(1).map(String::from).collect();
        if path.is_empty() {
            table(out, found, args.all)?;
            // a kind of law and a property of materials may have one name
            return match of_world(name) {
                Some(text) => Ok(writeln!(out, "\n{text}")?),
                None => Ok(()),
            };
        }
        if let Some(key) = schema::at(schema, &path) {
            return explain_key(out, name, &KeyList::new(schema, args.all), key);
        }
        let last = path.last().map_or("", String::as_str);
        let siblings = schema::at(schema, &path[..path.len() - 1]);
        let siblings = siblings.map_or_else(Vec::new, |s| schema::keys(schema, s));
        return Err(unknown(name, nearest(last, siblings), Vec::new()));
    }
    if let Some(text) = of_world(name) {
        return Ok(writeln!(out, "{text}")?);
    }
    let mut places = Vec::new();
    for known in &known {
        schema::visit(&known.schema, &known.name, &mut |path, key| {
            if path.rsplit('.').next() == Some(name) {
                places.push((path.to_string(), &known.schema, key));
            }
        });
    }
    // sections and plugins themselves before what they contain
    places.sort_by_key(|(path, ..)| path.split('.').count());
    let Some(((path, root, key), others)) = places.split_first() else {
        if let Some(names) = synonyms::of(name) {
            return meant(out, name, names, &known);
        }
        let plugins = known.iter().map(|known| known.name.clone());
        let fields = field::keys::ALL.iter().map(|(name, ..)| (*name).into());
        let properties = known_properties().into_iter().map(|p| p.name.into());
        let materials = library::names().map(String::from);
        let others = ["physics", "couplers", "type"].map(String::from);
        let names: Vec<String> = plugins
            .chain(others)
            .chain(fields)
            .chain(properties)
            .chain(materials)
            .collect();
        let close = nearest(name, names.iter().map(String::as_str));
        let mentions = match close {
            Some(_) => Vec::new(),
            None => mentioning(name, &known),
        };
        return Err(unknown(name, close, mentions));
    };
    explain_key(out, path, &KeyList::new(root, args.all), key)?;
    for (path, ..) in others {
        writeln!(out, "also: {path}")?;
    }
    Ok(())
}

/// Documentation of the `type` of a plugin.
const TYPE: &str = "Type of a physics or a coupler, such as `type = \"thermal\"`; `perimelt list` names all of them.";

/// A section of plugins.
fn plugins<P: ?Sized + 'static>(out: &mut impl Write, section: &str) -> Done
where
    Registration<P>: inventory::Collect,
{
    writeln!(
        out,
        "[[{section}]]\nA table for each of them, with its `type`:\n"
    )?;
    list::plugins::<P>(out)?;
    Ok(writeln!(
        out,
        "\n`perimelt explain <type>` explains its keys."
    )?)
}

fn unknown(name: &str, close: Option<&str>, mentions: Vec<String>) -> Box<dyn std::error::Error> {
    Unknown {
        name: name.into(),
        close: close.map(String::from),
        mentions,
    }
    .into()
}

/// Fields, properties, plugins and sections, then keys, in whose name or description all words of a text stand.
fn mentioning(text: &str, known: &[Known]) -> Vec<String> {
    const MOST: usize = 8;
    let plain = |text: &str| text.to_lowercase().replace('_', " ");
    let text = plain(text);
    let words: Vec<&str> = text.split_whitespace().collect();
    // letters are everywhere
    if words.iter().all(|word| word.chars().count() < 3) {
        return Vec::new();
    }
    let mut found = Vec::new();
    let mut look = |name: &str, description: &str| {
        let last = name.rsplit('.').next().unwrap_or(name);
        let said = plain(&format!("{last} {description}"));
        if words.iter().all(|word| said.contains(word)) {
            found.push(name.to_string());
        }
    };
    for (name, _, meaning) in field::keys::ALL {
        look(name, meaning);
    }
    for property in known_properties() {
        look(property.name, property.meaning);
    }
    for Known { name, schema, .. } in known {
        look(name, &schema::one_line(schema, schema));
    }
    for Known { name, schema, .. } in known {
        schema::visit(schema, name, &mut |path, key| {
            look(path, &schema::one_line(schema, key));
        });
    }
    found.truncate(MOST);
    found
}

/// Keys for a word of the trade.
fn meant(out: &mut impl Write, word: &str, names: &[&str], known: &[Known]) -> Done {
    writeln!(
        out,
        "`{word}` is not a name of a case file; it belongs to\n"
    )?;
    for name in names {
        writeln!(
            out,
            "  {name}\n      {}",
            meaning(name, known).unwrap_or_default()
        )?;
    }
    Ok(writeln!(
        out,
        "\n`perimelt explain <name>` explains each of them."
    )?)
}

/// One line on a field, a property, a plugin, a section or a key.
fn meaning(name: &str, known: &[Known]) -> Option<String> {
    let (first, rest) = name.split_once('.').unwrap_or((name, ""));
    let path: Vec<String> = rest
        .split('.')
        .filter(|k| !k.is_empty())
        .map(String::from)
        .collect();
    let of_schema = known
        .iter()
        .find(|known| known.name == first)
        .and_then(|known| {
            let key = schema::at(&known.schema, &path)?;
            Some(schema::one_line(&known.schema, key))
        });
    let of_field = || {
        field::keys::ALL
            .iter()
            .find(|(known, ..)| *known == name)
            .map(|(.., meaning)| meaning.to_string())
    };
    let of_property = || find_property(name).map(|p| p.meaning.to_string());
    of_schema.or_else(of_field).or_else(of_property)
}

/// A plugin or a section with its keys.
fn table(out: &mut impl Write, known: &Known, all: bool) -> Done {
    let Known {
        name,
        header,
        schema,
    } = known;
    let description = schema["description"].as_str().unwrap_or("");
    writeln!(out, "{header}\n{description}\n")?;
    if header.starts_with("[[physics") || header.starts_with("[[couplers") {
        writeln!(out, "  type = \"{name}\"")?;
        writeln!(out, "  name = <text> (optional)\n      {PLUGIN_NAME}")?;
    }
    KeyList::new(schema, all).write(out, schema, name, "")
}

/// One key, and the keys of its value.
fn explain_key(out: &mut impl Write, path: &str, listed: &KeyList<'_>, key: &Value) -> Done {
    let root = listed.root;
    let choice = key["const"].as_str().zip(path.rsplit_once('.'));
    match choice {
        Some((choice, (path, _))) => writeln!(out, "{path} = \"{choice}\"")?,
        None => writeln!(out, "{path} = <{}>", schema::type_name(root, key))?,
    }
    let text = schema::one_line(root, key);
    if !text.is_empty() {
        writeln!(out, "    {text}")?;
    }
    writeln!(out)?;
    if choice.is_none() {
        listed.write(out, key, path, "")?;
    }
    for fact in law_facts(root, path, key) {
        writeln!(out, "  {fact}")?;
    }
    Ok(())
}

/// What a law says besides its keys, if the key is one.
fn law_facts<'a>(root: &'a Value, path: &str, key: &Value) -> Vec<&'a str> {
    let name = path.rsplit('.').next().unwrap_or(path);
    let definitions = root["$defs"].as_object().into_iter().flatten();
    let schemas = definitions.map(|(_, schema)| schema).chain([root]);
    let mut choices = schemas.flat_map(|s| s["oneOf"].as_array().into_iter().flatten());
    let law = choices.find(|choice| &choice["properties"][name] == key);
    let facts = law.and_then(|law| law["x-law"].as_array());
    facts
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
        .collect()
}

/// A field, a material property or a material of the library.
fn of_world(name: &str) -> Option<String> {
    let field = field::keys::ALL.iter().find(|(known, ..)| *known == name);
    let field = field.map(|(_, unit, meaning)| format!("field `{name}` [{unit}]\n{meaning}"));
    let property = find_property(name).map(|p| {
        let range = match p.range {
            ValueRange::Any => "any number".into(),
            ValueRange::Positive => "above zero".into(),
            ValueRange::NotNegative => "zero or above".into(),
            ValueRange::Between(low, high) => format!("{low} to {high}"),
        };
        let form = "a number, or a table { temperature = [...], value = [...] }, each also for `.solid` and `.liquid`";
        let directions = match p.has_directions {
            true => {
                "; also { along = ..., across = ... } or { axes = [..., ..., ...] } along the axes of the material, which \
                 `initial.orientation` of the body turns"
            }
            false => "",
        };
        let (unit, meaning) = (p.unit, p.meaning);
        format!("material property `{name}` [{unit}]\n{meaning}; {range}; {form}{directions}")
    });
    let material = library::ENTRIES.iter().find(|(known, _)| *known == name);
    let material = material.map(|(_, text)| text.trim_end().to_string());
    let found: Vec<String> = [field, property, material].into_iter().flatten().collect();
    (!found.is_empty()).then(|| found.join("\n\n"))
}

/// A section or a plugin of a case file.
struct Known {
    name: String,
    /// How it stands in the case file.
    header: String,
    schema: Value,
}

/// All sections and plugins.
fn known() -> Vec<Known> {
    let section = |name: &str, header: &str, schema: schemars::Schema| Known {
        name: name.into(),
        header: header.into(),
        schema: schema.to_value(),
    };
    let mut all = Vec::new();
    all.extend(
        registered::<dyn Physics>()
            .iter()
            .map(|r| section(r.name, "[[physics]]", (r.schema)())),
    );
    all.extend(
        registered::<dyn Coupler>()
            .iter()
            .map(|r| section(r.name, "[[couplers]]", (r.schema)())),
    );
    all.extend(
        list::LAWS
            .iter()
            .map(|kind| section(kind.key, &kind.place(), (kind.schema)())),
    );
    all.push(section("case", "[case]", schema_for!(CaseSection)));
    all.push(section(
        "bodies",
        "[bodies.<name>]",
        schema_for!(BodySection),
    ));
    all.push(section(
        "materials",
        "[materials.<name>]",
        schema_for!(MaterialSection),
    ));
    all.push(section("time", "[time]", schema_for!(TimeSection)));
    all.push(section("probes", "[[probes]]", schema_for!(ProbeSection)));
    all.push(section("log", "[log]", schema_for!(LogSection)));
    all.push(section("verify", "[[verify]]", schema_for!(Check)));
    all
}

/// The keys of a schema, with those of nested tables or with a hint at them.
struct KeyList<'a> {
    root: &'a Value,
    all: bool,
}

impl<'a> KeyList<'a> {
    fn new(root: &'a Value, all: bool) -> Self {
        KeyList { root, all }
    }

    /// Prints the keys and choices of `schema`, to which `path` leads.
    fn write(&self, out: &mut impl Write, schema: &Value, path: &str, indent: &str) -> Done {
        // shapes hold shapes
        const DEEPEST: usize = 12;
        if indent.len() > DEEPEST {
            return Ok(());
        }
        let root = self.root;
        for a in schema::alternatives(root, schema) {
            let required = a["required"].as_array();
            for (name, key) in a["properties"].as_object().into_iter().flatten() {
                let is_required = required.is_some_and(|r| r.iter().any(|n| n == name));
                let kind = schema::type_name(root, key);
                let default = match key.get("default") {
                    Some(Value::Null) => " (optional)".to_string(),
                    Some(value) => format!(" (default {value})"),
                    None if is_required => String::new(),
                    None => " (optional)".to_string(),
                };
                writeln!(out, "{indent}  {name} = <{kind}>{default}")?;
                let text = schema::one_line(root, key);
                // a variant of a choice is explained at the variant
                let text = if text.is_empty() {
                    schema::one_line(root, a)
                } else {
                    text
                };
                if !text.is_empty() {
                    writeln!(out, "{indent}      {text}")?;
                }
                let path = format!("{path}.{name}");
                if self.all {
                    self.write(out, key, &path, &format!("{indent}    "))?;
                } else {
                    self.hint(out, key, &path, indent)?;
                }
            }
            for choice in a["enum"].as_array().into_iter().flatten() {
                writeln!(out, "{indent}  {choice}")?;
            }
            if let (Some(choice), text) = (a["const"].as_str(), schema::one_line(root, a)) {
                writeln!(out, "{indent}  \"{choice}\": {text}")?;
            }
        }
        Ok(())
    }

    /// Names the keys and choices of a nested value.
    fn hint(&self, out: &mut impl Write, schema: &Value, path: &str, indent: &str) -> Done {
        let mut names = schema::keys(self.root, schema);
        for a in schema::alternatives(self.root, schema) {
            names.extend(a["const"].as_str());
            names.extend(
                a["enum"]
                    .as_array()
                    .into_iter()
                    .flatten()
                    .filter_map(Value::as_str),
            );
        }
        if names.is_empty() {
            return Ok(());
        }
        let names = names.join(", ");
        Ok(writeln!(
            out,
            "{indent}      {names}: see `perimelt explain {path}`"
        )?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn synonyms_lead_to_names_with_a_meaning() {
        let known = known();
        for (word, names) in synonyms::all() {
            for name in *names {
                let meaning = meaning(name, &known);
                assert!(meaning.is_some_and(|m| !m.is_empty()), "{word}: {name}");
            }
            // a word that has become a name is explained as such
            assert!(!known.iter().any(|known| known.name == *word), "{word}");
        }
        assert_eq!(
            synonyms::of("Heat-affected zone"),
            synonyms::of("heat affected zone")
        );
        assert_eq!(synonyms::of("nonsense"), None);
    }

    fn explained(name: &str, all: bool) -> String {
        let Known { schema, .. } = known()
            .into_iter()
            .find(|known| known.name == name)
            .expect(name);
        let mut out = Vec::new();
        KeyList::new(&schema, all)
            .write(&mut out, &schema, name, "")
            .expect("written");
        String::from_utf8(out).expect("text")
    }

    #[test]
    fn keys_are_explained_in_two_levels() {
        let (own, all) = (explained("goldak", false), explained("goldak", true));
        assert!(
            own.contains("see `perimelt explain goldak.toolpath`"),
            "{own}"
        );
        assert!(!own.contains("  segments = "), "{own}");
        assert!(all.contains("  segments = "), "{all}");
        assert!(5 * own.lines().count() < all.lines().count(), "{own}");
    }
}
