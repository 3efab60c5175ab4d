//! Bodies that are walls for points that carry their mass: their points as points of the fluid, and collisions with them
//! ([`super::collision`]).

use nalgebra::Vector3;
use perimelt_core::family::ForeignBond;
use perimelt_core::world::BodyIndex;
use perimelt_core::{BondKernel, SlotField, World};

use super::collision::{CollisionWall, FluidPoints};
use super::pair_laws::SurveyInputs;
use crate::fluid::treatments::Crowding;
use crate::fluid::walls::{WallBody, Walls, places};

/// Fields of the fluid by slot, and what weighs on it.
pub(crate) struct FluidAtWall<'a, S: Fn(usize) -> usize + Sync, F: Fn(usize) -> Vector3<f64> + Sync>
{
    /// Slot of a point.
    pub slot_of: S,
    /// Components of the velocity, m/s.
    pub velocity: &'a [SlotField],
    /// kg/m³.
    pub density: &'a [f64],
    /// Pa s.
    pub viscosity: &'a [f64],
    /// Gradient of the density at rest, kg/m⁴, by point.
    pub slope: F,
    /// `a` of a complete family.
    pub moment: f64,
}

impl Walls {
    /// Lets fluid points that would penetrate walls collide with them, before they are displaced.
    pub(crate) fn collide(&mut self, world: &World, body: BodyIndex, mut fluid: FluidPoints<'_>) {
        if self.is_empty() {
            return;
        }
        let own = world.configuration(body);
        let others: Vec<_> = (self.bodies.iter())
            .map(|wall| world.configuration(wall.wall.other))
            .collect();
        let walls = self.bodies.iter().zip(&others);
        let interfaces: Vec<_> = walls
            .map(|(wall, other)| wall.interface(world, places(other)))
            .collect();
        let collide = |(number, wall): (usize, &WallBody)| {
            let seen = CollisionWall {
                interfaces: &interfaces,
                number,
                spacing: world.body(wall.wall.other).finest_spacing(),
                mass: wall.masses_of_collisions(world),
            };
            wall.collide(world, own.positions(), &seen, &mut fluid)
        };
        let found: Vec<_> = self.bodies.iter().enumerate().map(collide).collect();
        for (wall, collisions) in self.bodies.iter_mut().zip(found) {
            wall.force -= collisions[0] / fluid.dt;
            wall.collisions = collisions;
        }
    }

    /// Finds velocity, density, viscosity and compression of the ghosts.
    pub(crate) fn set_velocity<S, F>(&mut self, fluid: &FluidAtWall<'_, S, F>)
    where
        S: Fn(usize) -> usize + Sync,
        F: Fn(usize) -> Vector3<f64> + Sync,
    {
        self.bodies.iter_mut().for_each(|w| w.set_velocity(fluid));
    }

    /// Adds the bonds to ghosts to the sums of a kernel of the velocity, one row of `O` for each point; `forces`: the
    /// sums that are a force of viscosity, or its heat, which a wall with slip does not have.
    pub(crate) fn add_velocity<const D: usize, const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        own: impl Fn(usize) -> [f64; I] + Sync,
        forces: std::ops::Range<usize>,
        sums: &mut [[f64; O]],
    ) {
        let mut found = Vec::new();
        for wall in &self.bodies {
            wall.bonds.sum_by_owner(
                |n| wall.velocity_part::<D, I, O>(n, kernel, &own, &forces),
                &mut found,
            );
            wall.bonds.add_to_owners(&found, sums);
        }
    }

    /// Adds the points of the walls to the sums of `kernel` over neighbours that count one each. A wall point counts as
    /// its volume in those of a fluid point, so that a finer solid does not repel more.
    pub(crate) fn add_crowding(&self, kernel: &Crowding, sums: &mut [[f64; 6]]) {
        let mut found = Vec::new();
        for wall in &self.bodies {
            let part = |n: usize| {
                let bond = wall.bonds.bond(n).bond;
                let [counted @ .., weight]: [f64; 6] = kernel.bond(bond, [], []);
                let volumes = match bond.dual > 0.0 {
                    true => bond.weight / bond.dual,
                    false => 0.0,
                };
                let [length, number, x, y, z] = counted.map(|value| volumes * value);
                [length, number, x, y, z, weight]
            };
            wall.bonds.sum_by_owner(part, &mut found);
            wall.bonds.add_to_owners(&found, sums);
        }
    }

