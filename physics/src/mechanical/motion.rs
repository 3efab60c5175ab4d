//! Motion by velocity Verlet, with an account of the impulses that the body takes up.

use nalgebra::Vector3;
use perimelt_core::body::Points;
use perimelt_core::family::LayerRule;
use perimelt_core::solver::{Dynamics, HalfKick, Motion, SolverError};
use perimelt_core::{Step, Work, World};
use rayon::prelude::*;

use super::fields::Hold;
use super::momentum::{Momentum, part, place};
use super::solid::Solid;
use super::step::Run;

impl Run {
    /// Moves the body over `step`. Held components keep the displacement that was loaded.
    pub(super) fn move_points(&mut self, world: &World, step: Step) -> Result<Work, SolverError> {
        self.take_up_impulses(world);
        let body_force = self.fields.body_force.map(|b| world.read(b));
        let body_force = body_force.as_deref();
        let mut displacement = world.write(self.fields.displacement);
        let velocity = self.fields.velocity.expect("owned by the explicit solver");
        let mut velocity = world.write(velocity);
        let motion = Motion {
            displacement: bytemuck::cast_slice_mut::<Vector3<f64>, f64>(&mut displacement),
            velocity: bytemuck::cast_slice_mut(&mut velocity),
            inverse_mass: &self.free_inverse_density,
        };
        let dynamics = SolidDynamics {
            rules: &world.layer_rules(self.layers),
            points: &world.body(self.body).points,
            body_force: body_force.map_or(&[], |b| bytemuck::cast_slice(b)),
            density: &self.density,
            inverse_density: &self.free_inverse_density,
            has_held_points: self.fields.hold.is_some(),
            has_layers: self.solid.family().has_layers(),
            solid: &mut *self.solid,
            loaded: &mut self.state.loaded_body_force,
            given: &mut self.state.given,
        };
        let verlet = &mut self.state.verlet;
        verlet.step(step.start, step.size, motion, dynamics)?;
        Ok(Work::of_stages(1))
    }

    /// Adds the momentum of the sink `impulse` to the velocities of free components.
    fn take_up_impulses(&mut self, world: &World) {
        let (Some(impulse), Some(velocity)) = (self.fields.impulse, self.fields.velocity) else {
            return;
        };
        let impulse = &*world.read(impulse);
        let displacement = &*world.read::<Vector3<f64>>(self.fields.displacement.into());
        let (points, inverse) = (
            &world.body(self.body).points,
            &self.free_inverse_density[..],
        );
        self.state.given += Momentum::sum(points.len(), |i| {
            let x = place(&points.position[i], displacement[i].as_slice());
            let free = |axis: usize| inverse[3 * i + axis] != 0.0;
            let impulse_on = |axis: usize| match free(axis) {
                true => points.volume[i] * impulse[i][axis],
                false => 0.0,
            };
            part(x, std::array::from_fn(impulse_on))
        });
        let mut velocity = world.write(velocity);
        let velocity: &mut [f64] = bytemuck::cast_slice_mut(&mut velocity);
        let impulse: &[f64] = bytemuck::cast_slice(impulse);
        let components = velocity.par_iter_mut().zip(impulse).zip(inverse);
        let components = components.with_min_len(4096);
        components.for_each(|((v, j), inverse)| *v += j * inverse);
    }

    /// Stops the held components. Called before their displacement is set.
    pub(super) fn stop_held_points(&mut self, world: &World, hold: Hold, duration: f64) {
        let Some(velocity) = self.fields.velocity else {
            return;
        };
        let mut velocity = world.write(velocity);
        let given = self.impulse_of_holding(world, hold, &velocity, duration);
        self.state.given += given;
        let constraint = world.read(hold.constraint);
        let inverses = self.free_inverse_density.par_chunks_mut(3);
        let rows = inverses.zip(velocity.par_iter_mut()).zip(&self.density);
        let rows = rows.zip(constraint.par_iter()).with_min_len(4096);
        rows.for_each(|(((inverse, velocity), density), constraint)| {
            for axis in 0..3 {
                let free = constraint[axis] == 0.0;
                inverse[axis] = if free { 1.0 / density } else { 0.0 };
                velocity[axis] = if free { velocity[axis] } else { 0.0 };
            }
        });
    }

