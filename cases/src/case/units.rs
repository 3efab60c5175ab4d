//! Signs of numbers in other units than SI: grams and millimetres, degrees Celsius.
//!
//! Cases may have numbers without a scale, such as a density of 1, or only differences of temperature. So a number is suspected where
//! others of the same material are those of a metal in SI units.

use std::ops::Range;

use perimelt_core::material::{Material, Property};
use perimelt_core::{Body, Simulation};
use toml::de::DeValue;

use super::locate::TomlValue;
use super::warnings::{CELSIUS, COLD, melts, numbers};
use super::{Case, CaseError};
use crate::unit;

/// Density of solids and liquids, kg/m³.
const DENSITY: Range<f64> = 500.0..25e3;

/// Specific heat of solids and liquids at room temperature, J/(kg K).
const SPECIFIC_HEAT: Range<f64> = 100.0..1e4;

/// Density times specific heat of solids and liquids, J/(m³ K).
const HEAT_CAPACITY: Range<f64> = 1e5..2e7;

/// Conductivity of metals, W/(m K).
const CONDUCTIVITY: Range<f64> = 5.0..500.0;

/// Numbers below this (K) stand for zero, the start of a rise of temperature.
const ZERO: f64 = 1.0;

/// A last row of a table above this (K or °C) means that it is one of hot metal.
const HOT: f64 = 500.0;

/// A contact angle below this (degrees) may be meant in radians.
const SMALL_ANGLE: f64 = 3.2;

/// Contact angles that may be meant in radians.
pub(super) fn small_angles(simulation: &Simulation) -> Vec<String> {
    let composition = simulation.composition();
    let couplers = composition["couplers"].as_array().into_iter().flatten();
    let warning = |(label, coupler): (&str, &serde_json::Value)| {
        let angle = coupler["contact_angle"].as_f64();
        let angle = angle.filter(|angle| (1e-3..SMALL_ANGLE).contains(angle))?;
        let number = unit::number(angle, 5);
        Some(format!(
            "{label}: `contact_angle` is {number}; contact angles are in degrees"
        ))
    };
    simulation
        .coupler_labels()
        .zip(couplers)
        .filter_map(warning)
        .collect()
}

/// Values of a material at room temperature.
struct AtRoom {
    density: Option<f64>,
    specific_heat: Option<f64>,
    conductivity: Option<f64>,
}

impl AtRoom {
    fn of(material: &Material) -> Self {
        let value = |name: &str| material.get(name).map(|p: &Property| p.at(300.0, 0.0));
        AtRoom {
            density: material.reference_density().ok(),
            specific_heat: value("specific_heat"),
            conductivity: value("conductivity"),
        }
    }
}

/// Whether a number is in a range; one that is not given is not.
fn lies(value: Option<f64>, range: &Range<f64>) -> bool {
    value.is_some_and(|v| range.contains(&v))
}

/// Whether a body is of a material in SI units: it melts, or has the density and specific heat of a solid or liquid.
pub(super) fn are_si(body: &Body) -> bool {
    let is_si = |material: &Material| {
        let at = AtRoom::of(material);
        lies(at.density, &DENSITY) && lies(at.specific_heat, &SPECIFIC_HEAT)
    };
    melts(body) || body.materials.iter().any(is_si)
}

fn extent(body: &Body) -> f64 {
    let (min, max) = body.bounds();
    (0..body.dimension)
        .map(|a| max[a] - min[a])
        .fold(0.0, f64::max)
}

/// A density, a specific heat or a conductivity in other units.
pub(super) fn of_material(body: &Body) -> Option<String> {
    body.materials.iter().find_map(|material| {
        let at = AtRoom::of(material);
        let (density, specific_heat) = (at.density?, at.specific_heat?);
        let product = density * specific_heat;
        // metals of small bodies, of which one of the two numbers is in SI units
        let is_metal = lies(at.conductivity, &CONDUCTIVITY) && extent(body) < 1.0;
        let one_is_si = (1e3..25e3).contains(&density) || SPECIFIC_HEAT.contains(&specific_heat);
        let is_certain = material.get("solidus").is_some() || (is_metal && one_is_si);
        if is_certain && !HEAT_CAPACITY.contains(&product) {
            return Some(format!(
                "density times specific heat of material `{}` is {product:.3e} J/(m³ K), that of metals some 1e6 to 5e6: \
                 densities are in kg/m³, specific heats in J/(kg K)",
                material.name()
            ));
        }
        let is_dense = (2e3..25e3).contains(&density) && (100.0..1.5e3).contains(&specific_heat);
        let conductivity = at.conductivity.filter(|k| is_dense && (1e-4..0.1).contains(k))?;
        Some(format!(
            "the conductivity of material `{}` is {} W/(m K), that of metals some 10 to 400: conductivities are in W/(m K)",
            material.name(),
            unit::number(conductivity, 4)
        ))
    })
}

