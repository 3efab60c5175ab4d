//! Tables of material properties over temperature that a run leaves: beyond the first and the last row their end values hold.

use perimelt_core::material::{Material, Property};

use crate::unit;

/// Temperatures (K) by which a run may go beyond the last row of a table, and below the first, without notice: many tables
/// begin at 100 °C.
const BEYOND: f64 = 30.0;
const BELOW: f64 = 100.0;

/// Properties of the solid only, which have no meaning in the melt.
const OF_SOLID: [&str; 12] = [
    "youngs_modulus",
    "poissons_ratio",
    "yield_stress",
    "hardening_modulus",
    "thermal_expansion",
    "youngs_modulus_1",
    "youngs_modulus_2",
    "youngs_modulus_3",
    "poissons_ratio_12",
    "shear_modulus_12",
    "shear_modulus_13",
    "shear_modulus_23",
];

/// Properties of the liquid only.
const OF_LIQUID: [&str; 3] = ["viscosity", "surface_tension", "liquid_expansion"];

/// A table that a run left.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftTable {
    /// Name of the material.
    pub material: String,
    /// Name of the property, with the phase: `conductivity.solid`.
    pub property: String,
    /// First and last temperature of the table, K.
    pub rows: [f64; 2],
}

/// The tables of materials that a run between two temperatures (K) left, of the properties that a body with these fields
/// uses.
pub fn left_by(
    materials: &[Material],
    has_field: impl Fn(&str) -> bool,
    range: [f64; 2],
) -> Vec<LeftTable> {
    let is_used = |property: &str| match property {
        "specific_heat" | "conductivity" | "emissivity" => true,
        _ if OF_SOLID.contains(&property) => has_field("displacement"),
        _ if OF_LIQUID.contains(&property) => has_field("pressure") || has_field("melt_velocity"),
        _ => false,
    };
    let mut found = Vec::new();
    for material in materials {
        let constant = |name: &str| material.constant(name).ok();
        // what does not melt has properties of the solid and of the liquid at all temperatures
        let solidus = constant("solidus");
        let (solidus, liquid_from) = (solidus.unwrap_or(f64::INFINITY), solidus.unwrap_or(0.0));
        let properties = material.properties().iter();
        let used = properties.filter(|(name, _)| is_used(name));
        let used = used.flat_map(|(name, given)| given.values().iter().map(move |p| (name, p)));
        for (name, property) in used {
            let parts = match property {
                Property::ByPhase { solid, liquid } => vec![
                    // in the interval of melting its end stands for it
                    (format!("{name}.solid"), &**solid, [0.0, solidus]),
                    (
                        format!("{name}.liquid"),
                        &**liquid,
                        [liquid_from, f64::INFINITY],
                    ),
                ],
                plain if OF_SOLID.contains(&name.as_str()) => {
                    vec![(name.clone(), plain, [0.0, solidus])]
                }
                plain if OF_LIQUID.contains(&name.as_str()) => {
                    vec![(name.clone(), plain, [liquid_from, f64::INFINITY])]
                }
                plain => vec![(name.clone(), plain, [0.0, f64::INFINITY])],
            };
            for (property, table, [from, to]) in parts {
                let Property::Table(table) = table else {
                    continue;
                };
                let (first, last) = table.range();
                let (low, high) = (range[0].max(from), range[1].min(to));
                let leaves = high > last + BEYOND || low < first - BELOW;
                if first < last && low <= high && leaves {
                    found.push(LeftTable {
                        material: material.name().into(),
                        property,
                        rows: [first, last],
                    });
                }
            }
        }
    }
    found
}

/// A sentence about the tables that a run between two temperatures (K) left, if any.
pub fn sentence(left: &[LeftTable], [low, high]: [f64; 2]) -> Option<String> {
    let number = |t: f64| unit::number(t, 5);
    let tables: Vec<String> = left
        .iter()
        .map(|t| {
            let [first, last] = t.rows.map(number);
            format!("`{}` of `{}` ({first} to {last} K)", t.property, t.material)
        })
        .collect();
    let [low, high] = [low, high].map(number);
    (!left.is_empty()).then(|| {
        format!(
            "temperatures from {low} to {high} K are partly outside the tables of {}, which are constant beyond their ends",
            tables.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use perimelt_core::material::MaterialSection;

    use super::*;

    fn steel() -> Material {
        let section: MaterialSection = toml::from_str(
            "solidus = 1700\nliquidus = 1750\ndensity = 8000\n\
             conductivity = { solid = { temperature = [300, 1500], value = [50, 30] }, \
             liquid = { temperature = [1750, 2000], value = [30, 35] } }\n\
             youngs_modulus = { temperature = [300, 1680], value = [2e11, 1e10] }\n\
             specific_heat = 600",
        )
        .expect("a material");
        Material::new("steel", section, None).expect("valid")
    }

    #[test]
    fn a_run_beyond_the_rows_of_a_table_is_found_by_phase() {
        let left = |range: [f64; 2], fields: &[&str]| {
            let found = left_by(&[steel()], |f| fields.contains(&f), range);
            let properties: Vec<String> = found.into_iter().map(|t| t.property).collect();
            properties.join(" ")
        };
        let solid = ["displacement"];
        for (range, expected) in [
            ([293.0, 1400.0], ""),
            ([293.0, 1520.0], ""),
            ([150.0, 1400.0], "conductivity.solid youngs_modulus"),
            ([293.0, 1600.0], "conductivity.solid"),
            // melting does not leave the table of the stiffness, which ends near the solidus
            ([293.0, 1900.0], "conductivity.solid"),
            ([293.0, 2500.0], "conductivity.liquid conductivity.solid"),
        ] {
            let mut found: Vec<_> = left(range, &solid).split(' ').map(String::from).collect();
            found.sort();
            assert_eq!(found.join(" "), expected, "{range:?}");
        }
        assert_eq!(left([150.0, 1400.0], &[]), "conductivity.solid");
    }

    #[test]
    fn the_sentence_names_the_tables_with_their_ends() {
        let range = [293.0, 1650.0];
        let left = left_by(&[steel()], |_| false, range);
        let told = sentence(&left, range).expect("one table");
        assert!(
            told.contains("`conductivity.solid` of `steel` (300 to 1500 K)"),
            "{told}"
        );
        assert_eq!(sentence(&[], range), None);
    }
}
