//! Points that carry their mass: of the updated Lagrangian description, which change neighbours, and of the total one, which keep
//! them.
//!
//! Forces between pairs of points belong to the form of the equations ([`LagrangianForm`]); those of the conservative form are laws
//! ([`pair_laws`]), of which surface tension will be one.

pub(super) mod collision;
mod conservative;
mod differences;
mod least_distance;
mod motion;
mod pair_laws;
pub(super) mod surface_force;
mod walls;

pub(super) use motion::MotionStep;

use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::plugin::check_length;
use perimelt_core::solver::reduce::{sum, sum_of};
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Body, Family, FamilyHandle, PddoError, PointMover, Read, Setup, SetupError, SlotField, World,
    Write, keys,
};
use serde::{Deserialize, Serialize};

use crate::advection::FlowFamily;

use super::differences::Differences;
use super::interface_report::{FirstFluid, InterfaceFlow, InterfaceReport};
use super::kinds::{Arrangement, LagrangianKeys};
use super::medium::Medium;
use super::pair::FluidPair;
use super::points::Surroundings;
use super::rates::{LargestSums, Rates, Stability};
use super::walls::{WallMotion, Walls};
use conservative::Conservative;
use differences::LagrangianDifferences;
use surface_force::SurfaceForce;

/// Points that carry their mass.
#[derive(Debug)]
pub(super) struct LagrangianPoints {
    displacement: Write<Vector3<f64>>,
    form: LagrangianForm,
    /// Points that change neighbours.
    moving: Option<Moving>,
}

/// Form of the equations.
#[derive(Debug)]
enum LagrangianForm {
    Differences(Box<LagrangianDifferences>),
    Conservative(Box<Conservative>),
}

/// Points that change neighbours.
#[derive(Debug)]
struct Moving {
    mover: PointMover,
    family: FamilyHandle,
    arrangement: Arrangement,
    /// Impulses of other bodies, N s/m³ of the reference volume, where there are some.
    impulse: Option<Read<Vector3<f64>>>,
    /// Largest sums over the families at the reference positions.
    initial_sums: LargestSums,
    /// Volume that a fluid without free surface fills, m³.
    container: Option<f64>,
    /// kg; zero until the run starts or a state is restored.
    mass: Vec<f64>,
    /// Work arrays: the next configuration, in m and m³.
    position: Vec<Vector3<f64>>,
    volume: Vec<f64>,
}

/// State of points that carry their mass.
#[derive(Serialize, Deserialize)]
pub(super) struct SavedLagrangian {
    /// Masses of points that change neighbours, kg; empty for others.
    mass: Vec<f64>,
    walls: Vec<WallMotion>,
}

impl LagrangianForm {
    fn follow(&mut self, family: FollowedFamily<'_>) -> Result<(), PddoError> {
        match self {
            LagrangianForm::Differences(rates) => rates.follow(family),
            LagrangianForm::Conservative(rates) => {
                rates.follow(family);
                Ok(())
            }
        }
    }
}

/// A family that follows the points. The family so far must be released before the next one is taken, so that the world can
/// update it in place.
struct FollowedFamily<'a> {
    /// m.
    positions: &'a [Vector3<f64>],
    take: &'a dyn Fn() -> Arc<Family>,
}

impl Moving {
    fn prepare(
        arrangement: Arrangement,
        is_closed: bool,
        setup: &mut Setup<'_>,
        around: &Surroundings,
    ) -> Result<Self, SetupError> {
        let impulse = setup.take_if_added(around.body, &keys::IMPULSE)?;
        let mover = setup.move_points(around.body);
        let family = setup.world().family(around.family);
        let points = &setup.body(around.body).points;
        Ok(Moving {
            mover,
            family: around.family,
            arrangement,
            impulse,
            initial_sums: LargestSums::of(&family, points.len(), None),
            container: is_closed.then(|| sum(&points.volume)),
            mass: vec![0.0; points.len()],
            position: Vec::new(),
            volume: Vec::new(),
        })
    }
}

