use crate::{flattened, shared_keys};
use serde::Deserialize;
use serde_json::{Value, json};

shared_keys! {
    #[derive(Clone, Debug, Default, PartialEq)]
    struct Place {
        /// Body.
        #[serde(skip_serializing_if = "Option::is_none")]
        body: Option<String>,
        /// Position, m.
        at: [f64; 2],
        /// Whether it counts.
        #[serde(default = "yes")]
        counts: bool,
    }
}

shared_keys! {
    #[derive(Clone, Debug, Default, PartialEq)]
    struct Ordinary {
        /// Stabilisation.
        #[serde(default)]
        stabilisation: f64,
    }
}

flattened! {
    /// A table.
    #[derive(Clone, Debug, PartialEq)]
    struct Table {
        ..place: Place,
        ..form: Ordinary,
        /// Power, W.
        #[serde(alias = "watts")]
        #[schemars(extend("minimum" = 0))]
        power: f64,
    }
}

fn yes() -> bool {
    true
}

fn read(text: &str) -> Table {
    toml::from_str(text).expect("valid")
}

/// The message of a mistake and the text at its place.
fn mistake(text: &str) -> (String, String) {
    let error = toml::from_str::<Table>(text).expect_err("a mistake");
    let span = error.span().expect("a place");
    (error.message().into(), text[span].into())
}

#[test]
fn keys_are_distributed_and_defaults_taken() {
    let table = read("watts = 5\nat = [1, 2]");
    let place = Place {
        body: None,
        at: [1.0, 2.0],
        counts: true,
    };
    let form = Ordinary { stabilisation: 0.0 };
    assert_eq!((table.place, table.form, table.power), (place, form, 5.0));
    let table = read("at = [1, 2]\npower = 1\nstabilisation = 0.5\nbody = 'b'\ncounts = false");
    assert_eq!(table.form, Ordinary { stabilisation: 0.5 });
    assert_eq!(
        (table.place.body.as_deref(), table.place.counts),
        (Some("b"), false)
    );
    let saved = serde_json::to_value(&table).expect("serialises");
    assert_eq!(
        saved,
        json!({ "at": [1.0, 2.0], "body": "b", "counts": false, "power": 1.0, "stabilisation": 0.5 })
    );
    assert_eq!(Table::deserialize(saved).expect("the same"), table);
}

#[test]
fn a_mistake_keeps_its_place() {
    let (message, place) = mistake("power = 1\nat = [1, 'two']");
    assert!(
        message.starts_with("invalid type: string") && place == "'two'",
        "{message}"
    );
    let (message, place) = mistake("power = 1\nat = [1, 2]\nbodi = 'b'");
    assert!(
        message.starts_with("unknown field `bodi`") && place == "bodi",
        "{message}"
    );
    assert_eq!(mistake("power = 1").0, "missing field `at`");
    assert_eq!(mistake("at = [1, 2]").0, "missing field `power`");
}

#[test]
fn the_schema_lists_all_keys_with_their_documentation() {
    let schema = schemars::schema_for!(Table).to_value();
    let properties = schema["properties"].as_object().expect("keys");
    let names: Vec<_> = properties.keys().map(String::as_str).collect();
    assert_eq!(names, ["at", "body", "counts", "power", "stabilisation",]);
    assert_eq!(schema["required"], json!(["at", "power"]));
    assert_eq!(schema["additionalProperties"], Value::Bool(false));
    assert_eq!(schema["description"], "A table.");
    for (key, description) in [("at", "Position, m."), ("stabilisation", "Stabilisation.")] {
        assert_eq!(properties[key]["description"], description);
    }
    assert_eq!(
        (
            &properties["counts"]["default"],
            &properties["power"]["minimum"]
        ),
        (&json!(true), &json!(0))
    );
}
