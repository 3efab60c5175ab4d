//! The names, units and allowed values of material properties.
//!
//! A plugin registers additional properties where it defines them:
//!
//! ```
//! use perimelt_core::material::{PropertyKey, ValueRange};
//!
//! inventory::submit! {
//!     PropertyKey {
//!         name: "moisture_diffusivity",
//!         unit: "m²/s",
//!         meaning: "diffusivity of moisture",
//!         range: ValueRange::Positive,
//!         has_directions: false,
//!     }
//! }
//! ```

use std::fmt;

use crate::named::{HasName, by_name};
use crate::register_property;

/// One property that a material may have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PropertyKey {
    /// Name in case files.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Meaning, in one line.
    pub meaning: &'static str,
    /// Values it may take.
    pub range: ValueRange,
    /// Whether it may differ along the axes of the material ([`Directional`](super::Directional)).
    pub has_directions: bool,
}

inventory::collect!(PropertyKey);

impl HasName for PropertyKey {
    fn name(&self) -> &'static str {
        self.name
    }
}

/// Values that a property may take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ValueRange {
    /// Any finite number.
    Any,
    /// Above zero.
    Positive,
    /// Zero or above.
    NotNegative,
    /// From the first to the second number, both allowed.
    Between(f64, f64),
}

impl ValueRange {
    /// Whether `value` is finite and allowed.
    pub fn allows(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Self::Any => true,
                Self::Positive => value > 0.0,
                Self::NotNegative => value >= 0.0,
                Self::Between(low, high) => (low..=high).contains(&value),
            }
    }
}

impl fmt::Display for ValueRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Any => write!(f, "a finite number"),
            Self::Positive => write!(f, "above 0"),
            Self::NotNegative => write!(f, "0 or above"),
            Self::Between(low, high) => write!(f, "from {low} to {high}"),
        }
    }
}

/// All properties, by name.
pub fn known_properties() -> Vec<&'static PropertyKey> {
    by_name(|key| key)
}

/// The property called `name`.
pub fn find_property(name: &str) -> Option<&'static PropertyKey> {
    inventory::iter::<PropertyKey>
        .into_iter()
        .find(|key| key.name == name)
}

/// The candidate that is most similar to `name`, if one is similar.
pub(crate) fn nearest_name<'a>(
    name: &str,
    candidates: impl Iterator<Item = &'a str>,
) -> Option<String> {
    // below 0.4 unrelated names match: `foo` would suggest `solidus`
    const LEAST_SIMILARITY: f64 = 0.4;
    let name = name.to_lowercase();
    candidates
        .map(|candidate| {
            (
                strsim::normalized_damerau_levenshtein(&name, candidate),
                candidate,
            )
        })
        .filter(|(similarity, _)| *similarity >= LEAST_SIMILARITY)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate.to_owned())
}

// the properties that several plugins use

