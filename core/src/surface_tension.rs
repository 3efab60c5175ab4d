//! Surface tension, and how it changes with temperature.
//!
//! Its slope drives flow along surfaces by the stress `dgamma/dT grad_s T` (Marangoni): a negative one drives the melt from hot to cold, a positive one, as sulphur
//! causes it in steel, from cold to hot.
//!
//! Sahoo, DebRoy & McNallan (1988), iron with sulphur; docs/theory/melt_flow.md:
//!
//! ```text
//! gamma = 1.943 - 4.3e-4 (T - 1809) - R T G ln(1 + K a),    K = 3.18e-3 exp(1.66e5/(R T)),  G = 1.3e-5 mol/m²
//! ```
//!
//! with the activity `a` of sulphur in mass %.

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::SetupError;
use crate::material::Property;
use crate::numbers::{check_finite, check_within};

/// How the surface tension depends on temperature.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
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
/// Slope of clean iron, N/(m K), and its tension (N/m) at its melting temperature (K).
const CLEAN: f64 = -4.3e-4;
const CLEAN_TENSION: f64 = 1.943;
const MELTING: f64 = 1809.0;
/// Steels melt between these temperatures, K.
const STEEL: Range<f64> = 1550.0..1850.0;

/// A surface tension with what it takes from a material.
#[derive(Clone, Debug)]
pub struct TensionLaw {
    law: SurfaceTension,
    property: Property,
    /// Temperature at which the property is that of a constant slope, K.
    reference_temperature: f64,
}

impl SurfaceTension {
    /// The law of a material with this property `surface_tension`, which counts for [`SurfaceTension::Material`] only; that of the liquid, where it
    /// depends on the phase.
    pub fn with_property(self, property: Property) -> TensionLaw {
        TensionLaw {
            law: self,
            property: property.of_liquid().clone(),
            reference_temperature: 0.0,
        }
    }

    /// Whether it holds for a metal that melts at this temperature, K: the formula with sulphur is that of steel.
    pub fn holds_for(self, liquidus: f64) -> bool {
        !matches!(self, SurfaceTension::Sulphur(_)) || STEEL.contains(&liquidus)
    }

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
}

/// `K a` of the adsorption at a temperature (K).
fn adsorbed(sulphur: f64, temperature: f64) -> f64 {
    ENTROPY * (ADSORPTION / (GAS * temperature)).exp() * sulphur
}

impl TensionLaw {
    /// The same tension (N/m) at all temperatures.
    pub fn constant(tension: f64) -> Self {
        SurfaceTension::Material.with_property(Property::Constant(tension))
    }

    /// A tension (N/m) at a temperature (K) with a constant slope, N/(m K).
    pub fn linear(tension: f64, temperature: f64, slope: f64) -> Self {
        TensionLaw {
            law: SurfaceTension::Slope(slope),
            property: Property::Constant(tension),
            reference_temperature: temperature,
        }
    }

    /// Whether it is the same at all temperatures.
    pub fn is_constant(&self) -> bool {
        self.law == SurfaceTension::Material && self.property.is_constant()
    }

    /// A tension of its size, N/m.
    pub fn typical(&self) -> f64 {
        match self.law {
            SurfaceTension::Sulphur(_) => CLEAN_TENSION,
            _ => self.property.values().into_iter().fold(0.0, f64::max),
        }
    }

    /// At a temperature (K), N/m. Zero from the temperature on at which a law falls to it, as above a critical temperature.
    pub fn value(&self, temperature: f64) -> f64 {
        self.unbounded(temperature).max(0.0)
    }

    /// Whether the tension itself is known, not its slope alone.
    fn has_value(&self) -> bool {
        !matches!(self.law, SurfaceTension::Slope(_)) || self.reference_temperature > 0.0
    }

    fn unbounded(&self, temperature: f64) -> f64 {
        match self.law {
            SurfaceTension::Material => self.property.with_slope(temperature).0,
            SurfaceTension::Slope(slope) => {
                let (reference, _) = self.property.with_slope(self.reference_temperature);
                reference + slope * (temperature - self.reference_temperature)
            }
            SurfaceTension::Sulphur(sulphur) => {
                CLEAN_TENSION + CLEAN * (temperature - MELTING)
                    - GAS * temperature * SATURATION * adsorbed(sulphur, temperature).ln_1p()
            }
        }
    }

    /// Derivative by the temperature at a temperature (K), N/(m K).
    pub fn slope(&self, temperature: f64) -> f64 {
        if self.has_value() && self.unbounded(temperature) <= 0.0 {
            return 0.0;
        }
        match self.law {
            SurfaceTension::Material => self.property.with_slope(temperature).1,
            SurfaceTension::Slope(slope) => slope,
            SurfaceTension::Sulphur(sulphur) => {
                let adsorbed = adsorbed(sulphur, temperature);
                CLEAN - GAS * SATURATION * adsorbed.ln_1p()
                    + adsorbed / (1.0 + adsorbed) * ADSORPTION * SATURATION / temperature
            }
        }
    }

