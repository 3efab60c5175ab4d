//! Every file of the material library can be parsed, and its values are within plausible ranges.

use std::fs;
use std::path::Path;

use super::*;

/// Files of `cases/materials`, by name.
fn library() -> Vec<Material> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../cases/materials");
    let mut files: Vec<_> = fs::read_dir(folder)
        .expect("the library folder exists")
        .map(|entry| entry.expect("readable").path())
        .filter(|path| {
            path.extension()
                .is_some_and(|extension| extension == "toml")
        })
        .collect();
    files.sort();
    files
        .iter()
        .map(|path| {
            let name = path
                .file_stem()
                .expect("a file has a name")
                .to_string_lossy();
            let text = fs::read_to_string(path).expect("readable");
            let section: MaterialSection =
                toml::from_str(&text).unwrap_or_else(|error| panic!("{name}: {error}"));
            Material::new(name, section, None).unwrap_or_else(|error| panic!("{error}"))
        })
        .collect()
}

/// Registrations of a physics, which this crate does not depend on.
macro_rules! contents {
    ($($element:literal)*) => {
        $(inventory::submit! {
            PropertyKey {
                name: $element,
                unit: "mass %",
                meaning: "content of an element",
                range: ValueRange::NotNegative,
                has_directions: false,
            }
        })*
    };
}

contents! { "carbon" "manganese" "silicon" }

#[test]
fn every_entry_has_what_heat_conduction_with_melting_needs() {
    let materials = library();
    assert!(materials.len() >= 9);
    for material in &materials {
        assert!(material.description().is_some(), "{}", material.name());
        for property in [
            "density",
            "specific_heat",
            "conductivity",
            "solidus",
            "liquidus",
            "latent_heat",
        ] {
            material
                .require(property)
                .unwrap_or_else(|error| panic!("{error}"));
        }
    }
}

#[test]
fn every_entry_has_an_increasing_enthalpy_that_inverts() {
    for material in library() {
        let latent = material
            .latent_heat(MushyCapacity::LatentPlusSensible, LatentHeatForm::Enthalpy)
            .unwrap_or_else(|error| panic!("{error}"));
        assert!(latent.solidus <= latent.liquidus, "{}", material.name());
        let curve = material
            .enthalpy_curve(Some(latent))
            .unwrap_or_else(|error| panic!("{error}"));
        let mut last = f64::NEG_INFINITY;
        for temperature in (50..6000).map(f64::from) {
            let enthalpy = curve.enthalpy(temperature);
            assert!(enthalpy > last, "{} at {temperature} K", material.name());
            // rounding of h, up to 4e10 J/m³, over capacities of at least 1.5e6
            assert!((curve.temperature(enthalpy) - temperature).abs() < 1e-10);
            last = enthalpy;
        }
    }
}

#[test]
fn every_property_stays_within_what_such_materials_have() {
    // widest spans over the library, to catch a slipped power of ten or a column in celsius
    let spans = [
        ("density", 900.0, 9000.0),
        ("specific_heat", 300.0, 5200.0),
        ("conductivity", 0.5, 250.0),
        ("solidus", 273.0, 2000.0),
        ("liquidus", 273.0, 2000.0),
        ("latent_heat", 1.9e5, 5.6e5),
        ("boiling_temperature", 373.0, 3700.0),
        ("vaporisation_heat", 2e6, 1.1e7),
        ("molar_mass", 0.018, 0.06),
        ("youngs_modulus", 1e8, 2.2e11),
        ("poissons_ratio", 0.25, 0.5),
        ("thermal_expansion", 3e-6, 6e-5),
        ("expansion_reference", 273.15, 298.15),
        ("yield_stress", 1e5, 1.3e9),
        ("emissivity", 0.05, 0.97),
        ("absorptivity", 0.04, 0.7),
        ("viscosity", 1e-4, 1e-2),
        ("surface_tension", 0.05, 2.0),
        ("carbon", 0.01, 1.0),
        ("manganese", 0.1, 2.0),
        ("silicon", 0.05, 2.0),
    ];
    for material in library() {
        for (name, property) in material.properties() {
            let (_, low, high) = spans
                .iter()
                .find(|(span, ..)| span == name)
                .unwrap_or_else(|| panic!("no span for {name}"));
            for value in property.values().iter().flat_map(Property::values) {
                assert!(
                    (*low..=*high).contains(&value),
                    "{}: {name} = {value}",
                    material.name()
                );
            }
        }
    }
}
