//! Temperatures at which the material of a body melts.

use perimelt_core::log::Log;
use perimelt_core::material::Material;
use perimelt_physics::metallurgy::composition::Composition;

use crate::case::of_log::case_of;
use crate::log_file::plugins_of;

/// An isotherm to draw.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Isotherm {
    /// such as `solidus`; empty for a requested temperature
    pub name: String,
    /// temperature, K
    pub temperature: f64,
}

impl Isotherm {
    /// The name within a sentence.
    pub(crate) fn name_or_isotherm(&self) -> &str {
        if self.name.is_empty() {
            "isotherm"
        } else {
            &self.name
        }
    }
}

/// The isotherm that bounds the melt pool: the solidus of the case, or else the first requested one (K).
pub(crate) fn bound(log: &Log, body: &str, asked: &[f64]) -> Option<Isotherm> {
    let of_case = isotherms(log, body, &[]).into_iter().next();
    of_case.or_else(|| isotherms(log, body, asked).into_iter().next())
}

/// The requested isotherms, or else solidus and liquidus of the first material of the body
/// that melts, as the case file in the log gives it.
pub(crate) fn isotherms(log: &Log, body: &str, asked: &[f64]) -> Vec<Isotherm> {
    if !asked.is_empty() {
        let isotherm = |&temperature| Isotherm {
            name: String::new(),
            temperature,
        };
        return asked.iter().map(isotherm).collect();
    }
    // a log of another version of the program may hold a case that this one cannot read
    let materials = case_of(log).and_then(|case| case.materials_of(body));
    let melting = |material: &Material| Some(melting(material)).filter(|i| !i.is_empty());
    materials
        .unwrap_or_default()
        .iter()
        .find_map(melting)
        .unwrap_or_default()
}

/// The requested isotherms (K), or else those of the macrograph: the fusion line, and `Ac1` of a steel.
pub(crate) fn of_highest_temperatures(log: &Log, body: &str, asked: &[f64]) -> Vec<Isotherm> {
    if !asked.is_empty() {
        return isotherms(log, body, asked);
    }
    let line = isotherms(log, body, &[]).into_iter().next();
    let line = line.map(|isotherm| Isotherm {
        name: format!("fusion line ({})", isotherm.name),
        ..isotherm
    });
    let border = ac1(log, body).map(|temperature| Isotherm {
        name: "Ac1".into(),
        temperature,
    });
    line.into_iter().chain(border).collect()
}

/// Temperature (K) at which the steel of a body begins to become austenite: that of its physics `metallurgy`, or else of the
/// composition of its first steel.
pub(crate) fn ac1(log: &Log, body: &str) -> Option<f64> {
    let mut metallurgy = plugins_of(log, "physics", "metallurgy", body);
    let of_physics = metallurgy.find_map(|physics| physics["austenite"]["start"].as_f64());
    of_physics.or_else(|| {
        let materials = case_of(log).ok()?.materials_of(body).ok()?;
        let steel = |material| Composition::of(material).ok().flatten();
        Some(materials.iter().find_map(steel)?.ac1())
    })
}

fn melting(material: &Material) -> Vec<Isotherm> {
    let isotherm = |name: &str| {
        let temperature = material.get(name)?.constant()?;
        let name = name.to_string();
        Some(Isotherm { name, temperature })
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pure_substance_has_one_isotherm_and_an_alloy_two() {
        let names = |material: &str| -> Vec<String> {
            let material = crate::library::find(material).expect("in the library");
            melting(&material).into_iter().map(|i| i.name).collect()
        };
        assert_eq!(names("IN625"), ["solidus", "liquidus"]);
        assert_eq!(names("water"), ["melting point"]);
    }
}
