//! Laws of every kind, that of this crate among them, as a log has them: their keys make the same running objects again.

use std::path::Path;

use perimelt::case::Case;
use perimelt::case::of_log::case_of;
use perimelt::run::{self, Options};
use perimelt_core::log::Log;
use serde_json::Value;
use swift as _;

const CASE: &str = include_str!("laws.toml");

/// The keys of a plugin as it wrote them itself, as TOML; it writes keys that are left out as null.
fn table(keys: &Value) -> toml::Value {
    match keys {
        Value::Object(map) => {
            let given = map.iter().filter(|(_, value)| !value.is_null());
            toml::Value::Table(given.map(|(k, value)| (k.clone(), table(value))).collect())
        }
        Value::Array(values) => toml::Value::Array(values.iter().map(table).collect()),
        other => toml::Value::try_from(other).expect("a number, a text or a truth value"),
    }
}

/// Runs a case to a log; the log with the bits of its last checkpoint.
fn logged(text: String, path: &Path) -> (Log, Vec<u8>) {
    let case = Case::parse("laws.toml", text, Path::new(""));
    let case = case.unwrap_or_else(|e| panic!("{}", e.render(false)));
    let options = Options {
        out: path.to_path_buf(),
        force: false,
        until: None,
        quiet: true,
        stop: Default::default(),
        processes: Default::default(),
    };
    run::run(&case, &options).unwrap_or_else(|e| panic!("{e}"));
    let log = Log::open(path).expect("the log opens");
    let last = log.last_checkpoint().expect("it has a checkpoint");
    let state = log.checkpoint(last).expect("it reads");
    (log, state)
}

#[test]
fn laws_of_a_log_make_the_same_running_objects() {
    let folder = tempfile::tempdir().expect("a folder for logs");
    let (log, state) = logged(CASE.into(), &folder.path().join("first.mcap"));
    let again = case_of(&log).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let again = again.compose();
    again.unwrap_or_else(|e| panic!("the text of the log: {}", e.render(false)));

    let mut case: toml::Table = CASE.parse().expect("TOML");
    let plugins = &log.run().plugins;
    for section in ["physics", "couplers"] {
        case.insert(section.into(), table(&plugins[section]));
    }
    let text = toml::to_string(&case).expect("it was TOML before");
    for law in [
        "law.linear",
        "law.neo_hookean",
        "flow.swift",
        "viscosity.power_law",
        "state.tait",
        "conductivity.fourier",
    ] {
        assert!(text.contains(&format!(".{law}]")), "{law}: {text}");
    }
    let (_, rebuilt) = logged(text, &folder.path().join("second.mcap"));
    assert!(rebuilt == state, "the rebuilt run ends in another state");
}
