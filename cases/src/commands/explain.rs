//! `perimelt explain`: the keys of a plugin or section, from its schema.

use std::io::Write;

use perimelt_core::error::nearest;
use perimelt_core::material::MaterialSection;
use perimelt_core::plugin::registered;
use perimelt_core::{Coupler, Physics};
use schemars::schema_for;
use serde_json::Value;

use super::Done;
use crate::case::schema;
use crate::case::sections::{BodySection, CaseSection, LogSection, ProbeSection, TimeSection};

#[derive(clap::Args, Debug)]
pub struct ExplainArgs {
    /// Type of a physics or coupler, or a section: bodies, materials, time, probes, log
    name: String,
}

/// An unknown name.
#[derive(Debug, thiserror::Error)]
#[error("no plugin or section is called `{name}`{}; see `perimelt list`", .close.as_ref().map_or(String::new(), |c| format!("; did you mean `{c}`?")))]
struct Unknown {
    name: String,
    close: Option<String>,
}

pub fn run(args: &ExplainArgs) -> Done {
    let known = known();
    let found = known.iter().find(|(name, ..)| *name == args.name);
    let Some((name, header, schema)) = found else {
        let close = nearest(&args.name, known.iter().map(|(name, ..)| name.as_str()));
        return Err(Unknown {
            name: args.name.clone(),
            close: close.map(String::from),
        }
        .into());
    };
    let out = &mut std::io::stdout().lock();
    writeln!(
        out,
        "{header}\n{}\n",
        schema["description"].as_str().unwrap_or("")
    )?;
    if header.starts_with("[[physics") || header.starts_with("[[couplers") {
        writeln!(out, "  type = \"{name}\"")?;
    }
    keys(out, schema, schema, "")
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
