//! Motion by velocity Verlet, with an account of the impulses that the body takes up.

use std::borrow::Cow;

use nalgebra::Vector3;
use perimelt_core::body::Points;
use perimelt_core::family::LayerRule;
use perimelt_core::solver::reduce::sum_points;
use perimelt_core::solver::{Dynamics, HalfKick, SolverError, VerletState};
use perimelt_core::{Step, Work, World};
use rayon::prelude::*;

use super::energy::work_of;
use super::fields::Hold;
use super::momentum::{Balanced, Momentum, by_axis, place};
use super::solid::{Solid, Wanted};
use super::step::MechanicalRun;

impl MechanicalRun {
    /// Moves the body over `step`. Held components keep the displacement that was loaded.
    pub(super) fn move_points(&mut self, world: &World, step: Step) -> Result<Work, SolverError> {
        self.take_up_impulses(world);
        let body_force = self.fields.body_force.map(|b| world.read(b));
        let body_force = self.on_present_points(body_force.as_deref());
        let mut displacement = world.write(self.fields.displacement);
        let velocity = self.fields.velocity.expect("owned by the explicit solver");
        let mut velocity = world.write(velocity);
        let volume = &world.body(self.body).points.volume;
        let loaded = &self.state.loaded_body_force;
        let before = bytemuck::cast_slice(&displacement);
        self.state.watch.work += half_work_of_change(volume, [loaded, &*body_force], before);
        let motion = VerletState {
            displacement: bytemuck::cast_slice_mut::<Vector3<f64>, f64>(&mut displacement),
            velocity: bytemuck::cast_slice_mut(&mut velocity),
            inverse_mass: &self.free_inverse_density,
        };
        let dynamics = SolidDynamics {
            rules: &world.layer_rules(self.layers),
            points: &world.body(self.body).points,
            body_force: &body_force,
            density: &self.density,
            inverse_density: &self.free_inverse_density,
            balanced: self.balanced,
            has_held_points: self.fields.hold.is_some(),
            has_layers: self.solid.base().family().has_layers(),
            solid: &mut *self.solid,
            loaded: &mut self.state.loaded_body_force,
            external_force: &mut self.state.external_force,
            given: &mut self.state.given,
            work: &mut self.state.watch.work,
        };
        let verlet = &mut self.state.verlet;
        verlet.step(step.start, step.size, motion, dynamics)?;
        if std::mem::take(&mut self.scratch.has_moved) {
            self.add_half_work_of_held(world);
        }
        Ok(Work::of_stages(1))
    }

