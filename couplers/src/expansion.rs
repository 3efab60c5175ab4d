//! Thermal expansion: temperature gives every point an isotropic stress-free strain
//!
//! ```text
//! eigenstrain += alpha(T) (T - T_ref)
//! ```
//!
//! with the mean (secant) coefficient alpha from the stress-free temperature T_ref. A bond of a
//! bond-based solid then sees the mean of its ends, alpha (theta + theta')/2 (Wang (2025),
//! eq. 7.5). A table of alpha must have been measured from the same T_ref, as handbooks state
//! it; one for another reference is not converted.
//!
//! Not for a change of the stress-free state on melting: strain that is relieved in the melt
//! needs a plastic or viscous solid.

use perimelt_core::material::Property;
use perimelt_core::{
    Coupler, Read, ReadIfProvided, RunError, Setup, SetupError, Step, World, Write, keys,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Strain from temperature; needs the material property `thermal_expansion`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThermalExpansion {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Temperature at which the body is free of stress (K).
    pub reference_temperature: f64,
    #[serde(skip)]
    #[schemars(skip)]
    prepared: Option<Prepared>,
}

#[derive(Debug)]
struct Prepared {
    body: usize,
    expansion: Vec<Property>,
    temperature: Read<f64>,
    liquid_fraction: ReadIfProvided<f64>,
    eigenstrain: Write<f64>,
}

/// `alpha(T) (T - T_ref)`, for temperatures in K.
pub fn thermal_strain(
    expansion: &Property,
    temperature: f64,
    liquid_fraction: f64,
    reference_temperature: f64,
) -> f64 {
    expansion.at(temperature, liquid_fraction) * (temperature - reference_temperature)
}

#[typetag::serde(name = "thermal_expansion")]
impl Coupler for ThermalExpansion {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        self.prepared = Some(Prepared {
            body,
            expansion: setup.property(body, "thermal_expansion")?,
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            liquid_fraction: setup.read_if_provided(body, &keys::LIQUID_FRACTION)?,
            eigenstrain: setup.add(body, &keys::EIGENSTRAIN)?,
        });
        Ok(())
    }

    fn is_steady(&self) -> bool {
        true
    }

    fn apply(&mut self, world: &World, _step: Step) -> Result<(), RunError> {
        let p = self.prepared.as_ref().expect("prepared before the run");
        let temperature: &[f64] = &world.read(p.temperature);
        let liquid_fraction = world.read_if_provided(p.liquid_fraction);
        let liquid_fraction = liquid_fraction.as_deref();
        let material = &world.body(p.body).material_of_point;
        let reference = self.reference_temperature;
        let mut eigenstrain = world.write(p.eigenstrain);
        let strain = |point: usize| {
            let liquid = liquid_fraction.map_or(0.0, |f| f[point]);
            let expansion = &p.expansion[material[point] as usize];
            thermal_strain(expansion, temperature[point], liquid, reference)
        };
        let points = eigenstrain.par_iter_mut().enumerate();
        points.for_each(|(point, sum)| *sum += strain(point));
        Ok(())
    }
}

perimelt_core::register_coupler!("thermal_expansion", ThermalExpansion);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, set, values};

    #[test]
    fn strain_is_the_secant_coefficient_at_the_temperature_times_the_rise() {
        let mut world = World::new(vec![block([3, 1, 1], 1, STEEL)]);
        let mut expansion: ThermalExpansion = read("reference_temperature = 300");
        prepare(&mut world, &mut expansion, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.consume(0, &keys::EIGENSTRAIN).expect("free");
        })
        .expect("valid");
        set(&world, &keys::TEMPERATURE, |i| [200.0, 300.0, 800.0][i]);
        set(&world, &keys::EIGENSTRAIN, |_| 1.0);
        apply(&world, &mut expansion, 0.0);
        // 15e-6 half way through the table, 10e-6 below it; added to what was there
        let expected = [1.0 - 10e-6 * 100.0, 1.0, 1.0 + 15e-6 * 500.0];
        for (strain, expected) in values(&world, &keys::EIGENSTRAIN).iter().zip(expected) {
            assert!((strain - expected).abs() < 1e-15, "rounding of 1");
        }
    }

    #[test]
    fn a_material_without_expansion_is_named() {
        let mut world = World::new(vec![block([3, 1, 1], 1, "density = 1")]);
        let mut expansion: ThermalExpansion = read("reference_temperature = 300");
        let message = refusal(&mut world, &mut expansion);
        assert!(message.contains("material `steel` of body `block` has no `thermal_expansion`"));
    }
}
