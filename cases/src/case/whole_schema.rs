//! The JSON schema of whole case files, for editors.

use std::collections::BTreeMap;

use perimelt_core::material::MaterialSection;
use perimelt_core::plugin::{Registration, registered};
use perimelt_core::{Coupler, Physics};
use schemars::{JsonSchema, SchemaGenerator};
use serde_json::{Map, Value, json};

use super::sections::{BodySection, CaseSection, LogSection, ProbeSection, TimeSection};

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
            "verify": { "type": "array", "items": { "type": "object" } },
        },
        "required": ["bodies", "physics", "time"],
        "additionalProperties": false,
        "$defs": definitions,
    })
}

fn subschema<T: JsonSchema>(generator: &mut SchemaGenerator) -> schemars::Schema {
    generator.subschema_for::<T>()
}

/// What the `name` of a plugin is for.
pub const NAME: &str = "Name in messages, reports and sweeps; its type when left out.";

/// Schemas of the plugins of one kind, each with its `type`; what they refer to moves into
/// `definitions`.
fn plugins<P: ?Sized + 'static>(definitions: &mut Map<String, Value>) -> Vec<Value>
where
    Registration<P>: inventory::Collect,
{
    let plugin = |r: &&Registration<P>| {
        let mut schema = (r.schema)().to_value();
        if let Some(Value::Object(own)) = schema.as_object_mut().and_then(|s| s.remove("$defs")) {
            definitions.extend(own);
        }
        if let Some(object) = schema.as_object_mut() {
            object.remove("$schema");
        }
        schema["properties"]["type"] = json!({ "const": r.name });
        schema["properties"]["name"] = json!({ "type": "string", "description": NAME });
        match schema["required"].as_array_mut() {
            Some(required) => required.push("type".into()),
            None => schema["required"] = json!(["type"]),
        }
        schema
    };
    registered::<P>().iter().map(plugin).collect()
}
