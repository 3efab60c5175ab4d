//! Thermal expansion of a material: the strain between two states, from one of three kinds of data.
//!
//! | property | what it is | strain from state 1 to state 2 |
//! |---|---|---|
//! | `thermal_expansion` | mean (secant) coefficient alpha from the temperature T_0, `expansion_reference` | `alpha(T_2) (T_2 - T_0) - alpha(T_1) (T_1 - T_0)` |
//! | `instantaneous_expansion` | instantaneous (tangent) coefficient a | integral of `a dT` from T_1 to T_2 |
//! | `thermal_elongation` | elongation e, relative to the length at any one temperature | `e(T_2) - e(T_1)` |
//!
//! A mean coefficient that does not depend on the temperature needs no T_0. Outside its rows a table of coefficients
//! keeps its end values, and a table of the elongation keeps the slope of its first or last rows.

use thiserror::Error;

use super::{Directional, Material, MaterialError, Property, Table};

/// Name of the property with the mean coefficient, 1/K.
pub const MEAN: &str = "thermal_expansion";
/// Name of the property with the instantaneous coefficient, 1/K.
pub const INSTANTANEOUS: &str = "instantaneous_expansion";
/// Name of the property with the elongation.
pub const ELONGATION: &str = "thermal_elongation";
/// Name of the property with the temperature from which mean coefficients count, K.
pub const REFERENCE: &str = "expansion_reference";

/// The properties that state an expansion; a material has one of them at most.
pub const KINDS: [&str; 3] = [MEAN, INSTANTANEOUS, ELONGATION];

/// What is wrong with the expansion of a material.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ExpansionError {
    /// Two properties state the expansion.
    #[error("`{first}` and `{second}` both state the thermal expansion; give one of them")]
    TwoKinds {
        /// One property.
        first: &'static str,
        /// The other.
        second: &'static str,
    },
    /// A reference temperature without a mean coefficient.
    #[error(
        "`expansion_reference` belongs to the mean coefficient `thermal_expansion`, but the expansion is given by `{kind}`; leave it out"
    )]
    ReferenceWithoutMean {
        /// The property that states the expansion.
        kind: &'static str,
    },
    /// An elongation that is no function of the temperature.
    #[error(
        "`thermal_elongation` must be a table of two rows or more, or one for each phase: the elongation at each temperature, relative to the length at any one temperature; a coefficient is `thermal_expansion`"
    )]
    ElongationWithoutRows,
    /// An instantaneous coefficient for each phase, whose integral through the melting interval is not defined.
    #[error(
        "`instantaneous_expansion` must be one number or one table, not one for each phase; give `thermal_elongation` by phase instead"
    )]
    InstantaneousByPhase,
    /// Mean coefficients that count from an unknown temperature.
    #[error(
        "`thermal_expansion` is a table of mean coefficients, but the temperature from which they count is not given; add `expansion_reference` [K], often 293.15, or give `instantaneous_expansion`"
    )]
    NoReference,
}

/// Temperature (K) and liquid fraction of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThermalState {
    /// Temperature, K.
    pub temperature: f64,
    /// Liquid fraction, from 0 to 1.
    pub liquid_fraction: f64,
}

impl ThermalState {
    /// A solid at a temperature (K).
    pub fn solid(temperature: f64) -> Self {
        ThermalState {
            temperature,
            liquid_fraction: 0.0,
        }
    }
}

/// The thermal expansion of a material, in all directions or along one of its axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Expansion(Kind);

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    /// Mean coefficient (1/K) from a temperature (K).
    Mean {
        coefficient: Property,
        reference: Option<f64>,
    },
    /// Instantaneous coefficient, 1/K.
    Instantaneous(Table),
    /// Elongation by temperature and phase.
    Elongation(Property),
}

