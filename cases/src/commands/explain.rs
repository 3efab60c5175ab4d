//! `perimelt explain`: the keys of a plugin or section, from its schema; fields, materials and their properties.

use std::io::Write;

use perimelt_core::error::nearest;
use perimelt_core::field;
use perimelt_core::material::{MaterialSection, ValueRange, known_properties};
use perimelt_core::plugin::{Registration, registered};
use perimelt_core::{Coupler, Physics};
use schemars::schema_for;
use serde_json::Value;

use super::{Done, list};
use crate::case::sections::{BodySection, CaseSection, LogSection, ProbeSection, TimeSection};
use crate::case::{PLUGIN_NAME, schema};
use crate::library;
use crate::verify::check::Check;

#[derive(clap::Args, Debug)]
pub struct ExplainArgs {
    /// A section of the case file; the type of a physics or coupler; a key or a choice of one of these, such as
    /// `goldak.toolpath.polyline`, `polyline` or `rkl2`; a field, a material property, or a material of the library
    name: String,
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
    if let Some((first, header, schema)) = known.iter().find(|(known, ..)| known == first) {
        let path: Vec<String> = name.split('.').skip(1).map(String::from).collect();
        if path.is_empty() {
            return table(out, first, header, schema);
        }
        if let Some(key) = schema::at(schema, &path) {
            return explain_key(out, name, schema, key);
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
    for (first, _, schema) in &known {
        schema::visit(schema, first, &mut |path, key| {
            if path.rsplit('.').next() == Some(name) {
                places.push((path.to_string(), schema, key));
            }
        });
    }
    // sections and plugins themselves before what they contain
    places.sort_by_key(|(path, ..)| path.split('.').count());
    let Some(((path, root, key), others)) = places.split_first() else {
        let plugins = known.iter().map(|(name, ..)| name.clone());
        let fields = field::keys::ALL.iter().map(|(name, ..)| (*name).into());
        let properties = known_properties().map(|p| p.name.into());
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
    explain_key(out, path, root, key)?;
    for (path, ..) in others {
        writeln!(out, "also: {path}")?;
    }
    Ok(())
}

/// What the `type` of a plugin is for.
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
fn mentioning(text: &str, known: &[(String, String, Value)]) -> Vec<String> {
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
    for (name, _, schema) in known {
        look(name, &schema::one_line(schema, schema));
    }
    for (name, _, schema) in known {
        schema::visit(schema, name, &mut |path, key| {
            look(path, &schema::one_line(schema, key));
        });
    }
    found.truncate(MOST);
    found
}

/// A plugin or a section with its keys.
fn table(out: &mut impl Write, name: &str, header: &str, schema: &Value) -> Done {
    let description = schema["description"].as_str().unwrap_or("");
    writeln!(out, "{header}\n{description}\n")?;
    if header.starts_with("[[physics") || header.starts_with("[[couplers") {
        writeln!(out, "  type = \"{name}\"")?;
        writeln!(out, "  name = <text> (optional)\n      {PLUGIN_NAME}")?;
    }
    keys(out, schema, schema, "")
}

/// One key, and the keys of its value.
fn explain_key(out: &mut impl Write, path: &str, root: &Value, key: &Value) -> Done {
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
    match choice {
        Some(_) => Ok(()),
        None => keys(out, root, key, ""),
    }
}

/// A field, a material property or a material of the library.
fn of_world(name: &str) -> Option<String> {
    let field = field::keys::ALL.iter().find(|(known, ..)| *known == name);
    let field = field.map(|(_, unit, meaning)| format!("field `{name}` [{unit}]\n{meaning}"));
    let property = known_properties().find(|p| p.name == name).map(|p| {
        let range = match p.range {
            ValueRange::Any => "any number".into(),
            ValueRange::Positive => "above zero".into(),
            ValueRange::NotNegative => "zero or above".into(),
            ValueRange::Between(low, high) => format!("{low} to {high}"),
        };
        let form = "a number, or a table { temperature = [...], value = [...] }, each also for `.solid` and `.liquid`";
        let (unit, meaning) = (p.unit, p.meaning);
        format!("material property `{name}` [{unit}]\n{meaning}; {range}; {form}")
    });
    let material = library::ENTRIES.iter().find(|(known, _)| *known == name);
    let material = material.map(|(_, text)| text.trim_end().to_string());
    let found: Vec<String> = [field, property, material].into_iter().flatten().collect();
    (!found.is_empty()).then(|| found.join("\n\n"))
}

/// Everything that can be explained: name, header, schema.
fn known() -> Vec<(String, String, Value)> {
    let section = |name: &str, header: &str, schema: schemars::Schema| {
        (name.into(), header.into(), schema.to_value())
    };
    let mut all: Vec<(String, String, Value)> = Vec::new();
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

/// Prints the keys of `schema`, and below each key the keys or choices of its value.
fn keys(out: &mut impl Write, root: &Value, schema: &Value, indent: &str) -> Done {
    // shapes hold shapes
    const DEEPEST: usize = 12;
    if indent.len() > DEEPEST {
        return Ok(());
    }
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
            keys(out, root, key, &format!("{indent}    "))?;
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