    /// Stress along a flat surface at a temperature (K) that changes along it (K/m), Pa.
    pub fn stress(&self, temperature: f64, gradient: f64) -> f64 {
        self.slope(temperature) * gradient
    }
}

/// Gradient along a flat surface (K/m) from the temperatures (K) of a point and of its neighbours on both sides at the distance
/// `spacing` (m): central, one-sided beside a wall, where there is no neighbour.
pub fn gradient_along(own: f64, neighbours: [Option<f64>; 2], spacing: f64) -> f64 {
    let mut difference = 0.0;
    let mut spacings = 0.0;
    for (neighbour, sign) in neighbours.into_iter().zip([-1.0, 1.0]) {
        if let Some(other) = neighbour {
            difference += sign * (other - own);
            spacings += 1.0;
        }
    }
    match spacings > 0.0 {
        true => difference / (spacings * spacing),
        false => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Table;

    /// Values of the formula computed apart from this code, and the temperature at which the slope changes its sign.
    #[test]
    fn sulphur_turns_the_slope_round() {
        let with =
            |sulphur| SurfaceTension::Sulphur(sulphur).with_property(Property::Constant(0.0));
        let slope = |sulphur, temperature| with(sulphur).slope(temperature);
        for (temperature, expected) in [(1809.0, 3.13e-4), (2000.0, 4.2e-5), (2200.0, -1.79e-4)] {
            let found = slope(0.015, temperature);
            assert!((found - expected).abs() < 1e-6, "{temperature}: {found}");
        }
        for (sulphur, zero) in [(0.002, 1734.5), (0.015, 2031.7), (0.03, 2152.5)] {
            assert!(slope(sulphur, zero - 0.1) > 0.0, "{sulphur}");
            assert!(slope(sulphur, zero + 0.1) < 0.0, "{sulphur}");
        }
        assert_eq!(slope(0.0, 2000.0), CLEAN);
        assert!((with(0.0).value(1909.0) - 1.9).abs() < 1e-12);
    }

    #[test]
    fn a_tension_by_phase_is_that_of_the_liquid() {
        let table = || {
            let table = Table::new(vec![1700.0, 2700.0], vec![1.8, 1.4]);
            Box::new(Property::Table(table.expect("valid rows")))
        };
        let solid = Box::new(Property::Constant(2.0));
        let by_phase = Property::ByPhase {
            solid,
            liquid: table(),
        };
        let laws = [*table(), by_phase].map(|p| SurfaceTension::Material.with_property(p));
        let [plain, by_phase] = laws.map(|law| (law.value(2200.0), law.slope(2200.0)));
        assert_eq!(plain, by_phase);
        assert!(plain.1 < 0.0);
    }

    /// Their difference is the integral of the slope.
    #[test]
    fn values_agree_with_slopes() {
        let table = Table::new(vec![1700.0, 2700.0], vec![1.8, 1.4]).expect("valid rows");
        let constant = || Property::Constant(0.01);
        for (law, value) in [
            (
                SurfaceTension::Sulphur(0.015).with_property(constant()),
                None,
            ),
            (
                SurfaceTension::Material.with_property(Property::Table(table)),
                Some(1.6),
            ),
            (TensionLaw::linear(0.01, 2198.0, -0.002), Some(0.006)),
        ] {
            let (t, dt) = (2200.0, 1.0);
            let change = law.value(t + dt) - law.value(t - dt);
            let error = change / (2.0 * dt) - law.slope(t);
            assert!(error.abs() < 1e-9, "{law:?}: {error}");
            if let Some(value) = value {
                assert!((law.value(t) - value).abs() < 1e-12, "{law:?}");
            }
        }
    }

    #[test]
    fn gradients_beside_walls_are_one_sided() {
        for (neighbours, expected) in [
            ([Some(1.0), Some(4.0)], 0.75),
            ([None, Some(4.0)], 1.0),
            ([Some(1.0), None], 0.5),
            ([None, None], 0.0),
        ] {
            assert_eq!(gradient_along(2.0, neighbours, 2.0), expected);
        }
    }

    #[test]
    fn a_table_has_the_slope_of_its_rows() {
        let table = Table::new(vec![1700.0, 2700.0], vec![1.8, 1.4]).expect("valid rows");
        let property = Property::Table(table);
        let material = SurfaceTension::Material.with_property(property);
        assert!((material.slope(2000.0) + 4e-4).abs() < 1e-15);
        assert!((material.stress(2000.0, 5.0) + 2e-3).abs() < 1e-14);
        let slope = SurfaceTension::Slope(1e-4).with_property(Property::Constant(0.0));
        assert_eq!(slope.slope(300.0), 1e-4);
        assert!(!material.is_constant() && !slope.is_constant());
        assert!(TensionLaw::constant(0.07).is_constant());
    }

    #[test]
    fn sulphur_beyond_the_formula_is_refused() {
        let error = SurfaceTension::Sulphur(20.0).check("surface.tension");
        let error = error.expect_err("out of range");
        assert_eq!(error.key, "surface.tension.sulphur");
    }
}