    /// Change of momentum and of its moment when the held components stop and their displacement jumps to the held
    /// one, in a step of `duration` (s).
    fn impulse_of_holding(
        &self,
        world: &World,
        hold: Hold,
        velocity: &[Vector3<f64>],
        duration: f64,
    ) -> Momentum {
        let constraint = &*world.read(hold.constraint);
        let held = &*world.read(hold.displacement);
        let displacement = &*world.read::<Vector3<f64>>(self.fields.displacement.into());
        let (points, density) = (&world.body(self.body).points, &self.density);
        // The forces of the first half kick were evaluated before the jump, and their moments cancel there.
        let has_layers = self.solid.family().has_layers();
        let (force, loaded) = (self.state.verlet.force(), &self.state.loaded_body_force);
        let bond_force = |component: usize| match force.get(component) {
            Some(force) if !has_layers => force - loaded.get(component).unwrap_or(&0.0),
            _ => 0.0,
        };
        Momentum::sum(points.len(), |i| {
            let (c, u, v) = (&constraint[i], &displacement[i], &velocity[i]);
            if c.iter().all(|c| *c <= 0.0) {
                return [0.0; 12];
            }
            let (volume, is_held) = (points.volume[i], |axis: usize| c[axis] > 0.0);
            let momentum = |axis: usize| volume * density[i] * v[axis];
            let stop = |axis: usize| if is_held(axis) { -momentum(axis) } else { 0.0 };
            let stopped = part(
                place(&points.position[i], u.as_slice()),
                std::array::from_fn(stop),
            );
            let jump: [f64; 3] = std::array::from_fn(|axis| match is_held(axis) {
                true => held[i][axis] / c[axis] - u[axis],
                false => 0.0,
            });
            let half_kick = |axis: usize| 0.5 * duration * volume * bond_force(3 * i + axis);
            let remaining = |axis: usize| momentum(axis) + stop(axis) + half_kick(axis);
            let moved = part(jump, std::array::from_fn(remaining));
            // the jump changes only moments
            std::array::from_fn(|n| match n {
                0..3 | 6..9 => stopped[n],
                _ => stopped[n] + moved[n],
            })
        })
    }
}

/// The forces on a solid, and the sum of the impulses that its surroundings give to it.
struct SolidDynamics<'a> {
    solid: &'a mut dyn Solid,
    rules: &'a [LayerRule],
    points: &'a Points,
    /// N/m³, by component; empty if there is none.
    body_force: &'a [f64],
    density: &'a [f64],
    /// m³/kg, by component; zero where it is held.
    inverse_density: &'a [f64],
    has_held_points: bool,
    has_layers: bool,
    /// The body force in the last force.
    loaded: &'a mut Vec<f64>,
    given: &'a mut Momentum,
}

impl Dynamics for SolidDynamics<'_> {
    fn force(&mut self, _: f64, u: &[f64], force: &mut [f64]) -> Result<(), SolverError> {
        self.solid.set_displacement(u, self.rules);
        self.solid.force(force);
        let forces = force.par_iter_mut().zip(self.body_force);
        forces.with_min_len(4096).for_each(|(f, b)| *f += b);
        self.loaded.clear();
        self.loaded.extend_from_slice(self.body_force);
        Ok(())
    }

    /// Forces of bonds between points cancel; what is left is given by the surroundings: body forces, damping, the
    /// reaction of held components to their bonds, and the forces of bonds to layers.
    fn before_half_kick(&mut self, kick: &HalfKick<'_>) {
        let is_damped = kick.friction != 0.0;
        let has_forces = !self.loaded.is_empty() || self.has_layers || is_damped;
        if !has_forces && !self.has_held_points {
            return;
        }
        let (points, rule, has_layers) = (self.points, kick.rule(), self.has_layers);
        let (density, inverse_density) = (self.density, self.inverse_density);
        let loaded = &self.loaded[..];
        let impulse = |point: usize, component: usize| {
            let (force, velocity) = (kick.force[component], kick.velocity[component]);
            let body_force = loaded.get(component).copied().unwrap_or(0.0);
            let inverse = inverse_density[component];
            let is_free = inverse != 0.0;
            let external = match (has_layers, is_free) {
                (false, true) => body_force,
                (false, false) => body_force - force,
                (true, true) => force,
                (true, false) => 0.0,
            };
            let friction = match is_damped && is_free {
                true => {
                    let after = rule(velocity, force, inverse);
                    kick.friction * density[point] * (velocity + after)
                }
                false => 0.0,
            };
            points.volume[point] * (kick.duration * external - friction)
        };
        *self.given += Momentum::sum(points.len(), |i| {
            let components = 3 * i..3 * i + 3;
            let is_held = || inverse_density[components.clone()].contains(&0.0);
            if !has_forces && !is_held() {
                return [0.0; 12];
            }
            let x = place(&points.position[i], &kick.displacement[components.clone()]);
            part(x, std::array::from_fn(|axis| impulse(i, 3 * i + axis)))
        });
    }
}