register_property!(
    "density",
    "kg/m³",
    "mass per volume at the reference state (heat conduction conserves mass and uses it at all temperatures)",
    ValueRange::Positive
);
register_property!(
    "specific_heat",
    "J/(kg K)",
    "heat capacity per mass at constant pressure, without latent heat",
    ValueRange::Positive
);
register_property!(
    "conductivity",
    "W/(m K)",
    "thermal conductivity",
    ValueRange::Positive,
    directional
);
register_property!(
    "powder_conductivity",
    "W/(m K)",
    "effective thermal conductivity as powder",
    ValueRange::Positive
);
register_property!(
    "solidus",
    "K",
    "temperature at which melting starts",
    ValueRange::Positive
);
register_property!(
    "liquidus",
    "K",
    "temperature at which melting ends",
    ValueRange::Positive
);
register_property!(
    "latent_heat",
    "J/kg",
    "heat of fusion per mass, from solidus to liquidus",
    ValueRange::NotNegative
);
register_property!(
    "boiling_temperature",
    "K",
    "temperature of vaporisation at atmospheric pressure",
    ValueRange::Positive
);
register_property!(
    "vaporisation_heat",
    "J/kg",
    "heat of vaporisation per mass",
    ValueRange::Positive
);
register_property!(
    "molar_mass",
    "kg/mol",
    "mass per amount of substance of the vapour",
    ValueRange::Positive
);
register_property!(
    "youngs_modulus",
    "Pa",
    "Young's modulus",
    ValueRange::Positive
);
register_property!(
    "poissons_ratio",
    "1",
    "Poisson's ratio",
    ValueRange::Between(-1.0, 0.5)
);
register_property!(
    "thermal_expansion",
    "1/K",
    "mean (secant) coefficient of linear thermal expansion from `expansion_reference`",
    ValueRange::Any,
    directional
);
register_property!(
    "expansion_reference",
    "K",
    "temperature from which the mean coefficients of `thermal_expansion` count; a constant coefficient needs none",
    ValueRange::Positive
);
register_property!(
    "instantaneous_expansion",
    "1/K",
    "instantaneous (tangent) coefficient of linear thermal expansion, in place of `thermal_expansion`",
    ValueRange::Any,
    directional
);
register_property!(
    "thermal_elongation",
    "1",
    "table of the thermal elongation, relative to the length at any one temperature, in place of `thermal_expansion`",
    ValueRange::Any,
    directional
);
register_property!("yield_stress", "Pa", "yield stress", ValueRange::Positive);
register_property!(
    "hardening_modulus",
    "Pa",
    "rise of the flow stress per equivalent plastic strain",
    ValueRange::NotNegative
);
register_property!(
    "fracture_energy",
    "J/m²",
    "fracture energy per crack area (critical energy release rate)",
    ValueRange::Positive
);
register_property!(
    "critical_stretch",
    "1",
    "critical stretch of bonds, instead of that from `fracture_energy`",
    ValueRange::Positive
);
register_property!(
    "emissivity",
    "1",
    "total hemispherical emissivity of the surface",
    ValueRange::Between(0.0, 1.0)
);
register_property!(
    "absorptivity",
    "1",
    "absorbed fraction of a laser beam (wavelength near 1 µm)",
    ValueRange::Between(0.0, 1.0)
);
register_property!(
    "viscosity",
    "Pa s",
    "dynamic viscosity of the liquid",
    ValueRange::Positive
);
register_property!(
    "liquid_expansion",
    "1/K",
    "coefficient of the volume expansion of the liquid, which drives melt flow by buoyancy",
    ValueRange::Any
);
register_property!(
    "surface_tension",
    "N/m",
    "surface tension of the liquid against its gas",
    ValueRange::NotNegative
);

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    inventory::submit! {
        PropertyKey {
            name: "moisture_diffusivity",
            unit: "m²/s",
            meaning: "diffusivity of moisture (for this test)",
            range: ValueRange::Positive,
            has_directions: false,
        }
    }

    #[test]
    fn a_registered_property_is_known_beside_the_common_ones() {
        assert!(find_property("moisture_diffusivity").is_some());
        assert!(find_property("conductivity").is_some());
        assert!(find_property("colour").is_none());
    }

    #[test]
    fn names_are_unique() {
        let known = known_properties();
        let names: BTreeSet<_> = known.iter().map(|key| key.name).collect();
        assert_eq!(names.len(), known.len());
    }

    #[test]
    fn nearest_name_finds_slips_and_stays_silent_on_nonsense() {
        let known = known_properties();
        let nearest = |name| nearest_name(name, known.iter().map(|key| key.name));
        assert_eq!(nearest("conductivty").as_deref(), Some("conductivity"));
        assert_eq!(nearest("Youngs_Modulus").as_deref(), Some("youngs_modulus"));
        assert_eq!(nearest("qqq"), None);
    }

    #[test]
    fn ranges_keep_their_ends() {
        assert!(!ValueRange::Positive.allows(0.0));
        assert!(ValueRange::NotNegative.allows(0.0));
        assert!(ValueRange::Between(-1.0, 0.5).allows(0.5));
        assert!(!ValueRange::Between(0.0, 1.0).allows(1.01));
        assert!(!ValueRange::Any.allows(f64::NAN));
    }
}
