//! What a prepared fluid works with: handles, properties, points, and the account of what is conserved.

use nalgebra::Vector3;
use perimelt_core::material::EnthalpyCurve;
use perimelt_core::solver::reduce::sum;
use perimelt_core::world::{BodyIndex, LayersHandle};
use perimelt_core::{PddoError, Read, SlotField, Work, World, Write};
use serde::{Deserialize, Serialize};

use super::heat::FluidHeat;
use super::interface_report::InterfaceReport;
use super::keys::{Scheme, Smoothed};
use super::medium::Medium;
use super::points::Points;
use super::rates::Stability;
use super::treatments::Treatments;
use crate::momentum::{Balanced, Momentum};

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
    /// Account of the momentum where no face takes any.
    pub(super) momentum: Option<MomentumAccount>,
    /// Interface between two fluids.
    pub(super) interface: Option<InterfaceReport>,
    /// J.
    pub(super) kinetic_energy: f64,
    /// Largest `|rho/rho0 - 1|`; a fluid that keeps its volume has none.
    pub(super) density_deviation: Option<f64>,
}

/// Momentum that a fluid had at the start, and what forces and walls gave since.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct MomentumAccount {
    pub(super) balanced: Balanced,
    pub(super) initial: Momentum,
    pub(super) given: Momentum,
}

impl MomentumAccount {
    /// Adds a force (N) and its moment (N m) over a time (s).
    pub(super) fn give(&mut self, [force, moment]: [Vector3<f64>; 2], time: f64) {
        self.given += Momentum::of_impulse(time * force, time * moment);
    }
}

/// Fields that every fluid has.
#[derive(Debug)]
pub(super) struct FluidFields {
    pub(super) velocity: Write<Vector3<f64>>,
    pub(super) density: Write<f64>,
    pub(super) pressure: Write<f64>,
    /// Fraction of the first of two fluids.
    pub(super) fraction: Option<Write<f64>>,
    /// Pressure on the interface of two fluids, where something presses.
    pub(super) interface_pressure: Option<Read<f64>>,
    /// Temperature on which the tension between two fluids depends at points that move.
    pub(super) interface_temperature: Option<Read<f64>>,
    /// Where a fluid that keeps its volume carries heat.
    pub(super) heat: Option<FluidHeat>,
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
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct StepSettings {
    pub(super) scheme: Scheme,
    pub(super) density_diffusion: f64,
    pub(super) artificial_viscosity: f64,
    /// s.
    pub(super) startup: f64,
    /// Number of steps; 0: never.
    pub(super) smoothing: u32,
    pub(super) smoothed: Smoothed,
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
    fn sum_of_momenta(
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

    /// Momentum now, and its sizes: of the speeds, not of the components.
    pub(super) fn momentum_now(&self, world: &World, balanced: Balanced) -> Momentum {
        let sum = |part: fn(&Vector3<f64>, &Vector3<f64>) -> Vector3<f64>| -> [f64; 3] {
            self.sum_of_momenta(world, part).into()
        };
        let mut now = Momentum {
            linear: sum(|_, v| *v),
            linear_size: sum(|_, v| Vector3::repeat(v.norm())),
            ..Momentum::default()
        };
        if balanced.angular {
            now.angular = sum(|x, v| x.cross(v));
            now.angular_size = sum(|x, v| Vector3::repeat(x.norm() * v.norm()));
        }
        now
    }

    /// Sets what the fluxes of the last step follow from, where these are kept from step to step.
    pub(super) fn set_fluxes(&mut self, world: &World) {
        self.take_heat(world);
        if let Some(projection) = self.points.projection_mut() {
            if let Some(fraction) = self.fields.fraction {
                projection.set_fraction(&world.read::<f64>(fraction.into()));
            }
            let velocity = world.read::<Vector3<f64>>(self.fields.velocity.into());
            let density = world.read::<f64>(self.fields.density.into());
            let pressure = world.read::<f64>(self.fields.pressure.into());
            projection.set_fluxes(&velocity, &density, &pressure);
        }
    }

    /// What the last step cost.
    pub(super) fn work(&self) -> Work {
        match self.points.projection() {
            Some(projection) => Work {
                iterations: projection.iterations(),
                evaluations: 1 + projection.iterations(),
            },
            None => Work::of_stages(1),
        }
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
