//! Surface tension of a melt against its gas, and how it changes with temperature.
//!
//! Its slope drives flow along surfaces (Marangoni): a negative one drives the melt from hot to cold, a positive one, as sulphur
//! causes it in steel, from cold to hot.
//!
//! Sahoo, DebRoy & McNallan (1988), iron with sulphur; docs/theory/melt_flow.md:
//!
//! ```text
//! gamma = 1.943 - 4.3e-4 (T - 1809) - R T G ln(1 + K a),    K = 3.18e-3 exp(1.66e5/(R T)),  G = 1.3e-5 mol/m²
//! ```
//!
//! with the activity `a` of sulphur in mass %.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::SetupError;
use crate::material::Property;
use crate::numbers::{check_finite, check_within};

/// How the surface tension depends on temperature.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SurfaceTension {
    /// The property `surface_tension` of the material.
    Material,
    /// Constant slope, N/(m K), such as -4.3e-4 for clean iron.
    Slope(f64),
    /// Steel with so much sulphur, mass %, such as 0.015 (Sahoo, DebRoy & McNallan (1988)).
    Sulphur(f64),
}

/// Gas constant, J/(mol K).
const GAS: f64 = 8.314;
/// Surface excess at saturation, mol/m².
const SATURATION: f64 = 1.3e-5;
/// Heat of adsorption, J/mol.
const ADSORPTION: f64 = 1.66e5;
/// Entropy factor of the adsorption.
const ENTROPY: f64 = 3.18e-3;
/// Slope of clean iron, N/(m K).
const CLEAN: f64 = -4.3e-4;

impl SurfaceTension {
    /// Refuses numbers outside of their ranges; blamed on `key`.
    ///
    /// # Errors
    /// A slope that is not finite, or sulphur of less than 0 or more than 1 mass %.
    pub fn check(&self, key: &str) -> Result<(), SetupError> {
        match *self {
            SurfaceTension::Material => Ok(()),
            SurfaceTension::Slope(slope) => check_finite(&format!("{key}.slope"), slope).map(drop),
            SurfaceTension::Sulphur(sulphur) => {
                check_within(&format!("{key}.sulphur"), sulphur, 0.0, 1.0).map(drop)
            }
        }
    }

    /// Derivative by the temperature at a temperature (K), N/(m K). `property` is the `surface_tension` of the material, which
    /// [`SurfaceTension::Material`] needs.
    pub fn slope(&self, property: Option<&Property>, temperature: f64) -> f64 {
        match *self {
            SurfaceTension::Material => property.map_or(0.0, |p| p.with_slope(temperature).1),
            SurfaceTension::Slope(slope) => slope,
            SurfaceTension::Sulphur(sulphur) => {
                let adsorbed = ENTROPY * (ADSORPTION / (GAS * temperature)).exp() * sulphur;
                CLEAN - GAS * SATURATION * adsorbed.ln_1p()
                    + adsorbed / (1.0 + adsorbed) * ADSORPTION * SATURATION / temperature
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Table;

    /// Values of the formula computed apart from this code, and the temperature at which the slope changes its sign.
    #[test]
    fn sulphur_turns_the_slope_round() {
        let slope =
            |sulphur, temperature| SurfaceTension::Sulphur(sulphur).slope(None, temperature);
        for (temperature, expected) in [(1809.0, 3.13e-4), (2000.0, 4.2e-5), (2200.0, -1.79e-4)] {
            let found = slope(0.015, temperature);
            assert!((found - expected).abs() < 1e-6, "{temperature}: {found}");
        }
        for (sulphur, zero) in [(0.002, 1734.5), (0.015, 2031.7), (0.03, 2152.5)] {
            assert!(slope(sulphur, zero - 0.1) > 0.0, "{sulphur}");
            assert!(slope(sulphur, zero + 0.1) < 0.0, "{sulphur}");
        }
        assert_eq!(slope(0.0, 2000.0), CLEAN);
    }

    #[test]
    fn a_table_has_the_slope_of_its_rows() {
        let table = Table::new(vec![1700.0, 2700.0], vec![1.8, 1.4]).expect("valid rows");
        let property = Property::Table(table);
        let slope = SurfaceTension::Material.slope(Some(&property), 2000.0);
        assert!((slope + 4e-4).abs() < 1e-15);
        assert_eq!(SurfaceTension::Slope(1e-4).slope(None, 300.0), 1e-4);
    }

    #[test]
    fn sulphur_beyond_the_formula_is_refused() {
        let error = SurfaceTension::Sulphur(20.0).check("surface.tension");
        let error = error.expect_err("out of range");
        assert_eq!(error.key, "surface.tension.sulphur");
    }
}
