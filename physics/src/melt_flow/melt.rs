//! Properties of the melt.

use perimelt_core::material::{EnthalpyCurve, Property};
use perimelt_core::world::{BodyIndex, PhaseChange};
use perimelt_core::{Setup, SetupError, TensionLaw};

use crate::dependent_keys::need;
use crate::tension::prepare_face_tension;

use super::keys::MeltFlow;

/// The material of a body that melts.
#[derive(Debug)]
pub(super) struct Melt {
    /// Its number among the materials of the body.
    pub(super) material: u16,
    pub(super) curve: EnthalpyCurve,
    /// kg/m³.
    pub(super) density: f64,
    /// Pa s.
    viscosity: Property,
    viscosity_factor: f64,
    /// Conductivity (W/(m K)) and the part of it that the flow adds.
    conductivity: Option<(Property, f64)>,
    lift: Option<Lift>,
    pub(super) tension: Option<TensionLaw>,
    /// kg/(m³ s).
    pub(super) drag: Option<f64>,
}

/// Lift of the hot melt.
#[derive(Debug)]
struct Lift {
    expansion: Property,
    /// m/s².
    gravity: [f64; 3],
    /// K.
    reference_temperature: f64,
}

impl Melt {
    pub(super) fn prepare(
        keys: &MeltFlow,
        setup: &mut Setup<'_>,
        body: BodyIndex,
    ) -> Result<Melt, SetupError> {
        need(
            setup.facts::<PhaseChange>(body).next().is_some(),
            "body",
            "the body does not melt: no coupler says how",
            "a coupler `phase_change` on the body",
        )?;
        let curves = setup.world().enthalpy_curves(body)?;
        let melting = (0u16..).zip(&curves);
        let melting: Vec<_> = melting.filter(|(_, c)| c.latent_heat().is_some()).collect();
        let [(material, curve)] = melting[..] else {
            let message = "several materials of the body melt, and melt flow does not mix them";
            let expected = "a body of which one material melts";
            return Err(SetupError::value("body", message, expected));
        };
        let law = keys.surface.as_ref().and_then(|surface| surface.tension);
        let tension =
            law.map(|law| prepare_face_tension(law, "surface.tension", setup, body, material));
        let tension = tension.transpose()?;
        let of = |name: &str| setup.world().property_of(body, material, name);
        let liquidus = curve.latent_heat().map_or(0.0, |latent| latent.liquidus);
        let lift = match &keys.buoyancy {
            Some(buoyancy) => Some(Lift {
                expansion: of("liquid_expansion")?,
                gravity: buoyancy.gravity,
                reference_temperature: buoyancy.reference_temperature.unwrap_or(liquidus),
            }),
            None => None,
        };
        let added = keys.conductivity_factor - 1.0;
        let conductivity = match added > 0.0 {
            true => Some((of("conductivity")?, added)),
            false => None,
        };
        let viscosity = of("viscosity")?;
        Ok(Melt {
            material,
            density: setup.world().reference_densities(body)?[usize::from(material)],
            viscosity,
            viscosity_factor: keys.viscosity_factor,
            conductivity,
            lift,
            tension,
            drag: keys.drag,
            curve: curve.clone(),
        })
    }

    /// Kinematic viscosity at a temperature (K), m²/s.
    pub(super) fn viscosity(&self, temperature: f64) -> f64 {
        self.viscosity_factor * self.viscosity.at(temperature, 1.0) / self.density
    }

    /// Conductivity that the flow adds at a temperature (K), W/(m K); `None` where it adds none.
    pub(super) fn added_conductivity(&self, temperature: f64) -> Option<f64> {
        let (conductivity, added) = self.conductivity.as_ref()?;
        Some(added * conductivity.at(temperature, 1.0))
    }

    /// Force per volume by which hot melt rises at a temperature (K), N/m³.
    pub(super) fn lift(&self, temperature: f64) -> Option<[f64; 3]> {
        let lift = self.lift.as_ref()?;
        let difference = temperature - lift.reference_temperature;
        let lighter = self.density * lift.expansion.at(temperature, 1.0) * difference;
        Some(lift.gravity.map(|g| -lighter * g))
    }

    pub(super) fn has_lift(&self) -> bool {
        self.lift.is_some()
    }

    pub(super) fn has_tension(&self) -> bool {
        self.tension.is_some()
    }

    /// Rate at which the mushy zone brings the melt to rest at an enthalpy (J/m³), 1/s (Voller & Prakash (1987)).
    pub(super) fn drag_rate(&self, enthalpy: f64) -> f64 {
        let Some(drag) = self.drag else {
            return 0.0;
        };
        let liquid = self.curve.liquid_fraction_from_enthalpy(enthalpy);
        drag * (1.0 - liquid).powi(2) / (self.density * (liquid.powi(3) + 1e-3))
    }
}