    /// A body force (N/m³) by component, zero at points without material; empty if there is none.
    fn on_present_points<'a>(&self, body_force: Option<&'a [Vector3<f64>]>) -> Cow<'a, [f64]> {
        let body_force: &[f64] = body_force.map_or(&[], |b| bytemuck::cast_slice(b));
        let present = &self.state.present;
        if present.iter().all(|p| *p) {
            return Cow::Borrowed(body_force);
        }
        let components = body_force.iter().enumerate();
        let on_present = |(n, b): (usize, &f64)| if present[n / 3] { *b } else { 0.0 };
        components.map(on_present).collect()
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
        self.state.given += Momentum::sum(self.balanced, points.len(), |i| {
            let x = place(&points.position[i], displacement[i].as_slice());
            let free = |axis: usize| inverse[3 * i + axis] != 0.0;
            let impulse_on = |axis: usize| match free(axis) {
                true => points.volume[i] * impulse[i][axis],
                false => 0.0,
            };
            [x, by_axis(impulse_on)]
        });
        let mut velocity = world.write(velocity);
        let before = &velocity[..];
        self.state.watch.work += sum_points(points.len(), |i| {
            let of_axis = |axis: usize| {
                let (j, v) = (impulse[i][axis], before[i][axis]);
                j * (v + 0.5 * j * inverse[3 * i + axis])
            };
            let is_free = |axis: &usize| inverse[3 * i + axis] != 0.0;
            [points.volume[i] * (0..3).filter(is_free).map(of_axis).sum::<f64>()]
        })[0];
        let velocity: &mut [f64] = bytemuck::cast_slice_mut(&mut velocity);
        let impulse: &[f64] = bytemuck::cast_slice(impulse);
        let components = velocity.par_iter_mut().zip(impulse).zip(inverse);
        let components = components.with_min_len(4096);
        components.for_each(|((v, j), inverse)| *v += j * inverse);
    }

    /// Stops components that are held anew or move, before they take the displacement at which they are held. Whether
    /// there are any.
    pub(super) fn stop_held_points(&mut self, world: &World, hold: Hold, duration: f64) -> bool {
        let Some(velocity) = self.fields.velocity else {
            return true;
        };
        let mut velocity = world.write(velocity);
        if !self.holding_changes(world, hold, &velocity) {
            return false;
        }
        self.state.external_force = None;
        let given = self.impulse_of_holding(world, hold, &velocity, duration);
        self.state.given += given;
        let constraint = world.read(hold.constraint);
        let inverses = self.free_inverse_density.par_chunks_mut(3);
        let rows = inverses.zip(velocity.par_iter_mut()).zip(&self.density);
        let rows = rows.zip(constraint.par_iter()).enumerate();
        let present = &self.state.present;
        let rows = rows.with_min_len(4096);
        rows.for_each(|(point, (((inverse, velocity), density), constraint))| {
            for axis in 0..3 {
                let free = constraint[axis] == 0.0 && *present.get(point).unwrap_or(&true);
                inverse[axis] = if free { 1.0 / density } else { 0.0 };
                velocity[axis] = if free { velocity[axis] } else { 0.0 };
            }
        });
        true
    }

    /// Whether components are held or let go that were not, or held ones move.
    fn holding_changes(&self, world: &World, hold: Hold, velocity: &[Vector3<f64>]) -> bool {
        let (constraint, held) = (world.read(hold.constraint), world.read(hold.displacement));
        let displacement = world.read::<Vector3<f64>>(self.fields.displacement.into());
        let displacement: &[f64] = bytemuck::cast_slice(&displacement);
        let (constraint, held): (&[f64], &[f64]) = (
            bytemuck::cast_slice(&constraint),
            bytemuck::cast_slice(&held),
        );
        let velocity: &[f64] = bytemuck::cast_slice(velocity);
        let (inverse, present) = (&self.free_inverse_density[..], &self.state.present[..]);
        let changes = |n: usize| {
            if !present.get(n / 3).unwrap_or(&true) {
                return false;
            }
            let is_held = constraint[n] > 0.0;
            let moves = || velocity[n] != 0.0 || held[n] / constraint[n] != displacement[n];
            is_held != (inverse[n] == 0.0) || (is_held && moves())
        };
        let components = (0..inverse.len()).into_par_iter();
        components.with_min_len(4096).any(changes)
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
        let has_layers = self.solid.base().family().has_layers();
        let (force, loaded) = (self.state.verlet.force(), &self.state.loaded_body_force);
        let bond_force = |component: usize| match force.get(component) {
            Some(force) if !has_layers => force - loaded.get(component).unwrap_or(&0.0),
            _ => 0.0,
        };
        let present = &self.state.present[..];
        let is_present = |i: usize| *present.get(i).unwrap_or(&true);
        let is_held = |i: usize, axis: usize| constraint[i][axis] > 0.0 && is_present(i);
        let jump = |i: usize, axis: usize| match is_held(i, axis) {
            true => held[i][axis] / constraint[i][axis] - displacement[i][axis],
            false => 0.0,
        };
        let stop = |i: usize, axis: usize| match is_held(i, axis) {
            true => -points.volume[i] * density[i] * velocity[i][axis],
            false => 0.0,
        };
        let mut given = Momentum::sum(self.balanced, points.len(), |i| {
            let x = place(&points.position[i], displacement[i].as_slice());
            [x, by_axis(|axis| stop(i, axis))]
        });
        if self.balanced.angular {
            let moved = Momentum::sum(self.balanced, points.len(), |i| {
                let half_kick = |axis: usize| 0.5 * duration * bond_force(3 * i + axis);
                let remaining = |axis: usize| {
                    let momentum = density[i] * velocity[i][axis] + half_kick(axis);
                    points.volume[i] * momentum + stop(i, axis)
                };
                let jump = by_axis(|axis| jump(i, axis));
                [jump, by_axis(remaining)]
            });
            given += moved.only_angular();
        }
        given
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
    balanced: Balanced,
    has_held_points: bool,
    has_layers: bool,
    /// The body force in the last force.
    loaded: &'a mut Vec<f64>,
    /// Its sum at the displacement and the force of the moment, if it is known.
    external_force: &'a mut Option<Momentum>,
    given: &'a mut Momentum,
    /// Work of loads, J.
    work: &'a mut f64,
}