/// A body that starts colder than anything that is welded.
pub(super) fn cold_start(body: &Body, lowest: Option<f64>) -> Option<String> {
    let least = if melts(body) { f64::NEG_INFINITY } else { ZERO };
    let lowest = lowest.filter(|t| (least..COLD).contains(t))?;
    Some(format!(
        "the initial temperature of body `{}` is {} K; {CELSIUS}",
        body.name,
        unit::number(lowest, 5)
    ))
}

impl Case {
    /// Tables of materials and couplers whose temperatures begin at a room temperature in degrees Celsius and end where metal is hot, of
    /// bodies that start in kelvins.
    pub(super) fn tables_in_celsius(
        &self,
        lowest: &[Option<f64>],
    ) -> Result<Vec<String>, CaseError> {
        let is_cold = |t: &Option<f64>| t.is_some_and(|t| t < COLD);
        if lowest.iter().all(|t| t.is_none() || is_cold(t)) {
            return Ok(Vec::new());
        }
        let table = self.table();
        let materials = table.get("materials").and_then(|m| m.get_ref().as_table());
        let materials = materials.into_iter().flatten();
        let materials =
            materials.map(|(name, value)| (format!("material `{}`", name.get_ref()), value));
        let couplers = self.plugin_tables("couplers")?;
        let couplers = couplers.iter().map(|c| (format!("`{}`", c.kind), &c.value));
        let in_celsius = |(owner, value): (String, &TomlValue<'_>)| {
            let mut tables = Vec::new();
            temperatures_below(value, "", &mut tables);
            let is_celsius = |(_, rows): &(String, Vec<f64>)| {
                let ends = rows.first().zip(rows.last());
                ends.is_some_and(|(first, last)| {
                    (-50.0..=30.0).contains(first)
                        && *last > HOT
                        && first.fract() == 0.0
                        && *first != 1.0
                })
            };
            let (key, rows) = tables.into_iter().find(is_celsius)?;
            let [first, last] = [rows[0], rows[rows.len() - 1]].map(|t| unit::number(t, 5));
            Some(format!(
                "the table `{key}` of {owner} has temperatures from {first} to {last}, as in degrees Celsius; {CELSIUS}"
            ))
        };
        Ok(materials.chain(couplers).filter_map(in_celsius).collect())
    }

    /// Warnings about toolpaths whose interpass temperature the body cannot reach by cooling.
    pub(super) fn waits(
        &self,
        simulation: &Simulation,
        lowest: &[Option<f64>],
    ) -> Result<Vec<String>, CaseError> {
        let coldest = self.coldest_surroundings()?;
        let mut found = Vec::new();
        for table in self.plugin_tables("couplers")? {
            let index = table.body_index(simulation.world().bodies());
            let start = index.and_then(|index| lowest.get(index).copied().flatten());
            let Some(coldest) = start.into_iter().chain(coldest).reduce(f64::min) else {
                continue;
            };
            let mut waits = Vec::new();
            waits_below(&table.value, &mut waits);
            for wait in waits.into_iter().filter(|wait| *wait < coldest) {
                found.push(format!(
                    "`wait_until` of `{}` waits until the body is colder than {} K, but it starts at {} K and nothing around it is \
                     colder; {CELSIUS}",
                    table.kind,
                    unit::number(wait, 5),
                    unit::number(coldest, 5)
                ));
            }
        }
        Ok(found)
    }

