//! What a flow through points carries: fluxes and their divergence, and the stabilisation of convective terms.
//!
//! A field f is carried by `(f div(rho v) - div(rho v f)) / rho`: the integral of `rho f` is kept to rounding and uniform
//! fields stay uniform. Walls mirror the flux, also where the fluid sticks to them, so that nothing flows through.

use perimelt_core::{Derivatives, Pddo};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Stabilisation of the convective terms of an Eulerian fluid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Convection {
    /// The diffusivity of what is carried is at least a fifth of speed times spacing (after the hybrid scheme of
    /// Spalding (1972), with a half). Short waves do not grow; first order where the bound applies.
    #[default]
    Hybrid,
    /// No stabilisation. Short waves grow where speed times spacing is more than some ten times the diffusivity.
    Central,
}

impl Convection {
    /// Least diffusivity for a flow of this speed (m/s) through points of this spacing (m), m²/s.
    pub(crate) fn least_diffusivity(self, speed: f64, spacing: f64) -> f64 {
        match self {
            Convection::Hybrid => 0.2 * speed * spacing,
            Convection::Central => 0.0,
        }
    }
}

/// A flux through space and its divergence.
#[derive(Clone, Debug)]
pub(crate) struct Flux {
    /// By slot, one array for each axis.
    slots: Vec<Vec<f64>>,
    /// By point.
    pub(crate) divergence: Vec<f64>,
}

impl Flux {
    pub(crate) fn new(dimension: usize) -> Self {
        Flux {
            slots: vec![Vec::new(); dimension],
            divergence: Vec::new(),
        }
    }

    /// Sets the flux to the velocity, given by slot, or to the flux of mass where a density is given. Walls mirror it.
    pub(crate) fn find(
        &mut self,
        (pddo, work): (&Pddo, &mut Derivatives),
        velocity: &[Vec<f64>],
        density: Option<&[f64]>,
    ) {
        for (axis, (slots, velocity)) in self.slots.iter_mut().zip(velocity).enumerate() {
            slots.clone_from(velocity);
            if let Some(density) = density {
                slots.iter_mut().zip(density).for_each(|(f, rho)| *f *= rho);
            }
            pddo.family().fill_layers_turning(slots, |a| a == axis);
        }
        pddo.divergence(&self.slots, work, &mut self.divergence);
    }

    /// Sets the flux to that of a field, given by slot, that the flux of mass carries.
    pub(crate) fn carry(
        &mut self,
        (pddo, work): (&Pddo, &mut Derivatives),
        mass: &Flux,
        field: &[f64],
    ) {
        for (slots, mass) in self.slots.iter_mut().zip(&mass.slots) {
            slots.clear();
            slots.extend(mass.iter().zip(field).map(|(mass, value)| mass * value));
        }
        pddo.divergence(&self.slots, work, &mut self.divergence);
    }

    /// `f div(rho v) - div(rho v f)` at a point where the field f has this value.
    pub(crate) fn net(&self, mass: &Flux, point: usize, value: f64) -> f64 {
        value * mass.divergence[point] - self.divergence[point]
    }
}