impl Expansion {
    /// The expansion that a material states, `None` if it states none; the expansion along each axis if the property has
    /// directions.
    ///
    /// # Errors
    /// See [`ExpansionError`]; a reference temperature that is a table.
    pub fn of(material: &Material) -> Result<Option<Directional<Self>>, MaterialError> {
        let failed = |source| MaterialError::Expansion {
            material: material.name().to_string(),
            source,
        };
        let mut given = KINDS
            .iter()
            .filter_map(|&kind| Some((kind, material.directional(kind)?)));
        let Some((kind, property)) = given.next() else {
            return Ok(None);
        };
        if let Some((second, _)) = given.next() {
            let first = kind;
            return Err(failed(ExpansionError::TwoKinds { first, second }));
        }
        let has_reference = material.get(REFERENCE).is_some();
        if has_reference && kind != MEAN {
            return Err(failed(ExpansionError::ReferenceWithoutMean { kind }));
        }
        let reference = match has_reference {
            true => Some(material.constant(REFERENCE)?),
            false => None,
        };
        let expansion = property.map(|property| Expansion::by(kind, property, reference));
        expansion.transpose().map(Some).map_err(failed)
    }

    /// The expansion by a property of a kind, with the temperature (K) from which mean coefficients count.
    fn by(kind: &str, property: &Property, reference: Option<f64>) -> Result<Self, ExpansionError> {
        Ok(Expansion(match kind {
            MEAN => Kind::Mean {
                coefficient: property.clone(),
                reference,
            },
            INSTANTANEOUS => Kind::Instantaneous(match property {
                Property::Constant(value) => {
                    Table::new(vec![0.0], vec![*value]).expect("one finite row")
                }
                Property::Table(table) => table.clone(),
                Property::ByPhase { .. } => return Err(ExpansionError::InstantaneousByPhase),
            }),
            _ => match has_rows(property) {
                true => Kind::Elongation(property.clone()),
                false => return Err(ExpansionError::ElongationWithoutRows),
            },
        }))
    }

    /// Whether the strain depends on the reference temperature of mean coefficients, which is not given.
    pub fn lacks_reference(&self) -> bool {
        matches!(&self.0, Kind::Mean { coefficient, reference: None } if varies(coefficient))
    }

    /// Lets mean coefficients count from `temperature` (K), unless the material gives a reference temperature.
    pub fn with_default_reference(mut self, temperature: f64) -> Self {
        if let Kind::Mean { reference, .. } = &mut self.0 {
            reference.get_or_insert(temperature);
        }
        self
    }

    /// Linear strain between two states.
    ///
    /// Without a reference temperature mean coefficients count from the temperature of the first state.
    pub fn strain(&self, from: ThermalState, to: ThermalState) -> f64 {
        match &self.0 {
            Kind::Mean {
                coefficient,
                reference,
            } => {
                if let Some(coefficient) = coefficient.constant() {
                    return coefficient * (to.temperature - from.temperature);
                }
                let reference = reference.unwrap_or(from.temperature);
                let elongation = |s: ThermalState| {
                    coefficient.at(s.temperature, s.liquid_fraction) * (s.temperature - reference)
                };
                elongation(to) - elongation(from)
            }
            Kind::Instantaneous(table) => table.integral(from.temperature, to.temperature),
            Kind::Elongation(property) => {
                let elongation = |s: ThermalState| mixture(property, s, Table::continued);
                elongation(to) - elongation(from)
            }
        }
    }

    /// Instantaneous coefficient (1/K) in a state, without the change of volume in melting.
    ///
    /// # Errors
    /// [`ExpansionError::NoReference`].
    pub fn instantaneous(&self, state: ThermalState) -> Result<f64, ExpansionError> {
        match &self.0 {
            Kind::Mean {
                coefficient,
                reference,
            } => {
                let mean = coefficient.at(state.temperature, state.liquid_fraction);
                let slope = mixture(coefficient, state, Table::slope);
                match reference {
                    _ if slope == 0.0 => Ok(mean),
                    Some(reference) => Ok(mean + slope * (state.temperature - reference)),
                    None => Err(ExpansionError::NoReference),
                }
            }
            Kind::Instantaneous(table) => Ok(table.at(state.temperature)),
            Kind::Elongation(property) => Ok(mixture(property, state, Table::continued_slope)),
        }
    }
}

/// Values of a function of the table of each phase, weighted by the liquid fraction; zero for a number.
fn mixture(property: &Property, state: ThermalState, of: fn(&Table, f64) -> f64) -> f64 {
    match property {
        Property::Constant(_) => 0.0,
        Property::Table(table) => of(table, state.temperature),
        Property::ByPhase { solid, liquid } => {
            let [solid, liquid] = [solid, liquid].map(|phase| mixture(phase, state, of));
            solid + state.liquid_fraction.clamp(0.0, 1.0) * (liquid - solid)
        }
    }
}

