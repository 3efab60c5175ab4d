//! Convective transport: fluxes, their divergence, and the stabilisation of convective terms.
//!
//! A field f is carried by `(f div(rho v) - div(rho v f)) / rho`: the integral of `rho f` is kept to rounding and uniform
//! fields stay uniform. Walls mirror the flux, also where the fluid sticks to them, so that nothing flows through.

use nalgebra::Vector3;
use perimelt_core::family::{ByRules, LayerRule, Mirrored};
use perimelt_core::{
    Body, Bond, BondKernel, Derivatives, Description, Fact, FamilyHandle, Horizon, Pddo, SlotField,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Stabilisation of the convective terms of an Eulerian fluid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Convection {
    /// Waves of the length of a few spacings decay at a rate of at least 0.15 times speed over spacing (after the hybrid
    /// scheme of Spalding (1972), which has a least diffusivity): the diffusivity that they lack acts on the difference
    /// between a field and its mean over neighbours, third order in the spacing where the field is smooth.
    #[default]
    Hybrid,
    /// No stabilisation. Short waves grow where speed times spacing is more than some ten times the diffusivity.
    Central,
}

/// The family over which the flow through the points of a body is summed. Sums over the same bonds conserve transported
/// quantities to rounding.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FlowFamily(pub FamilyHandle);

impl Fact for FlowFamily {}

/// Default horizon of the derivatives of a flow: 3.015 spacings as published, 2.015 for an Eulerian fluid on a lattice,
/// which needs fewer neighbours.
pub(crate) fn usual_horizon(description: Description, body: &Body) -> Horizon {
    match description {
        flow if flow.flows_through() && body.lattice().is_some() => Horizon::Spacings(2.015),
        _ => Horizon::Spacings(3.015),
    }
}

/// Rate of decay of short waves over speed by spacing. Flows in a cavity are stable from 0.1 on at any Reynolds number.
const DECAY: f64 = 0.15;

impl Convection {
    /// Diffusivity that short waves lack in a flow of this speed (m/s), m²/s. `laplacian` is the sum of the weights of the
    /// Laplacian (1/m²), at about which they decay for a diffusivity of one.
    pub(crate) fn missing_diffusivity(
        self,
        speed: f64,
        spacing: f64,
        laplacian: f64,
        diffusivity: f64,
    ) -> f64 {
        match self {
            Convection::Hybrid => (DECAY * speed / (spacing * laplacian) - diffusivity).max(0.0),
            Convection::Central => 0.0,
        }
    }
}

/// Diffusion of short waves, `lap(d (f - mean f))` with the mean by the weights of the Laplacian,
/// `f - mean f = -lap f / laplacian`. Its integral vanishes where the layers behind faces are even.
#[derive(Clone, Debug, Default)]
pub(crate) struct ShortWaves {
    rules: Vec<LayerRule>,
    slots: SlotField,
    rate: Vec<f64>,
}

impl ShortWaves {
    /// Sets `d (f - mean f)`, given by point, for a component of a field that continues behind faces by these rules.
    pub(crate) fn find(
        &mut self,
        pddo: &Pddo,
        work: &mut Derivatives,
        rules: &[LayerRule],
        component: usize,
        difference: impl Fn(usize) -> f64 + Sync,
    ) {
        self.rules.clear();
        self.rules.extend(rules.iter().map(LayerRule::homogeneous));
        let ghosts = ByRules(&self.rules, component);
        self.slots.load(pddo.family(), difference, ghosts);
        pddo.laplacian(&self.slots, work, &mut self.rate);
    }

    /// Sets a difference that vanishes everywhere.
    pub(crate) fn vanish(&mut self) {
        self.rate.clear();
    }

    /// `lap(d (f - mean f))` at a point.
    pub(crate) fn rate(&self, point: usize) -> f64 {
        self.rate.get(point).copied().unwrap_or(0.0)
    }
}

/// `lap f` of several fields.
pub(crate) struct Laplacian {
    /// `2 / a`, 1/m.
    pub(crate) laplacian: f64,
}

impl<const D: usize> BondKernel<D, D> for Laplacian {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; D], other: [f64; D]) -> [f64; D] {
        let weight = bond.weight * self.laplacian;
        std::array::from_fn(|a| weight * (other[a] - own[a]))
    }
}

/// A flux through space and its divergence.
#[derive(Clone, Debug)]
pub(crate) struct Flux {
    /// Components by slot, one array for each axis.
    slots: Vec<SlotField>,
    /// Divergence at each point.
    pub(crate) divergence: Vec<f64>,
}