/// Half of the work of a body force that changes (N/m³, before and now), `-1/2 sum V (b_1 - b_0) . u`, J: that at one end
/// of the step. Zero if there was none before.
fn half_work_of_change(volume: &[f64], [before, now]: [&[f64]; 2], displacement: &[f64]) -> f64 {
    if before.len() != now.len() || before == now {
        return 0.0;
    }
    0.5 * (work_of(volume, before, displacement) - work_of(volume, now, displacement))
}

impl Dynamics for SolidDynamics<'_> {
    fn force(&mut self, _: f64, u: &[f64], force: &mut [f64]) -> Result<(), SolverError> {
        self.solid.set_displacement(u, self.rules);
        self.solid.evaluate(Wanted::force(force));
        let forces = force.par_iter_mut().zip(self.body_force);
        forces.with_min_len(4096).for_each(|(f, b)| *f += b);
        *self.external_force = None;
        *self.work += half_work_of_change(&self.points.volume, [self.loaded, self.body_force], u);
        self.loaded.clear();
        self.loaded.extend_from_slice(self.body_force);
        Ok(())
    }

    fn before_half_kick(&mut self, kick: &HalfKick<'_>) {
        let external = match self.external_force.take() {
            Some(known) => known,
            None => self.external_force(kick),
        };
        *self.given += external.times(kick.duration);
        *self.external_force = Some(external);
        if kick.friction != 0.0 {
            *self.given += self.impulse_of_friction(kick);
        }
    }
}

impl SolidDynamics<'_> {
    /// Sum of the forces of the surroundings (N) and of their moments. Forces of bonds between points cancel; what is
    /// left are body forces, the reaction of held components to their bonds, and the forces of bonds to layers.
    fn external_force(&self, kick: &HalfKick<'_>) -> Momentum {
        let has_loads = !self.loaded.is_empty() || self.has_layers;
        if !has_loads && !self.has_held_points {
            return Momentum::default();
        }
        let (points, has_layers) = (self.points, self.has_layers);
        let (inverse_density, loaded) = (self.inverse_density, &self.loaded[..]);
        let external = |component: usize| {
            let force = kick.force[component];
            let is_free = inverse_density[component] != 0.0;
            match (has_layers, is_free) {
                (true, true) => force,
                (true, false) => 0.0,
                (false, true) => loaded.get(component).copied().unwrap_or(0.0),
                (false, false) => loaded.get(component).copied().unwrap_or(0.0) - force,
            }
        };
        Momentum::sum(self.balanced, points.len(), |i| {
            let x = place(&points.position[i], &kick.displacement[3 * i..3 * i + 3]);
            [x, by_axis(|axis| points.volume[i] * external(3 * i + axis))]
        })
    }

    /// What damping takes.
    fn impulse_of_friction(&self, kick: &HalfKick<'_>) -> Momentum {
        let (points, rule) = (self.points, kick.rule());
        let (density, inverse_density) = (self.density, self.inverse_density);
        let friction = |point: usize, component: usize| {
            let inverse = inverse_density[component];
            if inverse == 0.0 {
                return 0.0;
            }
            let velocity = kick.velocity[component];
            let after = rule(velocity, kick.force[component], inverse);
            -points.volume[point] * kick.friction * density[point] * (velocity + after)
        };
        Momentum::sum(self.balanced, points.len(), |i| {
            let x = place(&points.position[i], &kick.displacement[3 * i..3 * i + 3]);
            [x, by_axis(|axis| friction(i, 3 * i + axis))]
        })
    }
}
