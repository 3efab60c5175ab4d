//! Melting and freezing: latent heat in the thermal physics of a body.
//!
//! The coupler chooses the enthalpy curve ([`perimelt_core::material::EnthalpyCurve`] has the formulas,
//! Wang (2025), eqs. 7.11, 7.12; docs/theory/phase_change.md) and writes the liquid fraction
//!
//! ```text
//! liquid_fraction = clamp((T - T_s)/(T_l - T_s), 0, 1)
//! ```
//!
//! for couplers, plots and properties by phase. Where the thermal physics provides `enthalpy`,
//! the liquid fraction is computed from it. This also holds for a pure substance (T_s = T_l), whose
//! temperature does not determine the liquid fraction. Materials of the body that lack one of
//! `solidus`, `liquidus` and `latent_heat` stay solid. Where two fluids share the points, it is the volume of the liquid of the first one over that of the
//! point, by its temperature.
//!
//! Not for vaporisation or undercooling.

use perimelt_core::error::Problem;
use perimelt_core::material::{EnthalpyCurve, LatentHeatForm, MushyCapacity};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{
    Coupler, Prepared, Read, ReadIfProvided, RunError, RunningCoupler, Setup, SetupError, Step,
    Stepping, World, Write, keys, world,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::point_materials::PointMaterials;

/// Latent heat; needs the material properties `solidus`, `liquidus` and `latent_heat`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PhaseChange {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// How a step finds the new temperature; default `enthalpy`.
    #[serde(default)]
    pub form: LatentHeatForm,
    /// What heats up between solidus and liquidus; default `latent_plus_sensible`.
    #[serde(default)]
    pub mushy_capacity: MushyCapacity,
}

/// A phase change that is ready to run.
struct RunningPhaseChange {
    body: usize,
    /// Enthalpy curves by material.
    curves: Vec<EnthalpyCurve>,
    temperature: Read<f64>,
    enthalpy: ReadIfProvided<f64>,
    materials: PointMaterials,
    liquid_fraction: Write<f64>,
}

/// The first property that the first material lacks, when no material of the body can melt.
fn missing_property(setup: &Setup<'_>, body: usize) -> Option<Problem> {
    const NEEDED: [&str; 3] = ["solidus", "liquidus", "latent_heat"];
    let body = setup.body(body);
    let mut first = None;
    for material in &body.materials {
        let property = NEEDED.iter().find(|p| material.get(p).is_none())?;
        first.get_or_insert_with(|| Problem::MissingProperty {
            material: material.name().into(),
            body: body.name.clone(),
            property: (*property).into(),
        });
    }
    first
}

#[typetag::serialize(name = "phase_change")]
impl Coupler for PhaseChange {
    fn publish(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        if let Some(problem) = missing_property(setup, body) {
            return Err(SetupError::new("", problem));
        }
        let change = world::PhaseChange {
            mushy_capacity: self.mushy_capacity,
            form: self.form,
        };
        setup.publish(body, change)?;
        setup.publish(body, world::LayerSideBySide)
    }

    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        setup.stepping(Stepping {
            is_steady: true,
            ..Stepping::default()
        });
        let materials = PointMaterials::prepare(setup, body)?;
        Ok(Box::new(RunningPhaseChange {
            body,
            curves: setup.world().enthalpy_curves(body)?,
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            enthalpy: setup.read_if_provided(body, &keys::ENTHALPY)?,
            materials,
            liquid_fraction: setup.write(body, &keys::LIQUID_FRACTION)?,
        }))
    }
}

impl RunningCoupler for RunningPhaseChange {
    fn apply(&mut self, world: &World, _step: Step) -> Result<(), RunError> {
        let temperature: &[f64] = &world.read(self.temperature);
        let enthalpy = world.read_if_provided(self.enthalpy);
        // that of a mixture is the one of both fluids
        let enthalpy = enthalpy.as_deref().filter(|_| !self.materials.are_fluids());
        let fraction = self.materials.fraction(world);
        let body = world.body(self.body);
        let materials = self.materials.with(body, fraction.as_deref());
        let liquid = |point: usize| {
            materials.mean(point, |m| match enthalpy {
                Some(enthalpy) => self.curves[m].liquid_fraction_from_enthalpy(enthalpy[point]),
                None => self.curves[m].liquid_fraction(temperature[point]),
            })
        };
        let mut liquid_fraction = world.write(self.liquid_fraction);
        let points = liquid_fraction.par_iter_mut().enumerate();
        points.for_all(|(point, value)| *value = liquid(point));
        Ok(())
    }
}

perimelt_core::register_coupler!("phase_change", PhaseChange, supports: [Motion, Flow, Births, Cuts, Window, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, set, values};

    #[test]
    fn the_liquid_fraction_follows_temperature_where_there_is_no_enthalpy() {
        let mut world = World::new(vec![block([4, 1, 1], 1, STEEL)]);
        let change: PhaseChange = read("form = 'apparent'\nmushy_capacity = 'latent_only'");
        let (mut change, curves) = prepare(&mut world, change, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.world().enthalpy_curves(0).expect("valid")
        })
        .expect("valid");
        let latent = curves[0]
            .latent_heat()
            .expect("the physics now sees latent heat");
        assert_eq!(latent.form, LatentHeatForm::Apparent);
        assert_eq!(latent.mushy_capacity, MushyCapacity::LatentOnly);
        let temperatures = [300.0, 1700.0, 1725.0, 2000.0];
        set(&mut world, &keys::TEMPERATURE, |i| temperatures[i]);
        apply(&world, &mut *change, 0.0);
        assert_eq!(
            values(&world, &keys::LIQUID_FRACTION),
            [0.0, 0.0, 0.25, 1.0]
        );
    }

    #[test]
    fn a_pure_substance_melts_by_its_enthalpy() {
        let ice = "density = 1000\nspecific_heat = 2000\nsolidus = 273\nliquidus = 273\nlatent_heat = 3e5";
        let mut world = World::new(vec![block([3, 1, 1], 1, ice)]);
        let change: PhaseChange = read("");
        let (mut change, ()) = prepare(&mut world, change, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.own(0, &keys::ENTHALPY).expect("free");
        })
        .expect("valid");
        set(&mut world, &keys::TEMPERATURE, |_| 273.0);
        // 3e8 J/m³ melt all of it
        set(&mut world, &keys::ENTHALPY, |i| [-1.0, 0.75e8, 4e8][i]);
        apply(&world, &mut *change, 0.0);
        assert_eq!(values(&world, &keys::LIQUID_FRACTION), [0.0, 0.25, 1.0]);
    }

    #[test]
    fn a_body_that_cannot_melt_is_refused_by_the_property_that_it_lacks() {
        let mut world = World::new(vec![block([3, 1, 1], 1, "solidus = 300\nliquidus = 400")]);
        let change: PhaseChange = read("");
        let message = refusal(&mut world, change);
        assert!(message.contains("material `steel` of body `block` has no `latent_heat`"));
    }
}