    /// Bodies with a heat source whose heat stays in them for longer than it takes to cross them.
    pub(super) fn nothing_cools(
        &self,
        simulation: &Simulation,
        lowest: &[Option<f64>],
    ) -> Result<Vec<String>, CaseError> {
        const COOLING: [&str; 7] = [
            "convection",
            "radiation",
            "prescribed_temperature",
            "water_jet",
            "heat_interface",
            "heat_flux",
            "moving_refinement",
        ];
        let couplers = self.plugin_tables("couplers")?;
        if couplers.iter().any(|c| COOLING.contains(&c.kind.as_str())) {
            return Ok(Vec::new());
        }
        let end = simulation.options().end;
        let mut found = Vec::new();
        for (index, body) in simulation.world().bodies().iter().enumerate() {
            let is_of_body = |c: &&super::plugins::PluginTable<'_>| {
                c.body().is_none_or(|name| name == body.name)
            };
            let has_source = couplers
                .iter()
                .filter(is_of_body)
                .any(|c| is_source(&c.value));
            let at_room = body.materials.first().map(AtRoom::of);
            let diffusivity =
                at_room.and_then(|m| Some(m.conductivity? / (m.density? * m.specific_heat?)));
            let Some(diffusivity) =
                diffusivity.filter(|_| has_source && are_si(body) && lowest[index].is_some())
            else {
                continue;
            };
            let crossing = extent(body).powi(2) / diffusivity;
            if end > crossing {
                found.push(format!(
                    "nothing cools body `{}`, and the heat of the source crosses it within {} s: its mean temperature only rises; \
                     heat leaves through `convection`, `radiation` or `prescribed_temperature`",
                    body.name,
                    unit::number(crossing, 3)
                ));
            }
        }
        Ok(found)
    }
}

/// Whether a coupler is a heat source: it has a power.
fn is_source(value: &TomlValue<'_>) -> bool {
    ["power", "voltage"]
        .into_iter()
        .any(|key| value.get_ref().get(key).is_some())
}

/// The temperatures of tables below a value, with their keys.
fn temperatures_below(value: &TomlValue<'_>, path: &str, found: &mut Vec<(String, Vec<f64>)>) {
    let Some(table) = value.get_ref().as_table() else {
        return;
    };
    for (key, value) in table.iter() {
        match (&**key.get_ref(), value.get_ref()) {
            ("temperature", DeValue::Array(_)) => {
                found.push((path.into(), numbers(value.get_ref())))
            }
            (key, _) => {
                let dot = if path.is_empty() { "" } else { "." };
                temperatures_below(value, &format!("{path}{dot}{key}"), found);
            }
        }
    }
}