impl Flux {
    pub(crate) fn new(dimension: usize) -> Self {
        Flux {
            slots: vec![SlotField::default(); dimension],
            divergence: Vec::new(),
        }
    }

    /// Sets the flux to the velocity, given by slot, or to the flux of mass where a density is given. Walls mirror it.
    pub(crate) fn find(
        &mut self,
        pddo: &Pddo,
        work: &mut Derivatives,
        velocity: &[SlotField],
        density: Option<&[f64]>,
    ) {
        for (axis, (slots, velocity)) in self.slots.iter_mut().zip(velocity).enumerate() {
            let velocity = velocity.par_iter();
            match density {
                Some(density) => slots.set(velocity.zip(density).map(|(v, rho)| v * rho)),
                None => slots.set(velocity.copied()),
            }
            slots.fill_ghosts(pddo.family(), Mirrored::Vector(axis));
        }
        pddo.divergence(&self.slots, work, &mut self.divergence);
    }

    /// The flux at a slot.
    pub(crate) fn at(&self, slot: usize) -> Vector3<f64> {
        Vector3::from_fn(|a, _| self.slots.get(a).map_or(0.0, |slots| slots[slot]))
    }

    /// Sets the flux to that of a field, given by slot, that the flux of mass carries.
    pub(crate) fn carry(
        &mut self,
        pddo: &Pddo,
        work: &mut Derivatives,
        mass: &Flux,
        field: &[f64],
    ) {
        for (slots, mass) in self.slots.iter_mut().zip(&mass.slots) {
            slots.set(mass.par_iter().zip(field).map(|(mass, value)| mass * value));
        }
        pddo.divergence(&self.slots, work, &mut self.divergence);
    }

    /// `f div(rho v) - div(rho v f)` at a point where the field f has this value at the start of the step.
    pub(crate) fn net(&self, mass: &Flux, point: usize, value: f64) -> f64 {
        value * mass.divergence[point] - self.divergence[point]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::block;
    use perimelt_core::Family;
    use perimelt_core::body::{Jitter, Store};

    /// The missing diffusivity gives short waves a decay rate of 0.15 times speed over spacing.
    #[test]
    fn short_waves_lack_what_makes_them_decay() {
        // 0.15 * 2 m/s over 0.5 m, by a sum of 30 / m²
        for (convection, diffusivity, expected) in [
            (Convection::Hybrid, 0.0, 0.02),
            (Convection::Hybrid, 0.015, 0.005),
            (Convection::Hybrid, 0.02, 0.0),
            (Convection::Hybrid, 1.0, 0.0),
            (Convection::Central, 0.0, 0.0),
        ] {
            let found = convection.missing_diffusivity(2.0, 0.5, 30.0, diffusivity);
            assert!(
                (found - expected).abs() < 1e-15,
                "{convection:?} {diffusivity}: {found}"
            );
        }
    }

    #[test]
    fn a_difference_that_vanishes_has_no_rate() {
        let body = block([8, 8, 1], 2, 0.5, Store::Lattice, "density = 1");
        let spec = Pddo::spec(Horizon::Spacings(2.015));
        let family = Family::moving(&body, &spec).expect("valid");
        let pddo = Pddo::build(&body, family.into(), 2).expect("valid");
        let mut short_waves = ShortWaves::default();
        let place = &body.points.position;
        let wave = |i: usize| (2.0 * place[i].x).sin();
        short_waves.find(&pddo, &mut Derivatives::default(), &[], 0, wave);
        assert!(short_waves.rate(20).abs() > 0.1);
        short_waves.vanish();
        assert_eq!(short_waves.rate(20), 0.0);
    }

    #[test]
    fn only_flows_through_a_lattice_have_a_short_horizon() {
        let lattice = block([4, 4, 1], 2, 0.5, Store::Lattice, "density = 1");
        let jitter = Jitter {
            amplitude: 0.1,
            seed: 1,
        };
        let cloud = lattice.clone().jittered(jitter).expect("valid");
        for (description, body, spacings) in [
            (Description::Eulerian, &lattice, 2.015),
            (Description::ArbitraryLagrangianEulerian, &lattice, 2.015),
            (Description::UpdatedLagrangian, &lattice, 3.015),
            (Description::TotalLagrangian, &lattice, 3.015),
            (Description::Eulerian, &cloud, 3.015),
        ] {
            let horizon = usual_horizon(description, body);
            assert_eq!(horizon, Horizon::Spacings(spacings), "{description:?}");
        }
    }
}
