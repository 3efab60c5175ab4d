//! Buoyancy of a fluid whose density hardly changes with temperature (Boussinesq):
//! `body_force -= 3 rho0 (e(T) - e(T_ref)) g` with the linear thermal expansion e, `rho0 beta (T - T_ref) g` for a constant
//! coefficient of volume beta.
//!
//! Gao (2020), eqs. 5.128 to 5.136. The weight at the reference temperature is balanced by a hydrostatic pressure and is
//! left out. A reference temperature in the middle of the range of temperatures keeps pressures small.

use nalgebra::Vector3;
use perimelt_core::material::{Expansion, MaterialError, ThermalState};
use perimelt_core::numbers::check_vector;
use perimelt_core::{
    Coupler, Prepared, Read, RunError, RunningCoupler, Setup, SetupError, Step, Stepping, World,
    Write, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::expansion::expansions_from;
use crate::point_materials::PointMaterials;

/// Lift of the hot fluid; needs the material properties `density` and `thermal_expansion`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Buoyancy {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Acceleration of gravity (m/s²), such as `[0.0, -9.81, 0.0]`.
    pub gravity: [f64; 3],
    /// Temperature without lift, K.
    pub reference_temperature: f64,
}

/// A buoyancy that is ready to act.
struct RunningBuoyancy {
    body: usize,
    /// Gravity, m/s².
    gravity: Vector3<f64>,
    /// Reference temperature, K.
    reference_temperature: f64,
    /// Density by material, kg/m³.
    density: Vec<f64>,
    /// Expansion by material.
    expansion: Vec<Expansion>,
    materials: PointMaterials,
    temperature: Read<f64>,
    body_force: Write<Vector3<f64>>,
}

#[typetag::serialize(name = "buoyancy")]
impl Coupler for Buoyancy {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        setup.once::<Self>(body)?;
        check_vector("gravity", self.gravity, setup.body(body))?;
        setup.stepping(Stepping {
            is_steady: true,
            ..Stepping::default()
        });
        let expansions = expansions_from(setup, body, &[self.reference_temperature])?;
        let materials = setup.body(body).materials.iter().zip(&expansions);
        let same = materials.map(|(material, expansion)| {
            let has_directions = || MaterialError::HasDirections {
                material: material.name().to_owned(),
                property: "thermal_expansion".to_owned(),
            };
            expansion.same().cloned().ok_or_else(has_directions)
        });
        let expansion = same
            .collect::<Result<_, _>>()
            .map_err(|e| SetupError::other("", e))?;
        Ok(Box::new(RunningBuoyancy {
            body,
            gravity: self.gravity.into(),
            reference_temperature: self.reference_temperature,
            density: setup.world().reference_densities(body)?,
            expansion,
            materials: PointMaterials::prepare(setup, body)?,
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            body_force: setup.add(body, &keys::BODY_FORCE)?,
        }))
    }
}

impl RunningCoupler for RunningBuoyancy {
    fn apply(&mut self, world: &World, _step: Step) -> Result<(), RunError> {
        let fraction = self.materials.fraction(world);
        let body = world.body(self.body);
        let materials = self.materials.with(body, fraction.as_deref());
        let temperature = world.read(self.temperature);
        let liquid = |temperature| ThermalState {
            temperature,
            liquid_fraction: 1.0,
        };
        let reference = liquid(self.reference_temperature);
        let mut body_force = world.write(self.body_force);
        let density = |m: usize| self.density[m];
        for (point, (sum, &t)) in body_force.iter_mut().zip(&*temperature).enumerate() {
            let strain = |m: usize| self.expansion[m].strain(reference, liquid(t));
            let lost = materials.mean(point, |m| density(m) * strain(m));
            // body forces are those of the density at the start
            let of_start = density(usize::from(body.material_of_point[point]));
            let at_start = of_start / materials.mean(point, density);
            *sum -= 3.0 * at_start * lost * self.gravity;
        }
        Ok(())
    }
}

perimelt_core::register_coupler!("buoyancy", Buoyancy, supports: [Motion, Flow]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{
        STEEL, add_gas, apply, block, prepare, prepare_after, read, set, two_fluids, values,
    };

    #[test]
    fn hot_fluid_rises_by_its_loss_of_weight() {
        let mut world = World::new(vec![block([1, 1, 1], 3, STEEL)]);
        let buoyancy: Buoyancy = read("gravity = [0, -10, 0]\nreference_temperature = -100");
        let (mut buoyancy, _) = prepare(&mut world, buoyancy, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.consume(0, &keys::BODY_FORCE).expect("free");
        })
        .expect("valid");
        apply(&world, &mut *buoyancy, 0.0);
        // 8000 kg/m3 that expand by 1e-5 per K along each axis, 100 K above the reference
        let force = values(&world, &keys::BODY_FORCE);
        assert!(
            (force[1] - 8000.0 * 3e-5 * 100.0 * 10.0).abs() < 1e-9,
            "{force:?}"
        );
        assert_eq!([force[0], force[2]], [0.0; 2]);
    }

    /// Where the fluids have moved, the lift is that of the mixture there, per mass of the mixture.
    #[test]
    fn two_fluids_rise_by_the_expansion_of_what_is_there_now() {
        let mut body = block([3, 1, 1], 3, STEEL);
        add_gas(&mut body, "density = 2\nthermal_expansion = 1e-3");
        let mut world = World::new(vec![body]);
        let buoyancy: Buoyancy = read("gravity = [0, -10, 0]\nreference_temperature = -100");
        let fluid = |setup: &mut Setup<'_>| {
            two_fluids(setup, 0);
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.consume(0, &keys::BODY_FORCE).expect("free");
        };
        let prepared = prepare_after(&mut world, fluid, buoyancy, |_| ());
        let (mut buoyancy, ()) = prepared.expect("valid");
        let fractions = [1.0, 0.0, 0.25];
        set(&mut world, &keys::FLUID_FRACTION, |i| fractions[i]);
        set(&mut world, &keys::TEMPERATURE, |_| 0.0);
        apply(&world, &mut *buoyancy, 0.0);
        let force = values(&world, &keys::BODY_FORCE);
        for (point, c) in fractions.into_iter().enumerate() {
            let lost = c * 8000.0 * 3e-5 * 100.0 + (1.0 - c) * 2.0 * 3e-3 * 100.0;
            let acceleration = 10.0 * lost / (c * 8000.0 + (1.0 - c) * 2.0);
            let found = force[3 * point + 1] / 8000.0;
            assert!(
                (found / acceleration - 1.0).abs() < 1e-9,
                "{c}: {found} {acceleration}"
            );
        }
    }

    #[test]
    fn a_second_buoyancy_of_a_body_is_refused() {
        let mut world = World::new(vec![block([1, 1, 1], 3, STEEL)]);
        let table = "gravity = [0, -10, 0]\nreference_temperature = 300";
        let first = |setup: &mut Setup<'_>| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            Box::new(read::<Buoyancy>(table))
                .prepare(setup)
                .expect("valid");
        };
        let Err(refused) = prepare_after(&mut world, first, read::<Buoyancy>(table), |_| ()) else {
            panic!("the lift would count twice");
        };
        assert!(
            refused
                .to_string()
                .contains("the whole effect on body `block` is that of")
        );
    }
}
