//! What a prepared fluid works with: handles, rates, and the configuration of points that move.

use nalgebra::Vector3;
use perimelt_core::material::EnthalpyCurve;
use perimelt_core::solver::reduce::sum_of;
use perimelt_core::world::{BodyIndex, LayersHandle};
use perimelt_core::{FamilyHandle, PddoError, PointMover, Read, SlotField, World, Write};

use super::medium::Medium;
use super::rates::{LargestSums, Rates, Stability};
use super::treatments::Treatments;

/// A prepared fluid.
#[derive(Debug)]
pub(super) struct FluidRun {
    pub(super) body: BodyIndex,
    pub(super) velocity: Write<Vector3<f64>>,
    pub(super) density: Write<f64>,
    pub(super) pressure: Write<f64>,
    pub(super) displacement: Option<Write<Vector3<f64>>>,
    /// Of an Eulerian fluid.
    pub(super) mass_flux: Option<Write<Vector3<f64>>>,
    pub(super) body_force: Option<Read<Vector3<f64>>>,
    /// Of points that move, where another body gives impulses.
    pub(super) impulse: Option<Read<Vector3<f64>>>,
    /// Where the viscosity depends on it.
    pub(super) temperature: Option<FluidTemperature>,
    /// Where somebody reads it.
    pub(super) viscous_work: Option<Write<f64>>,
    pub(super) velocity_layers: LayersHandle,
    pub(super) medium: Medium,
    pub(super) rates: Box<dyn Rates>,
    /// At the reference positions.
    pub(super) initial_stability: Stability,
    /// At the positions at which it was last found, which a restart must not change.
    pub(super) stability: Stability,
    /// Largest stable step, s, once it is found.
    pub(super) stable_step: Option<f64>,
    pub(super) treatments: Treatments,
    /// Components of the velocity by slot.
    pub(super) slots: Vec<SlotField>,
    pub(super) moving: Option<Moving>,
    /// Volume that a fluid without free surface fills, m³.
    pub(super) container: Option<f64>,
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

/// What a viscosity that depends on temperature needs.
#[derive(Debug)]
pub(super) struct FluidTemperature {
    pub(super) field: Read<f64>,
    pub(super) curves: Vec<EnthalpyCurve>,
}

/// Points of an updated Lagrangian fluid.
#[derive(Debug)]
pub(super) struct Moving {
    pub(super) mover: PointMover,
    pub(super) family: FamilyHandle,
    /// Largest sums over the families at the reference positions.
    pub(super) initial_sums: LargestSums,
    /// kg; zero until the run starts or a state is restored.
    pub(super) mass: Vec<f64>,
    /// Work arrays: the next configuration, in m and m³.
    pub(super) position: Vec<Vector3<f64>>,
    pub(super) volume: Vec<f64>,
}

impl FluidRun {
    /// Mass of each point, kg: that of a point that moves, or that in its reference volume.
    pub(super) fn mass_of_points<'a>(
        &'a self,
        world: &'a World,
        density: &'a [f64],
    ) -> impl Fn(usize) -> f64 + 'a {
        let volume = &world.body(self.body).points.volume;
        let fullness = self.rates.fullness();
        move |point| match &self.moving {
            Some(moving) => moving.mass[point],
            None => density[point] * volume[point] * fullness.map_or(1.0, |f| f[point]),
        }
    }

    /// Mass, kg. In a total Lagrangian fluid, whose points have their reference volumes, it shows how far densities
    /// depart from the change of volumes.
    pub(super) fn mass(&self, world: &World) -> f64 {
        if let Some(moving) = &self.moving {
            return sum_of([&moving.mass], |[m]| m);
        }
        let density = world.read::<f64>(self.density.into());
        let volume = &world.body(self.body).points.volume;
        match self.rates.fullness() {
            Some(fullness) => sum_of([&density, volume, fullness], |[rho, v, f]| rho * v * f),
            None => sum_of([&density, volume], |[rho, v]| rho * v),
        }
    }

    /// Sum of mass times `of(velocity)`, N s.
    pub(super) fn momentum_now(
        &self,
        world: &World,
        of: impl Fn(&Vector3<f64>) -> Vector3<f64>,
    ) -> Vector3<f64> {
        let velocity = world.read::<Vector3<f64>>(self.velocity.into());
        let density = world.read::<f64>(self.density.into());
        let mass = self.mass_of_points(world, &density);
        let points = velocity.iter().enumerate();
        points.map(|(i, v)| mass(i) * of(v)).sum()
    }

    /// Sum of mass times `of(position, velocity)`, with the current positions, N m s.
    pub(super) fn angular_momentum_now(
        &self,
        world: &World,
        of: impl Fn(&Vector3<f64>, &Vector3<f64>) -> Vector3<f64>,
    ) -> Vector3<f64> {
        let velocity = world.read::<Vector3<f64>>(self.velocity.into());
        let density = world.read::<f64>(self.density.into());
        let mass = self.mass_of_points(world, &density);
        let now = world.configuration(self.body);
        let points = velocity.iter().zip(now.positions()).enumerate();
        points.map(|(i, (v, x))| mass(i) * of(x, v)).sum()
    }

    /// Gives points that move the mass of their reference volumes.
    pub(super) fn weigh_points(&mut self, world: &World) {
        let density = world.read::<f64>(self.density.into());
        let volume = &world.body(self.body).points.volume;
        if let Some(moving) = &mut self.moving {
            let points = density.iter().zip(volume);
            moving.mass = points.map(|(rho, v)| rho * v).collect();
        }
    }

    /// Sets the configuration to where displacement and density say that the points are, and takes the family and
    /// operators of the new positions.
    pub(super) fn set_configuration(&mut self, world: &World) -> Result<(), PddoError> {
        let (Some(moving), Some(displacement)) = (&mut self.moving, self.displacement) else {
            return Ok(());
        };
        let reference = &world.body(self.body).points.position;
        let displacement = world.read::<Vector3<f64>>(displacement.into());
        let density = world.read::<f64>(self.density.into());
        moving.position.clear();
        let positions = reference.iter().zip(&*displacement).map(|(x, u)| x + u);
        moving.position.extend(positions);
        moving.volume.clear();
        let volumes = moving.mass.iter().zip(&*density).map(|(m, rho)| m / rho);
        moving.volume.extend(volumes);
        world.set_configuration(&moving.mover, &moving.position, &moving.volume);
        let family = || world.family(moving.family);
        self.rates.follow(&moving.position, &family)
    }

    /// Finds what the largest stable step depends on for the current positions.
    pub(super) fn update_stability(&mut self) {
        if let Some(motion) = self.rates.motion() {
            self.stability = self
                .initial_stability
                .compressed(motion.largest_compression());
        }
        if let Some(moving) = &self.moving {
            let now = LargestSums::of(self.rates.family(), moving.mass.len(), self.rates.walls());
            self.stability = self.initial_stability.scaled(moving.initial_sums, now);
        }
    }
}
