//! What a prepared fluid works with: handles, properties, points, and the account of what is conserved.

use nalgebra::Vector3;
use perimelt_core::material::EnthalpyCurve;
use perimelt_core::solver::reduce::sum;
use perimelt_core::world::{BodyIndex, LayersHandle};
use perimelt_core::{PddoError, Read, SlotField, World, Write};

use super::keys::Scheme;
use super::medium::Medium;
use super::points::Points;
use super::rates::Stability;
use super::treatments::Treatments;

/// A prepared fluid.
#[derive(Debug)]
pub(super) struct FluidRun {
    pub(super) body: BodyIndex,
    pub(super) fields: FluidFields,
    pub(super) settings: StepSettings,
    pub(super) medium: Medium,
    pub(super) points: Points,
    /// At the reference positions.
    pub(super) initial_stability: Stability,
    /// At the positions at which it was last found, which a restart must not change.
    pub(super) stability: Stability,
    /// Largest stable step, s, once it is found.
    pub(super) stable_step: Option<f64>,
    pub(super) treatments: Treatments,
    /// Components of the velocity by slot.
    pub(super) slots: Vec<SlotField>,
    pub(super) steps: u64,
    pub(super) initial_mass: f64,
    /// Where no face takes momentum: at the start, given by forces and walls since, and the sum of the absolute values
    /// of what they gave in each step, N s.
    pub(super) momentum: Option<[Vector3<f64>; 3]>,
    /// Where it is kept: angular momentum about the origin, likewise, N m s.
    pub(super) angular_momentum: Option<[Vector3<f64>; 3]>,
    /// J.
    pub(super) kinetic_energy: f64,
    /// Largest `|rho/rho0 - 1|`.
    pub(super) density_deviation: f64,
}

/// Fields that every fluid has.
#[derive(Debug)]
pub(super) struct FluidFields {
    pub(super) velocity: Write<Vector3<f64>>,
    pub(super) density: Write<f64>,
    pub(super) pressure: Write<f64>,
    pub(super) body_force: Option<Read<Vector3<f64>>>,
    pub(super) velocity_layers: LayersHandle,
    /// Temperature, where the viscosity depends on it.
    pub(super) temperature: Option<FluidTemperature>,
    /// Work of friction, where somebody reads it.
    pub(super) viscous_work: Option<Write<f64>>,
}

/// What a viscosity that depends on temperature needs.
#[derive(Debug)]
pub(super) struct FluidTemperature {
    pub(super) field: Read<f64>,
    pub(super) curves: Vec<EnthalpyCurve>,
}

/// Keys of a step that every fluid has.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepSettings {
    pub(super) scheme: Scheme,
    pub(super) density_diffusion: f64,
    pub(super) artificial_viscosity: f64,
    /// s.
    pub(super) startup: f64,
    /// Number of steps; 0: never.
    pub(super) smoothing: u32,
    pub(super) zero_surface_pressure: bool,
}

impl FluidRun {
    /// Mass, kg. In a total Lagrangian fluid, whose points have their reference volumes, it shows how far densities
    /// depart from the change of volumes.
    pub(super) fn mass(&self, world: &World) -> f64 {
        let density = world.read::<f64>(self.fields.density.into());
        sum(&self.masses(world, &density))
    }

    /// Mass of each point, kg.
    pub(super) fn masses(&self, world: &World, density: &[f64]) -> Vec<f64> {
        let volume = &world.body(self.body).points.volume;
        let mass = self.points.masses(density, volume);
        (0..density.len()).map(mass).collect()
    }

    /// Sum of mass times `part(position, velocity)` over the points at their current positions.
    pub(super) fn sum_of_momenta(
        &self,
        world: &World,
        part: impl Fn(&Vector3<f64>, &Vector3<f64>) -> Vector3<f64>,
    ) -> Vector3<f64> {
        let velocity = world.read::<Vector3<f64>>(self.fields.velocity.into());
        let density = world.read::<f64>(self.fields.density.into());
        let volume = &world.body(self.body).points.volume;
        let mass = self.points.masses(&density, volume);
        let now = world.configuration(self.body);
        let points = velocity.iter().zip(now.positions()).enumerate();
        points.map(|(i, (v, x))| mass(i) * part(x, v)).sum()
    }

    /// Sets the configuration to where displacement and density say that the points are.
    pub(super) fn set_configuration(&mut self, world: &World) -> Result<(), PddoError> {
        match &mut self.points {
            Points::Lagrangian(points) => {
                let density = world.read::<f64>(self.fields.density.into());
                points.set_configuration(world, self.body, &density)
            }
            Points::Eulerian(_) => Ok(()),
        }
    }

    /// Finds what the largest stable step depends on for the current positions.
    pub(super) fn update_stability(&mut self) {
        if let Some(now) = self.points.stability_now(self.initial_stability) {
            self.stability = now;
            self.stable_step = None;
        }
    }
}