impl LagrangianPoints {
    pub(super) fn prepare(
        keys: LagrangianKeys,
        setup: &mut Setup<'_>,
        mut around: Surroundings,
    ) -> Result<Self, SetupError> {
        let fluids = around.pair.take();
        let displacement = setup.own(around.body, &keys::DISPLACEMENT)?;
        let moving = match &keys {
            LagrangianKeys::Total(_) => {
                setup.publish(around.body, FlowFamily(around.family))?;
                None
            }
            LagrangianKeys::Updated(arrangement, _) => {
                Some(Moving::prepare(*arrangement, false, setup, &around)?)
            }
            LagrangianKeys::Conservative(arrangement, keys) => Some(Moving::prepare(
                *arrangement,
                keys.is_closed,
                setup,
                &around,
            )?),
        };
        let family = setup.world().family(around.family);
        let body = setup.body(around.body);
        let form = match keys {
            LagrangianKeys::Total(keys) | LagrangianKeys::Updated(_, keys) => {
                let core = Differences::prepare(keys, body, family, &around.complete)?;
                let surface = fluids.map(|fluids| SurfaceForce::new(fluids, body));
                let rates = LagrangianDifferences::new(core, surface);
                LagrangianForm::Differences(Box::new(rates))
            }
            LagrangianKeys::Conservative(_, keys) => {
                let rates = Conservative::new(keys, body, family, around);
                LagrangianForm::Conservative(Box::new(rates))
            }
        };
        Ok(LagrangianPoints {
            displacement,
            form,
            moving,
        })
    }

    pub(super) fn rates(&self) -> &dyn Rates {
        match &self.form {
            LagrangianForm::Differences(rates) => &**rates,
            LagrangianForm::Conservative(rates) => &**rates,
        }
    }

    pub(super) fn rates_mut(&mut self) -> &mut dyn Rates {
        match &mut self.form {
            LagrangianForm::Differences(rates) => &mut **rates,
            LagrangianForm::Conservative(rates) => &mut **rates,
        }
    }

    pub(super) fn walls(&self) -> Option<&Walls> {
        match &self.form {
            LagrangianForm::Differences(_) => None,
            LagrangianForm::Conservative(rates) => Some(&rates.walls),
        }
    }

    pub(super) fn walls_mut(&mut self) -> Option<&mut Walls> {
        match &mut self.form {
            LagrangianForm::Differences(_) => None,
            LagrangianForm::Conservative(rates) => Some(&mut rates.walls),
        }
    }

    /// Gives the walls the opposite of what they do to the fluid in a time (s), with the velocity by slot as last set.
    pub(super) fn give_impulses(&mut self, world: &World, velocity: &[SlotField], time: f64) {
        if let LagrangianForm::Conservative(rates) = &mut self.form {
            rates.give_impulses(world, velocity, time);
        }
    }

    /// Force between two fluids.
    fn surface(&self) -> Option<&SurfaceForce> {
        match &self.form {
            LagrangianForm::Differences(rates) => rates.surface.as_deref(),
            LagrangianForm::Conservative(_) => None,
        }
    }

    /// The two fluids, where there are two.
    pub(super) fn pair(&self) -> Option<&FluidPair> {
        self.surface().map(|surface| &surface.pair)
    }

    /// Finds the force between two fluids where their points are now, with these temperatures (K) where the tension depends on them.
    pub(super) fn find_surface_force(&mut self, temperature: Option<&[f64]>) {
        if let (LagrangianForm::Differences(rates), Some(moving)) = (&mut self.form, &self.moving) {
            rates.find_surface_force(&moving.position, temperature);
        }
    }

    /// Largest step (s) that the tension between two fluids allows, with these temperatures (K) where it depends on them.
    pub(super) fn capillary_step(&self, temperature: Option<&[f64]>) -> f64 {
        let surface = self.surface();
        surface.map_or(f64::INFINITY, |surface| surface.largest_step(temperature))
    }

    /// Measures the interface of two fluids.
    pub(super) fn measure(&self, body: &Body, flow: InterfaceFlow<'_>) -> Option<InterfaceReport> {
        let (surface, moving) = (self.surface()?, self.moving.as_ref()?);
        let first = FirstFluid {
            body,
            fraction: &surface.fraction,
            volume: &moving.volume,
            position: &moving.position,
            flow,
        };
        Some(InterfaceReport::of(&first, |i| surface.steepness(i)))
    }

    /// Masses of points that change neighbours, kg.
    pub(super) fn own_masses(&self) -> Option<&[f64]> {
        self.moving.as_ref().map(|moving| &moving.mass[..])
    }

    /// Volumes of points that change neighbours, m³.
    pub(super) fn current_volumes(&self) -> Option<&[f64]> {
        self.moving.as_ref().map(|moving| &moving.volume[..])
    }

