//! Radiation to black surroundings: `q = eps sigma (T_ambient^4 - T^4)` into the body, T of the
//! surface point itself, in K.
//!
//! The surface exchanges heat with the surroundings only, not with other parts of itself. At 3000 K the
//! exchange equals a convection of 6 kW/(m² K); for spacings far below k/6000 m the step limit of
//! conduction is the smaller one.

use perimelt_core::material::Property;
use perimelt_core::{
    Coupler, Face, Programme, Read, Report, RunError, Setup, SetupError, Step, World, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::InTime;
use crate::surface::{SurfaceHeat, all_faces};

/// Stefan-Boltzmann constant, W/(m² K⁴).
pub const STEFAN_BOLTZMANN: f64 = 5.670_374_419e-8;

/// Heat radiated to the surroundings; needs `emissivity` here or in the material.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Radiation {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Outward directions of the radiating surface; default all.
    #[serde(default = "all_faces")]
    pub faces: Vec<Face>,
    /// Region that limits the radiating surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<String>,
    /// Emissivity, 0 to 1: a number, or `{ temperature = [...], value = [...] }`; default that
    /// of the material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emissivity: Option<Property>,
    /// Temperature of the surroundings (K): a number, or `{ time = [...], value = [...] }`,
    /// times in s.
    pub ambient: InTime,
    #[serde(skip)]
    #[schemars(skip)]
    prepared: Option<RadiationState>,
}

#[derive(Debug)]
struct RadiationState {
    body: usize,
    heat: SurfaceHeat,
    temperature: Read<f64>,
    /// By material.
    emissivity: Vec<Property>,
}

#[typetag::serialize(name = "radiation")]
impl Coupler for Radiation {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        let emissivity = match &self.emissivity {
            Some(given) => vec![given.clone(); setup.body(body).materials.len()],
            None => setup.property(body, "emissivity")?,
        };
        let mut values = emissivity.iter().flat_map(Property::values);
        if let Some(value) = values.find(|e| !(0.0..=1.0).contains(e)) {
            let message = format!("the emissivity {value} is outside its range");
            return Err(SetupError::value("emissivity", message, "0 to 1"));
        }
        if let Some(value) = self.ambient.values().iter().find(|t| **t < 0.0) {
            let message = format!("{value} K is below absolute zero");
            return Err(SetupError::value(
                "ambient",
                message,
                "a temperature in kelvin",
            ));
        }
        self.prepared = Some(RadiationState {
            body,
            heat: SurfaceHeat::prepare(setup, body, &self.faces, self.region.as_deref())?,
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            emissivity,
        });
        Ok(())
    }

    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let p = self.prepared.as_mut().expect("prepared before the run");
        let temperature = world.read(p.temperature);
        let material = &world.body(p.body).material_of_point;
        let ambient = self.ambient.at(step.middle()).powi(4);
        p.heat.add(world, |point| {
            let temperature = temperature[point];
            let emissivity = p.emissivity[material[point] as usize].at(temperature, 0.0);
            emissivity * STEFAN_BOLTZMANN * (ambient - temperature.powi(4))
        });
        Ok(())
    }

    fn next_event(&self, after: f64) -> Option<f64> {
        self.ambient.next_event(after)
    }

    fn programme(&self, _run_end: f64) -> Option<Programme> {
        Programme::of_values([("ambient", &self.ambient)])
    }

    fn report(&self) -> Vec<Report> {
        let prepared = self.prepared.as_ref();
        prepared.map_or_else(Vec::new, |p| p.heat.report())
    }
}

perimelt_core::register_coupler!("radiation", Radiation);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, set};

    fn power(table: &str) -> f64 {
        let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
        let mut boundary: Radiation = read(table);
        prepare(&mut world, &mut boundary, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.consume(0, &keys::HEAT_SOURCE).expect("free");
        })
        .expect("valid");
        set(&mut world, &keys::TEMPERATURE, |_| 1000.0);
        apply(&world, &mut boundary, 0.0);
        boundary.report()[0].value
    }

    #[test]
    fn a_grey_surface_follows_the_fourth_powers() {
        // 56.70374 kW/m² from a black surface at 1000 K; rounding of a sum of 54 faces
        let close = |value: f64, expected: f64| (value / expected - 1.0).abs() < 1e-9;
        assert!(close(
            power("ambient = 0\nemissivity = 1"),
            -54.0 * 56703.74419
        ));
        assert!(close(power("ambient = 0"), -54.0 * 0.8 * 56703.74419));
        assert_eq!(power("ambient = 1000"), 0.0);
        assert!(power("ambient = 1200") > 0.0);
    }

    #[test]
    fn impossible_numbers_are_refused() {
        for (table, key) in [
            ("ambient = 3\nemissivity = 2", "emissivity"),
            ("ambient = -3", "ambient"),
        ] {
            let mut world = World::new(vec![block([3, 3, 3], 3, STEEL)]);
            let mut boundary: Radiation = read(table);
            assert!(refusal(&mut world, &mut boundary).starts_with(key));
        }
    }
}
