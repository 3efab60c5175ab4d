//! Finding one key in a JSON schema: its documentation, type and default.

use serde_json::Value;

/// The schema of the key that `path` leads to, through references and enum variants. The place in a list may be left out.
pub fn at<'s>(root: &'s Value, path: &[String]) -> Option<&'s Value> {
    let mut here = root;
    for name in path {
        here = child(root, here, name)?;
    }
    Some(here)
}

/// `schema` with a reference followed (its own description is kept by the caller).
pub fn resolve<'s>(root: &'s Value, schema: &'s Value) -> &'s Value {
    let mut here = schema;
    while let Some(name) = here["$ref"].as_str().and_then(|r| r.rsplit('/').next()) {
        here = &root["$defs"][name];
    }
    here
}

/// The alternatives of a schema: itself, or what `anyOf`, `oneOf` or `allOf` list.
pub fn alternatives<'s>(root: &'s Value, schema: &'s Value) -> Vec<&'s Value> {
    let schema = resolve(root, schema);
    let listed = ["anyOf", "oneOf", "allOf"]
        .iter()
        .filter_map(|key| schema[key].as_array())
        .flatten();
    let mut found: Vec<_> = listed.flat_map(|a| alternatives(root, a)).collect();
    if found.is_empty() || schema.get("properties").is_some() {
        found.push(schema);
    }
    found
}

fn child<'s>(root: &'s Value, schema: &'s Value, name: &str) -> Option<&'s Value> {
    alternatives(root, schema).into_iter().find_map(|a| {
        if name.parse::<usize>().is_ok() {
            return a.get("items").or_else(|| a["prefixItems"].get(0));
        }
        let any = || a.get("additionalProperties").filter(|v| v.is_object());
        let in_list = || child(root, a.get("items")?, name);
        let choice = || (a["const"] == name).then_some(a);
        let key = a["properties"].get(name);
        key.or_else(any).or_else(in_list).or_else(choice)
    })
}

/// Names of the keys of a table, or of the tables of a list.
pub fn keys<'s>(root: &'s Value, schema: &'s Value) -> Vec<&'s str> {
    let of = |a: &'s Value| {
        let own = a["properties"].as_object().into_iter().flatten();
        let mut names: Vec<&str> = own.map(|(name, _)| name.as_str()).collect();
        names.extend(a.get("items").map_or_else(Vec::new, |i| keys(root, i)));
        names
    };
    alternatives(root, schema)
        .into_iter()
        .flat_map(of)
        .collect()
}

/// Passes each key and each choice below a schema with its path to `receive`, once where keys nest in themselves as shapes
/// do.
pub fn visit<'s>(root: &'s Value, path: &str, receive: &mut impl FnMut(&str, &'s Value)) {
    descend(root, root, path, &mut Vec::new(), receive);
}

fn descend<'s>(
    root: &'s Value,
    schema: &'s Value,
    path: &str,
    inside: &mut Vec<&'s Value>,
    receive: &mut impl FnMut(&str, &'s Value),
) {
    for a in alternatives(root, schema) {
        if inside.iter().any(|known| std::ptr::eq(*known, a)) {
            continue;
        }
        inside.push(a);
        for (name, key) in a["properties"].as_object().into_iter().flatten() {
            let path = format!("{path}.{name}");
            receive(&path, key);
            descend(root, key, &path, inside, receive);
        }
        if let Some(choice) = a["const"].as_str() {
            receive(&format!("{path}.{choice}"), a);
        }
        if let Some(any) = a.get("additionalProperties").filter(|v| v.is_object()) {
            descend(root, any, &format!("{path}.<name>"), inside, receive);
        }
        if let Some(items) = a.get("items") {
            descend(root, items, path, inside, receive);
        }
        inside.pop();
    }
}

/// Documentation of the key at `path`, on one line; empty where there is none.
pub fn documentation(root: &Value, path: &[String]) -> String {
    at(root, path).map_or_else(String::new, |key| one_line(root, key))
}

/// Documentation of a schema on one line.
pub fn one_line(root: &Value, schema: &Value) -> String {
    let text = schema["description"]
        .as_str()
        .or_else(|| resolve(root, schema)["description"].as_str());
    let paragraph = text.unwrap_or("").split("\n\n").next().unwrap_or("");
    paragraph.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The type of a key in a few words, such as `number`, `list of 3 numbers`, `"a" | "b"`.
pub fn type_name(root: &Value, schema: &Value) -> String {
    let mut names = Vec::new();
    for a in alternatives(root, schema) {
        let name = single_type(root, a);
        if !name.is_empty() && !names.contains(&name) {
            names.push(name);
        }
    }
    names.join(" | ")
}

fn single_type(root: &Value, schema: &Value) -> String {
    let quoted = |v: &Value| v.as_str().map(|s| format!("\"{s}\""));
    if let Some(values) = schema["enum"].as_array() {
        return values
            .iter()
            .filter_map(quoted)
            .collect::<Vec<_>>()
            .join(" | ");
    }
    if let Some(value) = quoted(&schema["const"]) {
        return value;
    }
    // `["number", "null"]` is an optional number
    let kind = match &schema["type"] {
        Value::Array(kinds) => kinds
            .iter()
            .find_map(|k| k.as_str().filter(|k| *k != "null")),
        kind => kind.as_str(),
    };
    match kind {
        Some("integer") => "whole number".into(),
        Some("string") => "text".into(),
        Some("boolean") => "true | false".into(),
        Some("null") | None => String::new(),
        Some("array") => {
            let item = schema.get("items").or_else(|| schema["prefixItems"].get(0));
            let item = item.map_or_else(String::new, |i| type_name(root, i));
            match schema["minItems"].as_u64() {
                Some(count) if schema["maxItems"].as_u64() == Some(count) => {
                    format!("list of {count} {}", plural(&item))
                }
                _ => format!("list of {}", plural(&item)),
            }
        }
        Some("object") => match (&schema["properties"], schema["required"].as_array()) {
            // a variant of an externally tagged enum
            (Value::Object(keys), Some(required)) if keys.len() == 1 && required.len() == 1 => {
                let name = keys.keys().next().map_or("", String::as_str);
                format!("{{ {name} = ... }}")
            }
            _ => "table".into(),
        },
        Some(other) => other.into(),
    }
}

fn plural(item: &str) -> String {
    match item {
        "number" | "whole number" | "table" => format!("{item}s"),
        other if other.starts_with("list") => other.replacen("list", "lists", 1),
        other => other.into(),
    }
}
