//! Temperatures at which the material of a body melts.

use perimelt_core::log::Log;
use toml::{Table, Value};

/// An isotherm to draw.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Isotherm {
    /// such as `solidus`
    pub name: String,
    /// temperature, K
    pub temperature: f64,
}

/// The isotherms asked for, or else solidus and liquidus of the body's material as the case file
/// in the log gives them.
pub(crate) fn isotherms(log: &Log, body: &str, asked: &[f64]) -> Vec<Isotherm> {
    if !asked.is_empty() {
        let isotherm = |&temperature| Isotherm {
            name: "isotherm".into(),
            temperature,
        };
        return asked.iter().map(isotherm).collect();
    }
    log.case_text()
        .parse()
        .map_or_else(|_| Vec::new(), |case| in_case(&case, body))
}

/// Of the materials that the body's section mentions or, if it mentions none that melts, of the
/// only one that does.
fn in_case(case: &Table, body: &str) -> Vec<Isotherm> {
    let Some(materials) = case.get("materials").and_then(Value::as_table) else {
        return Vec::new();
    };
    let melting = |name: &String| {
        let number = |key: &str| match materials[name].get(key) {
            Some(Value::Float(temperature)) => Some(*temperature),
            Some(Value::Integer(temperature)) => Some(*temperature as f64),
            _ => None,
        };
        let isotherm = |key: &str| {
            number(key).map(|temperature| Isotherm {
                name: key.into(),
                temperature,
            })
        };
        let mut isotherms: Vec<_> = ["solidus", "liquidus"]
            .into_iter()
            .filter_map(isotherm)
            .collect();
        // a pure substance melts at one temperature
        if isotherms.len() == 2 && isotherms[0].temperature == isotherms[1].temperature {
            isotherms.truncate(1);
            isotherms[0].name = "melting point".into();
        }
        isotherms
    };
    let melting: Vec<_> = materials
        .keys()
        .map(|name| (name, melting(name)))
        .filter(|(_, i)| !i.is_empty())
        .collect();
    let section = match case.get("bodies") {
        Some(Value::Table(bodies)) => bodies.get(body),
        Some(Value::Array(bodies)) => bodies
            .iter()
            .find(|section| section.get("name").and_then(Value::as_str) == Some(body)),
        _ => None,
    };
    let mentioned = |name: &str| section.is_some_and(|section| mentions(section, name));
    let own = melting.iter().find(|(name, _)| mentioned(name));
    match (own, &melting[..]) {
        (Some((_, isotherms)), _) | (None, [(_, isotherms)]) => isotherms.clone(),
        _ => Vec::new(),
    }
}

fn mentions(value: &Value, name: &str) -> bool {
    match value {
        Value::String(text) => text == name,
        Value::Array(values) => values.iter().any(|value| mentions(value, name)),
        Value::Table(table) => table.values().any(|value| mentions(value, name)),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn body_gets_the_melting_range_of_its_own_material() {
        let case = r#"
            [bodies.plate]
            material = "steel"
            [bodies.block]
            materials = [{ name = "tin" }]
            [materials.steel]
            solidus = 1690
            liquidus = 1740.5
            [materials.tin]
            solidus = 505.1
            liquidus = 505.1
            [materials.copper]
            density = 8900
        "#;
        let case: Table = case.parse().expect("valid");
        let found = |body| -> Vec<(String, f64)> {
            in_case(&case, body)
                .into_iter()
                .map(|i| (i.name, i.temperature))
                .collect()
        };
        assert_eq!(
            found("plate"),
            [("solidus".into(), 1690.0), ("liquidus".into(), 1740.5)]
        );
        assert_eq!(found("block"), [("melting point".into(), 505.1)]);
        assert_eq!(found("other"), []);
    }
}