/// Whether a property of one phase changes with temperature.
fn varies(property: &Property) -> bool {
    match property {
        Property::Constant(_) => false,
        Property::Table(table) => table.values().windows(2).any(|pair| pair[0] != pair[1]),
        Property::ByPhase { solid, liquid } => varies(solid) || varies(liquid),
    }
}

/// Whether every phase has a table of two rows or more.
fn has_rows(property: &Property) -> bool {
    match property {
        Property::Constant(_) => false,
        Property::Table(table) => table.values().len() > 1,
        Property::ByPhase { solid, liquid } => has_rows(solid) && has_rows(liquid),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::MaterialSection;

    fn material(text: &str) -> Result<Material, MaterialError> {
        let section: MaterialSection = toml::from_str(text).expect("known keys");
        Material::new("steel", section, None)
    }

    fn expansion(text: &str) -> Expansion {
        let material = material(text).expect("valid");
        let expansion = Expansion::of(&material).expect("valid").expect("given");
        expansion.along(0).clone()
    }

    /// Each axis has an expansion of its own, of any kind.
    #[test]
    fn expansions_may_have_directions() {
        let table = "{ temperature = [200, 1300], value = [0.96e-5, 1.4e-5] }";
        let text = format!(
            "thermal_expansion = {{ along = -0.5e-6, across = {table} }}\nexpansion_reference = 300"
        );
        let material = material(&text).expect("valid");
        let expansion = Expansion::of(&material).expect("valid").expect("given");
        let [from, to] = [300.0, 500.0].map(ThermalState::solid);
        let strain = [0, 1, 2].map(|axis| expansion.along(axis).strain(from, to));
        let expected = [-1e-4, 2.16e-3, 2.16e-3];
        let pairs = strain.iter().zip(expected);
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-16));
    }

    /// `e = 1e-5 d + 4e-9 d^2` with `d = T - 300`, as mean coefficients, instantaneous coefficients and elongations; the first
    /// two are linear in the temperature, so that their tables are exact.
    const THREE_KINDS: [&str; 3] = [
        "thermal_expansion = { temperature = [200, 1300], value = [0.96e-5, 1.4e-5] }\nexpansion_reference = 300",
        "instantaneous_expansion = { temperature = [200, 1300], value = [0.92e-5, 1.8e-5] }",
        "thermal_elongation = { temperature = [200, 300, 500, 900, 1300], value = [-0.96e-3, 0, 2.16e-3, 7.44e-3, 14e-3] }",
    ];

    #[test]
    fn all_kinds_give_the_strain_between_any_two_temperatures() {
        let elongation = |t: f64| 1e-5 * (t - 300.0) + 4e-9 * (t - 300.0).powi(2);
        for text in THREE_KINDS {
            let expansion = expansion(text);
            for from in [200.0, 300.0, 500.0, 1300.0] {
                for to in [200.0, 500.0, 900.0] {
                    let found =
                        expansion.strain(ThermalState::solid(from), ThermalState::solid(to));
                    let expected = elongation(to) - elongation(from);
                    assert!(
                        (found - expected).abs() < 1e-16,
                        "{text}: {from} to {to}: {found}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_instantaneous_coefficient_is_the_derivative_of_the_strain() {
        for text in THREE_KINDS {
            let expansion = expansion(text);
            for temperature in [150.0, 400.0, 750.0, 1250.0, 1500.0] {
                let [low, high] = [-1e-3, 1e-3].map(|d| ThermalState::solid(temperature + d));
                let difference = expansion.strain(low, high) / 2e-3;
                let found = expansion.instantaneous(ThermalState::solid(temperature));
                let found = found.expect("the reference is given");
                // rounding of a strain of 1e-2 over 2e-3 K
                assert!(
                    (found / difference - 1.0).abs() < 1e-8,
                    "{text} at {temperature}"
                );
            }
        }
    }

    #[test]
    fn a_constant_coefficient_needs_no_reference() {
        for text in [
            "thermal_expansion = 1.2e-5",
            "thermal_expansion = 1.2e-5\nexpansion_reference = 273.15",
            "instantaneous_expansion = 1.2e-5",
        ] {
            let expansion = expansion(text);
            assert!(!expansion.lacks_reference());
            let strain = expansion.strain(ThermalState::solid(473.0), ThermalState::solid(873.0));
            assert!((strain - 4.8e-3).abs() < 1e-17, "{text}: {strain}");
            let coefficient = expansion.instantaneous(ThermalState::solid(500.0));
            assert_eq!(coefficient, Ok(1.2e-5));
        }
    }

    #[test]
    fn mean_coefficients_without_reference_are_told_apart() {
        let table = "thermal_expansion = { temperature = [300, 1300], value = [10e-6, 20e-6] }";
        let expansion = expansion(table);
        assert!(expansion.lacks_reference());
        let state = ThermalState::solid(800.0);
        assert_eq!(
            expansion.instantaneous(state),
            Err(ExpansionError::NoReference)
        );
        let given = expansion.with_default_reference(300.0);
        assert!(!given.lacks_reference());
        let coefficient = given.instantaneous(state).expect("given");
        assert!((coefficient - 20e-6).abs() < 1e-18);
    }

    #[test]
    fn elongation_by_phase_jumps_in_melting() {
        let expansion = expansion(
            "thermal_elongation.solid = { temperature = [300, 1300], value = [0, 0.02] }\nthermal_elongation.liquid = { temperature = [1300, 2300], value = [0.03, 0.06] }",
        );
        let state = |temperature, liquid_fraction| ThermalState {
            temperature,
            liquid_fraction,
        };
        for (to, expected) in [
            (state(1300.0, 0.0), 0.02),
            (state(1300.0, 0.5), 0.025),
            (state(1300.0, 1.0), 0.03),
            (state(2800.0, 1.0), 0.075),
        ] {
            let strain = expansion.strain(ThermalState::solid(300.0), to);
            assert!((strain - expected).abs() < 1e-16, "{to:?}: {strain}");
        }
    }

    #[test]
    fn contradictory_expansions_are_refused() {
        for (text, part) in [
            (
                "thermal_expansion = 1e-5\ninstantaneous_expansion = 1e-5",
                "both state the thermal expansion",
            ),
            (
                "instantaneous_expansion = 1e-5\nexpansion_reference = 300",
                "belongs to the mean coefficient",
            ),
            ("thermal_elongation = 0.01", "table of two rows or more"),
            (
                "thermal_elongation = { temperature = [300], value = [0] }",
                "table of two rows or more",
            ),
            (
                "instantaneous_expansion = { solid = 1e-5, liquid = 2e-5 }",
                "not one for each phase",
            ),
            (
                "thermal_expansion = 1e-5\nexpansion_reference = { temperature = [300, 400], value = [300, 400] }",
                "must be one number",
            ),
        ] {
            let error = material(text).expect_err(text).to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    /// Keys of a case replace the expansion of the library as a whole: a reference temperature belongs to its table.
    #[test]
    fn an_expansion_of_a_case_replaces_that_of_the_library() {
        let library = material(THREE_KINDS[0]).expect("valid");
        for (text, lacks_reference, strain) in [
            ("", false, 7.44e-3 - 2.16e-3),
            (
                "expansion_reference = 200",
                false,
                1.24e-5 * 700.0 - 1.08e-5 * 300.0,
            ),
            (
                "thermal_expansion = { temperature = [500, 900], value = [1e-5, 2e-5] }",
                true,
                2e-5 * 400.0,
            ),
            (
                "thermal_elongation = { temperature = [500, 900], value = [0, 1e-2] }",
                false,
                1e-2,
            ),
            ("instantaneous_expansion = 1e-5", false, 4e-3),
        ] {
            let section: MaterialSection = toml::from_str(text).expect("known keys");
            let plate = Material::new("plate", section, Some(&library)).expect("valid");
            let expansion = Expansion::of(&plate).expect("valid").expect("given");
            let expansion = expansion.along(0);
            assert_eq!(expansion.lacks_reference(), lacks_reference, "{text}");
            let found = expansion.strain(ThermalState::solid(500.0), ThermalState::solid(900.0));
            assert!((found - strain).abs() < 1e-16, "{text}: {found}");
        }
    }
}