/// Interpass temperatures (K) of toolpaths.
fn waits_below(value: &TomlValue<'_>, found: &mut Vec<f64>) {
    match value.get_ref() {
        DeValue::Table(table) => {
            for (key, value) in table.iter() {
                if key.get_ref() == "wait_until" {
                    let get = |key: &str| value.get_ref().get(key).map(|v| v.get_ref());
                    let rises = get("when").and_then(DeValue::as_str) == Some("above");
                    found.extend(
                        get("temperature")
                            .map(numbers)
                            .unwrap_or_default()
                            .into_iter()
                            .filter(|_| !rises),
                    );
                } else {
                    waits_below(value, found);
                }
            }
        }
        DeValue::Array(list) => list.iter().for_each(|value| waits_below(value, found)),
        _ => {}
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::path::Path;

    use super::*;

    const PLATE: &str = r#"
        [bodies.plate]
        shape.box = { min = [0, 0, -0.004], max = [0.02, 0.02, 0] }
        spacing = 2e-3
        material = "steel"
        initial.temperature = 293.15

        [materials.steel]
        density = 7800
        specific_heat = { temperature = [293, 1673], value = [450, 680] }
        conductivity = 50

        [[physics]]
        type = "thermal"
        horizon = 1

        [[couplers]]
        type = "gaussian_source"
        power = 50
        efficiency = 1
        sigma = 4e-3
        effective_depth = 2e-3
        toolpath.line = { start = [0.005, 0.01, 0], end = [0.015, 0.01, 0], speed = 5e-3 }

        [time]
        end = 0.2
        "#;

    pub(in crate::case) fn warnings(changes: &[(&str, &str)]) -> Vec<String> {
        let text = changes.iter().fold(PLATE.to_string(), |text, (old, new)| {
            assert!(text.contains(old), "`{old}` is there");
            text.replace(old, new)
        });
        warnings_of(&text)
    }

    pub(in crate::case) fn warnings_of(text: &str) -> Vec<String> {
        let case = Case::parse("case.toml", text.into(), Path::new("")).expect("valid");
        let mut simulation = case.compose().expect("complete");
        case.start(&mut simulation).expect("starts");
        case.warnings(&simulation).expect("read")
    }

    /// Each by a hand-written steel without a solidus; numbers without a scale, and rises from zero, are none.
    #[test]
    fn numbers_in_other_units_are_told_without_a_solidus() {
        assert_eq!(warnings(&[]), [""; 0]);
        let film = "[[couplers]]\ntype = 'convection'\nambient = 293.15\n\
                    coefficient = { temperature = [20, 900], value = [10, 50] }\n[time]";
        let (room, table) = ("initial.temperature = 293.15", "temperature = [293, 1673]");
        for (changes, told) in [
            (
                &[("density = 7800", "density = 7.8")][..],
                "densities are in kg/m³",
            ),
            (
                &[("value = [450, 680]", "value = [0.45, 0.68]")],
                "specific heats in J/(kg K)",
            ),
            (
                &[("conductivity = 50", "conductivity = 0.05")],
                "conductivities are in W/(m K)",
            ),
            (
                &[(room, "initial.temperature = 20")],
                "the initial temperature of body `plate` is 20 K",
            ),
            (
                // also where the density is in other units
                &[
                    (room, "initial.temperature = 20"),
                    ("density = 7800", "density = 7.8"),
                ],
                "the initial temperature of body `plate` is 20 K",
            ),
            (
                &[(table, "temperature = [20, 1400]")],
                "the table `specific_heat` of material `steel` has temperatures from 20 to 1400",
            ),
            (
                &[(table, "temperature = [0, 1400]")],
                "as in degrees Celsius",
            ),
            (
                &[
                    ("-0.004], max = [0.02, 0.02, 0]", "-4], max = [20, 20, 0]"),
                    ("spacing = 2e-3", "spacing = 1"),
                    ("sigma = 4e-3", "sigma = 4"),
                ],
                "body `plate` is 20 m long",
            ),
            (&[("end = 0.2", "end = 2000")], "nothing cools body `plate`"),
            (
                &[("[time]", film)],
                "the table `coefficient` of `convection` has temperatures from 20 to 900",
            ),
        ] {
            let found = warnings(changes).join("\n");
            assert!(found.contains(told), "{changes:?}: {found}");
        }
        for changes in [
            &[
                ("density = 7800", "density = 1"),
                ("value = [450, 680]", "value = [1, 1]"),
                ("conductivity = 50", "conductivity = 1"),
            ][..],
            &[
                (room, "initial.temperature = 77"),
                (table, "temperature = [20, 300]"),
            ][1..],
        ] {
            assert_eq!(warnings(changes), [""; 0], "{changes:?}");
        }
    }

    #[test]
    fn a_wait_for_a_temperature_that_is_not_reached_is_told() {
        let line =
            "toolpath.line = { start = [0.005, 0.01, 0], end = [0.015, 0.01, 0], speed = 5e-3 }";
        let waiting = |temperature: &str| {
            let path = format!(
                "toolpath.sequence = {{ wait_until = {{ temperature = {temperature} }}, passes = [{{ {line} }}, {{ {line} }}] }}"
            );
            warnings(&[(line, &path)]).join("\n")
        };
        assert!(waiting("150").contains("waits until the body is colder than 150 K"));
        assert_eq!(waiting("423"), "");
    }

    /// A drop of oil in water that moves along x between two walls.
    pub(crate) const DROP: &str = r#"
[bodies.box]
dimension = 2
spacing = 1e-3
shape.box = { min = [0, 0, 0], max = [0.02, 0.02, 1e-3] }
material = "water"
materials = { drop = "oil" }
regions.drop.cylinder = { start = [0.01, 0.01, 0], end = [0.01, 0.01, 1e-3], radius = 5e-3 }
initial.velocity = ["0.01", "0", "0"]
periodic = ["x"]

[materials.oil]
density = 900
viscosity = 0.05

[materials.water]
density = 1000
viscosity = 0.01

[[physics]]
type = "fluid"
description = "eulerian"
form = "conservative"
state.incompressible = {}
fluids = ["oil", "water"]
interface = { surface_tension = 0.03 }

[[couplers]]
type = "wall"
faces = ["y-", "y+"]
kind = "slip"

[time]
end = 1e-3
"#;

    #[test]
    fn contact_angles_in_radians_are_suspected() {
        let told = |angle: &str| {
            let wall = format!("kind = \"slip\"\ncontact_angle = {angle}");
            let found = warnings_of(&DROP.replace("kind = \"slip\"", &wall));
            found.iter().any(|w| w.contains("`contact_angle` is"))
        };
        for (angle, is_suspected) in [("1.047", true), ("3.1", true), ("0", false), ("60", false)] {
            assert_eq!(told(angle), is_suspected, "{angle}");
        }
    }
}
