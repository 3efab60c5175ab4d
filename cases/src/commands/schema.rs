//! The JSON schema of whole case files, for editors.

use std::collections::BTreeMap;

use perimelt_core::material::MaterialSection;
use perimelt_core::plugin::{Registration, registered};
use perimelt_core::{Coupler, Physics};
use schemars::{JsonSchema, SchemaGenerator};
use serde_json::{Map, Value, json};

use crate::case::sections::{BodySection, CaseSection, LogSection, TimeSection};
use crate::probe::ProbeSection;
use crate::verify::check::Check;

/// The schema that `perimelt schema` prints: every section, with every registered plugin.
pub fn whole_schema() -> Value {
    let mut generator = SchemaGenerator::default();
    let mut of =
        |schema: fn(&mut SchemaGenerator) -> schemars::Schema| schema(&mut generator).to_value();
    let case = of(subschema::<CaseSection>);
    let bodies = of(subschema::<BTreeMap<String, BodySection>>);
    let materials = of(subschema::<BTreeMap<String, MaterialSection>>);
    let time = of(subschema::<TimeSection>);
    let probes = of(subschema::<Vec<ProbeSection>>);
    let log = of(subschema::<LogSection>);
    let verify = of(subschema::<Vec<Check>>);
    let mut definitions: Map<String, Value> = generator.take_definitions(true);
    let physics = plugins::<dyn Physics>(&mut definitions);
    let couplers = plugins::<dyn Coupler>(&mut definitions);
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Perimelt case",
        "type": "object",
        "properties": {
            "case": case,
            "bodies": bodies,
            "materials": materials,
            "physics": { "type": "array", "items": { "oneOf": physics } },
            "couplers": { "type": "array", "items": { "oneOf": couplers } },
            "time": time,
            "probes": probes,
            "log": log,
            "verify": verify,
        },
        "required": ["bodies", "physics", "time"],
        "additionalProperties": false,
        "$defs": definitions,
    })
}

fn subschema<T: JsonSchema>(generator: &mut SchemaGenerator) -> schemars::Schema {
    generator.subschema_for::<T>()
}

/// Documentation of the `name` of a plugin.
pub(super) const PLUGIN_NAME: &str =
    "Name in messages, reports and sweeps; its type when left out.";

/// Schemas of the plugins of one kind, each with its `type`; what they refer to moves into
/// `definitions`.
fn plugins<P: ?Sized + 'static>(definitions: &mut Map<String, Value>) -> Vec<Value>
where
    Registration<P>: inventory::Collect,
{
    let plugin = |r: &&Registration<P>| {
        let mut schema = (r.schema)().to_value();
        if let Some(Value::Object(own)) = schema.as_object_mut().and_then(|s| s.remove("$defs")) {
            add_definitions(definitions, own, r.name, &mut schema);
        }
        if let Some(object) = schema.as_object_mut() {
            object.remove("$schema");
        }
        schema["properties"]["type"] = json!({ "const": r.name });
        schema["properties"]["name"] = json!({ "type": "string", "description": PLUGIN_NAME });
        match schema["required"].as_array_mut() {
            Some(required) => required.push("type".into()),
            None => schema["required"] = json!(["type"]),
        }
        schema
    };
    registered::<P>().iter().map(plugin).collect()
}

/// Adds the definitions of a plugin's schema. One whose name another definition has, such as `Form`, gets the name of the
/// plugin in front of its own.
fn add_definitions(
    definitions: &mut Map<String, Value>,
    own: Map<String, Value>,
    plugin: &str,
    schema: &mut Value,
) {
    let taken: Vec<String> = own
        .iter()
        .filter(|(name, schema)| definitions.get(*name).is_some_and(|known| known != *schema))
        .map(|(name, _)| name.clone())
        .collect();
    let refer = |value: &mut Value| {
        for name in &taken {
            redirect(
                value,
                &reference(name),
                &reference(&format!("{plugin}_{name}")),
            );
        }
    };
    refer(schema);
    for (name, mut definition) in own {
        refer(&mut definition);
        let name = if taken.contains(&name) {
            format!("{plugin}_{name}")
        } else {
            name
        };
        definitions.insert(name, definition);
    }
}

fn reference(name: &str) -> String {
    format!("#/$defs/{name}")
}

/// Replaces a reference wherever it occurs.
fn redirect(value: &mut Value, from: &str, to: &str) {
    match value {
        Value::Object(keys) => {
            for (key, value) in keys {
                if key == "$ref" && *value == from {
                    *value = to.into();
                } else {
                    redirect(value, from, to);
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| redirect(item, from, to)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn definitions_of_one_name_stay_apart() {
        let variants = |schema: &Value, plugin: &str| -> Value {
            let plugins = schema["properties"]["physics"]["items"]["oneOf"].as_array();
            let of_type = |p: &&Value| p["properties"]["type"]["const"] == plugin;
            let found = plugins.expect("a list").iter().find(of_type).expect(plugin);
            let form = &found["properties"]["form"];
            crate::case::schema::resolve(schema, form).clone()
        };
        let schema = whole_schema();
        let (thermal, fluid) = (variants(&schema, "thermal"), variants(&schema, "fluid"));
        assert!(thermal.to_string().contains("bonds"), "{thermal}");
        assert!(fluid.to_string().contains("conservative"), "{fluid}");
    }
}