    /// Passes each fluid point at a wall, with the compression of ghosts that it takes up (1/s), to `receive`.
    pub(crate) fn for_each_compression(&mut self, mut receive: impl FnMut(usize, f64)) {
        for wall in &mut self.bodies {
            let (bonds, points) = (&wall.bonds, &wall.points);
            let part = |n: usize| {
                let ForeignBond { bond, ghost, .. } = bonds.bond(n);
                [bond.weight * points[ghost.point].compression]
            };
            bonds.sum_by_owner(part, &mut wall.extra);
            for (&owner, [extra]) in bonds.owners().iter().zip(&wall.extra) {
                receive(owner as usize, *extra);
            }
        }
    }
}

impl WallBody {
    pub(crate) fn set_velocity<S, F>(&mut self, fluid: &FluidAtWall<'_, S, F>)
    where
        S: Fn(usize) -> usize + Sync,
        F: Fn(usize) -> Vector3<f64> + Sync,
    {
        let (bonds, points) = (&self.bonds, &self.points);
        let part = |n: usize| {
            let ForeignBond { bond, point, ghost } = bonds.bond(n);
            let (slot, xi) = ((fluid.slot_of)(point), Vector3::from(bond.xi));
            let mut v = Vector3::zeros();
            for (a, component) in fluid.velocity.iter().enumerate() {
                v[a] = component[slot];
            }
            let wall = ghost.reflect(points[ghost.point].velocity);
            let seen = ghost.reflect(v);
            let density = fluid.density[slot] + (fluid.slope)(point).dot(&xi);
            let divergence = (v - wall).dot(&-xi);
            let values = [
                1.0,
                seen.x,
                seen.y,
                seen.z,
                density,
                fluid.viscosity[slot],
                divergence,
            ];
            values.map(|value| bond.dual * value)
        };
        bonds.sum_by_foreign(part, &mut self.means);
        let slip = self.wall.slip;
        for (point, &[sum, x, y, z, density, viscosity, divergence]) in
            self.points.iter_mut().zip(&self.means)
        {
            if sum <= 0.0 {
                continue;
            }
            let mean = Vector3::new(x, y, z) / sum;
            point.held = if slip {
                point.velocity
            } else {
                2.0 * point.velocity - mean
            };
            point.density = density / sum;
            point.viscosity = viscosity / sum;
            point.compression = divergence / (fluid.moment * sum);
        }
    }

    /// What a bond adds to the sums of a kernel of the velocity of its fluid point.
    pub(crate) fn velocity_part<const D: usize, const I: usize, const O: usize>(
        &self,
        number: usize,
        kernel: &impl BondKernel<I, O>,
        own: &impl Fn(usize) -> [f64; I],
        forces: &std::ops::Range<usize>,
    ) -> [f64; O] {
        let ForeignBond { bond, point, ghost } = self.bonds.bond(number);
        let there = &self.points[ghost.point];
        let [velocity, held] = [there.velocity, there.held].map(|v| ghost.reflect(v));
        let other = std::array::from_fn(|i| match i {
            _ if i < SurveyInputs::<D>::HELD => velocity[i],
            _ if i < SurveyInputs::<D>::DENSITY => held[i - SurveyInputs::<D>::HELD],
            _ if i < SurveyInputs::<D>::VISCOSITY => there.density,
            _ => there.viscosity,
        });
        let mut part = kernel.bond(bond, own(point), other);
        if self.wall.slip {
            part[forces.clone()].fill(0.0);
        }
        part
    }

    /// Masses of the points of the wall, kg; `None` where they move as one.
    fn masses_of_collisions(&self, world: &World) -> Option<&[f64]> {
        let moves_as_one = world.is_rigid(self.wall.other) || self.mass.is_empty();
        (!moves_as_one).then_some(&self.mass[..])
    }

    /// Lets points of the fluid collide with the wall; returns the momentum (N s) and angular momentum (N m s) that they get.
    fn collide(
        &self,
        world: &World,
        places_of_fluid: &[Vector3<f64>],
        wall: &CollisionWall<'_>,
        fluid: &mut FluidPoints<'_>,
    ) -> [Vector3<f64>; 2] {
        let solid = world.body(self.wall.other);
        let mut velocity: Vec<_> = self.points.iter().map(|p| p.velocity).collect();
        let mut impulses = Vec::new();
        let mut collisions = [Vector3::zeros(); 2];
        wall.collide(fluid, &mut velocity, &mut impulses, |hit| {
            collisions[0] += hit.impulse;
            collisions[1] += places_of_fluid[hit.point].cross(&hit.impulse);
        });
        if !impulses.is_empty() {
            let mut sink = world.write(self.impulse);
            for (point, taken) in impulses {
                sink[point] += taken / solid.points.volume[point];
            }
        }
        collisions
    }
}