    /// Gives points that change neighbours the mass of their reference volumes (m³) at these densities (kg/m³).
    pub(super) fn weigh(&mut self, density: &[f64], reference_volume: &[f64]) {
        if let Some(moving) = &mut self.moving {
            let points = density.iter().zip(reference_volume);
            moving.mass = points.map(|(rho, v)| rho * v).collect();
        }
    }

    /// Sets the configuration of `body` to where displacement and density (kg/m³) say that the points are, and takes the family
    /// and operators of the new positions.
    pub(super) fn set_configuration(
        &mut self,
        world: &World,
        body: BodyIndex,
        density: &[f64],
    ) -> Result<(), PddoError> {
        let Some(moving) = &mut self.moving else {
            return Ok(());
        };
        let reference = &world.body(body).points.position;
        let displacement = world.read::<Vector3<f64>>(self.displacement.into());
        moving.position.clear();
        let positions = reference.iter().zip(&*displacement).map(|(x, u)| x + u);
        moving.position.extend(positions);
        moving.volume.clear();
        let volumes = moving.mass.iter().zip(density).map(|(m, rho)| m / rho);
        moving.volume.extend(volumes);
        world.set_configuration(&moving.mover, &moving.position, &moving.volume);
        let followed = FollowedFamily {
            positions: &moving.position,
            take: &|| world.family(moving.family),
        };
        self.form.follow(followed)
    }

    pub(super) fn stability_now(&self, initial: Stability) -> Option<Stability> {
        let moving = self.moving.as_ref()?;
        let points = moving.mass.len();
        let now = LargestSums::of(self.rates().family(), points, self.walls());
        Some(initial.scaled(moving.initial_sums, now))
    }

    /// Scales the densities of a fluid in a closed container so that its points fill it.
    pub(super) fn fill_container(
        &self,
        medium: &Medium,
        density: &mut [f64],
        pressure: &mut [f64],
    ) {
        let Some(moving) = &self.moving else {
            return;
        };
        let Some(container) = moving.container else {
            return;
        };
        let filled = sum_of([&moving.mass, density], |[mass, density]| mass / density);
        let factor = filled / container;
        for (i, (rho, p)) in density.iter_mut().zip(pressure).enumerate() {
            medium.change_density(i, *rho * factor, rho, p);
        }
    }

    /// Adds the impulses that other bodies gave to points that move to their velocities (m/s).
    pub(super) fn take_up_impulses(
        &self,
        world: &World,
        body: BodyIndex,
        velocity: &mut [Vector3<f64>],
    ) {
        let Some((moving, impulse)) = self.moving.as_ref().and_then(|m| Some((m, m.impulse?)))
        else {
            return;
        };
        let reference_volume = &world.body(body).points.volume;
        let impulse = world.read(impulse);
        let points = velocity.iter_mut().zip(&*impulse);
        let points = points.zip(reference_volume.iter().zip(&moving.mass));
        points.for_each(|((v, j), (volume, mass))| *v += j * (volume / mass));
    }

    /// Momentum that other bodies gave to the points by impulses, and its moment about the origin (N s, N m s).
    pub(super) fn received(&self, world: &World, body: BodyIndex) -> [Vector3<f64>; 2] {
        let mut given = [Vector3::zeros(); 2];
        if let Some(impulse) = self.moving.as_ref().and_then(|moving| moving.impulse) {
            let volume = &world.body(body).points.volume;
            let now = world.configuration(body);
            for ((j, volume), x) in world.read(impulse).iter().zip(volume).zip(now.positions()) {
                given[0] += *volume * j;
                given[1] += x.cross(&(*volume * j));
            }
        }
        given
    }

    pub(super) fn save(&self) -> SavedLagrangian {
        SavedLagrangian {
            mass: self.own_masses().map_or_else(Vec::new, <[f64]>::to_vec),
            walls: self.walls().map_or_else(Vec::new, Walls::motions),
        }
    }

    pub(super) fn load(&mut self, saved: SavedLagrangian) -> Result<(), erased_serde::Error> {
        if let Some(moving) = &mut self.moving {
            check_length("masses", saved.mass.len(), moving.mass.len())?;
            moving.mass = saved.mass;
        }
        if let Some(walls) = self.walls_mut() {
            walls.set_motions(saved.walls);
        }
        Ok(())
    }
}
