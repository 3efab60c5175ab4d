//! Materials: named sets of properties, each constant or a function of temperature and phase.
//!
//! - [`Table`]: a value at rows of increasing temperature (or time), piecewise linear, clamped;
//! - [`Property`]: a number, a table, or one of these for each of solid and liquid;
//! - [`Directional`]: a property in all directions alike, or one along each axis of the material;
//! - [`PropertyKey`], [`known_properties`]: which properties there are, with units and allowed
//!   values; a plugin may register more;
//! - [`MaterialSection`]: how a case file or a library file writes a material, with its mistakes
//!   reported where they are;
//! - [`Material`]: the checked set that physics and couplers read;
//! - [`EnthalpyCurve`]: heat content against temperature with melting, and back;
//! - [`Expansion`]: the thermal strain between two states;
//! - [`HeatPotential`]: the integral of the conductivity over the temperature.

mod directional;
mod enthalpy;
mod expansion;
mod mixture;
mod potential;
mod property;
mod section;
mod table;
mod values;
mod vocabulary;

#[cfg(test)]
mod library_files;

pub use directional::Directional;
pub use enthalpy::{
    EnthalpyCurve, EnthalpyError, LatentHeat, LatentHeatForm, MushyCapacity, REFERENCE_TEMPERATURE,
};
pub use expansion::{Expansion, ExpansionError, KINDS as EXPANSION_KINDS, ThermalState};
pub use mixture::{in_series, mixed_conductivity};
pub use potential::HeatPotential;
pub use property::Property;
pub use section::MaterialSection;
pub use table::{Table, TableError};
pub use vocabulary::{PropertyKey, ValueRange, find_property, known_properties};

use crate::explanation::Explanation;
use std::collections::BTreeMap;

use thiserror::Error;

/// A named set of properties, checked against the vocabulary.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    name: String,
    description: Option<String>,
    properties: BTreeMap<String, Directional<Property>>,
}

/// What is wrong with a material.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MaterialError {
    /// No property has this name.
    #[error("unknown material property `{property}`")]
    UnknownProperty {
        /// Name as written.
        property: String,
        /// Nearest valid name.
        nearest: Option<String>,
    },
    /// A value outside the range of its property.
    #[error("`{property}` must be {range} [{unit}], but is {value}")]
    OutOfRange {
        /// Name of the property.
        property: &'static str,
        /// The offending value.
        value: f64,
        /// Allowed values.
        range: ValueRange,
        /// Unit of the property.
        unit: &'static str,
    },
    /// A temperature at which the state of matter changes lies below one that precedes it.
    #[error("material `{material}`: the {upper} ({above} K) lies below the {lower} ({below} K)")]
    TemperaturesOutOfOrder {
        /// Name of the material.
        material: String,
        /// The temperature that precedes, in words.
        lower: String,
        /// Its value, K.
        below: f64,
        /// The one that follows.
        upper: String,
        /// Its value, K.
        above: f64,
    },
    /// A property that a plugin needs is not given.
    #[error("material `{material}` has no `{property}`{}", described(.property))]
    Missing {
        /// Name of the material.
        material: String,
        /// Name of the property.
        property: String,
    },
    /// A property must be a single number.
    #[error("material `{material}`: `{property}` must be one number, not a table or one per phase")]
    NotConstant {
        /// Name of the material.
        material: String,
        /// Name of the property.
        property: String,
    },
    /// A property must be the same in all directions.
    #[error(
        "material `{material}`: `{property}` must be the same in all directions here, without `along`, `across` or `axes`"
    )]
    HasDirections {
        /// Name of the material.
        material: String,
        /// Name of the property.
        property: String,
    },
    /// The properties give no thermal expansion.
    #[error("material `{material}`: {source}")]
    Expansion {
        /// Name of the material.
        material: String,
        /// Why.
        source: ExpansionError,
    },
    /// The properties give no enthalpy curve.
    #[error("material `{material}`: {source}")]
    Enthalpy {
        /// Name of the material.
        material: String,
        /// Why.
        source: EnthalpyError,
    },
}

impl MaterialError {
    /// The mistake in words.
    pub fn explain(&self) -> Explanation {
        let mut explanation = Explanation::new(self.to_string());
        match self {
            MaterialError::UnknownProperty {
                nearest: Some(nearest),
                ..
            } => {
                explanation.expected = format!("did you mean `{nearest}`?");
                explanation
            }
            MaterialError::UnknownProperty { nearest: None, .. } => {
                let names: Vec<_> = known_properties().iter().map(|key| key.name).collect();
                explanation.help(format!("the known ones are {}", names.join(", ")))
            }
            _ => explanation,
        }
    }
}

fn described(property: &str) -> String {
    find_property(property).map_or_else(String::new, |key| format!(" [{}]", key.unit))
}

impl Material {
    /// Builds a material from its section, starting from `library` where the section names one.
    ///
    /// Keys of the section replace those of the library entry. A thermal expansion of the section replaces that of the
    /// library entry as a whole, with its kind and its reference temperature.
    ///
    /// # Errors
    /// An unknown property, a value out of its range, a liquidus below the solidus or above the boiling temperature, or contradictory thermal expansions.
    pub fn new(
        name: impl Into<String>,
        section: MaterialSection,
        library: Option<&Material>,
    ) -> Result<Self, MaterialError> {
        let mut material = Self {
            name: name.into(),
            description: section
                .description
                .or_else(|| library.and_then(|entry| entry.description.clone())),
            properties: library.map_or_else(BTreeMap::new, |entry| entry.properties.clone()),
        };
        let states_expansion = |name: &str| section.properties.contains_key(name);
        if EXPANSION_KINDS.into_iter().any(states_expansion) {
            let old = EXPANSION_KINDS.into_iter().chain([expansion::REFERENCE]);
            old.for_each(|name| drop(material.properties.remove(name)));
        }
        for (property, value) in section.properties {
            check_range(known(&property)?, &value)?;
            material.properties.insert(property, value);
        }
        material.check_order()?;
        Expansion::of(&material)?;
        Ok(material)
    }

    /// Checks that temperatures at which the state of matter changes ascend.
    fn check_order(&self) -> Result<(), MaterialError> {
        let names = ["solidus", "liquidus", "boiling_temperature"];
        let given = names.map(|name| self.constant(name).ok().map(|at| (name, at)));
        let given: Vec<(&str, f64)> = given.into_iter().flatten().collect();
        let wrong = given.windows(2).find(|pair| pair[1].1 < pair[0].1);
        let error = |pair: &[(&str, f64)]| MaterialError::TemperaturesOutOfOrder {
            material: self.name.clone(),
            lower: pair[0].0.replace('_', " "),
            below: pair[0].1,
            upper: pair[1].0.replace('_', " "),
            above: pair[1].1,
        };
        wrong.map_or(Ok(()), |pair| Err(error(pair)))
    }

    /// Name in the case file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What the material is, in a line.
    pub fn description(&self) -> Option<&str> {
        self.description.as_deref()
    }

    /// All properties by name.
    pub fn properties(&self) -> &BTreeMap<String, Directional<Property>> {
        &self.properties
    }

    /// The property called `property`, if it is given.
    pub fn directional(&self, property: &str) -> Option<&Directional<Property>> {
        self.properties.get(property)
    }

    /// The property called `property`, if it is given, and is the same in all directions.
    pub fn get(&self, property: &str) -> Option<&Property> {
        self.directional(property)?.same()
    }

    /// The property called `property`, if it is given.
    ///
    /// # Errors
    /// [`MaterialError::HasDirections`].
    pub fn same_in_all_directions(
        &self,
        property: &str,
    ) -> Result<Option<&Property>, MaterialError> {
        let directions = || MaterialError::HasDirections {
            material: self.name.clone(),
            property: property.to_owned(),
        };
        let found = self.directional(property);
        found
            .map(|given| given.same().ok_or_else(directions))
            .transpose()
    }

    /// The property called `property`.
    ///
    /// # Errors
    /// [`MaterialError::Missing`] or [`MaterialError::HasDirections`].
    pub fn require(&self, property: &str) -> Result<&Property, MaterialError> {
        let found = self.same_in_all_directions(property)?;
        found.ok_or_else(|| MaterialError::Missing {
            material: self.name.clone(),
            property: property.to_owned(),
        })
    }

    /// The property called `property`, which must be a single number.
    ///
    /// # Errors
    /// [`MaterialError::Missing`], [`MaterialError::HasDirections`] or [`MaterialError::NotConstant`].
    pub fn constant(&self, property: &str) -> Result<f64, MaterialError> {
        self.require(property)?
            .constant()
            .ok_or_else(|| MaterialError::NotConstant {
                material: self.name.clone(),
                property: property.to_owned(),
            })
    }

    /// Density (kg/m³) that fixes the mass of a point: its value at [`REFERENCE_TEMPERATURE`],
    /// of the liquid if the material is molten there.
    ///
    /// # Errors
    /// [`MaterialError::Missing`].
    pub fn reference_density(&self) -> Result<f64, MaterialError> {
        let molten = self
            .constant("liquidus")
            .is_ok_and(|liquidus| liquidus <= REFERENCE_TEMPERATURE);
        Ok(self
            .require("density")?
            .at(REFERENCE_TEMPERATURE, f64::from(u8::from(molten))))
    }

    /// Melting by `solidus`, `liquidus` and `latent_heat`.
    ///
    /// # Errors
    /// One of the three is missing or not a single number.
    pub fn latent_heat(
        &self,
        mushy_capacity: MushyCapacity,
        form: LatentHeatForm,
    ) -> Result<LatentHeat, MaterialError> {
        Ok(LatentHeat {
            solidus: self.constant("solidus")?,
            liquidus: self.constant("liquidus")?,
            latent_heat: self.constant("latent_heat")?,
            mushy_capacity,
            form,
        })
    }

    /// Enthalpy against temperature, from `specific_heat`, the reference density and `latent`.
    ///
    /// # Errors
    /// A missing property, or [`MaterialError::Enthalpy`].
    pub fn enthalpy_curve(
        &self,
        latent: Option<LatentHeat>,
    ) -> Result<EnthalpyCurve, MaterialError> {
        EnthalpyCurve::new(
            self.reference_density()?,
            self.require("specific_heat")?,
            latent,
        )
        .map_err(|source| MaterialError::Enthalpy {
            material: self.name.clone(),
            source,
        })
    }
}

/// The key of a property name.
pub(crate) fn known(property: &str) -> Result<&'static PropertyKey, MaterialError> {
    find_property(property).ok_or_else(|| MaterialError::UnknownProperty {
        property: property.to_owned(),
        nearest: vocabulary::nearest_name(
            property,
            known_properties()
                .iter()
                .map(|key| key.name)
                .chain(section::OTHER_KEYS),
        ),
    })
}

/// Checks every number of a property.
pub(crate) fn check_range(
    key: &'static PropertyKey,
    property: &Directional<Property>,
) -> Result<(), MaterialError> {
    let values = property.values().iter().flat_map(Property::values);
    match values.into_iter().find(|&value| !key.range.allows(value)) {
        Some(value) => Err(MaterialError::OutOfRange {
            property: key.name,
            value,
            range: key.range,
            unit: key.unit,
        }),
        None => Ok(()),
    }
}
